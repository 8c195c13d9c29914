//! A synthetic street seen by a hand-held camera whose every pose is known.
//!
//! Surfaces are convex polygons with baked, mip-mapped textures and baked light (sun with shadows, sky with ambient
//! occlusion). A picture is made row by row, each row with the pose of the moment in which it is exposed, so that a
//! rolling shutter is exact. World axes are those of a camera: +x right, +y down, +z forward; meters; the ground is y = 0.
//!
//! - [`Scene::street`] builds the world, [`passer_by`] somebody who walks through it,
//! - [`HandHeld`] is the camera: an intended smooth path plus band-limited shake,
//! - [`View::render`] makes a picture.

mod bvh;
mod camera;
mod geometry;
mod light;
mod paint;
mod person;
mod sound;
mod street;
mod texture;
mod view;

pub use camera::{HandHeld, Pose, Walk};
pub use geometry::Polygon;
pub use person::passer_by;
pub use sound::{RATE_HZ, street_sound};
pub use view::View;

use texture::Texture;

/// Single-precision 3-vector of the pixel loops: m, or a color.
type Vec3 = nalgebra::Vector3<f32>;

/// Surfaces, their textures and the light that falls on them.
pub struct Scene {
    polygons: Vec<Polygon>,
    textures: Vec<Texture>,
}
