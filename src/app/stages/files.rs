//! Files that stages write: beside their targets, and under their names once they are whole.

use std::fmt::Display;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use super::context::Context;
use crate::pipeline::run_error::RunError;
use crate::report::{ReportFormat, document};
use plumbline_media::AtomicFile;

/// Starts the file that is to become `path`; dropped, it is removed.
pub(crate) fn begin(path: &Path) -> Result<AtomicFile, RunError> {
    AtomicFile::next_to(path).map_err(|e| cannot(path, &e))
}

pub(crate) fn cannot(path: &Path, why: &dyn Display) -> RunError {
    RunError::Output(format!("{}: cannot be written: {why}", path.display()))
}

/// Fills the file that is to become `path`; dropped, it is removed.
pub(crate) fn filled<E: Display>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
) -> Result<AtomicFile, RunError> {
    let unfinished = begin(path)?;
    let mut out = BufWriter::new(File::create(unfinished.path()).map_err(|e| cannot(path, &e))?);
    write(&mut out).map_err(|e| cannot(path, &e))?;
    out.flush().map_err(|e| cannot(path, &e))?;
    Ok(unfinished)
}

/// Writes a file at once.
pub(crate) fn write_whole(path: &Path, bytes: impl AsRef<[u8]>) -> Result<(), RunError> {
    let unfinished = filled(path, |out| out.write_all(bytes.as_ref()))?;
    unfinished.publish(path).map_err(|e| cannot(path, &e))
}

impl Context<'_, '_> {
    /// Writes a file and lists it among the outputs.
    pub(crate) fn write_file(&mut self, path: &Path, bytes: impl AsRef<[u8]>) -> Result<(), RunError> {
        write_whole(path, bytes)?;
        self.summary.outputs.push(path.to_owned());
        Ok(())
    }

    /// Writes a file piece by piece and lists it among the outputs.
    pub(crate) fn fill_file<E: Display>(
        &mut self,
        path: &Path,
        write: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
    ) -> Result<(), RunError> {
        self.job.check_cancel()?;
        filled(path, write)?.publish(path).map_err(|e| cannot(path, &e))?;
        self.summary.outputs.push(path.to_owned());
        Ok(())
    }

    /// Writes a report on `name`, in the format that the extension of `path` asks for.
    ///
    /// # Errors
    /// Another extension, or a file that cannot be written.
    pub(crate) fn write_report(&mut self, path: &str, name: &str, report: &serde_json::Value) -> Result<(), RunError> {
        let format = ReportFormat::of(path).map_err(RunError::Usage)?;
        self.write_file(Path::new(path), document(name, report, format))
    }
}
