//! How much a clip shakes, before and after, for the summary.
//!
//! With `F_t` the similarity measured from frame `t − 1` to `t` and `S_t` the virtual camera (`out_from_src`), a viewer sees
//! `M_t = F_t` before and `M_t = S_t F_t S_{t−1}⁻¹` after. The shift `M_t(c) − c` of the picture's center `c` and the
//! turn of `M_t` there are summed up along the shot; shake is how far these sums stray from their own Gaussian mean:
//!
//! ```text
//! p_t = Σ M_s(c) − c        shake = rms( p_t − (G_σ ∗ p)_t ),  σ = 0.5 s
//! ```
//!
//! That is the camera as the first pass measured it and the second showed it; what the mesh straightens within a frame
//! beyond the camera's own motion is not counted.

use std::ops::Range;

use crate::pipeline::summary::{Shake, ShakeSummary};
use plumbline_num::math::{Homography, Point2, Vec2};
use plumbline_video::motion::ClipMotion;
use plumbline_video::path::lowpass;

/// Extent of the mean, s: steps and tremor lie above it, pans and turns below.
const SIGMA_S: f64 = 0.5;

/// How far every frame strays, before and after.
pub(super) struct Strays {
    before: Vec<Stray>,
    after: Vec<Stray>,
}

/// How far the picture is from its mean course: px and rad.
#[derive(Clone, Copy)]
pub(super) struct Stray {
    shift: Vec2,
    turn: f64,
}

impl Strays {
    /// Of the clip itself and as seen through the cameras `out_from_src`, one per frame.
    pub(super) fn of(motion: &ClipMotion, out_from_src: &[Homography]) -> Self {
        let measured = |t: usize| motion.frames[t].similarity.to_homography();
        let seen = |t: usize| {
            let (this, previous) = (out_from_src.get(t)?, out_from_src.get(t - 1)?);
            Some(*this * measured(t) * previous.inverse()?)
        };
        Self { before: strays(motion, |t| Some(measured(t))), after: strays(motion, seen) }
    }

    /// Over a range of frames.
    pub(super) fn over(&self, frames: Range<usize>) -> Option<ShakeSummary> {
        Some(ShakeSummary { before: shake(self.before.get(frames.clone())?)?, after: shake(self.after.get(frames)?)? })
    }

    /// Distance from the course in every frame, px, before and after.
    pub(super) fn distances_px(&self) -> [Vec<f64>; 2] {
        [&self.before, &self.after].map(|strays| strays.iter().map(|s| s.shift.norm()).collect())
    }

    /// Over the whole clip.
    pub(super) fn whole(&self) -> Option<ShakeSummary> {
        self.over(0..self.before.len())
    }
}

pub(super) fn strays(motion: &ClipMotion, step: impl Fn(usize) -> Option<Homography>) -> Vec<Stray> {
    let center = Point2::new(f64::from(motion.width) / 2.0, f64::from(motion.height) / 2.0);
    let sigma = motion.frame_period_s().map_or(0.0, |period| SIGMA_S / period);
    let mut out = Vec::with_capacity(motion.frames.len());
    for shot in &motion.shots {
        let mut at = [0.0; 3];
        let mut sums: [Vec<f64>; 3] = Default::default();
        for t in shot.clone() {
            let moved = (t > shot.start).then(|| step(t)).flatten().and_then(|m| moved(&m, center));
            for ((sum, at), by) in sums.iter_mut().zip(&mut at).zip(moved.unwrap_or_default()) {
                *at += by;
                sum.push(*at);
            }
        }
        let [x, y, turn] = sums.map(|s| s.iter().zip(lowpass(&s, sigma)).map(|(s, mean)| s - mean).collect::<Vec<_>>());
        out.extend((0..shot.len()).map(|i| Stray { shift: Vec2::new(x[i], y[i]), turn: turn[i] }));
    }
    out
}

/// Shift of `center` by `m`, px, and the turn of `m` there, rad.
fn moved(m: &Homography, center: Point2) -> Option<[f64; 3]> {
    let here = m.apply(center)?;
    let across = m.apply(center + Vec2::new(1.0, 0.0))? - here;
    let turn = across.y.atan2(across.x);
    Some([here.x - center.x, here.y - center.y, turn])
}

pub(super) fn shake(strays: &[Stray]) -> Option<Shake> {
    if strays.is_empty() {
        return None;
    }
    let rms = |square: &dyn Fn(&Stray) -> f64| (strays.iter().map(square).sum::<f64>() / strays.len() as f64).sqrt();
    let px = rms(&|s| s.shift.x * s.shift.x + s.shift.y * s.shift.y);
    Some(Shake { px, deg: rms(&|s| s.turn * s.turn).to_degrees() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_num::math::Similarity2;
    use plumbline_num::time::{Timebase, Timestamp};
    use plumbline_video::motion::{FrameMotion, MotionQuality};

    const FRAMES: usize = 300;

    /// A clip of 640×360 px at 30/s whose center moves along `x(t)` and whose picture turns along `turn(t)`.
    fn clip(x: impl Fn(f64) -> f64, turn: impl Fn(f64) -> f64) -> ClipMotion {
        let center = Point2::new(320.0, 180.0);
        let frame = |k: u32| {
            if k == 0 {
                return FrameMotion::still(Timestamp(0), MotionQuality::ShotStart);
            }
            let (now, then) = (f64::from(k), f64::from(k) - 1.0);
            let shift = Vec2::new(x(now) - x(then), 0.0);
            let step = Similarity2::about(center, turn(now) - turn(then), 1.0, shift);
            FrameMotion {
                similarity: step,
                homography: step.to_homography(),
                ..FrameMotion::still(Timestamp(k.into()), MotionQuality::Measured)
            }
        };
        ClipMotion::new(640, 360, Timebase { num: 1, den: 30 }, (0..FRAMES as u32).map(frame).collect())
    }

    fn identity() -> Vec<Homography> {
        vec![Homography::identity(); FRAMES]
    }

    #[test]
    fn a_sine_shakes_by_its_amplitude_over_the_root_of_two() {
        let omega = 2.0 * std::f64::consts::PI * 3.0 / 30.0; // 3 Hz: far above the mean
        let clip = clip(|t| 5.0 * (omega * t).sin(), |t| 0.02 * (omega * t).sin());
        let shake = Strays::of(&clip, &identity()).whole().expect("a clip");
        let root = 0.5_f64.sqrt();
        assert!((shake.before.px / (5.0 * root) - 1.0).abs() < 0.02, "{shake:?}");
        assert!((shake.before.deg / (0.02_f64.to_degrees() * root) - 1.0).abs() < 0.02, "{shake:?}");
        assert!((shake.after.px - shake.before.px).abs() < 1e-9, "nothing done, nothing changed");
    }

    #[test]
    fn an_even_pan_does_not_shake() {
        let shake = Strays::of(&clip(|t| 4.0 * t, |t| 0.001 * t), &identity()).whole().expect("a clip");
        assert!(shake.before.px < 1e-6 && shake.before.deg < 1e-6, "{shake:?}");
    }

    #[test]
    fn a_camera_that_undoes_the_motion_leaves_none() {
        let clip = clip(|t| 5.0 * (0.6 * t).sin(), |_| 0.0);
        let undo = |t: usize| {
            let shift = Vec2::new(-5.0 * (0.6 * t as f64).sin(), 0.0);
            Similarity2 { t: shift, ..Similarity2::IDENTITY }.to_homography()
        };
        let strays = Strays::of(&clip, &(0..FRAMES).map(undo).collect::<Vec<_>>());
        let shake = strays.over(100..200).expect("inside");
        assert!(shake.before.px > 3.0 && shake.after.px < 1e-9, "{shake:?}");
        assert!(strays.over(200..400).is_none() && strays.over(5..5).is_none());
    }
}
