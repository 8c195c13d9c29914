//! Quadratic energies under linear equations, by elimination and by Lagrange multipliers.
//!
//! ```text
//! minimize ½ xᵀ A x − bᵀ x    s.t.  x_f = c          A_uu x_u = b_u − A_uf c
//!
//! minimize ½ xᵀ A x − bᵀ x    s.t.  C x = d          ⎡A Cᵀ⎤ ⎡x⎤   ⎡b⎤
//!                                                    ⎣C 0 ⎦ ⎣λ⎦ = ⎣d⎦
//! ```
//!
//! Elimination keeps the system definite, and smaller; it takes fixed values only. Multipliers take any equations and say
//! with `λ` the force of each constraint, at the price of an indefinite system.

use super::{Cholesky, Factor, GeneralMatrix, Method, Ordering, SparseBuilder, SparseError, SparseMatrix};
use crate::run::Run;

/// A symmetric positive definite system in which some unknowns are given.
#[derive(Debug)]
pub struct Eliminated {
    /// Reduced number of each free unknown.
    reduced: Vec<Option<u32>>,
    free: Vec<u32>,
    fixed: Vec<usize>,
    /// `A_uf` as `(free, fixed, value)`, both by their position in the lists.
    coupling: Vec<(u32, u32, f64)>,
    cholesky: Cholesky,
}

impl Eliminated {
    /// Factors `A_uu`; the set is fixed here, its values are given at [`Self::solve`], in the order of `fixed`.
    ///
    /// # Errors
    /// [`SparseError::OutOfRange`] for an unknown that does not exist or is fixed twice; [`SparseError::Singular`] with the
    /// numbers of `A` where the fixed ones leave a component unconstrained.
    pub fn new(a: &SparseMatrix, fixed: &[usize], ordering: &Ordering, run: &Run) -> Result<Self, SparseError> {
        let n = a.n();
        let mut position = vec![None; n];
        for (k, &f) in fixed.iter().enumerate() {
            let slot = position.get_mut(f).filter(|slot| slot.is_none());
            *slot.ok_or(SparseError::OutOfRange { index: f, unknowns: n })? = Some(k as u32);
        }
        let free: Vec<u32> = (0..n as u32).filter(|&i| position[i as usize].is_none()).collect();
        let mut reduced = vec![None; n];
        free.iter().zip(0..).for_each(|(&i, k)| reduced[i as usize] = Some(k));
        let (mut inner, mut coupling) = (Vec::new(), Vec::new());
        for (i, j, s) in a.pattern().entries() {
            let v = a.values()[s];
            match (reduced[i], reduced[j], position[i], position[j]) {
                (Some(i), Some(j), ..) => inner.push((i as usize, j as usize, v)),
                (Some(i), _, _, Some(f)) | (_, Some(i), Some(f), _) => coupling.push((i, f, v)),
                _ => {}
            }
        }
        let inner = SparseMatrix::from_triplets(free.len(), &inner)?;
        let mut cholesky = Cholesky::analyze(inner.pattern(), &ordering.restricted(&free, n)?)?;
        cholesky.factor(&inner, run).map_err(|error| error.renumbered(&free))?;
        Ok(Self { reduced, free, fixed: fixed.to_vec(), coupling, cholesky })
    }

    /// The minimizer for `b` (`n` values, those of fixed unknowns not read) and the fixed values.
    ///
    /// # Errors
    /// [`SparseError::Columns`].
    pub fn solve(&mut self, b: &[f64], values: &[f64]) -> Result<Vec<f64>, SparseError> {
        for (given, expected) in [(b.len(), self.reduced.len()), (values.len(), self.fixed.len())] {
            if given != expected {
                return Err(SparseError::Columns { given, expected });
            }
        }
        let mut rhs: Vec<f64> = self.free.iter().map(|&i| b[i as usize]).collect();
        for &(i, f, v) in &self.coupling {
            rhs[i as usize] -= v * values[f as usize];
        }
        self.cholesky.solve_in_place(&mut rhs);
        let mut x = vec![0.0; b.len()];
        self.free.iter().zip(&rhs).for_each(|(&i, &v)| x[i as usize] = v);
        self.fixed.iter().zip(values).for_each(|(&i, &v)| x[i] = v);
        Ok(x)
    }

    /// The factor of `A_uu`.
    pub fn cholesky(&self) -> &Cholesky {
        &self.cholesky
    }
}

/// A symmetric system under the equations `C x = d`.
#[derive(Debug)]
pub struct Multipliers {
    unknowns: usize,
    equations: usize,
    factor: Factor,
}

/// Where a constrained energy is least.
#[derive(Clone, Debug, PartialEq)]
pub struct Constrained {
    /// The minimizer.
    pub x: Vec<f64>,
    /// The multiplier of each equation: `A x + Cᵀ λ = b`.
    pub multipliers: Vec<f64>,
}

impl Multipliers {
    /// Factors the system for `C` (`k×n`). `A` must be definite where `C x = 0`, not everywhere.
    ///
    /// # Errors
    /// [`SparseError::Columns`] where `C` has another number of columns; [`SparseError::Undetermined`] where equations repeat
    /// each other (its unknown counts the multipliers after the unknowns) or leave something free.
    pub fn new(a: &SparseMatrix, c: &GeneralMatrix, run: &Run) -> Result<Self, SparseError> {
        let (n, k) = (a.n(), c.rows());
        if c.columns() != n {
            return Err(SparseError::Columns { given: c.columns(), expected: n });
        }
        let mut all = SparseBuilder::new(n + k, n + k);
        for (i, j, v) in GeneralMatrix::from(a).entries() {
            all.add_entry(i, j, v);
        }
        for (i, j, v) in c.entries() {
            all.add_entry(n + i, j, v).add_entry(j, n + i, v);
        }
        let factor = all.build()?.factor(Method::Auto, &Ordering::Amd, run)?;
        Ok(Self { unknowns: n, equations: k, factor })
    }

    /// The minimizer for one right-hand side of both.
    ///
    /// # Errors
    /// [`SparseError::Columns`].
    pub fn solve(&mut self, b: &[f64], d: &[f64]) -> Result<Constrained, SparseError> {
        for (given, expected) in [(b.len(), self.unknowns), (d.len(), self.equations)] {
            if given != expected {
                return Err(SparseError::Columns { given, expected });
            }
        }
        let mut x = self.factor.solve(&[b, d].concat())?;
        let multipliers = x.split_off(self.unknowns);
        Ok(Constrained { x, multipliers })
    }

    /// The factorization that took the system: `L D Lᵀ`, or LU.
    pub fn method(&self) -> Method {
        self.factor.method()
    }
}
