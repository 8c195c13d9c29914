//! Edge weights and the Laplace matrix assembled from them.

use std::sync::Arc;

use super::Cotangents;
use crate::mesh::TriMesh;
use plumbline_num::math::Lists;
use plumbline_num::sparse::{Pattern, SparseError, SparseMatrix};

/// Symmetric edge weights `w_ij`, each edge `i < j` once, in lexicographic order.
#[derive(Clone, Debug, PartialEq)]
pub struct EdgeWeights {
    vertices: usize,
    edges: Vec<[u32; 2]>,
    weights: Vec<f64>,
}

impl EdgeWeights {
    /// Cotangent weights `w_ij = ½ Σ cot` of the angles opposite `ij`, over the triangles incident to the edge: two in the
    /// interior of a manifold surface, one at its boundary. Dimensionless.
    pub fn cotangent(vertices: usize, cotangents: &Cotangents) -> Self {
        Self::summed(vertices, cotangents.edges().flatten())
    }

    /// Uniform weights (graph Laplacian): `w_ij = 1` for every edge.
    pub fn uniform(mesh: &TriMesh) -> Self {
        let edges = mesh.triangles().iter().flat_map(|&[a, b, c]| [(a, b, 1.0), (b, c, 1.0), (c, a, 1.0)]);
        let mut weights = Self::summed(mesh.vertex_count(), edges);
        weights.weights.fill(1.0);
        weights
    }

    /// Sums the given contributions per edge; contributions of a vertex with itself are ignored.
    fn summed(vertices: usize, parts: impl Iterator<Item = (u32, u32, f64)>) -> Self {
        // Counting sort by the lower vertex, then a sort within each row: rows are short, and one sort of all contributions
        // would cost five times as much.
        let parts: Vec<(u32, u32, f64)> =
            parts.filter(|(i, j, _)| i != j).map(|(i, j, w)| (i.min(j), i.max(j), w)).collect();
        let mut rows = Lists::new(vertices, parts.iter().map(|&(i, j, w)| (i, (j, w))));
        let (mut edges, mut weights) = (Vec::with_capacity(parts.len() / 2), Vec::with_capacity(parts.len() / 2));
        for i in 0..vertices {
            let row = rows.of_mut(i);
            // Stable sort: the order of summation, and so the rounding, is deterministic.
            row.sort_by_key(|&(j, _)| j);
            for of_edge in row.chunk_by(|a, b| a.0 == b.0) {
                edges.push([i as u32, of_edge[0].0]);
                weights.push(of_edge.iter().map(|&(_, w)| w).sum());
            }
        }
        Self { vertices, edges, weights }
    }

    /// `L W L` with `W = diag(weights)`: the bilaplacian if the weights are inverse masses. Its rows sum to zero too, so that
    /// it is again a matrix of edge weights, of both signs, between vertices up to two edges apart.
    ///
    /// # Panics
    /// If the number of weights differs from the number of vertices.
    #[must_use]
    pub fn squared(&self, weights: &[f64]) -> Self {
        assert_eq!(weights.len(), self.vertices, "one weight per vertex");
        let mut rows: Vec<Vec<(u32, f64)>> = (0..self.vertices as u32).map(|v| vec![(v, 0.0)]).collect();
        for (i, j, w) in self.iter() {
            rows[i][0].1 += w;
            rows[j][0].1 += w;
            rows[i].push((j as u32, -w));
            rows[j].push((i as u32, -w));
        }
        // (L W L)_ij = Σₖ wₖ L_ki L_kj
        let products = rows.iter().zip(weights).flat_map(|(row, &w)| {
            let pair = move |(n, a): (usize, &(u32, f64))| {
                let (i, a) = (a.0, a.1 * w);
                row[n + 1..].iter().map(move |&(j, b)| (i, j, -a * b))
            };
            row.iter().enumerate().flat_map(pair)
        });
        Self::summed(self.vertices, products)
    }

    /// Number of vertices, including isolated ones.
    pub fn vertex_count(&self) -> usize {
        self.vertices
    }

    /// Edges `[i, j]`, `i < j`, ascending.
    pub fn edges(&self) -> &[[u32; 2]] {
        &self.edges
    }

    /// Weight of every edge.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Iterates over `(i, j, w_ij)`, `i < j`.
    pub fn iter(&self) -> impl Iterator<Item = (usize, usize, f64)> + Clone + '_ {
        self.edges.iter().zip(&self.weights).map(|(&[i, j], &w)| (i as usize, j as usize, w))
    }

    /// Number of negative weights: energies that sum over cells, such as ARAP, may then be negative.
    pub fn negative(&self) -> usize {
        self.weights.iter().filter(|&&w| w < 0.0).count()
    }

    /// Laplace matrix `(L u)ᵢ = Σⱼ w_ij (uᵢ − uⱼ)`, integrated: symmetric, with rows that sum to zero; positive semidefinite
    /// for cotangent weights of triangles of any shape and for weights ≥ 0.
    ///
    /// # Errors
    /// [`SparseError::TooLarge`].
    pub fn laplacian(&self) -> Result<SparseMatrix, SparseError> {
        let pattern = Pattern::new(self.vertices, self.edges.iter().map(|&[i, j]| (i as usize, j as usize)))?;
        let starts = pattern.column_starts().to_vec();
        // The slots below the diagonal are in the order of the edges.
        let mut matrix = SparseMatrix::zeros(Arc::new(pattern));
        let values = matrix.values_mut();
        let mut next: Vec<u32> = starts[..self.vertices].iter().map(|s| s + 1).collect();
        for (i, j, w) in self.iter() {
            values[next[i] as usize] = -w;
            next[i] += 1;
            values[starts[i] as usize] += w;
            values[starts[j] as usize] += w;
        }
        Ok(matrix)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::super::CotangentRule;
    use super::*;

    #[test]
    fn a_weight_is_half_the_cotangents_of_both_opposite_angles() {
        // Two right isosceles triangles on one hypotenuse: 90° opposite it, 45° opposite the legs.
        let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let mesh = TriMesh::new(positions.map(Point3::from).to_vec(), vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        let weights = EdgeWeights::cotangent(4, &Cotangents::new(&mesh, CotangentRule::Raw));
        assert_eq!(weights.edges(), [[0, 1], [0, 2], [0, 3], [1, 2], [2, 3]]);
        for (i, j, w) in weights.iter() {
            assert!((w - if (i, j) == (0, 2) { 0.0 } else { 0.5 }).abs() < 1e-15);
        }
        let laplacian = weights.laplacian().unwrap();
        for (i, j, s) in laplacian.pattern().clone().entries() {
            let expected = if i == j {
                1.0
            } else if (j, i) == (0, 2) {
                0.0
            } else {
                -0.5
            };
            assert!((laplacian.values()[s] - expected).abs() < 1e-15, "({i}, {j})");
        }
    }

    #[test]
    fn edges_of_a_vertex_with_itself_are_none() {
        let mesh = TriMesh::new(vec![Point3::origin(); 3], vec![[0, 0, 1], [2, 2, 2]]).unwrap();
        assert_eq!(EdgeWeights::uniform(&mesh).edges(), [[0, 1]]);
        assert_eq!(EdgeWeights::cotangent(3, &Cotangents::new(&mesh, CotangentRule::Raw)).edges(), [[0, 1]]);
    }
}
