//! The sandbox that `SECURITY.md` advises: the program works in it, and nothing else is open to it.
#![cfg(target_os = "linux")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::support::clips::{make, pattern, workshop};
use crate::support::program::{err, names};

/// `examples/sandbox.rs`, which `cargo test` builds beside this test.
fn sandbox() -> PathBuf {
    let folder = Path::new(env!("CARGO_BIN_EXE_plumbline")).parent().expect("a folder");
    let program = folder.join("examples/sandbox");
    assert!(program.exists(), "build it by `cargo build --example sandbox`");
    program
}

fn confined(folder: &Path, command: &[&str]) -> Output {
    let mut sandbox = Command::new(sandbox());
    sandbox.args(["in", "out"]).args(command).current_dir(folder).env("NO_COLOR", "1");
    sandbox.output().expect("the sandbox starts")
}

#[test]
fn a_batch_works_in_the_sandbox_and_other_files_and_sockets_are_out_of_reach() {
    let Some(folder) = workshop() else { return };
    let folder = folder.path();
    std::fs::create_dir(folder.join("in")).expect("a folder");
    for name in ["a.mkv", "b.mkv"] {
        make(&folder.join("in"), name, &format!("{} -c:v ffv1", pattern(12)));
    }
    std::fs::write(folder.join("secret.txt"), "secret").expect("a small file");
    let nothing = confined(folder, &["/usr/bin/true"]);
    if !nothing.status.success() {
        // A kernel without Landlock: the sandbox says so, and runs nothing unconfined.
        assert!(err(&nothing).contains("this kernel has no Landlock"), "{}", err(&nothing));
        return;
    }
    let program = env!("CARGO_BIN_EXE_plumbline");
    let ran = confined(folder, &[program, "stabilize", "in", "--out-dir", "out", "--suffix", "_steady"]);
    assert_eq!(ran.status.code(), Some(0), "{}", err(&ran));
    assert!(names(&folder.join("out")).iter().filter(|n| n.ends_with("_steady.mp4")).count() == 2);

    let read = confined(folder, &["/usr/bin/cat", "secret.txt"]);
    assert!(!read.status.success() && err(&read).contains("Permission denied"), "{}", err(&read));
    let write = confined(folder, &["/usr/bin/touch", "in/new"]);
    assert!(!write.status.success() && !folder.join("in/new").exists(), "{}", err(&write));
    let connect = confined(folder, &["/usr/bin/bash", "-c", ": < /dev/tcp/127.0.0.1/9"]);
    assert!(err(&connect).contains("not permitted"), "{}", err(&connect));
}
