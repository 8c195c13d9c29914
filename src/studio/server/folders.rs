//! Folders that files may be opened from, and the picker of files in them.

use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::content::extension;
use crate::error::StudioError;
use plumbline_num::files::FileAccess;

/// Entries that are listed; a folder with more is listed up to here.
const MAX_ENTRIES: usize = 2000;

/// Folders, with links resolved.
#[derive(Debug)]
pub(crate) struct Folders {
    /// Named at start: what the picker begins with.
    named: Vec<PathBuf>,
    /// The same and that of dropped files.
    all: Vec<PathBuf>,
}

/// A folder for the picker.
#[derive(Debug, Serialize)]
pub(crate) struct Listing {
    /// The folder; empty for the list of those named at start.
    path: String,
    parent: Option<String>,
    entries: Vec<Entry>,
    /// There are more entries than are listed.
    cut: bool,
}

#[derive(Debug, Serialize)]
struct Entry {
    name: String,
    path: String,
    folder: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    bytes: Option<u64>,
    /// What the name promises; the content decides when it is opened.
    #[serde(skip_serializing_if = "Option::is_none")]
    workspace: Option<&'static str>,
}

impl Folders {
    pub(crate) fn new(named: &[PathBuf], dropped: &Path) -> Result<Self, StudioError> {
        let resolve = |folder: &Path| {
            let found = folder.canonicalize().and_then(|path| path.read_dir().map(|_| path));
            found.map_err(|e| StudioError::Input { path: folder.to_owned(), why: e.to_string() })
        };
        let named = named.iter().map(|folder| resolve(folder)).collect::<Result<Vec<_>, _>>()?;
        let all = named.iter().cloned().chain([resolve(dropped)?]).collect();
        Ok(Self { named, all })
    }

    /// Folders that were named at start.
    pub(crate) fn named(&self) -> &[PathBuf] {
        &self.named
    }

    /// All folders.
    pub(crate) fn all(&self) -> Vec<PathBuf> {
        self.all.clone()
    }

    /// The file or folder that a text means, without links: relative to the first folder, or absolute.
    ///
    /// # Errors
    /// Where it is in none of the folders, or there is none. Which of the two is not said.
    pub(crate) fn resolve(&self, text: &str) -> Result<PathBuf, String> {
        let first = self.named.first().or(self.all.first()).ok_or("there is no folder to open files from")?;
        let refused = |_| format!("{text}: there is no such file in the folders of the studio");
        FileAccess::of_folder(first, &self.all).resolve(Path::new(text)).map_err(refused)
    }

    /// What is in a folder, or the folders named at start where there are several of them.
    pub(crate) fn list(&self, text: &str) -> Result<Listing, String> {
        match (text, self.named.as_slice()) {
            ("", [only]) => self.entries(only),
            ("", named) => Ok(Listing {
                path: String::new(),
                parent: None,
                entries: named.iter().map(|path| folder_entry(path, path.display().to_string())).collect(),
                cut: false,
            }),
            _ => self.entries(&self.resolve(text)?),
        }
    }

    fn entries(&self, folder: &Path) -> Result<Listing, String> {
        let read = folder.read_dir().map_err(|e| format!("{}: {e}", folder.display()))?;
        let mut found: Vec<_> = read.filter_map(Result::ok).map(|entry| entry.path()).collect();
        found.sort();
        let mut entries: Vec<Entry> = found.iter().filter_map(|path| self.entry(path)).take(MAX_ENTRIES + 1).collect();
        let cut = entries.len() > MAX_ENTRIES;
        entries.truncate(MAX_ENTRIES);
        entries.sort_by_key(|entry| !entry.folder);
        let parent = match folder.parent() {
            _ if self.all.iter().any(|root| root == folder) => (self.named.len() > 1).then(String::new),
            parent => parent.map(|p| p.display().to_string()),
        };
        Ok(Listing { path: folder.display().to_string(), parent, entries, cut })
    }

    /// An entry, unless it is hidden, is a link out of the folders, or nobody opens it.
    fn entry(&self, path: &Path) -> Option<Entry> {
        let name = path.file_name()?.to_str()?.to_owned();
        if name.starts_with('.') {
            return None;
        }
        let real = self.resolve(path.to_str()?).ok()?;
        let found = real.metadata().ok()?;
        if found.is_dir() {
            return Some(folder_entry(path, name));
        }
        let workspace = promised(path)?;
        let path = path.display().to_string();
        found.is_file().then_some(Entry {
            name,
            path,
            folder: false,
            bytes: Some(found.len()),
            workspace: Some(workspace),
        })
    }
}

fn folder_entry(path: &Path, name: String) -> Entry {
    Entry { name, path: path.display().to_string(), folder: true, bytes: None, workspace: None }
}

/// The workspace that the name of a file promises.
fn promised(path: &Path) -> Option<&'static str> {
    match extension(path).as_str() {
        "obj" | "ply" | "off" | "stl" | "gltf" => Some("mesh"),
        "glb" | "vrm" | "fbx" | "bvh" => Some("character"),
        "jpg" | "jpeg" | "png" | "tif" | "tiff" | "webp" => Some("photo"),
        "toml" => Some("pipeline"),
        #[cfg(any(test, debug_assertions))]
        "fake" => Some("fake"),
        _ => None,
    }
}
