//! Limits of the system: a run ends well or as a passing fault with the limit named, and leaves nothing; it never panics or
//! hangs.

use std::path::Path;
use std::process::{Command, Output};

use crate::support::clips::workshop;
use crate::support::jobs::{WritingJob, contents, make_inputs};
use crate::support::program::{command, err};

/// `program` as the shell starts it after `ulimit`.
fn limited(folder: &Path, limit: &str, program: &Command) -> Output {
    let mut shell = Command::new("sh");
    let script = format!("ulimit {limit} || exit 99; exec \"$0\" \"$@\"");
    shell.args(["-c", &script]).arg(program.get_program()).args(program.get_args());
    shell.current_dir(folder).env("NO_COLOR", "1").output().expect("a shell")
}

/// Runs a job under each limit and demands one of two ends; tells how many runs met the limit.
fn each(job: &WritingJob, limits: &[String], named: &str) -> usize {
    let folder = tempfile::tempdir().expect("a temporary folder");
    make_inputs(folder.path());
    let inputs = contents(folder.path());
    let mut met = 0;
    for limit in limits {
        let ran = limited(folder.path(), limit, &job.command(folder.path()));
        let what = format!("{} under `ulimit {limit}`: {}: {}", job.name, ran.status, err(&ran));
        assert!(!err(&ran).contains("panicked"), "{what}");
        let left = contents(folder.path());
        match ran.status.code() {
            Some(0) => {
                for name in left.keys().filter(|name| !inputs.contains_key(*name)) {
                    std::fs::remove_file(folder.path().join(name)).expect("a result");
                }
            }
            // The system could not even load the program and its libraries, and said so.
            Some(127) => assert!(err(&ran).contains("error while loading shared libraries"), "{what}"),
            code => {
                met += 1;
                assert_eq!(code, Some(75), "{what}");
                assert!(err(&ran).contains(named), "{what}");
                assert!(
                    inputs.iter().all(|(file, bytes)| left.get(file) == Some(bytes)),
                    "{what}: an input has changed"
                );
                // A first result may be there, and is whole; one that is not has another name.
                for name in left.keys().filter(|name| !inputs.contains_key(*name)) {
                    assert!(!name.contains(".partial-"), "{what}: {name}");
                    std::fs::remove_file(folder.path().join(name)).expect("a result");
                }
            }
        }
    }
    met
}

/// Address spaces from what the program needs to be loaded to what a small job needs, KiB.
fn address_spaces() -> Vec<String> {
    let shown = |mib: usize| format!("-v {}", mib << 10);
    [150, 200, 230, 260, 290, 320, 350, 400, 450, 500, 600, 800].map(shown).to_vec()
}

#[test]
fn a_small_address_space_is_named() {
    let Some(_) = workshop() else { return };
    let jobs = ["clip", "motion", "photo", "mesh", "system"];
    let met: usize = jobs.iter().map(|name| each(WritingJob::named(name), &address_spaces(), "ulimit -v")).sum();
    assert!(met >= jobs.len(), "{met} runs met their limit");
}

#[test]
fn few_open_files_are_named() {
    let Some(_) = workshop() else { return };
    let limits: Vec<String> = [5, 6, 8, 10, 12, 16, 20].iter().map(|n| format!("-n {n}")).collect();
    for name in ["clip", "pictures", "photo", "mesh"] {
        assert!(each(WritingJob::named(name), &limits, "ulimit -n") > 0, "{name} needs fewer files than {limits:?}");
    }
}

#[test]
fn threads_beyond_all_use_are_refused_and_as_many_as_allowed_are_started() {
    let Some(_) = workshop() else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    make_inputs(folder.path());
    let run = |threads: &str| {
        let args = ["retarget", "p.png", "-o", "out.png", "--size", "60x120", "-y", "--threads", threads];
        command(folder.path(), &args).output().expect("the program starts")
    };
    let refused = run("1000000");
    assert_eq!(refused.status.code(), Some(2), "{}", err(&refused));
    let most = run("512");
    assert_eq!(most.status.code(), Some(0), "{}", err(&most));
}
