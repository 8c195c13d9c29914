//! Calls of the system that fail, one at a time: no partial file, inputs untouched, the right exit status, no panic.
//!
//! A small library is loaded before the C library (`shim.c`) and fails the `n`-th call of a kind, ours and those of the
//! libraries that we use alike. `PLUMBLINE_CASES` says how many numbers of each kind are tried, spaced logarithmically.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Output;

use crate::support::clips::workshop;
use crate::support::jobs::{WritingJob, cases, contents, make_inputs};
use crate::support::program::err;

/// A kind of call, the number of the error that it ends with, and the exit statuses that may follow.
struct Fault {
    kind: &'static str,
    error: i32,
    exits: &'static [i32],
}

const FAULTS: [Fault; 7] = [
    // What was read is an input, a file of our own that is read back, or a library's.
    Fault { kind: "read", error: libc::EIO, exits: &[65, 73, 75] },
    Fault { kind: "write", error: libc::ENOSPC, exits: &[73, 75] },
    Fault { kind: "rename", error: libc::EIO, exits: &[73] },
    Fault { kind: "sync", error: libc::EIO, exits: &[73] },
    Fault { kind: "open", error: libc::EMFILE, exits: &[75] },
    Fault { kind: "open", error: libc::EACCES, exits: &[2, 65, 73, 75] },
    Fault { kind: "thread", error: libc::EAGAIN, exits: &[75] },
];

/// The library that makes calls fail, built into `folder`.
fn shim(folder: &Path) -> PathBuf {
    let (source, library) = (folder.join("shim.c"), folder.join("shim.so"));
    std::fs::write(&source, include_str!("shim.c")).expect("a small file");
    let arguments = ["-O1", "-shared", "-fPIC", "-Wall", "-Werror", "-o"];
    let mut compiler = std::process::Command::new("cc");
    let built = compiler.args(arguments).args([&library, &source]).arg("-ldl").output();
    let built = built.expect("the C compiler that links this test runs");
    assert!(built.status.success(), "{}", err(&built));
    library
}

/// A job of one try, in a folder of its own.
fn run(job: &WritingJob, library: &Path, folder: &Path, variable: &str, value: &str) -> Output {
    let temporary = tempfile::tempdir().expect("a temporary folder");
    let mut program = job.command(folder);
    program.env("LD_PRELOAD", library).env("TMPDIR", temporary.path()).env(variable, value);
    let ran = program.output().expect("the program starts");
    assert_eq!(contents(temporary.path()).len(), 0, "{} {value}", job.name);
    ran
}

/// Whether each file was synced (f) before it was renamed (r), and its folder (d) afterwards.
fn is_synced_before_and_after(order: &str) -> bool {
    let (mut synced, mut renamed) = (0, 0);
    for call in order.chars() {
        match call {
            'f' => synced += 1,
            'r' if synced == 0 => return false,
            'r' => (synced, renamed) = (synced - 1, renamed + 1),
            _ => renamed = 0,
        }
    }
    renamed == 0 && order.contains('r')
}

/// Numbers from 1 to `last`, logarithmically spaced, at most `count`.
fn numbers(last: usize, count: usize) -> Vec<usize> {
    let at = |k: usize| (last as f64).powf(k as f64 / (count.max(2) - 1) as f64).round() as usize;
    let mut numbers: Vec<_> = (0..count).map(at).filter(|n| (1..=last).contains(n)).collect();
    numbers.dedup();
    numbers
}

fn fail_each(name: &str) {
    let Some(place) = workshop() else { return };
    let (job, library) = (WritingJob::named(name), shim(place.path()));
    let made = || {
        let folder = tempfile::tempdir().expect("a temporary folder");
        make_inputs(folder.path());
        folder
    };
    let counts = place.path().join("counts");
    let folder = made();
    let inputs = contents(folder.path());
    let ran = run(job, &library, folder.path(), "PLUMBLINE_FAULT_COUNTS", counts.to_str().expect("UTF-8"));
    assert!(ran.status.success(), "{name}: {}", err(&ran));
    let whole = contents(folder.path());
    let text = std::fs::read_to_string(&counts).expect("the library was loaded and wrote its counts");
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for (kind, count) in
        text.lines().filter_map(|l| l.split_once(' ')).filter_map(|(k, n)| Some((k, n.parse::<usize>().ok()?)))
    {
        // Of the processes of a batch each has its own numbers.
        let most = counts.entry(kind).or_default();
        *most = count.max(*most);
    }
    let mut orders = text.lines().filter_map(|line| line.strip_prefix("order ")).filter(|order| order.contains('r'));
    let synced = |order: &str| assert!(is_synced_before_and_after(order), "{name}: {order}");
    synced(orders.next().unwrap_or_else(|| panic!("{name}: nothing was renamed: {text}")));
    orders.for_each(synced);
    for fault in &FAULTS {
        assert!(counts[fault.kind] > 0, "{name} makes no call of the kind {}", fault.kind);
        let mut failed = 0;
        for number in numbers(counts[fault.kind], cases(3)) {
            let folder = made();
            let value = format!("{}:{number}:{}", fault.kind, fault.error);
            let ran = run(job, &library, folder.path(), "PLUMBLINE_FAULT", &value);
            let (what, left) = (format!("{name} {value}: {}", err(&ran)), contents(folder.path()));
            let code = ran.status.code().unwrap_or_else(|| panic!("{what}: {}", ran.status));
            assert!(!err(&ran).contains("panicked") && !err(&ran).contains("internal error"), "{what}");
            assert!(inputs.iter().all(|(file, bytes)| left.get(file) == Some(bytes)), "{what}: an input has changed");
            let odd: Vec<_> = left.iter().filter(|(file, bytes)| whole.get(*file) != Some(bytes)).collect();
            assert!(odd.is_empty(), "{what}: exit {code}, {:?}", odd.iter().map(|(file, _)| file).collect::<Vec<_>>());
            if code == 0 {
                assert!(left == whole, "{what}: a file is missing, and nothing is said of it");
            } else {
                failed += 1;
                let several = name == "batch" && code == 3;
                // The rest of a clip that cannot be read is missing like that of one that is cut.
                let several = several || (fault.kind == "read" && code == 3 && err(&ran).contains("cut short"));
                assert!(several || fault.exits.contains(&code), "{what}: exit {code}");
            }
        }
        // Some reads and files can be done without; the others cannot.
        let optional = ["read", "open"].contains(&fault.kind);
        assert!(optional || failed > 0, "{name}: no call of the kind {} failed", fault.kind);
    }
}

#[test]
fn a_clip_survives_calls_that_fail() {
    fail_each("clip");
}

#[test]
fn a_photo_survives_calls_that_fail() {
    fail_each("photo");
}

#[test]
fn a_mesh_survives_calls_that_fail() {
    fail_each("mesh");
}

#[test]
fn a_batch_survives_calls_that_fail() {
    fail_each("batch");
}

#[test]
fn each_of_the_first_threads_of_a_clip_may_be_refused() {
    // Where a thread of the shared pool was refused, a second attempt was told that there is a pool, and its first use panicked.
    let Some(place) = workshop() else { return };
    let (job, library) = (WritingJob::named("clip"), shim(place.path()));
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    // Those that probe the limits come first, then two pools; with two processors the shared pool has numbers 20 and 21,
    // and the encoder's own begin at 43.
    for number in 1..=(4 * threads + 40).min(80) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        make_inputs(folder.path());
        let inputs = contents(folder.path());
        let value = format!("thread:{number}:{}", libc::EAGAIN);
        let ran = run(job, &library, folder.path(), "PLUMBLINE_FAULT", &value);
        let what = format!("{value}: {}: {}", ran.status, err(&ran));
        assert!(matches!(ran.status.code(), Some(0 | 75)), "{what}");
        assert!(ran.status.success() || contents(folder.path()) == inputs, "{what}: something was left");
    }
}

#[test]
fn numbers_reach_from_the_first_call_to_the_last() {
    assert_eq!(numbers(1000, 4), [1, 10, 100, 1000]);
    assert_eq!(numbers(2, 5), [1, 2]);
    assert_eq!(numbers(7, 1), [1]);
}

#[test]
fn a_disk_that_is_too_small_is_refused_before_the_work_with_its_figures() {
    let Some(place) = workshop() else { return };
    let library = shim(place.path());
    let folder = tempfile::tempdir().expect("a temporary folder");
    make_inputs(folder.path());
    let inputs = contents(folder.path());
    let job = WritingJob::named("clip");
    // Ten frames of a thousand points of eight bytes; half of that is met.
    for (free, code, message) in
        [("0", 73, "out.mp4: cannot be written: no storage space"), ("4096", 75, " in "), ("100000000", 0, "")]
    {
        let ran = run(job, &library, folder.path(), "PLUMBLINE_FREE_SPACE", free);
        assert_eq!(ran.status.code(), Some(code), "{free}: {}", err(&ran));
        assert!(err(&ran).contains(message), "{free}: {}", err(&ran));
        if code == 75 {
            assert!(err(&ran).contains("which has 4.00 KiB free; set TMPDIR"), "{}", err(&ran));
        }
        assert!(code == 0 || contents(folder.path()) == inputs, "{free}");
    }
}
