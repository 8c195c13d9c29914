//! Cameras that are wished for in space, and how far the frames let the wish be followed.
//!
//! A path of a given shape ([`path::shaped_poses`]) may lead where the source shows nothing. From the low-passed cameras `near`,
//! which stay by the real ones, it is approached by a share per frame that changes slowly ([`path::even_shares`]),
//!
//! ```text
//! V_t = level( near_t toward wished_t by s_t ),      s_t ≤ max { s : the source covers the least window of the view G_t(s) }
//! ```
//!
//! (not from the real cameras: their shake would come back with every share that is left out). `level` turns the camera about
//! its axis where the horizon is locked.

use std::collections::BTreeMap;
use std::ops::Range;

use super::analysis::{Tracks, store_error};
use super::space::{Places, Wanted};
use crate::pipeline::run_error::RunError;
use plumbline_camera::{CameraPose, Point3, Vec3};
use plumbline_num::math::{Point2, Similarity2};
use plumbline_video::path::{self, PathShape, Sight};

/// The cameras wished for and those from which the way to them starts, one per frame of the clip.
pub(super) struct Wishes {
    near: Vec<Option<Wanted>>,
    wished: Vec<Option<CameraPose>>,
    ups: Option<Vec<Option<Vec3>>>,
    /// Shots and the shape that is followed in each, where one was wished for.
    shots: Vec<(Range<usize>, Option<PathShape>)>,
}

impl Wishes {
    /// The wish to follow `near` itself; under `ups` (one per frame) level.
    pub(super) fn new(near: Vec<Option<Wanted>>, ups: Option<Vec<Option<Vec3>>>, shots: &[Range<usize>]) -> Self {
        let wished = near.iter().map(|near| near.map(|n| n.pose)).collect();
        Self { near, wished, ups, shots: shots.iter().map(|s| (s.clone(), None)).collect() }
    }

    /// The wish for a path of a shape that is fitted to the cameras `real`.
    pub(super) fn shaped(
        mut self,
        shape: PathShape,
        real: &[Option<Wanted>],
        times_s: &[f64],
        sights: impl Fn(&Range<usize>) -> Result<Vec<Sight>, RunError>,
    ) -> Result<Self, RunError> {
        for (shot, followed) in &mut self.shots {
            let own: Vec<_> = real[shot.clone()].iter().map(|w| w.map(|w| w.pose)).collect();
            let sights = if shape == PathShape::Orbit { sights(shot)? } else { Vec::new() };
            let (poses, found) = path::shaped_poses(shape, &times_s[shot.clone()], &own, &sights);
            self.wished[shot.clone()].copy_from_slice(&poses);
            *followed = Some(found);
        }
        Ok(self)
    }

    /// The cameras at given shares of the way.
    pub(super) fn at(&self, shares: &[f64]) -> Vec<Option<Wanted>> {
        let camera = |t: usize| {
            let (near, wished) = self.near[t].zip(self.wished[t])?;
            let pose = if shares[t] >= 1.0 { wished } else { near.pose.toward(&wished, shares[t]) };
            let up = self.ups.as_ref().and_then(|ups| ups[t]);
            Some(Wanted { pose: up.map_or(pose, |up| path::leveled(&pose, &up)), ..near })
        };
        (0..self.near.len()).map(camera).collect()
    }

    /// The largest shares that change slowly and whose views, as `shown` tells them for cameras, are covered by the source.
    pub(super) fn shares(
        &self,
        shown: impl Fn(&[Option<Wanted>]) -> Result<Vec<Option<Similarity2>>, RunError>,
        covers: impl Fn(&Similarity2) -> bool,
        period_s: impl Fn(&Range<usize>) -> f64,
    ) -> Result<Vec<f64>, RunError> {
        let frames = self.near.len();
        if self.shots.iter().all(|(_, shape)| shape.is_none()) {
            return Ok(vec![1.0; frames]);
        }
        let from = shown(&self.at(&vec![0.0; frames]))?;
        // Where nothing is known of the view near by either, nothing speaks against the wish.
        let fits = |shares: &[f64]| -> Result<_, RunError> {
            let views = shown(&self.at(shares))?;
            let fits = |(view, from): (&Option<Similarity2>, &Option<Similarity2>)| {
                view.as_ref().map_or(from.is_none(), &covers)
            };
            Ok(views.iter().zip(&from).map(fits).collect())
        };
        let attainable = path::attainable_shares(frames, fits)?;
        let shots: Vec<Range<usize>> = self.shots.iter().map(|(shot, _)| shot.clone()).collect();
        Ok(path::even_shares(&attainable, &shots, period_s))
    }

    /// What is to be said of the frames of a shot; `None` where it has no cameras.
    pub(super) fn told(&self, frames: &Range<usize>, asked: Option<PathShape>, shares: &[f64]) -> Option<String> {
        let known: Vec<f64> = frames.clone().filter(|t| self.near[*t].is_some()).map(|t| shares[t]).collect();
        let count = (!known.is_empty()).then_some(known.len() as f64)?;
        let found = self.shots.iter().find(|(shot, _)| shot.start == frames.start).and_then(|(_, shape)| *shape);
        let mut told = String::new();
        if let Some(found) = found {
            if asked != Some(found) {
                told.push_str("nothing to circle about, ");
            }
            told.push_str(shape_name(found));
            let (mean, least) = (known.iter().sum::<f64>() / count, known.iter().copied().fold(1.0, f64::min));
            let part = format!(" followed {:.0} % of the way, {:.0} % at least", 100.0 * mean, 100.0 * least);
            told.push_str(if least >= 1.0 { " followed all the way" } else { &part });
        }
        let level = self.ups.as_ref().is_some_and(|ups| frames.clone().any(|t| ups[t].is_some()));
        if level {
            told.push_str(if told.is_empty() { "level horizon" } else { ", level horizon" });
        }
        Some(told)
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
pub(super) fn ups(real: &[Option<Wanted>], shots: &[Range<usize>]) -> Vec<Option<Vec3>> {
    let of_shot = |shot: &Range<usize>| {
        let rotations: Vec<_> = real[shot.clone()].iter().flatten().map(|w| w.pose.rotation).collect();
        vec![path::upward(&rotations); shot.len()]
    };
    shots.iter().flat_map(of_shot).collect()
}

/// The points of a shot, with how long and how near the middle of a picture of `size` they were seen.
pub(super) fn sights(
    tracks: &Tracks,
    places: &Places<'_>,
    size: (u32, u32),
    shot: &Range<usize>,
) -> Result<Vec<Sight>, RunError> {
    let middle = Point2::new(f64::from(size.0) / 2.0, f64::from(size.1) / 2.0);
    let mut seen: BTreeMap<u32, (Point3, usize, f64)> = BTreeMap::new();
    for frame in shot.clone() {
        for o in &tracks.store.read(frame).map_err(store_error)?.observations {
            let Some(place) = places.of(frame, o, false) else { continue };
            let off = (Point2::new(f64::from(o.x), f64::from(o.y)) - middle).norm() / middle.coords.norm();
            let (_, frames, sum) = seen.entry(o.id).or_insert((place, 0, 0.0));
            *frames += 1;
            *sum += off;
        }
    }
    let sight = |(place, frames, sum): (Point3, usize, f64)| Sight { place, frames, off_center: sum / frames as f64 };
    Ok(seen.into_values().map(sight).collect())
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;
    use plumbline_num::math::Vec2;

    const FRAMES: usize = 240;

    /// Cameras that wind their way along x and roll.
    fn winding() -> Vec<Option<Wanted>> {
        let pose = |t: usize| {
            let s = t as f64 / 30.0;
            let roll = UnitQuaternion::from_scaled_axis(Vec3::new(0.02 * s.sin(), 0.1 * s, 0.05 * (2.0 * s).cos()));
            CameraPose::looking_from(Point3::new(s, (1.7 * s).sin(), 0.0), roll)
        };
        (0..FRAMES).map(|t| Some(Wanted { pose: pose(t), turns: false })).collect()
    }

    fn linear(ups: Option<Vec<Option<Vec3>>>) -> Wishes {
        let times_s: Vec<f64> = (0..FRAMES).map(|t| t as f64 / 30.0).collect();
        Wishes::new(winding(), ups, std::slice::from_ref(&(0..FRAMES)))
            .shaped(PathShape::Linear, &winding(), &times_s, |_| Ok(Vec::new()))
            .expect("no tracks are read")
    }

    /// A view is the more shifted the further the camera is from its real place.
    #[expect(clippy::unnecessary_wraps, reason = "the signature of what reads tracks")]
    fn shown(cameras: &[Option<Wanted>]) -> Result<Vec<Option<Similarity2>>, RunError> {
        let off = |(a, b): (&Wanted, &Wanted)| 100.0 * (a.pose.center() - b.pose.center()).y;
        let view = |x: f64| Similarity2 { t: Vec2::new(x, 0.0), ..Similarity2::IDENTITY };
        Ok(cameras.iter().zip(&winding()).map(|(a, b)| a.as_ref().zip(b.as_ref()).map(off).map(view)).collect())
    }

    #[test]
    fn a_wish_that_fits_is_followed_all_the_way() {
        let wishes = linear(None);
        let shares = wishes.shares(shown, |_| true, |_| 1.0 / 30.0).expect("no fault");
        assert!(shares.iter().all(|s| *s == 1.0));
        let places: Vec<Vec3> = wishes.at(&shares).iter().map(|w| w.expect("known").pose.center().coords).collect();
        assert!(places.windows(3).all(|p| (p[2] - 2.0 * p[1] + p[0]).norm() < 1e-12), "on a line at even speed");
        let told = wishes.told(&(0..FRAMES), Some(PathShape::Linear), &shares).expect("cameras");
        assert_eq!(told, "linear path followed all the way");
    }

    #[test]
    fn a_wish_is_followed_as_far_as_the_source_covers_it_and_the_share_is_told() {
        let wishes = linear(None);
        let covers = |view: &Similarity2| view.t.x.abs() <= 40.0;
        let shares = wishes.shares(shown, covers, |_| 1.0 / 30.0).expect("no fault");
        let views = shown(&wishes.at(&shares)).expect("no fault");
        assert!(views.iter().flatten().all(covers), "every frame is covered");
        let least = shares.iter().copied().fold(1.0, f64::min);
        assert!(least > 0.2 && least < 0.6, "{least} at least");
        let told = wishes.told(&(0..FRAMES), Some(PathShape::Linear), &shares).expect("cameras");
        assert!(told.contains(&format!("{:.0} % at least", 100.0 * least)), "{told}");
    }

    #[test]
    fn under_a_locked_horizon_every_camera_is_level_at_every_share() {
        let ups = ups(&winding(), std::slice::from_ref(&(0..FRAMES)));
        let up = ups[0].expect("a vertical");
        let (wishes, free) = (linear(Some(ups)), linear(None));
        for share in [0.0, 0.3, 1.0] {
            let worst = |wishes: &Wishes| {
                let roll = |w: &Option<Wanted>| path::roll(&w.expect("known").pose, &up).abs();
                wishes.at(&[share; FRAMES]).iter().map(roll).fold(0.0, f64::max)
            };
            assert!(worst(&wishes) < 1e-9, "share {share}: {}", worst(&wishes));
            assert!(share == 1.0 || worst(&free) > 0.01, "share {share}: {}", worst(&free));
        }
        let told = wishes.told(&(0..FRAMES), Some(PathShape::Linear), &[1.0; FRAMES]).expect("cameras");
        assert_eq!(told, "linear path followed all the way, level horizon");
    }

    #[test]
    fn an_orbit_without_a_point_to_circle_about_is_told_to_be_a_line() {
        let times_s: Vec<f64> = (0..FRAMES).map(|t| t as f64 / 30.0).collect();
        let wishes = Wishes::new(winding(), None, std::slice::from_ref(&(0..FRAMES)))
            .shaped(PathShape::Orbit, &winding(), &times_s, |_| Ok(Vec::new()))
            .expect("no fault");
        let told = wishes.told(&(0..FRAMES), Some(PathShape::Orbit), &[1.0; FRAMES]).expect("cameras");
        assert_eq!(told, "nothing to circle about, linear path followed all the way");
    }

    #[test]
    fn frames_without_a_camera_stay_without_one_and_hold_nothing_back() {
        let mut near = winding();
        near[50..80].fill(None);
        let times_s: Vec<f64> = (0..FRAMES).map(|t| t as f64 / 30.0).collect();
        let shots = [0..100, 100..FRAMES];
        let wishes = Wishes::new(near.clone(), None, &shots)
            .shaped(PathShape::Dolly, &near, &times_s, |_| Ok(Vec::new()))
            .expect("no fault");
        let shares = wishes.shares(shown, |_| true, |_| 1.0 / 30.0).expect("no fault");
        assert!(shares.iter().all(|s| *s == 1.0));
        let cameras = wishes.at(&shares);
        assert!(cameras.iter().zip(&near).all(|(a, b)| a.is_some() == b.is_some()));
        let none = Wishes::new(vec![None; 5], None, std::slice::from_ref(&(0..5)));
        assert_eq!(none.told(&(0..5), None, &[1.0; 5]), None);
    }
}
