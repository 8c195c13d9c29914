//! What both files begin with, and reading them.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::MarksError;

/// The one version read and written.
pub(super) const VERSION: u32 = 1;
/// Largest file, bytes: a hundred thousand points with many digits.
const LARGEST_FILE: u64 = 1 << 24;

/// The picture that was marked.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Source {
    /// Width as shown, px.
    pub(super) width: u32,
    /// Height as shown, px.
    pub(super) height: u32,
}

impl Source {
    pub(super) fn of(size: (u32, u32)) -> Self {
        Self { width: size.0, height: size.1 }
    }
}

/// Enough of a file to tell what it is.
#[derive(Deserialize)]
struct Probe {
    format: String,
    version: u64,
}

/// A kind of file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kind {
    /// `lines` or `faces`.
    pub(super) name: &'static str,
    /// What `format` says.
    pub(super) format: &'static str,
}

impl Kind {
    /// What a text holds: the document, or a bare list.
    pub(super) fn parse<D: DeserializeOwned, L: DeserializeOwned>(
        self,
        text: &str,
    ) -> Result<Parsed<D, L>, MarksError> {
        let syntax = |fault| MarksError::Syntax { kind: self.name, fault };
        let text = text.trim_start_matches('\u{feff}');
        if text.trim_start().starts_with('[') {
            return serde_json::from_str(text).map(Parsed::List).map_err(syntax);
        }
        let probe: Probe = serde_json::from_str(text).map_err(syntax)?;
        if probe.format != self.format {
            return Err(MarksError::Format { kind: self.name, found: probe.format, expected: self.format });
        }
        if probe.version != u64::from(VERSION) {
            return Err(MarksError::Version { kind: self.name, found: probe.version });
        }
        serde_json::from_str(text).map(Parsed::Document).map_err(syntax)
    }
}

/// A document or a bare list.
pub(super) enum Parsed<D, L> {
    Document(D),
    List(Vec<L>),
}

/// By how much positions are moved so that pixel centers lie at integer + 0.5.
pub(super) fn shift(pixel_centre: f64) -> Result<f64, MarksError> {
    match pixel_centre {
        0.5 => Ok(0.0),
        0.0 => Ok(0.5),
        found => Err(MarksError::PixelCenter { found }),
    }
}

/// Refuses marks of another picture.
pub(super) fn check_size(source: Source, picture: (u32, u32)) -> Result<(), MarksError> {
    let file = (source.width, source.height);
    if file == picture { Ok(()) } else { Err(MarksError::Size { file, picture }) }
}

/// The text of a file of bearable size.
pub(super) fn read_text(path: &Path) -> Result<String, MarksError> {
    let file = File::open(path)?;
    let found = file.metadata()?.len();
    if found > LARGEST_FILE {
        return Err(MarksError::TooMany { what: "bytes", found, limit: LARGEST_FILE });
    }
    let mut text = String::new();
    file.take(LARGEST_FILE).read_to_string(&mut text)?;
    Ok(text)
}

/// `document`, whose list is empty and last, with `entries` in it, one per line of text: lines that a person can find
/// and switch off.
pub(super) fn one_per_line<E: Serialize>(document: &impl Serialize, entries: impl Iterator<Item = E>) -> String {
    const PROOF: &str = "numbers, strings and lists always serialize";
    let whole = serde_json::to_string(document).expect(PROOF);
    let head = whole.strip_suffix("[]}").expect("the empty list is last");
    let rows: Vec<String> = entries.map(|e| format!("\n  {}", serde_json::to_string(&e).expect(PROOF))).collect();
    format!("{head} [{}\n]}}\n", rows.join(","))
}
