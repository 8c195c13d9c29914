//! The path that follows target views as far as the source covers them.

use super::chain::Chain;
use super::plan::{expect_one_per_frame, follow, plan_shots, rooms, shot_path, validate, window_of};
use super::pose::{FrameUnits, Pose};
use super::{Clip, Margins, PathError, PathOptions, VirtualPath};
use plumbline_num::math::Similarity2;
use plumbline_num::run::Run;

/// Distance, in half diagonals, below which two windows are equal: a millionth of a pixel, above the rounding of the maps.
const TOLERANCE: f64 = 1e-9;

impl PathOptions {
    /// Whether a frame of `width` × `height` px covers the view `out_from_src` with the smallest window allowed.
    pub fn covers(&self, (width, height): (u32, u32), out_from_src: &Similarity2) -> bool {
        let units = FrameUnits::new(width, height);
        let window = out_from_src.inverse().map(|s| units.pose(s)).filter(Pose::is_finite);
        let frame = units.room(&Margins::default());
        window.is_some_and(|pose| units.widest(pose, &frame) * pose.z.norm().min(1.0) >= self.smallest_window())
    }
}

/// The virtual path that shows `target` (`out_from_src`, per frame that has one) where the source covers it with the smallest
/// window allowed, otherwise the nearest path that the frame covers. Frames without a target are interpolated; a shot without
/// any is planned as by `plan`.
///
/// # Errors
/// As for `plan_along`.
pub fn plan_toward(
    clip: &Clip<'_>,
    options: &PathOptions,
    target: &[Option<Similarity2>],
    run: &Run,
) -> Result<VirtualPath, PathError> {
    validate(clip, options)?;
    expect_one_per_frame(clip, target.len())?;
    let units = FrameUnits::new(clip.width, clip.height);
    Ok(plan_shots(
        clip,
        &units,
        options.window(),
        |shot| {
            let window = |w: &Option<Similarity2>| w.as_ref().map(|w| window_of(&units, w)).filter(Pose::is_finite);
            let known: Vec<Option<Pose>> = target[shot.clone()].iter().map(window).collect();
            let Some(ideal) = bridged(&known) else { return shot_path(clip, options, &units, shot, run) };
            let rooms = rooms(clip, &units, &shot);
            let chain = Chain::of_shot(clip, &units, shot);
            let path =
                follow(&chain, &units, &rooms, options, &ideal, run).map_err(|e| format!("no path was found: {e}"))?;
            let reason =
                if alike_but_for_size(&path, &ideal) { "follows the target path" } else { "constrained to the frame" };
            Ok((path, reason.to_owned()))
        },
        run,
    )?)
}

/// The windows with the unknown ones interpolated; `None` where all are unknown.
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

/// Whether two paths agree up to one constant factor of the size.
fn alike_but_for_size(path: &[Pose], other: &[Pose]) -> bool {
    let Some(size) = path.first().zip(other.first()).map(|(p, o)| p.z.norm() / o.z.norm()) else { return true };
    path.iter().zip(other).all(|(p, o)| (p.z - o.z * size).norm() + (p.d - o.d).norm() < TOLERANCE)
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
    fn covered_targets_are_followed_and_missing_ones_interpolated() {
        for frames in [1, 2, 3, 60] {
            let (times_s, motion, shot) = still(frames);
            let shots = std::slice::from_ref(&shot);
            let clip = Clip { width: 640, height: 360, times_s: &times_s, motion: &motion, shots, beyond: &[] };
            let shift = |t: usize| Similarity2 { t: Vec2::new(0.8 * t as f64, 2.0), ..Similarity2::IDENTITY };
            let target: Vec<_> = (0..frames).map(|t| (!(20..30).contains(&t)).then(|| shift(t))).collect();
            assert!(target.iter().flatten().all(|w| PathOptions::default().covers((640, 360), w)));
            let path = plan_toward(&clip, &PathOptions::default(), &target, &Run::default()).expect("valid input");
            assert_eq!(path.segments[0].reason, "follows the target path", "{frames} frames");
            for (t, out_from_src) in path.out_from_src.iter().enumerate() {
                let middle = out_from_src.apply(Point2::new(320.0, 180.0)).expect("affine");
                let expected = shift(t).t / path.crop[t];
                assert!((middle.coords - Vec2::new(320.0, 180.0) - expected).norm() < 1e-6, "frame {t}: {middle}");
                assert!((path.crop[t] - path.crop[0]).abs() < 1e-12, "one size");
            }
        }
    }

    #[test]
    fn uncovered_targets_are_constrained_to_the_frame_at_the_smallest_window() {
        let (times_s, motion, shot) = still(60);
        let shots = std::slice::from_ref(&shot);
        let clip = Clip { width: 640, height: 360, times_s: &times_s, motion: &motion, shots, beyond: &[] };
        let far = |t: usize| Similarity2 { t: Vec2::new(4.0 * t as f64, 0.0), ..Similarity2::IDENTITY };
        let target: Vec<_> = (0..60).map(|t| Some(far(t))).collect();
        let options = PathOptions::default();
        assert!(options.covers((640, 360), &far(0)) && !options.covers((640, 360), &far(59)));
        let path = plan_toward(&clip, &options, &target, &Run::default()).expect("valid input");
        assert_eq!(path.segments[0].reason, "constrained to the frame");
        assert!(path.crop.iter().all(|c| *c >= options.keep - 1e-6));
        let units = FrameUnits::new(640, 360);
        for out_from_src in &path.out_from_src {
            let m = out_from_src.matrix();
            let map = Similarity2 { a: m[(0, 0)], b: m[(1, 0)], t: Vec2::new(m[(0, 2)], m[(1, 2)]) };
            assert!(units.overhang(window_of(&units, &map), 1.0, &units.room(&Margins::default())) <= 1e-9);
        }
    }

    #[test]
    fn shots_without_targets_are_planned_as_usual() {
        let (times_s, mut motion, _) = still(120);
        for (t, step) in motion.iter_mut().enumerate() {
            let shift = Vec2::new(1.0, if t % 7 < 3 { 5.0 } else { -4.0 });
            step.similarity = Similarity2 { t: shift, ..Similarity2::IDENTITY };
        }
        let shots = [0..60, 60..120];
        let clip = Clip { width: 640, height: 360, times_s: &times_s, motion: &motion, shots: &shots, beyond: &[] };
        let options = PathOptions::default();
        let target: Vec<_> = (0..120).map(|t| (t >= 60).then_some(Similarity2::IDENTITY)).collect();
        let (mixed, alone) =
            (plan_toward(&clip, &options, &target, &Run::default()), plan(&clip, &options, &Run::default()));
        let (mixed, alone) = (mixed.expect("valid"), alone.expect("valid"));
        assert_eq!((&mixed.segments[0], &mixed.crop[..60]), (&alone.segments[0], &alone.crop[..60]));
        assert_eq!(mixed.segments[1].reason, "follows the target path");
        assert!(plan_toward(&clip, &options, &target[1..], &Run::default()).is_err());
    }

    #[test]
    fn a_view_is_covered_up_to_the_smallest_window_and_no_further() {
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
