//! The contents of a file, for `plumbline probe` and for the memory estimates of a plan.

use std::path::Path;

use super::context::open_input;
use super::video_decode::DecodeSettings;
use crate::pipeline::job::Probed;
use crate::pipeline::memory::ClipShape;
use crate::pipeline::run_error::RunError;
use plumbline_media::{Input, MediaInfo, ReadOptions, StreamKind, VideoReader};
use plumbline_num::run::Interrupt;
use plumbline_num::time::Timestamp;

/// Looks into `input`.
pub(crate) fn probe(input: &Path, playlists: bool) -> Result<Probed, RunError> {
    let input = match input.to_str() {
        Some(text) => open_input(text, &Interrupt::default())?,
        None => Input::parse(input)?,
    };
    let input = input.allowing_playlists(playlists);
    let info = plumbline_media::probe(&input)?;
    let shape = info.video.is_some().then(|| shape(&input, &info)).transpose()?;
    let json = serde_json::to_value(&info).map_err(|e| RunError::Internal(format!("probe: {e}")))?;
    Ok(Probed { text: info.to_string(), json, shape })
}

/// Length of a clip, s, where its container states it.
pub(crate) fn seconds(input: &Path) -> Result<Option<f64>, RunError> {
    Ok(plumbline_media::probe(&Input::parse(input)?)?.duration_s)
}

/// Times of the frames of a clip, by its packets.
pub(crate) fn frame_times(input: &Path, settings: &DecodeSettings) -> Result<Vec<Timestamp>, RunError> {
    let input = Input::parse(input)?.with_stream(settings.stream.map(|n| n as usize));
    Ok(plumbline_media::frame_times(&input)?)
}

/// What memory depends on, from the decoder itself.
fn shape(input: &Input, media: &MediaInfo) -> Result<ClipShape, RunError> {
    let reader = VideoReader::open(input, &ReadOptions::default())?;
    let info = reader.info();
    let samples = |i| {
        let (width, height) = info.format.plane_size(i, info.width, info.height);
        (width * height * info.format.bytes_per_sample()) as u64
    };
    Ok(ClipShape {
        width: info.width as u32,
        height: info.height as u32,
        frame_bytes: (0..info.format.planes()).map(samples).sum(),
        frames: info.frames_estimate.or_else(|| frames_of(media)),
    })
}

/// Frames by length and rate, for containers that do not count them, such as Matroska.
fn frames_of(media: &MediaInfo) -> Option<u64> {
    let stream = media.streams.iter().find(|stream| Some(stream.index) == media.video)?;
    let StreamKind::Video(video) = &stream.kind else { return None };
    let seconds = stream.duration_s.or(media.duration_s)?;
    let rate = video.frame_rate.or(video.base_rate)?.value();
    Some((seconds * rate).ceil()).filter(|frames| frames.is_finite() && *frames >= 0.0).map(|frames| frames as u64)
}
