//! Where a clip comes from: a file, an image sequence, or standard input copied to a temporary file.
//!
//! **Trimming.** A span `[start, end)` in seconds from the beginning of the file keeps the frames shown within it. Frames
//! keep the timestamps of the source, so that two passes and a motion file agree; the writer moves everything by `−start`,
//! so that the result begins at its beginning. Audio and subtitle packets that overlap the span are kept whole.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::MediaError;
use super::av::{AvError, Demuxer, Dictionary, log};
use super::error::reason;
use super::info::Ratio;
use super::sequence::Sequence;
use plumbline_num::files::AtomicFile;

/// Default limit of the copy of standard input, bytes.
pub const SPOOL_LIMIT: u64 = 16 << 30;

/// Default frame rate of image sequences, 1/s: FFmpeg's.
pub const PICTURE_RATE: Ratio = Ratio { num: 25, den: 1 };

/// A clip to read. Cheap to clone; a spooled copy is removed with the last clone.
#[derive(Clone, Debug)]
pub struct Input {
    name: String,
    source: Source,
    start: Option<f64>,
    end: Option<f64>,
    rate: Option<Ratio>,
}

#[derive(Clone, Debug)]
enum Source {
    File(PathBuf),
    Sequence(Sequence),
    Spooled(Arc<AtomicFile>),
}

/// Limits of the temporary copy of standard input.
#[derive(Clone, Debug)]
pub struct SpoolOptions {
    /// Folder for the copy.
    pub folder: PathBuf,
    /// Largest size, bytes.
    pub limit: u64,
}

impl Default for SpoolOptions {
    fn default() -> Self {
        Self { folder: std::env::temp_dir(), limit: SPOOL_LIMIT }
    }
}

impl Input {
    /// A file name, a pattern such as `frames/%05d.png`, or `-` for standard input, which is copied to a temporary file
    /// at once because a clip is read more than once.
    ///
    /// # Errors
    /// [`MediaError::Missing`], [`MediaError::Empty`], [`MediaError::Input`] for anything that is not a local file; spooling
    /// errors for `-`.
    pub fn parse(text: &str) -> Result<Self, MediaError> {
        if text == "-" { Self::spool(std::io::stdin().lock(), &SpoolOptions::default()) } else { Self::local(text) }
    }

    fn local(text: &str) -> Result<Self, MediaError> {
        let path = Path::new(text);
        if !path.exists()
            && let Some(sequence) = Sequence::find(text)?
        {
            return Ok(Self::of(text, Source::Sequence(sequence)));
        }
        if let Some((protocol, _)) = text.split_once("://").filter(|_| !path.exists()) {
            let problem = format!("only local files are read (protocol \"{protocol}\" refused); fetch the file first");
            return Err(MediaError::input(text, problem));
        }
        readable(path, text)?;
        Ok(Self::of(text, Source::File(path.to_owned())))
    }

    /// Pictures as a clip, in the order given; `name` is used in messages.
    ///
    /// # Errors
    /// [`MediaError::Missing`], [`MediaError::Input`] where they are of several kinds, [`MediaError::Spool`].
    pub fn pictures(name: &str, files: Vec<PathBuf>) -> Result<Self, MediaError> {
        Ok(Self::of(name, Source::Sequence(Sequence::of_pictures(name, files)?)))
    }

    fn of(name: &str, source: Source) -> Self {
        Self { name: name.to_owned(), source, start: None, end: None, rate: None }
    }

    /// Copies `reader` to a temporary file, which lives as long as the input.
    ///
    /// # Errors
    /// [`MediaError::SpoolLimit`], [`MediaError::Spool`], [`MediaError::Empty`].
    pub fn spool(reader: impl Read, options: &SpoolOptions) -> Result<Self, MediaError> {
        let place = || options.folder.clone();
        let fail = |source| MediaError::Spool { place: place(), source };
        let mut copy = AtomicFile::private(&options.folder, "plumbline-stdin-").map_err(fail)?;
        tracing::info!("copying standard input to {} (at most {} bytes)", copy.path().display(), options.limit);
        let file = copy.file().ok_or_else(|| fail(std::io::ErrorKind::Unsupported.into()))?;
        let copied = std::io::copy(&mut reader.take(options.limit.saturating_add(1)), file).map_err(fail)?;
        match copied {
            0 => Err(MediaError::Empty { path: "standard input".into() }),
            n if n > options.limit => Err(MediaError::SpoolLimit { limit: options.limit, place: place() }),
            _ => Ok(Self::of("standard input", Source::Spooled(Arc::new(copy)))),
        }
    }

    /// The span `[start, end)` of this input, seconds from its beginning; `None` leaves a side open.
    ///
    /// # Errors
    /// [`MediaError::Usage`] where the span is empty, negative or not a number.
    pub fn trimmed(self, start: Option<f64>, end: Option<f64>) -> Result<Self, MediaError> {
        let (from, to) = (start.unwrap_or(0.0), end.unwrap_or(f64::INFINITY));
        if !(from >= 0.0 && to > from) {
            return Err(MediaError::empty_span(&self.name, from, to, f64::NAN));
        }
        Ok(Self { start: start.filter(|s| *s > 0.0), end, ..self })
    }

    /// An image sequence at `rate`, 1/s; [`PICTURE_RATE`] unless set.
    ///
    /// # Errors
    /// [`MediaError::Usage`] for anything but an image sequence.
    pub fn at_rate(self, rate: Ratio) -> Result<Self, MediaError> {
        if !self.is_sequence() {
            let why = "has times of its own; a frame rate can be given for image sequences only";
            return Err(MediaError::Usage { problem: format!("{}: {why}", self.name) });
        }
        Ok(Self { rate: Some(rate), ..self })
    }

    /// The frame rate that was assumed, 1/s: of an image sequence for which none was given.
    pub fn assumed_rate(&self) -> Option<Ratio> {
        (self.is_sequence() && self.rate.is_none()).then_some(PICTURE_RATE)
    }

    /// The input as the user named it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The file that is read; for a sequence its first picture.
    pub fn path(&self) -> &Path {
        match &self.source {
            Source::File(path) => path,
            Source::Sequence(sequence) => sequence.files().first().map_or(Path::new(""), PathBuf::as_path),
            Source::Spooled(copy) => copy.path(),
        }
    }

    /// All files that are read.
    pub(super) fn files(&self) -> &[PathBuf] {
        match &self.source {
            Source::File(path) => std::slice::from_ref(path),
            Source::Sequence(sequence) => sequence.files(),
            Source::Spooled(_) => &[],
        }
    }

    /// Start of the span, s from the beginning of the file, and its end where one was given.
    pub fn span(&self) -> (f64, Option<f64>) {
        (self.start.unwrap_or(0.0), self.end)
    }

    /// Start and end of the span on the file's own clock, µs.
    pub(super) fn span_us(&self, demuxer: &Demuxer) -> (Option<i64>, Option<i64>) {
        let origin = demuxer.start_us().unwrap_or(0);
        let place = |s: f64| origin.saturating_add((s * 1e6).round() as i64);
        (self.start.map(place), self.end.filter(|e| e.is_finite()).map(place))
    }

    /// True where a start or an end was given.
    pub fn is_trimmed(&self) -> bool {
        self.start.is_some() || self.end.is_some()
    }

    /// True for an image sequence.
    pub fn is_sequence(&self) -> bool {
        matches!(self.source, Source::Sequence(_))
    }

    /// Opens the container.
    pub(super) fn demux(&self) -> Result<Demuxer, MediaError> {
        log::forget();
        // Playlists and the like may name other files, but nothing on a network.
        let options = Dictionary::new().with("protocol_whitelist", "file,pipe,crypto,data");
        let opened = match &self.source {
            Source::Sequence(sequence) => {
                let rate = self.rate.unwrap_or(PICTURE_RATE);
                let options =
                    options.with("start_number", &sequence.first().to_string()).with("framerate", &rate.to_string());
                Demuxer::open(sequence.pattern(), Some("image2"), options)
            }
            _ => Demuxer::open(&local_url(self.path()), None, options),
        };
        let demuxer = opened.map_err(|e| self.open_error(e))?;
        self.refuse_stills(&demuxer)?;
        Ok(demuxer)
    }

    fn open_error(&self, error: AvError) -> MediaError {
        let path = self.name.clone();
        match error.errno() {
            Some(libc::ENOENT) => MediaError::Missing { path },
            Some(libc::EACCES | libc::EISDIR | libc::EIO) => {
                MediaError::input(&path, format!("cannot be read: {error}"))
            }
            Some(libc::ENOMEM) => MediaError::NoMemory { what: format!("opening {path}") },
            _ => MediaError::NotMedia { path, reason: reason(error) },
        }
    }

    /// FFmpeg reads a photo as a clip of one frame; under a video's name it is a mistake.
    fn refuse_stills(&self, demuxer: &Demuxer) -> Result<(), MediaError> {
        let format = demuxer.format_name();
        let still = format == "image2" || format.ends_with("_pipe");
        if still && !self.is_sequence() {
            let format = format.trim_end_matches("_pipe");
            let help = "a sequence is given as frames/%05d.png or by its folder";
            return Err(MediaError::input(&self.name, format!("is a still picture ({format}), not a video; {help}")));
        }
        Ok(())
    }
}

fn readable(path: &Path, name: &str) -> Result<(), MediaError> {
    let unreadable = |reason: String| MediaError::input(name, format!("cannot be read: {reason}"));
    let meta = std::fs::metadata(path).map_err(|e| match e.kind() {
        std::io::ErrorKind::NotFound => MediaError::Missing { path: name.to_owned() },
        _ => unreadable(e.to_string()),
    })?;
    if meta.is_dir() {
        return Err(unreadable("it is a folder".into()));
    }
    if meta.is_file() && meta.len() == 0 {
        return Err(MediaError::Empty { path: name.to_owned() });
    }
    std::fs::File::open(path).map(|_| ()).map_err(|e| unreadable(e.to_string()))
}

/// The file protocol spelled out: a name with a colon in it is a name, not a protocol.
pub(super) fn local_url(path: &Path) -> String {
    format!("file:{}", path.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn networks_are_not_touched() {
        let e = Input::parse("https://example.org/clip.mp4").expect_err("refused");
        assert_eq!(
            e.to_string(),
            "https://example.org/clip.mp4: only local files are read (protocol \"https\" refused); fetch the file first"
        );
    }

    #[test]
    fn standard_input_is_spooled_up_to_its_limit() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let options = SpoolOptions { folder: folder.path().into(), limit: 4 };
        let input = Input::spool(&b"abcd"[..], &options).expect("fits");
        assert_eq!(std::fs::read(input.path()).expect("spooled"), b"abcd");
        let copy = input.path().to_owned();
        drop(input);
        assert!(!copy.exists(), "the copy goes with its input");
        assert!(matches!(Input::spool(&b"abcde"[..], &options), Err(MediaError::SpoolLimit { limit: 4, .. })));
        assert!(matches!(Input::spool(&b""[..], &options), Err(MediaError::Empty { .. })));
        assert_eq!(std::fs::read_dir(folder.path()).expect("folder").count(), 0);
    }

    #[test]
    fn empty_spans_are_refused() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("x");
        std::fs::write(&path, b"x").expect("write");
        let input = Input::parse(path.to_str().expect("UTF-8")).expect("exists");
        for (start, end) in [(2.0, 2.0), (2.0, 1.0), (-1.0, 1.0), (f64::NAN, 1.0), (0.0, f64::NAN)] {
            assert!(input.clone().trimmed(Some(start), Some(end)).is_err(), "{start} {end}");
        }
        assert!(input.trimmed(Some(0.0), None).is_ok_and(|i| !i.is_trimmed()));
    }
}
