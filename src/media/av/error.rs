//! FFmpeg's error numbers.

use std::ffi::{CStr, c_int};

use ffmpeg_next::ffi;

/// A negative return value of an FFmpeg function.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct AvError(pub(crate) c_int);

impl AvError {
    /// Output is not ready yet, or input must be drained first.
    pub(crate) const AGAIN: Self = Self(ffi::AVERROR(libc::EAGAIN));
    /// End of the file or of the stream.
    pub(crate) const EOF: Self = Self(ffi::AVERROR_EOF);
    /// The bytes are not what they claim to be.
    pub(crate) const INVALID_DATA: Self = Self(ffi::AVERROR_INVALIDDATA);
    /// A library behind FFmpeg failed and gave no reason.
    pub(crate) const EXTERNAL: Self = Self(ffi::AVERROR_EXTERNAL);
    /// Out of memory.
    pub(crate) const NO_MEMORY: Self = Self(ffi::AVERROR(libc::ENOMEM));
    /// No decoder, encoder, muxer or protocol of that name.
    pub(crate) const UNKNOWN_CODEC: Self = Self(ffi::AVERROR_DECODER_NOT_FOUND);
    /// No encoder of that name.
    pub(crate) const UNKNOWN_ENCODER: Self = Self(ffi::AVERROR_ENCODER_NOT_FOUND);
    /// The call was stopped from outside.
    pub(crate) const EXIT: Self = Self(ffi::AVERROR_EXIT);
    /// A demuxer reads without end and gives nothing.
    pub(crate) const NO_PROGRESS: Self = Self(ffi::AVERROR(libc::ELOOP));
    /// Another file that must not be opened.
    pub(crate) const FORBIDDEN: Self = Self(ffi::AVERROR(libc::EPERM));
    /// A number does not fit where it is to be stored.
    pub(crate) const OUT_OF_RANGE: Self = Self(ffi::AVERROR(libc::ERANGE));
    /// An argument does not fit.
    pub(crate) const INVALID: Self = Self(ffi::AVERROR(libc::EINVAL));

    /// The operating system's error number, where the failure came from there.
    pub(crate) fn errno(self) -> Option<i32> {
        (0 < -self.0 && -self.0 < 4096).then_some(-self.0)
    }
}

/// `Ok` with the value for zero and above.
pub(super) fn check(code: c_int) -> Result<c_int, AvError> {
    if code < 0 { Err(AvError(code)) } else { Ok(code) }
}

impl std::fmt::Display for AvError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut text = [0; 128];
        // SAFETY: the buffer is writable for its length, and FFmpeg ends what it writes with a zero within it.
        let message = unsafe {
            ffi::av_strerror(self.0, text.as_mut_ptr(), text.len());
            CStr::from_ptr(text.as_ptr())
        };
        f.write_str(&message.to_string_lossy())
    }
}

impl std::fmt::Debug for AvError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{self} ({})", self.0)
    }
}

impl std::error::Error for AvError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn operating_system_errors_are_distinguished_from_the_librarys_own() {
        assert_eq!(AvError::NO_MEMORY.errno(), Some(libc::ENOMEM));
        assert_eq!(AvError::INVALID_DATA.errno(), None);
        assert_eq!(AvError::EOF.to_string(), "End of file");
    }
}
