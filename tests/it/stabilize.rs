//! The main job as a user meets it: the built program on small shaky clips.

use std::path::Path;

use plumbline::num::math::Point2;
use plumbline::video::motion::ClipMotion;

use crate::support::clips::{filtered_sums, make, packet_sums, picture_sums, shaky, times, video_field, workshop};
use crate::support::program::{err, names, out, plumbline_fed, plumbline_in, succeed};

/// `clip.mp4`: 40 shaky frames with sound.
fn clip(folder: &Path) -> std::path::PathBuf {
    let sound = "-f lavfi -i sine=frequency=440:sample_rate=48000";
    make(
        folder,
        "clip.mp4",
        &format!("{sound} {} -c:v libx264 -crf 12 -preset ultrafast -pix_fmt yuv420p -c:a aac", shaky(1.6)),
    )
}

fn motion(folder: &Path, name: &str) -> ClipMotion {
    ClipMotion::from_json(&std::fs::read(folder.join(name)).expect("a motion file")).expect("its own format")
}

/// RMS of the second difference of the picture's center along the path of the clip, px.
fn shake(motion: &ClipMotion) -> f64 {
    let center = Point2::new(f64::from(motion.width) / 2.0, f64::from(motion.height) / 2.0);
    let steps: Vec<_> = motion.frames[1..].iter().map(|f| f.similarity.apply(center) - center).collect();
    let jerks: Vec<f64> = steps.windows(2).map(|w| (w[1] - w[0]).norm_squared()).collect();
    (jerks.iter().sum::<f64>() / jerks.len() as f64).sqrt()
}

#[test]
fn a_shaky_clip_comes_out_steady_whole_and_in_step() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let clip = clip(folder);
    let ran = succeed(folder, &["stabilize", "clip.mp4", "-o", "steady.mp4", "--export-motion", "before.json"]);
    let steady = folder.join("steady.mp4");
    assert_eq!(times(&steady), times(&clip), "every frame at its own time");
    assert_eq!(times(&steady).len(), 40);
    assert_eq!(packet_sums(&steady, "a"), packet_sums(&clip, "a"), "sound untouched");
    assert_eq!((video_field(&steady, "width"), video_field(&steady, "height")), ("320".into(), "180".into()));
    assert_eq!(out(&ran), "before.json\nsteady.mp4\n", "results alone on standard output");
    for told in ["wrote     before.json, steady.mp4", "frames    40, 320×180", "crop ", "frames 0 to 39: "] {
        assert!(err(&ran).contains(told), "{told}: {}", err(&ran));
    }
    succeed(folder, &["stabilize", "steady.mp4", "-o", "again.mp4", "--export-motion", "after.json"]);
    let (before, after) = (shake(&motion(folder, "before.json")), shake(&motion(folder, "after.json")));
    assert!(before > 5.0 && after < 0.2 * before, "shake {before:.2} px before, {after:.2} px after");
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    clip(folder);
    for threads in ["1", "2", "3"] {
        let (video, json) = (format!("{threads}.mkv"), format!("{threads}.json"));
        let args =
            ["stabilize", "clip.mp4", "-o", &video, "--export-motion", &json, "--codec", "ffv1", "--mode", "mesh"];
        succeed(folder, &[&args[..], &["--threads", threads, "--end", "1"]].concat());
    }
    let read = |name: &str| std::fs::read(folder.join(name)).expect("a motion file");
    let frames = |name: &str| picture_sums(&folder.join(name), "yuv420p");
    assert_eq!(frames("1.mkv").len(), 25);
    for other in ["2", "3"] {
        assert_eq!(read("1.json"), read(&format!("{other}.json")), "motion, byte for byte");
        assert_eq!(frames("1.mkv"), frames(&format!("{other}.mkv")), "pictures, bit for bit");
    }
}

#[test]
fn the_printed_pipeline_does_the_same_job() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    clip(folder);
    let args = ["stabilize", "clip.mp4", "-o", "a.mkv", "--codec", "ffv1", "--end", "0.6", "--smoothness", "0.7"];
    succeed(folder, &args);
    let printed = succeed(folder, &[&args[..], &["--print-pipeline"]].concat());
    std::fs::write(folder.join("job.toml"), &printed.stdout).expect("a small file");
    succeed(folder, &["run", "job.toml", "--set", "out.path=b.mkv"]);
    let frames = |name: &str| picture_sums(&folder.join(name), "yuv420p");
    assert_eq!(frames("a.mkv").len(), 15);
    assert_eq!(frames("a.mkv"), frames("b.mkv"));
}

#[test]
fn compare_shows_the_original_on_the_left_and_the_result_on_the_right() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let clip = clip(folder);
    let args = ["stabilize", "clip.mp4", "-o", "steady.mkv", "--compare", "--codec", "ffv1"];
    let ran = succeed(folder, &args);
    assert_eq!(out(&ran), "steady.mkv\nsteady.compare.mkv\n");
    assert_eq!(err(&ran).matches("render (2 of 2)").count(), err(&ran).matches("render").count(), "rendered once");
    let (steady, both) = (folder.join("steady.mkv"), folder.join("steady.compare.mkv"));
    assert_eq!((video_field(&both, "width"), video_field(&both, "height")), ("640".into(), "180".into()));
    assert_eq!(filtered_sums(&both, "crop=320:180:0:0", "yuv420p"), picture_sums(&clip, "yuv420p"));
    assert_eq!(filtered_sums(&both, "crop=320:180:320:0", "yuv420p"), picture_sums(&steady, "yuv420p"));
    assert_eq!(packet_sums(&both, "a"), packet_sums(&clip, "a"));
    assert_eq!(times(&both), times(&steady));
}

#[test]
fn one_broken_clip_of_three_costs_only_itself() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let clip = clip(folder);
    std::fs::create_dir(folder.join("in")).expect("a folder");
    for name in ["in/a.mp4", "in/c.mp4"] {
        std::fs::copy(&clip, folder.join(name)).expect("a copy");
    }
    std::fs::write(folder.join("in/b.mp4"), [7; 999]).expect("a small file");
    let ran = plumbline_in(folder, &["stabilize", "in", "--out-dir", "out", "--end", "0.4"]);
    assert_eq!(ran.status.code(), Some(3), "{}", err(&ran));
    assert_eq!(names(&folder.join("out")), ["a.mp4", "c.mp4"]);
    assert!(err(&ran).contains("error: in/b.mp4: ") && err(&ran).ends_with("\n1 of 3 items failed\n"), "{}", err(&ran));
    assert_eq!(times(&folder.join("out/c.mp4")).len(), 10);
}

#[test]
fn a_clip_may_come_from_standard_input_and_go_to_standard_output() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let clip = clip(folder);
    let bytes = std::fs::read(&clip).expect("a clip");
    let args = ["stabilize", "-", "-o", "-", "--codec", "ffv1", "--end", "0.6"];
    let piped = plumbline_fed(folder, &args, &bytes);
    assert_eq!(piped.status.code(), Some(0), "{}", err(&piped));
    std::fs::write(folder.join("piped.mkv"), &piped.stdout).expect("a file");
    succeed(folder, &["stabilize", "clip.mp4", "-o", "plain.mkv", "--codec", "ffv1", "--end", "0.6"]);
    let (piped, plain) = (folder.join("piped.mkv"), folder.join("plain.mkv"));
    assert_eq!(picture_sums(&piped, "yuv420p"), picture_sums(&plain, "yuv420p"));
    assert_eq!(packet_sums(&piped, "a"), packet_sums(&plain, "a"));
    assert_eq!(times(&piped).len(), 15);
}

#[test]
fn image_sequences_go_in_and_out() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    std::fs::create_dir(folder.join("in")).expect("a folder");
    make(folder, "in/%03d.png", &format!("{} -start_number 7", shaky(0.4)));
    succeed(folder, &["stabilize", "in/%03d.png", "-o", "out/%04d.png"]);
    assert_eq!(names(&folder.join("out")).len(), 10);
    succeed(folder, &["stabilize", "in/%03d.png", "-o", "clip.mkv"]);
    assert_eq!(times(&folder.join("clip.mkv")).len(), 10);
}

#[test]
fn a_span_of_the_clip_is_taken_from_start_to_end() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    clip(folder);
    succeed(folder, &["stabilize", "clip.mp4", "-o", "part.mp4", "--start", "0.4", "--end", "1"]);
    let times = times(&folder.join("part.mp4"));
    assert_eq!(times.len(), 15);
    assert!(times[0].abs() < 1e-3 && (times[14] - 0.56).abs() < 1e-3, "{times:?}");
    let late = plumbline_in(folder, &["stabilize", "clip.mp4", "-o", "late.mp4", "--start", "9"]);
    assert_eq!(late.status.code(), Some(2), "{}", err(&late));
    assert!(err(&late).contains("from 9 s to the end is empty or lies outside the clip"), "{}", err(&late));
}

#[test]
fn a_mask_hides_what_is_white() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    clip(folder);
    for (name, drawing) in [
        ("none.png", "color=black:s=320x180"),
        ("half.png", "color=black:s=320x180,drawbox=w=160:h=180:color=white:t=fill"),
        ("all.png", "color=white:s=320x180"),
    ] {
        make(folder, name, &format!("-f lavfi -i {drawing} -frames:v 1"));
    }
    let run = |mask: &[&str], name: &str| {
        let args = ["stabilize", "clip.mp4", "-o", "x.mp4", "--overwrite", "--end", "0.4", "--export-motion", name];
        plumbline_in(folder, &[&args[..], mask].concat())
    };
    assert_eq!(run(&[], "without.json").status.code(), Some(0));
    assert_eq!(run(&["--mask", "none.png"], "none.json").status.code(), Some(0));
    assert_eq!(run(&["--mask", "half.png"], "half.json").status.code(), Some(0));
    let read = |name: &str| std::fs::read(folder.join(name)).expect("a motion file");
    assert_eq!(read("without.json"), read("none.json"), "black hides nothing");
    let coverage = |name: &str| motion(folder, name).frames[5].coverage;
    assert!(coverage("half.json") < 0.6 * coverage("none.json"), "{} {}", coverage("half.json"), coverage("none.json"));
    let all = run(&["--mask", "all.png"], "all.json");
    assert_eq!(all.status.code(), Some(65));
    assert!(err(&all).contains("the mask covers 100.0 % of the picture (expected at most 98 %)"), "{}", err(&all));
}

#[test]
fn every_choice_that_help_offers_runs() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    clip(folder);
    let choices: [(&str, &[&str]); 7] = [
        ("--mode", &["auto", "mesh", "homography", "similarity"]),
        ("--path", &["optimal", "gaussian", "linear", "parabolic", "tripod", "orbit", "dolly"]),
        ("--zoom", &["fixed", "adaptive", "none"]),
        ("--border", &["crop", "mirror", "replicate", "black", "fill"]),
        ("--rolling-shutter", &["auto", "off", "0.02"]),
        ("--interpolation", &["bicubic", "lanczos3"]),
        ("--codec", &["h264", "h265", "prores", "ffv1"]),
    ];
    for (option, values) in choices {
        for value in values {
            let mut args = vec!["stabilize", "clip.mp4", "-o", "x.mkv", "--overwrite", "--end", "0.24", option, value];
            if *value == "none" {
                args.extend(["--border", "mirror"]);
            }
            succeed(folder, &args);
            assert_eq!(times(&folder.join("x.mkv")).len(), 6, "{option} {value}");
        }
    }
    let stuck = plumbline_in(folder, &["stabilize", "clip.mp4", "-o", "y.mkv", "--zoom", "none"]);
    assert_eq!(stuck.status.code(), Some(2));
    assert!(err(&stuck).contains("leaves no room to move the picture"), "{}", err(&stuck));
}

#[test]
fn probe_reports_the_contents_of_a_clip_to_programs() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    clip(folder);
    let told: serde_json::Value =
        serde_json::from_slice(&succeed(folder, &["probe", "clip.mp4", "--json"]).stdout).expect("JSON");
    assert_eq!((&told["streams"][0]["width"], &told["streams"][0]["height"]), (&320.into(), &180.into()), "{told:#}");
    assert_eq!(told["streams"].as_array().map(Vec::len), Some(2), "{told:#}");
    let plan = out(&succeed(folder, &["plan", "stabilize", "--set", "batch.foreach=clip.mp4"]));
    assert!(plan.contains("peak memory: about "), "{plan}");
}
