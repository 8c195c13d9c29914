//! Writing: samples and metadata as far as the format holds them, and a word where it does not.

use std::io::{Seek, Write};

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use image_webp::{ColorType, EncodingError, WebPEncoder};

use super::packed::{is_still, pack};
use super::{GainMap, Photo, StillError, StillFormat, Xmp, exif, iptc, jpeg, png, reduce, tiff};
use crate::{Frame, Layout};

/// How pictures are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SaveOptions {
    /// JPEG quality, 1 to 100. From 90 on chroma keeps its resolution.
    pub quality: u8,
}

impl Default for SaveOptions {
    fn default() -> Self {
        Self { quality: 92 }
    }
}

/// What was written.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Saved {
    /// What the format could not hold.
    pub warnings: Vec<String>,
}

/// What is written beside the pixels.
#[derive(Debug, Default)]
pub(super) struct Metadata {
    pub(super) exif: Option<Vec<u8>>,
    pub(super) icc: Option<Vec<u8>>,
    pub(super) xmp: Option<Xmp>,
    pub(super) iptc: Option<Vec<u8>>,
}

/// Writes a picture. The caller gives the file its name once this succeeds.
///
/// # Errors
/// Those of [`StillError`] that are about output.
pub fn encode(
    photo: &Photo,
    format: StillFormat,
    options: SaveOptions,
    out: impl Write + Seek,
) -> Result<Saved, StillError> {
    if !is_still(photo.frame.format) {
        return Err(StillError::Layout);
    }
    let mut saved = Saved::default();
    let metadata = Metadata::of(photo, format, &mut saved);
    if photo.gain_map.is_some() && format != StillFormat::Jpeg {
        saved.warnings.push(format!("{} has no HDR gain map; it was left out, and JPEG keeps it", format.name()));
    }
    match format {
        StillFormat::Jpeg => {
            let reduced = reduced(&photo.frame, format, false, &mut saved)?;
            let frame = reduced.as_ref().unwrap_or(&photo.frame);
            write_jpeg((frame, photo.gain_map.as_ref()), metadata, options.quality, out, &mut saved)?;
        }
        StillFormat::Tiff => tiff::encode(&photo.frame, &metadata, out)?,
        StillFormat::Png => write_png(&photo.frame, metadata, out)?,
        StillFormat::WebP => {
            let reduced = reduced(&photo.frame, format, true, &mut saved)?;
            let frame = reduced.as_ref().unwrap_or(&photo.frame);
            check_side(frame, format, 16_384)?;
            write_webp(frame, metadata, out)?;
        }
    }
    Ok(saved)
}

impl Metadata {
    /// What a format holds of a photo's metadata, said to be of its frame's size.
    fn of(photo: &Photo, format: StillFormat, saved: &mut Saved) -> Self {
        let size = (photo.frame.width, photo.frame.height);
        let mut exif = photo.exif.clone();
        if exif.as_mut().is_some_and(|block| !exif::describe(block, size.0, size.1)) {
            exif = None;
            saved.warnings.push("EXIF is damaged and was left out".to_owned());
        }
        let packet = photo.xmp.as_ref().and_then(|xmp| xmp.described(size));
        if photo.xmp.is_some() && packet.is_none() {
            saved.warnings.push("XMP is damaged and was left out".to_owned());
        }
        let extended = photo.xmp.as_ref().and_then(|xmp| xmp.extended.clone()).filter(|_| packet.is_some());
        let xmp = packet.map(|packet| Xmp { packet, extended });
        let mut metadata = Self { exif, icc: fitting_profile(photo, saved), xmp, iptc: photo.iptc.clone() };
        metadata.fit(format, &mut saved.warnings);
        metadata
    }

    /// Leaves out what the format has no room for.
    fn fit(&mut self, format: StillFormat, warnings: &mut Vec<String>) {
        let jpeg = format == StillFormat::Jpeg;
        let limits = if jpeg { [jpeg::MAX_EXIF, jpeg::MAX_XMP, jpeg::MAX_IPTC] } else { [usize::MAX; 3] };
        let name = format.name();
        let mut too_long = |what: &str, bytes: usize, limit: usize| {
            let long = bytes > limit;
            warnings.extend(long.then(|| format!("{what} of {bytes} bytes does not fit into {name} and was left out")));
            long
        };
        self.exif.take_if(|block| too_long("EXIF", block.len(), limits[0]));
        self.xmp.take_if(|xmp| too_long("XMP", xmp.packet.len(), limits[1]));
        self.iptc.take_if(|iim| too_long("IPTC", iim.len(), limits[2]));
        let extended = self.xmp.as_mut().filter(|_| !jpeg).and_then(|xmp| xmp.extended.take());
        if extended.is_some() {
            warnings.push(format!("{name} has no extended XMP; it was left out, and JPEG keeps it"));
        }
        if format == StillFormat::WebP && self.iptc.take().is_some() {
            warnings.push("WebP has no IPTC; it was left out, and JPEG, PNG and TIFF keep it".to_owned());
        }
    }
}

/// The profile, where it is one of the samples' color space.
fn fitting_profile(photo: &Photo, saved: &mut Saved) -> Option<Vec<u8>> {
    let icc = photo.icc.as_deref()?;
    let space: &[u8] = if reduce::is_gray(&photo.frame) { b"GRAY" } else { b"RGB " };
    let fits = icc.get(16..20) == Some(space);
    if !fits {
        saved.warnings.push("the color profile is not one of these samples and was left out".to_owned());
    }
    fits.then(|| icc.to_vec())
}

/// The frame as 8 bit, and without alpha if the format has none; `None` where it is that already.
fn reduced(frame: &Frame, format: StillFormat, alpha: bool, saved: &mut Saved) -> Result<Option<Frame>, StillError> {
    let mut out = None;
    if frame.format.alpha && !alpha {
        if !reduce::is_opaque(frame) {
            saved.warnings.push(format!("{} has no transparency: what is transparent became white", format.name()));
        }
        out = Some(reduce::over_white(frame)?);
    }
    let current = out.as_ref().unwrap_or(frame);
    if current.format.bits > 8 {
        saved
            .warnings
            .push(format!("{} holds 8 bits per sample, the picture has 16; PNG and TIFF keep them", format.name()));
        out = Some(reduce::to_8_bit(current)?);
    }
    Ok(out)
}

pub(super) fn check_side(frame: &Frame, format: StillFormat, most: usize) -> Result<(), StillError> {
    let (width, height) = (frame.width, frame.height);
    let side = StillError::Side { width, height, format: format.name(), most };
    if width.max(height) > most { Err(side) } else { Ok(()) }
}

/// Writes a picture, and its gain map behind it.
fn write_jpeg(
    (frame, gain_map): (&Frame, Option<&GainMap>),
    mut metadata: Metadata,
    quality: u8,
    mut out: impl Write,
    saved: &mut Saved,
) -> Result<(), StillError> {
    let Some(map) = gain_map else { return jpeg::encode(frame, quality, &jpeg::Written::of(&metadata), out) };
    let second = map.encoded(quality)?;
    let Some(packet) = GainMap::announced(metadata.xmp.as_ref(), second.len()) else {
        saved.warnings.push("XMP leaves no room to announce the HDR gain map, which was left out".to_owned());
        return jpeg::encode(frame, quality, &jpeg::Written::of(&metadata), out);
    };
    metadata.xmp = Some(Xmp { packet, extended: metadata.xmp.and_then(|xmp| xmp.extended) });
    // Of the binary form the picture has the version alone.
    let iso = map.iso.as_ref().map(|_| &[0; 4][..]);
    let mut first = Vec::new();
    jpeg::encode(frame, quality, &jpeg::Written { iso, ..jpeg::Written::of(&metadata) }, &mut first)?;
    let joined = jpeg::joined(&first, &second).ok_or_else(|| StillError::Encode("a picture of 4 GiB".to_owned()))?;
    out.write_all(&joined).map_err(StillError::Write)
}

fn write_png(frame: &Frame, metadata: Metadata, out: impl Write) -> Result<(), StillError> {
    let refused = |e: image::error::UnsupportedError| StillError::Encode(e.to_string());
    let packet = metadata.xmp.map(|xmp| png::international_text("XML:com.adobe.xmp", &xmp.packet));
    let iptc = metadata.iptc.map(|iim| png::text("Raw profile type iptc", iptc::text(&iim).as_bytes()));
    let out = png::WithChunks::new(out, packet.into_iter().chain(iptc).flatten().collect());
    let mut encoder = PngEncoder::new_with_quality(out, CompressionType::Fast, FilterType::Adaptive);
    if let Some(block) = metadata.exif {
        encoder.set_exif_metadata(block).map_err(refused)?;
    }
    if let Some(profile) = metadata.icc {
        encoder.set_icc_profile(profile).map_err(refused)?;
    }
    let color = match (frame.format.layout, frame.format.bits, frame.format.alpha) {
        (Layout::Gray, 8, false) => ExtendedColorType::L8,
        (Layout::Gray, 8, true) => ExtendedColorType::La8,
        (Layout::Gray, _, false) => ExtendedColorType::L16,
        (Layout::Gray, _, true) => ExtendedColorType::La16,
        (_, 8, false) => ExtendedColorType::Rgb8,
        (_, 8, true) => ExtendedColorType::Rgba8,
        (_, _, false) => ExtendedColorType::Rgb16,
        (_, _, true) => ExtendedColorType::Rgba16,
    };
    let (width, height) = (frame.width as u32, frame.height as u32);
    let written = if frame.format.bits == 8 {
        encoder.write_image(&pack::<u8>(frame)?, width, height, color)
    } else {
        encoder.write_image(bytemuck::cast_slice(&pack::<u16>(frame)?), width, height, color)
    };
    written.map_err(StillError::of_encoder)
}

fn write_webp(frame: &Frame, metadata: Metadata, out: impl Write) -> Result<(), StillError> {
    let mut encoder = WebPEncoder::new(out);
    encoder.set_exif_metadata(metadata.exif.unwrap_or_default());
    encoder.set_icc_profile(metadata.icc.unwrap_or_default());
    encoder.set_xmp_metadata(metadata.xmp.map(|xmp| xmp.packet).unwrap_or_default());
    let color = match (frame.format.layout, frame.format.alpha) {
        (Layout::Gray, false) => ColorType::L8,
        (Layout::Gray, true) => ColorType::La8,
        (_, false) => ColorType::Rgb8,
        (_, true) => ColorType::Rgba8,
    };
    let written = encoder.encode(&pack::<u8>(frame)?, frame.width as u32, frame.height as u32, color);
    written.map_err(|e| match e {
        EncodingError::IoError(e) => StillError::Write(e),
        other => StillError::Encode(other.to_string()),
    })
}
