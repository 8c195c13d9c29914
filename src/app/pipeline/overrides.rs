//! `--set NAME.KEY=VALUE`: settings from the command line, which win over the file.

use super::problem::Problem;
use super::suggest::did_you_mean;
use super::syntax::{Entry, Node, Source, SourceId, Sources, Span, Value};

/// Applies each option to the tree of the file. `NAME` is a stage, or `vars`, `batch` or `run`.
pub(super) fn apply(root: &mut Vec<Entry>, options: &[String], sources: &mut Sources, problems: &mut Vec<Problem>) {
    for option in options {
        let id = sources.add(Source { name: "--set".into(), text: option.clone(), base: None });
        if let Err(problem) = apply_one(root, option, id) {
            problems.push(problem);
        }
    }
}

fn apply_one(root: &mut Vec<Entry>, option: &str, id: SourceId) -> Result<(), Problem> {
    let span = |start: usize, end: usize| Some(Span { source: id, start, end });
    let malformed = || {
        Problem::new("set", format!("`{option}` is no setting"))
            .label(span(0, option.len()), "expected NAME.KEY=VALUE")
            .help("for example `--set out.crf=20` or `--set batch.foreach='clips/*.mp4'`")
    };
    let equals = option.find('=').ok_or_else(malformed)?;
    let (target, value) = (&option[..equals], &option[equals + 1..]);
    let (name, key) = target.split_once('.').ok_or_else(malformed)?;
    if name.is_empty() || key.is_empty() {
        return Err(malformed());
    }
    let node = Node {
        value: if value.contains("${") { Value::Text(value.to_owned()) } else { Value::Loose(value.to_owned()) },
        span: span(equals + 1, option.len()),
    };
    let key_span = span(name.len() + 1, equals);
    let table = if ["vars", "batch", "run"].contains(&name) {
        child_table(root, name)
    } else {
        stage_table(root, name, span(0, name.len()))?
    };
    table.retain(|e| e.key != key);
    table.push(Entry { key: key.to_owned(), key_span, node });
    Ok(())
}

/// The table `name`, made where there is none.
fn child_table<'a>(entries: &'a mut Vec<Entry>, name: &str) -> &'a mut Vec<Entry> {
    let at = entries.iter().position(|e| e.key == name).unwrap_or_else(|| {
        entries.push(Entry::built(name, Value::Table(Vec::new())));
        entries.len() - 1
    });
    let value = &mut entries[at].node.value;
    if !matches!(value, Value::Table(_)) {
        *value = Value::Table(Vec::new());
    }
    match value {
        Value::Table(table) => table,
        _ => unreachable!("made a table above"),
    }
}

fn stage_table<'a>(root: &'a mut Vec<Entry>, name: &str, span: Option<Span>) -> Result<&'a mut Vec<Entry>, Problem> {
    let stages = child_table(root, "stage");
    if !stages.iter().any(|e| e.key == name) {
        let known = stages.iter().map(|e| e.key.as_str()).chain(["vars", "batch", "run"]);
        return Err(Problem::new("set", format!("there is no stage `{name}` to set"))
            .label(span, "no such stage")
            .suggest(did_you_mean(name, known)));
    }
    Ok(child_table(stages, name))
}
