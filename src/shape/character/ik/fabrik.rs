//! FABRIK: the joints of a chain are points at fixed distances, pulled to the target from the tip (backward) and back to the root
//! (forward) in alternation; then the joints are rotated onto the points.
//!
//! Fast if the target is well within reach. Positions only: no limits, no twist, one target.
//!
//! # Reference
//! A. Aristidou, J. Lasenby, *FABRIK: A fast, iterative solver for the Inverse Kinematics problem*, Graphical Models 2011.

use nalgebra::{Point3, UnitQuaternion};

use super::ccd::chain;
use super::frames::Frames;
use super::two_bone::rotate;
use crate::character::{CharacterError, Pose, Skeleton};
use plumbline_num::run::Run;

/// As [`super::ccd()`], without limits.
///
/// # Errors
/// [`CharacterError::Input`], [`CharacterError::Interrupted`].
///
/// ```
/// use nalgebra::{Point3, Vector3};
/// use plumbline_num::math::Trs;
/// use plumbline_num::run::Run;
/// use plumbline_shape::character::ik::fabrik;
/// use plumbline_shape::character::{Joint, Skeleton};
///
/// let joint = |k: u32| Joint {
///     name: format!("joint {k}"),
///     parent: k.checked_sub(1),
///     rest: Trs::from_translation(Vector3::x() * f64::from(k.min(1))),
///     limits: None,
/// };
/// let arm = Skeleton::new((0..4).map(joint).collect())?;
/// let at = Point3::new(1.0, 1.5, 0.5);
/// let (pose, iterations) = fabrik(&arm, &arm.rest_pose(), (3, 3), &at, (200, 1e-6), &Run::default())?;
/// let tip = arm.globals(&pose)?[3].transform_point(&Point3::origin());
/// assert!(iterations < 200 && (tip - at).norm() <= 2e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn fabrik(
    skeleton: &Skeleton,
    pose: &Pose,
    (tip, joints): (u32, usize),
    at: &Point3<f64>,
    (iterations, tolerance): (usize, f64),
    run: &Run,
) -> Result<(Pose, usize), CharacterError> {
    let mut chain = chain(skeleton, tip, joints, at)?;
    chain.reverse();
    chain.push(tip);
    let frames = Frames::of(skeleton, pose)?;
    let start: Vec<Point3<f64>> = chain.iter().map(|&j| frames.at(j)).collect();
    let lengths: Vec<f64> = start.windows(2).map(|p| (p[1] - p[0]).norm()).collect();
    let (mut points, mut taken) = (start.clone(), iterations);
    let last = points.len() - 1;
    for iteration in 0..iterations {
        run.check()?;
        if (points[last] - at).norm() <= tolerance {
            taken = iteration;
            break;
        }
        points[last] = *at;
        for k in (0..last).rev() {
            points[k] = pulled(&points[k + 1], &points[k], lengths[k]);
        }
        points[0] = start[0];
        for k in 0..last {
            points[k + 1] = pulled(&points[k], &points[k + 1], lengths[k]);
        }
    }
    let mut pose = pose.clone();
    for k in 0..last {
        let frames = Frames::chained(skeleton, &pose);
        let [from, to] = [chain[k], chain[k + 1]].map(|j| frames.at(j));
        if let Some(by) = UnitQuaternion::rotation_between(&(to - from), &(points[k + 1] - points[k])) {
            rotate(skeleton, &frames, &mut pose, chain[k], &by);
        }
    }
    Ok((pose, taken))
}

/// The point at distance `length` from `from`, in the direction of `to`.
fn pulled(from: &Point3<f64>, to: &Point3<f64>, length: f64) -> Point3<f64> {
    let away = (to - from).try_normalize(0.0);
    away.map_or(*to, |direction| from + direction * length)
}
