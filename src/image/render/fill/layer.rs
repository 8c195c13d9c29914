//! A picture's samples on the blocks of a strip: read from a frame, or sampled from a neighbor.

use rayon::prelude::*;

use super::strip::{BLOCK, Corners, Strip};
use crate::Frame;
use crate::render::border::Border;
use crate::render::plane::sample_row;
use crate::render::scan::{Line, NOWHERE, Siting, unit};
use crate::render::source::Source;
use crate::render::{RenderError, Renderer};

/// A plane of a neighbor, 8 or 16 bits.
pub(super) enum AnySource<'a> {
    Bytes(Source<'a, u8>),
    Words(Source<'a, u16>),
}

impl<'a> AnySource<'a> {
    pub(super) fn new(frame: &'a Frame, i: usize) -> Result<Self, RenderError> {
        let unreadable = RenderError::Plane { plane: i, role: "source" };
        let bits = frame.format.bits;
        if frame.format.bytes_per_sample() == 1 {
            let plane = frame.plane8(i).ok_or(unreadable)?;
            Ok(Self::Bytes(Source::new(plane, Border::Replicate, 0, bits)))
        } else {
            let plane = frame.plane16(i).ok_or(unreadable)?;
            Ok(Self::Words(Source::new(plane, Border::Replicate, 0, bits)))
        }
    }

    /// Samples at positions in units of 1/256 px.
    fn sample(&self, renderer: &Renderer, xs: &[i32], ys: &[i32], out: &mut [f32]) {
        let n = out.len();
        match self {
            Self::Bytes(source) => {
                let mut row = [0; BLOCK];
                sample_row(renderer, source, (&xs[..n], &ys[..n]), &mut row[..n]);
                out.iter_mut().zip(row).for_each(|(out, v)| *out = f32::from(v));
            }
            Self::Words(source) => {
                let mut row = [0; BLOCK];
                sample_row(renderer, source, (&xs[..n], &ys[..n]), &mut row[..n]);
                out.iter_mut().zip(row).for_each(|(out, v)| *out = f32::from(v));
            }
        }
    }
}

/// The smaller of two numbers; unlike `f32::min` one instruction, for NaN does not occur.
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Values on some blocks of a strip, and the distance of each sample's source position to the edge of its source, luma px;
/// −∞ beyond the frame and where the map is not defined.
#[derive(Clone)]
pub(super) struct Rendered {
    pub(super) value: Vec<f32>,
    pub(super) margin: Vec<f32>,
}

/// The shape of a block in one plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    siting: Siting,
    /// Size of the plane, samples.
    width: usize,
    height: usize,
    /// Size of a block, samples.
    cols: usize,
    rows: usize,
}

impl Patch {
    pub(super) fn new(frame: &Frame, i: usize) -> Self {
        let (width, height) = frame.format.plane_size(i, frame.width, frame.height);
        let siting = Siting::of(frame.format, &frame.color, i);
        Self { siting, width, height, cols: BLOCK >> siting.log2.0, rows: BLOCK >> siting.log2.1 }
    }

    /// Samples in a block.
    pub(super) fn len(&self) -> usize {
        self.cols * self.rows
    }

    /// Where sample `k` of a block lies, in blocks.
    pub(super) fn place(&self, strip: &Strip, block: usize, k: usize) -> (f32, f32) {
        let along = |at: usize, k: usize, n: usize| at as f32 + (k as f32 + 0.5) / n as f32;
        let (i, j) = (block % strip.cols, block / strip.cols);
        (along(i, k % self.cols, self.cols), along(j, k / self.cols, self.rows))
    }

    /// Sample `k` of a block lies in the frame, which ends within the last blocks.
    pub(super) fn in_frame(&self, strip: &Strip, block: usize, k: usize) -> bool {
        self.row(strip, block, k / self.cols).is_some_and(|(_, _, len)| k % self.cols < len)
    }

    /// The sample at the start of row `r` of a block, and how many of the row lie in the frame; `None`: none.
    fn row(&self, strip: &Strip, block: usize, r: usize) -> Option<(usize, usize, usize)> {
        let (x, y) = (block % strip.cols * self.cols, block / strip.cols * self.rows + r);
        (x < self.width && y < self.height).then(|| (x, y, self.cols.min(self.width - x)))
    }

    /// Samples `source` in `blocks` with the given offsets of their corners, where its pixels reach; 0 elsewhere.
    pub(super) fn render(
        &self,
        renderer: &Renderer,
        source: &AnySource<'_>,
        strip: &Strip,
        (blocks, corners): (&[usize], &[Option<Corners>]),
    ) -> Rendered {
        self.each_row(strip, (blocks, corners), |_, margins, (xs, ys), out| {
            let inside = |&m: &f32| m > 0.0;
            if let (Some(first), Some(last)) = (margins.iter().position(inside), margins.iter().rposition(inside)) {
                source.sample(renderer, &xs[first..], &ys[first..], &mut out[first..=last]);
            }
        })
    }

    /// The samples of `frame` itself, as rendered before; `corners` tell margins.
    pub(super) fn read(
        &self,
        strip: &Strip,
        frame: &Frame,
        i: usize,
        corners: &[Option<Corners>],
    ) -> Result<Rendered, RenderError> {
        let unreadable = RenderError::Plane { plane: i, role: "destination" };
        if frame.format.bytes_per_sample() == 1 {
            let plane = frame.plane8(i).ok_or(unreadable)?;
            Ok(self.each_row(strip, (&strip.blocks, corners), |(x, y), _, _, out| {
                out.iter_mut().zip(&plane.row(y)[x..]).for_each(|(out, &v)| *out = f32::from(v));
            }))
        } else {
            let plane = frame.plane16(i).ok_or(unreadable)?;
            Ok(self.each_row(strip, (&strip.blocks, corners), |(x, y), _, _, out| {
                out.iter_mut().zip(&plane.row(y)[x..]).for_each(|(out, &v)| *out = f32::from(v));
            }))
        }
    }

    /// Values by `fill((x, y), margins, (xs, ys), out)` for each row of each block, and margins.
    fn each_row(
        &self,
        strip: &Strip,
        (blocks, corners): (&[usize], &[Option<Corners>]),
        fill: impl Fn((usize, usize), &[f32], (&[i32], &[i32]), &mut [f32]) + Sync,
    ) -> Rendered {
        let n = self.len();
        let mut rendered = Rendered { value: vec![0.0; n * blocks.len()], margin: Vec::new() };
        rendered.margin = vec![f32::NEG_INFINITY; rendered.value.len()];
        let samples = rendered.value.par_chunks_mut(n).zip(rendered.margin.par_chunks_mut(n));
        samples.zip(blocks).zip(corners).for_each(|(((value, margin), &block), corners)| {
            let (mut xs, mut ys) = ([NOWHERE; BLOCK], [NOWHERE; BLOCK]);
            for (r, (value, margin)) in value.chunks_mut(self.cols).zip(margin.chunks_mut(self.cols)).enumerate() {
                let Some((x, y, len)) = self.row(strip, block, r) else { continue };
                if let Some(corners) = corners {
                    self.positions(corners, (x, y, r), &mut xs, &mut ys);
                    self.margins(&xs, &ys, &mut margin[..len]);
                }
                fill((x, y), &margin[..len], (&xs, &ys), &mut value[..len]);
            }
        });
        rendered
    }

    /// Source positions of row `r` of a block that starts at sample `(x, y)`, in units of 1/256 px of the plane.
    fn positions(&self, corners: &Corners, (x, y, r): (usize, usize, usize), xs: &mut [i32], ys: &mut [i32]) {
        let v = (r as f32 * self.siting.luma_px().1 + 0.5 + self.siting.offset.1) / BLOCK as f32;
        let down = |a: [f32; 2], b: [f32; 2]| [a[0] + (b[0] - a[0]) * v, a[1] + (b[1] - a[1]) * v];
        let (left, right) = (down(corners[0], corners[2]), down(corners[1], corners[3]));
        let (phase, share) = ((0.5 + self.siting.offset.0) / BLOCK as f32, 1.0 / self.cols as f32);
        let line = |axis: usize, log2: u32| Line::new(left[axis], right[axis] - left[axis], phase, share, unit(log2));
        line(0, self.siting.log2.0).plus(x as i32, 1).write(&mut xs[..self.cols]);
        line(1, self.siting.log2.1).plus(y as i32, 0).write(&mut ys[..self.cols]);
    }

    fn margins(&self, xs: &[i32], ys: &[i32], margins: &mut [f32]) {
        let (right, bottom) = ((self.width - 1) as f32, (self.height - 1) as f32);
        let scale = self.siting.luma_px();
        for ((margin, &x), &y) in margins.iter_mut().zip(xs).zip(ys) {
            let (x, y) = (x as f32 / 256.0, y as f32 / 256.0);
            *margin = least(least(x, right - x) * scale.0, least(y, bottom - y) * scale.1);
        }
    }

    /// Writes values, which lie within the range of the format, to plane `i`.
    pub(super) fn write(&self, strip: &Strip, values: &[f32], dst: &mut Frame, i: usize) -> Result<(), RenderError> {
        let unwritable = RenderError::Plane { plane: i, role: "destination" };
        let rows = strip.blocks.iter().zip(values.chunks(self.len())).flat_map(|(&block, values)| {
            let rows = values.chunks(self.cols).enumerate();
            rows.filter_map(move |(r, values)| Some((self.row(strip, block, r)?, values)))
        });
        if dst.format.bytes_per_sample() == 1 {
            let mut plane = dst.plane8_mut(i).ok_or(unwritable)?;
            for ((x, y, len), values) in rows {
                let out = &mut plane.row_mut(y)[x..x + len];
                out.iter_mut().zip(values).for_each(|(out, v)| *out = v.round_ties_even() as u8);
            }
        } else {
            let mut plane = dst.plane16_mut(i).ok_or(unwritable)?;
            for ((x, y, len), values) in rows {
                let out = &mut plane.row_mut(y)[x..x + len];
                out.iter_mut().zip(values).for_each(|(out, v)| *out = v.round_ties_even() as u16);
            }
        }
        Ok(())
    }
}
