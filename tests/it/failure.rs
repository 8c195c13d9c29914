//! What the program prints: each error once, a line per result, details on request.

use std::path::Path;
use std::process::{Command, Output};

use crate::support::missing::skip;
use crate::support::program::{command, err, out};

/// A tetrahedron.
const GOOD: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
/// A triangle with a vertex that is not there.
const BAD: &str = "v 0 0 0\nv 1 0 0\nf 1 2 7\n";

fn folder_with(files: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::create_dir(folder.path().join("in")).expect("a folder");
    for (name, text) in files {
        std::fs::write(folder.path().join(name), text).expect("a small file");
    }
    folder
}

/// The program as users run it.
fn run(folder: &Path, args: &[&str]) -> Output {
    command(folder, args).output().expect("the program starts")
}

/// Messages of the lines that report an error.
fn errors(text: &str) -> Vec<&str> {
    text.lines().filter_map(|line| line.trim_end().split_once("error: ").map(|(_, message)| message)).collect()
}

/// Insists that `count` errors were printed, each once and to standard error.
fn each_once(name: &str, output: &Output, count: usize) {
    let all = err(output) + &out(output);
    let errors = errors(&all);
    assert_eq!(errors.len(), count, "{name}: {all}");
    for message in errors {
        // The name of the file is in the message, or in front of it where the key of the item is another.
        let bare = message.rsplit(": ").next().unwrap_or(message);
        assert!(all.matches(message).count() == 1, "{name}: {all}");
        assert!(count > 1 || all.matches(bare).count() == 1, "{name}: {all}");
    }
    assert_eq!(out(output), "", "{name}: standard output carries results only");
}

const PIPELINE: &str = "version = 1\n[stage.mesh]\nuse = \"mesh.load\"\npath = \"in/bad.obj\"\n[stage.out]\n\
                        use = \"mesh.save\"\ninputs = [\"mesh\"]\npath = \"out.obj\"\n";

#[test]
fn an_error_of_a_lone_job_is_printed_once_however_progress_is_shown() {
    let folder = folder_with(&[("in/bad.obj", BAD), ("job.toml", PIPELINE)]);
    for mode in ["auto", "plain", "none"] {
        for verbosity in ["-q", "-v", "--log-level=error"] {
            let args = ["render", "in/bad.obj", "-o", "a.png", "--progress", mode, verbosity];
            let ran = run(folder.path(), &args);
            assert_eq!(ran.status.code(), Some(65), "{}", err(&ran));
            each_once(mode, &ran, 1);
        }
        let ran = run(folder.path(), &["run", "job.toml", "--progress", mode]);
        assert_eq!(ran.status.code(), Some(65), "{}", err(&ran));
        each_once("a pipeline file", &ran, 1);
    }
    let json = run(folder.path(), &["run", "job.toml", "--progress", "json"]);
    let of_task = |line: &&str| line.contains("task.fail");
    assert_eq!((err(&json).lines().filter(of_task).count(), errors(&err(&json)).len()), (1, 0), "{}", err(&json));
}

#[test]
fn a_batch_prints_each_error_once_and_then_how_many_items_failed() {
    let files = [("in/a.obj", GOOD), ("in/b.obj", BAD), ("in/c.obj", "nonsense"), ("in/d.obj", GOOD), ("in/e.obj", "")];
    let folder = folder_with(&files);
    for mode in ["auto", "none"] {
        let ran = run(folder.path(), &["render", "in", "--out-dir", "out", "--progress", mode, "--jobs", "2", "-y"]);
        let text = err(&ran);
        assert_eq!(ran.status.code(), Some(3), "{text}");
        let errors = errors(&text);
        assert_eq!(errors.len(), 3, "{text}");
        for file in ["in/b.obj", "in/c.obj", "in/e.obj"] {
            assert_eq!(errors.iter().filter(|e| e.contains(file)).count(), 1, "{text}");
        }
        for message in errors {
            assert_eq!(text.matches(message).count(), 1, "{text}");
        }
        assert!(text.ends_with("\n3 of 5 items failed\n"), "{text}");
        assert_eq!(text.matches("failed").count(), 1, "{text}");
        assert_eq!(text.lines().filter(|line| line.starts_with("wrote ")).count(), 2, "a line per result: {text}");
    }
}

#[test]
fn meshes_that_cannot_be_read_are_reported_once() {
    let folder = folder_with(&[("in/a.obj", GOOD), ("in/b.obj", BAD)]);
    let ran = run(folder.path(), &["mesh", "info", "in/a.obj", "in/b.obj"]);
    assert_eq!((ran.status.code(), errors(&err(&ran)).len()), (Some(3), 1), "{}", err(&ran));
    assert!(err(&ran).ends_with("\n1 of 2 items failed\n"), "{}", err(&ran));
    let alone = run(folder.path(), &["mesh", "info", "in/b.obj"]);
    each_once("alone", &alone, 1);
}

#[test]
fn an_error_is_printed_once_on_a_terminal_too() {
    let folder = folder_with(&[("in/a.obj", GOOD), ("in/b.obj", BAD)]);
    let program = env!("CARGO_BIN_EXE_plumbline");
    let on_terminal = |args: &str| {
        let mut script = Command::new("script");
        script.args(["-qec", &format!("{program} {args}"), "/dev/null"]).current_dir(folder.path());
        script.env("NO_COLOR", "1").env("TERM", "xterm").output()
    };
    let Ok(ran) = on_terminal("render in/b.obj -o b.png") else {
        skip("the program `script`, which makes a terminal, is not installed");
        return;
    };
    assert_eq!(errors(&out(&ran)).len(), 1, "{}", out(&ran));
    let batch = on_terminal("render in --out-dir out").expect("it ran before");
    let text = out(&batch);
    assert_eq!((errors(&text).len(), text.matches("1 of 2 items failed").count()), (1, 1), "{text}");
    assert_eq!(text.matches("failed").count(), 1, "{text}");
}

#[test]
fn a_result_is_one_line_and_details_are_printed_on_request() {
    let folder = folder_with(&[("in/a.obj", GOOD)]);
    let rendered = |options: &[&str]| {
        let ran = run(folder.path(), &[&["render", "in/a.obj", "-o", "a.png", "-f"], options].concat());
        assert_eq!(ran.status.code(), Some(0), "{}", err(&ran));
        assert_eq!(out(&ran), "a.png\n", "standard output names the file");
        err(&ran)
    };
    let brief = rendered(&[]);
    assert_eq!((brief.lines().count(), brief.starts_with("wrote a.png: 1280×960 px")), (1, true), "{brief}");
    let detailed = rendered(&["-v"]);
    assert!(detailed.contains("  read      in/a.obj, 4 vertices, 4 faces"), "{detailed}");
    assert_eq!(rendered(&["--quiet"]), "");
    assert_eq!(rendered(&["--verbose"]).lines().count(), detailed.lines().count());
}

#[test]
fn options_of_other_programs_are_understood_or_explained() {
    let folder = folder_with(&[]);
    let refused = |args: &[&str], message: &str| {
        let ran = run(folder.path(), args);
        assert_eq!((ran.status.code(), err(&ran).contains(message)), (Some(2), true), "{}", err(&ran));
    };
    refused(&["stabilize", "-i", "a.mp4", "-o", "b.mp4"], "inputs need no -i");
    refused(
        &["stabilize", "a.mp4", "-o", "b.mp4", "--log-level", "loud"],
        "expected off, error, warn, info, debug, trace",
    );
    refused(&["stabilize", "a.mp4", "-o", "b.mp4", "--to", "5", "--duration", "2"], "cannot be used with");
    refused(&["rectify", "a.jpg", "-o", "b.jpg", "--size", "wide"], "expected WIDTHxHEIGHT, WIDTHx or xHEIGHT");
    refused(&["rectify", "a.jpg", "-o", "b.jpg", "--duration", "2"], "--duration is for clips");
    let args = ["stabilise", "a.mp4", "-o", "b.mp4", "--ss", "0:10", "--duration", "2.5", "--keep", "85%"];
    let printed = out(&run(folder.path(), &[&args[..], &["-y", "--print-pipeline"]].concat()));
    for line in ["start = 10.0", "end = 12.5", "keep = 0.85", "overwrite = true"] {
        assert!(printed.contains(line), "{line}: {printed}");
    }
}
