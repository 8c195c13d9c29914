//! One surface made of parts of two.
//!
//! 1. Both are cut ([`Cut`]).
//! 2. The part is brought to the base by a similarity: that of landmarks, or that of the two cuts.
//! 3. Both cuts gain each other's vertices and are joined one to one.
//! 4. In a band of rings around the seam the surface is solved for, so that it is continuous and smooth; outside it the base is as
//!    it was, and the part as it was but for the similarity.
//!
//! Where both were closed and manifold, so is the result.

mod cut;
mod seam_file;
mod stitching;
#[cfg(test)]
mod tests;
mod transition;

use std::collections::VecDeque;

use nalgebra::{Point3, Similarity3};

use super::MorphError;
use super::rigid::nearest_similarity;
use super::trajectory::opposite_edges;
use crate::mesh::operators::{CotangentRule, Cotangents};
use crate::mesh::{HalfEdges, TriMesh};
pub use cut::{Cut, CutSurface, cut};
use plumbline_num::run::Run;
pub use seam_file::SeamFile;
#[cfg(feature = "schema")]
#[cfg(feature = "schema")]
pub use seam_file::seam_schema;
use stitching::{Measured, Sheet, loop_similarity, matched};
use transition::Transition;

/// How two surfaces are made one.
#[derive(Clone, Debug, PartialEq)]
pub struct ComposeOptions {
    /// Where the base is cut.
    pub base: Cut,
    /// Where the part is cut.
    pub part: Cut,
    /// Vertices of base and part that belong together, at least three; fewer: none, and the two cuts tell how the part lies.
    pub landmarks: Vec<(u32, u32)>,
    /// Rings of vertices on either side of the seam that may move.
    pub band: usize,
}

/// Rings on either side of the seam that may move by default: half of it leaves a crease where the cuts are far apart, twice as
/// many smooth away detail.
const BAND: usize = 6;

impl ComposeOptions {
    /// Cuts in both surfaces, a band of 6 rings, and the part aligned by the cuts alone.
    pub fn new(base: Cut, part: Cut) -> Self {
        Self { base, part, landmarks: Vec::new(), band: BAND }
    }
}

/// Two surfaces made one.
#[derive(Clone, Debug)]
pub struct Composition {
    /// The surface: vertices of the base, then those of the part.
    pub mesh: TriMesh,
    /// The vertices of the seam, in order.
    pub seam: Vec<u32>,
    /// Where each vertex comes from.
    pub origin: Vec<Origin>,
    /// Edges from each vertex to the seam.
    pub ring: Vec<usize>,
    /// Where the part went before the transition.
    pub base_from_part: Similarity3<f64>,
    /// The farthest that the two cuts were apart after alignment, in diagonals of the base.
    pub gap: f64,
    /// The steepest angle between neighbors across the seam, rad.
    pub crease: f64,
}

/// Where a vertex comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// A vertex of the base.
    Base(u32),
    /// A vertex of the part.
    Part(u32),
    /// Made by a cut or at the seam.
    Made,
}

/// Makes two surfaces one.
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
    let line = |points: &[Point3<f64>], seam: &[u32]| Measured::new(seam.iter().map(|v| points[*v as usize]).collect());
    let pairs = matched(&line(kept.mesh.positions(), &kept.seam), &line(&moved, &added.seam));
    let mut sheets = [&kept, &added]
        .map(|c| Sheet { positions: c.mesh.positions().to_vec(), triangles: c.mesh.triangles().to_vec() });
    sheets[1].positions = moved;
    let (of_base, of_part): (Vec<_>, Vec<_>) = pairs.into_iter().unzip();
    let seams = [sheets[0].divide(&kept.seam, &of_base), sheets[1].divide(&added.seam, &of_part)];
    run.check()?;
    let joined = Joined::new(&sheets, &seams, [&kept, &added])?;
    let ring = rings(joined.mesh.triangles(), joined.mesh.vertex_count(), &seams[0]);
    let band = usable_band(&ring, options.band, which_part(&joined))?;
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

/// The similarity that takes the part to the base.
fn alignment(
    base: &TriMesh,
    part: &TriMesh,
    kept: &CutSurface,
    added: &CutSurface,
    landmarks: &[(u32, u32)],
) -> Result<Similarity3<f64>, MorphError> {
    if landmarks.is_empty() {
        let line = |c: &CutSurface| Measured::new(c.seam.iter().map(|v| c.mesh.positions()[*v as usize]).collect());
        return Ok(loop_similarity(&line(kept), &line(added)));
    }
    let from: Vec<_> = landmarks.iter().map(|l| part.positions()[l.1 as usize]).collect();
    let to: Vec<_> = landmarks.iter().map(|l| base.positions()[l.0 as usize]).collect();
    let (map, rank) = nearest_similarity(&from, &to, &vec![1.0; from.len()], true);
    if landmarks.len() < 3 || rank < 2 {
        return Err(MorphError::Landmarks { given: landmarks.len(), expected: 3 });
    }
    Ok(map)
}

/// Both sheets as one mesh.
struct Joined {
    mesh: TriMesh,
    origin: Vec<Origin>,
    edges: Vec<[nalgebra::Vector3<f64>; 3]>,
    half: Vec<[f64; 3]>,
    /// Vertices that come from the base's sheet.
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

fn which_part(joined: &Joined) -> impl Fn(usize) -> bool + use<> {
    let of_base = joined.of_base;
    move |v| v < of_base
}

/// Edges from each vertex to the seam; `usize::MAX` where no way leads there.
fn rings(triangles: &[[u32; 3]], vertices: usize, seam: &[u32]) -> Vec<usize> {
    let mut neighbors: Vec<Vec<u32>> = vec![Vec::new(); vertices];
    for &[a, b, c] in triangles {
        for (i, j) in [(a, b), (b, c), (c, a)] {
            neighbors[i as usize].push(j);
            neighbors[j as usize].push(i);
        }
    }
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

/// The band, made narrower until a ring of both sides stays where it is.
fn usable_band(ring: &[usize], wanted: usize, of_base: impl Fn(usize) -> bool) -> Result<usize, MorphError> {
    let deepest = |base: bool| {
        let side = ring.iter().enumerate().filter(|(v, r)| of_base(*v) == base && **r != usize::MAX);
        side.map(|(_, r)| *r).max().unwrap_or(0)
    };
    let band = wanted.min(deepest(true)).min(deepest(false));
    if band == 0 {
        let (what, value) = ("the band of the seam, in rings".to_owned(), wanted.to_string());
        let expected = "at least 1, and a base and a part with vertices beside their cuts".to_owned();
        return Err(MorphError::Value { what, value, expected });
    }
    Ok(band)
}

/// Of a surface and smoother ones the one that bends least about the seam. Slivers at the seam can spoil the smoothing, and differently
/// for each width: only those count that made the seam itself less steep.
fn smoothest(closed: TriMesh, smooth: Vec<Vec<Point3<f64>>>, seam: &[u32], ring: &[usize]) -> TriMesh {
    let steepest = crease(&closed, seam);
    let better = smooth.into_iter().filter_map(|x| closed.with_positions(x).ok());
    let better = better.filter(|mesh| crease(mesh, seam) <= steepest);
    let least = better.min_by(|a, b| bending(a, ring).total_cmp(&bending(b, ring)));
    least.unwrap_or(closed)
}

/// Rings about the seam whose bending is compared: those that the smoothing moves, and where they meet what stays.
const COMPARED: usize = 4;

/// `Σ θ² |e|` over the edges about the seam, `θ` the angle between the triangles on both sides.
fn bending(mesh: &TriMesh, ring: &[usize]) -> f64 {
    let Ok(half_edges) = HalfEdges::new(mesh) else { return f64::INFINITY };
    let of_edge = |h: u32| {
        let [a, b] = [half_edges.origin(h), half_edges.destination(h)];
        let near = ring[a as usize].min(ring[b as usize]) <= COMPARED;
        let pair = [h, half_edges.twin(h).filter(|_| near)?].map(|h| mesh.area_normal(HalfEdges::triangle(h) as usize));
        let length = (mesh.positions()[a as usize] - mesh.positions()[b as usize]).norm();
        Some(pair[0].angle(&pair[1]).powi(2) * length)
    };
    half_edges.edges().filter_map(of_edge).sum()
}

/// The steepest angle between the triangles on both sides of an edge of the seam.
fn crease(mesh: &TriMesh, seam: &[u32]) -> f64 {
    let Ok(half_edges) = HalfEdges::new(mesh) else { return f64::NAN };
    let of_edge = |(a, b): (u32, u32)| {
        let h = half_edges.around(a).find(|&h| half_edges.destination(h) == b)?;
        let pair = [h, half_edges.twin(h)?].map(|h| mesh.area_normal(HalfEdges::triangle(h) as usize));
        Some(pair[0].angle(&pair[1]))
    };
    let edges = (0..seam.len()).map(|k| (seam[k], seam[(k + 1) % seam.len()]));
    edges.filter_map(of_edge).fold(0.0, f64::max)
}
