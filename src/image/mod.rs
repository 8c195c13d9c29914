//! Frames and planes: stride-aware pixels in their native depth and color, YUV kept as YUV.

mod color;
mod format;
mod frame;
mod plane;

pub use color::ColorDescription;
pub use format::{Layout, PixelFormat};
pub use frame::{Frame, FrameBuffer, OwnedBuffer, PlaneRows};
pub use plane::{Plane, PlaneMut, PlaneRef};
