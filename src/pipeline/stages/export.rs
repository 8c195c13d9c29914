//! The motion file: written beside its target, and given its name when it is whole.

use std::fs::File;
use std::path::Path;

use crate::media::Unfinished;
use crate::motion::ClipMotion;
use crate::pipeline::run_error::RunError;

/// Starts the unfinished file beside `path`; dropped, it is removed.
pub(super) fn begin(path: &Path) -> Result<Unfinished, RunError> {
    Unfinished::beside(path).map_err(|e| cannot(path, &e))
}

/// Writes `motion` to `path`.
pub(super) fn write(motion: &ClipMotion, path: &Path) -> Result<(), RunError> {
    let unfinished = begin(path)?;
    let file = File::options().write(true).open(unfinished.path()).map_err(|e| cannot(path, &e))?;
    motion.write_json(file).map_err(|e| cannot(path, &e))?;
    unfinished.publish(path).map_err(|e| cannot(path, &e))
}

fn cannot(path: &Path, why: &dyn std::fmt::Display) -> RunError {
    RunError::Output(format!("{}: cannot be written: {why}", path.display()))
}
