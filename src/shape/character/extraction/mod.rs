//! The curve in the middle of a surface, and the joints of a skeleton on it.
//!
//! A surface is contracted until it is all but a curve, its triangles are collapsed, and what remains is put in the middle of the
//! shape. Part by part, with lengths in units of the radius of the sphere of equal area about the center of the area, so that
//! neither scale nor place nor pose of the model matters:
//!
//! | step | file |
//! | --- | --- |
//! | parts; vertices in one place are one | `parts.rs` |
//! | holes are closed; a surface without an inside becomes a thin solid | `caps.rs`, `sheet.rs` |
//! | about as many vertices as the curve needs | `reduction.rs` |
//! | tips, which keep their ends while the surface contracts: geodesic extrema | `extremities.rs` |
//! | the ball of each vertex | `medial.rs` |
//! | contraction, one sparse solve a round | `contraction.rs`, `normal_equations.rs` |
//! | collapse to a graph | `surgery.rs`, which loops may close: `homology.rs` |
//! | even nodes | `resampling.rs` |
//! | ends to the tips | `tips.rs` |
//! | branches into corners and rims | `cones.rs` |
//! | branches that say nothing | `pruning.rs` |
//! | the way to a tip that was none | `detours.rs` |
//! | to the middle, evened out as far as the shape is wide | `centering.rs`, `fairing.rs` |
//! | to the axis of round limbs | `axis.rs` |
//! | to where the surface sees it | `sight.rs` |
//! | sharp bends and crowded nodes that this leaves | `bends.rs`, `resampling.rs` |
//! | joints | `joints.rs` |
//!
//! The curve has as many loops as the surface has handles. Every vertex of the surface keeps the node that it became part of.
//! All iterations are bounded; an observer hears of every round and may stop the work. Results do not depend on threads.
//!
//! # Reference
//! O. K.-C. Au, C.-L. Tai, H.-K. Chu, D. Cohen-Or, T.-Y. Lee, *Skeleton extraction by mesh contraction*, SIGGRAPH 2008; A. Tagliasacchi, I.
//! Alhashim, M. Olson, H. Zhang, *Mean curvature skeletons*, SGP 2012.

mod aabb;
mod axis;
mod bends;
mod caps;
mod centering;
mod complex;
mod cones;
mod contraction;
mod detours;
mod error;
mod extremities;
mod fairing;
mod homology;
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
mod sight;
mod surgery;
#[cfg(test)]
mod tests;
mod tips;
mod web;

use std::ops::ControlFlow;

use nalgebra::Point3;

use super::{CurveSkeleton, Skeleton};
use crate::mesh::TriMesh;
pub use error::ExtractionError;
pub use joints::skeleton_of;
use plumbline_num::options::OptionError;
use plumbline_num::run::Run;
use plumbline_num::spatial::{KdTree, UnionFind};

/// Which ends must stay.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Keep {
    /// None in particular.
    #[default]
    Nothing,
    /// Those at vertices of the mesh: the curve reaches each of them.
    Vertices(Vec<u32>),
    /// Those at the tips that geodesic distance finds.
    Extrema,
}

/// How a curve is extracted.
#[derive(Clone, Debug, PartialEq)]
pub struct ExtractionOptions {
    /// Strength of the contraction, dimensionless. Less than 0.3 leaves wide parts as sheets, more than 2 draws limbs in.
    pub contraction: f64,
    /// How firmly a round holds on to the one before.
    pub hold: f64,
    /// Strength of the pull toward medial centers.
    pub medial: f64,
    /// Branches whose end sticks out of the balls about the rest of the curve by less than this share of its own half-width are
    /// taken away.
    pub prune: f64,
    /// Rounds of contraction at most.
    pub rounds: usize,
    /// Ends that stay.
    pub keep: Keep,
}

impl Default for ExtractionOptions {
    fn default() -> Self {
        Self { contraction: 0.7, hold: 0.1, medial: 0.3, prune: 1.5, rounds: 12, keep: Keep::default() }
    }
}

impl ExtractionOptions {
    fn check(&self, vertices: usize) -> Result<(), ExtractionError> {
        for (name, value) in [("contraction", self.contraction), ("hold", self.hold), ("medial", self.medial)] {
            OptionError::check(value > 0.0 && value <= 1000.0, name, value, "more than 0, at most 1000")?;
        }
        OptionError::check((0.0..=100.0).contains(&self.prune), "prune", self.prune, "0 to 100")?;
        match &self.keep {
            Keep::Vertices(all) => match all.iter().find(|v| **v as usize >= vertices) {
                Some(&vertex) => Err(ExtractionError::NoSuchVertex { vertex, vertices }),
                None => Ok(()),
            },
            Keep::Nothing | Keep::Extrema => Ok(()),
        }
    }
}

/// A round of contraction.
pub struct Round<'a> {
    /// The part of the surface, from 0.
    pub part: usize,
    /// How many parts there are.
    pub parts: usize,
    /// The round, from 1.
    pub round: usize,
    /// Rounds at most.
    pub rounds: usize,
    /// Share of the part's area that is left.
    pub area_left: f64,
    surface: &'a dyn Fn() -> TriMesh,
}

impl Round<'_> {
    /// The contracted part, in the place and scale of the model.
    pub fn surface(&self) -> TriMesh {
        (self.surface)()
    }
}

/// What is told of each round, and whether to go on.
pub type Observer<'o> = dyn FnMut(&Round<'_>) -> ControlFlow<()> + 'o;

/// How an extraction went.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ExtractionReport {
    /// Parts of the surface.
    pub parts: usize,
    /// Rounds of contraction over all parts.
    pub rounds: usize,
    /// Handles of the closed parts, and of sheets that are laid double: loops that the curve must have.
    pub handles: usize,
    /// Loops that it has.
    pub loops: usize,
    /// Ends of the curve.
    pub ends: usize,
    /// Nodes where three or more branches meet.
    pub junctions: usize,
    /// What repair did to the surface first, in words.
    pub repairs: Vec<String>,
}

/// The curve of a surface.
///
/// The surface is repaired first; it may be open, in parts, or no manifold. `node_of_vertex` of the result follows the vertices of
/// `mesh`; a vertex of which repair left nothing gets the node nearest to it.
///
/// # Errors
/// [`ExtractionError`]: a mesh without area, an option outside its range, a vertex to keep that does not exist, an interruption by
/// `observer` or `run`, a system that cannot be solved.
pub fn extract(
    mesh: &TriMesh,
    options: &ExtractionOptions,
    observer: &mut Observer<'_>,
    run: &Run,
) -> Result<(CurveSkeleton, ExtractionReport), ExtractionError> {
    options.check(mesh.vertex_count())?;
    let (parts, repairs) = parts::of(mesh, run)?;
    if parts.is_empty() {
        return Err(ExtractionError::Empty);
    }
    let mut report = ExtractionReport { parts: parts.len(), repairs, ..ExtractionReport::default() };
    let mut curve = CurveSkeleton { node_of_vertex: vec![u32::MAX; mesh.vertex_count()], ..CurveSkeleton::default() };
    let count = parts.len();
    for (i, part) in parts.into_iter().enumerate() {
        let found = part::extract(
            &part,
            (i, count),
            options,
            observer,
            &run.part(i as f64 / count as f64, (i + 1) as f64 / count as f64),
        )?;
        report.rounds += found.rounds;
        report.handles += found.handles;
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

/// The skeleton of a surface: [`extract`] with the default options, and [`skeleton_of`] its curve with as many joints as the
/// shape has ends, junctions and bends.
///
/// ```
/// use plumbline_shape::character::extraction::skeleton;
/// use plumbline_shape::mesh::shapes;
///
/// let bar = skeleton(&shapes::bar([4, 4, 20], [1.0, 1.0, 8.0]))?;
/// assert_eq!(bar.roots().count(), 1);
/// assert!(bar.joint_count() >= 2);
/// # Ok::<(), plumbline_shape::character::extraction::ExtractionError>(())
/// ```
///
/// # Errors
/// As for [`extract`]; [`ExtractionError::Skeleton`].
pub fn skeleton(mesh: &TriMesh) -> Result<Skeleton, ExtractionError> {
    let options = ExtractionOptions::default();
    let (curve, _) = extract(mesh, &options, &mut |_| ControlFlow::Continue(()), &Run::default())?;
    Ok(skeleton_of(&curve, None)?)
}

/// Vertices of no part go to the nearest node.
fn adopt_the_rest(mesh: &TriMesh, curve: &mut CurveSkeleton) {
    let tree = KdTree::new(&curve.nodes);
    for (node, p) in curve.node_of_vertex.iter_mut().zip(mesh.positions()) {
        if *node == u32::MAX {
            *node = tree.nearest(p, |_| true).map_or(0, |(v, _)| v);
        }
    }
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

/// A place and a scale that do not depend on how the model lies: the center of its area, and the radius of the sphere of equal
/// area.
#[derive(Clone, Copy, Debug)]
struct Frame {
    center: Point3<f64>,
    scale: f64,
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
        (scale > 0.0 && scale.is_finite()).then(|| Self { center: first + sum / area, scale })
    }

    fn normalized(&self, p: &Point3<f64>) -> Point3<f64> {
        Point3::from((p - self.center) / self.scale)
    }

    fn of_model(&self, p: &Point3<f64>) -> Point3<f64> {
        self.center + p.coords * self.scale
    }
}
