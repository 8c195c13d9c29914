//! Items of a batch are done by worker processes: a crash is one item's failure, and no worker outlives its run.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, ChildStderr, Command, Stdio};

use crate::support::clips::{make, picture_sums, shaky, workshop};
use crate::support::program::{command, err, names, succeed};

/// Two short clips and, between them by name, one that takes seconds.
fn clips(folder: &Path) {
    std::fs::create_dir(folder.join("in")).expect("a folder");
    let folder = folder.join("in");
    make(&folder, "a.mkv", &format!("{} -c:v ffv1", shaky(0.4)));
    std::fs::copy(folder.join("a.mkv"), folder.join("c.mkv")).expect("a copy");
    make(
        &folder,
        "b.mkv",
        &format!("{} -vf scale=960:540 -c:v libx264 -preset ultrafast -pix_fmt yuv420p", shaky(2.4)),
    );
}

/// A batch over them, once it works on `b.mkv`, and what it will tell from there.
fn at_work(folder: &Path) -> (Child, BufReader<ChildStderr>) {
    let args = ["stabilize", "in", "--out-dir", "out", "--preset", "slow", "--progress", "json", "--threads", "1"];
    let mut child = command(folder, &args).stderr(Stdio::piped()).spawn().expect("the program starts");
    let mut told = BufReader::new(child.stderr.take().expect("piped"));
    let mut line = String::new();
    while !(line.contains("task.progress") && line.contains("b.mkv") && line.contains("\"pass\":2")) {
        line.clear();
        assert!(told.read_line(&mut line).is_ok_and(|n| n > 0), "it ended before the long item");
    }
    (child, told)
}

/// Processes that `parent` started and that live.
fn children(parent: u32) -> Vec<u32> {
    let listed = std::fs::read_dir(format!("/proc/{parent}/task")).into_iter().flatten().flatten();
    let of_thread = |task: std::fs::DirEntry| std::fs::read_to_string(task.path().join("children")).unwrap_or_default();
    listed.flat_map(|task| of_thread(task).split_whitespace().flat_map(str::parse).collect::<Vec<u32>>()).collect()
}

fn signal(process: u32, name: &str) {
    let sent = Command::new("kill").args([&format!("-{name}"), &process.to_string()]).status();
    assert!(sent.is_ok_and(|s| s.success()), "kill -{name}");
}

/// Waits until no process of this number is left, for half a minute at most.
fn gone(process: u32) -> bool {
    let wait = ["30", "tail", &format!("--pid={process}"), "-f", "/dev/null"];
    Command::new("timeout").args(wait).status().expect("coreutils").success()
}

#[test]
fn a_worker_that_crashes_fails_one_item_and_takes_nothing_along() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    clips(folder);
    for (name, code, message) in
        [("ILL", 1, "its worker process crashed"), ("KILL", 75, "its worker process was killed")]
    {
        let (mut child, mut told) = at_work(folder);
        let workers = children(child.id());
        assert_eq!(workers.len(), 1, "one item at a time, one worker");
        signal(workers[0], name);
        let mut rest = String::new();
        told.read_to_string(&mut rest).expect("UTF-8");
        assert_eq!(child.wait().expect("it ends").code(), Some(3), "{rest}");
        let failed: Vec<&str> = rest.lines().filter(|l| l.contains("task.fail")).collect();
        assert!(matches!(failed.as_slice(), [one] if one.contains("b.mkv") && one.contains(message)), "{rest}");
        assert!(failed[0].contains(&format!("\"code\":{code}")), "{rest}");
        assert_eq!(names(&folder.join("out")), ["a.mp4", "c.mp4"], "the others are done, and nothing is left of `b`");
        std::fs::remove_dir_all(folder.join("out")).expect("a folder");
    }
}

#[test]
fn a_batch_that_is_stopped_or_killed_leaves_no_worker_and_no_unfinished_file() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    clips(folder);
    for (name, code) in [("INT", Some(130)), ("TERM", Some(143)), ("KILL", None)] {
        // The signal goes to the run alone, as from another program, and not to its workers too, as from a terminal.
        let (mut child, told) = at_work(folder);
        let workers = children(child.id());
        signal(child.id(), name);
        assert_eq!(child.wait().expect("it ends").code(), code, "SIG{name}");
        drop(told);
        assert!(workers.len() == 1 && gone(workers[0]), "SIG{name}: its worker still works");
        assert_eq!(names(&folder.join("out")), ["a.mp4"], "SIG{name}");
        std::fs::remove_dir_all(folder.join("out")).expect("a folder");
    }
}

#[test]
fn workers_give_the_same_results_as_the_program_itself() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    clips(folder);
    std::fs::remove_file(folder.join("in/b.mkv")).expect("a file");
    // Lossless: some versions of x264 read memory that they never wrote, so that its files differ from run to run.
    let options = ["--codec", "ffv1", "--threads", "1"];
    let batch = ["stabilize", "in", "--out-dir", "many", "--report", "pages"];
    let ran = succeed(folder, &[&batch[..], &options[..]].concat());
    assert!(err(&ran).contains("many/a.mkv") && err(&ran).contains("shake"), "summaries come back: {}", err(&ran));
    succeed(folder, &[&["stabilize", "in/a.mkv", "-o", "one.mkv"], &options[..]].concat());
    let pictures = |name: &str| picture_sums(&folder.join(name), "yuv420p");
    let one = pictures("one.mkv");
    assert_eq!(one.len(), 10);
    assert!(pictures("many/a.mkv") == one && pictures("many/c.mkv") == one);
    assert_eq!(names(&folder.join("pages")), ["a.html", "c.html"]);
}
