//! Reading: format by content, sizes before memory, orientation applied.

use std::fs::File;
use std::io::{BufRead, BufReader, Seek};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use super::container::{self, Container, Pixels, SPARE};
use super::jpeg::EncodedMap;
use super::packed::unpacked;
use super::sniff::{HEAD, refuse_raw_name, sniff};
use super::{ExifOrientation, ExifTags, GainMap, Photo, StillError, exif};
use crate::{Frame, PixelFormat};
use plumbline_num::files::open_regular;

/// How pictures are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadOptions {
    /// Most pixels; larger pictures are refused before memory is taken for them.
    pub max_pixels: u64,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self { max_pixels: 1 << 28 }
    }
}

impl LoadOptions {
    /// Refuses a size.
    pub(super) fn check(self, width: u64, height: u64) -> Result<(), StillError> {
        if width == 0 || height == 0 {
            return Err(StillError::Damaged(format!("a picture of {width}×{height} px")));
        }
        if width.saturating_mul(height) > self.max_pixels {
            return Err(StillError::TooLarge { width, height, limit: self.max_pixels });
        }
        Ok(())
    }

    /// Most bytes of a file that can hold no more pixels than allowed.
    pub(super) fn most_bytes(self) -> u64 {
        self.max_pixels.saturating_mul(8).saturating_add(SPARE)
    }
}

/// Reads a file.
///
/// # Errors
/// Any of [`StillError`] that is about input.
pub fn load(path: &Path, options: LoadOptions) -> Result<Photo, StillError> {
    decode(open(path, options)?, options)
}

/// Width and height of the upright picture, px, from the head of the file; pixels are not decoded.
///
/// # Errors
/// Any of [`StillError`] that is about input.
pub fn size(path: &Path, options: LoadOptions) -> Result<(usize, usize), StillError> {
    let opened = Opened::new(open(path, options)?, options)?;
    Ok(opened.orientation.size(opened.size.0, opened.size.1))
}

fn open(path: &Path, options: LoadOptions) -> Result<BufReader<File>, StillError> {
    let file = open_regular(path).map_err(StillError::Read)?;
    refuse_raw_name(path)?;
    let bytes = file.metadata().map_err(StillError::Read)?.len();
    if bytes > options.most_bytes() {
        return Err(StillError::TooLong { bytes, limit: options.max_pixels });
    }
    Ok(BufReader::with_capacity(1 << 16, file))
}

/// Reads a picture from memory or an open file.
///
/// # Errors
/// Any of [`StillError`] that is about input.
pub fn decode(reader: impl BufRead + Seek, options: LoadOptions) -> Result<Photo, StillError> {
    // Decoders are other people's code over hostile bytes: a panic there is a damaged file, not the end of the run.
    let decoded = catch_unwind(AssertUnwindSafe(|| Opened::new(reader, options)?.photo()));
    decoded.unwrap_or_else(|_| Err(StillError::Damaged("its decoder gave up".to_owned())))
}

/// A picture whose head was read.
struct Opened<'r> {
    pixels: Pixels<'r>,
    /// Stored width and height, px.
    size: (usize, usize),
    orientation: ExifOrientation,
    /// Everything but the pixels, whose frame is one pixel large.
    photo: Photo,
    layout: PixelFormat,
    gain_map: Option<EncodedMap>,
}

impl<'r> Opened<'r> {
    fn new(mut reader: impl BufRead + Seek + 'r, options: LoadOptions) -> Result<Self, StillError> {
        let mut head = [0; HEAD];
        let mut filled = 0;
        while filled < HEAD {
            match reader.read(&mut head[filled..]).map_err(StillError::Read)? {
                0 => break,
                n => filled += n,
            }
        }
        reader.rewind().map_err(StillError::Read)?;
        let format = sniff(&head[..filled])?;
        let Container { pixels, size, format: layout, mut exif, icc, xmp, iptc, gain_map, orientation } =
            container::open(reader, format, options)?;
        if let Some(b) = exif.as_mut().filter(|b| b.starts_with(b"Exif\0\0")) {
            b.drain(..6);
        }
        let tag = orientation.or_else(|| exif.as_deref().and_then(exif::orientation));
        let orientation = ExifOrientation::of_tag(tag.unwrap_or(1));
        let (width, height) = orientation.size(size.0, size.1);
        let mut photo = Photo::new(Frame::new(layout, 1, 1));
        photo.tags = exif.as_deref().map(ExifTags::of).unwrap_or_default();
        if exif.as_mut().is_some_and(|b| !exif::describe(b, width, height)) {
            exif = None;
            photo.warnings.push("its EXIF is damaged and was left out".to_owned());
        }
        photo.xmp = xmp.and_then(|xmp| xmp.read((width, height), &mut photo.warnings));
        photo.icc = icc.filter(|p| !p.is_empty());
        (photo.exif, photo.iptc, photo.format) = (exif, iptc, Some(format));
        let gain_map = gain_map.unwrap_or_else(|lost| {
            photo.warnings.push(lost.to_owned());
            None
        });
        Ok(Self { pixels, size, orientation, photo, layout, gain_map })
    }

    /// Decodes the pixels.
    fn photo(self) -> Result<Photo, StillError> {
        let Self { pixels, size, orientation, mut photo, layout, gain_map } = self;
        let samples = size.0 * size.1 * super::packed::planes_of(layout).len();
        let frame = if layout.bits == 8 {
            let mut packed = vec![0_u8; samples];
            pixels.read(&mut packed, &mut photo.warnings)?;
            unpacked(packed, size, layout, orientation)
        } else {
            let mut packed = vec![0_u16; samples];
            pixels.read(bytemuck::cast_slice_mut(&mut packed), &mut photo.warnings)?;
            unpacked(packed, size, layout, orientation)
        };
        if let Some(map) = gain_map {
            match GainMap::decoded(map, orientation, size.0 * size.1) {
                Ok(map) => photo.gain_map = Some(map),
                Err(e) => photo.warnings.push(format!("its HDR gain map was left out: {e}")),
            }
        }
        Ok(Photo { frame: frame.ok_or(StillError::Layout)?, ..photo })
    }
}
