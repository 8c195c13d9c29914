//! The motion file: written beside its target, and given its name when it is whole.

use std::path::Path;

use tempfile::NamedTempFile;

use crate::motion::ClipMotion;
use crate::pipeline::run_error::RunError;

/// Starts the unfinished file beside `path`; dropped, it is removed.
pub(super) fn begin(path: &Path) -> Result<NamedTempFile, RunError> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    tempfile::Builder::new().suffix(".partial").tempfile_in(folder).map_err(|e| cannot(path, &e))
}

/// Writes `motion` to `path`.
pub(super) fn write(motion: &ClipMotion, path: &Path, overwrite: bool) -> Result<(), RunError> {
    let mut file = begin(path)?;
    motion.write_json(std::io::BufWriter::new(&mut file)).map_err(|e| cannot(path, &e))?;
    file.as_file().sync_all().map_err(|e| cannot(path, &e))?;
    let named = if overwrite { file.persist(path) } else { file.persist_noclobber(path) };
    named.map(drop).map_err(|e| cannot(path, &e.error))
}

fn cannot(path: &Path, why: &dyn std::fmt::Display) -> RunError {
    RunError::Output(format!("{}: cannot be written: {why}", path.display()))
}
