//! Laws that hold for every pipeline: printing and reading, schemas and checks, noise.

use plumbline::app::pipeline::file::{Input, PipelineFile, StageEntry};
use plumbline::app::pipeline::reference::escape;
use plumbline::app::pipeline::shipped::shipped;
use plumbline::app::pipeline::syntax::{Entry, Value};
use plumbline::app::pipeline::units::{BitRate, ByteSize, ClipTime};
use plumbline::app::pipeline::{check, print, read, schema};
use plumbline::app::stages::{
    Border, Codec, DecodeSettings, EncodeSettings, Interpolation, KINDS, MotionSettings, RenderSettings,
    RollingShutter, SmoothSettings, TrackSettings, WarpSettings,
};
use proptest::prelude::*;
use serde_json::Value as Json;

use crate::pipeline::{GOOD, source};

/// Text that hurts: quotes, braces, references, line breaks, other scripts.
fn text() -> impl Strategy<Value = String> {
    proptest::collection::vec(
        prop_oneof![Just("${".to_owned()), Just("}".to_owned()), Just("$".to_owned()), "[ -~é漢\n\t\"'\\\\]{1,6}"],
        1..6,
    )
    .prop_map(|parts| parts.concat())
}

fn encode() -> impl Strategy<Value = EncodeSettings> {
    let codec = prop_oneof![Just(Codec::H264), Just(Codec::Hevc), Just(Codec::Av1)];
    let wishes = ["software", "auto", "hardware", "libaom-av1"].map(|w| w.parse().expect("a wish"));
    (
        text(),
        proptest::option::of(codec),
        proptest::sample::select(wishes.to_vec()),
        proptest::option::of(0.0..51.0f64),
        proptest::option::of(text()),
        any::<bool>(),
        1u64..1_000_000_000,
    )
        .prop_map(|(path, codec, encoder, crf, preset, strict, rate)| EncodeSettings {
            path: escape(&path),
            codec,
            encoder,
            crf,
            preset: preset.map(|p| escape(&p)),
            bitrate: crf.is_none().then_some(BitRate(rate)),
            strict,
        })
}

fn analysis() -> impl Strategy<Value = (DecodeSettings, TrackSettings, MotionSettings, SmoothSettings)> {
    let shutter = prop_oneof![
        Just(RollingShutter::Auto),
        Just(RollingShutter::Off),
        (1e-6..0.1f64).prop_map(RollingShutter::Readout)
    ];
    (
        text(),
        proptest::option::of(0.0..1e6f64),
        50u32..20_000,
        proptest::option::of(text()),
        shutter,
        0.05..30.0f64,
        0.3..1.0f64,
    )
        .prop_map(|(path, start, points, mask, rolling_shutter, smoothness, keep)| {
            let start = start.and_then(ClipTime::from_seconds);
            (
                DecodeSettings { path: escape(&path), start, ..DecodeSettings::default() },
                TrackSettings { points, mask: mask.map(|m| escape(&m).into()) },
                MotionSettings { rolling_shutter, ..MotionSettings::default() },
                SmoothSettings { smoothness, keep, ..SmoothSettings::default() },
            )
        })
}

fn rendering() -> impl Strategy<Value = (WarpSettings, RenderSettings)> {
    (2u32..256, 2u32..256, 0.001..1e6f64, any::<bool>(), 0u64..1 << 40).prop_map(
        |(columns, rows, alpha, fill, memory)| {
            let border = if fill { Border::Fill } else { Border::Mirror };
            let render =
                RenderSettings { interpolation: Interpolation::Lanczos3, border, fill_memory: ByteSize(memory) };
            (WarpSettings { columns, rows, alpha, ..WarpSettings::default() }, render)
        },
    )
}

fn pipeline_file() -> impl Strategy<Value = PipelineFile> {
    (analysis(), rendering(), encode(), proptest::option::of(text()), any::<i64>(), any::<bool>()).prop_map(
        |((decode, track, motion, smooth), (warp, render), encode, name, var, list)| {
            let mut stages = vec![
                StageEntry::built("source", &decode),
                StageEntry::built("tracks", &track).input("frames", "source"),
                StageEntry::built("motion", &motion).input("tracks", "tracks"),
                StageEntry::built("path", &smooth).input("motion", "motion"),
                StageEntry::built("warp", &warp).input("tracks", "tracks").input("path", "path"),
                StageEntry::built("steady", &render).input("frames", "source").inputs("warps", &["warp"]),
                StageEntry::built("out", &encode).input("frames", "steady"),
            ];
            if list {
                stages[3].inputs = vec![Input { port: None, from: vec!["motion".into()], list: true }];
            }
            let vars = vec![Entry::built("x", Value::Integer(var)), Entry::built("y", Value::Loose(format!("{var}")))];
            PipelineFile { name, vars, stages, ..PipelineFile::default() }
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(200) })]

    #[test]
    fn what_is_printed_reads_back_as_the_same_pipeline(file in pipeline_file()) {
        let printed = print(&file);
        let built = check(file).map_err(|p| TestCaseError::fail(p.render(false, 100)))?;
        let loaded = read(source(&printed), &[]).map_err(|p| TestCaseError::fail(format!("{printed}\n{}", p.render(false, 100))))?;
        prop_assert_eq!(&loaded, &built, "{}", printed);
        prop_assert_eq!(print(&loaded.file), printed, "printing twice gives the same text");
    }

    #[test]
    fn noise_in_a_file_never_panics(edits in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0u8..4), 1..12)) {
        let mut bytes = shipped("stabilize").map(|s| s.text.into_bytes()).unwrap_or_default();
        for (at, byte, how) in edits {
            let at = at.index(bytes.len());
            match how {
                0 => bytes[at] = byte,
                1 => { bytes.remove(at); }
                2 => bytes.insert(at, b" \n\"'[]{}$.=#0-"[usize::from(byte) % 14]),
                _ => { let tail = bytes.split_off(at); bytes.splice(0..0, tail); }
            }
        }
        if let Err(problems) = read(source(&String::from_utf8_lossy(&bytes)), &["out.crf=3".to_owned()]) {
            prop_assert!(!problems.problems.is_empty());
            let _ = (problems.render(true, 40), problems.to_json());
        }
    }

    #[test]
    fn any_option_either_applies_or_is_explained(option in "\\PC{0,30}") {
        let _ = read(source(GOOD), &[option]).map_err(|p| p.render(false, 100));
    }
}

/// Every setting with a range, of every kind: `(kind, key, least, most)`.
fn ranges() -> Vec<(&'static str, String, Option<f64>, Option<f64>)> {
    let of = |kind: &'static plumbline::app::pipeline::kind::StageKind| {
        let schema = (kind.schema)();
        let properties = schema["properties"].as_object().cloned().unwrap_or_default();
        properties.into_iter().map(move |(key, p)| (kind.name, key, p["minimum"].as_f64(), p["maximum"].as_f64()))
    };
    KINDS.iter().flat_map(of).filter(|(_, _, a, b)| a.is_some() || b.is_some()).collect()
}

#[test]
fn a_range_that_the_schema_states_is_enforced_and_nan_is_in_none() {
    let ranges = ranges();
    assert!(ranges.len() >= 6, "{ranges:?}");
    for (kind, key, least, most) in ranges {
        let code_at = |value: String| {
            let text = format!("version = 1\n[stage.x]\nuse = \"{kind}\"\npath = \"p\"\n{key} = {value}\n");
            let problems = read(source(&text), &[]).map_err(|p| p.problems).err().unwrap_or_default();
            problems.iter().find(|p| p.message.contains(&format!("`{key}`"))).map(|p| p.code)
        };
        let whole = |x: f64| if x.fract() == 0.0 { format!("{x:.0}") } else { x.to_string() };
        for inside in [least, most].into_iter().flatten() {
            let code = code_at(whole(inside)).filter(|c| *c != "conflict");
            assert_eq!(code, None, "{kind} {key} = {inside} is allowed, unless another setting forbids it");
        }
        assert!(most.is_none_or(|b| code_at(whole(b + 1.0)) == Some("out-of-range")), "{kind} {key} > {most:?}");
        assert!(least.is_none_or(|a| code_at(whole(a - 1.0)) == Some("out-of-range")), "{kind} {key} < {least:?}");
        for wild in ["nan", "inf", "-inf"] {
            assert_eq!(code_at(wild.to_owned()), Some("bad-value"), "{kind} {key} = {wild}");
        }
    }
}

#[test]
fn every_setting_and_port_is_explained_and_every_default_is_allowed() {
    for kind in &KINDS {
        let schema = (kind.schema)();
        for (key, property) in schema["properties"].as_object().into_iter().flatten() {
            assert!(property["description"].as_str().is_some_and(|d| d.len() > 5), "{} {key}", kind.name);
        }
        assert!(!kind.outputs.is_empty() && kind.inputs.iter().chain(kind.outputs).all(|p| !p.doc.is_empty()));
        let defaults = kind.defaults().expect("defaults parse");
        // It writes one of several files, none of them by default.
        let asks = kind.name == "video.motion_export";
        assert_eq!(defaults.conflicts().is_empty(), !asks, "{}", kind.name);
    }
}

#[test]
fn the_schema_is_draft_07_and_has_a_branch_for_every_kind() {
    let schema = schema();
    assert_eq!(schema["$schema"], "http://json-schema.org/draft-07/schema#");
    assert!(!schema.to_string().contains("$ref"), "editors for TOML resolve no references");
    let branches =
        schema["properties"]["stage"]["additionalProperties"]["allOf"].as_array().cloned().unwrap_or_default();
    let names: Vec<&Json> = branches.iter().map(|b| &b["if"]["properties"]["use"]["const"]).collect();
    assert_eq!(names, KINDS.iter().map(|k| k.name).collect::<Vec<_>>());
    let smooth = names.iter().position(|n| *n == "video.smooth").expect("a kind");
    insta::assert_snapshot!(format!("{:#}", branches[smooth]));
}

#[test]
fn defaults_are_those_of_the_modules_that_do_the_work() {
    let (smooth, path) = (SmoothSettings::default(), plumbline::video::path::PathOptions::default());
    assert_eq!((smooth.smoothness, smooth.keep), (path.smoothness_s, path.keep));
    assert_eq!(format!("{:?} {:?}", smooth.path, smooth.zoom), format!("{:?} {:?}", path.kind, path.zoom));
    assert_eq!(TrackSettings::default().points as usize, plumbline::video::track::TrackOptions::default().points);
    let render = plumbline::image::render::RenderOptions::default();
    assert_eq!(format!("{:?}", RenderSettings::default().interpolation), format!("{:?}", render.interpolation));
}
