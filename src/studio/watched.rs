//! Files of a document as they were when they were read or written last: size and time of the last change.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

/// Size and time of a file; `None` where there is none.
pub(crate) type Stamp = Option<(u64, Option<SystemTime>)>;

pub(crate) fn stamp(path: &Path) -> Stamp {
    let found = std::fs::metadata(path).ok()?;
    Some((found.len(), found.modified().ok()))
}

/// Files by their paths. Clones share them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Watched(Arc<Mutex<BTreeMap<PathBuf, Stamp>>>);

impl Watched {
    fn stamps(&self) -> MutexGuard<'_, BTreeMap<PathBuf, Stamp>> {
        // Nothing in here panics while it holds the lock.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The file is as it is now.
    pub(crate) fn see(&self, path: &Path) {
        self.stamps().insert(path.to_owned(), stamp(path));
    }

    /// Files that are not as they were.
    pub(crate) fn changed(&self) -> Vec<PathBuf> {
        let differs = |(path, known): (&PathBuf, &Stamp)| (stamp(path) != *known).then(|| path.clone());
        self.stamps().iter().filter_map(differs).collect()
    }

    /// All files are as they are now.
    pub(crate) fn accept(&self) {
        self.stamps().iter_mut().for_each(|(path, known)| *known = stamp(path));
    }
}
