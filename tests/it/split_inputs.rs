//! Clips that are unusual to split: the result is that of the run at once, or there is none and a clear error.

use std::path::Path;
use std::process::{Command, Output};

use crate::support::clips::{make, picture_sums, shaky, times, workshop};
use crate::support::program::{err, out, plumbline_in, succeed};

/// A pipeline that stabilizes `clip` to `RESULT` without loss.
fn job(folder: &Path, clip: &str, result: &str) {
    let args = ["stabilize", clip, "-o", result, "--codec", "ffv1", "--print-pipeline"];
    let text = out(&succeed(folder, &args)).replace("cameras = true", "cameras = false");
    std::fs::write(folder.join("job.toml"), text).expect("written");
}

/// The clip at once, as `whole.mkv`.
fn at_once(folder: &Path, clip: &str) -> Output {
    job(folder, clip, "whole.mkv");
    plumbline_in(folder, &["run", "job.toml"])
}

/// The tasks of the clip in parts of a second, as `parts.mkv`; the first one that fails.
fn in_parts(folder: &Path, clip: &str) -> (usize, Output) {
    job(folder, clip, "parts.mkv");
    let planned = plumbline_in(folder, &["plan", "job.toml", "--json", "--split", "1", "-o", "plan.json"]);
    if !planned.status.success() {
        return (0, planned);
    }
    let text = std::fs::read_to_string(folder.join("plan.json")).expect("a plan");
    let plan: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let ids: Vec<&str> = plan["tasks"].as_array().expect("tasks").iter().filter_map(|t| t["id"].as_str()).collect();
    let mut last = planned;
    for id in &ids {
        last = plumbline_in(folder, &["task", "run", "--plan", "plan.json", "--task", id, "--progress", "none"]);
        if !matches!(last.status.code(), Some(0 | 3)) {
            break;
        }
    }
    (ids.len(), last)
}

fn assert_same(folder: &Path) {
    let [a, b] = ["whole.mkv", "parts.mkv"].map(|name| folder.join(name));
    assert_eq!(picture_sums(&a, "yuv420p"), picture_sums(&b, "yuv420p"));
    assert_eq!(times(&a), times(&b));
    assert!(!folder.join(".plumbline/parts").exists());
}

#[test]
fn a_clip_of_variable_frame_rate_is_split_by_its_times_and_joined_by_make() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let uneven = "-s 160x90 -filter:v select='gt(mod(n,7),2)+lt(mod(n,11),3)' -fps_mode vfr -c:v libx264 -g 12 -bf 2";
    let args = format!("{} -c:v ffv1 -s 160x90", shaky(4.0));
    make(folder, "even.mkv", &args);
    make(folder, "clip.mkv", &format!("-i {} {uneven}", folder.join("even.mkv").display()));
    let distances: Vec<i64> =
        times(&folder.join("clip.mkv")).windows(2).map(|pair| ((pair[1] - pair[0]) * 1e3).round() as i64).collect();
    assert!(distances.iter().max() > distances.iter().min(), "{distances:?}");
    assert!(at_once(folder, "clip.mkv").status.success());
    job(folder, "clip.mkv", "parts.mkv");
    succeed(folder, &["plan", "job.toml", "--json", "--split", "1", "-o", "plan.json"]);
    let text = out(&succeed(folder, &["plan", "export", "plan.json", "--format", "make"]));
    std::fs::write(folder.join("Makefile"), text).expect("written");
    let program = Path::new(env!("CARGO_BIN_EXE_plumbline")).parent().expect("a folder").display().to_string();
    let path = format!("{program}:{}", std::env::var("PATH").expect("a path"));
    let made = Command::new("make").args(["-j", "2"]).current_dir(folder).env("PATH", path).output();
    let made = made.expect("make runs");
    assert!(made.status.success(), "{}", err(&made));
    assert_same(folder);
}

#[test]
fn a_clip_of_one_frame_is_split_into_one_part() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    make(folder, "clip.mkv", "-f lavfi -i testsrc2=size=160x90:rate=1/8:duration=8 -c:v libx264 -pix_fmt yuv420p");
    let whole = at_once(folder, "clip.mkv");
    assert!(whole.status.success(), "{}", err(&whole));
    let (_, parts) = in_parts(folder, "clip.mkv");
    assert!(parts.status.success(), "{}", err(&parts));
    assert_same(folder);
}

#[test]
fn a_clip_that_was_cut_off_gives_what_it_has_or_a_clear_error() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    make(folder, "full.mkv", &format!("{} -s 160x90 -c:v libx264 -g 12 -bf 2", shaky(4.0)));
    make(folder, "full.mp4", &format!("{} -s 160x90 -c:v libx264 -g 12 -bf 2 -movflags +faststart", shaky(4.0)));
    for name in ["full.mkv", "full.mp4"] {
        for percent in [30, 62, 97] {
            let bytes = std::fs::read(folder.join(name)).expect("a clip");
            let clip = name.replace("full", "clip");
            std::fs::write(folder.join(&clip), &bytes[..bytes.len() * percent / 100]).expect("written");
            let whole = at_once(folder, &clip);
            let (count, parts) = in_parts(folder, &clip);
            let what = format!("{name} {percent} %, {count} tasks: {:?} and {:?}", whole.status, parts.status);
            eprintln!("{what}: {}", err(&parts));
            if folder.join("parts.mkv").exists() {
                assert_eq!(whole.status.code(), parts.status.code(), "{what}: {}", err(&parts));
                assert_same(folder);
            } else {
                assert!(
                    matches!(parts.status.code(), Some(4 | 65)) && err(&parts).contains(&clip),
                    "{what}: {}",
                    err(&parts)
                );
            }
            for left in ["whole.mkv", "parts.mkv"] {
                let _ = std::fs::remove_file(folder.join(left));
            }
            let _ = std::fs::remove_dir_all(folder.join(".plumbline"));
        }
    }
}
