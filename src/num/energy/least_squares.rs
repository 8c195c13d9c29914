//! The clear path: an energy written as the sum of its terms.

use super::{EnergyError, Expr, Factored, FixedSet, Ordering, PlaneExpr, Value};
use crate::run::Run;

/// A weighted sum of squared expressions.
#[derive(Clone, Debug, Default)]
pub struct LeastSquares<const D: usize> {
    unknowns: usize,
    pub(super) rows: Vec<Row<D>>,
}

/// `w ‖Σ a x − b‖²`.
#[derive(Clone, Debug)]
pub(super) struct Row<const D: usize> {
    pub(super) terms: Vec<(usize, f64)>,
    pub(super) b: Value<D>,
    pub(super) w: f64,
    /// First row of the term this one belongs to.
    pub(super) term: usize,
}

/// One summand of an energy: names its targets, and is reweighted as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Term(pub(super) usize);

impl<const D: usize> LeastSquares<D> {
    /// The zero energy of so many unknowns.
    pub fn new(unknowns: usize) -> Self {
        Self { unknowns, rows: Vec::new() }
    }

    /// Number of unknowns.
    pub fn unknown_count(&self) -> usize {
        self.unknowns
    }

    /// Unknown `i` as an expression.
    pub fn var(&self, i: usize) -> Expr<D> {
        Expr::unknown(i)
    }

    /// Adds `w ‖residual‖²`, `w` ≥ 0. The residual's constant is minus the target, which solves may change.
    pub fn add(&mut self, w: f64, residual: Expr<D>) -> Term {
        let term = self.rows.len();
        self.push(w, residual, term);
        Term(term)
    }

    fn push(&mut self, w: f64, residual: Expr<D>, term: usize) {
        let (terms, constant) = residual.into_parts();
        self.rows.push(Row { terms, b: -constant, w, term });
    }

    /// The minimizer's solver, with these unknowns given.
    ///
    /// # Errors
    /// [`EnergyError::Weight`], [`EnergyError::NotFinite`], [`EnergyError::NoSuchUnknown`] for bad rows or a bad set;
    /// [`EnergyError::Unconstrained`] where part of the unknowns is held by nothing.
    pub fn factor(&self, fixed: &FixedSet, run: &Run) -> Result<Factored<D>, EnergyError> {
        self.factor_ordered(fixed, None, run)
    }

    /// [`Self::factor`] for unknowns that have places (vertices of a mesh): eliminated by nested dissection, which is found
    /// faster and fills less than the default order.
    ///
    /// # Errors
    /// As [`Self::factor`].
    pub fn factor_placed(
        &self,
        fixed: &FixedSet,
        positions: &[[f64; 3]],
        run: &Run,
    ) -> Result<Factored<D>, EnergyError> {
        self.factor_ordered(fixed, Some(positions), run)
    }

    fn factor_ordered(
        &self,
        fixed: &FixedSet,
        positions: Option<&[[f64; 3]]>,
        run: &Run,
    ) -> Result<Factored<D>, EnergyError> {
        self.check(fixed)?;
        let ordering = |free: &[usize]| match positions {
            Some(p) => Ordering::NestedDissection(free.iter().filter_map(|&i| p.get(i).copied()).collect()),
            None => Ordering::Amd,
        };
        Factored::new(self, fixed, ordering, run)
    }

    fn check(&self, fixed: &FixedSet) -> Result<(), EnergyError> {
        let used = self.rows.iter().flat_map(|row| row.terms.iter().map(|&(i, _)| i));
        if let Some(unknown) = used.chain(fixed.unknowns().iter().copied()).find(|&i| i >= self.unknowns) {
            return Err(EnergyError::NoSuchUnknown { unknown, unknowns: self.unknowns });
        }
        for row in &self.rows {
            if !(row.w >= 0.0 && row.w.is_finite()) {
                return Err(EnergyError::Weight { term: row.term, weight: row.w });
            }
            if !(row.terms.iter().all(|(_, a)| a.is_finite()) && row.b.iter().all(|b| b.is_finite())) {
                return Err(EnergyError::NotFinite { term: row.term });
            }
        }
        Ok(())
    }
}

impl LeastSquares<1> {
    /// The plane point of the scalar unknowns `2i` (x) and `2i + 1` (y).
    pub fn point(&self, i: usize) -> PlaneExpr {
        PlaneExpr { x: self.var(2 * i), y: self.var(2 * i + 1) }
    }

    /// Adds `w (‖residual.x‖² + ‖residual.y‖²)` as one term.
    pub fn add2(&mut self, w: f64, residual: PlaneExpr) -> Term {
        let term = self.rows.len();
        self.push(w, residual.x, term);
        self.push(w, residual.y, term);
        Term(term)
    }
}
