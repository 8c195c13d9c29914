//! A pipeline file as it was written: tables sorted by their meaning, references not yet replaced.
//!
//! A command builds the same structure that a file is read into, so both take the same path from here on.

use serde_json::Value as Json;

use super::kind::{Stage, StageKind};
use super::paths::to_text;
use super::reference::escape;
use super::syntax::{Entry, Node, Sources, Span, Value};

/// The format version this program reads and writes.
pub const VERSION: i64 = 1;

/// A word and its span. Equal when the words are.
#[derive(Clone, Debug)]
pub struct Name {
    /// The word.
    pub text: String,
    /// Where it is in the text.
    pub span: Option<Span>,
}

impl PartialEq for Name {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text
    }
}

impl From<&str> for Name {
    fn from(text: &str) -> Self {
        Self { text: text.to_owned(), span: None }
    }
}

/// Edges into one port, or into the ports in order.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// The port; `None` for the list form, which fills the ports in their order.
    pub port: Option<Name>,
    /// Where the data comes from: `stage` or `stage.port`.
    pub from: Vec<Name>,
    /// It was written as a list.
    pub list: bool,
}

/// One `[stage.NAME]`.
#[derive(Clone, Debug)]
pub struct StageEntry {
    /// Its name.
    pub name: Name,
    /// Its kind; `None` where `use` is missing or wrong, which was reported.
    pub kind: Option<&'static StageKind>,
    /// Its inputs.
    pub inputs: Vec<Input>,
    /// Its inputs could not be read, which was reported.
    pub unsound: bool,
    /// `enable`, if given.
    pub enable: Option<Node>,
    /// Its settings.
    pub settings: Vec<Entry>,
}

/// A pipeline file.
#[derive(Clone, Debug, Default)]
pub struct PipelineFile {
    /// The texts that it was read from.
    pub sources: Sources,
    /// `name`.
    pub name: Option<String>,
    /// `[vars]`.
    pub vars: Vec<Entry>,
    /// `[run]`.
    pub run: Vec<Entry>,
    /// `[batch]`.
    pub batch: Option<Vec<Entry>>,
    /// `[stage.*]`, in the order of the file, which has no meaning.
    pub stages: Vec<StageEntry>,
}

impl PipelineFile {
    /// A file with these stages, for programs.
    pub fn built(name: &str, stages: Vec<StageEntry>) -> Self {
        Self { name: Some(name.to_owned()), stages, ..Self::default() }
    }
}

impl StageEntry {
    /// A stage with typed settings, for programs. Settings equal to their defaults are left out, unless a file must give them. Strings in `settings` are
    /// templates: pass what must not be read as a reference through [`escape`].
    pub fn built<S: Stage>(name: &str, settings: &S) -> Self {
        let kind = crate::stages::find(S::KIND);
        Self {
            name: name.into(),
            kind,
            inputs: Vec::new(),
            unsound: false,
            enable: None,
            settings: entries(settings, &S::default(), S::REQUIRED),
        }
    }

    /// Connects `port` to `from`, which is `stage` or `stage.port`.
    #[must_use]
    pub fn input(mut self, port: &str, from: &str) -> Self {
        self.inputs.push(Input { port: Some(port.into()), from: vec![from.into()], list: false });
        self
    }

    /// Connects `port`, which takes a list, to each of `from`.
    #[must_use]
    pub fn inputs(mut self, port: &str, from: &[&str]) -> Self {
        self.inputs.push(Input {
            port: Some(port.into()),
            from: from.iter().map(|f| (*f).into()).collect(),
            list: true,
        });
        self
    }
}

/// The settings that differ from `defaults`, as entries.
pub fn entries_of<S: serde::Serialize>(settings: &S, defaults: &S) -> Vec<Entry> {
    entries(settings, defaults, &[])
}

/// The same, and those of `required` whatever they are.
fn entries<S: serde::Serialize>(settings: &S, defaults: &S, required: &[&str]) -> Vec<Entry> {
    let object = |s: &S| serde_json::to_value(s).ok().and_then(|v| v.as_object().cloned()).unwrap_or_default();
    let (given, defaults) = (object(settings), object(defaults));
    given
        .iter()
        .filter(|(key, value)| defaults.get(*key) != Some(value) || required.contains(&key.as_str()))
        .filter_map(|(key, value)| Some(Entry::built(key, value_of(value)?)))
        .collect()
}

/// JSON as a TOML value; TOML has no null.
pub(super) fn value_of(json: &Json) -> Option<Value> {
    Some(match json {
        Json::Null => return None,
        Json::Bool(b) => Value::Bool(*b),
        Json::Number(n) => n.as_i64().map(Value::Integer).or_else(|| n.as_f64().map(Value::Float))?,
        Json::String(text) => Value::Text(text.clone()),
        Json::Array(items) => Value::List(items.iter().filter_map(value_of).map(Node::built).collect()),
        Json::Object(pairs) => {
            Value::Table(pairs.iter().filter_map(|(k, v)| Some(Entry::built(k, value_of(v)?))).collect())
        }
    })
}

/// A path as a template that is read back as the path itself.
pub fn literal_path(path: &std::path::Path) -> String {
    escape(&to_text(path))
}
