//! Where the map shrinks: the mean over each output pixel's area.
//!
//! A kernel that interpolates passes frequencies of the source that the output cannot show; where one output pixel spans
//! `m > 1` source pixels they fold back as moiré. The value of a pixel is then the mean of `k × k` interpolated samples spread
//! over its area,
//!
//! ```text
//! k = ⌈m / 1.5⌉ ≥ 2,     o_a = ((a + ½)/k − ½) · s(m),     s(m) = clamp((m − 1.2) / 0.8, 0, 1),
//! ```
//!
//! along each axis by itself (a retargeted picture shrinks along one). `m` is the length of the Jacobian's column in a lattice
//! cell. The spread `s` grows from 0, so that nothing shows where the mean sets in: below `m = 1.2` the result is that of
//! [`Renderer::render`], bit for bit. Samples taken are at most about as many as the source has pixels, whatever the scale.

use rayon::prelude::*;

use super::kernel::PHASE_BITS;
use super::plane::{Job, ROWS_PER_TASK};
use super::scan::{Line, NOWHERE, unit};
use super::source::Source;
use super::{RenderError, Renderer, check};
use crate::warp::Lattice;
use crate::{Frame, PlaneMut};
use plumbline_num::run::{Run, Stopped};

#[cfg(target_arch = "x86_64")]
use super::avx2::Kernels;
#[cfg(not(target_arch = "x86_64"))]
use super::source::Sample as Kernels;

/// Scale (source px per output px) from which samples are spread over the pixel, and the range over which the spread
/// grows to the full pixel.
const MIN_SCALE: f32 = 1.2;
const SCALE_RANGE: f32 = 0.8;
/// Distance between two samples of a mean, source px: below the support of the kernel.
const SAMPLE_SPACING: f32 = 1.5;
/// Maximum number of samples of a mean along an axis: bounds the time of extreme scales.
const MAX_SAMPLES: f32 = 64.0;
/// Maximum lattice cell, px.
const MAX_CELL_PX: usize = 32;

/// Samples of the pixels in a lattice cell along one axis: how many, and over which part of the pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Spread {
    count: u32,
    part: f32,
}

impl Spread {
    /// For a pixel that spans `m` source pixels.
    fn of(m: f32) -> Self {
        let shrinks = m > MIN_SCALE && m.is_finite();
        if shrinks {
            Self {
                count: (m / SAMPLE_SPACING).ceil().clamp(2.0, MAX_SAMPLES) as u32,
                part: ((m - MIN_SCALE) / SCALE_RANGE).min(1.0),
            }
        } else {
            Self { count: 1, part: 0.0 }
        }
    }

    /// Offset of sample `a` from the pixel's center, px.
    fn offset(self, a: u32) -> f32 {
        ((a as f32 + 0.5) / self.count as f32 - 0.5) * self.part
    }
}

/// Spread of every lattice cell, x and y.
struct Spreads {
    cols: usize,
    cells: Vec<[Spread; 2]>,
    /// Rows of cells in which something is spread.
    rows: Vec<bool>,
}

impl Spreads {
    fn of(lattice: &Lattice) -> Self {
        let (cols, rows) = (lattice.points().0 - 1, lattice.points().1 - 1);
        let step = lattice.step() as f32;
        let cell = |k: usize, l: usize| {
            let (top, bottom) = (lattice.row(l), lattice.row(l + 1));
            let half = |a: [f32; 2], b: [f32; 2], c: [f32; 2], d: [f32; 2]| {
                [0, 1].map(|i| 0.5 * ((b[i] - a[i]) + (d[i] - c[i])) / step)
            };
            let [dx, dy] = half(top[k], top[k + 1], bottom[k], bottom[k + 1]);
            let [ex, ey] = half(top[k], bottom[k], top[k + 1], bottom[k + 1]);
            [Spread::of((1.0 + dx).hypot(dy)), Spread::of(ex.hypot(1.0 + ey))]
        };
        let cells: Vec<[Spread; 2]> = (0..rows * cols).map(|i| cell(i % cols, i / cols)).collect();
        let rows = cells.chunks(cols).map(|row| row.iter().any(|[x, y]| x.count * y.count > 1)).collect();
        Self { cols, cells, rows }
    }

    fn any(&self) -> bool {
        self.rows.contains(&true)
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
        self.render_planes(src, lattice, dst, run)?;
        let spreads = Spreads::of(lattice);
        if !spreads.any() {
            return Ok(());
        }
        let full_size = |i: &usize| src.format.subsampling(*i) == (0, 0);
        for i in (0..src.format.planes()).filter(full_size) {
            let (job, black) = self.job(src, lattice, i);
            let (bits, border) = (src.format.bits, self.border);
            let means = Means { job, lattice, spreads: &spreads };
            let unreadable = RenderError::Plane { plane: i, role: "source" };
            let unwritable = RenderError::Plane { plane: i, role: "destination" };
            if src.format.bytes_per_sample() == 1 {
                let plane = src.plane8(i).ok_or(unreadable)?;
                means.run(&Source::new(plane, border, black, bits), dst.plane8_mut(i).ok_or(unwritable)?, run)?;
            } else {
                let plane = src.plane16(i).ok_or(unreadable)?;
                means.run(&Source::new(plane, border, black, bits), dst.plane16_mut(i).ok_or(unwritable)?, run)?;
            }
        }
        Ok(())
    }
}

/// One plane, in which cells that shrink are rendered again.
struct Means<'a> {
    job: Job<'a>,
    lattice: &'a Lattice,
    spreads: &'a Spreads,
}

impl Means<'_> {
    fn run<S: Kernels>(&self, source: &Source<'_, S>, dst: PlaneMut<'_, S>, run: &Run) -> Result<(), Stopped> {
        let (width, height) = (dst.width(), dst.height());
        let (data, stride) = dst.into_data();
        let end = data.len().min(height * stride);
        data[..end].par_chunks_mut(stride * ROWS_PER_TASK).enumerate().try_for_each(|(task, rows)| {
            run.check()?;
            for (j, row) in (task * ROWS_PER_TASK..).zip(rows.chunks_mut(stride)) {
                self.row(source, j, &mut row[..width]);
            }
            Ok(())
        })
    }

    fn row<S: Kernels>(&self, source: &Source<'_, S>, j: usize, row: &mut [S]) {
        let step = self.lattice.step();
        let l = (j / step).min(self.lattice.points().1 - 2);
        if !self.spreads.rows[l] {
            return;
        }
        let cells = &self.spreads.cells[l * self.spreads.cols..][..self.spreads.cols];
        for (k, (out, spread)) in row.chunks_mut(step).zip(cells).enumerate() {
            if spread[0].count * spread[1].count > 1 {
                self.cell(source, (k, l, j), *spread, out);
            }
        }
    }

    /// The part of row `j` in cell `(k, l)`.
    fn cell<S: Kernels>(
        &self,
        source: &Source<'_, S>,
        (k, l, j): (usize, usize, usize),
        [across, down]: [Spread; 2],
        out: &mut [S],
    ) {
        let mut sums = [0_u32; MAX_CELL_PX];
        let (mut xs, mut ys) = ([0_i32; MAX_CELL_PX], [0_i32; MAX_CELL_PX]);
        let mut samples = [S::default(); MAX_CELL_PX];
        let count = out.len();
        for b in 0..down.count {
            for a in 0..across.count {
                let offset = [across.offset(a), down.offset(b)];
                self.positions((k, l, j), offset, &mut xs[..count], &mut ys[..count]);
                self.job.sample(source, (&xs[..count], &ys[..count]), &mut samples[..count]);
                sums.iter_mut().zip(&samples[..count]).for_each(|(sum, v)| *sum += v.to_i32() as u32);
            }
        }
        let of = across.count * down.count;
        out.iter_mut().zip(sums).for_each(|(v, sum)| *v = S::from_i32(((sum + of / 2) / of) as i32));
    }

    /// Source positions of the pixels of row `j` in cell `(k, l)`, moved by `offset` output px.
    fn positions(&self, (k, l, j): (usize, usize, usize), offset: [f32; 2], xs: &mut [i32], ys: &mut [i32]) {
        let step = self.lattice.step();
        let t = (j as f32 + 0.5 + offset[1]) / step as f32 - l as f32;
        let (top, bottom) = (self.lattice.row(l), self.lattice.row(l + 1));
        let at = |k: usize| [0, 1].map(|i| top[k][i] + (bottom[k][i] - top[k][i]) * t);
        let (left, right) = (at(k), at(k + 1));
        let slope = [right[0] - left[0], right[1] - left[1]];
        if !(slope[0].is_finite() && slope[1].is_finite()) {
            xs.fill(NOWHERE);
            ys.fill(NOWHERE);
            return;
        }
        let (phase, share) = ((0.5 + offset[0]) / step as f32, 1.0 / step as f32);
        Line::new(left[0] + offset[0], slope[0], phase, share, unit(0)).write(xs, (k * step) as i32, 1);
        Line::new(left[1] + offset[1], slope[1], phase, share, unit(0)).write(ys, j as i32, 0);
    }
}

const _: () = assert!(PHASE_BITS == 8, "offsets of samples are below a pixel");

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
