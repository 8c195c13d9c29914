//! Cameras in space on a rendered clip whose true cameras are known: recovered, and told where to stand.

use std::path::{Path, PathBuf};
use std::process::Command;

use nalgebra::{Quaternion, UnitQuaternion};
use plumbline::video::motion::ClipMotion;
use plumbline::video::motion::sfm::SfmVerdict;
use serde_json::{Value, json};

use crate::support::clips::workshop;
use crate::support::program::{err, names, plumbline_in, succeed};

/// Frames of the clip that are read, and how the command line says so.
const FRAMES: usize = 60;
const END: &str = "2";

fn media(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("media").join(name)
}

/// True poses `[qw, qx, qy, qz, tx, ty, tz]` of the first frames.
fn truth(which: &str) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(media("street-walk.truth.json")).expect("the truth beside the clip");
    let all: Value = serde_json::from_str(&text).expect("JSON");
    let poses: Vec<Vec<f64>> = serde_json::from_value(all[which].clone()).expect("poses");
    poses.into_iter().take(FRAMES).collect()
}

fn path_file(wanted: &[Vec<f64>], input: &[Vec<f64>]) -> Value {
    let entries = |poses: &[Vec<f64>]| poses.iter().map(|p| json!({ "q": p[..4], "t": p[4..] })).collect::<Vec<_>>();
    json!({ "wanted": entries(wanted), "input": entries(input) })
}

fn rotation(pose: &[f64]) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize(Quaternion::new(pose[0], pose[1], pose[2], pose[3]))
}

/// Mean PSNR, dB, of the frames of two clips.
fn psnr(folder: &Path, a: &str, b: &str) -> f64 {
    let run = Command::new("ffmpeg")
        .current_dir(folder)
        .args(["-nostdin", "-i", a, "-i", b, "-lavfi", "[0:v][1:v]psnr=shortest=1", "-f", "null", "-"])
        .output()
        .expect("ffmpeg");
    let told = String::from_utf8_lossy(&run.stderr).into_owned();
    let average = told.rsplit("average:").next().and_then(|t| t.split_whitespace().next()).expect("a figure");
    average.parse().unwrap_or(f64::INFINITY)
}

#[test]
fn the_cameras_of_a_rendered_walk_are_recovered() {
    let Some(folder) = workshop() else { return };
    let (folder, clip) = (folder.path(), media("street-walk.mp4"));
    let clip = clip.to_str().expect("a plain path");
    let told = err(&succeed(folder, &["motion", clip, "-o", "m.json", "--end", END]));
    assert!(told.contains("3d"), "{told}");
    let motion = ClipMotion::from_json(&std::fs::read(folder.join("m.json")).expect("written")).expect("a motion file");
    let cameras = motion.cameras.expect("cameras were asked for");
    assert_eq!((cameras.frames.len(), cameras.shots[0].verdict), (FRAMES, SfmVerdict::ThreeD));
    let truth = truth("shaky");
    let first = cameras.frames[0].expect("a camera").pose.rotation;
    for (k, camera) in cameras.frames.iter().enumerate() {
        let camera = camera.expect("a camera in every frame");
        let turned = camera.pose.rotation * first.inverse();
        let expected = rotation(&truth[k]) * rotation(&truth[0]).inverse();
        let off = turned.angle_to(&expected).to_degrees();
        assert!(off < 0.2, "frame {k} is turned {off:.3} degrees away from the truth");
    }
}

#[test]
fn the_clips_own_cameras_give_the_clip_back_and_others_do_not() {
    let Some(folder) = workshop() else { return };
    let (folder, clip) = (folder.path(), media("street-walk.mp4"));
    let clip = clip.to_str().expect("a plain path");
    let (shaky, stable) = (truth("shaky"), truth("stable"));
    for (wanted, name) in [(&shaky, "same"), (&stable, "steady")] {
        let file = format!("{name}.json");
        std::fs::write(folder.join(&file), path_file(wanted, &shaky).to_string()).expect("writable");
        let target = format!("{name}.mkv");
        let args = [
            "stabilize",
            clip,
            "-o",
            &target,
            "--end",
            END,
            "--path-file",
            &file,
            "--zoom",
            "none",
            "--border",
            "black",
        ];
        let told = err(&succeed(folder, &[&args[..], &["--codec", "ffv1"]].concat()));
        assert!(told.contains("3d ") && told.contains("aligned to"), "{told}");
    }
    let (same, steady) = (psnr(folder, "same.mkv", clip), psnr(folder, "steady.mkv", clip));
    assert!(same > 28.0 && steady < same - 6.0, "{same:.1} dB for the same cameras, {steady:.1} dB for steady ones");
}

/// Values over the frames of the virtual camera in a plot of a report, in thousandths of the plot's height; then the real one's.
fn plotted(page: &str, title: &str) -> [Vec<f64>; 2] {
    let figure =
        page.split("<figure").find(|f| f.contains(&format!("<h3>{title}<span> (scene units)<"))).expect("a plot");
    ["after", "before"].map(|class| {
        let path = figure.split(&format!("<path class=\"{class}\" d=\"M")).nth(1).expect("a curve");
        let outline = path.split('"').next().expect("closed");
        let height = |point: &str| point.split(' ').nth(1).and_then(|y| y.parse().ok()).expect("a point");
        outline.split('L').map(height).collect()
    })
}

#[test]
fn along_a_linear_path_the_virtual_camera_goes_straight_on_at_even_speed() {
    let Some(folder) = workshop() else { return };
    let (folder, clip) = (folder.path(), media("street-walk.mp4"));
    let clip = clip.to_str().expect("a plain path");
    let args = ["stabilize", clip, "-o", "line.mp4", "--end", END, "--mode", "3d", "--path", "linear"];
    let told = err(&succeed(folder, &[&args[..], &["--min-crop", "0.6", "--report", "line.html"]].concat()));
    assert!(told.contains("linear path followed fully"), "{told}");
    let page = std::fs::read_to_string(folder.join("line.html")).expect("a report");
    let bend = |values: &[f64]| {
        let (first, last) = (values[0], values[FRAMES - 1]);
        let even = |k: usize| first + (last - first) * k as f64 / (FRAMES as f64 - 1.0);
        (0..FRAMES).map(|k| (values[k] - even(k)).abs()).fold(0.0, f64::max)
    };
    let mut shaken: f64 = 0.0;
    for title in ["x, to the right", "y, down", "z, ahead"] {
        let [line, real] = plotted(&page, title);
        assert_eq!((line.len(), real.len()), (FRAMES, FRAMES), "{title}");
        assert!(bend(&line) <= 0.11, "{title} bends by {} of 1000", bend(&line));
        shaken = shaken.max(bend(&real));
    }
    assert!(shaken > 20.0, "the real camera's course bends by {shaken} of 1000 only");
}

#[test]
fn a_path_file_that_is_none_is_refused_and_nothing_is_written() {
    let Some(folder) = workshop() else { return };
    let (folder, clip) = (folder.path(), media("street-walk.mp4"));
    let clip = clip.to_str().expect("a plain path");
    let shaky: Vec<Vec<f64>> = truth("shaky").into_iter().take(10).collect();
    let good = path_file(&shaky, &shaky);
    let with = |change: &dyn Fn(&mut Value)| {
        let mut file = good.clone();
        change(&mut file);
        file.to_string()
    };
    for (text, words) in [
        ("{}".to_owned(), "missing field `wanted`"),
        (with(&|f| f["wanted"][3]["q"] = json!([2, 0, 0, 0])), "wanted[3] is no pose"),
        (with(&|f| f["wanted"][3]["q"] = json!(null)), "wanted[3] is no pose"),
        (with(&|f| f["input"][4]["t"] = json!([0, "x", 0])), "not a path file"),
        (with(&|f| f["input"] = json!([])), "input has 0 cameras for 10 frames"),
        (with(&|f| f["wanted"] = json!([f["wanted"][0]])), "wanted has 1 poses for 10 frames"),
    ] {
        std::fs::write(folder.join("path.json"), text).expect("writable");
        let args = ["stabilize", clip, "-o", "out.mkv", "--end", "0.33", "--path-file", "path.json"];
        let ran = plumbline_in(folder, &args);
        assert_eq!(ran.status.code(), Some(65), "{words}: {}", err(&ran));
        assert!(err(&ran).contains(words), "{words}: {}", err(&ran));
        assert_eq!(names(folder), ["path.json"], "{words}");
    }
}
