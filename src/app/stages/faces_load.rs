//! `faces.load`: reads boxes around faces.

use std::sync::Arc;

use super::prelude::*;
use crate::pipeline::paths::to_path;
use plumbline_image::feature::Face;
use plumbline_image::still::Photo;
use plumbline_photo::marks::FacesFile;

/// Settings of `faces.load`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FacesLoadSettings {
    /// The faces file: JSON with a list of boxes {"x", "y", "w", "h"}
    #[schemars(extend("format" = "path"))]
    pub path: String,
}

impl Stage for FacesLoadSettings {
    const KIND: &'static str = "faces.load";
    const SUMMARY: &'static str = "reads boxes around faces that were marked in a picture";
    const INPUTS: &'static [Port] = &[Port::one("image", PortType::Image, "the picture that the boxes are of")];
    const OUTPUTS: &'static [Port] = &[Port::one("faces", PortType::Faces, "the boxes")];
    const REQUIRED: &'static [&'static str] = &["path"];
    type Input = (Arc<Photo>,);
    type Output = (Arc<[Face]>,);

    fn reads(&self) -> Vec<&str> {
        vec![&self.path]
    }

    fn run(&self, (photo,): Self::Input, _context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        let path = &to_path(&self.path);
        let size = (photo.frame.width as u32, photo.frame.height as u32);
        let file = FacesFile::read(path, size).map_err(|e| RunError::Input(format!("{}: {e}", path.display())))?;
        let faces = file.in_use().map(|f| Face { rect: f.rect, score: f64::INFINITY }).collect();
        Ok((faces,))
    }
}
