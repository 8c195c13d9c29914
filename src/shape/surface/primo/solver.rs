//! The prisms of a mesh with a set of handles: built once, solved for many poses.

use nalgebra::{Matrix3, Point3, Vector3};

use super::super::lanes::Lanes;
use super::super::{Constraint, HandlePose, Handles};
use super::clusters::{self, Clusters};
use super::global::{Global, Level};
use super::prisms::{mean_edge, prisms};
use super::shell::{BodyPose, Joint, Shell};
use super::{HARD_SPRING_WEIGHT, PrimoOptions, ShellMaterial};
use crate::mesh::TriMesh;
use crate::mesh::operators::{CotangentRule, Cotangents};
use plumbline_num::energy::Convergence;
use plumbline_num::math::nearest_rotation;
use plumbline_num::run::Run;
use plumbline_num::sparse::SparseError;

/// Clusters of the coarsest level: a system of this size is solved in a millisecond.
const MIN_CLUSTERS: usize = 60;
/// Relative energy decrease per step below which a coarse level ends: the remaining energy needs finer clusters.
const COARSE_TOLERANCE: f64 = 1e-2;
/// Maximum steps on a coarse level.
const MAX_COARSE_STEPS: usize = 12;
/// Relative energy decrease per step below which Newton's matrix is tried: farther from the minimum it is mostly indefinite.
const NEWTON_THRESHOLD: f64 = 0.2;
/// So many times [`super::PrimoOptions::largest_system`] a system may be that is factored because conjugate gradients converge slowly.
const FACTORED_AFTER_ALL: usize = 10;

/// A fixed body, posed by its handles.
#[derive(Clone, Copy, Debug)]
enum FixedBody {
    /// A triangle of handles (their indices).
    Triangle { body: u32, handles: [u32; 3] },
    /// The fixed end of the springs of a handle.
    Point { body: u32, handle: u32 },
}

/// The result of a minimization.
#[derive(Debug)]
pub(super) struct Minimized {
    pub(super) poses: Vec<BodyPose>,
    pub(super) energies: Vec<f64>,
    pub(super) converged: bool,
}

#[derive(Debug)]
pub(super) struct Solver {
    rest: TriMesh,
    origin: Vector3<f64>,
    handles: Handles,
    fixed_bodies: Vec<FixedBody>,
    pub(super) shell: Shell,
    pub(super) levels: Vec<Clusters>,
    /// The linear system of each level, from the first minimization on.
    pub(super) systems: Vec<Global>,
    largest_system: usize,
    /// Triangles without area.
    pub(super) degenerate: usize,
}

impl Solver {
    /// `unconstrained`: whether each vertex is in a component without a handle.
    pub(super) fn new(
        mesh: &TriMesh,
        handles: &Handles,
        unconstrained: &[bool],
        options: &PrimoOptions,
        material: &ShellMaterial<'_>,
    ) -> Self {
        let origin = mesh.bounding_box().map_or_else(Vector3::zeros, |(a, b)| nalgebra::center(&a, &b).coords);
        let rest = mesh.with_positions(mesh.positions().iter().map(|p| p - origin).collect());
        let rest = rest.expect("finite positions minus their center");
        let mut shell = prisms(&rest, options.thickness * mean_edge(&rest), material);
        let degenerate = Cotangents::new(&rest, CotangentRule::Raw).degenerate();
        let fixed_bodies = fix_bodies(&mut shell, &rest, handles, unconstrained);
        let free = &shell.free;
        shell.joints.retain(|joint| joint.weight > 0.0 && joint.bodies.iter().any(|&b| free[b as usize]));
        let levels = clusters::levels(&shell, material.rigid, MIN_CLUSTERS);
        Self {
            rest,
            origin,
            handles: handles.clone(),
            fixed_bodies,
            shell,
            levels,
            systems: Vec::new(),
            largest_system: options.largest_system,
            degenerate,
        }
    }

    /// The candidate with the least energy, after the fixed bodies are at their targets.
    pub(super) fn best_of(&self, mut candidates: Vec<Vec<BodyPose>>, pose: &HandlePose) -> Vec<BodyPose> {
        for poses in &mut candidates {
            self.place_fixed(pose, poses);
        }
        let energy = |poses: &Vec<BodyPose>| self.shell.energy(poses);
        candidates.into_iter().min_by(|a, b| energy(a).total_cmp(&energy(b))).expect("one candidate at least")
    }

    /// All bodies moved by the best rigid motion to the targets.
    pub(super) fn rigidly_moved(&self, pose: &HandlePose) -> Vec<BodyPose> {
        let from: Vec<_> = self.handles.vertices().iter().map(|&v| self.rest.positions()[v as usize].coords).collect();
        let to: Vec<_> = pose.positions().iter().map(|p| p.coords - self.origin).collect();
        let whole = Shell::fit(&Vector3::zeros(), &from, &to);
        let moved = |c: &Vector3<f64>| BodyPose { rotation: whole.rotation, at: whole.at + whole.rotation * c };
        self.shell.centers.iter().map(moved).collect()
    }

    /// Poses fitted to positions of the vertices: one rigid motion per cluster of the finest level, and per fixed body.
    pub(super) fn fitted(&self, positions: &[Lanes]) -> Vec<BodyPose> {
        let (mut poses, finest) = (self.shell.rest(), &self.levels[0]);
        let fixed =
            (0..self.rest.triangle_count()).filter(|&t| finest.of_body[t] == clusters::FIXED).map(|t| vec![t as u32]);
        let free = (0..finest.count).map(|c| finest.members(c).to_vec());
        for group in fixed.chain(free) {
            let corners = || group.iter().flat_map(|&t| self.rest.triangles()[t as usize]).map(|v| v as usize);
            let from: Vec<_> = corners().map(|v| self.rest.positions()[v].coords).collect();
            let to: Vec<_> = corners().map(|v| Vector3::from(positions[v].xyz())).collect();
            for &body in &group {
                poses[body as usize] = Shell::fit(&self.shell.centers[body as usize], &from, &to);
            }
        }
        poses
    }

    /// Sets the fixed bodies to their targets, those of unconstrained components to their rest poses.
    fn place_fixed(&self, handle_pose: &HandlePose, poses: &mut [BodyPose]) {
        let target = |handle: u32| handle_pose.positions()[handle as usize].coords - self.origin;
        let rest = |handle: u32| self.rest.positions()[self.handles.vertices()[handle as usize] as usize].coords;
        for (body, _) in self.shell.free.iter().enumerate().filter(|(_, free)| !**free) {
            poses[body] = BodyPose { rotation: Matrix3::identity(), at: self.shell.centers[body] };
        }
        for fixed in &self.fixed_bodies {
            match *fixed {
                FixedBody::Point { body, handle } => poses[body as usize].at = target(handle),
                FixedBody::Triangle { body, handles } => {
                    let center = &self.shell.centers[body as usize];
                    let mut pose = Shell::fit(center, &handles.map(rest), &handles.map(target));
                    if let Some(rotations) = handle_pose.rotations() {
                        let matrix = |h: u32| rotations[h as usize].to_rotation_matrix().into_inner();
                        let [a, b, c] = handles.map(matrix);
                        pose.rotation = nearest_rotation(&(a + b + c));
                    }
                    poses[body as usize] = pose;
                }
            }
        }
    }

    /// Minimizes from coarse to fine clusters, then over all prisms until convergence.
    pub(super) fn minimize(
        &mut self,
        poses: Vec<BodyPose>,
        convergence: &Convergence,
        run: &Run,
    ) -> Result<Minimized, SparseError> {
        let mut state = Minimized { energies: vec![self.shell.energy(&poses)], poses, converged: false };
        // Rounding error of the energy of joints one diagonal long.
        let weights: f64 = self.shell.joints.iter().map(|j| j.weight).sum();
        let floor = weights * (1e-15 * self.rest.diagonal()).powi(2);
        if self.levels[0].count == 0 || state.energies[0] <= floor {
            state.converged = true;
            return Ok(state);
        }
        if self.systems.is_empty() {
            self.systems = self.linear_systems()?;
        }
        for level in (1..self.levels.len()).rev() {
            self.relax(level, &mut state, MAX_COARSE_STEPS, false, floor, run)?;
        }
        let mut newton = false;
        while state.energies.len() <= convergence.max_iterations && !state.converged {
            run.step(state.energies.len() as f64 / convergence.max_iterations as f64)?;
            let before = state.last();
            self.relax(0, &mut state, 1, newton, floor, run)?;
            let now = state.last();
            newton = before - now <= NEWTON_THRESHOLD * before;
            state.converged = now <= floor || before - now <= convergence.tolerance * before;
        }
        Ok(state)
    }

    fn linear_systems(&self) -> Result<Vec<Global>, SparseError> {
        let coarsest = self.levels.len() - 1;
        let system = |(level, clusters): (usize, &Clusters)| {
            Global::new(&self.shell, clusters, clusters.count <= self.largest_system || level == coarsest)
        };
        self.levels.iter().enumerate().map(system).collect()
    }

    /// Steps on one level.
    fn relax(
        &mut self,
        level: usize,
        state: &mut Minimized,
        steps: usize,
        newton: bool,
        floor: f64,
        run: &Run,
    ) -> Result<(), SparseError> {
        let largest = self.largest_system.saturating_mul(FACTORED_AFTER_ALL);
        let (clusters, systems) = (&self.levels[level..], &mut self.systems[level..]);
        let mut level = Level { shell: &self.shell, clusters, systems, largest };
        for _ in 0..steps {
            run.check()?;
            let before = state.last();
            let now = level.step(&mut state.poses, before, newton, run)?;
            state.energies.push(now);
            if now <= floor || before - now <= COARSE_TOLERANCE * before {
                break;
            }
        }
        Ok(())
    }

    /// Positions of the vertices: the mean over the prisms around each, targets for hard constraints, rest positions for vertices of
    /// no triangle.
    pub(super) fn positions(&self, poses: &[BodyPose], pose: &HandlePose) -> Vec<Point3<f64>> {
        let mut sums = vec![(Vector3::zeros(), 0.0); self.rest.vertex_count()];
        for (t, corners) in self.rest.triangles().iter().enumerate() {
            for &v in corners {
                let (sum, count) = &mut sums[v as usize];
                *sum += self.shell.carry(poses, t, &self.rest.positions()[v as usize].coords);
                *count += 1.0;
            }
        }
        let mean = |(&(sum, count), rest): (&(Vector3<f64>, f64), &Point3<f64>)| {
            Point3::from(if count > 0.0 { sum / count } else { rest.coords } + self.origin)
        };
        let mut positions: Vec<_> = sums.iter().zip(self.rest.positions()).map(mean).collect();
        let handles = self.handles.vertices().iter().zip(self.handles.constraints()).zip(pose.positions());
        for ((&vertex, _), target) in handles.filter(|((_, constraint), _)| **constraint == Constraint::Hard) {
            positions[vertex as usize] = *target;
        }
        positions
    }
}

impl Minimized {
    pub(super) fn last(&self) -> f64 {
        *self.energies.last().expect("the energy of the initial guess")
    }
}

/// Fixes the prisms with three hard constraints and those of unconstrained components, and adds springs for the other handles.
fn fix_bodies(shell: &mut Shell, rest: &TriMesh, handles: &Handles, unconstrained: &[bool]) -> Vec<FixedBody> {
    let mut handle_of = vec![u32::MAX; rest.vertex_count()];
    handles.vertices().iter().zip(0..).for_each(|(&v, k)| handle_of[v as usize] = k);
    let exact = |k: u32| handles.constraints().get(k as usize) == Some(&Constraint::Hard);
    let (mut fixed_bodies, mut carried) = (Vec::new(), vec![false; handles.len()]);
    let mut around = vec![Vec::new(); handles.len()];
    for (t, corners) in rest.triangles().iter().enumerate() {
        let of_corners = corners.map(|v| handle_of[v as usize]);
        if of_corners.iter().all(|&k| exact(k)) {
            shell.free[t] = false;
            fixed_bodies.push(FixedBody::Triangle { body: t as u32, handles: of_corners });
            for k in of_corners {
                carried[k as usize] = true;
            }
        } else if corners.iter().any(|&v| unconstrained[v as usize]) {
            shell.free[t] = false;
        } else {
            of_corners.iter().filter(|&&k| k != u32::MAX).for_each(|&k| around[k as usize].push(t as u32));
        }
    }
    for (k, &vertex) in handles.vertices().iter().enumerate().filter(|&(k, _)| !carried[k]) {
        let (body, position) = (shell.centers.len() as u32, rest.positions()[vertex as usize].coords);
        shell.centers.push(position);
        shell.free.push(false);
        fixed_bodies.push(FixedBody::Point { body, handle: k as u32 });
        let total = match handles.constraints()[k] {
            Constraint::Hard => HARD_SPRING_WEIGHT,
            Constraint::Soft(weight) => weight,
        };
        let weight = total / around[k].len().max(1) as f64;
        shell.joints.extend(around[k].iter().map(|&t| Joint::spring([t, body], weight, position)));
    }
    fixed_bodies
}
