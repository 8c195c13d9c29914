//! Settings without a pipeline: tables by kind of stage, which give a command's options other defaults.
//!
//! ```toml
//! version = 1
//!
//! [video.smooth]
//! smoothness = 1.5
//!
//! [stage.out]              # as in a pipeline file, without inputs
//! use = "video.encode"
//! crf = 20
//! ```

use serde_json::{Map, Value as Json};

use super::check::stage_settings;
use super::file::{PipelineFile, StageEntry, VERSION};
use super::kind::StageKind;
use super::paths::{to_path, to_text};
use super::problem::{Problem, Problems};
use super::recover::{Recovered, parse_recovering};
use super::reference::Scope;
use super::settings::property_of;
use super::suggest::did_you_mean;
use super::syntax::{Entry, Node, Source, Sources, Value};
use crate::stages;

/// A file of settings.
#[derive(Clone, Debug, Default)]
pub struct PartialFile {
    sources: Sources,
    kinds: Vec<(&'static StageKind, Vec<Entry>)>,
    run: Vec<Entry>,
}

impl PartialFile {
    /// Reads and checks a file of settings.
    ///
    /// # Errors
    /// Every unknown table, kind and setting, and every value out of its range.
    pub fn read(source: Source) -> Result<Self, Problems> {
        let (mut sources, mut problems) = (Sources::default(), Vec::new());
        let id = sources.add(source);
        let Recovered { root, problems: faults, .. } = parse_recovering(&sources, id);
        problems.extend(faults);
        let mut file = Self { sources, ..Self::default() };
        for entry in root {
            file.add(&entry, &mut problems);
        }
        file.check(&mut problems);
        if problems.is_empty() { Ok(file) } else { Err(Problems::new(problems, file.sources)) }
    }

    /// Sorts in one entry of the top level.
    fn add(&mut self, entry: &Entry, problems: &mut Vec<Problem>) {
        match (entry.key.as_str(), &entry.node.value) {
            ("version", Value::Integer(VERSION)) | ("name", Value::Text(_)) => {}
            ("run", Value::Table(table)) => self.run.extend(table.iter().cloned()),
            ("stage", Value::Table(stages)) => stages.iter().for_each(|stage| self.add_stage(stage, problems)),
            (group, Value::Table(kinds)) => {
                for kind in kinds {
                    self.add_kind(&format!("{group}.{}", kind.key), kind, problems);
                }
            }
            (key, _) => {
                let known = ["version", "name", "run", "stage"].into_iter().chain(groups());
                problems.push(
                    Problem::new("unknown-key", format!("a file of settings has no `{key}`"))
                        .label(entry.key_span, "unknown")
                        .help("settings are in tables by kind of stage, such as [video.smooth]")
                        .suggest(did_you_mean(key, known)),
                );
            }
        }
    }

    /// `[stage.NAME]` with `use`, or with a kind for its name.
    fn add_stage(&mut self, entry: &Entry, problems: &mut Vec<Problem>) {
        let Value::Table(settings) = &entry.node.value else { return self.add_kind(&entry.key, entry, problems) };
        let used = settings.iter().find(|e| e.key == "use").and_then(|e| e.node.text());
        let name = used.unwrap_or(&entry.key).to_owned();
        let rest: Vec<Entry> = settings.iter().filter(|e| e.key != "use").cloned().collect();
        let table = Entry { node: Node { value: Value::Table(rest), span: entry.node.span }, ..entry.clone() };
        self.add_kind(&name, &table, problems);
    }

    fn add_kind(&mut self, name: &str, entry: &Entry, problems: &mut Vec<Problem>) {
        let Some(kind) = stages::find(name) else {
            problems.push(
                Problem::new("unknown-kind", format!("there is no stage kind `{name}`"))
                    .label(entry.key_span, "unknown kind")
                    .help("`plumbline stages` lists all")
                    .suggest(did_you_mean(name, stages::KINDS.iter().map(|k| k.name))),
            );
            return;
        };
        match &entry.node.value {
            Value::Table(settings) => self.kinds.push((kind, settings.clone())),
            _ => problems.push(
                Problem::new("bad-value", format!("`{name}` is {} (expected a table)", entry.node.type_name()))
                    .label(entry.node.span, "expected a table"),
            ),
        }
    }

    /// Checks the settings of each kind; what a command gives, such as paths, may be missing.
    fn check(&self, problems: &mut Vec<Problem>) {
        let env = |name: &str| std::env::var(name).ok();
        let scope = Scope { vars: &[], env: &env, item: None };
        let file = PipelineFile { sources: self.sources.clone(), ..PipelineFile::default() };
        for (kind, settings) in &self.kinds {
            let name = super::file::Name { text: kind.name.to_owned(), span: None };
            let stage = StageEntry {
                name,
                kind: Some(kind),
                inputs: Vec::new(),
                unsound: false,
                enable: None,
                settings: settings.clone(),
            };
            let mut found = Vec::new();
            stage_settings(&file, &stage, &scope, &mut found);
            problems.extend(found.into_iter().filter(|p| !matches!(p.code, "missing-key" | "conflict")));
        }
    }

    /// The value of a setting as a command line would give it.
    pub fn default_of(&self, kind: &str, key: &str) -> Option<Vec<String>> {
        let of_kind = self.kinds.iter().filter(|(k, _)| k.name == kind);
        let mut entries = of_kind.flat_map(|(kind, entries)| entries.iter().map(|e| (*kind, e)));
        let (kind, entry) = entries.find(|(kind, entry)| canonical(kind, &entry.key) == key)?;
        let schema = kind.json_schema();
        self.words(&entry.node, &schema["properties"][key])
    }

    /// A value as words of a command line; relative paths start from the folder of the file.
    fn words(&self, node: &Node, property: &Json) -> Option<Vec<String>> {
        Some(match &node.value {
            Value::Bool(yes) => vec![yes.to_string()],
            Value::Integer(i) => vec![i.to_string()],
            Value::Float(x) => vec![x.to_string()],
            Value::Text(text) | Value::Loose(text) => {
                let folder = node.span.and_then(|s| self.sources.get(s.source)).and_then(|s| s.base.as_ref());
                let is_path = property["format"] == "path" && text != "-";
                let path = folder.filter(|_| is_path).map(|folder| to_text(folder.join(to_path(text))));
                vec![path.unwrap_or_else(|| text.clone())]
            }
            Value::List(items) => items.iter().filter_map(|n| self.words(n, property)).flatten().collect(),
            Value::Table(_) | Value::Unknown => return None,
        })
    }

    /// Adds the settings to the stages of their kinds, where those do not have them; `options` are the kinds and settings that
    /// the command line has given already.
    pub fn apply(&self, file: &mut PipelineFile, options: &[(String, String)]) {
        file.sources = self.sources.clone();
        for stage in &mut file.stages {
            let Some(kind) = stage.kind else { continue };
            for entry in self.kinds.iter().filter(|(k, _)| k.name == kind.name).flat_map(|(_, entries)| entries) {
                let key = canonical(kind, &entry.key);
                let given = options.iter().any(|(k, s)| k == kind.name && *s == key);
                if !given && !stage.settings.iter().any(|e| e.key == key) {
                    stage.settings.push(Entry { key, ..entry.clone() });
                }
            }
        }
        for entry in &self.run {
            // One word says what is done with results that exist, in either of two keys.
            let same =
                |key: &str| key == entry.key || [key, &entry.key].iter().all(|k| ["existing", "overwrite"].contains(k));
            if !file.run.iter().any(|e| same(&e.key)) {
                file.run.push(entry.clone());
            }
        }
    }
}

/// The name of a setting where it was given by a former one.
fn canonical(kind: &StageKind, key: &str) -> String {
    let schema = kind.json_schema();
    let empty = Map::new();
    let properties = schema["properties"].as_object().unwrap_or(&empty);
    property_of(properties, key).map_or(key, |(name, _)| name).to_owned()
}

/// First words of the kinds.
fn groups() -> impl Iterator<Item = &'static str> {
    stages::KINDS.iter().filter_map(|kind| kind.name.split_once('.').map(|(group, _)| group))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<PartialFile, Problems> {
        PartialFile::read(Source { name: "mine.toml".to_owned(), text: text.to_owned(), base: Some("/etc".into()) })
    }

    #[test]
    fn settings_are_found_by_kind_whichever_way_their_table_is_named() {
        let text = "version = 1\n[video.smooth]\nmin_crop = \"70%\"\n[stage.out]\nuse = \"video.encode\"\ncrf = 20\n\
                    [stage.\"video.track\"]\nmask = \"m.png\"\n[run]\nthreads = 2\n";
        let file = read(text).unwrap_or_else(|p| panic!("{}", p.render(false, 100)));
        let default = |kind: &str, key: &str| file.default_of(kind, key).map(|words| words.join(" "));
        assert_eq!(default("video.smooth", "keep").as_deref(), Some("70%"), "by its former name");
        assert_eq!(default("video.encode", "crf").as_deref(), Some("20"));
        assert_eq!(default("video.track", "mask").as_deref(), Some("/etc/m.png"), "from the folder of the file");
        assert_eq!(default("video.smooth", "smoothness"), None);
    }

    #[test]
    fn unknown_tables_kinds_and_settings_are_errors_with_a_suggestion() {
        for (text, message, help) in [
            ("[video.smoth]\n", "there is no stage kind `video.smoth`", "did you mean `video.smooth`?"),
            ("[video.smooth]\nsmothness = 1\n", "has no setting `smothness`", "did you mean `smoothness`?"),
            ("[video.smooth]\nsmoothness = 99\n", "out of range (expected 0.05 to 30)", ""),
            ("vidoe = 1\n", "a file of settings has no `vidoe`", "did you mean `video`?"),
            ("[stage.x]\nuse = \"video.encode\"\ninputs = [\"a\"]\n", "has no setting `inputs`", ""),
        ] {
            let message_text = read(text).expect_err("a fault").render(false, 200);
            assert!(message_text.contains(message) && message_text.contains(help), "{message_text}");
        }
    }

    #[test]
    fn settings_fill_what_the_stages_do_not_have_and_options_win() {
        let file = read("[video.smooth]\nkeep = 0.7\nreserve = 0.02\n").unwrap_or_default();
        let stage = |settings: &str| {
            let mut built = PipelineFile {
                stages: vec![StageEntry {
                    name: "path".into(),
                    kind: stages::find("video.smooth"),
                    inputs: Vec::new(),
                    unsound: false,
                    enable: None,
                    settings: vec![Entry::built(settings, Value::Float(0.9))],
                }],
                ..PipelineFile::default()
            };
            file.apply(&mut built, &[]);
            built.stages[0].settings.iter().map(|e| e.key.clone()).collect::<Vec<_>>()
        };
        assert_eq!(stage("keep"), ["keep", "reserve"]);
        let mut given = PipelineFile { stages: Vec::new(), ..PipelineFile::default() };
        file.apply(&mut given, &[("video.smooth".to_owned(), "keep".to_owned())]);
        assert!(given.stages.is_empty());
    }
}
