//! The prisms of one mesh under one set of handles: bound once, posed many times.

use nalgebra::{Matrix3, Point3, Vector3};

use super::super::lanes::Lanes;
use super::clusters::{self, Clusters};
use super::global::Global;
use super::prisms::{mean_edge, prisms};
use super::shell::{BodyPose, Joint, Shell};
use super::sweep::sweep;
use super::{Fabric, PrimoOptions, STIFF_SPRING};
use crate::mesh::TriMesh;
use crate::mesh::operators::{CotangentRule, Cotangents};
use plumbline_num::energy::Convergence;
use plumbline_num::math::nearest_rotation;
use plumbline_num::run::Run;
use plumbline_num::sparse::SparseError;

/// Clusters of the coarsest level: a system of this size costs next to nothing.
const MIN_CLUSTERS: usize = 60;
/// A coarse level is left when a step gains less than this share of the energy: what it cannot do finer levels must.
const COARSE_TOLERANCE: f64 = 1e-2;
/// Steps on a coarse level at most.
const COARSE_STEPS: usize = 12;
/// The minimum is near when a step gains less than this share of the energy: Newton's matrix is worth a try.
const NEAR: f64 = 0.2;
/// Rounds of local shape matching after each visit to a level; they even out what the level's clusters could not.
const SWEEPS: usize = 3;

/// A vertex that is held.
#[derive(Clone, Copy, Debug)]
pub(super) struct Anchor {
    pub(super) vertex: u32,
    /// Weight of its spring, `None` where it is held exactly.
    pub(super) soft: Option<f64>,
}

/// Where an anchor is wanted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wish {
    pub(super) position: Point3<f64>,
    /// How the surface is turned there, where that is known.
    pub(super) turn: Option<Matrix3<f64>>,
}

/// What decides where a body stands that may not move.
#[derive(Clone, Copy, Debug)]
enum Ground {
    /// A triangle of anchors (numbers among them).
    Triangle { body: u32, anchors: [u32; 3] },
    /// One end of the springs of an anchor.
    Point { body: u32, anchor: u32 },
}

/// How a minimization went.
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
    grounds: Vec<Ground>,
    pub(super) shell: Shell,
    pub(super) levels: Vec<Clusters>,
    globals: Vec<Option<Global>>,
    largest_system: usize,
    /// Triangles without area.
    pub(super) degenerate: usize,
}

impl Solver {
    /// `still` says of each vertex whether its part of the surface is held by nothing.
    pub(super) fn new(
        mesh: &TriMesh,
        anchors: Vec<Anchor>,
        still: &[bool],
        options: &PrimoOptions,
        fabric: &Fabric<'_>,
    ) -> Self {
        let origin = mesh.bounding_box().map_or_else(Vector3::zeros, |(a, b)| nalgebra::center(&a, &b).coords);
        let rest = mesh.with_positions(mesh.positions().iter().map(|p| p - origin).collect());
        let rest = rest.expect("finite positions less their middle");
        let mut shell = prisms(&rest, options.thickness * mean_edge(&rest), fabric);
        let degenerate = Cotangents::new(&rest, CotangentRule::Raw).degenerate();
        let grounds = ground(&mut shell, &rest, &anchors, still);
        let free = &shell.free;
        shell.joints.retain(|joint| joint.weight > 0.0 && joint.bodies.iter().any(|&b| free[b as usize]));
        let levels = clusters::levels(&shell, fabric.rigid, MIN_CLUSTERS);
        let globals = levels.iter().map(|_| None).collect();
        Self {
            rest,
            origin,
            anchors,
            grounds,
            shell,
            levels,
            globals,
            largest_system: options.largest_system,
            degenerate,
        }
    }

    /// Of these poses those of the least energy, once the fixed bodies stand where they are wished.
    pub(super) fn best_of(&self, mut candidates: Vec<Vec<BodyPose>>, wishes: &[Wish]) -> Vec<BodyPose> {
        for poses in &mut candidates {
            self.place(wishes, poses);
        }
        let energy = |poses: &Vec<BodyPose>| self.shell.energy(poses);
        candidates.into_iter().min_by(|a, b| energy(a).total_cmp(&energy(b))).expect("one candidate at least")
    }

    /// All bodies moved as the wishes are on the whole.
    pub(super) fn moved_whole(&self, wishes: &[Wish]) -> Vec<BodyPose> {
        let held: Vec<_> = self.anchors.iter().map(|a| self.rest.positions()[a.vertex as usize].coords).collect();
        let wanted: Vec<_> = wishes.iter().map(|w| w.position.coords - self.origin).collect();
        let whole = Shell::fit(&Vector3::zeros(), &held, &wanted);
        let moved = |c: &Vector3<f64>| BodyPose { turn: whole.turn, at: whole.at + whole.turn * c };
        self.shell.centers.iter().map(moved).collect()
    }

    /// Bodies as they fit positions of the vertices: each cluster of the finest level as one, fixed ones by themselves.
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

    /// Puts the fixed bodies where they are wished, those of unheld parts where they were.
    fn place(&self, wishes: &[Wish], poses: &mut [BodyPose]) {
        for (body, _) in self.shell.free.iter().enumerate().filter(|(_, free)| !**free) {
            poses[body] = BodyPose { turn: Matrix3::identity(), at: self.shell.centers[body] };
        }
        for ground in &self.grounds {
            match *ground {
                Ground::Point { body, anchor } => {
                    poses[body as usize].at = wishes[anchor as usize].position.coords - self.origin;
                }
                Ground::Triangle { body, anchors } => {
                    let of = anchors.map(|a| wishes[a as usize]);
                    let from = anchors.map(|a| self.rest.positions()[self.anchors[a as usize].vertex as usize].coords);
                    let to = of.map(|wish| wish.position.coords - self.origin);
                    let mut pose = Shell::fit(&self.shell.centers[body as usize], &from, &to);
                    if let [Some(a), Some(b), Some(c)] = of.map(|wish| wish.turn) {
                        pose.turn = nearest_rotation(&(a + b + c));
                    }
                    poses[body as usize] = pose;
                }
            }
        }
    }

    /// Coarse to fine, then all prisms until the energy stands.
    pub(super) fn minimize(
        &mut self,
        poses: Vec<BodyPose>,
        convergence: &Convergence,
        run: &Run,
    ) -> Result<Minimized, SparseError> {
        let mut state = Minimized { energies: vec![self.shell.energy(&poses)], poses, converged: false };
        // Below the rounding of joints a diagonal long there is nothing to gain.
        let weights: f64 = self.shell.joints.iter().map(|j| j.weight).sum();
        let floor = weights * (1e-15 * self.rest.diagonal()).powi(2);
        if self.levels[0].count == 0 || state.energies[0] <= floor {
            state.converged = true;
            return Ok(state);
        }
        let finest = (0..self.levels.len()).find(|&l| self.levels[l].count <= self.largest_system);
        let finest = finest.unwrap_or(self.levels.len() - 1);
        for level in (finest.max(1)..self.levels.len()).rev() {
            self.relax(level, &mut state, COARSE_STEPS, false, floor, run)?;
        }
        let mut curved = false;
        while state.energies.len() <= convergence.max_iterations && !state.converged {
            run.step(state.energies.len() as f64 / convergence.max_iterations as f64)?;
            let before = state.last();
            self.relax(finest, &mut state, 1, curved, floor, run)?;
            if finest > 0 {
                for _ in 0..SWEEPS {
                    run.check()?;
                    sweep(&self.shell, &self.levels[0], &mut state.poses);
                }
                let swept = self.shell.energy(&state.poses);
                *state.energies.last_mut().expect("a step was taken") = swept;
            }
            let now = state.last();
            curved = before - now <= NEAR * before;
            state.converged = now <= floor || before - now <= convergence.tolerance * before;
        }
        Ok(state)
    }

    /// Global steps on one level, each with local shape matching after it.
    fn relax(
        &mut self,
        level: usize,
        state: &mut Minimized,
        steps: usize,
        curved: bool,
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
            let mut now = global.step(&self.shell, clusters, &mut state.poses, before, curved, run)?;
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

    /// Positions of the vertices: the mean over the prisms around each; wishes where they are held exactly; where no prism is
    /// and nothing is held, the rest shape.
    pub(super) fn positions(&self, poses: &[BodyPose], wishes: &[Wish]) -> Vec<Point3<f64>> {
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
        for (anchor, wish) in self.anchors.iter().zip(wishes) {
            if anchor.soft.is_none() {
                positions[anchor.vertex as usize] = wish.position;
            }
        }
        positions
    }
}

impl Minimized {
    pub(super) fn last(&self) -> f64 {
        *self.energies.last().expect("the energy at the start")
    }
}

/// Fixes the prisms of triangles of exact anchors and of unheld parts, and ties springs to the other anchors.
fn ground(shell: &mut Shell, rest: &TriMesh, anchors: &[Anchor], still: &[bool]) -> Vec<Ground> {
    let mut anchor_of = vec![u32::MAX; rest.vertex_count()];
    for (k, anchor) in anchors.iter().enumerate() {
        anchor_of[anchor.vertex as usize] = k as u32;
    }
    let exact = |k: u32| anchors.get(k as usize).is_some_and(|a| a.soft.is_none());
    let (mut grounds, mut carried) = (Vec::new(), vec![false; anchors.len()]);
    let mut around = vec![Vec::new(); anchors.len()];
    for (t, corners) in rest.triangles().iter().enumerate() {
        let held = corners.map(|v| anchor_of[v as usize]);
        if held.iter().all(|&k| exact(k)) {
            shell.free[t] = false;
            grounds.push(Ground::Triangle { body: t as u32, anchors: held });
            for k in held {
                carried[k as usize] = true;
            }
        } else if corners.iter().any(|&v| still[v as usize]) {
            shell.free[t] = false;
        } else {
            held.iter().filter(|&&k| k != u32::MAX).for_each(|&k| around[k as usize].push(t as u32));
        }
    }
    for (k, anchor) in anchors.iter().enumerate().filter(|&(k, _)| !carried[k]) {
        let (body, place) = (shell.centers.len() as u32, rest.positions()[anchor.vertex as usize].coords);
        shell.centers.push(place);
        shell.free.push(false);
        grounds.push(Ground::Point { body, anchor: k as u32 });
        let weight = anchor.soft.unwrap_or(STIFF_SPRING) / around[k].len().max(1) as f64;
        shell.joints.extend(around[k].iter().map(|&t| Joint::spring([t, body], weight, place)));
    }
    grounds
}
