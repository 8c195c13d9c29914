//! Motion out and in again: files that a later run smooths without tracking, and models of other programs.

use std::path::{Path, PathBuf};
use std::process::Command;

use plumbline::video::motion::ClipMotion;
use plumbline::video::motion::exchange::colmap::Model;
use serde_json::{Value, json};

use crate::support::clips::{make, picture_sums, shaky, workshop};
use crate::support::program::{err, names, out, plumbline_in, succeed};

fn read(folder: &Path, name: &str) -> Value {
    serde_json::from_slice(&std::fs::read(folder.join(name)).expect("a file")).expect("JSON")
}

#[test]
fn smoothing_again_from_a_saved_file_gives_the_same_pictures_without_tracking() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    make(folder, "clip.mp4", &shaky(2.0));
    let lossless = ["--codec", "ffv1", "--threads", "1", "--mode", "mesh"];
    let first = ["stabilize", "clip.mp4", "-o", "first.mkv", "--export-motion", "m.json"];
    let told = err(&succeed(folder, &[&first[..], &lossless].concat()));
    let again = ["stabilize", "clip.mp4", "-o", "again.mkv", "--motion", "m.json"];
    let retold = err(&succeed(folder, &[&again[..], &lossless].concat()));
    let sums = |name: &str| picture_sums(&folder.join(name), "yuv420p");
    assert_eq!(sums("first.mkv"), sums("again.mkv"));
    let figures = |told: &str| -> Vec<String> {
        let wanted =
            |l: &&str| ["shake", "crop", "mesh", "homography", "similarity"].iter().any(|w| l.trim().starts_with(w));
        told.lines().filter(wanted).map(str::to_owned).collect()
    };
    assert!(!figures(&told).is_empty());
    assert_eq!(figures(&told), figures(&retold), "the summary tells the same");

    let converted = ["motion", "clip.mp4", "--motion", "m.json", "-o", "same.json", "--csv", "t.csv"];
    succeed(folder, &converted);
    let (m, same) = (read(folder, "m.json"), read(folder, "same.json"));
    for block in ["frames", "planar", "planar_similarity", "tracks", "readout_s", "source"] {
        assert_eq!(m[block], same[block], "{block} comes through reading and writing as it was");
    }
    assert!(same["cameras"].is_array() && m["cameras"].is_null(), "cameras were looked for on the saved points");
    let table = std::fs::read_to_string(folder.join("t.csv")).expect("a table");
    assert_eq!(table.lines().count(), 51);
}

#[test]
fn a_run_with_motion_from_a_file_is_planned_in_one_pass() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let args = ["stabilize", "clip.mp4", "-o", "out.mp4", "--motion", "m.json", "--mode", "3d", "--print-pipeline"];
    std::fs::write(folder.join("job.toml"), succeed(folder, &args).stdout).expect("a small file");
    let plan = out(&succeed(folder, &["plan", "job.toml"]));
    assert!(plan.starts_with("pass 1 of 1: source → motion → path → warp → steady → out"), "{plan}");
    assert!(!plan.contains("video.track"), "{plan}");
}

#[test]
fn motion_of_another_clip_or_none_is_refused_with_its_line_and_nothing_is_written() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    make(folder, "clip.mp4", &shaky(0.4));
    make(folder, "long.mp4", &shaky(0.6));
    make(folder, "small.mp4", "-f lavfi -i testsrc2=size=160x120:rate=25:duration=0.4");
    succeed(folder, &["stabilize", "clip.mp4", "-o", "x.mp4", "--mode", "mesh", "--export-motion", "good.json"]);
    std::fs::remove_file(folder.join("x.mp4")).expect("written");
    let good = std::fs::read_to_string(folder.join("good.json")).expect("written");
    let value: Value = serde_json::from_str(&good).expect("JSON");
    let line_of = |words: &str| 1 + good[..good.find(words).expect(words)].matches('\n').count();
    let with = |change: &dyn Fn(&mut Value)| {
        let mut file = value.clone();
        change(&mut file);
        serde_json::to_string_pretty(&file).expect("JSON")
    };
    let missing = |f: &mut Value| {
        for block in ["frames", "planar", "planar_similarity"] {
            f[block].as_array_mut().expect("a list").pop();
        }
        f["tracks"]["frames"].as_array_mut().expect("a list").pop();
    };
    let bad_planar = good.replacen("\"planar\": [\n[[", "\"planar\": [\n[[-", 1);
    let slow =
        |f: &mut Value| f["source"]["time_base"][0] = json!(2 * f["source"]["time_base"][0].as_i64().expect("ticks"));
    let cases: [(&str, String, String); 10] = [
        ("clip.mp4", with(&|f| f["version"] = json!(2)), "motion file version 2 is not supported".to_owned()),
        ("clip.mp4", with(&missing), "frames has 9 entries, and the clip 10 frames".to_owned()),
        ("long.mp4", good.clone(), "frames has 10 entries, and the clip 15 frames".to_owned()),
        ("small.mp4", good.clone(), "source is of 320×180 px, and the clip of 160×120 px".to_owned()),
        (
            "clip.mp4",
            with(&slow),
            "frames[1].pts is 0.080 s after the first (expected 0.040 s, as in the clip)".to_owned(),
        ),
        ("clip.mp4", bad_planar, format!("line {}: planar[0] is", line_of("\"planar\": [") + 1)),
        ("clip.mp4", good.replacen("\"ids\":[0", "\"ids\":[NaN", 1), "expected value at line".to_owned()),
        ("clip.mp4", good.replacen("\"ids\":[0", "\"ids\":[900000", 1), "tracks.frames[0]: ids[1] is".to_owned()),
        ("clip.mp4", good.replacen("\"x\":[", "\"x\":[1e9,", 1), "tracks.frames[0]:".to_owned()),
        ("clip.mp4", good.replacen("\"pts\":", "\"pts\":900000,\"was\":", 1), "line".to_owned()),
    ];
    let there = names(folder);
    for (clip, text, words) in cases {
        std::fs::write(folder.join("bad.json"), text).expect("writable");
        let ran = plumbline_in(folder, &["stabilize", clip, "-o", "out.mkv", "--motion", "bad.json"]);
        assert_eq!(ran.status.code(), Some(65), "{words}: {}", err(&ran));
        assert!(err(&ran).contains(&words), "{words}: {}", err(&ran));
        std::fs::remove_file(folder.join("bad.json")).expect("written");
        assert_eq!(names(folder), there, "{words}");
    }
}

#[test]
fn a_saved_file_serves_the_same_span_of_a_trimmed_clip_only() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    make(folder, "clip.mp4", &shaky(1.0));
    let span = ["--start", "0.2", "--end", "0.8"];
    succeed(folder, &[&["stabilize", "clip.mp4", "-o", "a.mp4", "--export-motion", "m.json"][..], &span].concat());
    succeed(folder, &[&["stabilize", "clip.mp4", "-o", "b.mp4", "--motion", "m.json"][..], &span].concat());
    let whole = plumbline_in(folder, &["stabilize", "clip.mp4", "-o", "c.mp4", "--motion", "m.json"]);
    assert!(err(&whole).contains("frames has 15 entries, and the clip 25 frames"), "{}", err(&whole));
}

#[test]
fn a_file_without_points_moves_the_frames_along_the_path_and_says_so() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    make(folder, "clip.mp4", &shaky(1.0));
    succeed(folder, &["stabilize", "clip.mp4", "-o", "a.mp4", "--export-motion", "m.json"]);
    let mut value = read(folder, "m.json");
    value.as_object_mut().expect("an object").remove("tracks");
    std::fs::write(folder.join("bare.json"), value.to_string()).expect("writable");
    let told = err(&succeed(folder, &["stabilize", "clip.mp4", "-o", "b.mp4", "--motion", "bare.json"]));
    assert!(told.contains("bare.json has no tracks"), "{told}");
}

#[test]
fn folders_with_something_in_them_are_not_filled_without_leave() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    make(folder, "clip.mp4", &shaky(0.4));
    std::fs::create_dir(folder.join("model")).expect("a folder");
    std::fs::write(folder.join("model/mine.txt"), "x").expect("a small file");
    let ran = plumbline_in(folder, &["motion", "clip.mp4", "--colmap", "model"]);
    assert_eq!(ran.status.code(), Some(73));
    assert!(err(&ran).contains("the folder `model` is not empty"), "{}", err(&ran));
    let none = plumbline_in(folder, &["motion", "clip.mp4"]);
    assert_eq!(none.status.code(), Some(2));
    assert!(
        err(&none).contains("<--output <FILE.json>|--colmap <DIR>|--gltf <FILE>|--csv <FILE.csv>>"),
        "{}",
        err(&none)
    );
}

#[test]
fn motion_files_are_written_by_the_stage_that_says_where() {
    let text = "version = 1\n[stage.source]\nuse = \"video.decode\"\npath = \"a.mp4\"\n\
                [stage.motion]\nuse = \"video.motion_import\"\ninputs = [\"source\"]\npath = \"m.json\"\n\
                [stage.files]\nuse = \"video.motion_export\"\ninputs = [\"motion\", \"motion.tracks\"]\n";
    let problems = plumbline::app::pipeline::read(crate::pipeline::source(text), &[]).expect_err("it writes nothing");
    assert!(problems.render(false, 100).contains("it writes nothing"), "{}", problems.render(false, 100));
    let overwritten = format!("{text}path = \"m.json\"\n");
    let pipeline = plumbline::app::pipeline::read(crate::pipeline::source(&overwritten), &[]).expect("a graph");
    assert!(pipeline.instances().expect_err("its own input").render(false, 100).contains("written over its input"));
}

fn media(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("media").join(name);
    path.to_str().expect("a plain path").to_owned()
}

#[test]
fn a_model_of_a_clip_is_drawn_in_3d_like_the_clip_itself() {
    let Some(folder) = workshop() else { return };
    let (folder, clip) = (folder.path(), media("street-walk.mp4"));
    let span = ["--end", "1.5"];
    let files = ["motion", &clip, "-o", "m.json", "--colmap", "model", "--gltf", "scene.glb", "--csv", "t.csv"];
    succeed(folder, &[&files[..], &span].concat());
    let model = Model::read(&folder.join("model")).expect("our own model");
    let motion = ClipMotion::from_json(&std::fs::read(folder.join("m.json")).expect("written")).expect("our own file");
    let cameras = motion.cameras.expect("cameras");
    let poses: Vec<_> = cameras.frames.iter().flatten().map(|c| c.pose).collect();
    assert_eq!(model.images.iter().map(|i| i.pose).collect::<Vec<_>>(), poses);
    let drawn = |source: &str, name: &str| {
        let args = ["stabilize", &clip, "-o", name, "--motion", source, "--mode", "3d", "--preset", "ultrafast"];
        err(&succeed(folder, &[&args[..], &span].concat()))
    };
    let (from_file, from_model) = (drawn("m.json", "file.mp4"), drawn("model", "model.mp4"));
    assert!(from_file.contains("  3d "), "{from_file}");
    assert!(
        from_model.contains("  3d ") && from_model.contains("read from a COLMAP model: 45 of 45 frames"),
        "{from_model}"
    );
    // Text alone, as COLMAP writes it on request, serves as well.
    for name in ["cameras.bin", "images.bin", "points3D.bin"] {
        std::fs::remove_file(folder.join("model").join(name)).expect("written");
    }
    assert_eq!(Model::read(&folder.join("model")).expect("text"), model);
    let other = plumbline_in(folder, &["stabilize", &clip, "-o", "x.mp4", "--motion", "model", "--end", "1"]);
    assert_eq!(other.status.code(), Some(65), "{}", err(&other));
    assert!(err(&other).contains("and the clip has 30 frames"), "{}", err(&other));
    assert!(!folder.join("x.mp4").exists());
}

/// Channels R and G of a map.
fn read_map(path: &Path) -> (usize, usize, Vec<f32>, Vec<f32>) {
    use exr::prelude::{ReadChannels, ReadLayers, read};
    let read = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer().all_attributes();
    let layer = read.from_file(path).expect("a valid file").layer_data;
    let channel = |name: &str| {
        let found = layer.channel_data.list.iter().find(|c| c.name.eq(name)).expect(name);
        found.sample_data.values_as_f32().collect::<Vec<f32>>()
    };
    (layer.size.0, layer.size.1, channel("R"), channel("G"))
}

/// Frame `k` of a clip, its luma alone.
fn luma(path: &PathBuf, k: usize, size: usize) -> Vec<f64> {
    let run = Command::new("ffmpeg")
        .args(["-v", "error", "-i"])
        .arg(path)
        .args(["-vf", "extractplanes=y", "-f", "rawvideo", "-"])
        .output()
        .expect("ffmpeg");
    run.stdout[k * size..(k + 1) * size].iter().map(|v| f64::from(*v)).collect()
}

/// `picture` sampled at a place, between the centers of its pixels, the edge drawn out.
fn bilinear(picture: &[f64], (w, h): (usize, usize), x: f64, y: f64) -> f64 {
    let (u, v) = ((x - 0.5).clamp(0.0, w as f64 - 1.0), (y - 0.5).clamp(0.0, h as f64 - 1.0));
    let (i, j) = ((u as usize).min(w - 2), (v as usize).min(h - 2));
    let (s, t) = (u - i as f64, v - j as f64);
    let row = |j: usize| picture[j * w + i] * (1.0 - s) + picture[j * w + i + 1] * s;
    row(j) * (1.0 - t) + row(j + 1) * t
}

#[test]
fn maps_for_compositors_show_what_was_rendered() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let clip = make(folder, "clip.mkv", &format!("{} -c:v ffv1 -pix_fmt yuv420p", shaky(0.6)));
    let args = ["stabilize", "clip.mkv", "-o", "out.mkv", "--codec", "ffv1", "--export-stmap", "maps"];
    let told = err(&succeed(folder, &args));
    assert!(told.contains("wrote     out.mkv, maps"), "{told}");
    let maps = names(&folder.join("maps"));
    assert_eq!((maps.len(), maps[0].as_str(), maps[14].as_str()), (15, "frame_000000.exr", "frame_000014.exr"));
    for k in [0, 7, 14] {
        let (w, h, red, green) = read_map(&folder.join("maps").join(&maps[k]));
        assert_eq!((w, h), (320, 180));
        let (source, shown) = (luma(&clip, k, w * h), luma(&folder.join("out.mkv"), k, w * h));
        let miss = |dx: f64, dy: f64| {
            let place = |i: usize| (f64::from(red[i]) * w as f64 + dx, (1.0 - f64::from(green[i])) * h as f64 + dy);
            let off = |i: usize| bilinear(&source, (w, h), place(i).0, place(i).1) - shown[i];
            ((0..w * h).map(|i| off(i).powi(2)).sum::<f64>() / (w * h) as f64).sqrt()
        };
        let (right, moved) = (miss(0.0, 0.0), [miss(0.25, 0.0), miss(-0.25, 0.0), miss(0.0, 0.25), miss(0.0, -0.25)]);
        assert!(
            moved.iter().all(|m| *m > 1.5 * right),
            "frame {k}: {right:.2} levels off, a quarter pixel away {moved:.2?}"
        );
    }
    let again = plumbline_in(folder, &["stabilize", "clip.mkv", "-o", "b.mkv", "--export-stmap", "maps"]);
    assert!(err(&again).contains("the folder `maps` is not empty"), "{}", err(&again));
}

#[test]
fn maps_of_an_unchanged_clip_are_the_identity() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    make(folder, "clip.mkv", "-f lavfi -i color=gray:size=64x48:rate=25:duration=0.2 -c:v ffv1");
    succeed(folder, &["stabilize", "clip.mkv", "-o", "out.mkv", "--export-stmap", "maps"]);
    let (w, h, red, green) = read_map(&folder.join("maps/frame_000003.exr"));
    for i in 0..w * h {
        let (x, y) = ((i % w) as f64 + 0.5, (i / w) as f64 + 0.5);
        assert_eq!((red[i], green[i]), ((x / w as f64) as f32, (1.0 - y / h as f64) as f32));
    }
}

#[test]
fn the_focal_length_of_a_container_is_reported() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let tag = "-movflags use_metadata_tags -metadata com.apple.quicktime.camera.focal_length.35mm_equivalent=26";
    make(folder, "phone.mov", &format!("-f lavfi -i testsrc2=size=160x120:rate=25:duration=0.2 {tag}"));
    let told = out(&succeed(folder, &["probe", "phone.mov"]));
    assert!(told.contains("focal length 26 mm in 35-mm terms, 120 px"), "{told}");
    let json: Value = serde_json::from_str(&out(&succeed(folder, &["probe", "phone.mov", "--json"]))).expect("JSON");
    assert_eq!(json["focal_35mm"], 26.0);
}
