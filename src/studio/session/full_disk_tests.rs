//! A disk that is full while a document is saved: a small file system of its own, in a namespace of mounts.

use std::io::{ErrorKind, Write as _};
use std::path::Path;
use std::process::Command;

use serde_json::{Value, json};

use super::test_document::{file_in, set, three};

/// Set in the process that works on the small disk.
const SMALL_DISK: &str = "PLUMBLINE_TEST_SMALL_DISK";
/// What the test is called with on the small disk.
const NAME: &str = "session::full_disk_tests::a_full_disk_while_saving_loses_nothing";
/// Exit status where the system forbids to mount.
const NOT_PERMITTED: i32 = 77;

#[test]
fn a_full_disk_while_saving_loses_nothing() {
    if std::env::var_os(SMALL_DISK).is_some() {
        return save_on_a_full_disk();
    }
    let disk = tempfile::tempdir().expect("a temporary folder");
    let script = format!(
        "mount -t tmpfs -o size=256k none \"$1\" || exit {NOT_PERMITTED}
         TMPDIR=\"$1\" {SMALL_DISK}=1 exec \"$2\" --exact {NAME} --nocapture"
    );
    let program = std::env::current_exe().expect("this test");
    let arguments = ["--user", "--map-root-user", "--mount", "sh", "-c", &script, "sh"];
    let ran = Command::new("unshare").args(arguments).arg(disk.path()).arg(program).output();
    let Ok(ran) = ran else { return eprintln!("skipped: there is no program `unshare`") };
    let told = String::from_utf8_lossy(&ran.stderr);
    if ran.status.code() == Some(NOT_PERMITTED) || told.starts_with("unshare:") {
        return eprintln!("skipped: no file system may be mounted: {told}");
    }
    assert!(ran.status.success() && String::from_utf8_lossy(&ran.stdout).contains("1 passed"), "{told}");
}

/// Fills the disk that temporary files are on.
fn fill(file: &Path) {
    let mut file = std::fs::File::create(file).expect("a file");
    let full = loop {
        if let Err(error) = file.write_all(&[0; 4096]) {
            break error;
        }
    };
    assert_eq!(full.kind(), ErrorKind::StorageFull, "{full}");
}

fn save_on_a_full_disk() {
    let opened = three();
    let mut window = opened.window();
    let (before, filler) = (opened.on_disk(), opened.folder.path().join("filler"));
    fill(&filler);
    window.done(set(0, 4.0));
    let kept = window.until(|m| m.get("notice").is_some());
    assert!(kept["notice"]["text"].as_str().is_some_and(|t| t.contains("cannot be kept for a crash")), "{kept}");
    let reply = window.ask(json!({"save": true}));
    let why = reply["error"].as_str().expect("it is refused").to_owned();
    assert!(why.contains("a.fake: cannot be saved: No space left on device"), "{why}");
    assert_eq!(opened.on_disk(), before, "the file is as it was");
    let names = std::fs::read_dir(opened.folder.path()).expect("the folder").map(|e| e.expect("an entry").file_name());
    let mut names: Vec<_> = names.collect();
    names.sort();
    assert_eq!(names, ["a.fake", "filler", "state"], "nothing unfinished stays");
    assert_eq!((window.sum(), &window.history["savedAt"]), (9.0, &json!(0)), "the change is there, and is not saved");
    window.done(set(1, 5.0));
    window.done(json!({"undo": true}));
    std::fs::remove_file(filler).expect("removed");
    window.done(json!({"save": true}));
    let saved: Value =
        serde_json::from_slice(&std::fs::read(file_in(&opened.folder)).expect("the file")).expect("JSON");
    assert_eq!(saved["numbers"], json!([4.0, 2.0, 3.0]));
}
