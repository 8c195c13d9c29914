//! Files that are not whole yet: written under a name of their own, removed when dropped, swept up where their writer died.
//!
//! A writer holds an advisory lock on its file as long as its process lives; the kernel lets go of the lock however that
//! process ends. A file `STEM.partial-PID-RANDOM.EXT` whose lock is free therefore belongs to nobody, and whoever next begins
//! such a file in the same folder removes it; one whose lock is held says that its target is being written. The process id
//! is there for people: it is used again, and means nothing in another container or on another machine that shares the
//! folder. Where the file system has no locks nothing is swept, and two writers of one target meet at its name only.

use std::fs::{File, TryLockError};
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::access::check_target;
use super::folder_of;
use super::registry::{self, Registered};
use super::rename::rename_new;

/// Maximum length of the stem in the temporary name, bytes: the rest of the 255 that file systems allow is for the
/// prefix, a hash of what is cut off and the random part.
const MAX_STEM: usize = 140;

/// Attempts to create and lock a temporary file, which a concurrent cleanup or a concurrent writer of the same target may
/// get in the way of, before the folder counts as unusable.
const ATTEMPTS: usize = 16;

/// Longest wait between two attempts, ms: several times what it takes to create and lock a file.
const MAX_WAIT_MS: u64 = 20;

/// Random letters and digits in a name.
const RANDOM: usize = 8;

/// What happens to a file that has the name of the target.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum IfExists {
    /// It stays, and writing fails: before the work where the file is there or being written, at its end where it appeared
    /// meanwhile.
    #[default]
    Refuse,
    /// It is replaced, in one step; of two writers the last wins.
    Replace,
}

impl IfExists {
    /// For an option that allows to replace files.
    pub fn overwrite(allowed: bool) -> Self {
        if allowed { Self::Replace } else { Self::Refuse }
    }
}

/// An unfinished file or folder; dropped, it is removed.
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    /// Holds the lock; `None` for a folder where folders cannot be opened.
    claim: Option<File>,
    published: bool,
    _registered: Registered,
}

impl AtomicFile {
    /// Begins the file that is to become `target`, in its folder. Leftovers of the same target are removed.
    ///
    /// # Errors
    /// What the system says of the folder; [`io::ErrorKind::InvalidInput`] for a target that exists and is no regular file;
    /// where nothing may be replaced [`io::ErrorKind::AlreadyExists`] for a target that exists, and
    /// [`io::ErrorKind::ResourceBusy`] for one that another process is writing.
    pub fn next_to(target: &Path, if_exists: IfExists) -> io::Result<Self> {
        check_target(target)?;
        if if_exists == IfExists::Refuse && target.symlink_metadata().is_ok() {
            return Err(exists());
        }
        Self::begin(folder_of(target), &Name::of(target), if_exists, |path| File::create_new(path).map(Some))
    }

    /// A temporary file in `folder` that only this user may read, under a name that begins with `prefix`.
    ///
    /// # Errors
    /// What the system says of the folder.
    pub fn private(folder: &Path, prefix: &str) -> io::Result<Self> {
        let mut options = File::options();
        options.read(true).write(true).create_new(true);
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
        Self::begin(folder, &Name::beginning(prefix), IfExists::Replace, |path| options.open(path).map(Some))
    }

    /// A folder in `folder`, for files that are to go there together.
    ///
    /// # Errors
    /// What the system says of the folder.
    pub fn sequence_in(folder: &Path) -> io::Result<Self> {
        Self::folder(folder, "sequence.partial-")
    }

    /// A temporary folder in `folder`, under a name that begins with `prefix`.
    ///
    /// # Errors
    /// What the system says of the folder.
    pub fn folder(folder: &Path, prefix: &str) -> io::Result<Self> {
        Self::begin(folder, &Name::beginning(prefix), IfExists::Replace, |path| {
            std::fs::create_dir(path).map(|()| File::open(path).ok())
        })
    }

    /// Two writers of one target that begin at the same time see each other; both give way and try again, each after a time
    /// of its own, until one comes to be alone.
    fn begin(
        folder: &Path,
        name: &Name,
        if_exists: IfExists,
        make: impl Fn(&Path) -> io::Result<Option<File>>,
    ) -> io::Result<Self> {
        let alone = |busy: bool| !(busy && if_exists == IfExists::Refuse);
        if !alone(sweep(folder, name)) {
            return Err(busy());
        }
        for _ in 0..ATTEMPTS {
            let path = folder.join(name.fresh());
            let registered = Registered::new(&path)?;
            let claim = make(&path)?;
            let begun = Self { path, claim, published: false, _registered: registered };
            let taken = begun.claim.as_ref().is_some_and(|f| matches!(f.try_lock(), Err(TryLockError::WouldBlock)));
            // Another run may have taken the file for a leftover before it was locked.
            if taken || begun.path.symlink_metadata().is_err() {
                continue;
            }
            if alone(if_exists == IfExists::Refuse && sweep(folder, name)) {
                return Ok(begun);
            }
            drop(begun);
            std::thread::park_timeout(Duration::from_millis(fastrand::u64(1..=MAX_WAIT_MS)));
            if !alone(sweep(folder, name)) {
                return Err(busy());
            }
        }
        Err(io::Error::other("unfinished files are taken away as soon as they are begun"))
    }

    /// Whether a name is one of an unfinished file or folder: what a killed run left is nobody's input.
    pub fn is_partial_name(name: &str) -> bool {
        let marked = name.match_indices(".partial-").any(|(at, mark)| {
            let (before, rest) = (&name[..at + mark.len()], &name[at + mark.len()..]);
            let after = rest.find('.').map_or("", |dot| &rest[dot..]);
            Name { before: before.to_owned(), after: after.to_owned() }.matches(name)
        });
        marked || Name::beginning("plumbline-stdin-").matches(name)
    }

    /// Removes unfinished files that were to become `target` and whose writers died. True where another process is writing one.
    pub fn remove_leftovers(target: &Path) -> bool {
        sweep(folder_of(target), &Name::of(target))
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The file itself; `None` for a folder that could not be opened.
    pub fn file(&mut self) -> Option<&mut File> {
        self.claim.as_mut()
    }

    /// Syncs the finished file to the disk and gives it the name `target`.
    ///
    /// # Errors
    /// What the system says, and [`io::ErrorKind::AlreadyExists`] where a file has the name and may not be replaced; the
    /// unfinished file is removed.
    pub fn publish(self, target: &Path, if_exists: IfExists) -> io::Result<()> {
        publish_all(vec![(self, target.to_owned())], if_exists)
    }

    /// The same for every file in an unfinished folder, under their own names in `folder`: all of them or none, as far as
    /// nothing is replaced and the process lives.
    ///
    /// # Errors
    /// As [`AtomicFile::publish`].
    pub fn publish_into(self, folder: &Path, if_exists: IfExists) -> io::Result<()> {
        let mut moves = Vec::new();
        for entry in std::fs::read_dir(&self.path)? {
            let entry = entry?;
            sync(&entry.path())?;
            moves.push((entry.path(), folder.join(entry.file_name())));
        }
        // In one order, so that of two writers the one that gets the first name gets all.
        moves.sort();
        rename_all(&moves, if_exists)
    }
}

/// Syncs finished files to the disk and gives them their names: all of them or none, as far as nothing is replaced and the
/// process lives.
///
/// # Errors
/// As [`AtomicFile::publish`].
pub fn publish_all(files: Vec<(AtomicFile, PathBuf)>, if_exists: IfExists) -> io::Result<()> {
    let mut files = files;
    for (unfinished, _) in &files {
        sync(&unfinished.path)?;
    }
    let moves: Vec<_> = files.iter().map(|(unfinished, target)| (unfinished.path.clone(), target.clone())).collect();
    rename_all(&moves, if_exists)?;
    for (unfinished, _) in &mut files {
        unfinished.published = true;
    }
    Ok(())
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if !self.published {
            remove(&self.path);
        }
    }
}

fn exists() -> io::Error {
    io::Error::new(
        io::ErrorKind::AlreadyExists,
        "a file of this name exists and was kept; allow to replace it, or choose another name",
    )
}

fn busy() -> io::Error {
    io::Error::new(
        io::ErrorKind::ResourceBusy,
        "another run is writing this file; wait for its end, or choose another name",
    )
}

/// The whole file must be on the disk before it has its name: after a crash of the system a name never stands for less.
fn sync(path: &Path) -> io::Result<()> {
    File::options().write(true).open(path)?.sync_all()
}

/// Renames synced files; where one name is taken those before it are given back, unless they replaced something.
fn rename_all(moves: &[(PathBuf, PathBuf)], if_exists: IfExists) -> io::Result<()> {
    for (done, (from, to)) in moves.iter().enumerate() {
        let renamed = match if_exists {
            IfExists::Replace => std::fs::rename(from, to),
            IfExists::Refuse => rename_new(from, to),
        };
        if let Err(error) = renamed {
            if if_exists == IfExists::Refuse {
                // New files of our own; one that cannot be taken back is whole.
                moves[..done].iter().for_each(|(_, to)| drop(std::fs::remove_file(to)));
            }
            return Err(if error.kind() == io::ErrorKind::AlreadyExists { exists() } else { error });
        }
    }
    // Names last once their folder is synced; file systems that cannot do that still hold the data.
    let mut folders: Vec<&Path> = moves.iter().map(|(_, to)| folder_of(to)).collect();
    folders.dedup();
    for folder in folders {
        if let Ok(folder) = File::open(folder) {
            let _ = folder.sync_all();
        }
    }
    Ok(())
}

/// Names of one kind of unfinished file: `before`, process, random, `after`.
#[derive(Clone, Debug)]
struct Name {
    before: String,
    after: String,
}

impl Name {
    /// For what is to become `target`. Different targets in one folder have different names.
    fn of(target: &Path) -> Self {
        let name = target.file_stem().unwrap_or_default();
        let stem = name.to_string_lossy();
        let end = (0..=stem.len().min(MAX_STEM)).rev().find(|&i| stem.is_char_boundary(i)).unwrap_or(0);
        let mut before = stem[..end].to_owned();
        if name.to_str().is_none_or(|whole| whole.len() > end) {
            let mut hasher = DefaultHasher::new();
            name.hash(&mut hasher);
            before.extend(["~", &format!("{:016x}", hasher.finish())]);
        }
        let after = target.extension().map(|e| format!(".{}", e.to_string_lossy())).unwrap_or_default();
        Self { before: before + ".partial-", after }
    }

    /// For what begins with `before`, which should tell the program.
    fn beginning(before: &str) -> Self {
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
/// True where another process is at work on one.
fn sweep(folder: &Path, name: &Name) -> bool {
    let mut busy = false;
    for entry in std::fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok) {
        let ours = entry.file_name().to_str().is_some_and(|n| name.matches(n));
        // Links are not of our making, and opening a pipe would wait for its other end.
        if !ours || !entry.file_type().is_ok_and(|kind| kind.is_file() || kind.is_dir()) {
            continue;
        }
        let path = entry.path();
        let Ok(file) = File::open(&path) else { continue };
        match file.try_lock() {
            Ok(()) if remove(&path) => {
                tracing::info!("{} was left by a run that was killed; removed", path.display());
            }
            Err(TryLockError::WouldBlock) => busy |= !registry::contains(&path),
            _ => {}
        }
    }
    busy
}

fn remove(path: &Path) -> bool {
    if path.is_dir() { std::fs::remove_dir_all(path).is_ok() } else { std::fs::remove_file(path).is_ok() }
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
        let live = AtomicFile::next_to(&at("out.mp4"), IfExists::Replace).expect("begun");
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
        drop(AtomicFile::next_to(&at("out.mp4"), IfExists::Replace).expect("begun"));
        let expected: Vec<_> = before.into_iter().filter(|n| !dead.contains(&n.as_str())).collect();
        assert_eq!(names(folder.path()), expected);
        assert!(expected.contains(&live_name), "a live one stays");
        drop(live);
        assert!(!names(folder.path()).contains(&live_name), "dropped, it is removed");
    }

    #[test]
    fn a_folder_is_swept_like_a_file() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let live = AtomicFile::sequence_in(folder.path()).expect("begun");
        let dead = folder.path().join("sequence.partial-7-aaaaaaaa");
        std::fs::create_dir(&dead).expect("folder");
        std::fs::write(dead.join("00001.png"), b"x").expect("write");
        drop(AtomicFile::sequence_in(folder.path()).expect("begun"));
        assert!(!dead.exists() && live.path().exists());
    }

    #[test]
    fn a_name_of_any_length_and_script_has_room_for_the_marks() {
        let folder = tempfile::tempdir().expect("temporary folder");
        for stem in ["x".repeat(240), "ä".repeat(120), String::new()] {
            let target = folder.path().join(format!("{stem}.mp4"));
            let file = AtomicFile::next_to(&target, IfExists::Refuse).expect("begun");
            let name = file.path().file_name().and_then(|n| n.to_str()).expect("UTF-8").to_owned();
            assert!(Name::of(&target).matches(&name), "{name}");
            file.publish(&target, IfExists::Refuse).expect("published");
            assert!(target.exists());
        }
    }

    #[test]
    fn a_target_that_appears_meanwhile_is_kept() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let target = folder.path().join("a.txt");
        let unfinished = AtomicFile::next_to(&target, IfExists::Refuse).expect("begun");
        std::fs::write(&target, b"another's").expect("write");
        let error = unfinished.publish(&target, IfExists::Refuse).expect_err("it exists");
        assert_eq!(error.kind(), io::ErrorKind::AlreadyExists);
        assert_eq!(names(folder.path()), ["a.txt"]);
        assert_eq!(std::fs::read(&target).expect("kept"), b"another's");
        let error = AtomicFile::next_to(&target, IfExists::Refuse).expect_err("it exists");
        assert_eq!(error.kind(), io::ErrorKind::AlreadyExists);
    }

    #[test]
    #[cfg(unix)]
    fn a_target_that_is_no_regular_file_is_refused_also_through_links() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("folder")).expect("folder");
        std::os::unix::net::UnixListener::bind(at("socket")).expect("socket");
        for (name, to) in [("null", "/dev/null"), ("to_folder", "folder"), ("to_link", "null"), ("to_socket", "socket")]
        {
            std::os::unix::fs::symlink(to, at(name)).expect("link");
        }
        let before = names(folder.path());
        let cases = [
            ("folder", "a folder"),
            ("socket", "a socket"),
            ("null", "a device"),
            ("to_folder", "a folder"),
            ("to_link", "a device"),
            ("to_socket", "a socket"),
        ];
        for (name, what) in cases {
            for if_exists in [IfExists::Refuse, IfExists::Replace] {
                let error = AtomicFile::next_to(&at(name), if_exists).expect_err(name);
                assert_eq!(error.kind(), io::ErrorKind::InvalidInput, "{name}");
                assert!(error.to_string().starts_with(&format!("{what}, not a regular file; ")), "{name}: {error}");
                assert_eq!(names(folder.path()), before, "{name}");
            }
        }
        // A link to a regular file, or to nothing, is a name like any other.
        std::fs::write(at("file"), b"x").expect("write");
        for (name, to) in [("to_file", "file"), ("to_none", "none")] {
            std::os::unix::fs::symlink(to, at(name)).expect("link");
            drop(AtomicFile::next_to(&at(name), IfExists::Replace).expect("may be replaced"));
        }
    }

    #[test]
    fn a_target_that_another_process_writes_is_refused_before_the_work() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let target = folder.path().join("a.txt");
        let other = folder.path().join("a.partial-1-abcd1234.txt");
        let lock = File::create_new(&other).expect("made");
        lock.try_lock().expect("free");
        let error = AtomicFile::next_to(&target, IfExists::Refuse).expect_err("busy");
        assert_eq!(error.kind(), io::ErrorKind::ResourceBusy);
        drop(AtomicFile::next_to(&target, IfExists::Replace).expect("the last one wins"));
        drop(AtomicFile::next_to(&folder.path().join("b.txt"), IfExists::Refuse).expect("another target"));
        assert_eq!(names(folder.path()), ["a.partial-1-abcd1234.txt"]);
        drop(lock);
        let own = AtomicFile::next_to(&target, IfExists::Refuse).expect("its writer has ended");
        drop(AtomicFile::next_to(&target, IfExists::Refuse).expect("this process itself is no other"));
        drop(own);
        assert!(names(folder.path()).is_empty());
    }

    #[test]
    fn several_files_get_their_names_together_or_not_at_all() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let fill = |part: &AtomicFile| {
            for name in ["1.png", "2.png", "3.png"] {
                std::fs::write(part.path().join(name), name).expect("write");
            }
        };
        let part = AtomicFile::sequence_in(folder.path()).expect("begun");
        fill(&part);
        std::fs::write(folder.path().join("3.png"), b"another's").expect("write");
        let error = part.publish_into(folder.path(), IfExists::Refuse).expect_err("one exists");
        assert_eq!(error.kind(), io::ErrorKind::AlreadyExists);
        assert_eq!(names(folder.path()), ["3.png"]);
        assert_eq!(std::fs::read(folder.path().join("3.png")).expect("kept"), b"another's");
        let part = AtomicFile::sequence_in(folder.path()).expect("begun");
        fill(&part);
        part.publish_into(folder.path(), IfExists::Replace).expect("may be replaced");
        assert_eq!(names(folder.path()), ["1.png", "2.png", "3.png"]);
        assert_eq!(std::fs::read(folder.path().join("3.png")).expect("replaced"), b"3.png");
    }

    #[test]
    fn long_names_with_a_common_beginning_are_different_targets() {
        let long = |end: &str| Name::of(Path::new(&format!("{}{end}.mp4", "x".repeat(200))));
        let (a, b) = (long("a"), long("b"));
        assert!(a.matches(&a.fresh()) && !a.matches(&b.fresh()));
        assert!(a.fresh().len() <= 255);
    }
}
