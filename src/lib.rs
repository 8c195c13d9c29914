//! **plumbline**: hold shaky video steady, make straight lines straight, bend shapes the way they would bend.
//!
//! Everything here chooses vertex positions `x` that minimise a sparse energy under point constraints,
//!
//! ```text
//! E(x) = Σᵣ wᵣ ‖Σⱼ aᵣⱼ xⱼ − bᵣ‖²      s.t.  x_f = c_f  for f in the fixed set,
//! ```
//!
//! which on a grid laid over an image is a *warp* and on a surface a *deformation*. The modules stand in strict layers;
//! `docs/ARCHITECTURE.md` holds the table of allowed imports, and a test reads it from there.

pub mod camera;
pub mod character;
pub mod cli;
pub mod energy;
pub mod feature;
pub mod image;
pub mod math;
pub mod media;
pub mod mesh;
pub mod morph;
pub mod motion;
pub mod optim;
pub mod path;
pub mod photo;
pub mod pipeline;
pub mod raster;
pub mod render;
pub mod report;
pub mod run;
pub mod sparse;
pub mod surface;
pub mod time;
pub mod track;
pub mod warp;
