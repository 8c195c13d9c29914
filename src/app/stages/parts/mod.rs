//! A long clip in parts, each the work of one task: its analysis windows, its motion, its cameras, its plan, its chunks, and their joining.
//!
//! | task | reads | writes to the folder of parts |
//! | --- | --- | --- |
//! | [`WindowsSettings`] | the frames of some analysis windows | the tracks of each window |
//! | [`MotionPartSettings`] | the tracks of all windows | motion in the picture; joined tracks, by chunk |
//! | [`CamerasPartSettings`], leading | the tracks of a chunk and behind it | cameras of the leading windows of its shots |
//! | [`CamerasPartSettings`], following | the same, and what the leading windows show | cameras of its other windows |
//! | [`PlanSettings`], behind [`KnownTracksSettings`] | motion, joined tracks, cameras | motion, path and models |
//! | [`ChunkSettings`] | the frames of a chunk, the plan, the tracks around it | their encoded pictures |
//! | [`PartJoiner`] | the encoded pictures of all chunks | the result itself, under its own name |
//!
//! No pipeline file has these kinds: `plumbline plan --split` makes them of a stabilization, and tasks alone run them.

mod cameras;
mod chunk;
mod chunks;
mod join;
mod motion;
mod plan;
mod windows;

use std::fs::File;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::context::Context;
use super::video_decode::DecodeSettings;
use crate::pipeline::kind::StageKind;
use crate::pipeline::paths::{to_path, to_text};
use crate::pipeline::run_error::RunError;
use plumbline_media::{FrameSpan, Input, ReadOptions, VideoReader};
use plumbline_num::files::open_regular;
use plumbline_video::motion::{ClipMotion, MotionFileError};
use plumbline_video::stabilize::Tracks;
use plumbline_video::track::{WindowFileError, WindowTracks};

pub(crate) use cameras::CamerasPartSettings;
pub(crate) use chunk::ChunkSettings;
pub(crate) use chunks::{Chunks, MAX_CHUNKS};
pub(crate) use join::{ClipParts, PartJoiner};
pub(crate) use motion::MotionPartSettings;
pub(crate) use plan::{KnownTracksSettings, PlanSettings};
pub(crate) use windows::WindowsSettings;

/// The kinds of parts.
pub(crate) static PART_KINDS: [StageKind; 6] = [
    StageKind::of::<WindowsSettings>(),
    StageKind::of::<MotionPartSettings>(),
    StageKind::of::<CamerasPartSettings>(),
    StageKind::of::<KnownTracksSettings>(),
    StageKind::of::<PlanSettings>(),
    StageKind::of::<ChunkSettings>(),
];

/// A file of a folder of parts.
#[derive(Clone, Copy, Debug)]
pub(crate) enum PartName {
    /// Tracks of an analysis window.
    Window(usize),
    /// Motion of the clip in the picture.
    Planar,
    /// Joined tracks of the frames of a chunk.
    Tracks(usize),
    /// Cameras of the leading windows of the shots that start in a chunk.
    Leading(usize),
    /// Cameras of the other windows that start in a chunk.
    Cameras(usize),
    /// Motion of the clip, with its cameras.
    Motion,
    /// Path and models of the clip.
    Plan,
    /// Encoded pictures of a chunk.
    Chunk(usize),
    /// The motion file that the pipeline asks for.
    Export,
    /// The clip is cut short, as the task of its last chunk found: empty.
    CutShort,
}

impl PartName {
    /// Its path in `folder`.
    pub(crate) fn in_folder(self, folder: &str) -> PathBuf {
        let name = match self {
            Self::Window(window) => format!("{window:05}.window"),
            Self::Planar => "planar.json".to_owned(),
            Self::Tracks(chunk) => format!("{chunk:05}.tracks"),
            Self::Leading(chunk) => format!("{chunk:05}.leading.json"),
            Self::Cameras(chunk) => format!("{chunk:05}.cameras.json"),
            Self::Motion => "motion.json".to_owned(),
            Self::Plan => "plan.json".to_owned(),
            Self::Chunk(chunk) => format!("{chunk:05}.part"),
            Self::Export => "export.json".to_owned(),
            Self::CutShort => "cut-short".to_owned(),
        };
        to_path(folder).join(name)
    }

    /// The same as the text of a setting.
    pub(crate) fn text(self, folder: &str) -> String {
        to_text(self.in_folder(folder))
    }
}

/// Opens a file that another task made. That it is not there may pass: a folder of another machine may show it later, or the task may be
/// run again.
fn made_before(path: &Path) -> Result<File, RunError> {
    let absent = |e| {
        let help = "the task that makes it comes first";
        RunError::Temporary(format!("{}: no part of the clip is there: {e}; {help}", path.display()))
    };
    open_regular(path).map_err(absent)
}

/// The tracks of a file of another task.
fn read_tracks(path: &Path) -> Result<WindowTracks, RunError> {
    let damaged = |e: WindowFileError| RunError::Input(format!("{}: {e}", path.display()));
    WindowTracks::read(made_before(path)?).map_err(damaged)
}

/// The motion of a file of another task.
fn read_motion(path: &Path) -> Result<ClipMotion, RunError> {
    let (motion, _) = ClipMotion::read_json(made_before(path)?).map_err(|e| RunError::Input(e.to_string()))?;
    Ok(motion)
}

/// The motion as a file without points, of which the same motion is read.
fn exact_text(motion: &ClipMotion) -> Result<Vec<u8>, RunError> {
    let mut text = Vec::new();
    let fault = |e: MotionFileError| RunError::Internal(e.to_string());
    motion.write_json(&mut text).map_err(fault)?;
    let again = ClipMotion::from_json(&text).map_err(fault)?;
    if again == *motion { Ok(text) } else { Err(inexact("the motion of the clip is")) }
}

/// What is not read back as it was written would make the parts differ from the whole.
fn inexact(what: &str) -> RunError {
    RunError::Internal(format!("{what} not read back as it was written; stabilize the clip as a whole"))
}

impl Context<'_, '_> {
    /// The tracks in `frames` of the clip of `motion`, and in all frames of chunks that have one of these.
    fn joined_tracks(
        &self,
        folder: &str,
        chunks: Chunks,
        frames: &Range<usize>,
        motion: &ClipMotion,
    ) -> Result<Tracks, RunError> {
        let part = |chunk| {
            self.job.check_cancel()?;
            read_tracks(&PartName::Tracks(chunk).in_folder(folder))
        };
        Tracks::of_parts(chunks.overlapping(frames).map(part), motion)
    }

    /// Opens some frames of the clip of a `video.decode` stage.
    fn open_span(&mut self, decode: usize, span: &FrameSpan) -> Result<(Input, VideoReader), RunError> {
        let input = self.input(decode)?;
        let settings = self.stage(decode).settings.get::<DecodeSettings>();
        let deinterlace = settings.map(|s| s.deinterlace).unwrap_or_default();
        let options = ReadOptions { threads: self.job.threads, deinterlace, strict: self.job.strict };
        let reader = VideoReader::open_span(&input, &options, span)?;
        Ok((input, reader))
    }
}
