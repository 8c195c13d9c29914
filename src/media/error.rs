//! What can go wrong with media, and whose fault it is.

use std::path::{Path, PathBuf};

use super::av::AvError;

/// Who can do something about an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The request itself: options that contradict each other or the clip.
    Usage,
    /// The input file.
    Input,
    /// The output file or its place.
    Output,
    /// Passing circumstances: memory, space, a device in use.
    Environment,
    /// A fault of this program or of FFmpeg.
    Internal,
}

impl Fault {
    /// The exit code of a program that stops for this reason.
    pub fn exit_code(self) -> u8 {
        match self {
            Self::Usage => 2,
            Self::Input => 65,
            Self::Output => 73,
            Self::Environment => 75,
            Self::Internal => 1,
        }
    }
}

/// An error of reading or writing media.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MediaError {
    /// The input does not exist.
    #[error("{path}: no such file; check the name")]
    Missing {
        /// The input as given.
        path: String,
    },
    /// The input cannot be opened for reading.
    #[error("{path}: cannot be read: {reason}")]
    Unreadable {
        /// The input as given.
        path: String,
        /// What the system says.
        reason: String,
    },
    /// The input has no bytes.
    #[error("{path}: the file is empty (0 bytes)")]
    Empty {
        /// The input as given.
        path: String,
    },
    /// No container or stream could be recognized.
    #[error("{path}: not a video that FFmpeg can read, or cut short: {reason}")]
    NotMedia {
        /// The input as given.
        path: String,
        /// What FFmpeg says.
        reason: String,
    },
    /// There are streams, but none of them is a video.
    #[error("{path}: has no video stream (only {found})")]
    NoVideo {
        /// The input as given.
        path: String,
        /// Kinds of the streams that are there.
        found: String,
    },
    /// A still picture, whatever its name says.
    #[error(
        "{path}: is a still picture ({format}), not a video; a sequence is given as frames/%05d.png or by its folder"
    )]
    StillPicture {
        /// The input as given.
        path: String,
        /// The picture's format.
        format: String,
    },
    /// A number is missing in a sequence.
    #[error(
        "{path}: number {missing} is missing ({first} to {last} are there in part); supply it, or give the folder to take the \
         pictures that are there in the order of their names"
    )]
    Gap {
        /// The input as given.
        path: String,
        /// The first number without a file.
        missing: u64,
        /// The lowest number there is.
        first: u64,
        /// The highest number there is.
        last: u64,
    },
    /// Pictures of one sequence are of several kinds.
    #[error("{path}: holds pictures of several kinds ({kinds}); name one kind, such as '{path}/*.{}'", first_of(kinds))]
    MixedPictures {
        /// The input as given.
        path: String,
        /// Their extensions.
        kinds: String,
    },
    /// A frame rate for a clip that has times of its own.
    #[error("{path}: has times of its own; a frame rate can be given for image sequences only")]
    OwnTimes {
        /// The input as given.
        path: String,
    },
    /// The video stream holds no picture that could be decoded.
    #[error("{path}: the video stream ({codec}) holds no frame that can be decoded")]
    NoFrames {
        /// The input as given.
        path: String,
        /// The codec's name.
        codec: String,
    },
    /// The pictures' format cannot be processed.
    #[error("{path}: pixel format {format} is not supported (planar, packed or palette integer formats are)")]
    PixelFormat {
        /// The input as given.
        path: String,
        /// FFmpeg's name of the format.
        format: String,
    },
    /// Frames change their size or format within the clip.
    #[error(
        "{path}: frame {frame} is {now}, all before it are {was}; cut the clip there or bring it to one size first"
    )]
    FormatChange {
        /// The input as given.
        path: String,
        /// Index of the first frame that differs.
        frame: u64,
        /// Size and format before.
        was: String,
        /// Size and format from here on.
        now: String,
    },
    /// Interlaced video, with deinterlacing forbidden.
    #[error("{path}: frame {frame} is interlaced; allow deinterlacing, or convert it to progressive video first")]
    Interlaced {
        /// The input as given.
        path: String,
        /// Index of the first interlaced frame.
        frame: u64,
    },
    /// Reading stopped with an error.
    #[error("{path}: reading failed after {frames} frames: {reason}")]
    Read {
        /// The input as given.
        path: String,
        /// Frames delivered before.
        frames: u64,
        /// What FFmpeg says.
        reason: String,
    },
    /// The numbers of a trimmed span make no sense.
    #[error("{path}: the span from {start} s to {} is empty or lies outside the clip{}", end_of(*end), long(*length))]
    EmptySpan {
        /// The input as given.
        path: String,
        /// Start asked for, s.
        start: f64,
        /// End asked for, s; infinite where open.
        end: f64,
        /// Length of the clip, s; NaN where unknown.
        length: f64,
    },
    /// A protocol other than local files.
    #[error("{path}: only local files are read (protocol \"{protocol}\" refused); fetch the file first")]
    Protocol {
        /// The input as given.
        path: String,
        /// The name before the colon.
        protocol: String,
    },
    /// Standard input holds more than may be spooled.
    #[error(
        "standard input is longer than {limit} bytes, the limit for the copy in {place}; raise the limit or give a file"
    )]
    SpoolLimit {
        /// The limit, bytes.
        limit: u64,
        /// Folder of the temporary copy.
        place: PathBuf,
    },
    /// Standard input could not be copied to a temporary file.
    #[error("cannot copy standard input to {place}: {source}")]
    Spool {
        /// Folder of the temporary copy.
        place: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The output would overwrite the input.
    #[error("{path}: is the input itself; give the result another name")]
    TargetIsInput {
        /// The output as given.
        path: PathBuf,
    },
    /// The output exists.
    #[error("{path}: exists already; choose another name or allow overwriting")]
    TargetExists {
        /// The output as given.
        path: PathBuf,
    },
    /// The output's extension is not that of a container.
    #[error("{path}: no container is known for this name; end it in .mp4, .mov, .mkv, .webm, .avi, .ts or %05d.png")]
    UnknownContainer {
        /// The output as given.
        path: PathBuf,
    },
    /// The container cannot be written as a stream.
    #[error("{container} cannot be written to standard output; use matroska, mpegts or a file")]
    NotStreamable {
        /// FFmpeg's name of the container.
        container: String,
    },
    /// The output cannot be created or written.
    #[error("{path}: cannot be written: {reason}")]
    Unwritable {
        /// The output as given.
        path: PathBuf,
        /// What the system or FFmpeg says.
        reason: String,
    },
    /// No space is left.
    #[error("{path}: no space is left on the device; the unfinished file was removed")]
    DiskFull {
        /// The output as given.
        path: PathBuf,
    },
    /// FFmpeg has no such encoder, or the device for it is missing.
    #[error("no encoder for {wanted}: {reason}; available: {available}")]
    NoEncoder {
        /// The codec or encoder asked for.
        wanted: String,
        /// Why.
        reason: String,
        /// Encoders that exist.
        available: String,
    },
    /// The encoder refused its settings.
    #[error("encoder {encoder} refused {settings}: {reason}")]
    EncoderRefused {
        /// FFmpeg's name of the encoder.
        encoder: String,
        /// Size, format and options.
        settings: String,
        /// What the encoder says.
        reason: String,
    },
    /// An odd size that the chosen pixel format cannot hold.
    #[error(
        "{width}×{height} px is odd, which {encoder} cannot hold in {format} (even sizes only); crop the clip by one pixel, \
         or choose a codec that can (ffv1, or h264 with a 4:4:4 source)"
    )]
    OddSize {
        /// Width, px.
        width: usize,
        /// Height, px.
        height: usize,
        /// FFmpeg's name of the encoder.
        encoder: String,
        /// FFmpeg's name of the pixel format.
        format: String,
    },
    /// Something of the source would be lost, and `strict` forbids it.
    #[error("{what} (refused because of strict)")]
    Loss {
        /// What would be lost, and why.
        what: String,
    },
    /// Frames handed to a writer do not fit it.
    #[error("a frame of {got} was handed to a writer for {expected}")]
    WrongFrame {
        /// Size and format of the frame.
        got: String,
        /// Size and format of the writer.
        expected: String,
    },
    /// No memory.
    #[error("out of memory for {what}; use fewer threads or a smaller clip")]
    NoMemory {
        /// What was to be allocated.
        what: String,
    },
    /// FFmpeg failed where it should not.
    #[error("{doing}: {reason}")]
    Internal {
        /// What was being done.
        doing: String,
        /// What FFmpeg says.
        reason: String,
    },
}

impl MediaError {
    /// Who can do something about it.
    pub fn fault(&self) -> Fault {
        match self {
            Self::Missing { .. }
            | Self::Unreadable { .. }
            | Self::Empty { .. }
            | Self::NotMedia { .. }
            | Self::NoVideo { .. }
            | Self::StillPicture { .. }
            | Self::Gap { .. }
            | Self::MixedPictures { .. }
            | Self::NoFrames { .. }
            | Self::PixelFormat { .. }
            | Self::FormatChange { .. }
            | Self::Interlaced { .. }
            | Self::Read { .. }
            | Self::Protocol { .. } => Fault::Input,
            Self::EmptySpan { .. }
            | Self::OwnTimes { .. }
            | Self::NoEncoder { .. }
            | Self::EncoderRefused { .. }
            | Self::OddSize { .. }
            | Self::UnknownContainer { .. }
            | Self::NotStreamable { .. }
            | Self::Loss { .. } => Fault::Usage,
            Self::TargetIsInput { .. }
            | Self::TargetExists { .. }
            | Self::Unwritable { .. }
            | Self::DiskFull { .. } => Fault::Output,
            Self::SpoolLimit { .. } | Self::Spool { .. } | Self::NoMemory { .. } => Fault::Environment,
            Self::WrongFrame { .. } | Self::Internal { .. } => Fault::Internal,
        }
    }

    /// An error of FFmpeg while `doing` something that concerns no file.
    pub(super) fn internal(doing: &str, source: AvError) -> Self {
        if source == AvError::NO_MEMORY {
            return Self::NoMemory { what: doing.to_owned() };
        }
        Self::Internal { doing: doing.to_owned(), reason: reason(source) }
    }

    /// An error of FFmpeg while writing `path`.
    pub(super) fn writing(path: &Path, source: AvError) -> Self {
        match source.errno() {
            Some(libc::ENOSPC | libc::EDQUOT) => Self::DiskFull { path: path.to_owned() },
            Some(libc::ENOMEM) => Self::NoMemory { what: format!("writing {}", path.display()) },
            _ => Self::Unwritable { path: path.to_owned(), reason: reason(source) },
        }
    }

    /// An error of the system while writing `path`.
    pub(super) fn writing_io(path: &Path, source: &std::io::Error) -> Self {
        match source.raw_os_error() {
            Some(code) => Self::writing(path, AvError(-code)),
            None => Self::Unwritable { path: path.to_owned(), reason: source.to_string() },
        }
    }
}

/// The end of a span in words.
fn end_of(end: f64) -> String {
    if end.is_finite() { format!("{end} s") } else { "the end".to_owned() }
}

fn long(length: f64) -> String {
    if length.is_finite() { format!(" ({length} s long)") } else { String::new() }
}

fn first_of(list: &str) -> &str {
    list.split(", ").next().unwrap_or_default()
}

/// FFmpeg's number in words, with the last complaint of the library where there is one.
pub(super) fn reason(error: AvError) -> String {
    let complaint = super::av::log::last_complaint();
    if complaint.is_empty() { error.to_string() } else { format!("{error} ({complaint})") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_is_distinguished_from_a_forbidden_folder() {
        let path = Path::new("out.mp4");
        let full = MediaError::writing(path, AvError(-libc::ENOSPC));
        assert_eq!(full.to_string(), "out.mp4: no space is left on the device; the unfinished file was removed");
        assert_eq!(full.fault().exit_code(), 73);
        let forbidden = MediaError::writing(path, AvError(-libc::EACCES));
        assert_eq!(forbidden.to_string(), "out.mp4: cannot be written: Permission denied");
        assert_eq!(forbidden.fault().exit_code(), 73);
    }
}
