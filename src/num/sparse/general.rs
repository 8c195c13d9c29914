//! Sparse matrices of any shape, and how they are put together entry by entry.

use super::{Pattern, SparseError, SparseMatrix};
use crate::math::Lists;

/// Collects the entries of an `m×n` matrix in any order.
///
/// An entry may be named more than once: [`Self::add_entry`] sums, [`Self::set_entry`] replaces what was said of the entry
/// before. Nothing is checked until [`Self::build`].
#[derive(Clone, Debug, Default)]
pub struct SparseBuilder {
    rows: usize,
    columns: usize,
    /// Row, column, value, and whether it replaces.
    entries: Vec<(usize, usize, f64, bool)>,
}

impl SparseBuilder {
    /// The zero matrix of this shape.
    pub fn new(rows: usize, columns: usize) -> Self {
        Self { rows, columns, entries: Vec::new() }
    }

    /// Adds `value` to the entry in row `i` and column `j`.
    pub fn add_entry(&mut self, i: usize, j: usize, value: f64) -> &mut Self {
        self.entries.push((i, j, value, false));
        self
    }

    /// Sets the entry in row `i` and column `j`, whatever was added or set there before.
    pub fn set_entry(&mut self, i: usize, j: usize, value: f64) -> &mut Self {
        self.entries.push((i, j, value, true));
        self
    }

    /// The matrix.
    ///
    /// # Errors
    /// [`SparseError::OutOfBounds`] for an entry beyond the shape, [`SparseError::NotFinite`] for one that is not a number,
    /// [`SparseError::TooLarge`] past 2³¹ rows, columns or entries.
    pub fn build(&self) -> Result<GeneralMatrix, SparseError> {
        let (rows, columns) = (self.rows, self.columns);
        let size = rows.max(columns).max(self.entries.len());
        if size > i32::MAX as usize {
            return Err(SparseError::TooLarge { size });
        }
        for &(row, col, value, _) in &self.entries {
            if row >= rows || col >= columns {
                return Err(SparseError::OutOfBounds { row, col, rows, columns });
            }
            if !value.is_finite() {
                return Err(SparseError::NotFinite { row, col });
            }
        }
        let mut order: Vec<u32> = (0..self.entries.len() as u32).collect();
        order.sort_by_key(|&k| {
            let (i, j, ..) = self.entries[k as usize];
            (j, i)
        });
        let mut matrix = GeneralMatrix { rows, starts: vec![0], row_idx: Vec::new(), values: Vec::new() };
        for k in order {
            let (i, j, value, replaces) = self.entries[k as usize];
            let here = matrix.starts.len() == j + 1 && matrix.row_idx.len() > matrix.starts[j] as usize;
            match matrix.values.last_mut() {
                Some(last) if here && matrix.row_idx.last() == Some(&(i as u32)) => {
                    *last = if replaces { value } else { *last + value };
                }
                _ => {
                    matrix.starts.resize(j + 1, matrix.row_idx.len() as u32);
                    matrix.row_idx.push(i as u32);
                    matrix.values.push(value);
                }
            }
        }
        matrix.starts.resize(columns + 1, matrix.row_idx.len() as u32);
        // Sums of numbers may be none.
        let bad = matrix.entries().find(|(_, _, v)| !v.is_finite());
        bad.map_or(Ok(()), |(row, col, _)| Err(SparseError::NotFinite { row, col }))?;
        Ok(matrix)
    }
}

/// An `m×n` matrix, compressed by columns, rows ascending within each.
#[derive(Clone, Debug, PartialEq)]
pub struct GeneralMatrix {
    rows: usize,
    starts: Vec<u32>,
    row_idx: Vec<u32>,
    values: Vec<f64>,
}

impl GeneralMatrix {
    /// Number of rows `m`.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns `n`.
    pub fn columns(&self) -> usize {
        self.starts.len() - 1
    }

    /// Stored entries.
    pub fn nnz(&self) -> usize {
        self.values.len()
    }

    /// Rows and values of column `j`.
    pub fn column(&self, j: usize) -> impl ExactSizeIterator<Item = (usize, f64)> + Clone + '_ {
        let range = self.starts[j] as usize..self.starts[j + 1] as usize;
        self.row_idx[range.clone()].iter().zip(&self.values[range]).map(|(&i, &v)| (i as usize, v))
    }

    /// All entries as `(row, column, value)`, column by column.
    pub fn entries(&self) -> impl Iterator<Item = (usize, usize, f64)> + Clone + '_ {
        (0..self.columns()).flat_map(move |j| self.column(j).map(move |(i, v)| (i, j, v)))
    }

    /// Starts of the columns, rows of the entries, entries: compressed columns as other code takes them.
    pub fn parts(&self) -> (&[u32], &[u32], &[f64]) {
        (&self.starts, &self.row_idx, &self.values)
    }

    /// `Aᵀ`; its columns are the rows of `A`.
    #[must_use]
    pub fn transposed(&self) -> Self {
        let columns = Lists::new(self.rows, self.entries().map(|(i, j, v)| (i as u32, (j as u32, v))));
        let starts = columns.starts().iter().map(|&start| start as u32).collect();
        let (row_idx, values) = columns.items().iter().copied().unzip();
        Self { rows: self.columns(), starts, row_idx, values }
    }

    /// `A x`, for `n` values.
    #[must_use]
    pub fn multiply(&self, x: &[f64]) -> Vec<f64> {
        assert!(x.len() == self.columns(), "{} values for {} columns", x.len(), self.columns());
        let mut y = vec![0.0; self.rows];
        for (i, j, v) in self.entries() {
            y[i] += v * x[j];
        }
        y
    }

    /// `Aᵀ y`, for `m` values.
    #[must_use]
    pub fn multiply_transposed(&self, y: &[f64]) -> Vec<f64> {
        assert!(y.len() == self.rows, "{} values for {} rows", y.len(), self.rows);
        (0..self.columns()).map(|j| self.column(j).map(|(i, v)| v * y[i]).sum()).collect()
    }

    /// `‖A‖₁`, the largest sum of the magnitudes of a column.
    pub fn norm_1(&self) -> f64 {
        (0..self.columns()).map(|j| self.column(j).map(|(_, v)| v.abs()).sum()).fold(0.0, f64::max)
    }

    /// First entry that differs from its mirror image, `None` where `A = Aᵀ` exactly.
    pub fn first_asymmetry(&self) -> Option<(usize, usize)> {
        let other = self.transposed();
        let mut pairs = self.entries().zip(other.entries());
        let differing = pairs.find(|((i, j, a), (k, l, b))| (i, j) != (k, l) || a != b);
        differing.map(|((i, j, _), _)| (i, j)).or((self.rows != self.columns()).then_some((self.rows, self.columns())))
    }

    /// The same as a symmetric matrix.
    ///
    /// # Errors
    /// [`SparseError::NotSquare`], [`SparseError::NotSymmetric`].
    pub fn symmetric(&self) -> Result<SparseMatrix, SparseError> {
        self.square()?;
        if let Some((row, col)) = self.first_asymmetry() {
            return Err(SparseError::NotSymmetric { row, col });
        }
        let lower: Vec<(usize, usize, f64)> = self.entries().filter(|(i, j, _)| i >= j).collect();
        SparseMatrix::from_triplets(self.rows, &lower)
    }

    pub(super) fn square(&self) -> Result<usize, SparseError> {
        let (rows, columns) = (self.rows, self.columns());
        if rows == columns { Ok(rows) } else { Err(SparseError::NotSquare { rows, columns }) }
    }

    /// The entries of `A + Aᵀ`.
    ///
    /// # Errors
    /// [`SparseError::NotSquare`].
    pub fn symmetric_pattern(&self) -> Result<Pattern, SparseError> {
        Pattern::new(self.square()?, self.entries().map(|(i, j, _)| (i, j)))
    }
}

impl From<&SparseMatrix> for GeneralMatrix {
    fn from(a: &SparseMatrix) -> Self {
        let mut builder = SparseBuilder::new(a.n(), a.n());
        for (i, j, s) in a.pattern().entries() {
            builder.add_entry(i, j, a.values()[s]);
            if i != j {
                builder.add_entry(j, i, a.values()[s]);
            }
        }
        builder.build().unwrap_or_else(|_| unreachable!("the indices of a symmetric matrix are within it"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn added_entries_sum_and_set_ones_replace_what_came_before() {
        let mut builder = SparseBuilder::new(3, 2);
        builder
            .add_entry(2, 1, 4.0)
            .set_entry(0, 0, 9.0)
            .add_entry(2, 1, 0.5)
            .set_entry(0, 0, 1.0)
            .add_entry(0, 0, 2.0);
        let a = builder.build().expect("inside");
        assert_eq!(a.entries().collect::<Vec<_>>(), [(0, 0, 3.0), (2, 1, 4.5)]);
        assert_eq!(a.transposed().entries().collect::<Vec<_>>(), [(0, 0, 3.0), (1, 2, 4.5)]);
        assert_eq!(a.multiply(&[1.0, 2.0]), [3.0, 0.0, 9.0]);
        assert_eq!(a.multiply_transposed(&[1.0, 7.0, 2.0]), [3.0, 9.0]);
        assert_eq!(a.norm_1(), 4.5);
    }

    #[test]
    fn empty_columns_at_both_ends_are_kept() {
        let mut builder = SparseBuilder::new(2, 5);
        builder.add_entry(1, 2, -1.0).add_entry(0, 3, 1.0).add_entry(1, 3, 1.0);
        let a = builder.build().expect("inside");
        assert_eq!((a.columns(), a.nnz(), a.column(0).len(), a.column(4).len()), (5, 3, 0, 0));
        assert_eq!(a.multiply(&[1.0; 5]), [1.0, 0.0]);
    }

    #[test]
    fn entries_outside_and_numbers_that_are_none_are_refused() {
        let outside = SparseBuilder::new(3, 2).add_entry(1, 2, 1.0).build().expect_err("column 2 of 2");
        assert_eq!(outside.to_string(), "entry (1, 2) is outside the 3×2 matrix (numbered from 0)");
        let nan = SparseBuilder::new(3, 2).set_entry(1, 1, f64::NAN).build().expect_err("NaN");
        assert_eq!(nan.to_string(), "entry (1, 1) of the matrix is not finite");
        let sum =
            SparseBuilder::new(3, 2).add_entry(2, 0, 1e308).add_entry(2, 0, 1e308).build().expect_err("overflows");
        assert_eq!(sum, SparseError::NotFinite { row: 2, col: 0 });
    }

    #[test]
    fn symmetry_is_judged_exactly() {
        let symmetric = |entries: &[(usize, usize, f64)]| {
            let mut builder = SparseBuilder::new(3, 3);
            for &(i, j, v) in entries {
                builder.add_entry(i, j, v);
            }
            builder.build().expect("inside").symmetric()
        };
        assert!(symmetric(&[(0, 0, 1.0), (2, 0, 3.0), (0, 2, 3.0)]).is_ok());
        for bad in [&[(2, 0, 3.0)][..], &[(2, 0, 3.0), (0, 2, 3.1)], &[(2, 0, 3.0), (0, 1, 3.0)]] {
            assert!(matches!(symmetric(bad), Err(SparseError::NotSymmetric { .. })), "{bad:?}");
        }
        let wide = SparseBuilder::new(1, 2).build().expect("inside").symmetric().expect_err("not square");
        assert_eq!(wide.to_string(), "the matrix is 1×2, not square: use QR or the normal equations");
    }
}
