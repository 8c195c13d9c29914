//! Tasks on a machine that has shared folders elsewhere.

use std::path::{Path, PathBuf};
use std::process::Output;

use crate::support::program::{command, err, names, out, plumbline_in, succeed};

/// A share with a root, and a photo and the folder of results beside the root; mounted elsewhere after the plan was made.
struct Share {
    folder: tempfile::TempDir,
    planned: PathBuf,
    mounted: PathBuf,
}

impl Share {
    fn new() -> Self {
        Self::with_result("planned/results/a.png")
    }

    /// `result`: its path below the share.
    fn with_result(result: &str) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let base = folder.path().canonicalize().expect("a folder");
        let (planned, mounted) = (base.join("planned"), base.join("mounted"));
        for name in ["root", "planned/media", "planned/results"] {
            std::fs::create_dir_all(base.join(name)).expect("a folder");
        }
        let picture = image::RgbImage::from_fn(96, 64, |x, y| image::Rgb([(x * 2) as u8, (y * 3) as u8, 40]));
        picture.save(planned.join("media/a.png")).expect("written");
        let root = base.join("root");
        let (photo, result) = (text(&planned.join("media/a.png")), text(&base.join(result)));
        let args = ["retarget", &photo, "-o", &result, "--size", "64x64", "--print-pipeline"];
        std::fs::write(root.join("job.toml"), out(&succeed(&root, &args))).expect("written");
        succeed(&root, &["plan", "job.toml", "--json", "-o", "plan.json"]);
        std::fs::rename(&planned, &mounted).expect("mounted elsewhere");
        Self { folder, planned, mounted }
    }

    fn root(&self) -> PathBuf {
        self.folder.path().join("root")
    }

    fn rule(&self) -> String {
        format!("{}={}", self.planned.display(), self.mounted.display())
    }

    fn id(&self) -> String {
        let text = std::fs::read_to_string(self.root().join("plan.json")).expect("a plan");
        let plan: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        plan["tasks"][0]["id"].as_str().expect("a name").to_owned()
    }

    fn task(&self, more: &[&str]) -> Output {
        let id = self.id();
        plumbline_in(&self.root(), &[&["task", "run", "--plan", "plan.json", "--task", &id], more].concat())
    }
}

fn text(path: &Path) -> String {
    path.display().to_string()
}

#[test]
fn a_task_finds_its_files_where_this_machine_has_them() {
    let share = Share::new();
    let results = text(&share.mounted.join("results"));
    let below = ["--write-below", results.as_str()];
    // Without a rule the results would be written where nobody looks for them.
    let lost = share.task(&[]);
    assert!(lost.status.code() == Some(73) && err(&lost).contains("--write-below"), "{}", err(&lost));
    assert!(!share.planned.exists());
    // A rule is no permission to write.
    let outside = share.task(&["--path-map", &share.rule()]);
    assert!(outside.status.code() == Some(73) && err(&outside).contains(&results), "{}", err(&outside));
    assert_eq!(names(&share.mounted.join("results")), Vec::<String>::new());
    let done = share.task(&[&["--path-map", &share.rule()], &below[..]].concat());
    assert!(done.status.success(), "{}", err(&done));
    assert_eq!(names(&share.mounted.join("results")), ["a.png"]);
    let again = share.task(&[&["--path-map", &share.rule()], &below[..]].concat());
    assert!(err(&again).contains("up to date"), "{}", err(&again));
    // The same by the variable of the machine, and where the folder is back at its own name.
    let args = ["task", "run", "--plan", "plan.json", "--task", &share.id(), "--write-below", &results];
    let by_variable = command(&share.root(), &args).env("PLUMBLINE_PATH_MAP", share.rule()).output().expect("it runs");
    assert!(err(&by_variable).contains("up to date"), "{}", err(&by_variable));
    std::fs::rename(&share.mounted, &share.planned).expect("mounted as planned");
    let planned = text(&share.planned.join("results"));
    let home = share.task(&["--write-below", &planned]);
    assert!(home.status.success() && err(&home).contains("up to date"), "{}", err(&home));
}

#[test]
fn a_result_made_of_a_file_mounted_elsewhere_is_up_to_date_where_it_is_not() {
    let share = Share::with_result("root/out/a.png");
    let missing = share.task(&[]);
    assert!(missing.status.code() == Some(65) && err(&missing).contains("media/a.png"), "{}", err(&missing));
    let done = share.task(&["--path-map", &share.rule()]);
    assert!(done.status.success(), "{}", err(&done));
    std::fs::rename(&share.mounted, &share.planned).expect("mounted as planned");
    let home = share.task(&[]);
    assert!(home.status.success() && err(&home).contains("up to date"), "{}", err(&home));
    let run = succeed(&share.root(), &["run", "job.toml", "--existing", "skip"]);
    assert!(err(&run).contains("up to date"), "{}", err(&run));
    // Another file in its place is another input.
    let photo = share.planned.join("media/a.png");
    image::RgbImage::new(96, 64).save(photo).expect("written");
    let run = plumbline_in(&share.root(), &["run", "job.toml", "--existing", "skip"]);
    assert!(run.status.code() == Some(73) && err(&run).contains("input changed"), "{}", err(&run));
}

#[test]
fn rules_that_lead_elsewhere_are_refused() {
    let share = Share::new();
    let refused = |rule: &str, code: i32, fault: &str| {
        let task = share.task(&["--path-map", rule]);
        assert!(task.status.code() == Some(code) && err(&task).contains(fault), "{rule}: {}", err(&task));
    };
    refused("media=/x", 2, "two absolute folders");
    refused("/media=/x/../etc", 2, "without `..`");
    let variable = command(&share.root(), &["task", "run", "--plan", "plan.json", "--task", &share.id()])
        .env("PLUMBLINE_PATH_MAP", "x")
        .output()
        .expect("it runs");
    assert!(variable.status.code() == Some(2) && err(&variable).contains("PLUMBLINE_PATH_MAP"), "{}", err(&variable));
    // A link below the folder of results that leads out of it is no result below it.
    let outside = share.folder.path().join("outside");
    std::fs::create_dir(&outside).expect("a folder");
    std::fs::rename(share.mounted.join("results"), share.mounted.join("real")).expect("renamed");
    #[cfg(unix)]
    std::os::unix::fs::symlink(&outside, share.mounted.join("results")).expect("a link");
    let media = text(&share.mounted);
    let rule = share.rule();
    let linked = share.task(&["--path-map", &rule, "--write-below", &media]);
    assert!(linked.status.code() == Some(73), "{}", err(&linked));
    assert_eq!(std::fs::read_dir(&outside).expect("a folder").count(), 0);
    // A plan that was changed to leave the mapped folder.
    let plan = std::fs::read_to_string(share.root().join("plan.json")).expect("a plan");
    let planned = text(&share.planned);
    let other = plan.replace(&format!("{planned}/results"), &format!("{planned}/../../results"));
    assert_ne!(plan, other);
    std::fs::write(share.root().join("plan.json"), other).expect("written");
    refused(&rule, 2, "by `..`");
}

#[test]
fn engines_and_exports_pass_rules_on() {
    let share = Share::new();
    let rule = share.rule();
    for format in ["make", "slurm", "hq"] {
        let args = ["plan", "export", "plan.json", "--format", format, "--path-map", &rule, "--path-map", "/a b=/c"];
        let text = out(&succeed(&share.root(), &args));
        assert!(text.contains(&rule) && text.contains("/a b=/c"), "{format}: {text}");
    }
    let builtin = plumbline_in(&share.root(), &["run", "job.toml", "--path-map", &rule]);
    assert!(builtin.status.code() == Some(2) && err(&builtin).contains("--engine dask"), "{}", err(&builtin));
    let twice = ["plan", "export", "plan.json", "--format", "dot", "--path-map", "/a=/b", "--path-map", "/a=/c"];
    assert_eq!(plumbline_in(&share.root(), &twice).status.code(), Some(2));
    std::fs::rename(&share.mounted, &share.planned).expect("mounted as planned");
    // A program in the place of HyperQueue's prints the job that it is given.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let bin = share.folder.path().join("bin");
        std::fs::create_dir(&bin).expect("a folder");
        std::fs::write(bin.join("hq"), "#!/bin/sh\ncat \"$3\"\n").expect("written");
        std::fs::set_permissions(bin.join("hq"), std::fs::Permissions::from_mode(0o755)).expect("set");
        let path = format!("{}:{}", bin.display(), std::env::var("PATH").expect("a path"));
        let args = ["run", "job.toml", "--engine", "hq", "--path-map", &rule];
        let job = command(&share.root(), &args).env("PATH", path).output().expect("it runs");
        assert!(job.status.success() && out(&job).contains(&format!("\"--path-map\", \"{rule}\"")), "{}", err(&job));
    }
}
