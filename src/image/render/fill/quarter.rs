//! Luma at a quarter of its size, for the alignment over many pixels.

use rayon::prelude::*;

use super::canvas::{FEATHER_PX, PlaneCanvas};
use super::strip::{BLOCK, Part, Strip};
use crate::Frame;

/// Luma px per sample, along both axes. Larger converges from further away and resolves less; chained motions are
/// seldom off by more than a few of these samples.
pub(super) const SIDE: usize = 4;
/// Samples along a block.
const PER_BLOCK: usize = BLOCK / SIDE;

/// The luma of a frame, each sample the mean of `SIDE × SIDE`.
#[derive(Debug, Default)]
pub(super) struct Quarter {
    width: usize,
    height: usize,
    values: Vec<f32>,
}

impl Quarter {
    /// Empty where the memory cannot be read.
    pub(super) fn of(frame: &Frame) -> Self {
        let (width, height) = (frame.width / SIDE, frame.height / SIDE);
        let row = |y: usize| -> Option<Vec<f32>> {
            let lines = SIDE * y..SIDE * (y + 1);
            if frame.format.bytes_per_sample() == 1 {
                let plane = frame.plane8(0)?;
                Some(means(lines.map(|l| plane.row(l)), width))
            } else {
                let plane = frame.plane16(0)?;
                Some(means(lines.map(|l| plane.row(l)), width))
            }
        };
        let rows: Option<Vec<_>> = (0..height).into_par_iter().map(row).collect();
        rows.map_or_else(Self::default, |rows| Self { width, height, values: rows.concat() })
    }

    /// Between samples, at a position in luma px; `None` beyond the outermost ones.
    fn at(&self, x: f32, y: f32) -> Option<f32> {
        let (u, v) = (x / SIDE as f32 - 0.5, y / SIDE as f32 - 0.5);
        let inside = u >= 0.0 && v >= 0.0 && u < self.width as f32 - 1.0 && v < self.height as f32 - 1.0;
        if !inside {
            return None;
        }
        let (i, j) = (u as usize, v as usize);
        let (s, t) = (u - i as f32, v - j as f32);
        let row = |j: usize| {
            let pair = &self.values[j * self.width + i..][..2];
            pair[0] + s * (pair[1] - pair[0])
        };
        let (top, bottom) = (row(j), row(j + 1));
        Some(top + t * (bottom - top))
    }

    /// Memory of its samples, bytes.
    pub(super) fn bytes(frame: &Frame) -> usize {
        (frame.width / SIDE) * (frame.height / SIDE) * size_of::<f32>()
    }
}

/// Means of `SIDE` lines over `SIDE` columns each.
fn means<'a, S: Copy + Into<u32> + 'a>(lines: impl Iterator<Item = &'a [S]>, width: usize) -> Vec<f32> {
    let mut sums = vec![0_u32; width];
    for line in lines {
        for (sum, four) in sums.iter_mut().zip(line.as_chunks::<SIDE>().0) {
            *sum += four.iter().map(|&v| v.into()).sum::<u32>();
        }
    }
    sums.into_iter().map(|sum| sum as f32 / (SIDE * SIDE) as f32).collect()
}

/// A sample of what the frame shows, with its gradient.
pub(super) struct Sample {
    /// Index of its block in the part, and in the grid.
    pub(super) place: (usize, usize),
    pub(super) own: f32,
    /// Per luma px.
    pub(super) gradient: [f32; 2],
    /// In the output, luma px.
    x: f32,
    y: f32,
    /// In its block, 0 to 1.
    u: f32,
    v: f32,
}

impl Sample {
    /// The neighbor's value there, its blocks displaced by `corners`.
    pub(super) fn other(&self, corners: &[Option<super::strip::Corners>], quarter: &Quarter) -> Option<f32> {
        let [a, b, c, d] = corners[self.place.0]?;
        let between = |axis: usize| {
            let (top, bottom) = (a[axis] + self.u * (b[axis] - a[axis]), c[axis] + self.u * (d[axis] - c[axis]));
            top + self.v * (bottom - top)
        };
        quarter.at(self.x + between(0), self.y + between(1))
    }
}

/// What the canvas shows of a part, at a quarter of the size.
pub(super) fn samples(strip: &Strip, luma: &PlaneCanvas, part: &Part) -> Vec<Sample> {
    let (cols, n) = (strip.cols * PER_BLOCK, BLOCK * BLOCK);
    let mut picture = vec![f32::NAN; cols * strip.rows * PER_BLOCK];
    let start = |block: usize| block / strip.cols * PER_BLOCK * cols + block % strip.cols * PER_BLOCK;
    for (&slot, &block) in part.slots.iter().zip(&part.blocks) {
        let (value, margin) = (&luma.shown.value[slot * n..][..n], &luma.shown.margin[slot * n..][..n]);
        for k in 0..PER_BLOCK * PER_BLOCK {
            picture[start(block) + k / PER_BLOCK * cols + k % PER_BLOCK] = mean(value, margin, k);
        }
    }
    let of_block = |(i, &block): (usize, &usize)| {
        let picture = &picture;
        (0..PER_BLOCK * PER_BLOCK).filter_map(move |k| sample(strip, picture, (i, block), k))
    };
    part.blocks.iter().enumerate().flat_map(of_block).collect()
}

/// Mean of the `k`-th square of a block; NaN where it is not shown fully.
fn mean(value: &[f32], margin: &[f32], k: usize) -> f32 {
    let first = k / PER_BLOCK * SIDE * BLOCK + k % PER_BLOCK * SIDE;
    let rows = |of: &'_ [f32]| -> [[f32; SIDE]; SIDE] {
        std::array::from_fn(|r| std::array::from_fn(|c| of[first + r * BLOCK + c]))
    };
    let shown = rows(margin).as_flattened().iter().all(|&m| m >= FEATHER_PX);
    let sum: f32 = rows(value).as_flattened().iter().sum();
    if shown { sum / (SIDE * SIDE) as f32 } else { f32::NAN }
}

/// The `k`-th sample of a block, where it and its neighbors are shown.
fn sample(strip: &Strip, picture: &[f32], place: (usize, usize), k: usize) -> Option<Sample> {
    let (cols, rows) = (strip.cols * PER_BLOCK, strip.rows * PER_BLOCK);
    let (i, j) = (place.1 % strip.cols * PER_BLOCK + k % PER_BLOCK, place.1 / strip.cols * PER_BLOCK + k / PER_BLOCK);
    if i == 0 || j == 0 || i + 1 >= cols || j + 1 >= rows {
        return None;
    }
    let at = j * cols + i;
    let across = |step: usize| (picture[at + step] - picture[at - step]) / (2 * SIDE) as f32;
    let (own, gradient) = (picture[at], [across(1), across(cols)]);
    let known = own.is_finite() && gradient.iter().all(|g| g.is_finite());
    let center = |i: usize| (i as f32 + 0.5) * SIDE as f32;
    let share = |k: usize| (k as f32 + 0.5) / PER_BLOCK as f32;
    let (u, v) = (share(k % PER_BLOCK), share(k / PER_BLOCK));
    known.then(|| Sample { place, own, gradient, x: center(i), y: center(j), u, v })
}
