//! Pipeline files as texts: an edit of a setting is an edit of the text, so that comments, variables and other stages stay.

use std::path::Path;

use serde_json::Value as Json;
use toml_edit::{DocumentMut, Item, TableLike, Value};

use crate::error::StudioError;
use plumbline_app::pipeline::{self, Graph, Problems, Source};

/// The graph of a text, checked as `plumbline run` does.
///
/// # Errors
/// [`StudioError::Input`]: the first fault with its line; a pipeline over several items.
pub(crate) fn checked(path: &Path, text: &str) -> Result<Graph, StudioError> {
    let fail = |why: String| StudioError::Input { path: path.to_owned(), why };
    let base = Some(plumbline_num::files::folder_of(path).to_owned());
    let source = Source { name: path.display().to_string(), text: text.to_owned(), base };
    let checked = pipeline::read(source, &[]).map_err(|problems| fail(first_fault(&problems)))?;
    if checked.batch.is_some() {
        return Err(fail("works on several items ([batch]): open one of them".to_owned()));
    }
    Ok(checked.graph)
}

/// The text with other settings of a stage; null leaves one to its default. What is allowed is checked where the text is read again.
///
/// # Errors
/// [`StudioError::Request`] for lists and tables.
pub(crate) fn with_settings(text: &str, stage: &str, settings: &[(&str, Json)]) -> Result<String, StudioError> {
    let mut document: DocumentMut =
        text.parse().map_err(|e: toml_edit::TomlError| StudioError::request(e.message().to_owned()))?;
    let table = document.get_mut("stage").and_then(|s| s.get_mut(stage)).and_then(Item::as_table_like_mut);
    let table = table.ok_or_else(|| StudioError::request(format!("there is no stage `{stage}`")))?;
    for (key, value) in settings {
        set(table, key, value)?;
    }
    Ok(document.to_string())
}

/// Sets or removes a key; the spaces and the comment beside a value stay.
fn set(table: &mut dyn TableLike, key: &str, value: &Json) -> Result<(), StudioError> {
    let new = match value {
        Json::Null => {
            table.remove(key);
            return Ok(());
        }
        Json::Bool(b) => Value::from(*b),
        Json::Number(n) => n.as_i64().map_or_else(|| n.as_f64().unwrap_or(f64::NAN).into(), Value::from),
        Json::String(text) => Value::from(text.as_str()),
        Json::Array(_) | Json::Object(_) => {
            return Err(StudioError::request(format!("`{key}` is a number, a word, true or false")));
        }
    };
    match table.get_mut(key).and_then(Item::as_value_mut) {
        Some(old) => {
            let decor = old.decor().clone();
            *old = new;
            *old.decor_mut() = decor;
        }
        None => {
            table.insert(key, Item::Value(new));
        }
    }
    Ok(())
}

/// The first fault with its line, and how many more there are.
fn first_fault(problems: &Problems) -> String {
    let Some(first) = problems.problems.first() else { return "is no pipeline".to_owned() };
    let line = first.labels.first().map(|(span, _)| format!("line {}: ", problems.sources.line_column(*span).0));
    let label = first.labels.first().map(|(_, text)| format!(" ({text})")).unwrap_or_default();
    let more = match problems.problems.len() {
        1 => String::new(),
        n => format!("; and {} more", n - 1),
    };
    format!("{}{}{label}{more}", line.unwrap_or_default(), first.message)
}
