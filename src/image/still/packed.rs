//! Between the packed samples of files, `R G B A R G B A …`, and planes.

use std::any::Any;

use bytemuck::Pod;
use rayon::prelude::*;

use super::{ExifOrientation, StillError};
use crate::simd::multiversion;
use crate::{Frame, FrameBuffer, Layout, PixelFormat, PlaneMut, PlaneRef, PlaneRows};

/// Rows per parallel task: a task outweighs its scheduling, and small pictures still split.
pub(super) const ROWS: usize = 32;

/// A sample type: `u8` or `u16`.
pub(super) trait Sample: Pod + Send + Sync {
    /// Plane `i` of a frame of this depth.
    fn plane(frame: &Frame, i: usize) -> Option<PlaneRef<'_, Self>>;

    /// Plane `i` for writing.
    fn plane_mut(frame: &mut Frame, i: usize) -> Option<PlaneMut<'_, Self>>;

    /// All planes for writing.
    fn planes_mut(frame: &mut Frame) -> Option<Vec<PlaneMut<'_, Self>>>;

    /// Packed red, green and blue as rows of each.
    fn split(samples: &[Self], g: &mut [Self], b: &mut [Self], r: &mut [Self]);
}

impl Sample for u8 {
    fn plane(frame: &Frame, i: usize) -> Option<PlaneRef<'_, Self>> {
        frame.plane8(i)
    }

    fn plane_mut(frame: &mut Frame, i: usize) -> Option<PlaneMut<'_, Self>> {
        frame.plane8_mut(i)
    }

    fn planes_mut(frame: &mut Frame) -> Option<Vec<PlaneMut<'_, Self>>> {
        frame.planes8_mut(0..frame.format.planes())
    }

    fn split(samples: &[Self], g: &mut [Self], b: &mut [Self], r: &mut [Self]) {
        split8(samples, g, b, r);
    }
}

impl Sample for u16 {
    fn plane(frame: &Frame, i: usize) -> Option<PlaneRef<'_, Self>> {
        frame.plane16(i)
    }

    fn plane_mut(frame: &mut Frame, i: usize) -> Option<PlaneMut<'_, Self>> {
        frame.plane16_mut(i)
    }

    fn planes_mut(frame: &mut Frame) -> Option<Vec<PlaneMut<'_, Self>>> {
        frame.planes16_mut(0..frame.format.planes())
    }

    fn split(samples: &[Self], g: &mut [Self], b: &mut [Self], r: &mut [Self]) {
        split16(samples, g, b, r);
    }
}

/// True for gray and GBR of 8 or 16 bit.
pub(super) fn is_still(format: PixelFormat) -> bool {
    matches!(format.layout, Layout::Gray | Layout::Gbr) && matches!(format.bits, 8 | 16)
}

/// Which plane holds each sample of a pixel, in the order of files: red, green, blue, alpha, or gray, alpha.
pub(super) fn planes_of(format: PixelFormat) -> &'static [usize] {
    match (format.layout, format.alpha) {
        (Layout::Gray, false) => &[0],
        (Layout::Gray, true) => &[0, 1],
        (_, false) => &[2, 0, 1],
        (_, true) => &[2, 0, 1, 3],
    }
}

/// The upright frame of packed samples of a stored picture of `width × height` px; `None` where their number is wrong.
pub(super) fn unpack<S: Sample>(
    samples: &[S],
    (width, height): (usize, usize),
    format: PixelFormat,
    orientation: ExifOrientation,
) -> Option<Frame> {
    let order = planes_of(format);
    let channels = order.len();
    if samples.len() != width * height * channels || samples.is_empty() {
        return None;
    }
    let (w, h) = orientation.size(width, height);
    let mut frame = Frame::new(format, w, h);
    frame.color.full_range = Some(true);
    if orientation == ExifOrientation::default() && order == [2, 0, 1] {
        unpack_upright(samples, &mut frame)?;
        return Some(frame);
    }
    for (channel, &plane) in order.iter().enumerate() {
        let (data, stride) = S::plane_mut(&mut frame, plane)?.into_data();
        data.par_chunks_mut(stride * ROWS).enumerate().for_each(|(task, rows)| {
            for (j, row) in (task * ROWS..h).zip(rows.chunks_mut(stride)) {
                fill_row(&mut row[..w], samples, (width, height), (channel, channels), orientation, j);
            }
        });
    }
    Some(frame)
}

/// Red, green and blue that are upright already, as of nearly every picture: all planes in one pass.
fn unpack_upright<S: Sample>(samples: &[S], frame: &mut Frame) -> Option<()> {
    let width = frame.width;
    let planes = <[PlaneMut<'_, S>; 3]>::try_from(S::planes_mut(frame)?).ok()?;
    let [(g, g_stride), (b, b_stride), (r, r_stride)] = planes.map(PlaneMut::into_data);
    let tasks = g.par_chunks_mut(g_stride * ROWS).zip(b.par_chunks_mut(b_stride * ROWS));
    let tasks = tasks.zip(r.par_chunks_mut(r_stride * ROWS)).zip(samples.par_chunks(3 * width * ROWS));
    tasks.for_each(|(((g, b), r), samples)| {
        let rows = g.chunks_mut(g_stride).zip(b.chunks_mut(b_stride)).zip(r.chunks_mut(r_stride));
        for (((g, b), r), samples) in rows.zip(samples.chunks_exact(3 * width)) {
            S::split(samples, &mut g[..width], &mut b[..width], &mut r[..width]);
        }
    });
    Some(())
}

multiversion! {
    /// Packed red, green and blue as rows of each.
    fn split8(samples: &[u8], g: &mut [u8], b: &mut [u8], r: &mut [u8]) {
        for (((pixel, r), g), b) in samples.as_chunks::<3>().0.iter().zip(r).zip(g).zip(b) {
            [*r, *g, *b] = *pixel;
        }
    }
}

multiversion! {
    /// The same at 16 bit.
    fn split16(samples: &[u16], g: &mut [u16], b: &mut [u16], r: &mut [u16]) {
        for (((pixel, r), g), b) in samples.as_chunks::<3>().0.iter().zip(r).zip(g).zip(b) {
            [*r, *g, *b] = *pixel;
        }
    }
}

/// [`unpack`] of samples that are not needed any longer: of red, green and blue that are upright already in their own memory.
pub(super) fn unpacked<S: Sample>(
    mut samples: Vec<S>,
    size: (usize, usize),
    format: PixelFormat,
    orientation: ExifOrientation,
) -> Option<Frame> {
    let (width, height) = size;
    let fits = samples.len() == 3 * width * height && !samples.is_empty();
    if !(fits && orientation == ExifOrientation::default() && planes_of(format) == [2, 0, 1]) {
        return unpack(&samples, size, format, orientation);
    }
    samples.par_chunks_mut(3 * width * ROWS).for_each_init(Vec::new, |copy, rows| {
        for row in rows.chunks_exact_mut(3 * width) {
            copy.clear();
            copy.extend_from_slice(row);
            let (g, rest) = row.split_at_mut(width);
            let (b, r) = rest.split_at_mut(width);
            S::split(copy, g, b, r);
        }
    });
    let mut frame = Frame::from_buffer(format, width, height, Box::new(PlanesByRow { samples, width }));
    frame.color.full_range = Some(true);
    Some(frame)
}

/// Planes whose rows take turns: a row of green, of blue, of red, the next of green.
struct PlanesByRow<S> {
    samples: Vec<S>,
    width: usize,
}

impl<S> PlanesByRow<S> {
    /// Bytes from a row of a plane to its next.
    fn stride(&self) -> usize {
        3 * self.width * size_of::<S>()
    }
}

impl<S: Sample> FrameBuffer for PlanesByRow<S> {
    fn plane(&self, i: usize) -> PlaneRows<'_> {
        (bytemuck::cast_slice(&self.samples[i * self.width..]), self.stride())
    }

    fn plane_mut(&mut self, i: usize) -> Option<(&mut [u8], usize)> {
        let stride = self.stride();
        Some((bytemuck::cast_slice_mut(&mut self.samples[i * self.width..]), stride))
    }

    fn planes_mut(&mut self) -> Option<Vec<(&mut [u8], usize)>> {
        None
    }

    fn as_any(&mut self) -> &mut dyn Any {
        self
    }
}

/// Row `j` of one plane of the upright picture.
fn fill_row<S: Sample>(
    row: &mut [S],
    samples: &[S],
    (width, height): (usize, usize),
    (channel, channels): (usize, usize),
    orientation: ExifOrientation,
    j: usize,
) {
    if orientation.swap {
        for (i, sample) in row.iter_mut().enumerate() {
            let (x, y) = orientation.stored((i, j), width, height);
            *sample = samples[(y * width + x) * channels + channel];
        }
        return;
    }
    let y = orientation.stored((0, j), width, height).1;
    let stored = samples[y * width * channels..][..width * channels].chunks_exact(channels).map(|p| p[channel]);
    if orientation.flip_x {
        row.iter_mut().rev().zip(stored).for_each(|(to, from)| *to = from);
    } else {
        row.iter_mut().zip(stored).for_each(|(to, from)| *to = from);
    }
}

/// Packed samples of the planes `order`, of rows `from..from + out.len() / (width · channels)`.
pub(super) fn pack_rows<S: Sample>(
    frame: &Frame,
    order: &[usize],
    from: usize,
    out: &mut [S],
) -> Result<(), StillError> {
    let channels = order.len();
    for (channel, &plane) in order.iter().enumerate() {
        let plane = S::plane(frame, plane).ok_or(StillError::Layout)?;
        let rows = out.chunks_exact_mut(frame.width * channels).enumerate();
        for (j, row) in rows {
            let samples = row.iter_mut().skip(channel).step_by(channels);
            samples.zip(plane.row(from + j)).for_each(|(to, from)| *to = *from);
        }
    }
    Ok(())
}

/// A frame oriented upright; `None` where its memory does not hold its planes, or its chroma is subsampled.
pub fn oriented(frame: &Frame, orientation: ExifOrientation) -> Option<Frame> {
    let (w, h) = orientation.size(frame.width, frame.height);
    let mut out = Frame::new(frame.format, w, h);
    out.copy_properties(frame);
    for i in 0..frame.format.planes() {
        let plain = frame.format.subsampling(i) == (0, 0);
        let oriented = if frame.format.bits == 8 {
            turned_plane::<u8>(frame, &mut out, i, orientation)
        } else {
            turned_plane::<u16>(frame, &mut out, i, orientation)
        };
        oriented.filter(|()| plain)?;
    }
    Some(out)
}

fn turned_plane<S: Sample>(frame: &Frame, out: &mut Frame, i: usize, orientation: ExifOrientation) -> Option<()> {
    let from = S::plane(frame, i)?;
    let (width, height) = (out.width, out.height);
    let (data, stride) = S::plane_mut(out, i)?.into_data();
    data.par_chunks_mut(stride).take(height).enumerate().for_each(|(j, row)| {
        for (i, sample) in row[..width].iter_mut().enumerate() {
            let (x, y) = orientation.stored((i, j), frame.width, frame.height);
            *sample = from.row(y)[x];
        }
    });
    Some(())
}

/// An 8-bit frame of packed red, green and blue.
///
/// # Errors
/// [`StillError::Layout`] where their number is wrong.
pub fn frame_of_rgb(samples: &[u8], width: usize, height: usize) -> Result<Frame, StillError> {
    let format = PixelFormat::opaque(Layout::Gbr, 8);
    unpack(samples, (width, height), format, ExifOrientation::default()).ok_or(StillError::Layout)
}

#[cfg(test)]
mod tests {
    use super::super::bands::Bands;
    use super::*;

    fn pack(frame: &Frame) -> Vec<u16> {
        Bands::of(frame).packed(planes_of(frame.format)).expect("a still format")
    }

    #[test]
    fn packing_undoes_unpacking_in_every_format() {
        for (layout, alpha) in [(Layout::Gray, false), (Layout::Gray, true), (Layout::Gbr, false), (Layout::Gbr, true)]
        {
            let format = PixelFormat { layout, bits: 16, alpha };
            let count = 37 * 70 * planes_of(format).len();
            let samples: Vec<u16> = (0..count).map(|i| (i * 7) as u16).collect();
            let frame = unpack(&samples, (37, 70), format, ExifOrientation::default()).expect("as many as it takes");
            assert_eq!(pack(&frame), samples);
            assert!(unpack(&samples[1..], (37, 70), format, ExifOrientation::default()).is_none());
        }
    }

    #[test]
    fn samples_unpacked_in_their_own_memory_are_the_same() {
        let format = PixelFormat::opaque(Layout::Gbr, 16);
        let samples: Vec<u16> = (0..37 * 70 * 3).map(|i| (i * 7) as u16).collect();
        let apart = unpack(&samples, (37, 70), format, ExifOrientation::default()).expect("as many as it takes");
        let own = unpacked(samples.clone(), (37, 70), format, ExifOrientation::default()).expect("as many as it takes");
        for plane in 0..3 {
            let rows = |frame: &Frame| {
                (0..70).map(|y| frame.plane16(plane).expect("16 bit").row(y).to_vec()).collect::<Vec<_>>()
            };
            assert_eq!(rows(&own), rows(&apart), "plane {plane}");
        }
        assert_eq!(pack(&own), samples);
        assert!(unpacked(samples[1..].to_vec(), (37, 70), format, ExifOrientation::default()).is_none());
    }

    #[test]
    fn red_green_and_blue_go_to_their_planes() {
        let format = PixelFormat::opaque(Layout::Gbr, 8);
        let frame = unpack(&[1_u8, 2, 3, 4, 5, 6], (2, 1), format, ExifOrientation::of_tag(2)).expect("six samples");
        let plane = |i| frame.plane8(i).expect("8 bit").row(0).to_vec();
        assert_eq!((plane(0), plane(1), plane(2)), (vec![5, 2], vec![6, 3], vec![4, 1]), "mirrored, green first");
    }

    #[test]
    fn rotated_pictures_agree_with_the_orientation_tag() {
        let (w, h) = (41, 33);
        let samples: Vec<u16> = (0..w * h).map(|i| i as u16).collect();
        for value in 1..=8 {
            let orientation = ExifOrientation::of_tag(value);
            let frame = unpack(&samples, (w, h), PixelFormat::opaque(Layout::Gray, 16), orientation).expect("as many");
            assert_eq!((frame.width, frame.height), orientation.size(w, h));
            let plane = frame.plane16(0).expect("16 bit");
            for (i, j) in [(0, 0), (frame.width - 1, 0), (3, frame.height - 1), (17, 32)] {
                let (x, y) = orientation.stored((i, j), w, h);
                assert_eq!(usize::from(plane.row(j)[i]), y * w + x, "{value}");
            }
        }
    }
}
