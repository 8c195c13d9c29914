//! Pixels on their way into a file, in bands of rows: those of a frame, or rows that are made when they are written.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use super::packed::{ROWS, Sample, is_still, pack_rows};
use super::{StillError, reduce};
use crate::{Frame, Layout, PixelFormat};

/// A picture whose rows are made when they are asked for, on many threads at once.
pub(crate) trait RowSource: Sync {
    /// Format of the rows: gray or GBR of 8 or 16 bit.
    fn format(&self) -> PixelFormat;

    /// Width and height of the picture, px.
    fn size(&self) -> (usize, usize);

    /// Rows as a frame of their own.
    fn rows(&self, rows: Range<usize>) -> Result<Frame, StillError>;
}

/// Where the pixels come from.
#[derive(Clone, Copy)]
pub(super) enum Pixels<'a> {
    /// They are there.
    Frame(&'a Frame),
    /// They are made when they are asked for.
    Rows(&'a dyn RowSource),
}

/// What the format of a file cannot hold, and is taken away band by band.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Reduction {
    /// Transparency, over white.
    pub(super) flat: bool,
    /// More than 8 bit.
    pub(super) eight: bool,
}

/// Pixels as they are written.
pub(super) struct Bands<'a> {
    pixels: Pixels<'a>,
    reduction: Reduction,
    transparent: AtomicBool,
}

/// Rows of a picture.
pub(super) struct Band<'a> {
    frame: Held<'a>,
    /// The row of the frame at which they begin.
    pub(super) first: usize,
}

enum Held<'a> {
    Whole(&'a Frame),
    Rows(Frame),
}

impl Band<'_> {
    /// The frame that holds the rows.
    pub(super) fn frame(&self) -> &Frame {
        match &self.frame {
            Held::Whole(frame) => frame,
            Held::Rows(frame) => frame,
        }
    }
}

impl<'a> Bands<'a> {
    /// All of a frame, as it is.
    pub(super) fn of(frame: &'a Frame) -> Self {
        Self::reduced(Pixels::Frame(frame), Reduction::default())
    }

    pub(super) fn reduced(pixels: Pixels<'a>, reduction: Reduction) -> Self {
        Self { pixels, reduction, transparent: AtomicBool::new(false) }
    }

    /// Format of the bands.
    pub(super) fn format(&self) -> PixelFormat {
        let format = self.pixels.format();
        let bits = if self.reduction.eight { 8 } else { format.bits };
        PixelFormat { bits, alpha: format.alpha && !self.reduction.flat, ..format }
    }

    /// Width and height of the picture, px.
    pub(super) fn size(&self) -> (usize, usize) {
        self.pixels.size()
    }

    /// Transparency was taken away from a band.
    pub(super) fn was_transparent(&self) -> bool {
        self.transparent.load(Ordering::Relaxed)
    }

    /// Some rows.
    pub(super) fn band(&self, rows: Range<usize>) -> Result<Band<'a>, StillError> {
        let Reduction { flat, eight } = self.reduction;
        let mut frame = match self.pixels {
            Pixels::Frame(frame) if !flat && !eight => {
                return Ok(Band { frame: Held::Whole(frame), first: rows.start });
            }
            Pixels::Frame(frame) => copied(frame, rows)?,
            Pixels::Rows(source) => source.rows(rows)?,
        };
        if flat {
            self.transparent.fetch_or(!reduce::is_opaque(&frame), Ordering::Relaxed);
            frame = reduce::over_white(&frame)?;
        }
        if eight {
            frame = reduce::to_8_bit(&frame)?;
        }
        Ok(Band { frame: Held::Rows(frame), first: 0 })
    }

    /// Packed samples of the planes `order`, of as many rows from `first` on as `out` has room for.
    pub(super) fn pack_rows<S: Sample>(&self, order: &[usize], first: usize, out: &mut [S]) -> Result<(), StillError> {
        let (row, height) = (self.size().0 * order.len(), self.size().1);
        let chunks = out.par_chunks_mut(row * ROWS).enumerate();
        chunks.try_for_each(|(task, out)| {
            let first = first + task * ROWS;
            let band = self.band(first..(first + out.len() / row).min(height))?;
            pack_rows(band.frame(), order, band.first, out)
        })
    }

    /// All samples of the planes `order`, packed.
    pub(super) fn packed<S: Sample>(&self, order: &[usize]) -> Result<Vec<S>, StillError> {
        let (width, height) = self.size();
        let mut out = vec![S::zeroed(); width * height * order.len()];
        self.pack_rows(order, 0, &mut out)?;
        Ok(out)
    }
}

impl Pixels<'_> {
    pub(super) fn format(self) -> PixelFormat {
        match self {
            Self::Frame(frame) => frame.format,
            Self::Rows(source) => source.format(),
        }
    }

    pub(super) fn size(self) -> (usize, usize) {
        match self {
            Self::Frame(frame) => (frame.width, frame.height),
            Self::Rows(source) => source.size(),
        }
    }

    pub(super) fn is_still(self) -> bool {
        is_still(self.format())
    }
}

/// Red, green and blue of a still frame in 8 bit, over white where it is transparent.
///
/// # Errors
/// [`StillError::Layout`].
pub fn rgb_of_frame(frame: &Frame) -> Result<Vec<[u8; 3]>, StillError> {
    rgb_of_rows(frame, 0..frame.height)
}

/// [`rgb_of_frame`] of some rows: a large picture need not be in memory twice.
///
/// ```
/// use plumbline_image::still::{frame_of_rgb, rgb_of_rows};
///
/// let frame = frame_of_rgb(&[1, 2, 3, 4, 5, 6], 1, 2)?;
/// assert_eq!(rgb_of_rows(&frame, 1..2)?, [[4, 5, 6]]);
/// # Ok::<(), plumbline_image::still::StillError>(())
/// ```
///
/// # Errors
/// [`StillError::Layout`]; also for rows that the frame does not have.
pub fn rgb_of_rows(frame: &Frame, rows: Range<usize>) -> Result<Vec<[u8; 3]>, StillError> {
    if !is_still(frame.format) || rows.end > frame.height {
        return Err(StillError::Layout);
    }
    let order: &[usize] = if frame.format.layout == Layout::Gray { &[0, 0, 0] } else { &[2, 0, 1] };
    let reduction = Reduction { flat: frame.format.alpha, eight: frame.format.bits > 8 };
    let mut out = vec![[0_u8; 3]; frame.width * rows.len()];
    let samples: &mut [u8] = bytemuck::cast_slice_mut(&mut out);
    Bands::reduced(Pixels::Frame(frame), reduction).pack_rows(order, rows.start, samples)?;
    Ok(out)
}

/// Rows of a frame, as a frame of their own.
fn copied(frame: &Frame, rows: Range<usize>) -> Result<Frame, StillError> {
    let mut out = Frame::new(frame.format, frame.width, rows.len());
    out.copy_properties(frame);
    for plane in 0..frame.format.planes() {
        if frame.format.bits == 8 {
            copy_plane::<u8>(frame, rows.start, &mut out, plane).ok_or(StillError::Layout)?;
        } else {
            copy_plane::<u16>(frame, rows.start, &mut out, plane).ok_or(StillError::Layout)?;
        }
    }
    Ok(out)
}

fn copy_plane<S: Sample>(frame: &Frame, first: usize, out: &mut Frame, i: usize) -> Option<()> {
    let from = S::plane(frame, i)?;
    let height = out.height;
    let mut to = S::plane_mut(out, i)?;
    (0..height).for_each(|j| to.row_mut(j).copy_from_slice(from.row(first + j)));
    Some(())
}
