//! A long clip as a graph of tasks.

use std::path::Path;
use std::process::Output;

use crate::support::clips::{make, packet_sums, picture_sums, shaky, times, workshop};
use crate::support::program::{err, names, out, plumbline_in, succeed};

/// A folder with a clip of two analysis windows, sound, and a pipeline that stabilizes it without loss.
fn job(folder: &Path) {
    let sound = "-f lavfi -i sine=frequency=440:duration=26";
    make(folder, "clip.mp4", &format!("{sound} {} -s 160x90 -c:v libx264 -g 50 -bf 2 -c:a aac", shaky(26.0)));
    let args = ["stabilize", "clip.mp4", "-o", "out/clip.mkv", "--codec", "ffv1", "--export-motion", "motion.json"];
    let text = out(&succeed(folder, &[&args[..], &["--print-pipeline"]].concat()));
    assert!(text.contains("cameras = true"), "{text}");
    std::fs::write(folder.join("job.toml"), text.replace("cameras = true", "cameras = false")).expect("written");
}

fn ids(folder: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(folder.join("plan.json")).expect("a plan");
    let plan: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let id = |task: &serde_json::Value| task["id"].as_str().expect("a name").to_owned();
    plan["tasks"].as_array().expect("tasks").iter().map(id).collect()
}

fn run_task(folder: &Path, id: &str) -> Output {
    plumbline_in(folder, &["task", "run", "--plan", "plan.json", "--task", id, "--progress", "none"])
}

#[test]
fn a_clip_in_parts_is_the_clip_at_once() {
    let Some(whole) = workshop() else { return };
    let whole = whole.path();
    job(whole);
    let parts = tempfile::tempdir().expect("a folder");
    let parts = parts.path();
    for name in ["clip.mp4", "job.toml"] {
        std::fs::copy(whole.join(name), parts.join(name)).expect("copied");
    }
    std::fs::create_dir(whole.join("out")).expect("a folder");
    succeed(whole, &["run", "job.toml"]);
    succeed(parts, &["plan", "job.toml", "--json", "--split", "9", "-o", "plan.json"]);
    let ids = ids(parts);
    let stem = ids.last().expect("tasks").clone();
    let named = |name: &str| format!("{stem}.{name}");
    let expected = ["tracks-0", "tracks-1", "motion", "plan", "render-0", "render-1", "render-2"].map(named);
    assert_eq!(ids[..7], expected);

    // In the wrong order nothing is lost: what is missing may come.
    let early = run_task(parts, &expected[4]);
    assert!(early.status.code() == Some(75), "{:?} {}", early.status, err(&early));
    for id in &ids[..6] {
        let task = run_task(parts, id);
        assert!(task.status.success(), "{id}: {}", err(&task));
    }
    let early = run_task(parts, &stem);
    assert!(early.status.code() == Some(75), "{:?} {}", early.status, err(&early));
    assert!(!parts.join("out/clip.mkv").exists() && !parts.join("motion.json").exists());
    let again = run_task(parts, &expected[5]);
    assert!(err(&again).contains("up to date"), "{}", err(&again));
    for id in &ids[6..] {
        let task = run_task(parts, id);
        assert!(task.status.success(), "{id}: {}", err(&task));
    }

    let [a, b] = [whole, parts].map(|folder| std::fs::read(folder.join("motion.json")).expect("a motion file"));
    assert!(a == b, "the motion file is another");
    let [a, b] = [whole, parts].map(|folder| folder.join("out/clip.mkv"));
    assert_eq!(picture_sums(&a, "yuv420p"), picture_sums(&b, "yuv420p"));
    assert_eq!((times(&a), packet_sums(&a, "a")), (times(&b), packet_sums(&b, "a")));

    // Parts are gone, and what was made of them counts as done, for each task and for the pipeline.
    assert_eq!(names(&parts.join(".plumbline")), ["done.jsonl", "logs"]);
    for id in [&ids[0], &ids[2], &ids[5], &stem] {
        let task = run_task(parts, id);
        assert!(task.status.success() && err(&task).contains("up to date"), "{id}: {}", err(&task));
    }
    assert_eq!(names(&parts.join(".plumbline")), ["done.jsonl", "logs"]);
    let all = succeed(parts, &["run", "job.toml", "--existing", "skip"]);
    assert!(err(&all).contains("up to date"), "{}", err(&all));
}

#[test]
fn short_clips_and_other_work_stay_one_task() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    make(folder, "clip.mp4", &format!("{} -c:v libx264", shaky(4.0)));
    let plan = |more: &[&str], seconds: &str| {
        let args = [&["stabilize", "clip.mp4", "-o", "out.mp4", "--print-pipeline"], more].concat();
        std::fs::write(folder.join("job.toml"), out(&succeed(folder, &args))).expect("written");
        let planned = succeed(folder, &["plan", "job.toml", "--json", "--split", seconds, "-o", "plan.json"]);
        (ids(folder).len(), err(&planned))
    };
    assert_eq!(plan(&[], "3").0, 1);
    assert_eq!(plan(&[], "1").0, 1 + 1 + 4 + 4 + 1 + 4 + 1);
    assert_eq!(plan(&["--mode", "mesh"], "1").0, 1 + 1 + 1 + 4 + 1);
    // What is in the place of the result is refused before any part is made.
    std::fs::write(folder.join("out.mp4"), "another").expect("written");
    let task = run_task(folder, &ids(folder)[0]);
    assert!(task.status.code() == Some(73) && err(&task).contains("not made by a run"), "{}", err(&task));
    assert!(!folder.join(".plumbline/parts").exists());
    let (tasks, note) = plan(&["--border", "fill"], "1");
    assert!(tasks == 1 && note.contains("borders are filled from neighboring frames"), "{note}");
    let (tasks, note) = plan(&["--start", "1"], "1");
    assert!(tasks == 1 && note.contains("only a span of it is read"), "{note}");
    let alone = plumbline_in(folder, &["run", "job.toml", "--split", "60"]);
    assert!(alone.status.code() == Some(2) && err(&alone).contains("--engine dask"), "{}", err(&alone));
    let wrong = plumbline_in(folder, &["plan", "job.toml", "--json", "--split", "0"]);
    assert!(wrong.status.code() == Some(2) && err(&wrong).contains("1 second or more"), "{}", err(&wrong));
}
