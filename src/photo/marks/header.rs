//! What both files begin with, and reading them.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize};

use crate::PhotoError;
use plumbline_num::document::{DocumentError, Kind};

/// Maximum size of a file, bytes: a hundred thousand points with many digits.
pub(super) const MAX_BYTES: u64 = 1 << 24;

/// The picture that was marked.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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

/// What a text holds: the document, or a bare list.
pub(super) fn parse<D: DeserializeOwned, L: DeserializeOwned>(
    kind: &Kind,
    text: &str,
) -> Result<Parsed<D, L>, DocumentError> {
    let text = text.trim_start_matches('\u{feff}');
    if text.trim_start().starts_with('[') {
        return serde_json::from_str(text).map(Parsed::List).map_err(|e| kind.syntax(e));
    }
    kind.parse(text).map(Parsed::Document)
}

/// A document or a bare list.
pub(super) enum Parsed<D, L> {
    Document(D),
    List(Vec<L>),
}

/// The name of a mark; bare lists may number them.
pub(super) fn name_or_number<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<String>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged, expecting = "a name or a whole number")]
    enum Name {
        Name(String),
        Number(i64),
    }
    let name = Option::<Name>::deserialize(deserializer)?;
    Ok(name.map(|name| match name {
        Name::Name(name) => name,
        Name::Number(n) => n.to_string(),
    }))
}

/// Refuses marks of another picture.
pub(super) fn check_size(source: Source, picture: (u32, u32)) -> Result<(), PhotoError> {
    let Source { width, height } = source;
    if (width, height) == picture {
        return Ok(());
    }
    Err(PhotoError::Input(format!(
        "the file is for a picture of {width}×{height} px and this one has {}×{}: mark this picture, or scale the file's \
         positions",
        picture.0, picture.1
    )))
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
