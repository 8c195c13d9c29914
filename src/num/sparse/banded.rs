//! Symmetric positive definite matrices that are banded but for a few dense last rows.
//!
//! ```text
//!     ⎡ A  Bᵀ⎤   A: n×n, zero more than `bandwidth` below its diagonal
//! M = ⎣ B  C ⎦   B: b×n and C: b×b dense, b small
//! ```
//!
//! Columns of `A` are stored one after another, each from its diagonal downwards, with a fixed pitch. Seen with a column stride one
//! less than that pitch, any block within the band is an ordinary strided matrix, so blocked elimination runs on dense
//! kernels; elimination leaves the band and the border as they are.
//!
//! # Reference
//! G. H. Golub, C. F. Van Loan, *Matrix Computations*, 4th ed. 2013, §4.3.5 (band Cholesky), §4.2.9 (blocking).

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltError, LltRegularization, cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{BlockStructure, matmul as triangular_matmul};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::prelude::{Reborrow, ReborrowMut};
use faer::{Accum, MatMut, MatRef, Par};

use super::SparseError;
use super::wide_registers::clear_upper_halves;

/// Columns eliminated at once: wide enough for the dense kernels, narrow against the bands of some hundred met here.
const BLOCK: usize = 48;

/// A banded and bordered symmetric matrix, or after [`Self::factor`] its factor `L`.
#[derive(Clone, Debug)]
pub struct BandedMatrix {
    n: usize,
    bandwidth: usize,
    /// Distance of two diagonal entries in `band`.
    pitch: usize,
    band: Vec<f64>,
    border: usize,
    /// `B`, column by column.
    rows: Vec<f64>,
    /// `C`, column by column, lower triangle.
    corner: Vec<f64>,
}

impl BandedMatrix {
    /// The zero matrix of `n` banded unknowns and `border` dense last ones.
    pub fn zeros(n: usize, bandwidth: usize, border: usize) -> Self {
        let bandwidth = bandwidth.min(n.saturating_sub(1));
        // The upper triangles of diagonal blocks fall on the padding.
        let pitch = bandwidth + 1 + BLOCK;
        Self {
            n,
            bandwidth,
            pitch,
            band: vec![0.0; n * pitch],
            border,
            rows: vec![0.0; n * border],
            corner: vec![0.0; border * border],
        }
    }

    /// Number of unknowns, those of the border included.
    pub fn n(&self) -> usize {
        self.n + self.border
    }

    /// Sets every entry to zero.
    pub fn clear(&mut self) {
        self.band.fill(0.0);
        self.rows.fill(0.0);
        self.corner.fill(0.0);
    }

    /// Takes the entries of another matrix of the same shape.
    pub fn copy_from(&mut self, other: &Self) {
        self.band.copy_from_slice(&other.band);
        self.rows.copy_from_slice(&other.rows);
        self.corner.copy_from_slice(&other.corner);
    }

    /// Adds another matrix of the same shape.
    pub fn add(&mut self, other: &Self) {
        let sum = |into: &mut [f64], from: &[f64]| into.iter_mut().zip(from).for_each(|(a, b)| *a += b);
        sum(&mut self.band, &other.band);
        sum(&mut self.rows, &other.rows);
        sum(&mut self.corner, &other.corner);
    }

    /// Column `j` of `A` from its diagonal downwards: `bandwidth + 1` entries, those past the last row unused.
    pub fn column_mut(&mut self, j: usize) -> &mut [f64] {
        &mut self.band[j * self.pitch..][..=self.bandwidth]
    }

    /// Column `j` of `B`.
    pub fn border_mut(&mut self, j: usize) -> &mut [f64] {
        &mut self.rows[j * self.border..][..self.border]
    }

    /// Entry `(i, j)` of the corner `C`, `i ≥ j`.
    pub fn corner_mut(&mut self, i: usize, j: usize) -> &mut f64 {
        &mut self.corner[i + j * self.border]
    }

    /// Diagonal entry `k`, the corner's after the band's.
    pub fn diagonal(&self, k: usize) -> f64 {
        if k < self.n { self.band[k * self.pitch] } else { self.corner[(k - self.n) * (self.border + 1)] }
    }

    /// The same, writable.
    pub fn diagonal_mut(&mut self, k: usize) -> &mut f64 {
        if k < self.n { &mut self.band[k * self.pitch] } else { &mut self.corner[(k - self.n) * (self.border + 1)] }
    }

    /// Makes unknown `k` one that nothing moves: its row and column become those of the identity.
    pub fn isolate(&mut self, k: usize) {
        if k < self.n {
            (k.saturating_sub(self.bandwidth)..k).for_each(|j| self.column_mut(j)[k - j] = 0.0);
            self.column_mut(k).fill(0.0);
            self.border_mut(k).fill(0.0);
        } else {
            let row = k - self.n;
            self.rows.iter_mut().skip(row).step_by(self.border).for_each(|entry| *entry = 0.0);
            for other in 0..self.border {
                let (i, j) = (other.max(k - self.n), other.min(k - self.n));
                *self.corner_mut(i, j) = 0.0;
            }
        }
        *self.diagonal_mut(k) = 1.0;
    }

    /// `M ← M − V Vᵀ` for a `V` whose rows are zero but for `first..first + v.nrows` of the band and those of the border.
    ///
    /// `v` holds the `rank` columns of the band's part, `rows` entries each; `v_border` those of the border's part.
    pub fn subtract_outer(&mut self, first: usize, (rows, rank): (usize, usize), v: &[f64], v_border: &[f64]) {
        assert!(rows <= self.bandwidth + 1 && first + rows <= self.n, "rows {first}+{rows} leave the band");
        let v = MatRef::from_column_major_slice(&v[..rows * rank], rows, rank);
        if rows > 0 {
            let block = strided(&mut self.band[first * self.pitch..], rows, rows, self.pitch - 1);
            subtract_lower(block, v);
        }
        if self.border > 0 {
            let v_border = MatRef::from_column_major_slice(&v_border[..self.border * rank], self.border, rank);
            let rows_of = &mut self.rows[first * self.border..(first + rows) * self.border];
            let block = MatMut::from_column_major_slice_mut(rows_of, self.border, rows);
            matmul(block, Accum::Add, v_border, v.transpose(), -1.0, Par::Seq);
            let corner = MatMut::from_column_major_slice_mut(&mut self.corner, self.border, self.border);
            subtract_lower(corner, v_border);
        }
        clear_upper_halves();
    }

    /// Replaces the matrix by its factor `L`, `M = L Lᵀ`.
    ///
    /// # Errors
    /// [`SparseError::Pivot`] where the matrix is not positive definite or not finite; the entries are then of no use.
    pub fn factor(&mut self) -> Result<(), SparseError> {
        let result = self.factor_blocks();
        clear_upper_halves();
        result
    }

    fn factor_blocks(&mut self) -> Result<(), SparseError> {
        let scratch = cholesky_in_place_scratch::<f64>(BLOCK.max(self.border), Par::Seq, faer::Spec::default());
        let mut memory = MemBuffer::new(scratch);
        let mut diagonal = vec![0.0; BLOCK * BLOCK];
        for start in (0..self.n).step_by(BLOCK) {
            self.eliminate(start, &mut diagonal, MemStack::new(&mut memory))?;
        }
        if self.border > 0 {
            let corner = MatMut::from_column_major_slice_mut(&mut self.corner, self.border, self.border);
            cholesky(corner, MemStack::new(&mut memory)).map_err(|k| SparseError::Pivot { unknown: self.n + k })?;
        }
        Ok(())
    }

    /// Eliminates the block of columns from `start`: its own factor, the panel below, then what the panel takes from the rest.
    fn eliminate(&mut self, start: usize, diagonal: &mut [f64], stack: &mut MemStack) -> Result<(), SparseError> {
        let width = BLOCK.min(self.n - start);
        let below = (self.bandwidth + width).min(self.n - start) - width;
        let stride = self.pitch - 1;
        let (head, rest) = self.band[start * self.pitch..].split_at_mut(width * self.pitch);
        cholesky(strided(head, width, width, stride), stack).map_err(|k| SparseError::Pivot { unknown: start + k })?;
        for j in 0..width {
            for i in j..width {
                diagonal[i + j * BLOCK] = head[i + j * stride];
            }
        }
        let l = MatRef::from_column_major_slice_with_stride(diagonal, width, width, BLOCK);
        let border = &mut self.rows[start * self.border..];
        let (own_border, rest_border) = border.split_at_mut(width * self.border);
        let mut b = MatMut::from_column_major_slice_mut(own_border, self.border, width);
        solve_lower_triangular_in_place(l, b.rb_mut().transpose_mut(), Par::Seq);
        if below > 0 {
            // Where a column's band ends above the panel's last row, the panel reads the padding: zeros, which stay zero.
            let mut panel = strided(&mut head[width..], below, width, stride);
            solve_lower_triangular_in_place(l, panel.rb_mut().transpose_mut(), Par::Seq);
            subtract_lower(strided(rest, below, below, stride), panel.rb());
            let next = &mut rest_border[..below * self.border];
            let next = MatMut::from_column_major_slice_mut(next, self.border, below);
            matmul(next, Accum::Add, b.rb(), panel.rb().transpose(), -1.0, Par::Seq);
        }
        let corner = MatMut::from_column_major_slice_mut(&mut self.corner, self.border, self.border);
        subtract_lower(corner, b.rb());
        Ok(())
    }

    /// Replaces `b` by `M⁻¹ b`; `self` must hold the factor.
    pub fn solve_in_place(&self, b: &mut [f64]) {
        assert!(b.len() == self.n(), "{} values for {} unknowns", b.len(), self.n());
        let (x, y) = b.split_at_mut(self.n);
        for j in 0..self.n {
            let (below, column) = self.column_of_factor(j);
            x[j] /= column[0];
            let xj = x[j];
            x[j + 1..=j + below].iter_mut().zip(&column[1..]).for_each(|(x, l)| *x -= l * xj);
            y.iter_mut().zip(&self.rows[j * self.border..]).for_each(|(y, l)| *y -= l * xj);
        }
        self.solve_corner(y);
        for j in (0..self.n).rev() {
            let (below, column) = self.column_of_factor(j);
            let inner: f64 = x[j + 1..=j + below].iter().zip(&column[1..]).map(|(x, l)| x * l).sum();
            let outer: f64 = y.iter().zip(&self.rows[j * self.border..]).map(|(y, l)| y * l).sum();
            x[j] = (x[j] - inner - outer) / column[0];
        }
    }

    fn solve_corner(&self, y: &mut [f64]) {
        let l = |i: usize, j: usize| self.corner[i + j * self.border];
        for i in 0..self.border {
            let known: f64 = (0..i).map(|j| l(i, j) * y[j]).sum();
            y[i] = (y[i] - known) / l(i, i);
        }
        for i in (0..self.border).rev() {
            let known: f64 = (i + 1..self.border).map(|j| l(j, i) * y[j]).sum();
            y[i] = (y[i] - known) / l(i, i);
        }
    }

    /// Number of entries below the diagonal in column `j`, and the column from its diagonal on.
    fn column_of_factor(&self, j: usize) -> (usize, &[f64]) {
        let below = self.bandwidth.min(self.n - 1 - j);
        (below, &self.band[j * self.pitch..][..=below])
    }
}

/// A block of the band: `rows` and `columns` from the entry on which `entries` starts.
fn strided(entries: &mut [f64], rows: usize, columns: usize, stride: usize) -> MatMut<'_, f64> {
    MatMut::from_column_major_slice_with_stride_mut(entries, rows, columns, stride)
}

/// `A ← A − V Vᵀ`, lower triangle.
fn subtract_lower(a: MatMut<'_, f64>, v: MatRef<'_, f64>) {
    let (lower, full) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
    triangular_matmul(a, lower, Accum::Add, v, full, v.transpose(), full, -1.0, Par::Seq);
}

/// Factors a dense block; the index of the first bad pivot on failure. NaN counts as bad.
fn cholesky(a: MatMut<'_, f64>, stack: &mut MemStack) -> Result<(), usize> {
    let mut a = a;
    match cholesky_in_place(a.rb_mut(), LltRegularization::default(), Par::Seq, stack, faer::Spec::default()) {
        Err(LltError::NonPositivePivot { index }) => Err(index),
        Ok(_) => match (0..a.nrows()).find(|&k| !(a[(k, k)] > 0.0 && a[(k, k)].is_finite())) {
            Some(k) => Err(k),
            None => Ok(()),
        },
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;

    /// A random banded and bordered positive definite matrix, in both forms.
    fn sample(n: usize, bandwidth: usize, border: usize, seed: u64) -> (BandedMatrix, DMatrix<f64>) {
        let mut rng = fastrand::Rng::with_seed(seed);
        let mut banded = BandedMatrix::zeros(n, bandwidth, border);
        let mut dense = DMatrix::zeros(n + border, n + border);
        let mut set = |i: usize, j: usize, v: f64| (dense[(i, j)], dense[(j, i)]) = (v, v);
        for j in 0..n {
            for i in j..=(j + bandwidth).min(n - 1) {
                let v = if i == j { 2.0 * bandwidth as f64 + 8.0 } else { rng.f64() - 0.5 };
                banded.column_mut(j)[i - j] = v;
                set(i, j, v);
            }
            for k in 0..border {
                banded.border_mut(j)[k] = 0.1 * (rng.f64() - 0.5);
                set(n + k, j, banded.border_mut(j)[k]);
            }
        }
        for k in 0..border {
            *banded.diagonal_mut(n + k) = 9.0 + k as f64;
            set(n + k, n + k, 9.0 + k as f64);
        }
        (banded, dense)
    }

    /// Sizes that end on a block and off it, within one block, with full and empty bands, with and without border.
    const SHAPES: [(usize, usize, usize); 6] =
        [(200, 70, 3), (144, 47, 0), (10, 4, 2), (130, 129, 1), (97, 0, 3), (301, 13, 0)];

    #[test]
    fn the_solution_of_a_banded_and_bordered_system_is_that_of_the_dense_one() {
        for (seed, (n, bandwidth, border)) in SHAPES.into_iter().enumerate() {
            let (mut banded, dense) = sample(n, bandwidth, border, seed as u64);
            let mut rng = fastrand::Rng::with_seed(7);
            let b = DVector::from_fn(n + border, |_, _| rng.f64() - 0.5);
            let expected = dense.lu().solve(&b).expect("regular");
            let mut x: Vec<f64> = b.iter().copied().collect();
            banded.factor().expect("positive definite");
            banded.solve_in_place(&mut x);
            let miss = (DVector::from_vec(x) - &expected).norm() / expected.norm();
            assert!(miss < 1e-12, "n {n}, bandwidth {bandwidth}, border {border}: {miss}");
        }
    }

    #[test]
    fn subtracting_an_outer_product_touches_its_block_and_the_border_only() {
        let (mut banded, mut dense) = sample(200, 70, 3, 3);
        let (first, rows, rank) = (61, 66, 5);
        let mut rng = fastrand::Rng::with_seed(5);
        let v: Vec<f64> = (0..rows * rank).map(|_| 0.1 * rng.f64()).collect();
        let w: Vec<f64> = (0..3 * rank).map(|_| 0.1 * rng.f64()).collect();
        let mut full = DMatrix::zeros(203, rank);
        for q in 0..rank {
            (0..rows).for_each(|i| full[(first + i, q)] = v[q * rows + i]);
            (0..3).for_each(|i| full[(200 + i, q)] = w[q * 3 + i]);
        }
        dense -= &full * full.transpose();
        banded.subtract_outer(first, (rows, rank), &v, &w);
        for j in 0..200 {
            (j..=(j + 70).min(199)).for_each(|i| assert!((banded.column_mut(j)[i - j] - dense[(i, j)]).abs() < 1e-13));
            (0..3).for_each(|k| assert!((banded.border_mut(j)[k] - dense[(200 + k, j)]).abs() < 1e-13));
        }
        (0..3).for_each(|j| {
            (j..3).for_each(|i| assert!((*banded.corner_mut(i, j) - dense[(200 + i, 200 + j)]).abs() < 1e-13));
        });
    }

    #[test]
    fn a_sum_of_matrices_solves_as_the_sum_of_the_dense_ones() {
        let ((mut banded, dense), (other, other_dense)) = (sample(130, 40, 2, 1), sample(130, 40, 2, 2));
        banded.add(&other);
        let b = DVector::from_element(132, 1.0);
        let expected = (dense + other_dense).lu().solve(&b).expect("regular");
        let mut x: Vec<f64> = b.iter().copied().collect();
        banded.factor().expect("positive definite");
        banded.solve_in_place(&mut x);
        assert!((DVector::from_vec(x) - expected).amax() < 1e-12);
    }

    #[test]
    fn an_isolated_unknown_stays_where_it_is() {
        for k in [0, 5, 130, 199, 201] {
            let (mut banded, mut dense) = sample(200, 70, 3, 11);
            banded.isolate(k);
            dense.row_mut(k).fill(0.0);
            dense.column_mut(k).fill(0.0);
            dense[(k, k)] = 1.0;
            let b = DVector::from_fn(203, |i, _| if i == k { 0.0 } else { 1.0 });
            let expected = dense.lu().solve(&b).expect("regular");
            let mut x: Vec<f64> = b.iter().copied().collect();
            banded.factor().expect("positive definite");
            banded.solve_in_place(&mut x);
            assert_eq!(x[k], 0.0);
            assert!((DVector::from_vec(x) - expected).amax() < 1e-12);
        }
    }

    #[test]
    fn a_matrix_without_positive_pivots_is_refused_with_the_pivot() {
        let (mut banded, _) = sample(200, 70, 3, 1);
        *banded.diagonal_mut(90) = -1.0;
        let error = banded.factor().expect_err("indefinite");
        assert_eq!(
            error.to_string(),
            "elimination met no positive pivot at unknown 90; damp the system or fix the unknown"
        );
        let (mut banded, _) = sample(200, 70, 3, 1);
        *banded.diagonal_mut(202) = f64::NAN;
        assert_eq!(banded.factor(), Err(SparseError::Pivot { unknown: 202 }));
    }
}
