//! The space of the iteration: orthonormal vectors, and the projection of `C` onto them.
//!
//! A block is made orthogonal to all vectors before it at once, a few rows at a time (classical Gram–Schmidt, twice): vectors of a large
//! surface are read from memory, which takes longer than what is done with them.
//!
//! # Reference
//! L. Giraud, J. Langou, M. Rozložník, *The loss of orthogonality in the Gram–Schmidt orthogonalization process*, Computers &
//! Mathematics with Applications 50 (2005).

use std::ops::Range;

use nalgebra::{DMatrix, SymmetricEigen};

use super::BLOCK;
use crate::math::{dot, norm};

/// Norm of a unit vector after it was made orthogonal below which the rest is rounding: a million roundings. Smaller takes rounding for new
/// directions, larger drops directions that are new.
const DEPENDENT: f64 = 1e-10;
/// Passes of orthogonalization: after one, vectors that lose most of their length are orthogonal to few digits; after two, all are to
/// working precision.
const PASSES: usize = 2;

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

/// Orthonormal vectors and the projection of `C` onto their span.
pub(super) struct Space {
    known: Vec<KnownVectors>,
    pub(super) basis: Vec<Vec<f64>>,
    /// `⟨v_i, C v_j⟩` for `j` whose image is known.
    projection: DMatrix<f64>,
    /// Coefficients of the images of the last block along the next one, and where the last block starts.
    tail: DMatrix<f64>,
    last: usize,
    pub(super) solves: usize,
    random: fastrand::Rng,
    n: usize,
}

/// Eigenvalues of the projection, greatest first.
pub(super) struct Ritz {
    values: Vec<f64>,
    vectors: DMatrix<f64>,
    /// What each lacks of being an eigenvalue of `C`, over itself.
    pub(super) errors: Vec<f64>,
}

impl Space {
    pub(super) fn new(n: usize, roots: &[f64], known: &[KnownVectors], seed: u64) -> Self {
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
    pub(super) fn known(&self) -> usize {
        self.known.iter().map(|group| group.vectors.len()).sum()
    }

    /// Makes a vector a unit orthogonal to all; `false` where nothing is left of it.
    fn orthonormalize(&self, y: &mut [f64], more: &[Vec<f64>]) -> bool {
        let before = norm(y);
        if !(before > 0.0 && before.is_finite()) {
            return false;
        }
        scale(y, 1.0 / before);
        let mut left = 1.0;
        for _ in 0..PASSES {
            self.known.iter().for_each(|group| group.leave_out(y));
            for v in self.basis.iter().chain(more) {
                subtract(y, v, product(v, y));
            }
            // A vector that keeps half of its length was orthogonal to most digits.
            let before = std::mem::replace(&mut left, norm(y));
            if left > 0.5 * before {
                break;
            }
        }
        scale(y, 1.0 / left);
        left > DEPENDENT
    }

    pub(super) fn random_block(&mut self, width: usize) -> Vec<Vec<f64>> {
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
    pub(super) fn take(&mut self, block: &mut Vec<Vec<f64>>) {
        self.last = self.basis.len();
        self.solves += block.len();
        self.basis.append(block);
    }

    /// Takes the images of the last block into the projection; returns what of them is new, orthonormal.
    pub(super) fn project(&mut self, mut images: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        let (size, width) = (self.basis.len(), images.len());
        let mut inside = DMatrix::zeros(size, width);
        for _ in 0..PASSES {
            self.known.iter().for_each(|group| images.iter_mut().for_each(|w| group.leave_out(w)));
            inside += leave_out(&mut images, &self.basis);
        }
        self.projection.resize_mut(size, size, 0.0);
        self.projection.view_mut((0, size - width), (size, width)).copy_from(&inside);
        self.projection.view_mut((size - width, 0), (width, size)).tr_copy_from(&inside);
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

    pub(super) fn ritz(&self, next: &[Vec<f64>]) -> Ritz {
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
    pub(super) fn restart(&mut self, ritz: &Ritz, kept: usize) {
        self.basis = self.combined(ritz, kept);
        self.projection = DMatrix::from_fn(kept, kept, |i, j| if i == j { ritz.values[i] } else { 0.0 });
        self.last = kept;
    }

    /// After an invariant space is found: new directions; `false` where there are none.
    pub(super) fn widen(&mut self, block: &mut Vec<Vec<f64>>) -> bool {
        *block = self.random_block(BLOCK.min(self.n - self.known() - self.basis.len()));
        !block.is_empty()
    }

    /// The vectors of the `count` greatest values.
    pub(super) fn combined(&self, ritz: &Ritz, count: usize) -> Vec<Vec<f64>> {
        let mut block = vec![vec![0.0; self.n]; count];
        take_away(&mut block, &self.basis, &-ritz.vectors.columns(0, count));
        for y in &mut block {
            let length = norm(y);
            scale(y, 1.0 / length);
        }
        block
    }
}

/// Rows that are worked on together: as many as leave those of a block of four in the nearest cache.
const ROWS: usize = 512;

fn rows_of(n: usize) -> impl Iterator<Item = Range<usize>> {
    (0..n).step_by(ROWS).map(move |start| start..(start + ROWS).min(n))
}

/// `W ← W − V Vᵀ W`; returns `Vᵀ W`. Every vector is read twice, not twice for each that it is left out of.
fn leave_out(block: &mut [Vec<f64>], from: &[Vec<f64>]) -> DMatrix<f64> {
    let mut inside = DMatrix::zeros(from.len(), block.len());
    for rows in rows_of(block.first().map_or(0, Vec::len)) {
        for (i, v) in from.iter().enumerate() {
            for (k, w) in block.iter().enumerate() {
                inside[(i, k)] += product(&v[rows.clone()], &w[rows.clone()]);
            }
        }
    }
    take_away(block, from, &inside);
    inside
}

/// `W ← W − V C`.
fn take_away(block: &mut [Vec<f64>], from: &[Vec<f64>], coefficients: &DMatrix<f64>) {
    for rows in rows_of(block.first().map_or(0, Vec::len)) {
        for (i, v) in from.iter().enumerate() {
            for (k, w) in block.iter_mut().enumerate() {
                subtract(&mut w[rows.clone()], &v[rows.clone()], coefficients[(i, k)]);
            }
        }
    }
}

/// `aᵀ b` in eight sums, which need not wait for each other.
fn product(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a_tail, b_tail) = (a.chunks_exact(8).remainder(), b.chunks_exact(8).remainder());
    for (a, b) in a.chunks_exact(8).zip(b.chunks_exact(8)) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    sums.iter().sum::<f64>() + dot(a_tail, b_tail)
}

pub(super) fn scale(a: &mut [f64], s: f64) {
    for a in a {
        *a *= s;
    }
}

/// `y ← y − c v`.
pub(super) fn subtract(y: &mut [f64], v: &[f64], c: f64) {
    for (y, v) in y.iter_mut().zip(v) {
        *y -= c * v;
    }
}
