//! The hand-held camera: the intended path and the shake.
//!
//! Each of six channels (yaw, pitch, roll; x, y, z) adds to the intended path
//!
//! ```text
//! n(t) = Σₖ aₖ sin(2π fₖ t + φₖ),   aₖ ∝ 1/fₖ,   fₖ log-uniform in the shake's band,
//! ```
//!
//! scaled to a given root mean square; hand tremor and the step of a walk have such spectra.

use std::f64::consts::TAU;

use nalgebra::{Rotation3, UnitQuaternion, Vector3};

/// Sinusoids per channel: enough that no period is noticed within a minute.
const TONES: usize = 24;
/// Band of the shake, Hz: slower is intended motion, faster is blur rather than shake.
const BAND_HZ: (f64, f64) = (1.0, 7.0);

/// A camera in the world.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    /// Turns directions of the world into directions of the camera (x right, y down, z forward).
    pub cam_from_world: Rotation3<f64>,
    /// Position in the world, m.
    pub center: Vector3<f64>,
}

impl Pose {
    /// Rotation `[w, x, y, z]` (w ≥ 0) and translation of `x_in_camera = R x_in_world + t`, as in the motion file.
    pub fn quaternion_and_translation(&self) -> [f64; 7] {
        let q = UnitQuaternion::from_rotation_matrix(&self.cam_from_world);
        let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
        let t = -(self.cam_from_world * self.center);
        [sign * q.w, sign * q.i, sign * q.j, sign * q.k, t.x, t.y, t.z]
    }
}

/// What the holder of the camera means to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Walk {
    /// Down the street in a gentle arc, looking around a little.
    Ahead,
    /// A few steps sideways while somebody passes.
    Aside,
}

/// A camera path: intended motion and shake.
pub struct HandHeld {
    walk: Walk,
    duration_s: f64,
    /// (frequency in Hz, phase, amplitude in rad or m) per channel.
    tones: [Vec<(f64, f64, f64)>; 6],
}

impl HandHeld {
    /// A path of `duration_s` seconds; `strength` 1 is a walking hand: 0.6° and 2 cm root mean square.
    pub fn new(walk: Walk, duration_s: f64, strength: f64, seed: u64) -> Self {
        let mut rng = fastrand::Rng::with_seed(seed);
        let (turn, shift) = (0.6_f64.to_radians() * strength, 0.02 * strength);
        // Rolling and moving along the view are the stiffer directions of a hand.
        let rms = [turn, turn, 0.6 * turn, shift, shift, 0.6 * shift];
        Self { walk, duration_s, tones: rms.map(|rms| tones(&mut rng, rms)) }
    }

    /// Yaw, pitch, roll (rad) and center (m) of the intended path.
    fn intended_channels(&self, t: f64) -> [f64; 6] {
        let w = TAU * t / self.duration_s.max(1e-9);
        match self.walk {
            Walk::Ahead => {
                let (yaw, pitch) = (0.20 * (0.75 * w).sin(), -0.02 + 0.025 * w.sin());
                [yaw, pitch, 0.0, 0.55 * (0.6 * w).sin(), -1.62 + 0.03 * w.sin(), 1.15 * t]
            }
            Walk::Aside => {
                let yaw = -0.22 + 0.34 * (w / 2.0).sin();
                [yaw, -0.02, 0.0, -1.1 + 2.2 * t / self.duration_s, -1.6, 3.0 + 0.25 * t]
            }
        }
    }

    /// The intended, smooth camera at `t` seconds.
    pub fn intended(&self, t: f64) -> Pose {
        pose(self.intended_channels(t))
    }

    /// The shaken camera at `t` seconds.
    pub fn shaken(&self, t: f64) -> Pose {
        let mut channels = self.intended_channels(t);
        for (channel, tones) in channels.iter_mut().zip(&self.tones) {
            *channel += tones.iter().map(|(f, phase, a)| a * (TAU * f * t + phase).sin()).sum::<f64>();
        }
        pose(channels)
    }
}

fn tones(rng: &mut fastrand::Rng, rms: f64) -> Vec<(f64, f64, f64)> {
    let (low, high) = (BAND_HZ.0.ln(), BAND_HZ.1.ln());
    let frequencies: Vec<f64> = (0..TONES).map(|_| (low + (high - low) * rng.f64()).exp()).collect();
    let power: f64 = frequencies.iter().map(|f| 0.5 / (f * f)).sum();
    frequencies.into_iter().map(|f| (f, TAU * rng.f64(), rms / f / power.sqrt())).collect()
}

fn pose([yaw, pitch, roll, x, y, z]: [f64; 6]) -> Pose {
    let turn = |axis: Vector3<f64>, angle: f64| Rotation3::new(axis * angle);
    let cam_from_world = turn(Vector3::z(), -roll) * turn(Vector3::x(), -pitch) * turn(Vector3::y(), -yaw);
    Pose { cam_from_world, center: Vector3::new(x, y, z) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shake_has_the_strength_asked_for_and_no_slow_part() {
        let path = HandHeld::new(Walk::Ahead, 600.0, 2.0, 3);
        let n = 60_000;
        let off: Vec<_> = (0..n)
            .map(|i| {
                let t = f64::from(i) * 0.01;
                path.shaken(t).center - path.intended(t).center
            })
            .collect();
        let rms = (off.iter().map(|v| v.x * v.x).sum::<f64>() / f64::from(n)).sqrt();
        assert!((rms - 0.04).abs() < 0.002, "{rms} m (expected 0.04)");
        // A second's mean of a tone of 1 Hz or more is small: what is left is not a drift.
        let drift = off.chunks(1000).map(|c| c.iter().map(|v| v.x).sum::<f64>().abs() / 1000.0).fold(0.0, f64::max);
        assert!(drift < 0.01, "mean over ten seconds: {drift} m");
    }

    #[test]
    fn positive_yaw_looks_to_the_right_and_positive_pitch_up() {
        let ahead = |channels| pose(channels).cam_from_world.inverse() * Vector3::z();
        assert!(ahead([0.1, 0.0, 0.0, 0.0, 0.0, 0.0]).x > 0.0);
        assert!(ahead([0.0, 0.1, 0.0, 0.0, 0.0, 0.0]).y < 0.0);
    }

    #[test]
    fn quaternion_and_translation_are_the_pose() {
        let pose = HandHeld::new(Walk::Aside, 4.0, 1.0, 1).shaken(1.3);
        let [w, i, j, k, tx, ty, tz] = pose.quaternion_and_translation();
        let q = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, i, j, k));
        let x = Vector3::new(0.3, -2.0, 9.0);
        let expected = pose.cam_from_world * (x - pose.center);
        assert!((q * x + Vector3::new(tx, ty, tz) - expected).norm() < 1e-12);
    }

    #[test]
    fn a_seed_is_a_path() {
        let x = |seed| HandHeld::new(Walk::Ahead, 4.0, 1.0, seed).shaken(2.0).center.x;
        assert_eq!(x(1), x(1));
        assert_ne!(x(1), x(2));
    }
}
