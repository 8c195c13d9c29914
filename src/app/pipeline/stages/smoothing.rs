//! `video.smooth`: the path of the virtual camera, between the passes.

use std::ops::Range;

use super::analysis::Tracks;
use super::choice;
use super::context::Context;
use super::path_file;
use super::space::{Places, Views, Wanted, steadied};
use super::wishes::{self, Wishes};
use crate::pipeline::kinds::{InSpace, PathMethod, SmoothSettings, Zoom};
use crate::pipeline::run_error::RunError;
use plumbline_camera::{CameraPose, Vec3};
use plumbline_num::math::Similarity2;
use plumbline_num::run::Run;
use plumbline_video::motion::sfm::SfmVerdict;
use plumbline_video::motion::{ClipCameras, ClipMotion, FrameCamera, FrameMotion, MotionQuality, ShotCameras};
use plumbline_video::path::{
    self, Clip, InterFrame, PathError, PathKind, PathOptions, PathShape, Segment, VirtualPath,
};

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
        let mut path =
            path::plan(&self.clip(&self.steps), &options(self.settings), &Run::default()).map_err(not_planned)?;
        path.segments.iter_mut().for_each(|s| self.tell_of_no_cameras(s));
        Ok(path)
    }

    /// The path of virtual cameras in space where there are any, else of the picture; of both the better, unless the settings
    /// say which, or the path is one that only cameras can ride.
    fn in_space(&self, cameras: &ClipCameras, tracks: &Tracks) -> Result<VirtualPath, RunError> {
        let real = self.real(cameras);
        let spans = spans(cameras);
        let near = self.smoothed(&real, &spans);
        if near.iter().all(Option::is_none) {
            return self.in_picture();
        }
        let places = Places::new(cameras, self.motion);
        let in_space = match self.wishes(&real, near, &spans, tracks, &places)? {
            Wish::Free(near) => {
                let views = Views::new(tracks, &places, &near, &self.times_s)?;
                self.shown(&views, tracks, &places, |clip, options| path::plan(clip, options, &Run::default()))?
            }
            Wish::Given(wishes) => self.toward(&wishes, tracks, &places)?,
        };
        let ridden = matches!(self.settings.method, PathMethod::Orbit | PathMethod::Dolly);
        match self.settings.in_space {
            InSpace::Auto if !ridden => {
                choice::better(self.motion, tracks, &in_space, &self.in_picture()?, self.settings.keep_inside)
            }
            _ => Ok(in_space),
        }
    }

    /// What the settings wish of the cameras `near` the real ones.
    fn wishes(
        &self,
        real: &[Option<Wanted>],
        near: Vec<Option<Wanted>>,
        spans: &[Range<usize>],
        tracks: &Tracks,
        places: &Places<'_>,
    ) -> Result<Wish, RunError> {
        let ups = self.settings.horizon.then(|| wishes::ups(real, spans));
        let shape = shape(self.settings.method);
        if shape.is_none() && ups.is_none() {
            return Ok(Wish::Free(near));
        }
        let wishes = Wishes::new(near, ups, spans);
        let size = (self.motion.width, self.motion.height);
        let sights = |shot: &Range<usize>| wishes::sights(tracks, places, size, shot);
        Ok(Wish::Given(match shape {
            Some(shape) => wishes.shaped(shape, real, &self.times_s, sights)?,
            None => wishes,
        }))
    }

    /// The path of wished cameras, as far as the frames cover what they show.
    fn toward(&self, wishes: &Wishes, tracks: &Tracks, places: &Places<'_>) -> Result<VirtualPath, RunError> {
        let views = |cameras: &[Option<Wanted>]| Views::new(tracks, places, cameras, &self.times_s);
        let (options, clip) = (options(self.settings), self.clip(&self.steps));
        let covers = |view: &Similarity2| options.covers((clip.width, clip.height), view);
        let shares = wishes.shares(|c| Ok(views(c)?.shown_from_src()), covers, |shot| clip.period_s(shot))?;
        let views = views(&wishes.at(&shares))?;
        let wanted = views.shown_from_src();
        let plan = |clip: &Clip<'_>, options: &PathOptions| path::plan_toward(clip, options, &wanted, &Run::default());
        let mut path = self.shown(&views, tracks, places, plan)?;
        for segment in &mut path.segments {
            match wishes.told(&segment.frames, shape(self.settings.method), &shares) {
                Some(told) => segment.reason = format!("{told}; {}", segment.reason),
                None => self.tell_of_no_cameras(segment),
            }
        }
        Ok(path)
    }

    /// The path that a planner finds for the film of some views, with its virtual cameras.
    fn shown(
        &self,
        views: &Views,
        tracks: &Tracks,
        places: &Places<'_>,
        plan: impl Fn(&Clip<'_>, &PathOptions) -> Result<VirtualPath, PathError>,
    ) -> Result<VirtualPath, RunError> {
        let mut steps = self.steps.clone();
        views.retarget(&mut steps);
        let clip = self.clip(&steps);
        let mut path = plan(&clip, &options(self.settings)).map_err(not_planned)?;
        let cameras = steadied(&views.cameras(&path), tracks, places, &self.times_s)?;
        path.cameras = vec![None; cameras.len()];
        let smallest = self.settings.keep_inside.then_some(self.settings.min_crop);
        for part in path.segments.clone() {
            if part.tier == path::Tier::Smoothed {
                views.show(&mut path, &cameras, &part.frames, &clip, smallest);
            }
        }
        Ok(path)
    }

    /// Says where a path that only cameras in space can ride has become another.
    fn tell_of_no_cameras(&self, segment: &mut Segment) {
        let asked = match self.settings.method {
            PathMethod::Orbit => "orbit",
            PathMethod::Dolly => "dolly",
            _ => return,
        };
        segment.reason = format!("no cameras for {asked}, linear instead; {}", segment.reason);
    }

    /// The path that a file asks for.
    fn along(&self, file: &str, cameras: &ClipCameras, tracks: &Tracks) -> Result<VirtualPath, RunError> {
        let given = path_file::read(file, cameras, &self.times_s)?;
        let wanted: Vec<_> = (given.poses.iter().enumerate())
            .map(|(frame, pose)| pose.map(|pose| wanted(pose, cameras.turns(frame))))
            .collect();
        let ups = self.settings.horizon.then(|| wishes::ups(&self.real(cameras), &spans(cameras)));
        let wanted = Wishes::new(wanted, ups, &spans(cameras)).at(&vec![1.0; self.times_s.len()]);
        let views = Views::new(tracks, &Places::new(cameras, self.motion), &wanted, &self.times_s)?;
        if views.known() == 0 {
            let blind = "the wanted cameras see nothing of what the clip's cameras saw";
            return Err(RunError::Input(format!("{file}: {blind}")));
        }
        let planned =
            path::plan_along(&self.clip(&self.steps), &options(self.settings), &views.out_from_src(), &Run::default());
        let mut path = planned.map_err(not_planned)?;
        path.cameras = views.cameras(&path);
        let aligned = format!("; aligned to {:.2} % of the path's length", 100.0 * given.residual);
        path.segments.iter_mut().for_each(|s| s.reason.push_str(&aligned));
        Ok(path)
    }

    /// The real cameras of the clip, where they bear to be drawn.
    fn real(&self, cameras: &ClipCameras) -> Vec<Option<Wanted>> {
        let of_shot = |shot: &ShotCameras| {
            let turns = self.settings.in_space == InSpace::Turn || shot.verdict == SfmVerdict::RotationOnly;
            let drawn = turns || shot.verdict == SfmVerdict::ThreeD;
            let camera = |camera: &Option<FrameCamera>| camera.filter(|_| drawn).map(|c| wanted(c.pose, turns));
            let mut real: Vec<_> = cameras.frames[shot.frames.clone()].iter().map(camera).collect();
            for run in real.chunk_by_mut(|a, b| a.is_some() == b.is_some()).filter(|run| run.len() < SHORTEST_RUN) {
                run.fill(None);
            }
            real
        };
        cameras.shots.iter().flat_map(of_shot).collect()
    }

    /// The same, smoothed span by span.
    fn smoothed(&self, real: &[Option<Wanted>], spans: &[Range<usize>]) -> Vec<Option<Wanted>> {
        let part = if self.settings.method == PathMethod::Gaussian { 1.0 } else { SPACE_SHARE };
        let of_shot = |shot: &Range<usize>| {
            let real = &real[shot.clone()];
            let own: Vec<_> = real.iter().map(|w| w.map(|w| w.pose)).collect();
            let poses = path::smoothed_poses(&self.times_s[shot.clone()], &own, part * self.settings.smoothness);
            let smooth = |(real, pose): (&Option<Wanted>, Option<CameraPose>)| Some(Wanted { pose: pose?, ..(*real)? });
            real.iter().zip(poses).map(smooth).collect::<Vec<_>>()
        };
        spans.iter().flat_map(of_shot).collect()
    }
}

/// What is wished of virtual cameras.
enum Wish {
    /// These, and windows that the planner chooses freely.
    Free(Vec<Option<Wanted>>),
    /// A path of their own.
    Given(Wishes),
}

/// The shape of the path in space that a method asks for, where it asks for one.
fn shape(method: PathMethod) -> Option<PathShape> {
    match method {
        PathMethod::Optimal | PathMethod::Gaussian => None,
        PathMethod::Linear => Some(PathShape::Linear),
        PathMethod::Parabolic => Some(PathShape::Parabolic),
        PathMethod::Tripod => Some(PathShape::Tripod),
        PathMethod::Orbit => Some(PathShape::Orbit),
        PathMethod::Dolly => Some(PathShape::Dolly),
    }
}

/// The ranges of frames that share coordinates.
fn spans(cameras: &ClipCameras) -> Vec<Range<usize>> {
    cameras.shots.iter().map(|s| s.frames.clone()).collect()
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
            PathMethod::Linear | PathMethod::Orbit | PathMethod::Dolly => PathKind::Linear,
            PathMethod::Parabolic => PathKind::Parabolic,
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
        level: settings.horizon,
        reserve: settings.reserve,
    }
}

fn inter_frame(motion: &FrameMotion) -> InterFrame {
    let reliable = !matches!(motion.quality, MotionQuality::Lost);
    InterFrame { similarity: motion.similarity, homography: motion.homography, reliable }
}
