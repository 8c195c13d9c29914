//! What a finished stage adds to the summary.

use std::path::PathBuf;

use crate::pipeline::summary::Summary;
use crate::report::Segment;
use plumbline_media::{Output, WriteReport};
use plumbline_video::motion::ShotCameras;
use plumbline_video::stabilize::{PlanSegment, PlanSummary, model_name, verdict_name};

/// Reports a file. Frames and size are those of the first.
pub(crate) fn report_file(summary: &mut Summary, output: &Output, size: (usize, usize), written: WriteReport) {
    summary.outputs.push(PathBuf::from(output.path()));
    summary.encoder.get_or_insert(written.encoder);
    if summary.size.is_none() {
        summary.frames = written.frames;
        summary.size = Some((size.0 as u32, size.1 as u32));
    }
    summary.input.iter_mut().for_each(|input| input.copied_videos.clone_from(&written.copied_videos));
    for warning in written.warnings {
        if !summary.warnings.contains(&warning) {
            summary.warnings.push(warning);
        }
    }
}

/// Reports the path and the models that a render stage followed.
pub(crate) fn report_plan(summary: &mut Summary, plan: PlanSummary) {
    let segment = |s: PlanSegment| Segment {
        frames: s.frames,
        mode: model_name(s.model).to_owned(),
        reason: s.reason,
        crop: s.crop,
        shake: s.shake,
    };
    summary.crop = Some(plan.mean_crop);
    summary.least_crop = Some(plan.min_crop);
    summary.shake = plan.shake;
    summary.segments.extend(plan.segments.into_iter().map(segment));
}

/// The cameras of a shot.
pub(crate) fn shot_segment(shot: &ShotCameras) -> Segment {
    Segment {
        frames: shot.frames.clone(),
        mode: verdict_name(shot.verdict).to_owned(),
        reason: shot.reason.clone(),
        crop: None,
        shake: None,
    }
}
