//! Messages between a page and its document: JSON texts, with buffers beside them ([`crate::outbox`]).
//!
//! Every message of a page that has an `id` is answered by exactly one [`Reply`], in the order of arrival but for drags (`newest`),
//! which are answered once the first slice of work after them is done. The types are exported to TypeScript
//! (`ui/src/generated/protocol.ts`).

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Version of the protocol; a page of another version must be loaded again.
pub const PROTO: u32 = 1;

/// A message of a page. Exactly one of the fields after `newest` is there.
#[derive(Debug, Default, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(optional_fields))]
#[serde(deny_unknown_fields)]
pub struct FromPage {
    /// Number of the message, chosen by the page, rising; without it there is no reply.
    #[serde(default)]
    pub id: Option<u32>,
    /// A later waiting edit of the same window replaces this one: for drags.
    #[serde(default)]
    pub newest: Option<bool>,
    /// A change of the document, as its workspace defines it.
    #[serde(default)]
    #[cfg_attr(test, ts(optional, type = "unknown"))]
    pub edit: Option<Value>,
    /// What is looked at.
    #[serde(default)]
    #[cfg_attr(test, ts(optional, type = "unknown"))]
    pub view: Option<Value>,
    /// A question.
    #[serde(default)]
    #[cfg_attr(test, ts(optional, type = "unknown"))]
    pub ask: Option<Value>,
    /// One step back.
    #[serde(default)]
    pub undo: Option<bool>,
    /// One step forward.
    #[serde(default)]
    pub redo: Option<bool>,
    /// The document after this step of the history.
    #[serde(default)]
    pub goto: Option<u32>,
    /// Ends the step that drags in a row made.
    #[serde(default)]
    pub seal: Option<bool>,
    /// Writes the files of the document.
    #[serde(default)]
    pub save: Option<bool>,
    /// What happens to the document whose files another program changed.
    #[serde(default)]
    pub disk: Option<DiskChoice>,
}

/// What happens to a document whose files another program changed.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "snake_case")]
pub enum DiskChoice {
    /// The files are read again; the document as it was stays in the history.
    Reload,
    /// The document stays; saving replaces the files.
    Keep,
}

/// What a page wants.
#[derive(Debug)]
pub enum Command {
    /// A change of the document.
    Edit {
        /// As the workspace defines it.
        edit: Value,
        /// Replaced by a later one that waits.
        newest: bool,
    },
    /// What is looked at.
    View(Value),
    /// A question.
    Ask(Value),
    /// One step back.
    Undo,
    /// One step forward.
    Redo,
    /// The document after a step.
    GoTo(usize),
    /// Ends a step.
    Seal,
    /// Writes the files.
    Save,
    /// After another program changed the files.
    Disk(DiskChoice),
}

/// A text that is no message: what is wrong, and the number it had.
#[derive(Debug, PartialEq, Eq)]
pub struct Malformed {
    /// Its number, where that can be read.
    pub id: Option<u32>,
    /// What is wrong.
    pub why: String,
}

/// Reads a message of a page.
///
/// # Errors
/// A text that is no message.
pub fn read(text: &str) -> Result<(Option<u32>, Command), Malformed> {
    let message: FromPage = serde_json::from_str(text).map_err(|e| {
        let id = serde_json::from_str::<Value>(text).ok();
        let id = id.and_then(|value| u32::try_from(value.get("id")?.as_u64()?).ok());
        Malformed { id, why: format!("malformed message: {e}") }
    })?;
    let id = message.id;
    let newest = message.newest.unwrap_or(false);
    let is = |flag: Option<bool>| flag == Some(true);
    let mut found: Vec<Command> = [
        message.edit.map(|edit| Command::Edit { edit, newest }),
        message.view.map(Command::View),
        message.ask.map(Command::Ask),
        is(message.undo).then_some(Command::Undo),
        is(message.redo).then_some(Command::Redo),
        message.goto.map(|k| Command::GoTo(k as usize)),
        is(message.seal).then_some(Command::Seal),
        is(message.save).then_some(Command::Save),
        message.disk.map(Command::Disk),
    ]
    .into_iter()
    .flatten()
    .collect();
    match (found.pop(), found.len()) {
        (Some(command), 0) => Ok((id, command)),
        (_, more) => {
            let count = if more == 0 { "none" } else { "several" };
            let why = format!("malformed message: {count} of edit, view, ask, undo, redo, goto, seal, save, disk");
            Err(Malformed { id, why })
        }
    }
}

/// A message to a page, but replies.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "camelCase")]
pub enum ToPage {
    /// The first message.
    Hello(Hello),
    /// State of the workspace, as it defines it.
    #[cfg_attr(test, ts(type = "unknown"))]
    State(Value),
    /// The steps.
    History(HistoryList),
    /// Whether the document's thread computes.
    Working(bool),
    /// A text for the user.
    Notice(Notice),
    /// Files that another program changed; empty once that is settled.
    ChangedOnDisk(Vec<String>),
    /// The document is closed; nothing follows.
    Closed(bool),
}

/// What document a page is connected to.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Hello {
    /// [`PROTO`].
    pub proto: u32,
    /// Name of the workspace.
    pub workspace: String,
    /// Id of the document.
    pub document: String,
    /// Name of its file.
    pub name: String,
}

/// The history list.
#[derive(Debug, Serialize, PartialEq, Eq)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "camelCase")]
pub struct HistoryList {
    /// All steps; the first is how the document was opened.
    pub steps: Vec<HistoryStep>,
    /// Number of the present one.
    pub at: usize,
    /// Number of the one that is on the disk.
    pub saved_at: Option<usize>,
}

/// A step of the history list.
#[derive(Debug, Serialize, PartialEq, Eq)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct HistoryStep {
    /// What was done.
    pub label: String,
}

/// A text for the user.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Notice {
    /// How serious.
    pub level: Level,
    /// The text.
    pub text: String,
}

/// How serious a notice is.
#[derive(Clone, Copy, Debug, Serialize, PartialEq, Eq)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// For information.
    Info,
    /// A warning.
    Warning,
    /// Something failed.
    Error,
}

/// The answer to a message.
#[derive(Debug, Default, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(optional_fields))]
pub struct Reply {
    /// Number of the message; null where it could not be read.
    #[cfg_attr(test, ts(optional = false))]
    pub reply: Option<u32>,
    /// Why it failed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// Answer to a question.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, ts(optional, type = "unknown"))]
    pub result: Option<Value>,
    /// Answer to a question: a file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub download: Option<Download>,
    /// A later edit replaced it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub replaced: Option<bool>,
}

/// A file for the user, to be fetched once.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Download {
    /// Path of the link, on this server.
    pub url: String,
    /// Name of the file.
    pub name: String,
}

impl Reply {
    /// The message with this number is done.
    pub fn done(id: u32) -> Self {
        Self { reply: Some(id), ..Self::default() }
    }

    /// It failed.
    pub fn failed(id: Option<u32>, why: impl Into<String>) -> Self {
        Self { reply: id, error: Some(why.into()), ..Self::default() }
    }

    /// A later edit replaced it.
    pub fn replaced(id: u32) -> Self {
        Self { replaced: Some(true), ..Self::done(id) }
    }
}

/// A message as text.
pub fn text(message: &impl Serialize) -> String {
    serde_json::to_string(message).unwrap_or_else(|e| {
        let why = format!("a message cannot be written: {e}");
        serde_json::json!({ "notice": { "level": "error", "text": why } }).to_string()
    })
}

#[cfg(test)]
#[path = "protocol_tests.rs"]
mod tests;
