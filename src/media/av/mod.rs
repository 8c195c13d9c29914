//! Safe wrappers of FFmpeg's C interface: every `unsafe` block of the media crate is in this folder.
//!
//! The binding's own wrappers are used for what they declare (constants, structures, functions) and not for ownership:
//! its packet iterator hides read errors, its pixel format conversions are undefined for formats newer than itself, and
//! its scaler cannot be told the color matrix. The types here own one FFmpeg object each, free it on drop, and expose
//! only what cannot break memory safety.
#![allow(unsafe_code)] // C library; each block carries its proof
#![allow(clippy::cast_possible_wrap)] // sizes, indices and counts are C ints on the other side, and far below 2^31
#![allow(clippy::cast_ptr_alignment)] // FFmpeg hands its own aligned structures over as bytes

pub(crate) mod build;
mod decode;
mod demux;
mod dict;
mod encode;
mod error;
mod frame;
mod hardware;
mod io;
pub(crate) mod log;
mod mux;
mod packet;
mod pixel;
mod pool;
mod repack;
mod scale;
mod stream;
mod subtitle;

pub(crate) use decode::Decoder;
pub(crate) use demux::{Chapter, Demuxer, InputFormat};
pub(crate) use dict::{Dictionary, c_path};
pub(crate) use encode::{Encoder, EncoderCodec, EncoderSettings, find_encoder};
pub(crate) use error::AvError;
pub(crate) use frame::{AvFrame, DOLBY_VISION, PlanarFrame, SideData};
pub(crate) use io::{Guard, Nested, within};
pub(crate) use mux::{Muxer, OutputFormat};
pub(crate) use packet::Packet;
pub(crate) use pixel::{Pix, Route};
pub(crate) use pool::FramePool;
pub(crate) use repack::{pack, unpack};
pub(crate) use scale::Scaler;
pub(crate) use stream::{Kind, Rational, StreamRef};
pub(crate) use subtitle::SubtitleTranscoder;
