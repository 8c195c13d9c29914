//! What a media file holds: every stream, chapter and tag, without decoding a frame.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

use super::av::{Demuxer, Kind, StreamRef};
use super::focal::{self, focal_px};
use super::info::{FieldOrder, Ratio, chapter_span, orientation};
use super::{Input, MediaError};

/// A media file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MediaInfo {
    /// The input as given.
    pub path: String,
    /// FFmpeg's short names of the container, separated by commas.
    pub container: String,
    /// The container in words.
    pub container_name: String,
    /// First presentation time, s.
    pub start_s: Option<f64>,
    /// Length, s.
    pub duration_s: Option<f64>,
    /// Mean rate of the whole file, bit/s.
    pub bit_rate: Option<u64>,
    /// Index of the stream that would be processed; `None` where there is no video.
    pub video: Option<usize>,
    /// Focal length in the container's metadata, mm in 35-mm terms.
    pub focal_35mm: Option<f64>,
    /// All streams, in the container's order.
    pub streams: Vec<StreamInfo>,
    /// All chapters.
    pub chapters: Vec<ChapterInfo>,
    /// Tags of the whole file.
    pub tags: BTreeMap<String, String>,
}

/// One stream.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StreamInfo {
    /// Index in the container.
    pub index: usize,
    /// Short name of the codec.
    pub codec: String,
    /// Seconds per tick of its timestamps.
    pub timebase: Option<Ratio>,
    /// First presentation time, s.
    pub start_s: Option<f64>,
    /// Length, s.
    pub duration_s: Option<f64>,
    /// Mean rate, bit/s.
    pub bit_rate: Option<u64>,
    /// Players choose it unless told otherwise.
    pub default: bool,
    /// What only this kind of stream has.
    #[serde(flatten)]
    pub kind: StreamKind,
    /// Tags of the stream.
    pub tags: BTreeMap<String, String>,
}

/// What a stream carries.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
#[non_exhaustive]
pub enum StreamKind {
    /// Moving pictures.
    Video(VideoSummary),
    /// A cover or thumbnail.
    Picture,
    /// Sound.
    Audio {
        /// Samples per second.
        sample_rate: u32,
        /// Channels.
        channels: u32,
    },
    /// Subtitles.
    Subtitle {
        /// Text that can be converted, as opposed to pictures.
        text: bool,
    },
    /// Timecode, positions and the like.
    Data,
    /// A file inside the file.
    Attachment,
    /// Something else.
    Unknown,
}

/// Headers of a video stream.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VideoSummary {
    /// Coded width, px.
    pub width: u32,
    /// Coded height, px.
    pub height: u32,
    /// FFmpeg's name of the pixel format.
    pub pixel_format: Option<String>,
    /// Mean frame rate, 1/s.
    pub frame_rate: Option<Ratio>,
    /// Smallest rate in which all frame times are whole: differs from the mean where the rate varies.
    pub base_rate: Option<Ratio>,
    /// Number of frames, if known from the container.
    pub frames: Option<u64>,
    /// Width over height of a pixel.
    pub sample_aspect: Option<Ratio>,
    /// Clockwise rotation that a player applies, degrees.
    pub rotation_deg: f64,
    /// The player mirrors the picture as well.
    pub mirrored: bool,
    /// What the headers say of fields.
    pub field_order: FieldOrder,
    /// Full (`true`) or limited (`false`) range.
    pub full_range: Option<bool>,
    /// H.273 codes of primaries, transfer and matrix; 2 is unspecified.
    pub color: [u8; 3],
    /// The container has mastering display or content light data.
    pub hdr_metadata: bool,
}

/// A named span.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChapterInfo {
    /// Start, s.
    pub start_s: f64,
    /// End, s.
    pub end_s: f64,
    /// The title, where there is one.
    pub title: Option<String>,
}

/// Reads the headers of `input`. Files without video are described like any others.
///
/// # Errors
/// [`MediaError::NotMedia`], [`MediaError::Input`]; [`MediaError::Usage`] where a stream was chosen that is not there.
pub fn probe(input: &Input) -> Result<MediaInfo, MediaError> {
    let demuxer = input.demux()?;
    let seconds = |us: i64| us as f64 * 1e-6;
    let chapter = |c| {
        let (start_s, end_s) = chapter_span(&c);
        ChapterInfo { start_s, end_s, title: c.metadata.into_iter().find(|(k, _)| k == "title").map(|(_, v)| v) }
    };
    let streams: Vec<StreamInfo> = demuxer.streams().enumerate().map(|(i, s)| stream_info(i, s)).collect();
    let tags: BTreeMap<String, String> = demuxer.metadata().into_iter().collect();
    let told = focal::of_tags(tags.iter().chain(streams.iter().flat_map(|s| &s.tags)));
    let quicktime = demuxer.format_name().split(',').any(|name| name == "mov");
    Ok(MediaInfo {
        path: input.name().to_owned(),
        container: demuxer.format_name(),
        container_name: demuxer.format_long_name(),
        start_s: demuxer.start_us().map(seconds),
        duration_s: demuxer.duration_us().map(seconds),
        bit_rate: demuxer.bit_rate(),
        video: input.video_of(&demuxer)?,
        focal_35mm: told.or_else(|| quicktime.then(|| input.file().ok().and_then(focal::of_tracks)).flatten()),
        streams,
        chapters: demuxer.chapters().into_iter().map(chapter).collect(),
        tags,
    })
}

impl MediaInfo {
    /// Focal length in the container's metadata, px of the coded picture.
    pub fn focal_px(&self) -> Option<f64> {
        let StreamKind::Video(video) = &self.streams.get(self.video?)?.kind else { return None };
        self.focal_35mm.map(|mm| focal_px(mm, video.width as usize, video.height as usize))
    }
}

fn stream_info(index: usize, stream: StreamRef<'_>) -> StreamInfo {
    let base = stream.time_base();
    let seconds = |ticks: i64| base.value().map(|unit| ticks as f64 * unit);
    let kind = match stream.kind() {
        Kind::Video if stream.is_attached_picture() => StreamKind::Picture,
        Kind::Video => StreamKind::Video(video_summary(stream)),
        Kind::Audio => {
            let (rate, channels) = (stream.sample_rate(), stream.channels());
            StreamKind::Audio { sample_rate: rate.max(0) as u32, channels: channels.max(0) as u32 }
        }
        Kind::Subtitle => StreamKind::Subtitle { text: stream.is_text_subtitle() },
        Kind::Data => StreamKind::Data,
        Kind::Attachment => StreamKind::Attachment,
        Kind::Other => StreamKind::Unknown,
    };
    StreamInfo {
        index,
        codec: stream.codec_name(),
        timebase: Ratio::known(base),
        start_s: stream.start().and_then(seconds),
        duration_s: stream.duration().and_then(seconds),
        bit_rate: stream.bit_rate(),
        default: stream.is_default(),
        kind,
        tags: stream.metadata().into_iter().collect(),
    }
}

fn video_summary(stream: StreamRef<'_>) -> VideoSummary {
    let (width, height) = stream.size();
    let (rotation_deg, mirrored) = stream.display_matrix().map_or((0.0, false), |m| orientation(&m));
    let (primaries, transfer, matrix, full_range) = stream.color();
    VideoSummary {
        width: width.max(0) as u32,
        height: height.max(0) as u32,
        pixel_format: stream.pixel_format(),
        frame_rate: Ratio::known(stream.average_rate()),
        base_rate: Ratio::known(stream.base_rate()),
        frames: stream.frames(),
        sample_aspect: Ratio::known(stream.sample_aspect()),
        rotation_deg,
        mirrored,
        field_order: FieldOrder::from_top_first(stream.declared_field_order()),
        full_range,
        color: [primaries, transfer, matrix],
        hdr_metadata: stream.has_hdr_metadata(),
    }
}

impl fmt::Display for MediaInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.path, self.container_name)?;
        if let Some(d) = self.duration_s {
            write!(f, ", {d:.3} s")?;
        }
        if let Some(rate) = self.bit_rate {
            write!(f, ", {} kbit/s", rate / 1000)?;
        }
        for stream in &self.streams {
            let mark = if self.video == Some(stream.index) { "*" } else { " " };
            write!(f, "\n {mark}{}: {stream}", stream.index)?;
        }
        for c in &self.chapters {
            let title = c.title.as_deref().unwrap_or("untitled");
            write!(f, "\n  chapter {:.3} to {:.3} s: {title}", c.start_s, c.end_s)?;
        }
        if let Some((mm, px)) = self.focal_35mm.zip(self.focal_px()) {
            write!(f, "\n  focal length {mm} mm in 35-mm terms, {px:.0} px")?;
        }
        self.tags.iter().try_for_each(|(k, v)| write!(f, "\n  {k} = {v}"))
    }
}

impl fmt::Display for StreamInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.kind {
            StreamKind::Video(v) => write!(f, "video {} {v}", self.codec)?,
            StreamKind::Picture => write!(f, "attached picture {}", self.codec)?,
            StreamKind::Audio { sample_rate, channels } => {
                write!(f, "audio {} {sample_rate} Hz, {channels} channels", self.codec)?;
            }
            StreamKind::Subtitle { text } => {
                write!(f, "subtitle {} ({})", self.codec, if *text { "text" } else { "pictures" })?;
            }
            StreamKind::Data => write!(f, "data {}", self.codec)?,
            StreamKind::Attachment => write!(f, "attachment {}", self.codec)?,
            StreamKind::Unknown => write!(f, "unknown {}", self.codec)?,
        }
        self.tags.get("language").filter(|l| *l != "und").map_or(Ok(()), |l| write!(f, ", {l}"))
    }
}

impl fmt::Display for VideoSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}×{} px {}", self.width, self.height, self.pixel_format.as_deref().unwrap_or("unknown"))?;
        if let Some(rate) = self.frame_rate {
            write!(f, ", {:.3} fps", rate.value())?;
        }
        if let Some(n) = self.frames {
            write!(f, ", {n} frames")?;
        }
        if self.rotation_deg != 0.0 || self.mirrored {
            write!(f, ", turned by {}°{}", self.rotation_deg, if self.mirrored { " and mirrored" } else { "" })?;
        }
        if let Some(aspect) = self.sample_aspect.filter(|a| a.num != a.den) {
            write!(f, ", pixel aspect {aspect}")?;
        }
        if self.field_order == FieldOrder::Progressive { Ok(()) } else { f.write_str(", interlaced") }
    }
}

/// Kinds of the streams in words, as in "audio, subtitle".
pub(super) fn kinds(demuxer: &Demuxer) -> String {
    let names: Vec<_> = demuxer.streams().map(kind_name).collect();
    if names.is_empty() { "nothing".into() } else { names.join(", ") }
}

/// A stream's kind in words.
pub(super) fn kind_name(stream: StreamRef<'_>) -> &'static str {
    match stream.kind() {
        Kind::Video if stream.is_attached_picture() => "attached picture",
        Kind::Video => "video",
        Kind::Audio => "audio",
        Kind::Subtitle => "subtitle",
        Kind::Data => "data",
        Kind::Attachment => "attachment",
        Kind::Other => "unknown",
    }
}
