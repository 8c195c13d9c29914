//! Clips in another shape and without their lens, by running the program: one interpolation, sound and times untouched.

use std::fs;
use std::path::Path;

use plumbline::app::cli::pipeline_of;
use plumbline::app::pipeline::draw::{GraphFormat, draw};
use plumbline::app::pipeline::plan::Plan;
use plumbline::app::pipeline::shipped::shipped;
use plumbline::app::pipeline::{check, print, read};

use crate::pipeline::source;
use crate::support::clips::{make, packet_sums, shaky, times, video_field, workshop};
use crate::support::program::{err, plumbline_in, succeed};

/// `clip.mp4`: 40 shaky frames of 320×180 px with sound.
fn clip(folder: &Path) -> std::path::PathBuf {
    let sound = "-f lavfi -i sine=frequency=440:sample_rate=48000";
    make(
        folder,
        "clip.mp4",
        &format!("{sound} {} -c:v libx264 -crf 12 -preset ultrafast -pix_fmt yuv420p -c:a aac", shaky(1.6)),
    )
}

fn size(path: &Path) -> (String, String) {
    // Of a turned clip ffprobe separates the side data, which was not asked for.
    let side = |name| video_field(path, name).trim_end_matches(',').to_owned();
    (side("width"), side("height"))
}

#[test]
fn a_wide_clip_becomes_tall_with_its_sound_and_its_times() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let clip = clip(folder);
    for (name, more, expected) in [
        ("a.mp4", &["--size", "9:16"][..], ("102", "180")),
        ("b.mp4", &["--size", "1:1", "--stabilize"], ("180", "180")),
        ("c.mp4", &["--size", "200x240", "--faces", "off"], ("200", "240")),
    ] {
        succeed(folder, &[&["retarget", "clip.mp4", "-o", name][..], more].concat());
        let made = folder.join(name);
        assert_eq!(size(&made), (expected.0.to_owned(), expected.1.to_owned()), "{name}");
        assert_eq!(times(&made), times(&clip), "{name}: every frame at its own time");
        assert_eq!(packet_sums(&made, "a"), packet_sums(&clip, "a"), "{name}: sound untouched");
    }
}

#[test]
fn a_clip_with_a_rotation_flag_gets_the_shape_that_is_shown() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    clip(folder);
    make(folder, "turned.mp4", &format!("-i {}/clip.mp4 -c copy -metadata:s:v rotate=90", folder.display()));
    // Shown 180×320; a square of it is coded 180×180, a strip of 2:1 is coded as tall as the clip is shown wide.
    for (shape, expected) in [("1:1", ("180", "180")), ("2:1", ("90", "180"))] {
        succeed(folder, &["retarget", "turned.mp4", "-o", "out.mp4", "--size", shape, "--overwrite"]);
        assert_eq!(size(&folder.join("out.mp4")), (expected.0.to_owned(), expected.1.to_owned()), "{shape}");
    }
}

#[test]
fn a_lens_is_taken_out_with_and_without_steadying_and_the_clip_keeps_its_size() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let clip = clip(folder);
    for (name, more) in
        [("a.mp4", &[][..]), ("b.mp4", &["--stabilize"]), ("c.mp4", &["--to", "panini", "--crop", "none"])]
    {
        let lens = ["rectify", "clip.mp4", "-o", name, "--lens", "equidistant", "--fov", "110"];
        succeed(folder, &[&lens[..], more].concat());
        let made = folder.join(name);
        assert_eq!(size(&made), ("320".to_owned(), "180".to_owned()), "{name}");
        assert_eq!(times(&made), times(&clip), "{name}");
        assert_eq!(packet_sums(&made, "a"), packet_sums(&clip, "a"), "{name}");
    }
    let all = "[stage.lens]\nuse = \"lens.undistort\"\ninputs = [\"source\"]\nlens = \"equidistant\"\nfov = 110\n\
               [stage.importance]\nuse = \"video.importance\"\ninputs = [\"source\"]\n";
    fs::write(folder.join("all.toml"), chained(all, "lens = \"lens\"", "\"lens\", \"warp\", \"map\""))
        .expect("a small file");
    succeed(folder, &["run", "all.toml"]);
    assert_eq!(size(&folder.join("out.mp4")), ("180".to_owned(), "180".to_owned()));
}

/// A graph of the stages `first`, tracking, steadying and a square, rendered through `warps`.
fn chained(first: &str, lens: &str, warps: &str) -> String {
    format!(
        "version = 1\n[stage.source]\nuse = \"video.decode\"\npath = \"clip.mp4\"\n{first}\
         [stage.tracks]\nuse = \"video.track\"\ninputs = {{ frames = \"source\"{}{lens} }}\n\
         [stage.motion]\nuse = \"video.motion\"\ninputs = [\"tracks\"]\n\
         [stage.path]\nuse = \"video.smooth\"\ninputs = [\"motion\"]\n\
         [stage.warp]\nuse = \"video.warp\"\ninputs = {{ tracks = \"tracks\", path = \"path\", motion = \"motion\" }}\n\
         [stage.map]\nuse = \"video.retarget\"\nsize = \"1:1\"\n\
         inputs = {{ importance = \"importance\", motion = \"motion\", path = \"path\" }}\n\
         [stage.drawn]\nuse = \"video.render\"\ninputs = {{ frames = \"source\", warps = [{warps}] }}\n\
         [stage.out]\nuse = \"video.encode\"\ninputs = {{ frames = \"drawn\", audio = \"source.audio\" }}\npath = \"out.mp4\"\n",
        if lens.is_empty() { "" } else { ", " }
    )
}

#[test]
fn maps_are_composed_in_one_order_and_know_of_those_before_them() {
    let importance = "[stage.importance]\nuse = \"video.importance\"\ninputs = [\"source\"]\n";
    let undistort =
        "[stage.lens]\nuse = \"lens.undistort\"\ninputs = [\"source\"]\nlens = \"equidistant\"\nfov = 110\n";
    let both = format!("{undistort}{importance}");
    for (first, lens, warps, fault) in [
        (importance, "", "\"warp\", \"map\"", None),
        (&both, "lens = \"lens\"", "\"lens\", \"warp\", \"map\"", None),
        (importance, "", "\"map\", \"warp\"", Some("takes the map `warp` after `map`")),
        (&both, "", "\"lens\", \"warp\"", Some("do not go through the same lens")),
        (&both, "lens = \"lens\"", "\"warp\", \"map\"", Some("do not go through the same lens")),
        (importance, "", "\"map\"", Some("is not planned behind")),
    ] {
        let text = chained(first, lens, warps);
        match (read(source(&text), &[]), fault) {
            (Ok(pipeline), None) => {
                let out = pipeline.graph.stages.iter().position(|s| s.name == "out").expect("a sink");
                assert_eq!(pipeline.graph.resamples(out), 1);
                assert_eq!(Plan::of(&pipeline.graph).passes.len(), 2, "judged while it is tracked");
            }
            (Err(problems), Some(fault)) => {
                let told = problems.render(false, 200);
                assert!(told.contains(fault), "{told}");
            }
            (Ok(_), Some(fault)) => panic!("{warps} should be refused: {fault}"),
            (Err(problems), None) => panic!("{}", problems.render(false, 200)),
        }
    }
}

#[test]
fn the_command_builds_the_shipped_graph() {
    let args = ["plumbline", "retarget", "a.mp4", "--out-dir", "d", "--size", "9:16", "--stabilize"];
    let file = pipeline_of(args).expect("options in order");
    let loaded = read(source(&print(&file)), &[]).unwrap_or_else(|p| panic!("{}", p.render(false, 100)));
    let built = check(file).expect("no faults");
    assert_eq!(loaded, built);
    let read =
        read(shipped("vertical-video").expect("shipped"), &[]).unwrap_or_else(|p| panic!("{}", p.render(false, 100)));
    assert_eq!(draw(&built.graph, GraphFormat::Mermaid), draw(&read.graph, GraphFormat::Mermaid));
    for stage in read.graph.stages.iter().filter(|s| !matches!(s.name.as_str(), "out" | "source")) {
        let ours = built.graph.stage(&stage.name).expect("the same stages");
        assert_eq!(ours.settings.to_json(), stage.settings.to_json(), "{}", stage.name);
    }
}

#[test]
fn options_of_the_other_kind_of_input_are_refused_with_the_reason() {
    for (options, message) in [
        (&["retarget", "a.mp4", "b.jpg", "--out-dir", "d", "--size", "1:1"][..], "some inputs are clips"),
        (&["retarget", "a.mp4", "-o", "b.mp4", "--size", "1:1", "--grid"], "--grid is for pictures"),
        (&["retarget", "a.mp4", "-o", "b.mp4", "--size", "1:1", "--faces", "f.json"], "--faces FILE is for pictures"),
        (&["retarget", "a.jpg", "-o", "b.jpg", "--size", "1:1", "--stabilize"], "--stabilize is for clips"),
        (&["rectify", "a.mp4", "-o", "b.mp4", "--rectangle"], "--rectangle is for stitched pictures"),
        (&["rectify", "a.mp4", "-o", "b.mp4", "--crop", "none", "--border", "fill"], "neither transparent nor filled"),
        (&["rectify", "a.mp4", "-o", "b.mp4", "--save-lines", "l.json"], "--save-lines"),
        (&["retarget", "a.mp4", "b.mp4", "-o", "c.mp4", "--size", "1:1"], "there are 2 clips"),
    ] {
        let refused = pipeline_of(["plumbline"].iter().chain(options)).expect_err(message);
        assert!(refused.contains(message), "{refused}");
    }
    let Some(folder) = workshop() else { return };
    clip(folder.path());
    let lens = plumbline_in(folder.path(), &["rectify", "clip.mp4", "-o", "b.mp4", "--lens", "equidistant"]);
    assert_eq!(lens.status.code(), Some(2), "{}", err(&lens));
    assert!(err(&lens).contains("needs a field of view"), "{}", err(&lens));
}
