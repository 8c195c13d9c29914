//! Files dropped on the page, and copies of examples: kept in a folder of this session, of bounded size.
//!
//! Files that are dropped together are beside each other, so that a glTF file finds its buffers and textures. The folder is removed at
//! the end, or by the next session, where only files that were dropped are in it. Folders of earlier sessions may be read: what was
//! saved there opens again.

use std::collections::BTreeMap;
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
use super::session_folder::SessionFolder;
use crate::recovery::{Recovery, private_folder};
use plumbline_num::files::{AtomicFile, IfExists};

/// Bytes of all files together: two large scans.
const MAX_BYTES: u64 = 2 << 30;
/// Files of a session.
const MAX_FILES: u64 = 1000;
/// Length of the name of a drop.
const MAX_DROP_NAME: usize = 64;

/// The folder of a session.
#[derive(Debug)]
pub(crate) struct Uploads {
    folder: SessionFolder,
    /// The folder of the folders of all sessions, where it is private; else that of this one.
    root: PathBuf,
    /// Where unsaved changes are kept.
    recovery: Option<Recovery>,
    used: AtomicU64,
    count: AtomicU64,
    /// Folders of the drops by the names that the page gave them.
    drops: Mutex<BTreeMap<String, PathBuf>>,
    max_bytes: u64,
}

impl Uploads {
    /// In the state folder, or in the system's folder of temporary files. Files with unsaved changes in there stay.
    pub(crate) fn new(state: Option<&Path>, recovery: Option<Recovery>) -> io::Result<Self> {
        let parent = state.map_or_else(std::env::temp_dir, |state| state.join("dropped"));
        if state.is_some() {
            private_folder(&parent)?;
        }
        let parent = parent.canonicalize()?;
        let folder = match state {
            Some(_) => SessionFolder::after_others(&parent, recovery.as_ref())?,
            None => SessionFolder::in_folder(&parent)?,
        };
        Ok(Self {
            root: if state.is_some() { parent } else { folder.path().to_owned() },
            folder,
            recovery,
            used: AtomicU64::new(0),
            count: AtomicU64::new(0),
            drops: Mutex::default(),
            max_bytes: MAX_BYTES,
        })
    }

    /// What dropped files may be opened from.
    pub(crate) fn root(&self) -> &Path {
        &self.root
    }

    /// A path for a file of this name: in the folder of its drop, or in one of its own, so that names do not meet.
    fn target(&self, name: &str, drop: Option<&str>) -> io::Result<PathBuf> {
        let name = Path::new(name).file_name().and_then(|n| n.to_str()).filter(|n| !n.starts_with('.'));
        let name = name.ok_or_else(|| io::Error::other("a dropped file needs a name"))?;
        let k = self.count.fetch_add(1, Ordering::Relaxed);
        if k >= MAX_FILES {
            return Err(io::Error::other(format!("more than {MAX_FILES} files were dropped")));
        }
        let Some(drop) = drop else { return Ok(self.folder.drop_folder(k)?.join(name)) };
        if drop.len() > MAX_DROP_NAME {
            return Err(io::Error::other(format!("the name of a drop is longer than {MAX_DROP_NAME} bytes")));
        }
        let mut drops = self.drops.lock().unwrap_or_else(PoisonError::into_inner);
        let folder = match drops.get(drop) {
            Some(folder) => folder.clone(),
            None => self.folder.drop_folder(k)?,
        };
        drops.insert(drop.to_owned(), folder.clone());
        Ok(folder.join(name))
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
        let target = self.target(name, None)?;
        self.take(content.len() as u64)?;
        let mut file = AtomicFile::next_to(&target, IfExists::Refuse)?;
        written(&mut file, content)?;
        self.publish(file, target)
    }

    async fn receive(&self, name: &str, drop: Option<&str>, mut body: Body) -> io::Result<PathBuf> {
        let target = self.target(name, drop)?;
        let mut file = AtomicFile::next_to(&target, IfExists::Refuse)?;
        while let Some(frame) = body.frame().await {
            let frame = frame.map_err(io::Error::other)?;
            if let Some(data) = frame.data_ref() {
                self.take(data.len() as u64)?;
                // A few kB at a time, to a disk of this machine.
                written(&mut file, data)?;
            }
        }
        self.publish(file, target)
    }

    fn publish(&self, file: AtomicFile, target: PathBuf) -> io::Result<PathBuf> {
        self.folder.list(&target, file.path())?;
        file.publish(&target, IfExists::Refuse)?;
        Ok(target)
    }
}

fn written(file: &mut AtomicFile, data: &[u8]) -> io::Result<()> {
    file.file().ok_or_else(|| io::Error::other("no file"))?.write_all(data)
}

impl Drop for Uploads {
    fn drop(&mut self) {
        self.folder.remove_unchanged(self.recovery.as_ref());
    }
}

#[derive(Deserialize)]
pub(super) struct Upload {
    name: String,
    /// Files with the same word were dropped together.
    #[serde(default)]
    drop: Option<String>,
}

/// `POST /api/upload?name=&drop=`: a dropped file.
pub(super) async fn upload(State(studio): State<Arc<Studio>>, Query(query): Query<Upload>, body: Body) -> Response {
    match studio.uploads.receive(&query.name, query.drop.as_deref(), body).await {
        Ok(path) => axum::Json(serde_json::json!({ "path": path })).into_response(),
        Err(e) if e.kind() == io::ErrorKind::QuotaExceeded => refusal(StatusCode::PAYLOAD_TOO_LARGE, &e.to_string()),
        Err(e) => refusal(StatusCode::UNPROCESSABLE_ENTITY, &format!("{}: {e}", query.name)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn uploads(folder: &Path, max_bytes: u64) -> Uploads {
        let recovery = Recovery::in_folder(folder.join("recovery")).expect("a folder");
        let mut uploads = Uploads::new(Some(folder), Some(recovery)).expect("a folder");
        uploads.max_bytes = max_bytes;
        uploads
    }

    fn receive(uploads: &Uploads, name: &str, drop: Option<&str>, content: &'static str) -> io::Result<PathBuf> {
        let runtime = tokio::runtime::Builder::new_current_thread().build().expect("a runtime");
        runtime.block_on(uploads.receive(name, drop, Body::from(content)))
    }

    /// The server is killed: nothing is removed, and its lock is free.
    fn kill(uploads: Uploads) {
        uploads.folder.release();
        std::mem::forget(uploads);
    }

    #[test]
    fn files_beyond_the_bound_are_refused_and_leave_nothing() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let uploads = uploads(folder.path(), 10);
        let first = receive(&uploads, "a.ply", None, "12345678").expect("8 of 10 bytes");
        let refused = receive(&uploads, "b.ply", None, "123").expect_err("11 of 10 bytes");
        assert_eq!(refused.kind(), io::ErrorKind::QuotaExceeded);
        receive(&uploads, "c.ply", None, "12").expect("10 of 10 bytes");
        let of_second = first.parent().and_then(Path::parent).expect("the folder").join("1");
        assert_eq!(of_second.read_dir().expect("its folder").count(), 0, "no part of it stays");
    }

    #[test]
    fn files_that_are_dropped_together_are_beside_each_other() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let uploads = uploads(folder.path(), 100);
        let drop = |name, drop| receive(&uploads, name, drop, "1");
        let [scene, buffer] = ["a.gltf", "a.bin"].map(|name| drop(name, Some("x")).expect("small"));
        assert_eq!(scene.parent(), buffer.parent());
        let refused = drop("a.bin", Some("x")).expect_err("there is one of this name");
        assert_eq!(refused.kind(), io::ErrorKind::AlreadyExists);
        let other = drop("a.bin", Some("y")).expect("another drop");
        assert!(other.parent() != buffer.parent() && drop("a.bin", None).expect("a drop of its own") != other);
        for name in ["../x", "/", ""] {
            let kept = drop("b.bin", Some(name)).expect("a word, not a path");
            assert!(kept.starts_with(uploads.folder.path()), "{}", kept.display());
        }
        assert!(drop("a.bin", Some(&"x".repeat(65))).is_err());
    }

    #[test]
    fn what_was_saved_beside_a_dropped_file_or_in_its_place_stays() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let uploads = uploads(folder.path(), 100);
        let dropped = ["a.ply", "b.ply", "c.toml"].map(|name| receive(&uploads, name, None, "1").expect("small"));
        let beside = dropped[1].with_file_name("b.deform.toml");
        std::fs::write(&beside, "version = 1").expect("written");
        std::fs::write(&dropped[2], "version = 1").expect("written");
        drop(uploads);
        assert_eq!(dropped.each_ref().map(|file| file.exists()), [false, true, true]);
        assert!(beside.exists());
    }

    #[test]
    fn what_a_killed_server_left_is_removed_by_the_next_and_nothing_of_one_that_runs() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let [killed, running] = [(), ()].map(|()| uploads(folder.path(), 100));
        let of_killed = ["a.ply", "b.ply", "c.ply"].map(|name| receive(&killed, name, None, "1").expect("small"));
        let of_running = receive(&running, "a.ply", None, "1").expect("small");
        std::fs::write(of_killed[1].with_file_name("b.deform.toml"), "version = 1").expect("written");
        // Of a character the document is not the file that was dropped.
        let document = of_killed[2].with_file_name("c.character.toml");
        let recovery = killed.recovery.clone().expect("a folder");
        recovery
            .store(&document, &std::collections::BTreeMap::from([(document.clone(), (*b"x").into())]))
            .expect("kept");
        let half = of_killed[0].with_file_name(format!("a.partial-{}-abcdefgh.ply", std::process::id()));
        std::fs::write(half, "1").expect("an upload that was cut short");
        kill(killed);
        let next = uploads(folder.path(), 100);
        assert_eq!(of_killed.each_ref().map(|file| file.exists()), [false, true, true]);
        assert!(of_running.exists());
        recovery.remove(&document).expect("it was saved");
        drop(uploads(folder.path(), 100));
        assert!(!of_killed[2].exists() && of_killed[1].exists() && of_running.exists());
        drop((next, running));
        let sessions = folder.path().join("dropped").read_dir().expect("a folder").filter_map(Result::ok);
        let sessions = sessions.filter(|entry| entry.path().is_dir()).count();
        assert_eq!(sessions, 1, "that in which something was saved");
    }
}
