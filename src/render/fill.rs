//! Full frames: what the shake pushed out of view is taken from neighboring frames.
//!
//! Each layer (the frame itself, then its neighbors in the order given) covers an output sample with weight
//!
//! ```text
//! α = clamp(m / F, 0, 1),    m = distance of its source position to the edge of its source, px,
//! ```
//!
//! and layers are composed front to back, `Σₖ αₖ Πⱼ₍ⱼ﹤ₖ₎ (1 − αⱼ) cₖ`, so that each ends in a feather of `F` px instead of a
//! seam. Beyond the frame itself the sum is divided by the weight its neighbors took, so that their own feathers do not let
//! the border shine through. The colors `cₖ` of a neighbor are corrected by the [`Tone`] that continues its difference to the frame itself. A
//! neighbor that does not repeat the texture of the overlap (another shot, parallax, motion blur) is left out. What no
//! layer covers keeps the border that the frame was rendered with.

use rayon::prelude::*;

use super::scan::Siting;
use super::source::Sample;
use super::tone::{BLOCK, BlockSums, Tone, disagreement};
use super::{RenderError, Renderer};
use crate::image::{Frame, PlaneRef};
use crate::warp::Lattice;

/// Width of a feather, luma px. Narrower shows a line where tone differs within a block; wider shows double contours
/// where alignment is off by a pixel.
const FEATHER_PX: f32 = 8.0;
/// Samples this near to the edge of a neighbor do not count: kernels mix them with its border.
const RIM_PX: f32 = 2.0;
/// Weight of all neighbors together below which the border fades in. Smaller shows where the last neighbor ends.
const FADE: f32 = 0.25;
/// Largest share of texture that a neighbor may miss. Aligned frames of real video miss 0.02 to 0.3, unrelated ones 1 and
/// more.
const MAX_DISAGREEMENT: f32 = 0.5;
/// Standard deviation of noise, as a share of the range, below which texture proves nothing.
const NOISE: f32 = 2.0 / 255.0;
/// A neighbor that adds less than this share of the samples is not worth rendering.
const LEAST_GAIN: f32 = 2e-4;

/// A frame from which a border can be filled.
#[derive(Clone, Copy, Debug)]
pub struct Neighbor<'a> {
    /// Its pixels, in the format and size of the frame to fill.
    pub frame: &'a Frame,
    /// Where each output position of the frame to fill lies in it: its motion relative to that frame composed with that
    /// frame's own field.
    pub src_from_out: &'a Lattice,
}

/// What a call of [`Renderer::fill`] did, in shares of the luma samples, 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FillReport {
    /// Not covered by the frame itself.
    pub uncovered: f64,
    /// Covered by no neighbor either: these kept their border.
    pub left: f64,
    /// Neighbors that were composed.
    pub used: usize,
}

/// Composition of one plane, front to back.
struct Canvas {
    siting: Siting,
    width: usize,
    height: usize,
    /// Weight of the frame itself.
    alpha: Vec<f32>,
    /// Colors of the neighbors times their weights.
    sum: Vec<f32>,
    /// Weight that no layer has taken yet.
    rest: Vec<f32>,
}

impl Renderer {
    /// Fills what `dst`, rendered before through `own`, does not cover from `neighbors`, the best first.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn fill(&self, dst: &mut Frame, own: &Lattice, neighbors: &[Neighbor<'_>]) -> Result<FillReport, RenderError> {
        super::check(dst, own, dst)?;
        let mut canvases: Vec<Canvas> = (0..dst.format.planes()).map(|i| Canvas::new(dst, own, i)).collect();
        let uncovered = canvases[0].left();
        let (mut left, mut used) = (uncovered, 0);
        let mut other = Frame::new(dst.format, dst.width, dst.height);
        for neighbor in neighbors {
            let weights: Vec<Vec<f32>> = canvases.iter().map(|c| c.weights(neighbor.src_from_out, RIM_PX)).collect();
            if left < f64::from(LEAST_GAIN) || canvases[0].gain(&weights[0]) < f64::from(LEAST_GAIN) {
                continue;
            }
            self.render(neighbor.frame, neighbor.src_from_out, &mut other)?;
            if compose(dst, &other, &mut canvases, &weights)? {
                used += 1;
                left = canvases[0].left();
            }
        }
        for (i, canvas) in canvases.iter().enumerate().filter(|_| used > 0) {
            write_plane(canvas, dst, i)?;
        }
        Ok(FillReport { uncovered, left, used })
    }
}

/// Adds `other` to the canvases unless it disagrees with `dst`; true where it was added.
fn compose(dst: &Frame, other: &Frame, canvases: &mut [Canvas], weights: &[Vec<f32>]) -> Result<bool, RenderError> {
    let noise = NOISE * ((1_u32 << dst.format.bits) - 1) as f32;
    for (i, (canvas, weights)) in canvases.iter_mut().zip(weights).enumerate() {
        let unreadable = || RenderError::Plane { plane: i, role: "destination" };
        let agreed = if dst.format.bytes_per_sample() == 1 {
            let planes = (dst.plane8(i).ok_or_else(unreadable)?, other.plane8(i).ok_or_else(unreadable)?);
            canvas.add(planes, weights, (i == 0).then_some(noise))
        } else {
            let planes = (dst.plane16(i).ok_or_else(unreadable)?, other.plane16(i).ok_or_else(unreadable)?);
            canvas.add(planes, weights, (i == 0).then_some(noise))
        };
        if !agreed {
            return Ok(false);
        }
    }
    Ok(true)
}

fn write_plane(canvas: &Canvas, dst: &mut Frame, i: usize) -> Result<(), RenderError> {
    let max = ((1_u32 << dst.format.bits) - 1) as f32;
    let unwritable = RenderError::Plane { plane: i, role: "destination" };
    if dst.format.bytes_per_sample() == 1 {
        let (data, stride) = dst.plane8_mut(i).ok_or(unwritable)?.into_data();
        canvas.write(data, stride, max);
    } else {
        let (data, stride) = dst.plane16_mut(i).ok_or(unwritable)?.into_data();
        canvas.write(data, stride, max);
    }
    Ok(())
}

impl Canvas {
    /// The canvas of plane `i` with the frame itself in front; its color is added when the plane is written.
    fn new(dst: &Frame, own: &Lattice, i: usize) -> Self {
        let (width, height) = dst.format.plane_size(i, dst.width, dst.height);
        let siting = Siting::of(dst.format, &dst.color, i);
        let sum = vec![0.0; width * height];
        let mut canvas = Self { siting, width, height, alpha: Vec::new(), sum, rest: Vec::new() };
        canvas.alpha = canvas.weights(own, 0.0);
        canvas.rest = canvas.alpha.iter().map(|a| 1.0 - a).collect();
        canvas
    }

    /// Weight `α` of a layer at each sample, 0 within `rim` luma px of its edge.
    fn weights(&self, lattice: &Lattice, rim: f32) -> Vec<f32> {
        let mut weights = vec![0.0; self.width * self.height];
        let (right, bottom) = ((self.width - 1) as f32, (self.height - 1) as f32);
        let scale = self.siting.luma_px();
        weights.par_chunks_mut(self.width).enumerate().for_each_init(
            || (vec![0; self.width], vec![0; self.width]),
            |(xs, ys), (j, row)| {
                self.siting.positions(lattice, j, xs, ys);
                for ((weight, &x), &y) in row.iter_mut().zip(&*xs).zip(&*ys) {
                    let (x, y) = (x as f32 / 256.0, y as f32 / 256.0);
                    let margin = (x.min(right - x) * scale.0).min(y.min(bottom - y) * scale.1);
                    *weight = ((margin - rim) / FEATHER_PX).clamp(0.0, 1.0);
                }
            },
        );
        weights
    }

    /// Share of samples that the layers so far do not cover.
    fn left(&self) -> f64 {
        share(self.rest.iter().filter(|&&r| r > 0.5).count(), self.rest.len())
    }

    /// Share of samples that another layer would cover first.
    fn gain(&self, weights: &[f32]) -> f64 {
        share(self.rest.iter().zip(weights).filter(|&(&r, &a)| r > 0.5 && a > 0.5).count(), self.rest.len())
    }

    /// Adds a layer behind the ones so far. With `noise` given, refuses one that disagrees with the overlap.
    fn add<S: Sample>(
        &mut self,
        planes: (PlaneRef<'_, S>, PlaneRef<'_, S>),
        weights: &[f32],
        noise: Option<f32>,
    ) -> bool {
        let (own, other) = planes;
        let blocks = self.block_sums(own, other, weights);
        if noise.is_some_and(|sigma| disagreement(&blocks, sigma * sigma) > MAX_DISAGREEMENT) {
            return false;
        }
        let tone = Tone::new(&blocks, self.width.div_ceil(BLOCK));
        let rows = self.sum.par_chunks_mut(self.width).zip(self.rest.par_chunks_mut(self.width));
        rows.zip(weights.par_chunks(self.width)).enumerate().for_each(|(y, ((sum, rest), weights))| {
            let row = other.row(y);
            for (x, &weight) in weights.iter().enumerate() {
                let share = rest[x] * weight;
                if share > 0.0 {
                    sum[x] += share * (row[x].to_i32() as f32 + tone.at(x, y));
                    rest[x] -= share;
                }
            }
        });
        true
    }

    /// Sums over the overlap of the frame itself and a layer, per block.
    fn block_sums<S: Sample>(&self, own: PlaneRef<'_, S>, other: PlaneRef<'_, S>, weights: &[f32]) -> Vec<BlockSums> {
        let cols = self.width.div_ceil(BLOCK);
        let mut blocks = vec![BlockSums::default(); cols * self.height.div_ceil(BLOCK)];
        blocks.par_chunks_mut(cols).enumerate().for_each(|(j, blocks)| {
            for y in j * BLOCK..((j + 1) * BLOCK).min(self.height) {
                let (a, b) = (own.row(y), other.row(y));
                let line = y * self.width..(y + 1) * self.width;
                for (x, (&alpha, &weight)) in self.alpha[line.clone()].iter().zip(&weights[line]).enumerate() {
                    if alpha == 1.0 && weight == 1.0 {
                        blocks[x / BLOCK].add(a[x].to_i32() as f32, b[x].to_i32() as f32);
                    }
                }
            }
        });
        blocks
    }

    /// Writes the composition where neighbors contributed. Inside the frame, its own color has the weight that they have
    /// not taken; outside, where that color is only a border, they share all of it.
    fn write<S: Sample>(&self, data: &mut [S], stride: usize, max: f32) {
        let end = data.len().min(stride * self.height);
        data[..end].par_chunks_mut(stride).enumerate().for_each(|(y, row)| {
            let line = y * self.width..(y + 1) * self.width;
            let weights = self.alpha[line.clone()].iter().zip(&self.rest[line.clone()]);
            for ((sample, &sum), (&alpha, &rest)) in row.iter_mut().zip(&self.sum[line]).zip(weights) {
                let (own, placed) = (sample.to_i32() as f32, 1.0 - alpha - rest);
                if placed > 0.0 {
                    let fade = if alpha > 0.0 { placed } else { (placed / FADE).min(1.0) };
                    let value = own + fade * (sum / placed - own);
                    *sample = S::from_i32(value.clamp(0.0, max).round_ties_even() as i32);
                }
            }
        });
    }
}

fn share(part: usize, whole: usize) -> f64 {
    part as f64 / whole.max(1) as f64
}
