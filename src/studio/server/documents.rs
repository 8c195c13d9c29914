//! Documents that are open.

use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use crate::content::Content;
use crate::error::StudioError;
use crate::registry::kind_of;
use crate::session::{Document, Status, Surroundings};

/// Documents that may be open at the same time: each holds a mesh or a photo in memory.
const MAX_DOCUMENTS: usize = 32;

/// Documents that are open or being opened.
#[derive(Debug)]
pub(crate) struct Documents {
    list: Mutex<Vec<Arc<Document>>>,
    surroundings: Surroundings,
}

impl Documents {
    pub(crate) fn new(surroundings: Surroundings) -> Self {
        Self { list: Mutex::default(), surroundings }
    }

    fn list(&self) -> MutexGuard<'_, Vec<Arc<Document>>> {
        // Nothing in here panics while it holds the lock.
        let mut list = self.list.lock().unwrap_or_else(PoisonError::into_inner);
        list.retain(|document| !matches!(document.status(), Status::Gone(_)));
        list
    }

    /// The document of a file: the one that is open, or a new one, whose opening begins. Reads the beginning of the file.
    pub(crate) fn open(&self, path: &Path) -> Result<Arc<Document>, StudioError> {
        let fail = |why: String| StudioError::Input { path: path.to_owned(), why };
        let id = id_of(path);
        if let Some(open) = self.find(&id) {
            return Ok(open);
        }
        let content = Content::of(path)?;
        let kind = kind_of(&content).ok_or_else(|| fail("no workspace opens this kind of file".to_owned()))?;
        let mut list = self.list();
        if let Some(open) = list.iter().find(|document| document.hello.document == id) {
            return Ok(Arc::clone(open));
        }
        if list.len() >= MAX_DOCUMENTS {
            return Err(StudioError::request(format!("{MAX_DOCUMENTS} documents are open: close one first")));
        }
        let started = (kind.start)(&id, path, self.surroundings.clone());
        let document = started.map_err(|e| StudioError::Environment(format!("cannot start a thread: {e}")))?;
        list.push(Arc::clone(&document));
        Ok(document)
    }

    /// The open document with this id.
    pub(crate) fn find(&self, id: &str) -> Option<Arc<Document>> {
        self.list().iter().find(|document| document.hello.document == id).cloned()
    }

    /// All of them.
    pub(crate) fn all(&self) -> Vec<Arc<Document>> {
        self.list().clone()
    }

    pub(crate) fn close_all(&self) {
        self.all().iter().for_each(|document| document.close());
    }

    /// Waits for their threads.
    pub(crate) fn join_all(&self, deadline: Instant) {
        let list = std::mem::take(&mut *self.list.lock().unwrap_or_else(PoisonError::into_inner));
        for document in list {
            if !document.join(deadline) {
                tracing::warn!(path = %document.path.display(), "a document has not ended in time");
            }
        }
    }
}

/// The same for a file whenever it is opened, so that a page finds its document after the program was started again.
fn id_of(path: &Path) -> String {
    format!("{:016x}", crate::recovery::fnv(path.as_os_str().as_encoded_bytes()))
}
