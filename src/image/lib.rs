//! Frames and planes: stride-aware pixels in their native depth and color, YUV kept as YUV.

pub mod canvas;
mod color;
#[cfg(feature = "files")]
mod exr;
#[cfg(feature = "detection")]
pub mod feature;
mod format;
mod frame;
pub mod grid;
mod luma;
mod plane;
mod pyramid;
pub mod render;
mod rgb;
pub mod simd;
#[cfg(feature = "files")]
pub mod still;
pub mod warp;

#[cfg(feature = "files")]
pub use self::exr::write_exr;
pub use color::ColorDescription;
pub use format::{Layout, PixelFormat};
pub use frame::{Frame, FrameBuffer, OwnedBuffer, PlaneRows};
pub use luma::{analysis_luma, analysis_size};
pub use plane::{Plane, PlaneMut, PlaneRef, Raster};
pub use pyramid::{PADDING, PaddedPlane, Pyramid};
pub use rgb::rgb_frame;
