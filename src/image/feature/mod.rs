//! Features of one picture: corners, line segments, masks, faces, saliency and importance.

mod corners;
mod edge_curve;
mod edge_trace;
mod error;
mod faces;
mod gradient;
mod importance;
mod lab_picture;
mod mask;
mod saliency;
mod segments;

pub use corners::{Corner, CornerDetector};
pub use edge_curve::{MAX_OFF_CUBIC, SmoothCurve, grown};
pub use edge_trace::{EdgeTracer, TracedEdge, averaged};
pub use error::FeatureError;
pub use faces::{Face, FaceDetector, FaceOptions};
pub use gradient::gradient;
pub use importance::{Importance, ImportanceOptions};
pub use lab_picture::LabPicture;
pub use mask::Mask;
pub use saliency::saliency;
pub use segments::{Segment, segments};
