//! Where a result goes, and how it gets there in one piece.
//!
//! A file is written beside its target ([`AtomicFile`]), synced and renamed last. Whatever happens before that, nothing
//! is under the final name and the input is untouched.

use std::collections::HashSet;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

use super::av::OutputFormat;
use super::sequence::{Pattern, muxer_pattern};
use super::{Codec, Input, MediaError};
use plumbline_num::files::{AtomicFile, IfExists, folder_of};

/// A target to write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Output {
    target: Target,
    container: Option<String>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Target {
    File(PathBuf),
    Sequence(PathBuf),
    Stdout,
}

impl Output {
    /// A file name, a pattern such as `frames/%05d.png`, or `-` for standard output. Names need not be UTF-8.
    pub fn parse(name: impl AsRef<OsStr>) -> Self {
        let path = Path::new(name.as_ref());
        let numbered = path.file_name().and_then(Pattern::parse).is_some();
        let target = match path {
            _ if name.as_ref() == "-" => Target::Stdout,
            _ if numbered => Target::Sequence(path.to_owned()),
            _ => Target::File(path.to_owned()),
        };
        Self { target, container: None }
    }

    /// The same target in a container of the given FFmpeg name (`matroska`, `mp4`, `mpegts`), whatever its own name says.
    #[must_use]
    pub fn with_container(self, name: &str) -> Self {
        Self { container: Some(name.to_owned()), ..self }
    }

    /// The target as a path; `-` for standard output.
    pub fn path(&self) -> &Path {
        match &self.target {
            Target::File(path) | Target::Sequence(path) => path,
            Target::Stdout => Path::new("-"),
        }
    }

    /// True for a numbered image sequence.
    pub fn is_sequence(&self) -> bool {
        matches!(self.target, Target::Sequence(_))
    }

    /// True for standard output.
    pub fn is_stdout(&self) -> bool {
        self.target == Target::Stdout
    }

    /// The container: as asked for, else from the name, else Matroska on standard output.
    pub(super) fn format(&self) -> Result<OutputFormat, MediaError> {
        let unknown = || MediaError::UnknownContainer { path: self.path().to_owned() };
        let format = match (&self.container, &self.target) {
            (Some(name), _) => OutputFormat::named(name),
            (None, Target::Stdout) => OutputFormat::named("matroska"),
            (None, Target::Sequence(_)) => OutputFormat::named("image2"),
            (None, Target::File(path)) => {
                path.extension().and_then(|_| OutputFormat::for_file(&path.to_string_lossy()))
            }
        };
        let format = format.filter(|f| self.is_sequence() || !f.opens_own_files()).ok_or_else(unknown)?;
        if self.is_stdout() && !streams(&format.name()) {
            let help = "use matroska, mpegts or a file";
            let problem = format!("{} cannot be written to standard output; {help}", format.name());
            return Err(MediaError::Usage { problem });
        }
        Ok(format)
    }

    /// The codec of a target for which none was chosen: the first of [`Codec::ALL`] that the container holds, which is H.264, in WebM
    /// AV1.
    ///
    /// # Example
    /// ```
    /// use plumbline_media::{Codec, Output};
    ///
    /// assert_eq!(Output::parse("steady.mp4").usual_codec(), Codec::H264);
    /// assert_eq!(Output::parse("steady.webm").usual_codec(), Codec::Av1);
    /// ```
    pub fn usual_codec(&self) -> Codec {
        let format = self.format().ok().filter(|_| !self.is_sequence());
        let held = |codec: &Codec| format.is_none_or(|format| format.holds(*codec));
        Codec::ALL.into_iter().find(held).unwrap_or_default()
    }

    /// Refuses a codec that the container does not hold.
    ///
    /// # Errors
    /// [`MediaError::Usage`]; as [`Self::preflight`] for an unknown container.
    pub fn check_codec(&self, codec: Codec) -> Result<(), MediaError> {
        let format = self.format()?;
        if self.is_sequence() || format.holds(codec) {
            return Ok(());
        }
        let held = Codec::ALL.into_iter().filter(|codec| format.holds(*codec)).map(Codec::name).collect::<Vec<_>>();
        let held = if held.is_empty() { "none that can be written".to_owned() } else { held.join(", ") };
        let problem =
            format!("{} holds no {} (it holds {held}); take another codec or container", format.name(), codec.name());
        Err(MediaError::Usage { problem })
    }

    /// Refuses at once what writing would refuse after long work: an unknown container, a folder that cannot be written.
    ///
    /// # Errors
    /// [`MediaError::UnknownContainer`], [`MediaError::Usage`], [`MediaError::Output`],
    /// [`MediaError::DiskFull`].
    pub fn preflight(&self) -> Result<(), MediaError> {
        self.format()?;
        self.begin(IfExists::Replace).map(drop)
    }

    /// Refuses targets that would destroy something.
    pub(super) fn check(&self, source: &Input, overwrite: bool) -> Result<(), MediaError> {
        let path = self.path();
        if self.is_stdout() {
            return Ok(());
        }
        let occupied = match &self.target {
            Target::Sequence(path) => files_of_sequence(path),
            _ => path.symlink_metadata().is_ok().then(|| path.to_owned()).into_iter().collect(),
        };
        let inputs: HashSet<Identity> = source.files().iter().filter_map(|f| identity(f)).collect();
        if occupied.iter().any(|o| identity(o).is_some_and(|i| inputs.contains(&i))) {
            let problem = "is the input itself; give the result another name".to_owned();
            return Err(MediaError::Output { path: path.to_owned(), problem });
        }
        match occupied.into_iter().next() {
            Some(path) if path.is_dir() => Err(MediaError::unwritable(&path, "it is a folder")),
            Some(path) if !overwrite => Err(MediaError::TargetExists { path }),
            _ => Ok(()),
        }
    }

    /// Starts the unfinished file.
    pub(super) fn begin(&self, if_exists: IfExists) -> Result<Partial, MediaError> {
        match &self.target {
            Target::Stdout => Ok(Partial::Stdout),
            Target::File(path) => Partial::file(path, if_exists),
            Target::Sequence(path) => Partial::folder(path, if_exists),
        }
    }
}

/// Containers that can be written without going back.
fn streams(container: &str) -> bool {
    matches!(container, "matroska" | "webm" | "mpegts" | "nut" | "mp4" | "mov")
}

/// Device and inode, so that links in any disguise are seen through.
#[cfg(unix)]
type Identity = (u64, u64);
/// The file's path without links.
#[cfg(not(unix))]
type Identity = PathBuf;

fn identity(path: &Path) -> Option<Identity> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        path.metadata().ok().map(|meta| (meta.dev(), meta.ino()))
    }
    #[cfg(not(unix))]
    {
        path.canonicalize().ok()
    }
}

fn files_of_sequence(path: &Path) -> Vec<PathBuf> {
    let Some(pattern) = path.file_name().and_then(Pattern::parse) else { return Vec::new() };
    let matches = |p: &PathBuf| p.file_name().is_some_and(|n| pattern.number(n).is_some());
    let entries = std::fs::read_dir(folder_of(path)).into_iter().flatten();
    entries.filter_map(|e| Some(e.ok()?.path())).filter(matches).collect()
}

/// An unfinished result; dropped without [`Partial::publish`] it is removed.
#[derive(Debug)]
pub(super) enum Partial {
    Stdout,
    File { partial: AtomicFile, target: PathBuf, if_exists: IfExists },
    Folder { partial: AtomicFile, target: PathBuf, if_exists: IfExists },
}

impl Partial {
    fn file(target: &Path, if_exists: IfExists) -> Result<Self, MediaError> {
        let partial = AtomicFile::next_to(target, if_exists).map_err(|e| MediaError::writing_io(target, &e))?;
        Ok(Self::File { partial, target: target.to_owned(), if_exists })
    }

    fn folder(target: &Path, if_exists: IfExists) -> Result<Self, MediaError> {
        let partial = AtomicFile::sequence_in(folder_of(target));
        let partial = partial.map_err(|e| MediaError::writing_io(target, &e))?;
        Ok(Self::Folder { partial, target: target.to_owned(), if_exists })
    }

    /// What FFmpeg is to open.
    pub(super) fn url(&self) -> OsString {
        match self {
            Self::Stdout => "pipe:1".into(),
            Self::File { partial, .. } => super::input::local_url(partial.path()),
            Self::Folder { partial, target, .. } => muxer_pattern(partial.path(), target.as_os_str()),
        }
    }

    /// Where the unfinished file or folder is, and the name that it gets; `None` for standard output.
    pub(super) fn names(&self) -> Option<(&Path, &Path)> {
        match self {
            Self::Stdout => None,
            Self::File { partial, target, .. } | Self::Folder { partial, target, .. } => Some((partial.path(), target)),
        }
    }

    /// Syncs the finished result to the disk and gives it its name.
    pub(super) fn publish(self) -> Result<(), MediaError> {
        match self {
            Self::Stdout => Ok(()),
            Self::File { partial, target, if_exists } => {
                partial.publish(&target, if_exists).map_err(|e| MediaError::writing_io(&target, &e))
            }
            Self::Folder { partial, target, if_exists } => {
                partial.publish_into(folder_of(&target), if_exists).map_err(|e| MediaError::writing_io(&target, &e))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_to_the_input_are_the_input() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let [clip, hard, soft, other] =
            ["clip.mp4", "hard.mp4", "soft.mp4", "other.mp4"].map(|n| folder.path().join(n));
        std::fs::write(&clip, b"x").expect("write");
        std::fs::write(&other, b"x").expect("write");
        std::fs::hard_link(&clip, &hard).expect("link");
        std::os::unix::fs::symlink(&clip, &soft).expect("link");
        let source = Input::parse(clip.to_str().expect("UTF-8")).expect("exists");
        for target in [&clip, &hard, &soft] {
            let e = Output::parse(target.to_str().expect("UTF-8")).check(&source, true).expect_err("refused");
            assert!(e.to_string().ends_with("is the input itself; give the result another name"), "{e}");
        }
        let existing = Output::parse(other.to_str().expect("UTF-8"));
        assert!(matches!(existing.check(&source, false), Err(MediaError::TargetExists { .. })));
        assert!(existing.check(&source, true).is_ok());
    }

    #[test]
    fn an_unfinished_file_is_removed_and_a_finished_one_takes_its_name() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let target = folder.path().join("out.mp4");
        let output = Output::parse(target.to_str().expect("UTF-8"));
        let names = || {
            let mut names: Vec<_> =
                std::fs::read_dir(folder.path()).expect("folder").map(|e| e.expect("entry").file_name()).collect();
            names.sort();
            names
        };
        let partial = output.begin(IfExists::Refuse).expect("begin");
        assert_eq!(names().len(), 1);
        assert!(!target.exists() && partial.url().to_string_lossy().contains("out.partial-"));
        drop(partial);
        assert!(names().is_empty());
        output.begin(IfExists::Refuse).expect("begin").publish().expect("publish");
        assert_eq!(names(), ["out.mp4"]);
    }

    #[test]
    fn the_name_tells_the_container() {
        for (name, container) in
            [("a.mp4", "mp4"), ("a.mkv", "matroska"), ("a.mov", "mov"), ("a.ts", "mpegts"), ("f/%05d.png", "image2")]
        {
            assert_eq!(Output::parse(name).format().expect(name).name(), container);
        }
        assert_eq!(Output::parse("-").format().expect("streams").name(), "matroska");
        let e = Output::parse("-").with_container("avi").format().err().expect("refused");
        assert_eq!(e.to_string(), "avi cannot be written to standard output; use matroska, mpegts or a file");
        for name in ["a", "a.xyz", "mp4", "a.png"] {
            assert!(matches!(Output::parse(name).format(), Err(MediaError::UnknownContainer { .. })), "{name}");
        }
    }
}
