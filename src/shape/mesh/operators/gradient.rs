//! Gradient and divergence of piecewise linear functions.

use nalgebra::Vector3;

use super::cotangents::unit_normal;
use crate::mesh::TriMesh;

/// Gradients of the hat functions (linear shape functions) of each triangle, and the triangle areas.
#[derive(Clone, Debug)]
pub struct Gradient {
    triangles: Vec<[u32; 3]>,
    hats: Vec<[Vector3<f64>; 3]>,
    areas: Vec<f64>,
    vertices: usize,
}

impl Gradient {
    /// `∇φₖ = n × eₖ / 2A`, with `eₖ` the edge opposite corner `k`, counterclockwise; zero in degenerate triangles.
    pub fn new(mesh: &TriMesh) -> Self {
        let of_triangle = |t: usize| {
            let corners = mesh.corners(t);
            let normal = mesh.area_normal(t);
            let (unit, doubled) = (unit_normal(&corners, &normal), normal.norm());
            let hat = |k: usize| {
                let edge = corners[(k + 2) % 3] - corners[(k + 1) % 3];
                if unit == Vector3::zeros() { unit } else { unit.cross(&edge) / doubled }
            };
            ([hat(0), hat(1), hat(2)], 0.5 * doubled)
        };
        let (hats, areas) = (0..mesh.triangle_count()).map(of_triangle).unzip();
        Self { triangles: mesh.triangles().to_vec(), hats, areas, vertices: mesh.vertex_count() }
    }

    /// Gradients of the three hat functions of a triangle, in its plane, summing to zero; 1/length.
    pub fn hats(&self, triangle: usize) -> &[Vector3<f64>; 3] {
        &self.hats[triangle]
    }

    /// Areas of the triangles.
    pub fn areas(&self) -> &[f64] {
        &self.areas
    }

    /// Gradient `∇u` in each triangle of a function `u` given at the vertices.
    pub fn apply(&self, u: &[f64]) -> Vec<Vector3<f64>> {
        let of_triangle = |(v, hats): (&[u32; 3], &[Vector3<f64>; 3])| {
            // Differences of values: the gradient of a constant is exactly zero.
            let [a, b, c] = v.map(|v| u[v as usize]);
            hats[1] * (b - a) + hats[2] * (c - a)
        };
        self.triangles.iter().zip(&self.hats).map(of_triangle).collect()
    }

    /// `(div X)ᵢ = −Σ_{t∋i} A_t ∇φᵢ · X_t`: integrated over the dual cell of the vertex, so that `−div ∇ = L`.
    pub fn divergence(&self, field: &[Vector3<f64>]) -> Vec<f64> {
        let mut divergence = vec![0.0; self.vertices];
        for (t, v) in self.triangles.iter().enumerate() {
            for k in 0..3 {
                divergence[v[k] as usize] -= self.areas[t] * self.hats[t][k].dot(&field[t]);
            }
        }
        divergence
    }
}
