//! Two bones in closed form, such as an arm or a leg.
//!
//! With bone lengths `l₁`, `l₂` and the target at distance `d` from the root, the law of cosines gives the angle at the root,
//!
//! ```text
//! cos α = (l₁² + d² − l₂²) / (2 l₁ d),      b' = a + l₁ (cos α u + sin α q)
//! ```
//!
//! with `u` toward the target and `q ⊥ u` the direction in which the chain bends: toward the pole, or as it bends now. A target out of reach
//! is approached as far as the bones reach. The middle joint rotates in the plane of the bend only, so that a hinge stays a hinge. Limits
//! are ignored: follow with [`super::within_limits`], or use [`super::solve`].

use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};

use super::frames::Frames;
use super::{check_chain, check_joints};
use crate::character::{CharacterError, Pose, Skeleton};

/// Rotates the first two joints of a chain (root, middle, tip) so that the third reaches a position. Frames above must not be scaled unevenly.
///
/// # Errors
/// [`CharacterError::Input`].
///
/// ```
/// use nalgebra::{Point3, Vector3};
/// use plumbline_num::math::Trs;
/// use plumbline_shape::character::ik::two_bone;
/// use plumbline_shape::character::{Joint, Skeleton};
///
/// let joint = |k: u32| Joint {
///     name: format!("joint {k}"),
///     parent: k.checked_sub(1),
///     rest: Trs::from_translation(Vector3::x() * f64::from(k.min(1))),
///     limits: None,
/// };
/// let arm = Skeleton::new((0..3).map(joint).collect())?;
/// let at = Point3::new(1.0, 1.2, 0.5);
/// let pose = two_bone(&arm, &arm.rest_pose(), [0, 1, 2], &at, Some(&Point3::new(0.0, 5.0, 0.0)))?;
/// let tip = arm.globals(&pose)?[2].transform_point(&Point3::origin());
/// assert!((tip - at).norm() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn two_bone(
    skeleton: &Skeleton,
    pose: &Pose,
    chain: [u32; 3],
    at: &Point3<f64>,
    pole: Option<&Point3<f64>>,
) -> Result<Pose, CharacterError> {
    let finite = at.iter().chain(pole.iter().flat_map(|p| p.iter())).all(|x| x.is_finite());
    check_joints(skeleton, 0, &chain, finite)?;
    check_chain(skeleton, 0, chain)?;
    let frames = Frames::of(skeleton, pose)?;
    let [root, middle, tip] = chain;
    let [a, b, c] = chain.map(|j| frames.at(j));
    let (first, second) = ((b - a).norm(), (c - b).norm());
    let away = at - a;
    let distance = away.norm().clamp((first - second).abs(), first + second);
    let toward = away.try_normalize(0.0).or((c - a).try_normalize(0.0)).unwrap_or_else(Vector3::x);
    let across =
        |v: Vector3<f64>, axis: &Vector3<f64>| (v - axis * axis.dot(&v)).try_normalize(1e-9 * (first + second));
    // The present bend direction, carried along by the shortest rotation of the whole chain.
    let present = (c - a).try_normalize(0.0).unwrap_or(toward);
    let bend = across(b - a, &present).unwrap_or_else(|| some_across(&present));
    let carried = UnitQuaternion::rotation_between(&present, &toward).unwrap_or_else(UnitQuaternion::identity) * bend;
    let bend_toward =
        pole.and_then(|p| across(p - a, &toward)).or(across(carried, &toward)).unwrap_or_else(|| some_across(&toward));
    let cosine = ((first * first + distance * distance - second * second) / (2.0 * first * distance)).clamp(-1.0, 1.0);
    let cosine = if cosine.is_finite() { cosine } else { 1.0 };
    let sine = (1.0 - cosine * cosine).sqrt();
    let new_b = a + (toward * cosine + bend_toward * sine) * first;
    let new_c = a + toward * distance;
    // The root rotates the first bone together with the plane of the bend.
    let plane = |along: Vector3<f64>, bend: &Vector3<f64>, axis: &Vector3<f64>| -> Option<Rotation3<f64>> {
        let (along, normal) = (along.try_normalize(0.0)?, axis.cross(bend).try_normalize(0.0)?);
        let columns = [along, normal.cross(&along), normal];
        Some(Rotation3::from_matrix_unchecked(Matrix3::from_columns(&columns)))
    };
    let mut pose = pose.clone();
    if let (Some(old), Some(new)) = (plane(b - a, &bend, &present), plane(new_b - a, &bend_toward, &toward)) {
        rotate(skeleton, &frames, &mut pose, root, &UnitQuaternion::from_rotation_matrix(&(new * old.inverse())));
    }
    let frames = Frames::of(skeleton, &pose)?;
    let (old, new) = (frames.at(tip) - frames.at(middle), new_c - new_b);
    if let Some(by) = UnitQuaternion::rotation_between(&old, &new) {
        rotate(skeleton, &frames, &mut pose, middle, &by);
    } else {
        // Folded back upon itself: rotate about the normal of the plane.
        let by = UnitQuaternion::from_scaled_axis(toward.cross(&bend_toward) * std::f64::consts::PI);
        rotate(skeleton, &frames, &mut pose, middle, &by);
    }
    Ok(pose)
}

/// Rotates a joint about its origin by a world rotation.
pub(super) fn rotate(skeleton: &Skeleton, frames: &Frames, pose: &mut Pose, joint: u32, by: &UnitQuaternion<f64>) {
    let parent = skeleton.joints()[joint as usize].parent;
    let above = parent.map_or_else(UnitQuaternion::identity, |p| frames.rotation[p as usize]);
    let local = &mut pose.locals[joint as usize].rotation;
    *local = above.inverse() * by * above * *local;
    local.renormalize();
}

/// A unit vector perpendicular to an axis.
fn some_across(axis: &Vector3<f64>) -> Vector3<f64> {
    axis.cross(&Vector3::ith(axis.iamin(), 1.0)).normalize()
}
