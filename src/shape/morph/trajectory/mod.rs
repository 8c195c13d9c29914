//! What lies between two poses of one mesh.
//!
//! Triangle `t` goes from the first pose to the second by `Aₜ = Rₜ Sₜ`. At time `τ` it should be turned and stretched by
//!
//! ```text
//! Aₜ(τ) = exp(τ ωₜ) ((1 − τ) I + τ Sₜ),        its edges   (1 − τ) exp(τ ωₜ) a  +  τ exp((τ − 1) ωₜ) b,
//! ```
//!
//! `exp ωₜ = Rₜ`, `a` and `b` the edges of both poses; where triangles turn far, relative to their neighbors ([`unwinding`]). The positions
//! whose edges are nearest to that solve a Poisson equation. They are then improved to be as rigid as possible towards both ends:
//!
//! ```text
//! min over x, Pₜ, Qₜ   Σ_t Σ_{e ∈ t} h_e [ (1 − τ) |e(x) − Pₜ a|² + τ |e(x) − Qₜ b|² ]
//! ```
//!
//! The weights `h` are the means of the half cotangents of both poses, so that the matrix is the same for every time, even for one
//! that varies over the surface ([`Trajectory::blend`]): one factor serves all frames. Everything is symmetric in the two poses.
//! What the surface does as a whole, the rotation nearest to all of it and the way of its center, is taken out before and goes
//! its own way as a screw motion, to which whole turns can be added.
//!
//! # Reference
//! M. Alexa, D. Cohen-Or, D. Levin, *As-rigid-as-possible shape interpolation*, SIGGRAPH 2000; D. Xu, H. Zhang, Q. Wang, H. Bao,
//! *Poisson shape interpolation*, SPM 2005; M. Kilian, N. Mitra, H. Pottmann, *Geometric modeling in shape space*, SIGGRAPH 2007,
//! for paths that are rigid towards both ends.

mod frames;
#[cfg(test)]
mod tests;
mod untangling;
mod unwinding;

use std::collections::BTreeSet;
use std::f64::consts::TAU;
use std::sync::OnceLock;

use nalgebra::{Matrix3, Point3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::MorphError;
use super::elastic_solve::ElasticSolve;
use super::rigid::{Screw, centroid, nearest_similarity};
use crate::mesh::TriMesh;
use crate::mesh::operators::{CotangentRule, Cotangents, barycentric_areas};
pub(super) use frames::{Frame, opposite_edges};
use plumbline_num::run::{Run, Stopped};
use unwinding::Unwinding;
pub(super) use unwinding::neighbors;

/// How a trajectory is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default)]
pub struct TrajectoryOptions {
    /// Rounds in which each shape is made more rigid towards both meshes.
    ///
    /// 0: the Poisson solution. Gains fall quickly: after 10 rounds frames of a running horse still move by 10⁻⁴ of its size.
    #[cfg_attr(feature = "schema", schemars(range(min = 0, max = 10_000)))]
    pub rounds: usize,
    /// Whole turns added to how the surface turns as a whole: -1 makes 90 degrees the other way 270.
    #[cfg_attr(feature = "schema", schemars(range(min = -100, max = 100)))]
    pub whole_turns: i32,
}

impl Default for TrajectoryOptions {
    fn default() -> Self {
        Self { rounds: 10, whole_turns: 0 }
    }
}

/// All shapes between two poses.
#[derive(Debug)]
pub struct Trajectory {
    triangles: Vec<[u32; 3]>,
    first: Vec<Point3<f64>>,
    second: Vec<Point3<f64>>,
    /// The second pose after the motion of the whole is undone.
    still: Vec<Point3<f64>>,
    motion: Screw,
    /// `exp(τ ωₜ)`, without the motion of the whole.
    turns: Unwinding,
    /// Frames of both poses' triangles.
    frames: [Vec<Option<Frame>>; 2],
    /// Share of each vertex in the surface.
    weights: Vec<f64>,
    solve: ElasticSolve,
    rounds: usize,
    /// Pairs of triangles that intersect in both poses, once somebody asked.
    own_intersections: OnceLock<BTreeSet<[u32; 2]>>,
}

impl Trajectory {
    /// Prepares the way from a mesh to another pose of it.
    ///
    /// # Errors
    /// [`MorphError::VertexCounts`], [`MorphError::Triangles`] where the meshes are not two poses of one;
    /// [`MorphError::Numerics`], [`MorphError::Interrupted`].
    pub fn new(first: &TriMesh, second: &TriMesh, options: &TrajectoryOptions, run: &Run) -> Result<Self, MorphError> {
        same_connectivity(first, second)?;
        let weights = shares(first, second);
        let motion = motion_of_whole(first, second, &weights, options.whole_turns);
        let still: Vec<_> = second.positions().iter().map(|p| motion.undone(p)).collect();
        let triangles = first.triangles().to_vec();
        let frames_of = |x: &[Point3<f64>]| triangles.iter().map(|t| Frame::new(&t.map(|v| x[v as usize]))).collect();
        let frames: [Vec<Option<Frame>>; 2] = [frames_of(first.positions()), frames_of(&still)];
        let rotation = |(a, b): (&Option<Frame>, &Option<Frame>)| a.as_ref()?.rotation_to(b.as_ref()?);
        let rotations: Vec<Option<UnitQuaternion<f64>>> = frames[0].iter().zip(&frames[1]).map(rotation).collect();
        run.check()?;
        let solve = ElasticSolve::free(&triangles, mean_weights(first, second), first.positions(), run)?;
        Ok(Self {
            turns: Unwinding::new(&triangles, &rotations),
            first: first.positions().to_vec(),
            second: second.positions().to_vec(),
            triangles,
            still,
            motion,
            frames,
            weights,
            solve,
            rounds: options.rounds,
            own_intersections: OnceLock::new(),
        })
    }

    /// Positions at a time: 0 and 1 are the two poses themselves; beyond them the way goes on.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn at(&mut self, time: f64, run: &Run) -> Result<Vec<Point3<f64>>, Stopped> {
        self.blend(&vec![time; self.first.len()], run)
    }

    /// Positions where each vertex has a time of its own. Where all are the same, as [`Self::at`].
    ///
    /// # Errors
    /// [`Stopped`].
    ///
    /// # Panics
    /// Unless there is one time per vertex.
    pub fn blend(&mut self, times: &[f64], run: &Run) -> Result<Vec<Point3<f64>>, Stopped> {
        assert_eq!(times.len(), self.first.len(), "one time per vertex");
        let everywhere = |time: f64| times.iter().all(|t| *t == time);
        if everywhere(0.0) {
            return Ok(self.first.clone());
        }
        if everywhere(1.0) {
            return Ok(self.second.clone());
        }
        run.check()?;
        let of_triangle: Vec<f64> =
            self.triangles.iter().map(|t| t.iter().map(|v| times[*v as usize]).sum::<f64>() / 3.0).collect();
        let guess = self.guess(times);
        let mut x = guess.clone();
        let edges = self.wanted_edges(&of_triangle);
        self.solve.follow(|t| edges[t], &mut x);
        self.solve.center(&mut x, &guess, &self.weights);
        if self.rounds > 0 {
            let start = x.clone();
            for _ in 0..self.rounds {
                run.check()?;
                let edges = self.rigid_edges(&of_triangle, &x);
                self.solve.follow(|t| edges[t], &mut x);
            }
            self.settle(&mut x, &start);
        }
        Ok(x)
    }

    /// The energy that [`Self::at`] makes small: how far every triangle is from both ends, but for rotations. Squared length.
    pub fn energy(&self, time: f64, x: &[Point3<f64>]) -> f64 {
        let misfit = |t: usize| -> f64 {
            let now = self.corners(x, t);
            let frame = Frame::new(&now);
            let to_end = |end: usize, share: f64| -> f64 {
                let turn = self.fit(end, t, frame.as_ref());
                let edges = opposite_edges(&self.corners(self.end(end), t)).into_iter().zip(opposite_edges(&now));
                let square =
                    |((rest, e), h): ((Vector3<f64>, Vector3<f64>), &f64)| h * (e - turn * rest).norm_squared();
                share * edges.zip(&self.solve.half()[t]).map(square).sum::<f64>()
            };
            to_end(0, 1.0 - time) + to_end(1, time)
        };
        (0..self.triangles.len()).map(misfit).sum()
    }

    /// Positions on straight ways: what everybody gets who asks nobody.
    pub fn linear(&self, time: f64) -> Vec<Point3<f64>> {
        self.first.iter().zip(&self.second).map(|(a, b)| a + (b - a) * time).collect()
    }

    /// By how much the surface turns as a whole: axis times angle, rad.
    pub fn turn_of_whole(&self) -> Vector3<f64> {
        self.motion.turn
    }

    /// Straight ways between the poses, both carried along by the motion of the whole.
    fn guess(&self, times: &[f64]) -> Vec<Point3<f64>> {
        let between =
            |(&time, (a, b)): (&f64, (&Point3<f64>, &Point3<f64>))| self.motion.at(time, &(a + (b - a) * time));
        times.iter().zip(self.first.iter().zip(&self.still)).map(between).collect()
    }

    /// `(1 − τ) exp(τ ω) a + τ exp((τ − 1) ω) b`, turned with the whole.
    fn wanted_edges(&self, times: &[f64]) -> Vec<[Vector3<f64>; 3]> {
        let of_triangle = |(t, (&time, [ahead, back])): (usize, (&f64, &[UnitQuaternion<f64>; 2]))| {
            let whole = self.motion.rotation(time);
            let [a, b] = [0, 1].map(|end| opposite_edges(&self.corners(self.end(end), t)));
            std::array::from_fn(|k| whole * (ahead * a[k] * (1.0 - time) + back * b[k] * time))
        };
        times.iter().zip(&self.turns.at(times)).enumerate().map(of_triangle).collect()
    }

    /// Edges of both ends, turned to fit those of `x`.
    fn rigid_edges(&self, times: &[f64], x: &[Point3<f64>]) -> Vec<[Vector3<f64>; 3]> {
        let of_triangle = |(t, &time): (usize, &f64)| {
            let frame = Frame::new(&self.corners(x, t));
            let turned = [0, 1].map(|end| {
                let turn = self.fit(end, t, frame.as_ref());
                opposite_edges(&self.corners(self.end(end), t)).map(|e| turn * e)
            });
            std::array::from_fn(|k| turned[0][k] * (1.0 - time) + turned[1][k] * time)
        };
        times.iter().enumerate().map(of_triangle).collect()
    }

    /// The rotation that takes a triangle of an end nearest to where it is now; none where one of both has no area.
    fn fit(&self, end: usize, t: usize, now: Option<&Frame>) -> Matrix3<f64> {
        let fitted =
            self.frames[end][t].as_ref().zip(now).map(|(rest, now)| rest.best_rotation_to(now, &self.solve.half()[t]));
        fitted.unwrap_or_else(Matrix3::identity)
    }

    fn end(&self, end: usize) -> &[Point3<f64>] {
        if end == 0 { &self.first } else { &self.still }
    }

    fn corners(&self, x: &[Point3<f64>], t: usize) -> [Point3<f64>; 3] {
        self.triangles[t].map(|v| x[v as usize])
    }

    /// Moves each piece rigidly to where it lay: the energy does not see where it is.
    fn settle(&self, x: &mut [Point3<f64>], start: &[Point3<f64>]) {
        let (piece, pieces) = self.solve.pieces();
        let mut of_piece = vec![Vec::new(); pieces];
        piece.iter().enumerate().for_each(|(v, p)| of_piece[*p as usize].push(v));
        for vertices in of_piece {
            let from: Vec<_> = vertices.iter().map(|&v| x[v]).collect();
            let to: Vec<_> = vertices.iter().map(|&v| start[v]).collect();
            let weights: Vec<f64> = vertices.iter().map(|&v| self.weights[v]).collect();
            let (back, rank) = nearest_similarity(&from, &to, &weights, false);
            if rank > 1 {
                vertices.iter().zip(from).for_each(|(&v, p)| x[v] = back * p);
            }
        }
    }
}

/// The shape between two poses of one mesh, with the default options: the first at time 0, the second at 1, beyond them the motion
/// goes on. For several times make a [`Trajectory`], which is factored once.
///
/// ```
/// use plumbline_shape::mesh::shapes;
/// use plumbline_shape::morph::interpolate;
///
/// let bar = shapes::bar([2, 2, 10], [1.0, 1.0, 5.0]);
/// let twice = bar.with_positions(bar.positions().iter().map(|p| p * 2.0).collect())?;
/// let between = interpolate(&bar, &twice, 0.5)?;
/// assert!((between[0] - bar.positions()[0] * 1.5).norm() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// As for [`Trajectory::new`].
pub fn interpolate(first: &TriMesh, second: &TriMesh, time: f64) -> Result<Vec<Point3<f64>>, MorphError> {
    let run = Run::default();
    let mut trajectory = Trajectory::new(first, second, &TrajectoryOptions::default(), &run)?;
    Ok(trajectory.at(time, &run)?)
}

/// Two poses of one mesh have the same triangles.
///
/// # Errors
/// [`MorphError::VertexCounts`], [`MorphError::Triangles`] where these are not.
pub fn same_connectivity(first: &TriMesh, second: &TriMesh) -> Result<(), MorphError> {
    if first.vertex_count() != second.vertex_count() {
        return Err(MorphError::VertexCounts { first: first.vertex_count(), second: second.vertex_count() });
    }
    let (a, b) = (first.triangles(), second.triangles());
    match (0..a.len().max(b.len())).find(|&t| a.get(t) != b.get(t)) {
        None => Ok(()),
        Some(t) => Err(MorphError::Triangles { triangle: t, first: a.get(t).copied(), second: b.get(t).copied() }),
    }
}

/// Share of each vertex in the area of both surfaces; all alike where neither has any.
fn shares(first: &TriMesh, second: &TriMesh) -> Vec<f64> {
    let share = |mesh: &TriMesh| {
        let areas = barycentric_areas(mesh);
        let total: f64 = areas.iter().sum();
        areas.into_iter().map(move |a| if total > 0.0 { a / total } else { 0.0 })
    };
    let shares: Vec<f64> = share(first).zip(share(second)).map(|(a, b)| 0.5 * (a + b)).collect();
    if shares.iter().any(|s| *s > 0.0) { shares } else { vec![1.0; shares.len()] }
}

/// Half cotangents, the means of both poses'.
fn mean_weights(first: &TriMesh, second: &TriMesh) -> Vec<[f64; 3]> {
    let [a, b] = [first, second].map(|mesh| Cotangents::new(mesh, CotangentRule::Raw));
    let mean = |(a, b): (&[f64; 3], &[f64; 3])| std::array::from_fn(|k| 0.5 * (a[k] + b[k]));
    a.half().iter().zip(b.half()).map(mean).collect()
}

fn motion_of_whole(first: &TriMesh, second: &TriMesh, weights: &[f64], whole_turns: i32) -> Screw {
    let (a, b) = (first.positions(), second.positions());
    let (nearest, rank) = nearest_similarity(a, b, weights, false);
    let turn = if rank > 1 { nearest.isometry.rotation.scaled_axis() } else { Vector3::zeros() };
    let axis = turn.try_normalize(1e-12).unwrap_or_else(Vector3::y);
    let turn = turn + axis * (f64::from(whole_turns) * TAU);
    Screw::new(turn, centroid(a, weights), centroid(b, weights))
}
