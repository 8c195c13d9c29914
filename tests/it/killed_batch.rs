//! A batch that is killed again and again, and run again each time, ends as if nothing had happened.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::kills::signal;
use crate::support::clips::{make, workshop};
use crate::support::jobs::contents;
use crate::support::program::command;

/// Clips of the batch; `PLUMBLINE_CLIPS` says how many in long runs.
fn clips() -> usize {
    std::env::var("PLUMBLINE_CLIPS").ok().and_then(|text| text.parse().ok()).unwrap_or(8)
}

/// The program on the batch, with events on standard error and a cache of its own.
fn batch(folder: &Path, temporary: &Path) -> Command {
    let args = ["stabilize", "in", "--out-dir", "out", "--preset", "ultrafast", "--jobs", "2", "--progress", "json"];
    let mut command = command(folder, &args);
    command.env("TMPDIR", temporary).env("PLUMBLINE_CACHE", folder.join("cache")).stdout(Stdio::null());
    command
}

/// Starts the batch, whose events go to `log`.
fn started(folder: &Path, temporary: &Path, log: &Path) -> Child {
    let log = File::create(log).expect("a log");
    batch(folder, temporary).stderr(log).spawn().expect("the program starts")
}

/// Tasks by the events of a log; the last line of a killed run may be torn.
fn tasks(log: &Path, event: &str) -> BTreeSet<String> {
    let text = String::from_utf8_lossy(&std::fs::read(log).expect("a log")).into_owned();
    let events = text.lines().filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok());
    events.filter(|e| e["ev"] == event).filter_map(|e| e["task"].as_str().map(str::to_owned)).collect()
}

#[test]
fn a_batch_killed_at_random_moments_gives_each_result_once_and_leaves_nothing() {
    let Some(workshop) = workshop() else { return };
    let (count, whole) = (clips(), workshop.path().join("whole"));
    std::fs::create_dir_all(whole.join("in")).expect("a folder");
    for clip in 0..count {
        let source = format!("-f lavfi -i testsrc2=size=64x48:rate=25:duration=0.8 -vf hue=h={clip}*360/{count}");
        make(&whole.join("in"), &format!("{clip:02}.mkv"), &format!("{source} -c:v ffv1 -pix_fmt yuv420p"));
    }
    let (killed, temporary) = (workshop.path().join("killed"), workshop.path().join("tmp"));
    for folder in [&killed, &temporary] {
        std::fs::create_dir(folder).expect("a folder");
    }
    for (name, bytes) in contents(&whole) {
        std::fs::create_dir_all(killed.join("in")).expect("a folder");
        std::fs::write(killed.join(name), bytes).expect("written");
    }
    let began = Instant::now();
    let log = |run: u32| workshop.path().join(format!("{run}.log"));
    assert!(started(&whole, &temporary, &log(0)).wait().expect("it ends").success());
    let time = began.elapsed();
    let results = |folder: &Path| -> BTreeMap<String, Vec<u8>> { contents(&folder.join("out")) };
    let expected = results(&whole);
    assert_eq!(expected.len(), count);

    let kills: u32 = if count < 60 { 3 } else { 10 };
    let mut random = fastrand::Rng::with_seed(0xba7c4);
    let mut done: BTreeSet<String> = BTreeSet::new();
    for run in 1..=kills + 1 {
        let mut child = started(&killed, &temporary, &log(run));
        if run <= kills {
            // A run begins with what is left, so that the kills are spread over the whole of the batch.
            let delay = time.mul_f64(3.0 * random.f64() / f64::from(kills + 1));
            std::thread::park_timeout(delay.max(Duration::from_millis(1)));
            signal(&child, "KILL");
        }
        let status = child.wait().expect("it ends");
        let text = String::from_utf8_lossy(&std::fs::read(log(run)).unwrap_or_default()).into_owned();
        assert!(run <= kills || status.success(), "{status}: {text}");
        // Workers of the run before, which end when they see that they are alone, are waited for.
        let failed = tasks(&log(run), "task.fail");
        assert!(failed.is_empty(), "run {run}: {failed:?} failed: {text}");
        // What was done is skipped, and not even begun.
        let again: Vec<_> = tasks(&log(run), "task.start").intersection(&done).cloned().collect();
        assert!(again.is_empty(), "run {run}: {again:?} were done twice: {text}");
        done.extend(tasks(&log(run), "task.done"));
        for (name, bytes) in results(&killed).iter().filter(|(name, _)| !name.contains(".partial-")) {
            assert!(expected.get(name) == Some(bytes), "run {run}: {name} is not whole");
        }
        eprintln!("run {run}: {} of {count} done after {:?}", done.len(), began.elapsed());
    }
    assert!(results(&killed) == expected, "left: {:?}", results(&killed).keys());
    let left = contents(&temporary);
    assert!(left.is_empty(), "{:?}", left.keys());
}
