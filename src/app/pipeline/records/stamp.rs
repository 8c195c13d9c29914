//! What a file is recognized by: size and time.

use std::ffi::OsStr;
use std::path::{Component, Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::pipeline::items::{RECORDS_FOLDER, is_glob};
use crate::pipeline::paths::to_text;

/// What a file is recognized by.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::pipeline) struct Stamp {
    /// Bytes; of a folder, of all files in it.
    pub(super) size: u64,
    /// Time of its last change, nanoseconds since 1970; of a folder, the latest of its files.
    mtime_ns: u64,
    /// Of a folder or a sequence: its files, with size and time of each.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    files: Option<String>,
}

impl Stamp {
    /// Of a file, of all files in a folder, or of those that a pattern may mean; `None` where there is none.
    pub(in crate::pipeline) fn of(path: &Path) -> Option<Self> {
        match path.metadata() {
            Ok(meta) if meta.is_dir() => Self::of_files(files_below(path)),
            Ok(meta) => Some(Self { size: meta.len(), mtime_ns: mtime_ns(&meta), files: None }),
            // A pattern of numbers, or a glob: all files of the folder that end like it.
            Err(_) if is_pattern(path) => {
                let like = |file: &PathBuf| file.extension() == path.extension();
                let listed = std::fs::read_dir(folder_of(path)).into_iter().flatten().filter_map(Result::ok);
                Self::of_files(listed.map(|e| e.path()).filter(like).collect())
            }
            Err(_) => None,
        }
    }

    fn of_files(mut files: Vec<PathBuf>) -> Option<Self> {
        files.sort();
        let mut all = Self { size: 0, mtime_ns: 0, files: None };
        // FNV-1a: a change by accident is to be seen, not one by intent.
        let mut sum = 0xcbf2_9ce4_8422_2325_u64;
        let mut add = |bytes: &[u8]| {
            for byte in bytes {
                sum = (sum ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
            }
        };
        let mut count = 0;
        for file in &files {
            let Ok(meta) = file.metadata() else { continue };
            if !meta.is_file() {
                continue;
            }
            count += 1;
            all.size += meta.len();
            all.mtime_ns = all.mtime_ns.max(mtime_ns(&meta));
            add(file.file_name().unwrap_or_default().as_encoded_bytes());
            add(&meta.len().to_le_bytes());
            add(&mtime_ns(&meta).to_le_bytes());
        }
        all.files = Some(format!("{count}:{sum:016x}"));
        (count > 0).then_some(all)
    }
}

fn mtime_ns(meta: &std::fs::Metadata) -> u64 {
    let since = meta.modified().ok().and_then(|t| t.duration_since(std::time::UNIX_EPOCH).ok());
    since.and_then(|t| u64::try_from(t.as_nanos()).ok()).unwrap_or(0)
}

/// The name of a numbered sequence, or a glob.
pub(super) fn is_pattern(path: &Path) -> bool {
    let text = to_text(path);
    text.contains('%') || is_glob(&text)
}

/// Most files of a folder that are looked at.
const MAX_FILES: usize = 1 << 20;

/// Files below a folder, links not followed.
fn files_below(folder: &Path) -> Vec<PathBuf> {
    let (mut files, mut left) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(folder) = left.pop() {
        for entry in std::fs::read_dir(&folder).into_iter().flatten().filter_map(Result::ok) {
            match entry.file_type() {
                Ok(kind) if kind.is_dir() && entry.file_name() != OsStr::new(RECORDS_FOLDER) => left.push(entry.path()),
                Ok(kind) if !kind.is_dir() && files.len() < MAX_FILES => files.push(entry.path()),
                _ => {}
            }
        }
    }
    files
}

pub(super) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| *p != Path::new("")).unwrap_or(Path::new("."))
}

/// The path without links, also of what does not exist; `.` and `..` taken out.
pub(in crate::pipeline) fn resolved(path: &Path) -> PathBuf {
    if let Ok(found) = path.canonicalize() {
        return found;
    }
    match (folder_of(path).canonicalize(), path.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        _ => std::path::absolute(path).unwrap_or_else(|_| path.to_owned()),
    }
}

/// `path` as seen from `folder`; both without links.
pub(super) fn relative(path: &Path, folder: &Path) -> PathBuf {
    let (mut to, mut from) = (path.components().peekable(), folder.components().peekable());
    while to.peek().is_some() && to.peek() == from.peek() {
        to.next();
        from.next();
    }
    from.map(|_| Component::ParentDir).chain(to).collect()
}

/// `..` taken out of a path without links.
pub(super) fn normal(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => _ = out.pop(),
            Component::CurDir => {}
            part => out.push(part),
        }
    }
    out
}
