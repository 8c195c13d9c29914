//! All targets as one damped least-squares problem.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::frames::Frames;
use super::residual::{Lever, jacobian, residual};
use super::variables::{Coordinates, Variables};
use super::{Target, above};
use crate::character::{Pose, Skeleton};
use plumbline_num::optim::levenberg_marquardt::DampedProblem;

/// Stiffness of a direction blocked by limits, relative to the largest diagonal entry: large enough to stop the step to 1e-8, small enough
/// for the Cholesky factor to keep half its digits.
const BLOCKED_STIFFNESS: f64 = 1e8;

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
    hessian: DMatrix<f64>,
    gradient: DVector<f64>,
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
        let size = 3 * variables.joints.len();
        Self {
            skeleton,
            targets,
            variables,
            // Chain lengths are constant under rotation of joints.
            scales: targets.iter().map(|t| start.scale(t)).collect(),
            rest,
            frames: Frames::chained(skeleton, &pose),
            trial: pose.clone(),
            pose,
            hessian: DMatrix::zeros(size, size),
            gradient: DVector::zeros(size),
        }
    }

    pub(super) fn into_pose(self) -> Pose {
        self.pose
    }

    /// Gradient at the current pose.
    #[cfg(test)]
    pub(super) fn gradient(&mut self) -> DVector<f64> {
        self.linearize();
        self.gradient.clone()
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
        for &j in &self.variables.joints {
            let (from_rest, _) = Coordinates::of(self.skeleton, pose, j).rotation_from_rest();
            cost += 0.5 * (self.rest * from_rest).norm_squared();
        }
        cost
    }

    fn lever(&self, j: u32) -> Lever {
        let parent = self.skeleton.joints()[j as usize].parent.map(|p| p as usize);
        let linear =
            parent.map_or_else(Matrix3::identity, |p| self.frames.world[p].fixed_view::<3, 3>(0, 0).into_owned());
        let rotation =
            parent.map_or_else(Matrix3::identity, |p| self.frames.rotation[p].to_rotation_matrix().into_inner());
        Lever {
            origin: self.frames.at(j),
            // A singular frame moves nothing that could be measured.
            inverse: linear.try_inverse().unwrap_or_else(Matrix3::zeros),
            linear,
            rotation,
            velocities: Coordinates::of(self.skeleton, &self.pose, j).velocities(),
        }
    }

    /// Stiffens the directions that active limits block (penalty form of an active set).
    fn stiffen(&self, matrix: &mut DMatrix<f64>) {
        let most = self.hessian.diagonal().amax().max(f64::MIN_POSITIVE);
        for (k, &j) in self.variables.joints.iter().enumerate() {
            let push: Vector3<f64> = -self.gradient.fixed_rows::<3>(3 * k).into_owned();
            for normal in Coordinates::of(self.skeleton, &self.pose, j).blocked(&push) {
                let mut block = matrix.fixed_view_mut::<3, 3>(3 * k, 3 * k);
                block += normal * normal.transpose() * (BLOCKED_STIFFNESS * most);
            }
        }
    }
}

impl DampedProblem for Problem<'_> {
    fn linearize(&mut self) {
        self.hessian.fill(0.0);
        self.gradient.fill(0.0);
        let joints = &self.variables.joints;
        let levers: Vec<Lever> = joints.iter().map(|&j| self.lever(j)).collect();
        for (t, (target, scale)) in self.targets.iter().zip(&self.scales).enumerate() {
            let r = residual(target, &self.frames, *scale) * target.weight;
            let columns: Vec<(usize, Matrix3<f64>)> = self.variables.of_target[t]
                .iter()
                .map(|&k| {
                    let moves = |j: u32| j == joints[k] || above(self.skeleton, j, joints[k]);
                    (k, jacobian(target, &self.frames, *scale, &levers[k], moves) * target.weight)
                })
                .collect();
            for (k, a) in &columns {
                let mut rows = self.gradient.fixed_rows_mut::<3>(3 * k);
                rows += a.transpose() * r;
                for (l, b) in &columns {
                    let mut block = self.hessian.fixed_view_mut::<3, 3>(3 * k, 3 * l);
                    block += a.transpose() * b;
                }
            }
        }
        for (k, &j) in joints.iter().enumerate() {
            let (from_rest, change) = Coordinates::of(self.skeleton, &self.pose, j).rotation_from_rest();
            let weight = self.rest * self.rest;
            let mut rows = self.gradient.fixed_rows_mut::<3>(3 * k);
            rows += change.transpose() * from_rest * weight;
            let mut block = self.hessian.fixed_view_mut::<3, 3>(3 * k, 3 * k);
            block += change.transpose() * change * weight;
        }
    }

    fn propose(&mut self, lambda: f64) -> Option<f64> {
        let mut damped = self.hessian.clone();
        let least = damped.diagonal().amax() * 1e-9;
        for k in 0..damped.nrows() {
            damped[(k, k)] += lambda * damped[(k, k)].max(least) + f64::MIN_POSITIVE;
        }
        self.stiffen(&mut damped);
        let step = -damped.cholesky()?.solve(&self.gradient);
        let mut taken = step.clone();
        for (k, &j) in self.variables.joints.iter().enumerate() {
            let part: Vector3<f64> = step.fixed_rows::<3>(3 * k).into_owned();
            let (rotation, possible) = Coordinates::of(self.skeleton, &self.pose, j).stepped(part);
            self.trial.locals[j as usize].rotation = rotation;
            taken.fixed_rows_mut::<3>(3 * k).copy_from(&possible);
        }
        let gain = -(self.gradient.dot(&taken) + 0.5 * taken.dot(&(&self.hessian * &taken)));
        // A step that projection onto the limits turned uphill is rejected; more damping shortens it.
        (gain > 0.0 || taken.amax() == 0.0).then_some(gain.max(0.0))
    }

    fn trial_cost(&mut self) -> f64 {
        self.cost_of(&self.trial, &Frames::chained(self.skeleton, &self.trial))
    }

    fn accept(&mut self) {
        self.pose.clone_from(&self.trial);
        self.frames = Frames::chained(self.skeleton, &self.pose);
    }
}
