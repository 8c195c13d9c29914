//! `video.smooth`: the path of the virtual camera, between the passes.

use super::analysis::Tracks;
use super::choice;
use super::context::Context;
use super::path_file;
use super::space::{Places, Views, Wanted, steadied};
use crate::camera::{CameraPose, Vec3};
use crate::motion::sfm::SfmVerdict;
use crate::motion::{ClipCameras, ClipMotion, FrameCamera, FrameMotion, MotionQuality};
use crate::path::{self, Clip, InterFrame, PathError, PathKind, PathOptions, VirtualPath};
use crate::pipeline::kinds::{InSpace, PathMethod, SmoothSettings, Zoom};
use crate::pipeline::run_error::RunError;

/// Smoothing of virtual cameras in space, as a part of the smoothness asked for: what they leave, the planner evens out.
const SPACE_SHARE: f64 = 0.7;

/// Frames with a camera each that are worth a change of tier, at least: it takes fifteen to pass into it, and as many out.
const SHORTEST_RUN: usize = 45;

/// Plans the path.
pub(super) fn run(context: &mut Context<'_, '_>, stage: usize, settings: &SmoothSettings) -> Result<(), RunError> {
    let motion: &ClipMotion = context.values.get(context.required(stage, "motion")?)?;
    let tracks: Option<&Tracks> = context.edge(stage, "tracks").map(|edge| context.values.get(edge)).transpose()?;
    let planner = Planner::new(motion, settings);
    let path = match (&motion.cameras, tracks, &settings.path_file) {
        (Some(cameras), Some(tracks), Some(file)) => planner.along(file, cameras, tracks)?,
        (Some(cameras), Some(tracks), None) => planner.in_space(cameras, tracks)?,
        (_, _, None) => planner.in_picture()?,
        (_, _, Some(_)) => {
            let missing =
                "a path file needs the cameras of the clip: `cameras = true` on video.motion, and its tracks here";
            return Err(RunError::Input(missing.to_owned()));
        }
    };
    context.values.put(stage, "path", path);
    Ok(())
}

/// Plans paths for one clip.
struct Planner<'a> {
    motion: &'a ClipMotion,
    settings: &'a SmoothSettings,
    times_s: Vec<f64>,
    /// Motion as measured in the picture.
    steps: Vec<InterFrame>,
}

impl<'a> Planner<'a> {
    fn new(motion: &'a ClipMotion, settings: &'a SmoothSettings) -> Self {
        let times_s = motion.frames.iter().map(|m| motion.timebase.seconds(m.pts)).collect();
        let steps = motion.frames.iter().map(inter_frame).collect();
        Self { motion, settings, times_s, steps }
    }

    fn clip<'s>(&'s self, steps: &'s [InterFrame]) -> Clip<'s> {
        let ClipMotion { width, height, shots, .. } = self.motion;
        Clip { width: *width, height: *height, times_s: &self.times_s, motion: steps, shots }
    }

    /// The path that the motion in the picture allows.
    fn in_picture(&self) -> Result<VirtualPath, RunError> {
        path::plan(&self.clip(&self.steps), &options(self.settings)).map_err(not_planned)
    }

    /// The path of smoothed cameras in space where there are any, else of the picture; of both the better, unless the
    /// settings say which.
    fn in_space(&self, cameras: &ClipCameras, tracks: &Tracks) -> Result<VirtualPath, RunError> {
        let wanted = self.smoothed(cameras);
        if wanted.iter().all(Option::is_none) {
            return self.in_picture();
        }
        let places = Places::new(cameras, self.motion);
        let views = Views::new(tracks, &places, &wanted, &self.times_s)?;
        let mut steps = self.steps.clone();
        views.retarget(&mut steps);
        let mut in_space = path::plan(&self.clip(&steps), &options(self.settings)).map_err(not_planned)?;
        let planned = views.cameras(&in_space);
        let cameras = steadied(&planned, tracks, &places, &self.times_s)?;
        in_space.cameras = vec![None; cameras.len()];
        let smallest = self.settings.keep_inside.then_some(self.settings.min_crop);
        for part in in_space.segments.clone() {
            if part.tier == path::Tier::Smoothed {
                views.show(&mut in_space, &cameras, &part.frames, &self.clip(&steps), smallest);
            }
        }
        match self.settings.in_space {
            InSpace::Auto => {
                choice::better(self.motion, tracks, in_space, self.in_picture()?, self.settings.keep_inside)
            }
            InSpace::Always | InSpace::Turn => Ok(in_space),
        }
    }

    /// The path that a file asks for.
    fn along(&self, file: &str, cameras: &ClipCameras, tracks: &Tracks) -> Result<VirtualPath, RunError> {
        let given = path_file::read(file, cameras, &self.times_s)?;
        let wanted: Vec<_> = (given.poses.iter().enumerate())
            .map(|(frame, pose)| pose.map(|pose| wanted(pose, cameras.turns(frame))))
            .collect();
        let views = Views::new(tracks, &Places::new(cameras, self.motion), &wanted, &self.times_s)?;
        if views.known() == 0 {
            let blind = "the wanted cameras see nothing of what the clip's cameras saw";
            return Err(RunError::Input(format!("{file}: {blind}")));
        }
        let planned = path::plan_along(&self.clip(&self.steps), &options(self.settings), &views.out_from_src());
        let mut path = planned.map_err(not_planned)?;
        path.cameras = views.cameras(&path);
        let aligned = format!("; aligned to {:.2} % of the path's length", 100.0 * given.residual);
        path.segments.iter_mut().for_each(|s| s.reason.push_str(&aligned));
        Ok(path)
    }

    /// The cameras of the clip, smoothed shot by shot, where they bear it.
    fn smoothed(&self, cameras: &ClipCameras) -> Vec<Option<Wanted>> {
        let sigma_s = SPACE_SHARE * self.settings.smoothness;
        let mut smooth = Vec::with_capacity(self.times_s.len());
        for shot in &cameras.shots {
            let turns = self.settings.in_space == InSpace::Turn || shot.verdict == SfmVerdict::RotationOnly;
            let drawn = turns || shot.verdict == SfmVerdict::ThreeD;
            let pose = |camera: &Option<FrameCamera>| {
                let pose = camera.filter(|_| drawn)?.pose;
                Some(wanted(pose, turns).pose)
            };
            let own: Vec<_> = cameras.frames[shot.frames.clone()].iter().map(pose).collect();
            let mut poses = path::smoothed_poses(&self.times_s[shot.frames.clone()], &own, sigma_s);
            for run in poses.chunk_by_mut(|a, b| a.is_some() == b.is_some()).filter(|run| run.len() < SHORTEST_RUN) {
                run.fill(None);
            }
            smooth.extend(poses.into_iter().map(|p| p.map(|pose| Wanted { pose, turns })));
        }
        smooth
    }
}

/// A wanted camera; one that turns has no place.
fn wanted(pose: CameraPose, turns: bool) -> Wanted {
    let translation = if turns { Vec3::zeros() } else { pose.translation };
    Wanted { pose: CameraPose { translation, ..pose }, turns }
}

#[expect(clippy::needless_pass_by_value, reason = "the signature that map_err wants")]
fn not_planned(error: PathError) -> RunError {
    RunError::Input(error.to_string())
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
