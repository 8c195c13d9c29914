//! Symmetric indefinite factorization `P A Pᵀ = L D Lᵀ`, `D` of 1×1 and 2×2 blocks.
//!
//! A multifrontal factorization as for Cholesky, with pivots sought among the columns of each front: column `q` is taken
//! where
//!
//! ```text
//! |a_qq| ≥ u γ_q                                    γ_q = max_{i≠q} |a_iq| over all rows of the front
//! ```
//!
//! and columns `q`, `r` together, `r` the row of the largest entry of column `q` that may still be a pivot, where
//!
//! ```text
//! |⎡a_qq a_rq⎤⁻¹| ⎡γ_q⎤ ≤ 1/u                       γ over the other rows
//!  ⎣a_rq a_rr⎦    ⎣γ_r⎦
//! ```
//!
//! so that no entry of `L` exceeds `1/u`. Columns without such a pivot are handed to the parent with what is left of them: at
//! a root, where a front has no rows below, one of the two always holds.
//!
//! # Reference
//! J. R. Bunch, B. N. Parlett, SIAM J. Numer. Anal. 8 (1971), for the root; I. S. Duff, J. K. Reid, *The multifrontal solution
//! of indefinite sparse symmetric linear equations*, ACM TOMS 9 (1983); I. S. Duff, *MA57 – a code for the solution of sparse
//! symmetric definite and indefinite systems*, ACM TOMS 30 (2004), for the threshold.

use crate::run::Run;
use crate::sparse::blocks::Analysis;
use crate::sparse::front::subtract_product;
use crate::sparse::{Ordering, Permutation, SparseError, SparseMatrix};

/// `u` above: smaller keeps more of the planned order, larger bounds the growth of rounding more tightly.
const THRESHOLD: f64 = 0.01;

/// What elimination leaves of an entry relative to its row and column, below which it is nothing but rounding.
const ROUNDING: f64 = 1e-14;

/// The factor.
#[derive(Debug)]
pub(super) struct Ldlt {
    order: Permutation,
    fronts: Vec<Eliminated>,
}

/// What was eliminated in one front.
#[derive(Debug)]
struct Eliminated {
    /// Unknowns in the permuted numbering: those eliminated, then the other rows.
    rows: Vec<u32>,
    /// `(d, e)` for each: its diagonal entry of `D`, and the entry beside it where it is the first of two.
    pivots: Vec<(f64, f64)>,
    /// Columns of `L`, each of all rows; the part above its diagonal is not read.
    columns: Vec<f64>,
}

/// What a front hands on.
struct Remainder {
    front: usize,
    /// Columns that found no pivot, then the rows below.
    rows: Vec<u32>,
    delayed: usize,
    /// The square of them, column by column, lower triangle.
    values: Vec<f64>,
}

impl Ldlt {
    /// The factor; where pivots vanish an unknown among those left free, as [`SparseError::Undetermined`].
    pub(super) fn new(a: &SparseMatrix, ordering: &Ordering, run: &Run) -> Result<Self, SparseError> {
        let Analysis { order, permuted, blocks, .. } = Analysis::new(a.pattern(), &ordering.permutation(a.pattern())?);
        let entries: Vec<f64> = permuted.sources().map(|(slot, _)| a.values()[slot]).collect();
        let mut scale = vec![0.0; a.n()];
        for j in 0..a.n() {
            for s in permuted.range(j) {
                let i = permuted.rows[s] as usize;
                scale[i] = f64::max(scale[i], entries[s].abs());
                scale[j] = f64::max(scale[j], entries[s].abs());
            }
        }
        let parents = blocks.parents();
        let mut position = vec![0_u32; a.n()];
        let mut waiting: Vec<Remainder> = Vec::new();
        let mut fronts = Vec::with_capacity(blocks.len());
        for (s, block) in blocks.iter().enumerate() {
            run.check()?;
            let children =
                waiting.split_off(waiting.iter().rposition(|c| parents[c.front] != s as u32).map_or(0, |k| k + 1));
            let delayed = children.iter().flat_map(|c| &c.rows[..c.delayed]).copied();
            let candidates = delayed.chain((block.first..block.first + block.width).map(|j| j as u32));
            let mut front = Front::new(candidates.collect(), block.rows);
            front.rows.iter().enumerate().for_each(|(k, &row)| position[row as usize] = k as u32);
            for j in block.first..block.first + block.width {
                for s in permuted.range(j) {
                    front.add(position[permuted.rows[s] as usize] as usize, position[j] as usize, entries[s]);
                }
            }
            for child in &children {
                child.add_to(&mut front, &position);
            }
            let is_root = block.rows.is_empty();
            let pivots = front.eliminate(|i| if is_root { ROUNDING * scale[i as usize] } else { 0.0 });
            if is_root && pivots.len() < front.candidates {
                let unknown = order.old_from_new()[front.rows[pivots.len()] as usize] as usize;
                return Err(SparseError::Undetermined { unknown });
            }
            waiting.extend((front.rows.len() > pivots.len()).then(|| front.remainder(s, &pivots)));
            front.panel.truncate(pivots.len() * front.rows.len());
            fronts.push(Eliminated { rows: front.rows, pivots, columns: front.panel });
        }
        Ok(Self { order, fronts })
    }

    pub(super) fn solve(&self, b: &mut [f64]) {
        let mut x: Vec<f64> = self.order.old_from_new().iter().map(|&old| b[old as usize]).collect();
        let mut local = Vec::new();
        for front in &self.fronts {
            front.gather(&x, &mut local);
            front.forwards(&mut local);
            front.divide(&mut local);
            front.scatter(&local, &mut x, front.rows.len());
        }
        for front in self.fronts.iter().rev() {
            front.gather(&x, &mut local);
            front.backwards(&mut local);
            front.scatter(&local, &mut x, front.pivots.len());
        }
        x.iter().zip(self.order.old_from_new()).for_each(|(x, &old)| b[old as usize] = *x);
    }
}

impl Eliminated {
    fn gather(&self, x: &[f64], local: &mut Vec<f64>) {
        local.clear();
        local.extend(self.rows.iter().map(|&row| x[row as usize]));
    }

    fn scatter(&self, local: &[f64], x: &mut [f64], count: usize) {
        self.rows[..count].iter().zip(local).for_each(|(&row, &v)| x[row as usize] = v);
    }

    /// First row below the diagonal block of pivot `k`, and column `k` of `L` from there.
    fn column(&self, k: usize) -> (usize, &[f64]) {
        let start = if self.pivots[k].1 == 0.0 { k + 1 } else { k + 2 };
        let rows = self.rows.len();
        (start, &self.columns[k * rows + start..(k + 1) * rows])
    }

    fn forwards(&self, x: &mut [f64]) {
        for k in 0..self.pivots.len() {
            let (start, l) = self.column(k);
            let v = x[k];
            x[start..].iter_mut().zip(l).for_each(|(x, l)| *x -= l * v);
        }
    }

    fn divide(&self, x: &mut [f64]) {
        let mut k = 0;
        while k < self.pivots.len() {
            let (d, e) = self.pivots[k];
            if e == 0.0 {
                x[k] /= d;
                k += 1;
            } else {
                let pair = solve_pair((d, e, self.pivots[k + 1].0), (x[k], x[k + 1]));
                (x[k], x[k + 1]) = pair;
                k += 2;
            }
        }
    }

    fn backwards(&self, x: &mut [f64]) {
        for k in (0..self.pivots.len()).rev() {
            let (start, l) = self.column(k);
            x[k] -= x[start..].iter().zip(l).map(|(x, l)| x * l).sum::<f64>();
        }
    }
}

/// `[d e; e f]⁻¹ b`, scaled by `e`, which is the largest entry by far where the pivot is 2×2 for a reason.
fn solve_pair((d, e, f): (f64, f64, f64), b: (f64, f64)) -> (f64, f64) {
    let (d, f, b) = (d / e, f / e, (b.0 / e, b.1 / e));
    let determinant = d * f - 1.0;
    ((f * b.0 - b.1) / determinant, (d * b.1 - b.0) / determinant)
}

/// A dense front while it is eliminated.
struct Front {
    /// Unknowns: those that may be pivots, then those below.
    rows: Vec<u32>,
    candidates: usize,
    /// Columns of the candidates, all rows, both triangles.
    panel: Vec<f64>,
    /// The square of the rows below, lower triangle.
    below: Vec<f64>,
}

impl Front {
    fn new(mut rows: Vec<u32>, below: &[u32]) -> Self {
        let candidates = rows.len();
        rows.extend_from_slice(below);
        let (panel, square) = (vec![0.0; candidates * rows.len()], vec![0.0; below.len() * below.len()]);
        Self { rows, candidates, panel, below: square }
    }

    /// Adds to the entry at positions `i` and `j` and to its mirror image.
    fn add(&mut self, i: usize, j: usize, value: f64) {
        let (i, j, size) = (i.max(j), i.min(j), self.rows.len());
        if j >= self.candidates {
            self.below[(j - self.candidates) * (size - self.candidates) + i - self.candidates] += value;
            return;
        }
        self.panel[j * size + i] += value;
        if i < self.candidates && i != j {
            self.panel[i * size + j] += value;
        }
    }

    /// Eliminates candidates while one is found; entries up to `rounding` of their row count for nothing.
    fn eliminate(&mut self, rounding: impl Fn(u32) -> f64) -> Vec<(f64, f64)> {
        let mut pivots = Vec::new();
        while let Some(choice) = (pivots.len()..self.candidates).find_map(|q| self.pivot_at(pivots.len(), q, &rounding))
        {
            let k = pivots.len();
            match choice {
                (q, None) => {
                    self.swap(k, q);
                    pivots.push(self.eliminate_one(k));
                }
                (q, Some(r)) => {
                    self.swap(k, q);
                    self.swap(k + 1, if r == k { q } else { r });
                    pivots.extend(self.eliminate_two(k));
                }
            }
        }
        self.subtract_from_below(&pivots);
        pivots
    }

    fn entry(&self, i: usize, j: usize) -> f64 {
        self.panel[j * self.rows.len() + i]
    }

    /// Column `q`, or it and another, where they may be pivots once `k` are eliminated.
    fn pivot_at(&self, k: usize, q: usize, rounding: impl Fn(u32) -> f64) -> Option<(usize, Option<usize>)> {
        let column = &self.panel[q * self.rows.len()..][..self.rows.len()];
        let largest = |range: std::ops::Range<usize>, column: &[f64], without: [usize; 2]| {
            let others = range.filter(|i| !without.contains(i));
            others.fold(
                (0.0, None),
                |(max, at), i| if column[i].abs() > max { (column[i].abs(), Some(i)) } else { (max, at) },
            )
        };
        let (own, partner) = largest(k..self.candidates, column, [q, q]);
        let (below, _) = largest(self.candidates..column.len(), column, [q, q]);
        let (gamma, diagonal) = (f64::max(own, below), column[q].abs());
        if diagonal.max(gamma) <= rounding(self.rows[q]) {
            return None;
        }
        if diagonal > 0.0 && diagonal >= THRESHOLD * gamma {
            return Some((q, None));
        }
        let r = partner?;
        let other = &self.panel[r * self.rows.len()..][..self.rows.len()];
        let gamma_q = largest(k..column.len(), column, [q, r]).0;
        let gamma_r = largest(k..column.len(), other, [q, r]).0;
        let (a, b, c) = (column[q], column[r], other[r]);
        let bound = (a * c - b * b).abs() / THRESHOLD;
        let holds = bound > 0.0
            && c.abs() * gamma_q + b.abs() * gamma_r <= bound
            && a.abs() * gamma_r + b.abs() * gamma_q <= bound;
        holds.then_some((q, Some(r)))
    }

    /// Exchanges candidates `i` and `j`, neither of them eliminated yet.
    fn swap(&mut self, i: usize, j: usize) {
        if i == j {
            return;
        }
        let size = self.rows.len();
        self.rows.swap(i, j);
        for c in 0..self.candidates {
            self.panel.swap(c * size + i, c * size + j);
        }
        let (head, tail) = self.panel.split_at_mut(i.max(j) * size);
        head[i.min(j) * size..][..size].swap_with_slice(&mut tail[..size]);
    }

    /// Turns column `k` into one of `L` and subtracts its part from the other candidates.
    fn eliminate_one(&mut self, k: usize) -> (f64, f64) {
        let size = self.rows.len();
        let (head, tail) = self.panel.split_at_mut((k + 1) * size);
        let column = &mut head[k * size..];
        let pivot = column[k];
        for (j, other) in tail.chunks_exact_mut(size).enumerate() {
            let ratio = column[k + 1 + j] / pivot;
            if ratio != 0.0 {
                other[k + 1..].iter_mut().zip(&column[k + 1..]).for_each(|(v, c)| *v -= ratio * c);
            }
        }
        column[k + 1..].iter_mut().for_each(|v| *v /= pivot);
        (pivot, 0.0)
    }

    /// The same for columns `k` and `k + 1`.
    fn eliminate_two(&mut self, k: usize) -> [(f64, f64); 2] {
        let size = self.rows.len();
        let pivot = (self.entry(k, k), self.entry(k + 1, k), self.entry(k + 1, k + 1));
        let (head, tail) = self.panel.split_at_mut((k + 2) * size);
        let (one, two) = head[k * size..].split_at_mut(size);
        for (j, other) in tail.chunks_exact_mut(size).enumerate() {
            let (s, t) = solve_pair(pivot, (one[k + 2 + j], two[k + 2 + j]));
            if s != 0.0 || t != 0.0 {
                let columns = one[k + 2..].iter().zip(&two[k + 2..]);
                other[k + 2..].iter_mut().zip(columns).for_each(|(v, (a, b))| *v -= s * a + t * b);
            }
        }
        for (a, b) in one[k + 2..].iter_mut().zip(&mut two[k + 2..]) {
            (*a, *b) = solve_pair(pivot, (*a, *b));
        }
        [(pivot.0, pivot.1), (pivot.2, 0.0)]
    }

    /// `U ← U − M D Mᵀ`, `M` the rows of `L` below.
    fn subtract_from_below(&mut self, pivots: &[(f64, f64)]) {
        let (size, first) = (self.rows.len(), self.candidates);
        let below = size - first;
        // M D, column by column.
        let mut scaled = vec![0.0; below * pivots.len()];
        for (k, scaled) in scaled.chunks_exact_mut(below.max(1)).enumerate() {
            let mut add = |c: usize, d: f64| {
                let column = &self.panel[c * size + first..(c + 1) * size];
                scaled.iter_mut().zip(column).for_each(|(to, l)| *to += d * l);
            };
            add(k, pivots[k].0);
            if pivots[k].1 != 0.0 {
                add(k + 1, pivots[k].1);
            }
            if k > 0 && pivots[k - 1].1 != 0.0 {
                add(k - 1, pivots[k - 1].1);
            }
        }
        subtract_product(&mut self.below, below, &scaled, (&self.panel, size));
    }

    fn remainder(&self, front: usize, pivots: &[(f64, f64)]) -> Remainder {
        let (done, size) = (pivots.len(), self.rows.len());
        let left = size - done;
        let mut values = vec![0.0; left * left];
        for j in done..self.candidates {
            values[(j - done) * left..][..left].copy_from_slice(&self.panel[j * size + done..(j + 1) * size]);
        }
        let below = size - self.candidates;
        for j in 0..below {
            let to = (self.candidates - done + j) * left + self.candidates - done;
            values[to..to + below].copy_from_slice(&self.below[j * below..(j + 1) * below]);
        }
        Remainder { front, rows: self.rows[done..].to_vec(), delayed: self.candidates - done, values }
    }
}

impl Remainder {
    fn add_to(&self, front: &mut Front, position: &[u32]) {
        let size = self.rows.len();
        for j in 0..size {
            for i in j..size {
                let value = self.values[j * size + i];
                front.add(position[self.rows[i] as usize] as usize, position[self.rows[j] as usize] as usize, value);
            }
        }
    }
}
