//! Inner products of many dense columns at once.

use std::ops::Range;

use faer::linalg::matmul::triangular::{BlockStructure, matmul};
use faer::{Accum, MatMut, MatRef, Par};

/// `S[rows, cols] ← S[rows, cols] − Aᵀ B`: `to` is the square matrix `S` of `m` columns, `a` and `b` are columns of `n` values. Of a block on
/// the diagonal the lower triangle is computed.
pub(crate) fn subtract_inner_products(
    (to, m): (&mut [f64], usize),
    (rows, a): (Range<usize>, &[f64]),
    (cols, b): (Range<usize>, &[f64]),
    n: usize,
) {
    let a = MatRef::from_column_major_slice(a, n, rows.len());
    let b = MatRef::from_column_major_slice(b, n, cols.len());
    let full = BlockStructure::Rectangular;
    let shape = if rows == cols { BlockStructure::TriangularLower } else { full };
    let to = MatMut::from_column_major_slice_mut(to, m, m);
    let to = to.submatrix_mut(rows.start, cols.start, rows.len(), cols.len());
    matmul(to, shape, Accum::Add, a.transpose(), full, b, full, -1.0, Par::Seq);
}
