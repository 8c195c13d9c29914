//! `video.importance`: importance maps of a clip, computed at a few frames per second as for still images, while the clip is
//! tracked or in a pass of its own.

use super::clip::stream::for_each_frame;
use super::kept::{Slot, importance_slot};
use super::photo::painted_mask;
use super::prelude::*;
use crate::pipeline::paths::to_path;
use crate::stages::TrackSettings;
use plumbline_image::Frame;
use plumbline_image::feature::{Face, FaceDetector, FaceOptions, Importance, ImportanceOptions};
use plumbline_media::{Ratio, VideoInfo, VideoReader};
use plumbline_num::run::Run;
use plumbline_photo::temporal::ClipImportance;

/// Whether faces are looked for in a clip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ClipFaces {
    /// Twice a second
    #[default]
    Auto,
    /// Not at all
    Off,
}

/// Settings of `video.importance`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct VideoImportanceSettings {
    /// Face detection; faces are the most important content
    pub faces: ClipFaces,
    /// A picture of the clip's size, painted by hand: white matters, black does not, mid-gray leaves what was found
    #[schemars(extend("format" = "path"))]
    pub mask: Option<String>,
}

impl Stage for VideoImportanceSettings {
    const KIND: &'static str = "video.importance";
    const SUMMARY: &'static str = "estimates the importance of each position of a clip, six times a second";
    const INPUTS: &'static [Port] = &[Port::one("frames", PortType::Frames, "the clip to analyze")];
    const OUTPUTS: &'static [Port] =
        &[Port::one("importance", PortType::Importance, "the importance of each position")];
    type Input = Wired;
    type Output = HandedOn;

    fn over_time(&self) -> TemporalScope {
        TemporalScope::Reduce
    }

    fn memory(&self) -> Vec<MemoryCost> {
        // 1300 bytes per moment; the detector's model and pyramid.
        vec![
            MemoryCost { what: "importance", bytes_per_clip_frame: 1300.0 / 5.0, ..MemoryCost::default() },
            MemoryCost { what: "a small picture and the search for faces", bytes: 24 << 20, ..MemoryCost::default() },
        ]
    }

    fn reads(&self) -> Vec<&str> {
        self.mask.as_deref().into_iter().collect()
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        let decode = context.required(stage, "frames")?.from;
        let tracks = |s: &usize| {
            context.stage(*s).settings.get::<TrackSettings>().is_some()
                && context.edge(*s, "frames").is_some_and(|e| e.from == decode)
        };
        if context.pass.stages.iter().any(tracks) {
            return Ok(HandedOn);
        }
        let (_, reader) = context.open(decode)?;
        let video = reader.info().clone();
        let mut estimators = importance_estimators(context, decode, &video, None)?;
        estimators.retain(|e| e.stage == stage);
        estimate(context, reader, estimators, &[])?;
        Ok(HandedOn)
    }
}

/// Shows the frames of a clip to estimators, if there are any; `cuts`: whether each frame is the first of a shot, where that is known.
pub(super) fn estimate(
    context: &mut Context<'_, '_>,
    reader: VideoReader,
    mut estimators: Vec<ImportanceEstimator>,
    cuts: &[bool],
) -> Result<(), RunError> {
    if estimators.is_empty() {
        return Ok(());
    }
    context.job.progress.begin(context.pass.index, "judge", reader.info().frames_estimate);
    let mut cuts = cuts.iter().copied();
    let report = for_each_frame(context.job, reader, |frame| {
        let cut = cuts.next().unwrap_or(false);
        estimators.iter_mut().try_for_each(|e| e.push(&frame, cut))
    })?;
    let whole = context.report_damage(&report);
    for estimator in estimators {
        estimator.finish(context, whole);
    }
    Ok(())
}

/// Moments analyzed per second. Importance is evened out over a second: more would add nothing.
const PER_SECOND: f64 = 6.0;
/// Moments from one search for faces to the next: two searches per second.
const FACES_EVERY: usize = 3;
/// The smallest faces of a clip, as a fraction of the longer side: those that one look at the whole picture finds (34 of 38 faces of
/// `benches/peers/faces.json`, all 27 from a tenth on). Smaller ones would cost six times as much, twice a second.
const MIN_FACE: f64 = 1.0 / 16.0;
/// The longer side of the picture that is analyzed, px. The result is kept in 48 cells across.
const ANALYSIS_SIDE: usize = 240;

/// The importance of the positions of a clip.
pub(super) struct EstimatedImportance {
    pub(super) importance: ClipImportance,
    pub(super) video: VideoInfo,
}

/// Estimates the importance of a clip frame by frame.
pub(super) struct ImportanceEstimator {
    stage: usize,
    video: VideoInfo,
    importance: ClipImportance,
    mask: Option<(String, Frame)>,
    detector: Option<FaceDetector>,
    faces: Vec<Face>,
    /// Frames from one moment to the next, seen so far, and since faces were looked for last, in moments.
    stride: usize,
    seen: usize,
    moments: usize,
    /// Where the result is kept.
    slot: Option<Slot>,
}

impl ImportanceEstimator {
    pub(super) fn new(stage: usize, settings: &VideoImportanceSettings, video: &VideoInfo) -> Result<Self, RunError> {
        let mask = |path: &String| Ok::<_, RunError>((path.clone(), painted_mask(&to_path(path))?));
        let rate = video.frame_rate.map_or(25.0, Ratio::value);
        Ok(Self {
            stage,
            video: video.clone(),
            importance: ClipImportance::new((video.width, video.height)),
            mask: settings.mask.as_ref().map(mask).transpose()?,
            detector: (settings.faces == ClipFaces::Auto)
                .then(|| FaceDetector::new(FaceOptions { min_size: MIN_FACE, ..FaceOptions::default() })),
            faces: Vec::new(),
            stride: ((rate / PER_SECOND).round() as usize).max(1),
            seen: 0,
            moments: 0,
            slot: None,
        })
    }

    /// Takes the next frame; `cut`: it is the first of a shot.
    pub(super) fn push(&mut self, frame: &Frame, cut: bool) -> Result<(), RunError> {
        let index = self.seen;
        self.seen += 1;
        if !(cut || index.is_multiple_of(self.stride)) {
            return Ok(());
        }
        if let Some(detector) = self.detector.as_ref().filter(|_| cut || self.moments.is_multiple_of(FACES_EVERY)) {
            self.faces = detector.detect(frame, &Run::default())?;
        }
        self.moments = if cut { 1 } else { self.moments + 1 };
        let options = ImportanceOptions { max_side: ANALYSIS_SIDE, ..ImportanceOptions::default() };
        let mask = self.mask.as_ref().map(|(_, mask)| mask);
        let judged = Importance::of_frame(frame, &self.faces, mask, &options, &Run::default());
        let judged = judged.map_err(|e| match &self.mask {
            Some((name, _)) => RunError::Input(format!("{name}: {e}")),
            None => RunError::Input(e.to_string()),
        })?;
        self.importance.push(index, &judged);
        Ok(())
    }

    /// Hands the result on; `whole`: the clip is not damaged, so that the result may be kept.
    pub(super) fn finish(self, context: &mut Context<'_, '_>, whole: bool) {
        let Self { stage, importance, video, slot, .. } = self;
        if let Some(slot) = slot.filter(|_| whole) {
            slot.keep(context, &importance);
        }
        context.values.put(stage, "importance", EstimatedImportance { importance, video });
    }
}

/// What is left to estimate for the `video.importance` stages of this pass that take the pictures of decode stage `decode`; results
/// that are kept are handed on. Cuts are found by `tracker`, if there is one.
pub(super) fn importance_estimators(
    context: &mut Context<'_, '_>,
    decode: usize,
    video: &VideoInfo,
    tracker: Option<&TrackSettings>,
) -> Result<Vec<ImportanceEstimator>, RunError> {
    let mut found = Vec::new();
    let pass = context.pass;
    for &stage in &pass.stages {
        let settings = context.stage(stage).settings.clone();
        let Some(own) = settings.get::<VideoImportanceSettings>() else { continue };
        if context.edge(stage, "frames").is_none_or(|e| e.from != decode) {
            continue;
        }
        let mut estimator = ImportanceEstimator::new(stage, own, video)?;
        estimator.slot = importance_slot(context, stage, decode, own, tracker);
        let size = (video.width, video.height);
        let fits = |known: &ClipImportance| known.is_of(size);
        match estimator.slot.as_ref().and_then(|slot| slot.take(context, fits)) {
            Some(importance) => {
                let video = video.clone();
                context.values.put(stage, "importance", EstimatedImportance { importance, video });
            }
            None => found.push(estimator),
        }
    }
    Ok(found)
}
