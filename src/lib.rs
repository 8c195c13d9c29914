//! **plumbline**: hold shaky video steady, make straight lines straight, bend shapes the way they would bend.
//!
//! Everything here chooses vertex positions `x` that minimize a sparse energy under point constraints,
//!
//! ```text
//! E(x) = Σᵣ wᵣ ‖Σⱼ aᵣⱼ xⱼ − bᵣ‖²      s.t.  x_f = c_f  for f in the fixed set,
//! ```
//!
//! which on a grid laid over an image is a *warp* and on a surface a *deformation*. Each part is a crate of its own;
//! `docs/ARCHITECTURE.md` holds the table of what each may use, and a test reads it from there.

#[cfg(feature = "cli")]
pub use plumbline_app as app;
pub use plumbline_camera as camera;
pub use plumbline_image as image;
#[cfg(feature = "media")]
pub use plumbline_media as media;
pub use plumbline_num as num;
pub use plumbline_photo as photo;
pub use plumbline_shape as shape;
pub use plumbline_video as video;
