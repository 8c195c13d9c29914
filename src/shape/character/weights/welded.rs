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
    /// Component of each welded vertex; isolated vertices come last.
    piece: Vec<u32>,
    pieces: usize,
}

impl Welded {
    pub(super) fn new(mesh: &TriMesh) -> Self {
        let mut seen: HashMap<[u64; 3], u32> = HashMap::with_capacity(mesh.vertex_count());
        let mut positions = Vec::with_capacity(mesh.vertex_count());
        let place = |p: &Point3<f64>| {
            // Adding 0 turns −0 into 0, which it equals.
            *seen.entry([p.x + 0.0, p.y + 0.0, p.z + 0.0].map(f64::to_bits)).or_insert_with(|| {
                positions.push(*p);
                positions.len() as u32 - 1
            })
        };
        let vertex_of: Vec<u32> = mesh.positions().iter().map(place).collect();
        let corners = |t: &[u32; 3]| t.map(|v| vertex_of[v as usize]);
        let triangles: Vec<[u32; 3]> = mesh.triangles().iter().map(corners).collect();
        let (piece, pieces) = pieces(positions.len(), &triangles);
        let mesh = TriMesh::new(positions, triangles).expect("of a mesh that was valid");
        Self { mesh, vertex_of, piece, pieces }
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

    /// Component of a welded vertex.
    pub(super) fn piece_of(&self, vertex: usize) -> u32 {
        self.piece[vertex]
    }

    /// Number of components with triangles.
    pub(super) fn piece_count(&self) -> usize {
        self.pieces
    }
}

/// Component of each vertex, numbered by lowest vertex, isolated vertices last; number of components with triangles.
fn pieces(vertices: usize, triangles: &[[u32; 3]]) -> (Vec<u32>, usize) {
    let root = components(vertices, triangles);
    let mut used = vec![false; vertices];
    triangles.iter().flatten().for_each(|v| used[*v as usize] = true);
    let mut piece = vec![u32::MAX; vertices];
    let mut next = 0;
    let mut with_triangles = 0;
    for lone in [false, true] {
        for v in 0..vertices {
            let r = root[v] as usize;
            if used[r] == lone {
                continue;
            }
            if piece[r] == u32::MAX {
                piece[r] = next;
                next += 1;
            }
            piece[v] = piece[r];
        }
        if !lone {
            with_triangles = next as usize;
        }
    }
    (piece, with_triangles)
}
