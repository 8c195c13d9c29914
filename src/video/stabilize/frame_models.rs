//! The motion model of each frame: from the requested mode and the verdict on its segment, blended across segment borders.

use std::ops::Range;

use super::model_evaluation::EvaluatedModel;
use super::options::ModelChoice;
use crate::motion::{ClipMotion, MotionModel, SegmentVerdict, verdicts};
use crate::path::{self, SegmentOutcome, VirtualPath};

/// Frames over which one model blends into the next: half a second, so that the change of model cannot be seen.
const BLEND: usize = 15;

/// The motion model of every frame.
#[derive(Clone, Debug)]
pub struct FrameModels {
    /// In order, without gaps.
    pub(super) segments: Vec<SegmentVerdict>,
    /// Frames at which, within a shot, cameras in space continue in coordinates of their own.
    seams: Vec<usize>,
    /// Frames whose path was given.
    given: Vec<Range<usize>>,
    /// Models that were evaluated to select those of the segments.
    pub(super) evaluated: Vec<EvaluatedModel>,
}

impl FrameModels {
    /// The models of a clip by `mode` and its verdicts; frames that the path leaves unchanged are not warped.
    pub(super) fn new(mode: ModelChoice, motion: Option<&ClipMotion>, path: &VirtualPath) -> Self {
        let verdicts = motion.map(verdicts).unwrap_or_default();
        let mut segments = Vec::new();
        for part in &path.segments {
            if part.outcome == SegmentOutcome::Unchanged {
                let (frames, reason) = (part.frames.clone(), part.reason.clone());
                segments.push(SegmentVerdict { frames, model: MotionModel::Untouched, reason });
            } else {
                segments.extend(split_in_space(path, motion, forced(mode, &verdicts, part)));
            }
        }
        let given =
            path.segments.iter().filter(|s| s.outcome == SegmentOutcome::Given).map(|s| s.frames.clone()).collect();
        Self { segments, seams: seams(path, motion), given, evaluated: Vec::new() }
    }

    /// The segments in order, without gaps: frames, model and reason.
    pub fn segments(&self) -> &[SegmentVerdict] {
        &self.segments
    }

    /// The models that were evaluated to select those of the segments; empty where there was nothing to select.
    pub fn evaluated(&self) -> &[EvaluatedModel] {
        &self.evaluated
    }

    /// Strength of a given camera in space, in [0, 1]: 0 on frames whose path was not given.
    pub(super) fn given(&self, frame: usize) -> f64 {
        if self.given.iter().any(|frames| frames.contains(&frame)) { self.in_space(frame) } else { 0.0 }
    }

    /// Strength of the virtual cameras in space, in [0, 1]: as for [`Self::strength`], and less about a seam, where the two sides
    /// need not show the same parallax.
    pub(super) fn in_space(&self, frame: usize) -> f64 {
        let nearest = self.seams.iter().map(|&s| if frame < s { s - frame } else { frame + 1 - s }).min();
        let clear = nearest.map_or(1.0, |d| (d as f64 / BLEND as f64).min(1.0));
        clear * self.strength(frame, |model| model == MotionModel::ThreeD)
    }

    /// Joint strength at `frame` of the models that fulfill `with`: 1 far inside their segments, 0 outside.
    pub(super) fn strength(&self, frame: usize, with: impl Fn(MotionModel) -> bool) -> f64 {
        let (Some(here), reach) = (self.segment(frame), BLEND as f64) else { return 0.0 };
        if here.model == MotionModel::Untouched || !with(here.model) {
            return 0.0;
        }
        let without = |s: &&SegmentVerdict| s.model != MotionModel::Untouched && !with(s.model);
        let distance =
            |r: &Range<usize>| if frame < r.start { r.start - frame } else { (frame + 1).saturating_sub(r.end) };
        let nearest = self.segments.iter().filter(without).map(|s| distance(&s.frames)).min();
        nearest.map_or(1.0, |d| (d as f64 / reach).min(1.0))
    }

    fn segment(&self, frame: usize) -> Option<&SegmentVerdict> {
        let at = self.segments.partition_point(|s| s.frames.end <= frame);
        self.segments.get(at).filter(|s| s.frames.contains(&frame))
    }
}

/// Frames inside a shot at which a segment of cameras begins right after another.
fn seams(path: &VirtualPath, motion: Option<&ClipMotion>) -> Vec<usize> {
    let Some((motion, cameras)) = motion.and_then(|m| Some((m, m.cameras.as_ref()?))) else { return Vec::new() };
    let known = |frame: usize| path.cameras.get(frame).is_some_and(Option::is_some);
    let starts = cameras.shots.iter().map(|s| s.frames.start).filter(|&s| s > 0 && known(s) && known(s - 1));
    starts.filter(|start| !motion.shots.iter().any(|s| s.start == *start)).collect()
}

/// The segments, split where virtual cameras in space begin and end, with the verdict on the cameras in their reasons.
fn split_in_space(
    path: &VirtualPath,
    motion: Option<&ClipMotion>,
    segments: Vec<SegmentVerdict>,
) -> Vec<SegmentVerdict> {
    let Some(cameras) = motion.and_then(|m| m.cameras.as_ref()).filter(|_| !path.cameras.is_empty()) else {
        return segments;
    };
    let known = |frame: usize| {
        let camera = path.cameras.get(frame).copied().flatten()?;
        Some(if camera.rotation_only { MotionModel::Rotation } else { MotionModel::ThreeD })
    };
    let mut parted = Vec::new();
    for segment in segments {
        let mut start = segment.frames.start;
        while start < segment.frames.end {
            let here = known(start);
            let end = (start..segment.frames.end).find(|&f| known(f) != here).unwrap_or(segment.frames.end);
            let shot = cameras.shots.iter().find(|s| s.frames.contains(&start));
            let verdict = shot.map_or_else(String::new, |s| format!("{}; ", s.reason));
            let model = here.unwrap_or(segment.model);
            parted.push(SegmentVerdict { frames: start..end, model, reason: format!("{verdict}{}", segment.reason) });
            start = end;
        }
    }
    parted
}

/// The segments of one part of the path.
fn forced(mode: ModelChoice, verdicts: &[SegmentVerdict], part: &path::Segment) -> Vec<SegmentVerdict> {
    let model = match mode {
        ModelChoice::Auto => None,
        // Cameras in space where there are any; a mesh elsewhere.
        ModelChoice::ThreeD | ModelChoice::Rotation | ModelChoice::Mesh => Some(MotionModel::Mesh),
        ModelChoice::Subspace => Some(MotionModel::Subspace),
        ModelChoice::Homography => Some(MotionModel::Homography),
        ModelChoice::Similarity => Some(MotionModel::Similarity),
    };
    match model {
        Some(model) => {
            vec![SegmentVerdict { frames: part.frames.clone(), model, reason: format!("requested; {}", part.reason) }]
        }
        None => verdicts.iter().filter_map(|v| clipped(v, part)).collect(),
    }
}

/// The intersection of a verdict with `part`, with both reasons. Frames whose motion cannot be measured still follow the path.
fn clipped(verdict: &SegmentVerdict, part: &path::Segment) -> Option<SegmentVerdict> {
    let frames = verdict.frames.start.max(part.frames.start)..verdict.frames.end.min(part.frames.end);
    let reason = format!("{}; {}", verdict.reason, part.reason);
    (!frames.is_empty()).then(|| SegmentVerdict { frames, model: verdict.model.max(MotionModel::Similarity), reason })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn models(parts: &[(Range<usize>, MotionModel)]) -> FrameModels {
        let segment = |(frames, model): &(Range<usize>, MotionModel)| SegmentVerdict {
            frames: frames.clone(),
            model: *model,
            reason: String::new(),
        };
        FrameModels {
            segments: parts.iter().map(segment).collect(),
            seams: Vec::new(),
            given: Vec::new(),
            evaluated: Vec::new(),
        }
    }

    #[test]
    fn models_blend_into_each_other_without_a_step() {
        let models =
            models(&[(0..100, MotionModel::Mesh), (100..200, MotionModel::ThreeD), (200..300, MotionModel::Subspace)]);
        let strength: Vec<f64> = (0..300).map(|f| models.strength(f, |m| m == MotionModel::ThreeD)).collect();
        assert_eq!((strength[99], strength[200], strength[150]), (0.0, 0.0, 1.0));
        assert!(strength.windows(2).all(|s| (s[1] - s[0]).abs() <= 1.0 / BLEND as f64 + 1e-12));
        assert!((0..300).all(|f| models.strength(f, |m| m >= MotionModel::Mesh) == 1.0), "all of them bend a mesh");
    }

    #[test]
    fn unchanged_frames_are_not_blended() {
        let models = models(&[(0..50, MotionModel::Untouched), (50..100, MotionModel::Mesh)]);
        assert_eq!(models.strength(10, |_| true), 0.0);
        assert_eq!(models.strength(50, |m| m == MotionModel::Mesh), 1.0, "a stretch that is not touched ends in a cut");
    }

    #[test]
    fn only_a_given_path_is_followed_closely() {
        let given = FrameModels {
            given: std::iter::once(0..100).collect(),
            ..models(&[(0..200, MotionModel::ThreeD), (200..300, MotionModel::Mesh)])
        };
        assert_eq!((given.given(50), given.given(150), given.given(250)), (1.0, 0.0, 0.0));
    }

    #[test]
    fn parallax_fades_about_a_seam() {
        let seamed = FrameModels { seams: vec![50], ..models(&[(0..100, MotionModel::ThreeD)]) };
        let strength: Vec<f64> = (0..100).map(|f| seamed.in_space(f)).collect();
        assert!(strength[49] < 0.1 && strength[50] < 0.1 && strength[20] == 1.0 && strength[80] == 1.0);
        assert!(strength.windows(2).all(|s| (s[1] - s[0]).abs() <= 1.0 / BLEND as f64 + 1e-12));
    }
}
