//! What can be wrong with a lens file.

use std::path::PathBuf;

use crate::LensError;

/// A lens file that was not read, by its name.
#[derive(Debug, thiserror::Error)]
#[error("{}: {fault}", path.display())]
pub struct LensFileError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with it.
    pub fault: ProfileError,
}

/// What is wrong with the contents of a lens file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ProfileError {
    /// The file cannot be read, is too large, or no text.
    #[error("cannot be read: {0} (a lens file is a short JSON, YAML, XML or plain text in UTF-8)")]
    Read(#[from] std::io::Error),
    /// None of the formats.
    #[error(
        "is no lens file that is known here (read are: lens JSON, OpenCV and ROS YAML, XML and JSON, Kalibr YAML, Gyroflow \
         JSON, WoodScape JSON, COLMAP cameras.txt, OCamCalib calib_results.txt, lensfun XML)"
    )]
    UnknownFormat,
    /// Breaks the rules of its format.
    #[error("is no valid {format}: {reason}")]
    Syntax {
        /// Name of the format.
        format: &'static str,
        /// The parser's message, with the position.
        reason: String,
    },
    /// Something needed is not there.
    #[error("lacks `{key}` ({expected})")]
    Missing {
        /// Path of the key.
        key: String,
        /// What belongs there.
        expected: &'static str,
    },
    /// Something is there, but wrong.
    #[error("has `{key}` = {value} (expected {expected})")]
    Value {
        /// Path of the key, or the line.
        key: String,
        /// The value found, shortened.
        value: String,
        /// What belongs there.
        expected: String,
    },
    /// A camera model that is not known.
    #[error("uses the camera model `{model}` (known in {format}: {known})")]
    Model {
        /// Name of the format.
        format: &'static str,
        /// The model.
        model: String,
        /// The models that are known.
        known: &'static str,
    },
    /// More than one camera, none of which has the picture's size.
    #[error("holds several cameras ({names}) and the picture's size does not select one: keep one in the file")]
    Several {
        /// Their names.
        names: String,
    },
    /// A database without the lens, or with too little known about the picture to find it.
    #[error("{reason}")]
    NotInDatabase {
        /// The name searched for, similar names, and a remedy.
        reason: String,
    },
    /// Parameters that make no lens.
    #[error(transparent)]
    Lens(#[from] LensError),
}

impl ProfileError {
    #[allow(clippy::needless_pass_by_value)] // callers hand over numbers and texts alike
    pub(super) fn value(key: impl Into<String>, value: impl std::fmt::Display, expected: impl Into<String>) -> Self {
        const SHOWN: usize = 60;
        let mut value = value.to_string();
        if value.chars().count() > SHOWN {
            value = value.chars().take(SHOWN).chain("…".chars()).collect();
        }
        Self::Value { key: key.into(), value, expected: expected.into() }
    }

    #[allow(clippy::needless_pass_by_value)] // likewise
    pub(super) fn syntax(format: &'static str, reason: impl std::fmt::Display) -> Self {
        Self::Syntax { format, reason: reason.to_string() }
    }
}
