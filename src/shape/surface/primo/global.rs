//! Gauss–Newton and Newton steps in the velocities of all clusters.
//!
//! Cluster `c` moves by `x ↦ x + v_c + ω_c × (x − z_c)` about its center `z_c`. Both sides of a joint are linear in six numbers and
//! the energy is quadratic in `6 m` (Gauss–Newton, the paper's global step); its minimizer is a descent direction. Near the
//! minimum the second derivative of the rotations is added while the matrix stays positive definite (Newton): four steps per
//! digit become two steps for all digits. Velocities become rigid motions by a rotation about the axis `ω` by `arctan ‖tω‖`,
//! equal to first order; the step `t` is halved until the energy has decreased sufficiently ([`plumbline_num::optim::newton`]).
//!
//! A system over a few thousand clusters is factored. A larger one is solved by conjugate gradients ([`super::multigrid`]), only
//! as far as the step is worth it (an inexact Newton method), and factored after all where they converge slowly, as in a shell
//! without thickness, or break down.
//!
//! Departure from the paper, which moves along a helix: rotation about the center and translation agree with it to first order.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::clusters::{Clusters, FIXED};
use super::multigrid::{Cycle, Transfer};
use super::shell::{BodyPose, Joint, Shell};
use crate::mesh::operators::max_multiplications;
use plumbline_num::optim::newton::{DescentEnd, DescentOptions, DescentProblem, descend};
use plumbline_num::run::Run;
use plumbline_num::sparse::{BlockMatrix, Cholesky, Ordering, SparseError, SparseMatrix, Stop, conjugate_gradients};

/// Damping added to the diagonal, relative to its largest entry, for rotations that no joint resists (a hinge without thickness,
/// a body on one spring). More slows convergence near the minimum.
const DAMPING: f64 = 1e-10;
/// How far conjugate gradients go. A residual of a tenth leaves about a hundredth of the energy that a step can gain; with a
/// hundredth of the residual a bent tube of 40 000 prisms takes half as long again, with a fifth it takes as long in more steps.
/// Sixty iterations are more than any step took at the default thickness (45, on a horse of 97 000 triangles); thin shells took up to
/// 125 (R. Dembo, S. Eisenstat, T. Steihaug, *Inexact Newton methods*, SIAM J. Numer. Anal. 19, 1982).
const INEXACT: Stop = Stop { max_iterations: 60, tolerance: 0.1 };

/// The linear system in the velocities of the clusters of a level.
#[derive(Debug)]
pub(super) struct Global {
    pub(super) matrix: BlockMatrix<6>,
    gradient: Vec<f64>,
    /// Symbolic factorization once, numeric factorization per step; `None` where the system is too large.
    direct: Option<(SparseMatrix, Cholesky)>,
}

impl Global {
    /// Zero; `factored`: a system that is solved by factoring it.
    pub(super) fn new(shell: &Shell, clusters: &Clusters, factored: bool) -> Result<Self, SparseError> {
        let ends = |joint: &Joint| joint.bodies.map(|b| clusters.of_body[b as usize]);
        let pairs = shell.joints.iter().map(ends).filter(|&[a, b]| a != FIXED && b != FIXED).map(|[a, b]| (a, b));
        let matrix = BlockMatrix::new(clusters.count, pairs);
        let direct = if factored { Some(Self::analyze(&matrix, rest_positions(shell, clusters))?) } else { None };
        Ok(Self { gradient: vec![0.0; 6 * clusters.count], matrix, direct })
    }

    fn analyze(matrix: &BlockMatrix<6>, positions: Vec<[f64; 3]>) -> Result<(SparseMatrix, Cholesky), SparseError> {
        let pattern = matrix.pattern()?;
        let most = max_multiplications(pattern.n());
        let factor = Cholesky::analyze_within(&pattern, &Ordering::NestedDissection(positions), most)?;
        Ok((SparseMatrix::zeros(pattern), factor))
    }

    #[cfg(test)]
    pub(super) fn is_factored(&self) -> bool {
        self.direct.is_some()
    }

    /// The numeric factorization.
    fn factor(&mut self, run: &Run) -> Result<&mut Cholesky, SparseError> {
        let (entries, factor) = self.direct.as_mut().expect("a system that is factored");
        self.matrix.fill(entries);
        factor.factor(entries, run)?;
        Ok(factor)
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
        self.matrix.clear();
        for joint in &shell.joints {
            let ends = joint.bodies.map(|b| clusters.of_body[b as usize]);
            if ends[0] != ends[1] {
                let derivatives = JointDerivatives::new(shell, poses, joint, ends, centers);
                self.add(joint, ends, &derivatives, newton);
            }
        }
        self.damp();
    }

    fn add(&mut self, joint: &Joint, ends: [u32; 2], derivatives: &JointDerivatives, newton: bool) {
        for (side, &end) in ends.iter().enumerate().filter(|(_, end)| **end != FIXED) {
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
            self.matrix.add_diagonal(end as usize, &block);
        }
        if ends.iter().all(|&end| end != FIXED) {
            self.matrix.add(ends[0] as usize, ends[1] as usize, &derivatives.block(joint, 0, 1));
        }
    }

    /// Rotations and translations have different units: each is damped relative to its own diagonal entries.
    fn damp(&mut self) {
        let n = self.matrix.block_rows();
        let damping = [0, 3].map(|first| {
            let entries = (0..n).flat_map(|c| (first..first + 3).map(move |k| (c, k)));
            let largest = entries.map(|(c, k)| self.matrix.diagonal(c)[(k, k)]).fold(0.0, f64::max);
            if largest > 0.0 { DAMPING * largest } else { 1.0 }
        });
        let damping = nalgebra::Matrix6::from_diagonal(&nalgebra::Vector6::from_fn(|k, _| damping[k / 3]));
        for c in 0..n {
            self.matrix.add_diagonal(c, &damping);
        }
    }
}

/// A minimization on one level of clusters.
pub(super) struct Level<'a> {
    pub(super) shell: &'a Shell,
    /// Its clusters, and those of the coarser levels.
    pub(super) clusters: &'a [Clusters],
    /// Their systems; the last one at least is factored.
    pub(super) systems: &'a mut [Global],
    /// Maximum number of clusters of a system that is factored where conjugate gradients converge slowly.
    pub(super) largest: usize,
}

impl Level<'_> {
    /// One step; returns the energy after it, or `before` if no step decreases it. `newton` selects Newton's matrix.
    pub(super) fn step(
        &mut self,
        poses: &mut Vec<BodyPose>,
        before: f64,
        newton: bool,
        run: &Run,
    ) -> Result<f64, SparseError> {
        let centers = self.clusters.iter().map(|clusters| centers(clusters, poses)).collect();
        let (velocity, trial, failed) = (Vec::new(), Vec::new(), None);
        let mut at = Linearized { level: self, poses, centers, before, newton, run, velocity, trial, failed };
        let one = DescentOptions { max_iterations: 1, tolerance: 0.0, floor: 0.0 };
        let report = descend(&mut at, &one, run)?;
        match at.failed.filter(|_| report.end == DescentEnd::NoDirection) {
            Some(error) => Err(error),
            None => Ok(report.energies.last().copied().unwrap_or(before)),
        }
    }
}

/// The energy about the present poses, for one step of Newton's method.
struct Linearized<'a, 'b> {
    level: &'a mut Level<'b>,
    poses: &'a mut Vec<BodyPose>,
    /// Centers of the clusters of each level.
    centers: Vec<Vec<Vector3<f64>>>,
    /// Energy of the poses.
    before: f64,
    newton: bool,
    run: &'a Run,
    velocity: Vec<f64>,
    /// The poses of the last step length tried.
    trial: Vec<BodyPose>,
    /// Why Gauss–Newton's system could not be solved.
    failed: Option<SparseError>,
}

impl Linearized<'_, '_> {
    /// Solves for the velocities.
    fn solve(&mut self, newton: bool) -> Result<(), SparseError> {
        let Level { shell, clusters, largest, .. } = *self.level;
        let (systems, centers, run) = (&mut *self.level.systems, &self.centers, self.run);
        systems[0].linearize(shell, &clusters[0], self.poses, &centers[0], newton);
        self.velocity = systems[0].gradient.iter().map(|g| -g).collect();
        let factored = systems.iter().position(|system| system.direct.is_some());
        let factored = factored.expect("the coarsest system is factored");
        if factored > 0 {
            let at = |k: usize| (&clusters[k], &centers[k][..]);
            let transfers: Vec<Transfer> = (0..factored).map(|k| Transfer::new(at(k), at(k + 1))).collect();
            for (k, transfer) in transfers.iter().enumerate() {
                let (fine, coarse) = systems.split_at_mut(k + 1);
                transfer.coarsen(&fine[k].matrix, &mut coarse[0].matrix);
            }
            let (finer, rest) = systems.split_at_mut(factored);
            let matrices = finer.iter().map(|system| &system.matrix);
            let force = std::mem::replace(&mut self.velocity, vec![0.0; 6 * clusters[0].count]);
            let cycle = rest[0].factor(run).and_then(|last| Cycle::new(matrices.zip(transfers), last));
            let solved = cycle.and_then(|mut cycle| {
                conjugate_gradients(&finer[0].matrix, &force, &mut self.velocity, &mut cycle, &INEXACT, run)
            });
            let truncated = match solved {
                Ok(report) if report.converged => return Ok(()),
                Ok(_) => Ok(()),
                Err(error) => Err(error),
            };
            // Newton's matrix is given up where it is refused, Gauss–Newton's is factored.
            if clusters[0].count > largest || (newton && truncated.is_err()) {
                return truncated;
            }
            run.check()?;
            let positions = centers[0].iter().flat_map(|&center| [center.into(); 6]).collect();
            let system = &mut systems[0];
            let Ok(direct) = Global::analyze(&system.matrix, positions) else { return truncated };
            system.direct = Some(direct);
            self.velocity = force;
        }
        systems[0].factor(run)?.solve_in_place(&mut self.velocity);
        Ok(())
    }
}

impl DescentProblem for Linearized<'_, '_> {
    fn energy(&mut self) -> f64 {
        self.before
    }

    /// Newton's matrix first, where it is asked for; any shift stands for Gauss–Newton's, which is positive definite.
    fn direction(&mut self, shift: f64) -> Option<f64> {
        if self.failed.is_some() {
            return None;
        }
        let newton = self.newton && shift == 0.0;
        if let Err(error) = self.solve(newton) {
            self.failed = (!newton).then_some(error);
            return None;
        }
        // The linearized function is half the energy.
        let gradient = &self.level.systems[0].gradient;
        Some(2.0 * gradient.iter().zip(&self.velocity).map(|(g, v)| g * v).sum::<f64>())
    }

    fn energy_along(&mut self, alpha: f64) -> f64 {
        self.trial = moved(&self.level.clusters[0], self.poses, &self.centers[0], &self.velocity, alpha);
        self.level.shell.energy(&self.trial)
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
