//! What is known of a clip's video before it is processed.

use serde::Serialize;

use super::av::{Chapter, Rational};
use plumbline_image::{ColorDescription, Layout, PixelFormat};
use plumbline_num::time::Timebase;

/// How the lines of interlaced frames belong together in time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FieldOrder {
    /// Whole pictures.
    Progressive,
    /// Two fields, the one with the first line earlier.
    TopFirst,
    /// Two fields, the one with the second line earlier.
    BottomFirst,
}

impl FieldOrder {
    /// Interlaced with the top field first, with the bottom field first, or not at all.
    pub(super) fn from_top_first(top_first: Option<bool>) -> Self {
        match top_first {
            None => Self::Progressive,
            Some(true) => Self::TopFirst,
            Some(false) => Self::BottomFirst,
        }
    }
}

/// A positive fraction; frame rates and pixel aspects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Ratio {
    /// Numerator, > 0.
    pub num: i32,
    /// Denominator, > 0.
    pub den: i32,
}

impl Ratio {
    /// `None` where a term is not positive ("unknown" in media files).
    pub fn new(num: i32, den: i32) -> Option<Self> {
        (num > 0 && den > 0).then_some(Self { num, den })
    }

    /// The quotient.
    pub fn value(self) -> f64 {
        f64::from(self.num) / f64::from(self.den)
    }

    pub(super) fn known(r: Rational) -> Option<Self> {
        Self::new(r.num, r.den)
    }

    pub(super) fn av(self) -> Rational {
        Rational { num: self.num, den: self.den }
    }
}

impl std::fmt::Display for Ratio {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}", self.num, self.den)
    }
}

/// HDR metadata of a stream or of its first frame, in the structures of FFmpeg that made them.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct HdrBytes {
    pub(super) mastering: Option<Vec<u8>>,
    pub(super) light: Option<Vec<u8>>,
    /// Metadata that change from scene to scene, by their usual names.
    pub(super) dynamic: Vec<&'static str>,
}

/// The video stream of an input, with the properties of its file.
#[derive(Clone, Debug)]
pub struct VideoInfo {
    /// Coded width, px.
    pub width: usize,
    /// Coded height, px.
    pub height: usize,
    /// Format of the frames as they are delivered: planar, native depth.
    pub format: PixelFormat,
    /// FFmpeg's name of the decoder's own format (`yuvj420p`, `nv12`).
    pub source_format: String,
    /// Unit of every timestamp.
    pub timebase: Timebase,
    /// Mean frame rate, 1/s, if known from the container.
    pub frame_rate: Option<Ratio>,
    /// Width over height of a pixel; `None` where unspecified.
    pub sample_aspect: Option<Ratio>,
    /// Clockwise rotation that a player applies, degrees, a multiple of 90 in practice; frames are delivered unturned.
    pub rotation_deg: f64,
    /// The player mirrors the picture as well.
    pub mirrored: bool,
    /// Meaning of the samples.
    pub color: ColorDescription,
    /// Field order of the source; frames are delivered progressive unless deinterlacing was turned off.
    pub field_order: FieldOrder,
    /// Short name of the codec.
    pub codec: String,
    /// Frames in the stream, if known from the container; of a trimmed span, by its length and the mean rate. Edit lists are
    /// not taken into account.
    pub frames_estimate: Option<u64>,
    /// Length, s, of the trimmed span where one was asked for.
    pub duration_s: Option<f64>,
    /// Index of the stream in the container.
    pub stream: usize,
    /// The other video streams of the container.
    pub other_videos: Vec<usize>,
    pub(super) chroma_location: i32,
    pub(super) hdr: HdrBytes,
}

impl VideoInfo {
    /// Time base in FFmpeg's form.
    pub(super) fn av_timebase(&self) -> Rational {
        Rational { num: self.timebase.num, den: self.timebase.den }
    }

    /// Mean distance of two frames in ticks, at least 1.
    pub(super) fn mean_ticks(&self) -> i64 {
        let rate = self.frame_rate.map_or(25.0, Ratio::value);
        let seconds_per_tick = f64::from(self.timebase.num) / f64::from(self.timebase.den);
        ((1.0 / rate / seconds_per_tick).round() as i64).max(1)
    }
}

/// Size and format in words, as errors name them.
pub(super) fn describe(width: usize, height: usize, format: PixelFormat) -> String {
    let layout = match format.layout {
        Layout::Gray => "gray",
        Layout::Yuv420 => "4:2:0",
        Layout::Yuv422 => "4:2:2",
        Layout::Yuv440 => "4:4:0",
        Layout::Yuv411 => "4:1:1",
        Layout::Yuv444 => "4:4:4",
        Layout::Gbr => "RGB",
    };
    let alpha = if format.alpha { " with alpha" } else { "" };
    format!("{width}×{height} px {layout} {} bit{alpha}", format.bits)
}

/// Clockwise rotation in degrees within (−180, 180] and mirroring of a display matrix.
pub(super) fn orientation(matrix: &[i32; 9]) -> (f64, bool) {
    let [a, b, c, d] = [0, 1, 3, 4].map(|i| f64::from(matrix[i]));
    let mirrored = a * d - b * c < 0.0;
    let degrees = if mirrored { (-b).atan2(-a) } else { b.atan2(a) }.to_degrees();
    ((degrees + 0.0 - if degrees <= -180.0 { -360.0 } else { 0.0 }), mirrored)
}

/// A chapter's span in seconds.
pub(super) fn chapter_span(c: &Chapter) -> (f64, f64) {
    let unit = c.time_base.value().unwrap_or(0.0);
    (c.start as f64 * unit, c.end as f64 * unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn display_matrices_of_the_four_rotations_are_read() {
        let one = 1 << 16;
        for (m, degrees) in [
            ([one, 0, 0, one], 0.0),
            ([0, one, -one, 0], 90.0),
            ([-one, 0, 0, -one], 180.0),
            ([0, -one, one, 0], -90.0),
        ] {
            let matrix = [m[0], m[1], 0, m[2], m[3], 0, 0, 0, 1 << 30];
            assert_eq!(orientation(&matrix), (degrees, false));
        }
        assert_eq!(orientation(&[-one, 0, 0, 0, one, 0, 0, 0, 1 << 30]), (0.0, true));
    }
}
