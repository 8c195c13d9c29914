//! HEIC and AVIF through FFmpeg: one picture of a clip, as color planes.

use std::io::{BufReader, Read};
use std::path::Path;

use crate::pipeline::run_error::RunError;
use plumbline_image::rgb_frame;
use plumbline_image::still::{ExifOrientation, ExifTags, LoadOptions, Photo, exif_of_container, oriented};
use plumbline_media::{Input, ReadOptions, VideoReader};
use plumbline_num::files::open_regular;

/// Most bytes of a file's head that are searched for its items.
const HEAD: u64 = 1 << 20;

/// Reads the picture of a HEIF file.
pub(crate) fn load(path: &Path, options: LoadOptions, threads: usize) -> Result<Photo, RunError> {
    let bad = |what: &str| RunError::Input(format!("{}: {what}", path.display()));
    if is_tiled(path) {
        let help = "convert it first, for example with `heif-dec in.heic out.png`";
        return Err(bad(&format!("a HEIC picture in tiles, which are not joined here; {help}")));
    }
    // The size is checked before a pixel is decoded.
    let input = Input::parse(path)?;
    let read = ReadOptions { threads, ..ReadOptions::default() };
    let mut reader = VideoReader::open(&input, &read)?;
    let info = reader.info();
    let (width, height) = (info.width as u64, info.height as u64);
    if width * height > options.max_pixels {
        let limit = options.max_pixels;
        return Err(bad(&format!(
            "{width}×{height} px are more than the limit of {limit} px; raise it with --max-pixels"
        )));
    }
    // The picture, upright.
    let quarters = (info.rotation_deg / 90.0).round().rem_euclid(4.0) as u32;
    let turn = ExifOrientation::of_display(quarters, info.mirrored);
    let frame = reader.next_frame()?.ok_or_else(|| bad("no picture in it"))?;
    let frame = rgb_frame(&frame).and_then(|f| oriented(&f, turn));
    let frame = frame.ok_or_else(|| bad("its pixels are of a kind that is not read here"))?;
    // Its metadata, and what is lost.
    let file = open_regular(path).ok();
    let read = file.and_then(|f| exif_of_container(BufReader::new(f), frame.width, frame.height));
    let (exif, tags) = read.map_or((None, ExifTags::default()), |(exif, tags)| (Some(exif), tags));
    let mut warnings = Vec::new();
    if reader.next_frame()?.is_some() {
        warnings.push("more than one picture in it; the first was taken".to_owned());
    }
    warnings.push("color profile, XMP and gain map inside HEIF are not read; colors are taken as sRGB".to_owned());
    Ok(Photo { exif, tags, warnings, ..Photo::new(frame) })
}

/// True where the items of the file are tiles of a larger picture.
fn is_tiled(path: &Path) -> bool {
    let mut head = Vec::new();
    let read = open_regular(path).and_then(|f| f.take(HEAD).read_to_end(&mut head));
    // An item's entry: the box's type, version and flags, then number (longer from version 3 on), protection and type.
    let is_grid = |w: &[u8]| match w {
        [b'i', b'n', b'f', b'e', 2, rest @ ..] => rest[7..].starts_with(b"grid"),
        [b'i', b'n', b'f', b'e', 3, rest @ ..] => rest[9..].starts_with(b"grid"),
        _ => false,
    };
    read.is_ok() && head.windows(18).any(is_grid)
}
