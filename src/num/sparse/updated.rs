//! A factored system to which weighted constraints are added and from which they are taken.
//!
//! ```text
//! A′ = A + U S Uᵀ      S = diag(sₖ),  U = (u₁ … uᵣ) sparse rows
//! A′⁻¹ b = x − Z (S⁻¹ + Uᵀ Z)⁻¹ Uᵀ x,      x = A⁻¹ b,   Z = A⁻¹ U      (Sherman, Morrison, Woodbury)
//! ```
//!
//! A constraint `w (uᵀx − t)²` adds `w u uᵀ` to the matrix; taking it away adds the same with `−w`. Each change costs one solve
//! (a column of `Z`) where refactoring costs a factorization, but every later solve pays `4 n` for each column of `Z`.
//! In multiplications, with `r` changes pending:
//!
//! ```text
//! one more change   4 nnz(L) + 2 n r            refactoring   Σ cⱼ² (+ analysis, where the pattern grows)
//! ```
//!
//! The system refactors where the changes pending have cost as much as a factorization would, or where their total
//! per solve passes a solve's own cost, `4 n r > 4 nnz(L)`. Removing its last constraint leaves the system singular: the inner
//! matrix is then singular too, the system is refactored and the component named.
//!
//! # Reference
//! W. W. Hager, *Updating the inverse of a matrix*, SIAM Review 31 (1989).

use nalgebra::{DMatrix, DVector};

use super::{Cholesky, Ordering, SparseError, SparseMatrix};
use crate::run::Run;

/// Multiplications that analysis costs for each entry of the factor: ordering dominates, as measured on surfaces of 10⁴ to
/// 10⁶ unknowns, where it takes 1 to 3 times the numeric factorization of minimum degree.
const ANALYSIS_PER_ENTRY: f64 = 100.0;

/// One weighted row: `s u uᵀ`.
#[derive(Clone, Debug)]
struct Change {
    terms: Vec<(usize, f64)>,
    weight: f64,
    /// `A⁻¹ u`.
    solved: Vec<f64>,
}

/// A system under changing constraints.
///
/// ```
/// use plumbline_num::run::Run;
/// use plumbline_num::sparse::{Ordering, SparseMatrix, Updated};
///
/// // A chain of three, fixed softly at its first unknown; a second constraint `4 (x₂ − 1)²` comes and goes.
/// let chain = [(0, 0, 2.0), (1, 1, 2.0), (2, 2, 1.0), (1, 0, -1.0), (2, 1, -1.0)];
/// let mut system = Updated::new(SparseMatrix::from_triplets(3, &chain)?, Ordering::Amd, &Run::default())?;
/// system.add(&[(2, 1.0)], 4.0, &Run::default())?;
/// let mut x = [0.0, 0.0, 4.0];
/// system.solve(&mut x);
/// assert!((x[2] - 12.0 / 13.0).abs() < 1e-12 && (x[0] - x[1] / 2.0).abs() < 1e-12);
/// system.add(&[(2, 1.0)], -4.0, &Run::default())?;
/// let mut x = [1.0, 0.0, 0.0];
/// system.solve(&mut x);
/// assert!(x.iter().all(|x| (x - 1.0).abs() < 1e-12));
/// # Ok::<(), plumbline_num::sparse::SparseError>(())
/// ```
#[derive(Debug)]
pub struct Updated {
    ordering: Ordering,
    base: SparseMatrix,
    cholesky: Cholesky,
    pending: Vec<Change>,
    /// `S⁻¹ + Uᵀ Z`, factored.
    inner: Option<nalgebra::LU<f64, nalgebra::Dyn, nalgebra::Dyn>>,
    spent: f64,
    refactorizations: usize,
    /// Rows taken away so far, to name the one that leaves no minimum.
    subtracted: usize,
}

impl Updated {
    /// Factors the system as it is.
    ///
    /// # Errors
    /// As [`Cholesky::factor`].
    pub fn new(a: SparseMatrix, ordering: Ordering, run: &Run) -> Result<Self, SparseError> {
        let mut cholesky = Cholesky::analyze(a.pattern(), &ordering)?;
        cholesky.factor(&a, run)?;
        Ok(Self {
            ordering,
            base: a,
            cholesky,
            pending: Vec::new(),
            inner: None,
            spent: 0.0,
            refactorizations: 0,
            subtracted: 0,
        })
    }

    /// Number of unknowns.
    pub fn n(&self) -> usize {
        self.base.n()
    }

    /// Changes not yet in the factor.
    pub fn pending(&self) -> usize {
        self.pending.len()
    }

    /// How often the system was factored anew.
    pub fn refactorizations(&self) -> usize {
        self.refactorizations
    }

    /// Adds `weight · (Σ a x)²` to the energy, that is `weight · a aᵀ` to the matrix; a negative weight takes a term away.
    ///
    /// # Errors
    /// [`SparseError::OutOfRange`], [`SparseError::Weight`] for bad input; [`SparseError::Subtracted`] where what remains has no
    /// minimum. After an error nothing has changed.
    pub fn add(&mut self, terms: &[(usize, f64)], weight: f64, run: &Run) -> Result<(), SparseError> {
        let n = self.n();
        if let Some(&(index, _)) = terms.iter().find(|&&(i, _)| i >= n) {
            return Err(SparseError::OutOfRange { index, unknowns: n });
        }
        if !(weight.is_finite() && terms.iter().all(|(_, a)| a.is_finite())) {
            return Err(SparseError::Weight { row: self.pending.len(), weight });
        }
        if weight != 0.0 && !terms.is_empty() {
            self.apply(terms, weight, run)
                .map_err(|e| if weight < 0.0 { e.subtracting(self.subtracted) } else { e })?;
        }
        self.subtracted += usize::from(weight < 0.0);
        Ok(())
    }

    fn apply(&mut self, terms: &[(usize, f64)], weight: f64, run: &Run) -> Result<(), SparseError> {
        let n = self.n();
        let mut change = Change { terms: terms.to_vec(), weight, solved: vec![0.0; n] };
        let update = 4.0 * self.cholesky.nnz() as f64 + 2.0 * (n * self.pending.len()) as f64;
        let lasting = n * (self.pending.len() + 1) > self.cholesky.nnz();
        if self.spent + update > self.cost_of_refactoring(&change) || lasting {
            return self.refactor_with(&change, run);
        }
        change.terms.iter().for_each(|&(i, a)| change.solved[i] += a);
        self.cholesky.solve_in_place(&mut change.solved);
        self.pending.push(change);
        if self.factor_inner() {
            self.spent += update;
            return Ok(());
        }
        let Some(change) = self.pending.pop() else { return Ok(()) };
        self.refactor_with(&change, run)
    }

    fn cost_of_refactoring(&self, change: &Change) -> f64 {
        let changes = self.pending.iter().chain([change]);
        let grows = changes.flat_map(pairs).any(|(i, j, _)| self.base.pattern().slot(i, j).is_none());
        self.cholesky.flops() + if grows { ANALYSIS_PER_ENTRY * self.cholesky.nnz() as f64 } else { 0.0 }
    }

    /// Factors `S⁻¹ + Uᵀ Z`; false where it is singular, or `A′` no longer positive definite, by the sign of its determinant:
    /// `det A′ = det A · det S · det(S⁻¹ + Uᵀ Z)`, and each change moves at most one eigenvalue past zero.
    fn factor_inner(&mut self) -> bool {
        let r = self.pending.len();
        let inner = DMatrix::from_fn(r, r, |p, q| {
            let product: f64 = self.pending[p].terms.iter().map(|&(i, a)| a * self.pending[q].solved[i]).sum();
            product + if p == q { 1.0 / self.pending[p].weight } else { 0.0 }
        });
        let scale = inner
            .diagonal()
            .abs()
            .zip_map(&DVector::from_iterator(r, self.pending.iter().map(|c| 1.0 / c.weight.abs())), f64::max);
        // `1 + s uᵀ A⁻¹ u` near zero: removing the change leaves nothing in some direction.
        let sound = (0..r).all(|k| inner[(k, k)].abs() > MIN_PIVOT * scale[k]);
        let lu = inner.lu();
        let u = lu.u();
        let definite = lu.determinant() * self.pending.iter().map(|c| c.weight.signum()).product::<f64>() > 0.0;
        let kept = sound && definite && (0..r).all(|k| u[(k, k)].abs() > MIN_PIVOT * scale[k]);
        if kept {
            self.inner = Some(lu);
        }
        kept
    }

    /// Puts all changes into the matrix and factors it; on failure all stays as it was.
    fn refactor_with(&mut self, change: &Change, run: &Run) -> Result<(), SparseError> {
        let changes = || self.pending.iter().chain([change]).flat_map(pairs);
        let mut triplets: Vec<(usize, usize, f64)> =
            self.base.pattern().entries().map(|(i, j, s)| (i, j, self.base.values()[s])).collect();
        triplets.extend(changes());
        let base = SparseMatrix::from_triplets(self.n(), &triplets)?;
        let mut cholesky = Cholesky::analyze(base.pattern(), &self.ordering)?;
        cholesky.factor(&base, run)?;
        (self.base, self.cholesky, self.inner) = (base, cholesky, None);
        self.pending.clear();
        self.spent = 0.0;
        self.refactorizations += 1;
        Ok(())
    }

    /// Replaces `b` by the solution of the system with all changes.
    pub fn solve(&mut self, b: &mut [f64]) {
        self.cholesky.solve_in_place(b);
        let Some(inner) = &self.inner else { return };
        for x in b.chunks_exact_mut(self.base.n()) {
            let along = |c: &Change| c.terms.iter().map(|&(i, a)| a * x[i]).sum::<f64>();
            let mut coefficients = DVector::from_iterator(self.pending.len(), self.pending.iter().map(along));
            inner.solve_mut(&mut coefficients);
            for (change, c) in self.pending.iter().zip(coefficients.iter()) {
                x.iter_mut().zip(&change.solved).for_each(|(x, z)| *x -= c * z);
            }
        }
    }
}

/// Below this fraction of its terms a pivot of the inner matrix has lost half of its digits to cancellation: the system is factored anew.
/// Larger refactors where the update was precise enough, smaller returns solutions of few digits.
const MIN_PIVOT: f64 = 1e-8;

/// Entries of `s u uᵀ`, lower triangle; equal unknowns in `u` meet on the diagonal.
fn pairs(change: &Change) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
    change.terms.iter().enumerate().flat_map(move |(k, &(i, a))| {
        change.terms[..=k].iter().enumerate().map(move |(l, &(j, b))| {
            let twice = if l < k && i == j { 2.0 } else { 1.0 };
            (i.max(j), i.min(j), twice * change.weight * a * b)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fixed_grid(side: usize) -> SparseMatrix {
        let mut triplets = vec![(0, 0, 1.0)];
        for i in 0..side * side {
            let mut edge = |j: usize| triplets.extend([(i, i, 1.0), (j, j, 1.0), (i, j, -1.0)]);
            if i % side > 0 {
                edge(i - 1);
            }
            if i >= side {
                edge(i - side);
            }
        }
        SparseMatrix::from_triplets(side * side, &triplets).expect("in range")
    }

    fn with(a: &SparseMatrix, changes: &[(Vec<(usize, f64)>, f64)]) -> SparseMatrix {
        let mut triplets: Vec<_> = a.pattern().entries().map(|(i, j, s)| (i, j, a.values()[s])).collect();
        for (terms, weight) in changes {
            triplets.extend(pairs(&Change { terms: terms.clone(), weight: *weight, solved: Vec::new() }));
        }
        SparseMatrix::from_triplets(a.n(), &triplets).expect("in range")
    }

    #[test]
    fn a_changed_system_solves_as_one_made_with_the_changes() {
        let a = fixed_grid(25);
        let mut updated = Updated::new(a.clone(), Ordering::Amd, &Run::default()).expect("constrained");
        let mut changes: Vec<(Vec<(usize, f64)>, f64)> = Vec::new();
        let b: Vec<f64> = (0..625).map(|i| f64::from(i).cos()).collect();
        for k in 0..40 {
            let terms = match k % 4 {
                0 => vec![(37 * k % 625, 1.0)],
                1 => vec![(31 * k % 625, 1.0), ((31 * k + 300) % 625, -1.0)],
                2 => vec![(5 * k, 1.0), (5 * k, 0.5), (7 * k, 2.0)],
                _ => changes[changes.len() - 3].0.clone(),
            };
            let weight = if k % 4 == 3 { -changes[changes.len() - 3].1 } else { 1.0 + f64::from(k as u32) };
            updated.add(&terms, weight, &Run::default()).expect("stays constrained");
            changes.push((terms, weight));
            let mut x = b.clone();
            updated.solve(&mut x);
            let mut r = vec![0.0; 625];
            with(&a, &changes).residual(&x, &b, &mut r);
            let worst = r.iter().fold(0.0, |m: f64, r| m.max(r.abs()));
            assert!(worst < 1e-8, "change {k}: {worst}");
        }
        assert!(updated.refactorizations() > 0 && updated.pending() > 0, "{updated:?}");
    }

    #[test]
    fn taking_away_what_holds_a_system_is_refused_and_changes_nothing() {
        let mut updated = Updated::new(fixed_grid(12), Ordering::Amd, &Run::default()).expect("constrained");
        let error = updated.add(&[(0, 1.0)], -1.0, &Run::default()).expect_err("floats");
        assert!(
            matches!(&error, SparseError::Subtracted { row: 0, component } if component.unknowns.len() == 144),
            "{error}"
        );
        updated.add(&[(3, 1.0)], 2.0, &Run::default()).expect("added");
        updated.add(&[(3, 1.0)], -2.0, &Run::default()).expect("taken away again");
        let error = updated.add(&[(0, 1.0)], -2.0, &Run::default()).expect_err("indefinite");
        assert!(error.to_string().starts_with("subtracting row 1 "), "{error}");
        assert!(matches!(
            updated.add(&[(144, 1.0)], 1.0, &Run::default()),
            Err(SparseError::OutOfRange { index: 144, .. })
        ));
        assert!(matches!(updated.add(&[(3, 1.0)], f64::NAN, &Run::default()), Err(SparseError::Weight { .. })));
        let mut x = vec![0.0; 144];
        x[0] = 1.0;
        updated.solve(&mut x);
        assert!(x.iter().all(|x| (x - 1.0).abs() < 1e-10), "still constrained at its first unknown");
    }

    #[test]
    fn a_held_place_may_move_from_one_end_to_the_other() {
        let mut updated = Updated::new(fixed_grid(12), Ordering::Amd, &Run::default()).expect("constrained");
        updated.add(&[(143, 1.0)], 5.0, &Run::default()).expect("constrained twice");
        updated.add(&[(0, 1.0)], -1.0, &Run::default()).expect("constrained at the other end");
        let mut x = vec![0.0; 144];
        x[143] = 10.0;
        updated.solve(&mut x);
        assert!(x.iter().all(|x| (x - 2.0).abs() < 1e-8), "{:?}", &x[..3]);
    }
}
