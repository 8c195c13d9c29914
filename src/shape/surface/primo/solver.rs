//! The prisms of a mesh with a set of handles: built once, solved for many poses.

use nalgebra::{Matrix3, Point3, Vector3};

use super::super::lanes::Lanes;
use super::clusters::{self, Clusters};
use super::global::Global;
use super::prisms::{mean_edge, prisms};
use super::shell::{BodyPose, Joint, Shell};
use super::sweep::sweep;
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
/// Sweeps of local shape matching after each step on a level; they smooth the error within its clusters.
const SWEEPS: usize = 3;

/// A constrained vertex.
#[derive(Clone, Copy, Debug)]
pub(super) struct Anchor {
    pub(super) vertex: u32,
    /// Weight of a soft constraint, `None` for a hard one.
    pub(super) soft: Option<f64>,
}

/// The target of an anchor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Target {
    pub(super) position: Point3<f64>,
    /// Rotation of the surface there, if known.
    pub(super) rotation: Option<Matrix3<f64>>,
}

/// A fixed body, posed by its anchors.
#[derive(Clone, Copy, Debug)]
enum FixedBody {
    /// A triangle of anchors (their indices).
    Triangle { body: u32, anchors: [u32; 3] },
    /// The fixed end of the springs of an anchor.
    Point { body: u32, anchor: u32 },
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
    anchors: Vec<Anchor>,
    fixed_bodies: Vec<FixedBody>,
    pub(super) shell: Shell,
    pub(super) levels: Vec<Clusters>,
    globals: Vec<Option<Global>>,
    largest_system: usize,
    /// Triangles without area.
    pub(super) degenerate: usize,
}

impl Solver {
    /// `unconstrained`: whether each vertex is in a component without a handle.
    pub(super) fn new(
        mesh: &TriMesh,
        anchors: Vec<Anchor>,
        unconstrained: &[bool],
        options: &PrimoOptions,
        material: &ShellMaterial<'_>,
    ) -> Self {
        let origin = mesh.bounding_box().map_or_else(Vector3::zeros, |(a, b)| nalgebra::center(&a, &b).coords);
        let rest = mesh.with_positions(mesh.positions().iter().map(|p| p - origin).collect());
        let rest = rest.expect("finite positions minus their center");
        let mut shell = prisms(&rest, options.thickness * mean_edge(&rest), material);
        let degenerate = Cotangents::new(&rest, CotangentRule::Raw).degenerate();
        let fixed_bodies = fix_bodies(&mut shell, &rest, &anchors, unconstrained);
        let free = &shell.free;
        shell.joints.retain(|joint| joint.weight > 0.0 && joint.bodies.iter().any(|&b| free[b as usize]));
        let levels = clusters::levels(&shell, material.rigid, MIN_CLUSTERS);
        let globals = levels.iter().map(|_| None).collect();
        Self {
            rest,
            origin,
            anchors,
            fixed_bodies,
            shell,
            levels,
            globals,
            largest_system: options.largest_system,
            degenerate,
        }
    }

    /// The candidate with the least energy, after the fixed bodies are at their targets.
    pub(super) fn best_of(&self, mut candidates: Vec<Vec<BodyPose>>, targets: &[Target]) -> Vec<BodyPose> {
        for poses in &mut candidates {
            self.place_fixed(targets, poses);
        }
        let energy = |poses: &Vec<BodyPose>| self.shell.energy(poses);
        candidates.into_iter().min_by(|a, b| energy(a).total_cmp(&energy(b))).expect("one candidate at least")
    }

    /// All bodies moved by the best rigid motion to the targets.
    pub(super) fn rigidly_moved(&self, targets: &[Target]) -> Vec<BodyPose> {
        let from: Vec<_> = self.anchors.iter().map(|a| self.rest.positions()[a.vertex as usize].coords).collect();
        let to: Vec<_> = targets.iter().map(|w| w.position.coords - self.origin).collect();
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
    fn place_fixed(&self, targets: &[Target], poses: &mut [BodyPose]) {
        for (body, _) in self.shell.free.iter().enumerate().filter(|(_, free)| !**free) {
            poses[body] = BodyPose { rotation: Matrix3::identity(), at: self.shell.centers[body] };
        }
        for fixed in &self.fixed_bodies {
            match *fixed {
                FixedBody::Point { body, anchor } => {
                    poses[body as usize].at = targets[anchor as usize].position.coords - self.origin;
                }
                FixedBody::Triangle { body, anchors } => {
                    let of = anchors.map(|a| targets[a as usize]);
                    let from = anchors.map(|a| self.rest.positions()[self.anchors[a as usize].vertex as usize].coords);
                    let to = of.map(|target| target.position.coords - self.origin);
                    let mut pose = Shell::fit(&self.shell.centers[body as usize], &from, &to);
                    if let [Some(a), Some(b), Some(c)] = of.map(|target| target.rotation) {
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
        let finest = (0..self.levels.len()).find(|&l| self.levels[l].count <= self.largest_system);
        let finest = finest.unwrap_or(self.levels.len() - 1);
        for level in (finest.max(1)..self.levels.len()).rev() {
            self.relax(level, &mut state, MAX_COARSE_STEPS, false, floor, run)?;
        }
        let mut newton = false;
        while state.energies.len() <= convergence.max_iterations && !state.converged {
            run.step(state.energies.len() as f64 / convergence.max_iterations as f64)?;
            let before = state.last();
            self.relax(finest, &mut state, 1, newton, floor, run)?;
            if finest > 0 {
                for _ in 0..SWEEPS {
                    run.check()?;
                    sweep(&self.shell, &self.levels[0], &mut state.poses);
                }
                let swept = self.shell.energy(&state.poses);
                *state.energies.last_mut().expect("a step was taken") = swept;
            }
            let now = state.last();
            newton = before - now <= NEWTON_THRESHOLD * before;
            state.converged = now <= floor || before - now <= convergence.tolerance * before;
        }
        Ok(state)
    }

    /// Global steps on one level, each followed by local shape matching.
    fn relax(
        &mut self,
        level: usize,
        state: &mut Minimized,
        steps: usize,
        newton: bool,
        floor: f64,
        run: &Run,
    ) -> Result<(), SparseError> {
        let clusters = &self.levels[level];
        if self.globals[level].is_none() {
            run.check()?;
            self.globals[level] = Some(Global::new(&self.shell, clusters)?);
        }
        let global = self.globals[level].as_mut().expect("made just now");
        for _ in 0..steps {
            run.check()?;
            let before = state.last();
            let mut now = global.step(&self.shell, clusters, &mut state.poses, before, newton, run)?;
            if level > 0 {
                for _ in 0..SWEEPS {
                    run.check()?;
                    sweep(&self.shell, clusters, &mut state.poses);
                }
                now = self.shell.energy(&state.poses);
            }
            state.energies.push(now);
            if now <= floor || before - now <= COARSE_TOLERANCE * before {
                break;
            }
        }
        Ok(())
    }

    /// Positions of the vertices: the mean over the prisms around each, targets for hard constraints, rest positions for vertices of
    /// no triangle.
    pub(super) fn positions(&self, poses: &[BodyPose], targets: &[Target]) -> Vec<Point3<f64>> {
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
        for (anchor, target) in self.anchors.iter().zip(targets) {
            if anchor.soft.is_none() {
                positions[anchor.vertex as usize] = target.position;
            }
        }
        positions
    }
}

impl Minimized {
    pub(super) fn last(&self) -> f64 {
        *self.energies.last().expect("the energy of the initial guess")
    }
}

/// Fixes the prisms with three hard constraints and those of unconstrained components, and adds springs for the other anchors.
fn fix_bodies(shell: &mut Shell, rest: &TriMesh, anchors: &[Anchor], unconstrained: &[bool]) -> Vec<FixedBody> {
    let mut anchor_of = vec![u32::MAX; rest.vertex_count()];
    for (k, anchor) in anchors.iter().enumerate() {
        anchor_of[anchor.vertex as usize] = k as u32;
    }
    let exact = |k: u32| anchors.get(k as usize).is_some_and(|a| a.soft.is_none());
    let (mut fixed_bodies, mut carried) = (Vec::new(), vec![false; anchors.len()]);
    let mut around = vec![Vec::new(); anchors.len()];
    for (t, corners) in rest.triangles().iter().enumerate() {
        let of_corners = corners.map(|v| anchor_of[v as usize]);
        if of_corners.iter().all(|&k| exact(k)) {
            shell.free[t] = false;
            fixed_bodies.push(FixedBody::Triangle { body: t as u32, anchors: of_corners });
            for k in of_corners {
                carried[k as usize] = true;
            }
        } else if corners.iter().any(|&v| unconstrained[v as usize]) {
            shell.free[t] = false;
        } else {
            of_corners.iter().filter(|&&k| k != u32::MAX).for_each(|&k| around[k as usize].push(t as u32));
        }
    }
    for (k, anchor) in anchors.iter().enumerate().filter(|&(k, _)| !carried[k]) {
        let (body, position) = (shell.centers.len() as u32, rest.positions()[anchor.vertex as usize].coords);
        shell.centers.push(position);
        shell.free.push(false);
        fixed_bodies.push(FixedBody::Point { body, anchor: k as u32 });
        let weight = anchor.soft.unwrap_or(HARD_SPRING_WEIGHT) / around[k].len().max(1) as f64;
        shell.joints.extend(around[k].iter().map(|&t| Joint::spring([t, body], weight, position)));
    }
    fixed_bodies
}
