//! Nothing is replaced without `--overwrite`: neither what is there, nor what appears meanwhile, nor what another run writes.

use std::path::Path;
use std::process::{Child, Stdio};

use crate::support::clips::{make, shaky, workshop};
use crate::support::jobs::{JOBS, contents, make_inputs};
use crate::support::program::{command, err, names, plumbline_in, succeed};

/// A run that has begun its result and waits for the end of its input.
fn waiting(folder: &Path, args: &[&str]) -> Child {
    let mut program = command(folder, args);
    program.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("the program starts")
}

#[test]
fn of_two_runs_for_one_target_exactly_one_succeeds() {
    let Some(_) = workshop() else { return };
    for job in &JOBS {
        let folder = tempfile::tempdir().expect("a temporary folder");
        make_inputs(folder.path());
        let mut both = [0, 1].map(|_| {
            let mut program = job.command(folder.path());
            program.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("the program starts")
        });
        let codes: Vec<_> = both.iter_mut().map(|run| run.wait().expect("it ends").code()).collect();
        let partly = if job.name == "batch" { [Some(0), Some(3), Some(73)] } else { [Some(0), Some(73), Some(73)] };
        assert!(codes.iter().all(|code| partly.contains(code)), "{}: {codes:?}", job.name);
        if job.name != "batch" {
            assert_eq!(codes.iter().filter(|code| **code == Some(0)).count(), 1, "{}: {codes:?}", job.name);
        }
        assert!(contents(folder.path()).keys().all(|name| !name.contains(".partial-")), "{}", job.name);
        let there = contents(folder.path());
        let again = job.command(folder.path()).output().expect("the program starts");
        assert!(job.name == "batch" || again.status.code() == Some(73), "{}: {}", job.name, err(&again));
        assert!(contents(folder.path()) == there, "{}: what is there stays", job.name);
    }
}

#[test]
fn a_second_run_is_refused_before_it_works() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    let scaled = "-vf scale=960:540 -c:v libx264 -preset ultrafast -pix_fmt yuv420p";
    make(folder, "long.mkv", &format!("{} {scaled}", shaky(2.4)));
    let args = ["stabilize", "long.mkv", "-o", "out.mp4", "--preset", "slow", "--threads", "1"];
    let mut first = waiting(folder, &args);
    while !names(folder).iter().any(|name| name.starts_with("out.partial-")) {
        assert!(first.try_wait().expect("a child").is_none(), "it ended before it began its result");
    }
    let second = plumbline_in(folder, &["stabilize", "long.mkv", "-o", "out.mp4", "--progress", "plain"]);
    assert_eq!(second.status.code(), Some(73), "{}", err(&second));
    assert!(err(&second).contains("out.mp4: cannot be written: another run is writing this file"), "{}", err(&second));
    assert!(!err(&second).contains("frames"), "refused before any work: {}", err(&second));
    first.kill().expect("it runs");
    first.wait().expect("it ends");
    succeed(folder, &["stabilize", "long.mkv", "-o", "out.mp4", "--preset", "ultrafast", "--end", "0.4"]);
    assert_eq!(names(folder), ["long.mkv", "out.mp4"], "a lock ends with its run, and nothing is left of it");
}

#[test]
fn a_target_that_appears_meanwhile_is_kept() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    make(folder, "a.mkv", &format!("{} -c:v ffv1 -pix_fmt yuv420p", shaky(1.2)));
    for (output, appears) in [("out.mkv", "out.mkv"), ("frames/%03d.png", "frames/004.png")] {
        let args = ["stabilize", "a.mkv", "-o", output, "--threads", "1"];
        let mut run = waiting(folder, &args);
        let at = folder.join(appears);
        let begun = |name: &str| name.contains(".partial-");
        while !contents(folder).keys().any(|name| begun(name)) {
            assert!(run.try_wait().expect("a child").is_none(), "it ended before it began its result");
        }
        std::fs::write(&at, b"precious").expect("a small file");
        let ran = run.wait_with_output().expect("it ends");
        assert_eq!(ran.status.code(), Some(73), "{output}: {}", err(&ran));
        assert!(err(&ran).contains("exists"), "{output}: {}", err(&ran));
        assert_eq!(std::fs::read(&at).expect("kept"), b"precious");
        let left = contents(folder);
        let others: Vec<_> =
            left.keys().filter(|name| *name != "a.mkv" && *name != appears && *name != "out.mkv").collect();
        assert!(others.is_empty(), "{output}: {others:?}");
    }
}
