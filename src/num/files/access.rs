//! Opening files: regular files only, and files that another file names only in folders that are allowed.
//!
//! A path that the user types may be any path. A path *inside* a file comes from whoever made the file: a mesh from
//! the network must not make other files of the machine a part of the result. [`FileAccess`] therefore confines it to the folder of
//! the file that names it, and to folders that the user allows besides.

use std::fs::{File, FileType, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

/// Opens a regular file for reading. Anything else is refused before it is opened, since opening a named pipe waits for a writer, and
/// again when it is open, since the name may mean another file by then.
///
/// # Errors
/// Those of the system; [`io::ErrorKind::InvalidInput`] for a folder, named pipe, socket or device, with the remedy.
pub fn open_regular(path: &Path) -> io::Result<File> {
    check_type(std::fs::metadata(path)?.file_type())?;
    let mut options = OpenOptions::new();
    options.read(true);
    // Never waits, and never makes a terminal the controlling one; regular files are read as without these flags.
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::custom_flags(&mut options, libc::O_NONBLOCK | libc::O_NOCTTY);
    let file = options.open(path)?;
    check_type(file.metadata()?.file_type())?;
    Ok(file)
}

/// Refuses what is no regular file.
///
/// # Errors
/// [`io::ErrorKind::InvalidInput`] with what it is, and the remedy.
pub fn check_type(found: FileType) -> io::Result<()> {
    refused(found, "write its content to a file and give the path of that")
}

/// Refuses a target that exists and is no regular file, also through links: its name would be given to another file, and the
/// folder, pipe or device would be lost to everyone who uses it.
///
/// # Errors
/// [`io::ErrorKind::InvalidInput`] with what it is, and the remedy.
pub(super) fn check_target(target: &Path) -> io::Result<()> {
    target
        .metadata()
        .map_or(Ok(()), |found| refused(found.file_type(), "it is not replaced; give the name of a new file"))
}

fn refused(found: FileType, remedy: &str) -> io::Result<()> {
    let (what, remedy) = match () {
        () if found.is_file() => return Ok(()),
        () if found.is_dir() => ("a folder", "give the path of a file in it"),
        () => (special(found), remedy),
    };
    Err(io::Error::new(io::ErrorKind::InvalidInput, format!("{what}, not a regular file; {remedy}")))
}

#[cfg(unix)]
fn special(found: FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt;
    match () {
        () if found.is_fifo() => "a named pipe",
        () if found.is_socket() => "a socket",
        () if found.is_char_device() || found.is_block_device() => "a device",
        () => "a special file",
    }
}

#[cfg(not(unix))]
fn special(_found: FileType) -> &'static str {
    "a special file"
}

/// Why a path inside a file was refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AccessError {
    /// Input: a text that is no path.
    #[error("{named:?} is not a path of a file")]
    NotAPath {
        /// The path as the file has it.
        named: String,
    },
    /// Input: outside the folders that are allowed.
    #[error(
        "{named:?} leads outside the folder of the file that names it ({folder}); put it into that folder, or allow its own \
         with --allow-path DIR (`run.allow_paths`)"
    )]
    Outside {
        /// The path as the file has it.
        named: String,
        /// The folder of the file that names it.
        folder: String,
    },
    /// Input: the bytes that name it come from no file.
    #[error("{named:?}: other files are not opened here")]
    NoFolder {
        /// The path as the file has it.
        named: String,
    },
    /// Input or environment: no such file, or one that cannot be read.
    #[error("{named:?} cannot be read: {fault}")]
    Io {
        /// The path as the file has it.
        named: String,
        /// Error of the system.
        #[source]
        fault: io::Error,
    },
}

/// Files that a file may name: those in its own folder, and in folders that the user allows.
///
/// ```
/// # use plumbline_num::files::FileAccess;
/// let access = FileAccess::of_file("models/chair.gltf".as_ref(), &[]);
/// assert!(access.resolve("../secret.bin".as_ref()).is_err());
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct FileAccess<'a> {
    folder: Option<&'a Path>,
    allowed: &'a [PathBuf],
}

impl<'a> FileAccess<'a> {
    /// For the paths in `file`; `allowed` are further folders.
    pub fn of_file(file: &'a Path, allowed: &'a [PathBuf]) -> Self {
        Self::of_folder(file.parent().unwrap_or(Path::new("")), allowed)
    }

    /// For the paths in a file of `folder`.
    pub fn of_folder(folder: &'a Path, allowed: &'a [PathBuf]) -> Self {
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        Self { folder: Some(folder), allowed }
    }

    /// The file that is meant by `named`, a path relative to the folder or an absolute one, without symbolic links.
    ///
    /// # Errors
    /// [`AccessError`]: it is outside the folders by `..`, as an absolute path or through a symbolic link; or there is no such file.
    pub fn resolve(&self, named: &Path) -> Result<PathBuf, AccessError> {
        let name = || named.to_string_lossy().into_owned();
        let io = |fault: io::Error| AccessError::Io { named: name(), fault };
        let folder = self.folder.ok_or_else(|| AccessError::NoFolder { named: name() })?;
        if named.as_os_str().is_empty() || named.as_os_str().as_encoded_bytes().contains(&0) {
            return Err(AccessError::NotAPath { named: name() });
        }
        let outside = || AccessError::Outside { named: name(), folder: folder.display().to_string() };
        let roots: Vec<PathBuf> = [folder]
            .into_iter()
            .chain(self.allowed.iter().map(PathBuf::as_path))
            .filter_map(|root| root.canonicalize().ok())
            .collect();
        let allowed = |path: &Path| roots.iter().any(|root| path.starts_with(root));
        match folder.join(named).canonicalize() {
            Ok(path) if allowed(&path) => Ok(path),
            Ok(_) => Err(outside()),
            // Whether a file outside exists is not revealed either.
            Err(fault) => Err(if stays_inside(named) { io(fault) } else { outside() }),
        }
    }

    /// Opens the regular file that is meant by `named`.
    ///
    /// # Errors
    /// As [`Self::resolve`]; [`AccessError::Io`] also for what [`open_regular`] refuses.
    pub fn open(&self, named: &Path) -> Result<File, AccessError> {
        let path = self.resolve(named)?;
        open_regular(&path).map_err(|fault| AccessError::Io { named: named.to_string_lossy().into_owned(), fault })
    }
}

/// True for a relative path without `..`.
fn stays_inside(path: &Path) -> bool {
    use std::path::Component;
    path.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_inside_a_file_stay_in_its_folder_unless_another_is_allowed() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        for folder in ["home/parts", "common", "home2"] {
            std::fs::create_dir_all(at(folder)).unwrap();
        }
        for file in ["home/a.bin", "home/parts/b.bin", "common/c.bin", "home2/d.bin"] {
            std::fs::write(at(file), file).unwrap();
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(at("common/c.bin"), at("home/link.bin")).unwrap();
            std::os::unix::fs::symlink(at("home/a.bin"), at("home/parts/back.bin")).unwrap();
            std::os::unix::fs::symlink(at("common"), at("home/folder")).unwrap();
        }
        let (file, absolute) = (at("home/model.gltf"), at("common/c.bin"));
        let (alone, widened) = (FileAccess::of_file(&file, &[]), [at("common")]);
        let widened = FileAccess::of_file(&file, &widened);
        for inside in ["a.bin", "./a.bin", "parts/b.bin", "parts/../a.bin", "parts/back.bin"] {
            assert!(alone.resolve(inside.as_ref()).is_ok() && widened.open(inside.as_ref()).is_ok(), "{inside}");
        }
        let absolute = absolute.to_str().unwrap();
        for outside in ["../common/c.bin", "link.bin", "folder/c.bin", absolute] {
            let error = alone.resolve(outside.as_ref()).unwrap_err().to_string();
            assert!(error.contains(&format!("{outside:?} leads outside")) && error.contains("--allow-path"), "{error}");
            assert!(widened.resolve(outside.as_ref()).is_ok(), "{outside}");
        }
        // A folder whose name begins alike is another one; what is missing outside is reported as what is there.
        for outside in ["../home2/d.bin", "../none.bin", "/nonexistent/x", ".."] {
            let error = widened.resolve(outside.as_ref()).unwrap_err();
            assert!(matches!(error, AccessError::Outside { .. }), "{error}");
        }
        assert!(matches!(alone.resolve("none.bin".as_ref()), Err(AccessError::Io { .. })));
        for odd in ["", "a\0.bin"] {
            assert!(matches!(alone.resolve(odd.as_ref()), Err(AccessError::NotAPath { .. })), "{odd:?}");
        }
        assert!(matches!(FileAccess::default().resolve("a.bin".as_ref()), Err(AccessError::NoFolder { .. })));
    }

    #[test]
    #[cfg(unix)]
    fn pipes_sockets_devices_and_folders_are_refused_at_once() {
        let place = tempfile::tempdir().unwrap();
        let pipe = place.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let socket = place.path().join("socket");
        let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        for (path, what) in [
            (pipe.as_path(), "a named pipe, not a regular file; write its content to a file"),
            (&socket, "a socket, not a regular file"),
            (Path::new("/dev/zero"), "a device, not a regular file"),
            (place.path(), "a folder, not a regular file; give the path of a file in it"),
        ] {
            let error = open_regular(path).unwrap_err();
            assert!(error.to_string().starts_with(what), "{error}");
        }
        let named = FileAccess::of_folder(place.path(), &[]).open("pipe".as_ref()).unwrap_err().to_string();
        assert!(named.starts_with("\"pipe\" cannot be read: a named pipe"), "{named}");
    }
}
