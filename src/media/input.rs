//! Where a clip comes from: a file, an image sequence, or standard input copied to a temporary file.
//!
//! **Trimming.** A span `[start, end)` in seconds from the beginning of the file keeps the frames shown within it. Frames
//! keep the timestamps of the source, so that two passes and a motion file agree; the writer moves everything by `−start`,
//! so that the result begins at its beginning. Audio and subtitle packets that overlap the span are kept whole.

use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use super::av::{AvError, Demuxer, Dictionary, Guard, InputFormat, Nested, Packet, Rational, c_path, log};
use super::error::reason;
use super::extent::{self, Extent};
use super::info::Ratio;
use super::sequence::Sequence;
use super::{MediaError, playlist};
use plumbline_num::files::{AtomicFile, open_regular};
use plumbline_num::limits::Shortage;
use plumbline_num::run::{Interrupt, Stopped};

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
    stream: Option<usize>,
    playlists: bool,
    interrupt: Interrupt,
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
    /// Ends the copying of standard input, also while nothing comes.
    pub interrupt: Interrupt,
}

impl Default for SpoolOptions {
    fn default() -> Self {
        Self { folder: std::env::temp_dir(), limit: SPOOL_LIMIT, interrupt: Interrupt::default() }
    }
}

impl Input {
    /// A file name, a pattern such as `frames/%05d.png`, or `-` for standard input, which is copied to a temporary file
    /// at once because a clip is read more than once. Names need not be UTF-8.
    ///
    /// # Errors
    /// [`MediaError::Missing`], [`MediaError::Empty`], [`MediaError::Input`] for anything that is not a local regular file;
    /// spooling errors for `-`.
    pub fn parse(name: impl AsRef<OsStr>) -> Result<Self, MediaError> {
        let name = name.as_ref();
        if name == "-" { Self::standard_input(&SpoolOptions::default()) } else { Self::local(name) }
    }

    fn local(name: &OsStr) -> Result<Self, MediaError> {
        let path = Path::new(name);
        let text = name.to_string_lossy();
        if !path.exists()
            && let Some(sequence) = Sequence::find(name)?
        {
            return Ok(Self::of(&text, Source::Sequence(sequence)));
        }
        if let Some((protocol, _)) = text.split_once("://").filter(|_| !path.exists()) {
            let problem = format!("only local files are read (protocol \"{protocol}\" refused); fetch the file first");
            return Err(MediaError::input(&text, problem));
        }
        readable(path, &text)?;
        Ok(Self::of(&text, Source::File(path.to_owned())))
    }

    /// Pictures as a clip, in the order given; `name` is used in messages.
    ///
    /// # Errors
    /// [`MediaError::Missing`], [`MediaError::Input`] where they are of several kinds, [`MediaError::Spool`].
    pub fn pictures(name: &str, files: Vec<PathBuf>) -> Result<Self, MediaError> {
        Ok(Self::of(name, Source::Sequence(Sequence::of_pictures(name, files)?)))
    }

    fn of(name: &str, source: Source) -> Self {
        Self {
            name: name.to_owned(),
            source,
            start: None,
            end: None,
            rate: None,
            stream: None,
            playlists: false,
            interrupt: Interrupt::default(),
        }
    }

    /// Standard input, copied to a temporary file, which lives as long as the input.
    ///
    /// # Errors
    /// As for [`Self::spool`]; [`MediaError::Interrupted`].
    pub fn standard_input(options: &SpoolOptions) -> Result<Self, MediaError> {
        Self::spool(Interruptible::new(std::io::stdin(), &options.interrupt), options)
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
        let copied = std::io::copy(&mut reader.take(options.limit.saturating_add(1)), file);
        if options.interrupt.is_stopped() {
            return Err(Stopped::Interrupted.into());
        }
        let copied = copied.map_err(fail)?;
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

    /// The same input with stream `index` of the container as its video, counted as [`super::probe`] lists them; FFmpeg's choice
    /// unless set. A stream that is not there or no video is reported when the clip is opened.
    #[must_use]
    pub fn with_stream(self, index: Option<usize>) -> Self {
        Self { stream: index, ..self }
    }

    /// The same input, which may be a playlist (HLS, ffconcat) of files in its own folder; refused unless allowed, since a text
    /// under a video's name could otherwise make any file that can be read part of the result.
    #[must_use]
    pub fn allowing_playlists(self, allowed: bool) -> Self {
        Self { playlists: allowed, ..self }
    }

    /// The same input, whose readers stop with [`MediaError::Interrupted`] once `interrupt` is raised, whatever FFmpeg is doing.
    #[must_use]
    pub fn with_interrupt(self, interrupt: &Interrupt) -> Self {
        Self { interrupt: interrupt.clone(), ..self }
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
        if self.interrupt.is_stopped() {
            return Err(Stopped::Interrupted.into());
        }
        match &self.source {
            Source::Sequence(sequence) => self.open_pictures(sequence),
            Source::File(_) | Source::Spooled(_) => self.open_container(),
        }
    }

    /// The file, opened once more.
    pub(super) fn file(&self) -> Result<File, MediaError> {
        open(self.path(), &self.name)
    }

    /// The file ends before its container says.
    pub(super) fn is_cut(&self, demuxer: &Demuxer) -> bool {
        if self.is_sequence() {
            return false;
        }
        self.file().is_ok_and(|file| extent::of(file, &demuxer.format_name()) != Extent::Whole)
    }

    /// Some stream has a packet that ends later than `from`, s on the file's clock. The whole file is read, since seeking relies on
    /// the index that is in doubt; a file that cannot be opened counts as having one.
    pub(super) fn has_packets_at(&self, from: f64) -> bool {
        let Ok(mut demuxer) = self.demux() else { return true };
        let micro = |s: f64| (s * 1e6).round() as i64;
        let mut packet = Packet::new();
        loop {
            match demuxer.read(&mut packet) {
                Ok(true) => {
                    let base = demuxer.stream(packet.stream()).time_base();
                    let end = packet.pts().or(packet.dts()).map(|t| t.saturating_add(packet.duration()));
                    if end.is_some_and(|t| base.rescale(t, Rational::MICRO) > micro(from)) {
                        return true;
                    }
                }
                Err(AvError::INVALID_DATA) => {}
                Ok(false) | Err(_) => return false,
            }
        }
    }

    fn open_container(&self) -> Result<Demuxer, MediaError> {
        let file = self.file()?;
        let failed = |e: std::io::Error| MediaError::input(&self.name, format!("cannot be read: {e}"));
        let length = file.metadata().map_err(failed)?.len();
        let extension = self.path().extension().and_then(OsStr::to_str).unwrap_or_default();
        let guard = Guard::new(&self.interrupt, Nested::Refused, length);
        let copy = file.try_clone().map_err(failed)?;
        let format = InputFormat::recognize(copy, extension, &guard).map_err(|e| self.open_error(e))?;
        if format.is_container() {
            let opened = Demuxer::open(file, extension, format, Arc::clone(&guard));
            return opened.map_err(|e| self.refused_file(&guard).unwrap_or_else(|| self.open_error(e)));
        }
        self.refuse_stills(format)?;
        if !self.playlists || !playlist::is_readable(format) {
            return Err(playlist::refusal(&self.name, format));
        }
        let list = playlist::Playlist::new(self.path(), &self.name, format, &file, &self.interrupt)?;
        let guard = list.guard(&self.interrupt);
        let opened = list.open(file, Arc::clone(&guard));
        opened.map_err(|e| self.refused_file(&guard).unwrap_or_else(|| self.open_error(e)))
    }

    fn open_pictures(&self, sequence: &Sequence) -> Result<Demuxer, MediaError> {
        let rate = self.rate.unwrap_or(PICTURE_RATE);
        let options = Dictionary::new()
            .with("pattern_type", "sequence")
            .with("codec_whitelist", PICTURE_DECODERS)
            .with("start_number", &sequence.first().to_string())
            .with("framerate", &rate.to_string());
        let format = InputFormat::named(c"image2").ok_or_else(|| self.open_error(AvError::UNKNOWN_CODEC))?;
        let guard = Guard::new(&self.interrupt, Nested::Pictures, 0);
        let opened = Demuxer::open_as(None, &c_path(sequence.pattern()), format, options, Arc::clone(&guard));
        opened.map_err(|e| self.refused_file(&guard).unwrap_or_else(|| self.open_error(e)))
    }

    /// The video stream: the one that was chosen, else the best one; `None` where there is no video.
    ///
    /// # Errors
    /// [`MediaError::Usage`] where the chosen one is not there or no video.
    pub(super) fn video_of(&self, demuxer: &Demuxer) -> Result<Option<usize>, MediaError> {
        let Some(index) = self.stream else { return Ok(demuxer.best_video()) };
        if demuxer.is_video(index) {
            return Ok(Some(index));
        }
        let videos: Vec<String> = demuxer.videos().map(|i| i.to_string()).collect();
        let (name, videos) = (&self.name, videos.join(", "));
        let kind = if index < demuxer.stream_count() { "is no video" } else { "is not there" };
        let help = if videos.is_empty() { "there is none".to_owned() } else { format!("take one of {videos}") };
        Err(MediaError::Usage { problem: format!("{name}: stream {index} {kind}; of the video streams {help}") })
    }

    /// The container named a file that it must not.
    fn refused_file(&self, guard: &Guard) -> Option<MediaError> {
        let name = guard.refused()?;
        let problem =
            format!("names another file that is not read ({name}): it must be a regular file within the same folder");
        Some(MediaError::input(&self.name, problem))
    }

    fn open_error(&self, error: AvError) -> MediaError {
        let path = self.name.clone();
        match (error, error.errno()) {
            (AvError::EXIT, _) => Stopped::Interrupted.into(),
            (AvError::NO_PROGRESS, _) => {
                MediaError::input(&path, "FFmpeg reads it without end and finds nothing: it is damaged".into())
            }
            (_, Some(libc::ENOENT)) => MediaError::Missing { path },
            (_, Some(libc::EACCES | libc::EISDIR | libc::EIO)) => {
                MediaError::input(&path, format!("cannot be read: {error}"))
            }
            (_, Some(libc::ENOMEM)) => MediaError::NoMemory { what: format!("opening {path}") },
            _ => match Shortage::likely() {
                Some(shortage) => MediaError::Shortage { problem: format!("{path}: {}", reason(error)), shortage },
                None => MediaError::NotMedia { path, reason: reason(error) },
            },
        }
    }

    /// FFmpeg reads a photo as a clip of one frame; under a video's name it is a mistake.
    fn refuse_stills(&self, format: InputFormat) -> Result<(), MediaError> {
        let format = format.name();
        if format != "image2" && !format.ends_with("_pipe") {
            return Ok(());
        }
        let format = format.trim_end_matches("_pipe");
        let help = "a sequence is given as frames/%05d.png or by its folder";
        Err(MediaError::input(&self.name, format!("is a still picture ({format}), not a video; {help}")))
    }
}

/// Bytes in one piece between the two threads of [`Interruptible`].
const PIECE: usize = 1 << 16;

/// How often an interrupt is looked for while nothing comes.
const PATIENCE: Duration = Duration::from_millis(100);

/// A reader that may block for good, read on a thread of its own: the caller stops waiting once it is interrupted.
struct Interruptible {
    pieces: Receiver<std::io::Result<Vec<u8>>>,
    piece: std::io::Cursor<Vec<u8>>,
    interrupt: Interrupt,
}

impl Interruptible {
    fn new(mut reader: impl Read + Send + 'static, interrupt: &Interrupt) -> Self {
        let (sender, pieces) = std::sync::mpsc::sync_channel(4);
        // Not joined: it may wait for bytes for as long as the program runs, and ends with whoever listens.
        std::thread::spawn(move || {
            loop {
                let mut piece = vec![0; PIECE];
                let read = reader.read(&mut piece).map(|n| {
                    piece.truncate(n);
                    piece
                });
                let ended = read.as_ref().is_ok_and(Vec::is_empty);
                let failed = read.as_ref().is_err_and(|e| e.kind() != std::io::ErrorKind::Interrupted);
                if sender.send(read).is_err() || ended || failed {
                    break;
                }
            }
        });
        Self { pieces, piece: std::io::Cursor::default(), interrupt: interrupt.clone() }
    }
}

impl Read for Interruptible {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        loop {
            match self.piece.read(buffer)? {
                0 => {}
                n => return Ok(n),
            }
            if self.interrupt.is_stopped() {
                return Err(std::io::Error::other("interrupted"));
            }
            match self.pieces.recv_timeout(PATIENCE) {
                Ok(piece) => {
                    let piece = piece?;
                    if piece.is_empty() {
                        return Ok(0);
                    }
                    self.piece = std::io::Cursor::new(piece);
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(0),
            }
        }
    }
}

/// FFmpeg's decoders of still pictures; others (vector graphics, video) have no place in a sequence.
const PICTURE_DECODERS: &str = "png,apng,mjpeg,jpegls,jpeg2000,libopenjpeg,libjxl,tiff,bmp,webp,exr,dpx,pam,pbm,pgm,pgmyuv,\
                                ppm,pfm,phm,targa,sgi,sunrast,gif,psd,qoi,hdr,pcx,xbm,xpm,xwd,dds,cri,av1,libdav1d,hevc";

fn readable(path: &Path, name: &str) -> Result<(), MediaError> {
    let file = open(path, name)?;
    match file.metadata() {
        Ok(meta) if meta.len() == 0 => Err(MediaError::Empty { path: name.to_owned() }),
        _ => Ok(()),
    }
}

fn open(path: &Path, name: &str) -> Result<File, MediaError> {
    open_regular(path).map_err(|e| match e.kind() {
        std::io::ErrorKind::NotFound => MediaError::Missing { path: name.to_owned() },
        // A clip is read more than once.
        std::io::ErrorKind::InvalidInput if path.is_dir() => {
            MediaError::input(name, "cannot be read: it is a folder".to_owned())
        }
        std::io::ErrorKind::InvalidInput => {
            MediaError::input(name, format!("cannot be read: it is {e}; - reads standard input, which is copied"))
        }
        _ => MediaError::input(name, format!("cannot be read: {e}")),
    })
}

/// The file protocol spelled out: a name with a colon in it is a name, not a protocol.
pub(super) fn local_url(path: &Path) -> OsString {
    let mut url = OsString::from("file:");
    url.push(path);
    url
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
        let options = SpoolOptions { folder: folder.path().into(), limit: 4, ..SpoolOptions::default() };
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
    fn waiting_for_bytes_that_never_come_can_be_interrupted() {
        struct Silent;
        impl Read for Silent {
            fn read(&mut self, _: &mut [u8]) -> std::io::Result<usize> {
                loop {
                    std::thread::park();
                }
            }
        }
        let folder = tempfile::tempdir().expect("temporary folder");
        let interrupt = Interrupt::new();
        let options =
            SpoolOptions { folder: folder.path().into(), interrupt: interrupt.clone(), ..SpoolOptions::default() };
        interrupt.stop();
        let error = Input::spool(Interruptible::new(Silent, &interrupt), &options).expect_err("stops");
        assert!(matches!(error, MediaError::Interrupted(_)), "{error}");
        let bytes = vec![7; 3 * PIECE + 5];
        let calm = Interrupt::new();
        let input =
            Input::spool(Interruptible::new(std::io::Cursor::new(bytes.clone()), &calm), &SpoolOptions::default());
        assert_eq!(std::fs::read(input.expect("spools").path()).expect("spooled"), bytes);
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
