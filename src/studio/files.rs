//! The files of a document: what was opened, its side files, what was recovered after a crash.

use std::collections::BTreeMap;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::error::StudioError;
use crate::recovery::Texts;
use crate::watched::Watched;
use plumbline_num::files::{AccessError, AtomicFile, FileAccess, IfExists, folder_of, open_regular, publish_all};

/// The files of a document. Texts that were written wait here until they are [published](Self::publish).
///
/// Files outside its folder and the folders that are allowed are refused, also through links. Clones share what is known of the files
/// on the disk.
#[derive(Clone, Debug, Default)]
pub struct DocumentFiles {
    opened: PathBuf,
    allowed: Arc<[PathBuf]>,
    /// Written and not yet on the disk, or recovered: by absolute path.
    pending: Texts,
    watched: Watched,
}

impl DocumentFiles {
    /// The files of the document that a path names; `recovered` are the texts that a session that ended early had not saved.
    pub fn new(opened: impl Into<PathBuf>, recovered: BTreeMap<PathBuf, Arc<[u8]>>) -> Self {
        let opened = opened.into();
        let watched = Watched::default();
        watched.see(&opened);
        Self { opened, allowed: Arc::default(), pending: recovered, watched }
    }

    /// The same with further folders whose files may be read and written.
    #[must_use]
    pub fn with_allowed(self, allowed: Arc<[PathBuf]>) -> Self {
        Self { allowed, ..self }
    }

    /// What the user opened: a pipeline file, a mesh, a photo. An absolute path.
    pub fn opened(&self) -> &Path {
        &self.opened
    }

    /// Its folder: relative paths inside the document start there.
    pub fn folder(&self) -> &Path {
        folder_of(&self.opened)
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
    /// A file that is outside the folders, cannot be read or is larger.
    pub fn read(&self, path: &Path, max_bytes: u64) -> Result<Option<Arc<[u8]>>, StudioError> {
        if let Some(bytes) = self.pending.get(path) {
            return Ok(Some(bytes.clone()));
        }
        let fail = |why: String| StudioError::Input { path: path.to_owned(), why };
        self.watched.see(path);
        if std::fs::symlink_metadata(path).is_err_and(|e| e.kind() == std::io::ErrorKind::NotFound) {
            return Ok(None);
        }
        let file = open_regular(&self.confined(path)?).map_err(|e| fail(e.to_string()))?;
        let mut bytes = Vec::new();
        std::io::Read::read_to_end(&mut std::io::Read::take(file, max_bytes.saturating_add(1)), &mut bytes)
            .map_err(|e| fail(e.to_string()))?;
        if bytes.len() as u64 > max_bytes {
            return Err(fail(format!("the file is larger than {max_bytes} bytes")));
        }
        Ok(Some(bytes.into()))
    }

    /// The file that is meant by a path of the document, relative to its folder or absolute, without links: for readers of the
    /// library that open files themselves. The user is told where another program changes it.
    ///
    /// # Errors
    /// A file outside the folders, or none.
    pub fn confined(&self, path: &Path) -> Result<PathBuf, StudioError> {
        let fail = |why: String| StudioError::Input { path: path.to_owned(), why };
        self.watched.see(&self.folder().join(path));
        FileAccess::of_folder(self.folder(), &self.allowed).resolve(path).map_err(|e| fail(e.to_string()))
    }

    /// Another content of a file, not yet on the disk.
    pub fn write(&mut self, path: impl Into<PathBuf>, bytes: impl Into<Arc<[u8]>>) {
        self.pending.insert(path.into(), bytes.into());
    }

    /// What waits: path and content.
    pub fn pending(&self) -> &BTreeMap<PathBuf, Arc<[u8]>> {
        &self.pending
    }

    /// Puts what waits onto the disk: each file whole, and none of them before all are written beside their targets, so that a full
    /// disk leaves the files as they were.
    ///
    /// # Errors
    /// The first file that cannot be written or is outside the folders; nothing that waits is lost.
    pub fn publish(&mut self) -> Result<(), StudioError> {
        let failed = |path: &Path, e: io::Error| StudioError::Output {
            path: path.to_owned(),
            why: format!("cannot be saved: {e}; what is not saved stays open"),
        };
        let mut files = Vec::new();
        for (path, bytes) in &self.pending {
            let target = self.target(path)?;
            files.push((unfinished(&target, bytes).map_err(|e| failed(path, e))?, target));
        }
        publish_all(files, IfExists::Replace).map_err(|e| failed(&self.opened, e))?;
        self.pending.keys().for_each(|path| self.watched.see(path));
        self.pending.clear();
        Ok(())
    }

    /// The file that a path of the document is written to.
    fn target(&self, path: &Path) -> Result<PathBuf, StudioError> {
        let fail = |e: AccessError| StudioError::Output { path: path.to_owned(), why: e.to_string() };
        let folder = FileAccess::of_folder(self.folder(), &self.allowed).resolve(folder_of(path)).map_err(fail)?;
        let target = folder.join(path.file_name().unwrap_or_default());
        if target.is_symlink() {
            self.confined(path)?;
        }
        Ok(target)
    }

    /// Files of the document that differ on the disk from what was read or written last.
    pub fn changed_on_disk(&self) -> Vec<PathBuf> {
        self.watched.changed()
    }

    /// Takes the files on the disk as known.
    pub fn accept_disk(&self) {
        self.watched.accept();
    }
}

/// A file of this content that does not have its name yet.
fn unfinished(target: &Path, bytes: &[u8]) -> io::Result<AtomicFile> {
    let mut file = AtomicFile::next_to(target, IfExists::Replace)?;
    file.file().ok_or_else(|| io::Error::other("no file"))?.write_all(bytes)?;
    Ok(file)
}

#[cfg(test)]
#[path = "files_tests.rs"]
mod tests;
