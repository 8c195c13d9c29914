//! Documents that were opened lately, kept from one start to the next.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use serde::{Deserialize, Serialize};

use plumbline_num::files::{IfExists, write_whole};

/// Documents that are remembered.
const MAX_RECENT: usize = 20;

/// A document that was opened.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub(crate) struct Opened {
    pub(crate) path: PathBuf,
    pub(crate) workspace: String,
}

/// Documents, the last one first.
#[derive(Debug)]
pub(crate) struct Recent {
    file: Option<PathBuf>,
    list: Mutex<Vec<Opened>>,
}

impl Recent {
    /// Those of the file; a file that cannot be read is as good as none.
    pub(crate) fn new(file: Option<PathBuf>) -> Self {
        let text = file.as_deref().and_then(|file| std::fs::read(file).ok());
        let mut list: Vec<Opened> = text.and_then(|text| serde_json::from_slice(&text).ok()).unwrap_or_default();
        list.truncate(MAX_RECENT);
        Self { file, list: Mutex::new(list) }
    }

    fn list(&self) -> MutexGuard<'_, Vec<Opened>> {
        // Nothing in here panics while it holds the lock.
        self.list.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts a document first.
    pub(crate) fn add(&self, path: &Path, workspace: &str) {
        let mut list = self.list();
        list.retain(|opened| opened.path != path);
        list.insert(0, Opened { path: path.to_owned(), workspace: workspace.to_owned() });
        list.truncate(MAX_RECENT);
        let Some(file) = &self.file else { return };
        let text = serde_json::to_vec(&*list).unwrap_or_default();
        if let Err(error) = write_whole(file, &text, IfExists::Replace) {
            tracing::warn!(%error, "the list of recent documents cannot be written");
        }
    }

    /// Those that are still there and may be opened.
    pub(crate) fn that(&self, may_be_opened: impl Fn(&Path) -> bool) -> Vec<Opened> {
        self.list().iter().filter(|opened| opened.path.is_file() && may_be_opened(&opened.path)).cloned().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_document_comes_first_and_once_also_after_a_restart() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let names = ["a", "b", "c"].map(|name| folder.path().join(name));
        for path in &names {
            std::fs::write(path, "").expect("written");
        }
        let file = folder.path().join("recent.json");
        let recent = Recent::new(Some(file.clone()));
        for k in [0, 1, 2, 0] {
            recent.add(&names[k], "mesh");
        }
        std::fs::remove_file(&names[1]).expect("removed");
        let again = Recent::new(Some(file.clone()));
        let shown: Vec<_> = again.that(|_| true).into_iter().map(|opened| opened.path).collect();
        assert_eq!(shown, [names[0].clone(), names[2].clone()]);
        assert!(again.that(|_| false).is_empty(), "documents outside the folders are not shown");
        std::fs::write(&file, "[").expect("written");
        assert!(Recent::new(Some(file)).that(|_| true).is_empty(), "a damaged list is as good as none");
    }
}
