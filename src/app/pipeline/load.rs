//! Sorts the syntax tree of a file into a [`PipelineFile`], going on after every fault.

use super::file::{Input, Name, PipelineFile, StageEntry, VERSION};
use super::problem::Problem;
use super::suggest::did_you_mean;
use super::syntax::{Entry, Node, Sources, Value};
use crate::stages;

const TABLES: [&str; 6] = ["version", "name", "vars", "run", "batch", "stage"];

/// Reads the top level.
pub(super) fn load(root: Vec<Entry>, sources: Sources, problems: &mut Vec<Problem>) -> PipelineFile {
    let mut file = PipelineFile { sources, ..PipelineFile::default() };
    check_version(&root, problems);
    for entry in root {
        match entry.key.as_str() {
            "version" => {}
            "name" => file.name = text(&entry, problems),
            "vars" => file.vars = vars(entry, problems),
            "run" => file.run = table(entry, problems).unwrap_or_default(),
            "batch" => file.batch = table(entry, problems),
            "stage" => {
                let stages = table(entry, problems).unwrap_or_default();
                file.stages = stages.into_iter().filter_map(|e| stage(e, problems)).collect();
            }
            key => problems.push(
                Problem::new("unknown-key", format!("a pipeline file has no `{key}`"))
                    .label(entry.key_span, "unknown")
                    .suggest(did_you_mean(key, TABLES)),
            ),
        }
    }
    if file.stages.is_empty() && problems.is_empty() {
        problems.push(
            Problem::new("no-stages", "the pipeline has no stages").help("add a table [stage.NAME] with `use = \"…\"`"),
        );
    }
    file
}

fn check_version(root: &[Entry], problems: &mut Vec<Problem>) {
    let Some(entry) = root.iter().find(|e| e.key == "version") else {
        let help = format!("begin the file with `version = {VERSION}`");
        problems.push(Problem::new("version", "the file does not say its format version").help(help));
        return;
    };
    if entry.node.value != Value::Integer(VERSION) && entry.node.value != Value::Unknown {
        let found = match &entry.node.value {
            Value::Integer(i) => i.to_string(),
            _ => entry.node.type_name().to_owned(),
        };
        let message = format!("format version {found} is not known (this program reads version {VERSION})");
        problems.push(
            Problem::new("version", message)
                .label(entry.node.span, "this version")
                .help("a newer file needs a newer plumbline; otherwise write `version = 1`"),
        );
    }
}

fn wrong_type(entry: &Entry, wanted: &str) -> Problem {
    Problem::new("bad-value", format!("`{}` is {} (expected {wanted})", entry.key, entry.node.type_name()))
        .label(entry.node.span, format!("expected {wanted}"))
}

fn text(entry: &Entry, problems: &mut Vec<Problem>) -> Option<String> {
    let text = entry.node.text().map(str::to_owned);
    if text.is_none() && entry.node.value != Value::Unknown {
        problems.push(wrong_type(entry, "a string"));
    }
    text
}

fn table(entry: Entry, problems: &mut Vec<Problem>) -> Option<Vec<Entry>> {
    if let Value::Table(entries) = entry.node.value {
        return Some(entries);
    }
    if entry.node.value != Value::Unknown {
        problems.push(wrong_type(&entry, "a table"));
    }
    None
}

fn vars(entry: Entry, problems: &mut Vec<Problem>) -> Vec<Entry> {
    let entries = table(entry, problems).unwrap_or_default();
    for var in &entries {
        check_name("variable", &Name { text: var.key.clone(), span: var.key_span }, problems);
        if matches!(var.node.value, Value::Table(_)) {
            problems.push(wrong_type(var, "a string, number, boolean or list"));
        }
    }
    entries
}

/// Names are `[a-z][a-z0-9_-]*`: they are used in references, options and file names.
fn check_name(what: &str, name: &Name, problems: &mut Vec<Problem>) {
    let mut bytes = name.text.bytes();
    let good = bytes.next().is_some_and(|b| b.is_ascii_lowercase())
        && bytes.all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_' || b == b'-');
    let reserved = what == "stage" && ["vars", "run", "batch"].contains(&name.text.as_str());
    if reserved {
        let message = format!("a stage cannot be called `{}`: `--set {}.…` means the table", name.text, name.text);
        problems.push(Problem::new("bad-name", message).label(name.span, "reserved name"));
    } else if !good {
        let message = format!("`{}` is no name for a {what} (expected a-z, then a-z, 0-9, _ or -)", name.text);
        problems.push(Problem::new("bad-name", message).label(name.span, "this name"));
    }
}

fn stage(entry: Entry, problems: &mut Vec<Problem>) -> Option<StageEntry> {
    let name = Name { text: entry.key.clone(), span: entry.key_span };
    check_name("stage", &name, problems);
    let unsound = entry.node.value == Value::Unknown;
    let mut stage = StageEntry { name, kind: None, inputs: Vec::new(), unsound, enable: None, settings: Vec::new() };
    if unsound {
        return Some(stage);
    }
    let entries = table(entry, problems)?;
    if !entries.iter().any(|e| e.key == "use") {
        let message = format!("stage `{}` does not say its kind", stage.name.text);
        let help = "add `use = \"KIND\"`; `plumbline stages` lists the kinds";
        problems.push(Problem::new("missing-key", message).label(stage.name.span, "`use` is missing").help(help));
    }
    for entry in entries {
        match entry.key.as_str() {
            "use" => stage.kind = kind(&stage.name, &entry, problems),
            "inputs" if entry.node.value == Value::Unknown => stage.unsound = true,
            "inputs" => stage.inputs = inputs(&stage.name, &entry, problems),
            "enable" => stage.enable = Some(entry.node),
            _ => stage.settings.push(entry),
        }
    }
    Some(stage)
}

fn kind(stage: &Name, entry: &Entry, problems: &mut Vec<Problem>) -> Option<&'static super::kind::StageKind> {
    let name = text(entry, problems)?;
    let found = stages::find(&name);
    if found.is_none() {
        problems.push(
            Problem::new("unknown-kind", format!("stage `{}` uses the unknown kind `{name}`", stage.text))
                .label(entry.node.span, "no such kind")
                .suggest(did_you_mean(&name, stages::KINDS.iter().map(|k| k.name))),
        );
    }
    found
}

fn inputs(stage: &Name, entry: &Entry, problems: &mut Vec<Problem>) -> Vec<Input> {
    match &entry.node.value {
        Value::List(items) => {
            let from = items.iter().filter_map(|n| endpoint(stage, n, problems)).collect();
            vec![Input { port: None, from, list: true }]
        }
        Value::Table(ports) => ports.iter().map(|port| named_input(stage, port, problems)).collect(),
        _ => {
            let mut problem = wrong_type(entry, "a list or a table of ports");
            if let Some(text) = entry.node.text() {
                problem = problem.help(format!("write `inputs = [\"{text}\"]`"));
            }
            problems.push(problem);
            // What was meant is clear enough to check the rest with.
            let meant = entry.node.text().map(|text| Name { text: text.to_owned(), span: entry.node.span });
            vec![Input { port: None, from: meant.into_iter().collect(), list: true }]
        }
    }
}

fn named_input(stage: &Name, port: &Entry, problems: &mut Vec<Problem>) -> Input {
    let name = Some(Name { text: port.key.clone(), span: port.key_span });
    match &port.node.value {
        Value::List(items) => {
            let from = items.iter().filter_map(|n| endpoint(stage, n, problems)).collect();
            Input { port: name, from, list: true }
        }
        _ => Input { port: name, from: endpoint(stage, &port.node, problems).into_iter().collect(), list: false },
    }
}

fn endpoint(stage: &Name, node: &Node, problems: &mut Vec<Problem>) -> Option<Name> {
    let name = node.text().map(|text| Name { text: text.to_owned(), span: node.span });
    if name.is_none() {
        let message = format!(
            "an input of stage `{}` is {} (expected \"stage\" or \"stage.port\")",
            stage.text,
            node.type_name()
        );
        problems.push(Problem::new("bad-value", message).label(node.span, "expected a string"));
    }
    name
}
