//! What the files of this module share: JSON that names its format, and version 1 of it.

use std::path::Path;

use serde::de::DeserializeOwned;

use super::MorphError;

/// The content of such a file.
pub(super) trait Versioned: DeserializeOwned {
    /// What the file holds, for messages.
    const KIND: &'static str;
    /// What its `format` must be.
    const FORMAT: &'static str;

    /// Its `format` and `version`.
    fn header(&self) -> (&str, u32);

    /// Says what is wrong with a file.
    fn malformed(fault: String) -> MorphError {
        MorphError::Malformed { kind: Self::KIND, fault }
    }

    /// The text of a file.
    fn text_of(path: &Path) -> Result<String, MorphError> {
        std::fs::read_to_string(path).map_err(|e| Self::malformed(format!("cannot be read: {e}")))
    }

    /// Understands the text of a file.
    fn of_text(text: &str) -> Result<Self, MorphError> {
        let content: Self = serde_json::from_str(text).map_err(|e| Self::malformed(e.to_string()))?;
        match content.header() {
            (format, _) if format != Self::FORMAT => {
                Err(Self::malformed(format!("the format is {format:?} (expected {:?})", Self::FORMAT)))
            }
            (_, 1) => Ok(content),
            (_, version) => Err(Self::malformed(format!("version {version} is not supported (expected 1)"))),
        }
    }
}
