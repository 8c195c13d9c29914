//! Drawing in software: lines, grids and text over pictures, and a textured 3D street that a known camera looks at.

mod canvas;
mod font;
pub mod scene;

pub use canvas::{Canvas, Rgb};
pub use font::text_width;
