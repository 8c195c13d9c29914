//! What can be found in one picture: corners, straight edges, and masks that say where not to look.

mod corners;
mod mask;
mod segments;

pub use corners::{Corner, CornerDetector, CornerOptions};
pub use mask::{Mask, MaskError};
pub use segments::{Segment, SegmentOptions, segments};
