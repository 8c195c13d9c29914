//! Instances: one graph per item of the batch, its settings filled in, its plan made.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use super::check::{Pipeline, resolved_vars, stage_settings};
use super::graph::Graph;
use super::items::{CLIP_EXTENSIONS, MESH_EXTENSIONS, PHOTO_EXTENSIONS, expand};
use super::options::BatchSettings;
use super::plan::Plan;
use super::port::PortType;
use super::problem::{Problem, Problems};
use super::reference::{Item, Resolved, Scope, resolve};
use super::syntax::{Node, Value};
use crate::stages::EncodeSettings;

/// One graph to run, with nothing left open.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Its name in messages.
    pub key: String,
    /// What it works on; `None` without a batch.
    pub item: Option<Item>,
    /// Its stages.
    pub graph: Graph,
    /// Its passes.
    pub plan: Plan,
}

impl Instance {
    /// Files that it writes, in the order of its stages.
    pub fn outputs(&self) -> Vec<PathBuf> {
        self.graph.stages.iter().flat_map(|s| s.settings.writes()).map(PathBuf::from).collect()
    }

    /// A stage asks for losses to be errors.
    pub fn is_strict(&self) -> bool {
        self.graph.stages.iter().any(|s| s.settings.get::<EncodeSettings>().is_some_and(|encode| encode.strict))
    }

    /// Folders that it fills with files.
    pub fn folders(&self) -> Vec<PathBuf> {
        self.graph.stages.iter().flat_map(|s| s.settings.fills()).map(PathBuf::from).collect()
    }

    /// Files that it reads.
    pub fn inputs(&self) -> Vec<PathBuf> {
        self.graph.stages.iter().flat_map(|s| s.settings.reads()).map(PathBuf::from).collect()
    }
}

impl Pipeline {
    /// One instance per item, in order; one alone without a batch.
    ///
    /// # Errors
    /// Every fault that only shows with the items: nothing found, a setting that is wrong for an item, the same key or the same
    /// output twice, an output that is an input.
    pub fn instances(&self) -> Result<Vec<Instance>, Problems> {
        let mut problems = Vec::new();
        let env = |name: &str| std::env::var(name).ok();
        let vars = resolved_vars(&self.file, &env, &mut problems);
        let scope = Scope { vars: &vars, env: &env, item: None };
        let instances = match &self.batch {
            None => vec![self.instance(self.single_key(), None, &scope, &mut problems)],
            Some(batch) => {
                let items = self.items(batch, &mut problems);
                items.iter().map(|item| self.item_instance(batch, item, &scope, &mut problems)).collect()
            }
        };
        check_keys(&instances, &mut problems);
        check_outputs(&instances, &mut problems);
        if problems.is_empty() { Ok(instances) } else { Err(Problems::new(problems, self.file.sources.clone())) }
    }

    fn single_key(&self) -> String {
        let file = self.graph.stages.iter().flat_map(|s| s.settings.reads()).next();
        self.file.name.clone().or(file.map(str::to_owned)).unwrap_or_else(|| "run".to_owned())
    }

    fn items(&self, batch: &BatchSettings, problems: &mut Vec<Problem>) -> Vec<Item> {
        let span = self.file.batch.iter().flatten().find(|e| e.key == "foreach").and_then(|e| e.node.span);
        let extensions: &[&str] = if self.graph.gives(PortType::Mesh) {
            &MESH_EXTENSIONS
        } else if self.graph.is_still() {
            &PHOTO_EXTENSIONS
        } else {
            &CLIP_EXTENSIONS
        };
        match expand(batch.foreach.patterns(), batch.base.as_deref(), extensions) {
            Ok(paths) if paths.is_empty() && !batch.allow_empty => {
                let message = format!("no file matches {}", batch.foreach.patterns().join(", "));
                let help = "look at the pattern, or set `allow_empty = true` if finding nothing is fine";
                problems.push(Problem::new("empty-batch", message).label(span, "matches nothing").help(help));
                Vec::new()
            }
            Ok(paths) => paths.into_iter().enumerate().map(|(index, path)| Item { path, index }).collect(),
            Err(message) => {
                problems.push(Problem::new("bad-value", message).label(span, "here"));
                Vec::new()
            }
        }
    }

    fn item_instance(
        &self,
        batch: &BatchSettings,
        item: &Item,
        scope: &Scope<'_>,
        problems: &mut Vec<Problem>,
    ) -> Instance {
        let scope = Scope { item: Some(item), ..*scope };
        let template = Node::built(Value::Text(batch.key.clone()));
        let key = match resolve(&template, &scope) {
            Ok(Resolved::Ready(node, _)) => match node.value {
                Value::Text(text) | Value::Loose(text) => text,
                Value::Integer(i) => i.to_string(),
                _ => item.path.display().to_string(),
            },
            _ => item.path.display().to_string(),
        };
        self.instance(key, Some(item), &scope, problems)
    }

    fn instance(&self, key: String, item: Option<&Item>, scope: &Scope<'_>, problems: &mut Vec<Problem>) -> Instance {
        let mut graph = self.graph.clone();
        for stage in &mut graph.stages {
            let Some(entry) = self.file.stages.iter().find(|s| s.name.text == stage.name) else { continue };
            if let (Some(settings), _) = stage_settings(&self.file, entry, scope, problems) {
                stage.settings = settings;
                stage.deferred.clear();
            }
        }
        let plan = Plan::of(&graph);
        Instance { key, item: item.cloned(), graph, plan }
    }
}

fn check_keys(instances: &[Instance], problems: &mut Vec<Problem>) {
    let mut seen: HashMap<&str, usize> = HashMap::new();
    for (i, instance) in instances.iter().enumerate() {
        if let Some(first) = seen.insert(&instance.key, i) {
            let path =
                |i: usize| instances[i].item.as_ref().map(|item| item.path.display().to_string()).unwrap_or_default();
            let message = format!("items `{}` and `{}` have the same key `{}`", path(first), path(i), instance.key);
            problems.push(
                Problem::new("duplicate-key", message)
                    .help("set `batch.key` to something that differs, such as \"${item.path}\""),
            );
        }
    }
}

/// The file behind a path, so that two spellings of one file are seen to be one.
#[derive(Debug, PartialEq, Eq, Hash)]
enum Identity {
    /// Device and inode of a file that exists: links of either kind are seen through.
    #[cfg(unix)]
    Inode(u64, u64),
    /// Where it is, or will be.
    Path(PathBuf),
}

fn identity(path: &Path) -> Identity {
    #[cfg(unix)]
    if let Ok(meta) = path.metadata() {
        use std::os::unix::fs::MetadataExt;
        return Identity::Inode(meta.dev(), meta.ino());
    }
    Identity::Path(resolved(path))
}

fn resolved(path: &Path) -> PathBuf {
    if let Ok(found) = path.canonicalize() {
        return found;
    }
    let parent = path.parent().filter(|p| *p != Path::new("")).unwrap_or(Path::new("."));
    match (parent.canonicalize(), path.file_name()) {
        (Ok(parent), Some(name)) => parent.join(name),
        _ => path.to_owned(),
    }
}

fn check_outputs(instances: &[Instance], problems: &mut Vec<Problem>) {
    let standard = Path::new("-");
    let files = |paths: Vec<PathBuf>| {
        paths.into_iter().filter(|p| p != standard).map(|p| (identity(&p), p)).collect::<Vec<_>>()
    };
    let mut inputs: HashSet<Identity> = HashSet::new();
    for instance in instances {
        inputs.extend(files(instance.inputs()).into_iter().map(|(file, _)| file));
    }
    let mut written: HashMap<Identity, &str> = HashMap::new();
    for instance in instances {
        for (file, path) in files([instance.outputs(), instance.folders()].concat()) {
            if inputs.contains(&file) {
                let message = format!("`{}` would be written over its input", path.display());
                problems.push(Problem::new("output-is-input", message).help("write to another file or folder"));
            }
            if let Some(other) = written.insert(file, &instance.key) {
                let message =
                    format!("`{}` would be written twice, by `{other}` and by `{}`", path.display(), instance.key);
                let help = "make the output's path differ, for example with ${item.stem} or ${item.index}";
                problems.push(Problem::new("duplicate-output", message).help(help));
            }
        }
    }
}
