//! The fast path: an energy whose pattern is known for good and whose values are refilled before every solve.
//!
//! ```text
//! E(x) = Σₑ Σᵣ wᵣ |Σⱼ aᵣⱼ x_{e(j)} − bᵣ|² + Σᵢ wᵢ |xᵢ − bᵢ|²
//! ```
//!
//! Each *element* `e` is a short list of unknowns that rows may couple: a cell's corners, an edge's ends. Where the
//! products of a row go in the matrix is looked up once; a frame then costs additions, one numeric factorization and one
//! solve, and allocates nothing. Normal equations: `A = Σ w aᴴa`, `A x = Σ w aᴴ b`.

use std::sync::Arc;

use super::{EnergyError, Ordering, Scalar};
use crate::run::Run;
use crate::sparse::{Cholesky, Pattern, SparseMatrix};

/// A sum of squares over fixed elements; `T = Complex` lets one unknown be a point of the plane.
#[derive(Debug)]
pub struct QuadraticEnergy<T = f64> {
    /// Unknowns of element `e`: `unknowns[starts[e]..starts[e + 1]]`.
    starts: Vec<u32>,
    unknowns: Vec<u32>,
    /// Matrix slots of element `e`, its lower triangle row by row, from `slot_starts[e]`.
    slot_starts: Vec<u32>,
    slots: Vec<u32>,
    diagonal: Vec<u32>,
    matrix: SparseMatrix<T>,
    rhs: Vec<T>,
    solution: Vec<T>,
    cholesky: Cholesky<T>,
}

impl<T: Scalar> QuadraticEnergy<T> {
    /// The zero energy of `n` unknowns that `elements` may couple. Each element lists its unknowns in ascending order.
    ///
    /// # Errors
    /// [`EnergyError::Solve`] for an unknown ≥ `n` or an ordering of another size.
    pub fn new<'a>(
        n: usize,
        elements: impl Iterator<Item = &'a [usize]> + Clone,
        ordering: &Ordering,
    ) -> Result<Self, EnergyError> {
        let pairs = elements.clone().flat_map(|e| e.iter().flat_map(move |&i| e.iter().map(move |&j| (i, j))));
        let pattern = Arc::new(Pattern::new(n, pairs.filter(|(i, j)| i >= j))?);
        let cholesky = Cholesky::analyze(&pattern, ordering)?;
        let (mut starts, mut unknowns, mut slot_starts, mut slots) = (vec![0], Vec::new(), vec![0], Vec::new());
        for element in elements {
            assert!(element.is_sorted_by(|a, b| a < b), "unknowns of an element must ascend: {element:?}");
            unknowns.extend(element.iter().map(|&i| i as u32));
            starts.push(unknowns.len() as u32);
            for (a, &i) in element.iter().enumerate() {
                slots.extend(element[..=a].iter().filter_map(|&j| pattern.slot(i, j)).map(|s| s as u32));
            }
            slot_starts.push(slots.len() as u32);
        }
        let diagonal = pattern.column_starts()[..n].to_vec();
        let (rhs, solution) = (vec![T::default(); n], vec![T::default(); n]);
        let matrix = SparseMatrix::zeros(pattern);
        Ok(Self { starts, unknowns, slot_starts, slots, diagonal, matrix, rhs, solution, cholesky })
    }

    /// Number of unknowns.
    pub fn unknown_count(&self) -> usize {
        self.rhs.len()
    }

    /// Forgets all terms; the pattern stays.
    pub fn clear(&mut self) {
        self.matrix.values_mut().fill(T::default());
        self.rhs.fill(T::default());
    }

    /// Adds `w |Σⱼ aⱼ xⱼ − b|²` over the unknowns of an element, one coefficient each.
    #[inline]
    pub fn add(&mut self, element: usize, w: f64, coefficients: &[T], b: T) {
        let unknowns = &self.unknowns[self.starts[element] as usize..self.starts[element + 1] as usize];
        assert_eq!(coefficients.len(), unknowns.len(), "one coefficient per unknown of element {element}");
        let slots = &self.slots[self.slot_starts[element] as usize..];
        let values = self.matrix.values_mut();
        let mut slot = slots.iter();
        for (a, &i) in unknowns.iter().enumerate() {
            let left = coefficients[a].conjugate().times(w);
            self.rhs[i as usize] += left * b;
            for (&right, &s) in coefficients[..=a].iter().zip(&mut slot) {
                values[s as usize] += left * right;
            }
        }
    }

    /// Adds the Hermitian form `xᴴ B x` over an element's unknowns; `block` is the lower triangle of `B`, row by row.
    #[inline]
    pub fn add_form(&mut self, element: usize, block: &[T]) {
        let slots = &self.slots[self.slot_starts[element] as usize..self.slot_starts[element + 1] as usize];
        assert_eq!(block.len(), slots.len(), "lower triangle of element {element}");
        let values = self.matrix.values_mut();
        for (&b, &s) in block.iter().zip(slots) {
            values[s as usize] += b;
        }
    }

    /// Adds `w |xᵢ − b|²` for every unknown.
    pub fn add_everywhere(&mut self, w: f64, b: T) {
        for (&s, rhs) in self.diagonal.iter().zip(&mut self.rhs) {
            self.matrix.values_mut()[s as usize] += T::real(w);
            *rhs += b.times(w);
        }
    }

    /// Unknowns of an element.
    pub(super) fn unknowns_of(&self, element: usize) -> &[u32] {
        &self.unknowns[self.starts[element] as usize..self.starts[element + 1] as usize]
    }

    /// `Σ w aᴴ b` of what has been added since [`Self::clear`].
    pub(super) fn rhs(&self) -> &[T] {
        &self.rhs
    }

    /// Factors what has been added since [`Self::clear`].
    pub(super) fn factor(&mut self, run: &Run) -> Result<(), EnergyError> {
        Ok(self.cholesky.factor(&self.matrix, run)?)
    }

    /// Solves for right-hand sides other than the terms' own: columns of one entry per unknown.
    pub(super) fn solve_in_place(&mut self, rhs: &mut [T]) {
        self.cholesky.solve_in_place(rhs);
    }

    /// Half of it: [`Cholesky::half_solve_in_place`].
    pub(super) fn half_solve_in_place(&mut self, rhs: &mut [T]) {
        self.cholesky.half_solve_in_place(rhs);
    }

    /// The minimizer of what has been added since [`Self::clear`].
    ///
    /// # Errors
    /// [`EnergyError::Solve`] where the terms leave something free or are not finite, [`EnergyError::Interrupted`].
    pub fn minimize(&mut self, run: &Run) -> Result<&[T], EnergyError> {
        self.factor(run)?;
        self.solution.copy_from_slice(&self.rhs);
        self.cholesky.solve_in_place(&mut self.solution);
        Ok(&self.solution)
    }

    /// The last minimizer.
    pub fn solution(&self) -> &[T] {
        &self.solution
    }
}
