//! Drawing in software: lines, grids and text over pictures, a textured 3D street that a known camera looks at, and a room of
//! straight lines seen through any lens.

mod canvas;
mod font;
pub mod room;
pub mod scene;

pub use canvas::{Canvas, Rgb};
pub use font::text_width;
