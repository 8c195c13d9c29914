//! Plans of tasks, run one by one as an engine would.

use std::path::Path;
use std::process::{Command, Output};

use crate::support::program::{err, names, out, plumbline_in, succeed};

/// A folder with three small photos and a pipeline for them, and its plan.
fn planned() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::create_dir(folder.path().join("in")).expect("a folder");
    for (k, name) in ["a", "b", "c d"].into_iter().enumerate() {
        let picture = image::RgbImage::from_fn(96, 64, |x, y| image::Rgb([(x * 2) as u8, (y * 3) as u8, 40 * k as u8]));
        picture.save(folder.path().join(format!("in/{name}.png"))).expect("written");
    }
    let args = ["retarget", "in", "--size", "64x64", "--out-dir", "out", "--print-pipeline"];
    let text = out(&succeed(folder.path(), &args));
    std::fs::write(folder.path().join("job.toml"), text).expect("written");
    succeed(folder.path(), &["plan", "job.toml", "--json", "-o", "plan.json"]);
    folder
}

fn run_task(folder: &Path, id: &str, more: &[&str]) -> Output {
    plumbline_in(folder, &[&["task", "run", "--plan", "plan.json", "--task", id], more].concat())
}

fn ids(folder: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(folder.join("plan.json")).expect("a plan");
    let plan: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let id = |task: &serde_json::Value| task["id"].as_str().expect("a name").to_owned();
    plan["tasks"].as_array().expect("tasks").iter().map(id).collect()
}

#[test]
fn what_an_engine_ran_is_done_for_everybody() {
    let folder = planned();
    let again = out(&succeed(folder.path(), &["plan", "job.toml", "--json"]));
    assert_eq!(again, std::fs::read_to_string(folder.path().join("plan.json")).expect("a plan"));
    let ids = ids(folder.path());
    assert_eq!(ids, ["in_a.png", "in_b.png", "in_c_d.png"]);
    // From elsewhere, as on another machine.
    let elsewhere = tempfile::tempdir().expect("a folder");
    let (plan, root) = (folder.path().join("plan.json"), folder.path().display().to_string());
    for id in &ids {
        succeed(
            elsewhere.path(),
            &["task", "run", "--plan", &plan.display().to_string(), "--root", &root, "--task", id],
        );
    }
    assert_eq!(names(&folder.path().join("out")), ["a.png", "b.png", "c d.png"]);
    let before = std::fs::read(folder.path().join("out/a.png")).expect("a result");
    let task = run_task(folder.path(), &ids[0], &[]);
    assert!(task.status.success() && err(&task).contains("up to date"), "{}", err(&task));
    assert_eq!(std::fs::read(folder.path().join("out/a.png")).expect("a result"), before);
    let all = succeed(folder.path(), &["run", "job.toml"]);
    assert!(err(&all).contains("3 up to date, 0 to do"), "{}", err(&all));
    let planned = out(&succeed(folder.path(), &["plan", "job.toml"]));
    assert!(planned.starts_with("3 items (3 up to date, 0 to do), "), "{planned}");
    let log = std::fs::read_to_string(folder.path().join("out/.plumbline/logs/in_a.png.log")).expect("a log");
    assert_eq!(log.matches("exit status 0").count(), 2, "{log}");
}

#[test]
fn tasks_give_the_results_of_the_run() {
    let folder = planned();
    succeed(folder.path(), &["run", "job.toml"]);
    let other = planned();
    for id in ids(other.path()) {
        assert!(run_task(other.path(), &id, &["--threads", "1"]).status.success());
    }
    for name in names(&folder.path().join("out")) {
        let [a, b] = [&folder, &other].map(|f| std::fs::read(f.path().join("out").join(&name)).expect("a result"));
        assert_eq!(a, b, "{name}");
    }
}

#[test]
fn make_runs_an_exported_plan() {
    let folder = planned();
    let text = out(&succeed(folder.path(), &["plan", "export", "plan.json", "--format", "make"]));
    std::fs::write(folder.path().join("Makefile"), text).expect("written");
    let program = Path::new(env!("CARGO_BIN_EXE_plumbline")).parent().expect("a folder").display().to_string();
    let path = format!("{program}:{}", std::env::var("PATH").expect("a path"));
    let made = Command::new("make").args(["-j", "2"]).current_dir(folder.path()).env("PATH", path).output();
    let made = made.expect("make runs");
    assert!(made.status.success(), "{}", err(&made));
    assert_eq!(names(&folder.path().join("out")), ["a.png", "b.png", "c d.png"]);
}

#[test]
fn a_task_says_by_its_exit_status_whether_to_try_again() {
    let folder = planned();
    let exit = |more: &[&str], id: &str| {
        let task = run_task(folder.path(), id, more);
        (task.status.code().expect("not killed"), err(&task))
    };
    let (code, text) = exit(&[], "no-such");
    assert!(code == 2 && text.contains("no task `no-such`"), "{text}");
    let (code, text) = exit(&["--root", "not-mounted"], "in_a.png");
    assert!(code == 75 && text.contains("not-mounted"), "{text}");
    std::fs::create_dir(folder.path().join("scratch")).expect("a folder");
    let (code, text) = exit(&["--write-below", "scratch"], "in_a.png");
    assert!(code == 73 && text.contains("--write-below"), "{text}");
    assert!(!folder.path().join("out").exists());
    std::fs::remove_file(folder.path().join("in/b.png")).expect("removed");
    let (code, text) = exit(&[], "in_b.png");
    assert!(code == 65 && text.contains("in/b.png"), "{text}");
    std::fs::write(folder.path().join("in/b.png"), "other").expect("written");
    let (code, text) = exit(&[], "in_b.png");
    assert!(code == 4 && text.contains("make the plan again"), "{text}");
    let plan = std::fs::read_to_string(folder.path().join("plan.json")).expect("a plan");
    let other = plan.replace(&format!("\"program\":\"{}\"", env!("CARGO_PKG_VERSION")), "\"program\":\"9.9.9\"");
    std::fs::write(folder.path().join("plan.json"), other).expect("written");
    let (code, text) = exit(&[], "in_a.png");
    assert!(code == 4 && text.contains("9.9.9"), "{text}");
    std::fs::write(folder.path().join("plan.json"), "{}").expect("written");
    assert_eq!(exit(&[], "in_a.png").0, 2);
}
