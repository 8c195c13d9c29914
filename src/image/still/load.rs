//! Reading: format by content, sizes before memory, orientation applied.

use std::fs::File;
use std::io::{BufRead, BufReader, Cursor, Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use image::codecs::jpeg::JpegDecoder;
use image::codecs::png::PngDecoder;
use image::codecs::tiff::TiffDecoder;
use image::codecs::webp::WebPDecoder;
use image::{ColorType, ExtendedColorType, ImageDecoder, Limits};

use super::packed::unpack;
use super::sniff::{HEAD, refuse_raw_name, sniff};
use super::{ExifOrientation, ExifTags, Photo, StillError, StillFormat, exif, jpeg, tiff};
use crate::{Layout, PixelFormat};
use plumbline_num::files::open_regular;

/// Memory beyond the pixels that a decoder may take, bytes: rows, tables, metadata.
const SPARE: u64 = 64 << 20;

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
    fn most_bytes(self) -> u64 {
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
    Ok(opened.orientation.size(opened.width, opened.height))
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
    decoder: Box<dyn ImageDecoder + 'r>,
    format: StillFormat,
    width: usize,
    height: usize,
    pixels: PixelFormat,
    orientation: ExifOrientation,
    exif: Option<Vec<u8>>,
    tags: ExifTags,
    icc: Option<Vec<u8>>,
    warnings: Vec<String>,
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
        let mut own = None;
        let mut decoder: Box<dyn ImageDecoder + 'r> = match format {
            StillFormat::Jpeg => Box::new(jpeg_decoder(reader, options)?),
            StillFormat::Png => {
                let limits = Limits::no_limits();
                let decoder = PngDecoder::with_limits(reader, limits).map_err(StillError::of_decoder)?;
                if decoder.is_apng().map_err(StillError::of_decoder)? {
                    return Err(StillError::Animated("PNG"));
                }
                Box::new(decoder)
            }
            StillFormat::WebP => {
                check_riff(&mut reader, &head[..filled])?;
                let decoder = WebPDecoder::new(reader).map_err(StillError::of_decoder)?;
                if decoder.has_animation() {
                    return Err(StillError::Animated("WebP"));
                }
                Box::new(decoder)
            }
            StillFormat::Tiff => {
                own = Some(tiff::metadata(&mut reader, options.most_bytes())?);
                reader.seek(SeekFrom::Start(0)).map_err(StillError::Read)?;
                Box::new(TiffDecoder::new(reader).map_err(StillError::of_decoder)?)
            }
        };
        let (width, height) = decoder.dimensions();
        options.check(u64::from(width), u64::from(height))?;
        let mut limits = Limits::no_limits();
        limits.max_alloc = Some(decoder.total_bytes().saturating_mul(2).saturating_add(SPARE));
        decoder.set_limits(limits).map_err(StillError::of_decoder)?;
        let pixels = pixel_format(&*decoder)?;
        let mut warnings = Vec::new();
        let (mut block, icc) = match own {
            Some(found) => (found.exif, found.icc),
            None => (decoder.exif_metadata().ok().flatten(), decoder.icc_profile().ok().flatten()),
        };
        if let Some(b) = block.as_mut().filter(|b| b.starts_with(b"Exif\0\0")) {
            b.drain(..6);
        }
        let tag = match format {
            StillFormat::Tiff => decoder.orientation().ok().map(|o| u32::from(o.to_exif())),
            _ => block.as_deref().and_then(exif::orientation),
        };
        let orientation = ExifOrientation::of_tag(tag.unwrap_or(1));
        let (width, height) = (width as usize, height as usize);
        let tags = block.as_deref().map(ExifTags::of).unwrap_or_default();
        let (w, h) = orientation.size(width, height);
        if let Some(b) = &mut block
            && !exif::describe(b, w, h)
        {
            block = None;
            warnings.push("its EXIF is damaged and was left out".to_owned());
        }
        let icc = icc.filter(|p| !p.is_empty());
        Ok(Self { decoder, format, width, height, pixels, orientation, exif: block, tags, icc, warnings })
    }

    /// Decodes the pixels.
    fn photo(self) -> Result<Photo, StillError> {
        let Self { decoder, format, width, height, pixels, orientation, exif, tags, icc, warnings } = self;
        let samples = width * height * super::packed::planes_of(pixels).len();
        let frame = if pixels.bits == 8 {
            let mut packed = vec![0_u8; samples];
            decoder.read_image_boxed(&mut packed).map_err(StillError::of_decoder)?;
            unpack(&packed, (width, height), pixels, orientation)
        } else {
            let mut packed = vec![0_u16; samples];
            decoder.read_image_boxed(bytemuck::cast_slice_mut(&mut packed)).map_err(StillError::of_decoder)?;
            unpack(&packed, (width, height), pixels, orientation)
        };
        let frame = frame.ok_or(StillError::Layout)?;
        Ok(Photo { frame, exif, tags, icc, format: Some(format), warnings })
    }
}

/// A WebP file declares its length in its header; a truncation behind the pixels would go unnoticed otherwise.
fn check_riff(reader: &mut (impl BufRead + Seek), head: &[u8]) -> Result<(), StillError> {
    let [_, _, _, _, a, b, c, d, ..] = *head else { return Err(StillError::Truncated) };
    let claimed = u64::from(u32::from_le_bytes([a, b, c, d])) + 8;
    let length = reader.seek(SeekFrom::End(0)).map_err(StillError::Read)?;
    reader.rewind().map_err(StillError::Read)?;
    if claimed > length { Err(StillError::Truncated) } else { Ok(()) }
}

/// The decoder of a JPEG file whose markers are sound.
fn jpeg_decoder(
    mut reader: impl BufRead + Seek,
    options: LoadOptions,
) -> Result<JpegDecoder<Cursor<Vec<u8>>>, StillError> {
    let mut bytes = Vec::new();
    reader.by_ref().take(options.most_bytes()).read_to_end(&mut bytes).map_err(StillError::Read)?;
    let (width, height) = jpeg::check(&bytes)?;
    options.check(u64::from(width), u64::from(height))?;
    JpegDecoder::new(Cursor::new(bytes)).map_err(StillError::of_decoder)
}

/// The planes of a decoded picture.
fn pixel_format(decoder: &dyn ImageDecoder) -> Result<PixelFormat, StillError> {
    if matches!(decoder.original_color_type(), ExtendedColorType::Cmyk8 | ExtendedColorType::Cmyk16) {
        return Err(StillError::Cmyk);
    }
    let format = |layout, bits, alpha| Ok(PixelFormat { layout, bits, alpha });
    match decoder.color_type() {
        ColorType::L8 => format(Layout::Gray, 8, false),
        ColorType::La8 => format(Layout::Gray, 8, true),
        ColorType::L16 => format(Layout::Gray, 16, false),
        ColorType::La16 => format(Layout::Gray, 16, true),
        ColorType::Rgb8 => format(Layout::Gbr, 8, false),
        ColorType::Rgba8 => format(Layout::Gbr, 8, true),
        ColorType::Rgb16 => format(Layout::Gbr, 16, false),
        ColorType::Rgba16 => format(Layout::Gbr, 16, true),
        ColorType::Rgb32F | ColorType::Rgba32F => Err(StillError::Depth("samples of 32-bit floats".to_owned())),
        other => Err(StillError::Depth(format!("samples of kind {other:?}"))),
    }
}
