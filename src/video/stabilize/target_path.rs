//! The target path of the virtual camera in space, and the fraction to which the frames allow following it.
//!
//! A path of a given shape ([`path::shaped_poses`]) may leave the region that the source shows. From the low-passed cameras
//! `near`, which are close to the real ones, it is approached by a fraction per frame that changes slowly
//! ([`path::smoothed_fractions`]),
//!
//! ```text
//! V_t = level( near_t toward target_t by s_t ),      s_t ≤ max { s : the source covers the smallest window of the view G_t(s) }
//! ```
//!
//! (not from the real cameras: a fraction below one would bring back their shake). `level` rotates the camera about its axis
//! where the horizon is locked.

use std::collections::BTreeMap;
use std::ops::Range;

use super::error::StabilizeError;
use super::space::{ScenePoints, TargetPose};
use super::tracks::Tracks;
use crate::path::{self, PathShape, SeenPoint};
use plumbline_camera::{CameraPose, Point3, Vec3};
use plumbline_num::math::{Point2, Similarity2};
use plumbline_num::run::Run;

/// The target cameras and those near the real ones from which they are approached, one per frame of the clip.
pub(super) struct TargetPath {
    near: Vec<Option<TargetPose>>,
    target: Vec<Option<CameraPose>>,
    ups: Option<Vec<Option<Vec3>>>,
    /// Shots and the shape that is followed in each, where one was requested.
    shots: Vec<(Range<usize>, Option<PathShape>)>,
}

impl TargetPath {
    /// The path of `near` itself; level under the verticals `ups`, one per frame.
    pub(super) fn new(near: Vec<Option<TargetPose>>, ups: Option<Vec<Option<Vec3>>>, shots: &[Range<usize>]) -> Self {
        let target = near.iter().map(|near| near.map(|n| n.pose)).collect();
        Self { near, target, ups, shots: shots.iter().map(|s| (s.clone(), None)).collect() }
    }

    /// A path of a shape that is fitted to the cameras `real`.
    pub(super) fn shaped(
        mut self,
        shape: PathShape,
        real: &[Option<TargetPose>],
        times_s: &[f64],
        seen_points: impl Fn(&Range<usize>) -> Result<Vec<SeenPoint>, StabilizeError>,
    ) -> Result<Self, StabilizeError> {
        for (shot, followed) in &mut self.shots {
            let own: Vec<_> = real[shot.clone()].iter().map(|w| w.map(|w| w.pose)).collect();
            let seen_points = if shape == PathShape::Orbit { seen_points(shot)? } else { Vec::new() };
            let (poses, found) = path::shaped_poses(shape, &times_s[shot.clone()], &own, &seen_points);
            self.target[shot.clone()].copy_from_slice(&poses);
            *followed = Some(found);
        }
        Ok(self)
    }

    /// The cameras interpolated from `near` to the target by `fractions`.
    pub(super) fn at(&self, fractions: &[f64]) -> Vec<Option<TargetPose>> {
        let camera = |t: usize| {
            let (near, target) = self.near[t].zip(self.target[t])?;
            let pose = if fractions[t] >= 1.0 { target } else { near.pose.toward(&target, fractions[t]) };
            let up = self.ups.as_ref().and_then(|ups| ups[t]);
            Some(TargetPose { pose: up.map_or(pose, |up| path::leveled(&pose, &up)), ..near })
        };
        (0..self.near.len()).map(camera).collect()
    }

    /// The largest fractions that change slowly and whose views, as `shown` gives them for cameras, are covered by the source.
    pub(super) fn fractions(
        &self,
        shown: impl Fn(&[Option<TargetPose>]) -> Result<Vec<Option<Similarity2>>, StabilizeError>,
        covers: impl Fn(&Similarity2) -> bool,
        period_s: impl Fn(&Range<usize>) -> f64,
    ) -> Result<Vec<f64>, StabilizeError> {
        let frames = self.near.len();
        if self.shots.iter().all(|(_, shape)| shape.is_none()) {
            return Ok(vec![1.0; frames]);
        }
        let from = shown(&self.at(&vec![0.0; frames]))?;
        // Where the view of the near camera is unknown too, coverage cannot be tested and the target is accepted.
        let fits = |fractions: &[f64]| {
            let views = shown(&self.at(fractions))?;
            let fits = |(view, from): (&Option<Similarity2>, &Option<Similarity2>)| {
                view.as_ref().map_or(from.is_none(), &covers)
            };
            Ok::<_, StabilizeError>(views.iter().zip(&from).map(fits).collect())
        };
        let attainable = path::attainable_fractions(frames, fits)?;
        let shots: Vec<Range<usize>> = self.shots.iter().map(|(shot, _)| shot.clone()).collect();
        Ok(path::smoothed_fractions(&attainable, &shots, period_s))
    }

    /// The reason to report for the frames of a shot; `None` where it has no cameras.
    pub(super) fn reason(&self, frames: &Range<usize>, asked: Option<PathShape>, fractions: &[f64]) -> Option<String> {
        let known: Vec<f64> = frames.clone().filter(|t| self.near[*t].is_some()).map(|t| fractions[t]).collect();
        let count = (!known.is_empty()).then_some(known.len() as f64)?;
        let found = self.shots.iter().find(|(shot, _)| shot.start == frames.start).and_then(|(_, shape)| *shape);
        let mut reason = String::new();
        if let Some(found) = found {
            if asked != Some(found) {
                reason.push_str("no point of interest to orbit, ");
            }
            reason.push_str(shape_name(found));
            let (mean, least) = (known.iter().sum::<f64>() / count, known.iter().copied().fold(1.0, f64::min));
            let part = format!(" followed to {:.0} % on average, {:.0} % at least", 100.0 * mean, 100.0 * least);
            reason.push_str(if least >= 1.0 { " followed fully" } else { &part });
        }
        let level = self.ups.as_ref().is_some_and(|ups| frames.clone().any(|t| ups[t].is_some()));
        if level {
            reason.push_str(if reason.is_empty() { "level horizon" } else { ", level horizon" });
        }
        Some(reason)
    }
}

fn shape_name(shape: PathShape) -> &'static str {
    match shape {
        PathShape::Linear => "linear path",
        PathShape::Parabolic => "parabolic path",
        PathShape::Tripod => "tripod",
        PathShape::Orbit => "orbit",
        PathShape::Dolly => "dolly",
    }
}

/// The vertical of every shot, for each of its frames.
pub(super) fn ups(real: &[Option<TargetPose>], shots: &[Range<usize>]) -> Vec<Option<Vec3>> {
    let of_shot = |shot: &Range<usize>| {
        let rotations: Vec<_> = real[shot.clone()].iter().flatten().map(|w| w.pose.rotation).collect();
        vec![path::upward(&rotations); shot.len()]
    };
    shots.iter().flat_map(of_shot).collect()
}

/// The points of a shot with the number of frames that observe them and their mean distance from the center of a picture of `size`.
pub(super) fn seen_points(
    tracks: &Tracks,
    scene: &ScenePoints<'_>,
    size: (u32, u32),
    shot: &Range<usize>,
    run: &Run,
) -> Result<Vec<SeenPoint>, StabilizeError> {
    let middle = Point2::new(f64::from(size.0) / 2.0, f64::from(size.1) / 2.0);
    let mut seen: BTreeMap<u32, (Point3, usize, f64)> = BTreeMap::new();
    for frame in shot.clone() {
        run.check()?;
        for o in &tracks.store.read(frame)?.observations {
            let Some(point) = scene.of(frame, o, false) else { continue };
            let off = (Point2::new(f64::from(o.x), f64::from(o.y)) - middle).norm() / middle.coords.norm();
            let (_, frames, sum) = seen.entry(o.id).or_insert((point, 0, 0.0));
            *frames += 1;
            *sum += off;
        }
    }
    let seen_point =
        |(position, frames, sum): (Point3, usize, f64)| SeenPoint { position, frames, off_center: sum / frames as f64 };
    Ok(seen.into_values().map(seen_point).collect())
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;
    use plumbline_num::math::Vec2;

    const FRAMES: usize = 240;

    /// Cameras that wind along x and roll.
    fn winding() -> Vec<Option<TargetPose>> {
        let pose = |t: usize| {
            let s = t as f64 / 30.0;
            let roll = UnitQuaternion::from_scaled_axis(Vec3::new(0.02 * s.sin(), 0.1 * s, 0.05 * (2.0 * s).cos()));
            CameraPose::looking_from(Point3::new(s, (1.7 * s).sin(), 0.0), roll)
        };
        (0..FRAMES).map(|t| Some(TargetPose { pose: pose(t), rotation_only: false })).collect()
    }

    fn linear(ups: Option<Vec<Option<Vec3>>>) -> TargetPath {
        let times_s: Vec<f64> = (0..FRAMES).map(|t| t as f64 / 30.0).collect();
        TargetPath::new(winding(), ups, std::slice::from_ref(&(0..FRAMES)))
            .shaped(PathShape::Linear, &winding(), &times_s, |_| Ok(Vec::new()))
            .expect("no tracks are read")
    }

    /// A view is the more shifted the further the camera is from its real position.
    #[expect(clippy::unnecessary_wraps, reason = "the signature of what reads tracks")]
    fn shown(cameras: &[Option<TargetPose>]) -> Result<Vec<Option<Similarity2>>, StabilizeError> {
        let off = |(a, b): (&TargetPose, &TargetPose)| 100.0 * (a.pose.center() - b.pose.center()).y;
        let view = |x: f64| Similarity2 { t: Vec2::new(x, 0.0), ..Similarity2::IDENTITY };
        Ok(cameras.iter().zip(&winding()).map(|(a, b)| a.as_ref().zip(b.as_ref()).map(off).map(view)).collect())
    }

    #[test]
    fn a_target_path_that_fits_is_followed_fully() {
        let target = linear(None);
        let fractions = target.fractions(shown, |_| true, |_| 1.0 / 30.0).expect("no fault");
        assert!(fractions.iter().all(|s| *s == 1.0));
        let centers: Vec<Vec3> = target.at(&fractions).iter().map(|w| w.expect("known").pose.center().coords).collect();
        assert!(centers.windows(3).all(|p| (p[2] - 2.0 * p[1] + p[0]).norm() < 1e-12), "on a line at even speed");
        let reason = target.reason(&(0..FRAMES), Some(PathShape::Linear), &fractions).expect("cameras");
        assert_eq!(reason, "linear path followed fully");
    }

    #[test]
    fn a_target_path_is_followed_as_far_as_the_source_covers_it_and_the_fraction_is_reported() {
        let target = linear(None);
        let covers = |view: &Similarity2| view.t.x.abs() <= 40.0;
        let fractions = target.fractions(shown, covers, |_| 1.0 / 30.0).expect("no fault");
        let views = shown(&target.at(&fractions)).expect("no fault");
        assert!(views.iter().flatten().all(covers), "every frame is covered");
        let least = fractions.iter().copied().fold(1.0, f64::min);
        assert!(least > 0.2 && least < 0.6, "{least} at least");
        let reason = target.reason(&(0..FRAMES), Some(PathShape::Linear), &fractions).expect("cameras");
        assert!(reason.contains(&format!("{:.0} % at least", 100.0 * least)), "{reason}");
    }

    #[test]
    fn under_a_locked_horizon_every_camera_is_level_at_every_fraction() {
        let ups = ups(&winding(), std::slice::from_ref(&(0..FRAMES)));
        let up = ups[0].expect("a vertical");
        let (target, free) = (linear(Some(ups)), linear(None));
        for fraction in [0.0, 0.3, 1.0] {
            let worst = |target: &TargetPath| {
                let roll = |w: &Option<TargetPose>| path::roll(&w.expect("known").pose, &up).abs();
                target.at(&[fraction; FRAMES]).iter().map(roll).fold(0.0, f64::max)
            };
            assert!(worst(&target) < 1e-9, "fraction {fraction}: {}", worst(&target));
            assert!(fraction == 1.0 || worst(&free) > 0.01, "fraction {fraction}: {}", worst(&free));
        }
        let reason = target.reason(&(0..FRAMES), Some(PathShape::Linear), &[1.0; FRAMES]).expect("cameras");
        assert_eq!(reason, "linear path followed fully, level horizon");
    }

    #[test]
    fn an_orbit_without_a_point_of_interest_is_reported_as_a_line() {
        let times_s: Vec<f64> = (0..FRAMES).map(|t| t as f64 / 30.0).collect();
        let target = TargetPath::new(winding(), None, std::slice::from_ref(&(0..FRAMES)))
            .shaped(PathShape::Orbit, &winding(), &times_s, |_| Ok(Vec::new()))
            .expect("no fault");
        let reason = target.reason(&(0..FRAMES), Some(PathShape::Orbit), &[1.0; FRAMES]).expect("cameras");
        assert_eq!(reason, "no point of interest to orbit, linear path followed fully");
    }

    #[test]
    fn frames_without_a_camera_stay_without_one_and_constrain_no_other() {
        let mut near = winding();
        near[50..80].fill(None);
        let times_s: Vec<f64> = (0..FRAMES).map(|t| t as f64 / 30.0).collect();
        let shots = [0..100, 100..FRAMES];
        let target = TargetPath::new(near.clone(), None, &shots)
            .shaped(PathShape::Dolly, &near, &times_s, |_| Ok(Vec::new()))
            .expect("no fault");
        let fractions = target.fractions(shown, |_| true, |_| 1.0 / 30.0).expect("no fault");
        assert!(fractions.iter().all(|s| *s == 1.0));
        let cameras = target.at(&fractions);
        assert!(cameras.iter().zip(&near).all(|(a, b)| a.is_some() == b.is_some()));
        let none = TargetPath::new(vec![None; 5], None, std::slice::from_ref(&(0..5)));
        assert_eq!(none.reason(&(0..5), None, &[1.0; 5]), None);
    }
}
