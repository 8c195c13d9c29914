//! Files of others, opened with care; files of our own, which appear under their names once they are whole.
//!
//! | | |
//! | --- | --- |
//! | [`open_regular`] | a regular file, and never a pipe, a socket or a device |
//! | [`FileAccess`] | files that another file names, confined to folders |
//! | [`AtomicFile`] | written beside its target, synced, renamed last; one writer per target |
//! | [`write_whole`] | the same for bytes at hand |
//! | [`remove_partial_files`] | what a process that cannot unwind any more does before it ends |
//! | [`free_space`] | bytes that a file in a folder may take |
//!
//! ```
//! use plumbline_num::files::{AtomicFile, IfExists};
//!
//! # fn main() -> std::io::Result<()> {
//! # let folder = tempfile::tempdir()?;
//! let target = folder.path().join("result.txt");
//! let unfinished = AtomicFile::next_to(&target, IfExists::Refuse)?;
//! std::fs::write(unfinished.path(), "whole")?;
//! unfinished.publish(&target, IfExists::Refuse)?; // dropped instead, it would be removed
//! assert_eq!(std::fs::read_to_string(&target)?, "whole");
//! # Ok(())
//! # }
//! ```

mod access;
mod atomic_file;
mod registry;
mod rename;

use std::io::{self, Write as _};
use std::path::Path;

pub use access::{AccessError, FileAccess, check_type, open_regular};
pub use atomic_file::{AtomicFile, IfExists, publish_all};
pub use registry::remove_partial_files;

/// Writes a file that is whole or does not exist.
///
/// # Errors
/// What the system says; [`io::ErrorKind::AlreadyExists`] where the target exists and must stay.
pub fn write_whole(target: &Path, bytes: &[u8], if_exists: IfExists) -> io::Result<()> {
    let mut unfinished = AtomicFile::next_to(target, if_exists)?;
    match unfinished.file() {
        Some(file) => file.write_all(bytes)?,
        None => std::fs::write(unfinished.path(), bytes)?,
    }
    unfinished.publish(target, if_exists)
}

/// The folder that holds `path`.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Bytes that this user may still write in the file system of `folder`; `None` where the system does not report them.
pub fn free_space(folder: &Path) -> Option<u64> {
    #[cfg(unix)]
    {
        let found = rustix::fs::statvfs(folder).ok()?;
        // File systems without blocks of their own, such as those of processes, report none at all.
        (found.f_blocks > 0).then(|| found.f_bavail.saturating_mul(found.f_frsize))
    }
    #[cfg(not(unix))]
    {
        let _ = folder;
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_written_whole_and_only_where_nothing_is_replaced() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let target = folder.path().join("a.txt");
        write_whole(&target, b"first", IfExists::Refuse).expect("a new file");
        let error = write_whole(&target, b"second", IfExists::Refuse).expect_err("it exists");
        assert_eq!(error.kind(), io::ErrorKind::AlreadyExists);
        assert_eq!(std::fs::read(&target).expect("kept"), b"first");
        write_whole(&target, b"third", IfExists::Replace).expect("may be replaced");
        assert_eq!(std::fs::read(&target).expect("replaced"), b"third");
        assert_eq!(std::fs::read_dir(folder.path()).expect("folder").count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn a_folder_has_room_and_a_missing_one_has_no_figure() {
        let folder = tempfile::tempdir().expect("temporary folder");
        assert!(free_space(folder.path()).is_some_and(|bytes| bytes > 0));
        assert_eq!(free_space(&folder.path().join("none")), None);
    }
}
