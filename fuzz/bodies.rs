//! What the fuzz targets do with any bytes. The integration tests run the same on mutated examples, for toolchains without a
//! fuzzer.

use std::io::Cursor;

use plumbline::camera::{ExifFacts, LensFile, parse_lens};
use plumbline::image::still::{ExifTags, LoadOptions, SaveOptions, StillFormat, decode, encode};
use plumbline::math::Point2;
use plumbline::motion::ClipMotion;
use plumbline::pipeline::{Source, print, read};

/// A motion file of any bytes is refused or read, never a panic; what was read can be written and read again.
pub(crate) fn motion_file(bytes: &[u8]) {
    if let Ok(clip) = ClipMotion::from_json(bytes) {
        let mut text = Vec::new();
        if clip.write_json(&mut text).is_ok() {
            ClipMotion::from_json(&text[..]).expect("own files are read");
        }
    }
}

/// Any bytes as a pipeline file: checked without a panic, every fault renderable, and what is accepted prints to itself.
pub(crate) fn pipeline_file(bytes: &[u8]) {
    let source = |text: String| Source { name: "fuzz.toml".into(), text, base: None };
    match read(source(String::from_utf8_lossy(bytes).into_owned()), &[]) {
        Err(problems) => {
            assert!(!problems.problems.is_empty());
            let _ = (problems.render(false, 80), problems.to_json());
        }
        Ok(pipeline) => {
            let again = read(source(print(&pipeline.file)), &[]).expect("what is printed is accepted");
            assert_eq!(again, pipeline);
        }
    }
}

/// A lens file of any bytes is refused or read, never a panic; the lens that was read can be used, written and read again.
pub(crate) fn lens_file(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let zoom = ExifFacts {
        size: Some((640.0, 480.0)),
        model: Some("Canon EOS 7D".to_owned()),
        lens: Some("EF-S10-22mm f/3.5-4.5 USM".to_owned()),
        focal_mm: Some(16.0),
        ..ExifFacts::default()
    };
    for picture in [ExifFacts::default(), zoom] {
        let Ok(profile) = parse_lens(&text, &picture) else { continue };
        for p in [Point2::new(0.0, 0.0), Point2::new(320.0, 470.0)] {
            let seen = profile.lens.unproject(p).and_then(|ray| profile.lens.project(&ray));
            assert!(seen.is_none_or(|q| q.x.is_finite() && q.y.is_finite()));
        }
        let own = serde_json::to_string(&LensFile::of(&profile.lens, "")).expect("plain data");
        parse_lens(&own, &picture).expect("own files are read");
    }
}

/// Any bytes as a picture, and as an EXIF block: read or refused without a panic; what was read can be written and read again.
pub(crate) fn still_file(bytes: &[u8]) {
    let _ = ExifTags::of(bytes);
    let options = LoadOptions { max_pixels: 1 << 18 };
    if let Ok(photo) = decode(Cursor::new(bytes), options) {
        let mut file = Cursor::new(Vec::new());
        encode(&photo, StillFormat::Tiff, SaveOptions::default(), &mut file).expect("any picture fits into TIFF");
        let again = decode(Cursor::new(file.into_inner()), options).expect("own files are read");
        assert_eq!((again.frame.width, again.frame.height), (photo.frame.width, photo.frame.height));
    }
}
