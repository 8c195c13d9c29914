//! The surface in the bind pose: positions, tangent frames, and derivatives of the weights along them.
//!
//! ```text
//! ∂w_ij/∂s = Σ_{t∋i} A_t ∇w_j|_t · s / Σ_{t∋i} A_t
//! ```
//!
//! Slopes are stored for the influences of a vertex only and corrected to sum to zero, as the derivatives of a partition of unity must;
//! otherwise normals would depend on the position of the surface. Duplicates of a vertex (texture seams) share their triangles.

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};

use super::super::{CharacterError, SkinWeights};
use crate::mesh::TriMesh;
use crate::mesh::operators::Gradient;

/// Positions, tangents, and slopes of weights.
#[derive(Clone, Debug)]
pub(super) struct RestSurface {
    positions: Vec<Point3<f64>>,
    /// Two unit tangents whose cross product is the normal.
    tangents: Vec<[Vector3<f64>; 2]>,
    /// Derivatives of each influence's weight along both tangents, in row order.
    slopes: Vec<[f64; 2]>,
    starts: Vec<u32>,
}

impl RestSurface {
    pub(super) fn new(
        mesh: &TriMesh,
        normals: Option<&[Vector3<f64>]>,
        weights: &SkinWeights,
    ) -> Result<Self, CharacterError> {
        let vertices = mesh.vertex_count();
        CharacterError::check_per_vertex("rows of weights", weights.vertex_count(), vertices)?;
        CharacterError::check_per_vertex("normals", normals.map_or(vertices, <[_]>::len), vertices)?;
        let tangents = match normals {
            Some(normals) => normals.iter().map(tangents).collect(),
            None => mesh.vertex_normals().iter().map(tangents).collect::<Vec<_>>(),
        };
        let mut starts = vec![0];
        starts.extend(weights.rows().scan(0, |sum, r| {
            *sum += r.len() as u32;
            Some(*sum)
        }));
        let mut rest = Self { positions: mesh.positions().to_vec(), tangents, slopes: Vec::new(), starts };
        rest.slopes = rest.slopes_of_weights(mesh, weights);
        Ok(rest)
    }

    #[inline]
    pub(super) fn position(&self, vertex: usize) -> Point3<f64> {
        self.positions[vertex]
    }

    #[inline]
    pub(super) fn tangents(&self, vertex: usize) -> [Vector3<f64>; 2] {
        self.tangents[vertex]
    }

    pub(super) fn normal(&self, vertex: usize) -> Vector3<f64> {
        let [s, t] = self.tangents[vertex];
        s.cross(&t)
    }

    /// Slopes of the weights of a vertex, in the order of its influences.
    #[inline]
    pub(super) fn slopes(&self, vertex: usize) -> &[[f64; 2]] {
        &self.slopes[self.starts[vertex] as usize..self.starts[vertex + 1] as usize]
    }

    /// Derivatives of a point field along the tangents, from triangles whose corners are all `known`.
    pub(super) fn slopes_of_points(
        &self,
        mesh: &TriMesh,
        field: &[Point3<f64>],
        known: impl Fn(usize) -> bool,
    ) -> Vec<[Vector3<f64>; 2]> {
        let gradient = Gradient::new(mesh);
        let mut sums = vec![([Vector3::zeros(); 2], 0.0); field.len()];
        for (t, corners) in mesh.triangles().iter().enumerate() {
            if !corners.iter().all(|&c| known(c as usize)) {
                continue;
            }
            let (phi, area) = (gradient.hats(t), gradient.areas()[t]);
            for &v in corners {
                let (sum, total) = &mut sums[v as usize];
                for (along, tangent) in sum.iter_mut().zip(self.tangents[v as usize]) {
                    let slope = |k: usize| field[corners[k] as usize].coords * phi[k].dot(&tangent);
                    *along += area * (0..3).map(slope).sum::<Vector3<f64>>();
                }
                *total += area;
            }
        }
        sums.into_iter().map(|(sum, total)| if total > 0.0 { sum.map(|s| s / total) } else { sum }).collect()
    }

    fn slopes_of_weights(&self, mesh: &TriMesh, weights: &SkinWeights) -> Vec<[f64; 2]> {
        let gradient = Gradient::new(mesh);
        let first = copies(mesh, weights);
        let mut slopes = vec![[0.0; 2]; *self.starts.last().unwrap_or(&0) as usize];
        let mut totals = vec![0.0; mesh.vertex_count()];
        for (t, corners) in mesh.triangles().iter().enumerate() {
            let (phi, area) = (gradient.hats(t), gradient.areas()[t]);
            for &corner in corners {
                let v = first[corner as usize] as usize;
                totals[v] += area;
                let start = self.starts[v] as usize;
                for (slope, influence) in slopes[start..].iter_mut().zip(weights.row(v)) {
                    let term = |k: usize| phi[k] * weights.weight(corners[k] as usize, influence.joint);
                    let g: Vector3<f64> = (0..3).map(term).sum();
                    for (along, tangent) in slope.iter_mut().zip(&self.tangents[v]) {
                        *along += area * g.dot(tangent);
                    }
                }
            }
        }
        self.balance(weights, &first, &totals, &mut slopes);
        slopes
    }

    /// Divides by the areas, removes the mean so that slopes sum to zero, and copies them to duplicates.
    fn balance(&self, weights: &SkinWeights, first: &[u32], totals: &[f64], slopes: &mut [[f64; 2]]) {
        for v in 0..first.len() {
            let (start, row) = (self.starts[v] as usize, weights.row(v));
            let origin = first[v] as usize;
            if origin != v {
                // Duplicates may have other tangents if their normals differ at a crease.
                let from = self.starts[origin] as usize;
                for k in 0..row.len() {
                    let [a, b] = slopes[from + k];
                    let g = self.tangents[origin][0] * a + self.tangents[origin][1] * b;
                    slopes[start + k] = self.tangents[v].map(|t| t.dot(&g));
                }
                continue;
            }
            let one = &mut slopes[start..start + row.len()];
            for k in 0..2 {
                let scale = if totals[v] > 0.0 { 1.0 / totals[v] } else { 0.0 };
                let excess: f64 = one.iter().map(|s| s[k] * scale).sum();
                for (s, i) in one.iter_mut().zip(row) {
                    s[k] = s[k] * scale - i.weight * excess;
                }
            }
        }
    }
}

/// Two unit vectors whose cross product is the normal.
fn tangents(normal: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let n = normal.try_normalize(0.0).unwrap_or_else(Vector3::z);
    let s = n.cross(&Vector3::ith(n.iamin(), 1.0)).normalize();
    [s, n.cross(&s)]
}

/// The first vertex with the same position and weights.
fn copies(mesh: &TriMesh, weights: &SkinWeights) -> Vec<u32> {
    let mut seen: HashMap<[u64; 3], u32> = HashMap::with_capacity(mesh.vertex_count());
    let first = |(v, p): (usize, &Point3<f64>)| {
        let known = *seen.entry([p.x, p.y, p.z].map(f64::to_bits)).or_insert(v as u32);
        if weights.row(known as usize) == weights.row(v) { known } else { v as u32 }
    };
    mesh.positions().iter().enumerate().map(first).collect()
}
