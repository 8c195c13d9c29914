//! The executor, with bodies that only pretend.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use plumbline::app::pipeline::execute::{Backend, Report, execute};
use plumbline::app::pipeline::progress::{Event, Progress, Silent};
use plumbline::app::pipeline::{
    ArtifactStore, Exit, InputSummary, Job, Pass, Probed, RunError, Shake, ShakeSummary, Source, StageRunner, Summary,
    read,
};
use plumbline::app::report::Segment;

use crate::pipeline::GOOD;

/// Fails, panics or stops on items named so, and notes what it was asked.
#[derive(Default)]
struct Pretender {
    asked: Mutex<Vec<String>>,
    tries: AtomicUsize,
    at_once: AtomicUsize,
    most_at_once: AtomicUsize,
}

impl StageRunner for Pretender {
    fn probe(&self, input: &Path, _: bool) -> Result<Probed, RunError> {
        Err(RunError::Input(format!("cannot open `{}`", input.display())))
    }

    fn run_pass(
        &self,
        job: &Job<'_>,
        pass: &Pass,
        values: &mut ArtifactStore,
        summary: &mut Summary,
    ) -> Result<(), RunError> {
        let now = self.at_once.fetch_add(1, Ordering::SeqCst) + 1;
        self.most_at_once.fetch_max(now, Ordering::SeqCst);
        #[expect(clippy::disallowed_methods, reason = "work that takes time, so that items overlap")]
        std::thread::sleep(std::time::Duration::from_millis(2));
        self.at_once.fetch_sub(1, Ordering::SeqCst);
        self.asked.lock().expect("not poisoned").push(format!("{} {}", job.instance.key, pass.index + 1));
        match job.instance.key.as_str() {
            "broken" => return Err(RunError::Input("`broken.mp4` is no video".into())),
            "busy" if self.tries.fetch_add(1, Ordering::SeqCst) < 2 => {
                return Err(RunError::Temporary("device busy".into()));
            }
            "panics" => panic!("index out of bounds"),
            "stop" => job.cancel.store(true, Ordering::SeqCst),
            _ => {}
        }
        job.progress.begin(pass.index, "pretend", Some(10));
        for &(stage, port) in &pass.hands_on {
            values.put(stage, port, format!("{port} of {stage}"));
        }
        for &stage in &pass.stages {
            let later = job.graph().stages[stage].edges.iter().filter(|e| !pass.stages.contains(&e.from));
            for edge in later {
                assert_eq!(values.get::<String>(edge)?, &format!("{} of {}", edge.output.name, edge.from));
            }
        }
        job.progress.frames(10);
        summary.frames = 10;
        summary.outputs = job.instance.outputs();
        Ok(())
    }
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn with(names: &[&str]) -> Self {
        let folder = Self(tempfile::tempdir().expect("a temporary folder"));
        for name in names {
            std::fs::write(folder.path(name), name).expect("a small file");
        }
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn source(&self, batch: &str) -> Source {
        let text = GOOD.replace("in.mp4", "${item.path}").replace("out.mp4", "out/${item.stem}.mp4");
        let text = format!("{text}\n[batch]\nkey = \"${{item.stem}}\"\n{batch}\n");
        Source { name: "batch.toml".into(), text, base: Some(self.0.path().to_owned()) }
    }

    fn run(&self, batch: &str, backend: &Pretender) -> Report {
        self.run_reporting(batch, &[], backend, &Silent)
    }

    fn run_reporting(&self, batch: &str, set: &[&str], backend: &Pretender, progress: &dyn Progress) -> Report {
        let set: Vec<String> = set.iter().map(|s| (*s).to_owned()).collect();
        let pipeline = read(self.source(batch), &set).unwrap_or_else(|p| panic!("{}", p.render(false, 100)));
        let instances = pipeline.instances().unwrap_or_else(|p| panic!("{}", p.render(false, 100)));
        let backend = Backend { stages: backend, workers: None };
        execute(&pipeline, &instances, backend, progress, &Arc::new(AtomicBool::new(false)))
    }

    fn refusal(&self, batch: &str, set: &[&str]) -> String {
        let set: Vec<String> = set.iter().map(|s| (*s).to_owned()).collect();
        let pipeline = read(self.source(batch), &set).unwrap_or_else(|p| panic!("{}", p.render(false, 100)));
        let problems = pipeline.instances().expect_err("refused");
        problems.render(false, 100).replace(&self.0.path().display().to_string(), "FOLDER")
    }
}

fn outcome(report: &Report) -> Vec<String> {
    let word = |r: &Option<Result<Summary, RunError>>| match r {
        None => "not started".to_owned(),
        Some(Ok(_)) => "done".to_owned(),
        Some(Err(e)) => e.to_string(),
    };
    report.items.iter().map(|i| format!("{}: {}", i.key, word(&i.result))).collect()
}

#[test]
fn one_failure_does_not_stop_the_rest() {
    let folder = Folder::with(&["a.mp4", "broken.mp4", "z.mp4"]);
    let backend = Pretender::default();
    let report = folder.run("foreach = \"*.mp4\"", &backend);
    assert_eq!(outcome(&report), ["a: done", "broken: `broken.mp4` is no video", "z: done"]);
    assert_eq!(report.exit(), Exit::Partial);
    assert_eq!(
        *backend.asked.lock().expect("not poisoned"),
        ["a 1", "a 2", "broken 1", "z 1", "z 2"],
        "items and passes in order"
    );
    assert!(!folder.path("out").exists(), "no empty folder stays behind a failure");
    let folder = Folder::with(&["a.mp4"]);
    folder.run("foreach = \"*.mp4\"", &Pretender::default());
    assert!(folder.path("out").is_dir(), "missing folders are made");
}

#[test]
fn on_error_stop_starts_nothing_more() {
    let folder = Folder::with(&["a.mp4", "broken.mp4", "z.mp4"]);
    let report = folder.run("foreach = \"*.mp4\"\non_error = \"stop\"", &Pretender::default());
    assert_eq!(outcome(&report), ["a: done", "broken: `broken.mp4` is no video", "z: not started"]);
    assert_eq!(report.exit(), Exit::Partial);
}

#[test]
fn a_lone_item_fails_with_the_status_of_its_fault() {
    let folder = Folder::with(&["broken.mp4"]);
    assert_eq!(folder.run("foreach = \"*.mp4\"", &Pretender::default()).exit(), Exit::Input);
}

#[test]
fn only_a_temporary_failure_is_tried_again() {
    let folder = Folder::with(&["broken.mp4", "busy.mp4"]);
    let backend = Pretender::default();
    let report = folder.run("foreach = \"*.mp4\"\nretries = 2", &backend);
    assert_eq!(outcome(&report), ["broken: `broken.mp4` is no video", "busy: done"]);
    assert_eq!(*backend.asked.lock().expect("not poisoned"), ["broken 1", "busy 1", "busy 1", "busy 1", "busy 2"]);
    let impatient = folder.run("foreach = \"busy.mp4\"\nretries = 1", &Pretender::default());
    assert_eq!(impatient.exit(), Exit::Temporary);
}

#[test]
fn a_panic_is_one_items_failure() {
    let folder = Folder::with(&["a.mp4", "panics.mp4", "z.mp4"]);
    let report = folder.run("foreach = \"*.mp4\"", &Pretender::default());
    assert_eq!(outcome(&report)[1], "panics: internal error: index out of bounds; please report it");
    assert_eq!(outcome(&report)[2], "z: done");
}

#[test]
fn an_interruption_ends_everything() {
    let folder = Folder::with(&["a.mp4", "stop.mp4", "z.mp4"]);
    let report = folder.run("foreach = \"*.mp4\"", &Pretender::default());
    assert_eq!(outcome(&report)[0], "a: done");
    assert!(outcome(&report)[1].starts_with("stop: interrupted"));
    assert_eq!(outcome(&report)[2], "z: not started");
    assert_eq!(report.exit(), Exit::Interrupted);
}

#[test]
fn jobs_bound_what_runs_at_once_and_change_no_result() {
    let names: Vec<String> = (0..12).map(|i| format!("clip{i:02}.mp4")).collect();
    let folder = Folder::with(&names.iter().map(String::as_str).collect::<Vec<_>>());
    let (alone, three) = (Pretender::default(), Pretender::default());
    let one_by_one = outcome(&folder.run("foreach = \"*.mp4\"", &alone));
    assert_eq!(outcome(&folder.run("foreach = \"*.mp4\"\njobs = 3", &three)), one_by_one);
    assert_eq!(alone.most_at_once.load(Ordering::SeqCst), 1);
    assert!((1..=3).contains(&three.most_at_once.load(Ordering::SeqCst)));
}

#[test]
fn an_existing_file_is_replaced_only_when_allowed() {
    let folder = Folder::with(&["a.mp4"]);
    std::fs::create_dir(folder.path("out")).expect("a folder");
    std::fs::write(folder.path("out/a.mp4"), "precious").expect("a small file");
    let backend = Pretender::default();
    let report = folder.run("foreach = \"*.mp4\"", &backend);
    assert_eq!(report.exit(), Exit::Output);
    assert!(outcome(&report)[0].contains("--overwrite"), "{:?}", outcome(&report));
    assert!(backend.asked.lock().expect("not poisoned").is_empty(), "refused before any work");
    let allowed = folder.run_reporting("foreach = \"*.mp4\"", &["run.overwrite=true"], &backend, &Silent);
    assert_eq!(allowed.exit(), Exit::Done);
}

#[test]
fn a_batch_that_cannot_be_meant_is_refused_before_any_work() {
    let folder = Folder::with(&["a.mp4", "a.mov"]);
    let all = "foreach = [\"a.mp4\", \"a.mov\"]";
    insta::assert_snapshot!("batch_same_key", folder.refusal(all, &[]));
    insta::assert_snapshot!("batch_empty", folder.refusal("foreach = \"*.mkv\"", &[]));
    let over_input = format!("out.path={}", folder.path("a.mp4").display());
    insta::assert_snapshot!("batch_over_input", folder.refusal("foreach = \"a.mp4\"", &[&over_input]));
    insta::assert_snapshot!("batch_bad_glob", folder.refusal("foreach = \"[a\"", &[]));
    let typed = folder.refusal("foreach = \"a.mp4\"", &["out.crf=${item.stem}"]);
    assert!(typed.contains("`crf` of stage `out` (video.encode) is wrong"), "{typed}");
}

#[test]
fn an_input_is_recognized_under_another_name() {
    let folder = Folder::with(&["a.mp4"]);
    let link = folder.path("link.mp4");
    std::os::unix::fs::symlink(folder.path("a.mp4"), &link).expect("a link");
    let refused = folder.refusal("foreach = \"a.mp4\"", &[&format!("out.path={}", link.display())]);
    assert!(refused.contains("would be written over its input"), "{refused}");
}

#[test]
fn an_empty_batch_may_be_allowed() {
    let folder = Folder::with(&[]);
    let report = folder.run("foreach = \"*.mp4\"\nallow_empty = true", &Pretender::default());
    assert_eq!((report.items.len(), report.exit()), (0, Exit::Done));
}

/// Notes the names of events.
#[derive(Default)]
struct Notes(Mutex<Vec<&'static str>>);

impl Progress for Notes {
    fn event(&self, event: &Event<'_>) {
        let name = match event {
            Event::RunStart { .. } => "run starts",
            Event::TaskStart { .. } => "task starts",
            Event::TaskProgress { .. } => "frames",
            Event::TaskRetry { .. } => "retry",
            Event::TaskDone { .. } => "task done",
            Event::TaskFail { .. } => "task failed",
            Event::TaskSkip { .. } => "up to date",
            Event::RunEnd { .. } => "run ends",
        };
        self.0.lock().expect("not poisoned").push(name);
    }
}

#[test]
fn events_report_the_run_in_order() {
    let folder = Folder::with(&["a.mp4", "broken.mp4"]);
    let notes = Notes::default();
    folder.run_reporting("foreach = \"*.mp4\"", &[], &Pretender::default(), &notes);
    let expected =
        ["run starts", "task starts", "frames", "frames", "task done", "task starts", "task failed", "run ends"];
    assert_eq!(*notes.0.lock().expect("not poisoned"), expected);
}

#[test]
fn a_summary_reads_well() {
    let shake = ShakeSummary { before: Shake { px: 12.34, deg: 0.45 }, after: Shake { px: 1.2, deg: 0.04 } };
    let segment = |frames, mode: &str, reason: &str| Segment {
        frames,
        mode: mode.into(),
        reason: reason.into(),
        crop: Some(0.925),
        shake: Some(shake),
    };
    let summary = Summary {
        up_to_date: false,
        input: Some(InputSummary {
            name: "tour.mov".into(),
            size: (1920, 1080),
            fps: Some(29.97),
            ..InputSummary::default()
        }),
        outputs: vec![Path::new("steady/tour.mp4").to_owned()],
        encoder: Some("libx264".into()),
        shake: Some(shake),
        frames: 300,
        size: Some((1920, 1080)),
        segments: vec![
            segment(0..250, "mesh", "points cover the picture"),
            segment(250..300, "unchanged", "too dark to follow"),
        ],
        crop: Some(0.912),
        least_crop: Some(0.88),
        readout_s: Some(0.0183),
        window: None,
        surface: None,
        lens: None,
        source_shown: None,
        lines: None,
        cached: vec!["tracks".into()],
        cut_short: false,
        warnings: vec!["2 corrupt packets were concealed".into()],
        seconds: 12.0,
        ..Summary::default()
    };
    insta::assert_snapshot!(summary);
}
