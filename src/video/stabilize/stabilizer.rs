//! The whole method in three calls: analyze, plan, map.

use std::path::Path;
use std::sync::Arc;

use super::camera_recovery::complete_motion;
use super::error::StabilizeError;
use super::frame_maps::{FrameMaps, RenderInputs};
use super::frame_models::FrameModels;
use super::import::{ImportedModels, MotionFile};
use super::model_selection::select_models;
use super::options::{StabilizerOptions, WarpOptions};
use super::path_planning::plan_path;
use super::source::{ClipInfo, FrameSource};
use super::summary::PlanSummary;
use super::tracking::{ClipTracker, WindowJoiner, WindowTracker};
use super::tracks::Tracks;
use crate::motion::ClipMotion;
use crate::path::VirtualPath;
use crate::track::{AnalysisWindows, WindowTracks};
use plumbline_image::Frame;
use plumbline_image::warp::WarpField;
use plumbline_num::run::Run;
use plumbline_num::time::Timestamp;

/// Fraction of the progress of an analysis that tracking takes where cameras are recovered too: about half of the time on clips of
/// a minute.
const TRACKING: f64 = 0.5;

/// Stabilizes clips: see the [module](super) for the method and an example.
#[derive(Clone, Debug, Default)]
pub struct Stabilizer {
    options: StabilizerOptions,
}

/// The tracks of a clip and the motion of its camera: expensive to compute, and the same for every plan.
///
/// Clones share their data.
#[derive(Clone, Debug)]
pub struct Analysis {
    motion: Arc<ClipMotion>,
    tracks: Arc<Tracks>,
}

/// The virtual camera of a clip, and the motion model of each frame.
#[derive(Clone, Debug)]
pub struct Plan {
    analysis: Analysis,
    path: VirtualPath,
    models: FrameModels,
    warp: WarpOptions,
    covered: bool,
}

impl Stabilizer {
    /// A stabilizer with these options.
    ///
    /// # Errors
    /// [`StabilizeError::Options`] for a value out of range.
    pub fn new(options: StabilizerOptions) -> Result<Self, StabilizeError> {
        options.check()?;
        Ok(Self { options })
    }

    /// The options.
    pub fn options(&self) -> &StabilizerOptions {
        &self.options
    }

    /// Replaces the options, for another plan of the same analysis.
    ///
    /// # Errors
    /// As for [`Self::new`]; the options then stay as they are.
    pub fn set_options(&mut self, options: StabilizerOptions) -> Result<(), StabilizeError> {
        *self = Self::new(options)?;
        Ok(())
    }

    /// Reads the clip once: tracks points through its frames and estimates the camera's motion.
    ///
    /// # Errors
    /// [`StabilizeError::Frames`]: the source; [`StabilizeError::Input`]: no frame, or a mask that cannot be used;
    /// [`StabilizeError::Store`]: the temporary folder; [`StabilizeError::Interrupted`].
    pub fn analyze<S: FrameSource>(&self, source: &S, run: &Run) -> Result<Analysis, StabilizeError> {
        let info = source.info();
        let tracking = run.part(0.0, if self.options.motion.cameras { TRACKING } else { 1.0 });
        let mut tracker = ClipTracker::new(&info, &self.options.track, None)?;
        for_each_frame(source, &info, &tracking, |frame| tracker.push(frame).map(|_| ()))?;
        let (motion, tracks) = tracker.finish()?;
        self.completed(motion, tracks, &info, run)
    }

    /// Tracks points through one window of the clip ([`AnalysisWindows::default`]); the windows of a clip may be analyzed in any
    /// order and by several processes. The frames before the window are read and not looked at.
    ///
    /// # Errors
    /// [`StabilizeError::Frames`]: the source; [`StabilizeError::Input`]: no frame in the window, or a mask that cannot be used;
    /// [`StabilizeError::Interrupted`].
    pub fn analyze_window<S: FrameSource>(
        &self,
        source: &S,
        window: usize,
        run: &Run,
    ) -> Result<WindowTracks, StabilizeError> {
        let windows = AnalysisWindows::default();
        let mut tracker = WindowTracker::new(&source.info(), &self.options.track, windows, window)?;
        let frames = tracker.frames();
        let failed = |error: S::Error| StabilizeError::Frames(Box::new(error));
        let mut last = 0;
        for (index, frame) in source.frames().map_err(failed)?.take(frames.end).enumerate() {
            run.check()?;
            let frame = frame.map_err(failed)?;
            if frames.contains(&index) {
                tracker.push(&frame);
            }
            last = index;
            run.progress.report((index + 1) as f64 / frames.end as f64);
        }
        if last < windows.owned(window).start {
            let text = format!("the clip has no frame in analysis window {window}: its last one is {last}");
            return Err(StabilizeError::Input(text));
        }
        Ok(tracker.finish())
    }

    /// The analysis of a clip from that of its windows, in order: bit for bit the result of [`Self::analyze`]. No frame is read; `info`
    /// is that of the clip.
    ///
    /// # Errors
    /// Those of `windows`; [`StabilizeError::Input`]: none, one that is not the next, or one of another clip;
    /// [`StabilizeError::Store`]: the temporary folder; [`StabilizeError::Interrupted`].
    pub fn join(
        &self,
        info: &ClipInfo,
        windows: impl IntoIterator<Item = Result<WindowTracks, StabilizeError>>,
        run: &Run,
    ) -> Result<Analysis, StabilizeError> {
        let mut joiner = WindowJoiner::new(info, &self.options.track, AnalysisWindows::default(), None)?;
        for window in windows {
            run.check()?;
            joiner.push(window?)?;
        }
        let (motion, tracks) = joiner.finish()?;
        self.completed(motion, tracks, info, run)
    }

    /// Reads the motion of the clip from a file instead: a motion file (`plumbline.motion`), or the folder of a COLMAP model. The
    /// frames are read only where `source` does not know their number and rate.
    ///
    /// # Errors
    /// [`StabilizeError::Input`]: the file; otherwise as for [`Self::analyze`].
    pub fn import<S: FrameSource>(&self, path: &Path, source: &S, run: &Run) -> Result<Analysis, StabilizeError> {
        let info = source.info();
        let reading = run.part(0.0, TRACKING);
        let (motion, tracks) = if path.is_dir() {
            let imported = ImportedModels::read(path)?.motion(&times(source, &info, &reading)?, &info)?;
            (imported.motion, imported.tracks)
        } else {
            let file = MotionFile::read(path)?;
            file.check_size(&info)?;
            if !file.matches(&info) {
                file.check_times(&times(source, &info, &reading)?, &info)?;
            }
            file.into_motion()?
        };
        self.completed(motion, tracks, &info, run)
    }

    /// The analysis with the camera motion that the options request.
    fn completed(
        &self,
        mut motion: ClipMotion,
        tracks: Tracks,
        info: &ClipInfo,
        run: &Run,
    ) -> Result<Analysis, StabilizeError> {
        complete_motion(&mut motion, &tracks, &self.options.motion, info.focal_px, &run.part(TRACKING, 1.0))?;
        Ok(Analysis::new(motion, tracks))
    }

    /// Plans the virtual camera and selects the motion model of each segment. Nothing is tracked and no frame is read: again with
    /// other options, it takes milliseconds in the picture and seconds in space.
    ///
    /// # Errors
    /// [`StabilizeError::Options`], [`StabilizeError::Input`] and [`StabilizeError::PathFileWithoutCameras`]: the path file;
    /// [`StabilizeError::Store`]: the temporary folder; [`StabilizeError::Interrupted`].
    pub fn plan(&self, analysis: &Analysis, run: &Run) -> Result<Plan, StabilizeError> {
        let StabilizerOptions { path: smoothing, warp, .. } = &self.options;
        let (motion, tracks) = (analysis.motion(), analysis.tracks());
        let path = plan_path(motion, Some(tracks), smoothing, run)?;
        let covered = smoothing.keep_inside;
        let models = select_models(&RenderInputs { tracks, path: &path, motion: Some(motion), warp, covered }, run)?;
        run.step(1.0)?;
        Ok(Plan { analysis: analysis.clone(), path, models, warp: warp.clone(), covered })
    }
}

impl Analysis {
    /// An analysis of motion and tracks that are known already.
    pub fn new(motion: ClipMotion, tracks: Tracks) -> Self {
        Self { motion: Arc::new(motion), tracks: Arc::new(tracks) }
    }

    /// The motion of the camera, frame by frame, with its cameras in space where they were requested.
    pub fn motion(&self) -> &ClipMotion {
        &self.motion
    }

    /// The points of the clip.
    pub fn tracks(&self) -> &Tracks {
        &self.tracks
    }
}

impl Plan {
    /// The path of the virtual camera: its map per frame, how much of the picture it keeps, and why.
    pub fn path(&self) -> &VirtualPath {
        &self.path
    }

    /// The motion model of every frame, and the models that were evaluated to select them.
    pub fn models(&self) -> &FrameModels {
        &self.models
    }

    /// The figures of the plan: crop, shake before and after, the segments and their reasons.
    pub fn summary(&self) -> PlanSummary {
        PlanSummary::of(Some(self.analysis.motion()), &self.path, &self.models)
    }

    /// The maps of the clip's frames, to be asked for in their order.
    ///
    /// # Errors
    /// [`StabilizeError::Options`]: no mesh of this shape.
    pub fn maps(&self) -> Result<FrameMaps<'_>, StabilizeError> {
        let (tracks, motion) = (self.analysis.tracks(), Some(self.analysis.motion()));
        let inputs = RenderInputs { tracks, path: &self.path, motion, warp: &self.warp, covered: self.covered };
        FrameMaps::new(&inputs, &self.models)
    }

    /// The map of frame `index` alone, from output pixels to source pixels; `frame` is its picture, from which the saliency is
    /// measured. For all frames in order use [`Self::maps`], which reads the tracks once.
    ///
    /// # Errors
    /// [`StabilizeError::Input`] beyond the last frame; [`StabilizeError::Store`], [`StabilizeError::Warp`].
    pub fn map(&self, index: usize, frame: Option<&Frame>) -> Result<WarpField, StabilizeError> {
        self.maps()?.at(index, frame)
    }
}

/// Reads a clip from its first frame to its last.
fn for_each_frame<S: FrameSource>(
    source: &S,
    info: &ClipInfo,
    run: &Run,
    mut body: impl FnMut(&Frame) -> Result<(), StabilizeError>,
) -> Result<(), StabilizeError> {
    let failed = |error: S::Error| StabilizeError::Frames(Box::new(error));
    for (done, frame) in source.frames().map_err(failed)?.enumerate() {
        run.check()?;
        body(&frame.map_err(failed)?)?;
        if let Some(frames) = info.frames {
            run.progress.report((done + 1) as f64 / frames.max(1) as f64);
        }
    }
    Ok(())
}

/// Times of the clip's frames.
fn times<S: FrameSource>(source: &S, info: &ClipInfo, run: &Run) -> Result<Vec<Timestamp>, StabilizeError> {
    let mut times = Vec::new();
    for_each_frame(source, info, run, |frame| {
        times.push(frame.pts);
        Ok(())
    })?;
    Ok(times)
}

#[cfg(test)]
mod tests;
