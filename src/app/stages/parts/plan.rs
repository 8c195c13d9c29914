//! The plan of a clip from the tracks of its analysis windows.

use std::ops::Range;

use super::{PartName, made_before};
use crate::pipeline::paths::unescaped;
use crate::stages::WarpSettings;
use crate::stages::context::changed;
use crate::stages::prelude::*;
use crate::stages::video_track::{TrackSettings, clip_info, focal_px_of, hand_on_to_all};
use plumbline_video::motion::{ClipMotion, MotionFileError};
use plumbline_video::path::VirtualPath;
use plumbline_video::stabilize::{
    FrameMaps, PlanFile, PlanSummary, RenderInputs, StabilizeError, Tracks, WindowJoiner, select_models,
};
use plumbline_video::track::{AnalysisWindows, WindowFileError, WindowTracks};

/// Settings of the joining of analysis windows, which stands for their tracking.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct JoinWindowsSettings {
    /// The folder of parts
    #[schemars(extend("format" = "path"))]
    pub(crate) folder: String,
    /// Frames of the clip
    pub(crate) frames: usize,
    /// How points were tracked
    pub(crate) track: TrackSettings,
}

impl Stage for JoinWindowsSettings {
    const KIND: &'static str = "part.join_windows";
    const SUMMARY: &'static str = "joins the tracks of the analysis windows of a clip";
    const INPUTS: &'static [Port] = TrackSettings::INPUTS;
    const OUTPUTS: &'static [Port] = TrackSettings::OUTPUTS;
    type Input = Wired;
    type Output = HandedOn;

    fn memory(&self) -> Vec<MemoryCost> {
        self.track.memory()
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        let decode = context.required(stage, "frames")?.from;
        let (input, reader) = context.open(decode)?;
        let info = clip_info(reader.info());
        drop(reader);
        let options = TrackSettings { mask: self.track.mask.as_deref().map(unescaped), ..self.track.clone() };
        let windows = AnalysisWindows::default();
        let mut joiner = WindowJoiner::new(&info, &options, windows, None)?;
        for window in 0..windows.count(self.frames) {
            context.job.check_cancel()?;
            let path = PartName::Window(window).in_folder(&self.folder);
            let damaged = |e: WindowFileError| RunError::Input(format!("{}: {e}", path.display()));
            let tracks = WindowTracks::read(made_before(&path)?).map_err(damaged)?;
            if tracks.window != window {
                return Err(RunError::Input(format!("{}: the tracks of window {}", path.display(), tracks.window)));
            }
            joiner.push(tracks)?;
        }
        let (motion, tracks) = joiner.finish()?;
        if motion.frames.len() != self.frames {
            return Err(changed(input.name(), &format!("{} frames, then {}", self.frames, motion.frames.len())));
        }
        hand_on_to_all(context, stage, &motion, &tracks, || focal_px_of(&input))?;
        context.values.put(stage, "tracks", tracks);
        Ok(HandedOn)
    }
}

/// Settings of the plan of a clip that is rendered in chunks.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct PlanSettings {
    /// The folder of parts
    #[schemars(extend("format" = "path"))]
    pub(crate) folder: String,
    /// Frames of each chunk
    pub(crate) chunks: Vec<Range<usize>>,
    /// How frames are warped
    pub(crate) warp: WarpSettings,
    /// The source must cover the output
    pub(crate) covered: bool,
}

impl Stage for PlanSettings {
    const KIND: &'static str = "part.plan";
    const SUMMARY: &'static str = "writes the plan of a clip for the rendering of its chunks";
    const INPUTS: &'static [Port] = WarpSettings::INPUTS;
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the plan")];
    type Input = Wired;
    type Output = HandedOn;

    fn memory(&self) -> Vec<MemoryCost> {
        self.warp.memory()
    }

    fn writes(&self) -> Vec<String> {
        let chunks = (0..self.chunks.len()).map(PartName::Tracks);
        [PartName::Motion, PartName::Plan].into_iter().chain(chunks).map(|name| name.text(&self.folder)).collect()
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        let tracks: &Tracks = context.values.get(context.required(stage, "tracks")?)?;
        let path: &VirtualPath = context.values.get(context.required(stage, "path")?)?;
        let motion: &ClipMotion = context.values.get(context.required(stage, "motion")?)?;
        let inputs = RenderInputs { tracks, path, motion: Some(motion), warp: &self.warp, covered: self.covered };
        let frames = motion.frames.len();
        if let Some(chunk) = self.chunks.iter().find(|chunk| chunk.start >= chunk.end || chunk.end > frames) {
            return Err(RunError::Input(format!("frames {chunk:?} of a clip of {frames}: make the plan again")));
        }
        let models = select_models(&inputs, &context.job.run())?;
        let summary = PlanSummary::of(Some(motion), path, &models);
        let motion_text = exact(motion)?;
        let plan_text = PlanFile::new(path, &models)?.to_json()?;
        let maps = FrameMaps::new(&inputs, &models)?;
        let taken = |chunk: &Range<usize>| tracks.background(maps.support(chunk.clone())?);
        let taken = self.chunks.iter().map(taken).collect::<Result<Vec<_>, StabilizeError>>()?;
        context.write_file(&PartName::Motion.in_folder(&self.folder), motion_text)?;
        context.write_file(&PartName::Plan.in_folder(&self.folder), plan_text)?;
        for (chunk, tracks) in taken.iter().enumerate() {
            context.fill_file(&PartName::Tracks(chunk).in_folder(&self.folder), |out| tracks.write(out))?;
        }
        crate::stages::clip::summary::report_plan(context.summary, summary);
        Ok(HandedOn)
    }
}

/// The motion as a file without points, of which the same motion is read.
fn exact(motion: &ClipMotion) -> Result<Vec<u8>, RunError> {
    let mut text = Vec::new();
    let fault = |e: MotionFileError| RunError::Internal(e.to_string());
    motion.write_json(&mut text).map_err(fault)?;
    let read = ClipMotion::from_json(&text).map_err(fault)?;
    if read == *motion {
        return Ok(text);
    }
    let help = "stabilize the clip as a whole";
    Err(RunError::Internal(format!("the motion of the clip is not read back as it was written; {help}")))
}
