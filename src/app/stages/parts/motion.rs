//! The motion of a clip in the picture, from the tracks of its analysis windows.

use super::{Chunks, PartName, exact_text, read_tracks};
use crate::pipeline::paths::unescaped;
use crate::stages::context::changed;
use crate::stages::prelude::*;
use crate::stages::video_track::{TrackSettings, clip_info};
use plumbline_video::stabilize::WindowJoiner;
use plumbline_video::track::AnalysisWindows;

/// Settings of the joining of analysis windows.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct MotionPartSettings {
    /// The folder of parts
    #[schemars(extend("format" = "path"))]
    pub(crate) folder: String,
    /// Chunks that tracks are written for
    pub(crate) chunks: Chunks,
    /// How points were tracked
    pub(crate) track: TrackSettings,
}

impl Stage for MotionPartSettings {
    const KIND: &'static str = "part.motion";
    const SUMMARY: &'static str = "joins the tracks of the analysis windows of a clip and measures its motion";
    const INPUTS: &'static [Port] = &[Port::one("frames", PortType::Frames, "the clip")];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the motion")];
    type Input = Wired;
    type Output = HandedOn;

    fn memory(&self) -> Vec<MemoryCost> {
        self.track.memory()
    }

    fn writes(&self) -> Vec<String> {
        let tracks = (0..self.chunks.count).map(PartName::Tracks);
        [PartName::Planar].into_iter().chain(tracks).map(|name| name.text(&self.folder)).collect()
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        let decode = context.required(stage, "frames")?.from;
        let (input, reader) = context.open(decode)?;
        let info = clip_info(reader.info());
        drop(reader);
        let options = TrackSettings { mask: self.track.mask.as_deref().map(unescaped), ..self.track.clone() };
        let windows = AnalysisWindows::default();
        let mut joiner = WindowJoiner::new(&info, &options, windows, None)?;
        for window in 0..windows.count(self.chunks.frames) {
            context.job.check_cancel()?;
            let path = PartName::Window(window).in_folder(&self.folder);
            let tracks = read_tracks(&path)?;
            if tracks.window != window {
                return Err(RunError::Input(format!("{}: the tracks of window {}", path.display(), tracks.window)));
            }
            joiner.push(tracks)?;
        }
        let (motion, tracks) = joiner.finish()?;
        let (expected, found) = (self.chunks.frames, motion.frames.len());
        if found != expected {
            return Err(changed(input.name(), &format!("{expected} frames, then {found}")));
        }
        context.write_file(&PartName::Planar.in_folder(&self.folder), exact_text(&motion)?)?;
        for (chunk, frames) in self.chunks.ranges().enumerate() {
            context.job.check_cancel()?;
            let part = tracks.part(frames)?;
            context.fill_file(&PartName::Tracks(chunk).in_folder(&self.folder), |out| part.write(out))?;
        }
        context.summary.frames = found as u64;
        Ok(HandedOn)
    }
}
