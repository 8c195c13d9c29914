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

use nalgebra::{DMatrix, SymmetricEigen};

use crate::math::{dot, norm};
use crate::run::{Run, Stopped};
use crate::sparse::{Cholesky, SparseMatrix};

/// Vectors per block: as many equal eigenvalues as rotations about an axis and mirrors bring, twice over. Solves with four
/// right-hand sides cost little more than two with one.
const BLOCK: usize = 4;
/// Norm of a unit vector after it was made orthogonal below which the rest is rounding: a million roundings. Smaller takes rounding for new
/// directions, larger drops directions that are new.
const DEPENDENT: f64 = 1e-10;
/// Passes of orthogonalization: after one, vectors that lose most of their length are orthogonal to few digits; after two, all are to
/// working precision (Giraud, Langou, Rozložník 2005).
const PASSES: usize = 2;

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
    /// Factor of `A + σM`.
    pub factor: &'a mut Cholesky,
    /// Eigenvectors that are not asked for. Supports of different groups are disjoint.
    pub known: &'a [KnownVectors],
}

/// Vectors that are zero outside of a support: the work of leaving them out is that of the support, however many groups there are.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KnownVectors {
    /// Unknowns, each once.
    pub support: Vec<u32>,
    /// Values at the support, of any length, independent of each other.
    pub vectors: Vec<Vec<f64>>,
}

impl KnownVectors {
    /// What `y` has at the support.
    fn gather(&self, y: &[f64]) -> Vec<f64> {
        self.support.iter().map(|i| y[*i as usize]).collect()
    }

    /// Makes `y` orthogonal to the vectors, which are orthonormal.
    fn leave_out(&self, y: &mut [f64]) {
        let mut part = self.gather(y);
        for v in &self.vectors {
            let c = dot(v, &part);
            subtract(&mut part, v, c);
        }
        for (i, value) in self.support.iter().zip(part) {
            y[*i as usize] = value;
        }
    }

    /// The vectors `√m x` made orthonormal, without those that depend on others.
    fn orthonormal(&self, roots: &[f64]) -> Self {
        let roots = self.gather(roots);
        let mut kept = Self { support: (0..self.support.len() as u32).collect(), vectors: Vec::new() };
        for x in &self.vectors {
            let mut y: Vec<f64> = x.iter().zip(&roots).map(|(x, r)| x * r).collect();
            let before = norm(&y);
            if !(before > 0.0 && before.is_finite()) {
                continue;
            }
            scale(&mut y, 1.0 / before);
            (0..PASSES).for_each(|_| kept.leave_out(&mut y));
            let left = norm(&y);
            scale(&mut y, 1.0 / left);
            if left > DEPENDENT {
                kept.vectors.push(y);
            }
        }
        Self { support: self.support.clone(), vectors: kept.vectors }
    }
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
        self.factor.solve_in_place(&mut columns);
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
        for k in 0..count {
            let y = space.combined(&ritz, k);
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

/// Orthonormal vectors and the projection of `C` onto their span.
struct Space {
    known: Vec<KnownVectors>,
    basis: Vec<Vec<f64>>,
    /// `⟨v_i, C v_j⟩` for `j` whose image is known.
    projection: DMatrix<f64>,
    /// Coefficients of the images of the last block along the next one, and where the last block starts.
    tail: DMatrix<f64>,
    last: usize,
    solves: usize,
    random: fastrand::Rng,
    n: usize,
}

/// Eigenvalues of the projection, greatest first.
struct Ritz {
    values: Vec<f64>,
    vectors: DMatrix<f64>,
    /// What each lacks of being an eigenvalue of `C`, over itself.
    errors: Vec<f64>,
}

impl Space {
    fn new(n: usize, roots: &[f64], known: &[KnownVectors], seed: u64) -> Self {
        Self {
            known: known.iter().map(|group| group.orthonormal(roots)).collect(),
            basis: Vec::new(),
            projection: DMatrix::zeros(0, 0),
            tail: DMatrix::zeros(0, 0),
            last: 0,
            solves: 0,
            random: fastrand::Rng::with_seed(seed),
            n,
        }
    }

    /// Number of known vectors.
    fn known(&self) -> usize {
        self.known.iter().map(|group| group.vectors.len()).sum()
    }

    /// Makes a vector a unit orthogonal to all; `false` where nothing is left of it.
    fn orthonormalize(&self, y: &mut [f64], more: &[Vec<f64>]) -> bool {
        let before = norm(y);
        if !(before > 0.0 && before.is_finite()) {
            return false;
        }
        scale(y, 1.0 / before);
        for _ in 0..PASSES {
            self.known.iter().for_each(|group| group.leave_out(y));
            for v in self.basis.iter().chain(more) {
                subtract(y, v, dot(v, y));
            }
        }
        let left = norm(y);
        scale(y, 1.0 / left);
        left > DEPENDENT
    }

    fn random_block(&mut self, width: usize) -> Vec<Vec<f64>> {
        let mut block: Vec<Vec<f64>> = Vec::new();
        for _ in 0..2 * width {
            let mut y: Vec<f64> = (0..self.n).map(|_| self.random.f64() - 0.5).collect();
            if block.len() < width && self.orthonormalize(&mut y, &block) {
                block.push(y);
            }
        }
        block
    }

    /// Moves a block into the basis.
    fn take(&mut self, block: &mut Vec<Vec<f64>>) {
        self.last = self.basis.len();
        self.solves += block.len();
        self.basis.append(block);
    }

    /// Takes the images of the last block into the projection; returns what of them is new, orthonormal.
    fn project(&mut self, mut images: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        let (size, width) = (self.basis.len(), images.len());
        self.projection.resize_mut(size, size, 0.0);
        for (k, w) in images.iter_mut().enumerate() {
            let column = size - width + k;
            for pass in 0..PASSES {
                self.known.iter().for_each(|group| group.leave_out(w));
                for (i, v) in self.basis.iter().enumerate() {
                    let c = dot(v, w);
                    subtract(w, v, c);
                    let sum = if pass == 0 { c } else { self.projection[(i, column)] + c };
                    self.projection[(i, column)] = sum;
                    self.projection[(column, i)] = sum;
                }
            }
        }
        let residue = images.clone();
        let largest = self.projection.diagonal().amax();
        let mut next: Vec<Vec<f64>> = Vec::new();
        for w in &mut images {
            // What C makes small is not new, however little it is made a unit of.
            if norm(w) > DEPENDENT * largest && self.orthonormalize(w, &next) {
                next.push(std::mem::take(w));
            }
        }
        self.tail = DMatrix::from_fn(next.len(), width, |i, k| dot(&next[i], &residue[k]));
        next
    }

    fn ritz(&self, next: &[Vec<f64>]) -> Ritz {
        let size = self.projection.nrows();
        let eigen = SymmetricEigen::new(self.projection.clone());
        let mut order: Vec<usize> = (0..size).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let vectors = DMatrix::from_fn(size, size, |i, k| eigen.eigenvectors[(i, order[k])]);
        let values: Vec<f64> = order.iter().map(|&k| eigen.eigenvalues[k]).collect();
        let ends = vectors.rows(self.last, size - self.last);
        let left = if next.is_empty() { DMatrix::zeros(1, size) } else { &self.tail * ends };
        let errors = values.iter().enumerate().map(|(k, v)| left.column(k).norm() / v.abs()).collect();
        Ritz { values, vectors, errors }
    }

    /// Begins again with the `kept` greatest Ritz vectors; the next block goes on from there.
    fn restart(&mut self, ritz: &Ritz, kept: usize) {
        self.basis = (0..kept).map(|k| self.combined(ritz, k)).collect();
        self.projection = DMatrix::from_fn(kept, kept, |i, j| if i == j { ritz.values[i] } else { 0.0 });
        self.last = kept;
    }

    /// After an invariant space is found: new directions; `false` where there are none.
    fn widen(&mut self, block: &mut Vec<Vec<f64>>) -> bool {
        *block = self.random_block(BLOCK.min(self.n - self.known() - self.basis.len()));
        !block.is_empty()
    }

    fn combined(&self, ritz: &Ritz, k: usize) -> Vec<f64> {
        let mut y = vec![0.0; self.n];
        for (v, c) in self.basis.iter().zip(ritz.vectors.column(k).iter()) {
            subtract(&mut y, v, -c);
        }
        let length = norm(&y);
        scale(&mut y, 1.0 / length);
        y
    }
}

fn scale(a: &mut [f64], s: f64) {
    for a in a {
        *a *= s;
    }
}

/// `y ← y − c v`.
fn subtract(y: &mut [f64], v: &[f64], c: f64) {
    for (y, v) in y.iter_mut().zip(v) {
        *y -= c * v;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sparse::Ordering;

    /// The Laplacian of a ring of `n` plus a diagonal, with its factor after a shift.
    fn pencil(n: usize, diagonal: impl Fn(usize) -> f64, mass: &[f64], shift: f64) -> (SparseMatrix, Cholesky) {
        let entries: Vec<_> = (0..n).flat_map(|i| [(i, i, 2.0 + diagonal(i)), ((i + 1) % n, i, -1.0)]).collect();
        let a = SparseMatrix::from_triplets(n, &entries).expect("entries inside");
        let mut shifted = a.clone();
        for (i, m) in mass.iter().enumerate() {
            shifted.values_mut()[a.pattern().column(i).start] += shift * m;
        }
        let mut factor = Cholesky::analyze(a.pattern(), &Ordering::Amd).expect("a small system");
        factor.factor(&shifted, &Run::default()).expect("a positive definite matrix");
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
