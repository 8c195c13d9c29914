//! Half-edge data structure of an oriented 2-manifold triangle mesh, with or without boundary.
//!
//! Half-edge `h = 3t + k` runs from corner `k` of triangle `t` to the next corner, with the triangle to its left. Next,
//! previous and face are therefore arithmetic on `h`; only the origin, the twin (opposite half-edge) and one outgoing half-edge
//! per vertex are stored.
//!
//! Invariants of the tables after [`HalfEdges::new`]:
//!
//! ```text
//! twin(twin(h)) = h                                      where h has a twin
//! origin(twin(h)) = destination(h), and conversely       the two half-edges of an edge run in opposite directions
//! origin(outgoing(v)) = v                                where a triangle references v
//! twin(outgoing(v)) = none                               exactly where v is on the boundary
//! ```
//!
//! # Reference
//! M. Botsch, L. Kobbelt, M. Pauly, P. Alliez, B. Lévy, *Polygon Mesh Processing*, 2010, chapter 2.

use super::{MeshError, TriMesh};
use plumbline_num::math::Lists;

/// Null index: no twin, or no outgoing half-edge. `u32::MAX` is no valid half-edge, and one word instead of an `Option<u32>`
/// halves the tables.
const NONE: u32 = u32::MAX;

/// Half-edge connectivity of an oriented manifold triangle mesh.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HalfEdges {
    /// Origin vertex of each half-edge.
    origins: Vec<u32>,
    /// Opposite half-edge of each half-edge; [`NONE`] on the boundary.
    twins: Vec<u32>,
    /// One outgoing half-edge per vertex: the boundary half-edge for boundary vertices; [`NONE`] for isolated vertices.
    outgoing: Vec<u32>,
    /// Number of half-edges without a twin.
    boundary_edges: usize,
}

impl HalfEdges {
    /// The half-edges of an oriented manifold mesh. Isolated vertices (referenced by no triangle) have none.
    ///
    /// # Errors
    /// [`MeshError::RepeatedCorner`], [`MeshError::NonManifoldEdge`] (also for inconsistently oriented adjacent triangles),
    /// [`MeshError::NonManifoldVertex`].
    pub fn new(mesh: &TriMesh) -> Result<Self, MeshError> {
        for (triangle, &[a, b, c]) in mesh.triangles().iter().enumerate() {
            if a == b || b == c || c == a {
                return Err(MeshError::RepeatedCorner { triangle });
            }
        }
        let origins: Vec<u32> = mesh.triangles().iter().flatten().copied().collect();
        let mut half_edges = Self {
            twins: vec![NONE; origins.len()],
            outgoing: vec![NONE; mesh.vertex_count()],
            origins,
            boundary_edges: 0,
        };
        half_edges.pair()?;
        half_edges.start()?;
        Ok(half_edges)
    }

    /// Pairs the half-edges of each edge as twins: one half-edge is a boundary edge, two in opposite directions are twins, all
    /// else is non-manifold or inconsistently oriented.
    fn pair(&mut self) -> Result<(), MeshError> {
        for edge in edge_groups(&self.origins).iter() {
            match *edge {
                [(_, _)] => self.boundary_edges += 1,
                [(_, g), (_, h)] if self.origins[g as usize] != self.origins[h as usize] => {
                    self.twins[g as usize] = h;
                    self.twins[h as usize] = g;
                }
                _ => {
                    let (from, to) = (self.origin(edge[0].1), self.destination(edge[0].1));
                    let along = edge.iter().filter(|&&(_, h)| self.origin(h) == from).count();
                    return Err(MeshError::NonManifoldEdge { from, to, triangles: edge.len(), along });
                }
            }
        }
        Ok(())
    }

    /// Chooses the outgoing half-edge of each vertex, preferring one on the boundary, and checks that rotating about the vertex
    /// from it reaches all incident triangles, so that they form a single fan.
    fn start(&mut self) -> Result<(), MeshError> {
        let mut degree = vec![0_u32; self.outgoing.len()];
        for h in 0..self.origins.len() as u32 {
            let v = self.origin(h) as usize;
            degree[v] += 1;
            if self.outgoing[v] == NONE || self.twin(h).is_none() {
                self.outgoing[v] = h;
            }
        }
        for (vertex, &degree) in degree.iter().enumerate() {
            let vertex = vertex as u32;
            let reached = self.around(vertex).count();
            if reached < degree as usize {
                return Err(MeshError::NonManifoldVertex { vertex, fans: self.fans(vertex) });
            }
        }
        Ok(())
    }

    /// Number of fans (maximal edge-connected sets of incident triangles) at a vertex. Linear in the mesh: for error messages.
    fn fans(&self, vertex: u32) -> usize {
        let mut left: Vec<u32> = (0..self.origins.len() as u32).filter(|&h| self.origin(h) == vertex).collect();
        let mut fans = 0;
        while let Some(&first) = left.iter().find(|&&h| self.twin(h).is_none()).or(left.first()) {
            let fan: Vec<u32> = self.rotate(first).collect();
            left.retain(|h| !fan.contains(h));
            fans += 1;
        }
        fans
    }

    /// Number of half-edges.
    pub fn len(&self) -> usize {
        self.origins.len()
    }

    /// Whether the mesh has no triangles.
    pub fn is_empty(&self) -> bool {
        self.origins.is_empty()
    }

    /// Number of edges.
    pub fn edge_count(&self) -> usize {
        usize::midpoint(self.origins.len(), self.boundary_edges)
    }

    /// Number of boundary edges: edges with a single incident triangle.
    pub fn boundary_edge_count(&self) -> usize {
        self.boundary_edges
    }

    /// One half-edge of each edge, in ascending order.
    pub fn edges(&self) -> impl Iterator<Item = u32> {
        (0..self.origins.len() as u32).filter(|&h| self.twin(h).is_none_or(|twin| h < twin))
    }

    /// Origin vertex of a half-edge.
    #[inline]
    pub fn origin(&self, h: u32) -> u32 {
        self.origins[h as usize]
    }

    /// Destination vertex of a half-edge.
    #[inline]
    pub fn destination(&self, h: u32) -> u32 {
        self.origins[Self::next(h) as usize]
    }

    /// The half-edge after this one in its triangle.
    #[inline]
    pub fn next(h: u32) -> u32 {
        if h % 3 == 2 { h - 2 } else { h + 1 }
    }

    /// The half-edge before this one in its triangle.
    #[inline]
    pub fn previous(h: u32) -> u32 {
        if h.is_multiple_of(3) { h + 2 } else { h - 1 }
    }

    /// The triangle to the left of a half-edge.
    #[inline]
    pub fn triangle(h: u32) -> u32 {
        h / 3
    }

    /// The opposite half-edge; `None` on the boundary.
    #[inline]
    pub fn twin(&self, h: u32) -> Option<u32> {
        Some(self.twins[h as usize]).filter(|&twin| twin != NONE)
    }

    /// An outgoing half-edge of a vertex, the boundary half-edge where the vertex has one; `None` for an isolated vertex.
    #[inline]
    pub fn outgoing(&self, vertex: u32) -> Option<u32> {
        Some(self.outgoing[vertex as usize]).filter(|&h| h != NONE)
    }

    /// Whether the vertex is on the boundary.
    pub fn is_boundary(&self, vertex: u32) -> bool {
        self.outgoing(vertex).is_some_and(|h| self.twin(h).is_none())
    }

    /// Outgoing half-edges of a vertex, counterclockwise, starting at the boundary half-edge where the vertex has one.
    pub fn around(&self, vertex: u32) -> impl Iterator<Item = u32> {
        self.outgoing(vertex).into_iter().flat_map(|first| self.rotate(first))
    }

    /// Outgoing half-edges in counterclockwise order from `first`, until the boundary or `first` again.
    fn rotate(&self, first: u32) -> impl Iterator<Item = u32> {
        let step = move |&h: &u32| self.twin(Self::previous(h)).filter(|&next| next != first);
        std::iter::successors(Some(first), step)
    }

    /// One-ring neighbors of a vertex, counterclockwise.
    pub fn neighbors(&self, vertex: u32) -> impl Iterator<Item = u32> {
        let last = self.around(vertex).last().map(Self::previous).filter(|&h| self.twin(h).is_none());
        self.around(vertex).map(|h| self.destination(h)).chain(last.map(|h| self.origin(h)))
    }

    /// Boundary loops as closed sequences of vertices, each with the surface to its left.
    pub fn boundary_loops(&self) -> Vec<Vec<u32>> {
        let mut seen = vec![false; self.outgoing.len()];
        let mut loops = Vec::new();
        for start in 0..self.outgoing.len() as u32 {
            let (mut vertex, mut line) = (start, Vec::new());
            while self.is_boundary(vertex) && !std::mem::replace(&mut seen[vertex as usize], true) {
                line.push(vertex);
                vertex = self.destination(self.outgoing[vertex as usize]);
            }
            if !line.is_empty() {
                loops.push(line);
            }
        }
        loops
    }
}

/// Half-edges sorted by their undirected edge: `(low << 32 | high, half-edge)` with `low < high` the end vertices, in lists by `low`.
pub(crate) struct EdgeGroups(Lists<(u64, u32)>);

/// Groups the half-edges of triangles, given by their origins, by undirected edge: a counting sort by the lower end vertex, then
/// a comparison sort within each vertex, which is short since few edges have the same one. The mesh may be non-manifold.
pub(crate) fn edge_groups(origins: &[u32]) -> EdgeGroups {
    let half_edges = (0..origins.len() as u32).map(|h| {
        let (p, q) = (origins[h as usize], origins[HalfEdges::next(h) as usize]);
        let (low, high) = (p.min(q), p.max(q));
        (low, (u64::from(low) << 32 | u64::from(high), h))
    });
    let mut sorted = Lists::new(origins.iter().max().map_or(0, |&v| v as usize + 1), half_edges);
    (0..sorted.len()).for_each(|v| sorted.of_mut(v).sort_unstable());
    EdgeGroups(sorted)
}

impl EdgeGroups {
    /// One slice per edge: the key of the edge with each of its half-edges, in ascending order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &[(u64, u32)]> {
        self.0.iter().flat_map(|edges| edges.chunk_by(|a, b| a.0 == b.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::{book, cylinder, disjoint, hourglass, icosphere, moebius, one_triangle, plane, tube};

    #[test]
    fn going_around_a_vertex_meets_each_neighbor_once() {
        for mesh in [icosphere(2), plane(4), tube(7, 3, 1.0, 1.0), cylinder(9, 2, 1.0, 1.0), one_triangle()] {
            let half_edges = HalfEdges::new(&mesh).expect("valid");
            let mut expected = vec![std::collections::BTreeSet::new(); mesh.vertex_count()];
            for &[a, b, c] in mesh.triangles() {
                for (p, q) in [(a, b), (b, c), (c, a)] {
                    expected[p as usize].insert(q);
                    expected[q as usize].insert(p);
                }
            }
            for (vertex, expected) in expected.iter().enumerate() {
                let neighbors: Vec<u32> = half_edges.neighbors(vertex as u32).collect();
                assert_eq!(neighbors.len(), expected.len(), "vertex {vertex}");
                assert!(neighbors.iter().all(|n| expected.contains(n)));
                // Counterclockwise: each neighbor and the next form a triangle with the vertex in this order.
                for pair in neighbors.windows(2) {
                    let triangle = [vertex as u32, pair[0], pair[1]];
                    assert!(
                        mesh.triangles()
                            .iter()
                            .any(|t| (0..3).any(|k| [t[k], t[(k + 1) % 3], t[(k + 2) % 3]] == triangle))
                    );
                }
            }
            let sum = mesh.vertex_count() + mesh.triangle_count();
            assert_eq!(half_edges.edges().count(), half_edges.edge_count());
            assert_eq!(sum + half_edges.boundary_loops().len(), 2 + half_edges.edge_count(), "a sphere with holes");
        }
    }

    #[test]
    fn boundary_loops_run_with_the_surface_to_their_left() {
        let mesh = plane(3);
        let loops = HalfEdges::new(&mesh).expect("valid").boundary_loops();
        let corner = |&v: &u32| mesh.positions()[v as usize];
        let winding = |line: &[u32]| {
            (0..line.len())
                .map(|k| corner(&line[k]).xy().coords.perp(&corner(&line[(k + 1) % line.len()]).xy().coords))
                .sum::<f64>()
        };
        assert_eq!((loops.len(), loops[0].len()), (1, 12));
        assert!((winding(&loops[0]) - 2.0).abs() < 1e-12, "once around the unit square, counterclockwise");
    }

    #[test]
    fn what_is_no_oriented_manifold_is_refused_with_its_place() {
        let refused = |mesh: TriMesh| HalfEdges::new(&mesh).expect_err("to be refused");
        assert_eq!(refused(book(3)), MeshError::NonManifoldEdge { from: 0, to: 1, triangles: 3, along: 3 });
        assert_eq!(refused(hourglass()), MeshError::NonManifoldVertex { vertex: 0, fans: 2 });
        assert!(matches!(refused(moebius(8, 1)), MeshError::NonManifoldEdge { triangles: 2, along: 2, .. }));
        let repeated = TriMesh::new(plane(1).positions().to_vec(), vec![[0, 1, 1]]).expect("valid");
        assert_eq!(refused(repeated), MeshError::RepeatedCorner { triangle: 0 });
        assert!(HalfEdges::new(&disjoint(&[plane(2), icosphere(0)])).is_ok());
    }
}
