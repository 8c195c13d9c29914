//! All targets as one damped least-squares problem.
//!
//! There are many more coordinates (three per joint) than residuals (three per target), and all that is added to `JᵀJ` is block-diagonal:
//! the damping, the stiffness of blocked directions and the pull to rest, together `B`. By the push-through identity the step is
//!
//! ```text
//! (JᵀJ + B) δ = −Jᵀr − g₀        δ = −B⁻¹ (g₀ + Jᵀ y),    (I + J B⁻¹ Jᵀ) y = r − J B⁻¹ g₀
//! ```
//!
//! with `g₀` the gradient of the pull to rest: a system of the size of the residuals, and `J` kept as the 3 × 3 blocks that are not zero.
//! The cost is linear in the number of joints.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::frames::Frames;
use super::residual::{Lever, jacobian, residual};
use super::variables::{Motion, Variables};
use super::{Target, above};
use crate::character::{Pose, Skeleton};
use plumbline_num::optim::levenberg_marquardt::DampedProblem;

/// Stiffness of a direction blocked by limits, relative to the largest diagonal entry: large enough to stop the step to 1e-8, small enough
/// for the factor to keep half its digits.
const BLOCKED_STIFFNESS: f64 = 1e8;

/// A nonzero block of the Jacobian.
struct Block {
    target: usize,
    jacobian: Matrix3<f64>,
}

/// The problem at the current pose.
pub(super) struct Problem<'a> {
    skeleton: &'a Skeleton,
    targets: &'a [Target],
    variables: &'a Variables,
    /// Unit of each target's residual.
    scales: Vec<f64>,
    rest: f64,
    pose: Pose,
    frames: Frames,
    trial: Pose,
    trial_frames: Frames,
    /// Weighted residuals, three per target.
    residuals: DVector<f64>,
    /// Blocks of the Jacobian by variable, targets ascending.
    columns: Vec<Vec<Block>>,
    /// Second derivative and gradient `g₀` of the pull to rest, by variable.
    to_rest: Vec<(Matrix3<f64>, Vector3<f64>)>,
    /// Gradient of the cost, by variable.
    gradient: Vec<Vector3<f64>>,
}

impl<'a> Problem<'a> {
    pub(super) fn new(
        skeleton: &'a Skeleton,
        targets: &'a [Target],
        variables: &'a Variables,
        start: &Frames,
        pose: Pose,
        rest: f64,
    ) -> Self {
        let count = variables.motions.len();
        let frames = Frames::chained(skeleton, &pose);
        Self {
            skeleton,
            targets,
            variables,
            // Chain lengths are constant under rotation of joints.
            scales: targets.iter().map(|t| start.scale(t)).collect(),
            rest,
            trial_frames: frames.clone(),
            frames,
            trial: pose.clone(),
            pose,
            residuals: DVector::zeros(3 * targets.len()),
            columns: (0..count).map(|_| Vec::new()).collect(),
            to_rest: vec![(Matrix3::zeros(), Vector3::zeros()); count],
            gradient: vec![Vector3::zeros(); count],
        }
    }

    pub(super) fn into_pose(self) -> Pose {
        self.pose
    }

    /// Gradient at the current pose.
    #[cfg(test)]
    pub(super) fn gradient(&mut self) -> Vec<f64> {
        self.linearize();
        self.gradient.iter().flat_map(|g| [g.x, g.y, g.z]).collect()
    }

    /// Cost of the current pose.
    pub(super) fn cost(&self) -> f64 {
        self.cost_of(&self.pose, &self.frames)
    }

    fn cost_of(&self, pose: &Pose, frames: &Frames) -> f64 {
        let mut cost = 0.0;
        for (target, scale) in self.targets.iter().zip(&self.scales) {
            cost += 0.5 * (target.weight * residual(target, frames, *scale)).norm_squared();
        }
        if self.rest > 0.0 {
            for motion in &self.variables.motions {
                let (from_rest, _) = motion.at(self.skeleton, pose).rotation_from_rest();
                cost += 0.5 * (self.rest * from_rest).norm_squared();
            }
        }
        cost
    }

    fn lever(&self, motion: Motion) -> Lever {
        let j = motion.joint();
        let parent = self.skeleton.joints()[j as usize].parent.map(|p| p as usize);
        let linear =
            parent.map_or_else(Matrix3::identity, |p| self.frames.world[p].fixed_view::<3, 3>(0, 0).into_owned());
        let rotation =
            parent.map_or_else(Matrix3::identity, |p| self.frames.rotation[p].to_rotation_matrix().into_inner());
        let translates = matches!(motion, Motion::Translation(_));
        Lever {
            origin: self.frames.at(j),
            // A singular frame moves nothing that could be measured.
            inverse: linear.try_inverse().unwrap_or_else(Matrix3::zeros),
            linear,
            rotation,
            velocities: if translates {
                linear * self.variables.unit
            } else {
                motion.at(self.skeleton, &self.pose).velocities()
            },
            translates,
        }
    }

    /// The inverse block of `B` for each variable; directions that active limits block are stiffened (penalty form of an active set).
    fn damping(&self, lambda: f64) -> Option<Vec<Matrix3<f64>>> {
        let diagonal = |k: usize| {
            let columns = self.columns[k].iter().map(|b| b.jacobian.map(|x| x * x).row_sum().transpose());
            columns.sum::<Vector3<f64>>() + self.to_rest[k].0.diagonal()
        };
        let diagonals: Vec<Vector3<f64>> = (0..self.columns.len()).map(diagonal).collect();
        let most = diagonals.iter().map(Vector3::amax).fold(f64::MIN_POSITIVE, f64::max);
        let block = |(k, motion): (usize, &Motion)| {
            let damped = diagonals[k].map(|d| lambda * d.max(1e-9 * most) + f64::MIN_POSITIVE);
            let mut block = self.to_rest[k].0 + Matrix3::from_diagonal(&damped);
            for normal in motion.at(self.skeleton, &self.pose).blocked(&-self.gradient[k]) {
                block += normal * normal.transpose() * (BLOCKED_STIFFNESS * most);
            }
            block.cholesky().map(|factor| factor.inverse())
        };
        self.variables.motions.iter().enumerate().map(block).collect()
    }

    /// The damped step, by variable.
    fn step(&self, inverse: &[Matrix3<f64>]) -> Option<Vec<Vector3<f64>>> {
        let rows = self.residuals.len();
        let (mut system, mut right) = (DMatrix::identity(rows, rows), self.residuals.clone());
        for ((column, inverse), (_, to_rest)) in self.columns.iter().zip(inverse).zip(&self.to_rest) {
            for (i, a) in column.iter().enumerate() {
                let scaled = a.jacobian * inverse;
                let mut rows = right.fixed_rows_mut::<3>(3 * a.target);
                rows -= scaled * to_rest;
                for b in &column[..=i] {
                    // Targets ascend: this is the lower triangle, all that the factorization reads.
                    let mut block = system.fixed_view_mut::<3, 3>(3 * a.target, 3 * b.target);
                    block += scaled * b.jacobian.transpose();
                }
            }
        }
        let y = system.cholesky()?.solve(&right);
        let along = |k: usize| {
            let pulled = self.columns[k].iter().map(|b| b.jacobian.transpose() * y.fixed_rows::<3>(3 * b.target));
            -inverse[k] * (self.to_rest[k].1 + pulled.sum::<Vector3<f64>>())
        };
        Some((0..self.columns.len()).map(along).collect())
    }

    /// Decrease of the cost that the quadratic model predicts for a step.
    fn predicted(&self, step: &[Vector3<f64>]) -> f64 {
        let mut moved = DVector::<f64>::zeros(self.residuals.len());
        let mut change = 0.0;
        for (k, step) in step.iter().enumerate() {
            for block in &self.columns[k] {
                let mut rows = moved.fixed_rows_mut::<3>(3 * block.target);
                rows += block.jacobian * step;
            }
            change += self.gradient[k].dot(step) + 0.5 * step.dot(&(self.to_rest[k].0 * step));
        }
        -(change + 0.5 * moved.norm_squared())
    }
}

impl DampedProblem for Problem<'_> {
    fn linearize(&mut self) {
        let motions = &self.variables.motions;
        let levers: Vec<Lever> = motions.iter().map(|motion| self.lever(*motion)).collect();
        self.columns.iter_mut().for_each(Vec::clear);
        self.gradient.fill(Vector3::zeros());
        for (t, (target, scale)) in self.targets.iter().zip(&self.scales).enumerate() {
            let r = residual(target, &self.frames, *scale) * target.weight;
            self.residuals.fixed_rows_mut::<3>(3 * t).copy_from(&r);
            for &k in &self.variables.of_target[t] {
                let joint = motions[k].joint();
                let moves = |j: u32| j == target.joint || j == joint || above(self.skeleton, j, joint);
                let jacobian = jacobian(target, &self.frames, *scale, &levers[k], moves) * target.weight;
                self.gradient[k] += jacobian.transpose() * r;
                self.columns[k].push(Block { target: t, jacobian });
            }
        }
        if self.rest > 0.0 {
            for (k, motion) in motions.iter().enumerate() {
                let (from_rest, change) = motion.at(self.skeleton, &self.pose).rotation_from_rest();
                let weighted = change.transpose() * (self.rest * self.rest);
                self.to_rest[k] = (weighted * change, weighted * from_rest);
                self.gradient[k] += self.to_rest[k].1;
            }
        }
    }

    fn propose(&mut self, lambda: f64) -> Option<f64> {
        let mut step = self.step(&self.damping(lambda)?)?;
        for (motion, step) in self.variables.motions.iter().zip(&mut step) {
            let local = &mut self.trial.locals[motion.joint() as usize];
            *step = motion.at(self.skeleton, &self.pose).stepped(*step, self.variables.unit, local);
        }
        let gain = self.predicted(&step);
        // A step that projection onto the limits turned uphill is rejected; more damping shortens it.
        (gain > 0.0 || step.iter().all(|s| s.amax() == 0.0)).then_some(gain.max(0.0))
    }

    fn trial_cost(&mut self) -> f64 {
        self.trial_frames.chain(self.skeleton, &self.trial);
        self.cost_of(&self.trial, &self.trial_frames)
    }

    fn accept(&mut self) {
        self.pose.clone_from(&self.trial);
        std::mem::swap(&mut self.frames, &mut self.trial_frames);
    }
}
