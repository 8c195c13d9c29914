//! A smooth function known on some blocks, continued over the others.
//!
//! ```text
//! Δ f = 0   with   f given on the known blocks,
//! ```
//!
//! relaxed on the block grid. A difference of tone continued like this makes two pictures agree along their seam, as
//! mean-value cloning does, for any shape of the seam.
//!
//! # Reference
//! Z. Farbman et al., *Coordinates for instant image cloning*, SIGGRAPH 2009 (the membrane and its use for seams).

use std::collections::VecDeque;

use super::strip::Strip;

/// Relaxation sweeps. Regions to fill are some ten blocks deep at most, and the initial guess is the nearest known
/// block.
const SWEEPS: usize = 12;

/// Values at the centers of blocks.
pub(super) struct Membrane {
    cols: usize,
    rows: usize,
    values: Vec<f32>,
}

impl Membrane {
    /// Continues `values`, one per block of the grid, from where they are known over `blocks`; 0 everywhere where nothing
    /// is known.
    pub(super) fn new(strip: &Strip, blocks: &[usize], values: Vec<f32>, known: &[bool]) -> Self {
        let mut membrane = Self { cols: strip.cols, rows: strip.rows, values };
        membrane.spread(known);
        let unknown: Vec<usize> = blocks.iter().copied().filter(|&b| !known[b]).collect();
        for _ in 0..SWEEPS {
            for &k in &unknown {
                membrane.relax(k);
            }
        }
        membrane
    }

    /// Gives unknown blocks the value of the nearest known one.
    fn spread(&mut self, known: &[bool]) {
        let mut reached = known.to_vec();
        let mut queue: VecDeque<usize> = (0..known.len()).filter(|&k| known[k]).collect();
        if queue.is_empty() {
            self.values.fill(0.0);
        }
        while let Some(k) = queue.pop_front() {
            for n in self.around(k) {
                if !std::mem::replace(&mut reached[n], true) {
                    self.values[n] = self.values[k];
                    queue.push_back(n);
                }
            }
        }
    }

    /// One Gauss–Seidel step at block `k`.
    fn relax(&mut self, k: usize) {
        let (sum, count) = self.around(k).fold((0.0, 0.0), |(s, c), n| (s + self.values[n], c + 1.0));
        self.values[k] = if count > 0.0 { sum / count } else { self.values[k] };
    }

    /// The four neighbors of block `k`.
    fn around(&self, k: usize) -> impl Iterator<Item = usize> + use<> {
        let (cols, i, j) = (self.cols, k % self.cols, k / self.cols);
        let sides = [
            (i > 0, k.wrapping_sub(1)),
            (i + 1 < cols, k + 1),
            (j > 0, k.wrapping_sub(cols)),
            (j + 1 < self.rows, k + cols),
        ];
        sides.into_iter().filter(|side| side.0).map(|side| side.1)
    }

    /// The value of block `k`.
    pub(super) fn of_block(&self, k: usize) -> f32 {
        self.values[k]
    }

    /// The value at `(u, v)`, in blocks, bilinear between their centers.
    pub(super) fn at(&self, u: f32, v: f32) -> f32 {
        let place = |u: f32, n: usize| {
            let u = (u - 0.5).clamp(0.0, (n - 1) as f32);
            let low = (u as usize).min(n.saturating_sub(2));
            (low, (low + 1).min(n - 1), u - low as f32)
        };
        let ((i, i1, s), (j, j1, t)) = (place(u, self.cols), place(v, self.rows));
        let v = |i: usize, j: usize| self.values[j * self.cols + i];
        let (top, bottom) = (v(i, j) + s * (v(i1, j) - v(i, j)), v(i, j1) + s * (v(i1, j1) - v(i, j1)));
        top + t * (bottom - top)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::warp::{Lattice, WarpField};
    use plumbline_num::math::{Similarity2, Vec2};

    /// A strip of all blocks of a 160×128 frame: 10 × 8 of them.
    fn everything() -> Strip {
        let away = Similarity2 { t: Vec2::new(900.0, 0.0), ..Similarity2::IDENTITY }.to_homography();
        let field = WarpField::from_forward_homography(&away).expect("regular");
        Strip::new(&Lattice::new(&field, 160, 128), (160, 128)).expect("nothing is covered")
    }

    #[test]
    fn the_membrane_lies_between_its_boundary_values() {
        let (mut values, mut known) = (vec![0.0; 80], vec![false; 80]);
        for j in 0..8 {
            (values[j * 10], values[j * 10 + 9]) = (-3.0, 6.0);
            (known[j * 10], known[j * 10 + 9]) = (true, true);
        }
        let strip = everything();
        let membrane = Membrane::new(&strip, &strip.blocks, values, &known);
        assert_eq!((membrane.of_block(20), membrane.of_block(29)), (-3.0, 6.0));
        let along: Vec<f32> = (0..10).map(|i| membrane.at(i as f32 + 0.5, 4.0)).collect();
        assert!(along.is_sorted(), "{along:?}");
        assert!((along[4] + along[5] - 3.0).abs() < 0.6, "harmonic in one dimension: linear; {along:?}");
    }

    #[test]
    fn where_nothing_is_known_it_vanishes() {
        let strip = everything();
        let membrane = Membrane::new(&strip, &strip.blocks, vec![7.0; 80], &[false; 80]);
        assert_eq!(membrane.at(3.2, 4.7), 0.0);
    }
}
