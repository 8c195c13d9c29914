//! Unsaved changes outlive a crash: the files of a document as they would be saved, kept in one file of a private folder.
//!
//! The file is a line of JSON that names the document and the lengths of its texts, then the texts. It is written whole or not at
//! all, so that a crash while writing leaves the one before.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use plumbline_num::files::{IfExists, open_regular, write_whole};

/// Contents of files by absolute path.
pub type Texts = BTreeMap<PathBuf, Arc<[u8]>>;

/// Maximum size of a recovery file, bytes: side files are a few MB.
const MAX_BYTES: u64 = 1 << 30;

/// Maximum size of the header of a recovery file, bytes: a path per text.
const MAX_HEADER: u64 = 1 << 20;

/// A folder of recovery files.
#[derive(Clone, Debug)]
pub struct Recovery {
    folder: PathBuf,
}

#[derive(Deserialize, Serialize)]
struct Header {
    format: String,
    opened: PathBuf,
    files: Vec<(PathBuf, u64)>,
}

const FORMAT: &str = "plumbline.recovery/1";

impl Recovery {
    /// In this folder, which is made where it is missing; only this user may look into it.
    ///
    /// # Errors
    /// What the system says.
    pub fn in_folder(folder: impl Into<PathBuf>) -> io::Result<Self> {
        let folder = folder.into();
        private_folder(&folder)?;
        Ok(Self { folder })
    }

    fn file(&self, opened: &Path) -> PathBuf {
        let stem = opened.file_stem().unwrap_or_default().to_string_lossy();
        let stem: String = stem.chars().filter(|c| c.is_alphanumeric()).take(40).collect();
        self.folder.join(format!("{stem}-{:016x}", fnv(opened.as_os_str().as_encoded_bytes())))
    }

    /// What was kept for this document, where anything was.
    ///
    /// # Errors
    /// A file that cannot be read, or is none of ours.
    pub fn load(&self, opened: &Path) -> io::Result<Option<Texts>> {
        let file = match open_regular(&self.file(opened)) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
            file => file?,
        };
        let mut bytes = Vec::new();
        io::Read::read_to_end(&mut io::Read::take(file, MAX_BYTES), &mut bytes)?;
        let (header, texts) = parse(&bytes).ok_or_else(|| io::Error::other("no recovery file"))?;
        Ok((header.opened == opened).then_some(texts))
    }

    /// Documents of which anything is kept.
    pub fn documents(&self) -> Vec<PathBuf> {
        let files = self.folder.read_dir().into_iter().flatten().filter_map(Result::ok);
        files.filter_map(|file| header(&file.path())).map(|header| header.opened).collect()
    }

    /// Keeps these texts for the document, in place of those before.
    ///
    /// # Errors
    /// What the system says; those before stay.
    pub fn store(&self, opened: &Path, texts: &Texts) -> io::Result<()> {
        let files = texts.iter().map(|(path, text)| (path.clone(), text.len() as u64)).collect();
        let header = Header { format: FORMAT.to_owned(), opened: opened.to_owned(), files };
        let mut bytes = serde_json::to_vec(&header).map_err(io::Error::other)?;
        bytes.push(b'\n');
        for text in texts.values() {
            bytes.extend_from_slice(text);
        }
        write_whole(&self.file(opened), &bytes, IfExists::Replace)
    }

    /// Forgets what was kept for the document.
    ///
    /// # Errors
    /// What the system says.
    pub fn remove(&self, opened: &Path) -> io::Result<()> {
        match std::fs::remove_file(self.file(opened)) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(()),
            removed => removed,
        }
    }

    /// Puts what was kept aside, under a name that is returned: it cannot be opened, and is not lost.
    ///
    /// # Errors
    /// What the system says.
    pub fn put_aside(&self, opened: &Path) -> io::Result<PathBuf> {
        let file = self.file(opened);
        let aside = file.with_extension("unreadable");
        std::fs::rename(&file, &aside)?;
        Ok(aside)
    }
}

/// Makes a folder that only this user may look into.
///
/// # Errors
/// What the system says.
pub fn private_folder(folder: &Path) -> io::Result<()> {
    let mut builder = std::fs::DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(folder)?;
    #[cfg(unix)]
    std::fs::set_permissions(folder, std::os::unix::fs::PermissionsExt::from_mode(0o700))?;
    Ok(())
}

/// A folder of a new name that only this user may look into.
///
/// # Errors
/// What the system says.
pub(crate) fn private_temporary_folder(prefix: &str, parent: &Path) -> io::Result<tempfile::TempDir> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(prefix);
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o700));
    builder.tempdir_in(parent)
}

/// The header of a recovery file.
fn header(file: &Path) -> Option<Header> {
    let file = io::BufReader::new(open_regular(file).ok()?);
    let mut line = Vec::new();
    io::BufRead::read_until(&mut io::Read::take(file, MAX_HEADER), b'\n', &mut line).ok()?;
    serde_json::from_slice(&line).ok()
}

fn parse(bytes: &[u8]) -> Option<(Header, Texts)> {
    let end = bytes.iter().position(|b| *b == b'\n')?;
    let header: Header = serde_json::from_slice(&bytes[..end]).ok()?;
    let mut rest = &bytes[end + 1..];
    let mut texts = Texts::new();
    for (path, length) in &header.files {
        let (text, after) = rest.split_at_checked(usize::try_from(*length).ok()?)?;
        texts.insert(path.clone(), text.into());
        rest = after;
    }
    (header.format == FORMAT && rest.is_empty()).then_some((header, texts))
}

/// FNV-1a: a name of fixed length for a path. Two paths with one name are told apart by the header.
pub(crate) fn fnv(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, b| (hash ^ u64::from(*b)).wrapping_mul(0x0100_0000_01b3))
}

#[cfg(test)]
#[path = "recovery_tests.rs"]
mod tests;
