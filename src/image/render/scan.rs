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
    #[inline(always)] // so that it is compiled again for AVX2
    #[allow(clippy::inline_always)]
    pub(super) fn positions(&self, lattice: &Lattice, j: usize, xs: &mut [i32], ys: &mut [i32]) {
        let step = lattice.step() as f32;
        let y = ((j << self.log2.1) as f32 + 0.5 + self.offset.1) / step;
        let l = (y as usize).min(lattice.points().1 - 2);
        let t = y - l as f32;
        let at = |u: &[f32; 2], v: &[f32; 2]| [u[0] + (v[0] - u[0]) * t, u[1] + (v[1] - u[1]) * t];
        let mut ends = lattice.row(l).iter().zip(lattice.row(l + 1)).map(|(u, v)| at(u, v));
        let per_cell = lattice.step() >> self.log2.0;
        let phase = (0.5 + self.offset.0) / step;
        let ratio = 1.0 / per_cell as f32;
        let (unit_x, unit_y) = (unit(self.log2.0), unit(self.log2.1));
        let mut left = ends.next().unwrap_or_default();
        let cells = xs.chunks_mut(per_cell).zip(ys.chunks_mut(per_cell)).zip(ends);
        for (k, ((xs, ys), right)) in cells.enumerate() {
            let slope = [right[0] - left[0], right[1] - left[1]];
            let x = Line::new(left[0], slope[0], phase, ratio, unit_x);
            let y = Line::new(left[1], slope[1], phase, ratio, unit_y);
            if slope[0].is_finite() && slope[1].is_finite() {
                x.write(xs, (k * per_cell) as i32, 1);
                y.write(ys, j as i32, 0);
            } else {
                xs.fill(NOWHERE);
                ys.fill(NOWHERE);
            }
            left = right;
        }
    }
}

/// Fixed-point units per luma px in a plane subsampled by `2^log2`.
pub(super) fn unit(log2: u32) -> f32 {
    (1 << (FRACTION_BITS - log2)) as f32
}

/// An offset along the samples of a cell, in fixed point.
pub(super) struct Line {
    start: i32,
    advance: i32,
}

#[allow(clippy::inline_always)] // see `positions`
impl Line {
    /// From the offset at the left end of a cell and its change over the cell, luma px. The first sample stands `phase`
    /// of the cell behind the left end, samples are `ratio` of the cell apart.
    #[inline(always)]
    pub(super) fn new(left: f32, slope: f32, phase: f32, ratio: f32, unit: f32) -> Self {
        let start = (left + slope * phase).clamp(-MAX_OFFSET_PX, MAX_OFFSET_PX) * unit;
        let advance = (slope * ratio).clamp(-MAX_OFFSET_PX, MAX_OFFSET_PX) * unit;
        Self { start: start as i32, advance: advance as i32 }
    }

    /// Positions of samples from index `first` on, `own` indices apart.
    #[inline(always)]
    pub(super) fn write(&self, out: &mut [i32], first: i32, own: i32) {
        const DROPPED: u32 = FRACTION_BITS - PHASE_BITS;
        let advance = self.advance.wrapping_add(own << FRACTION_BITS);
        let mut at = (first << FRACTION_BITS).wrapping_add(self.start).wrapping_add(1 << (DROPPED - 1));
        // Eight or four at a time: the inner loop is one vector addition, one shift and one store.
        let (eights, rest) = out.as_chunks_mut::<8>();
        if !eights.is_empty() {
            let lanes = [0, 1, 2, 3, 4, 5, 6, 7].map(|k| advance.wrapping_mul(k));
            for eight in eights {
                for (position, lane) in eight.iter_mut().zip(lanes) {
                    *position = at.wrapping_add(lane) >> DROPPED;
                }
                at = at.wrapping_add(advance.wrapping_mul(8));
            }
        }
        let (fours, rest) = rest.as_chunks_mut::<4>();
        for four in fours {
            for (position, k) in four.iter_mut().zip(0_i32..) {
                *position = at.wrapping_add(advance.wrapping_mul(k)) >> DROPPED;
            }
            at = at.wrapping_add(advance.wrapping_mul(4));
        }
        for position in rest {
            *position = at >> DROPPED;
            at = at.wrapping_add(advance);
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
            siting.positions(&lattice, 50, &mut xs, &mut ys);
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
