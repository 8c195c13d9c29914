//! What can go wrong with media, and whose fault it is.

use std::path::{Path, PathBuf};

use super::av::AvError;
use plumbline_num::limits::{Resource, Shortage};
use plumbline_num::run::Stopped;

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
    /// The video stream holds no picture that could be decoded.
    #[error("{path}: the video stream ({codec}) holds no frame that can be decoded")]
    NoFrames {
        /// The input as given.
        path: String,
        /// The codec's name.
        codec: String,
    },
    /// The input cannot be read, or holds what cannot be processed.
    #[error("{path}: {problem}")]
    Input {
        /// The input as given.
        path: String,
        /// What is wrong, and what to do.
        problem: String,
    },
    /// What is asked for contradicts itself, or does not fit the clip, the container or the encoders that there are.
    #[error("{problem}")]
    Usage {
        /// What is wrong, and what to do.
        problem: String,
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
    /// The output cannot be created or written.
    #[error("{path}: {problem}")]
    Output {
        /// The output as given.
        path: PathBuf,
        /// What is wrong, and what to do.
        problem: String,
    },
    /// No space is left.
    #[error("{path}: no space is left on the device; the unfinished file was removed")]
    DiskFull {
        /// The output as given.
        path: PathBuf,
    },
    /// No memory. The message names the limit in force.
    #[error("{what}: {}", Shortage(Resource::Memory))]
    NoMemory {
        /// What was being done.
        what: String,
    },
    /// The call was stopped from outside.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
    /// A library failed, and this process has little left of what it needs.
    #[error("{problem} ({shortage})")]
    Shortage {
        /// What failed.
        problem: String,
        /// What there is too little of.
        shortage: Shortage,
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
            | Self::Empty { .. }
            | Self::NotMedia { .. }
            | Self::NoVideo { .. }
            | Self::NoFrames { .. }
            | Self::Input { .. } => Fault::Input,
            Self::UnknownContainer { .. } | Self::Usage { .. } => Fault::Usage,
            Self::TargetExists { .. } | Self::Output { .. } | Self::DiskFull { .. } => Fault::Output,
            Self::SpoolLimit { .. }
            | Self::Spool { .. }
            | Self::NoMemory { .. }
            | Self::Shortage { .. }
            | Self::Interrupted(_) => Fault::Environment,
            Self::Internal { .. } => Fault::Internal,
        }
    }

    /// An input that cannot be processed: what is wrong, and what to do.
    pub(super) fn input(path: &str, problem: String) -> Self {
        Self::Input { path: path.to_owned(), problem }
    }

    /// A clip that ends before its container says, where that is an error.
    pub(super) fn cut_short(path: &str, shortfall: &str) -> Self {
        Self::input(
            path,
            format!("{shortfall} (refused because of strict); get the whole file, or allow what is there"),
        )
    }

    /// A span without a frame: from `start` to `end` of a clip of `length`, s; infinite where open, NaN where unknown.
    pub(super) fn empty_span(path: &str, start: f64, end: f64, length: f64) -> Self {
        let end = if end.is_finite() { format!("{end} s") } else { "the end".to_owned() };
        let length = if length.is_finite() { format!(" ({length} s long)") } else { String::new() };
        let problem = format!("{path}: the span from {start} s to {end} is empty or lies outside the clip{length}");
        Self::Usage { problem }
    }

    /// An encoder that refuses its settings: size, format and options, and what it says.
    pub(super) fn encoder_refused(encoder: &str, settings: &str, reason: &str) -> Self {
        let problem = format!("encoder {encoder} refused {settings}: {reason}");
        // Libraries of encoders do not say what they lack.
        match Shortage::likely() {
            Some(shortage) => Self::Shortage { problem, shortage },
            None => Self::Usage { problem },
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
        if source == AvError::EXIT {
            return Stopped::Interrupted.into();
        }
        match source.errno() {
            Some(libc::ENOSPC | libc::EDQUOT) => Self::DiskFull { path: path.to_owned() },
            Some(libc::ENOMEM) => Self::NoMemory { what: format!("writing {}", path.display()) },
            _ => Self::unwritable(path, &reason(source)),
        }
    }

    /// An output that cannot be written, and why.
    pub(super) fn unwritable(path: &Path, reason: &str) -> Self {
        Self::Output { path: path.to_owned(), problem: format!("cannot be written: {reason}") }
    }

    /// An error of the system while writing `path`.
    pub(super) fn writing_io(path: &Path, source: &std::io::Error) -> Self {
        match source.raw_os_error() {
            Some(code) => Self::writing(path, AvError(-code)),
            None => Self::unwritable(path, &source.to_string()),
        }
    }
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

    #[test]
    fn missing_memory_is_said_with_the_limit_and_the_remedy() {
        for error in [
            MediaError::internal("decoding a.mkv", AvError::NO_MEMORY),
            MediaError::writing(Path::new("out.mp4"), AvError(-libc::ENOMEM)),
        ] {
            assert!(error.to_string().contains(&Shortage(Resource::Memory).to_string()), "{error}");
            assert_eq!(error.fault().exit_code(), 75);
        }
    }
}
