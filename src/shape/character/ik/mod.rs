//! Inverse kinematics: turns of joints that bring parts of a character where they are wanted.
//!
//! All targets form one least-squares problem in the turns `q` of the joints that may move:
//!
//! ```text
//! minimize ½ Σ w² ‖r(q)‖²      subject to the limits of each joint
//!
//! position      r = (p(q) − p̂) / ℓ                        ℓ the length of the longest chain
//! orientation   r = log(R(q) R̂⁻¹)
//! look at       r = d(q) − direction to the point          d an axis of the joint
//! pole          r = m(q) − m̂                              directions from the chain's axis to its middle, and to the pole
//! ```
//!
//! `q` of a joint with limits are its swing and twist, in which limits are convex; other joints turn by rotation vectors. Steps
//! are those of Levenberg and Marquardt in the face of the limits that hold the solution back, each ends with the nearest point
//! that limits allow, and is taken only where it lowers the cost: no pose on the way breaks a limit, and bones keep their lengths
//! because joints only turn. What the targets leave open stays as it was at the start, as the damping has it; where joints shall
//! be drawn to rest instead, `½ μ² Σ ‖turn from rest‖²` is added for a first run, and a second without it meets the targets.
//!
//! Other methods ([`IkMethod`]) seek positions, one target after the other: the closed form for two bones ([`two_bone`]), cyclic
//! coordinate descent ([`ccd()`]) and FABRIK ([`fabrik()`]).
//!
//! # Reference
//! S. R. Buss, *Introduction to Inverse Kinematics with Jacobian Transpose, Pseudoinverse and Damped Least Squares Methods*, 2004.
//! P. Baerlocher, R. Boulic, *An Inverse Kinematics Architecture Enforcing an Arbitrary Number of Strict Priority Levels*, The
//! Visual Computer 2004 (limits in swing and twist).

mod ccd;
mod error;
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

use super::{Pose, Skeleton};
use plumbline_num::optim::levenberg_marquardt::{DampingOptions, minimize};
use plumbline_num::run::Run;

pub use ccd::ccd;
pub use error::IkError;
pub use fabrik::fabrik;
pub use two_bone::two_bone;

use frames::Frames;
use least_squares::Problem;
use variables::Variables;

/// What is wanted of a joint.
#[derive(Clone, Debug, PartialEq)]
pub enum Goal {
    /// A point of its frame is at a place.
    Position {
        /// The point, in the joint's frame.
        point: Point3<f64>,
        /// Where it is wanted, world.
        at: Point3<f64>,
    },
    /// Its frame is turned like this in the world.
    Orientation(UnitQuaternion<f64>),
    /// An axis of it points at a place.
    LookAt {
        /// The axis, in the joint's frame.
        axis: Unit<Vector3<f64>>,
        /// Where it points, world.
        at: Point3<f64>,
    },
    /// The chain that ends with the joint bends toward a place.
    Pole {
        /// Where the chain begins: an ancestor.
        root: u32,
        /// What bends: between the two.
        middle: u32,
        /// Toward this, world.
        at: Point3<f64>,
    },
}

/// Something wanted of a joint, and how much.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// The joint.
    pub joint: u32,
    /// What is wanted.
    pub goal: Goal,
    /// How much it counts beside others, above 0.
    pub weight: f64,
    /// Joints that turn for it: the joint itself and this many above it; all up to the root without a number.
    pub chain: Option<usize>,
}

impl Target {
    /// A joint's origin at a place; all joints above it may turn.
    pub fn position(joint: u32, at: Point3<f64>) -> Self {
        Self { joint, goal: Goal::Position { point: Point3::origin(), at }, weight: 1.0, chain: None }
    }
}

/// The algorithm of inverse kinematics.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum IkMethod {
    /// Damped least squares: all targets of all kinds together
    ///
    /// Joint limits hold at every step.
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

/// How targets are sought.
#[derive(Clone, Debug, PartialEq)]
pub struct IkOptions {
    /// The algorithm.
    pub method: IkMethod,
    /// Steps at most.
    pub iterations: usize,
    /// Done when a step lowers the cost by no more than this share.
    pub tolerance: f64,
    /// `μ`: how much turns from rest count in a first run, per radian; 0: there is none, and poses follow their start closely.
    pub rest: f64,
    /// Joints that do not turn.
    pub locked: Vec<u32>,
}

impl Default for IkOptions {
    fn default() -> Self {
        Self { method: IkMethod::default(), iterations: 200, tolerance: 1e-9, rest: 0.0, locked: Vec::new() }
    }
}

/// A pose and how well it meets its targets.
#[derive(Clone, Debug, PartialEq)]
pub struct IkSolution {
    /// The pose: within all limits, and as the one it started from but for turns.
    pub pose: Pose,
    /// For each target how far it is missed: units of the model for positions, rad otherwise.
    pub missed: Vec<f64>,
    /// Steps tried.
    pub iterations: usize,
    /// The last step gained nothing to speak of.
    pub converged: bool,
}

/// A second try from a bent pose must lower the cost to this share, or the first result stays: two tries that end alike must not
/// alternate from frame to frame.
const BETTER: f64 = 0.25;
/// Residuals below this, of weight 1, count as met.
const MET: f64 = 1e-6;
/// Steps toward rest at most: along the curved valley of poses that meet their targets they are short.
const DRAWN: usize = 50;
/// How far joints are bent for a second try, rad.
const BENT: f64 = 0.3;

/// Turns joints of a pose so that targets are met as well as possible. Joints outside of their limits are brought inside first.
///
/// # Errors
/// [`IkError`]: `Unknown`, `NotFinite`, `Weight`, `Chain`, `Method`, `Character`, `Interrupted`.
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
///     assert!(found.missed[0] < 1e-5, "{method:?}: {}", found.missed[0]);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn solve(
    skeleton: &Skeleton,
    start: &Pose,
    targets: &[Target],
    options: &IkOptions,
    run: &Run,
) -> Result<IkSolution, IkError> {
    check(skeleton, targets)?;
    let allowed = within_limits(skeleton, start);
    if options.method != IkMethod::LeastSquares {
        return single_chain::solve(skeleton, allowed, targets, options, run);
    }
    let frames = Frames::of(skeleton, &allowed)?;
    let variables = Variables::of(skeleton, targets, options);
    let run_with = |pose: Pose, rest: f64, iterations: usize| {
        let mut problem = Problem::new(skeleton, targets, &variables, &frames, pose, rest);
        let cost = problem.cost();
        let damping = DampingOptions {
            tolerance: options.tolerance,
            floor: 1e-20,
            max_iterations: iterations,
            ..DampingOptions::default()
        };
        let report = minimize(&mut problem, cost, &damping, run)?;
        Ok::<_, IkError>((problem.into_pose(), report))
    };
    let meet = |pose: Pose| run_with(pose, 0.0, options.iterations);
    let first =
        if options.rest > 0.0 { run_with(allowed, options.rest, options.iterations.min(DRAWN))?.0 } else { allowed };
    let (mut pose, mut report) = meet(first)?;
    let missed = |pose: &Pose| residual::missed(skeleton, targets, &Frames::chained(skeleton, pose));
    let unmet = |pose: &Pose| missed(pose).iter().zip(targets).any(|(m, t)| *m > MET * frames.scale(t));
    if unmet(&pose) {
        // A stretched chain whose target lies along it has no gradient.
        let (second, other) = meet(variables.bent(skeleton, &pose, BENT))?;
        if other.cost < BETTER * report.cost {
            (pose, report) = (second, other);
        }
    }
    Ok(IkSolution { missed: missed(&pose), pose, iterations: report.iterations, converged: report.converged })
}

/// A pose on the way from one to another: `t` 0 and 1 are these. Between poses that limits allow it is allowed too.
///
/// # Errors
/// [`IkError::Character`] for poses of another skeleton.
pub fn between(skeleton: &Skeleton, from: &Pose, to: &Pose, t: f64) -> Result<Pose, IkError> {
    let (mut pose, _, _) = (from.clone(), skeleton.globals(from)?, skeleton.globals(to)?);
    for ((joint, local), target) in skeleton.joints().iter().zip(&mut pose.locals).zip(&to.locals) {
        local.translation += (target.translation - local.translation) * t;
        local.scale += (target.scale - local.scale) * t;
        local.rotation = match &joint.limits {
            None => turned(&local.rotation, &target.rotation, t),
            Some(limits) => {
                let rest = joint.rest.rotation;
                let [mut a, b] = [&local.rotation, &target.rotation].map(|r| limits.split(&(rest.inverse() * r)));
                a.swing += (b.swing - a.swing) * t;
                a.twist += (b.twist - a.twist) * t;
                rest * limits.turn(&a)
            }
        };
    }
    Ok(pose)
}

/// On the great circle, the short way.
fn turned(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>, t: f64) -> UnitQuaternion<f64> {
    let turn = a.inverse() * b;
    let turn = if turn.w < 0.0 { UnitQuaternion::new_unchecked(-turn.into_inner()) } else { turn };
    a * UnitQuaternion::from_scaled_axis(turn.scaled_axis() * t)
}

/// The pose with every joint within its limits; others are left as they are.
pub fn within_limits(skeleton: &Skeleton, pose: &Pose) -> Pose {
    let mut pose = pose.clone();
    for (joint, local) in skeleton.joints().iter().zip(&mut pose.locals) {
        if let Some(limits) = &joint.limits {
            let turn = joint.rest.rotation.inverse() * local.rotation;
            if !limits.allows(&turn, 0.0) {
                local.rotation = joint.rest.rotation * limits.project(&turn);
            }
        }
    }
    pose
}

fn check(skeleton: &Skeleton, targets: &[Target]) -> Result<(), IkError> {
    let joints = skeleton.joint_count();
    for (number, target) in targets.iter().enumerate() {
        let mut named = vec![target.joint];
        let finite = match &target.goal {
            Goal::Position { point, at } => point.iter().chain(at.iter()).all(|x| x.is_finite()),
            Goal::Orientation(turn) => turn.coords.iter().all(|x| x.is_finite()),
            Goal::LookAt { axis, at } => axis.iter().chain(at.iter()).all(|x| x.is_finite()),
            Goal::Pole { root, middle, at } => {
                named.extend([*root, *middle]);
                at.iter().all(|x| x.is_finite())
            }
        };
        if let Some(&joint) = named.iter().find(|&&j| j as usize >= joints) {
            return Err(IkError::Unknown { target: number, joint, joints });
        }
        if !finite {
            return Err(IkError::NotFinite { target: number });
        }
        if !(target.weight > 0.0 && target.weight.is_finite()) {
            return Err(IkError::Weight { target: number, weight: target.weight });
        }
        if let Goal::Pole { root, middle, .. } = target.goal
            && !(above(skeleton, middle, root) && above(skeleton, target.joint, middle))
        {
            return Err(IkError::Chain { target: number });
        }
    }
    Ok(())
}

/// Whether `ancestor` lies above a joint.
fn above(skeleton: &Skeleton, joint: u32, ancestor: u32) -> bool {
    let parent = |j: u32| skeleton.joints()[j as usize].parent;
    std::iter::successors(parent(joint), |&j| parent(j)).any(|j| j == ancestor)
}
