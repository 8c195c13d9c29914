//! Files dropped on the page, and copies of examples: kept in a folder of this session, of bounded size.
//!
//! The folder is removed at the end where only files that were dropped are in it; where something was saved beside them, or changes
//! of one are kept for the next time, it stays. Folders of earlier sessions may be read: what was dropped before a crash opens again.

use std::collections::BTreeSet;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use axum::body::Body;
use axum::extract::{Query, State};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use http_body_util::BodyExt as _;
use serde::Deserialize;

use super::Studio;
use super::api::refusal;
use crate::recovery::{Recovery, private_folder, private_temporary_folder};
use plumbline_num::files::{AtomicFile, IfExists};

/// Bytes of all files together: two large scans.
const MAX_BYTES: u64 = 2 << 30;
/// Files of a session.
const MAX_FILES: u64 = 1000;

/// The folder of a session.
#[derive(Debug)]
pub(crate) struct Uploads {
    folder: PathBuf,
    /// The folder of the folders of all sessions, where it is private; else that of this one.
    root: PathBuf,
    /// Where unsaved changes are kept.
    recovery: Option<Recovery>,
    used: AtomicU64,
    count: AtomicU64,
    /// What was dropped, not saved.
    dropped: Mutex<BTreeSet<PathBuf>>,
    max_bytes: u64,
}

impl Uploads {
    /// In the state folder, or in the system's folder of temporary files.
    pub(crate) fn new(state: Option<&Path>) -> io::Result<Self> {
        let parent = state.map_or_else(std::env::temp_dir, |state| state.join("dropped"));
        if state.is_some() {
            private_folder(&parent)?;
        }
        let parent = parent.canonicalize()?;
        let folder = private_temporary_folder("session-", &parent)?.keep();
        Ok(Self {
            root: if state.is_some() { parent } else { folder.clone() },
            folder,
            recovery: None,
            used: AtomicU64::new(0),
            count: AtomicU64::new(0),
            dropped: Mutex::default(),
            max_bytes: MAX_BYTES,
        })
    }

    /// Files with unsaved changes in here stay at the end.
    pub(crate) fn with_recovery(mut self, recovery: Option<Recovery>) -> Self {
        self.recovery = recovery;
        self
    }

    /// What dropped files may be opened from.
    pub(crate) fn root(&self) -> &Path {
        &self.root
    }

    /// A path for a file of this name: each in a folder of its own, so that names do not meet.
    fn target(&self, name: &str) -> io::Result<PathBuf> {
        let name = Path::new(name).file_name().and_then(|n| n.to_str()).filter(|n| !n.starts_with('.'));
        let name = name.ok_or_else(|| io::Error::other("a dropped file needs a name"))?;
        let k = self.count.fetch_add(1, Ordering::Relaxed);
        if k >= MAX_FILES {
            return Err(io::Error::other(format!("more than {MAX_FILES} files were dropped")));
        }
        let folder = self.folder.join(k.to_string());
        private_folder(&folder)?;
        let target = folder.join(name);
        self.dropped.lock().unwrap_or_else(PoisonError::into_inner).insert(target.clone());
        Ok(target)
    }

    /// Takes part of the space.
    fn take(&self, bytes: u64) -> io::Result<()> {
        let before = self.used.fetch_add(bytes, Ordering::Relaxed);
        if before.saturating_add(bytes) > self.max_bytes {
            self.used.fetch_sub(bytes, Ordering::Relaxed);
            return Err(io::Error::new(
                io::ErrorKind::QuotaExceeded,
                format!("dropped files may have {} MB together", self.max_bytes >> 20),
            ));
        }
        Ok(())
    }

    /// A file of this content.
    pub(crate) fn keep(&self, name: &str, content: &[u8]) -> io::Result<PathBuf> {
        let target = self.target(name)?;
        self.take(content.len() as u64)?;
        std::fs::write(&target, content)?;
        Ok(target)
    }

    async fn receive(&self, name: &str, mut body: Body) -> io::Result<PathBuf> {
        let target = self.target(name)?;
        let mut file = AtomicFile::next_to(&target, IfExists::Refuse)?;
        while let Some(frame) = body.frame().await {
            let frame = frame.map_err(io::Error::other)?;
            if let Some(data) = frame.data_ref() {
                self.take(data.len() as u64)?;
                // A few kB at a time, to a disk of this machine.
                file.file().ok_or_else(|| io::Error::other("no file"))?.write_all(data)?;
            }
        }
        file.publish(&target, IfExists::Refuse)?;
        Ok(target)
    }
}

impl Drop for Uploads {
    fn drop(&mut self) {
        let dropped = self.dropped.lock().unwrap_or_else(PoisonError::into_inner);
        let folders: BTreeSet<_> = dropped.iter().filter_map(|file| file.parent()).collect();
        let only_dropped = |folder: &&&Path| {
            folder.read_dir().is_ok_and(|mut files| files.all(|f| f.is_ok_and(|f| dropped.contains(&f.path()))))
        };
        let unsaved = |file: &Path| self.recovery.as_ref().is_some_and(|recovery| recovery.has(file));
        let kept: BTreeSet<_> = dropped.iter().filter(|file| unsaved(file)).filter_map(|file| file.parent()).collect();
        for folder in folders.difference(&kept).filter(only_dropped) {
            let _ = std::fs::remove_dir_all(folder);
        }
        // Stays where something is in it.
        let _ = std::fs::remove_dir(&self.folder);
    }
}

#[derive(Deserialize)]
pub(super) struct Upload {
    name: String,
}

/// `POST /api/upload?name=`: a dropped file.
pub(super) async fn upload(State(studio): State<Arc<Studio>>, Query(query): Query<Upload>, body: Body) -> Response {
    match studio.uploads.receive(&query.name, body).await {
        Ok(path) => axum::Json(serde_json::json!({ "path": path })).into_response(),
        Err(e) if e.kind() == io::ErrorKind::QuotaExceeded => refusal(StatusCode::PAYLOAD_TOO_LARGE, &e.to_string()),
        Err(e) => refusal(StatusCode::UNPROCESSABLE_ENTITY, &format!("{}: {e}", query.name)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn uploads(folder: &Path, max_bytes: u64) -> Uploads {
        let mut uploads = Uploads::new(Some(folder)).expect("a folder");
        uploads.max_bytes = max_bytes;
        uploads
    }

    fn receive(uploads: &Uploads, name: &str, content: &'static str) -> io::Result<PathBuf> {
        let runtime = tokio::runtime::Builder::new_current_thread().build().expect("a runtime");
        runtime.block_on(uploads.receive(name, Body::from(content)))
    }

    #[test]
    fn files_beyond_the_bound_are_refused_and_leave_nothing() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let uploads = uploads(folder.path(), 10);
        let first = receive(&uploads, "a.ply", "12345678").expect("8 of 10 bytes");
        let refused = receive(&uploads, "b.ply", "123").expect_err("11 of 10 bytes");
        assert_eq!(refused.kind(), io::ErrorKind::QuotaExceeded);
        receive(&uploads, "c.ply", "12").expect("10 of 10 bytes");
        let of_second = first.parent().and_then(Path::parent).expect("the folder").join("1");
        assert_eq!(of_second.read_dir().expect("its folder").count(), 0, "no part of it stays");
    }

    #[test]
    fn what_was_saved_beside_a_dropped_file_stays() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let uploads = uploads(folder.path(), 10);
        let [dropped, saved] = ["a.ply", "b.ply"].map(|name| receive(&uploads, name, "1").expect("small"));
        let beside = saved.with_file_name("b.deform.toml");
        std::fs::write(&beside, "version = 1").expect("written");
        drop(uploads);
        assert!(!dropped.exists() && saved.exists() && beside.exists());
    }
}
