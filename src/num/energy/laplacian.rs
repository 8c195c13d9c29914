//! The Laplacian of a weighted graph under constraints: smooth fields, and the global step of deformation methods.
//!
//! ```text
//! E(x) = Σ_ij w_ij |xᵢ − xⱼ|² + Σᵢ μᵢ |xᵢ − tᵢ|² − 2 b · x      s.t.  x_f = c_f  for the fixed vertices f
//! (L_uu + diag μ) x_u = b_u + μ t + Σ_f w_uf c_f                 u the free vertices: the unknowns
//! ```
//!
//! Hard constraints are eliminated, soft ones add their weight `μ` to the diagonal. All coordinates of `x` share one factor; it
//! depends on weights and on which vertices are constrained, never on where they are. The graph may be a mesh with cotangent or
//! uniform weights, a curve, or the pairs of a squared Laplacian, whose weights have both signs.
//!
//! # Reference
//! M. Botsch, L. Kobbelt, M. Pauly, P. Alliez, B. Lévy, *Polygon Mesh Processing*, 2010, sections 3.3 and 9.

use std::sync::Arc;

use crate::run::Run;
use crate::sparse::{CompactFactor, Ordering, Pattern, SparseError, SparseMatrix};

/// In the list of unknowns: the vertex is fixed and has none.
pub const FIXED: u32 = u32::MAX;

/// Which vertices are unknowns, and what joins them to fixed ones.
#[derive(Clone, Debug)]
struct Unknowns {
    /// Vertex of each unknown, ascending.
    free: Vec<u32>,
    /// Unknown of each vertex, or [`FIXED`].
    of_vertex: Vec<u32>,
    /// `(unknown, fixed vertex, w)`, in the order of the terms.
    coupling: Vec<(u32, u32, f64)>,
}

/// `L_uu + diag μ`, assembled and not yet factored.
///
/// ```
/// use plumbline_num::energy::ConstrainedLaplacian;
/// use plumbline_num::run::Run;
/// use plumbline_num::sparse::Ordering;
///
/// // A path 0 – 1 – 2 – 3 – 4 with both ends fixed: its harmonic function is linear.
/// let edges = (0..4).map(|i| (i, i + 1, 1.0));
/// let laplacian = ConstrainedLaplacian::new(5, edges, |v| v == 0 || v == 4)?;
/// let mut solver = laplacian.factor(&Ordering::Amd, &Run::default())?;
/// let x = solver.interpolate(|v| [v as f64]);
/// assert!(x.iter().enumerate().all(|(v, x)| (x[0] - v as f64).abs() < 1e-12));
/// # Ok::<(), plumbline_num::sparse::SparseError>(())
/// ```
#[derive(Clone, Debug)]
pub struct ConstrainedLaplacian {
    unknowns: Unknowns,
    matrix: SparseMatrix,
}

impl ConstrainedLaplacian {
    /// Sums the terms: `(i, j, w)` is `w |xᵢ − xⱼ|²`, `(i, i, μ)` the soft constraint `μ |xᵢ − tᵢ|²` of a vertex. Terms of one edge
    /// add up; edges in ascending order are assembled fastest. Terms of fixed vertices alone are left out.
    ///
    /// # Errors
    /// [`SparseError::OutOfRange`] for a vertex ≥ `vertices`, [`SparseError::TooLarge`].
    pub fn new(
        vertices: usize,
        terms: impl Iterator<Item = (usize, usize, f64)> + Clone,
        fixed: impl Fn(usize) -> bool,
    ) -> Result<Self, SparseError> {
        if let Some(index) = terms.clone().map(|(i, j, _)| i.max(j)).find(|&v| v >= vertices) {
            return Err(SparseError::OutOfRange { index, unknowns: vertices });
        }
        let free: Vec<u32> = (0..vertices as u32).filter(|&v| !fixed(v as usize)).collect();
        let mut of_vertex = vec![FIXED; vertices];
        free.iter().zip(0..).for_each(|(&v, k)| of_vertex[v as usize] = k);
        let inner = terms.clone().map(|(i, j, _)| (of_vertex[i], of_vertex[j])).filter(|&(a, b)| a.max(b) != FIXED);
        let pattern = Arc::new(Pattern::new(free.len(), inner.map(|(a, b)| (a as usize, b as usize)))?);
        let mut matrix = SparseMatrix::zeros(Arc::clone(&pattern));
        let coupling = fill(&mut matrix, terms, &of_vertex);
        Ok(Self { unknowns: Unknowns { free, of_vertex, coupling }, matrix })
    }

    /// The matrix of the unknowns, for factorizations whose values change.
    pub fn matrix(&self) -> &SparseMatrix {
        &self.matrix
    }

    /// `(unknown, fixed vertex, w)` of each edge between the two, in the order of the terms.
    pub fn coupling(&self) -> &[(u32, u32, f64)] {
        &self.unknowns.coupling
    }

    /// Factors the matrix; `ordering` is that of all vertices.
    ///
    /// # Errors
    /// [`SparseError::Singular`] names the vertices of a component without a constraint,
    /// [`SparseError::NotPositiveDefinite`], [`SparseError::NotFinite`]; [`SparseError::OutOfRange`] for an ordering of another
    /// size, [`SparseError::Interrupted`].
    pub fn factor(self, ordering: &Ordering, run: &Run) -> Result<FactoredLaplacian, SparseError> {
        self.factor_within(ordering, f64::INFINITY, run)
    }

    /// [`Self::factor`] where the factorization takes at most `most` multiplications.
    ///
    /// # Errors
    /// Those of [`Self::factor`]; [`SparseError::TooDense`] names the vertex of the most neighbors before the factor is allocated.
    pub fn factor_within(self, ordering: &Ordering, most: f64, run: &Run) -> Result<FactoredLaplacian, SparseError> {
        let Self { unknowns, matrix } = self;
        let ordering = ordering.restricted(&unknowns.free, unknowns.of_vertex.len())?;
        let factor = CompactFactor::of_within(&matrix, &ordering, most, run)
            .map_err(|error| error.renumbered(&unknowns.free))?;
        Ok(FactoredLaplacian { unknowns, factor: Factor::Double(factor) })
    }
}

/// Adds the terms to the matrix over its unknowns; returns those that meet a fixed vertex.
fn fill(
    matrix: &mut SparseMatrix,
    terms: impl Iterator<Item = (usize, usize, f64)>,
    of_vertex: &[u32],
) -> Vec<(u32, u32, f64)> {
    let pattern = Arc::clone(matrix.pattern());
    let (starts, rows) = (pattern.column_starts(), pattern.rows());
    let values = matrix.values_mut();
    // Edges in ascending order meet the slots of each column one after the other: the next one is tried before it is searched.
    let mut next: Vec<u32> = starts[..pattern.n()].iter().map(|s| s + 1).collect();
    let mut coupling = Vec::new();
    for (i, j, w) in terms {
        let (a, b) = (of_vertex[i], of_vertex[j]);
        if i == j {
            if a != FIXED {
                values[starts[a as usize] as usize] += w;
            }
            continue;
        }
        for (own, other, vertex) in [(a, b, j), (b, a, i)] {
            if own != FIXED {
                values[starts[own as usize] as usize] += w;
                if other == FIXED {
                    coupling.push((own, vertex as u32, w));
                }
            }
        }
        if a.max(b) != FIXED {
            let (row, column) = (a.max(b), a.min(b) as usize);
            let slot = next[column];
            if slot < starts[column + 1] && rows[slot as usize] == row {
                next[column] += 1;
                values[slot as usize] -= w;
            } else {
                let slot = pattern.slot(row as usize, column).expect("the pattern was made of these terms");
                values[slot] -= w;
            }
        }
    }
    coupling
}

#[derive(Clone, Debug)]
enum Factor {
    Double(CompactFactor),
    Single(CompactFactor<f32>),
}

/// The factored system: two triangular substitutions per solve, whatever the constrained values.
#[derive(Clone, Debug)]
pub struct FactoredLaplacian {
    unknowns: Unknowns,
    factor: Factor,
}

impl FactoredLaplacian {
    /// Vertex of each unknown, ascending.
    pub fn free(&self) -> &[u32] {
        &self.unknowns.free
    }

    /// Unknown of each vertex, or [`FIXED`].
    pub fn unknowns(&self) -> &[u32] {
        &self.unknowns.of_vertex
    }

    /// As [`ConstrainedLaplacian::coupling`].
    pub fn coupling(&self) -> &[(u32, u32, f64)] {
        &self.unknowns.coupling
    }

    /// Keeps the factor in single precision where its entries allow it: half of its memory, for solves that are a preconditioner
    /// ([`CompactFactor::rounded`]).
    pub fn round(&mut self) {
        if let Factor::Double(factor) = &self.factor
            && let Some(rounded) = factor.rounded()
        {
            self.factor = Factor::Single(rounded);
        }
    }

    /// Replaces `b`, `D` ≤ 4 values for each unknown, by `(L_uu + diag μ)⁻¹ b`.
    ///
    /// # Panics
    /// Unless `b` has one entry per unknown.
    pub fn solve<const D: usize>(&mut self, b: &mut [[f64; D]]) {
        match &mut self.factor {
            Factor::Double(factor) => factor.solve_points(b),
            Factor::Single(factor) => factor.solve_points(b),
        }
    }

    /// The same for one value per unknown.
    ///
    /// # Panics
    /// As [`Self::solve`].
    pub fn solve_scalar(&mut self, b: &mut [f64]) {
        match &mut self.factor {
            Factor::Double(factor) => factor.solve(b),
            Factor::Single(factor) => factor.solve(b),
        }
    }

    /// The minimizer for `b = 0` and no soft constraint: `D` ≤ 4 values for each vertex, `value(v)` for the fixed ones. Harmonic
    /// for cotangent weights; between the least and the greatest fixed value for weights above 0.
    pub fn interpolate<const D: usize>(&mut self, value: impl Fn(usize) -> [f64; D]) -> Vec<[f64; D]> {
        let mut b = vec![[0.0; D]; self.free().len()];
        for &(unknown, vertex, w) in self.coupling() {
            let c = value(vertex as usize);
            b[unknown as usize].iter_mut().zip(c).for_each(|(b, c)| *b += w * c);
        }
        self.solve(&mut b);
        let of = |(v, &k): (usize, &u32)| if k == FIXED { value(v) } else { b[k as usize] };
        self.unknowns().iter().enumerate().map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_of_the_terms_does_not_matter() {
        let terms = [(0, 1, 1.0), (1, 2, 0.5), (1, 3, 2.0), (2, 3, 0.25), (2, 2, 3.0), (0, 3, 1.0)];
        let backwards: Vec<_> = terms.iter().rev().map(|&(i, j, w)| (j, i, w)).collect();
        let fixed = |v: usize| v == 0;
        let a = ConstrainedLaplacian::new(4, terms.into_iter(), fixed).expect("in range");
        let b = ConstrainedLaplacian::new(4, backwards.into_iter(), fixed).expect("in range");
        assert_eq!(a.matrix().values(), b.matrix().values());
        assert_eq!(a.matrix().values(), [3.5, -0.5, -2.0, 3.75, -0.25, 3.25]);
        assert_eq!(a.coupling(), [(0, 0, 1.0), (2, 0, 1.0)]);
    }

    #[test]
    fn a_component_without_a_constraint_is_named_by_its_vertices() {
        let laplacian = ConstrainedLaplacian::new(5, [(0, 1, 1.0), (2, 4, 1.0)].into_iter(), |v| v == 0 || v == 3);
        let error =
            laplacian.expect("in range").factor(&Ordering::Natural, &Run::default()).expect_err("2 and 4 are free");
        assert!(matches!(error, SparseError::Singular { component } if component.unknowns == [2, 4]));
        let beyond = ConstrainedLaplacian::new(2, [(0, 2, 1.0)].into_iter(), |_| false).expect_err("two vertices");
        assert_eq!(beyond, SparseError::OutOfRange { index: 2, unknowns: 2 });
    }

    #[test]
    fn a_graph_too_dense_is_refused_with_the_vertex_of_the_most_neighbors() {
        // A wheel around vertex 3, whose neighbors are joined to vertex 5 as well; vertex 0 is fixed.
        let spokes = [1, 2, 4, 6, 7].into_iter().flat_map(|v| [(3, v, 1.0), (5, v, 1.0)]);
        let terms = spokes.chain([(0, 1, 1.0), (3, 5, 1.0), (3, 8, 1.0)]);
        let laplacian = ConstrainedLaplacian::new(9, terms, |v| v == 0).expect("in range");
        let run = Run::default();
        let flops =
            crate::sparse::FactorStructure::new(laplacian.matrix().pattern(), &Ordering::Amd).expect("valid").flops();
        assert!(laplacian.clone().factor_within(&Ordering::Amd, flops, &run).is_ok());
        let refused = laplacian.factor_within(&Ordering::Amd, flops - 1.0, &run).expect_err("one too many");
        assert_eq!(refused, SparseError::TooDense { flops, most: flops - 1.0, unknown: 3, neighbors: 7 });
    }

    #[test]
    fn a_graph_without_a_free_vertex_has_the_given_values() {
        for ordering in [Ordering::Amd, Ordering::NestedDissection(vec![[0.0; 3]; 2])] {
            let laplacian = ConstrainedLaplacian::new(2, [(0, 1, 1.0)].into_iter(), |_| true).expect("in range");
            let mut solver = laplacian.factor(&ordering, &Run::default()).expect("nothing to factor");
            assert_eq!(solver.interpolate(|v| [v as f64, 1.0]), [[0.0, 1.0], [1.0, 1.0]]);
        }
    }
}
