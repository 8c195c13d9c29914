//! Source positions along a row of an output plane, in fixed point.
//!
//! Sample `i` of a plane subsampled by `F` is at the luma position `X = F i + ½ + o`, `o` the siting offset of
//! [`crate::ColorDescription::chroma_offset`]. If the field moves it by `d(X)` luma px, its source index in the same
//! plane is
//!
//! ```text
//! i' = (X + d(X) − ½ − o) / F = i + d(X) / F,
//! ```
//!
//! so that siting matters only for where the lattice is read. Within a lattice cell `d` is linear along a row: positions
//! advance by a constant, in units of 2⁻¹⁶ px, and are stored in units of 1/256 px.

use super::kernel::PHASE_BITS;
use crate::warp::Lattice;
use crate::{ColorDescription, PixelFormat};

/// Fractional bits while positions are advanced. An error of one unit per step grows to 5e-4 px over a cell of 32 px.
const FRACTION_BITS: u32 = 16;
/// Bits that a stored position has less.
const DROPPED_BITS: u32 = FRACTION_BITS - PHASE_BITS;
/// Offsets are clamped to this, px, so that positions fit an `i32` with [`FRACTION_BITS`].
const MAX_OFFSET_PX: f32 = 16_000.0;
/// Largest width and height that fit beside [`MAX_OFFSET_PX`].
pub(super) const MAX_SIZE: usize = 16_384;
/// Position of a sample whose source is not defined: outside whatever the size.
pub(super) const NOWHERE: i32 = -(MAX_SIZE as i32) << PHASE_BITS;

/// Position of a plane's samples relative to the luma samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Siting {
    /// Binary logarithm of luma px per sample, x and y.
    pub(super) log2: (u32, u32),
    /// Position of the first sample from that of the first luma sample, luma px.
    pub(super) offset: (f32, f32),
}

impl Siting {
    /// Siting of plane `i`; an offset counts only along axes that are subsampled.
    pub(super) fn of(format: PixelFormat, color: &ColorDescription, i: usize) -> Self {
        let (x, y) = format.subsampling(i);
        let along = |log2: u32, offset: f32| if log2 == 0 { 0.0 } else { offset };
        Self { log2: (x, y), offset: (along(x, color.chroma_offset[0]), along(y, color.chroma_offset[1])) }
    }

    /// Luma px per sample along x and y.
    pub(super) fn luma_px(&self) -> (f32, f32) {
        ((1 << self.log2.0) as f32, (1 << self.log2.1) as f32)
    }

    /// Writes the source positions of row `j` in units of 1/256 px of the plane, 0 at the center of its first sample.
    #[inline(always)] // so that it is compiled again for AVX2; closures would not be, hence loops
    #[allow(clippy::inline_always)]
    pub(super) fn positions(&self, lattice: &Lattice, j: usize, cells: &mut Cells, (xs, ys): (&mut [i32], &mut [i32])) {
        let step = lattice.step() as f32;
        let y = ((j << self.log2.1) as f32 + 0.5 + self.offset.1) / step;
        let l = (y as usize).min(lattice.points().1 - 2);
        cells.set_ends((lattice.row(l), lattice.row(l + 1)), y - l as f32);
        let per_cell = lattice.step() >> self.log2.0;
        let phase = (0.5 + self.offset.0) / step;
        // The index is that of the sample along x, and everywhere that of the row along y.
        cells.set_lines(0, phase, per_cell, unit(self.log2.0), (0, 1));
        cells.write(per_cell, xs);
        cells.set_lines(1, phase, per_cell, unit(self.log2.1), (j as i32, 0));
        cells.write(per_cell, ys);
    }
}

/// What [`Siting::positions`] keeps of a row of cells: loops over arrays of one kind of number each become vector code.
#[derive(Debug, Default)]
pub(super) struct Cells {
    /// Offsets between the cells, luma px, along x and along y.
    ends: [Vec<f32>; 2],
    /// Some of them are not defined.
    undefined: bool,
    /// The [`Line`] of each cell, along one axis.
    starts: Vec<i32>,
    advances: Vec<i32>,
}

#[allow(clippy::inline_always)] // see `positions`
impl Cells {
    /// Offsets in the fraction `t` of the way from one row of lattice points to the next.
    #[inline(always)]
    fn set_ends(&mut self, (above, below): (&[[f32; 2]], &[[f32; 2]]), t: f32) {
        let mut undefined = false;
        for (axis, ends) in self.ends.iter_mut().enumerate() {
            ends.resize(above.len(), 0.0);
            for (end, (u, v)) in ends.iter_mut().zip(above.iter().zip(below)) {
                *end = u[axis] + (v[axis] - u[axis]) * t;
                undefined |= !end.is_finite();
            }
        }
        self.undefined = undefined;
    }

    /// The lines along an axis of cells of `per_cell` samples, whose indices start at `first` and are `own` apart.
    #[inline(always)]
    fn set_lines(&mut self, axis: usize, phase: f32, per_cell: usize, unit: f32, (first, own): (i32, i32)) {
        let (ends, ratio) = (&self.ends[axis], 1.0 / per_cell as f32);
        self.starts.resize(ends.len() - 1, 0);
        self.advances.resize(ends.len() - 1, 0);
        let mut index = first;
        for ((start, advance), (left, right)) in
            self.starts.iter_mut().zip(&mut self.advances).zip(ends.iter().zip(&ends[1..]))
        {
            let line = Line::new(*left, right - left, phase, ratio, unit).plus(index, own);
            (*start, *advance) = (line.start, line.advance);
            index += own * per_cell as i32;
        }
        if self.undefined {
            let [x, y] = &self.ends;
            for (k, (x, y)) in x.windows(2).zip(y.windows(2)).enumerate() {
                if !((x[1] - x[0]).is_finite() && (y[1] - y[0]).is_finite()) {
                    (self.starts[k], self.advances[k]) = (Line::NOWHERE.start, Line::NOWHERE.advance);
                }
            }
        }
    }

    /// Positions of cells of `per_cell` samples, a power of two up to the largest step of a lattice.
    #[inline(always)]
    fn write(&self, per_cell: usize, out: &mut [i32]) {
        match per_cell {
            1 => self.write_by::<1>(out),
            2 => self.write_by::<2>(out),
            4 => self.write_by::<4>(out),
            8 => self.write_by::<8>(out),
            16 => self.write_by::<16>(out),
            _ => self.write_by::<32>(out),
        }
    }

    /// Positions of cells of `N` samples; the row may end within the last.
    #[inline(always)]
    fn write_by<const N: usize>(&self, out: &mut [i32]) {
        let (whole, rest) = out.as_chunks_mut::<N>();
        for (cell, (&start, &advance)) in whole.iter_mut().zip(self.starts.iter().zip(&self.advances)) {
            Line { start, advance }.write(cell);
        }
        if let (Some(&start), Some(&advance)) = (self.starts.get(whole.len()), self.advances.get(whole.len())) {
            Line { start, advance }.write(rest);
        }
    }
}

/// Fixed-point units per luma px in a plane subsampled by `2^log2`.
pub(super) fn unit(log2: u32) -> f32 {
    (1 << (FRACTION_BITS - log2)) as f32
}

/// Positions along the samples of a cell, in fixed point that wraps.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    start: i32,
    advance: i32,
}

#[allow(clippy::inline_always)] // see `positions`
impl Line {
    /// All samples at [`NOWHERE`].
    const NOWHERE: Self = Self { start: NOWHERE << DROPPED_BITS, advance: 0 };

    /// The offset at the left end of a cell and its change over the cell, luma px. The first sample stands `phase` of the
    /// cell behind the left end, samples are `ratio` of the cell apart.
    #[inline(always)]
    pub(super) fn new(left: f32, slope: f32, phase: f32, ratio: f32, unit: f32) -> Self {
        let start = (left + slope * phase).clamp(-MAX_OFFSET_PX, MAX_OFFSET_PX) * unit;
        let advance = (slope * ratio).clamp(-MAX_OFFSET_PX, MAX_OFFSET_PX) * unit;
        Self { start: start as i32, advance: advance as i32 }
    }

    /// Offsets from samples with indices from `first` on, `own` apart.
    #[inline(always)]
    pub(super) fn plus(self, first: i32, own: i32) -> Self {
        Self {
            start: (first << FRACTION_BITS).wrapping_add(self.start),
            advance: (own << FRACTION_BITS).wrapping_add(self.advance),
        }
    }

    /// Writes the positions of samples from the first on, rounded.
    #[inline(always)]
    pub(super) fn write(self, out: &mut [i32]) {
        let start = self.start.wrapping_add(1 << (DROPPED_BITS - 1));
        for (position, i) in out.iter_mut().zip(0_i32..) {
            *position = start.wrapping_add(self.advance.wrapping_mul(i)) >> DROPPED_BITS;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Layout;
    use crate::warp::WarpField;
    use plumbline_num::math::{Point2, PointMap, Similarity2, Vec2};

    #[test]
    fn positions_equal_the_field_at_the_sited_sample() {
        let s = Similarity2::about(Point2::new(320.0, 180.0), 0.04, 1.1, Vec2::new(9.3, -4.2)).to_homography();
        let field = WarpField::from_forward_homography(&s).expect("regular");
        let lattice = Lattice::new(&field, 640, 360);
        for (layout, offset) in [
            (Layout::Yuv420, [0.0, 0.5]),
            (Layout::Yuv420, [0.0; 2]),
            (Layout::Yuv411, [1.5, 0.0]),
            (Layout::Yuv440, [0.5; 2]),
        ] {
            let color = ColorDescription { chroma_offset: offset, ..ColorDescription::default() };
            let format = PixelFormat::opaque(layout, 8);
            let siting = Siting::of(format, &color, 1);
            let (w, h) = format.plane_size(1, 640, 360);
            let (fx, fy) = ((640 / w) as f64, (360 / h) as f64);
            let o =
                [if fx > 1.0 { f64::from(offset[0]) } else { 0.0 }, if fy > 1.0 { f64::from(offset[1]) } else { 0.0 }];
            let (mut xs, mut ys) = (vec![0; w], vec![0; w]);
            siting.positions(&lattice, 50, &mut Cells::default(), (&mut xs, &mut ys));
            for i in [0, 1, 7, w - 1] {
                let luma = Point2::new(fx * i as f64 + 0.5 + o[0], fy * 50.0 + 0.5 + o[1]);
                let src = field.map(luma).expect("affine");
                let expected = [(src.x - 0.5 - o[0]) / fx, (src.y - 0.5 - o[1]) / fy];
                let found = [f64::from(xs[i]) / 256.0, f64::from(ys[i]) / 256.0];
                assert!((found[0] - expected[0]).abs() < 0.003, "{layout:?} x of {i}: {found:?} for {expected:?}");
                assert!((found[1] - expected[1]).abs() < 0.003, "{layout:?} y of {i}: {found:?} for {expected:?}");
            }
        }
    }
}
