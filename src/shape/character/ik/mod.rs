//! Inverse kinematics: joint rotations that bring parts of a character to targets.
//!
//! All targets form one least-squares problem in the coordinates `q` of the movable joints:
//!
//! ```text
//! minimize ½ Σ w² ‖r(q)‖²      subject to the limits of each joint
//!
//! position      r = (p(q) − p̂) / ℓ                        ℓ the length of the longest chain
//! orientation   r = log(R(q) R̂⁻¹)
//! look at       r = d(q) − direction to the point          d an axis of the joint
//! pole          r = m(q) − m̂                              directions from the chain's axis to its middle joint, and to the pole
//! ```
//!
//! The coordinates of a joint with limits are its swing and twist, in which limits are convex; other joints use rotation vectors. Steps
//! are Levenberg–Marquardt with an active set of limits; each step is projected onto the limits and accepted only if it lowers the cost.
//! Every intermediate pose is therefore within the limits, and bone lengths are constant because joints only rotate. The root, which the
//! body hangs on ([`body_roots`]), stays unless a target is on it; a position target moves it, too. Degrees of freedom
//! that the targets leave open stay near the initial guess, by the damping. With `μ > 0`, `½ μ² Σ ‖rotation from rest‖²` is added in a
//! first run, which draws joints to rest; a second run without it meets the targets.
//!
//! Other methods ([`IkMethod`]) support positions only, one target after the other: the closed form for two bones ([`two_bone`]),
//! cyclic coordinate descent ([`ccd()`]) and FABRIK ([`fabrik()`]).
//!
//! # Reference
//! S. R. Buss, *Introduction to Inverse Kinematics with Jacobian Transpose, Pseudoinverse and Damped Least Squares Methods*, 2004.
//! P. Baerlocher, R. Boulic, *An Inverse Kinematics Architecture Enforcing an Arbitrary Number of Strict Priority Levels*, The
//! Visual Computer 2004 (limits in swing and twist).

mod ccd;
mod fabrik;
mod frames;
mod least_squares;
mod residual;
mod single_chain;
#[cfg(test)]
mod tests;
mod two_bone;
mod variables;

use nalgebra::{Point3, Unit, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::{CharacterError, Pose, Skeleton};
use plumbline_num::optim::levenberg_marquardt::{DampingOptions, minimize};
use plumbline_num::run::Run;

pub use ccd::ccd;
pub use fabrik::fabrik;
pub use two_bone::two_bone;

pub(super) use frames::Frames;
use least_squares::Problem;
use variables::Variables;

/// Kinds of targets.
#[derive(Clone, Debug, PartialEq)]
pub enum Goal {
    /// A point of the joint's frame reaches a world position.
    Position {
        /// The point, in the joint's frame.
        point: Point3<f64>,
        /// The world position.
        at: Point3<f64>,
    },
    /// The joint has this world rotation.
    Orientation(UnitQuaternion<f64>),
    /// An axis of the joint points at a world position.
    LookAt {
        /// The axis, in the joint's frame.
        axis: Unit<Vector3<f64>>,
        /// The world position.
        at: Point3<f64>,
    },
    /// The chain that ends at the joint bends toward a world position.
    Pole {
        /// First joint of the chain, an ancestor.
        root: u32,
        /// The joint that bends, between the two.
        middle: u32,
        /// The world position.
        at: Point3<f64>,
    },
}

/// A target for a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// The joint.
    pub joint: u32,
    /// What to reach.
    pub goal: Goal,
    /// Weight of the residual, above 0.
    pub weight: f64,
    /// Movable joints: the joint itself and this many ancestors; `None`: all up to the root.
    pub chain: Option<usize>,
}

impl Target {
    /// The joint's origin reaches a world position; all ancestors may move.
    pub fn position(joint: u32, at: Point3<f64>) -> Self {
        Self { joint, goal: Goal::Position { point: Point3::origin(), at }, weight: 1.0, chain: None }
    }
}

/// Inverse kinematics method.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum IkMethod {
    /// Damped least squares: all targets of all kinds together
    ///
    /// Every step is within the joint limits. Slowest, and the only method for orientations, directions and poles.
    #[default]
    LeastSquares,
    /// Cyclic coordinate descent: positions only
    ///
    /// One target after the other, joint limits included.
    Ccd,
    /// Forward and backward reaching: positions only
    ///
    /// One target after the other; joint limits are applied to the result of each.
    Fabrik,
    /// Closed form for two bones: positions, with poles
    ///
    /// The two joints above a target, or those that a pole of the same joint names; limits are applied to the result of each.
    TwoBone,
}

impl IkMethod {
    /// The name a user types.
    pub fn name(self) -> &'static str {
        match self {
            Self::LeastSquares => "least-squares",
            Self::Ccd => "ccd",
            Self::Fabrik => "fabrik",
            Self::TwoBone => "two-bone",
        }
    }
}

/// Options of the inverse kinematics solver.
#[derive(Clone, Debug, PartialEq)]
pub struct IkOptions {
    /// The method. Default: damped least squares.
    pub method: IkMethod,
    /// Largest number of steps. Default 200.
    pub iterations: usize,
    /// Relative cost decrease per step below which the solver stops. Default 1e-9.
    pub tolerance: f64,
    /// `μ`: weight of rotations from rest in a first run, per radian. 0 (default) skips it, and poses stay close to the initial guess.
    pub rest: f64,
    /// Joints that do not rotate.
    pub locked: Vec<u32>,
    /// Motion of the root. Default: pinned.
    pub root: RootMotion,
}

impl Default for IkOptions {
    fn default() -> Self {
        Self {
            method: IkMethod::default(),
            iterations: 200,
            tolerance: 1e-9,
            rest: 0.0,
            locked: Vec::new(),
            root: RootMotion::default(),
        }
    }
}

/// Motion of the root of a body ([`body_roots`]).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum RootMotion {
    /// It stays, unless a target is on it: a position moves it, any target rotates it, as does a position of a joint next to it
    #[default]
    Pinned,
    /// It rotates for all targets, and does not move
    Rotates,
}

/// The joints that a body hangs on: of each root with several limbs the first joint from which they go, and its ancestors.
///
/// A skeleton that does not branch is a limb alone, whose first joint rotates like the others.
///
/// ```
/// use plumbline_shape::character::humanoid::humanoid;
/// use plumbline_shape::character::ik::body_roots;
///
/// let skeleton = humanoid(0.1)?.skeleton;
/// assert_eq!(body_roots(&skeleton), [skeleton.named("hips")?]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn body_roots(skeleton: &Skeleton) -> Vec<u32> {
    let mut roots = Vec::new();
    for root in skeleton.roots() {
        let only = |j: &u32| if let [child] = skeleton.children(*j) { Some(*child) } else { None };
        let trunk: Vec<u32> = std::iter::successors(Some(root), only).collect();
        if trunk.last().is_some_and(|last| !skeleton.children(*last).is_empty()) {
            roots.extend(trunk);
        }
    }
    roots
}

/// Whether a target moves a root: one on it, or the position of a joint that it alone moves, such as the hip of a leg.
fn moves_root(skeleton: &Skeleton, root: u32, target: &Target) -> bool {
    let is_position = matches!(target.goal, Goal::Position { .. });
    target.joint == root || is_position && skeleton.joints()[target.joint as usize].parent == Some(root)
}

/// A pose and its residuals.
#[derive(Clone, Debug, PartialEq)]
pub struct IkSolution {
    /// The pose: within all limits; only rotations differ from the initial guess, and the translation of a root with a position target.
    pub pose: Pose,
    /// Residual of each target: units of the model for positions, rad otherwise.
    pub residuals: Vec<f64>,
    /// Number of steps tried.
    pub iterations: usize,
    /// Whether the last step was below the tolerance.
    pub converged: bool,
}

/// Cost ratio below which another attempt from a bent pose replaces the best before. Well below 1, so that two attempts of similar
/// quality do not alternate from frame to frame.
const MAX_RETRY_COST_RATIO: f64 = 0.25;
/// Largest residual of a met target, in its unit.
const MET_TOLERANCE: f64 = 1e-6;
/// Largest number of steps toward rest: along the curved valley of poses that meet the targets steps are short.
const MAX_REST_ITERATIONS: usize = 50;
/// Largest number of targets: a solve is cubic in it, and this many take about a second.
pub const MAX_TARGETS: usize = 256;
/// Largest number of joints that move targets, summed over the targets: 100 MB.
const MAX_BLOCKS: usize = 1 << 20;
/// Steps of an attempt. Reachable targets take 5 to 15; of 5,000 random poses of a person of 60 joints 96.5 % were reached with one attempt of
/// 200 steps and another from a bent pose, 99.7 % with the attempts below, in half the time.
const ATTEMPT_ITERATIONS: usize = 30;
/// Rotation of each joint before the further attempts, rad. The first is enough to leave the singularity of a straight chain with a target
/// on its line, where the gradient is zero; the larger ones leave a minimum in which joints at their limits block one another. Growth
/// matters more than number: six attempts at ±0.8 reach 98.5 %.
const RETRY_BENDS: [f64; 6] = [0.3, -0.8, 1.3, -1.8, 2.3, -2.8];

/// Rotates joints so that targets are met in the least-squares sense. Joints outside their limits are first projected onto them.
///
/// # Errors
/// [`CharacterError::Input`]: an invalid pose or target, or one that the method does not support; [`CharacterError::Interrupted`].
///
/// ```
/// use nalgebra::{Point3, Vector3};
/// use plumbline_num::math::Trs;
/// use plumbline_num::run::Run;
/// use plumbline_shape::character::ik::{IkMethod, IkOptions, Target, solve};
/// use plumbline_shape::character::{Joint, Skeleton};
///
/// // Three bones of length 1 in a row, and a position for their end.
/// let joint = |k: u32| Joint {
///     name: format!("joint {k}"),
///     parent: k.checked_sub(1),
///     rest: Trs::from_translation(Vector3::x() * f64::from(k.min(1))),
///     limits: None,
/// };
/// let arm = Skeleton::new((0..4).map(joint).collect())?;
/// let targets = [Target::position(3, Point3::new(1.0, 1.5, 0.5))];
/// for method in [IkMethod::LeastSquares, IkMethod::Ccd, IkMethod::Fabrik, IkMethod::TwoBone] {
///     let options = IkOptions { method, ..IkOptions::default() };
///     let found = solve(&arm, &arm.rest_pose(), &targets, &options, &Run::default())?;
///     assert!(found.residuals[0] < 1e-5, "{method:?}: {}", found.residuals[0]);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn solve(
    skeleton: &Skeleton,
    start: &Pose,
    targets: &[Target],
    options: &IkOptions,
    run: &Run,
) -> Result<IkSolution, CharacterError> {
    check(skeleton, targets)?;
    let allowed = within_limits(skeleton, start);
    if options.method != IkMethod::LeastSquares {
        return single_chain::solve(skeleton, allowed, targets, options, run);
    }
    let frames = Frames::of(skeleton, &allowed)?;
    let variables = Variables::of(skeleton, targets, options, frames.size());
    let blocks: usize = variables.of_target.iter().map(Vec::len).sum();
    if blocks > MAX_BLOCKS {
        let fault = format!("{} targets move {blocks} joints in all (at most {MAX_BLOCKS})", targets.len());
        return Err(CharacterError::Input(format!("{fault}; give fewer targets, or shorter chains")));
    }
    let run_with = |pose: Pose, rest: f64, iterations: usize| {
        let mut problem = Problem::new(skeleton, targets, &variables, &frames, pose, rest);
        let cost = problem.cost();
        let damping = DampingOptions {
            tolerance: options.tolerance,
            // Relative to unit residuals: a cost of 1e-20 is 1e-10 of a chain length.
            floor: 1e-20,
            max_iterations: iterations,
            ..DampingOptions::default()
        };
        let report = minimize(&mut problem, cost, &damping, run)?;
        Ok::<_, CharacterError>((problem.into_pose(), report))
    };
    let first = if options.rest > 0.0 {
        run_with(allowed, options.rest, options.iterations.min(MAX_REST_ITERATIONS))?.0
    } else {
        allowed
    };
    let residuals = |pose: &Pose| residual::residuals(targets, &Frames::chained(skeleton, pose));
    let met = |pose: &Pose| residuals(pose).iter().zip(targets).all(|(m, t)| *m <= MET_TOLERANCE * frames.scale(t));
    let (mut pose, mut report) = run_with(first, 0.0, options.iterations.min(ATTEMPT_ITERATIONS))?;
    let (mut steps, mut attempt) = (report.iterations, 0);
    while attempt < RETRY_BENDS.len() && steps < options.iterations && !met(&pose) {
        let bent = variables.bent(skeleton, &pose, RETRY_BENDS[attempt]);
        let (other, its) = run_with(bent, 0.0, (options.iterations - steps).min(ATTEMPT_ITERATIONS))?;
        (steps, attempt) = (steps + its.iterations, attempt + 1);
        if its.cost < MAX_RETRY_COST_RATIO * report.cost {
            (pose, report) = (other, its);
        }
    }
    if !report.converged && !met(&pose) {
        // Out of reach, or slow: the best attempt goes on.
        (pose, report) = run_with(pose, 0.0, options.iterations)?;
        steps += report.iterations;
    }
    report.iterations = steps;
    Ok(IkSolution { residuals: residuals(&pose), pose, iterations: report.iterations, converged: report.converged })
}

/// Number of ancestors that a drag of a joint moves ([`Target::chain`]): those of its limb, up to the first joint from which several limbs
/// go. `None`, which moves all, for a joint of the body itself: a root, or a joint whose parent has other children; also in a skeleton that
/// does not branch above the joint.
///
/// ```
/// use plumbline_shape::character::humanoid::humanoid;
/// use plumbline_shape::character::ik::limb_chain;
///
/// let skeleton = humanoid(0.1)?.skeleton;
/// // The chest, with a neck and two arms, does not follow a hand.
/// assert_eq!(limb_chain(&skeleton, skeleton.named("hand.L")?), Some(2));
/// assert_eq!(limb_chain(&skeleton, skeleton.named("hips")?), None);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn limb_chain(skeleton: &Skeleton, joint: u32) -> Option<usize> {
    let parent = |j: u32| skeleton.joints().get(j as usize)?.parent;
    let mut above = std::iter::successors(parent(joint), |j| parent(*j));
    above.position(|j| skeleton.children(j).len() > 1).filter(|count| *count > 0)
}

/// Interpolates two poses at `t` in 0 ..= 1. If both are within the limits, so is the result.
///
/// # Errors
/// [`CharacterError::Input`] for poses of another skeleton.
pub fn interpolate(skeleton: &Skeleton, from: &Pose, to: &Pose, t: f64) -> Result<Pose, CharacterError> {
    let (mut pose, _, _) = (from.clone(), skeleton.globals(from)?, skeleton.globals(to)?);
    for ((joint, local), target) in skeleton.joints().iter().zip(&mut pose.locals).zip(&to.locals) {
        local.translation += (target.translation - local.translation) * t;
        local.scale += (target.scale - local.scale) * t;
        local.rotation = match &joint.limits {
            None => slerp(&local.rotation, &target.rotation, t),
            Some(limits) => {
                let rest = joint.rest.rotation;
                let [mut a, b] = [&local.rotation, &target.rotation].map(|r| limits.split(&(rest.inverse() * r)));
                a.swing += (b.swing - a.swing) * t;
                a.twist += (b.twist - a.twist) * t;
                rest * limits.rotation(&a)
            }
        };
    }
    Ok(pose)
}

/// Slerp on the shortest path.
fn slerp(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>, t: f64) -> UnitQuaternion<f64> {
    a * UnitQuaternion::from_scaled_axis((a.inverse() * b).scaled_axis() * t)
}

/// The pose with every joint projected onto its limits; joints within them are unchanged.
pub fn within_limits(skeleton: &Skeleton, pose: &Pose) -> Pose {
    let mut pose = pose.clone();
    for (joint, local) in skeleton.joints().iter().zip(&mut pose.locals) {
        if let Some(limits) = &joint.limits {
            let from_rest = joint.rest.rotation.inverse() * local.rotation;
            if !limits.allows(&from_rest, 0.0) {
                local.rotation = joint.rest.rotation * limits.project(&from_rest);
            }
        }
    }
    pose
}

fn check(skeleton: &Skeleton, targets: &[Target]) -> Result<(), CharacterError> {
    if targets.len() > MAX_TARGETS {
        return Err(CharacterError::Input(format!("{} targets are too many (at most {MAX_TARGETS})", targets.len())));
    }
    for (number, target) in targets.iter().enumerate() {
        let mut named = vec![target.joint];
        let finite = match &target.goal {
            Goal::Position { point, at } => point.iter().chain(at.iter()).all(|x| x.is_finite()),
            Goal::Orientation(rotation) => rotation.coords.iter().all(|x| x.is_finite()),
            Goal::LookAt { axis, at } => axis.iter().chain(at.iter()).all(|x| x.is_finite()),
            Goal::Pole { root, middle, at } => {
                named.extend([*root, *middle]);
                at.iter().all(|x| x.is_finite())
            }
        };
        check_joints(skeleton, number, &named, finite)?;
        let weight = target.weight;
        if !(weight > 0.0 && weight.is_finite()) {
            let what = format!("the weight {weight} of target {number}");
            return Err(CharacterError::Input(format!("{what} is invalid (expected more than 0, finite)")));
        }
        if let Goal::Pole { root, middle, .. } = target.goal {
            check_chain(skeleton, number, [root, middle, target.joint])?;
        }
    }
    Ok(())
}

/// Checks the joints that a target names, and that its numbers are finite.
fn check_joints(skeleton: &Skeleton, target: usize, named: &[u32], finite: bool) -> Result<(), CharacterError> {
    let joints = skeleton.joint_count();
    if let Some(joint) = named.iter().find(|j| **j as usize >= joints) {
        let there = format!("but there are {joints}, numbered from 0");
        return Err(CharacterError::Input(format!("target {target} names joint {joint}, {there}")));
    }
    if finite { Ok(()) } else { Err(CharacterError::Input(format!("target {target} is not finite"))) }
}

fn check_chain(skeleton: &Skeleton, target: usize, [root, middle, tip]: [u32; 3]) -> Result<(), CharacterError> {
    if above(skeleton, middle, root) && above(skeleton, tip, middle) { Ok(()) } else { Err(no_chain(target)) }
}

fn no_chain(target: usize) -> CharacterError {
    let expected = "each must be an ancestor of the next (root, middle, tip)";
    CharacterError::Input(format!("the joints of target {target} are not a chain: {expected}"))
}

/// Whether `ancestor` is a proper ancestor of a joint.
fn above(skeleton: &Skeleton, joint: u32, ancestor: u32) -> bool {
    skeleton.ancestors(joint).any(|j| j == ancestor)
}
