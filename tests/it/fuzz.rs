//! The fuzz targets' bodies on mutated examples: flipped, cut, doubled, moved and spliced bytes, and words of the formats.

#[path = "../../fuzz/bodies.rs"]
mod bodies;

use std::io::Cursor;

use plumbline::image::still::{ExifTags, Photo, SaveOptions, StillFormat, encode, frame_of_rgb};
use plumbline::motion::{ClipMotion, FrameMotion, MotionQuality};
use plumbline::time::{Timebase, Timestamp};
use plumbline::track::{FrameQuality, FrameTracks, Observation, TrackStore};

/// Mutated inputs for each target.
const ROUNDS: usize = 30_000;

/// Pieces that get further into a parser than single bytes do.
const WORDS: [&str; 28] = [
    "[",
    "]",
    "{",
    "}",
    "\"",
    "'''",
    "=",
    "#",
    "\n",
    "${",
    "${item.stem}",
    "${vars.out}",
    "${env.HOME}",
    "[stage.x]",
    "[[stage]]",
    "use = \"video.encode\"",
    "inputs = [\"x\"]",
    "inputs = { frames = \"x\" }",
    "enabled = false",
    "null",
    "-1",
    "1e308",
    "nan",
    "1e-400",
    "18446744073709551616",
    "\u{0}",
    "\u{feff}",
    "ä",
];

/// One example changed in one to four places.
fn mutated(examples: &[Vec<u8>], random: &mut fastrand::Rng) -> Vec<u8> {
    let mut bytes = random.choice(examples).cloned().unwrap_or_default();
    for _ in 0..random.usize(1..=4) {
        let at = random.usize(0..=bytes.len());
        let end = (at + random.usize(1..40)).min(bytes.len());
        match random.u8(0..7) {
            0 if at < bytes.len() => bytes[at] ^= 1 << random.u8(0..8),
            1 if at < bytes.len() => bytes[at] = random.u8(..),
            2 => drop(bytes.drain(at..end)),
            3 => bytes.truncate(at),
            4 => {
                let piece = bytes[at..end].to_vec();
                let to = random.usize(0..=bytes.len());
                bytes.splice(to..to, piece);
            }
            5 => {
                let other = random.choice(examples).cloned().unwrap_or_default();
                let from = random.usize(0..=other.len());
                let piece = other[from..(from + random.usize(0..200)).min(other.len())].to_vec();
                bytes.splice(at..at, piece);
            }
            _ => {
                let word = random.choice(&WORDS).copied().unwrap_or_default();
                bytes.splice(at..at, word.bytes());
            }
        }
    }
    bytes
}

/// Runs `body` on the examples and on their mutants.
fn hammer(examples: &[Vec<u8>], body: fn(&[u8]), seed: u64) {
    let mut random = fastrand::Rng::with_seed(seed);
    for example in examples {
        body(example);
    }
    for round in 0..ROUNDS {
        let bytes = mutated(examples, &mut random);
        let ran = std::panic::catch_unwind(|| body(&bytes));
        assert!(ran.is_ok(), "round {round} panicked on:\n{}", String::from_utf8_lossy(&bytes));
    }
}

#[test]
fn no_pipeline_file_makes_the_reader_panic() {
    let mut examples: Vec<Vec<u8>> = vec![
        std::fs::read("pipeline/stabilize.toml").expect("the shipped pipeline"),
        b"version = 1\n[stage.a]\nuse = \"video.decode\"\npath = \"a.mp4\"\n[stage.b]\nuse = \"video.encode\"\n\
          inputs = [\"a\"]\npath = \"b.mp4\"\ncrf = 18\n"
            .to_vec(),
    ];
    let all = ["plumbline", "stabilize", "f/%d.png", "-o", "x.mkv", "--fps", "29.97", "--border", "fill", "--compare"];
    let built = plumbline::cli::pipeline_of(all).expect("options in order");
    examples.push(plumbline::pipeline::print(&built).into_bytes());
    hammer(&examples, bodies::pipeline_file, 1);
}

#[test]
fn no_motion_file_makes_the_reader_panic() {
    let frame = |k: i64| FrameMotion::still(Timestamp(k * 512), MotionQuality::Measured);
    let clip = ClipMotion::new(640, 360, Timebase { num: 1, den: 12800 }, (0..4).map(frame).collect());
    let mut text = Vec::new();
    clip.write_json(&mut text).expect("a small file");
    let mut store = TrackStore::new().expect("a temporary folder");
    for frame in &clip.frames {
        let observations = (0..5).map(|id| Observation { id, x: 30.5, y: 7.25, background: id != 3 }).collect();
        store.push(&FrameTracks { pts: frame.pts, observations, quality: FrameQuality::default() }).expect("in range");
    }
    let mut with_tracks = Vec::new();
    clip.write_json_with_tracks(&mut with_tracks, &store).expect("a small file");
    hammer(&[text, with_tracks, b"{}".to_vec(), b"[]".to_vec()], bodies::motion_file, 2);
}

#[test]
fn no_picture_makes_the_reader_panic() {
    let samples: Vec<u8> = (0..24 * 16 * 3).map(|i| (i * 7 % 251) as u8).collect();
    let frame = frame_of_rgb(&samples, 24, 16).expect("as many as it takes");
    let exif = Some(b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0".to_vec());
    let photo = Photo { frame, exif, tags: ExifTags::default(), icc: None, format: None, warnings: Vec::new() };
    let file = |format| {
        let mut out = Cursor::new(Vec::new());
        encode(&photo, format, SaveOptions::default(), &mut out).expect("it can be written");
        out.into_inner()
    };
    let formats = [StillFormat::Jpeg, StillFormat::Png, StillFormat::Tiff, StillFormat::WebP];
    hammer(&formats.map(file), bodies::still_file, 3);
}
