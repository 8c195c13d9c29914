//! The program on batches: folders and trees, what it reports, broken items, names of any bytes.

use std::fmt::Write as _;
use std::path::Path;

use plumbline::app::pipeline::{Source, read};

use crate::pipeline::GOOD;
use crate::support::program::{err, names, out, plumbline_in};

/// A mesh of one triangle.
const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// A pipeline that copies meshes, and a folder with some.
fn meshes(files: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for name in files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        std::fs::write(path, TRIANGLE).expect("a small file");
    }
    let text = "version = 1\n[batch]\nforeach = \"in\"\n[stage.mesh]\nuse = \"mesh.load\"\npath = \"${item.path}\"\n\
                [stage.out]\nuse = \"mesh.save\"\ninputs = [\"mesh\"]\npath = \"out/${item.rel}/${item.stem}.ply\"\n";
    std::fs::write(folder.path().join("job.toml"), text).expect("a small file");
    folder
}

fn run(folder: &Path, args: &[&str], exit: i32) -> String {
    let output = plumbline_in(folder, args);
    assert_eq!(output.status.code(), Some(exit), "{args:?}: {}{}", out(&output), err(&output));
    err(&output)
}

#[test]
fn the_program_reports_how_much_is_up_to_date_and_what_each_item_became() {
    let folder = meshes(&["in/a.obj", "in/b.obj", "in/sub/c.obj"]);
    let folder = folder.path();
    std::fs::write(folder.join("in/bad.obj"), "v 0 0\nf 1 2 9\n").expect("a small file");
    let results = || -> serde_json::Value {
        serde_json::from_slice(&std::fs::read(folder.join("r.json")).expect("results")).expect("JSON")
    };
    run(folder, &["run", "job.toml", "--results", "r.json"], 3);
    assert_eq!((&results()["format"], &results()["exit_code"]), (&"plumbline.results".into(), &3.into()));
    assert_eq!((&results()["done"], &results()["failed"]), (&3.into(), &1.into()));
    let item = |key: &str| {
        let items = results()["items"].as_array().expect("a list").clone();
        items.into_iter().find(|item| item["key"] == key).unwrap_or_else(|| panic!("no {key}"))
    };
    let bad = item("in/bad.obj");
    assert_eq!(
        (&bad["status"], &bad["exit_code"], &bad["outputs"]),
        (&"failed".into(), &65.into(), &[(); 0][..].into())
    );
    assert!(bad["error"].as_str().is_some_and(|text| text.contains("in/bad.obj")), "{bad}");
    assert_eq!((&item("in/a.obj")["status"], &item("in/a.obj")["outputs"][0]), (&"done".into(), &"out/a.ply".into()));
    // Only what failed.
    let text = run(folder, &["run", "job.toml", "--retry-failed", "r.json", "--results", "r2.json"], 65);
    assert!(text.contains("1 of 4 items of `r.json` to do"), "{text}");
    std::fs::write(folder.join("in/bad.obj"), TRIANGLE).expect("a small file");
    run(folder, &["run", "job.toml", "--retry-failed", "r.json", "--results", "r.json"], 0);
    assert_eq!((&results()["done"], results()["items"].as_array().map(Vec::len)), (&1.into(), Some(1)));
    // The whole again.
    let text = run(folder, &["run", "job.toml", "--results", "r.json"], 0);
    assert!(text.contains("4 up to date, 0 to do"), "{text}");
    assert_eq!((&results()["up_to_date"], &item("in/sub/c.obj")["status"]), (&4.into(), &"up_to_date".into()));
    let quiet = plumbline_in(folder, &["run", "job.toml", "--progress", "none"]);
    assert!(err(&quiet).contains("4 up to date, 0 to do") && out(&quiet).is_empty(), "{}", err(&quiet));
    // Results replace results, and nothing else.
    let refused = run(folder, &["run", "job.toml", "--results", "job.toml"], 73);
    assert!(refused.contains("`job.toml` exists and is not a file of results"), "{refused}");
    let wrong = run(folder, &["run", "job.toml", "--retry-failed", "job.toml"], 65);
    assert!(wrong.contains("not a file of results"), "{wrong}");
}

#[test]
fn a_lone_file_is_refused_as_ever_and_leaves_no_record() {
    let folder = meshes(&["a.obj"]);
    let folder = folder.path();
    let args = ["render", "a.obj", "-o", "a.png"];
    run(folder, &args, 0);
    assert!(!folder.join(".plumbline").exists());
    let refused = run(folder, &args, 73);
    assert!(refused.contains("`a.png` exists; allow to replace it with --overwrite"), "{refused}");
    run(folder, &["render", "a.obj", "-o", "a.png", "--existing", "overwrite"], 0);
    run(folder, &["render", "a.obj", "-o", "b.png", "--existing", "skip"], 0);
    let text = run(folder, &["render", "a.obj", "-o", "b.png", "--existing", "skip"], 0);
    assert!(text.contains("1 up to date, 0 to do"), "{text}");
}

#[test]
fn mesh_tools_search_folders_keep_their_tree_and_work_on_several_files_at_once() {
    let folder = meshes(&["in/a.obj", "in/x/b.obj", "in/x/y/c.obj", "in/.hidden/d.obj"]);
    let folder = folder.path();
    std::fs::write(folder.join("in/bad.obj"), "f 1 2 3\n").expect("a small file");
    let args = ["mesh", "convert", "in", "--out-dir", "out", "--format", "ply", "--jobs", "3", "--json"];
    let output = plumbline_in(folder, &args);
    assert_eq!(output.status.code(), Some(3), "{}", err(&output));
    let list: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let files: Vec<_> = list.as_array().expect("a list").iter().filter_map(|item| item["file"].as_str()).collect();
    assert_eq!(files, ["in/a.obj", "in/bad.obj", "in/x/b.obj", "in/x/y/c.obj"], "in order, the broken one among them");
    for name in ["out/a.ply", "out/x/b.ply", "out/x/y/c.ply"] {
        assert!(folder.join(name).exists(), "{name}");
    }
    let flat = plumbline_in(folder, &["mesh", "info", "in/x", "--no-recurse", "--json"]);
    let list: serde_json::Value = serde_json::from_slice(&flat.stdout).expect("JSON");
    assert_eq!(list.as_array().map(Vec::len), Some(1));
}

/// Pictures too small to take time.
fn pictures(files: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for name in files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        image::RgbImage::from_fn(32, 24, |x, y| image::Rgb([(8 * x) as u8, (8 * y) as u8, 99]))
            .save(path)
            .expect("saved");
    }
    folder
}

const SQUARE: [&str; 6] = ["--size", "24x24", "--lines", "off", "--faces", "off"];

#[test]
fn a_folder_is_searched_at_any_depth_and_its_tree_is_kept() {
    let folder = pictures(&["in/a.png", "in/x/a.png", "in/x/y/b.png", "in/.hidden/c.png"]);
    let folder = folder.path();
    let retarget = |args: &[&str], exit| run(folder, &[&["retarget"], args, &SQUARE[..]].concat(), exit);
    retarget(&["in", "--out-dir", "out"], 0);
    let visible = |name: &str| names(&folder.join(name));
    assert_eq!(
        (visible("out"), visible("out/x"), visible("out/x/y")),
        (vec!["a.png".into(), "x".into()], vec!["a.png".into(), "y".into()], vec!["b.png".to_owned()])
    );
    assert!(retarget(&["in", "--out-dir", "out"], 0).contains("3 up to date, 0 to do"));
    retarget(&["in", "--out-dir", "one", "--no-recurse"], 0);
    assert_eq!(visible("one"), ["a.png"]);
    let refused = retarget(&["in", "--out-dir", "flat", "--flat"], 2);
    assert!(refused.contains("would be written twice") && !folder.join("flat").exists(), "{refused}");
    retarget(&["in/x", "--out-dir", "flat", "--flat"], 0);
    assert_eq!(visible("flat"), ["a.png", "b.png"]);
    // A glob keeps the tree below its root as well.
    retarget(&["in/x/**/*.png", "--out-dir", "glob"], 0);
    assert_eq!((visible("glob"), visible("glob/y")), (vec!["a.png".into(), "y".into()], vec!["b.png".to_owned()]));
}

#[test]
fn results_of_the_batch_itself_are_no_inputs_of_the_next_run() {
    let folder = pictures(&["in/a.png", "in/x/b.png"]);
    let folder = folder.path();
    let retarget = |args: &[&str], exit| run(folder, &[&["retarget"], args, &SQUARE[..]].concat(), exit);
    // In a folder below the one that is searched.
    retarget(&["in", "--out-dir", "in/out"], 0);
    assert!(retarget(&["in", "--out-dir", "in/out"], 0).contains("2 up to date, 0 to do"));
    std::fs::remove_dir_all(folder.join("in/out")).expect("removed");
    // Beside their inputs: by name or by folder.
    retarget(&["in", "--suffix", "_s"], 0);
    assert!(retarget(&["in", "--suffix", "_s"], 0).contains("2 up to date, 0 to do"));
    let named = ["in/a.png", "in/a_s.png", "--suffix", "_s"];
    assert!(retarget(&named, 0).contains("1 up to date, 0 to do"), "as a shell expands in/*.png");
    assert!(!folder.join("in/a_s_s.png").exists());
    // A file of the same name that no run made is an input, and its loss an error.
    std::fs::remove_dir_all(folder.join("in/.plumbline")).expect("removed");
    assert!(retarget(&named, 2).contains("would be written over its input"));
}

#[test]
fn a_broken_input_or_an_unreadable_folder_does_not_stop_the_rest_and_is_named() {
    let folder = pictures(&["in/a.png", "in/z.png"]);
    let folder = folder.path();
    std::fs::write(folder.join("in/broken.png"), "no picture").expect("written");
    std::fs::write(folder.join("in/empty.png"), "").expect("written");
    let args = ["retarget", "in", "--out-dir", "out", "--results", "r.json", "--jobs", "2"];
    let text = run(folder, &[&args[..], &SQUARE].concat(), 3);
    assert!(text.contains("in/broken.png") && text.contains("in/empty.png"), "{text}");
    assert!(folder.join("out/a.png").exists() && folder.join("out/z.png").exists());
    let results: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.join("r.json")).expect("results")).expect("JSON");
    assert_eq!((&results["done"], &results["failed"], &results["exit_code"]), (&2.into(), &2.into(), &3.into()));
}

#[test]
fn check_and_plan_report_what_the_run_would() {
    let folder = meshes(&["in/a.obj", "in/b.obj"]);
    let folder = folder.path();
    let text = std::fs::read_to_string(folder.join("job.toml")).expect("a file");
    let cases = [
        (
            "twice",
            text.replace("${item.rel}/${item.stem}", "same"),
            "would be written twice, by `in/a.obj` and by `in/b.obj`",
        ),
        (
            "stages",
            format!(
                "{text}[stage.out2]\nuse = \"mesh.save\"\ninputs = [\"mesh\"]\npath = \"out/${{item.rel}}/${{item.stem}}.ply\"\n"
            ),
            "would be written twice",
        ),
        ("glob", text.replace("\"in\"", "[\"in\", \"in/[a\", \"in/{b\"]"), "`in/[a` is no glob"),
        ("empty", text.replace("\"in\"", "\"*.glb\""), "no file matches *.glb"),
        ("keys", text.replace("[batch]", "[batch]\nkey = \"x\""), "have the same key `x`"),
        ("input", text.replace("out/${item.rel}/${item.stem}.ply", "${item.path}"), "would be written over its input"),
    ];
    for (name, text, message) in cases {
        std::fs::write(folder.join("bad.toml"), text).expect("a small file");
        for command in ["check", "plan", "run"] {
            let refused = run(folder, &[command, "bad.toml"], 2);
            assert!(refused.contains(message), "{command} {name}: {refused}");
        }
        let list = plumbline_in(folder, &["check", "bad.toml", "--message-format", "json"]);
        let list: serde_json::Value = serde_json::from_slice(&list.stdout).expect("JSON");
        assert!(list.as_array().is_some_and(|list| !list.is_empty()), "{name}");
    }
    assert!(!folder.join("out").exists());
    // Inputs may come later.
    std::fs::write(folder.join("good.toml"), text.replace("\"in\"", "[\"in\", \"later.obj\"]")).expect("a small file");
    let checked = plumbline_in(folder, &["check", "good.toml"]);
    assert_eq!(checked.status.code(), Some(0), "{}", err(&checked));
    assert!(err(&checked).contains("note: there is no file `later.obj`"), "{}", err(&checked));
}

/// Nanoseconds that this thread has computed: what other programs do meanwhile is not counted.
fn cpu_ns() -> f64 {
    // The scheduler's own figure (`schedstat`) lags behind by a tick, more than the shorter of two works.
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 * 1e9 + time.tv_nsec as f64
}

#[test]
fn the_time_of_a_batch_grows_with_its_items_and_not_with_their_square() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let time = |count: usize| {
        let names: Vec<String> = (0..count).map(|i| format!("\"clip{i:06}.mp4\"")).collect();
        let text = GOOD.replace("in.mp4", "${item.path}").replace("out.mp4", "out/${item.stem}.mp4");
        let text = format!("{text}\n[batch]\nforeach = [{}]\n", names.join(", "));
        let source = Source { name: "many.toml".into(), text, base: Some(folder.path().to_owned()) };
        let before = cpu_ns();
        let pipeline = read(source, &[]).unwrap_or_else(|p| panic!("{}", p.render(false, 100)));
        assert_eq!(pipeline.instances().map(|all| all.len()).ok(), Some(count));
        cpu_ns() - before
    };
    time(1_000);
    let (few, many) = (time(3_000), time(60_000));
    // 20 times if it is linear, 400 if it is quadratic.
    assert!(many < 80.0 * few, "{few} ns and {many} ns");
}

#[test]
fn a_graph_of_many_stages_is_checked_in_time_and_without_recursion() {
    let time = |count: usize| {
        let mut text = String::from("version = 1\n[stage.s0]\nuse = \"image.load\"\npath = \"a.png\"\n");
        for i in 1..count {
            let before = i - 1;
            writeln!(text, "[stage.s{i}]\nuse = \"image.render\"\ninputs = {{ image = \"s{before}\" }}").expect("text");
        }
        let before = cpu_ns();
        let refused = read(Source { name: "long.toml".into(), text, base: None }, &[]);
        assert!(refused.is_err(), "pixels are interpolated more than once");
        cpu_ns() - before
    };
    time(100);
    let (few, many) = (time(500), time(10_000));
    assert!(many < 80.0 * few, "{few} ns and {many} ns");
}

#[cfg(unix)]
mod names_of_any_bytes {
    use super::*;
    use std::ffi::{OsStr, OsString};
    use std::os::unix::ffi::OsStrExt;
    use std::process::Command;

    /// `s\xfcd`, south in Latin-1: no UTF-8.
    fn odd(before: &str, after: &str) -> OsString {
        OsString::from_iter([OsStr::new(before), OsStr::from_bytes(b"s\xfcd"), OsStr::new(after)])
    }

    fn run_os(folder: &Path, args: &[&OsStr], exit: i32) -> (Vec<u8>, String) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_plumbline"));
        let output = command.args(args).current_dir(folder).env("NO_COLOR", "1").output().expect("the program starts");
        assert_eq!(output.status.code(), Some(exit), "{args:?}: {}", err(&output));
        (output.stdout.clone(), err(&output))
    }

    #[test]
    fn files_whose_names_are_no_utf8_are_read_named_after_written_and_up_to_date() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let folder = folder.path();
        std::fs::create_dir_all(folder.join(odd("in/", ""))).expect("a folder");
        for name in [odd("in/", ".obj"), odd("in/", "/a.obj"), odd("in/", "/b.obj")] {
            std::fs::write(folder.join(name), TRIANGLE).expect("a small file");
        }
        let text = std::fs::read_to_string(meshes(&[]).path().join("job.toml")).expect("a file");
        std::fs::write(folder.join("job.toml"), &text).expect("a small file");
        let os = OsStr::new;
        let (paths, _) = run_os(folder, &[os("run"), os("job.toml"), os("--results"), os("r.json")], 0);
        assert!(paths.windows(12).any(|w| w == b"out/s\xfcd.ply\n".get(..12).expect("as long")), "{paths:?}");
        for name in [odd("out/", ".ply"), odd("out/", "/a.ply"), odd("out/", "/b.ply")] {
            assert!(folder.join(&name).exists(), "{}", name.display());
        }
        let (_, messages) = run_os(folder, &[os("run"), os("job.toml")], 0);
        assert!(messages.contains("3 up to date, 0 to do"), "{messages}");
        // Named on the command line, in --set, with glob and suffix, and in messages.
        let foreach = OsString::from_iter([os("batch.foreach="), &odd("in/", "/*.obj")]);
        let path = OsString::from_iter([os("out.path="), &odd("other/", "_${item.stem}.ply")]);
        run_os(folder, &[os("run"), os("job.toml"), os("--set"), &foreach, os("--set"), &path], 0);
        assert!(folder.join(odd("other/", "_a.ply")).exists());
        run_os(folder, &[os("render"), &odd("in/", ".obj"), os("-o"), &odd("", ".png")], 0);
        assert!(folder.join(odd("", ".png")).exists());
        run_os(folder, &[os("render"), &odd("in/", ""), os("--out-dir"), &odd("p", ""), os("--suffix"), os("_p")], 0);
        assert!(folder.join(odd("p", "/a_p.png")).exists());
        let (_, missing) = run_os(folder, &[os("render"), &odd("no", ".obj"), os("-o"), os("x.png")], 65);
        assert!(missing.contains("nos\u{fffd}d.obj") && !missing.contains('\u{10fffc}'), "{missing}");
        // What failed is found again by its key.
        std::fs::write(folder.join(odd("in/", ".obj")), "f 1 2 3\n").expect("a small file");
        let again = [os("run"), os("job.toml"), os("--existing"), os("overwrite"), os("--results"), os("r.json")];
        run_os(folder, &again, 3);
        std::fs::write(folder.join(odd("in/", ".obj")), TRIANGLE).expect("a small file");
        let retry = [os("run"), os("job.toml"), os("--existing"), os("overwrite"), os("--retry-failed"), os("r.json")];
        let (_, messages) = run_os(folder, &retry, 0);
        assert!(messages.contains("1 of 3 items"), "{messages}");
    }

    #[test]
    fn pictures_whose_names_are_no_utf8_have_lines_beside_them() {
        let folder = pictures(&["a.png"]);
        let folder = folder.path();
        std::fs::rename(folder.join("a.png"), folder.join(odd("", ".png"))).expect("renamed");
        let os = OsStr::new;
        let args =
            ["--size", "24x24", "--faces", "off", "--lines", "auto", "--save-lines", "l", "--report", "r"].map(os);
        run_os(folder, &[&[os("retarget"), os("."), os("--out-dir"), os("out")], &args[..]].concat(), 0);
        for name in [odd("out/", ".png"), odd("l/", ".lines.json"), odd("r/", ".html")] {
            assert!(folder.join(&name).exists(), "{}", name.display());
        }
    }
}
