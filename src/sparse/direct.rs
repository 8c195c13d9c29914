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
//! Pivots of `L D Lᵀ` are sought within supernodes only, LU and QR do not tell a tiny pivot from a small one: each of the
//! three is therefore probed with a known solution before it is handed out. Where no digit of that solution comes back the
//! matrix is called singular, and [`Method::Auto`] goes on to the next method.
//!
//! # Reference
//! T. A. Davis, *Direct Methods for Sparse Linear Systems*, SIAM 2006; J. R. Bunch, L. Kaufman, Math. Comp. 31 (1977).

use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::solvers::{Solve, SolveLstsq};
use faer::perm::PermRef;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, IntranodeLbltRef, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::linalg::solvers::{Lu, Qr, SymbolicLu, SymbolicQr};
use faer::sparse::linalg::{LuError, SupernodalThreshold};
use faer::sparse::{SparseColMat, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side, Spec};

use super::etree::Elimination;
use super::wide_registers::clear_upper_halves;
use super::{Cholesky, GeneralMatrix, Ordering, Permutation, SparseError, SparseMatrix};

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
    Symmetric(Box<Symmetric>),
    Lu(Box<Lu<u32, f64>>),
    Qr(Box<Qr<u32, f64>>),
}

/// Share of a probe's solution that may be wrong: more, and not even its leading digit can be trusted.
const PROBE_TOLERANCE: f64 = 0.1;

impl GeneralMatrix {
    /// Factors the matrix. The ordering counts for symmetric methods; LU and QR order their columns by COLAMD.
    ///
    /// # Errors
    /// [`SparseError::NotSquare`], [`SparseError::NotSymmetric`], [`SparseError::Underdetermined`] where the method does not
    /// take such a matrix; [`SparseError::Singular`], [`SparseError::NotPositiveDefinite`], [`SparseError::Undetermined`]
    /// where it has no solution; [`SparseError::OutOfMemory`].
    pub fn factor(&self, method: Method, ordering: &Ordering) -> Result<Factor, SparseError> {
        let kind = match method {
            Method::Auto if self.rows() != self.columns() => self.qr()?,
            Method::Auto => self.best(ordering)?,
            Method::Cholesky => cholesky(&self.symmetric()?, ordering)?,
            Method::SimplicialCholesky => symmetric(&self.symmetric()?, ordering, false)?,
            Method::Ldlt => symmetric(&self.symmetric()?, ordering, true)?,
            Method::Lu => self.lu()?,
            Method::Qr => self.qr()?,
        };
        let mut factor = Factor { rows: self.rows(), columns: self.columns(), kind };
        if !matches!(factor.kind, Kind::Cholesky(_)) {
            factor.probe(self)?;
        }
        Ok(factor)
    }

    fn best(&self, ordering: &Ordering) -> Result<Kind, SparseError> {
        if self.first_asymmetry().is_some() {
            return self.lu();
        }
        let a = self.symmetric()?;
        match cholesky(&a, ordering) {
            Err(SparseError::NotPositiveDefinite { .. }) => {}
            // Zeros on the diagonal look singular to Cholesky, and may be those of constraints.
            Err(SparseError::Singular { .. }) if a.n() > 1 => {}
            other => return other,
        }
        let kind = symmetric(&a, ordering, true)?;
        let mut factor = Factor { rows: a.n(), columns: a.n(), kind };
        if factor.probe(self).is_ok() { Ok(factor.kind) } else { self.lu() }
    }

    fn to_faer(&self) -> SparseColMat<u32, f64> {
        let (starts, rows, values) = self.parts();
        let (m, n) = (self.rows(), self.columns());
        let symbolic = SymbolicSparseColMat::new_checked(m, n, starts.to_vec(), None, rows.to_vec());
        SparseColMat::new(symbolic, values.to_vec())
    }

    fn lu(&self) -> Result<Kind, SparseError> {
        let n = self.square()?;
        let out_of_memory = || SparseError::OutOfMemory { unknowns: n };
        if let Some(unknown) = (0..n).find(|&j| self.column(j).len() == 0) {
            return Err(SparseError::Undetermined { unknown });
        }
        let a = self.to_faer();
        let symbolic = SymbolicLu::try_new(a.symbolic()).map_err(|_| out_of_memory())?;
        match Lu::try_new_with_symbolic(symbolic, a.as_ref()) {
            Ok(lu) => Ok(Kind::Lu(Box::new(lu))),
            Err(LuError::SymbolicSingular { index }) => Err(SparseError::Undetermined { unknown: index.min(n - 1) }),
            Err(LuError::Generic(_)) => Err(out_of_memory()),
        }
    }

    fn qr(&self) -> Result<Kind, SparseError> {
        let (rows, columns) = (self.rows(), self.columns());
        if rows < columns {
            return Err(SparseError::Underdetermined { rows, columns });
        }
        if let Some(unknown) = (0..columns).find(|&j| self.column(j).len() == 0) {
            return Err(SparseError::Undetermined { unknown });
        }
        let out_of_memory = |_| SparseError::OutOfMemory { unknowns: columns };
        let a = self.to_faer();
        let symbolic = SymbolicQr::try_new(a.symbolic()).map_err(out_of_memory)?;
        Ok(Kind::Qr(Box::new(Qr::try_new_with_symbolic(symbolic, a.as_ref()).map_err(out_of_memory)?)))
    }
}

fn cholesky(a: &SparseMatrix, ordering: &Ordering) -> Result<Kind, SparseError> {
    let mut cholesky = Cholesky::analyze(a.pattern(), ordering)?;
    cholesky.factor(a)?;
    Ok(Kind::Cholesky(Box::new(cholesky)))
}

/// A symmetric factorization other than the supernodal Cholesky.
#[derive(Debug)]
struct Symmetric {
    order: Permutation,
    symbolic: SymbolicCholesky<u32>,
    values: Vec<f64>,
    /// Off-diagonals of 2×2 pivots and the pivots' order, for `L D Lᵀ`.
    pivots: Option<(Vec<f64>, Vec<u32>, Vec<u32>)>,
}

fn symmetric(a: &SparseMatrix, ordering: &Ordering, indefinite: bool) -> Result<Kind, SparseError> {
    let n = a.n();
    let out_of_memory = || SparseError::OutOfMemory { unknowns: n };
    let order = Elimination::postordered(a.pattern(), &ordering.permutation(a.pattern())?).order;
    // Permuted by hand, upper triangle: with a permutation of its own the analysis would not keep ours postordered.
    let mut upper = super::SparseBuilder::new(n, n);
    for (i, j, s) in a.pattern().places() {
        let (i, j) = (order.new_from_old()[i] as usize, order.new_from_old()[j] as usize);
        upper.add_entry(i.min(j), i.max(j), a.values()[s]);
    }
    let upper = upper.build()?.to_faer();
    let threshold =
        if indefinite { SupernodalThreshold::FORCE_SUPERNODAL } else { SupernodalThreshold::FORCE_SIMPLICIAL };
    let params = CholeskySymbolicParams { supernodal_flop_ratio_threshold: threshold, ..Default::default() };
    let symbolic = factorize_symbolic_cholesky(upper.symbolic(), Side::Upper, SymmetricOrdering::Identity, params)
        .map_err(|_| out_of_memory())?;
    let mut values = vec![0.0; symbolic.len_val()];
    let (par, side) = (Par::Seq, Side::Upper);
    let llt = symbolic.factorize_numeric_llt_scratch::<f64>(par, Spec::default());
    let lblt = symbolic.factorize_numeric_intranode_lblt_scratch::<f64>(par, Spec::default());
    let mut memory = MemBuffer::try_new(StackReq::any_of(&[llt, lblt])).map_err(|_| out_of_memory())?;
    let stack = MemStack::new(&mut memory);
    let pivots = if indefinite {
        let (mut subdiagonal, mut forward, mut inverse) = (vec![0.0; n], vec![0_u32; n], vec![0_u32; n]);
        symbolic.factorize_numeric_intranode_lblt(
            &mut values,
            &mut subdiagonal,
            &mut forward,
            &mut inverse,
            upper.as_ref(),
            side,
            par,
            stack,
            Spec::default(),
        );
        Some((subdiagonal, forward, inverse))
    } else {
        let done = symbolic.factorize_numeric_llt(
            &mut values,
            upper.as_ref(),
            side,
            faer::linalg::cholesky::llt::factor::LltRegularization::default(),
            par,
            stack,
            Spec::default(),
        );
        if done.is_err() {
            // The supernodal one knows the component.
            return cholesky(a, ordering);
        }
        None
    };
    clear_upper_halves();
    Ok(Kind::Symmetric(Box::new(Symmetric { order, symbolic, values, pivots })))
}

impl Symmetric {
    fn solve(&self, b: &mut [f64]) {
        let n = self.order.len();
        let mut x: Vec<f64> = self.order.old_from_new().iter().map(|&old| b[old as usize]).collect();
        let mut memory = MemBuffer::new(self.symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
        let stack = MemStack::new(&mut memory);
        let rhs = MatMut::from_column_major_slice_mut(&mut x, n, 1);
        match &self.pivots {
            None => LltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(Conj::No, rhs, Par::Seq, stack),
            Some((subdiagonal, forward, inverse)) => {
                let pivots = PermRef::new_checked(forward, inverse, n);
                let factor = IntranodeLbltRef::new(&self.symbolic, &self.values, subdiagonal, pivots);
                factor.solve_in_place_with_conj(Conj::No, rhs, Par::Seq, stack);
            }
        }
        for (x, &old) in x.iter().zip(self.order.old_from_new()) {
            b[old as usize] = *x;
        }
    }
}

impl Factor {
    /// The method that was used in the end.
    pub fn method(&self) -> Method {
        match &self.kind {
            Kind::Cholesky(_) => Method::Cholesky,
            Kind::Symmetric(f) if f.pivots.is_none() => Method::SimplicialCholesky,
            Kind::Symmetric(_) => Method::Ldlt,
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
        let columns = b.len() / m;
        let mut x = b.to_vec();
        match &mut self.kind {
            Kind::Cholesky(cholesky) => cholesky.solve_in_place(&mut x),
            Kind::Symmetric(factor) => x.chunks_exact_mut(n).for_each(|x| factor.solve(x)),
            Kind::Lu(lu) => lu.solve_in_place(MatMut::from_column_major_slice_mut(&mut x, n, columns)),
            Kind::Qr(qr) => {
                qr.solve_lstsq_in_place(MatMut::from_column_major_slice_mut(&mut x, m, columns));
                x = x.chunks_exact(m).flat_map(|x| &x[..n]).copied().collect();
            }
        }
        clear_upper_halves();
        Ok(x)
    }

    /// Solves with the transposed matrix, for square ones; `None` for QR, which does not offer it.
    pub fn solve_transposed(&mut self, b: &[f64]) -> Option<Vec<f64>> {
        match &mut self.kind {
            Kind::Qr(_) => None,
            Kind::Lu(lu) => {
                let mut x = b.to_vec();
                lu.solve_transpose_in_place(MatMut::from_column_major_slice_mut(&mut x, self.rows, 1));
                clear_upper_halves();
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
