//! PNG: rows into the stream of the format's crate as they are made, metadata behind the header.

use std::borrow::Cow;
use std::io::Write;

use png::{BitDepth, ColorType, DeflateCompression, Encoder, EncodingError, Filter, Info, chunk};

use super::bands::Bands;
use super::packed::{Sample, planes_of};
use super::save::Metadata;
use super::{StillError, iptc};
use crate::Layout;

/// Bytes of the rows that are made at once, on all threads, and of a chunk of the file.
const MADE: usize = 16 << 20;
const CHUNK: usize = 1 << 18;

/// Writes pixels.
pub(super) fn encode(bands: &Bands<'_>, metadata: Metadata, out: impl Write) -> Result<(), StillError> {
    let (format, (width, height)) = (bands.format(), bands.size());
    let mut info = Info::with_size(width as u32, height as u32);
    info.color_type = match (format.layout, format.alpha) {
        (Layout::Gray, false) => ColorType::Grayscale,
        (Layout::Gray, true) => ColorType::GrayscaleAlpha,
        (_, false) => ColorType::Rgb,
        (_, true) => ColorType::Rgba,
    };
    info.bit_depth = if format.bits == 8 { BitDepth::Eight } else { BitDepth::Sixteen };
    info.icc_profile = metadata.icc.map(Cow::Owned);
    info.exif_metadata = metadata.exif.map(Cow::Owned);
    let mut encoder = Encoder::with_info(out, info).map_err(refused)?;
    // The faster compression of the crate writes noise by a third larger than it is, and a stream cannot be taken back.
    encoder.set_deflate_compression(DeflateCompression::Level(1));
    encoder.set_filter(Filter::Adaptive);
    let mut writer = encoder.write_header().map_err(refused)?;
    if let Some(xmp) = metadata.xmp {
        // Not compressed, no language, no translated keyword.
        let content = [b"XML:com.adobe.xmp\0\0\0\0\0", &xmp.packet[..]].concat();
        writer.write_chunk(chunk::iTXt, &content).map_err(refused)?;
    }
    if let Some(iim) = metadata.iptc {
        let content = [b"Raw profile type iptc\0", iptc::text(&iim).as_bytes()].concat();
        writer.write_chunk(chunk::tEXt, &content).map_err(refused)?;
    }
    let mut stream = writer.stream_writer_with_size(CHUNK).map_err(refused)?;
    if format.bits == 8 {
        write_rows::<u8>(bands, |v| v, &mut stream)?;
    } else {
        write_rows::<u16>(bands, u16::to_be, &mut stream)?;
    }
    stream.finish().map_err(refused)?;
    writer.finish().map_err(refused)
}

/// Writes packed rows in the byte order of the file.
fn write_rows<S: Sample>(bands: &Bands<'_>, ordered: fn(S) -> S, out: &mut impl Write) -> Result<(), StillError> {
    let (order, (width, height)) = (planes_of(bands.format()), bands.size());
    let row = width * order.len();
    let rows = (MADE / (row * size_of::<S>()).max(1)).clamp(1, height);
    let mut made = vec![S::zeroed(); row * rows];
    for first in (0..height).step_by(rows) {
        let made = &mut made[..row * rows.min(height - first)];
        bands.pack_rows(order, first, made)?;
        for v in made.iter_mut() {
            *v = ordered(*v);
        }
        out.write_all(bytemuck::cast_slice(made)).map_err(StillError::Write)?;
    }
    Ok(())
}

fn refused(error: EncodingError) -> StillError {
    match error {
        EncodingError::IoError(e) => StillError::Write(e),
        other => StillError::Encode(other.to_string()),
    }
}
