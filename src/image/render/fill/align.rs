//! Alignment of a neighbor with the filled frame: a local displacement, and a trust from the agreement of textures.
//!
//! With `d = own − other` and `g = ∇own`, both without their means over a window (tone is no displacement), Gauss–Newton
//! takes the displacement `δ` of the neighbor from
//!
//! ```text
//! (Σ w g gᵀ + λ I) δ = Σ w g d,
//! ```
//!
//! first at a quarter of the size, where chained motions that are off by several pixels are still within reach, summed
//! over the whole overlap and then over windows of blocks, so that parallax and what the camera's model misses are
//! followed near where they matter; then at full size. `w` is small for blocks that disagree. What a window misses of its
//! texture once aligned, `Σ d² / Σ (own² + σ²)`, is how far it is trusted.

use super::canvas::Canvas;
use super::choose::Neighbor;
use super::layer::{AnySource, Rendered};
use super::membrane::Membrane;
use super::quarter::{SIDE, Sample, samples};
use super::strip::{Corners, Part, Strip};
use super::sums::{MIN_SAMPLES, Sums, overlap, total, trust, windows};
use crate::render::{RenderError, Renderer};

/// Gauss–Newton iterations at a quarter of the size: for the overlap as a whole, and block by block.
const COARSE_ITERATIONS: [usize; 2] = [2, 2];
/// Radius of the window of a block's displacement, blocks. Smaller follows noise, larger misses parallax.
const WINDOW: usize = 3;
/// Maximum step, samples: beyond it the linearization is invalid.
const MAX_STEP: f32 = 3.0;
/// Minimum number of coarse samples of a block that both cover: half of them.
const MIN_COARSE_SAMPLES: f32 = 8.0;

/// A neighbor ready to be shown.
pub(super) struct Aligned {
    /// The blocks it was asked for.
    pub(super) part: Part,
    /// Its offsets for each of them.
    pub(super) corners: Vec<Option<Corners>>,
    /// Its luma there.
    pub(super) luma: Rendered,
    /// Trust in [0, 1] per block; `None`: it disagrees nearly everywhere.
    pub(super) trust: Option<Membrane>,
    /// The same at a quarter of the size, blind to fine texture.
    pub(super) coarse_trust: Membrane,
}

/// What alignment compares.
struct Comparison<'a> {
    strip: &'a Strip,
    part: &'a Part,
    neighbor: &'a Neighbor<'a>,
    samples: Vec<Sample>,
    /// Largest sample value.
    range: f32,
}

impl Aligned {
    /// Aligns a neighbor on `part`; `None` where it shows something else.
    pub(super) fn new(
        renderer: &Renderer,
        strip: &Strip,
        canvas: &Canvas,
        part: Part,
        neighbor: &Neighbor<'_>,
    ) -> Result<Option<Self>, RenderError> {
        let (luma, frame) = (&canvas.planes[0], &*neighbor.held.frame);
        let source = AnySource::new(frame, 0)?;
        let range = ((1_u32 << frame.format.bits) - 1) as f32;
        let compared = Comparison { strip, part: &part, neighbor, samples: samples(strip, luma, &part), range };
        let Some(mut shift) = compared.coarsely() else { return Ok(None) };
        let corners = compared.corners(&shift);
        let shown = |(corners, &slot): (&Option<Corners>, &usize)| corners.filter(|_| luma.overlaps[slot]);
        let overlapping: Vec<_> = corners.iter().zip(&part.slots).map(shown).collect();
        let layer = luma.patch.render(renderer, &source, strip, (&part.blocks, &overlapping));
        add(&mut shift, &compared.apart(&overlap(strip, luma, &part, &layer), MAX_STEP));
        let corners = compared.corners(&shift);
        let luma_of = luma.patch.render(renderer, &source, strip, (&part.blocks, &corners));
        let coarse = compared.coarse(&corners).into_iter().map(Sums::centered).collect();
        let Some(coarse_trust) = trust(strip, &part, coarse, range) else { return Ok(None) };
        let trust = trust(strip, &part, overlap(strip, luma, &part, &luma_of), range);
        Ok(Some(Self { part, corners, luma: luma_of, trust, coarse_trust }))
    }
}

impl Comparison<'_> {
    /// Displacements by the pictures at a quarter of the size, one per block of the grid.
    fn coarsely(&self) -> Option<Vec<[f32; 2]>> {
        let mut shift = vec![[0.0; 2]; self.strip.cols * self.strip.rows];
        for step in 0..COARSE_ITERATIONS.iter().sum() {
            let blocks = self.coarse(&self.corners(&shift));
            if !(blocks.iter().map(|b| b.count).sum::<f32>() > 4.0 * MIN_SAMPLES / (SIDE * SIDE) as f32) {
                return None;
            }
            let longest = MAX_STEP * SIDE as f32;
            let moves = if step < COARSE_ITERATIONS[0] {
                self.together(&blocks, longest)
            } else {
                self.apart(&blocks, longest)
            };
            add(&mut shift, &moves);
        }
        Some(shift)
    }

    fn corners(&self, shift: &[[f32; 2]]) -> Vec<Option<Corners>> {
        self.strip.neighbor_corners(&self.neighbor.field, shift, &self.part.blocks)
    }

    /// Sums of each block of the grid at a quarter of the size.
    fn coarse(&self, corners: &[Option<Corners>]) -> Vec<Sums> {
        let mut blocks = vec![Sums::default(); self.strip.cols * self.strip.rows];
        let usual = 0.5 * self.range;
        for sample in &self.samples {
            if let Some(other) = sample.other(corners, &self.neighbor.held.quarter) {
                blocks[sample.place.1].take(sample.own - other, sample.gradient, sample.own - usual);
            }
        }
        blocks.iter_mut().filter(|b| b.count < MIN_COARSE_SAMPLES).for_each(|b| *b = Sums::default());
        blocks
    }

    /// One displacement for the overlap as a whole.
    fn together(&self, blocks: &[Sums], longest: f32) -> Vec<[f32; 2]> {
        let total = total(blocks, self.part, self.range).centered();
        vec![total.solve(1e-3 * total.damping(), longest); blocks.len()]
    }

    /// A displacement for the window around each block, continued where there is no overlap.
    fn apart(&self, blocks: &[Sums], longest: f32) -> Vec<[f32; 2]> {
        let damping = total(blocks, self.part, self.range).centered().damping();
        let weighted = blocks.iter().map(|b| Sums::default().plus(b, b.centered().weight(self.range)));
        let windows = windows(self.strip, self.part, &weighted.collect::<Vec<_>>(), WINDOW);
        let known: Vec<bool> = blocks.iter().map(|b| b.count > 0.0).collect();
        let solved = |(w, &known): (&Sums, &bool)| if known { w.centered().solve(damping, longest) } else { [0.0; 2] };
        let moves: Vec<[f32; 2]> = windows.iter().zip(&known).map(solved).collect();
        let [x, y] = [0, 1].map(|axis| {
            let values = moves.iter().map(|d| d[axis]).collect();
            Membrane::new(self.strip, &self.part.blocks, values, &known)
        });
        (0..blocks.len()).map(|k| [x.of_block(k), y.of_block(k)]).collect()
    }
}

fn add(shift: &mut [[f32; 2]], moves: &[[f32; 2]]) {
    shift.iter_mut().zip(moves).for_each(|(shift, d)| *shift = [shift[0] + d[0], shift[1] + d[1]]);
}
