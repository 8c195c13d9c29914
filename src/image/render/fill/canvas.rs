//! The composition of a frame's strip, front to back, plane by plane.

use rayon::prelude::*;

use super::align::Aligned;
use super::choose::{Neighbor, RIM_PX};
use super::layer::{AnySource, Patch, Rendered};
use super::membrane::Membrane;
use super::strip::{Corners, Part, Strip};
use crate::Frame;
use crate::render::{RenderError, Renderer};

/// Width of a feather, luma px. Narrower shows a line where tone differs within a block; wider shows double contours
/// where alignment is off by a pixel.
pub(super) const FEATHER_PX: f32 = 8.0;
/// Total weight of neighbors below which the border fades in. Smaller shows an edge where the last neighbor ends,
/// larger lets the border shine through half-trusted neighbors.
const BORDER_FADE: f32 = 0.25;
/// Minimum fraction of a block's samples that both pictures cover for a mean.
const MIN_COVERAGE: f32 = 0.125;
/// Trust below which a block is not shown, nor used for the tone.
const MIN_TRUST: f32 = 0.5;
/// Trust from which a block is shown fully.
const FULL_TRUST: f32 = 0.75;
/// Weight left to later layers below which a sample counts as covered.
const MAX_REMAINDER: f32 = 0.02;

/// The strip of a frame with the layers of its neighbors.
pub(super) struct Canvas {
    pub(super) planes: Vec<PlaneCanvas>,
    uncovered: f64,
}

/// One plane: the samples of each block of the strip, row by row, block after block.
pub(super) struct PlaneCanvas {
    pub(super) patch: Patch,
    /// The frame itself.
    own: Rendered,
    /// The frame and the layers so far, with a margin of [`FEATHER_PX`] where those cover fully: what the next layer has to
    /// continue.
    pub(super) shown: Rendered,
    /// For each block, whether any of it is shown fully.
    pub(super) overlaps: Vec<bool>,
    /// Colors of the neighbors times their weights.
    sum: Vec<f32>,
    /// Weight that no layer has taken yet.
    rest: Vec<f32>,
}

impl Canvas {
    /// The canvas with the frame itself in front.
    pub(super) fn new(strip: &Strip, dst: &Frame) -> Result<Self, RenderError> {
        let corners = strip.own_corners();
        let planes = (0..dst.format.planes()).map(|i| PlaneCanvas::new(strip, dst, i, &corners));
        let mut canvas = Self { planes: planes.collect::<Result<_, _>>()?, uncovered: 0.0 };
        canvas.uncovered = canvas.left(strip);
        Ok(canvas)
    }

    /// Share of the frame that it does not cover itself.
    pub(super) fn uncovered(&self) -> f64 {
        self.uncovered
    }

    /// Share of the frame that the layers so far do not cover.
    pub(super) fn left(&self, strip: &Strip) -> f64 {
        let luma = &self.planes[0];
        // In its feather the frame itself is shown.
        let is_open = |(rest, margin): &(&f32, &f32)| **rest > 0.5 && **margin <= 0.0;
        let open = luma.rest.iter().zip(&luma.own.margin).filter(is_open).count();
        open as f64 / (strip.size.0 * strip.size.1) as f64
    }

    /// Which probes the layers so far do not cover.
    pub(super) fn left_probes(&self, strip: &Strip) -> Vec<bool> {
        let luma = &self.planes[0];
        let open = |(slot, sample): (usize, usize)| luma.rest[slot * luma.patch.len() + sample] > 0.5;
        strip.probes.iter().map(|probe| open(probe.at)).collect()
    }

    /// The blocks that are not covered yet, and those along them.
    pub(super) fn part(&self, strip: &Strip) -> Part {
        let luma = &self.planes[0];
        let open: Vec<bool> = luma.rest.chunks(luma.patch.len()).map(|rest| rest.iter().any(|&r| r > 0.5)).collect();
        strip.part(&open)
    }

    /// Adds a neighbor behind the layers so far, as far as it is trusted.
    pub(super) fn add(
        &mut self,
        renderer: &Renderer,
        strip: &Strip,
        neighbor: &Neighbor<'_>,
        aligned: &Aligned,
        trust: &Membrane,
    ) -> Result<(), RenderError> {
        let part = &aligned.part;
        let (luma, chroma) = self.planes.split_at_mut(1);
        luma[0].add(strip, part, &aligned.luma, trust);
        for (i, plane) in (1..).zip(chroma) {
            let source = AnySource::new(&neighbor.held.frame, i)?;
            let layer = plane.patch.render(renderer, &source, strip, (&part.blocks, &aligned.corners));
            plane.add(strip, part, &layer, trust);
        }
        Ok(())
    }

    /// Writes the strip to the frame.
    pub(super) fn write(&self, strip: &Strip, dst: &mut Frame) -> Result<(), RenderError> {
        let max = ((1_u32 << dst.format.bits) - 1) as f32;
        for (i, plane) in self.planes.iter().enumerate() {
            plane.patch.write(strip, &plane.finished(strip, max), dst, i)?;
        }
        Ok(())
    }
}

impl PlaneCanvas {
    fn new(strip: &Strip, dst: &Frame, i: usize, corners: &[Option<Corners>]) -> Result<Self, RenderError> {
        let patch = Patch::new(dst, i);
        let own = patch.read(strip, dst, i, corners)?;
        let n = patch.len();
        let open = |k: usize| if patch.in_frame(strip, strip.blocks[k / n], k % n) { 1.0 } else { 0.0 };
        let rest = own.margin.iter().enumerate().map(|(k, &m)| open(k) * (1.0 - feather(m))).collect();
        let overlaps = own.margin.chunks(n).map(covers_any).collect();
        Ok(Self { patch, sum: vec![0.0; own.margin.len()], rest, shown: own.clone(), own, overlaps })
    }

    fn add(&mut self, strip: &Strip, part: &Part, layer: &Rendered, trust: &Membrane) {
        let tone = self.tone(strip, part, layer, trust);
        let (n, patch) = (self.patch.len(), self.patch);
        for (i, (&slot, &block)) in part.slots.iter().zip(&part.blocks).enumerate() {
            let (sum, rest) = (&mut self.sum[slot * n..][..n], &mut self.rest[slot * n..][..n]);
            let (value, margin) = (&layer.value[i * n..][..n], &layer.margin[i * n..][..n]);
            let mut changed = false;
            for (k, rest) in rest.iter_mut().enumerate() {
                let weight = feather(margin[k] - RIM_PX);
                if *rest > 0.0 && weight > 0.0 {
                    let (u, v) = patch.place(strip, block, k);
                    let share = *rest * weight * certain(trust.at(u, v));
                    sum[k] += share * (value[k] + tone.at(u, v));
                    *rest -= share;
                    changed |= share > 0.0;
                }
            }
            if changed {
                self.show(slot);
            }
        }
    }

    /// Brings up to date what is shown in a block.
    fn show(&mut self, slot: usize) {
        let n = self.patch.len();
        for k in slot * n..(slot + 1) * n {
            if self.rest[k] < MAX_REMAINDER && self.own.margin[k] < FEATHER_PX && self.own.margin[k] > f32::NEG_INFINITY
            {
                (self.shown.value[k], self.shown.margin[k]) = (self.value(k, 0.0), FEATHER_PX);
            }
        }
        self.overlaps[slot] = covers_any(&self.shown.margin[slot * n..][..n]);
    }

    /// The difference `shown − layer` of blocks that both cover, continued over the part.
    fn tone(&self, strip: &Strip, part: &Part, layer: &Rendered, trust: &Membrane) -> Membrane {
        let n = self.patch.len();
        let (mut values, mut known) = (vec![0.0; strip.cols * strip.rows], vec![false; strip.cols * strip.rows]);
        for (i, (&slot, &block)) in part.slots.iter().zip(&part.blocks).enumerate() {
            if !(self.overlaps[slot] && trust.of_block(block) >= MIN_TRUST) {
                continue;
            }
            let (mut sum, mut count) = (0.0_f32, 0.0_f32);
            for k in 0..n {
                let (own, other) = (slot * n + k, i * n + k);
                let both = self.shown.margin[own] >= FEATHER_PX && layer.margin[other] >= FEATHER_PX;
                let w = if both { 1.0 } else { 0.0 };
                sum += w * (self.shown.value[own] - layer.value[other]);
                count += w;
            }
            if count >= MIN_COVERAGE * n as f32 {
                (values[block], known[block]) = (sum / count, true);
            }
        }
        Membrane::new(strip, &part.blocks, values, &known)
    }

    /// All samples; where layers end, the border continues their tone.
    fn finished(&self, strip: &Strip, max: f32) -> Vec<f32> {
        let (n, patch, tone) = (self.patch.len(), self.patch, self.border_tone(strip));
        let mut values = vec![0.0; self.sum.len()];
        values.par_chunks_mut(n).zip(&strip.blocks).enumerate().for_each(|(slot, (values, &block))| {
            for (k, value) in values.iter_mut().enumerate() {
                let at = slot * n + k;
                let tone = if self.rest[at] > 0.0 {
                    let (u, v) = patch.place(strip, block, k);
                    tone.at(u, v)
                } else {
                    0.0
                };
                *value = self.value(at, tone).clamp(0.0, max);
            }
        });
        values
    }

    /// The difference `shown − own` of blocks that are shown, continued to where only the border is left.
    fn border_tone(&self, strip: &Strip) -> Membrane {
        let n = self.patch.len();
        let (mut values, mut known) = (vec![0.0; strip.cols * strip.rows], vec![false; strip.cols * strip.rows]);
        for (slot, &block) in strip.blocks.iter().enumerate().filter(|&(slot, _)| self.overlaps[slot]) {
            let shown = (slot * n..(slot + 1) * n).filter(|&k| self.shown.margin[k] >= FEATHER_PX);
            let difference = |k: usize| self.shown.value[k] - self.own.value[k];
            let (sum, count) = shown.fold((0.0, 0.0), |(sum, count), k| (sum + difference(k), count + 1.0));
            if count >= MIN_COVERAGE * n as f32 {
                (values[block], known[block]) = (sum / count, true);
            }
        }
        Membrane::new(strip, &strip.blocks, values, &known)
    }

    /// Where neighbors contributed: inside the frame, its own color has the weight that they have not taken; outside, where
    /// that color is only a border, brought to their tone, they share nearly all of it.
    fn value(&self, k: usize, border_tone: f32) -> f32 {
        let (own, alpha) = (self.own.value[k], feather(self.own.margin[k]));
        let behind = own + (1.0 - alpha) * border_tone;
        let placed = 1.0 - alpha - self.rest[k];
        if !(placed > 1e-6) {
            return behind;
        }
        let fade = (placed / BORDER_FADE).min(1.0 - alpha);
        behind + fade * (self.sum[k] / placed - behind)
    }
}

/// Weight of a layer by its trust. What reaches a place from trusted blocks further away than from refused ones is not
/// shown: half shown it would be a ghost.
fn certain(trust: f32) -> f32 {
    ((trust - MIN_TRUST) / (FULL_TRUST - MIN_TRUST)).clamp(0.0, 1.0)
}

/// Some sample is covered fully.
fn covers_any(margins: &[f32]) -> bool {
    margins.iter().any(|&m| m >= FEATHER_PX)
}

/// Weight of a layer at a distance from its edge, px.
fn feather(margin: f32) -> f32 {
    (margin / FEATHER_PX).clamp(0.0, 1.0)
}
