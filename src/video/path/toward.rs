//! The path that shows given views as far as the source covers them.

use super::chain::Chain;
use super::plan::{expect_one_per_frame, follow, plan_shots, shot_path, validate, window_of};
use super::pose::{Pose, Stage};
use super::{Clip, PathError, PathOptions, VirtualPath};
use plumbline_num::math::Similarity2;
use plumbline_num::run::Run;

/// Distance, in halves of the diagonal, below which two windows are one.
const SAME: f64 = 1e-9;

impl PathOptions {
    /// Whether a frame of `width` × `height` px covers what a view shows of it (`out_from_src`) in the smallest window allowed.
    pub fn covers(&self, (width, height): (u32, u32), out_from_src: &Similarity2) -> bool {
        let stage = Stage::new(width, height);
        let window = out_from_src.inverse().map(|s| stage.pose(s)).filter(Pose::is_finite);
        window.is_some_and(|pose| stage.widest(pose) * pose.z.norm().min(1.0) >= self.smallest_window())
    }
}

/// The virtual path that shows `wanted` (`out_from_src`, per frame where something is wanted) where the source can cover the
/// least window allowed, else held so that it does. A frame of which nothing is said gets what lies between its neighbors; a
/// shot of which nothing is said is planned by itself, as `plan` does.
///
/// # Errors
/// As for `plan_along`.
pub fn plan_toward(
    clip: &Clip<'_>,
    options: &PathOptions,
    wanted: &[Option<Similarity2>],
    run: &Run,
) -> Result<VirtualPath, PathError> {
    validate(clip, options)?;
    expect_one_per_frame(clip, wanted.len())?;
    let stage = Stage::new(clip.width, clip.height);
    Ok(plan_shots(
        clip,
        &stage,
        options.window(),
        |shot| {
            let window = |w: &Option<Similarity2>| w.as_ref().map(|w| window_of(&stage, w)).filter(Pose::is_finite);
            let known: Vec<Option<Pose>> = wanted[shot.clone()].iter().map(window).collect();
            let Some(ideal) = bridged(&known) else { return shot_path(clip, options, &stage, shot, run) };
            let chain = Chain::of_shot(clip, &stage, shot);
            let path = follow(&chain, &stage, options, &ideal, run).map_err(|e| format!("no path was found: {e}"))?;
            let reason = if alike_but_for_size(&path, &ideal) { "shown as wanted" } else { "held inside the frame" };
            Ok((path, reason.to_owned()))
        },
        run,
    )?)
}

/// Windows between which the unknown ones lie evenly; `None` where all are unknown.
fn bridged(known: &[Option<Pose>]) -> Option<Vec<Pose>> {
    let mut windows = Vec::with_capacity(known.len());
    let mut last: Option<Pose> = None;
    for (t, here) in known.iter().enumerate() {
        let next = || known[t..].iter().position(Option::is_some).map(|away| (away, known[t + away]));
        let window = match (here, last, next()) {
            (Some(here), ..) => *here,
            (None, Some(last), Some((away, Some(next)))) => last.toward(next, 1.0 / (away + 1) as f64),
            (None, None, Some((_, Some(next)))) => next,
            (None, last, _) => last?,
        };
        last = Some(window);
        windows.push(window);
    }
    Some(windows)
}

/// Whether a path stands and turns as another, at one size of its own.
fn alike_but_for_size(path: &[Pose], other: &[Pose]) -> bool {
    let Some(size) = path.first().zip(other.first()).map(|(p, o)| p.z.norm() / o.z.norm()) else { return true };
    path.iter().zip(other).all(|(p, o)| (p.z - o.z * size).norm() + (p.d - o.d).norm() < SAME)
}

#[cfg(test)]
mod tests {
    use std::ops::Range;

    use super::*;
    use crate::path::{InterFrame, plan};
    use plumbline_num::math::{Point2, Vec2};

    /// A clip of one shot of frames whose content does not move.
    fn still(frames: usize) -> (Vec<f64>, Vec<InterFrame>, Range<usize>) {
        let similarity = Similarity2::IDENTITY;
        let still = InterFrame { similarity, homography: similarity.to_homography(), reliable: true };
        ((0..frames).map(|t| t as f64 / 30.0).collect(), vec![still; frames], 0..frames)
    }

    #[test]
    fn what_is_wanted_is_shown_where_the_source_covers_it_and_bridged_where_nothing_is_said() {
        for frames in [1, 2, 3, 60] {
            let (times_s, motion, shot) = still(frames);
            let shots = std::slice::from_ref(&shot);
            let clip = Clip { width: 640, height: 360, times_s: &times_s, motion: &motion, shots };
            let shift = |t: usize| Similarity2 { t: Vec2::new(0.8 * t as f64, 2.0), ..Similarity2::IDENTITY };
            let wanted: Vec<_> = (0..frames).map(|t| (!(20..30).contains(&t)).then(|| shift(t))).collect();
            assert!(wanted.iter().flatten().all(|w| PathOptions::default().covers((640, 360), w)));
            let path = plan_toward(&clip, &PathOptions::default(), &wanted, &Run::default()).expect("valid input");
            assert_eq!(path.segments[0].reason, "shown as wanted", "{frames} frames");
            for (t, out_from_src) in path.out_from_src.iter().enumerate() {
                let middle = out_from_src.apply(Point2::new(320.0, 180.0)).expect("affine");
                let expected = shift(t).t / path.crop[t];
                assert!((middle.coords - Vec2::new(320.0, 180.0) - expected).norm() < 1e-6, "frame {t}: {middle}");
                assert!((path.crop[t] - path.crop[0]).abs() < 1e-12, "one size");
            }
        }
    }

    #[test]
    fn what_the_source_does_not_cover_is_held_inside_at_the_least_window() {
        let (times_s, motion, shot) = still(60);
        let shots = std::slice::from_ref(&shot);
        let clip = Clip { width: 640, height: 360, times_s: &times_s, motion: &motion, shots };
        let far = |t: usize| Similarity2 { t: Vec2::new(4.0 * t as f64, 0.0), ..Similarity2::IDENTITY };
        let wanted: Vec<_> = (0..60).map(|t| Some(far(t))).collect();
        let options = PathOptions::default();
        assert!(options.covers((640, 360), &far(0)) && !options.covers((640, 360), &far(59)));
        let path = plan_toward(&clip, &options, &wanted, &Run::default()).expect("valid input");
        assert_eq!(path.segments[0].reason, "held inside the frame");
        assert!(path.crop.iter().all(|c| *c >= options.min_crop - 1e-6));
        let stage = Stage::new(640, 360);
        for out_from_src in &path.out_from_src {
            let m = out_from_src.matrix();
            let map = Similarity2 { a: m[(0, 0)], b: m[(1, 0)], t: Vec2::new(m[(0, 2)], m[(1, 2)]) };
            assert!(stage.overhang(window_of(&stage, &map), 1.0) <= 1e-9);
        }
    }

    #[test]
    fn shots_of_which_nothing_is_said_are_planned_by_themselves() {
        let (times_s, mut motion, _) = still(120);
        for (t, step) in motion.iter_mut().enumerate() {
            let shift = Vec2::new(1.0, if t % 7 < 3 { 5.0 } else { -4.0 });
            step.similarity = Similarity2 { t: shift, ..Similarity2::IDENTITY };
        }
        let shots = [0..60, 60..120];
        let clip = Clip { width: 640, height: 360, times_s: &times_s, motion: &motion, shots: &shots };
        let options = PathOptions::default();
        let wanted: Vec<_> = (0..120).map(|t| (t >= 60).then_some(Similarity2::IDENTITY)).collect();
        let (mixed, alone) =
            (plan_toward(&clip, &options, &wanted, &Run::default()), plan(&clip, &options, &Run::default()));
        let (mixed, alone) = (mixed.expect("valid"), alone.expect("valid"));
        assert_eq!((&mixed.segments[0], &mixed.crop[..60]), (&alone.segments[0], &alone.crop[..60]));
        assert_eq!(mixed.segments[1].reason, "shown as wanted");
        assert!(plan_toward(&clip, &options, &wanted[1..], &Run::default()).is_err());
    }

    #[test]
    fn a_view_is_covered_up_to_the_least_window_and_no_further() {
        let options = PathOptions::default();
        let size = (640, 360);
        let about = |angle: f64, zoom: f64, x: f64| {
            Similarity2::about(Point2::new(320.0, 180.0), angle, zoom, Vec2::new(x, 0.0))
        };
        for (view, covered) in [
            (about(0.0, 1.0, 63.0), true),
            (about(0.0, 1.0, 65.0), false),
            (about(0.0, 1.24, 0.0), true),
            (about(0.0, 1.26, 0.0), false),
            (about(0.0, 0.81, 0.0), true),
            (about(0.0, 0.79, 0.0), false),
            (about(0.1, 1.0, 0.0), true),
            (about(0.2, 1.0, 0.0), false),
            (about(0.0, f64::NAN, 0.0), false),
            (about(0.0, 1.0, f64::NAN), false),
            (about(0.0, 1.0, f64::INFINITY), false),
        ] {
            assert_eq!(options.covers(size, &view), covered, "{view:?}");
        }
    }
}
