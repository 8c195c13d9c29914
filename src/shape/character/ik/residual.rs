//! Residuals of targets and their Jacobians.

use nalgebra::{Matrix3, Point3, UnitQuaternion, Vector3};

use super::frames::Frames;
use super::variables::left_jacobian;
use super::{Goal, Target};

/// Effect of the coordinates of a joint on its descendants: the angular velocity `ω` of the parent's frame moves the point `p` by
/// `A (ω × A⁻¹ (p − o))` and rotates its frame by `R ω`; a velocity moves all points alike.
pub(super) struct Lever {
    pub(super) origin: Point3<f64>,
    pub(super) linear: Matrix3<f64>,
    pub(super) inverse: Matrix3<f64>,
    pub(super) rotation: Matrix3<f64>,
    /// Angular velocities of the joint's coordinates in the parent's frame, or their velocities in the world, as columns.
    pub(super) velocities: Matrix3<f64>,
    /// Whether the coordinates are those of a translation.
    pub(super) translates: bool,
}

impl Lever {
    /// Velocity of a point per coordinate, as columns.
    fn of_point(&self, p: &Point3<f64>) -> Matrix3<f64> {
        if self.translates {
            return self.velocities;
        }
        let arm = self.inverse * (p - self.origin);
        -self.linear * arm.cross_matrix() * self.velocities
    }

    /// World angular velocity per coordinate, as columns.
    fn of_rotation(&self) -> Matrix3<f64> {
        if self.translates { Matrix3::zeros() } else { self.rotation * self.velocities }
    }
}

/// The residual of a target, before weighting.
pub(super) fn residual(target: &Target, frames: &Frames, scale: f64) -> Vector3<f64> {
    match &target.goal {
        Goal::Position { point, at } => (frames.point(target.joint, point) - at) / scale,
        Goal::Orientation(wanted) => error_of(&frames.rotation[target.joint as usize], wanted),
        Goal::LookAt { axis, at } => {
            let seen = frames.rotation[target.joint as usize] * axis.into_inner();
            seen - direction(at - frames.at(target.joint))
        }
        Goal::Pole { root, middle, at } => {
            let [a, b, c] = [*root, *middle, target.joint].map(|j| frames.at(j));
            let axis = direction(c - a);
            across(&axis, &(b - a)) - across(&axis, &(at - a))
        }
    }
}

/// Jacobian of the residual in the coordinates of a joint. `moves` tests whether the joint is an ancestor of another, or the same.
pub(super) fn jacobian(
    target: &Target,
    frames: &Frames,
    scale: f64,
    lever: &Lever,
    moves: impl Fn(u32) -> bool,
) -> Matrix3<f64> {
    let point = |j: u32, p: &Point3<f64>| if moves(j) { lever.of_point(p) } else { Matrix3::zeros() };
    match &target.goal {
        Goal::Position { point: p, .. } => point(target.joint, &frames.point(target.joint, p)) / scale,
        Goal::Orientation(wanted) => {
            let error = error_of(&frames.rotation[target.joint as usize], wanted);
            left_jacobian(&error).try_inverse().unwrap_or_else(Matrix3::identity) * lever.of_rotation()
        }
        Goal::LookAt { axis, at } => {
            let seen = frames.rotation[target.joint as usize] * axis.into_inner();
            let from = frames.at(target.joint);
            -seen.cross_matrix() * lever.of_rotation() + direction_change(&(at - from)) * point(target.joint, &from)
        }
        Goal::Pole { root, middle, at } => {
            let [a, b, c] = [*root, *middle, target.joint].map(|j| frames.at(j));
            let [da, db, dc] = [(*root, a), (*middle, b), (target.joint, c)].map(|(j, p)| point(j, &p));
            let (axis, turning) = (direction(c - a), direction_change(&(c - a)) * (dc - da));
            across_change(&axis, &turning, &(b - a), &(db - da)) - across_change(&axis, &turning, &(at - a), &-da)
        }
    }
}

/// Residual of each target: units of the model for positions, rad otherwise.
pub(super) fn residuals(targets: &[Target], frames: &Frames) -> Vec<f64> {
    let angle = |chord: f64| 2.0 * (0.5 * chord).min(1.0).asin();
    let of = |target: &Target| match target.goal {
        Goal::Position { .. } | Goal::Orientation(_) => residual(target, frames, 1.0).norm(),
        _ => angle(residual(target, frames, 1.0).norm()),
    };
    targets.iter().map(of).collect()
}

/// `log(R R̂⁻¹)` on the shortest path.
fn error_of(rotation: &UnitQuaternion<f64>, wanted: &UnitQuaternion<f64>) -> Vector3<f64> {
    (rotation * wanted.inverse()).scaled_axis()
}

/// The unit vector; zero for the zero vector.
fn direction(v: Vector3<f64>) -> Vector3<f64> {
    v.try_normalize(0.0).unwrap_or_else(Vector3::zeros)
}

/// Derivative of the unit vector: `(I − d dᵀ) / |v|`.
fn direction_change(v: &Vector3<f64>) -> Matrix3<f64> {
    let length = v.norm();
    if !(length > 0.0) {
        return Matrix3::zeros();
    }
    let d = v / length;
    (Matrix3::identity() - d * d.transpose()) / length
}

/// Unit vector of the part of `v` perpendicular to an axis.
fn across(axis: &Vector3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
    direction(v - axis * axis.dot(v))
}

/// Its derivative, from those of the axis and of the vector.
fn across_change(axis: &Vector3<f64>, turning: &Matrix3<f64>, v: &Vector3<f64>, moving: &Matrix3<f64>) -> Matrix3<f64> {
    let flat = v - axis * axis.dot(v);
    let change = moving - turning * axis.dot(v) - axis * (v.transpose() * turning + axis.transpose() * moving);
    direction_change(&flat) * change
}
