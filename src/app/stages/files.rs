//! Files that stages write: beside their targets, and under their names once they are whole.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::context::Context;
use crate::pipeline::paths::to_path;
use crate::pipeline::run_error::RunError;
use crate::report::{ReportFormat, document};
use plumbline_num::files::{AtomicFile, IfExists};

/// Refuses a folder in which the file that is to become `path` cannot be begun. Whether the file itself may be replaced is
/// looked at where a run begins.
pub(crate) fn try_begin(path: &Path) -> Result<(), RunError> {
    AtomicFile::next_to(path, IfExists::Replace).map(drop).map_err(|e| cannot(path, &e))
}

/// Why `path` was not written.
pub(crate) fn cannot(path: &Path, why: &io::Error) -> RunError {
    RunError::Output(format!("{}: cannot be written: {why}", path.display())).settled()
}

/// Fills the file that is to become `path`; dropped, it is removed.
pub(crate) fn filled<E>(
    path: &Path,
    if_exists: IfExists,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), E>,
) -> Result<AtomicFile, RunError>
where
    E: Into<Box<dyn std::error::Error + Send + Sync>>,
{
    let mut unfinished = AtomicFile::next_to(path, if_exists).map_err(|e| cannot(path, &e))?;
    let unopened = || cannot(path, &io::ErrorKind::Unsupported.into());
    let mut out = BufWriter::with_capacity(BUFFER, unfinished.file().ok_or_else(unopened)?);
    let written = write(&mut out).map_err(io::Error::other);
    written.and_then(|()| out.flush()).map_err(|e| cannot(path, &e))?;
    drop(out);
    Ok(unfinished)
}

/// Bytes gathered before they go to the disk.
const BUFFER: usize = 1 << 16;

/// Writes a file at once.
pub(crate) fn write_whole(path: &Path, bytes: impl AsRef<[u8]>, if_exists: IfExists) -> Result<(), RunError> {
    plumbline_num::files::write_whole(path, bytes.as_ref(), if_exists).map_err(|e| cannot(path, &e))
}

impl Context<'_, '_> {
    /// Writes a file and lists it among the outputs.
    pub(crate) fn write_file(&mut self, path: &Path, bytes: impl AsRef<[u8]>) -> Result<(), RunError> {
        self.fill_file(path, |out| out.write_all(bytes.as_ref()))
    }

    /// Writes a file piece by piece and lists it among the outputs.
    pub(crate) fn fill_file<E>(
        &mut self,
        path: &Path,
        write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), E>,
    ) -> Result<(), RunError>
    where
        E: Into<Box<dyn std::error::Error + Send + Sync>>,
    {
        self.job.check_cancel()?;
        let if_exists = self.job.if_exists();
        let unfinished = filled(path, if_exists, write)?;
        self.job.publishing(unfinished.path(), path)?;
        unfinished.publish(path, if_exists).map_err(|e| cannot(path, &e))?;
        self.summary.outputs.push(path.to_owned());
        Ok(())
    }

    /// Writes a report on `name`, in the format that the extension of `path` asks for.
    ///
    /// # Errors
    /// Another extension, or a file that cannot be written.
    pub(crate) fn write_report(&mut self, path: &str, name: &str, report: &serde_json::Value) -> Result<(), RunError> {
        let format = ReportFormat::of(path).map_err(RunError::Usage)?;
        self.write_file(&to_path(path), document(name, report, format))
    }
}
