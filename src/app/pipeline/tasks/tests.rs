use super::*;
use crate::pipeline::{read, shipped};
use crate::stages::DecodeSettings;
use plumbline_num::time::Timestamp;

struct NoProbe;

impl StageRunner for NoProbe {
    fn probe(&self, input: &Path, _: bool) -> Result<crate::pipeline::Probed, RunError> {
        Err(RunError::Input(input.display().to_string()))
    }

    fn run_pass(
        &self,
        _: &crate::pipeline::Job<'_>,
        _: &crate::pipeline::Pass,
        _: &mut crate::pipeline::ArtifactStore,
        _: &mut crate::pipeline::Summary,
    ) -> Result<(), RunError> {
        Err(RunError::Internal("no stage runs".to_owned()))
    }
}

fn plan_of(name: &str, set: &[&str], root: &Path) -> TaskPlan {
    let set: Vec<String> = set.iter().map(|s| (*s).to_owned()).collect();
    let pipeline = read(shipped::find_source(name).expect("shipped"), &set).expect("no faults");
    let instances = pipeline.instances().expect("items");
    TaskPlan::of(&pipeline, &instances, root, &NoProbe).expect("a plan")
}

#[test]
fn every_shipped_pipeline_has_a_plan_that_reads_back() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, _) in shipped::SHIPPED {
        let plan = plan_of(name, &["batch.foreach=item.x"], Path::new("."));
        let path = folder.path().join("plan.json");
        std::fs::write(&path, plan.to_text().expect("plain data")).expect("written");
        assert_eq!(TaskPlan::read(&path), Ok(plan.clone()), "{name}");
        assert!(plan.tasks[0].id.starts_with("item"), "{}", plan.tasks[0].id);
        let instance = plan.tasks[0].instance().expect("known kinds");
        assert_eq!(instance.inputs(), plan.tasks[0].inputs.iter().map(|i| to_path(&i.path)).collect::<Vec<_>>());
    }
}

#[test]
fn paths_start_from_the_root_and_those_outside_are_absolute() {
    let folder = tempfile::tempdir().expect("a folder");
    let root = folder.path().canonicalize().expect("a folder");
    std::fs::create_dir(root.join("in")).expect("a folder");
    let inside = root.join("in/a.jpg").display().to_string();
    let out = root.parent().expect("no root").join("elsewhere.jpg").display().to_string();
    let set = [format!("batch.foreach={inside}"), format!("out.path={out}")];
    let plan = plan_of("rectify", &set.each_ref().map(String::as_str), &root);
    let task = &plan.tasks[0];
    assert_eq!((task.inputs[0].path.as_str(), task.outputs.as_slice()), ("in/a.jpg", [out].as_slice()));
    // What is outside is not written unless allowed.
    assert_eq!(task.output_outside(std::slice::from_ref(&root)).as_ref(), Some(&task.outputs[0]));
    assert_eq!(task.output_outside(&[root.parent().expect("no root").to_owned()]), None);
}

#[test]
fn where_contents_are_stated_a_copy_is_unchanged_and_has_the_same_key() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.jpg");
    let plan = |seconds: u64, contents: bool| {
        std::fs::write(&path, "pixels").expect("written");
        let file = std::fs::File::options().write(true).open(&path).expect("there");
        file.set_modified(std::time::UNIX_EPOCH + std::time::Duration::from_secs(seconds)).expect("set");
        let mut plan = plan_of("rectify", &[&format!("batch.foreach={}", path.display())], folder.path());
        if contents {
            plan.state_contents(folder.path(), digest_of_file).expect("read");
        }
        // The paths of a plan start from its root, here from nowhere.
        plan.tasks[0].inputs[0].path = path.display().to_string();
        plan.tasks.remove(0)
    };
    for contents in [false, true] {
        let (first, later) = (plan(1000, contents), plan(2000, contents));
        assert_eq!(first.changed_input().is_none(), contents, "{:?}", first.inputs);
        assert_eq!(first.key == later.key, contents);
        std::fs::write(&path, "others").expect("written");
        assert!(first.changed_input().is_some_and(|input| !input.is_missing));
        std::fs::remove_file(&path).expect("removed");
        assert!(first.changed_input().is_some_and(|input| input.is_missing));
    }
}

#[test]
fn a_key_follows_settings_and_inputs() {
    let folder = tempfile::tempdir().expect("a folder");
    let root = folder.path().canonicalize().expect("a folder");
    let photo = root.join("a.jpg");
    let key = |set: &[&str]| {
        let item = format!("batch.foreach={}", photo.display());
        plan_of("rectify", &[&[item.as_str()], set].concat(), &root).tasks.remove(0).key
    };
    let missing = key(&[]);
    assert_eq!(key(&[]), missing, "the same each time");
    std::fs::write(&photo, "x").expect("written");
    let there = key(&[]);
    std::fs::write(&photo, "xy").expect("written");
    let longer = key(&[]);
    let keys = HashSet::from([missing, there, longer.clone(), key(&["out.quality=80"])]);
    assert_eq!(keys.len(), 4);
    assert_eq!(key(&["run.threads=1", "run.progress=none"]), longer, "not of the way in which it runs");
}

#[test]
fn names_are_fit_for_files_and_tell_items_apart() {
    let mut ids = Ids::default();
    let long = format!("{}/end.mp4", "x".repeat(200));
    let names: Vec<String> =
        ["clips/a.mp4", "clips a.mp4", "../-b", "süd", "", "...", &long].map(|key| ids.next(key)).to_vec();
    assert_eq!(names[..6], ["clips_a.mp4", "clips_a.mp4-2", "b", "s_d", "task", "task-2"]);
    assert!(names[6].ends_with("_end.mp4") && names.iter().all(|id| is_id(id)));
}

/// A plan of tasks that wait for others.
fn diamond() -> TaskPlan {
    let first = plan_of("rectify", &["batch.foreach=item.x"], Path::new(".")).tasks.remove(0);
    let task = |id: &str, after: &[&str]| Task {
        id: id.to_owned(),
        after: after.iter().map(|id| (*id).to_owned()).collect(),
        ..first.clone()
    };
    TaskPlan {
        format: KIND.format.to_owned(),
        version: VERSION,
        program: env!("CARGO_PKG_VERSION").to_owned(),
        tasks: vec![task("a", &[]), task("b", &["a"]), task("c", &["a"]), task("d", &["b", "c"])],
    }
}

#[test]
fn hostile_plans_are_refused() {
    let with = |change: fn(&mut TaskPlan)| {
        let mut plan = diamond();
        change(&mut plan);
        plan.check()
    };
    assert_eq!(with(|_| ()), Ok(()));
    assert!(with(|plan| plan.tasks.swap(0, 1)).expect_err("an order").contains("not before it"));
    assert!(with(|plan| plan.tasks[1].id = "a".to_owned()).expect_err("a name").contains("two tasks"));
    for id in ["", "a b", "$(rm)", "../x", "-a", "a\n"] {
        let mut plan = diamond();
        plan.tasks[3].id = id.to_owned();
        assert!(plan.check().expect_err(id).contains("no name of a task"));
    }
}

#[test]
fn exports_call_the_tasks_in_their_order() {
    let plan = diamond();
    let text =
        |format| export(&plan, Path::new("/share/my plan.json"), Path::new("/share"), &PathMap::default(), format);
    let make = text(TaskFormat::Make);
    assert!(
        make.contains("\nd: b c\n\tplumbline task run --plan '/share/my plan.json' --root /share --task d\n"),
        "{make}"
    );
    let slurm = text(TaskFormat::Slurm);
    assert_eq!((slurm.matches("sbatch").count(), slurm.matches("--array=0-1").count()), (3, 1), "{slurm}");
    let hq: toml_edit::DocumentMut = text(TaskFormat::Hq).parse().expect("TOML");
    let tasks = hq["task"].as_array_of_tables().expect("tasks");
    let deps: Vec<String> = tasks.iter().map(|task| task["deps"].to_string().trim().to_owned()).collect();
    assert_eq!(deps, ["[]", "[0]", "[0]", "[1, 2]"]);
    assert_eq!(
        tasks.get(3).expect("four")["command"].as_array().expect("words").get(4).and_then(|w| w.as_str()),
        Some("/share/my plan.json")
    );
    assert!(text(TaskFormat::Dot).contains("\"c\" -> \"d\";"));
}

/// Every clip has a minute, at 25 frames/s.
struct Minute;

impl StageRunner for Minute {
    fn probe(&self, input: &Path, playlists: bool) -> Result<crate::pipeline::Probed, RunError> {
        NoProbe.probe(input, playlists)
    }

    fn clip_seconds(&self, _: &Path) -> Result<Option<f64>, RunError> {
        Ok(Some(60.0))
    }

    fn frame_times(&self, _: &Path, _: &DecodeSettings) -> Result<Vec<Timestamp>, RunError> {
        Ok((0..1500).map(|frame| Timestamp(40 * frame)).collect())
    }

    fn run_pass(
        &self,
        job: &crate::pipeline::Job<'_>,
        pass: &crate::pipeline::Pass,
        values: &mut crate::pipeline::ArtifactStore,
        summary: &mut crate::pipeline::Summary,
    ) -> Result<(), RunError> {
        NoProbe.run_pass(job, pass, values, summary)
    }
}

fn split_plan() -> TaskPlan {
    let mut plan = plan_of("stabilize", &["batch.foreach=item.mp4"], Path::new("."));
    assert_eq!(plan.split(Path::new("."), 15.0, &Minute).expect("a clip"), Vec::<String>::new());
    plan
}

#[test]
fn a_long_clip_is_cut_into_whole_windows_and_equal_chunks() {
    let plan = split_plan();
    let ids: Vec<&str> = plan.tasks.iter().map(|task| task.id.as_str()).collect();
    let round = |name: &str| (0..4).map(|k| format!("{name}-{k}")).collect::<Vec<_>>();
    let first = ["tracks-0", "tracks-1", "tracks-2", "motion"].map(str::to_owned).to_vec();
    let parts = [first, round("leading"), round("cameras"), vec!["plan".to_owned()], round("render")].concat();
    let (whole, named) = ids.split_last().expect("tasks");
    assert_eq!(named, parts.iter().map(|part| format!("{whole}.{part}")).collect::<Vec<_>>());
    let whole = plan.task(whole).expect("there");
    let chunks = &whole.parts.as_ref().expect("parts").chunks;
    assert_eq!(chunks.iter().map(|c| c.frames.clone()).collect::<Vec<_>>(), [0..375, 375..750, 750..1125, 1125..1500]);
    assert!(chunks.windows(2).all(|pair| pair[0].end == Some(pair[1].start)) && chunks[3].end.is_none());
    assert_eq!(whole.after, named[13..]);
    assert!(
        plan.tasks[..17]
            .iter()
            .all(|task| task.part_of.as_deref() == Some(whole.id.as_str()) && task.instance().is_ok())
    );
    let text = plan.to_text().expect("plain data");
    assert_eq!(TaskPlan::parse(&text), Ok(plan.clone()));
    assert_eq!(split_plan(), plan, "the same each time");
}

#[test]
fn a_plan_names_no_folder_that_is_removed() {
    let mut plan = split_plan();
    let mut whole = plan.tasks.pop().expect("tasks");
    assert!(plan.check().expect_err("no whole").contains("which is no task"));
    whole.key = "../../../home".to_owned();
    let folder = whole.parts_folder();
    assert!(folder.contains(".plumbline/parts/") && !folder.contains(".."), "{folder}");
}
