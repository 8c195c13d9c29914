//! Drawing in software: lines, grids and text over pictures, surfaces of triangles, a textured 3D street that a known camera
//! looks at, and a room of straight lines seen through any lens.

mod canvas;
mod color_map;
mod font;
pub mod room;
pub mod scene;
mod srgb;
pub mod surface;

pub use canvas::{Canvas, Rgb};
pub use color_map::ColorMap;
pub use font::text_width;
