//! The surface with duplicate vertices welded, and its connected components.

use std::collections::HashMap;

use nalgebra::Point3;

use crate::mesh::TriMesh;
use plumbline_num::spatial::components;

/// The welded surface.
#[derive(Debug)]
pub(super) struct Welded {
    mesh: TriMesh,
    /// Welded vertex of each vertex.
    vertex_of: Vec<u32>,
    /// Component of each welded vertex: its lowest vertex.
    piece: Vec<u32>,
    /// Whether each welded vertex is in no triangle.
    isolated: Vec<bool>,
}

impl Welded {
    pub(super) fn new(mesh: &TriMesh) -> Self {
        let mut seen: HashMap<[u64; 3], u32> = HashMap::with_capacity(mesh.vertex_count());
        let mut positions = Vec::with_capacity(mesh.vertex_count());
        let position = |p: &Point3<f64>| {
            // Adding 0 turns −0 into 0, which it equals.
            *seen.entry([p.x + 0.0, p.y + 0.0, p.z + 0.0].map(f64::to_bits)).or_insert_with(|| {
                positions.push(*p);
                positions.len() as u32 - 1
            })
        };
        let vertex_of: Vec<u32> = mesh.positions().iter().map(position).collect();
        let corners = |t: &[u32; 3]| t.map(|v| vertex_of[v as usize]);
        let triangles: Vec<[u32; 3]> = mesh.triangles().iter().map(corners).collect();
        let piece = components(positions.len(), &triangles);
        let mut isolated = vec![true; positions.len()];
        triangles.iter().flatten().for_each(|v| isolated[*v as usize] = false);
        let mesh = TriMesh::new(positions, triangles).expect("of a mesh that was valid");
        Self { mesh, vertex_of, piece, isolated }
    }

    pub(super) fn mesh(&self) -> &TriMesh {
        &self.mesh
    }

    pub(super) fn positions(&self) -> &[Point3<f64>] {
        self.mesh.positions()
    }

    /// Welded vertex of each vertex.
    pub(super) fn vertex_of(&self) -> &[u32] {
        &self.vertex_of
    }

    /// Component of a welded vertex, named by its lowest vertex.
    pub(super) fn piece_of(&self, vertex: usize) -> u32 {
        self.piece[vertex]
    }

    /// Whether a welded vertex is in no triangle.
    pub(super) fn is_isolated(&self, vertex: usize) -> bool {
        self.isolated[vertex]
    }

    /// Number of components with triangles.
    pub(super) fn piece_count(&self) -> usize {
        let lowest = |v: &usize| self.piece[*v] as usize == *v && !self.isolated[*v];
        (0..self.piece.len()).filter(lowest).count()
    }
}
