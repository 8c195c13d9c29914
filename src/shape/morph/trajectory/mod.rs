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
//! possible towards both poses:
//!
//! ```text
//! min over x, Pₜ, Qₜ   Σ_t Σ_{e ∈ t} h_e [ (1 − τ) |e(x) − Pₜ a|² + τ |e(x) − Qₜ b|² ]
//! ```
//!
//! The weights `h` are the means of the half cotangents of both poses, so that the matrix is the same for every time, even for
//! times that vary over the surface ([`Trajectory::blend`]): one factor serves all frames. The method is symmetric in the two
//! poses. The global motion, the best rotation and the displacement of the centroid, is removed first and interpolated as a
//! screw motion, to which full turns can be added.
//!
//! # Reference
//! M. Alexa, D. Cohen-Or, D. Levin, *As-rigid-as-possible shape interpolation*, SIGGRAPH 2000; D. Xu, H. Zhang, Q. Wang, H. Bao,
//! *Poisson shape interpolation*, SPM 2005; M. Kilian, N. Mitra, H. Pottmann, *Geometric modeling in shape space*, SIGGRAPH 2007,
//! for paths that are as rigid as possible towards both ends.

mod frames;
mod rotation_paths;
#[cfg(test)]
mod tests;
mod untangling;

pub use untangling::Untangled;

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
use plumbline_num::math::Lists;
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
    /// Convergence is fast: after 10 iterations frames of a running horse still change by 10⁻⁴ of its size.
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

/// The interpolation between two poses.
#[derive(Debug)]
pub struct Trajectory {
    triangles: Vec<[u32; 3]>,
    first: Vec<Point3<f64>>,
    second: Vec<Point3<f64>>,
    /// The second pose without the global motion.
    aligned: Vec<Point3<f64>>,
    motion: Screw,
    /// `exp(τ ωₜ)`, without the global motion.
    rotations: RotationPaths,
    /// Frames of both poses' triangles.
    frames: [Vec<Option<Frame>>; 2],
    /// Fraction of each vertex in the area of the surface.
    weights: Vec<f64>,
    solve: ElasticSolve,
    iterations: usize,
    /// Pairs of triangles that intersect in both poses, computed at first use; `None` where that takes too many tests.
    own_intersections: OnceLock<Option<BTreeSet<[u32; 2]>>>,
}

impl Trajectory {
    /// Prefactors the interpolation from a mesh to another pose of it.
    ///
    /// # Errors
    /// [`MorphError::VertexCounts`], [`MorphError::Triangles`] where the meshes are not two poses of one;
    /// [`MorphError::Numerics`], [`MorphError::Interrupted`].
    pub fn new(first: &TriMesh, second: &TriMesh, options: &TrajectoryOptions, run: &Run) -> Result<Self, MorphError> {
        same_connectivity(first, second)?;
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
        Ok(Self {
            rotations: RotationPaths::new(&triangles, &rotations),
            first: first.positions().to_vec(),
            second: second.positions().to_vec(),
            triangles,
            aligned,
            motion,
            frames,
            weights,
            solve,
            iterations: options.iterations,
            own_intersections: OnceLock::new(),
        })
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
        let edges = self.target_edges(&of_triangle);
        self.solve.follow(|t| edges[t], &mut x);
        self.solve.center(&mut x, &guess, &self.weights);
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

    /// The energy that [`Self::at`] minimizes: the distance of every triangle from both poses up to rotations, squared length.
    pub fn energy(&self, time: f64, x: &[Point3<f64>]) -> f64 {
        let of_triangle = |t: usize| -> f64 {
            let now = self.corners(x, t);
            let frame = Frame::new(&now);
            let to_end = |end: usize, weight: f64| -> f64 {
                let rotation = self.fit(end, t, frame.as_ref());
                let edges = opposite_edges(&self.corners(self.end(end), t)).into_iter().zip(opposite_edges(&now));
                let square =
                    |((rest, e), h): ((Vector3<f64>, Vector3<f64>), &f64)| h * (e - rotation * rest).norm_squared();
                weight * edges.zip(&self.solve.half()[t]).map(square).sum::<f64>()
            };
            to_end(0, 1.0 - time) + to_end(1, time)
        };
        (0..self.triangles.len()).map(of_triangle).sum()
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

    /// `(1 − τ) exp(τ ω) a + τ exp((τ − 1) ω) b`, rotated with the global motion.
    fn target_edges(&self, times: &[f64]) -> Vec<[Vector3<f64>; 3]> {
        let of_triangle = |(t, (&time, [ahead, back])): (usize, (&f64, &[UnitQuaternion<f64>; 2]))| {
            let global = self.motion.rotation(time);
            let [a, b] = [0, 1].map(|end| opposite_edges(&self.corners(self.end(end), t)));
            std::array::from_fn(|k| global * (ahead * a[k] * (1.0 - time) + back * b[k] * time))
        };
        times.iter().zip(&self.rotations.at(times)).enumerate().map(of_triangle).collect()
    }

    /// Edges of both poses, rotated to fit those of `x`.
    fn rigid_edges(&self, times: &[f64], x: &[Point3<f64>]) -> Vec<[Vector3<f64>; 3]> {
        let of_triangle = |(t, &time): (usize, &f64)| {
            let frame = Frame::new(&self.corners(x, t));
            let rotated = [0, 1].map(|end| {
                let rotation = self.fit(end, t, frame.as_ref());
                opposite_edges(&self.corners(self.end(end), t)).map(|e| rotation * e)
            });
            std::array::from_fn(|k| rotated[0][k] * (1.0 - time) + rotated[1][k] * time)
        };
        times.iter().enumerate().map(of_triangle).collect()
    }

    /// The best rotation of a triangle from a pose to its current shape; the identity if one of them is degenerate.
    fn fit(&self, end: usize, t: usize, now: Option<&Frame>) -> Matrix3<f64> {
        let fitted =
            self.frames[end][t].as_ref().zip(now).map(|(rest, now)| rest.best_rotation_to(now, &self.solve.half()[t]));
        fitted.unwrap_or_else(Matrix3::identity)
    }

    fn end(&self, end: usize) -> &[Point3<f64>] {
        if end == 0 { &self.first } else { &self.aligned }
    }

    fn corners(&self, x: &[Point3<f64>], t: usize) -> [Point3<f64>; 3] {
        self.triangles[t].map(|v| x[v as usize])
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

/// The best rigid motion between the poses, with additional full turns.
fn global_motion(first: &TriMesh, second: &TriMesh, weights: &[f64], full_rotations: i32) -> Screw {
    let (a, b) = (first.positions(), second.positions());
    let (nearest, rank) = nearest_similarity(a, b, weights, false);
    let rotation = if rank > 1 { nearest.isometry.rotation.scaled_axis() } else { Vector3::zeros() };
    let axis = rotation.try_normalize(1e-12).unwrap_or_else(Vector3::y);
    let rotation = rotation + axis * (f64::from(full_rotations) * TAU);
    Screw::new(rotation, centroid(a, weights), centroid(b, weights))
}
