//! The motion file: what is written comes back, and what cannot be is refused by name.

use std::io::Cursor;

use plumbline::num::math::{Point2, Vec2};
use plumbline::video::motion::{self, ClipMotion, MotionFileError, MotionQuality};
use plumbline::video::track::{FrameQuality, FrameTracks, Observation, TrackStore};

use crate::motion::{clip, gap};

fn written(clip: &ClipMotion) -> String {
    let mut bytes = Vec::new();
    clip.write_json(&mut bytes).expect("finite motion");
    String::from_utf8(bytes).expect("JSON is text")
}

fn sample_clip() -> ClipMotion {
    use MotionQuality::{Lost, Measured, ShotStart};
    let mut clip = clip(&[ShotStart, Measured, Measured, Lost, Measured, ShotStart, Measured]);
    clip.rotation = 90;
    clip.pixel_aspect = (4, 3);
    clip.readout_s = Some(0.02);
    clip.other_blocks.insert("gyroscope".into(), serde_json::json!([{ "rad_s": [0.1, 0.0, -0.2] }]));
    clip
}

#[test]
fn a_motion_file_brings_back_what_was_written() {
    let clip = sample_clip();
    let back = ClipMotion::from_json(written(&clip).as_bytes()).expect("own file");
    assert_eq!(back, clip);
    assert_eq!(back.shown_size(), (360, 853));
    assert_eq!(written(&back), written(&clip));
}

#[test]
fn a_file_with_pixel_centers_at_integers_is_shifted() {
    let clip = sample_clip();
    let text = written(&clip).replace("\"pixel_center\": 0.5", "\"pixel_centre\": 0");
    let shifted = ClipMotion::from_json(text.as_bytes()).expect("centers at integers are accepted");
    for (a, b) in clip.frames.iter().zip(&shifted.frames) {
        let p = Point2::new(100.0, 200.0);
        let half = Vec2::new(0.5, 0.5);
        let expected = a.homography.apply(p).expect("in front") + half;
        assert!((b.homography.apply(p + half).expect("in front") - expected).norm() < 1e-9);
        assert!((b.similarity.apply(p + half) - (a.similarity.apply(p) + half)).norm() < 1e-9);
    }
}

#[test]
fn a_file_without_similarities_gets_the_nearest_ones() {
    let text = written(&sample_clip());
    let cut = text.find(",\n\"planar_similarity\"").expect("the block is written");
    let clip = ClipMotion::from_json(format!("{}}}", &text[..cut]).as_bytes()).expect("the block is optional");
    let apart = gap(&clip.frames[1].similarity.to_homography(), &clip.frames[1].homography);
    assert!(apart > 0.1 && apart < 12.0, "{apart}");
}

#[test]
fn every_refusal_names_the_field_the_value_and_what_may_stand_there() {
    let good = written(&sample_clip());
    let cases = [
        ("\"version\": 1", "\"version\": 2", "motion file version 2 is not supported (expected 1)"),
        ("plumbline.motion", "other", "format \"other\" is not a motion file"),
        ("\"width\":640", "\"width\":4000000000", "source.width is 4000000000 (expected 1 to 65536 px)"),
        ("\"width\":640", "\"width\":0", "source.width is 0"),
        ("\"rotation\":90", "\"rotation\":45", "source.rotation is 45"),
        ("\"time_base\":[1,30000]", "\"time_base\":[1,0]", "source.time_base is [1, 0]"),
        ("\"pixel_aspect\":[4,3]", "\"pixel_aspect\":[0,3]", "source.pixel_aspect is [0, 3]"),
        ("\"pixel_center\": 0.5", "\"pixel_center\": 0.25", "pixel_center is 0.25 (expected 0.5, or 0)"),
        ("\"readout_s\": 0.02", "\"readout_s\": 2", "readout_s is 2 (expected -0.1 to 0.1 s)"),
        ("\"pts\":1001", "\"pts\":0", "frames[1].pts is 0 (expected later than the frame before)"),
        ("\"shot\":1", "\"shot\":7", "frames[5].shot is 7"),
        ("\"planar\": [\n", "\"planar\": [\nnull,\n", "block \"planar\" has 8 entries for 7 frames"),
        ("[[1.01,0.012,4.0]", "[[1e999,0.012,4.0]", "not a motion file: number out of range"),
        ("[[1.01,0.012,4.0],[-0.008,0.995,-3.0]", "[[0,0,0],[0,0,0]", "planar[0] is "),
        ("[[1.01,0.012,4.0]", "[[null,0.012,4.0]", "not a motion file: invalid type: null"),
    ];
    for (from, to, message) in cases {
        assert!(good.contains(from), "{from} is not in the file");
        let error = ClipMotion::from_json(good.replacen(from, to, 1).as_bytes()).expect_err(to);
        assert!(error.to_string().contains(message), "{to}: {error}");
    }
}

/// Random points for every frame of a clip, the last of which stand on the edges of the picture.
fn tracked(clip: &ClipMotion) -> TrackStore {
    let mut rng = fastrand::Rng::with_seed(6);
    let mut store = TrackStore::new().expect("a temporary folder");
    for frame in &clip.frames {
        let mut seen: Vec<Observation> = (0..rng.u32(0..40))
            .map(|k| {
                let (x, y) = (640.0 * rng.f32(), 360.0 * rng.f32());
                Observation { id: 7 * k + rng.u32(0..7), x, y, background: rng.bool() }
            })
            .collect();
        seen.push(Observation { id: 900, x: 640.0, y: 0.0, background: false });
        let quality = FrameQuality::default();
        store.push(&FrameTracks { pts: frame.pts, observations: seen, quality }).expect("in range");
    }
    store
}

fn frames_of(store: &TrackStore) -> Vec<FrameTracks> {
    store.window(0..store.frames()).expect("stored")
}

fn written_with_tracks() -> (ClipMotion, TrackStore, String) {
    let clip = sample_clip();
    let store = tracked(&clip);
    let mut bytes = Vec::new();
    clip.write_json_with_tracks(&mut bytes, &store).expect("finite motion");
    (clip, store, String::from_utf8(bytes).expect("JSON is text"))
}

#[test]
fn points_come_back_from_a_motion_file_to_the_bit() {
    let (clip, store, text) = written_with_tracks();
    let (back, tracks) = ClipMotion::read_json(Cursor::new(&text)).expect("own file");
    assert_eq!(back, clip);
    assert_eq!(frames_of(&tracks.expect("tracks were written")), frames_of(&store));
    // Blocks in another order, as a program that sorts them writes.
    let sorted = serde_json::from_str::<serde_json::Value>(&text).expect("JSON").to_string();
    assert!(sorted.find("\"unit_px\"") > sorted.find("\"ids\""));
    let (_, tracks) = ClipMotion::read_json(Cursor::new(&sorted)).expect("the same in another order");
    assert_eq!(frames_of(&tracks.expect("tracks")), frames_of(&store));
    let (_, none) = ClipMotion::read_json(Cursor::new(&written(&clip))).expect("own file");
    assert!(none.is_none());
}

#[test]
fn points_in_another_unit_with_centers_at_integers_are_shifted() {
    let (_, store, text) = written_with_tracks();
    let step = 1.0 / 256.0;
    let mut file: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    file["pixel_center"] = 0.into();
    file["tracks"]["unit_px"] = 0.5.into();
    for frame in file["tracks"]["frames"].as_array_mut().expect("frames") {
        for axis in ["x", "y"] {
            for v in frame[axis].as_array_mut().expect("positions") {
                *v = ((v.as_f64().expect("a number") * step - 0.5) / 0.5).into();
            }
        }
    }
    let (_, tracks) = ClipMotion::read_json(Cursor::new(file.to_string())).expect("another program's file");
    assert_eq!(frames_of(&tracks.expect("tracks")), frames_of(&store));
}

#[test]
fn points_that_cannot_be_are_refused_with_frame_and_line() {
    type Change<'a> = &'a dyn Fn(&mut serde_json::Value);
    let (_, _, text) = written_with_tracks();
    let file: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let refused = |change: &dyn Fn(&mut serde_json::Value)| {
        let mut file = file.clone();
        change(&mut file["tracks"]);
        let text = serde_json::to_string_pretty(&file).expect("JSON");
        ClipMotion::read_json(Cursor::new(text)).expect_err("refused").to_string()
    };
    let cases: [(Change<'_>, &str); 9] = [
        (&|t| t["unit_px"] = 0.into(), "tracks.unit_px is 0 (expected above 0 up to 1)"),
        (&|t| drop(t.as_object_mut().expect("a block").remove("unit_px")), "missing field `unit_px`"),
        (&|t| drop(t["frames"].as_array_mut().expect("a list").pop()), "tracks.frames has 6 entries for 7 frames"),
        (
            &|t| t["frames"].as_array_mut().expect("a list").push(serde_json::json!({})),
            "tracks.frames[7]: one frame too many",
        ),
        (&|t| t["frames"][1]["ids"][0] = 950.into(), "tracks.frames[1]: ids[1] is"),
        (&|t| drop(t["frames"][1]["x"].as_array_mut().expect("a list").pop()), "tracks.frames[1]:"),
        (
            &|t| t["frames"][2]["y"][0] = (-9000).into(),
            "tracks.frames[2]: y[0] is -9000, or -35.15625 px (expected 0 to 360 px)",
        ),
        (&|t| t["frames"][2]["moving"] = serde_json::json!([901]), "tracks.frames[2]: moving contains 901"),
        (&|t| t["frames"][2]["x"][0] = "5".into(), "invalid type: string"),
    ];
    for (change, words) in cases {
        let error = refused(change);
        assert!(error.contains(words) && error.contains(" at line "), "{words}: {error}");
    }
}

#[test]
fn a_value_that_cannot_be_is_refused_with_its_line() {
    let good = written(&sample_clip());
    let line = 1 + good.lines().position(|l| l.contains("\"pts\":1001")).expect("the second frame");
    let error = ClipMotion::from_json(good.replacen("\"pts\":1001", "\"pts\":0", 1).as_bytes()).expect_err("no time");
    assert_eq!(error.to_string(), format!("line {line}: frames[1].pts is 0 (expected later than the frame before)"));
}

#[test]
fn a_repeated_block_is_refused() {
    let twice = written(&sample_clip()).replacen("\"readout_s\"", "\"readout_s\": 0.01,\n\"readout_s\"", 1);
    let error = ClipMotion::from_json(twice.as_bytes()).expect_err("which one").to_string();
    assert!(error.contains("the block \"readout_s\" occurs twice"), "{error}");
}

#[test]
fn motion_that_is_not_finite_is_not_written() {
    let mut clip = sample_clip();
    clip.frames[2].similarity.t.x = f64::NAN;
    let error = clip.write_json(Vec::new()).expect_err("NaN");
    assert!(matches!(&error, MotionFileError::Value { field, .. } if field == "motion of frame 2"), "{error}");
}

#[test]
fn damaged_files_are_refused_or_read_but_never_panic() {
    let good = written(&sample_clip()).into_bytes();
    let mut rng = fastrand::Rng::with_seed(11);
    for _ in 0..4000 {
        let mut bytes = good.clone();
        for _ in 0..rng.usize(1..6) {
            let at = rng.usize(..good.len());
            match rng.u8(..4) {
                _ if at >= bytes.len() => {}
                0 => bytes[at] = rng.u8(..),
                1 => bytes[at] = *rng.choice(b"0123456789-.e[]{},:\"n").expect("not empty"),
                2 => bytes.truncate(at.max(1)),
                _ => bytes.splice(at..at, good[at..(at + 20).min(good.len())].iter().copied()).for_each(drop),
            }
        }
        if let Ok(clip) = ClipMotion::from_json(&bytes) {
            assert!(clip.frames.iter().all(|f| f.homography.is_finite()));
            drop(written(&clip));
        }
    }
}

#[test]
fn the_schema_names_every_field_of_the_file() {
    let schema = serde_json::to_string(&motion::motion_file_schema()).expect("a schema is JSON");
    let planar = ["pixel_center", "time_base", "readout_s", "planar", "planar_similarity", "verdict", "tier", "pts"];
    let in_space = ["cameras", "points", "reconstruction", "focal", "tracks", "unit_px", "ids", "moving"];
    for field in planar.into_iter().chain(in_space) {
        assert!(schema.contains(&format!("\"{field}\"")), "{field}");
    }
}
