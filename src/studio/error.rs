//! Errors of the studio.

use std::path::PathBuf;

use plumbline_num::run::Stopped;

/// Why the studio could not do what a window asked for. The text is shown to the user.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StudioError {
    /// A message of a window that does not fit the document: an unknown vertex, a value out of its range.
    #[error("{0}")]
    Request(String),
    /// A file that cannot be read or is no document of this kind.
    #[error("{}: {why}", path.display())]
    Input {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// A file that cannot be written.
    #[error("{}: {why}", path.display())]
    Output {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        why: String,
    },
    /// The library's method failed on what it was given.
    #[error("{0}")]
    Method(String),
    /// Something that the machine does not have: a port, a folder, a thread.
    #[error("{0}")]
    Environment(String),
    /// What is asked for is still being computed: the same is possible soon.
    #[error("{0}")]
    NotReady(&'static str),
    /// A newer letter waits, or the program ends: no fault.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

impl StudioError {
    /// A message of a window that does not fit.
    pub fn request(why: impl Into<String>) -> Self {
        Self::Request(why.into())
    }
}
