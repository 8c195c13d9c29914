//! How a neighbor continues a frame: displaced a little, and trusted where it repeats the frame's texture.
//!
//! On each block `B` of the overlap, with `d = own − other` and `g = ∇own`, both without their means over the block (tone is
//! no displacement), Gauss–Newton takes the displacement `δ` of the neighbor from
//!
//! ```text
//! (Σ w g gᵀ + λ I) δ = Σ w g d,
//! ```
//!
//! summed over the whole overlap first, then over windows of blocks, so that parallax and what the camera's model misses are
//! followed near where they matter. `w` is small for blocks that disagree. What a block misses of its texture once
//! aligned, `Σ d² / Σ (own² + σ²)`, is how far it is trusted.

use rayon::prelude::*;

use super::canvas::Canvas;
use super::layer::{AnySource, Rendered};
use super::membrane::Membrane;
use super::strip::{Corners, Strip};
use crate::image::Frame;
use crate::render::{RenderError, Renderer};
use crate::warp::WarpField;

/// Gauss–Newton steps: the first for the overlap as a whole, the second block by block.
const STEPS: usize = 2;
/// Radius of the window of a block's displacement, blocks. Smaller follows noise, larger misses parallax.
const WINDOW: usize = 3;
/// Radius of the window of a block's trust, blocks: one alone is too noisy to be judged.
const TRUST_WINDOW: usize = 1;
/// `λ` as a share of the mean squared gradient of the overlap, per sample: blocks without texture stay where they are.
const DAMPING: f32 = 0.05;
/// Longest step, px: beyond it the linearisation means nothing.
const LONGEST_STEP_PX: f32 = 3.0;
/// Share of texture missed up to which a block is trusted fully, and from which not at all. Aligned frames of real video
/// miss 0.02 to 0.3, unrelated ones 1 and more.
const TRUST: [f32; 2] = [0.35, 0.7];
/// Standard deviation of noise, as a share of the range, below which texture proves nothing.
const NOISE: f32 = 2.5 / 255.0;
/// Difference from the usual tone, as a share of the range, that counts as missed: something else stands there.
const ODD_TONE: f32 = 16.0 / 255.0;
/// Samples of a block that both must cover.
const ENOUGH: f32 = 48.0;
/// Share of the overlap that must be trusted, or the neighbor is of another scene.
const LEAST_TRUST: f32 = 0.3;

/// A neighbor ready to be shown.
pub(super) struct Aligned {
    /// Its offsets for each block of the strip.
    pub(super) corners: Vec<Option<Corners>>,
    /// Trust in [0, 1] per block.
    pub(super) trust: Membrane,
}

/// Sums over the samples of a block, or of a window of blocks, that both pictures cover.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    count: f32,
    /// `Σ g gᵀ`: xx, xy, yy.
    gram: [f32; 3],
    /// `Σ g d`.
    pull: [f32; 2],
    /// `Σ d²`.
    missed: f32,
    /// `Σ own²`.
    texture: f32,
    /// Mean of `own − other`, not summed over windows.
    tone: f32,
}

impl Aligned {
    /// Aligns `frame`, mapped by `field` from positions in the frame itself; `None` where it shows something else.
    pub(super) fn new(
        renderer: &Renderer,
        strip: &Strip,
        canvas: &Canvas,
        frame: &Frame,
        field: &WarpField,
    ) -> Result<Option<Self>, RenderError> {
        let source = AnySource::new(frame, 0)?;
        let range = ((1_u32 << frame.format.bits) - 1) as f32;
        let patch = canvas.planes[0].patch;
        let mut shift = vec![[0.0; 2]; strip.cols * strip.rows];
        for step in 0..=STEPS {
            let corners = strip.neighbor_corners(field, &shift);
            let shown = |(corners, &overlaps): (&Option<Corners>, &bool)| corners.filter(|_| overlaps);
            let overlapping: Vec<_> = corners.iter().zip(&canvas.planes[0].overlaps).map(shown).collect();
            let layer = patch.render(renderer, &source, strip, &overlapping);
            let blocks = overlap(strip, canvas, &layer, range);
            if step == STEPS {
                return Ok(trust(strip, &blocks, range).map(|trust| Self { corners, trust }));
            }
            if !(blocks.iter().map(|b| b.count).sum::<f32>() > 4.0 * ENOUGH) {
                return Ok(None);
            }
            let moves = if step == 0 { together(&blocks, range) } else { apart(strip, &blocks, range) };
            shift.iter_mut().zip(moves).for_each(|(shift, d)| *shift = [shift[0] + d[0], shift[1] + d[1]]);
        }
        Ok(None)
    }
}

/// Sums of each block of the grid.
fn overlap(strip: &Strip, canvas: &Canvas, layer: &Rendered, range: f32) -> Vec<Sums> {
    let of_strip: Vec<Sums> = (0..strip.blocks.len()).into_par_iter().map(|slot| block(canvas, layer, slot)).collect();
    let mut tones: Vec<f32> = of_strip.iter().filter(|b| b.count > 0.0).map(|b| b.tone).collect();
    let middle = tones.len() / 2;
    let usual = if tones.is_empty() { 0.0 } else { *tones.select_nth_unstable_by(middle, f32::total_cmp).1 };
    let mut blocks = vec![Sums::default(); strip.cols * strip.rows];
    for (&at, mut sums) in strip.blocks.iter().zip(of_strip) {
        let odd = ((sums.tone - usual).abs() - ODD_TONE * range).max(0.0);
        sums.missed += sums.count * odd * odd;
        blocks[at] = sums;
    }
    blocks
}

/// Sums of one block: empty where the overlap is too small.
fn block(canvas: &Canvas, layer: &Rendered, slot: usize) -> Sums {
    let luma = &canvas.planes[0];
    let (n, cols) = (luma.patch.len(), luma.patch.row_len());
    let inner = (slot * n + cols..(slot + 1) * n - cols).filter(|k| (1..cols - 1).contains(&(k % cols)));
    let both = inner.filter(|&k| luma.both(layer, k));
    let own = &luma.own.value;
    // Moments of d, gx, gy and own: subtracting the products of means takes the tone out.
    let mut first = [0.0_f32; 4];
    let mut second = Sums::default();
    for k in both {
        let (gx, gy) = (0.5 * (own[k + 1] - own[k - 1]), 0.5 * (own[k + cols] - own[k - cols]));
        let (d, o) = (own[k] - layer.value[k], own[k] - own[slot * n]);
        second.count += 1.0;
        first = [first[0] + d, first[1] + gx, first[2] + gy, first[3] + o];
        let [xx, xy, yy] = second.gram;
        second.gram = [xx + gx * gx, xy + gx * gy, yy + gy * gy];
        second.pull = [second.pull[0] + gx * d, second.pull[1] + gy * d];
        second.missed += d * d;
        second.texture += o * o;
    }
    if second.count < ENOUGH {
        return Sums::default();
    }
    let [d, gx, gy, o] = first.map(|sum| sum / second.count);
    let ([xx, xy, yy], [px, py], count) = (second.gram, second.pull, second.count);
    Sums {
        count,
        gram: [xx - count * gx * gx, xy - count * gx * gy, yy - count * gy * gy],
        pull: [px - count * gx * d, py - count * gy * d],
        missed: (second.missed - count * d * d).max(0.0),
        texture: (second.texture - count * o * o).max(0.0),
        tone: d,
    }
}

impl Sums {
    fn plus(self, other: &Self, weight: f32) -> Self {
        let [a, b] = [self, *other];
        Self {
            count: a.count + weight * b.count,
            gram: std::array::from_fn(|k| a.gram[k] + weight * b.gram[k]),
            pull: std::array::from_fn(|k| a.pull[k] + weight * b.pull[k]),
            missed: a.missed + weight * b.missed,
            texture: a.texture + weight * b.texture,
            tone: 0.0,
        }
    }

    /// Share of the texture that the neighbor misses.
    fn disagreement(&self, range: f32) -> f32 {
        let noise = NOISE * range;
        self.missed / (self.texture + self.count * noise * noise)
    }

    /// Weight among other blocks: a quarter where the disagreement is that of a block trusted no more.
    fn weight(&self, range: f32) -> f32 {
        if self.count > 0.0 { 1.0 / (1.0 + 3.0 * (self.disagreement(range) / TRUST[1]).powi(2)) } else { 0.0 }
    }

    /// The displacement; `damping` is `λ` per sample.
    fn solve(&self, damping: f32) -> [f32; 2] {
        let lambda = damping * self.count;
        let ([xx, xy, yy], [px, py]) = (self.gram, self.pull);
        let (xx, yy) = (xx + lambda, yy + lambda);
        let det = xx * yy - xy * xy;
        if !(det > 0.0) {
            return [0.0; 2];
        }
        let d = [(yy * px - xy * py) / det, (xx * py - xy * px) / det];
        let length = d[0].hypot(d[1]);
        d.map(|d| d * (LONGEST_STEP_PX / length).min(1.0))
    }
}

/// All blocks of the grid summed, each with its weight.
fn total(blocks: &[Sums], range: f32) -> Sums {
    blocks.iter().fold(Sums::default(), |sum, block| sum.plus(block, block.weight(range)))
}

/// `λ` per sample.
fn damping(total: &Sums) -> f32 {
    DAMPING * (total.gram[0] + total.gram[2]) / (2.0 * total.count.max(1.0))
}

/// One displacement for the overlap as a whole.
fn together(blocks: &[Sums], range: f32) -> Vec<[f32; 2]> {
    let total = total(blocks, range);
    vec![total.solve(1e-3 * damping(&total)); blocks.len()]
}

/// A displacement for the window around each block, continued where there is no overlap.
fn apart(strip: &Strip, blocks: &[Sums], range: f32) -> Vec<[f32; 2]> {
    let damping = damping(&total(blocks, range));
    let weighted: Vec<Sums> = blocks.iter().map(|b| Sums::default().plus(b, b.weight(range))).collect();
    let windows = windows(strip, &weighted, WINDOW);
    let known: Vec<bool> = blocks.iter().map(|b| b.count > 0.0).collect();
    let [x, y] = [0, 1].map(|axis| {
        let values = windows.iter().zip(&known).map(|(w, &known)| if known { w.solve(damping)[axis] } else { 0.0 });
        Membrane::new(strip, values.collect(), &known)
    });
    (0..blocks.len()).map(|k| [x.of_block(k), y.of_block(k)]).collect()
}

/// Trust of each block; `None` where most of the overlap disagrees, or where there is none.
fn trust(strip: &Strip, blocks: &[Sums], range: f32) -> Option<Membrane> {
    let windows = windows(strip, blocks, TRUST_WINDOW);
    let of = |window: &Sums| ((TRUST[1] - window.disagreement(range)) / (TRUST[1] - TRUST[0])).clamp(0.0, 1.0);
    let known: Vec<bool> = blocks.iter().map(|b| b.count > 0.0).collect();
    let values: Vec<f32> = windows.iter().zip(&known).map(|(w, &known)| if known { of(w) } else { 0.0 }).collect();
    let count = known.iter().filter(|&&known| known).count() as f32;
    (count > 0.0 && values.iter().sum::<f32>() >= LEAST_TRUST * count).then(|| Membrane::new(strip, values, &known))
}

/// Sums over windows of blocks, rows first.
fn windows(strip: &Strip, blocks: &[Sums], radius: usize) -> Vec<Sums> {
    let (cols, rows) = (strip.cols, strip.rows);
    let add = |sum: Sums, block: &Sums| sum.plus(block, 1.0);
    let mut along = vec![Sums::default(); blocks.len()];
    for &k in &strip.blocks {
        let (row, i) = (k / cols * cols, k % cols);
        let near = row + i.saturating_sub(radius)..row + (i + radius + 1).min(cols);
        along[k] = blocks[near].iter().fold(Sums::default(), add);
    }
    let mut windows = vec![Sums::default(); blocks.len()];
    for &k in &strip.blocks {
        let (i, j) = (k % cols, k / cols);
        let near = j.saturating_sub(radius)..(j + radius + 1).min(rows);
        windows[k] = near.fold(Sums::default(), |sum, l| add(sum, &along[l * cols + i]));
    }
    windows
}
