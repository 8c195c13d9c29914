//! The files of a document: what was opened, its side files, what was recovered after a crash.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::error::StudioError;
use plumbline_num::files::{IfExists, open_regular, write_whole};

/// The files of a document. Texts that were written wait here until they are [published](Self::publish).
#[derive(Clone, Debug, Default)]
pub struct DocumentFiles {
    opened: PathBuf,
    /// Written and not yet on the disk, or recovered: by absolute path.
    pending: BTreeMap<PathBuf, Arc<[u8]>>,
}

impl DocumentFiles {
    /// The files of the document that a path names; `recovered` are the texts that a session that ended early had not saved.
    pub fn new(opened: impl Into<PathBuf>, recovered: BTreeMap<PathBuf, Arc<[u8]>>) -> Self {
        Self { opened: opened.into(), pending: recovered }
    }

    /// What the user opened: a pipeline file, a mesh, a photo. An absolute path.
    pub fn opened(&self) -> &Path {
        &self.opened
    }

    /// Its folder: relative paths inside the document start there.
    pub fn folder(&self) -> &Path {
        plumbline_num::files::folder_of(&self.opened)
    }

    /// `NAME` + `ending` beside the opened file `NAME.obj`, `NAME.deform.toml`.
    pub fn side_file(&self, ending: &str) -> PathBuf {
        let name = self.opened.file_name().unwrap_or_default().to_string_lossy();
        let stem = name.split('.').next().unwrap_or_default();
        self.folder().join(format!("{stem}{ending}"))
    }

    /// The content of a file of at most `max_bytes`: what waits here, else what is on the disk; `None` where there is no such file.
    ///
    /// # Errors
    /// A file that cannot be read or is larger.
    pub fn read(&self, path: &Path, max_bytes: u64) -> Result<Option<Arc<[u8]>>, StudioError> {
        if let Some(bytes) = self.pending.get(path) {
            return Ok(Some(bytes.clone()));
        }
        let fail = |why: String| StudioError::Input { path: path.to_owned(), why };
        let file = match open_regular(path) {
            Ok(file) => file,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(fail(e.to_string())),
        };
        let mut bytes = Vec::new();
        std::io::Read::read_to_end(&mut std::io::Read::take(file, max_bytes + 1), &mut bytes)
            .map_err(|e| fail(e.to_string()))?;
        if bytes.len() as u64 > max_bytes {
            return Err(fail(format!("the file is larger than {max_bytes} bytes")));
        }
        Ok(Some(bytes.into()))
    }

    /// Another content of a file, not yet on the disk.
    pub fn write(&mut self, path: impl Into<PathBuf>, bytes: impl Into<Arc<[u8]>>) {
        self.pending.insert(path.into(), bytes.into());
    }

    /// What waits: path and content.
    pub fn pending(&self) -> &BTreeMap<PathBuf, Arc<[u8]>> {
        &self.pending
    }

    /// Puts what waits onto the disk, each file whole.
    ///
    /// # Errors
    /// The first file that cannot be written; those that could are there, and nothing that waits is lost.
    pub fn publish(&mut self) -> Result<(), StudioError> {
        for (path, bytes) in &self.pending {
            write_whole(path, bytes, IfExists::Replace)
                .map_err(|e| StudioError::Output { path: path.clone(), why: e.to_string() })?;
        }
        self.pending.clear();
        Ok(())
    }
}
