//! Writing: samples and metadata as far as the format holds them, and a word where it does not.

use std::io::{Seek, Write};

use image_webp::{ColorType, EncodingError, WebPEncoder};

use super::bands::{Bands, Pixels, Reduction, RowSource};
use super::packed::planes_of;
use super::{GainMap, Photo, StillError, StillFormat, Xmp, exif, jpeg, png, reduce, tiff};
use crate::{Layout, PixelFormat};

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
    write(photo, Pixels::Frame(&photo.frame), format, options, out)
}

/// Writes the pixels of `source`, with what `head` has beside its own ([`Photo::without_pixels`]). Rows are made as they are
/// written, so that the picture is never in memory as a whole; as packed samples it is for WebP, whose encoder takes it at once.
pub(crate) fn encode_rows(
    head: &Photo,
    source: &dyn RowSource,
    format: StillFormat,
    options: SaveOptions,
    out: impl Write + Seek,
) -> Result<Saved, StillError> {
    write(head, Pixels::Rows(source), format, options, out)
}

/// Writes pixels, and what a photo says beside its own.
fn write(
    photo: &Photo,
    pixels: Pixels<'_>,
    format: StillFormat,
    options: SaveOptions,
    out: impl Write + Seek,
) -> Result<Saved, StillError> {
    if !pixels.is_still() {
        return Err(StillError::Layout);
    }
    let mut saved = Saved::default();
    let metadata = Metadata::of(photo, pixels.size(), format, &mut saved);
    if photo.gain_map.is_some() && format != StillFormat::Jpeg {
        saved.warnings.push(format!("{} has no HDR gain map; it was left out, and JPEG keeps it", format.name()));
    }
    let reduction = reduction(pixels.format(), format);
    if reduction.eight {
        saved
            .warnings
            .push(format!("{} holds 8 bits per sample, the picture has 16; PNG and TIFF keep them", format.name()));
    }
    let bands = Bands::reduced(pixels, reduction);
    match format {
        StillFormat::Jpeg => {
            write_jpeg((&bands, photo.gain_map.as_ref()), metadata, options.quality, out, &mut saved)?;
        }
        StillFormat::Tiff => tiff::encode(&bands, &metadata, out)?,
        StillFormat::Png => png::encode(&bands, metadata, out)?,
        StillFormat::WebP => {
            check_side(bands.size(), format, 16_384)?;
            write_webp(&bands, metadata, out)?;
        }
    }
    if bands.was_transparent() {
        saved.warnings.push(format!("{} has no transparency: what is transparent became white", format.name()));
    }
    Ok(saved)
}

/// What a format cannot hold of pixels.
fn reduction(pixels: PixelFormat, format: StillFormat) -> Reduction {
    let (flat, eight) = match format {
        StillFormat::Jpeg => (true, true),
        StillFormat::WebP => (false, true),
        StillFormat::Png | StillFormat::Tiff => (false, false),
    };
    Reduction { flat: flat && pixels.alpha, eight: eight && pixels.bits > 8 }
}

impl Metadata {
    /// What a format holds of a photo's metadata, said to be of pixels of this size.
    fn of(photo: &Photo, size: (usize, usize), format: StillFormat, saved: &mut Saved) -> Self {
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

pub(super) fn check_side((width, height): (usize, usize), format: StillFormat, most: usize) -> Result<(), StillError> {
    let side = StillError::Side { width, height, format: format.name(), most };
    if width.max(height) > most { Err(side) } else { Ok(()) }
}

/// Writes a picture, and its gain map behind it.
fn write_jpeg(
    (bands, gain_map): (&Bands<'_>, Option<&GainMap>),
    mut metadata: Metadata,
    quality: u8,
    mut out: impl Write,
    saved: &mut Saved,
) -> Result<(), StillError> {
    let Some(map) = gain_map else { return jpeg::encode(bands, quality, &jpeg::Written::of(&metadata), out) };
    let second = map.encoded(quality)?;
    let Some(packet) = GainMap::announced(metadata.xmp.as_ref(), second.len()) else {
        saved.warnings.push("XMP leaves no room to announce the HDR gain map, which was left out".to_owned());
        return jpeg::encode(bands, quality, &jpeg::Written::of(&metadata), out);
    };
    metadata.xmp = Some(Xmp { packet, extended: metadata.xmp.and_then(|xmp| xmp.extended) });
    // Of the binary form the picture has the version alone.
    let iso = map.iso.as_ref().map(|_| &[0; 4][..]);
    let mut first = Vec::new();
    jpeg::encode(bands, quality, &jpeg::Written { iso, ..jpeg::Written::of(&metadata) }, &mut first)?;
    let joined = jpeg::joined(&first, &second).ok_or_else(|| StillError::Encode("a picture of 4 GiB".to_owned()))?;
    out.write_all(&joined).map_err(StillError::Write)
}

fn write_webp(bands: &Bands<'_>, metadata: Metadata, out: impl Write) -> Result<(), StillError> {
    let mut encoder = WebPEncoder::new(out);
    encoder.set_exif_metadata(metadata.exif.unwrap_or_default());
    encoder.set_icc_profile(metadata.icc.unwrap_or_default());
    encoder.set_xmp_metadata(metadata.xmp.map(|xmp| xmp.packet).unwrap_or_default());
    let pixels = bands.format();
    let color = match (pixels.layout, pixels.alpha) {
        (Layout::Gray, false) => ColorType::L8,
        (Layout::Gray, true) => ColorType::La8,
        (_, false) => ColorType::Rgb8,
        (_, true) => ColorType::Rgba8,
    };
    let (width, height) = (bands.size().0 as u32, bands.size().1 as u32);
    let written = encoder.encode(&bands.packed::<u8>(planes_of(pixels))?, width, height, color);
    written.map_err(|e| match e {
        EncodingError::IoError(e) => StillError::Write(e),
        other => StillError::Encode(other.to_string()),
    })
}
