//! Poses of a skeleton.

use nalgebra::{Quaternion, Unit, UnitQuaternion, Vector3};

use super::edit::other_side;
use super::ik::within_limits;
use super::{CharacterError, Skeleton};
use plumbline_num::math::Trs;

/// `parent_from_joint` of every joint, in the order of the skeleton's joints.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    /// One per joint.
    pub locals: Vec<Trs>,
}

impl Pose {
    /// The pose with left and right exchanged, within the joint limits.
    ///
    /// The world rotation of each joint from rest, and its translation from rest, are reflected in the plane through the origin with this
    /// normal and given to the joint of the other side ([`other_side`]), to the joint itself where there is none. Scales stay.
    ///
    /// # Errors
    /// [`CharacterError::Input`] for a pose of another skeleton.
    ///
    /// ```
    /// use nalgebra::{UnitQuaternion, Vector3};
    /// use plumbline_shape::character::humanoid::humanoid;
    ///
    /// let skeleton = humanoid(0.1)?.skeleton;
    /// let mut pose = skeleton.rest_pose();
    /// let arm = skeleton.named("arm.L")? as usize;
    /// pose.locals[arm].rotation *= UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.4);
    /// let other = pose.mirrored(&skeleton, &Vector3::x_axis())?;
    /// let at = |pose, joint: &str| -> Result<_, Box<dyn std::error::Error>> {
    ///     Ok(skeleton.globals(pose)?[skeleton.named(joint)? as usize].column(3).xyz())
    /// };
    /// let (left, right) = (at(&pose, "hand.L")?, at(&other, "hand.R")?);
    /// assert!((right - Vector3::new(-left.x, left.y, left.z)).norm() < 1e-9);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn mirrored(&self, skeleton: &Skeleton, normal: &Unit<Vector3<f64>>) -> Result<Self, CharacterError> {
        let (rest, now) = (rotations(skeleton, &skeleton.rest_pose())?, rotations(skeleton, self)?);
        let joints = skeleton.joints();
        let image: Vec<usize> = (0..joints.len()).map(|j| on_other_side(skeleton, j)).collect();
        let reflect = |v: Vector3<f64>| v - normal.into_inner() * (2.0 * normal.dot(&v));
        // The axis of a rotation is a pseudovector: it is reflected and reversed.
        let turned =
            |q: UnitQuaternion<f64>| UnitQuaternion::new_unchecked(Quaternion::from_parts(q.w, -reflect(q.imag())));
        let world = |j: usize| turned(now[image[j]] * rest[image[j]].inverse()) * rest[j];
        let above = |j: usize, of: &dyn Fn(usize) -> UnitQuaternion<f64>| {
            joints[j].parent.map_or_else(UnitQuaternion::identity, |p| of(p as usize))
        };
        let mut mirrored = self.clone();
        for (j, local) in mirrored.locals.iter_mut().enumerate() {
            let (own, parent) = (image[j], above(j, &world));
            local.rotation = parent.inverse() * world(j);
            let shift = self.locals[own].translation - joints[own].rest.translation;
            let shift = parent.inverse() * reflect(above(own, &|p| now[p]) * shift);
            local.translation = joints[j].rest.translation + shift;
        }
        Ok(within_limits(skeleton, &mirrored))
    }
}

/// World rotations of all joints.
fn rotations(skeleton: &Skeleton, pose: &Pose) -> Result<Vec<UnitQuaternion<f64>>, CharacterError> {
    Ok(skeleton.globals(pose)?.iter().map(|g| Trs::from_matrix(g).rotation).collect())
}

/// The joint of the other side; the joint itself where there is none.
fn on_other_side(skeleton: &Skeleton, j: usize) -> usize {
    let other = other_side(&skeleton.joints()[j].name).and_then(|name| skeleton.find(&name));
    other.map_or(j, |other| other as usize)
}
