//! The unfinished files of this process, so that they can be removed where nothing unwinds: memory has run out, or a library
//! does not return.
//!
//! Names are kept as the system calls take them: removing them allocates nothing.

use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};

#[cfg(unix)]
type Name = std::ffi::CString;
#[cfg(not(unix))]
type Name = std::path::PathBuf;

/// What is registered.
struct Registry {
    entries: Vec<(u64, Name)>,
    /// The process is ending: nothing more is begun.
    closed: bool,
}

static REGISTRY: Mutex<Registry> = Mutex::new(Registry { entries: Vec::new(), closed: false });
static NEXT: AtomicU64 = AtomicU64::new(0);

/// A registered name; dropped, it is forgotten.
#[derive(Debug)]
pub(super) struct Registered(u64);

fn registry() -> MutexGuard<'static, Registry> {
    REGISTRY.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Registered {
    /// Registers a file or folder before it is made.
    ///
    /// # Errors
    /// A process that is ending, no memory, or a name with a zero byte.
    pub(super) fn new(path: &Path) -> io::Result<Self> {
        let name = name_of(path)?;
        let id = NEXT.fetch_add(1, Ordering::Relaxed);
        let mut registry = registry();
        if registry.closed {
            return Err(io::Error::other("the program is ending"));
        }
        // Not by `push` alone: memory that ends while the lock is held must not end the process.
        registry.entries.try_reserve(1).map_err(|_| io::ErrorKind::OutOfMemory)?;
        registry.entries.push((id, name));
        Ok(Self(id))
    }
}

impl Drop for Registered {
    fn drop(&mut self) {
        registry().entries.retain(|(id, _)| *id != self.0);
    }
}

/// Whether this process is at work on `path`.
pub(super) fn contains(path: &Path) -> bool {
    name_of(path).is_ok_and(|name| registry().entries.iter().any(|(_, n)| *n == name))
}

#[cfg(unix)]
fn name_of(path: &Path) -> io::Result<Name> {
    use std::os::unix::ffi::OsStrExt as _;
    Ok(std::ffi::CString::new(path.as_os_str().as_bytes())?)
}

#[cfg(not(unix))]
fn name_of(path: &Path) -> io::Result<Name> {
    Ok(path.to_owned())
}

/// Attempts to take the registry from a thread that may never let go of it.
const ATTEMPTS: usize = 1000;

/// Removes all unfinished files of this process, and lets it begin no more: for a process that is about to end without
/// unwinding. Allocates nothing and waits for nobody, so that a signal handler may call it.
pub fn remove_partial_files() {
    for _ in 0..ATTEMPTS {
        let mut registry = match REGISTRY.try_lock() {
            Ok(registry) => registry,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => {
                std::thread::yield_now();
                continue;
            }
        };
        registry.closed = true;
        registry.entries.iter().for_each(|(_, name)| remove(name));
        return;
    }
}

/// Removes a file, or a folder and the files in it.
#[cfg(unix)]
fn remove(name: &Name) {
    use rustix::fs::{AtFlags, CWD, unlinkat};
    // Nobody is left to hear of what cannot be removed; the next run sweeps it.
    if unlinkat(CWD, name.as_c_str(), AtFlags::empty()).is_err() {
        empty(name);
        let _ = unlinkat(CWD, name.as_c_str(), AtFlags::REMOVEDIR);
    }
}

/// Removes the files of a folder, read into a buffer on the stack.
#[cfg(target_os = "linux")]
fn empty(folder: &Name) {
    use rustix::fs::{AtFlags, Mode, OFlags, RawDir, open, unlinkat};
    let flags = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::CLOEXEC | OFlags::NOFOLLOW;
    let Ok(opened) = open(folder.as_c_str(), flags, Mode::empty()) else { return };
    let mut buffer = [std::mem::MaybeUninit::uninit(); 4096];
    let mut entries = RawDir::new(&opened, &mut buffer);
    while let Some(Ok(entry)) = entries.next() {
        let _ = unlinkat(&opened, entry.file_name(), AtFlags::empty());
    }
}

#[cfg(all(unix, not(target_os = "linux")))]
fn empty(folder: &Name) {
    use std::os::unix::ffi::OsStrExt as _;
    let path = Path::new(std::ffi::OsStr::from_bytes(folder.as_bytes()));
    for entry in std::fs::read_dir(path).into_iter().flatten().flatten() {
        let _ = std::fs::remove_file(entry.path());
    }
}

#[cfg(not(unix))]
fn remove(name: &Name) {
    let _ = std::fs::remove_file(name).or_else(|_| std::fs::remove_dir_all(name));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_registered_as_long_as_its_owner_lives() {
        let path = Path::new("none/out.partial-1-abcd1234.mp4");
        assert!(!contains(path));
        let registered = Registered::new(path).expect("open");
        assert!(contains(path));
        drop(registered);
        assert!(!contains(path));
    }

    #[test]
    fn files_and_folders_with_files_in_them_are_removed() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let (file, inner) = (folder.path().join("a"), folder.path().join("b"));
        std::fs::write(&file, b"x").expect("write");
        std::fs::create_dir(&inner).expect("folder");
        for k in 0..300 {
            std::fs::write(inner.join(format!("a long name of a picture {k:05}.png")), b"x").expect("write");
        }
        remove(&name_of(&file).expect("a name"));
        remove(&name_of(&inner).expect("a name"));
        assert_eq!(std::fs::read_dir(folder.path()).expect("folder").count(), 0);
    }
}
