//! An energy after factorization: solves for any targets and fixed values, refactors for other weights.
//!
//! With the unknowns split into free `x` and fixed `c`, rows `A x + B c = b` and weights `W`, each solve is
//! `(Aᵀ W A) x = Aᵀ W (b − B c)`, once per coordinate, against one factor.

use std::ops::{Index, IndexMut};

use super::least_squares::Row;
use super::{EnergyError, FixedSet, FixedValues, LeastSquares, Ordering, QuadraticEnergy, Term, Value};
use crate::math::Vec2;
use crate::run::Run;
use crate::sparse::SparseError;

/// What each row's `Σ a x` should equal: `b`.
#[derive(Clone, Debug, PartialEq)]
pub struct Targets<const D: usize>(Vec<Value<D>>);

impl<const D: usize> Index<Term> for Targets<D> {
    type Output = Value<D>;

    fn index(&self, term: Term) -> &Value<D> {
        &self.0[term.0]
    }
}

impl<const D: usize> IndexMut<Term> for Targets<D> {
    fn index_mut(&mut self, term: Term) -> &mut Value<D> {
        &mut self.0[term.0]
    }
}

impl Targets<1> {
    /// Sets both targets of a term added by [`LeastSquares::add2`].
    pub fn set_point(&mut self, term: Term, b: Vec2) {
        self.0[term.0].x = b.x;
        self.0[term.0 + 1].x = b.y;
    }
}

/// Solver of a [`LeastSquares`] energy with a fixed set.
#[derive(Debug)]
pub struct Factored<const D: usize> {
    pub(super) rows: Vec<Row<D>>,
    fixed: FixedSet,
    /// Unknown of each free index.
    free: Vec<usize>,
    /// Free index of each unknown; fixed ones have none.
    index_of: Vec<Option<u32>>,
    normal: QuadraticEnergy<f64>,
    rhs: Vec<f64>,
    coefficients: Vec<f64>,
}

impl<const D: usize> Factored<D> {
    pub(super) fn new(
        energy: &LeastSquares<D>,
        fixed: &FixedSet,
        ordering: impl FnOnce(&[usize]) -> Ordering,
        run: &Run,
    ) -> Result<Self, EnergyError> {
        let n = energy.unknown_count();
        let mut index_of = vec![Some(0); n];
        fixed.unknowns().iter().for_each(|&i| index_of[i] = None);
        let free: Vec<usize> = (0..n).filter(|&i| index_of[i].is_some()).collect();
        free.iter().enumerate().for_each(|(k, &i)| index_of[i] = Some(k as u32));
        let elements: Vec<Vec<usize>> = energy
            .rows
            .iter()
            .map(|row| row.terms.iter().filter_map(|&(i, _)| index_of[i].map(|k| k as usize)).collect())
            .collect();
        let normal = QuadraticEnergy::new(free.len(), elements.iter().map(|e| &e[..]), &ordering(&free))?;
        let rhs = vec![0.0; D * free.len()];
        let rows = energy.rows.clone();
        let mut factored = Self { rows, fixed: fixed.clone(), free, index_of, normal, rhs, coefficients: Vec::new() };
        factored.refactor(run)?;
        Ok(factored)
    }

    /// The fixed set it was factored for.
    pub fn fixed(&self) -> &FixedSet {
        &self.fixed
    }

    /// The targets that the expressions were written with.
    pub fn targets(&self) -> Targets<D> {
        Targets(self.rows.iter().map(|row| row.b).collect())
    }

    /// Gives every term the weight `w(term, weight so far)` and factors anew; allocates nothing.
    ///
    /// # Errors
    /// [`EnergyError::Weight`] (nothing has changed then); [`EnergyError::Unconstrained`] where too many weights vanish
    /// (solves give NaN then, until a reweighting succeeds).
    pub fn reweight(&mut self, mut w: impl FnMut(Term, f64) -> f64, run: &Run) -> Result<(), EnergyError> {
        for pass in 0..2 {
            for row in &mut self.rows {
                let weight = w(Term(row.term), row.w);
                if !(weight >= 0.0 && weight.is_finite()) {
                    return Err(EnergyError::Weight { term: row.term, weight });
                }
                if pass == 1 {
                    row.w = weight;
                }
            }
        }
        self.refactor(run)
    }

    fn refactor(&mut self, run: &Run) -> Result<(), EnergyError> {
        self.normal.clear();
        for (element, row) in self.rows.iter().enumerate() {
            let free = row.terms.iter().filter(|&&(i, _)| self.index_of[i].is_some());
            self.coefficients.clear();
            self.coefficients.extend(free.map(|&(_, a)| a));
            self.normal.add(element, row.w, &self.coefficients, 0.0);
        }
        self.normal.factor(run).map_err(|error| self.name_component(error))
    }

    /// Says which of the caller's unknowns a singular component consists of.
    fn name_component(&self, error: EnergyError) -> EnergyError {
        match error {
            EnergyError::Solve(
                SparseError::Singular { component } | SparseError::NotPositiveDefinite { component },
            ) => EnergyError::Unconstrained { unknowns: component.unknowns.iter().map(|&k| self.free[k]).collect() },
            other => other,
        }
    }

    /// The minimizer: a value for every unknown, fixed ones included.
    ///
    /// # Errors
    /// [`EnergyError::FixedValues`], [`EnergyError::Targets`] where they were made for another energy.
    pub fn solve(&mut self, targets: &Targets<D>, values: &FixedValues<D>) -> Result<Vec<Value<D>>, EnergyError> {
        let mut x = vec![Value::zeros(); self.index_of.len()];
        self.solve_into(targets, values, &mut x)?;
        Ok(x)
    }

    /// [`Self::solve`] into a slice of as many values as unknowns; allocates nothing after the first time.
    ///
    /// # Errors
    /// As [`Self::solve`].
    pub fn solve_into(
        &mut self,
        targets: &Targets<D>,
        values: &FixedValues<D>,
        x: &mut [Value<D>],
    ) -> Result<(), EnergyError> {
        if *values.set() != self.fixed {
            let (given, expected) = (values.as_slice().len(), self.fixed.unknowns().len());
            return Err(EnergyError::FixedValues { given, expected });
        }
        if targets.0.len() != self.rows.len() {
            return Err(EnergyError::Targets { given: targets.0.len(), expected: self.rows.len() });
        }
        assert_eq!(x.len(), self.index_of.len(), "one value per unknown");
        for (&i, value) in self.fixed.unknowns().iter().zip(values.as_slice()) {
            x[i] = *value;
        }
        self.gather(targets, x);
        self.normal.solve_in_place(&mut self.rhs);
        for (k, &i) in self.free.iter().enumerate() {
            x[i] = Value::from_fn(|d, _| self.rhs[d * self.free.len() + k]);
        }
        Ok(())
    }

    /// `Aᵀ W (b − B c)`, one column per coordinate.
    fn gather(&mut self, targets: &Targets<D>, x: &[Value<D>]) {
        let n = self.free.len();
        self.rhs.fill(0.0);
        for (row, b) in self.rows.iter().zip(&targets.0) {
            let known = |&(i, a): &(usize, f64)| if self.index_of[i].is_none() { x[i] * a } else { Value::zeros() };
            let residual = row.terms.iter().fold(*b, |r, term| r - known(term)) * row.w;
            for &(i, a) in &row.terms {
                if let Some(k) = self.index_of[i] {
                    (0..D).for_each(|d| self.rhs[d * n + k as usize] += a * residual[d]);
                }
            }
        }
    }

    /// `Σ a x − b` of row `r`.
    fn residual(&self, r: usize, targets: &Targets<D>, x: &[Value<D>]) -> Value<D> {
        self.rows[r].terms.iter().fold(-targets.0[r], |sum, &(i, a)| sum + x[i] * a)
    }

    /// `E(x)` with the present weights.
    pub fn energy(&self, targets: &Targets<D>, x: &[Value<D>]) -> f64 {
        (0..self.rows.len()).map(|r| self.rows[r].w * self.residual(r, targets, x).norm_squared()).sum()
    }

    /// `‖residual‖²` of a term, unweighted, both rows of a plane term together.
    pub fn squared_residual(&self, term: Term, targets: &Targets<D>, x: &[Value<D>]) -> f64 {
        let rows = (term.0..self.rows.len()).take_while(|&r| self.rows[r].term == term.0);
        rows.map(|r| self.residual(r, targets, x).norm_squared()).sum()
    }
}
