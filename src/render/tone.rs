//! The difference in tone between two pictures of the same scene, known where both are and continued beyond.
//!
//! Exposure, vignetting and haze make frames differ by a smooth function even where they are aligned. A [`Tone`] holds
//! the mean difference `own − other` of blocks of [`BLOCK`] samples; blocks without overlap are filled by the membrane
//!
//! ```text
//! Δ d = 0   with   d = own − other   on the overlap,
//! ```
//!
//! relaxed on the block grid. Added to the other picture it makes both agree along their seam, as mean-value cloning
//! does, for any shape of the seam.
//!
//! # Reference
//! Z. Farbman et al., *Coordinates for instant image cloning*, SIGGRAPH 2009 (the membrane and its use for seams).

/// Side of a block, samples. Smaller blocks follow misaligned texture; larger ones miss vignetting.
pub(super) const BLOCK: usize = 16;
/// Fewest samples for a mean: an eighth of a block.
const ENOUGH: f32 = 32.0;
/// Sweeps of the relaxation. Regions to fill are some ten blocks deep at most and start from their nearest known block.
const SWEEPS: usize = 24;

/// Sums over the samples of one block that both pictures cover.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BlockSums {
    count: f32,
    own: f32,
    own_squared: f32,
    difference: f32,
    difference_squared: f32,
}

impl BlockSums {
    /// Counts one sample of both pictures.
    pub(super) fn add(&mut self, own: f32, other: f32) {
        let d = own - other;
        self.count += 1.0;
        self.own += own;
        self.own_squared += own * own;
        self.difference += d;
        self.difference_squared += d * d;
    }

    fn known(&self) -> bool {
        self.count >= ENOUGH
    }
}

/// Share of the texture of the overlap that the other picture misses, tone apart: 0 for perfect alignment, 2 for
/// unrelated pictures. `floor` is the variance of noise, added to the texture's.
pub(super) fn disagreement(blocks: &[BlockSums], floor: f32) -> f32 {
    let variance = |sum: f32, squared: f32, n: f32| (squared - sum * sum / n).max(0.0);
    let known = || blocks.iter().filter(|b| b.known());
    let missed: f32 = known().map(|b| variance(b.difference, b.difference_squared, b.count)).sum();
    let texture: f32 = known().map(|b| variance(b.own, b.own_squared, b.count) + floor * b.count).sum();
    if texture > 0.0 { missed / texture } else { f32::INFINITY }
}

/// Differences of tone at the centers of blocks.
pub(super) struct Tone {
    cols: usize,
    rows: usize,
    values: Vec<f32>,
}

impl Tone {
    /// The differences of `blocks`, row-major in `cols` columns, continued over blocks without overlap.
    pub(super) fn new(blocks: &[BlockSums], cols: usize) -> Self {
        let rows = blocks.len() / cols;
        let known: Vec<bool> = blocks.iter().map(BlockSums::known).collect();
        let values = blocks.iter().map(|b| if b.known() { b.difference / b.count } else { 0.0 }).collect();
        let mut tone = Self { cols, rows, values };
        tone.spread(&known);
        tone.relax(&known);
        tone
    }

    /// Gives unknown blocks the mean of their neighbors, ring after ring; 0 everywhere where nothing is known.
    fn spread(&mut self, known: &[bool]) {
        let mut reached = known.to_vec();
        while reached.iter().any(|r| !r) && reached.iter().any(|&r| r) {
            let before = reached.clone();
            for k in (0..before.len()).filter(|&k| !before[k]) {
                let near = self.around(k).filter(|&n| before[n]);
                let (sum, count) = near.fold((0.0, 0.0), |(s, c), n| (s + self.values[n], c + 1.0));
                if count > 0.0 {
                    self.values[k] = sum / count;
                    reached[k] = true;
                }
            }
        }
    }

    /// Gauss-Seidel sweeps over the unknown blocks.
    fn relax(&mut self, known: &[bool]) {
        for _ in 0..SWEEPS {
            for k in (0..known.len()).filter(|&k| !known[k]) {
                let (sum, count) = self.around(k).fold((0.0, 0.0), |(s, c), n| (s + self.values[n], c + 1.0));
                if count > 0.0 {
                    self.values[k] = sum / count;
                }
            }
        }
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

    /// The difference at sample `(x, y)`, bilinear between the centers of blocks.
    pub(super) fn at(&self, x: usize, y: usize) -> f32 {
        let place = |at: usize, n: usize| {
            let u = ((at as f32 + 0.5) / BLOCK as f32 - 0.5).clamp(0.0, (n - 1) as f32);
            let low = (u as usize).min(n.saturating_sub(2));
            (low, (low + 1).min(n - 1), u - low as f32)
        };
        let ((i, i1, s), (j, j1, t)) = (place(x, self.cols), place(y, self.rows));
        let v = |i: usize, j: usize| self.values[j * self.cols + i];
        let (top, bottom) = (v(i, j) + s * (v(i1, j) - v(i, j)), v(i, j1) + s * (v(i1, j1) - v(i, j1)));
        top + t * (bottom - top)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(difference: f32) -> BlockSums {
        let mut sums = BlockSums::default();
        (0..64).for_each(|k| sums.add(100.0 + k as f32, 100.0 + k as f32 - difference));
        sums
    }

    #[test]
    fn the_membrane_lies_between_its_boundary_values() {
        let mut blocks = vec![BlockSums::default(); 80];
        (0..8).for_each(|j| blocks[j * 10] = block(-3.0));
        (0..8).for_each(|j| blocks[j * 10 + 9] = block(6.0));
        let tone = Tone::new(&blocks, 10);
        assert_eq!(tone.at(0, 40), -3.0);
        assert_eq!(tone.at(159, 40), 6.0);
        let values: Vec<f32> = (0..160).step_by(16).map(|x| tone.at(x + 8, 60)).collect();
        assert!(values.is_sorted(), "{values:?}");
        assert!((values[4] + values[5] - 3.0).abs() < 0.6, "harmonic in one dimension: linear; {values:?}");
    }

    #[test]
    fn a_difference_of_tone_is_no_disagreement_and_noise_is() {
        assert!(disagreement(&[block(20.0)], 1.0) < 1e-3);
        let mut sums = BlockSums::default();
        (0..64).for_each(|k| sums.add((k * 37 % 64) as f32, (k * 23 % 61) as f32));
        assert!(disagreement(&[sums], 1.0) > 1.0);
        assert!(disagreement(&[BlockSums::default()], 1.0).is_infinite(), "no overlap proves nothing");
    }
}
