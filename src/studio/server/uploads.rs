//! Files dropped on the page, and copies of examples: kept in a folder of this session, of bounded size.
//!
//! The folder is removed at the end where only files that were dropped are in it; where something was saved beside them it stays.

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
use crate::recovery::{private_folder, private_temporary_folder};
use plumbline_num::files::{AtomicFile, IfExists};

/// Bytes of all files together: two large scans.
const MAX_BYTES: u64 = 2 << 30;
/// Files of a session.
const MAX_FILES: u64 = 1000;

/// The folder of a session.
#[derive(Debug)]
pub(crate) struct Uploads {
    folder: PathBuf,
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
        let folder = private_temporary_folder("session-", &parent)?.keep();
        Ok(Self {
            folder,
            used: AtomicU64::new(0),
            count: AtomicU64::new(0),
            dropped: Mutex::default(),
            max_bytes: MAX_BYTES,
        })
    }

    pub(crate) fn folder(&self) -> &Path {
        &self.folder
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

    /// A copy of a file, with those that belong to it.
    pub(crate) fn copy(&self, file: &Path, beside: &[PathBuf]) -> io::Result<PathBuf> {
        let target = self.target(&file.file_name().unwrap_or_default().to_string_lossy())?;
        self.take(std::fs::copy(file, &target)?)?;
        for other in beside {
            let copy = target.with_file_name(other.file_name().unwrap_or_default());
            self.take(std::fs::copy(other, copy)?)?;
        }
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
        for folder in folders.iter().filter(only_dropped) {
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
