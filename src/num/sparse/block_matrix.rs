//! Symmetric matrices of dense blocks, one per pair of bodies, vertices or cameras with several unknowns each.
//!
//! Both triangles are stored, by rows of blocks: a product reads the matrix once in order, and a row is at hand for
//! relaxation.

use std::sync::Arc;

use nalgebra::{Const, SMatrix};

use super::{Component, Pattern, SparseError, SparseMatrix, SymmetricOperator};
use crate::math::Lists;

/// A symmetric matrix of `B × B` blocks; unknown `B i + k` is the `k`-th of block row `i`.
///
/// ```
/// use nalgebra::Matrix2;
/// use plumbline_num::sparse::{BlockMatrix, SymmetricOperator};
///
/// let mut a = BlockMatrix::<2>::new(2, [(0, 1)]);
/// a.add_diagonal(0, &Matrix2::new(2.0, 0.0, 0.0, 3.0));
/// a.add_diagonal(1, &Matrix2::identity());
/// a.add(0, 1, &Matrix2::new(0.0, 1.0, 0.0, 0.0));
/// let mut y = [0.0; 4];
/// a.multiply(&[1.0, 1.0, 1.0, 1.0], &mut y);
/// assert_eq!(y, [3.0, 3.0, 1.0, 2.0]);
/// ```
#[derive(Clone, Debug)]
pub struct BlockMatrix<const B: usize> {
    /// Columns of the blocks of each row, ascending, that of the diagonal included.
    columns: Lists<u32>,
    /// Where the block on the diagonal of each row is.
    diagonal: Vec<usize>,
    blocks: Vec<SMatrix<f64, B, B>>,
}

impl<const B: usize> BlockMatrix<B> {
    /// A zero matrix of `n` block rows with blocks on the diagonal and for these pairs, in whichever order and number.
    ///
    /// # Panics
    /// If a pair is out of range.
    pub fn new(n: usize, pairs: impl IntoIterator<Item = (u32, u32)>) -> Self {
        let mut places: Vec<(u32, u32)> = pairs.into_iter().flat_map(|(i, j)| [(i, j), (j, i)]).collect();
        places.extend((0..n as u32).map(|i| (i, i)));
        places.sort_unstable();
        places.dedup();
        let columns = Lists::new(n, places.iter().copied());
        let on_diagonal = |i: usize| columns.range(i).start + columns.of(i).partition_point(|&j| (j as usize) < i);
        let diagonal = (0..n).map(on_diagonal).collect();
        Self { blocks: vec![SMatrix::zeros(); places.len()], diagonal, columns }
    }

    /// Number of block rows.
    pub fn block_rows(&self) -> usize {
        self.diagonal.len()
    }

    /// Sets all entries to zero.
    pub fn clear(&mut self) {
        self.blocks.fill(SMatrix::zeros());
    }

    /// The block on the diagonal of a row.
    pub fn diagonal(&self, i: usize) -> &SMatrix<f64, B, B> {
        &self.blocks[self.diagonal[i]]
    }

    /// Adds a symmetric block to the diagonal.
    pub fn add_diagonal(&mut self, i: usize, block: &SMatrix<f64, B, B>) {
        self.blocks[self.diagonal[i]] += block;
    }

    /// Adds a block at `(i, j)`, and its transpose at `(j, i)`; `i ≠ j`.
    ///
    /// # Panics
    /// If the matrix was made without this pair.
    pub fn add(&mut self, i: usize, j: usize, block: &SMatrix<f64, B, B>) {
        let [upper, lower] = [(i, j), (j, i)].map(|(row, column)| {
            let at =
                self.columns.of(row).binary_search(&(column as u32)).expect("a pair that the matrix was made with");
            self.columns.range(row).start + at
        });
        self.blocks[upper] += block;
        self.blocks[lower] += block.transpose();
    }

    /// The blocks of a row with their columns, ascending.
    pub fn row(&self, i: usize) -> impl Iterator<Item = (usize, &SMatrix<f64, B, B>)> + Clone {
        self.columns.of(i).iter().map(|&j| j as usize).zip(&self.blocks[self.columns.range(i)])
    }

    /// The entries of the lower triangle that may be non-zero.
    ///
    /// # Errors
    /// As [`Pattern::new`].
    pub fn pattern(&self) -> Result<Arc<Pattern>, SparseError> {
        let entries = (0..self.block_rows()).flat_map(|i| {
            let lower = self.columns.of(i).iter().map(|&j| j as usize).filter(move |&j| j <= i);
            lower.flat_map(move |j| (0..B * B).map(move |k| (B * i + k % B, B * j + k / B)))
        });
        Ok(Arc::new(Pattern::new(B * self.block_rows(), entries.filter(|(i, j)| i >= j))?))
    }

    /// Writes the entries of the lower triangle to a matrix with the pattern of this one.
    pub fn fill(&self, matrix: &mut SparseMatrix) {
        let mut values = matrix.values_mut().iter_mut();
        for j in 0..self.block_rows() {
            for k in 0..B {
                // By symmetry the column of blocks below the diagonal is the rest of the row.
                let below = self.row(j).skip_while(|&(i, _)| i < j);
                let entries = below.flat_map(|(i, block)| (if i == j { k } else { 0 }..B).map(move |r| block[(k, r)]));
                for (entry, value) in entries.zip(&mut values) {
                    *value = entry;
                }
            }
        }
    }

    /// `Σ_j A_ij x_j` over some blocks of a row.
    fn times<'a>(blocks: impl Iterator<Item = (usize, &'a SMatrix<f64, B, B>)>, x: &[[f64; B]]) -> [f64; B] {
        let mut sum = [0.0; B];
        for (j, block) in blocks {
            for (column, x) in block.data.0.iter().zip(&x[j]) {
                for (sum, a) in sum.iter_mut().zip(column) {
                    *sum += a * x;
                }
            }
        }
        sum
    }
}

impl<const B: usize> SymmetricOperator for BlockMatrix<B> {
    fn n(&self) -> usize {
        B * self.block_rows()
    }

    fn multiply(&self, x: &[f64], y: &mut [f64]) {
        assert!(x.len() == self.n() && y.len() == self.n(), "vectors of a system of {} unknowns", self.n());
        let x = x.as_chunks::<B>().0;
        for (i, y) in y.as_chunks_mut::<B>().0.iter_mut().enumerate() {
            *y = Self::times(self.row(i), x);
        }
    }

    fn component_of(&self, unknown: usize) -> Component {
        let (mut seen, mut stack) = (vec![false; self.block_rows()], vec![unknown / B]);
        while let Some(i) = stack.pop() {
            if !std::mem::replace(&mut seen[i], true) {
                stack.extend(self.row(i).filter(|(_, block)| block.iter().any(|&v| v != 0.0)).map(|(j, _)| j));
            }
        }
        Component { unknowns: (0..self.n()).filter(|k| seen[k / B]).collect() }
    }
}

/// Gauss–Seidel relaxation by blocks: each block row in order takes the values that satisfy its own `B` equations.
///
/// A sweep forwards and one backwards around the correction by a coarser level make a multigrid cycle that is symmetric, as
/// conjugate gradients need it.
///
/// ```
/// use nalgebra::Matrix2;
/// use plumbline_num::sparse::{BlockGaussSeidel, BlockMatrix};
///
/// let mut a = BlockMatrix::<2>::new(1, []);
/// a.add_diagonal(0, &Matrix2::new(2.0, 1.0, 1.0, 2.0));
/// let (mut x, mut left) = ([0.0; 2], [0.0; 2]);
/// BlockGaussSeidel::new(&a)?.forwards_from_zero(&[3.0, 3.0], &mut x, &mut left);
/// assert!((x[0] - 1.0).abs() < 1e-15 && left == [0.0; 2]);
/// # Ok::<(), plumbline_num::sparse::SparseError>(())
/// ```
#[derive(Clone, Debug)]
pub struct BlockGaussSeidel<'a, const B: usize> {
    matrix: &'a BlockMatrix<B>,
    inverses: Vec<SMatrix<f64, B, B>>,
}

impl<'a, const B: usize> BlockGaussSeidel<'a, B> {
    /// Inverts the blocks of the diagonal.
    ///
    /// # Errors
    /// [`SparseError::Pivot`] where one is not positive definite.
    pub fn new(matrix: &'a BlockMatrix<B>) -> Result<Self, SparseError> {
        let inverse = |i: usize| {
            let factor = nalgebra::Cholesky::<f64, Const<B>>::new(*matrix.diagonal(i));
            let inverse = factor.ok_or(SparseError::Pivot { unknown: B * i })?.inverse();
            inverse.iter().all(|v| v.is_finite()).then_some(inverse).ok_or(SparseError::Pivot { unknown: B * i })
        };
        Ok(Self { matrix, inverses: (0..matrix.block_rows()).map(inverse).collect::<Result<_, _>>()? })
    }

    /// A sweep in ascending order from `x = 0`; `left` is the residual `b − A x` after it.
    ///
    /// # Panics
    /// If lengths differ.
    pub fn forwards_from_zero(&self, b: &[f64], x: &mut [f64], left: &mut [f64]) {
        let n = self.matrix.n();
        assert!(b.len() == n && x.len() == n && left.len() == n, "vectors of a system of {n} unknowns");
        let x = x.as_chunks_mut::<B>().0;
        for (i, b) in b.as_chunks::<B>().0.iter().enumerate() {
            let before = self.matrix.row(i).take_while(|&(j, _)| j < i);
            x[i] = self.own(i, b, BlockMatrix::times(before, x));
        }
        // When a block row has got its values its equations are met but for the rows after it, which are zero then.
        for (i, left) in left.as_chunks_mut::<B>().0.iter_mut().enumerate() {
            *left = BlockMatrix::times(self.matrix.row(i).skip_while(|&(j, _)| j <= i), x).map(|sum| -sum);
        }
    }

    /// A sweep in descending order.
    ///
    /// # Panics
    /// If lengths differ.
    pub fn backwards(&self, b: &[f64], x: &mut [f64]) {
        let n = self.matrix.n();
        assert!(b.len() == n && x.len() == n, "vectors of a system of {n} unknowns");
        let x = x.as_chunks_mut::<B>().0;
        for (i, b) in b.as_chunks::<B>().0.iter().enumerate().rev() {
            let others = self.matrix.row(i).filter(|&(j, _)| j != i);
            x[i] = self.own(i, b, BlockMatrix::times(others, x));
        }
    }

    /// `A_ii⁻¹ (b_i − others)`.
    fn own(&self, i: usize, b: &[f64; B], others: [f64; B]) -> [f64; B] {
        let right: [f64; B] = std::array::from_fn(|k| b[k] - others[k]);
        BlockMatrix::times(std::iter::once((0, &self.inverses[i])), &[right])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix2;

    /// A ring of springs with two unknowns each, held at one block row.
    fn ring(n: usize) -> (BlockMatrix<2>, SparseMatrix) {
        let next = |i: usize| (i + 1) % n;
        let mut blocks = BlockMatrix::new(n, (0..n).map(|i| (i as u32, next(i) as u32)));
        blocks.add_diagonal(0, &Matrix2::identity());
        for i in 0..n {
            let stiffness = Matrix2::new(2.0 + i as f64, 0.5, 0.5, 1.0);
            blocks.add_diagonal(i, &stiffness);
            blocks.add_diagonal(next(i), &stiffness);
            // A joint whose ends are turned against each other.
            blocks.add(i, next(i), &(-stiffness * Matrix2::new(0.8, -0.6, 0.6, 0.8)));
        }
        let mut sparse = SparseMatrix::zeros(blocks.pattern().expect("in range"));
        blocks.fill(&mut sparse);
        (blocks, sparse)
    }

    fn wave(n: usize) -> Vec<f64> {
        (0..n).map(|k| (k as f64 * 1.7).sin()).collect()
    }

    #[test]
    fn blocks_multiply_as_the_same_entries_do_one_by_one() {
        let (blocks, sparse) = ring(7);
        let (x, mut y, mut z) = (wave(14), vec![0.0; 14], vec![0.0; 14]);
        blocks.multiply(&x, &mut y);
        sparse.multiply(&x, &mut z);
        assert!(y.iter().zip(&z).all(|(a, b)| (a - b).abs() < 1e-13) && y.iter().any(|y| y.abs() > 1.0));
    }

    #[test]
    fn a_sweep_satisfies_each_block_row_in_turn_and_tells_what_is_left() {
        let (blocks, sparse) = ring(7);
        let relaxation = BlockGaussSeidel::new(&blocks).expect("positive");
        let (b, mut x, mut left, mut residual) = (wave(14), vec![9.0; 14], vec![9.0; 14], vec![0.0; 14]);
        relaxation.forwards_from_zero(&b, &mut x, &mut left);
        sparse.residual(&x, &b, &mut residual);
        assert!(left.iter().zip(&residual).all(|(a, b)| (a - b).abs() < 1e-13));
        assert!(residual[12..].iter().all(|r| r.abs() < 1e-13), "the last block row is satisfied");
        relaxation.backwards(&b, &mut x);
        sparse.residual(&x, &b, &mut residual);
        assert!(residual[..2].iter().all(|r| r.abs() < 1e-13), "the first block row is satisfied");
    }

    #[test]
    fn parts_that_are_not_joined_are_told_apart_and_a_bad_block_is_named() {
        let mut blocks = BlockMatrix::<2>::new(3, [(0, 2)]);
        blocks.add(2, 0, &Matrix2::identity());
        assert_eq!(blocks.component_of(1).unknowns, [0, 1, 4, 5]);
        assert_eq!(blocks.component_of(2).unknowns, [2, 3]);
        blocks.add_diagonal(0, &Matrix2::identity());
        assert!(matches!(BlockGaussSeidel::new(&blocks), Err(SparseError::Pivot { unknown: 2 })));
        assert_eq!(BlockMatrix::<2>::new(0, []).n(), 0);
    }
}
