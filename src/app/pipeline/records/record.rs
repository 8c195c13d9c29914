//! A line of the file of records, and in what two of them differ.

use std::collections::{BTreeMap, BTreeSet};
use std::convert::Infallible;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value as Json};

use super::Difference;
use super::stamp::{Stamp, relative, resolved};
use crate::pipeline::batch::Instance;
use crate::pipeline::graph::{Edge, Graph, Stage};
use crate::pipeline::paths::{to_path, to_text};
use crate::pipeline::setting_paths::for_each_path;

/// One line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Record {
    /// The first result, relative to the folder.
    pub(super) name: String,
    /// Key of the item.
    pub(super) key: String,
    /// Version of the program.
    pub(super) version: String,
    /// Everything was written; false while the item is at work.
    pub(super) complete: bool,
    /// Stages by their names.
    pub(super) stages: BTreeMap<String, StageRecord>,
    /// Inputs in the order of the stages.
    pub(super) inputs: Vec<InputRecord>,
    /// Files and folders that were written.
    pub(super) outputs: Vec<OutputRecord>,
}

/// A line that adds a result to the record before it, so that an item of many results is not written as often.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Further {
    /// The first result of the item.
    pub(super) name: String,
    /// One more.
    pub(super) output: OutputRecord,
}

/// What a stage did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct StageRecord {
    /// Its kind.
    #[serde(rename = "use")]
    pub(super) kind: String,
    /// Its edges, `port = stage.output`.
    pub(super) inputs: Vec<String>,
    /// Settings other than paths that differ from their defaults.
    pub(super) set: Map<String, Json>,
}

/// A file that was read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct InputRecord {
    /// The stage that read it.
    pub(super) stage: String,
    /// Its path relative to the folder of the results: trees may be moved as a whole.
    pub(super) path: String,
    /// `None`: it was missing.
    pub(super) file: Option<Stamp>,
}

/// A file or folder that was written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct OutputRecord {
    /// Its path relative to the folder.
    pub(super) path: String,
    #[serde(flatten)]
    pub(super) file: Stamp,
}

impl Record {
    /// What would be made now, into `folder`; nothing of its results.
    pub(super) fn of(instance: &Instance, folder: &Path, name: String) -> Self {
        let stages = instance.graph.stages.iter();
        let input = |stage: &Stage, path: &str| {
            let path = to_path(path);
            let file = Stamp::of(&path);
            InputRecord { stage: stage.name.clone(), path: to_text(relative(&resolved(&path), folder)), file }
        };
        Self {
            name,
            key: instance.key.clone(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            complete: false,
            stages: stages.clone().map(|s| (s.name.clone(), StageRecord::of(&instance.graph, s))).collect(),
            inputs: stages.flat_map(|s| s.settings.reads().into_iter().map(|path| input(s, path))).collect(),
            outputs: Vec::new(),
        }
    }

    /// In what this record differs from `now`, results aside.
    pub(super) fn differences(&self, now: &Self) -> Vec<Difference> {
        let mut out = Vec::new();
        if self.version != now.version {
            out.push(Difference::Version(self.version.clone()));
        }
        out.extend(stage_differences(&self.stages, &now.stages).into_iter().map(Difference::Settings));
        let name = |input: &InputRecord| {
            to_path(&input.path).file_name().map_or_else(String::new, |n| Path::new(n).display().to_string())
        };
        for (was, is) in self.inputs.iter().zip(&now.inputs) {
            // The same file in another folder, or none in both: shared storage is mounted elsewhere, or the tree of the inputs was moved.
            let moved = was.file == is.file && name(was) == name(is);
            let text = match (&was.file, &is.file) {
                _ if was.path != is.path && !moved => format!("made from `{}`, not from `{}`", name(was), name(is)),
                (Some(a), Some(b)) if a == b => continue,
                (None, None) => continue,
                (Some(_), None) => format!("`{}` is gone", name(is)),
                (None, Some(_)) => format!("`{}` is new", name(is)),
                (Some(a), Some(b)) if a.size != b.size => {
                    format!("`{}` had {} bytes and has {}", name(is), a.size, b.size)
                }
                (Some(_), Some(_)) => format!("`{}` was written again since", name(is)),
            };
            out.push(Difference::Input(text));
        }
        if self.inputs.len() != now.inputs.len() {
            let (was, is) = (self.inputs.len(), now.inputs.len());
            out.push(Difference::Input(format!("made from {was} files, now there are {is}")));
        }
        out
    }
}

impl StageRecord {
    fn of(graph: &Graph, stage: &Stage) -> Self {
        let schema = stage.kind.json_schema();
        let defaults = stage.kind.defaults().map(|d| d.to_json()).unwrap_or_default();
        let mut settings = stage.settings.to_json();
        let differs = |(key, value): &(&String, &Json)| {
            defaults[key.as_str()] != **value && schema["properties"][key.as_str()]["format"] != "path"
        };
        for (key, value) in settings.as_object_mut().into_iter().flatten().filter(|(_, value)| value.is_object()) {
            let clear = &mut |text: &mut String, _| {
                text.clear();
                Ok(())
            };
            let Ok(()) = for_each_path::<Infallible>(&schema["properties"][key.as_str()], value, clear);
        }
        let set = settings.as_object().into_iter().flatten().filter(differs);
        let edge = |e: &Edge| format!("{} = {}.{}", e.port.name, graph.stages[e.from].name, e.output.name);
        Self {
            kind: stage.kind.name.to_owned(),
            inputs: stage.edges.iter().map(edge).collect(),
            set: set.map(|(key, value)| (key.clone(), value.clone())).collect(),
        }
    }
}

/// Stages and settings that differ, each in words.
fn stage_differences(was: &BTreeMap<String, StageRecord>, is: &BTreeMap<String, StageRecord>) -> Vec<String> {
    let mut out = Vec::new();
    for (name, a) in was {
        let Some(b) = is.get(name) else {
            out.push(format!("stage `{name}` ({}) is gone", a.kind));
            continue;
        };
        if a.kind != b.kind {
            out.push(format!("stage `{name}` was {} and is {}", a.kind, b.kind));
            continue;
        }
        if a.inputs != b.inputs {
            out.push(format!("stage `{name}` takes other inputs"));
        }
        let keys: BTreeSet<&String> = a.set.keys().chain(b.set.keys()).collect();
        let value = |set: &Map<String, Json>, key: &str| set.get(key).map_or("its default".to_owned(), Json::to_string);
        for key in keys.into_iter().filter(|key| a.set.get(*key) != b.set.get(*key)) {
            out.push(format!("`{key}` of stage `{name}` was {} and is {}", value(&a.set, key), value(&b.set, key)));
        }
    }
    let new = is.iter().filter(|(name, _)| !was.contains_key(*name));
    out.extend(new.map(|(name, stage)| format!("stage `{name}` ({}) is new", stage.kind)));
    out
}
