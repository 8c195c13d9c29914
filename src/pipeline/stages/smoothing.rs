//! `video.smooth`: the path of the virtual camera, between the passes.

use super::analysis::Tracks;
use super::context::Context;
use super::path_file;
use super::space::{Places, Views};
use crate::motion::sfm::SfmVerdict;
use crate::motion::{ClipMotion, FrameMotion, MotionQuality};
use crate::path::{self, Clip, InterFrame, PathKind, PathOptions};
use crate::pipeline::kinds::{PathMethod, SmoothSettings, Zoom};
use crate::pipeline::run_error::RunError;

/// Smoothing of virtual cameras in space, as a part of the smoothness asked for: what they leave, the planner evens out.
const SPACE_SHARE: f64 = 0.7;

/// Plans the path.
pub(super) fn run(context: &mut Context<'_, '_>, stage: usize, settings: &SmoothSettings) -> Result<(), RunError> {
    let motion: &ClipMotion = context.values.get(context.required(stage, "motion")?)?;
    let times_s: Vec<f64> = motion.frames.iter().map(|m| motion.timebase.seconds(m.pts)).collect();
    let mut steps: Vec<InterFrame> = motion.frames.iter().map(inter_frame).collect();
    let tracks: Option<&Tracks> = context.edge(stage, "tracks").map(|edge| context.values.get(edge)).transpose()?;
    let views = views(motion, tracks, &times_s, settings)?;
    if let (Some((views, _)), None) = (&views, &settings.path_file) {
        views.retarget(&mut steps);
    }
    let clip =
        Clip { width: motion.width, height: motion.height, times_s: &times_s, motion: &steps, shots: &motion.shots };
    let wanted = views.as_ref().filter(|_| settings.path_file.is_some());
    let planned = match wanted {
        Some((views, _)) => path::plan_along(&clip, &options(settings), &views.out_from_src()),
        None => path::plan(&clip, &options(settings)),
    };
    let mut path = planned.map_err(|e| RunError::Input(e.to_string()))?;
    if let Some((views, residual)) = &views {
        path.cameras = views.cameras(&path);
        if let Some(residual) = residual {
            let aligned = format!("; aligned to {:.2} % of the path's length", 100.0 * residual);
            path.segments.iter_mut().for_each(|s| s.reason.push_str(&aligned));
        }
    }
    context.values.put(stage, "path", path);
    Ok(())
}

/// What virtual cameras show, where the cameras of the clip are known, and how well a given path could be aligned to them.
fn views(
    motion: &ClipMotion,
    tracks: Option<&Tracks>,
    times_s: &[f64],
    settings: &SmoothSettings,
) -> Result<Option<(Views, Option<f64>)>, RunError> {
    let (Some(cameras), Some(tracks)) = (&motion.cameras, tracks) else {
        let missing =
            "a path file needs the cameras of the clip: `cameras = true` on video.motion, and its tracks here";
        return if settings.path_file.is_some() { Err(RunError::Input(missing.to_owned())) } else { Ok(None) };
    };
    let places = Places::new(cameras, motion);
    if let Some(file) = &settings.path_file {
        let wanted = path_file::read(file, cameras, times_s)?;
        let views = Views::new(tracks, &places, &wanted.poses)?;
        if views.known() == 0 {
            return Err(RunError::Input(format!(
                "{file}: the wanted cameras see nothing of what the clip's cameras saw"
            )));
        }
        return Ok(Some((views, Some(wanted.residual))));
    }
    let sigma_s = SPACE_SHARE * settings.smoothness;
    let mut poses = Vec::with_capacity(times_s.len());
    for shot in &cameras.shots {
        let own: Vec<_> = cameras.frames[shot.frames.clone()].iter().map(|c| c.map(|c| c.pose)).collect();
        let drawn = if shot.verdict == SfmVerdict::ThreeD { own } else { vec![None; own.len()] };
        poses.extend(path::smoothed_poses(&times_s[shot.frames.clone()], &drawn, sigma_s));
    }
    Ok(Some((Views::new(tracks, &places, &poses)?, None)))
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
