//! Edge weights and the Laplace matrix assembled from them.

use std::sync::Arc;

use super::{Cotangents, Forming};
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
    /// # Errors
    /// [`SparseError::TooDense`] where so many edges meet at vertices that the product, or its factor, would take gigabytes: it is counted
    /// before it is formed.
    ///
    /// # Panics
    /// If the number of weights differs from the number of vertices.
    pub fn squared(&self, weights: &[f64]) -> Result<Self, SparseError> {
        assert_eq!(weights.len(), self.vertices, "one weight per vertex");
        let rows = Rows::new(self);
        let entries = rows.count_squared()?;
        let (mut edges, mut products) = (Vec::with_capacity(entries), Vec::with_capacity(entries));
        let mut sums = vec![0.0; self.vertices];
        rows.for_each_squared(|i, others| {
            rows.add_products(i, weights, &mut sums);
            edges.extend(others.iter().map(|&j| [i as u32, j]));
            products.extend(others.iter().map(|&j| std::mem::take(&mut sums[j as usize])));
            Ok(())
        })?;
        Ok(Self { vertices: self.vertices, edges, weights: products })
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

/// The Laplace matrix by rows: the diagonal, and the entries beside it, ascending.
struct Rows {
    diagonal: Vec<f64>,
    beside: Lists<(u32, f64)>,
}

impl Rows {
    fn new(weights: &EdgeWeights) -> Self {
        let mut diagonal = vec![0.0; weights.vertices];
        for (i, j, w) in weights.iter() {
            diagonal[i] += w;
            diagonal[j] += w;
        }
        // In the order of the edges each row receives the vertices before it, then those after it.
        let both = weights.iter().flat_map(|(i, j, w)| [(i as u32, (j as u32, -w)), (j as u32, (i as u32, -w))]);
        Self { diagonal, beside: Lists::new(weights.vertices, both) }
    }

    /// The entries of row `k` with itself among them, from vertex `from` on, ascending.
    fn row(&self, k: u32, from: u32) -> impl Iterator<Item = (u32, f64)> + '_ {
        let row = self.beside.of(k as usize);
        let (start, own) = (row.partition_point(|e| e.0 < from), row.partition_point(|e| e.0 < k));
        let (before, after) = (&row[start.min(own)..own], &row[start.max(own)..]);
        let itself = (k >= from).then_some((k, self.diagonal[k as usize]));
        before.iter().copied().chain(itself).chain(after.iter().copied())
    }

    /// For each vertex `i` those after it that share a neighbor with it or are one, ascending.
    fn for_each_squared(
        &self,
        mut visit: impl FnMut(usize, &[u32]) -> Result<(), SparseError>,
    ) -> Result<(), SparseError> {
        let mut seen = vec![u32::MAX; self.diagonal.len()];
        let mut others = Vec::new();
        for i in 0..self.diagonal.len() as u32 {
            others.clear();
            for (k, _) in self.row(i, 0) {
                let new = |j: &u32| std::mem::replace(&mut seen[*j as usize], i) != i;
                others.extend(self.row(k, i + 1).map(|(j, _)| j).filter(new));
            }
            others.sort_unstable();
            visit(i as usize, &others)?;
        }
        Ok(())
    }

    /// Entries of the squared matrix above its diagonal; refused where they are out of proportion.
    fn count_squared(&self) -> Result<usize, SparseError> {
        let neighbors = |v: &usize| self.beside.of(*v).len();
        let n = self.diagonal.len();
        let Some(vertex) = (0..n).rev().max_by_key(neighbors) else { return Ok(0) };
        let forming = Forming { unknowns: n, per_vertex: 1, vertex, neighbors: neighbors(&vertex) };
        forming.check_clique()?;
        let mut entries = 0;
        self.for_each_squared(|_, others| {
            entries += others.len();
            forming.check_entries(entries)
        })?;
        Ok(entries)
    }

    /// Adds `−Σₖ L_ik w_k L_kj` to the sum of each `j` after `i`.
    fn add_products(&self, i: usize, weights: &[f64], sums: &mut [f64]) {
        let i = i as u32;
        for (k, a) in self.row(i, 0) {
            let w = weights[k as usize];
            for (j, b) in self.row(k, i + 1) {
                // The diagonal entry is weighted first: the product of a pair is the same from either end.
                sums[j as usize] -= if j == k { b * w * a } else { a * w * b };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector, Point3};

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

    /// A star of `n` edges around vertex 0, its ends joined in a ring.
    fn wheel(n: u32) -> EdgeWeights {
        EdgeWeights::summed(
            n as usize + 1,
            (1..=n).flat_map(|k| [(0, k, 0.5), (k, k % n + 1, -0.25 * f64::from(k % 3))]),
        )
    }

    #[test]
    fn the_square_is_the_product_of_the_matrices() {
        let mut random = fastrand::Rng::with_seed(3);
        let edges = (0..300).map(|_| (random.u32(0..60), random.u32(0..60), random.f64() - 0.3));
        for weights in [EdgeWeights::summed(61, edges), wheel(40), wheel(3)] {
            let n = weights.vertex_count();
            let masses: Vec<f64> = (0..n).map(|_| random.f64() + 0.1).collect();
            let full = |weights: &EdgeWeights| {
                let mut full = DMatrix::<f64>::zeros(n, n);
                for (i, j, w) in weights.iter() {
                    full[(i, i)] += w;
                    full[(j, j)] += w;
                    full[(i, j)] -= w;
                    full[(j, i)] -= w;
                }
                full
            };
            let squared = weights.squared(&masses).expect("a small graph");
            let expected = full(&weights) * DMatrix::from_diagonal(&DVector::from_vec(masses)) * full(&weights);
            assert!((full(&squared) - &expected).amax() < 1e-12 * expected.amax());
            assert!(squared.edges().is_sorted() && squared.edges().iter().all(|[i, j]| i < j));
        }
    }

    #[test]
    fn the_square_of_a_hub_is_refused_before_it_is_formed() {
        let squared = |weights: &EdgeWeights| weights.squared(&vec![1.0; weights.vertex_count()]);
        assert_eq!(squared(&wheel(1500)).expect("a hub that can be solved").edges().len(), 1501 * 1500 / 2);
        let refused = squared(&wheel(20_000)).expect_err("two hundred million entries");
        assert!(matches!(refused, SparseError::TooDense { unknown: 0, neighbors: 20_000, .. }), "{refused}");
        // Many hubs of which none is too dense alone.
        let hubs = (0..40_u32).flat_map(|hub| (40..2040).map(move |v| (hub, v + 2000 * (hub / 4), 1.0)));
        let refused = squared(&EdgeWeights::summed(25_000, hubs)).expect_err("twenty million entries");
        assert!(matches!(refused, SparseError::TooDense { unknown: 0, neighbors: 2000, .. }), "{refused}");
    }

    #[test]
    fn the_square_of_a_lattice_in_space_is_not_refused() {
        let side = 25_u32;
        let at = |x, y, z| (x * side + y) * side + z;
        let cells = (0..side - 1).flat_map(|x| (0..side - 1).flat_map(move |y| (0..side - 1).map(move |z| [x, y, z])));
        // Each cell has all edges between its corners: 26 neighbors.
        let edges = cells.flat_map(|[x, y, z]| {
            let corner = move |c: u32| at(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2));
            (0..8).flat_map(move |a| (0..a).map(move |b| (corner(a), corner(b), 1.0)))
        });
        let lattice = EdgeWeights::summed(side.pow(3) as usize, edges);
        let squared = lattice.squared(&vec![1.0; lattice.vertex_count()]).expect("62 entries in a row");
        assert!(squared.edges().len() > 40 * lattice.vertex_count());
    }
}
