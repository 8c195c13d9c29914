//! Cyclic coordinate descent: each joint of a chain, from the tip to the root, rotates so that the tip points at the target, within its
//! limits.
//!
//! Simple and never divergent, but it favors joints near the tip, takes tens to hundreds of iterations near full extension, and supports a
//! single position target; [`super::solve`] has none of these limitations.
//!
//! # Reference
//! L.-C. T. Wang, C. C. Chen, *A Combined Optimization Method for Solving the Inverse Kinematics Problem of Mechanical
//! Manipulators*, IEEE Transactions on Robotics and Automation 1991.

use nalgebra::{Point3, UnitQuaternion};

use super::frames::Frames;
use super::two_bone::rotate;
use super::{check_joints, within_limits};
use crate::character::{CharacterError, Pose, Skeleton};
use plumbline_num::run::Run;

/// Moves a tip to a position by rotating up to `joints` joints above it, for at most `iterations` iterations or until it is within
/// `tolerance`, units of the model. Returns the pose and the number of iterations.
///
/// # Errors
/// [`CharacterError::Input`], [`CharacterError::Interrupted`].
///
/// ```
/// use nalgebra::{Point3, Vector3};
/// use plumbline_num::math::Trs;
/// use plumbline_num::run::Run;
/// use plumbline_shape::character::ik::ccd;
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
/// let (pose, iterations) = ccd(&arm, &arm.rest_pose(), (3, 3), &at, (200, 1e-6), &Run::default())?;
/// let tip = arm.globals(&pose)?[3].transform_point(&Point3::origin());
/// assert!(iterations < 200 && (tip - at).norm() <= 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn ccd(
    skeleton: &Skeleton,
    pose: &Pose,
    (tip, joints): (u32, usize),
    at: &Point3<f64>,
    (iterations, tolerance): (usize, f64),
    run: &Run,
) -> Result<(Pose, usize), CharacterError> {
    let chain = chain(skeleton, tip, joints, at)?;
    let mut pose = within_limits(skeleton, pose);
    let mut frames = Frames::of(skeleton, &pose)?;
    for iteration in 0..iterations {
        run.check()?;
        if (frames.at(tip) - at).norm() <= tolerance {
            return Ok((pose, iteration));
        }
        for &joint in &chain {
            let from = frames.at(joint);
            if let Some(by) = UnitQuaternion::rotation_between(&(frames.at(tip) - from), &(at - from)) {
                rotate(skeleton, &frames, &mut pose, joint, &by);
                let described = &skeleton.joints()[joint as usize];
                if let Some(limits) = &described.limits {
                    let local = &mut pose.locals[joint as usize].rotation;
                    *local = described.rest.rotation * limits.project(&(described.rest.rotation.inverse() * *local));
                }
                frames = Frames::chained(skeleton, &pose);
            }
        }
    }
    Ok((pose, iterations))
}

/// Ancestors of a tip, the nearest first.
pub(super) fn chain(
    skeleton: &Skeleton,
    tip: u32,
    joints: usize,
    at: &Point3<f64>,
) -> Result<Vec<u32>, CharacterError> {
    check_joints(skeleton, 0, &[tip], at.iter().all(|x| x.is_finite()))?;
    Ok(skeleton.ancestors(tip).take(joints).collect())
}
