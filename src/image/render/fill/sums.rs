//! Moments of two pictures on a block, for Gauss–Newton and trust.

use super::canvas::{FEATHER_PX, PlaneCanvas};
use super::layer::Rendered;
use super::membrane::Membrane;
use super::strip::{BLOCK, Part, Strip};

/// Fraction of texture residual up to which a block has full trust, and from which none. Aligned frames of real video
/// have 0.02 to 0.3, unrelated ones 1 and more.
pub(super) const TRUST: [f32; 2] = [0.35, 0.7];
/// Radius of the window of a block's trust, blocks: a single block is too noisy.
const TRUST_WINDOW: usize = 1;
/// Minimum trusted fraction of the overlap; below, the neighbor is of another scene.
const MIN_CONFIDENCE: f32 = 0.3;
/// Standard deviation of noise, as a fraction of the range, below which texture is not significant.
const NOISE_SIGMA: f32 = 2.5 / 255.0;
/// Difference from the typical tone, as a fraction of the range, that counts as a residual: another object.
const MAX_TONE_DIFFERENCE: f32 = 16.0 / 255.0;
/// Minimum number of samples of a block that both cover.
pub(super) const MIN_SAMPLES: f32 = 48.0;
/// `λ` as a fraction of the mean squared gradient of the overlap, per sample: blocks without texture keep their
/// displacement.
const DAMPING: f32 = 0.05;

/// Sums over the samples of a block, or of a window of blocks, that both pictures cover.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    pub(super) count: f32,
    /// `Σ d`, `Σ g`, `Σ own`; zero once [centered](Sums::centered).
    first: [f32; 4],
    /// `Σ g gᵀ`: xx, xy, yy.
    gram: [f32; 3],
    /// `Σ g d`.
    pull: [f32; 2],
    /// `Σ d²`.
    missed: f32,
    /// `Σ own²`.
    texture: f32,
    /// Mean of `own − other` of a block.
    tone: f32,
}

impl Sums {
    /// Takes a sample: `d = own − other`, `g = ∇own`, and `o = own` less any constant.
    pub(super) fn take(&mut self, d: f32, [gx, gy]: [f32; 2], o: f32) {
        self.count += 1.0;
        let add = |sums: &mut [f32], terms: &[f32]| sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
        add(&mut self.first, &[d, gx, gy, o]);
        add(&mut self.gram, &[gx * gx, gx * gy, gy * gy]);
        add(&mut self.pull, &[gx * d, gy * d]);
        self.missed += d * d;
        self.texture += o * o;
    }

    /// The sums of differences from the means: tone is no displacement.
    pub(super) fn centered(self) -> Self {
        if !(self.count > 0.0) {
            return Self::default();
        }
        let [d, gx, gy, o] = self.first.map(|sum| sum / self.count);
        let ([xx, xy, yy], [px, py], count) = (self.gram, self.pull, self.count);
        Self {
            count,
            first: [0.0; 4],
            gram: [xx - count * gx * gx, xy - count * gx * gy, yy - count * gy * gy],
            pull: [px - count * gx * d, py - count * gy * d],
            missed: (self.missed - count * d * d).max(0.0),
            texture: (self.texture - count * o * o).max(0.0),
            tone: d,
        }
    }

    pub(super) fn plus(self, other: &Self, weight: f32) -> Self {
        let [a, b] = [self, *other];
        Self {
            count: a.count + weight * b.count,
            first: std::array::from_fn(|k| a.first[k] + weight * b.first[k]),
            gram: std::array::from_fn(|k| a.gram[k] + weight * b.gram[k]),
            pull: std::array::from_fn(|k| a.pull[k] + weight * b.pull[k]),
            missed: a.missed + weight * b.missed,
            texture: a.texture + weight * b.texture,
            tone: 0.0,
        }
    }

    /// Share of the texture that the neighbor misses.
    fn disagreement(&self, range: f32) -> f32 {
        let noise = NOISE_SIGMA * range;
        self.missed / (self.texture + self.count * noise * noise)
    }

    /// Weight among other blocks: a quarter where the disagreement is that of a block trusted no more.
    pub(super) fn weight(&self, range: f32) -> f32 {
        if self.count > 0.0 { 1.0 / (1.0 + 3.0 * (self.disagreement(range) / TRUST[1]).powi(2)) } else { 0.0 }
    }

    /// The displacement, at most `longest` px; `damping` is `λ` per sample.
    pub(super) fn solve(&self, damping: f32, longest: f32) -> [f32; 2] {
        let lambda = damping * self.count;
        let ([xx, xy, yy], [px, py]) = (self.gram, self.pull);
        let (xx, yy) = (xx + lambda, yy + lambda);
        let det = xx * yy - xy * xy;
        if !(det > 0.0) {
            return [0.0; 2];
        }
        let d = [(yy * px - xy * py) / det, (xx * py - xy * px) / det];
        let length = d[0].hypot(d[1]);
        d.map(|d| d * (longest / length).min(1.0))
    }

    /// `λ` per sample for blocks that sum up to this.
    pub(super) fn damping(&self) -> f32 {
        DAMPING * (self.gram[0] + self.gram[2]) / (2.0 * self.count.max(1.0))
    }
}

/// Centered sums of each block of the grid at full size.
pub(super) fn overlap(strip: &Strip, luma: &PlaneCanvas, part: &Part, layer: &Rendered) -> Vec<Sums> {
    let mut blocks = vec![Sums::default(); strip.cols * strip.rows];
    for (i, (&slot, &block)) in part.slots.iter().zip(&part.blocks).enumerate() {
        let sums = self::block(&luma.shown, slot, layer, i);
        if sums.count >= MIN_SAMPLES {
            blocks[block] = sums.centered();
        }
    }
    blocks
}

/// Samples of a block with all four neighbors: rows and columns 1 to `BLOCK − 2`.
const N: usize = BLOCK * BLOCK;

/// Sums of block `slot` of what is shown and `i` of a layer; row by row in [`BLOCK`] lanes.
fn block(shown: &Rendered, slot: usize, layer: &Rendered, i: usize) -> Sums {
    let (own, covered) = (&shown.value[slot * N..][..N], &shown.margin[slot * N..][..N]);
    let (other, reached) = (&layer.value[i * N..][..N], &layer.margin[i * N..][..N]);
    if !reached.iter().any(|&m| m >= FEATHER_PX) {
        return Sums::default();
    }
    let mut lanes = [[0.0_f32; BLOCK]; 12];
    for r in 1..BLOCK - 1 {
        for c in 1..BLOCK - 1 {
            let k = r * BLOCK + c;
            let (gx, gy) = (0.5 * (own[k + 1] - own[k - 1]), 0.5 * (own[k + BLOCK] - own[k - BLOCK]));
            let around = covered[k - 1].min(covered[k + 1]).min(covered[k - BLOCK].min(covered[k + BLOCK]));
            let both = covered[k] >= FEATHER_PX && reached[k] >= FEATHER_PX && around > 0.0;
            let w = if both { 1.0 } else { 0.0 };
            let (d, o) = (w * (own[k] - other[k]), w * (own[k] - own[0]));
            let (gx, gy) = (w * gx, w * gy);
            let terms = [w, d, gx, gy, o, gx * gx, gx * gy, gy * gy, gx * d, gy * d, d * d, o * o];
            lanes.iter_mut().zip(terms).for_each(|(lane, term)| lane[c] += term);
        }
    }
    let [count, d, gx, gy, o, xx, xy, yy, px, py, missed, texture] = lanes.map(|lane| lane.iter().sum::<f32>());
    let first = [d, gx, gy, o];
    Sums { count, first, gram: [xx, xy, yy], pull: [px, py], missed, texture, tone: 0.0 }
}

/// All blocks summed, each with its weight.
pub(super) fn total(blocks: &[Sums], part: &Part, range: f32) -> Sums {
    part.blocks.iter().fold(Sums::default(), |sum, &k| sum.plus(&blocks[k], blocks[k].centered().weight(range)))
}

/// Trust of each block from its centered sums; `None` where most of the overlap disagrees, or where there is none.
pub(super) fn trust(strip: &Strip, part: &Part, mut blocks: Vec<Sums>, range: f32) -> Option<Membrane> {
    let known: Vec<bool> = blocks.iter().map(|b| b.count > 0.0).collect();
    let mut tones: Vec<f32> = blocks.iter().zip(&known).filter(|(_, known)| **known).map(|(b, _)| b.tone).collect();
    if tones.is_empty() {
        return None;
    }
    let middle = tones.len() / 2;
    let usual = *tones.select_nth_unstable_by(middle, f32::total_cmp).1;
    for sums in &mut blocks {
        let odd = ((sums.tone - usual).abs() - MAX_TONE_DIFFERENCE * range).max(0.0);
        sums.missed += sums.count * odd * odd;
    }
    let windows = windows(strip, part, &blocks, TRUST_WINDOW);
    let of = |window: &Sums| ((TRUST[1] - window.disagreement(range)) / (TRUST[1] - TRUST[0])).clamp(0.0, 1.0);
    let values: Vec<f32> = windows.iter().zip(&known).map(|(w, &known)| if known { of(w) } else { 0.0 }).collect();
    let enough = values.iter().sum::<f32>() >= MIN_CONFIDENCE * tones.len() as f32;
    enough.then(|| Membrane::new(strip, &part.blocks, values, &known))
}

/// Sums over windows of blocks, rows first.
pub(super) fn windows(strip: &Strip, part: &Part, blocks: &[Sums], radius: usize) -> Vec<Sums> {
    let (cols, rows) = (strip.cols, strip.rows);
    let add = |sum: Sums, block: &Sums| sum.plus(block, 1.0);
    let mut along = vec![Sums::default(); blocks.len()];
    for &k in &part.blocks {
        let (row, i) = (k / cols * cols, k % cols);
        let near = row + i.saturating_sub(radius)..row + (i + radius + 1).min(cols);
        along[k] = blocks[near].iter().fold(Sums::default(), add);
    }
    let mut windows = vec![Sums::default(); blocks.len()];
    for &k in &part.blocks {
        let (i, j) = (k % cols, k / cols);
        let near = j.saturating_sub(radius)..(j + radius + 1).min(rows);
        windows[k] = near.fold(Sums::default(), |sum, l| add(sum, &along[l * cols + i]));
    }
    windows
}
