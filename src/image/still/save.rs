//! Writing: samples and metadata as far as the format holds them, and a word where it does not.

use std::io::{Seek, Write};

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::codecs::webp::WebPEncoder;
use image::{ExtendedColorType, ImageEncoder};

use super::packed::{is_still, pack};
use super::{Photo, StillError, StillFormat, exif, jpeg, reduce, tiff};
use crate::{Frame, Layout};

/// Maximum size of EXIF in JPEG, bytes: one segment.
const MAX_EXIF_IN_JPEG: usize = 65_527;

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
    let exif = upright(photo, &mut saved);
    let icc = fitting_profile(photo, &mut saved);
    match format {
        StillFormat::Jpeg => {
            let reduced = reduced(&photo.frame, format, false, &mut saved)?;
            let too_long = |block: &&Vec<u8>| {
                let long = block.len() > MAX_EXIF_IN_JPEG;
                if long {
                    saved
                        .warnings
                        .push(format!("EXIF of {} bytes does not fit into JPEG and was left out", block.len()));
                }
                !long
            };
            let exif = exif.as_ref().filter(too_long);
            let metadata = jpeg::Metadata { exif: exif.map(Vec::as_slice), icc };
            jpeg::encode(reduced.as_ref().unwrap_or(&photo.frame), options.quality, metadata, out)?;
        }
        StillFormat::Tiff => tiff::encode(&photo.frame, exif.as_deref(), icc, out)?,
        StillFormat::Png => {
            let encoder = PngEncoder::new_with_quality(out, CompressionType::Fast, FilterType::Adaptive);
            with_metadata(encoder, &photo.frame, exif, icc)?;
        }
        StillFormat::WebP => {
            let reduced = reduced(&photo.frame, format, true, &mut saved)?;
            let frame = reduced.as_ref().unwrap_or(&photo.frame);
            check_side(frame, format, 16_384)?;
            with_metadata(WebPEncoder::new_lossless(out), frame, exif, icc)?;
        }
    }
    Ok(saved)
}

/// EXIF with the size of the written picture.
fn upright(photo: &Photo, saved: &mut Saved) -> Option<Vec<u8>> {
    let mut block = photo.exif.clone()?;
    let good = exif::describe(&mut block, photo.frame.width, photo.frame.height);
    if !good {
        saved.warnings.push("EXIF is damaged and was left out".to_owned());
    }
    good.then_some(block)
}

/// The profile, where it is one of the samples' color space.
fn fitting_profile<'p>(photo: &'p Photo, saved: &mut Saved) -> Option<&'p [u8]> {
    let icc = photo.icc.as_deref()?;
    let space: &[u8] = if reduce::is_gray(&photo.frame) { b"GRAY" } else { b"RGB " };
    let fits = icc.get(16..20) == Some(space);
    if !fits {
        saved.warnings.push("the color profile is not one of these samples and was left out".to_owned());
    }
    fits.then_some(icc)
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

fn with_metadata(
    mut encoder: impl ImageEncoder,
    frame: &Frame,
    exif: Option<Vec<u8>>,
    icc: Option<&[u8]>,
) -> Result<(), StillError> {
    let refused = |e: image::error::UnsupportedError| StillError::Encode(e.to_string());
    if let Some(block) = exif {
        encoder.set_exif_metadata(block).map_err(refused)?;
    }
    if let Some(profile) = icc {
        encoder.set_icc_profile(profile.to_vec()).map_err(refused)?;
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
