//! `faces.detect`: finds faces.

use std::sync::Arc;

use super::prelude::*;
use plumbline_image::feature::{Face, FaceDetector, FaceOptions};
use plumbline_image::still::Photo;

/// Settings of `faces.detect`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FacesDetectSettings {
    /// Minimum score of a face, a probability
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_score: f64,
}

impl Default for FacesDetectSettings {
    fn default() -> Self {
        Self { min_score: FaceOptions::default().min_score }
    }
}

impl Stage for FacesDetectSettings {
    const KIND: &'static str = "faces.detect";
    const SUMMARY: &'static str = "finds faces";
    const INPUTS: &'static [Port] = &[Port::one("image", PortType::Image, "the picture")];
    const OUTPUTS: &'static [Port] = &[Port::one("faces", PortType::Faces, "boxes around the faces")];
    type Input = (Arc<Photo>,);
    type Output = (Arc<[Face]>,);

    fn run(&self, (photo,): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        let options = FaceOptions { min_score: self.min_score, ..FaceOptions::default() };
        let faces = FaceDetector::new(options).detect(&photo.frame, &context.job.run())?;
        Ok((faces.into(),))
    }
}
