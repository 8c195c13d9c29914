//! A hand-held camera's path in continuous time.

use std::f64::consts::TAU;

use nalgebra::UnitQuaternion;

use plumbline_camera::{CameraPose, Point3, Vec3};

/// Number of sines per channel of the shake.
const SINES: usize = 12;
/// Shake frequencies, cycles per frame: 1 to 7 Hz at 30 frames per second.
const BAND: (f64, f64) = (1.0 / 30.0, 7.0 / 30.0);

/// The intended camera motion, without shake.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Course {
    /// Forward along an arc, with a slow pan.
    Walk,
    /// Sideways.
    Side,
    /// A pan from a fixed position: the center is constant, without shake.
    Rotation,
}

/// Camera poses as a function of time, in frames.
#[derive(Clone, Debug)]
pub(crate) struct ShakyPath {
    course: Course,
    frames: f64,
    /// Three rotation channels, rad, then three translation channels: amplitude, frequency and phase of each sine.
    sines: Vec<[(f64, f64, f64); SINES]>,
}

impl ShakyPath {
    /// A path over `frames` frames; `shake` scales a typical hand's 0.6° and 2 cm.
    pub(crate) fn new(course: Course, frames: usize, shake: f64, rng: &mut fastrand::Rng) -> Self {
        let shift = if course == Course::Rotation { 0.0 } else { 0.02 };
        let sizes = [0.0105, 0.0105, 0.0063, shift, shift, 0.6 * shift];
        let sines = sizes.map(|size| {
            let mut sines = [(0.0, 0.0, 0.0); SINES];
            for sine in &mut sines {
                let frequency = BAND.0 * (BAND.1 / BAND.0).powf(rng.f64());
                *sine = (1.0 / frequency, frequency, TAU * rng.f64());
            }
            // Power falls with frequency; the sum is normalized to the target root mean square.
            let power: f64 = sines.iter().map(|s| 0.5 * s.0 * s.0).sum();
            sines.map(|(a, f, p)| (a * shake * size / power.sqrt(), f, p))
        });
        Self { course, frames: frames.max(1) as f64, sines: sines.to_vec() }
    }

    /// `cam_from_world` at a time.
    pub(crate) fn pose(&self, time: f64) -> CameraPose {
        let shake = |channel: usize| -> f64 {
            self.sines[channel].iter().map(|(a, f, p)| a * (TAU * f * time + p).sin()).sum()
        };
        let (rotation, center) = self.intended(time);
        let rotation = rotation + Vec3::new(shake(0), shake(1), shake(2));
        let center = center + Vec3::new(shake(3), shake(4), shake(5));
        let (pitch, yaw, roll) = (rotation.x, rotation.y, rotation.z);
        let about = |axis: Vec3, angle: f64| UnitQuaternion::from_scaled_axis(angle * axis);
        let rotation = about(Vec3::z(), roll) * about(Vec3::x(), pitch) * about(Vec3::y(), yaw);
        CameraPose::looking_from(Point3::from(center), rotation)
    }

    /// Rotation about x, y, z and center; meters, 0.025 m per frame.
    fn intended(&self, time: f64) -> (Vec3, Vec3) {
        let part = time / self.frames;
        let wave = (TAU * part).sin();
        match self.course {
            Course::Walk => (
                Vec3::new(0.03 * wave, 0.16 * (0.5 * TAU * part).sin(), 0.0),
                Vec3::new(0.9 * (0.75 * TAU * part).sin(), 0.08 * wave, 0.025 * time),
            ),
            Course::Side => (Vec3::new(0.0, 0.06 * wave, 0.0), Vec3::new(0.02 * time, 0.0, 0.2 * part)),
            Course::Rotation => (Vec3::new(0.05 * wave, 0.7 * part, 0.0), Vec3::zeros()),
        }
    }
}
