//! JPEG files of four inks: CMYK, and YCCK, its form with luma and chroma.
//!
//! A file with the segment of Adobe stores 255 − ink; YCCK stores YCbCr of that, so that its red, green and blue are the inks C, M
//! and Y. Inks become sRGB by the file's profile, perceptually; without one that can be used, as if each ink took its
//! light away whole:
//!
//! ```text
//! R = (1 − C)(1 − K),   G = (1 − M)(1 − K),   B = (1 − Y)(1 − K).
//! ```
//!
//! # Reference
//! Adobe, technical note 5116; ITU-T T.872, 6.5.3; ICC.1:2022 (profiles).

use moxcms::{ColorProfile, DataColorSpace, Layout, RenderingIntent, Transform8BitExecutor, TransformOptions};
use rayon::prelude::*;
use std::sync::Arc;
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

use super::super::StillError;
use super::segments::contents;

/// Pixels per parallel task.
const TASK: usize = 1 << 14;

/// The file as red, green and blue of sRGB, packed into `out`.
pub(in super::super) fn read_rgb(
    bytes: &[u8],
    profile: Option<&[u8]>,
    out: &mut [u8],
    warnings: &mut Vec<String>,
) -> Result<(), StillError> {
    let mut inks = vec![0; out.len() / 3 * 4];
    read_inks(bytes, &mut inks)?;
    let transform = profile.and_then(transform);
    if transform.is_none() {
        let what = if profile.is_some() { "its color profile is not one of CMYK" } else { "it has no color profile" };
        warnings.push(format!("CMYK was converted to RGB without color management: {what}"));
    }
    let failed = |e: moxcms::CmsError| StillError::Damaged(format!("its color profile: {e}"));
    out.par_chunks_mut(3 * TASK).zip(inks.par_chunks(4 * TASK)).try_for_each(|(rgb, inks)| {
        if let Some(transform) = &transform {
            return transform.transform(inks, rgb).map_err(failed);
        }
        rgb.chunks_exact_mut(3).zip(inks.chunks_exact(4)).for_each(|(rgb, inks)| plain(inks, rgb));
        Ok(())
    })
}

/// Inks from 0, none, to 255, packed.
fn read_inks(bytes: &[u8], inks: &mut [u8]) -> Result<(), StillError> {
    let damaged = |e: zune_jpeg::errors::DecodeErrors| StillError::Damaged(format!("{e:?}"));
    let options = DecoderOptions::default().set_strict_mode(false).set_max_width(65_535).set_max_height(65_535);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(damaged)?;
    let space = decoder.input_colorspace().filter(|s| matches!(s, ColorSpace::CMYK | ColorSpace::YCCK));
    let space = space.ok_or_else(|| StillError::Damaged("four components that are no inks".to_owned()))?;
    decoder.set_options(decoder.options().jpeg_set_out_colorspace(space));
    if decoder.output_buffer_size() != Some(inks.len()) {
        return Err(StillError::Damaged("two sizes in one file".to_owned()));
    }
    decoder.decode_into(inks).map_err(damaged)?;
    let inverted = contents(bytes, 0xee, b"Adobe").next().is_some();
    match space {
        ColorSpace::YCCK => inks.par_chunks_exact_mut(4).for_each(inks_of_ycck),
        _ if inverted => inks.par_iter_mut().for_each(|v| *v = 255 - *v),
        _ => {}
    }
    Ok(())
}

/// Inks of luma, chroma and inverted black.
fn inks_of_ycck(pixel: &mut [u8]) {
    let [y, cb, cr, k] = pixel else { return };
    let (luma, blue, red) = (f32::from(*y), f32::from(*cb) - 128.0, f32::from(*cr) - 128.0);
    // Of JFIF; conversion saturates.
    let round = |v: f32| v.round() as u8;
    (*y, *cb, *cr) =
        (round(luma + 1.402 * red), round(luma - 0.344_136 * blue - 0.714_136 * red), round(luma + 1.772 * blue));
    *k = 255 - *k;
}

/// From inks to sRGB by a profile; `None` where it is not one of inks, or damaged.
fn transform(profile: &[u8]) -> Option<Arc<Transform8BitExecutor>> {
    let profile = ColorProfile::new_from_slice(profile).ok().filter(|p| p.color_space == DataColorSpace::Cmyk)?;
    let options = TransformOptions { rendering_intent: RenderingIntent::Perceptual, ..TransformOptions::default() };
    profile.create_transform_8bit(Layout::Rgba, &ColorProfile::new_srgb(), Layout::Rgb, options).ok()
}

fn plain(inks: &[u8], rgb: &mut [u8]) {
    let [c, m, y, k] = *inks else { return };
    let shown = |ink: u8| ((255 - u32::from(ink)) * (255 - u32::from(k)) + 127) / 255;
    rgb.iter_mut().zip([c, m, y]).for_each(|(to, ink)| *to = shown(ink) as u8);
}

#[cfg(test)]
pub(in super::super) mod tests {
    use super::super::super::{LoadOptions, Photo, decode};
    use jpeg_encoder::{ColorType, Encoder};
    use std::io::Cursor;

    /// A profile of the output class for inks with two points along each: black is black, and the other corners have Lab values
    /// that no conversion without a profile has.
    pub(in super::super::super) fn profile() -> Vec<u8> {
        let corner = |i: u8| {
            let [c, m, y, k] = [3, 2, 1, 0].map(|bit| i32::from(i >> bit & 1));
            let lab = [255 - 100 * c - 110 * m - 20 * y, 128 - 20 * c + 60 * m, 128 - 50 * c + 60 * y];
            if k == 1 { [0, 128, 128] } else { lab.map(|v| v.max(0) as u8) }
        };
        let identity = (0..9).flat_map(|i| u32::to_be_bytes(if i % 4 == 0 { 65_536 } else { 0 }));
        let mut lut = b"mft1\0\0\0\0\x04\x03\x02\0".to_vec();
        lut.extend(identity);
        lut.extend((0..4).flat_map(|_| 0..=255_u8));
        lut.extend((0..16).flat_map(corner));
        lut.extend((0..3).flat_map(|_| 0..=255_u8));
        let white: Vec<u8> = [63_190_u32, 65_536, 54_061].iter().flat_map(|v| v.to_be_bytes()).collect();
        let description = [&b"desc\0\0\0\0\0\0\0\x05test\0"[..], &[0; 78]].concat();
        let tags = [
            (*b"desc", description),
            (*b"wtpt", [b"XYZ \0\0\0\0", &white[..]].concat()),
            (*b"cprt", b"text\0\0\0\0free\0".to_vec()),
            (*b"A2B0", lut),
        ];
        let (mut table, mut body) = ((tags.len() as u32).to_be_bytes().to_vec(), Vec::new());
        for (name, mut content) in tags {
            content.resize(content.len().next_multiple_of(4), 0);
            let at = 128 + 4 + 12 * 4 + body.len() as u32;
            table.extend([&name[..], &at.to_be_bytes(), &(content.len() as u32).to_be_bytes()].concat());
            body.extend(content);
        }
        let mut head = (128 + (table.len() + body.len()) as u32).to_be_bytes().to_vec();
        head.extend(b"\0\0\0\0\x02\x40\0\0prtrCMYKLab ");
        head.resize(36, 0);
        head.extend(b"acsp");
        head.resize(68, 0);
        head.extend(white);
        head.resize(128, 0);
        [head, table, body].concat()
    }

    /// A file of one color of ink, 0 to 255.
    pub(in super::super::super) fn file(inks: [u8; 4], kind: ColorType, profile: Option<&[u8]>) -> Vec<u8> {
        let mut out = Vec::new();
        let mut encoder = Encoder::new(&mut out, 100);
        if let Some(profile) = profile {
            encoder.add_icc_profile(profile).expect("a small profile");
        }
        encoder.encode(&inks.repeat(17 * 9), 17, 9, kind).expect("memory");
        out
    }

    fn color(bytes: &[u8]) -> ([u8; 3], Photo) {
        let photo = decode(Cursor::new(bytes), LoadOptions::default()).expect("sound");
        assert_eq!((photo.size(), &photo.icc), ((17, 9), &None));
        let at = |plane| photo.frame.plane8(plane).expect("8 bit").row(8)[16];
        ([at(2), at(0), at(1)], photo)
    }

    fn assert_near(found: [u8; 3], expected: [u8; 3], what: &str) {
        let off = found.iter().zip(expected).map(|(a, b)| a.abs_diff(b)).max();
        assert!(off <= Some(4), "{what}: {found:?} for {expected:?}");
    }

    /// Colors by LittleCMS 2.
    const BY_PROFILE: [([u8; 4], [u8; 3]); 6] = [
        ([0, 0, 0, 0], [255, 255, 255]),
        ([255, 0, 0, 0], [0, 160, 235]),
        ([0, 255, 0, 0], [226, 83, 139]),
        ([0, 0, 255, 0], [255, 230, 113]),
        ([0, 0, 0, 255], [0, 0, 0]),
        ([128, 0, 0, 0], [155, 206, 246]),
    ];

    #[test]
    fn inks_become_srgb_by_their_profile() {
        for (inks, expected) in BY_PROFILE {
            for kind in [ColorType::Cmyk, ColorType::CmykAsYcck] {
                let (found, photo) = color(&file(inks, kind, Some(&profile())));
                assert_near(found, expected, &format!("{inks:?} as {kind:?}"));
                assert_eq!(photo.warnings, [""; 0]);
            }
        }
    }

    #[test]
    fn inks_without_a_profile_take_their_light_away_and_that_is_said() {
        for (inks, expected) in [([255, 0, 0, 0], [0, 255, 255]), ([0, 64, 128, 128], [127, 95, 63])] {
            for (kind, profile) in [(ColorType::Cmyk, None), (ColorType::CmykAsYcck, Some(&b"no profile"[..]))] {
                let (found, photo) = color(&file(inks, kind, profile));
                assert_near(found, expected, &format!("{inks:?} as {kind:?}"));
                assert!(photo.warnings[0].contains("without color management"), "{:?}", photo.warnings);
            }
        }
        // Without the segment of Adobe the numbers are inks as they are.
        let mut plain = file([0, 255, 255, 255], ColorType::Cmyk, None);
        let adobe = plain.windows(5).position(|w| w == b"Adobe").expect("written");
        plain[adobe] = b'a';
        assert_near(color(&plain).0, [0, 255, 255], "not inverted");
    }

    #[test]
    fn mutated_inks_and_profiles_never_panic() {
        let mut rng = fastrand::Rng::with_seed(5);
        for kind in [ColorType::Cmyk, ColorType::CmykAsYcck] {
            let whole = file([9, 80, 200, 30], kind, Some(&profile()));
            for _ in 0..150 {
                let mut wild = whole.clone();
                for _ in 0..rng.usize(1..8) {
                    let most = if rng.bool() { wild.len() } else { 700 };
                    wild[rng.usize(..most)] = rng.u8(..);
                }
                let _ = decode(Cursor::new(&wild), LoadOptions { max_pixels: 1 << 16 });
            }
        }
    }
}
