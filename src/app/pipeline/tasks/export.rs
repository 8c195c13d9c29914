//! A plan in the languages of other programs: a makefile, job arrays of Slurm, a job of HyperQueue, a drawing.
//!
//! What they call is `plumbline task run` alone, so that they need to know of nothing but names, order and resources.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::path::Path;

use clap::ValueEnum;

use super::{PathMap, Task, TaskPlan};
use crate::pipeline::paths::to_text;

/// A language that a plan can be written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum TaskFormat {
    /// A makefile: `make -j 4 -f FILE`
    Make,
    /// A shell script that submits job arrays to Slurm
    Slurm,
    /// A job definition for HyperQueue: `hq job submit-file FILE`
    Hq,
    /// A drawing for Graphviz
    Dot,
}

/// `plan`, which is at the path `file`, for another program; `root` is the folder of its paths on the machines that run it, which have
/// other folders where `map` says.
pub fn export(plan: &TaskPlan, file: &Path, root: &Path, map: &PathMap, format: TaskFormat) -> String {
    let rules = map.rules().iter().flat_map(|rule| ["--path-map".to_owned(), rule.to_text()]).collect();
    let call = Call { plan: to_text(file), root: to_text(root), rules };
    match format {
        TaskFormat::Make => make(plan, &call),
        TaskFormat::Slurm => slurm(plan, &call),
        TaskFormat::Hq => hq(plan, &call),
        TaskFormat::Dot => dot(plan),
    }
}

/// What runs a task.
struct Call {
    plan: String,
    root: String,
    /// Arguments for folders that are elsewhere.
    rules: Vec<String>,
}

impl Call {
    /// Arguments in front of the name of the task.
    fn words(&self) -> Vec<&str> {
        let start = ["plumbline", "task", "run", "--plan", &self.plan, "--root", &self.root];
        start.into_iter().chain(self.rules.iter().map(String::as_str)).chain(["--task"]).collect()
    }

    /// The same for a shell.
    fn line(&self) -> String {
        self.words().into_iter().map(quoted).collect::<Vec<_>>().join(" ")
    }
}

/// A word for a POSIX shell.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-+,=:@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

fn make(plan: &TaskPlan, call: &Call) -> String {
    let run = call.line().replace('$', "$$");
    let names: Vec<&str> = plan.tasks.iter().map(|task| task.id.as_str()).collect();
    let mut out = format!("# Tasks that are done already end at once.\n.PHONY: all {}\n", names.join(" "));
    let _ = writeln!(out, "all: {}", names.join(" "));
    for task in &plan.tasks {
        let _ = write!(out, "\n{}: {}\n\t{run} {}\n", task.id, task.after.join(" "), task.id);
    }
    out
}

/// Tasks by how many others they wait for in a row.
fn levels(plan: &TaskPlan) -> Vec<Vec<&Task>> {
    let mut level_of: HashMap<&str, usize> = HashMap::new();
    let mut levels: Vec<Vec<&Task>> = Vec::new();
    for task in &plan.tasks {
        let level = task.after.iter().map(|id| level_of[id.as_str()] + 1).max().unwrap_or(0);
        level_of.insert(&task.id, level);
        levels.resize(levels.len().max(level + 1), Vec::new());
        levels[level].push(task);
    }
    levels
}

/// Tasks of an array at most: sites allow from a thousand on.
const MAX_ARRAY: usize = 1000;

fn slurm(plan: &TaskPlan, call: &Call) -> String {
    let mut out =
        "#!/bin/sh\n# Submits one job array per thousand tasks. A task that failed for a reason that may be gone is \
                   tried again by running this script again: tasks that are done end at once.\nset -eu\n"
            .to_owned();
    let _ = writeln!(out, "after=");
    for level in levels(plan) {
        let _ = writeln!(out, "jobs=");
        for part in level.chunks(MAX_ARRAY) {
            let most = |of: fn(&Task) -> u64| part.iter().map(|task| of(task)).max().unwrap_or(1);
            let (cpus, memory) = (most(|t| t.resources.cpus as u64), most(|t| t.resources.memory_mb));
            let minutes = most(|t| t.timeout_s).div_ceil(60);
            let names: Vec<&str> = part.iter().map(|task| task.id.as_str()).collect();
            let last = part.len() - 1;
            let _ = writeln!(
                out,
                "job=$(sbatch --parsable $after --job-name=plumbline --array=0-{last} --cpus-per-task={cpus} --mem={memory}M \
                 --time={minutes} <<'ARRAY'\n#!/bin/sh\nset -- {}\nshift \"$SLURM_ARRAY_TASK_ID\"\nexec {} \"$1\" --threads \
                 \"$SLURM_CPUS_PER_TASK\"\nARRAY\n)\njobs=\"$jobs:${{job%%;*}}\"",
                names.join(" "),
                call.line()
            );
        }
        let _ = writeln!(out, "after=\"--dependency=afterok$jobs\"");
    }
    let _ = writeln!(out, "echo \"submitted: $jobs\"");
    out
}

fn hq(plan: &TaskPlan, call: &Call) -> String {
    let number: HashMap<&str, usize> = plan.tasks.iter().enumerate().map(|(i, task)| (task.id.as_str(), i)).collect();
    let text = |word: &str| toml_edit::Value::from(word).to_string().trim().to_owned();
    let mut out = "name = \"plumbline\"\n".to_owned();
    for (i, task) in plan.tasks.iter().enumerate() {
        let words: Vec<String> = call.words().into_iter().chain([task.id.as_str()]).map(text).collect();
        let deps: Vec<String> = task.after.iter().map(|id| number[id.as_str()].to_string()).collect();
        let _ = write!(
            out,
            "\n[[task]]\nid = {i}\ncommand = [{}]\ndeps = [{}]\ntime_limit = \"{}s\"\ncrash_limit = {}\n\n[[task.request]]\n\
             resources = {{ \"cpus\" = {} }}\n",
            words.join(", "),
            deps.join(", "),
            task.timeout_s,
            task.retries + 1,
            task.resources.cpus
        );
    }
    out
}

fn dot(plan: &TaskPlan) -> String {
    let mut out = "digraph plan {\n    rankdir = LR;\n    node [shape = box];\n".to_owned();
    for task in &plan.tasks {
        let _ = writeln!(out, "    \"{}\";", task.id);
        for before in &task.after {
            let _ = writeln!(out, "    \"{before}\" -> \"{}\";", task.id);
        }
    }
    out + "}\n"
}
