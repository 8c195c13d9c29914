//! Ends at any moment: nothing under a final name that is not whole, inputs untouched, no litter that the next run leaves.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::support::clips::workshop;
use crate::support::jobs::{JOBS, WritingJob, cases, contents, make_inputs};
use crate::support::program::command;

pub(crate) fn signal(child: &Child, name: &str) {
    let sent = Command::new("kill").args([&format!("-{name}"), &child.id().to_string()]).status();
    assert!(sent.is_ok_and(|s| s.success()), "kill -{name}");
}

fn wait_until(moment: Instant) {
    std::thread::park_timeout(moment.saturating_duration_since(Instant::now()));
}

type Contents = BTreeMap<String, Vec<u8>>;

fn is_unfinished(name: &str) -> bool {
    name.contains(".partial-")
}

/// What a job leaves where nothing happens, and how long it takes.
fn undisturbed(job: &WritingJob) -> (Contents, Duration) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    make_inputs(folder.path());
    let began = Instant::now();
    let run = job.command(folder.path()).output().expect("the program starts");
    assert!(run.status.success(), "{}: {}", job.name, String::from_utf8_lossy(&run.stderr));
    (contents(folder.path()), began.elapsed())
}

/// Ends a run after `delay` and looks at what is there.
fn ended(job: &WritingJob, whole: &Contents, name: &str, delay: Duration) {
    let what = format!("{} after {delay:?} by SIG{name}", job.name);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let temporary = tempfile::tempdir().expect("a temporary folder");
    make_inputs(folder.path());
    let inputs = contents(folder.path());
    let mut quiet = job.command(folder.path());
    quiet.env("TMPDIR", temporary.path()).stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = quiet.spawn().expect("the program starts");
    wait_until(Instant::now() + delay);
    signal(&child, name);
    let sent = Instant::now();
    let status = child.wait().expect("it ends");
    // Two seconds, and what a busy machine adds.
    assert!(sent.elapsed() < Duration::from_secs(8), "{what}: it took {:?} to end", sent.elapsed());
    let left = contents(folder.path());
    for (file, bytes) in left.iter().filter(|(file, _)| !is_unfinished(file)) {
        assert!(whole.get(file) == Some(bytes), "{what}: {file} is not whole");
    }
    assert!(inputs.keys().all(|file| left.contains_key(file)), "{what}: an input is gone");
    if name != "KILL" {
        let unfinished: Vec<_> = left.keys().filter(|file| is_unfinished(file)).collect();
        assert!(unfinished.is_empty(), "{what}: {unfinished:?}");
        assert_eq!(contents(temporary.path()).len(), 0, "{what}");
        let code = match name {
            "INT" => 130,
            "TERM" => 143,
            _ => 129,
        };
        // Before the handlers are there the signal itself ends it; after the work is done nothing is interrupted.
        assert!(matches!(status.code(), None | Some(0)) || status.code() == Some(code), "{what}: {status}");
    }
    let again = job.command(folder.path()).arg("--overwrite").output().expect("the program starts");
    assert!(again.status.success(), "{what}: {}", String::from_utf8_lossy(&again.stderr));
    assert!(contents(folder.path()) == *whole, "{what}: the next run leaves {:?}", contents(folder.path()).keys());
}

#[test]
fn ends_at_random_moments_leave_whole_files_and_no_litter() {
    let Some(_) = workshop() else { return };
    let mut random = fastrand::Rng::with_seed(0x5eed);
    let reference: Vec<_> = JOBS.iter().map(undisturbed).collect();
    // At least one of each job, at moments that differ from run to run of the machine, as they do for users.
    for k in 0..cases(JOBS.len()).max(JOBS.len()) {
        let (whole, time) = &reference[k % JOBS.len()];
        let name = ["KILL", "TERM", "INT", "HUP"][(k + k / JOBS.len()) % 4];
        ended(&JOBS[k % JOBS.len()], whole, name, time.mul_f64(1.1 * random.f64()));
    }
}

/// A run that waits for standard input, which never comes: FFmpeg is not asked, no loop looks at a flag.
fn stuck(folder: &Path, program: &mut Command) -> Child {
    program.args(["stabilize", "-", "-o", "out.mp4"]).current_dir(folder).env("TMPDIR", folder);
    program.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::null());
    let child = program.spawn().expect("the program starts");
    let began = Instant::now();
    while std::fs::read_dir(folder).expect("a folder").count() == 0 {
        assert!(began.elapsed() < Duration::from_mins(1), "it never began its copy of standard input");
        wait_until(Instant::now() + Duration::from_millis(5));
    }
    child
}

#[test]
fn work_that_does_not_look_ends_within_two_seconds_of_the_first_signal_and_at_once_at_the_second() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (name, code) in [("INT", 130), ("TERM", 143), ("HUP", 129)] {
        for signals in [1, 2] {
            let mut child = stuck(folder.path(), &mut command(folder.path(), &[]));
            let began = Instant::now();
            (0..signals).for_each(|_| {
                signal(&child, name);
                wait_until(Instant::now() + Duration::from_millis(50));
            });
            let status = child.wait().expect("it ends");
            assert_eq!(status.code(), Some(code), "SIG{name}: {status}");
            // The bounds are 1.5 s and at once; a busy machine adds to them.
            let bound = Duration::from_secs(if signals == 1 { 6 } else { 4 });
            assert!(began.elapsed() < bound, "{signals} SIG{name}: {:?}", began.elapsed());
            assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0, "SIG{name}");
        }
    }
}

#[test]
fn a_signal_that_the_shell_told_to_ignore_is_ignored() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut shell = Command::new("sh");
    shell.args(["-c", "trap '' HUP; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_plumbline")]);
    let mut child = stuck(folder.path(), &mut shell);
    signal(&child, "HUP");
    wait_until(Instant::now() + Duration::from_millis(300));
    assert!(child.try_wait().expect("a child").is_none(), "SIGHUP was to be ignored");
    signal(&child, "TERM");
    assert_eq!(child.wait().expect("it ends").code(), Some(143));
}
