//! Cuts of a surface along a closed curve.
//!
//! A plane `n·(x − p) = 0` and the loop through picked vertices are zero level sets of a function on the vertices, which divide
//! triangles. A lasso follows edges, on shortest paths from one of its vertices to the next; a loop is the lasso after smoothing:
//! the indicator `χ` of one side diffuses for a short time,
//!
//! ```text
//! (M + τ L) u = M χ,
//! ```
//!
//! and the curve is the level set `u = ½`, across triangles and without the lasso's corners: one step of mean curvature motion.
//!
//! Only the curve nearest to the given point cuts, so that a plane through a neck does not cut a leg too.
//!
//! # Reference
//! B. Merriman, J. Bence, S. Osher, *Motion of multiple junctions: a level set approach*, J. Comput. Phys. 112 (1994).

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Point3, Vector3};

use super::super::MorphError;
use super::super::correspondence::divided;
use super::{LeftTriangles, closed_edges, left_triangles};
use crate::mesh::operators::{CotangentRule, Cotangents, EdgeWeights, barycentric_areas, factored_laplacian};
use crate::mesh::{HalfEdges, TriMesh, neighbors_of_vertices};
use plumbline_num::energy::ConstrainedLaplacian;
use plumbline_num::run::Run;
use plumbline_num::sparse::Ordering;
use plumbline_num::spatial::{ShortestPaths, UnionFind};

/// Distance of a cut point from a vertex, as a fraction of the edge, below which the cut is snapped to the vertex. Smaller values
/// leave slivers with noisy normals after the transition; larger ones move the cut visibly away from the plane.
const SNAP_FRACTION: f64 = 0.1;

/// Diffusion length of a loop's indicator, in mean edge lengths of the lasso. Smaller values leave corners, larger ones move the
/// curve away from the picked vertices.
const DIFFUSION_LENGTH: f64 = 2.0;

/// A cut of a surface.
#[derive(Clone, Debug, PartialEq)]
pub enum Cut {
    /// By a plane, along its closed intersection curve nearest to the point.
    Plane {
        /// A point of the plane, near the cut.
        point: Point3<f64>,
        /// Normal of the plane, towards the kept side.
        normal: Vector3<f64>,
    },
    /// Along edges, on shortest paths from vertex to vertex and back to the first.
    Lasso {
        /// Vertices on the curve, in order.
        vertices: Vec<u32>,
        /// A vertex of the kept side.
        keep: u32,
    },
    /// A smoothed lasso, across triangles.
    Loop {
        /// Vertices near the curve, in order.
        vertices: Vec<u32>,
        /// A vertex of the kept side.
        keep: u32,
    },
    /// No cut: the existing boundary nearest to a point.
    Boundary {
        /// The point.
        near: Point3<f64>,
    },
}

/// A cut surface.
#[derive(Clone, Debug)]
pub struct CutSurface {
    /// The kept part.
    pub mesh: TriMesh,
    /// The vertices of the cut in order, the surface on their left.
    pub seam: Vec<u32>,
    /// The input vertex of each vertex; `None` for those created by the cut.
    pub source: Vec<Option<u32>>,
}

/// Cuts a surface. Parts that do not touch the cut are kept if `keep_rest`.
///
/// # Errors
/// [`MorphError::Seam`] if the curve does not close, does not separate, or does not exist; [`MorphError::NoSuchVertex`];
/// [`MorphError::Mesh`] if the surface is not an oriented manifold.
pub fn cut(
    mesh: &TriMesh,
    cut: &Cut,
    which: &'static str,
    keep_rest: bool,
    run: &Run,
) -> Result<CutSurface, MorphError> {
    HalfEdges::new(mesh)?;
    match cut {
        Cut::Plane { point, normal } => {
            let normal = normal.try_normalize(0.0).filter(|n| n.iter().all(|c| c.is_finite()));
            let normal = normal.ok_or_else(|| seam(which, "has a plane whose normal is zero".to_owned()))?;
            let levels = mesh.positions().iter().map(|p| normal.dot(&(p - point))).collect();
            along_level(mesh, levels, point, which, keep_rest)
        }
        Cut::Lasso { vertices, keep } => {
            let line = closed_path(mesh, vertices, *keep, which)?;
            separated(mesh, &line, Some(*keep), &own_vertices(mesh), which, keep_rest)
        }
        Cut::Loop { vertices, keep } => {
            let line = closed_path(mesh, vertices, *keep, which)?;
            let levels = shortened(mesh, &line, *keep, which, run)?;
            along_level(mesh, levels, &mesh.positions()[vertices[0] as usize], which, keep_rest)
        }
        Cut::Boundary { near } => {
            let loops = HalfEdges::new(mesh)?.boundary_loops();
            let line = nearest_line(mesh, loops, near);
            let seam =
                line.ok_or_else(|| seam(which, "is a boundary, but the surface is closed; cut it".to_owned()))?;
            Ok(CutSurface { mesh: mesh.clone(), seam, source: own_vertices(mesh) })
        }
    }
}

fn seam(which: &'static str, fault: String) -> MorphError {
    MorphError::Seam { which, fault }
}

/// The vertices of a surface that is not divided, as sources of themselves.
fn own_vertices(mesh: &TriMesh) -> Vec<Option<u32>> {
    (0..mesh.vertex_count() as u32).map(Some).collect()
}

/// Cuts along the zero level curve nearest to a point; keeps the positive side.
fn along_level(
    mesh: &TriMesh,
    mut levels: Vec<f64>,
    near: &Point3<f64>,
    which: &'static str,
    keep_rest: bool,
) -> Result<CutSurface, MorphError> {
    snap(mesh, &mut levels);
    let mut positions = mesh.positions().to_vec();
    let mut source = own_vertices(mesh);
    let mut middle_of = BTreeMap::new();
    for &[a, b, c] in mesh.triangles() {
        for (i, j) in [(a, b), (b, c), (c, a)].map(|(i, j)| (i.min(j), i.max(j))) {
            let (p, q) = (levels[i as usize], levels[j as usize]);
            if p * q < 0.0 && !middle_of.contains_key(&(i, j)) {
                middle_of.insert((i, j), positions.len() as u32);
                let (a, b) = (positions[i as usize], positions[j as usize]);
                positions.push(a + (b - a) * (p / (p - q)));
                levels.push(0.0);
                source.push(None);
            }
        }
    }
    let triangles = mesh.triangles().iter().flat_map(|t| divided(t, &middle_of)).collect();
    let divided = TriMesh::new(positions, triangles)?;
    let above: Vec<bool> = divided.triangles().iter().map(|t| t.iter().all(|v| levels[*v as usize] >= 0.0)).collect();
    let lines = lines_between(&divided, &above);
    let closed: Vec<_> = lines.iter().filter(|l| l.1).map(|l| l.0.clone()).collect();
    let open = lines.len() - closed.len();
    let line = nearest_line(&divided, closed, near).ok_or_else(|| {
        let fault = if open > 0 {
            "does not close: it ends at the boundary of the surface"
        } else {
            "does not meet the surface"
        };
        seam(which, format!("{fault}; move the plane or the vertices"))
    })?;
    separated(&divided, &line, None, &source, which, keep_rest)
}

/// Moves the level set to vertices very near to it.
fn snap(mesh: &TriMesh, levels: &mut [f64]) {
    let given = levels.to_vec();
    for &[a, b, c] in mesh.triangles() {
        for (i, j) in [(a, b), (b, c), (c, a), (b, a), (c, b), (a, c)] {
            let (p, q) = (given[i as usize], given[j as usize]);
            if p * q < 0.0 && p.abs() < SNAP_FRACTION * (p - q).abs() {
                levels[i as usize] = 0.0;
            }
        }
    }
}

/// Curves between marked triangles and others, with the marked ones on their left, and whether each closes.
fn lines_between(mesh: &TriMesh, marked: &[bool]) -> Vec<(Vec<u32>, bool)> {
    let left = left_triangles(mesh.triangles());
    let mut next: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    let mut before = BTreeMap::new();
    for (&(a, b), &t) in &left {
        if marked[t] && left.get(&(b, a)).is_some_and(|&u| !marked[u]) {
            next.entry(a).or_default().push(b);
            *before.entry(b).or_insert(0_usize) += 1;
        }
    }
    let starts: Vec<u32> = next.keys().copied().collect();
    // Open curves first, from their ends.
    let (ends, rest): (Vec<u32>, Vec<u32>) =
        starts.into_iter().partition(|v| before.get(v).copied().unwrap_or(0) < next[v].len());
    let mut lines = Vec::new();
    for start in ends.into_iter().chain(rest) {
        while next.get(&start).is_some_and(|n| !n.is_empty()) {
            let (mut line, mut at) = (vec![start], start);
            while let Some(v) = next.get_mut(&at).and_then(Vec::pop) {
                at = v;
                if v == start {
                    break;
                }
                line.push(v);
            }
            lines.push((line, at == start));
        }
    }
    lines
}

fn nearest_line(mesh: &TriMesh, lines: Vec<Vec<u32>>, near: &Point3<f64>) -> Option<Vec<u32>> {
    let distance = |line: &Vec<u32>| {
        line.iter().map(|v| (mesh.positions()[*v as usize] - near).norm_squared()).fold(f64::INFINITY, f64::min)
    };
    lines.into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

/// The kept side of a surface separated along a closed curve of its edges: that of a vertex, or the left one.
fn separated(
    mesh: &TriMesh,
    line: &[u32],
    kept: Option<u32>,
    source: &[Option<u32>],
    which: &'static str,
    keep_rest: bool,
) -> Result<CutSurface, MorphError> {
    let edges: Vec<(u32, u32)> = closed_edges(line).collect();
    let left = left_triangles(mesh.triangles());
    let part = parts(mesh, &left, &edges);
    let side = |from: u32, to: u32| left.get(&(from, to)).map(|&t| part[t]);
    let sides = side(line[0], line[1]).zip(side(line[1], line[0]));
    let (left, right) = sides.ok_or_else(|| seam(which, "runs along the boundary of the surface".to_owned()))?;
    if left == right {
        let fault = "does not separate the surface; add the other cuts that are needed";
        return Err(seam(which, fault.to_owned()));
    }
    let triangle = kept.and_then(|v| mesh.triangles().iter().position(|t| t.contains(&v)));
    let wanted = triangle.map_or(left, |t| part[t]);
    if wanted != left && wanted != right {
        return Err(seam(which, "does not touch the component of the vertex to keep".to_owned()));
    }
    let removed = if wanted == left { right } else { left };
    let keep = |t: usize| if keep_rest { part[t] != removed } else { part[t] == wanted };
    let line: Vec<u32> = if wanted == left { line.to_vec() } else { line.iter().rev().copied().collect() };
    compacted(mesh, keep, &line, source)
}

/// The connected part of each triangle, without crossing the given edges.
fn parts(mesh: &TriMesh, left: &LeftTriangles, edges: &[(u32, u32)]) -> Vec<u32> {
    let walls: BTreeSet<(u32, u32)> = edges.iter().flat_map(|&(a, b)| [(a, b), (b, a)]).collect();
    let mut joined = UnionFind::new(mesh.triangle_count());
    for (&(a, b), &t) in left.iter().filter(|(edge, _)| !walls.contains(edge)) {
        if let Some(&u) = left.get(&(b, a)) {
            joined.join(t as u32, u as u32);
        }
    }
    joined.roots()
}

/// The kept triangles with their vertices.
fn compacted(
    mesh: &TriMesh,
    keep: impl Fn(usize) -> bool,
    line: &[u32],
    source: &[Option<u32>],
) -> Result<CutSurface, MorphError> {
    let kept = (0..mesh.triangle_count()).filter(|&t| keep(t)).map(|t| mesh.triangles()[t]).collect();
    let part = TriMesh::new(mesh.positions().to_vec(), kept)?;
    let (vertices, _) = part.referenced_and_isolated();
    let cut = part.restricted(&vertices, part.triangles().iter().copied());
    HalfEdges::new(&cut)?;
    let number = |v: &u32| vertices.binary_search(v).expect("a vertex of the kept side") as u32;
    Ok(CutSurface {
        mesh: cut,
        seam: line.iter().map(number).collect(),
        source: vertices.iter().map(|&v| source[v as usize]).collect(),
    })
}

/// The shortest paths along edges from each vertex to the next and back to the first.
fn closed_path(mesh: &TriMesh, vertices: &[u32], keep: u32, which: &'static str) -> Result<Vec<u32>, MorphError> {
    let count = mesh.vertex_count();
    if let Some(&v) = vertices.iter().chain([&keep]).find(|&&v| v as usize >= count) {
        return Err(MorphError::NoSuchVertex {
            context: "seam".to_owned(),
            which,
            vertex: u64::from(v),
            vertices: count,
        });
    }
    if vertices.len() < 2 {
        return Err(seam(which, format!("has {} vertices (expected at least 2)", vertices.len())));
    }
    let neighbors = neighbors_of_vertices(count, mesh.triangles());
    let mut line: Vec<u32> = Vec::new();
    for (k, &from) in vertices.iter().enumerate() {
        let to = vertices[(k + 1) % vertices.len()];
        // Later paths do not touch earlier ones: with two vertices the path back is another one.
        let forbidden = |v: u32| line.contains(&v) || v == keep;
        // A path of one edge and the same edge back enclose nothing.
        let back = forbidden(to) && forbidden(from) && neighbors[from as usize].len() > 1;
        let path = ShortestPaths::between(count, from, to, |v| {
            let free = |&&w: &&u32| (w == to || !forbidden(w)) && !(back && v == from && w == to);
            let length = |&w: &u32| (w, (mesh.positions()[v as usize] - mesh.positions()[w as usize]).norm());
            neighbors[v as usize].iter().filter(free).map(length).collect::<Vec<_>>()
        });
        let path = path.ok_or_else(|| {
            seam(which, format!("does not close: no path from vertex {from} to vertex {to} avoids the earlier ones"))
        })?;
        line.extend(&path[..path.len() - 1]);
    }
    if line.len() < 3 || line.contains(&keep) {
        return Err(seam(which, format!("runs through vertex {keep}, which is to be kept; choose one inside")));
    }
    Ok(line)
}

/// Level function of the smoothed curve; positive on the side of `keep`.
fn shortened(mesh: &TriMesh, line: &[u32], keep: u32, which: &'static str, run: &Run) -> Result<Vec<f64>, MorphError> {
    let edges: Vec<(u32, u32)> = closed_edges(line).collect();
    let part = parts(mesh, &left_triangles(mesh.triangles()), &edges);
    let kept = mesh.triangles().iter().position(|t| t.contains(&keep)).map(|t| part[t]);
    let kept = kept.ok_or_else(|| seam(which, format!("keeps vertex {keep}, which is in no triangle")))?;
    let masses = barycentric_areas(mesh);
    let mut rhs = vec![0.0; mesh.vertex_count()];
    for (t, corners) in mesh.triangles().iter().enumerate() {
        let third = mesh.area_normal(t).norm() / 6.0;
        for v in corners {
            rhs[*v as usize] += if part[t] == kept { third } else { 0.0 };
        }
    }
    let length: f64 =
        edges.iter().map(|e| (mesh.positions()[e.0 as usize] - mesh.positions()[e.1 as usize]).norm()).sum();
    let time = (DIFFUSION_LENGTH * length / edges.len() as f64).powi(2);
    let cotangents = Cotangents::new(mesh, CotangentRule::IntrinsicDelaunay);
    let min_mass = mesh.area() * 1e-12 / mesh.vertex_count() as f64;
    let weights = EdgeWeights::cotangent(mesh.vertex_count(), &cotangents);
    let masses = masses.iter().enumerate().map(|(v, m)| (v, v, m.max(min_mass)));
    let terms = masses.chain(weights.iter().map(|(i, j, w)| (i, j, w.max(0.0) * time)));
    let laplacian = ConstrainedLaplacian::new(mesh.vertex_count(), terms, |_| false)?;
    let positions = mesh.positions().iter().map(|p| p.coords.into()).collect();
    factored_laplacian(laplacian, &Ordering::NestedDissection(positions), run)?.solve_scalar(&mut rhs);
    Ok(rhs.into_iter().map(|u| u - 0.5).collect())
}
