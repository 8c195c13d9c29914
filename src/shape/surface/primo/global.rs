//! Gauss–Newton and Newton steps in the velocities of all clusters.
//!
//! Cluster `c` moves by `x ↦ x + v_c + ω_c × (x − z_c)` about its center `z_c`. Both sides of a joint are linear in six numbers and
//! the energy is quadratic in `6 m` (Gauss–Newton, the paper's global step); its minimizer is a descent direction. Near the
//! minimum the second derivative of the rotations is added while the matrix stays positive definite (Newton): four steps per
//! digit become two steps for all digits. Velocities become rigid motions by a rotation about the axis `ω` by `arctan ‖tω‖`,
//! equal to first order; the step `t` is halved until the energy has decreased sufficiently ([`plumbline_num::optim::newton`]).
//!
//! Departure from the paper, which moves along a helix: rotation about the center and translation agree with it to first order.

use std::sync::Arc;

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::clusters::{Clusters, FIXED};
use super::shell::{BodyPose, Joint, Shell};
use crate::mesh::operators::max_multiplications;
use plumbline_num::optim::newton::{DescentEnd, DescentOptions, DescentProblem, descend};
use plumbline_num::run::Run;
use plumbline_num::sparse::{Cholesky, Ordering, Pattern, SparseError, SparseMatrix};

/// Damping added to the diagonal, relative to its largest entry, for rotations that no joint resists (a hinge without thickness,
/// a body on one spring). More slows convergence near the minimum.
const DAMPING: f64 = 1e-10;

/// Newton steps over the velocities of the clusters: symbolic factorization once, numeric factorization per step.
#[derive(Debug)]
pub(super) struct Global {
    matrix: SparseMatrix,
    factor: Cholesky,
    gradient: Vec<f64>,
    /// For each joint between two clusters, the slots of the first row of each of the six columns of its block.
    blocks: Vec<[u32; 6]>,
    /// For each joint, its index in `blocks` (`u32::MAX`: none).
    block_of: Vec<u32>,
}

impl Global {
    pub(super) fn new(shell: &Shell, clusters: &Clusters) -> Result<Self, SparseError> {
        let ends = |joint: &Joint| joint.bodies.map(|b| clusters.of_body[b as usize]);
        let joined = |&[a, b]: &[u32; 2]| a != b && a != FIXED && b != FIXED;
        let mut pairs: Vec<[u32; 2]> = shell.joints.iter().map(ends).filter(joined).collect();
        for pair in &mut pairs {
            pair.sort_unstable();
        }
        pairs.sort_unstable();
        pairs.dedup();
        pairs.extend((0..clusters.count as u32).map(|c| [c, c]));
        let entries = pairs.iter().flat_map(|&[a, b]| {
            (0..36).map(move |k| (6 * b as usize + k % 6, 6 * a as usize + k / 6)).filter(|(row, col)| row >= col)
        });
        let pattern = Arc::new(Pattern::new(6 * clusters.count, entries)?);
        let (mut blocks, mut block_of) = (Vec::new(), vec![u32::MAX; shell.joints.len()]);
        for (joint, block) in shell.joints.iter().zip(&mut block_of) {
            let mut pair = ends(joint);
            if joined(&pair) {
                pair.sort_unstable();
                *block = blocks.len() as u32;
                let slot = |col: usize| pattern.slot(6 * pair[1] as usize, 6 * pair[0] as usize + col);
                blocks.push(std::array::from_fn(|col| {
                    slot(col).expect("the pattern has every pair of connected clusters") as u32
                }));
            }
        }
        let ordering = Ordering::NestedDissection(rest_positions(shell, clusters));
        let factor = Cholesky::analyze_within(&pattern, &ordering, max_multiplications(pattern.n()))?;
        Ok(Self { gradient: vec![0.0; pattern.n()], matrix: SparseMatrix::zeros(pattern), factor, blocks, block_of })
    }

    /// One step; returns the energy after it, or `before` if no step decreases it. `newton` selects Newton's matrix.
    pub(super) fn step(
        &mut self,
        shell: &Shell,
        clusters: &Clusters,
        poses: &mut Vec<BodyPose>,
        before: f64,
        newton: bool,
        run: &Run,
    ) -> Result<f64, SparseError> {
        let centers = centers(clusters, poses);
        let (trial, velocity, failed) = (Vec::new(), Vec::new(), None);
        let mut at =
            Linearized { global: self, shell, clusters, poses, centers, before, newton, run, trial, velocity, failed };
        let one = DescentOptions { max_iterations: 1, tolerance: 0.0, floor: 0.0 };
        let report = descend(&mut at, &one, run)?;
        match at.failed.filter(|_| report.end == DescentEnd::NoDirection) {
            Some(error) => Err(error),
            None => Ok(report.energies.last().copied().unwrap_or(before)),
        }
    }

    /// Gradient of half the energy by the velocities of the clusters, at rest: `(ω, v)` of each.
    #[cfg(test)]
    pub(super) fn gradient(&mut self, shell: &Shell, clusters: &Clusters, poses: &[BodyPose]) -> &[f64] {
        self.linearize(shell, clusters, poses, &centers(clusters, poses), false);
        &self.gradient
    }

    fn linearize(
        &mut self,
        shell: &Shell,
        clusters: &Clusters,
        poses: &[BodyPose],
        centers: &[Vector3<f64>],
        newton: bool,
    ) {
        self.gradient.fill(0.0);
        self.matrix.values_mut().fill(0.0);
        for (k, joint) in shell.joints.iter().enumerate() {
            let ends = joint.bodies.map(|b| clusters.of_body[b as usize]);
            if ends[0] != ends[1] {
                let derivatives = JointDerivatives::new(shell, poses, joint, ends, centers);
                self.add(joint, ends, &derivatives, k, newton);
            }
        }
        self.damp();
    }

    fn add(&mut self, joint: &Joint, ends: [u32; 2], derivatives: &JointDerivatives, k: usize, newton: bool) {
        for (side, &end) in ends.iter().enumerate() {
            if end != FIXED {
                let first = 6 * end as usize;
                let (angular, linear) = derivatives.gradient(joint, side);
                for i in 0..3 {
                    self.gradient[first + i] += angular[i];
                    self.gradient[first + 3 + i] += linear[i];
                }
                let mut block = derivatives.block(joint, side, side);
                if newton {
                    let mut angular = block.fixed_view_mut::<3, 3>(0, 0);
                    angular += derivatives.curvature(joint, side);
                }
                self.add_diagonal(first, &block);
            }
        }
        if let Some(slots) = self.blocks.get(self.block_of[k] as usize) {
            let (row, col) = if ends[0] > ends[1] { (0, 1) } else { (1, 0) };
            let block = derivatives.block(joint, row, col);
            let values = self.matrix.values_mut();
            for (c, &slot) in slots.iter().enumerate() {
                for r in 0..6 {
                    values[slot as usize + r] += block[(r, c)];
                }
            }
        }
    }

    /// Adds to the diagonal block of a cluster: rows from the diagonal down are contiguous.
    fn add_diagonal(&mut self, first: usize, block: &nalgebra::Matrix6<f64>) {
        for c in 0..6 {
            let start = self.matrix.pattern().column_starts()[first + c] as usize;
            for r in c..6 {
                self.matrix.values_mut()[start + r - c] += block[(r, c)];
            }
        }
    }

    fn damp(&mut self) {
        let starts: Vec<usize> = self.matrix.pattern().column_starts().iter().map(|&s| s as usize).collect();
        let values = self.matrix.values_mut();
        // Rotations and translations have different units: each is damped relative to its own diagonal entries.
        let diagonal = |kind: usize| starts[..starts.len() - 1].iter().skip(3 * kind).step_by(6).copied();
        for kind in 0..2 {
            let largest = diagonal(kind).map(|s| values[s]).fold(0.0, f64::max);
            let damping = if largest > 0.0 { DAMPING * largest } else { 1.0 };
            for k in 0..3 {
                for s in starts[..starts.len() - 1].iter().skip(3 * kind + k).step_by(6) {
                    values[*s] += damping;
                }
            }
        }
    }
}

/// The energy about the present poses, for one step of Newton's method.
struct Linearized<'a> {
    global: &'a mut Global,
    shell: &'a Shell,
    clusters: &'a Clusters,
    poses: &'a mut Vec<BodyPose>,
    centers: Vec<Vector3<f64>>,
    /// Energy of the poses.
    before: f64,
    newton: bool,
    run: &'a Run,
    velocity: Vec<f64>,
    /// The poses of the last step length tried.
    trial: Vec<BodyPose>,
    /// Why Gauss–Newton's matrix could not be factored.
    failed: Option<SparseError>,
}

impl DescentProblem for Linearized<'_> {
    fn energy(&mut self) -> f64 {
        self.before
    }

    /// Newton's matrix first, where it is asked for; any shift stands for Gauss–Newton's, which is positive definite.
    fn direction(&mut self, shift: f64) -> Option<f64> {
        if self.failed.is_some() {
            return None;
        }
        let newton = self.newton && shift == 0.0;
        self.global.linearize(self.shell, self.clusters, self.poses, &self.centers, newton);
        if let Err(error) = self.global.factor.factor(&self.global.matrix, self.run) {
            self.failed = (!newton).then_some(error);
            return None;
        }
        self.velocity = self.global.gradient.iter().map(|g| -g).collect();
        self.global.factor.solve_in_place(&mut self.velocity);
        // The linearized function is half the energy.
        Some(2.0 * self.global.gradient.iter().zip(&self.velocity).map(|(g, v)| g * v).sum::<f64>())
    }

    fn energy_along(&mut self, alpha: f64) -> f64 {
        self.trial = moved(self.clusters, self.poses, &self.centers, &self.velocity, alpha);
        self.shell.energy(&self.trial)
    }

    fn step(&mut self, _alpha: f64) {
        std::mem::swap(self.poses, &mut self.trial);
    }
}

/// Derivatives of the energy of a joint between two clusters, the sides 0 and 1.
struct JointDerivatives {
    /// Vector from the center of the cluster to the joint, for each side.
    arm: [Vector3<f64>; 2],
    /// `T_i(o) − T_j(o)`.
    gap: Vector3<f64>,
    /// `R_i S R_jᵀ` for all pairs of sides.
    moment: [[Matrix3<f64>; 2]; 2],
}

impl JointDerivatives {
    fn new(shell: &Shell, poses: &[BodyPose], joint: &Joint, ends: [u32; 2], centers: &[Vector3<f64>]) -> Self {
        let sides = shell.sides(poses, joint);
        let arm = |k: usize| centers.get(ends[k] as usize).map_or_else(Vector3::zeros, |z| sides[k].at - z);
        let moment = |i: usize, j: usize| sides[i].rotation * joint.moment * sides[j].rotation.transpose();
        let mixed = moment(0, 1);
        Self {
            arm: [arm(0), arm(1)],
            gap: sides[0].at - sides[1].at,
            moment: [[moment(0, 0), mixed], [mixed.transpose(), moment(1, 1)]],
        }
    }

    /// Gradient of half the energy by `ω` and `v` of one side.
    fn gradient(&self, joint: &Joint, side: usize) -> (Vector3<f64>, Vector3<f64>) {
        let force = self.gap * if side == 0 { joint.weight } else { -joint.weight };
        // Σ a × b over the moment's vectors, a on this side, b on the other.
        let p = &self.moment[side][1 - side];
        let torque = Vector3::new(p.m23 - p.m32, p.m31 - p.m13, p.m12 - p.m21);
        (self.arm[side].cross(&force) - torque, force)
    }

    /// Block of the Gauss–Newton matrix with rows of side `i` and columns of side `j`.
    fn block(&self, joint: &Joint, i: usize, j: usize) -> nalgebra::Matrix6<f64> {
        let sign = if i == j { 1.0 } else { -1.0 };
        let w = sign * joint.weight;
        let (a, b) = (self.arm[i], self.arm[j]);
        let p = &self.moment[i][j];
        // [a]ᵀ[b] = (a·b) I − b aᵀ for the matrices of the cross product.
        let angular = (Matrix3::identity() * a.dot(&b) - b * a.transpose()) * w
            + (Matrix3::identity() * p.trace() - p.transpose()) * sign;
        let mut block = nalgebra::Matrix6::zeros();
        block.fixed_view_mut::<3, 3>(0, 0).copy_from(&angular);
        // v + ω × a = v − [a] ω.
        block.fixed_view_mut::<3, 3>(0, 3).copy_from(&(a.cross_matrix() * w));
        block.fixed_view_mut::<3, 3>(3, 0).copy_from(&(b.cross_matrix() * -w));
        block.fixed_view_mut::<3, 3>(3, 3).copy_from(&(Matrix3::identity() * w));
        block
    }

    /// The additional term of Newton's matrix in the rotations of one side: the second-order term `½ ω × (ω × a)` of rotating an
    /// arm `a`, times the residual.
    fn curvature(&self, joint: &Joint, side: usize) -> Matrix3<f64> {
        let gap = if side == 0 { self.gap } else { -self.gap };
        let product =
            self.arm[side] * gap.transpose() * joint.weight + self.moment[side][side] - self.moment[side][1 - side];
        symmetric(&product) - Matrix3::identity() * product.trace()
    }
}

/// The symmetric part.
fn symmetric(m: &Matrix3<f64>) -> Matrix3<f64> {
    (m + m.transpose()) * 0.5
}

/// Mean position of the bodies of each cluster.
fn centers(clusters: &Clusters, poses: &[BodyPose]) -> Vec<Vector3<f64>> {
    means(clusters, poses.iter().map(|pose| pose.at))
}

/// Rest position of each unknown (six per cluster), for the elimination order.
fn rest_positions(shell: &Shell, clusters: &Clusters) -> Vec<[f64; 3]> {
    means(clusters, shell.centers.iter().copied()).into_iter().flat_map(|c| [c.into(); 6]).collect()
}

fn means(clusters: &Clusters, of_bodies: impl Iterator<Item = Vector3<f64>>) -> Vec<Vector3<f64>> {
    let mut sums = vec![(Vector3::zeros(), 0.0); clusters.count];
    for (position, &c) in of_bodies.zip(&clusters.of_body) {
        if let Some((sum, n)) = sums.get_mut(c as usize) {
            *sum += position;
            *n += 1.0;
        }
    }
    sums.into_iter().map(|(sum, n)| sum / n).collect()
}

/// The poses after time `t`.
fn moved(clusters: &Clusters, poses: &[BodyPose], centers: &[Vector3<f64>], velocity: &[f64], t: f64) -> Vec<BodyPose> {
    let motion = |c: usize| {
        let part = |k: usize| Vector3::from_column_slice(&velocity[6 * c + k..6 * c + k + 3]) * t;
        let speed = part(0).norm();
        let angle = if speed > 0.0 { part(0) * (speed.atan() / speed) } else { Vector3::zeros() };
        (Rotation3::new(angle).into_inner(), part(3))
    };
    let motions: Vec<_> = (0..clusters.count).map(motion).collect();
    let moved = |(pose, &c): (&BodyPose, &u32)| match motions.get(c as usize) {
        None => *pose,
        Some((rotation, shift)) => {
            let center = centers[c as usize];
            BodyPose { rotation: rotation * pose.rotation, at: center + shift + rotation * (pose.at - center) }
        }
    };
    poses.iter().zip(&clusters.of_body).map(moved).collect()
}
