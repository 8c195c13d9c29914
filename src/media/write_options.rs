//! How to write a result, and what became of it.

use serde::Serialize;

/// Video codecs to write.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Codec {
    /// H.264 / AVC: plays everywhere.
    #[default]
    H264,
    /// H.265 / HEVC: smaller, 12 bit, HDR.
    Hevc,
    /// AV1: smallest, slow.
    Av1,
    /// Apple ProRes: large, for editing; 10 bit, alpha in 4444.
    Prores,
    /// FFV1: without loss, any depth, alpha.
    Ffv1,
}

impl Codec {
    /// All codecs, in the order in which they are offered.
    pub const ALL: [Self; 5] = [Self::H264, Self::Hevc, Self::Av1, Self::Prores, Self::Ffv1];

    /// The name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::H264 => "h264",
            Self::Hevc => "hevc",
            Self::Av1 => "av1",
            Self::Prores => "prores",
            Self::Ffv1 => "ffv1",
        }
    }
}

impl std::str::FromStr for Codec {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wanted = text.to_ascii_lowercase();
        let known = || Self::ALL.map(Self::name).join(", ");
        let found = Self::ALL.into_iter().find(|c| c.name() == wanted);
        found.ok_or_else(|| format!("unknown codec \"{text}\"; one of {}", known()))
    }
}

/// Options of [`super::VideoWriter::create`].
#[derive(Clone, Debug, Default)]
pub struct WriteOptions {
    /// Codec of the video.
    pub codec: Codec,
    /// An encoder of FFmpeg by its own name (`h264_nvenc`, `libaom-av1`) instead of the codec's usual one.
    pub encoder: Option<String>,
    /// Constant quality, in the codec's own scale (0 to 51, AV1 0 to 63); lower is better and larger. The default is 18
    /// for H.264, 20 for HEVC, 25 for AV1: no visible loss.
    pub crf: Option<f64>,
    /// Speed against size, by the names of x264 (`ultrafast` to `veryslow`); other encoders get their nearest setting.
    pub preset: Option<String>,
    /// Mean bit rate, bit/s, instead of constant quality.
    pub bitrate: Option<u64>,
    /// Threads of the encoder; 0: its own choice.
    pub threads: usize,
    /// Replace an existing target.
    pub overwrite: bool,
    /// Make an error of everything that would be lost: depth, chroma, alpha, streams.
    pub strict: bool,
}

/// What became of a result.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct WriteReport {
    /// Frames written.
    pub frames: u64,
    /// FFmpeg's name of the encoder.
    pub encoder: String,
    /// FFmpeg's name of the pixel format written.
    pub pixel_format: String,
    /// FFmpeg's name of the container.
    pub container: String,
    /// Packets of other streams that were copied.
    pub copied_packets: u64,
    /// What was lost or changed, in words, one sentence each.
    pub warnings: Vec<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_codec_is_found_by_its_name() {
        for codec in Codec::ALL {
            assert_eq!(codec.name().to_uppercase().parse(), Ok(codec));
        }
        let e = "xvid".parse::<Codec>().expect_err("unknown");
        assert_eq!(e, "unknown codec \"xvid\"; one of h264, hevc, av1, prores, ffv1");
    }
}
