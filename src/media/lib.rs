//! Video files: probing, streaming decode, streaming encode, and everything else in the file passed through.
//!
//! Exactly as many frames come out as go in, each at its own time; color, depth, rotation, HDR metadata, audio, subtitles,
//! chapters and tags are kept. [`VideoReader`] and [`VideoWriter`] are `Send`: decode, work and encode run on threads of
//! their own, joined by bounded channels, and no frame is copied on the way. `FFmpeg` does the work; `av` is the one
//! folder that touches its C interface.

mod av;
mod build_info;
mod chapters;
mod clock;
mod copier;
mod deinterlace;
mod encoder_choice;
mod encoder_settings;
mod encoders;
mod error;
mod extent;
mod fields;
mod focal;
mod frame_span;
mod hdr;
mod info;
mod input;
mod losses;
mod odd_size;
mod output;
mod packet_times;
mod part;
mod playlist;
mod probe;
mod read_options;
mod reader;
mod sequence;
mod surface;
mod unpack;
mod write_options;
mod writer;

pub use build_info::FfmpegBuild;
pub use encoders::{EncoderInfo, check_encoder, encoders};
pub use error::{Fault, MediaError};
pub use focal::focal_px;
pub use frame_span::{FrameSpan, frame_times};
pub use info::{FieldOrder, Ratio, VideoInfo};
pub use input::{Input, PICTURE_RATE, SPOOL_LIMIT, SpoolOptions};
pub use output::Output;
pub use probe::{ChapterInfo, MediaInfo, StreamInfo, StreamKind, VideoSummary, probe};
pub use read_options::{Deinterlace, ReadOptions, ReadReport};
pub use reader::VideoReader;
pub use surface::FramePool;
pub use write_options::{Codec, EncoderChoice, PassthroughStreams, WriteOptions, WriteReport};
pub use writer::{SealedVideo, VideoWriter};
