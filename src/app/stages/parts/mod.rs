//! A long clip in parts, each the work of one task: its analysis windows, its plan, its chunks, and their joining.
//!
//! | task | reads | writes to the folder of parts |
//! | --- | --- | --- |
//! | [`WindowsSettings`] | the frames of some analysis windows | the tracks of each window |
//! | [`PlanSettings`], behind [`JoinWindowsSettings`] | the tracks of all windows | motion, path and models; the tracks of each chunk |
//! | [`ChunkSettings`] | the frames of a chunk, and its part of the plan | their encoded pictures |
//! | [`PartJoiner`] | the encoded pictures of all chunks | the result itself, under its own name |
//!
//! No pipeline file has these kinds: `plumbline plan --split` makes them of a stabilization, and tasks alone run them.

mod chunk;
mod join;
mod plan;
mod windows;

use std::fs::File;
use std::path::{Path, PathBuf};

use super::context::Context;
use super::video_decode::DecodeSettings;
use crate::pipeline::kind::StageKind;
use crate::pipeline::paths::{to_path, to_text};
use crate::pipeline::run_error::RunError;
use plumbline_media::{FrameSpan, Input, ReadOptions, VideoReader};
use plumbline_num::files::open_regular;

pub(crate) use chunk::ChunkSettings;
pub(crate) use join::{ClipParts, PartJoiner};
pub(crate) use plan::{JoinWindowsSettings, PlanSettings};
pub(crate) use windows::WindowsSettings;

/// The kinds of parts.
pub(crate) static PART_KINDS: [StageKind; 4] = [
    StageKind::of::<WindowsSettings>(),
    StageKind::of::<JoinWindowsSettings>(),
    StageKind::of::<PlanSettings>(),
    StageKind::of::<ChunkSettings>(),
];

/// A file of a folder of parts.
#[derive(Clone, Copy, Debug)]
pub(crate) enum PartName {
    /// Tracks of an analysis window.
    Window(usize),
    /// Motion of the clip.
    Motion,
    /// Path and models of the clip.
    Plan,
    /// Tracks that a chunk takes.
    Tracks(usize),
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
            Self::Motion => "motion.json".to_owned(),
            Self::Plan => "plan.json".to_owned(),
            Self::Tracks(chunk) => format!("{chunk:05}.tracks"),
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

impl Context<'_, '_> {
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
