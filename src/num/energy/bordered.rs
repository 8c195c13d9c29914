//! A sparse energy with a border: a few unknowns that rows of many elements share.
//!
//! ```text
//! E(u, q) = Σ w |a·u + c·q − b|²,       [ K  B ] [u]   [r]
//!                                       [ Bᵀ D ] [q] = [d]
//! ```
//!
//! `u` are the sparse unknowns, coupled within elements alone, `q` the border: offsets of lines, similarities of groups. In a
//! common factor a border of `m` unknowns fills most of `m` rows, and its pattern changes with the elements it meets. Here
//! only `K` is factored, whose pattern does not know the border; the border is solved for by its Schur complement:
//!
//! ```text
//! S = D − Bᵀ K⁻¹ B,      S q = d − Bᵀ K⁻¹ r,      K u = r − B q
//! ```
//!
//! With `P K Pᵀ = L Lᵀ`, `Bᵀ K⁻¹ B = Yᵀ Y` where `L Y = P B`: half of a solve for each column of the border, and less where it
//! meets few elements.
//!
//! So a border of another size, or one that meets other elements, costs no new analysis. `K` alone is the energy
//! with `q = 0`; it is positive definite wherever the whole is.

use std::ops::Range;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::{EnergyError, Ordering, QuadraticEnergy};
use crate::run::Run;
use crate::sparse::{SparseError, subtract_inner_products};

/// Values of the columns of the border that are held at once, 64 MB: a border of 800 on ten thousand unknowns.
const MOST: usize = 8 << 20;

/// A sum of squares over fixed elements and a border that is free to change.
#[derive(Debug)]
pub struct BorderedEnergy {
    inner: QuadraticEnergy,
    /// `B`: entries of each column.
    columns: Vec<Vec<(u32, f64)>>,
    /// `D`.
    corner: DMatrix<f64>,
    /// `d`.
    corner_rhs: DVector<f64>,
    /// Factor of `S`; none before the first [`Self::minimize`], nor for an empty border.
    schur: Option<Cholesky<f64, Dyn>>,
    /// `q`.
    border: Vec<f64>,
    solution: Vec<f64>,
}

impl BorderedEnergy {
    /// The zero energy of `n` unknowns that `elements` may couple, as in [`QuadraticEnergy::new`]; no border yet.
    ///
    /// # Errors
    /// As [`QuadraticEnergy::new`].
    pub fn new<'a>(
        n: usize,
        elements: impl Iterator<Item = &'a [usize]> + Clone,
        ordering: &Ordering,
    ) -> Result<Self, EnergyError> {
        let inner = QuadraticEnergy::new(n, elements, ordering)?;
        let (corner, corner_rhs) = (DMatrix::zeros(0, 0), DVector::zeros(0));
        let (border, columns, solution) = (Vec::new(), Vec::new(), vec![0.0; n]);
        Ok(Self { inner, columns, corner, corner_rhs, schur: None, border, solution })
    }

    /// Forgets all terms; the border has `border` unknowns from now on.
    pub fn clear(&mut self, border: usize) {
        self.inner.clear();
        self.columns.iter_mut().for_each(Vec::clear);
        self.columns.resize(border, Vec::new());
        self.corner = DMatrix::zeros(border, border);
        self.corner_rhs = DVector::zeros(border);
        self.border.resize(border, 0.0);
    }

    /// Adds `w |Σⱼ aⱼ uⱼ − b|²` over the unknowns of an element.
    #[inline]
    pub fn add(&mut self, element: usize, w: f64, coefficients: &[f64], b: f64) {
        self.inner.add(element, w, coefficients, b);
    }

    /// Adds a quadratic form over an element's unknowns, as [`QuadraticEnergy::add_form`].
    #[inline]
    pub fn add_form(&mut self, element: usize, block: &[f64]) {
        self.inner.add_form(element, block);
    }

    /// Adds `w |uᵢ − b|²` for every sparse unknown and `w |qᵢ|²` for every one of the border.
    pub fn add_everywhere(&mut self, w: f64, b: f64) {
        self.inner.add_everywhere(w, b);
        for k in 0..self.columns.len() {
            self.corner[(k, k)] += w;
        }
    }

    /// Adds `w |Σⱼ aⱼ uⱼ + Σₖ cₖ qₖ − b|²`; `shared` lists the border's unknowns with their coefficients.
    pub fn add_shared(&mut self, element: usize, w: f64, coefficients: &[f64], shared: &[(usize, f64)], b: f64) {
        self.inner.add(element, w, coefficients, b);
        for &(k, c) in shared {
            let unknowns = self.inner.unknowns_of(element).iter().zip(coefficients);
            self.columns[k].extend(unknowns.filter(|(_, a)| **a != 0.0).map(|(&i, a)| (i, w * c * a)));
            self.corner_rhs[k] += w * c * b;
            for &(l, other) in shared {
                self.corner[(k, l)] += w * c * other;
            }
        }
    }

    /// The sparse part of the minimizer of what has been added since [`Self::clear`].
    ///
    /// # Errors
    /// [`EnergyError::Solve`] where the terms leave something free or are not finite, [`EnergyError::Interrupted`].
    pub fn minimize(&mut self, run: &Run) -> Result<&[f64], EnergyError> {
        self.inner.factor(run)?;
        self.schur = None;
        if !self.columns.is_empty() {
            let n = self.solution.len();
            let singular = || EnergyError::Solve(SparseError::Pivot { unknown: n });
            let group = (MOST / n.max(1)).max(1);
            self.schur = Some(self.schur_complement(group, run)?.cholesky().ok_or_else(singular)?);
        }
        let mut solution = self.inner.rhs().to_vec();
        let border = self.solve(&mut solution, &self.corner_rhs.clone());
        self.border.copy_from_slice(border.as_slice());
        self.solution = solution;
        Ok(&self.solution)
    }

    /// The sparse part of the answer to a right-hand side `r` over the sparse unknowns other than the terms' own, `d = 0`;
    /// the terms must not have changed since [`Self::minimize`].
    pub fn response(&mut self, r: &[f64]) -> Vec<f64> {
        let mut u = r.to_vec();
        self.solve(&mut u, &DVector::zeros(self.columns.len()));
        u
    }

    /// Replaces `r` by `u`, and gives `q`.
    fn solve(&mut self, r: &mut [f64], d: &DVector<f64>) -> DVector<f64> {
        let Some(schur) = &self.schur else {
            self.inner.solve_in_place(r);
            return DVector::zeros(0);
        };
        let mut without = r.to_vec();
        self.inner.solve_in_place(&mut without);
        let meets = self.columns.iter().map(|column| dot(column, &without));
        let border = schur.solve(&(d - DVector::from_iterator(d.len(), meets)));
        for (column, q) in self.columns.iter().zip(border.iter()) {
            for &(i, b) in column {
                r[i as usize] -= b * q;
            }
        }
        self.inner.solve_in_place(r);
        border
    }

    /// `S = D − Yᵀ Y` with `Y = L⁻¹ P B`, lower triangle, by groups of so many columns.
    fn schur_complement(&mut self, group: usize, run: &Run) -> Result<DMatrix<f64>, EnergyError> {
        let (n, m) = (self.solution.len(), self.columns.len());
        let mut schur = self.corner.clone();
        let (mut first, mut second) = (Vec::new(), Vec::new());
        for k in (0..m).step_by(group) {
            let own = k..m.min(k + group);
            self.half_solved(own.clone(), &mut first, run)?;
            for l in (k..m).step_by(group) {
                let other = l..m.min(l + group);
                if l > k {
                    self.half_solved(other.clone(), &mut second, run)?;
                }
                let rows = (other, if l > k { &second[..] } else { &first });
                subtract_inner_products((schur.as_mut_slice(), m), rows, (own.clone(), &first), n);
            }
        }
        Ok(schur)
    }

    /// Columns of `Y`.
    fn half_solved(&mut self, columns: Range<usize>, y: &mut Vec<f64>, run: &Run) -> Result<(), EnergyError> {
        let n = self.solution.len();
        y.clear();
        y.resize(columns.len() * n, 0.0);
        for (column, dense) in self.columns[columns].iter().zip(y.chunks_exact_mut(n)) {
            run.check()?;
            for &(i, b) in column {
                dense[i as usize] += b;
            }
            self.inner.half_solve_in_place(dense);
        }
        Ok(())
    }

    /// The border's part of the last minimizer.
    pub fn border(&self) -> &[f64] {
        &self.border
    }
}

fn dot(column: &[(u32, f64)], dense: &[f64]) -> f64 {
    column.iter().map(|&(i, b)| b * dense[i as usize]).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chain of points and two springs' ends that it shares: as one sparse system, and with the ends as the border.
    #[test]
    fn a_border_gives_the_minimizer_of_the_whole() {
        let (n, shared) = (40, 35);
        let mut rng = fastrand::Rng::with_seed(4);
        let rows: Vec<(usize, [f64; 2], [f64; 2], f64)> =
            (0..60).map(|k| (k % (n - 1), [rng.f64(), -rng.f64()], [rng.f64(), rng.f64() - 0.5], rng.f64())).collect();
        let whole: Vec<Vec<usize>> = (0..n - 1).map(|i| (i..i + 2).chain(n..n + shared).collect()).collect();
        let mut reference =
            QuadraticEnergy::new(n + shared, whole.iter().map(Vec::as_slice), &Ordering::Amd).expect("elements");
        let parts: Vec<[usize; 2]> = (0..n - 1).map(|i| [i, i + 1]).collect();
        let mut bordered =
            BorderedEnergy::new(n, parts.iter().map(<[usize; 2]>::as_slice), &Ordering::Amd).expect("elements");
        for border in [2, shared, 0, 3] {
            reference.clear();
            bordered.clear(border);
            reference.add_everywhere(1e-3, 0.0);
            bordered.add_everywhere(1e-3, 0.0);
            for (k, (element, a, c, b)) in rows.iter().enumerate() {
                let meets: Vec<(usize, f64)> =
                    if border == 0 { Vec::new() } else { vec![(k % border, c[0]), ((k + 1) % border, c[1])] };
                let mut row = vec![0.0; 2 + shared];
                row[..2].copy_from_slice(a);
                for (q, c) in &meets {
                    row[2 + q] += c;
                }
                reference.add(*element, 2.0, &row, *b);
                bordered.add_shared(*element, 2.0, a, &meets, *b);
            }
            let x = reference.minimize(&Run::default()).expect("constrained").to_vec();
            let u = bordered.minimize(&Run::default()).expect("constrained").to_vec();
            let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
            assert!(near(&x[..n], &u) && near(&x[n..n + border], bordered.border()), "a border of {border}");
            let whole = bordered.schur_complement(border.max(1), &Run::default()).expect("never stops");
            for group in [1, 2, 4] {
                let parts = bordered.schur_complement(group, &Run::default()).expect("never stops");
                let off = (&whole - parts).lower_triangle().abs();
                assert!(off.iter().all(|x| *x < 1e-12), "a border of {border} in groups of {group}");
            }
            // Superposition: a target that one more term has is answered by the response to it.
            let mut unit = vec![0.0; n];
            unit[7] = 0.5;
            let response = bordered.response(&unit);
            bordered.add(7, 1e-20, &[1.0, 0.0], 0.5e20);
            let both = bordered.minimize(&Run::default()).expect("constrained").to_vec();
            let sum: Vec<f64> = u.iter().zip(&response).map(|(u, r)| u + r).collect();
            assert!(near(&both, &sum), "a border of {border}");
        }
    }

    #[test]
    fn an_unconstrained_border_is_refused() {
        let parts = [[0_usize, 1]];
        let mut energy =
            BorderedEnergy::new(2, parts.iter().map(<[usize; 2]>::as_slice), &Ordering::Amd).expect("elements");
        energy.clear(1);
        energy.add(0, 1.0, &[1.0, 0.0], 1.0);
        energy.add(0, 1.0, &[0.0, 1.0], 1.0);
        assert!(matches!(energy.minimize(&Run::default()), Err(EnergyError::Solve(SparseError::Pivot { unknown: 2 }))));
    }
}
