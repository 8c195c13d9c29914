//! Round trips through every format, and files that lie.

use std::io::Cursor;

use super::exif::{Order, orientation, tests::sample as exif_block};
use super::packed::{Sample, planes_of, unpack};
use super::*;
use crate::{Layout, PixelFormat};

mod gain_map;
mod metadata;

const FORMATS: [StillFormat; 4] = [StillFormat::Jpeg, StillFormat::Png, StillFormat::Tiff, StillFormat::WebP];

/// A smooth picture with an edge in it, so that lossy formats come near.
fn photo(layout: Layout, bits: u8, alpha: bool, (w, h): (usize, usize)) -> Photo {
    let format = PixelFormat { layout, bits, alpha };
    let channels = planes_of(format).len();
    let value = |i: usize| {
        let (x, y, c) = (i / channels % w, i / channels / w, i % channels);
        let smooth = (x * 150 / w + y * 60 / h + 15 * c) as u16;
        let v = if alpha && c + 1 == channels { 255 - (y * 200 / h) as u16 } else { smooth };
        if bits == 16 { v * 256 + (x % 200) as u16 } else { v }
    };
    let values: Vec<u16> = (0..w * h * channels).map(value).collect();
    let frame = if bits == 16 {
        unpack(&values, (w, h), format, ExifOrientation::default())
    } else {
        unpack(&values.iter().map(|v| *v as u8).collect::<Vec<u8>>(), (w, h), format, ExifOrientation::default())
    };
    Photo::new(frame.expect("as many as it takes"))
}

/// A profile as far as anybody looks here: its length and color space.
fn profile(space: [u8; 4], length: usize) -> Vec<u8> {
    let mut p = vec![7; length];
    p[..4].copy_from_slice(&(length as u32).to_be_bytes());
    p[16..20].copy_from_slice(&space);
    p[36..40].copy_from_slice(b"acsp");
    p
}

fn written(photo: &Photo, format: StillFormat) -> (Vec<u8>, Saved) {
    let mut out = Cursor::new(Vec::new());
    let saved = encode(photo, format, SaveOptions::default(), &mut out).expect("it can be written");
    (out.into_inner(), saved)
}

fn read(bytes: &[u8]) -> Result<Photo, StillError> {
    decode(Cursor::new(bytes), LoadOptions::default())
}

fn plane<S: Sample>(photo: &Photo, i: usize) -> Vec<S> {
    let plane = S::plane(&photo.frame, i).expect("this depth");
    (0..photo.frame.height).flat_map(|j| plane.row(j).to_vec()).collect()
}

#[test]
fn lossless_formats_give_back_every_sample_at_its_depth() {
    for (layout, bits, alpha) in [Layout::Gray, Layout::Gbr]
        .into_iter()
        .flat_map(|l| [(l, 8, false), (l, 8, true), (l, 16, false), (l, 16, true)])
    {
        for format in [StillFormat::Png, StillFormat::Tiff] {
            let before = photo(layout, bits, alpha, (61, 300));
            let (bytes, saved) = written(&before, format);
            let after = read(&bytes).expect("sound");
            assert_eq!(saved.warnings, [""; 0]);
            assert_eq!(after.format, Some(format));
            if format == StillFormat::Tiff && layout == Layout::Gray && alpha {
                // Gray with alpha is written as color: hardly anything reads it otherwise.
                assert_eq!(after.frame.format, PixelFormat { layout: Layout::Gbr, bits, alpha });
                continue;
            }
            assert_eq!(after.frame.format, before.frame.format);
            for i in 0..before.frame.format.planes() {
                if bits == 8 {
                    assert_eq!(plane::<u8>(&before, i), plane::<u8>(&after, i), "{format:?} {layout:?} plane {i}");
                } else {
                    assert_eq!(plane::<u16>(&before, i), plane::<u16>(&after, i), "{format:?} {layout:?} plane {i}");
                }
            }
        }
    }
}

#[test]
fn webp_keeps_8_bits_and_alpha_and_reports_losses() {
    let before = photo(Layout::Gbr, 8, true, (61, 40));
    let (bytes, saved) = written(&before, StillFormat::WebP);
    let after = read(&bytes).expect("sound");
    assert!(saved.warnings.is_empty() && after.frame.format == before.frame.format);
    assert!((0..4).all(|i| plane::<u8>(&before, i) == plane::<u8>(&after, i)));
    let (bytes, saved) = written(&photo(Layout::Gbr, 16, false, (61, 40)), StillFormat::WebP);
    assert!(saved.warnings[0].contains("8 bits per sample"), "{saved:?}");
    assert_eq!(read(&bytes).expect("sound").frame.format.bits, 8);
}

#[test]
fn jpeg_in_bands_is_one_picture_near_the_original_at_any_size_and_quality() {
    for (w, h) in [(1, 1), (8, 8), (17, 33), (640, 7), (333, 1000), (4100, 130)] {
        for (layout, quality) in [(Layout::Gbr, 92), (Layout::Gbr, 80), (Layout::Gray, 92)] {
            let before = photo(layout, 8, false, (w, h));
            let mut out = Cursor::new(Vec::new());
            encode(&before, StillFormat::Jpeg, SaveOptions { quality }, &mut out).expect("it can be written");
            let after = read(out.get_ref()).expect("sound");
            assert_eq!((after.frame.width, after.frame.height, after.frame.format), (w, h, before.frame.format));
            for i in 0..before.frame.format.planes() {
                let (a, b) = (plane::<u8>(&before, i), plane::<u8>(&after, i));
                let sum: u64 = a.iter().zip(&b).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
                assert!(
                    sum <= 3 * a.len() as u64,
                    "{w}×{h} {layout:?} {quality} plane {i}: mean {}",
                    sum / a.len() as u64
                );
                let most = a.iter().zip(&b).map(|(a, b)| a.abs_diff(*b)).max().expect("not empty");
                assert!(most <= 24, "{w}×{h} {layout:?} {quality} plane {i}: {most}");
            }
        }
    }
}

#[test]
fn exif_and_profile_travel_through_every_format_and_say_the_new_size() {
    for (format, order) in FORMATS.into_iter().flat_map(|f| [(f, Order::Little), (f, Order::Big)]) {
        let mut before = photo(Layout::Gbr, 8, false, (50, 40));
        before.exif = Some(exif_block(order));
        before.icc = Some(profile(*b"RGB ", 70_000));
        let (bytes, saved) = written(&before, format);
        assert!(saved.warnings.is_empty(), "{format:?}: {:?}", saved.warnings);
        let after = read(&bytes).expect("sound");
        assert_eq!((after.frame.width, after.frame.height), (50, 40), "{format:?}: orientation 6 was done before");
        assert!(after.icc == before.icc, "{format:?}");
        let block = after.exif.as_deref().expect("kept");
        assert_eq!(orientation(block), Some(1), "{format:?}");
        assert!(block.windows(8).any(|w| w == b"MAKERXYZ"), "{format:?}: the maker's note is kept");
        let tags = &after.tags;
        assert_eq!((tags.make.as_deref(), tags.focal_mm, tags.size_px), (Some("Cam"), Some(2.8), Some((50, 40))));
    }
}

#[test]
fn a_tiff_file_holds_the_block_at_its_old_offsets() {
    let mut before = photo(Layout::Gray, 16, false, (50, 40));
    before.exif = Some(exif_block(Order::Big));
    let (bytes, _) = written(&before, StillFormat::Tiff);
    assert_eq!(&bytes[112..120], b"MAKERXYZ", "offsets inside the note stay true");
    assert_eq!(plane::<u16>(&read(&bytes).expect("sound"), 0), plane::<u16>(&before, 0), "big-endian samples");
}

#[test]
fn a_profile_of_another_color_space_is_left_out_with_a_word() {
    let mut gray = photo(Layout::Gray, 8, false, (5, 4));
    gray.icc = Some(profile(*b"RGB ", 200));
    let (bytes, saved) = written(&gray, StillFormat::Png);
    assert!(saved.warnings[0].contains("profile"), "{saved:?}");
    assert_eq!(read(&bytes).expect("sound").icc, None);
}

#[test]
fn jpeg_says_what_it_drops() {
    let (bytes, saved) = written(&photo(Layout::Gbr, 16, true, (30, 40)), StillFormat::Jpeg);
    assert!(saved.warnings.iter().any(|w| w.contains("became white")), "{saved:?}");
    assert!(saved.warnings.iter().any(|w| w.contains("8 bits")), "{saved:?}");
    assert_eq!(read(&bytes).expect("sound").frame.format, PixelFormat::opaque(Layout::Gbr, 8));
    let mut long = photo(Layout::Gbr, 8, false, (30, 40));
    long.exif = Some([exif_block(Order::Little), vec![0; 70_000]].concat());
    let (bytes, saved) = written(&long, StillFormat::Jpeg);
    assert!(saved.warnings[0].contains("does not fit into JPEG"), "{saved:?}");
    assert_eq!(read(&bytes).expect("sound").exif, None);
}

/// A JPEG or PNG with an orientation in it, as a camera writes it.
fn oriented(value: u8, format: StillFormat) -> Vec<u8> {
    let mut stored = photo(Layout::Gbr, 8, false, (48, 32));
    stored.exif = Some(exif_block(Order::Little));
    let (mut bytes, _) = written(&stored, format);
    // TIFF has a directory of its own behind that of the block, and the last one counts.
    let at = bytes.windows(8).rposition(|w| w == [0x12, 1, 3, 0, 1, 0, 0, 0]).expect("the orientation's entry") + 8;
    bytes[at] = value;
    bytes
}

#[test]
fn all_eight_orientations_are_applied_once_and_then_say_one() {
    for (value, format) in
        (1..=8).flat_map(|v| [(v, StillFormat::Jpeg), (v, StillFormat::Tiff), (v, StillFormat::WebP)])
    {
        let plain = read(&oriented(1, format)).expect("sound");
        let upright = read(&oriented(value, format)).expect("sound");
        let exif = ExifOrientation::of_tag(u32::from(value));
        assert_eq!((upright.frame.width, upright.frame.height), exif.size(48, 32), "{value} {format:?}");
        let (a, b) = (plain.frame.plane8(0).expect("8 bit"), upright.frame.plane8(0).expect("8 bit"));
        for (i, j) in [(0, 0), (5, 9), (31, 31)] {
            let (x, y) = exif.stored((i, j), 48, 32);
            assert_eq!(a.row(y)[x], b.row(j)[i], "{value} {format:?}");
        }
        assert_eq!(upright.exif.as_deref().and_then(orientation), Some(1));
        let again = read(&written(&upright, StillFormat::Png).0).expect("sound");
        assert_eq!((again.frame.width, again.frame.height), (upright.frame.width, upright.frame.height));
    }
}

#[test]
fn sizes_are_refused_before_memory_is_taken() {
    let limit = LoadOptions { max_pixels: 1000 };
    for format in FORMATS {
        let (bytes, _) = written(&photo(Layout::Gbr, 8, false, (40, 26)), format);
        let error = decode(Cursor::new(&bytes), limit).expect_err("1040 px");
        assert!(matches!(error, StillError::TooLarge { width: 40, height: 26, limit: 1000 }), "{format:?}: {error}");
        assert!(error.to_string().contains("--max-pixels"));
    }
    // Headers that claim far more than the file holds.
    let (mut jpeg, _) = written(&photo(Layout::Gbr, 8, false, (40, 26)), StillFormat::Jpeg);
    let sof = jpeg.windows(2).position(|w| w == [0xff, 0xc0]).expect("a frame header");
    jpeg[sof + 5..sof + 9].fill(0xff);
    assert!(matches!(read(&jpeg), Err(StillError::TooLarge { width: 65_535, height: 65_535, .. })));
    let (mut png, _) = written(&photo(Layout::Gbr, 8, false, (40, 26)), StillFormat::Png);
    png[16..24].copy_from_slice(&[0x7f, 0, 0, 0, 0x7f, 0, 0, 0]);
    assert!(read(&png).is_err());
}

#[test]
fn files_cut_off_anywhere_are_refused() {
    for format in FORMATS {
        let mut whole = photo(Layout::Gbr, 8, false, (90, 70));
        whole.exif = Some(exif_block(Order::Little));
        let (bytes, _) = written(&whole, format);
        for part in 1..20 {
            let cut = &bytes[..bytes.len() * part / 20];
            let error = read(cut).map(|p| (p.frame.width, p.frame.height)).err();
            let error = error.unwrap_or_else(|| panic!("{format:?} is taken with {part} of 20 parts"));
            assert!(!error.is_about_output(), "{format:?} {part}: {error}");
        }
    }
}

#[test]
fn a_png_of_noise_is_hardly_larger_than_its_samples() {
    for bits in [8, 16] {
        let mut random = fastrand::Rng::with_seed(7);
        let samples: Vec<u16> = (0..300 * 200 * 3).map(|_| random.u16(..)).collect();
        let format = PixelFormat::opaque(Layout::Gbr, bits);
        let frame = if bits == 16 {
            unpack(&samples, (300, 200), format, ExifOrientation::default())
        } else {
            let bytes: Vec<u8> = samples.iter().map(|v| *v as u8).collect();
            unpack(&bytes, (300, 200), format, ExifOrientation::default())
        };
        let (bytes, _) = written(&Photo::new(frame.expect("as many as it takes")), StillFormat::Png);
        let most = samples.len() * usize::from(bits / 8) * 101 / 100;
        assert!(bytes.len() < most, "{} bytes for {most}", bytes.len());
    }
}

#[test]
fn kinds_that_are_not_read_are_named_with_what_to_do() {
    let message = |bytes: &[u8]| read(bytes).expect_err("refused").to_string();
    assert!(message(b"GIF89a\x01\0\x01\0\0\0\0").contains("GIF"));
    assert!(message(b"\0\0\0\x1cftypavif\0\0\0\0avifmif1").contains("FFmpeg"));
    assert!(message(b"FUJIFILMCCD-RAW 0201").contains("develop it"));
    assert!(message(b"").contains("empty"));
    let (mut jpeg, _) = written(&photo(Layout::Gbr, 8, false, (40, 26)), StillFormat::Jpeg);
    let sof = jpeg.windows(2).position(|w| w == [0xff, 0xc0]).expect("a frame header");
    jpeg[sof + 4] = 12;
    assert!(message(&jpeg).contains("12 bits"), "{}", message(&jpeg));
    // A DNG is a TIFF file with a version of its own.
    let (mut tiff, _) = written(&photo(Layout::Gray, 8, false, (40, 26)), StillFormat::Tiff);
    let first = u32::from_le_bytes(tiff[4..8].try_into().expect("four")) as usize;
    let last = first + 2 + 12 * (usize::from(tiff[first]) - 1);
    tiff[last..last + 2].copy_from_slice(&50_706_u16.to_le_bytes());
    assert!(message(&tiff).contains("darktable"), "{}", message(&tiff));
    let mut apng = Vec::new();
    let mut encoder = ::png::Encoder::new(&mut apng, 1, 1);
    encoder.set_animated(2, 0).expect("two frames");
    let mut writer = encoder.write_header().expect("into memory");
    for gray in [0, 9] {
        writer.write_image_data(&[gray]).expect("into memory");
    }
    writer.finish().expect("both frames");
    assert!(message(&apng).contains("animated PNG"), "{}", message(&apng));
}

#[test]
fn a_picture_developed_from_dng_is_not_taken_for_one() {
    // One entry: the version of DNG, four bytes, which such pictures have in their EXIF still.
    let exif = b"II*\0\x08\0\0\0\x01\0\x12\xc6\x01\0\x04\0\0\0\x01\x04\0\0\0\0\0\0".to_vec();
    let before = Photo { exif: Some(exif), ..photo(Layout::Gbr, 8, false, (24, 16)) };
    for format in FORMATS {
        let (bytes, _) = written(&before, format);
        assert_eq!(read(&bytes).expect("no raw file").frame.width, 24, "{format:?}");
    }
}

#[test]
fn paths_that_are_no_files_are_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let options = LoadOptions::default();
    let message = load(folder.path(), options).expect_err("a folder").to_string();
    assert!(message.starts_with("cannot be read: a folder, not a regular file"), "{message}");
    assert!(matches!(load(&folder.path().join("none.png"), options), Err(StillError::Read(_))));
    let raw = folder.path().join("a.NEF");
    std::fs::write(&raw, b"II*\0").expect("a small file");
    assert!(matches!(load(&raw, options), Err(StillError::Raw(_))));
    // The content counts, not the name.
    let wrong = folder.path().join("a.jpg");
    std::fs::write(&wrong, written(&photo(Layout::Gray, 8, false, (4, 3)), StillFormat::Png).0).expect("a small file");
    assert_eq!(load(&wrong, options).expect("a PNG").format, Some(StillFormat::Png));
    assert_eq!(size(&wrong, options).expect("a PNG"), (4, 3));
    let short = LoadOptions { max_pixels: 1 };
    std::fs::File::create(folder.path().join("long.png")).and_then(|f| f.set_len(80 << 20)).expect("a sparse file");
    assert!(matches!(load(&folder.path().join("long.png"), short), Err(StillError::TooLong { .. })));
}

#[test]
fn mutated_files_never_panic() {
    let mut rng = fastrand::Rng::with_seed(1);
    for format in FORMATS {
        let mut whole = photo(Layout::Gbr, 8, false, (40, 30));
        whole.exif = Some(exif_block(Order::Big));
        whole.icc = Some(profile(*b"RGB ", 300));
        let (bytes, _) = written(&whole, format);
        for _ in 0..1500 {
            let mut wild = bytes.clone();
            for _ in 0..rng.usize(1..8) {
                // Half of the changes in the first half kilobyte, where the structure is.
                let most = if rng.bool() { wild.len() } else { wild.len().min(500) };
                let at = rng.usize(..most);
                wild[at] = rng.u8(..);
            }
            if rng.u8(..) < 40 {
                wild.truncate(rng.usize(..wild.len()));
            }
            let options = LoadOptions { max_pixels: 1 << 20 };
            if let Err(StillError::Damaged(why)) = decode(Cursor::new(&wild), options) {
                assert_ne!(why, "its decoder gave up", "{format:?}");
            }
        }
    }
}
