//! The plan of a clip from its tracks, its motion and its cameras, as other tasks found them.

use super::cameras::joined_cameras;
use super::{Chunks, PartName, exact_text, read_motion};
use crate::stages::prelude::*;
use crate::stages::video_track::{TrackSettings, hand_on_to_all};
use crate::stages::{MotionSettings, WarpSettings};
use plumbline_video::motion::ClipMotion;
use plumbline_video::path::VirtualPath;
use plumbline_video::stabilize::{PlanFile, PlanSummary, RenderInputs, Tracks, select_models};

/// Settings of the reading of tracks, motion and cameras, which stands for the tracking.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct KnownTracksSettings {
    /// The folder of parts
    #[schemars(extend("format" = "path"))]
    pub(crate) folder: String,
    /// The chunks of the clip
    pub(crate) chunks: Chunks,
    /// How points were tracked
    pub(crate) track: TrackSettings,
    /// How motion is estimated, where its cameras are known
    pub(crate) cameras: Option<MotionSettings>,
}

impl Stage for KnownTracksSettings {
    const KIND: &'static str = "part.tracks";
    const SUMMARY: &'static str = "reads the tracks and the motion of a clip, and its cameras";
    const INPUTS: &'static [Port] = TrackSettings::INPUTS;
    const OUTPUTS: &'static [Port] = TrackSettings::OUTPUTS;
    type Input = Wired;
    type Output = HandedOn;

    fn memory(&self) -> Vec<MemoryCost> {
        self.track.memory()
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        let mut motion = read_motion(&PartName::Planar.in_folder(&self.folder))?;
        let tracks = context.joined_tracks(&self.folder, self.chunks, &(0..motion.frames.len()), &motion)?;
        if let Some(settings) = &self.cameras {
            motion.cameras = Some(joined_cameras(&self.folder, self.chunks, &motion, settings)?);
        }
        hand_on_to_all(context, stage, &motion, &tracks, || None)?;
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
        [PartName::Motion, PartName::Plan].map(|name| name.text(&self.folder)).into()
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        let tracks: &Tracks = context.values.get(context.required(stage, "tracks")?)?;
        let path: &VirtualPath = context.values.get(context.required(stage, "path")?)?;
        let motion: &ClipMotion = context.values.get(context.required(stage, "motion")?)?;
        let inputs = RenderInputs { tracks, path, motion: Some(motion), warp: &self.warp, covered: self.covered };
        let models = select_models(&inputs, &context.job.run())?;
        let summary = PlanSummary::of(Some(motion), path, &models);
        let motion_text = exact_text(motion)?;
        let plan_text = PlanFile::new(path, &models)?.to_json()?;
        context.write_file(&PartName::Motion.in_folder(&self.folder), motion_text)?;
        context.write_file(&PartName::Plan.in_folder(&self.folder), plan_text)?;
        crate::stages::clip::summary::report_plan(context.summary, summary);
        Ok(HandedOn)
    }
}
