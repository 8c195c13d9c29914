//! `video.smooth`: the path of the virtual camera, between the passes.

use super::context::Context;
use crate::motion::{ClipMotion, FrameMotion, MotionQuality};
use crate::path::{self, Clip, InterFrame, PathKind, PathOptions};
use crate::pipeline::kinds::{PathMethod, SmoothSettings, Zoom};
use crate::pipeline::run_error::RunError;

/// Plans the path.
pub(super) fn run(context: &mut Context<'_, '_>, stage: usize, settings: &SmoothSettings) -> Result<(), RunError> {
    let motion: &ClipMotion = context.values.get(context.required(stage, "motion")?)?;
    let times_s: Vec<f64> = motion.frames.iter().map(|m| motion.timebase.seconds(m.pts)).collect();
    let steps: Vec<InterFrame> = motion.frames.iter().map(inter_frame).collect();
    let clip =
        Clip { width: motion.width, height: motion.height, times_s: &times_s, motion: &steps, shots: &motion.shots };
    let path = path::plan(&clip, &options(settings)).map_err(|e| RunError::Input(e.to_string()))?;
    context.values.put(stage, "path", path);
    Ok(())
}

fn options(settings: &SmoothSettings) -> PathOptions {
    PathOptions {
        kind: match settings.method {
            PathMethod::Optimal => PathKind::Optimal,
            PathMethod::Gaussian => PathKind::Gaussian,
            PathMethod::Tripod => PathKind::Tripod,
        },
        smoothness_s: settings.smoothness,
        min_crop: settings.min_crop,
        zoom: match settings.zoom {
            Zoom::Fixed => path::Zoom::Fixed,
            Zoom::Adaptive => path::Zoom::Adaptive,
            Zoom::None => path::Zoom::None,
        },
        border_allows_outside: !settings.keep_inside,
        reserve: settings.reserve,
    }
}

fn inter_frame(motion: &FrameMotion) -> InterFrame {
    let reliable = !matches!(motion.quality, MotionQuality::Lost);
    InterFrame { similarity: motion.similarity, homography: motion.homography, reliable }
}
