//! `lines.load`: reads marked lines.

use std::sync::Arc;

use super::prelude::*;
use super::values::LineSet;
use crate::pipeline::paths::to_path;
use plumbline_image::still::Photo;
use plumbline_photo::marks::LinesFile;

/// Settings of `lines.load`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LinesLoadSettings {
    /// The lines file, usually NAME.lines.json beside the picture
    #[schemars(extend("format" = "path"))]
    pub path: String,
    /// A missing file means that no lines are marked, and is no error
    pub optional: bool,
}

impl Stage for LinesLoadSettings {
    const KIND: &'static str = "lines.load";
    const SUMMARY: &'static str = "reads lines that were marked in a picture";
    const INPUTS: &'static [Port] = &[Port::one("image", PortType::Image, "the picture that the lines are of")];
    const OUTPUTS: &'static [Port] = &[Port::one("lines", PortType::Lines, "the lines")];
    const REQUIRED: &'static [&'static str] = &["path"];
    type Input = (Arc<Photo>,);
    type Output = (LineSet,);

    fn reads(&self) -> Vec<&str> {
        vec![&self.path]
    }

    fn run(&self, (photo,): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        let path = &to_path(&self.path);
        if self.optional && !path.exists() {
            return Ok((LineSet::default(),));
        }
        let size = (photo.frame.width as u32, photo.frame.height as u32);
        let file = LinesFile::read(path, size).map_err(|e| RunError::Input(format!("{}: {e}", path.display())))?;
        for note in &file.notes {
            context.warn(format!("{}: {note}", path.display()));
        }
        let lines = file.in_use().cloned().collect();
        Ok((LineSet { lines, ..LineSet::default() },))
    }
}
