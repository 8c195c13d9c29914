//! `lines.save`: writes lines as a file of marked lines.

use std::sync::Arc;

use super::prelude::*;
use super::values::LineSet;
use crate::pipeline::paths::to_path;
use plumbline_image::still::Photo;
use plumbline_photo::marks::LinesFile;

/// Settings of `lines.save`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LinesSaveSettings {
    /// The lines file to write; `"off": true` in it switches a line off
    #[schemars(extend("format" = "path"))]
    pub path: String,
}

impl Stage for LinesSaveSettings {
    const KIND: &'static str = "lines.save";
    const SUMMARY: &'static str =
        "writes lines as a file in which each can be switched off, and which lines.load reads";
    const INPUTS: &'static [Port] = &[
        Port::one("image", PortType::Image, "the picture that the lines are of"),
        Port::one("lines", PortType::Lines, "the lines"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the file")];
    const REQUIRED: &'static [&'static str] = &["path"];
    type Input = (Arc<Photo>, LineSet);
    type Output = (Written,);

    fn writes(&self) -> Vec<String> {
        vec![self.path.clone()]
    }

    fn run(&self, (photo, set): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        let size = (photo.frame.width as u32, photo.frame.height as u32);
        let text = LinesFile::new(size, set.lines).to_json();
        context.write_file(&to_path(&self.path), text)?;
        Ok((Written,))
    }
}
