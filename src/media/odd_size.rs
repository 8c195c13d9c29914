//! Odd sizes and subsampled chroma.
//!
//! A 641×361 picture in 4:2:0 has chroma planes of 321×181 samples; H.264 and its kin can only say 640×360 there, and an
//! encoder would cut a line in silence. Where the encoder takes full chroma, that is used instead: the size stays exact.

use super::MediaError;
use super::av::Pix;
use super::encoder_choice::{Choice, Fit};
use super::info::VideoInfo;
use plumbline_image::{Layout, PixelFormat};

/// Encoders that keep odd sizes in subsampled formats.
const KEEPS_ODD: [&str; 8] = ["ffv1", "libaom-av1", "librav1e", "prores_ks", "mjpeg", "png", "tiff", "dpx"];

/// Changes `choice` to full chroma where its format could not hold the size of `video`; says so.
pub(super) fn avoid(choice: &mut Choice, video: &VideoInfo, strict: bool) -> Result<Option<String>, MediaError> {
    let (sx, sy) = choice.pix.chroma_shift();
    let odd = (sx > 0 && video.width % 2 == 1) || (sy > 0 && video.height % 2 == 1);
    let encoder = choice.encoder.name();
    if !odd || KEEPS_ODD.contains(&encoder.as_str()) {
        return Ok(None);
    }
    let (width, height, format) = (video.width, video.height, choice.pix.name());
    let full = Pix::from_planar(PixelFormat::opaque(Layout::Yuv444, choice.pix.bits()));
    match full.filter(|pix| choice.encoder.formats().contains(pix) && !strict) {
        Some(pix) => {
            (choice.pix, choice.fit) = (pix, Fit::Converted);
            let name = pix.name();
            Ok(Some(format!(
                "{width}×{height} px is odd: {encoder} encodes {name} instead of {format} to keep the size"
            )))
        }
        None => Err(MediaError::Usage {
            problem: format!(
                "{width}×{height} px is odd, which {encoder} cannot hold in {format} (even sizes only); crop the clip by one \
                 pixel, or choose a codec that can (ffv1, or h264 with a 4:4:4 source)"
            ),
        }),
    }
}
