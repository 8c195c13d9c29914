//! Options for writing a clip, and a report.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::Input;

/// How the pictures are coded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Codec {
    /// H.264: plays everywhere
    #[default]
    H264,
    /// H.265: smaller, slower
    #[serde(alias = "h265")]
    Hevc,
    /// AV1: smallest, slowest
    Av1,
    /// Apple ProRes 422: large, for editing
    Prores,
    /// FFV1: lossless
    Ffv1,
}

impl Codec {
    /// All codecs, in the order in which they are offered.
    pub const ALL: [Self; 5] = [Self::H264, Self::Hevc, Self::Av1, Self::Prores, Self::Ffv1];

    /// The name in files and options.
    pub const fn name(self) -> &'static str {
        match self {
            Self::H264 => "h264",
            Self::Hevc => "hevc",
            Self::Av1 => "av1",
            Self::Prores => "prores",
            Self::Ffv1 => "ffv1",
        }
    }

    /// The worst constant quality on the codec's scale, which begins at 0; `None` where it has no such setting.
    pub const fn crf_max(self) -> Option<f64> {
        match self {
            Self::H264 | Self::Hevc => Some(51.0),
            Self::Av1 => Some(63.0),
            Self::Prores | Self::Ffv1 => None,
        }
    }
}

/// Which encoder of a codec.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum EncoderChoice {
    /// The usual one that runs on the processor.
    #[default]
    Software,
    /// One that runs on a device, where one opens and loses nothing; else in software.
    Auto,
    /// One that runs on a device.
    Hardware,
    /// The one of this name in FFmpeg (`h264_nvenc`, `libaom-av1`).
    Named(String),
}

impl FromStr for EncoderChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let named = !text.is_empty() && text.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_' || b == b'-');
        match text {
            "software" => Ok(Self::Software),
            "auto" => Ok(Self::Auto),
            "hardware" => Ok(Self::Hardware),
            _ if named => Ok(Self::Named(text.to_owned())),
            _ => Err(format!("`{text}` is no encoder (expected software, auto, hardware, or FFmpeg's name of one)")),
        }
    }
}

impl fmt::Display for EncoderChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Software => "software",
            Self::Auto => "auto",
            Self::Hardware => "hardware",
            Self::Named(name) => name,
        })
    }
}

impl Serialize for EncoderChoice {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        s.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for EncoderChoice {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        String::deserialize(d)?.parse().map_err(serde::de::Error::custom)
    }
}

#[cfg(feature = "schema")]
impl schemars::JsonSchema for EncoderChoice {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "EncoderChoice".into()
    }
    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({"type": "string", "pattern": "^[A-Za-z0-9_-]+$"})
    }
}

/// Where everything beside the pictures comes from: audio, subtitles, data, chapters and tags.
#[derive(Clone, Debug, Default)]
pub enum PassthroughStreams {
    /// The clip that the pictures come from.
    #[default]
    OfSource,
    /// Another clip.
    Of(Input),
    /// Nowhere: the file holds the pictures alone.
    None,
}

/// Options of [`super::VideoWriter::create`].
#[derive(Clone, Debug, Default)]
pub struct WriteOptions {
    /// Codec of the video.
    pub codec: Codec,
    /// Which of the codec's encoders.
    pub encoder: EncoderChoice,
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
    /// Where everything beside the pictures comes from.
    pub passthrough: PassthroughStreams,
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
    /// Further video streams of the source that were copied as they are, in words.
    pub copied_videos: Vec<String>,
    /// What was lost or changed, in words, one sentence each.
    pub warnings: Vec<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_codec_reads_its_own_name() {
        for codec in Codec::ALL {
            assert_eq!(serde_json::from_value::<Codec>(codec.name().into()).expect("a codec"), codec);
            assert_eq!(serde_json::to_value(codec).expect("JSON"), codec.name());
        }
        assert_eq!(serde_json::from_value::<Codec>("h265".into()).expect("another name"), Codec::Hevc);
    }

    #[test]
    fn an_encoder_choice_is_written_as_it_is_read() {
        for text in ["software", "auto", "hardware", "h264_nvenc", "libaom-av1"] {
            assert_eq!(text.parse::<EncoderChoice>().map(|w| w.to_string()), Ok(text.to_owned()));
        }
        assert!("".parse::<EncoderChoice>().is_err() && "a b".parse::<EncoderChoice>().is_err());
    }
}
