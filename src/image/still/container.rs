//! Files opened: what the head says, what travels along with the pixels, and a decoder that was not asked for them yet.

use std::io::{BufRead, Cursor, Read, Seek, SeekFrom};

use image::codecs::jpeg::JpegDecoder;
use image::codecs::png::PngDecoder;
use image::codecs::tiff::TiffDecoder;
use image::codecs::webp::WebPDecoder;
use image::{ColorType, ExtendedColorType, ImageDecoder, Limits};

use super::floats::Floats;
use super::{LoadOptions, StillError, StillFormat, Xmp, iptc, jpeg, tiff};
use crate::{Layout, PixelFormat};

/// Memory beyond the pixels that a decoder may take, bytes: rows, tables, metadata.
pub(super) const SPARE: u64 = 64 << 20;

/// A file whose head was read.
pub(super) struct Container<'r> {
    pub(super) pixels: Pixels<'r>,
    /// Stored width and height, px; within the limits.
    pub(super) size: (usize, usize),
    pub(super) format: PixelFormat,
    pub(super) exif: Option<Vec<u8>>,
    pub(super) icc: Option<Vec<u8>>,
    pub(super) xmp: Option<Xmp>,
    pub(super) iptc: Option<Vec<u8>>,
    /// A gain map behind the picture, or why it cannot be read.
    pub(super) gain_map: Result<Option<jpeg::EncodedMap>, &'static str>,
    /// Orientation, where the container has it outside of EXIF.
    pub(super) orientation: Option<u32>,
}

/// Where the pixels come from.
pub(super) enum Pixels<'r> {
    /// A decoder of samples as they are written into planes.
    Decoder(Box<dyn ImageDecoder + 'r>),
    /// A JPEG file of inks, and its profile.
    Inks { file: Vec<u8>, profile: Option<Vec<u8>> },
    /// A TIFF file of floating-point samples.
    Floats(Floats<'r>),
}

impl Pixels<'_> {
    /// Decodes packed samples of the container's format, and warns of what is not in them.
    pub(super) fn read(self, packed: &mut [u8], warnings: &mut Vec<String>) -> Result<(), StillError> {
        match self {
            Self::Decoder(decoder) => decoder.read_image_boxed(packed).map_err(StillError::of_decoder),
            Self::Inks { file, profile } => jpeg::read_rgb(&file, profile.as_deref(), packed, warnings),
            Self::Floats(floats) => {
                let packed = bytemuck::try_cast_slice_mut(packed).map_err(|_| StillError::Layout)?;
                floats.read(packed, warnings)
            }
        }
    }
}

/// Opens a file of a format.
pub(super) fn open<'r>(
    mut reader: impl BufRead + Seek + 'r,
    format: StillFormat,
    options: LoadOptions,
) -> Result<Container<'r>, StillError> {
    match format {
        StillFormat::Jpeg => open_jpeg(reader, options),
        StillFormat::Png => {
            let decoder = PngDecoder::with_limits(reader, Limits::no_limits()).map_err(StillError::of_decoder)?;
            if decoder.is_apng().map_err(StillError::of_decoder)? {
                return Err(StillError::Animated("PNG"));
            }
            let mut container = of_decoder(Box::new(decoder), options)?;
            container.iptc = container.iptc.as_deref().and_then(iptc::of_text);
            Ok(container)
        }
        StillFormat::WebP => {
            check_riff(&mut reader)?;
            let decoder = WebPDecoder::new(reader).map_err(StillError::of_decoder)?;
            if decoder.has_animation() {
                return Err(StillError::Animated("WebP"));
            }
            of_decoder(Box::new(decoder), options)
        }
        StillFormat::Tiff => open_tiff(reader, options),
    }
}

fn open_jpeg<'r>(mut reader: impl BufRead + Seek, options: LoadOptions) -> Result<Container<'r>, StillError> {
    let mut bytes = Vec::new();
    reader.by_ref().take(options.most_bytes()).read_to_end(&mut bytes).map_err(StillError::Read)?;
    let jpeg::Head { size, inks } = jpeg::check(&bytes)?;
    options.check(size.0 as u64, size.1 as u64)?;
    let jpeg::Found { xmp, iptc } = jpeg::found(&bytes);
    let gain_map = jpeg::gain_map(&bytes);
    if !inks {
        let decoder = JpegDecoder::new(Cursor::new(bytes)).map_err(StillError::of_decoder)?;
        return Ok(Container { xmp, iptc, gain_map, ..of_decoder(Box::new(decoder), options)? });
    }
    let (exif, profile) = jpeg::exif_and_profile(&bytes);
    let format = PixelFormat { layout: Layout::Gbr, bits: 8, alpha: false };
    let pixels = Pixels::Inks { file: bytes, profile };
    Ok(Container { pixels, size, format, exif, icc: None, xmp, iptc, gain_map, orientation: None })
}

fn open_tiff<'r>(mut reader: impl BufRead + Seek + 'r, options: LoadOptions) -> Result<Container<'r>, StillError> {
    let found = tiff::metadata(&mut reader, options.most_bytes())?;
    reader.seek(SeekFrom::Start(0)).map_err(StillError::Read)?;
    if found.floats {
        let tiff::TiffMetadata { exif, icc, xmp, iptc, .. } = found;
        let floats = Floats::open(reader, options)?;
        let (size, format) = (floats.size, floats.format);
        let pixels = Pixels::Floats(floats);
        return Ok(Container { pixels, size, format, exif, icc, xmp, iptc, gain_map: Ok(None), orientation: None });
    }
    let mut decoder = TiffDecoder::new(reader).map_err(StillError::of_decoder)?;
    let orientation = decoder.orientation().ok().map(|o| u32::from(o.to_exif()));
    let tiff::TiffMetadata { exif, icc, xmp, iptc, floats: _ } = found;
    Ok(Container { exif, icc, xmp, iptc, orientation, ..of_decoder(Box::new(decoder), options)? })
}

/// What a decoder says of its file.
fn of_decoder<'r>(mut decoder: Box<dyn ImageDecoder + 'r>, options: LoadOptions) -> Result<Container<'r>, StillError> {
    let (width, height) = decoder.dimensions();
    options.check(u64::from(width), u64::from(height))?;
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(decoder.total_bytes().saturating_mul(2).saturating_add(SPARE));
    decoder.set_limits(limits).map_err(StillError::of_decoder)?;
    let format = pixel_format(&*decoder)?;
    let packet = decoder.xmp_metadata().ok().flatten();
    Ok(Container {
        size: (width as usize, height as usize),
        format,
        exif: decoder.exif_metadata().ok().flatten(),
        icc: decoder.icc_profile().ok().flatten(),
        xmp: packet.map(|packet| Xmp { packet, extended: None }),
        iptc: decoder.iptc_metadata().ok().flatten(),
        gain_map: Ok(None),
        orientation: None,
        pixels: Pixels::Decoder(decoder),
    })
}

/// A WebP file declares its length and those of its chunks: a truncation behind the pixels would go unnoticed otherwise, and the
/// decoder takes memory for chunks as long as they claim to be.
fn check_riff(reader: &mut (impl BufRead + Seek)) -> Result<(), StillError> {
    let length = reader.seek(SeekFrom::End(0)).map_err(StillError::Read)?;
    let mut at = 0;
    let mut end = 8;
    while at + 8 <= end.min(length) {
        let mut header = [0; 8];
        reader.seek(SeekFrom::Start(at)).map_err(StillError::Read)?;
        reader.read_exact(&mut header).map_err(StillError::Read)?;
        let [_, _, _, _, a, b, c, d] = header;
        let claimed = u64::from(u32::from_le_bytes([a, b, c, d]));
        if at + 8 + claimed > length {
            return Err(StillError::Truncated);
        }
        // Chunks begin behind the name of the format.
        (at, end) = if at == 0 { (12, 8 + claimed) } else { (at + 8 + claimed + claimed % 2, end) };
    }
    reader.rewind().map_err(StillError::Read)
}

/// The planes of a decoded picture.
pub(super) fn pixel_format(decoder: &dyn ImageDecoder) -> Result<PixelFormat, StillError> {
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
        other => Err(StillError::Depth(format!("samples of kind {other:?}"))),
    }
}
