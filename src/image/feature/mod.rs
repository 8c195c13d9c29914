//! Features of one picture: corners, line segments, masks, faces, saliency and importance.

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
