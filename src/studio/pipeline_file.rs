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

/// A change of a setting: its stage, its key, and the value; `None` leaves it to its default.
pub(crate) type Change<'c> = (&'c str, &'c str, Option<Value>);

/// What the text says with other settings, read by `read`: what is allowed is checked there.
///
/// # Errors
/// [`StudioError::Request`] with what is allowed.
pub(crate) fn edited<P>(
    path: &Path,
    text: &str,
    changes: &[Change<'_>],
    read: impl FnOnce(&Path, &str) -> Result<P, StudioError>,
) -> Result<P, StudioError> {
    read(path, &with_settings(text, changes)?).map_err(|error| match error {
        StudioError::Input { why, .. } => StudioError::Request(why),
        other => other,
    })
}

/// A value that a window sends; null leaves the setting to its default.
///
/// # Errors
/// [`StudioError::Request`] for lists and tables.
pub(crate) fn setting(key: &str, value: &Json) -> Result<Option<Value>, StudioError> {
    Ok(Some(match value {
        Json::Null => return Ok(None),
        Json::Bool(b) => Value::from(*b),
        Json::Number(n) => n.as_i64().map_or_else(|| n.as_f64().unwrap_or(f64::NAN).into(), Value::from),
        Json::String(text) => Value::from(text.as_str()),
        Json::Array(_) | Json::Object(_) => {
            return Err(StudioError::request(format!("`{key}` is a number, a word, true or false")));
        }
    }))
}

fn with_settings(text: &str, changes: &[Change<'_>]) -> Result<String, StudioError> {
    let mut document: DocumentMut =
        text.parse().map_err(|e: toml_edit::TomlError| StudioError::request(e.message().to_owned()))?;
    for (stage, key, value) in changes {
        let table = document.get_mut("stage").and_then(|s| s.get_mut(stage)).and_then(Item::as_table_like_mut);
        let table = table.ok_or_else(|| StudioError::request(format!("there is no stage `{stage}`")))?;
        set(table, key, value.clone());
    }
    Ok(document.to_string())
}

/// Sets or removes a key; the spaces and the comment beside a value stay.
fn set(table: &mut dyn TableLike, key: &str, value: Option<Value>) {
    let Some(new) = value else {
        table.remove(key);
        return;
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
