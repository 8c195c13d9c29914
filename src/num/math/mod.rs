//! Geometry that every layer shares: points, similarities and homographies of the plane, rotations and rigid motions of space;
//! of numbers the median and the minimum of a function; lists of lists.
//!
//! Transforms are named `dst_from_src` and map points of `src` to points of `dst`. Image points are in pixels,
//! y down, with pixel centers at integer + 0.5, so that an image of `W×H` pixels is the rectangle `[0,W]×[0,H]`.

mod dual_quaternion;
mod golden_section;
mod homography;
mod lists;
mod median;
pub mod polynomial;
mod rect;
mod rotation;
mod similarity;
mod slices;
mod trs;

pub use dual_quaternion::DualQuaternion;
pub use golden_section::golden_section;
pub use homography::Homography;
pub use lists::Lists;
pub use median::median;
pub use rect::Rect;
pub use rotation::{nearest_rotation, polar, without_reflection};
pub use similarity::Similarity2;
pub use slices::{dot, norm};
pub use trs::Trs;

/// A position in the plane, px unless said otherwise.
pub type Point2 = nalgebra::Point2<f64>;
/// A displacement in the plane, px unless said otherwise.
pub type Vec2 = nalgebra::Vector2<f64>;

/// A map of the plane that can be evaluated and linearised anywhere: lens models, homographies, meshes.
pub trait PointMap: Send + Sync {
    /// Image of `p`; `None` where the map is not defined (behind the camera, outside a lens's field).
    fn map(&self, p: Point2) -> Option<Point2>;

    /// 2×2 Jacobian `∂map/∂p`, row-major in the sense of `d(map) = J · dp`.
    fn jacobian(&self, p: Point2) -> Option<nalgebra::Matrix2<f64>>;
}
