//! What `plan` expects of tasks: how they are, how long they take, and what past runs say of it.

use std::path::Path;

use crate::support::clips::{make, shaky, workshop};
use crate::support::program::{command, err, out, plumbline_in, succeed};

/// A folder with three small photos and a pipeline for them.
fn photos() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::create_dir(folder.path().join("in")).expect("a folder");
    for (k, name) in ["a", "b", "c"].into_iter().enumerate() {
        let picture = image::RgbImage::from_fn(640, 480, |x, y| image::Rgb([x as u8, y as u8, 40 * k as u8]));
        picture.save(folder.path().join(format!("in/{name}.png"))).expect("written");
    }
    let args = ["retarget", "in", "--size", "320x320", "--out-dir", "out", "--print-pipeline"];
    std::fs::write(folder.path().join("job.toml"), out(&succeed(folder.path(), &args))).expect("written");
    folder
}

fn plan(folder: &Path, more: &[&str]) -> String {
    out(&succeed(folder, &[&["plan", "job.toml"], more].concat()))
}

#[test]
fn a_plan_prints_what_is_done_what_is_left_and_how_long_it_takes() {
    let folder = photos();
    let folder = folder.path();
    let text = plan(folder, &["--workers", "1,3"]);
    assert!(text.contains("\n3 tasks: 3 to run\n"), "{text}");
    assert!(text.contains(" on 1 worker, ") && text.contains(" on 3 workers; "), "{text}");
    assert!(text.contains("times are those of the shipped model"), "{text}");
    succeed(folder, &["plan", "job.toml", "--json", "-o", "plan.json"]);
    succeed(folder, &["task", "run", "--plan", "plan.json", "--task", "in_a.png"]);
    std::fs::write(folder.join("out/b.png"), "another").expect("written");
    let text = plan(folder, &[]);
    assert!(text.contains("\n3 tasks: 1 done, 1 to run, 1 blocked\n"), "{text}");
    assert!(text.contains("blocked: `out/b.png` exists, not made by a run that is on record"), "{text}");
    assert!(text.lines().any(|line| line.starts_with("in_a.png") && line.ends_with("  done")), "{text}");
    for (more, fault) in [
        (&["--workers", "0"][..], "0 is not in 1..=100000"),
        (&["--workers", "2", "--json"][..], "cannot be used with"),
    ] {
        let wrong = plumbline_in(folder, &[&["plan", "job.toml"], more].concat());
        assert!(wrong.status.code() == Some(2) && err(&wrong).contains(fault), "{}", err(&wrong));
    }
    // Standard output is of no plan, and of no table.
    let piped = out(&succeed(folder, &["retarget", "in/a.png", "-o", "-", "--size", "99x99", "--print-pipeline"]));
    std::fs::write(folder.join("piped.toml"), piped).expect("written");
    let text = out(&succeed(folder, &["plan", "piped.toml"]));
    assert!(text.starts_with("pass 1 of 1") && !text.contains("task"), "{text}");
}

#[test]
fn past_runs_change_what_is_printed_and_not_the_plan() {
    let folder = photos();
    let folder = folder.path();
    let with_cache = |args: &[&str]| {
        let done = command(folder, args).env("PLUMBLINE_CACHE", folder.join("cache")).output().expect("it runs");
        assert!(done.status.success(), "{args:?}: {}", err(&done));
        out(&done)
    };
    let json = with_cache(&["plan", "job.toml", "--json"]);
    let parsed: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    let estimate = &parsed["tasks"][0]["estimate"];
    assert!(estimate["seconds"].as_f64() > Some(0.01), "{estimate}");
    assert_eq!(estimate["work"]["megapixels"], 0.3072);
    assert!(estimate["stages"]["photo.retarget"].as_f64() > Some(0.0), "{estimate}");
    with_cache(&["run", "job.toml"]);
    assert_eq!(with_cache(&["plan", "job.toml", "--json"]), json, "of the pipeline and its inputs alone");
    std::fs::remove_dir_all(folder.join("out")).expect("removed");
    let text = with_cache(&["plan", "job.toml"]);
    assert!(text.contains("times are fitted to ") && text.contains("3 tasks: 3 to run"), "{text}");
    // A damaged file of times costs nothing but the fit.
    std::fs::write(folder.join("cache/times.jsonl"), [0xFF; 5000]).expect("written");
    assert!(with_cache(&["plan", "job.toml"]).contains("times are those of the shipped model"));
    with_cache(&["cache", "clear"]);
    assert!(!folder.join("cache/times.jsonl").exists());
}

#[test]
fn tracks_in_the_cache_make_a_clip_cheaper_and_parts_wait_for_one_another() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    make(folder, "clip.mp4", &format!("{} -c:v libx264 -preset ultrafast", shaky(3.0)));
    let job = |result: &str| {
        let args = ["stabilize", "clip.mp4", "-o", result, "--print-pipeline"];
        let text = out(&succeed(folder, &args)).replace("cameras = true", "cameras = false");
        std::fs::write(folder.join("job.toml"), text).expect("written");
    };
    let with_cache = |args: &[&str]| {
        let done = command(folder, args).env("PLUMBLINE_CACHE", folder.join("cache")).output().expect("it runs");
        assert!(done.status.success(), "{args:?}: {}", err(&done));
        out(&done)
    };
    job("a.mp4");
    assert!(with_cache(&["plan", "job.toml"]).contains("1 task: 1 to run\n"));
    // Notes of a file that was changed just now would not show the next change.
    std::thread::park_timeout(std::time::Duration::from_millis(2100));
    with_cache(&["run", "job.toml", "--existing", "skip"]);
    assert!(with_cache(&["plan", "job.toml"]).contains("1 task: 1 done\n"));
    job("b.mp4");
    let text = with_cache(&["plan", "job.toml"]);
    assert!(text.contains("run; tracks cached\n") && text.contains("1 task: 1 to run from the cache\n"), "{text}");
    let text = plan(folder, &["--split", "1", "-v"]);
    assert!(text.contains("7 tasks: 1 to run, 6 waiting\n"), "{text}");
    assert!(text.contains("blocked: waits for stabilize.tracks-0\n"), "{text}");
}
