//! Direct solution of square systems and of least squares, by whichever factorization the matrix allows.
//!
//! | method | for | keeps order |
//! |---|---|---|
//! | Cholesky `L Lᵀ`, supernodal | symmetric positive definite | yes |
//! | the same, column by column | small or very sparse ones | yes |
//! | `L D Lᵀ`, `D` of 1×1 and 2×2 blocks | symmetric indefinite | yes |
//! | LU, partial pivoting | any square matrix | rows move |
//! | QR (Householder) | least squares, `m ≥ n`; no squaring of the condition number as in `AᵀA` | – |
//!
//! LU, QR and the column-by-column Cholesky do not distinguish a tiny pivot from a small one: all but the supernodal one are therefore
//! probed with a known solution before they are handed out. Where no digit of that solution comes back the matrix is called
//! singular, and [`Method::Auto`] goes on to the next method.
//!
//! # Reference
//! T. A. Davis, *Direct Methods for Sparse Linear Systems*, SIAM 2006.

mod ldlt;
mod lu;
mod qr;
mod simplicial;

use super::{Cholesky, GeneralMatrix, Ordering, SparseError, SparseMatrix};
use crate::run::Run;
use ldlt::Ldlt;
use lu::Lu;
use qr::Qr;
use simplicial::Simplicial;

/// How a matrix is factored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Cholesky for symmetric matrices, `L D Lᵀ` where that finds a negative pivot, LU for what remains; QR unless square.
    #[default]
    Auto,
    /// `L Lᵀ`, in blocks of columns.
    Cholesky,
    /// `L Lᵀ`, column by column.
    SimplicialCholesky,
    /// `L D Lᵀ`.
    Ldlt,
    /// `L U`.
    Lu,
    /// `Q R`.
    Qr,
}

/// A factored matrix.
#[derive(Debug)]
pub struct Factor {
    rows: usize,
    columns: usize,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    Cholesky(Box<Cholesky>),
    Simplicial(Box<Simplicial>),
    Ldlt(Box<Ldlt>),
    Lu(Box<Lu>),
    Qr(Box<Qr>),
}

/// Relative error that a probe's solution may have: more, and not even its leading digit can be trusted.
const PROBE_TOLERANCE: f64 = 0.1;

impl GeneralMatrix {
    /// Factors the matrix. The ordering counts for symmetric methods and for LU where entries mostly have mirror
    /// images; other matrices and QR have their columns ordered by COLAMD.
    ///
    /// # Errors
    /// [`SparseError::NotSquare`], [`SparseError::NotSymmetric`], [`SparseError::Underdetermined`] where the method does not
    /// take such a matrix; [`SparseError::Singular`], [`SparseError::NotPositiveDefinite`], [`SparseError::Undetermined`]
    /// where it has no solution; [`SparseError::OutOfMemory`], [`SparseError::Interrupted`].
    pub fn factor(&self, method: Method, ordering: &Ordering, run: &Run) -> Result<Factor, SparseError> {
        let kind = match method {
            Method::Auto if self.rows() != self.columns() => self.qr(run)?,
            Method::Auto => self.best(ordering, run)?,
            Method::Cholesky => cholesky(&self.symmetric()?, ordering, run)?,
            Method::SimplicialCholesky => simplicial(&self.symmetric()?, ordering, run)?,
            Method::Ldlt => Kind::Ldlt(Box::new(Ldlt::new(&self.symmetric()?, ordering, run)?)),
            Method::Lu => self.lu(ordering, run)?,
            Method::Qr => self.qr(run)?,
        };
        let mut factor = Factor { rows: self.rows(), columns: self.columns(), kind };
        if !matches!(factor.kind, Kind::Cholesky(_)) {
            factor.probe(self)?;
        }
        Ok(factor)
    }

    fn best(&self, ordering: &Ordering, run: &Run) -> Result<Kind, SparseError> {
        if self.first_asymmetry().is_some() {
            return self.lu(ordering, run);
        }
        let a = self.symmetric()?;
        let fault = match cholesky(&a, ordering, run) {
            Err(SparseError::NotPositiveDefinite { .. }) => None,
            // Zeros on the diagonal look singular to Cholesky, and may be those of constraints.
            Err(fault @ SparseError::Singular { .. }) if a.n() > 1 => {
                let weighted = (0..a.n()).all(|j| a.values()[a.pattern().column(j).start] > 0.0);
                weighted.then_some(fault)
            }
            other => return other,
        };
        // Where nothing else works either, what Cholesky found of a semidefinite matrix says most.
        self.indefinite(&a, ordering, run).map_err(|error| match error {
            SparseError::Interrupted(_) => error,
            error => fault.unwrap_or(error),
        })
    }

    fn indefinite(&self, a: &SparseMatrix, ordering: &Ordering, run: &Run) -> Result<Kind, SparseError> {
        let factor = |kind| Factor { rows: a.n(), columns: a.n(), kind };
        if let Ok(ldlt) = Ldlt::new(a, ordering, run) {
            let mut ldlt = factor(Kind::Ldlt(Box::new(ldlt)));
            if ldlt.probe(self).is_ok() {
                return Ok(ldlt.kind);
            }
        }
        run.check()?;
        let mut lu = factor(self.lu(ordering, run)?);
        lu.probe(self)?;
        Ok(lu.kind)
    }

    fn lu(&self, ordering: &Ordering, run: &Run) -> Result<Kind, SparseError> {
        self.square()?;
        Ok(Kind::Lu(Box::new(Lu::new(self, ordering, run)?)))
    }

    fn qr(&self, run: &Run) -> Result<Kind, SparseError> {
        let (rows, columns) = (self.rows(), self.columns());
        if rows < columns {
            return Err(SparseError::Underdetermined { rows, columns });
        }
        Ok(Kind::Qr(Box::new(Qr::new(self, run)?)))
    }
}

fn cholesky(a: &SparseMatrix, ordering: &Ordering, run: &Run) -> Result<Kind, SparseError> {
    let mut cholesky = Cholesky::analyze(a.pattern(), ordering)?;
    cholesky.factor(a, run)?;
    Ok(Kind::Cholesky(Box::new(cholesky)))
}

fn simplicial(a: &SparseMatrix, ordering: &Ordering, run: &Run) -> Result<Kind, SparseError> {
    match Simplicial::new(a, ordering, run)? {
        Some(factor) => Ok(Kind::Simplicial(Box::new(factor))),
        // The supernodal one knows the component.
        None => cholesky(a, ordering, run),
    }
}

impl Factor {
    /// The method that was used in the end.
    pub fn method(&self) -> Method {
        match &self.kind {
            Kind::Cholesky(_) => Method::Cholesky,
            Kind::Simplicial(_) => Method::SimplicialCholesky,
            Kind::Ldlt(_) => Method::Ldlt,
            Kind::Lu(_) => Method::Lu,
            Kind::Qr(_) => Method::Qr,
        }
    }

    /// The Cholesky factor, where that is what there is.
    pub fn cholesky(&self) -> Option<&Cholesky> {
        if let Kind::Cholesky(cholesky) = &self.kind { Some(cholesky) } else { None }
    }

    /// Solves for columns of `m` values one after another: `n` values of solution for each, the least-squares solution
    /// where `m > n`.
    ///
    /// # Errors
    /// [`SparseError::Columns`].
    pub fn solve(&mut self, b: &[f64]) -> Result<Vec<f64>, SparseError> {
        let (m, n) = (self.rows, self.columns);
        if m == 0 || !b.len().is_multiple_of(m) {
            return if b.is_empty() {
                Ok(Vec::new())
            } else {
                Err(SparseError::Columns { given: b.len(), expected: m })
            };
        }
        if let Kind::Qr(qr) = &self.kind {
            return Ok(b.chunks_exact(m).flat_map(|b| qr.solve(b)).collect());
        }
        let mut x = b.to_vec();
        let columns = x.chunks_exact_mut(n);
        match &mut self.kind {
            Kind::Cholesky(cholesky) => cholesky.solve_in_place(&mut x),
            Kind::Simplicial(factor) => columns.for_each(|x| factor.solve(x)),
            Kind::Ldlt(factor) => columns.for_each(|x| factor.solve(x)),
            Kind::Lu(factor) => columns.for_each(|x| factor.solve(x)),
            Kind::Qr(_) => {}
        }
        Ok(x)
    }

    /// Solves with the transposed matrix, for square ones; `None` for QR, which does not offer it.
    pub fn solve_transposed(&mut self, b: &[f64]) -> Option<Vec<f64>> {
        match &mut self.kind {
            Kind::Qr(_) => None,
            Kind::Lu(lu) => {
                let mut x = b.to_vec();
                lu.solve_transposed(&mut x);
                Some(x)
            }
            _ => self.solve(b).ok(),
        }
    }

    /// Solves for a known solution.
    fn probe(&mut self, a: &GeneralMatrix) -> Result<(), SparseError> {
        if self.columns == 0 {
            return Ok(());
        }
        let mut rng = fastrand::Rng::with_seed(1);
        let expected: Vec<f64> = (0..self.columns).map(|_| 1.0 + rng.f64()).collect();
        let x = self.solve(&a.multiply(&expected))?;
        let miss = |k: usize| if x[k].is_finite() { (x[k] - expected[k]).abs() } else { f64::INFINITY };
        let worst = (0..self.columns).max_by(|&a, &b| miss(a).total_cmp(&miss(b))).unwrap_or(0);
        if miss(worst) <= PROBE_TOLERANCE { Ok(()) } else { Err(SparseError::Undetermined { unknown: worst }) }
    }
}
