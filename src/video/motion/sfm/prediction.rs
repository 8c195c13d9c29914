//! Held-out validation: whether depth predicts observations that were not used to estimate it.
//!
//! Low residuals do not prove correct cameras: with one depth per track, a spurious translation explains even a
//! rotating camera down to the noise. A spurious model, however, does not predict where a point moves next. A frame
//! `s` and a later frame `t` share tracks; every second one is held out, and its position in `t` is predicted twice
//! from its position in `s`:
//!
//! - in space, `Y = R_ts m + w t_ts`, with `w` triangulated from the frames up to `s` alone and the camera of `t`
//!   estimated from the other tracks alone;
//! - by the homography from `s` to `t` that fits the other tracks best, the most general motion of a scene without
//!   depth, or of a camera that only rotates.
//!
//! Both are estimated by the same robust search. Prediction errors are truncated at the same limit, because
//! independently moving objects have large errors under both. The motion of the camera during the readout is part of
//! the first prediction; for the second its rotation is removed from the observations beforehand.

use rayon::prelude::*;

use super::absolute_pose::absolute_pose;
use super::correspondence::Correspondence;
use super::homography_search::ByPlane;
use super::mapper::WRONG_PX;
use super::robust_search::robust_search;
use super::three_point::PointRay;
use super::triangulate::{View, triangulate};
use super::{Match, Observation, Scene, TrackTable};
use plumbline_camera::{CameraPose, Point3, Vec3};
use plumbline_num::math::{Point2, Vec2};
use plumbline_num::optim::ransac::MsacOptions;
use plumbline_num::run::{Run, Stopped};

/// Number of frame pairs that are evaluated, spread over the shot: with at least [`MIN_TRACKS`] held-out tracks each, 288
/// predictions.
const PAIRS: usize = 24;
/// Maximum number of frames between the two of a pair: path smoothing looks about as far ahead.
const MAX_GAP: usize = 40;
/// Minimum fraction of the tracks of the first frame that the second one still observes.
const SURVIVORS: f64 = 0.4;
/// Neighbors on either side that a frame of a pair must have, to determine its motion during the readout.
const AROUND: usize = 2;
/// Minimum number of frames up to the first one of the pair in which a held-out track is observed.
const MIN_KNOWN: usize = 8;
/// Minimum inverse depth, in the unit of the scene: points farther away are used at this depth. Over a baseline of one unit
/// they move by less than a thousandth of a pixel (f = 600 px).
const MIN_INVERSE_DEPTH: f64 = 1e-6;
/// Minimum number of tracks to fit, and of held-out tracks: three equations per parameter of a homography.
const MIN_TRACKS: usize = 12;

/// Prediction error of held-out observations.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Prediction {
    /// Number of predicted observations.
    pub(super) observations: usize,
    /// Root mean square prediction error in space, px; single errors are truncated at 3 px at 640 px across.
    pub(super) space_px: f64,
    /// The same with homographies.
    pub(super) plane_px: f64,
}

/// Predicts held-out observations of a shot; zero observations if too few tracks are long enough.
pub(super) fn predict(table: &TrackTable, scene: &Scene, run: &Run) -> Result<Prediction, Stopped> {
    let frames = table.frames();
    let last = frames.saturating_sub(AROUND + 1);
    let start = |k: usize| MIN_KNOWN + k * last.saturating_sub(MIN_KNOWN) / PAIRS;
    let mut starts: Vec<usize> = (0..PAIRS).map(start).filter(|s| s + 2 <= last).collect();
    starts.dedup();
    let evaluated: Vec<Sums> =
        starts.into_par_iter().filter_map(|s| Pair::from(table, scene, s)?.evaluated(scene, run)).collect();
    let total = evaluated.into_iter().fold(Sums::default(), |a, b| Sums {
        count: a.count + b.count,
        space: a.space + b.space,
        plane: a.plane + b.plane,
    });
    let px = |sum: f64| scene.intrinsics.focal * (sum / total.count.max(1) as f64).sqrt();
    run.complete(Prediction { observations: total.count, space_px: px(total.space), plane_px: px(total.plane) })
}

/// Sums of squared prediction errors, normalized image coordinates.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    count: usize,
    space: f64,
    plane: f64,
}

/// Two frames and their common tracks.
struct Pair<'a> {
    table: &'a TrackTable,
    first: (usize, CameraPose),
    second: (usize, CameraPose),
    /// The tracks to fit; the held-out tracks follow.
    fit: Vec<Match>,
    held_out: Vec<Match>,
}

impl<'a> Pair<'a> {
    /// The pair from a first frame to the last frame that enough of its tracks reach.
    fn from(table: &'a TrackTable, scene: &Scene, first: usize) -> Option<Self> {
        let seen = table.in_frame(first).len() as f64;
        let enough = |shared: &Vec<Match>| shared.len() as f64 >= SURVIVORS * seen;
        let last = (first + MAX_GAP).min(table.frames().checked_sub(AROUND + 1)?);
        let (second, shared) =
            (first + 2..=last).rev().map(|t| (t, table.shared(first, t))).find(|(_, shared)| enough(shared))?;
        let (fit, held_out): (Vec<_>, Vec<_>) = shared.into_iter().partition(|m| m.point % 2 == 0);
        let pose = |f: usize| scene.poses[f].map(|p| (f, p));
        (fit.len() >= MIN_TRACKS && held_out.len() >= MIN_TRACKS)
            .then(|| Some(Self { table, first: pose(first)?, second: pose(second)?, fit, held_out }))?
    }

    fn evaluated(&self, scene: &Scene, run: &Run) -> Option<Sums> {
        let limit = WRONG_PX * self.table.unit_px() / scene.intrinsics.focal;
        let options = MsacOptions { threshold: limit, min_samples: 20, max_samples: 500, local_steps: 5 };
        let found = self.camera(scene, &options, run)? * self.second.1.inverse();
        let ends = |m: &Match| Row::of(scene, self.first.0, m.first).zip(Row::of(scene, self.second.0, m.second));
        let pair = |(a, b): (Row, Row)| {
            Correspondence::new(a.without_rotation(&self.first.1), b.without_rotation(&self.second.1))
        };
        let pairs: Vec<Correspondence> = self.fit.iter().filter_map(ends).map(pair).collect();
        let plane = robust_search(&ByPlane(&pairs), &options, None, self.first.0 as u64, run).ok()??.model;
        let squared_error = |y: Vec3, seen: Vec2| {
            let squared = (y.xy() / y.z - seen).norm_squared();
            if y.z > 0.0 && squared <= limit * limit { squared } else { limit * limit }
        };
        let mut sums = Sums::default();
        for (m, (a, b)) in self.held_out.iter().filter_map(|m| Some((m, ends(m)?))) {
            let Some(inverse_depth) = self.inverse_depth(scene, m.point, &a) else { continue };
            let b_from_a = found * b.pose * a.pose.inverse();
            let flat = pair((a, b));
            sums.count += 1;
            sums.space +=
                squared_error(b_from_a.rotation * a.seen.push(1.0) + inverse_depth * b_from_a.translation, b.seen);
            sums.plane += squared_error(plane * flat.first, flat.second.xy());
        }
        (sums.count > 0).then_some(sums)
    }

    /// The camera of the second frame, estimated from the tracks to fit alone.
    fn camera(&self, scene: &Scene, options: &MsacOptions, run: &Run) -> Option<CameraPose> {
        let observation = |m: &Match| {
            let point = scene.points[m.point as usize]?;
            let anchor = scene.poses[point.anchor as usize]?;
            let row = Row::of(scene, self.second.0, m.second)?;
            let depth = 1.0 / point.inverse_depth.max(MIN_INVERSE_DEPTH);
            // Observation of the point as it would be without camera motion during the readout.
            let moved = self.second.1.inverse() * row.pose * anchor.inverse();
            Some(PointRay { point: moved.apply(&Point3::from(point.direction() * depth)), ray: row.seen })
        };
        let known: Vec<PointRay> = self.fit.iter().filter_map(observation).collect();
        Some(absolute_pose(&known, options, Some(self.second.1), self.second.0 as u64, run).ok()??.model)
    }

    /// Inverse depth in the first frame, triangulated from observations up to that frame.
    fn inverse_depth(&self, scene: &Scene, point: u32, anchor: &Row) -> Option<f64> {
        let from_anchor = anchor.pose.inverse();
        let before = self.table.of_point(point as usize).take_while(|o| (o.frame as usize) < self.first.0);
        let view = |o: &Observation| {
            let row = Row::of(scene, o.frame as usize, o.pixel)?;
            Some(View { view_from_anchor: row.pose * from_anchor, ray: row.seen })
        };
        let views: Vec<View> = before.filter_map(view).collect();
        (views.len() >= MIN_KNOWN).then(|| triangulate(anchor.seen, &views)).flatten().map(|t| t.inverse_depth.max(0.0))
    }
}

/// An observation with the camera pose at the capture time of its row.
#[derive(Clone, Copy, Debug)]
struct Row {
    pose: CameraPose,
    /// Normalized image coordinates.
    seen: Vec2,
}

impl Row {
    /// The camera motion around the middle row is interpolated from the neighboring frames by differences of fourth
    /// order: a shake of several Hz is far from linear between two frames. If one of the nearest is unknown the camera
    /// is taken as constant.
    fn of(scene: &Scene, frame: usize, pixel: Point2) -> Option<Self> {
        let (pose, seen) = (scene.poses[frame]?, scene.intrinsics.undistorted(pixel)?);
        let neighbor = |f: Option<usize>| scene.poses.get(f?).copied().flatten();
        let difference = |reach: usize| {
            let (before, after) = (neighbor(frame.checked_sub(reach))?, neighbor(Some(frame + reach))?);
            let rotation = (after.rotation * before.rotation.inverse()).scaled_axis();
            Some((rotation, after.translation - before.translation))
        };
        let Some(near) = difference(1).filter(|_| scene.readout != 0.0) else { return Some(Self { pose, seen }) };
        let speed = match difference(2) {
            Some(far) => ((8.0 * near.0 - far.0) / 12.0, (8.0 * near.1 - far.1) / 12.0),
            None => (0.5 * near.0, 0.5 * near.1),
        };
        let middle = scene.intrinsics.center.y;
        let time = (pixel.y - middle) / (2.0 * middle) * scene.readout;
        Some(Self { pose: pose.perturbed(&(time * speed.0), &(time * speed.1)), seen })
    }

    /// The observation without the camera rotation since the frame's own time.
    fn without_rotation(&self, frame: &CameraPose) -> Vec2 {
        let ray = frame.rotation * self.pose.rotation.inverse() * self.seen.push(1.0);
        ray.xy() / ray.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::sfm::ScenePoint;
    use crate::motion::sfm::tests::synthetic::{Course, Shot, ShotOptions};

    /// The true cameras, and the points at the first observation and the given `depth`.
    fn scene(shot: &Shot, table: &TrackTable, depth: impl Fn(&ScenePoint) -> f64) -> Scene {
        let point = |p: usize| {
            let truth = shot.truth.points[table.id(p as u32) as usize]?;
            Some(ScenePoint { inverse_depth: depth(&truth), ..truth })
        };
        Scene { points: (0..table.points()).map(point).collect(), ..shot.truth.clone() }
    }

    fn shot(course: Course, noise_px: f64, readout: f64) -> Shot {
        Shot::new(&ShotOptions { seed: 5, frames: 60, course, noise_px, readout, ..ShotOptions::default() })
    }

    #[test]
    fn exact_tracks_of_a_walk_are_predicted_exactly_in_space_and_not_by_homographies() {
        for readout in [0.0, 0.5] {
            let shot = shot(Course::Walk, 0.0, readout);
            let table = shot.table();
            let found = predict(&table, &scene(&shot, &table, |p| p.inverse_depth), &Run::default())
                .expect("a run that never stops");
            // Differences of fourth order have an error of an eighth of the speed of a 7 Hz shake, 0.3 px at the first
            // and the last row.
            let exact = if readout == 0.0 { 1e-6 } else { 0.5 };
            assert!(found.observations > 500 && found.space_px < exact && found.plane_px > 1.0, "{found:?}");
        }
    }

    #[test]
    fn a_false_translation_of_a_rotating_camera_predicts_worse_than_homographies() {
        let shot = shot(Course::Rotation, 0.2, 0.0);
        let table = shot.table();
        let mut made_up = scene(&shot, &table, |p| p.inverse_depth);
        let mut random = fastrand::Rng::with_seed(1);
        for (frame, pose) in made_up.poses.iter_mut().enumerate() {
            let drift = Vec3::new(0.004 * frame as f64, 0.01 * random.f64(), 0.0);
            pose.as_mut().expect("true").translation += drift;
        }
        let found = predict(&table, &made_up, &Run::default()).expect("a run that never stops");
        assert!(found.observations > 500 && found.space_px > 1.1 * found.plane_px, "{found:?}");
    }

    #[test]
    fn shots_too_short_or_without_cameras_have_no_predictions() {
        let whole = shot(Course::Walk, 0.0, 0.0);
        let table_of = whole.table();
        let blind = Scene { poses: vec![None; 60], ..scene(&whole, &table_of, |p| p.inverse_depth) };
        assert_eq!(predict(&table_of, &blind, &Run::default()).expect("a run that never stops").observations, 0);
        let short = Shot::new(&ShotOptions { frames: 6, ..ShotOptions::default() });
        let table = short.table();
        assert_eq!(
            predict(&table, &scene(&short, &table, |p| p.inverse_depth), &Run::default())
                .expect("a run that never stops"),
            Prediction::default()
        );
    }
}
