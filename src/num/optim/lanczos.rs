//! The lowest eigenpairs of a sparse symmetric pencil, by shift-invert block Lanczos.
//!
//! ```text
//! A x = λ M x,     A symmetric positive semidefinite,  M = diag(m), m > 0
//! C = M^{½} (A + σM)⁻¹ M^{½},     C y = θ y,     λ = 1/θ − σ,   x = M^{−½} y
//! ```
//!
//! The lowest `λ` are the greatest `θ`, and far apart there. A Krylov space of `C` is built block by block, every new vector
//! made orthogonal to *all* before it (twice, which is enough); the projection of `C` onto it is solved densely. Blocks find
//! eigenvalues that coincide, which one vector at a time would not; shapes with symmetries have them. When the space
//! is full it is begun again with the best vectors found (thick restart). Known eigenvectors, such as those of a null
//! space, are kept out of the space altogether.
//!
//! # Reference
//! R. Grimes, J. Lewis, H. Simon, *A shifted block Lanczos algorithm for solving sparse symmetric generalized eigenproblems*,
//! SIAM J. Matrix Anal. Appl. 15 (1994); K. Wu, H. Simon, *Thick-restart Lanczos method for large symmetric eigenvalue
//! problems*, SIAM J. Matrix Anal. Appl. 22 (2000).

mod space;

pub use space::KnownVectors;

use crate::math::norm;
use crate::run::{Run, Stopped};
use crate::sparse::{CompactFactor, SparseMatrix};
use space::{Space, scale, subtract};

/// Vectors per block: as many equal eigenvalues as rotations about an axis and mirrors bring, twice over. Solves with four
/// right-hand sides cost little more than two with one.
const BLOCK: usize = 4;

/// How far to go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LanczosOptions {
    /// Residual under which a pair is accepted, > 0 (see [`Eigenpairs::residuals`]).
    pub tolerance: f64,
    /// Maximum number of blocks, all restarts together, ≥ 1.
    pub max_blocks: usize,
    /// Seed of the first block.
    pub seed: u64,
}

impl Default for LanczosOptions {
    fn default() -> Self {
        Self { tolerance: 1e-6, max_blocks: 400, seed: 0 }
    }
}

/// Eigenpairs, lowest first.
#[derive(Clone, Debug, PartialEq)]
pub struct Eigenpairs {
    /// `λ`, ascending.
    pub values: Vec<f64>,
    /// `x`, with `xᵀ M x = 1`, orthogonal in `M`.
    pub vectors: Vec<Vec<f64>>,
    /// `‖(λ + σ) C y − y‖` of each, `y` a unit: how far `1/(λ + σ)` may be off, relatively. (The residual of `A` itself drowns
    /// in the rounding of its greatest eigenvalues.)
    pub residuals: Vec<f64>,
    /// Known vectors that were left out: those independent of the others.
    pub known: usize,
    /// Solves with the factor, one vector each.
    pub solves: usize,
    /// Whether all residuals met the tolerance.
    pub converged: bool,
}

/// A pencil with a factor of `A + σM`.
pub struct ShiftedPencil<'a> {
    /// `A`.
    pub matrix: &'a SparseMatrix,
    /// `m`, > 0.
    pub mass: &'a [f64],
    /// `σ`, > 0.
    pub shift: f64,
    /// Factor of `A + σM`: there are a hundred solves.
    pub factor: &'a mut CompactFactor,
    /// Eigenvectors that are not asked for. Supports of different groups are disjoint.
    pub known: &'a [KnownVectors],
}

impl ShiftedPencil<'_> {
    /// The `count` lowest eigenpairs but for the known ones; fewer where the pencil has no more.
    ///
    /// # Errors
    /// [`Stopped`].
    ///
    /// # Panics
    /// Where lengths differ, or a mass or the shift is not positive.
    pub fn lowest(&mut self, count: usize, options: &LanczosOptions, run: &Run) -> Result<Eigenpairs, Stopped> {
        let n = self.matrix.n();
        assert!(self.mass.len() == n && self.factor.n() == n, "one mass per unknown, one factor");
        assert!(self.mass.iter().all(|&m| m > 0.0) && self.shift > 0.0, "positive masses and shift");
        let roots: Vec<f64> = self.mass.iter().map(|m| m.sqrt()).collect();
        let mut space = Space::new(n, &roots, self.known, options.seed);
        let count = count.min(n - space.known());
        let largest = (2 * count + 6 * BLOCK).min(n - space.known());
        let mut block = space.random_block(count.min(BLOCK));
        let mut blocks = 0;
        while count > 0 && blocks < options.max_blocks {
            run.step(blocks as f64 / options.max_blocks as f64)?;
            // Extend the space by the block and its image under `C`.
            let width = block.len();
            space.take(&mut block);
            let mut image: Vec<Vec<f64>> = space.basis[space.basis.len() - width..].to_vec();
            self.apply(&roots, &mut image);
            block = space.project(image);
            blocks += 1;
            // Ritz pairs: always where the space is full, else after every third block.
            let full = space.basis.len() + block.len() > largest || block.is_empty();
            let ritz = if full || blocks % 3 == 0 { Some(space.ritz(&block)) } else { None };
            let Some(ritz) = ritz else { continue };
            if space.basis.len() >= count && ritz.errors[..count].iter().all(|e| *e <= 0.1 * options.tolerance)
                || block.is_empty() && !space.widen(&mut block)
            {
                break;
            }
            // Thick restart: keep the best vectors.
            if full && space.basis.len() > count + BLOCK {
                space.restart(&ritz, count + BLOCK);
            }
        }
        run.check()?;
        Ok(self.pairs(&space, &roots, count, options.tolerance))
    }

    /// `C y` for each vector.
    fn apply(&mut self, roots: &[f64], vectors: &mut [Vec<f64>]) {
        let mut columns: Vec<f64> = vectors.iter().flat_map(|y| y.iter().zip(roots).map(|(y, r)| y * r)).collect();
        self.factor.solve_columns(&mut columns);
        for (y, column) in vectors.iter_mut().zip(columns.chunks_exact(roots.len())) {
            for ((y, c), r) in y.iter_mut().zip(column).zip(roots) {
                *y = c * r;
            }
        }
    }

    fn pairs(&mut self, space: &Space, roots: &[f64], count: usize, tolerance: f64) -> Eigenpairs {
        let count = count.min(space.basis.len());
        let mut found = Eigenpairs {
            values: vec![],
            vectors: vec![],
            residuals: vec![],
            known: space.known(),
            solves: space.solves,
            converged: true,
        };
        if count == 0 {
            return found;
        }
        let ritz = space.ritz(&[]);
        for y in space.combined(&ritz, count) {
            let x: Vec<f64> = y.iter().zip(roots).map(|(y, r)| y / r).collect();
            let mut image = vec![0.0; x.len()];
            self.matrix.multiply(&x, &mut image);
            // Rayleigh's quotient: twice the digits of the vector.
            let value: f64 = x.iter().zip(&image).map(|(x, a)| x * a).sum();
            found.values.push(value);
            found.vectors.push(x);
        }
        self.measure(&mut found, roots);
        found.converged = found.residuals.iter().all(|r| *r <= tolerance);
        found
    }

    /// Residuals of the pairs found.
    fn measure(&mut self, found: &mut Eigenpairs, roots: &[f64]) {
        let unit = |x: &Vec<f64>| x.iter().zip(roots).map(|(x, r)| x * r).collect::<Vec<f64>>();
        let mut images: Vec<Vec<f64>> = found.vectors.iter().map(unit).collect();
        self.apply(roots, &mut images);
        for ((x, image), value) in found.vectors.iter().zip(&mut images).zip(&found.values) {
            scale(image, value + self.shift);
            subtract(image, &unit(x), 1.0);
            found.residuals.push(norm(image));
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, SymmetricEigen};

    use super::*;
    use crate::sparse::Ordering;

    /// The Laplacian of a ring of `n` plus a diagonal, with its factor after a shift.
    fn pencil(n: usize, diagonal: impl Fn(usize) -> f64, mass: &[f64], shift: f64) -> (SparseMatrix, CompactFactor) {
        let entries: Vec<_> = (0..n).flat_map(|i| [(i, i, 2.0 + diagonal(i)), ((i + 1) % n, i, -1.0)]).collect();
        let a = SparseMatrix::from_triplets(n, &entries).expect("entries inside");
        let mut shifted = a.clone();
        for (i, m) in mass.iter().enumerate() {
            shifted.values_mut()[a.pattern().column(i).start] += shift * m;
        }
        let factor = CompactFactor::of(&shifted, &Ordering::Amd, &Run::default()).expect("a positive definite matrix");
        (a, factor)
    }

    fn dense_values(a: &SparseMatrix, mass: &[f64]) -> Vec<f64> {
        let n = a.n();
        let mut full = DMatrix::zeros(n, n);
        for (i, j, s) in a.pattern().entries() {
            let v = a.values()[s] / (mass[i] * mass[j]).sqrt();
            full[(i, j)] = v;
            full[(j, i)] = v;
        }
        let mut values: Vec<f64> = SymmetricEigen::new(full).eigenvalues.iter().copied().collect();
        values.sort_by(f64::total_cmp);
        values
    }

    #[test]
    fn the_lowest_pairs_are_those_of_the_dense_problem() {
        let n = 200;
        let mass: Vec<f64> = (0..n).map(|i| 1.0 + 0.5 * (i as f64).sin()).collect();
        let (a, mut factor) = pencil(n, |i| 1e-3 * (i % 7) as f64, &mass, 1e-4);
        let expected = dense_values(&a, &mass);
        let mut problem = ShiftedPencil { matrix: &a, mass: &mass, shift: 1e-4, factor: &mut factor, known: &[] };
        let found = problem.lowest(12, &LanczosOptions::default(), &Run::default()).expect("a run that never stops");
        assert!(found.converged, "{:?}", found.residuals);
        for (value, expected) in found.values.iter().zip(&expected) {
            assert!((value - expected).abs() < 1e-10 * expected, "{value} against {expected}");
        }
        for (i, x) in found.vectors.iter().enumerate() {
            for (j, y) in found.vectors.iter().enumerate() {
                let product: f64 = x.iter().zip(y).zip(&mass).map(|((x, y), m)| x * y * m).sum();
                assert!((product - f64::from(u8::from(i == j))).abs() < 1e-10, "{i} {j} {product}");
            }
        }
    }

    #[test]
    fn coinciding_values_are_all_found_and_known_vectors_are_left_out() {
        // A ring: 0, then pairs 2 − 2 cos(2πk/n).
        let n = 300;
        let mass = vec![1.0; n];
        let (a, mut factor) = pencil(n, |_| 0.0, &mass, 1e-6);
        let known = [KnownVectors { support: (0..n as u32).collect(), vectors: vec![vec![3.0; n]] }];
        let mut problem = ShiftedPencil { matrix: &a, mass: &mass, shift: 1e-6, factor: &mut factor, known: &known };
        let found = problem.lowest(20, &LanczosOptions::default(), &Run::default()).expect("a run that never stops");
        assert!(found.converged, "{:?}", found.residuals);
        for (k, value) in found.values.iter().enumerate() {
            let expected = 2.0 - 2.0 * (std::f64::consts::TAU * (k / 2 + 1) as f64 / n as f64).cos();
            assert!((value - expected).abs() < 1e-8 * expected, "{k}: {value} against {expected}");
        }
        assert!(found.vectors.iter().all(|x| x.iter().sum::<f64>().abs() < 1e-9));
    }

    #[test]
    fn more_pairs_than_there_are_gives_all_of_them() {
        let mass: Vec<f64> = (0..7).map(|i| 1.0 + f64::from(i)).collect();
        let (a, mut factor) = pencil(7, |i| i as f64, &mass, 0.1);
        let expected = dense_values(&a, &mass);
        let mut problem = ShiftedPencil { matrix: &a, mass: &mass, shift: 0.1, factor: &mut factor, known: &[] };
        let found = problem.lowest(50, &LanczosOptions::default(), &Run::default()).expect("a run that never stops");
        assert_eq!(found.values.len(), 7);
        for (value, expected) in found.values.iter().zip(&expected) {
            assert!((value - expected).abs() < 1e-10 * (1.0 + expected), "{value} against {expected}");
        }
    }

    #[test]
    fn few_blocks_say_that_they_were_too_few() {
        let n = 500;
        let mass = vec![1.0; n];
        let (a, mut factor) = pencil(n, |i| 0.1 * (i % 13) as f64, &mass, 1.0);
        let mut problem = ShiftedPencil { matrix: &a, mass: &mass, shift: 1.0, factor: &mut factor, known: &[] };
        let found = problem
            .lowest(10, &LanczosOptions { max_blocks: 3, ..LanczosOptions::default() }, &Run::default())
            .expect("a run that never stops");
        assert!(!found.converged && found.values.len() == 10);
    }
}
