//! What can be found in one picture: corners, straight edges, masks that say where not to look, faces, and what matters.

mod corners;
mod faces;
mod gradient;
mod importance;
mod lab_picture;
mod mask;
mod saliency;
mod segments;

pub use corners::{Corner, CornerDetector, CornerOptions};
pub use faces::{Face, FaceDetector, FaceOptions};
pub use gradient::gradient;
pub use importance::{Importance, ImportanceError, ImportanceOptions};
pub use lab_picture::LabPicture;
pub use mask::{Mask, MaskError};
pub use saliency::saliency;
pub use segments::{Segment, SegmentOptions, segments};
