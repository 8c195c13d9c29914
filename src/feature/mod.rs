//! What can be found in one picture: corners, and masks that say where not to look.

mod corners;
mod mask;

pub use corners::{Corner, CornerDetector, CornerOptions};
pub use mask::{Mask, MaskError};
