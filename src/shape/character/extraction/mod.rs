//! Curve skeletons of surfaces, and joint skeletons derived from them.
//!
//! A surface is contracted almost to a curve, its triangles are collapsed, and the remaining graph is centered. Each connected component is
//! processed separately, with lengths relative to the radius of the sphere of equal area and positions relative to the centroid, so that the
//! result is invariant to scale, position and rotation of the model:
//!
//! | step | file |
//! | --- | --- |
//! | connected components, duplicate vertices and those across gaps welded | `parts.rs` |
//! | close holes; thicken a surface without an inside | `caps.rs`, `sheet.rs` |
//! | reduce to as many vertices as the curve needs | `reduction.rs` |
//! | tips, pinned during contraction: geodesic extrema | `geodesic_extrema.rs` |
//! | medial ball of each vertex | `medial.rs` |
//! | contraction, one sparse solve per iteration | `contraction.rs`, `normal_equations.rs` |
//! | collapse to a graph; which loops may close; edges across holes | `surgery.rs`, `homology.rs`, `part.rs` |
//! | uniform node spacing | `resampling.rs` |
//! | one energy: centered, smooth, inside | `curve_energy.rs` |
//! | prune branches and ends that are no limbs | `pruning.rs` |
//! | ends to the ends of the shape; the energy again | `tips.rs` |
//! | edges that pass outside; thin crowded nodes | `inside.rs`, `resampling.rs` |
//! | joints | `joints.rs` |
//!
//! The curve has as many loops as the surface has handles. Every vertex of the surface is assigned the node it contracted to. All iterations
//! are bounded; an observer is called after every iteration and may stop the work. Results are independent of threads. What each step changes on
//! the shared models is in `docs/ABLATIONS.md`.
//!
//! # Reference
//! O. K.-C. Au, C.-L. Tai, H.-K. Chu, D. Cohen-Or, T.-Y. Lee, *Skeleton extraction by mesh contraction*, SIGGRAPH 2008; A. Tagliasacchi, I.
//! Alhashim, M. Olson, H. Zhang, *Mean curvature skeletons*, SGP 2012.

mod aabb;
mod budget;
mod caps;
mod complex;
mod contraction;
mod curve_energy;
mod curve_graph;
mod geodesic_extrema;
mod homology;
mod inside;
mod joints;
mod medial;
mod normal_equations;
mod order;
mod part;
mod parts;
mod pruning;
mod reduction;
mod resampling;
mod sheet;
mod surgery;
#[cfg(test)]
mod tests;
mod tips;

use std::ops::ControlFlow;

use nalgebra::{Point3, Rotation3, Vector3};
use serde::{Deserialize, Serialize};

use super::{CharacterError, CurveSkeleton, Skeleton};
use crate::mesh::TriMesh;
pub use joints::skeleton_of;
use order::Cost;
use parts::Parts;
use plumbline_num::options::OptionError;
use plumbline_num::run::Run;
use plumbline_num::spatial::{KdTree, UnionFind};

/// Which ends are kept.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Keep {
    /// No particular ends.
    #[default]
    Nothing,
    /// Ends at these vertices of the mesh: the curve reaches each of them.
    Vertices(Vec<u32>),
    /// Ends at the tips found by geodesic distance.
    Extrema,
}

/// Least and largest weight: where one is a thousand times another, the other has no part left in the sum, and beyond that only
/// the condition of the system gets worse.
const MIN_WEIGHT: f64 = 0.001;
const MAX_WEIGHT: f64 = 1000.0;

/// Options of curve skeleton extraction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default)]
pub struct ExtractionOptions {
    /// Weight of the contraction; below 0.3 wide parts stay sheets, above 2 limbs shorten
    #[cfg_attr(feature = "schema", schemars(range(min = MIN_WEIGHT, max = MAX_WEIGHT)))]
    pub contraction: f64,
    /// Weight of the positions of the last contraction iteration
    #[cfg_attr(feature = "schema", schemars(range(min = MIN_WEIGHT, max = MAX_WEIGHT)))]
    pub attraction: f64,
    /// Weight of the centers of the largest balls inside
    #[cfg_attr(feature = "schema", schemars(range(min = MIN_WEIGHT, max = MAX_WEIGHT)))]
    pub medial: f64,
    /// Prune terminal branches that extend less than this many local radii beyond the rest of the skeleton
    #[cfg_attr(feature = "schema", schemars(range(min = 0, max = 100)))]
    pub prune: f64,
    /// Largest number of contraction iterations
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 1000)))]
    pub iterations: usize,
    /// Ends to keep.
    #[serde(skip)]
    pub keep: Keep,
}

impl Default for ExtractionOptions {
    fn default() -> Self {
        Self { contraction: 0.7, attraction: 0.1, medial: 0.3, prune: 1.05, iterations: 12, keep: Keep::default() }
    }
}

impl ExtractionOptions {
    fn check(&self, vertices: usize) -> Result<(), CharacterError> {
        for (name, value) in
            [("contraction", self.contraction), ("attraction", self.attraction), ("medial", self.medial)]
        {
            OptionError::check((MIN_WEIGHT..=MAX_WEIGHT).contains(&value), name, value, "0.001 to 1000")?;
        }
        OptionError::check((0.0..=100.0).contains(&self.prune), "prune", self.prune, "0 to 100")?;
        let iterations = self.iterations as f64;
        OptionError::check((1.0..=1000.0).contains(&iterations), "iterations", iterations, "1 to 1000")?;
        if let Keep::Vertices(all) = &self.keep
            && let Some(vertex) = all.iter().find(|v| **v as usize >= vertices)
        {
            let fault = format!("vertex {vertex} is to be kept, but the mesh has {vertices} vertices, numbered from 0");
            return Err(CharacterError::Input(fault));
        }
        Ok(())
    }
}

/// Progress of the contraction after an iteration.
pub struct ContractionStep<'a> {
    /// Index of the connected component, from 0.
    pub part: usize,
    /// Number of components.
    pub parts: usize,
    /// The iteration, from 1.
    pub iteration: usize,
    /// Largest number of iterations.
    pub iterations: usize,
    /// Fraction of the component's initial area that is left.
    pub area_left: f64,
    surface: &'a dyn Fn() -> TriMesh,
}

impl ContractionStep<'_> {
    /// The contracted component, in model coordinates.
    pub fn surface(&self) -> TriMesh {
        (self.surface)()
    }
}

/// Called after every iteration; decides whether to continue.
pub type Observer<'o> = dyn FnMut(&ContractionStep<'_>) -> ControlFlow<()> + 'o;

/// Statistics of an extraction.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ExtractionReport {
    /// Connected components of the surface.
    pub parts: usize,
    /// Contraction iterations over all components.
    pub iterations: usize,
    /// Handles of the closed components and of thickened sheets: loops that the curve must have.
    pub handles: usize,
    /// Loops of the curve.
    pub loops: usize,
    /// Ends of the curve.
    pub ends: usize,
    /// Nodes where three or more branches meet.
    pub junctions: usize,
    /// Repairs made to the surface first, in words.
    pub repairs: Vec<String>,
    /// Vertices that were left out because they are far from all others ([`TriMesh::outliers`]).
    pub outliers: Vec<u32>,
    /// Components that were left out because they are too small for a curve.
    pub specks: usize,
    /// Vertices of these components.
    pub speck_vertices: usize,
    /// Factor by which the nodes are farther apart than usual, because a component is very long and thin; 1 where no component is.
    pub spacing: f64,
    /// Components whose curve was not refined to the end, because queries visited too many overlapping triangles.
    pub unrefined: usize,
}

/// Extracts the curve skeleton of a surface.
///
/// The surface is repaired first; it may be open, disconnected or non-manifold. `node_of_vertex` follows the vertices of `mesh`; vertices
/// removed by repair get the nearest node.
///
/// Left out, and counted in the report, are the triangles at outliers ([`TriMesh::outliers`]), and specks: components of less than
/// 10⁻⁴ of the area of the largest one. Their vertices get the nearest node, too. A component within the node distance of the largest one is
/// a single node. The work is bounded: at most 6000 vertices of a component
/// are contracted, its curve has about 2000 nodes at most, and many components are subdivided less (`src/shape/character/extraction`).
///
/// # Errors
/// [`CharacterError`]: zero surface area, an option out of range, a vertex index out of range, interruption by `observer` or `run`, a
/// singular system.
pub fn extract(
    mesh: &TriMesh,
    options: &ExtractionOptions,
    observer: &mut Observer<'_>,
    run: &Run,
) -> Result<(CurveSkeleton, ExtractionReport), CharacterError> {
    options.check(mesh.vertex_count())?;
    let Parts { kept: parts, repairs, outliers, specks, speck_vertices } = parts::of(mesh, run)?;
    if parts.is_empty() {
        return Err(no_area());
    }
    let spacing = 1.0;
    let mut report = ExtractionReport {
        parts: parts.len(),
        repairs,
        outliers,
        specks,
        speck_vertices,
        spacing,
        ..ExtractionReport::default()
    };
    let mut curve = CurveSkeleton { node_of_vertex: vec![u32::MAX; mesh.vertex_count()], ..CurveSkeleton::default() };
    let count = parts.len();
    // Where the largest component would have one node a small one has no more.
    let reach = part::node_distance(parts.iter().map(|part| part.mesh.area()).fold(0.0, f64::max));
    for (i, part) in parts.into_iter().enumerate() {
        let own_run = run.part(i as f64 / count as f64, (i + 1) as f64 / count as f64);
        let part::Found { curve: found, iterations, handles, spacing, refined } = match part::point_within(&part, reach)
        {
            Some(point) => point,
            None => part::extract(&part, (i, count), options, observer, &own_run)?,
        };
        report.iterations += iterations;
        report.handles += handles;
        report.spacing = report.spacing.max(spacing);
        report.unrefined += usize::from(!refined);
        let first = curve.nodes.len() as u32;
        curve.nodes.extend(found.nodes);
        curve.radius.extend(found.radius);
        curve.edges.extend(found.edges.iter().map(|e| e.map(|v| v + first)));
        for (sources, node) in part.sources.iter().zip(found.node_of_vertex) {
            for v in sources {
                curve.node_of_vertex[*v as usize] = first + node;
            }
        }
    }
    adopt_the_rest(mesh, &mut curve);
    count_features(&curve, &mut report);
    Ok((curve, report))
}

/// The skeleton of a surface in one call: [`extract`] with default options, then [`skeleton_of`] with as many joints as the curve has ends,
/// junctions and bends.
///
/// ```
/// use plumbline_shape::character::extraction::skeleton;
/// use plumbline_shape::mesh::shapes;
///
/// let bar = skeleton(&shapes::bar([4, 4, 20], [1.0, 1.0, 8.0]))?;
/// assert_eq!(bar.roots().count(), 1);
/// assert!(bar.joint_count() >= 2);
/// # Ok::<(), plumbline_shape::character::CharacterError>(())
/// ```
///
/// # Errors
/// As for [`extract`] and [`skeleton_of`].
pub fn skeleton(mesh: &TriMesh) -> Result<Skeleton, CharacterError> {
    let options = ExtractionOptions::default();
    let (curve, _) = extract(mesh, &options, &mut |_| ControlFlow::Continue(()), &Run::default())?;
    skeleton_of(&curve, None)
}

/// Assigns unassigned vertices to the nearest node.
fn adopt_the_rest(mesh: &TriMesh, curve: &mut CurveSkeleton) {
    let tree = KdTree::new(&curve.nodes);
    for (node, p) in curve.node_of_vertex.iter_mut().zip(mesh.positions()) {
        if *node == u32::MAX {
            *node = tree.nearest(p, |_| true).map_or(0, |(v, _)| v);
        }
    }
}

fn no_area() -> CharacterError {
    let fault = "mesh has zero surface area, or areas beyond the range of double precision; scale it to a size near 1";
    CharacterError::Input(fault.to_owned())
}

fn count_features(curve: &CurveSkeleton, report: &mut ExtractionReport) {
    let mut degree = vec![0_usize; curve.nodes.len()];
    let mut pieces = UnionFind::new(curve.nodes.len());
    for &[a, b] in &curve.edges {
        degree[a as usize] += 1;
        degree[b as usize] += 1;
        report.loops += usize::from(!pieces.join(a, b));
    }
    report.ends = degree.iter().filter(|d| **d == 1).count();
    report.junctions = degree.iter().filter(|d| **d > 2).count();
}

/// Normalizing transform: the centroid of the area, the radius of the sphere of equal area, and axes that turn with the model.
#[derive(Clone, Copy, Debug)]
struct Frame {
    center: Point3<f64>,
    scale: f64,
    axes: Rotation3<f64>,
}

impl Frame {
    fn of(mesh: &TriMesh) -> Option<Self> {
        let first = mesh.positions().first()?;
        let (mut sum, mut area) = (nalgebra::Vector3::zeros(), 0.0);
        for t in 0..mesh.triangle_count() {
            let own = 0.5 * mesh.area_normal(t).norm();
            let middle = mesh.corners(t).iter().map(|p| p - first).sum::<nalgebra::Vector3<f64>>() / 3.0;
            sum += middle * own;
            area += own;
        }
        let scale = (area / (4.0 * std::f64::consts::PI)).sqrt();
        (scale > 0.0 && scale.is_finite()).then(|| {
            let center = first + sum / area;
            let axes = axes(&mesh.positions().iter().map(|p| (p - center) / scale));
            Self { center, scale, axes }
        })
    }

    fn normalized(&self, p: &Point3<f64>) -> Point3<f64> {
        Point3::from((p - self.center) / self.scale)
    }

    fn of_model(&self, p: &Point3<f64>) -> Point3<f64> {
        self.center + p.coords * self.scale
    }
}

/// Axes toward the point farthest from the center, and across to the point farthest from that axis. In single precision, so that a rotated
/// model has the same farthest points; without extent any axes do.
fn axes(all: &(impl Iterator<Item = Vector3<f64>> + Clone)) -> Rotation3<f64> {
    let farthest = |part: &dyn Fn(Vector3<f64>) -> Vector3<f64>| {
        let parts = all.clone().map(part).enumerate();
        let best = parts.max_by_key(|(i, d)| (Cost::new(d.norm()), std::cmp::Reverse(*i)));
        best.and_then(|(_, d)| d.try_normalize(0.0))
    };
    let Some(first) = farthest(&|d| d) else { return Rotation3::identity() };
    let Some(second) = farthest(&|d| d - first * d.dot(&first)) else { return Rotation3::identity() };
    Rotation3::from_basis_unchecked(&[first, second, first.cross(&second)])
}
