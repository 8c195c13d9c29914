//! A pipeline as TOML that is read back as the same graph.

use toml_edit::{Array, DocumentMut, InlineTable, Item, Table, Value as Toml, value};

use super::file::{Input, PipelineFile, StageEntry, VERSION};
use super::syntax::{Entry, Node, SourceId, Value, parse_value};

/// The text of `file`. Comments of the text it was read from are not kept.
pub fn print(file: &PipelineFile) -> String {
    let mut document = DocumentMut::new();
    document["version"] = value(VERSION);
    if let Some(name) = &file.name {
        document["name"] = value(name);
    }
    for (name, entries) in [("vars", Some(&file.vars)), ("run", Some(&file.run)), ("batch", file.batch.as_ref())] {
        let wanted = entries.filter(|e| name == "batch" || !e.is_empty());
        if let Some(entries) = wanted {
            document[name] = Item::Table(table(entries));
        }
    }
    let mut stages = Table::new();
    stages.set_implicit(true);
    for stage in &file.stages {
        stages[&stage.name.text] = Item::Table(stage_table(stage));
    }
    document["stage"] = Item::Table(stages);
    document.to_string()
}

fn table(entries: &[Entry]) -> Table {
    let mut table = Table::new();
    for entry in entries {
        table[&entry.key] = Item::Value(toml_of(&entry.node));
    }
    table
}

fn stage_table(stage: &StageEntry) -> Table {
    let mut out = Table::new();
    if let Some(kind) = stage.kind {
        out["use"] = value(kind.name);
    }
    match stage.inputs.as_slice() {
        [] => {}
        [Input { port: None, from, .. }] => out["inputs"] = value(names(from)),
        ports => {
            let mut inline = InlineTable::new();
            for input in ports {
                let port = input.port.as_ref().map_or("", |p| p.text.as_str());
                let edges = match input.from.as_slice() {
                    [one] if !input.list => Toml::from(one.text.as_str()),
                    many => Toml::Array(names(many)),
                };
                inline.insert(port, edges);
            }
            out["inputs"] = value(inline);
        }
    }
    if let Some(enable) = &stage.enable {
        out["enable"] = Item::Value(toml_of(enable));
    }
    for entry in &stage.settings {
        out[&entry.key] = Item::Value(toml_of(&entry.node));
    }
    out
}

fn names(from: &[super::file::Name]) -> Array {
    from.iter().map(|n| n.text.as_str()).collect()
}

fn toml_of(node: &Node) -> Toml {
    match &node.value {
        Value::Bool(b) => Toml::from(*b),
        Value::Integer(i) => Toml::from(*i),
        Value::Float(x) => Toml::from(*x),
        Value::Text(text) => Toml::from(text.as_str()),
        Value::Loose(text) => match parse_value(SourceId(0), text, 0) {
            Some(typed) => toml_of(&typed),
            None => Toml::from(text.as_str()),
        },
        Value::Unknown => Toml::from(""),
        Value::List(items) => Toml::Array(items.iter().map(toml_of).collect()),
        Value::Table(entries) => {
            let pairs = entries.iter().map(|e| (e.key.clone(), toml_of(&e.node)));
            Toml::InlineTable(pairs.collect())
        }
    }
}
