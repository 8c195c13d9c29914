//! Why a picture cannot be read or written.

use std::io;

use plumbline_num::run::Stopped;

/// Why a picture cannot be read or written. Messages do not name the file: the caller knows it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StillError {
    /// The input is at fault (a folder, a pipe, a device among them), or the disk.
    #[error("cannot be read: {0}")]
    Read(#[source] io::Error),
    /// The input is at fault: not a picture of a kind that is read.
    #[error("{found} is not read here; convert it to PNG, TIFF or JPEG first")]
    Unknown {
        /// What it seems to be.
        found: &'static str,
    },
    /// The input is at fault: raw sensor data.
    #[error("a camera's raw file ({0}); develop it to a 16-bit TIFF first, for example with darktable or RawTherapee")]
    Raw(String),
    /// HEIC or AVIF, which another layer decodes.
    #[error("a HEIF picture, which is read through FFmpeg")]
    Heif,
    /// The input is at fault: it moves.
    #[error("an animated {0}; take one picture out of it first")]
    Animated(&'static str),
    /// The input is at fault, or the limit too low.
    #[error(
        "{width}×{height} px are more than the limit of {limit} px; raise it with --max-pixels (`max_pixels`) if the file is to be trusted"
    )]
    TooLarge {
        /// Width that the file claims, px.
        width: u64,
        /// Height that the file claims, px.
        height: u64,
        /// Most pixels allowed.
        limit: u64,
    },
    /// The input is at fault: more bytes than any picture within the limit has.
    #[error(
        "{bytes} bytes are more than a picture of {limit} px needs; raise the limit with --max-pixels (`max_pixels`)"
    )]
    TooLong {
        /// Bytes of the file.
        bytes: u64,
        /// Most pixels allowed.
        limit: u64,
    },
    /// The input is at fault: it ends early.
    #[error("the file is truncated; get a complete copy")]
    Truncated,
    /// The input is at fault.
    #[error("the file is damaged: {0}")]
    Damaged(String),
    /// The input is at fault: CMYK, which is read from JPEG files alone.
    #[error(
        "CMYK in a TIFF file; convert it to RGB with its profile first, for example `magick in.tif -profile sRGB.icc out.tif`"
    )]
    Cmyk,
    /// The input is at fault: samples of another depth or kind.
    #[error("{0} are not read here; convert it to 8 or 16 bit per sample first")]
    Depth(String),
    /// The caller is at fault: the format cannot hold the picture.
    #[error("{width}×{height} px are more than {format} can hold (expected at most {most} px a side); write a TIFF")]
    Side {
        /// Width, px.
        width: usize,
        /// Height, px.
        height: usize,
        /// Name of the format.
        format: &'static str,
        /// Most pixels a side.
        most: usize,
    },
    /// The caller is at fault: a name without a known ending.
    #[error("`{0}` ends like no picture that is written here; end it with .jpg, .png, .tif or .webp")]
    Extension(String),
    /// The caller is at fault: a frame that is not gray or GBR of 8 or 16 bit, or whose memory is shared.
    #[error("a frame of another layout than gray or GBR with 8 or 16 bit")]
    Layout,
    /// The disk is at fault.
    #[error("cannot be written: {0}")]
    Write(#[source] io::Error),
    /// The run was interrupted, or its time is used up, while pixels were made for the file.
    #[error(transparent)]
    Stopped(#[from] Stopped),
    /// An encoder refused.
    #[error("cannot be written: {0}")]
    Encode(String),
}

impl StillError {
    /// The output, not the input, is at fault.
    pub fn is_about_output(&self) -> bool {
        matches!(self, Self::Side { .. } | Self::Extension(_) | Self::Layout | Self::Write(_) | Self::Encode(_))
    }

    /// What a decoder said.
    pub(super) fn of_decoder(error: image::ImageError) -> Self {
        match error {
            image::ImageError::IoError(e) if e.kind() == io::ErrorKind::UnexpectedEof => Self::Truncated,
            image::ImageError::IoError(e) => Self::Read(e),
            other => {
                let text = other.to_string();
                if text.contains("unexpected end of file") || text.contains("failed to fill whole buffer") {
                    Self::Truncated
                } else {
                    Self::Damaged(text)
                }
            }
        }
    }
}
