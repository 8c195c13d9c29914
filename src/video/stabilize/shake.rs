//! Shake of a clip before and after stabilization.
//!
//! With `F_t` the similarity measured from frame `t − 1` to `t` and `S_t` the virtual camera (`out_from_src`), a viewer sees
//! `M_t = F_t` before and `M_t = S_t F_t S_{t−1}⁻¹` after. The shift `M_t(c) − c` of the picture's center `c` and the
//! rotation of `M_t` there are summed along the shot; shake is the deviation of these sums from their Gaussian mean:
//!
//! ```text
//! p_t = Σ M_s(c) − c        shake = rms( p_t − (G_σ ∗ p)_t ),  σ = 0.5 s
//! ```
//!
//! It measures the camera before and after; corrections by the mesh within a frame are not included.

use std::fmt;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::motion::ClipMotion;
use crate::path::lowpass;
use plumbline_num::math::{Homography, Point2, Vec2};

/// Standard deviation of the mean, s: steps and tremor are faster, pans and rotations slower. At half of it steps count as
/// intended motion, at double of it pans count as shake.
const SIGMA_S: f64 = 0.5;

/// RMS deviation of the picture's accumulated motion from its Gaussian mean (σ = 0.5 s).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shake {
    /// Of its center, px of the source.
    pub px: f64,
    /// Of its angle, degrees.
    pub deg: f64,
}

impl fmt::Display for Shake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.2} px and {:.2}°", self.px, self.deg)
    }
}

/// Shake of the clip as measured, and as shown.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShakeSummary {
    /// As the camera recorded it.
    pub before: Shake,
    /// As the virtual camera shows it.
    pub after: Shake,
}

/// Deviation of every frame from its mean path, before and after.
pub struct PathDeviations {
    before: Vec<PathDeviation>,
    after: Vec<PathDeviation>,
}

/// Deviation of the picture from its mean path.
#[derive(Clone, Copy)]
pub(super) struct PathDeviation {
    /// Of its center, px.
    shift: Vec2,
    /// Of its angle, rad.
    rotation: f64,
}

impl PathDeviations {
    /// Of the clip itself and as seen through the cameras `out_from_src`, one per frame.
    pub fn of(motion: &ClipMotion, out_from_src: &[Homography]) -> Self {
        let measured = |t: usize| motion.frames[t].similarity.to_homography();
        let seen = |t: usize| {
            let (this, previous) = (out_from_src.get(t)?, out_from_src.get(t - 1)?);
            Some(*this * measured(t) * previous.inverse()?)
        };
        Self { before: path_deviations(motion, |t| Some(measured(t))), after: path_deviations(motion, seen) }
    }

    /// Over a range of frames; `None` where there are no frames, or not so many.
    pub fn over(&self, frames: Range<usize>) -> Option<ShakeSummary> {
        Some(ShakeSummary { before: shake(self.before.get(frames.clone())?)?, after: shake(self.after.get(frames)?)? })
    }

    /// Distance from the mean path in every frame, px, before and after.
    pub fn distances_px(&self) -> [Vec<f64>; 2] {
        [&self.before, &self.after].map(|deviations| deviations.iter().map(|s| s.shift.norm()).collect())
    }

    /// Over the whole clip.
    pub fn whole(&self) -> Option<ShakeSummary> {
        self.over(0..self.before.len())
    }
}

/// The deviations of a clip whose picture moves to frame `t` by `step(t)`.
pub(super) fn path_deviations(motion: &ClipMotion, step: impl Fn(usize) -> Option<Homography>) -> Vec<PathDeviation> {
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
        let [x, y, rotation] =
            sums.map(|s| s.iter().zip(lowpass(&s, sigma)).map(|(s, mean)| s - mean).collect::<Vec<_>>());
        out.extend((0..shot.len()).map(|i| PathDeviation { shift: Vec2::new(x[i], y[i]), rotation: rotation[i] }));
    }
    out
}

/// Shift of `center` by `m`, px, and its rotation there, rad.
fn moved(m: &Homography, center: Point2) -> Option<[f64; 3]> {
    let here = m.apply(center)?;
    let across = m.apply(center + Vec2::new(1.0, 0.0))? - here;
    let rotation = across.y.atan2(across.x);
    Some([here.x - center.x, here.y - center.y, rotation])
}

/// RMS over the frames; `None` where there are none.
pub(super) fn shake(deviations: &[PathDeviation]) -> Option<Shake> {
    if deviations.is_empty() {
        return None;
    }
    let rms = |square: &dyn Fn(&PathDeviation) -> f64| {
        (deviations.iter().map(square).sum::<f64>() / deviations.len() as f64).sqrt()
    };
    let px = rms(&|s| s.shift.x * s.shift.x + s.shift.y * s.shift.y);
    Some(Shake { px, deg: rms(&|s| s.rotation * s.rotation).to_degrees() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{FrameMotion, MotionQuality};
    use plumbline_num::math::Similarity2;
    use plumbline_num::time::{Timebase, Timestamp};

    const FRAMES: usize = 300;

    /// A clip of 640×360 px at 30/s whose center moves along `x(t)` and whose picture rotates along `rotation(t)`.
    fn clip(x: impl Fn(f64) -> f64, rotation: impl Fn(f64) -> f64) -> ClipMotion {
        let center = Point2::new(320.0, 180.0);
        let frame = |k: u32| {
            if k == 0 {
                return FrameMotion::still(Timestamp(0), MotionQuality::ShotStart);
            }
            let (now, then) = (f64::from(k), f64::from(k) - 1.0);
            let shift = Vec2::new(x(now) - x(then), 0.0);
            let step = Similarity2::about(center, rotation(now) - rotation(then), 1.0, shift);
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
        let shake = PathDeviations::of(&clip, &identity()).whole().expect("a clip");
        let root = 0.5_f64.sqrt();
        assert!((shake.before.px / (5.0 * root) - 1.0).abs() < 0.02, "{shake:?}");
        assert!((shake.before.deg / (0.02_f64.to_degrees() * root) - 1.0).abs() < 0.02, "{shake:?}");
        assert!((shake.after.px - shake.before.px).abs() < 1e-9, "nothing done, nothing changed");
    }

    #[test]
    fn a_constant_pan_has_no_shake() {
        let shake = PathDeviations::of(&clip(|t| 4.0 * t, |t| 0.001 * t), &identity()).whole().expect("a clip");
        assert!(shake.before.px < 1e-6 && shake.before.deg < 1e-6, "{shake:?}");
    }

    #[test]
    fn a_camera_that_undoes_the_motion_leaves_none() {
        let clip = clip(|t| 5.0 * (0.6 * t).sin(), |_| 0.0);
        let undo = |t: usize| {
            let shift = Vec2::new(-5.0 * (0.6 * t as f64).sin(), 0.0);
            Similarity2 { t: shift, ..Similarity2::IDENTITY }.to_homography()
        };
        let deviations = PathDeviations::of(&clip, &(0..FRAMES).map(undo).collect::<Vec<_>>());
        let shake = deviations.over(100..200).expect("inside");
        assert!(shake.before.px > 3.0 && shake.after.px < 1e-9, "{shake:?}");
        assert!(deviations.over(200..400).is_none() && deviations.over(5..5).is_none());
    }
}
