//! As-rigid-as-possible interpolation between two poses of one mesh.
//!
//! The map of triangle `t` from the first pose to the second is `Aₜ = Rₜ Sₜ`. Its target at time `τ` is
//!
//! ```text
//! Aₜ(τ) = exp(τ ωₜ) ((1 − τ) I + τ Sₜ),        its edges   (1 − τ) exp(τ ωₜ) a  +  τ exp((τ − 1) ωₜ) b,
//! ```
//!
//! with `exp ωₜ = Rₜ` and the edges `a` and `b` of both poses; large rotations are relative to those of neighbors
//! ([`rotation_paths`]). The positions with the nearest edges solve a Poisson equation. They are then refined to be as rigid as
//! possible towards both poses, the triangles around each vertex (its cell) together:
//!
//! ```text
//! min over x, P_v, Q_v   Σ_v Σ_{t ∋ v} Σ_{e ∈ t} h_e [ (1 − τ) |e(x) − P_v a|² + τ |e(x) − Q_v b|² ]
//! ```
//!
//! A rotation for each triangle instead measures no bending: between unlike shapes, whose triangles rotate by unrelated angles, creases
//! and folds of the start then stay for nothing. Where rotations reach 180° and their paths are ambiguous, the refinement also starts
//! from linear interpolation, and what ends lower at half time is taken: chains of rotations carry a long twist, but go the wrong way
//! round behind triangles that the correspondence turned over.
//!
//! A triangle that such shapes fold follows one pose alone ([`following`]).
//!
//! The weights `h` are the means of the half cotangents of both poses, so that the matrix is the same for every time, even for
//! times that vary over the surface ([`Trajectory::blend`]): one factor serves all frames. The method is symmetric in the two
//! poses. The global motion, the best rotation and the displacement of the centroid, is removed first and interpolated as a
//! screw motion, to which full turns can be added; so is the difference in size, the ratio of the roots of the areas, which changes
//! linearly. Otherwise the larger of two unlike shapes hides the other almost until its end.
//!
//! # Reference
//! M. Alexa, D. Cohen-Or, D. Levin, *As-rigid-as-possible shape interpolation*, SIGGRAPH 2000; D. Xu, H. Zhang, Q. Wang, H. Bao,
//! *Poisson shape interpolation*, SPM 2005; M. Kilian, N. Mitra, H. Pottmann, *Geometric modeling in shape space*, SIGGRAPH 2007,
//! for paths that are as rigid as possible towards both ends; I. Chao, U. Pinkall, P. Sanan, P. Schröder, *A simple geometric model for
//! elastic deformations*, SIGGRAPH 2010, for the cells.

mod following;
mod frames;
mod rotation_paths;
#[cfg(test)]
mod tests;
mod untangling;

use untangling::Faults;
pub use untangling::Untangled;

use std::f64::consts::TAU;
use std::sync::OnceLock;

use nalgebra::{Matrix3, Point3, UnitQuaternion, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::MorphError;
use super::elastic_solve::ElasticSolve;
use super::error::check_size;
use super::rigid::{Screw, centroid, nearest_similarity};
use crate::mesh::TriMesh;
use crate::mesh::operators::{CotangentRule, Cotangents, barycentric_areas};
use following::{Follows, SEARCHED, follows};
pub(super) use frames::{Frame, opposite_edges};
use plumbline_num::math::{Lists, nearest_rotation};
use plumbline_num::run::{Run, Stopped};
use rotation_paths::RotationPaths;
pub(super) use rotation_paths::neighbors;

/// Options of the interpolation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default)]
pub struct TrajectoryOptions {
    /// Iterations that make each shape as rigid as possible towards both meshes; 0 for the Poisson solution.
    ///
    /// After 10 iterations frames of a running horse change by 1.5·10⁻⁴ of its size with each further one, and are 5·10⁻³ from those after
    /// 100 (root mean square).
    #[serde(alias = "rounds")]
    #[cfg_attr(feature = "schema", schemars(range(min = 0, max = 10_000), extend("aliases" = ["rounds"])))]
    pub iterations: usize,
    /// Full rotations of 360 degrees added to the global rotation; -1 makes 90 degrees 270 degrees in the opposite direction.
    #[cfg_attr(feature = "schema", schemars(range(min = -100, max = 100)))]
    pub full_rotations: i32,
}

impl Default for TrajectoryOptions {
    fn default() -> Self {
        Self { iterations: 10, full_rotations: 0 }
    }
}

/// Distance outside the bounding box of both poses, over its diagonal, that a shape between them may have.
const MAX_EXCESS: f64 = 0.2;

/// Where refinement starts.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Start {
    /// From edges rotated along their paths.
    RotatedEdges,
    /// From linear interpolation of the aligned poses.
    Straight,
}

/// The interpolation between two poses.
#[derive(Debug)]
pub struct Trajectory {
    triangles: Vec<[u32; 3]>,
    first: Vec<Point3<f64>>,
    second: Vec<Point3<f64>>,
    /// The second pose without the global motion, in the size of the first.
    aligned: Vec<Point3<f64>>,
    motion: Screw,
    /// `exp(τ ωₜ)`, without the global motion.
    rotations: RotationPaths,
    start: Start,
    /// Which ends each triangle follows.
    follows: Vec<Follows>,
    /// Fraction of each vertex in the area of the surface.
    weights: Vec<f64>,
    solve: ElasticSolve,
    iterations: usize,
    /// Faults of both poses, computed at first use; `None` where that takes too many tests.
    own_faults: OnceLock<Option<Faults>>,
}

impl Trajectory {
    /// Prefactors the interpolation from a mesh to another pose of it.
    ///
    /// # Errors
    /// [`MorphError::VertexCounts`], [`MorphError::Triangles`] where the meshes are not two poses of one;
    /// [`MorphError::Size`], [`MorphError::Numerics`], [`MorphError::Interrupted`].
    pub fn new(first: &TriMesh, second: &TriMesh, options: &TrajectoryOptions, run: &Run) -> Result<Self, MorphError> {
        same_connectivity(first, second)?;
        check_size(first, "first")?;
        check_size(second, "second")?;
        let weights = area_fractions(first, second);
        let motion = global_motion(first, second, &weights, options.full_rotations);
        let aligned: Vec<_> = second.positions().iter().map(|p| motion.inverse(p)).collect();
        let triangles = first.triangles().to_vec();
        let frames_of = |x: &[Point3<f64>]| triangles.iter().map(|t| Frame::new(&t.map(|v| x[v as usize]))).collect();
        let frames: [Vec<Option<Frame>>; 2] = [frames_of(first.positions()), frames_of(&aligned)];
        let rotation = |(a, b): (&Option<Frame>, &Option<Frame>)| a.as_ref()?.rotation_to(b.as_ref()?);
        let rotations: Vec<Option<UnitQuaternion<f64>>> = frames[0].iter().zip(&frames[1]).map(rotation).collect();
        run.check()?;
        let solve = ElasticSolve::new(&triangles, mean_weights(first, second), first.positions(), None, run)?;
        let mut this = Self {
            rotations: RotationPaths::new(&triangles, &rotations),
            start: Start::RotatedEdges,
            follows: vec![Follows::default(); triangles.len()],
            first: first.positions().to_vec(),
            second: second.positions().to_vec(),
            triangles,
            aligned,
            motion,
            weights,
            solve,
            iterations: options.iterations,
            own_faults: OnceLock::new(),
        };
        if this.iterations > 0 && !this.rotations.is_unique() {
            this.start = this.lower_start(run)?;
            let between = SEARCHED.map(|time| this.at(time, run)).into_iter().collect::<Result<Vec<_>, _>>()?;
            this.follows = follows(&this.triangles, [&this.first, &this.aligned], &between);
        }
        Ok(this)
    }

    /// The start from which refinement ends lower at half time.
    fn lower_start(&mut self, run: &Run) -> Result<Start, Stopped> {
        let mut energy = |start: Start| {
            self.start = start;
            let x = self.at(0.5, run)?;
            Ok(self.energy(0.5, &x))
        };
        let rotated = energy(Start::RotatedEdges)?;
        // Equal but for rounding, either direction of the trajectory takes the same.
        let lower = energy(Start::Straight)? < rotated * (1.0 - 1e-6);
        Ok(if lower { Start::Straight } else { Start::RotatedEdges })
    }

    /// Positions at a time: 0 and 1 are the two poses; other times extrapolate.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn at(&mut self, time: f64, run: &Run) -> Result<Vec<Point3<f64>>, Stopped> {
        self.blend(&vec![time; self.first.len()], run)
    }

    /// Positions for one time per vertex; with equal times as [`Self::at`].
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
        if self.start == Start::RotatedEdges {
            let edges = self.target_edges(&of_triangle);
            self.solve.follow(|t| edges[t], &mut x);
            self.solve.center(&mut x, &guess, &self.weights);
        }
        if self.iterations > 0 {
            let initial = x.clone();
            for _ in 0..self.iterations {
                run.check()?;
                let edges = self.rigid_edges(&of_triangle, &x);
                self.solve.follow(|t| edges[t], &mut x);
            }
            self.align_components(&mut x, &initial);
        }
        Ok(x)
    }

    /// The energy that [`Self::at`] minimizes: the distance of the cell of every vertex from both poses up to rotations, or from one where
    /// the shapes between fold, in the size of the time, squared length.
    pub fn energy(&self, time: f64, x: &[Point3<f64>]) -> f64 {
        let size = self.motion.size(time);
        let to_end = |end: usize| -> f64 {
            let weight = |t: usize| {
                let second = self.follows[t].weight(time);
                if end == 0 { 1.0 - second } else { second }
            };
            let cells = self.cell_rotations(end, x);
            let of_triangle = |t: usize| -> f64 {
                let (rest, now) = (self.edges(self.end(end), t), self.edges(x, t));
                let of_cell = |v: &u32| -> f64 {
                    let square = |k: usize| (now[k] - cells[*v as usize] * rest[k] * size).norm_squared();
                    (0..3).map(|k| self.solve.half()[t][k] * square(k)).sum()
                };
                weight(t) * self.triangles[t].iter().map(of_cell).sum::<f64>()
            };
            (0..self.triangles.len()).map(of_triangle).sum()
        };
        to_end(0) + to_end(1)
    }

    /// Linear interpolation of the positions, for comparison.
    pub fn linear(&self, time: f64) -> Vec<Point3<f64>> {
        self.first.iter().zip(&self.second).map(|(a, b)| a + (b - a) * time).collect()
    }

    /// Checks that positions at a time stay near both poses: inside their bounding box, grown on each side by a fifth of its
    /// diagonal, in the frame that moves with the global motion. An elastic interpolation leaves it where the correspondence folds the
    /// surface: the rotations of neighboring triangles are then unrelated.
    ///
    /// # Errors
    /// [`MorphError::OutsideBox`].
    pub fn check_extent(&self, time: f64, x: &[Point3<f64>]) -> Result<(), MorphError> {
        let ends = self.first.iter().chain(&self.aligned);
        let Some((low, high)) = ends.fold(None, |bounds: Option<(Point3<f64>, Point3<f64>)>, p| {
            Some(bounds.map_or((*p, *p), |(low, high)| (low.inf(p), high.sup(p))))
        }) else {
            return Ok(());
        };
        let outside = |p: &Point3<f64>| {
            let p = self.motion.inverse_at(time, p);
            (low - p).sup(&(p - high)).max()
        };
        let (excess, diagonal) = (x.iter().map(outside).fold(0.0, f64::max), (high - low).norm());
        if excess <= MAX_EXCESS * diagonal {
            return Ok(());
        }
        Err(MorphError::OutsideBox { time, excess: excess / diagonal })
    }

    /// The global rotation between the poses as a rotation vector, rad.
    pub fn global_rotation(&self) -> Vector3<f64> {
        self.motion.rotation_vector
    }

    /// Linear interpolation of the aligned poses, moved by the global motion.
    fn guess(&self, times: &[f64]) -> Vec<Point3<f64>> {
        let between =
            |(&time, (a, b)): (&f64, (&Point3<f64>, &Point3<f64>))| self.motion.at(time, &(a + (b - a) * time));
        times.iter().zip(self.first.iter().zip(&self.aligned)).map(between).collect()
    }

    /// `(1 − τ) exp(τ ω) a + τ exp((τ − 1) ω) b`, with the global motion.
    fn target_edges(&self, times: &[f64]) -> Vec<[Vector3<f64>; 3]> {
        let of_triangle = |(t, (&time, [ahead, back])): (usize, (&f64, &[UnitQuaternion<f64>; 2]))| {
            let (global, size) = (self.motion.rotation(time), self.motion.size(time));
            let [a, b] = [0, 1].map(|end| self.edges(self.end(end), t));
            std::array::from_fn(|k| global * (ahead * a[k] * (1.0 - time) + back * b[k] * time) * size)
        };
        times.iter().zip(&self.rotations.at(times)).enumerate().map(of_triangle).collect()
    }

    /// Edges of both poses, rotated to fit those of `x`: the mean over the cells that a triangle is in.
    fn rigid_edges(&self, times: &[f64], x: &[Point3<f64>]) -> Vec<[Vector3<f64>; 3]> {
        let cells = [0, 1].map(|end| self.cell_rotations(end, x));
        let of_triangle = |(t, &time): (usize, &f64)| {
            let [a, b] = [0, 1].map(|end| {
                let sum: Matrix3<f64> = self.triangles[t].iter().map(|v| cells[end][*v as usize]).sum();
                self.edges(self.end(end), t).map(|e| sum * e / 3.0)
            });
            let (size, second) = (self.motion.size(time), self.follows[t].weight(time));
            std::array::from_fn(|k| (a[k] * (1.0 - second) + b[k] * second) * size)
        };
        times.iter().enumerate().map(of_triangle).collect()
    }

    /// The rotation of the cell of each vertex from a pose that fits `x` best.
    fn cell_rotations(&self, end: usize, x: &[Point3<f64>]) -> Vec<Matrix3<f64>> {
        let mut sums = vec![Matrix3::zeros(); x.len()];
        for (t, (corners, half)) in self.triangles.iter().zip(self.solve.half()).enumerate() {
            let pairs = self.edges(x, t).into_iter().zip(self.edges(self.end(end), t)).zip(half);
            let sum: Matrix3<f64> = pairs.map(|((now, rest), h)| now * rest.transpose() * *h).sum();
            for v in corners {
                sums[*v as usize] += sum;
            }
        }
        sums.par_iter().map(nearest_rotation).collect()
    }

    fn end(&self, end: usize) -> &[Point3<f64>] {
        if end == 0 { &self.first } else { &self.aligned }
    }

    /// Edges of a triangle, each opposite a corner.
    fn edges(&self, x: &[Point3<f64>], t: usize) -> [Vector3<f64>; 3] {
        opposite_edges(&self.triangles[t].map(|v| x[v as usize]))
    }

    /// Aligns each component rigidly with `target`: the energy is invariant to its rigid motions.
    fn align_components(&self, x: &mut [Point3<f64>], target: &[Point3<f64>]) {
        let (component, count) = self.solve.components();
        for vertices in Lists::new(count, component.iter().copied().zip(0..)).iter() {
            let from: Vec<_> = vertices.iter().map(|&v| x[v as usize]).collect();
            let to: Vec<_> = vertices.iter().map(|&v| target[v as usize]).collect();
            let weights: Vec<f64> = vertices.iter().map(|&v| self.weights[v as usize]).collect();
            let (back, rank) = nearest_similarity(&from, &to, &weights, false);
            if rank > 1 {
                vertices.iter().zip(from).for_each(|(&v, p)| x[v as usize] = back * p);
            }
        }
    }
}

/// Interpolates two poses of one mesh with the default options: the first at time 0, the second at 1; other times extrapolate. For
/// several times make a [`Trajectory`], which is factored once.
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

/// Checks that two meshes have the same triangles, as poses of one mesh.
///
/// # Errors
/// [`MorphError::VertexCounts`], [`MorphError::Triangles`].
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

/// Fraction of each vertex in the area of both surfaces; uniform if neither has an area.
fn area_fractions(first: &TriMesh, second: &TriMesh) -> Vec<f64> {
    let fractions = |mesh: &TriMesh| {
        let areas = barycentric_areas(mesh);
        let total: f64 = areas.iter().sum();
        areas.into_iter().map(move |a| if total > 0.0 { a / total } else { 0.0 })
    };
    let mean: Vec<f64> = fractions(first).zip(fractions(second)).map(|(a, b)| 0.5 * (a + b)).collect();
    if mean.iter().any(|s| *s > 0.0) { mean } else { vec![1.0; mean.len()] }
}

/// Half cotangents, averaged over both poses, with those of an equilateral triangle for slivers.
fn mean_weights(first: &TriMesh, second: &TriMesh) -> Vec<[f64; 3]> {
    let [a, b] = [first, second].map(|mesh| {
        let half = Cotangents::new(mesh, CotangentRule::Raw);
        let blended = |(t, h): (usize, &[f64; 3])| without_slivers(&mesh.corners(t), h);
        half.half().iter().enumerate().map(blended).collect::<Vec<_>>()
    });
    a.iter().zip(&b).map(|(a, b)| std::array::from_fn(|k| 0.5 * (a[k] + b[k]))).collect()
}

/// Minimum area of a triangle in the sum of its squared edges, about 2.3° between long edges; weights of thinner ones are blended.
///
/// A sliver resists across itself only, however little its area. Where a correspondence makes many of them, the system is singular along
/// them, up to rounding: shapes between a spot and a bunny were 3,590 diagonals outside the bounding box.
const MIN_AREA: f64 = 0.01;

/// Half cotangents of a triangle, blended with those of an equilateral one in proportion to the area that it lacks.
fn without_slivers(corners: &[Point3<f64>; 3], half: &[f64; 3]) -> [f64; 3] {
    let edges = opposite_edges(corners);
    let squares: f64 = edges.iter().map(Vector3::norm_squared).sum();
    let area = 0.5 * edges[0].cross(&edges[1]).norm();
    let fraction = if squares > 0.0 { (area / (MIN_AREA * squares)).min(1.0) } else { 0.0 };
    half.map(|h| if fraction > 0.0 { fraction * h } else { 0.0 } + (1.0 - fraction) * EQUILATERAL)
}

/// Half the cotangent of 60°.
const EQUILATERAL: f64 = 0.288_675_134_594_812_9;

/// The best rigid motion between the poses and the ratio of their sizes, with additional full turns.
fn global_motion(first: &TriMesh, second: &TriMesh, weights: &[f64], full_rotations: i32) -> Screw {
    let (a, b) = (first.positions(), second.positions());
    let (nearest, rank) = nearest_similarity(a, b, weights, false);
    let rotation = if rank > 1 { nearest.isometry.rotation.scaled_axis() } else { Vector3::zeros() };
    let axis = rotation.try_normalize(1e-12).unwrap_or_else(Vector3::y);
    let rotation = rotation + axis * (f64::from(full_rotations) * TAU);
    let scale = (second.area() / first.area()).sqrt();
    let scale = if scale > 0.0 && scale.is_finite() { scale } else { 1.0 };
    Screw::new(rotation, scale, centroid(a, weights), centroid(b, weights))
}
