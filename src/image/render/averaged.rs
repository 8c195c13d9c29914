//! Where the map shrinks: the mean over each output pixel's area.
//!
//! A kernel that interpolates passes frequencies of the source that the output cannot show; where one output pixel spans
//! `m > 1` source pixels they fold back as moiré. The value of a pixel is then the mean of samples spread evenly over its area. With
//! `u` and `v` the columns of the Jacobian in a lattice cell, the source px that a step of one output px along x and y spans, the
//! area is that of the upright rectangle with the same second moments, of sides
//!
//! ```text
//! w(mₓ) and w(m_y),    mₓ = √(uₓ² + vₓ²),  m_y = √(u_y² + v_y²),    w(m) = m · clamp((m − 1.2) / 0.8, 0, 1):
//! ```
//!
//! exact for maps that scale both ways alike, however they rotate, and for those that scale along the axes, as retargeted pictures do. The
//! spread `w` grows from 0, so that nothing shows where the mean sets in: below `m = 1.2` the result is that of
//! [`Renderer::render`], bit for bit.
//!
//! Along each axis `2n` samples are taken, `n = ⌈m / 2.9⌉`, at most 1.45 px apart. Neighbors are taken two at a time: the mean of two samples
//! of a four-tap kernel is one sample of a kernel of six ([`PairTable`](super::kernel::PairTable)). Up to `m = 2.9` a pixel
//! therefore is a single sample.
//!
//! # Reference
//! P. Heckbert, *Fundamentals of texture mapping and image warping*, UC Berkeley (1989), section 3.5, on the moments of a pixel's
//! footprint.

use rayon::prelude::*;

use super::kernel::{MAX_PAIR_PX, PHASES, pair_rows};
use super::plane::{Band, Job};
use super::scan::Cells;
use super::source::{Pairs, Sample, Source};
use super::{RenderError, Renderer, check};
use crate::Frame;
use crate::warp::Lattice;
use plumbline_num::run::Run;

#[cfg(target_arch = "x86_64")]
use super::avx2::Kernels;
#[cfg(not(target_arch = "x86_64"))]
use super::source::Sample as Kernels;

/// Scale (source px per output px) from which samples are spread over the pixel, and the range over which the spread
/// grows to the full pixel.
const MIN_SCALE: f32 = 1.2;
const SCALE_RANGE: f32 = 0.8;
/// Maximum number of pairs of samples of a mean along an axis: bounds the time of extreme scales.
const MAX_PAIRS: f32 = 32.0;
/// Maximum lattice cell, px.
const MAX_CELL_PX: usize = 32;

/// Samples of the pixels in a lattice cell along one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Spread {
    /// Pairs of samples.
    pairs: u16,
    /// First row of the weights of a pair.
    rows: u16,
    /// Length over which they are spread, units of 1/256 px.
    width: f32,
}

impl Spread {
    const NONE: Self = Self { pairs: 1, rows: 0, width: 0.0 };

    /// For a pixel that spans `m` source pixels.
    fn of(m: f32) -> Self {
        if !(m > MIN_SCALE && m.is_finite()) {
            return Self::NONE;
        }
        let width = m * ((m - MIN_SCALE) / SCALE_RANGE).min(1.0);
        let pairs = (0.5 * m / MAX_PAIR_PX).ceil().clamp(1.0, MAX_PAIRS);
        Self { pairs: pairs as u16, rows: pair_rows(0.5 * width / pairs) as u16, width: width * PHASES as f32 }
    }

    /// Offset of pair `a` from the pixel's center, units of 1/256 px.
    fn offset(self, a: u16) -> i32 {
        (((f32::from(a) + 0.5) / f32::from(self.pairs) - 0.5) * self.width).round() as i32
    }
}

/// What the pixels of a cell are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// Interpolated.
    Plain,
    /// The mean of one pair of samples along each axis.
    Pair,
    /// The mean of more.
    Many,
}

/// Spread of every lattice cell, x and y, row by row; none of rows in which nothing is spread.
#[derive(Debug)]
pub(super) struct Spreads {
    rows: Vec<Vec<[Spread; 2]>>,
}

/// The length of a vector; `hypot` takes care of ranges that scales do not have, at ten times the time.
fn length(x: f32, y: f32) -> f32 {
    (x * x + y * y).sqrt()
}

impl Spreads {
    /// Those of a lattice; `None` where nothing is spread.
    pub(super) fn of(lattice: &Lattice) -> Option<Self> {
        let (cols, rows) = (lattice.points().0 - 1, lattice.points().1 - 1);
        let step = lattice.step() as f32;
        let cell = |k: usize, l: usize| {
            let (top, bottom) = (lattice.row(l), lattice.row(l + 1));
            let half = |a: [f32; 2], b: [f32; 2], c: [f32; 2], d: [f32; 2], i: usize| {
                0.5 * ((b[i] - a[i]) + (d[i] - c[i])) / step
            };
            let along = |i: usize| half(top[k], top[k + 1], bottom[k], bottom[k + 1], i);
            let down = |i: usize| half(top[k], bottom[k], top[k + 1], bottom[k + 1], i);
            [Spread::of(length(1.0 + along(0), down(0))), Spread::of(length(along(1), 1.0 + down(1)))]
        };
        let row = |l: usize| -> Vec<[Spread; 2]> {
            let cells: Vec<_> = (0..cols).map(|k| cell(k, l)).collect();
            // Of most rows of most pictures nothing is kept.
            if cells.iter().all(|cell| Self::kind(cell) == Kind::Plain) { Vec::new() } else { cells }
        };
        let rows: Vec<_> = (0..rows).into_par_iter().map(row).collect();
        rows.iter().any(|row| !row.is_empty()).then_some(Self { rows })
    }

    fn kind(cell: &[Spread; 2]) -> Kind {
        match cell {
            [x, y] if x.pairs > 1 || y.pairs > 1 => Kind::Many,
            [x, y] if x.rows > 0 || y.rows > 0 => Kind::Pair,
            _ => Kind::Plain,
        }
    }

    /// The row of cells of output row `j`.
    fn row_of(lattice: &Lattice, j: usize) -> usize {
        (j / lattice.step()).min(lattice.points().1 - 2)
    }

    /// Something is spread in output row `j`.
    pub(super) fn any_in(&self, lattice: &Lattice, j: usize) -> bool {
        !self.rows[Self::row_of(lattice, j)].is_empty()
    }

    /// Samples output row `j`, whose positions are in `scratch`.
    pub(super) fn row<S: Kernels>(
        &self,
        job: &Job<'_>,
        sources: &[Source<'_, S>],
        j: usize,
        scratch: &mut Scratch<S>,
        outs: &mut [&mut [S]],
    ) {
        let (step, width) = (job.lattice.step(), scratch.xs.len());
        let cells = &self.rows[Self::row_of(job.lattice, j)][..];
        let mut from = 0;
        while from < cells.len() {
            let kind = Self::kind(&cells[from]);
            let count = cells[from..].iter().take_while(|cell| Self::kind(cell) == kind).count();
            let run = &cells[from..from + count];
            let (start, end) = ((from * step).min(width), ((from + count) * step).min(width));
            let mut parts: Vec<&mut [S]> = outs.iter_mut().map(|out| &mut out[start..end]).collect();
            match kind {
                Kind::Plain => {
                    let at = (&scratch.xs[start..end], &scratch.ys[start..end]);
                    job.renderer.instructions.sample(&job.renderer.tables, sources, at, &mut parts);
                }
                Kind::Pair => scratch.pairs(job, sources, (start, run), &mut parts),
                Kind::Many => scratch.many(job, sources, (start, run), &mut parts),
            }
            from += count;
        }
    }
}

/// Memory for a row of samples.
pub(super) struct Scratch<S> {
    pub(super) cells: Cells,
    /// Source positions, units of 1/256 px.
    pub(super) xs: Vec<i32>,
    pub(super) ys: Vec<i32>,
    /// First rows of the weights of their pairs.
    across: Vec<u16>,
    down: Vec<u16>,
    /// Of a cell: samples of each plane, and their sums.
    samples: Vec<[S; MAX_CELL_PX]>,
    sums: Vec<[u32; MAX_CELL_PX]>,
}

impl<S: Sample> Scratch<S> {
    /// For so many px and planes.
    pub(super) fn new(width: usize, planes: usize) -> Self {
        Self {
            cells: Cells::default(),
            xs: vec![0; width],
            ys: vec![0; width],
            across: vec![0; width],
            down: vec![0; width],
            samples: vec![[S::default(); MAX_CELL_PX]; planes],
            sums: vec![[0; MAX_CELL_PX]; planes],
        }
    }
}

impl<S: Kernels> Scratch<S> {
    /// Cells from px `start` on in which one pair of samples per axis is averaged.
    fn pairs(
        &mut self,
        job: &Job<'_>,
        sources: &[Source<'_, S>],
        (start, cells): (usize, &[[Spread; 2]]),
        outs: &mut [&mut [S]],
    ) {
        let end = (start + cells.len() * job.lattice.step()).min(self.xs.len());
        let (across, down) = (&mut self.across[start..end], &mut self.down[start..end]);
        let (step, parts) = (job.lattice.step(), cells.iter());
        for ((across, down), cell) in across.chunks_mut(step).zip(down.chunks_mut(step)).zip(parts) {
            across.fill(cell[0].rows);
            down.fill(cell[1].rows);
        }
        let pairs = Pairs { table: job.renderer.pair_table(), across, down };
        let at = (&self.xs[start..end], &self.ys[start..end]);
        job.renderer.instructions.sample_pairs(&pairs, sources, at, outs);
    }

    /// Cells from px `start` on in which more are.
    fn many(
        &mut self,
        job: &Job<'_>,
        sources: &[Source<'_, S>],
        (start, cells): (usize, &[[Spread; 2]]),
        outs: &mut [&mut [S]],
    ) {
        let step = job.lattice.step();
        for (k, cell) in cells.iter().enumerate() {
            let first = start + k * step;
            let count = step.min(self.xs.len() - first);
            self.cell(job, sources, (first, count), *cell);
            let of = u32::from(cell[0].pairs) * u32::from(cell[1].pairs);
            for (out, sums) in outs.iter_mut().zip(&self.sums) {
                let mean = |sum: &u32| S::from_i32(((sum + of / 2) / of) as i32);
                out[k * step..][..count].iter_mut().zip(sums).for_each(|(out, sum)| *out = mean(sum));
            }
        }
    }

    /// The sums of the samples of `count` pixels from px `first` on.
    fn cell(
        &mut self,
        job: &Job<'_>,
        sources: &[Source<'_, S>],
        (first, count): (usize, usize),
        [across, down]: [Spread; 2],
    ) {
        let Renderer { instructions, .. } = job.renderer;
        let rows = [across, down].map(|spread| [spread.rows; MAX_CELL_PX]);
        let pairs = Pairs { table: job.renderer.pair_table(), across: &rows[0][..count], down: &rows[1][..count] };
        let (xs, ys) = (&self.xs[first..first + count], &self.ys[first..first + count]);
        let (mut moved_xs, mut moved_ys) = ([0; MAX_CELL_PX], [0; MAX_CELL_PX]);
        self.sums.iter_mut().for_each(|sums| sums.fill(0));
        for b in 0..down.pairs {
            moved_ys.iter_mut().zip(ys).for_each(|(to, y)| *to = y + down.offset(b));
            for a in 0..across.pairs {
                moved_xs.iter_mut().zip(xs).for_each(|(to, x)| *to = x + across.offset(a));
                let mut outs: Vec<&mut [S]> = self.samples.iter_mut().map(|samples| &mut samples[..count]).collect();
                instructions.sample_pairs(&pairs, sources, (&moved_xs[..count], &moved_ys[..count]), &mut outs);
                for (sums, samples) in self.sums.iter_mut().zip(&self.samples) {
                    sums.iter_mut().zip(samples).for_each(|(sum, v)| *sum += v.to_i32() as u32);
                }
            }
        }
    }
}

impl Renderer {
    /// Renders `src` through `lattice` into `dst` like [`Renderer::render`], and as the mean over each pixel's area where the map
    /// shrinks. For planes at full size; chroma that is subsampled is interpolated as in `render`.
    ///
    /// # Errors
    /// As for `render`; [`RenderError::Interrupted`], and what `dst` shows is unspecified.
    pub fn render_averaged(
        &self,
        src: &Frame,
        lattice: &Lattice,
        dst: &mut Frame,
        run: &Run,
    ) -> Result<(), RenderError> {
        check(src, lattice, dst)?;
        self.render_planes(src, lattice, dst, (Spreads::of(lattice).as_ref(), Band::Whole), run)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix2x3;

    use super::*;
    use crate::render::{Border, RenderOptions};
    use crate::warp::{Map, WarpField};
    use crate::{Layout, PixelFormat};

    fn picture(width: usize, height: usize, bits: u8, f: impl Fn(usize, usize) -> u16) -> Frame {
        let mut frame = Frame::new(PixelFormat::opaque(Layout::Gray, bits), width, height);
        frame.color.full_range = Some(true);
        for y in 0..height {
            for x in 0..width {
                if bits == 8 {
                    frame.plane8_mut(0).expect("8 bit").row_mut(y)[x] = f(x, y) as u8;
                } else {
                    frame.plane16_mut(0).expect("16 bit").row_mut(y)[x] = f(x, y);
                }
            }
        }
        frame
    }

    fn shrunk(src: &Frame, (w, h): (usize, usize), averaged: bool) -> Frame {
        let scale = (src.width as f64 / w as f64, src.height as f64 / h as f64);
        let field = WarpField { chain: vec![Map::Affine(Matrix2x3::new(scale.0, 0.0, 0.0, 0.0, scale.1, 0.0))] };
        let lattice = Lattice::between(&field, (w, h), (src.width, src.height));
        let mut dst = Frame::new(src.format, w, h);
        let renderer = Renderer::new(RenderOptions { border: Border::Replicate, ..RenderOptions::default() });
        let made = if averaged {
            renderer.render_averaged(src, &lattice, &mut dst, &Run::default())
        } else {
            renderer.render(src, &lattice, &mut dst)
        };
        made.expect("sizes fit");
        dst
    }

    fn samples(frame: &Frame) -> Vec<u16> {
        let row = |j: usize| -> Vec<u16> {
            frame.plane8(0).map_or_else(
                || frame.plane16(0).expect("16 bit").row(j).to_vec(),
                |p| p.row(j).iter().map(|v| u16::from(*v)).collect(),
            )
        };
        (0..frame.height).flat_map(row).collect()
    }

    #[test]
    fn patterns_finer_than_the_output_become_even_instead_of_moire() {
        // Waves of 2.3 px across and 3.1 px down, shrunk to a fifth.
        let wave = |x: usize, y: usize| 128.0 + 100.0 * (x as f64 * 2.73).sin() * (y as f64 * 2.03).sin();
        let src = picture(800, 600, 8, |x, y| wave(x, y).round() as u16);
        let spread = |frame: &Frame| {
            let v = samples(frame);
            let mean = v.iter().map(|v| f64::from(*v)).sum::<f64>() / v.len() as f64;
            (v.iter().map(|v| (f64::from(*v) - mean).powi(2)).sum::<f64>() / v.len() as f64).sqrt()
        };
        let (plain, averaged) = (spread(&shrunk(&src, (160, 120), false)), spread(&shrunk(&src, (160, 120), true)));
        assert!(plain > 30.0, "without a mean it is moiré: {plain}");
        assert!(averaged < 6.0, "{averaged}");
    }

    #[test]
    fn constants_stay_constant_and_ramps_stay_ramps_at_either_depth() {
        for (bits, value) in [(8, 203_u16), (16, 51_234)] {
            let flat = picture(300, 200, bits, |_, _| value);
            assert!(samples(&shrunk(&flat, (40, 70), true)).iter().all(|v| *v == value));
        }
        let ramp = picture(640, 64, 16, |x, _| (x * 100) as u16);
        let small = shrunk(&ramp, (64, 64), true);
        for (i, v) in samples(&small)[..64].iter().enumerate().skip(2).take(60) {
            let expected = ((i as f64 + 0.5) * 10.0 - 0.5) * 100.0;
            assert!((f64::from(*v) - expected).abs() < 12.0, "{i}: {v} for {expected}");
        }
    }

    #[test]
    fn where_nothing_shrinks_nothing_changes() {
        let src = picture(333, 222, 8, |x, y| ((x * 31 + y * 17) % 251) as u16);
        for size in [(333, 222), (300, 200), (500, 400)] {
            assert_eq!(samples(&shrunk(&src, size, true)), samples(&shrunk(&src, size, false)), "{size:?}");
        }
        assert_ne!(samples(&shrunk(&src, (333, 100), true)), samples(&shrunk(&src, (333, 100), false)));
    }

    #[test]
    fn the_mean_sets_in_without_a_step() {
        let src = picture(1000, 40, 16, |x, _| 30_000 + (20_000.0 * (x as f64 * 0.9).sin()) as u16);
        // Sizes that differ by a pixel, around the onset, give nearly the same values in the first columns.
        let first = |w: usize| samples(&shrunk(&src, (w, 40), true))[..4].to_vec();
        for w in 810..850 {
            for (a, b) in first(w).iter().zip(first(w + 1)) {
                assert!(a.abs_diff(b) < 400, "{w}: {a} and {b}");
            }
        }
    }
}
