//! Composition of one surface from parts of two.
//!
//! 1. Both surfaces are cut ([`Cut`]).
//! 2. The part is aligned with the base by a similarity, from landmarks or from the two cuts.
//! 3. The vertices of each cut are inserted into the other one, and both are joined one to one.
//! 4. A band of rings around the seam is deformed to be continuous and smooth. Outside the band the base is unchanged, and the part
//!    is unchanged up to the similarity.
//!
//! The result is closed and manifold if both surfaces are.

mod cut;
mod seam_file;
mod stitching;
#[cfg(test)]
mod tests;
mod transition;

use std::collections::{BTreeMap, VecDeque};

use nalgebra::{Point3, Similarity3};

use super::MorphError;
use super::rigid::landmark_similarity;
use super::trajectory::opposite_edges;
use crate::mesh::operators::{CotangentRule, Cotangents};
use crate::mesh::{HalfEdges, TriMesh, neighbors_of_vertices};
pub use cut::{Cut, CutSurface, cut};
use plumbline_num::run::Run;
pub use seam_file::SeamFile;
#[cfg(feature = "schema")]
pub use seam_file::seam_schema;
use stitching::{ArcLengthCurve, Sheet, curve_similarity, matched_points};
use transition::Transition;

/// Options of a composition.
#[derive(Clone, Debug, PartialEq)]
pub struct ComposeOptions {
    /// Cut of the base.
    pub base: Cut,
    /// Cut of the part.
    pub part: Cut,
    /// Corresponding vertices of base and part, at least three; without any the part is aligned by the two cuts.
    pub landmarks: Vec<(u32, u32)>,
    /// Width of the transition band on either side of the seam, in rings of vertices.
    pub band: usize,
}

/// Default width of the transition band, in rings: half of it leaves a crease where the cuts are far apart, twice of it removes
/// detail.
const DEFAULT_BAND: usize = 6;

impl ComposeOptions {
    /// Two cuts, a band of 6 rings, and alignment by the cuts.
    pub fn new(base: Cut, part: Cut) -> Self {
        Self { base, part, landmarks: Vec::new(), band: DEFAULT_BAND }
    }
}

/// A composed surface.
#[derive(Clone, Debug)]
pub struct Composition {
    /// The surface: vertices of the base, then those of the part.
    pub mesh: TriMesh,
    /// The vertices of the seam, in order.
    pub seam: Vec<u32>,
    /// Origin of each vertex.
    pub origin: Vec<Origin>,
    /// Distance of each vertex from the seam in edges.
    pub ring: Vec<usize>,
    /// Similarity of the part before the transition.
    pub base_from_part: Similarity3<f64>,
    /// Largest distance between the two cuts after alignment, in diagonals of the base.
    pub gap: f64,
    /// Largest dihedral angle at the seam, rad.
    pub crease: f64,
}

/// Origin of a vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// A vertex of the base.
    Base(u32),
    /// A vertex of the part.
    Part(u32),
    /// Created by a cut or at the seam.
    Made,
}

/// Composes two surfaces.
///
/// ```
/// use plumbline_num::run::Run;
/// use plumbline_shape::mesh::shapes;
/// use plumbline_shape::morph::composition::{ComposeOptions, Cut, compose};
///
/// let (base, part) = (shapes::icosphere(3), shapes::icosphere(4));
/// let across = |normal: [f64; 3]| Cut::Plane { point: [0.0, 0.0, 0.1].into(), normal: normal.into() };
/// let options = ComposeOptions::new(across([0.0, 0.0, -1.0]), across([0.0, 0.0, 1.0])); // the lower half below the upper one
/// let composed = compose(&base, &part, &options, &Run::default())?;
/// assert!(composed.gap < 0.01);
/// # Ok::<(), plumbline_shape::morph::MorphError>(())
/// ```
///
/// # Errors
/// [`MorphError::Seam`], [`MorphError::NoSuchVertex`], [`MorphError::Landmarks`], [`MorphError::Mesh`], [`MorphError::Numerics`],
/// [`MorphError::Interrupted`].
pub fn compose(base: &TriMesh, part: &TriMesh, options: &ComposeOptions, run: &Run) -> Result<Composition, MorphError> {
    let kept = cut(base, &options.base, "base", true, run)?;
    let added = cut(part, &options.part, "part", false, run)?;
    let base_from_part = alignment(base, part, &kept, &added, &options.landmarks)?;
    let moved: Vec<Point3<f64>> = added.mesh.positions().iter().map(|p| base_from_part * p).collect();
    let line =
        |points: &[Point3<f64>], seam: &[u32]| ArcLengthCurve::new(seam.iter().map(|v| points[*v as usize]).collect());
    let pairs = matched_points(&line(kept.mesh.positions(), &kept.seam), &line(&moved, &added.seam));
    let mut sheets = [&kept, &added]
        .map(|c| Sheet { positions: c.mesh.positions().to_vec(), triangles: c.mesh.triangles().to_vec() });
    sheets[1].positions = moved;
    let (of_base, of_part): (Vec<_>, Vec<_>) = pairs.into_iter().unzip();
    let seams = [sheets[0].divide(&kept.seam, &of_base), sheets[1].divide(&added.seam, &of_part)];
    run.check()?;
    let joined = Joined::new(&sheets, &seams, [&kept, &added])?;
    let ring = rings(joined.mesh.triangles(), joined.mesh.vertex_count(), &seams[0]);
    let band = usable_band(&ring, options.band, joined.of_base)?;
    let transition = Transition { joined: &joined.mesh, edges: joined.edges, half: joined.half, ring: &ring, band };
    let (closed, smooth) = transition.solve(run)?;
    let mesh = smoothest(joined.mesh.with_positions(closed)?, smooth, &seams[0], &ring);
    run.check()?;
    HalfEdges::new(&mesh)?;
    Ok(Composition {
        crease: crease(&mesh, &seams[0]),
        gap: joined.gap / base.diagonal(),
        mesh,
        seam: seams[0].clone(),
        origin: joined.origin,
        ring,
        base_from_part,
    })
}

/// The triangle on the left of each directed edge.
type LeftTriangles = BTreeMap<(u32, u32), usize>;

fn left_triangles(triangles: &[[u32; 3]]) -> LeftTriangles {
    let edges = |(t, &[a, b, c]): (usize, &[u32; 3])| [(a, b), (b, c), (c, a)].map(|edge| (edge, t));
    triangles.iter().enumerate().flat_map(edges).collect()
}

/// The edges of a closed curve of vertices, from each vertex to the next.
fn closed_edges(line: &[u32]) -> impl Iterator<Item = (u32, u32)> + '_ {
    line.iter().copied().zip(line.iter().copied().cycle().skip(1))
}

/// The similarity from the part to the base.
fn alignment(
    base: &TriMesh,
    part: &TriMesh,
    kept: &CutSurface,
    added: &CutSurface,
    landmarks: &[(u32, u32)],
) -> Result<Similarity3<f64>, MorphError> {
    if landmarks.is_empty() {
        let line =
            |c: &CutSurface| ArcLengthCurve::new(c.seam.iter().map(|v| c.mesh.positions()[*v as usize]).collect());
        return Ok(curve_similarity(&line(kept), &line(added)));
    }
    landmark_similarity(landmarks.iter().map(|l| (part.positions()[l.1 as usize], base.positions()[l.0 as usize])))
}

/// Both sheets joined to one mesh.
struct Joined {
    mesh: TriMesh,
    origin: Vec<Origin>,
    edges: Vec<[nalgebra::Vector3<f64>; 3]>,
    half: Vec<[f64; 3]>,
    /// Number of vertices of the base's sheet.
    of_base: usize,
    gap: f64,
}

impl Joined {
    fn new(sheets: &[Sheet; 2], seams: &[Vec<u32>; 2], cuts: [&CutSurface; 2]) -> Result<Self, MorphError> {
        let mut positions = sheets[0].positions.clone();
        let of_base = positions.len();
        let mut number: Vec<Option<u32>> = vec![None; sheets[1].positions.len()];
        let mut gap: f64 = 0.0;
        for (&v, &w) in seams[0].iter().zip(&seams[1]) {
            number[w as usize] = Some(v);
            let other = sheets[1].positions[w as usize];
            gap = gap.max((positions[v as usize] - other).norm());
        }
        let source = |cut: &CutSurface, v: usize| cut.source.get(v).copied().flatten();
        let mut origin: Vec<Origin> =
            (0..of_base).map(|v| source(cuts[0], v).map_or(Origin::Made, Origin::Base)).collect();
        seams[0].iter().for_each(|v| origin[*v as usize] = Origin::Made);
        for (w, number) in number.iter_mut().enumerate().filter(|(_, n)| n.is_none()) {
            *number = Some(positions.len() as u32);
            positions.push(sheets[1].positions[w]);
            origin.push(source(cuts[1], w).map_or(Origin::Made, Origin::Part));
        }
        let renamed = |v: u32| number[v as usize].unwrap_or(v);
        let mut triangles = sheets[0].triangles.clone();
        triangles.extend(sheets[1].triangles.iter().map(|t| t.map(renamed)));
        let (mut edges, mut half) = (Vec::new(), Vec::new());
        for sheet in sheets {
            let own = TriMesh::new(sheet.positions.clone(), sheet.triangles.clone())?;
            edges.extend((0..own.triangle_count()).map(|t| opposite_edges(&own.corners(t))));
            half.extend_from_slice(Cotangents::new(&own, CotangentRule::Raw).half());
        }
        Ok(Self { mesh: TriMesh::new(positions, triangles)?, origin, edges, half, of_base, gap })
    }
}

/// Distance of each vertex from the seam in edges (breadth-first); `usize::MAX` on other components.
fn rings(triangles: &[[u32; 3]], vertices: usize, seam: &[u32]) -> Vec<usize> {
    let neighbors = neighbors_of_vertices(vertices, triangles);
    let mut ring = vec![usize::MAX; vertices];
    for v in seam {
        ring[*v as usize] = 0;
    }
    let mut queue: VecDeque<u32> = seam.iter().copied().collect();
    while let Some(v) = queue.pop_front() {
        for &w in &neighbors[v as usize] {
            if ring[w as usize] == usize::MAX {
                ring[w as usize] = ring[v as usize] + 1;
                queue.push_back(w);
            }
        }
    }
    ring
}

/// The band width, reduced until at least one ring of both sides is fixed; the first `of_base` vertices are those of the base.
fn usable_band(ring: &[usize], wanted: usize, of_base: usize) -> Result<usize, MorphError> {
    let (base, part) = ring.split_at(of_base);
    let deepest = |side: &[usize]| side.iter().copied().filter(|r| *r != usize::MAX).max().unwrap_or(0);
    let band = wanted.min(deepest(base)).min(deepest(part));
    if band == 0 {
        let (what, value) = ("the band of the seam, in rings".to_owned(), wanted.to_string());
        let expected = "at least 1, and a base and a part with vertices away from their cuts".to_owned();
        return Err(MorphError::Value { what, value, expected });
    }
    Ok(band)
}

/// The candidate with the least bending around the seam. Slivers at the seam can spoil the smoothing for some widths: only candidates
/// that reduce the dihedral angles of the seam are considered.
fn smoothest(closed: TriMesh, smooth: Vec<Vec<Point3<f64>>>, seam: &[u32], ring: &[usize]) -> TriMesh {
    let steepest = crease(&closed, seam);
    let better = smooth.into_iter().filter_map(|x| closed.with_positions(x).ok());
    let better = better.filter(|mesh| crease(mesh, seam) <= steepest);
    let least = better.min_by(|a, b| bending(a, ring).total_cmp(&bending(b, ring)));
    least.unwrap_or(closed)
}

/// Rings around the seam in which bending is compared: those moved by the smoothing, and the first fixed one.
const COMPARED_RINGS: usize = 4;

/// `Σ θ² |e|` over the edges around the seam with dihedral angles `θ`.
fn bending(mesh: &TriMesh, ring: &[usize]) -> f64 {
    let Ok(half_edges) = HalfEdges::new(mesh) else { return f64::INFINITY };
    let of_edge = |h: u32| {
        let [a, b] = [half_edges.origin(h), half_edges.destination(h)];
        let near = ring[a as usize].min(ring[b as usize]) <= COMPARED_RINGS;
        let pair = [h, half_edges.twin(h).filter(|_| near)?].map(|h| mesh.area_normal(HalfEdges::triangle(h) as usize));
        let length = (mesh.positions()[a as usize] - mesh.positions()[b as usize]).norm();
        Some(pair[0].angle(&pair[1]).powi(2) * length)
    };
    half_edges.edges().filter_map(of_edge).sum()
}

/// The largest dihedral angle at the seam.
fn crease(mesh: &TriMesh, seam: &[u32]) -> f64 {
    let Ok(half_edges) = HalfEdges::new(mesh) else { return f64::NAN };
    let of_edge = |(a, b): (u32, u32)| {
        let h = half_edges.around(a).find(|&h| half_edges.destination(h) == b)?;
        let pair = [h, half_edges.twin(h)?].map(|h| mesh.area_normal(HalfEdges::triangle(h) as usize));
        Some(pair[0].angle(&pair[1]))
    };
    closed_edges(seam).filter_map(of_edge).fold(0.0, f64::max)
}
