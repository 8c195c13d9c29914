//! The camera's path in the picture, before and after.
//!
//! With `F_t` the similarity measured from frame `t − 1` to `t`, `c` the picture's center and `B_t` the window that the result
//! shows (`src_from_out`),
//!
//! ```text
//! before   p_t = −Σ (F_s(c) − c),     θ_t = −Σ ∠F_s,              z_t = Π |F_s|
//! after    p_t + (B_t(c) − c),        θ_t + ∠B_t,                 z_t / |B_t|
//! ```
//!
//! summed from the start of each shot: the camera goes where the picture comes from. Shifts and rotations are given as a player
//! shows the picture.

use super::shown::Shown;
use crate::report::{Change, Chart, Curve, Curves};
use plumbline_num::math::{Homography, Point2, Vec2};
use plumbline_video::motion::ClipMotion;
use plumbline_video::path::VirtualPath;

/// What the plots mean, for the reader.
pub(super) const NOTE: &str = "Where the camera looked, and where it looks now: shifts of the picture’s center, rotations and zoom, \
    summed up from frame to frame within each shot, as the picture is shown. Positive is to the right, down, clockwise, nearer; \
    the zoom of the result includes what hides its borders. The colors above each plot are those of the modes below; every other \
    shot is shaded.";

/// The window that the result shows, against the whole frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Window {
    /// From the frame's center to the window's, px as shown.
    pub(super) shift: Vec2,
    /// Clockwise rotation as shown, rad.
    pub(super) rotation: f64,
    /// By how much its content is enlarged.
    pub(super) zoom: f64,
}

/// The windows of a path.
pub(super) struct Windows {
    /// `None` where a map cannot be inverted.
    pub(super) frames: Vec<Option<Window>>,
    /// Half the frame's diagonal, px.
    half_diagonal: f64,
}

impl Windows {
    pub(super) fn of(motion: &ClipMotion, path: &VirtualPath, shown: Shown) -> Self {
        let center = center(motion);
        let frames = path.out_from_src.iter().map(|m| window(m, center, shown)).collect();
        Self { frames, half_diagonal: center.coords.norm() }
    }

    /// Upper bound of how far a window moves the picture, px.
    pub(super) fn moved(&self, frame: usize) -> f64 {
        let window = self.frames.get(frame).copied().flatten();
        window.map_or(0.0, |w| w.shift.norm() + w.rotation.abs() * self.half_diagonal)
    }
}

fn window(out_from_src: &Homography, center: Point2, shown: Shown) -> Option<Window> {
    let src_from_out = out_from_src.inverse()?;
    let here = src_from_out.apply(center)?;
    let across = src_from_out.apply(center + Vec2::new(1.0, 0.0))? - here;
    Some(Window {
        shift: shown.shift(here - center),
        rotation: shown.rotation(across.y.atan2(across.x)),
        zoom: 1.0 / across.norm(),
    })
}

fn center(motion: &ClipMotion) -> Point2 {
    Point2::new(f64::from(motion.width) / 2.0, f64::from(motion.height) / 2.0)
}

/// Where the camera is, against the start of its shot: shift in px, rotation in degrees, zoom.
type CameraState = [f64; 4];

/// Plots of shift, angle and zoom.
pub(super) fn charts(motion: &ClipMotion, windows: &Windows, shown: Shown) -> Vec<Chart> {
    let before = states(motion, shown);
    let seen = |(state, window): (&CameraState, &Option<Window>)| {
        let [x, y, angle, zoom] = *state;
        window.map_or([f64::NAN; 4], |w| [x + w.shift.x, y + w.shift.y, angle + w.rotation.to_degrees(), zoom * w.zoom])
    };
    let after: Vec<CameraState> = before.iter().zip(&windows.frames).map(seen).collect();
    let axes =
        [("x, to the right", "px", 4.0), ("y, down", "px", 4.0), ("Angle, clockwise", "°", 0.5), ("Zoom", "×", 0.02)];
    let chart = |(i, (title, unit, least_span)): (usize, (&str, &str, f64))| {
        let of = |states: &[CameraState]| states.iter().map(|p| p[i]).collect();
        let curves = curves(of(&before), of(&after));
        Chart { title: title.to_owned(), unit: unit.to_owned(), least_span, curves }
    };
    axes.into_iter().enumerate().map(chart).collect()
}

/// A curve of the clip and one of the result.
pub(super) fn curves(before: Vec<f64>, after: Vec<f64>) -> Curves {
    let curve = |name: &str, values| Curve { name: name.to_owned(), values };
    Curves::Two(Change { before: curve("original", before), after: curve("result", after) })
}

fn states(motion: &ClipMotion, shown: Shown) -> Vec<CameraState> {
    let center = center(motion);
    let mut out = Vec::with_capacity(motion.frames.len());
    for shot in &motion.shots {
        let (mut shift, mut angle, mut zoom) = (Vec2::zeros(), 0.0, 1.0);
        for frame in shot.clone() {
            if frame > shot.start {
                let step = &motion.frames[frame].similarity;
                shift -= shown.shift(step.apply(center) - center);
                angle -= shown.rotation(step.angle()).to_degrees();
                zoom *= step.scale();
            }
            out.push([shift.x, shift.y, angle, zoom]);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_num::math::Similarity2;
    use plumbline_num::time::{Timebase, Timestamp};
    use plumbline_video::motion::{FrameMotion, MotionQuality};

    const UPRIGHT: Shown = Shown { rotation_deg: 0.0, mirrored: false };

    /// A clip whose picture moves by `steps`; the first is a shot's start, as is every one without a motion.
    fn clip(steps: &[Option<Similarity2>]) -> ClipMotion {
        let frame = |(i, step): (i64, &Option<Similarity2>)| {
            let quality = if step.is_some() { MotionQuality::Measured } else { MotionQuality::ShotStart };
            let similarity = step.unwrap_or(Similarity2::IDENTITY);
            FrameMotion { similarity, ..FrameMotion::still(Timestamp(i), quality) }
        };
        ClipMotion::new(640, 360, Timebase { num: 1, den: 25 }, (0..).zip(steps).map(frame).collect())
    }

    fn about(angle: f64, scale: f64, x: f64, y: f64) -> Similarity2 {
        Similarity2::about(Point2::new(320.0, 180.0), angle, scale, Vec2::new(x, y))
    }

    fn path(maps: Vec<Homography>) -> VirtualPath {
        VirtualPath { crop: vec![1.0; maps.len()], out_from_src: maps, cameras: Vec::new(), segments: Vec::new() }
    }

    fn values(chart: &Chart) -> (&[f64], &[f64]) {
        let Curves::Two(Change { before, after }) = &chart.curves else { panic!("two curves") };
        (&before.values, &after.values)
    }

    #[test]
    fn the_camera_goes_where_the_picture_comes_from_and_each_shot_starts_anew() {
        let step = Some(about(0.01, 1.1, -5.0, 3.0));
        let motion = clip(&[None, step, step, None, step]);
        let still = path(vec![Homography::identity(); 5]);
        let charts = charts(&motion, &Windows::of(&motion, &still, UPRIGHT), UPRIGHT);
        let wanted = [
            [0.0, 5.0, 10.0, 0.0, 5.0],
            [0.0, -3.0, -6.0, 0.0, -3.0],
            [0.0, -0.572_957_8, -1.145_915_6, 0.0, -0.572_957_8],
            [1.0, 1.1, 1.21, 1.0, 1.1],
        ];
        for (chart, wanted) in charts.iter().zip(wanted) {
            let (before, after) = values(chart);
            let apart = |v: &[f64]| v.iter().zip(wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(before.len() == 5 && apart(before) < 1e-6 && apart(after) < 1e-6, "{}: {before:?}", chart.title);
        }
    }

    #[test]
    fn a_window_that_takes_out_all_motion_leaves_a_camera_at_rest() {
        let steps = [about(0.0, 1.0, 4.0, -2.0), about(0.0, 1.0, -7.0, 1.0)];
        let motion = clip(&[None, Some(steps[0]), Some(steps[1])]);
        let undo = |m: Similarity2| m.inverse().expect("a motion").to_homography();
        let maps = vec![Homography::identity(), undo(steps[0]), undo(steps[1] * steps[0])];
        let path = path(maps);
        for chart in charts(&motion, &Windows::of(&motion, &path, UPRIGHT), UPRIGHT) {
            let (_, after) = values(&chart);
            assert!(after.iter().all(|v| (v - after[0]).abs() < 1e-9), "{}: {after:?}", chart.title);
        }
    }

    #[test]
    fn a_turned_clip_is_told_as_it_is_shown() {
        let motion = clip(&[None, Some(about(0.0, 1.0, -5.0, 0.0))]);
        let shown = Shown { rotation_deg: 90.0, mirrored: false };
        let still = path(vec![Homography::identity(), about(0.0, 1.0, 8.0, 0.0).to_homography()]);
        let windows = Windows::of(&motion, &still, shown);
        let charts = charts(&motion, &windows, shown);
        assert!((values(&charts[1]).0[1] - 5.0).abs() < 1e-12, "right in the coded picture is down on the screen");
        assert!((values(&charts[1]).1[1] + 3.0).abs() < 1e-9 && values(&charts[0]).1[1].abs() < 1e-9);
        assert!((windows.moved(1) - 8.0).abs() < 1e-9 && windows.moved(0) == 0.0 && windows.moved(7) == 0.0);
    }
}
