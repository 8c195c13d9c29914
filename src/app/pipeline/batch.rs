//! Instances: one graph per item of the batch, its settings filled in, its plan made.

use std::collections::{HashMap, HashSet};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use super::check::{Pipeline, StageTemplate, resolved_vars};
use super::file::StageEntry;
use super::graph::{Graph, Stage};
use super::items::{CLIP_EXTENSIONS, Found, MESH_EXTENSIONS, PHOTO_EXTENSIONS, Search, is_glob};
use super::options::BatchSettings;
use super::paths::{shown, to_path, to_text};
use super::plan::Plan;
use super::port::PortType;
use super::problem::{Problem, Problems};
use super::records::Records;
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
    pub plan: Arc<Plan>,
}

impl Instance {
    /// Files that it writes, in the order of its stages.
    pub fn outputs(&self) -> Vec<PathBuf> {
        self.graph.stages.iter().flat_map(|s| s.settings.writes()).map(|path| to_path(&path)).collect()
    }

    /// A stage asks for losses to be errors.
    pub fn is_strict(&self) -> bool {
        self.graph.stages.iter().any(|s| s.settings.get::<EncodeSettings>().is_some_and(|encode| encode.strict))
    }

    /// Folders that it fills with files.
    pub fn folders(&self) -> Vec<PathBuf> {
        self.graph.stages.iter().flat_map(|s| s.settings.fills()).map(to_path).collect()
    }

    /// Files that it needs and that do not exist; patterns of sequences are left out.
    pub fn missing_inputs(&self) -> Vec<PathBuf> {
        let missing = |path: &&str| *path != "-" && !path.contains('%') && !is_glob(path) && !to_path(path).exists();
        let of_stage = |stage: &Stage| -> Vec<PathBuf> {
            let missing: Vec<PathBuf> = stage.settings.reads().into_iter().filter(missing).map(to_path).collect();
            let optional = !missing.is_empty() && stage.settings.to_json()["optional"] == true;
            if optional { Vec::new() } else { missing }
        };
        self.graph.stages.iter().flat_map(of_stage).collect()
    }

    /// Files that it reads.
    pub fn inputs(&self) -> Vec<PathBuf> {
        self.graph.stages.iter().flat_map(|s| s.settings.reads()).map(to_path).collect()
    }
}

impl Pipeline {
    /// One instance per item, in order; one alone without a batch.
    ///
    /// Results of the batch itself are no items of it, where a folder or a glob finds them: files below the folder that results
    /// go to, and results beside their inputs that are on record.
    ///
    /// # Errors
    /// Every fault that only shows with the items: nothing found, a setting that is wrong for an item, the same key or the same
    /// output twice, an output that is an input.
    pub fn instances(&self) -> Result<Vec<Instance>, Problems> {
        let mut problems = Vec::new();
        let env = |name: &str| std::env::var(name).ok();
        let vars = resolved_vars(&self.file, &env, &mut problems);
        let scope = Scope { vars: &vars, env: &env, item: None };
        let template = Template::new(self, &scope);
        let mut instances = match &self.batch {
            None => vec![template.instance(self.single_key(), None, &mut problems)],
            Some(batch) => template.instances(&batch.key, self.items(batch, &mut problems), &mut problems),
        };
        let mut files = Files::default();
        let own = own_results(&instances, &mut files);
        if let (Some(batch), false) = (&self.batch, own.is_empty()) {
            let kept = instances.into_iter().enumerate().filter(|(i, _)| !own.contains(i)).filter_map(|(_, i)| i.item);
            let items = kept.enumerate().map(|(index, item)| Item { index, ..item }).collect();
            problems.clear();
            instances = template.instances(&batch.key, items, &mut problems);
        }
        check_keys(&instances, &mut problems);
        check_outputs(&instances, &mut files, &mut problems);
        if problems.is_empty() { Ok(instances) } else { Err(Problems::new(problems, self.file.sources.clone())) }
    }

    fn single_key(&self) -> String {
        let file = self.graph.stages.iter().flat_map(|s| s.settings.reads()).next();
        self.file.name.clone().or(file.map(str::to_owned)).unwrap_or_else(|| "run".to_owned())
    }

    fn items(&self, batch: &BatchSettings, problems: &mut Vec<Problem>) -> Vec<Item> {
        let foreach = self.file.batch.iter().flatten().find(|e| e.key == "foreach").map(|e| &e.node);
        let span = foreach.and_then(|node| node.span);
        let extensions: &[&str] = if self.graph.gives(PortType::Mesh) {
            &MESH_EXTENSIONS
        } else if self.graph.is_still() {
            &PHOTO_EXTENSIONS
        } else {
            &CLIP_EXTENSIONS
        };
        let search = Search { base: batch.base.as_deref(), extensions, recurse: batch.recurse };
        match search.expand(batch.foreach.patterns()) {
            Ok(found) if found.is_empty() && !batch.allow_empty => {
                let patterns = batch.foreach.patterns();
                let names = patterns.iter().take(MAX_LISTED).map(|p| shown(p).into_owned()).collect::<Vec<_>>();
                let more = patterns.len().saturating_sub(MAX_LISTED);
                let more = if more > 0 { format!(" and {more} others") } else { String::new() };
                let message = format!("no file matches {}{more}", names.join(", "));
                let help = "look at the pattern, or set `allow_empty = true` if finding nothing is fine";
                problems.push(Problem::new("empty-batch", message).label(span, "matches nothing").help(help));
                Vec::new()
            }
            Ok(found) => {
                let item = |(index, Found { path, rel }): (usize, Found)| Item { path, rel, index };
                found.into_iter().enumerate().map(item).collect()
            }
            Err(bad) => {
                let one = |index: usize| match foreach.map(|node| &node.value) {
                    Some(Value::List(nodes)) => nodes.get(index).and_then(|node| node.span).or(span),
                    _ => span,
                };
                problems
                    .extend(bad.into_iter().map(|b| Problem::new("bad-value", b.message).label(one(b.index), "here")));
                Vec::new()
            }
        }
    }
}

/// Patterns that a message lists.
const MAX_LISTED: usize = 5;

/// A pipeline in which only what depends on the item is open: all else is checked and planned once for all items.
struct Template<'p> {
    pipeline: &'p Pipeline,
    scope: &'p Scope<'p>,
    /// By the stages of the graph, those that wait for the item.
    open: Vec<Option<StageTemplate<'p>>>,
    plan: Arc<Plan>,
}

impl<'p> Template<'p> {
    fn new(pipeline: &'p Pipeline, scope: &'p Scope<'p>) -> Self {
        let entries: HashMap<&str, &StageEntry> =
            pipeline.file.stages.iter().map(|stage| (stage.name.text.as_str(), stage)).collect();
        let open = |stage: &Stage| {
            let entry = entries.get(stage.name.as_str()).filter(|_| !stage.deferred.is_empty())?;
            // Its faults were reported when the pipeline was checked.
            StageTemplate::new(&pipeline.file, entry, scope, &mut Vec::new())
        };
        let open = pipeline.graph.stages.iter().map(open).collect();
        Self { pipeline, scope, open, plan: Arc::new(Plan::of(&pipeline.graph)) }
    }

    fn instances(&self, key: &str, items: Vec<Item>, problems: &mut Vec<Problem>) -> Vec<Instance> {
        let template = Node::built(Value::Text(key.to_owned()));
        let key = |item: &Item| {
            let scope = Scope { item: Some(item), ..*self.scope };
            match resolve(&template, &scope) {
                Ok(Resolved::Ready(Node { value: Value::Text(text) | Value::Loose(text), .. }, _)) => text,
                Ok(Resolved::Ready(Node { value: Value::Integer(i), .. }, _)) => i.to_string(),
                _ => to_text(&item.path),
            }
        };
        items.into_iter().map(|item| self.instance(key(&item), Some(item), problems)).collect()
    }

    fn instance(&self, key: String, item: Option<Item>, problems: &mut Vec<Problem>) -> Instance {
        let scope = Scope { item: item.as_ref(), ..*self.scope };
        let mut graph = self.pipeline.graph.clone();
        let mut planned = true;
        for (stage, open) in graph.stages.iter_mut().zip(&self.open) {
            if let Some(settings) = open.as_ref().and_then(|open| open.fill(&scope, problems)) {
                planned &= settings.over_time() == stage.settings.over_time();
                stage.settings = settings;
                stage.deferred.clear();
            }
        }
        let plan = if planned { Arc::clone(&self.plan) } else { Arc::new(Plan::of(&graph)) };
        Instance { key, item, graph, plan }
    }
}

fn check_keys(instances: &[Instance], problems: &mut Vec<Problem>) {
    let mut seen: HashMap<&str, usize> = HashMap::new();
    for (i, instance) in instances.iter().enumerate() {
        if let Some(first) = seen.insert(&instance.key, i) {
            let path =
                |i: usize| instances[i].item.as_ref().map(|item| item.path.display().to_string()).unwrap_or_default();
            let key = shown(&instance.key);
            let message = format!("items `{}` and `{}` have the same key `{key}`", path(first), path(i));
            problems.push(
                Problem::new("duplicate-key", message)
                    .help("set `batch.key` to something that differs, such as \"${item.path}\""),
            );
        }
    }
}

/// The file behind a path, so that two spellings of one file are seen to be one.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum Identity {
    /// Device and inode of a file that exists: links of either kind are seen through.
    #[cfg(unix)]
    Inode(u64, u64),
    /// Where it is, or will be.
    Path(PathBuf),
}

/// Files behind paths; folders are looked up once.
#[derive(Debug, Default)]
struct Files {
    folders: HashMap<PathBuf, Option<PathBuf>>,
}

impl Files {
    fn identity(&mut self, path: &Path) -> Identity {
        #[cfg(unix)]
        if let Ok(meta) = path.metadata() {
            use std::os::unix::fs::MetadataExt;
            return Identity::Inode(meta.dev(), meta.ino());
        }
        Identity::Path(self.resolved(path))
    }

    /// The path, its folder without links.
    fn resolved(&mut self, path: &Path) -> PathBuf {
        match (self.folder(folder_of(path)), path.file_name()) {
            (Some(folder), Some(name)) => folder.join(name),
            _ => path.canonicalize().unwrap_or_else(|_| path.to_owned()),
        }
    }

    /// A folder without links; `None` where there is none.
    fn folder(&mut self, folder: &Path) -> Option<&PathBuf> {
        if !self.folders.contains_key(folder) {
            self.folders.insert(folder.to_owned(), folder.canonicalize().ok());
        }
        self.folders.get(folder)?.as_ref()
    }
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| *p != Path::new("")).unwrap_or(Path::new("."))
}

/// Standard input and output are no files.
fn is_file(path: &PathBuf) -> bool {
    path != Path::new("-")
}

/// `folder` without `rel` at its end: the folder or root of a glob that an item was found under, or its counterpart.
fn root_of(folder: &Path, rel: &Path) -> PathBuf {
    let rel: Vec<_> = rel.components().filter(|c| *c != Component::CurDir).collect();
    let all: Vec<_> = folder.components().collect();
    let rest = all.strip_suffix(rel.as_slice()).unwrap_or(&all);
    if rest.is_empty() { PathBuf::from(".") } else { rest.iter().collect() }
}

/// Items that are results of the batch: their positions.
fn own_results(instances: &[Instance], files: &mut Files) -> HashSet<usize> {
    let (mut folders, mut results) = (HashSet::new(), HashMap::new());
    for (i, instance) in instances.iter().enumerate() {
        let Some(item) = &instance.item else { return HashSet::new() };
        for output in instance.outputs().iter().filter(|path| is_file(path)) {
            // Folders are many fewer than files.
            folders.insert((root_of(folder_of(output), &item.rel), root_of(folder_of(&item.path), &item.rel)));
            results.insert(files.identity(output), i);
        }
    }
    // Folders of results below those that were searched.
    let below = |(to, from): (PathBuf, PathBuf)| {
        let (to, from) = (files.folder(&to)?.clone(), files.folder(&from)?.clone());
        (to != from && to.starts_with(&from)).then_some((from, to))
    };
    let below: HashSet<(PathBuf, PathBuf)> = folders.into_iter().filter_map(below).collect();
    let records = Records::default();
    let mut own = HashSet::new();
    for (i, instance) in instances.iter().enumerate() {
        let Some(item) = &instance.item else { continue };
        let in_results = !below.is_empty() && item.rel != Path::new(".") && {
            let root = files.folder(&root_of(folder_of(&item.path), &item.rel)).cloned();
            let folder = files.folder(folder_of(&item.path)).cloned();
            let inside = |(from, to): &(PathBuf, PathBuf)| {
                root.as_ref() == Some(from) && folder.as_ref().is_some_and(|folder| folder.starts_with(to))
            };
            below.iter().any(inside)
        };
        let identity = files.identity(&item.path);
        let made_from = results.get(&identity).filter(|from| **from != i);
        let on_record = made_from.is_some_and(|from| records.is_result(&item.path, &instances[*from]));
        if in_results || on_record {
            own.insert(i);
        }
    }
    own
}

fn check_outputs(instances: &[Instance], files: &mut Files, problems: &mut Vec<Problem>) {
    let mut inputs: HashSet<Identity> = HashSet::new();
    for instance in instances {
        inputs.extend(instance.inputs().iter().filter(|p| is_file(p)).map(|path| files.identity(path)));
    }
    let mut written: HashMap<Identity, &str> = HashMap::new();
    for instance in instances {
        for path in [instance.outputs(), instance.folders()].concat().iter().filter(|p| is_file(p)) {
            let file = files.identity(path);
            if inputs.contains(&file) {
                let message = format!("`{}` would be written over its input", path.display());
                problems.push(Problem::new("output-is-input", message).help("write to another file or folder"));
            }
            if let Some(other) = written.insert(file, &instance.key) {
                let (other, key) = (shown(other), shown(&instance.key));
                let message = format!("`{}` would be written twice, by `{other}` and by `{key}`", path.display());
                let help = "make the output's path differ, for example with ${item.rel}, ${item.stem} or ${item.index}";
                problems.push(Problem::new("duplicate-output", message).help(help));
            }
        }
    }
}
