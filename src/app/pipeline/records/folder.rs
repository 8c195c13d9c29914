//! The file of records of a folder: lines that are appended under a lock, and read back whatever they hold.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::IgnoredAny;

use crate::pipeline::items::RECORDS_FOLDER;
use crate::pipeline::lines_file::locked;

/// The file in [`RECORDS_FOLDER`].
const RECORDS_FILE: &str = "done.jsonl";

/// Longest line that is written or read, bytes: an item with ten thousand results has a tenth of it.
pub(super) const MAX_LINE: u64 = 8 << 20;

/// Bytes that are read of a file, from its end: a hundred thousand items have half of them.
const MAX_BYTES: u64 = 256 << 20;

/// The records of one folder.
#[derive(Debug, Default)]
pub(super) struct Folder {
    /// Last record of each item, by the name of its first result: its line, and lines of further results.
    pub(super) lines: HashMap<String, Vec<String>>,
    /// Lines of the file, those that do not count included.
    pub(super) count: usize,
    /// Length of the file when it was read, bytes.
    pub(super) length: u64,
    /// This run has appended to it.
    pub(super) appended: bool,
}

/// The path of the file of records.
pub(super) fn path_in(folder: &Path) -> PathBuf {
    folder.join(RECORDS_FOLDER).join(RECORDS_FILE)
}

/// Drops lines that do not count, where they are many.
pub(super) fn compact(folder: &Path) -> io::Result<()> {
    let path = path_in(folder);
    let held = locked(&path)?;
    let known = Folder::read(folder);
    let mut names: Vec<&String> = known.lines.keys().collect();
    names.sort();
    let mut out = tempfile::NamedTempFile::new_in(folder.join(RECORDS_FOLDER))?;
    for name in names {
        for line in &known.lines[name] {
            writeln!(out, "{line}")?;
        }
    }
    out.as_file().sync_all()?;
    out.persist(&path).map_err(|e| e.error)?;
    drop(held);
    Ok(())
}

impl Folder {
    /// Reads the file of a folder; what is no record is passed over.
    pub(super) fn read(folder: &Path) -> Self {
        let path = path_in(folder);
        let mut known = Self::default();
        // A pipe would be waited for.
        if !path.metadata().is_ok_and(|meta| meta.is_file()) {
            return known;
        }
        let Ok(mut file) = File::open(path) else { return known };
        known.length = file.metadata().map_or(0, |meta| meta.len());
        let from = known.length.saturating_sub(MAX_BYTES);
        if file.seek(SeekFrom::Start(from)).is_err() {
            return known;
        }
        let mut reader = BufReader::new(file).take(MAX_BYTES);
        let mut bytes = Vec::new();
        loop {
            bytes.clear();
            let read = (&mut reader).take(MAX_LINE).read_until(b'\n', &mut bytes);
            if !matches!(read, Ok(1..)) {
                return known;
            }
            known.add(&bytes);
        }
    }

    /// Takes a line.
    pub(super) fn add(&mut self, bytes: &[u8]) {
        /// Enough of a line to find it again.
        #[derive(Deserialize)]
        struct Head {
            name: String,
            output: Option<IgnoredAny>,
        }
        self.count += 1;
        let Ok(line) = std::str::from_utf8(bytes) else { return };
        let line = line.trim_end().to_owned();
        match serde_json::from_str(&line) {
            Ok(Head { name, output: None }) => {
                self.lines.insert(name, vec![line]);
            }
            Ok(Head { name, output: Some(_) }) => {
                if let Some(lines) = self.lines.get_mut(&name) {
                    lines.push(line);
                }
            }
            Err(_) => {}
        }
    }
}
