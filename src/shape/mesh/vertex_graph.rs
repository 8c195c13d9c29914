//! Vertices and the edges between them: rings and connected components of a set of vertices.

use super::TriMesh;
use plumbline_num::math::Lists;

/// The vertices of a mesh and their neighbors along edges.
///
/// ```
/// use plumbline_shape::mesh::{VertexGraph, shapes};
///
/// let ball = shapes::icosphere(2);
/// let graph = VertexGraph::new(&ball);
/// let ring = graph.grown(&[0], 1);
/// assert_eq!(ring.len(), 1 + 5, "a corner of the icosahedron has five neighbors");
/// assert_eq!(graph.shrunk(&ring, 1), [0]);
/// assert_eq!(graph.connected(&[0]).len(), ball.vertex_count());
/// ```
#[derive(Clone, Debug)]
pub struct VertexGraph {
    neighbors: Lists<u32>,
}

impl VertexGraph {
    /// The graph of a mesh.
    pub fn new(mesh: &TriMesh) -> Self {
        let ends = |&[a, b, c]: &[u32; 3]| [(a, b), (b, a), (b, c), (c, b), (c, a), (a, c)];
        Self { neighbors: Lists::new(mesh.vertex_count(), mesh.triangles().iter().flat_map(ends)) }
    }

    /// The vertices of a set with those at most so many edges away, ascending.
    ///
    /// # Panics
    /// If a vertex does not exist; so do the other calls.
    pub fn grown(&self, vertices: &[u32], rings: usize) -> Vec<u32> {
        let mut inside = self.mask(vertices);
        let mut rim: Vec<u32> = vertices.to_vec();
        for _ in 0..rings {
            rim = self.spread(&rim, &mut inside);
        }
        ascending(&inside)
    }

    /// The vertices of a set that are more than so many edges away from all others, ascending.
    pub fn shrunk(&self, vertices: &[u32], rings: usize) -> Vec<u32> {
        let mut outside = self.mask(vertices);
        for inside in &mut outside {
            *inside = !*inside;
        }
        let mut rim = ascending(&outside);
        for _ in 0..rings {
            rim = self.spread(&rim, &mut outside);
        }
        for outside in &mut outside {
            *outside = !*outside;
        }
        ascending(&outside)
    }

    /// All vertices that are connected to one of the set, ascending.
    pub fn connected(&self, vertices: &[u32]) -> Vec<u32> {
        let mut inside = self.mask(vertices);
        let mut rim = vertices.to_vec();
        while !rim.is_empty() {
            rim = self.spread(&rim, &mut inside);
        }
        ascending(&inside)
    }

    fn mask(&self, vertices: &[u32]) -> Vec<bool> {
        let mut mask = vec![false; self.neighbors.len()];
        for v in vertices {
            mask[*v as usize] = true;
        }
        mask
    }

    /// Adds the neighbors of `rim` to the set; returns the new ones.
    fn spread(&self, rim: &[u32], inside: &mut [bool]) -> Vec<u32> {
        let mut added = Vec::new();
        for &w in rim.iter().flat_map(|v| self.neighbors.of(*v as usize)) {
            if !std::mem::replace(&mut inside[w as usize], true) {
                added.push(w);
            }
        }
        added
    }
}

fn ascending(mask: &[bool]) -> Vec<u32> {
    (0..mask.len()).filter(|v| mask[*v]).map(|v| v as u32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn growing_and_shrinking_count_edges_from_the_rim() {
        let bar = shapes::bar([1, 1, 9], [1.0, 1.0, 9.0]);
        let graph = VertexGraph::new(&bar);
        let below = |z: f64| -> Vec<u32> {
            (0..bar.vertex_count() as u32).filter(|v| bar.positions()[*v as usize].z < z).collect()
        };
        assert_eq!(graph.grown(&below(2.5), 3), below(5.5));
        assert_eq!(graph.shrunk(&below(5.5), 3), below(2.5));
        assert_eq!(graph.grown(&[7], 0), [7]);
        assert!(graph.shrunk(&below(0.5), 1).is_empty());
    }

    #[test]
    fn a_component_ends_where_no_edge_leads_on() {
        let mut ball = shapes::icosphere(0);
        let other = ball.positions().iter().map(|p| p + nalgebra::Vector3::x() * 9.0);
        let positions: Vec<_> = ball.positions().iter().copied().chain(other).collect();
        let twice = ball.triangles().iter().copied().chain(ball.triangles().iter().map(|t| t.map(|v| v + 12)));
        ball = TriMesh::new(positions, twice.collect()).unwrap();
        let graph = VertexGraph::new(&ball);
        assert_eq!(graph.connected(&[15]), (12..24).collect::<Vec<u32>>());
        assert_eq!(graph.connected(&[3, 15]).len(), 24);
        assert!(graph.connected(&[]).is_empty());
    }
}
