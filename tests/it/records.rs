//! Batches that are run again: what is up to date, what differs, what was left over.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use plumbline::app::pipeline::execute::{Backend, Report, execute};
use plumbline::app::pipeline::progress::Silent;
use plumbline::app::pipeline::records::Records;
use plumbline::app::pipeline::{
    ArtifactStore, Exit, Instance, Job, Pass, Pipeline, Probed, RunError, Source, StageRunner, Summary, read,
};

use crate::pipeline::GOOD;

/// Writes what the stages of a pass would write: the motion file in the first, clip and report in the second.
#[derive(Default)]
struct Writer {
    /// Passes that ran.
    ran: Mutex<Vec<String>>,
    /// Key of the item at whose second pass the run is interrupted.
    stop_at: Option<String>,
}

impl StageRunner for Writer {
    fn probe(&self, input: &Path, _: bool) -> Result<Probed, RunError> {
        Err(RunError::Input(input.display().to_string()))
    }

    fn run_pass(
        &self,
        job: &Job<'_>,
        pass: &Pass,
        _: &mut ArtifactStore,
        summary: &mut Summary,
    ) -> Result<(), RunError> {
        let key = &job.instance.key;
        self.ran.lock().expect("not poisoned").push(format!("{key} {}", pass.index + 1));
        if key == "broken" {
            return Err(RunError::Input("`broken.mp4` is no video".into()));
        }
        if pass.index == 1 && self.stop_at.as_ref() == Some(key) {
            job.cancel.store(true, Ordering::SeqCst);
            return Err(RunError::Interrupted);
        }
        for &stage in &pass.stages {
            for path in job.graph().stages[stage].settings.writes() {
                assert!(job.overwrite || !Path::new(&path).exists(), "{path} would be replaced");
                std::fs::write(&path, format!("of {key}")).expect("written");
                job.publishing(Path::new(&path), Path::new(&path))?;
                summary.outputs.push(path.into());
            }
        }
        Ok(())
    }
}

impl Writer {
    fn ran(&self) -> Vec<String> {
        self.ran.lock().expect("not poisoned").clone()
    }
}

/// A folder with clips `in/NAME.mp4`, and a pipeline that writes `out/NAME.mp4` and `out/NAME.json`.
struct Job60(tempfile::TempDir);

impl Job60 {
    fn with(names: &[&str]) -> Self {
        let folder = Self(tempfile::tempdir().expect("a temporary folder"));
        std::fs::create_dir(folder.path("in")).expect("a folder");
        for name in names {
            std::fs::write(folder.path(&format!("in/{name}.mp4")), name).expect("a small file");
        }
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn pipeline(&self, set: &[&str]) -> Pipeline {
        let exported = "[stage.saved]\nuse = \"video.motion_export\"\ninputs = [\"motion\", \"tracks\"]\n\
                        path = \"out/${item.stem}.json\"\n";
        let text = GOOD.replace("in.mp4", "${item.path}").replace("out.mp4", "out/${item.stem}.mp4");
        let text = format!("{text}\n{exported}\n[batch]\nkey = \"${{item.stem}}\"\nforeach = \"in\"\n");
        let source = Source { name: "batch.toml".into(), text, base: Some(self.0.path().to_owned()) };
        let set: Vec<String> = set.iter().map(|s| (*s).to_owned()).collect();
        read(source, &set).unwrap_or_else(|p| panic!("{}", p.render(false, 100)))
    }

    fn instances(&self, set: &[&str]) -> Vec<Instance> {
        self.pipeline(set).instances().unwrap_or_else(|p| panic!("{}", p.render(false, 100)))
    }

    fn run(&self, set: &[&str], writer: &Writer) -> Report {
        let pipeline = self.pipeline(set);
        let instances = self.instances(set);
        execute(
            &pipeline,
            &instances,
            Backend { stages: writer, workers: None },
            &Silent,
            &Arc::new(AtomicBool::new(false)),
        )
    }

    /// The error of the one item that fails.
    fn refused(&self, set: &[&str]) -> String {
        let writer = Writer::default();
        let report = self.run(set, &writer);
        assert_eq!(writer.ran(), [""; 0], "refused before any work");
        let errors: Vec<String> = report.failures().map(|(_, error)| error.to_string()).collect();
        assert_eq!(errors.len(), 1, "{errors:?}");
        errors[0].replace(&self.0.path().display().to_string(), "FOLDER")
    }

    fn record(&self) -> PathBuf {
        self.path("out/.plumbline/done.jsonl")
    }

    fn lines(&self) -> Vec<serde_json::Value> {
        let text = std::fs::read_to_string(self.record()).expect("a record");
        text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
    }
}

fn outcome(report: &Report) -> Vec<String> {
    let word = |result: &Option<Result<Summary, RunError>>| match result {
        None => "not started".to_owned(),
        Some(Ok(summary)) if summary.up_to_date => "up to date".to_owned(),
        Some(Ok(_)) => "done".to_owned(),
        Some(Err(error)) => error.to_string(),
    };
    report.items.iter().map(|item| format!("{}: {}", item.key, word(&item.result))).collect()
}

/// Gives a file another time of change, as later writing would.
fn age(path: &Path) {
    let file = std::fs::File::options().append(true).open(path).expect("a file");
    let before = file.metadata().and_then(|meta| meta.modified()).expect("a time");
    file.set_modified(before + std::time::Duration::from_secs(2)).expect("another time");
}

#[test]
fn a_finished_batch_run_again_is_up_to_date_and_does_nothing() {
    let job = Job60::with(&["a", "b", "c"]);
    assert_eq!(outcome(&job.run(&[], &Writer::default())), ["a: done", "b: done", "c: done"]);
    let writer = Writer::default();
    // What changes no result is not compared.
    let report = job.run(&["run.threads=3", "batch.jobs=2", "batch.retries=1", "run.progress=none"], &writer);
    assert_eq!(outcome(&report), ["a: up to date", "b: up to date", "c: up to date"]);
    assert_eq!((report.exit(), report.up_to_date(), writer.ran().len()), (Exit::Done, 3, 0));
    // A new input is the only one at work.
    std::fs::write(job.path("in/b2.mp4"), "new").expect("a small file");
    let report = job.run(&[], &writer);
    assert_eq!(outcome(&report), ["a: up to date", "b: up to date", "b2: done", "c: up to date"]);
    // A result that is gone is made again, beside the other that is there.
    std::fs::remove_file(job.path("out/a.mp4")).expect("removed");
    assert_eq!(outcome(&job.run(&[], &Writer::default()))[0], "a: done");
    assert_eq!(job.run(&[], &Writer::default()).up_to_date(), 4);
}

#[test]
fn what_an_interrupted_run_left_is_made_again() {
    let job = Job60::with(&["a", "b", "c"]);
    let writer = Writer { stop_at: Some("b".into()), ..Writer::default() };
    let report = job.run(&[], &writer);
    assert_eq!(outcome(&report)[0], "a: done");
    assert!(job.path("out/b.json").exists() && !job.path("out/b.mp4").exists(), "half of its results");
    let complete = |name: &str| job.lines().iter().any(|line| line["name"] == name && line["complete"] == true);
    assert!(complete("a.mp4") && !complete("b.mp4"), "{:?}", job.lines());
    let writer = Writer::default();
    assert_eq!(outcome(&job.run(&[], &writer)), ["a: up to date", "b: done", "c: done"]);
    assert_eq!(writer.ran(), ["b 1", "b 2", "c 1", "c 2"]);
    // What was changed in between is not.
    let job = Job60::with(&["a"]);
    job.run(&[], &Writer { stop_at: Some("a".into()), ..Writer::default() });
    std::fs::write(job.path("out/a.json"), "precious").expect("a small file");
    assert!(job.refused(&[]).contains("result altered: `FOLDER/out/a.json`"), "{}", job.refused(&[]));
    // Nor is what others put in the place of the missing result.
    let job = Job60::with(&["a"]);
    job.run(&[], &Writer { stop_at: Some("a".into()), ..Writer::default() });
    std::fs::write(job.path("out/a.mp4"), "precious").expect("a small file");
    let refused = job.refused(&[]);
    assert!(refused.starts_with("`FOLDER/out/a.mp4` exists, not made by a run that is on record"), "{refused}");
}

#[test]
fn each_difference_is_named_and_the_result_stays() {
    let job = Job60::with(&["a"]);
    job.run(&[], &Writer::default());
    let refused = |set: &[&str], words: &[&str]| {
        let message = job.refused(set);
        assert!(message.starts_with("`FOLDER/out/a.mp4` exists and is not up to date: "), "{message}");
        assert!(message.contains("--overwrite"), "{message}");
        for word in words {
            assert!(message.contains(word), "{word}: {message}");
        }
        assert_eq!(std::fs::read_to_string(job.path("out/a.mp4")).expect("it stays"), "of a");
    };
    refused(&["out.crf=20"], &["settings changed: `crf` of stage `out` was its default and is 20"]);
    refused(&["motion.cameras=true", "path.keep=0.7"], &["`cameras` of stage `motion`", "`keep` of stage `path`"]);
    let text = std::fs::read_to_string(job.record()).expect("a record");
    std::fs::write(job.record(), text.replace(env!("CARGO_PKG_VERSION"), "0.0.1")).expect("written");
    refused(&[], &["version changed: made by plumbline 0.0.1"]);
    std::fs::write(job.record(), &text).expect("written");
    age(&job.path("in/a.mp4"));
    refused(&[], &["input changed: `a.mp4` was written again since"]);
    std::fs::write(job.path("in/a.mp4"), "longer").expect("written");
    refused(&[], &["input changed: `a.mp4` had 1 bytes and has 6"]);
    // A mask that was not there before is another setting and another input.
    std::fs::write(job.path("mask.png"), "").expect("written");
    let mask = format!("tracks.mask={}", job.path("mask.png").display());
    refused(&[&mask], &["made from 1 files, now there are 2"]);
}

#[test]
fn results_that_are_not_on_record_or_were_altered_are_refused_by_name() {
    let job = Job60::with(&["a"]);
    std::fs::create_dir(job.path("out")).expect("a folder");
    std::fs::write(job.path("out/a.mp4"), "precious").expect("a small file");
    assert!(job.refused(&[]).contains("not made by a run that is on record"));
    assert!(!job.path("out/.plumbline").exists(), "nothing was made");
    assert_eq!(job.run(&["run.existing=overwrite"], &Writer::default()).exit(), Exit::Done);
    assert_eq!(job.run(&[], &Writer::default()).up_to_date(), 1, "replaced, it is on record");
    std::fs::write(job.path("out/a.json"), "edited").expect("a small file");
    assert!(job.refused(&[]).contains("result altered: `FOLDER/out/a.json` is not as it was written"));
    // As before: nothing that exists is touched, up to date or not.
    let job = Job60::with(&["a"]);
    job.run(&[], &Writer::default());
    assert!(job.refused(&["run.existing=refuse"]).contains("exists; allow to replace it with --overwrite"));
    assert_eq!(outcome(&job.run(&["run.overwrite=true"], &Writer::default())), ["a: done"]);
}

#[test]
fn a_record_is_read_past_torn_lines_and_what_is_no_record() {
    let job = Job60::with(&["a", "b"]);
    job.run(&[], &Writer::default());
    let text = std::fs::read_to_string(job.record()).expect("a record");
    // The kill came in the middle of a line; the next line begins on its own.
    let torn = format!("\u{0}\u{1}garbage\n{{}}\n[1]\n{text}{}", &text[..40]);
    std::fs::write(job.record(), torn).expect("written");
    std::fs::write(job.path("in/c.mp4"), "c").expect("written");
    assert_eq!(outcome(&job.run(&[], &Writer::default())), ["a: up to date", "b: up to date", "c: done"]);
    assert_eq!(job.run(&[], &Writer::default()).up_to_date(), 3);
    // A record that cannot be written costs no result.
    let job = Job60::with(&["a"]);
    std::fs::create_dir_all(job.path("out")).expect("a folder");
    std::fs::write(job.path("out/.plumbline"), "in the way").expect("written");
    let report = job.run(&[], &Writer::default());
    let warnings: Vec<_> = report.done().flat_map(|(_, summary)| summary.warnings.clone()).collect();
    assert!(warnings.iter().any(|w| w.starts_with("not on record")), "{warnings:?}");
    assert_eq!(report.exit(), Exit::Done);
}

#[test]
fn several_runs_append_to_one_record_and_old_lines_are_dropped() {
    let all: Vec<String> = (0..40).map(|i| format!("n{i:02}")).collect();
    let job = Job60::with(&all.iter().map(String::as_str).collect::<Vec<_>>());
    job.run(&[], &Writer::default());
    let instances = job.instances(&[]);
    std::thread::scope(|scope| {
        for records in [Records::default(), Records::default(), Records::default()] {
            let instances = &instances;
            scope.spawn(move || {
                for instance in instances {
                    records.note(instance, &instance.outputs()).expect("noted");
                }
                records.compact().expect("shortened");
            });
        }
    });
    assert!(job.lines().len() >= all.len(), "every line is whole");
    assert_eq!(job.run(&[], &Writer::default()).up_to_date(), all.len());
    // One run after the other, the file stays short.
    for _ in 0..8 {
        let records = Records::default();
        for instance in &instances {
            records.note(instance, &instance.outputs()).expect("noted");
        }
        records.compact().expect("shortened");
    }
    assert!(job.lines().len() <= 3 * all.len() + 64, "{} lines", job.lines().len());
    assert_eq!(job.run(&[], &Writer::default()).up_to_date(), all.len());
}
