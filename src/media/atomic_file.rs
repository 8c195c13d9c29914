//! Files that are not whole yet: written under a name of their own, removed when dropped, swept up where their writer died.
//!
//! A writer holds an advisory lock on its file as long as its process lives; the kernel lets go of the lock however that
//! process ends. A file `STEM.partial-PID-RANDOM.EXT` whose lock is free therefore belongs to nobody, and whoever next begins
//! such a file in the same folder removes it. The process id is there for people: it is used again, and means nothing in
//! another container or on another machine that shares the folder. Where the file system has no locks nothing is swept.

use std::fs::{File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

/// Maximum length of the stem in the temporary name, bytes: the rest of the 255 that file systems allow is for the
/// prefix and the random part.
const MAX_STEM: usize = 160;

/// Attempts to create and lock a temporary file, which a concurrent cleanup may remove in between, before the folder
/// counts as unusable.
const ATTEMPTS: usize = 16;

/// Random letters and digits in a name.
const RANDOM: usize = 8;

/// An unfinished file or folder; dropped, it is removed.
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    /// Holds the lock; `None` for a folder where folders cannot be opened.
    claim: Option<File>,
    published: bool,
}

impl AtomicFile {
    /// Begins the file that is to become `target`, in its folder. Leftovers of the same target are removed.
    ///
    /// # Errors
    /// What the system says of the folder.
    pub fn next_to(target: &Path) -> io::Result<Self> {
        Self::begin(folder_of(target), &Name::of(target), |path| File::create_new(path).map(Some))
    }

    /// Removes unfinished files that were to become `target` and whose writers died.
    pub fn remove_leftovers(target: &Path) {
        sweep(folder_of(target), &Name::of(target));
    }

    /// A file in `folder` that only this user may read.
    pub(super) fn private(folder: &Path, name: &Name) -> io::Result<Self> {
        let mut options = File::options();
        options.read(true).write(true).create_new(true);
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
        Self::begin(folder, name, |path| options.open(path).map(Some))
    }

    /// A folder in `folder`, for files that are to go there together.
    ///
    /// # Errors
    /// What the system says of the folder.
    pub fn sequence_in(folder: &Path) -> io::Result<Self> {
        Self::folder(folder, &Name::beginning("sequence.partial-"))
    }

    /// A folder in `folder`.
    pub(super) fn folder(folder: &Path, name: &Name) -> io::Result<Self> {
        Self::begin(folder, name, |path| std::fs::create_dir(path).map(|()| File::open(path).ok()))
    }

    fn begin(folder: &Path, name: &Name, make: impl Fn(&Path) -> io::Result<Option<File>>) -> io::Result<Self> {
        sweep(folder, name);
        for _ in 0..ATTEMPTS {
            let path = folder.join(name.fresh());
            let claim = make(&path)?;
            let lost = claim.as_ref().is_some_and(|file| matches!(file.try_lock(), Err(TryLockError::WouldBlock)));
            // Another run may have taken the file for a leftover before it was locked.
            if !lost && path.symlink_metadata().is_ok() {
                return Ok(Self { path, claim, published: false });
            }
        }
        Err(io::Error::other("unfinished files are taken away as soon as they are begun"))
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The file itself.
    pub(super) fn file(&mut self) -> Option<&mut File> {
        self.claim.as_mut()
    }

    /// Syncs the finished file to the disk and gives it the name `target`, which is replaced where it exists.
    ///
    /// # Errors
    /// What the system says; the unfinished file is removed.
    pub fn publish(mut self, target: &Path) -> io::Result<()> {
        move_synced(&self.path, target)?;
        self.published = true;
        Ok(())
    }

    /// The same for every file in an unfinished folder, under their own names in `folder`.
    ///
    /// # Errors
    /// The system's error; files not yet moved are removed.
    pub fn publish_into(self, folder: &Path) -> io::Result<()> {
        for entry in std::fs::read_dir(&self.path)? {
            let entry = entry?;
            move_synced(&entry.path(), &folder.join(entry.file_name()))?;
        }
        Ok(())
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if !self.published {
            remove(&self.path);
        }
    }
}

/// Names of one kind of unfinished file: `before`, process, random, `after`.
#[derive(Clone, Debug)]
pub(super) struct Name {
    before: String,
    after: String,
}

impl Name {
    /// For what is to become `target`.
    fn of(target: &Path) -> Self {
        let stem = target.file_stem().unwrap_or_default().to_string_lossy();
        let end = (0..=stem.len().min(MAX_STEM)).rev().find(|&i| stem.is_char_boundary(i)).unwrap_or(0);
        let after = target.extension().map(|e| format!(".{}", e.to_string_lossy())).unwrap_or_default();
        Self { before: format!("{}.partial-", &stem[..end]), after }
    }

    /// For what begins with `before`, which should tell the program.
    pub(super) fn beginning(before: &str) -> Self {
        Self { before: before.to_owned(), after: String::new() }
    }

    fn fresh(&self) -> String {
        let random: String = (0..RANDOM).map(|_| fastrand::alphanumeric()).collect();
        format!("{}{}-{random}{}", self.before, std::process::id(), self.after)
    }

    fn matches(&self, name: &str) -> bool {
        let middle = name.strip_prefix(&self.before).and_then(|n| n.strip_suffix(&self.after));
        middle.and_then(|m| m.split_once('-')).is_some_and(|(process, random)| {
            let digits = !process.is_empty() && process.bytes().all(|b| b.is_ascii_digit());
            digits && random.len() == RANDOM && random.bytes().all(|b| b.is_ascii_alphanumeric())
        })
    }
}

/// Removes files with a name of this kind and no owner. Files whose owner is unknown, or that cannot be removed, stay.
fn sweep(folder: &Path, name: &Name) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok) {
        let ours = entry.file_name().to_str().is_some_and(|n| name.matches(n));
        // Links are not of our making, and opening a pipe would wait for its other end.
        if !ours || !entry.file_type().is_ok_and(|kind| kind.is_file() || kind.is_dir()) {
            continue;
        }
        let path = entry.path();
        if File::open(&path).is_ok_and(|file| file.try_lock().is_ok() && remove(&path)) {
            tracing::info!("{} was left by a run that was killed; removed", path.display());
        }
    }
}

fn remove(path: &Path) -> bool {
    if path.is_dir() { std::fs::remove_dir_all(path).is_ok() } else { std::fs::remove_file(path).is_ok() }
}

/// The folder that holds `path`.
pub(super) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn move_synced(from: &Path, to: &Path) -> io::Result<()> {
    File::options().write(true).open(from)?.sync_all()?;
    std::fs::rename(from, to)?;
    // The name itself lasts once the folder is synced; file systems that cannot do that still hold the data.
    if let Ok(folder) = File::open(folder_of(to)) {
        let _ = folder.sync_all();
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).expect("folder");
        let mut names: Vec<_> = entries.map(|e| e.expect("entry").file_name().into_string().expect("UTF-8")).collect();
        names.sort();
        names
    }

    #[test]
    fn leftovers_without_an_owner_are_swept_and_nothing_else() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let at = |name: &str| folder.path().join(name);
        let live = AtomicFile::next_to(&at("out.mp4")).expect("begun");
        let live_name = live.path().file_name().and_then(|n| n.to_str()).expect("UTF-8").to_owned();
        let dead = ["out.partial-1-abcd1234.mp4", "out.partial-4000000-ABCDEFGH.mp4"];
        let others = [
            "out.mp4",
            "out.partial-1-abcd1234.mkv",
            "out.partial-1-abcd123.mp4",
            "out.partial-x-abcd1234.mp4",
            "out.partial-1.mp4",
            "other.partial-1-abcd1234.mp4",
        ];
        for name in dead.iter().chain(&others) {
            std::fs::write(at(name), b"x").expect("write");
        }
        #[cfg(unix)]
        std::os::unix::fs::symlink(at("out.mp4"), at("out.partial-2-abcd1234.mp4")).expect("link");
        let before = names(folder.path());
        drop(AtomicFile::next_to(&at("out.mp4")).expect("begun"));
        let expected: Vec<_> = before.into_iter().filter(|n| !dead.contains(&n.as_str())).collect();
        assert_eq!(names(folder.path()), expected);
        assert!(expected.contains(&live_name), "a live one stays");
        drop(live);
        assert!(!names(folder.path()).contains(&live_name), "dropped, it is removed");
    }

    #[test]
    fn a_folder_is_swept_like_a_file() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let name = Name::beginning("sequence.partial-");
        let live = AtomicFile::folder(folder.path(), &name).expect("begun");
        let dead = folder.path().join("sequence.partial-7-aaaaaaaa");
        std::fs::create_dir(&dead).expect("folder");
        std::fs::write(dead.join("00001.png"), b"x").expect("write");
        drop(AtomicFile::folder(folder.path(), &name).expect("begun"));
        assert!(!dead.exists() && live.path().exists());
    }

    #[test]
    fn a_name_of_any_length_and_script_has_room_for_the_marks() {
        let folder = tempfile::tempdir().expect("temporary folder");
        for stem in ["x".repeat(240), "ä".repeat(120), String::new()] {
            let target = folder.path().join(format!("{stem}.mp4"));
            let file = AtomicFile::next_to(&target).expect("begun");
            let name = file.path().file_name().and_then(|n| n.to_str()).expect("UTF-8").to_owned();
            assert!(Name::of(&target).matches(&name), "{name}");
            file.publish(&target).expect("published");
            assert!(target.exists());
        }
    }
}
