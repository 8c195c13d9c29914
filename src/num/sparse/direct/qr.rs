//! Sparse QR factorization for least squares: Householder reflections front by front.
//!
//! ```text
//! A Π = Q [R; 0] ,      min ‖A x − b‖  ⇔  R Πᵀx = first n entries of Qᵀ b
//! ```
//!
//! `R` is the Cholesky factor of `Πᵀ Aᵀ A Π` up to signs, so its elimination tree and blocks serve. The front of a block holds
//! the rows of `A` whose first entry is in one of its columns, and what is left of the rows of its children; reflections
//! make it upper trapezoidal, the first rows are rows of `R`, the others go to the parent, and rows that vanish are done with.
//! `Q` is kept as its reflections.
//!
//! The rows of `A` need not be multiplied out for the structure: all columns of a row lie on one path up the tree, so joining
//! each to the first of them gives the same tree.
//!
//! # Reference
//! J. W. H. Liu, *On general row merging schemes for sparse Givens transformations*, SIAM J. Sci. Stat. Comput. 7 (1986);
//! T. A. Davis, *Algorithm 915, SuiteSparseQR*, ACM TOMS 38 (2011); G. H. Golub, C. F. Van Loan, *Matrix Computations*, 4th
//! ed. 2013, §5.1 (reflections).

use crate::run::Run;
use crate::sparse::blocks::Analysis;
use crate::sparse::etree::NONE;
use crate::sparse::ordering::column_degree;
use crate::sparse::{GeneralMatrix, Pattern, Permutation, SparseError};

/// The factors.
#[derive(Debug)]
pub(super) struct Qr {
    columns: Permutation,
    fronts: Vec<Reduced>,
}

/// A front made upper trapezoidal.
#[derive(Debug)]
struct Reduced {
    /// First of its own columns, and their number.
    first: usize,
    width: usize,
    /// Its other columns.
    rest: Vec<u32>,
    /// Rows of the matrix that its rows replace.
    rows: Vec<u32>,
    /// Rows of `R`, column by column of the front, `width` values each.
    r: Vec<f64>,
    /// `(row, length, τ)` of each reflection `I − τ v vᵀ`, and the vectors one after another, without their first entry 1.
    reflections: Vec<(u32, u32, f64)>,
    vectors: Vec<f64>,
}

/// Rows that a front hands on: upper triangular in its columns.
struct Remainder {
    rows: Vec<u32>,
    /// Column by column, as many values each as rows.
    values: Vec<f64>,
}

impl Qr {
    /// The factors of a matrix with at least as many rows as columns; a column without a pivot as
    /// [`SparseError::Undetermined`].
    pub(super) fn new(a: &GeneralMatrix, run: &Run) -> Result<Self, SparseError> {
        let order = column_degree(a)?;
        let rows = a.transposed();
        let first_of = |i: usize, order: &Permutation| rows.column(i).map(|(j, _)| (order.new_from_old()[j], j)).min();
        let stars = (0..a.rows()).filter_map(|i| first_of(i, &order).map(|(_, center)| (i, center)));
        let pattern =
            Pattern::new(a.columns(), stars.flat_map(|(i, center)| rows.column(i).map(move |(j, _)| (j, center))))?;
        let Analysis { order: columns, blocks, .. } = Analysis::new(&pattern, &order);
        let mut starting_in = vec![Vec::new(); a.columns()];
        for i in 0..a.rows() {
            if let Some((first, _)) = first_of(i, &columns) {
                starting_in[first as usize].push(i as u32);
            }
        }
        let parents = blocks.parents();
        let mut position = vec![0_u32; a.columns()];
        let mut left: Vec<(usize, Remainder)> = Vec::new();
        let mut fronts: Vec<Reduced> = Vec::with_capacity(blocks.len());
        for (s, block) in blocks.iter().enumerate() {
            run.check()?;
            let own = block.first..block.first + block.width;
            let names = || own.clone().map(|j| j as u32).chain(block.rows.iter().copied());
            names().enumerate().for_each(|(k, j)| position[j as usize] = k as u32);
            let children = left.split_off(left.iter().rposition(|(c, _)| parents[*c] != s as u32).map_or(0, |k| k + 1));
            let mut front = Front::new(block.width + block.rows.len());
            for &i in own.clone().flat_map(|j| &starting_in[j]) {
                let entries = rows.column(i as usize);
                front.rows.push((i, entries.map(|(j, v)| (position[columns.new_from_old()[j] as usize], v)).collect()));
            }
            for (child, remainder) in &children {
                remainder.add_to(&mut front, &fronts[*child].rest, &position);
            }
            let (reduced, remainder) = front.reduce(block.first, block.width, block.rows.to_vec());
            if let Some(k) = reduced.vanished() {
                let unknown = columns.old_from_new()[block.first + k] as usize;
                return Err(SparseError::Undetermined { unknown });
            }
            if parents[s] != NONE {
                left.push((s, remainder));
            }
            fronts.push(reduced);
        }
        Ok(Self { columns, fronts })
    }

    /// The least-squares solution.
    pub(super) fn solve(&self, b: &[f64]) -> Vec<f64> {
        let mut y = b.to_vec();
        let mut local = Vec::new();
        for front in &self.fronts {
            local.clear();
            local.extend(front.rows.iter().map(|&i| y[i as usize]));
            front.reflect(&mut local);
            front.rows.iter().zip(&local).for_each(|(&i, &v)| y[i as usize] = v);
        }
        let mut x = vec![0.0; self.columns.len()];
        for front in self.fronts.iter().rev() {
            let (own, rest) = front.r.split_at(front.width * front.width);
            let mut known: Vec<f64> = front.rows[..front.width].iter().map(|&i| y[i as usize]).collect();
            for (r, &j) in rest.chunks_exact(front.width).zip(&front.rest) {
                known.iter_mut().zip(r).for_each(|(k, r)| *k -= r * x[j as usize]);
            }
            for (k, r) in own.chunks_exact(front.width).enumerate().rev() {
                let v = known[k] / r[k];
                x[front.first + k] = v;
                known[..k].iter_mut().zip(r).for_each(|(known, r)| *known -= r * v);
            }
        }
        self.columns.new_from_old().iter().map(|&new| x[new as usize]).collect()
    }
}

impl Reduced {
    /// First of its own columns whose diagonal entry is zero.
    fn vanished(&self) -> Option<usize> {
        (0..self.width).find(|&k| !(self.r[k * self.width + k].abs() > 0.0))
    }

    fn reflect(&self, b: &mut [f64]) {
        let mut vectors = &self.vectors[..];
        for &(row, length, tau) in &self.reflections {
            let (v, rest) = vectors.split_at(length as usize);
            reflect(v, tau, &mut b[row as usize..=row as usize + v.len()]);
            vectors = rest;
        }
    }
}

impl Remainder {
    fn add_to(&self, front: &mut Front, columns: &[u32], position: &[u32]) {
        for (k, &i) in self.rows.iter().enumerate() {
            let entries = columns.iter().zip(self.values.chunks_exact(self.rows.len())).skip(k);
            front.rows.push((i, entries.map(|(&j, column)| (position[j as usize], column[k])).collect()));
        }
    }
}

/// Rows that are to be reduced together, entries by the position of their columns.
struct Front {
    columns: usize,
    rows: Vec<(u32, Vec<(u32, f64)>)>,
}

impl Front {
    fn new(columns: usize) -> Self {
        Self { columns, rows: Vec::new() }
    }

    fn reduce(mut self, first: usize, width: usize, rest: Vec<u32>) -> (Reduced, Remainder) {
        // Rows in the order in which they begin: reflections then end where the later rows begin.
        let begin = |entries: &[(u32, f64)]| entries.iter().map(|&(j, _)| j).min().unwrap_or(u32::MAX);
        self.rows.sort_by_key(|(_, entries)| begin(entries));
        let height = self.rows.len();
        let mut dense = vec![0.0; height * self.columns];
        let mut ends = vec![0; self.columns];
        for (k, (_, entries)) in self.rows.iter().enumerate() {
            for &(j, v) in entries {
                dense[j as usize * height + k] += v;
            }
            if let Some(end) = ends.get_mut(begin(entries) as usize) {
                *end = k + 1;
            }
        }
        let (mut reflections, mut vectors) = (Vec::new(), Vec::new());
        let mut end = 0;
        for k in 0..self.columns.min(height) {
            end = end.max(ends[k]).max(k + 1);
            let (head, tail) = dense.split_at_mut((k + 1) * height);
            let column = &mut head[k * height + k..k * height + end];
            let tau = make_reflection(column);
            if tau == 0.0 {
                continue;
            }
            for other in tail.chunks_exact_mut(height) {
                reflect(&column[1..], tau, &mut other[k..end]);
            }
            reflections.push((k as u32, (end - k - 1) as u32, tau));
            vectors.extend_from_slice(&column[1..]);
            column[1..].fill(0.0);
        }
        let rows: Vec<u32> = self.rows.iter().map(|&(i, _)| i).collect();
        let value = |i: usize, j: usize| if i < height { dense[j * height + i] } else { 0.0 };
        let r = (0..self.columns).flat_map(|j| (0..width).map(move |i| (i, j))).map(|(i, j)| value(i, j)).collect();
        let kept = width.min(height)..self.columns.min(height).max(width.min(height));
        let values = (width..self.columns).flat_map(|j| &dense[j * height..][kept.clone()]).copied().collect();
        let remainder = Remainder { rows: rows[kept.clone()].to_vec(), values };
        (Reduced { first, width, rest, rows, r, reflections, vectors }, remainder)
    }
}

/// Replaces `x` by `(‖x‖, v)` with `(I − τ v vᵀ) x = ±‖x‖ e₁`, `v₁ = 1`; returns `τ`, 0 where nothing is to be done.
fn make_reflection(x: &mut [f64]) -> f64 {
    let largest = x[1..].iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    if largest == 0.0 {
        return 0.0;
    }
    let scale = largest.max(x[0].abs());
    let norm = scale * x.iter().map(|v| (v / scale).powi(2)).sum::<f64>().sqrt();
    // Of the two signs the one that adds.
    let image = if x[0] > 0.0 { -norm } else { norm };
    let tau = (image - x[0]) / image;
    let first = x[0] - image;
    x[1..].iter_mut().for_each(|v| *v /= first);
    x[0] = image;
    tau
}

/// `b ← (I − τ v vᵀ) b`, `v` without its first entry 1.
fn reflect(v: &[f64], tau: f64, b: &mut [f64]) {
    let Some((first, rest)) = b.split_first_mut() else { return };
    let scaled = tau * (*first + dot(v, rest));
    *first -= scaled;
    rest.iter_mut().zip(v).for_each(|(b, v)| *b -= scaled * v);
}

/// Inner product in eight sums, so that they need not wait for each other.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a_tail, b_tail) = (a.chunks_exact(8).remainder(), b.chunks_exact(8).remainder());
    for (a, b) in a.chunks_exact(8).zip(b.chunks_exact(8)) {
        (0..8).for_each(|k| sums[k] += a[k] * b[k]);
    }
    sums.iter().sum::<f64>() + a_tail.iter().zip(b_tail).map(|(a, b)| a * b).sum::<f64>()
}
