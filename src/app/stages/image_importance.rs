//! `image.importance`: the importance of each position of a picture.

use std::sync::Arc;

use super::photo::painted_mask;
use super::prelude::*;
use crate::pipeline::paths::to_path;
use plumbline_image::feature::{Face, Importance, ImportanceOptions};
use plumbline_image::still::Photo;

/// Settings of `image.importance`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ImportanceSettings {
    /// A picture of the same size, painted by hand: white matters, black does not, mid-gray leaves what was found
    #[schemars(extend("format" = "path"))]
    pub mask: Option<String>,
}

impl Stage for ImportanceSettings {
    const KIND: &'static str = "image.importance";
    const ALIASES: &'static [&'static str] = &["importance"];
    const SUMMARY: &'static str = "estimates the importance of each position of a picture";
    const INPUTS: &'static [Port] = &[
        Port::one("image", PortType::Image, "the picture"),
        Port::optional("faces", PortType::Faces, "faces, which matter most"),
    ];
    const OUTPUTS: &'static [Port] =
        &[Port::one("importance", PortType::Importance, "the importance of each position")];
    type Input = (Arc<Photo>, Option<Arc<[Face]>>);
    type Output = (Arc<Importance>,);

    fn reads(&self) -> Vec<&str> {
        self.mask.as_deref().into_iter().collect()
    }

    fn run(&self, (photo, faces): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        let faces = faces.unwrap_or_default();
        let mask = match self.mask.as_deref().map(to_path) {
            Some(path) => Some(painted_mask(&path)?),
            None => None,
        };
        let options = ImportanceOptions::default();
        let judged = Importance::of_frame(&photo.frame, &faces, mask.as_ref(), &options, &context.job.run());
        let importance = judged.map_err(|e| match &self.mask {
            Some(mask) => RunError::Input(format!("{mask}: {e}")),
            None => RunError::Input(e.to_string()),
        })?;
        Ok((Arc::new(importance),))
    }
}
