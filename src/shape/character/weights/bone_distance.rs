//! Closest points on bones.

use nalgebra::Point3;

use super::super::Bone;

/// The point of a bone closest to `p`, its squared distance, and its parameter along the bone, 0 at the joint.
pub(super) fn nearest(bone: &Bone, p: &Point3<f64>) -> (Point3<f64>, f64, f64) {
    let along = bone.to - bone.from;
    let length = along.norm_squared();
    let t = if length > 0.0 { ((p - bone.from).dot(&along) / length).clamp(0.0, 1.0) } else { 0.0 };
    let q = bone.from + along * t;
    (q, (p - q).norm_squared(), t)
}
