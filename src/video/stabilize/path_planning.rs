//! The path of the virtual camera: in the picture, in space where the cameras were recovered, or from a file.

use std::ops::Range;
use std::path::Path;

use super::error::StabilizeError;
use super::model_selection::select_path;
use super::moving_objects::moving_objects;
use super::options::{InSpace, PathMethod, SmoothingOptions};
use super::path_file;
use super::space::{ScenePoints, TargetPose, Views, steadied};
use super::target_path::{self, TargetPath};
use super::tracks::Tracks;
use crate::motion::sfm::SfmVerdict;
use crate::motion::{ClipCameras, ClipMotion, FrameCamera, FrameMotion, MotionQuality, ShotCameras};
use crate::path::{
    self, BeyondOptions, Clip, InterFrame, Margins, PathError, PathOptions, Segment, SegmentOutcome, VirtualPath,
};
use plumbline_camera::{CameraPose, Vec3};
use plumbline_num::math::Similarity2;
use plumbline_num::run::Run;

/// Smoothing of virtual cameras in space, as a fraction of the requested smoothness: the planner smooths the windows in addition.
const SMOOTHNESS_IN_SPACE: f64 = 0.7;

/// Least number of successive frames with a camera for which the model changes: fifteen frames blend into it, fifteen out of it,
/// and as many show it fully.
const MIN_RUN: usize = 45;

/// Plans the path of the virtual camera for a clip; without its `tracks`, in the picture alone.
///
/// # Errors
/// [`StabilizeError::Options`], [`StabilizeError::Input`], [`StabilizeError::PathFileWithoutCameras`],
/// [`StabilizeError::Store`], [`StabilizeError::Interrupted`].
pub fn plan_path(
    motion: &ClipMotion,
    tracks: Option<&Tracks>,
    options: &SmoothingOptions,
    run: &Run,
) -> Result<VirtualPath, StabilizeError> {
    run.check()?;
    let planner = Planner::new(motion, tracks, options, run)?;
    match (&motion.cameras, tracks, &options.path_file) {
        (Some(cameras), Some(tracks), Some(file)) => planner.along(file, cameras, tracks),
        (Some(cameras), Some(tracks), None) => planner.in_space(cameras, tracks),
        (_, _, None) => planner.in_picture(),
        (_, _, Some(_)) => Err(StabilizeError::PathFileWithoutCameras),
    }
}

/// Plans paths for one clip.
struct Planner<'a> {
    motion: &'a ClipMotion,
    options: &'a SmoothingOptions,
    run: &'a Run,
    times_s: Vec<f64>,
    /// Motion as measured in the picture.
    steps: Vec<InterFrame>,
    /// How far the window may leave the frame; empty where it may not, or anywhere.
    beyond: Vec<Margins>,
}

impl<'a> Planner<'a> {
    fn new(
        motion: &'a ClipMotion,
        tracks: Option<&Tracks>,
        options: &'a SmoothingOptions,
        run: &'a Run,
    ) -> Result<Self, StabilizeError> {
        let times_s = motion.frames.iter().map(|m| motion.timebase.seconds(m.pts)).collect();
        let steps = motion.frames.iter().map(inter_frame).collect();
        let mut planner = Self { motion, options, run, times_s, steps, beyond: Vec::new() };
        if options.is_bounded_by_neighbors() {
            let limits = BeyondOptions { limit: 0.5 * (1.0 - options.keep), ..BeyondOptions::default() };
            let min_speed = limits.min_speed(motion.width);
            let objects = tracks.map(|tracks| moving_objects(motion, tracks, min_speed, run)).transpose()?;
            let objects = objects.unwrap_or_default();
            planner.beyond = path::shown_beyond(&planner.clip(&planner.steps), &objects, &limits, run)?;
        }
        Ok(planner)
    }

    fn clip<'s>(&'s self, steps: &'s [InterFrame]) -> Clip<'s> {
        let ClipMotion { width, height, shots, .. } = self.motion;
        Clip { width: *width, height: *height, times_s: &self.times_s, motion: steps, shots, beyond: &self.beyond }
    }

    /// The path by the motion in the picture.
    fn in_picture(&self) -> Result<VirtualPath, StabilizeError> {
        let mut path = path::plan(&self.clip(&self.steps), &self.options.in_picture(), self.run)?;
        path.segments.iter_mut().for_each(|s| self.note_missing_cameras(s));
        Ok(path)
    }

    /// The path of virtual cameras in space where there are any, otherwise the path in the picture. Of both the better one, unless
    /// the options select one, or only cameras in space can follow the path.
    fn in_space(&self, cameras: &ClipCameras, tracks: &Tracks) -> Result<VirtualPath, StabilizeError> {
        let real = self.real(cameras);
        let spans = spans(cameras);
        let near = self.smoothed(&real, &spans);
        if near.iter().all(Option::is_none) {
            return self.in_picture();
        }
        let scene = ScenePoints::new(cameras, self.motion);
        let in_space = match self.target(&real, near, &spans, tracks, &scene)? {
            Target::Free(near) => {
                let views = Views::new(tracks, &scene, &near, &self.times_s, self.run)?;
                self.shown(&views, tracks, &scene, |clip, options| path::plan(clip, options, self.run))?
            }
            Target::Path(target) => self.toward(&target, tracks, &scene)?,
        };
        match self.options.in_space {
            InSpace::Auto if !self.options.path.needs_cameras() => {
                let in_picture = self.in_picture()?;
                select_path(self.motion, tracks, &in_space, &in_picture, self.options.keep_inside, self.run)
            }
            _ => Ok(in_space),
        }
    }

    /// The target of the cameras, by the options; `near`: the real cameras, low-passed.
    fn target(
        &self,
        real: &[Option<TargetPose>],
        near: Vec<Option<TargetPose>>,
        spans: &[Range<usize>],
        tracks: &Tracks,
        scene: &ScenePoints<'_>,
    ) -> Result<Target, StabilizeError> {
        let ups = self.options.horizon_lock.then(|| target_path::ups(real, spans));
        let shape = self.options.path.shape();
        if shape.is_none() && ups.is_none() {
            return Ok(Target::Free(near));
        }
        let target = TargetPath::new(near, ups, spans);
        let size = (self.motion.width, self.motion.height);
        let seen_points = |shot: &Range<usize>| target_path::seen_points(tracks, scene, size, shot, self.run);
        Ok(Target::Path(match shape {
            Some(shape) => target.shaped(shape, real, &self.times_s, seen_points)?,
            None => target,
        }))
    }

    /// The path towards target cameras, as far as the frames cover their views.
    fn toward(
        &self,
        target: &TargetPath,
        tracks: &Tracks,
        scene: &ScenePoints<'_>,
    ) -> Result<VirtualPath, StabilizeError> {
        let views = |cameras: &[Option<TargetPose>]| Views::new(tracks, scene, cameras, &self.times_s, self.run);
        let (options, clip) = (self.options.in_picture(), self.clip(&self.steps));
        let covers = |view: &Similarity2| options.covers((clip.width, clip.height), view);
        let fractions = target.fractions(|c| Ok(views(c)?.shown_from_src()), covers, |shot| clip.period_s(shot))?;
        let views = views(&target.at(&fractions))?;
        let shown_from_src = views.shown_from_src();
        let plan = |clip: &Clip<'_>, options: &PathOptions| path::plan_toward(clip, options, &shown_from_src, self.run);
        let mut path = self.shown(&views, tracks, scene, plan)?;
        for segment in &mut path.segments {
            match target.reason(&segment.frames, self.options.path.shape(), &fractions) {
                Some(reason) => segment.reason = format!("{reason}; {}", segment.reason),
                None => self.note_missing_cameras(segment),
            }
        }
        Ok(path)
    }

    /// The path that `plan` finds for the motion of the views, with its virtual cameras.
    fn shown(
        &self,
        views: &Views,
        tracks: &Tracks,
        scene: &ScenePoints<'_>,
        plan: impl Fn(&Clip<'_>, &PathOptions) -> Result<VirtualPath, PathError>,
    ) -> Result<VirtualPath, StabilizeError> {
        self.run.check()?;
        let mut steps = self.steps.clone();
        views.retarget(&mut steps);
        let clip = self.clip(&steps);
        let mut path = plan(&clip, &self.options.in_picture())?;
        let cameras = steadied(&views.cameras(&path), tracks, scene, &self.times_s, self.run)?;
        path.cameras = vec![None; cameras.len()];
        let is_bounded = self.options.keep_inside || self.options.is_bounded_by_neighbors();
        let min_crop = is_bounded.then_some(self.options.keep);
        for part in path.segments.clone() {
            if part.outcome == SegmentOutcome::Smoothed {
                views.show(&mut path, &cameras, &part.frames, &clip, min_crop);
            }
        }
        Ok(path)
    }

    /// Reports in the reason of a segment that a path only for cameras in space was replaced by a linear one.
    fn note_missing_cameras(&self, segment: &mut Segment) {
        let method = self.options.path;
        if method.needs_cameras() {
            segment.reason = format!("no cameras for {method}, linear instead; {}", segment.reason);
        }
    }

    /// The path from a file.
    fn along(&self, file: &Path, cameras: &ClipCameras, tracks: &Tracks) -> Result<VirtualPath, StabilizeError> {
        let given = path_file::read(file, cameras, &self.times_s)?;
        let target: Vec<_> = (given.poses.iter().enumerate())
            .map(|(frame, pose)| pose.map(|pose| target_pose(pose, cameras.is_rotation_only(frame))))
            .collect();
        let ups = self.options.horizon_lock.then(|| target_path::ups(&self.real(cameras), &spans(cameras)));
        let target = TargetPath::new(target, ups, &spans(cameras)).at(&vec![1.0; self.times_s.len()]);
        let scene = ScenePoints::new(cameras, self.motion);
        let views = Views::new(tracks, &scene, &target, &self.times_s, self.run)?;
        if views.known() == 0 {
            let reason = "the target cameras see none of the points that the clip's cameras saw";
            return Err(StabilizeError::Input(format!("{}: {reason}", file.display())));
        }
        let mut path =
            path::plan_along(&self.clip(&self.steps), &self.options.in_picture(), &views.out_from_src(), self.run)?;
        path.cameras = views.cameras(&path);
        let aligned = format!("; aligned to {:.2} % of the path's length", 100.0 * given.residual);
        path.segments.iter_mut().for_each(|s| s.reason.push_str(&aligned));
        Ok(path)
    }

    /// The real cameras of the clip, where they are accurate enough to be shown.
    fn real(&self, cameras: &ClipCameras) -> Vec<Option<TargetPose>> {
        let of_shot = |shot: &ShotCameras| {
            let rotation_only = self.options.in_space == InSpace::Rotation || shot.verdict == SfmVerdict::RotationOnly;
            let usable = rotation_only || shot.verdict == SfmVerdict::ThreeD;
            let camera =
                |camera: &Option<FrameCamera>| camera.filter(|_| usable).map(|c| target_pose(c.pose, rotation_only));
            let mut real: Vec<_> = cameras.frames[shot.frames.clone()].iter().map(camera).collect();
            for run in real.chunk_by_mut(|a, b| a.is_some() == b.is_some()).filter(|run| run.len() < MIN_RUN) {
                run.fill(None);
            }
            real
        };
        cameras.shots.iter().flat_map(of_shot).collect()
    }

    /// The same, smoothed span by span.
    fn smoothed(&self, real: &[Option<TargetPose>], spans: &[Range<usize>]) -> Vec<Option<TargetPose>> {
        let fraction = if self.options.path == PathMethod::Gaussian { 1.0 } else { SMOOTHNESS_IN_SPACE };
        let of_shot = |shot: &Range<usize>| {
            let real = &real[shot.clone()];
            let own: Vec<_> = real.iter().map(|w| w.map(|w| w.pose)).collect();
            let poses = path::smoothed_poses(&self.times_s[shot.clone()], &own, fraction * self.options.smoothness);
            let smooth =
                |(real, pose): (&Option<TargetPose>, Option<CameraPose>)| Some(TargetPose { pose: pose?, ..(*real)? });
            real.iter().zip(poses).map(smooth).collect::<Vec<_>>()
        };
        spans.iter().flat_map(of_shot).collect()
    }
}

/// Target of the virtual cameras.
enum Target {
    /// These cameras, with windows chosen by the planner.
    Free(Vec<Option<TargetPose>>),
    /// A given path.
    Path(TargetPath),
}

/// The ranges of frames that share coordinates.
fn spans(cameras: &ClipCameras) -> Vec<Range<usize>> {
    cameras.shots.iter().map(|s| s.frames.clone()).collect()
}

/// A target pose; one that only rotates has no position.
fn target_pose(pose: CameraPose, rotation_only: bool) -> TargetPose {
    let translation = if rotation_only { Vec3::zeros() } else { pose.translation };
    TargetPose { pose: CameraPose { translation, ..pose }, rotation_only }
}

fn inter_frame(motion: &FrameMotion) -> InterFrame {
    let reliable = !matches!(motion.quality, MotionQuality::Lost);
    InterFrame { similarity: motion.similarity, homography: motion.homography, reliable }
}
