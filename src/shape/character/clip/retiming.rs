//! Retiming and resampling of clips.

use nalgebra::UnitQuaternion;

use super::{Clip, Curve, Interpolation, Keys, MorphTrack, RotationKeys, Track, rotations};
use crate::character::CharacterError;
use plumbline_num::options::OptionError;

/// Largest number of samples per curve: four hours at 60 per second; it bounds memory to 40 MB per rotation curve.
const MAX_KEYS: f64 = 1e6;

impl Clip {
    /// Maps every key time `t` to `start + t / speed`; a negative speed reverses the clip. Reversed smooth rotations pass through the
    /// same keys on a slightly different path, because the cumulative form is not symmetric in time.
    ///
    /// # Errors
    /// [`CharacterError::Option`] for a speed of 0 or non-finite values, [`CharacterError::Input`] if keys coincide after rounding.
    pub fn retimed(&self, start: f64, speed: f64) -> Result<Self, CharacterError> {
        OptionError::check(speed != 0.0 && speed.is_finite(), "speed", speed, "any number but 0")?;
        self.each_curve(&Change { start, speed })
    }

    /// The clip between two times, s, shifted to start at 0, with linear keys every `1 / rate` seconds and at both ends.
    ///
    /// # Errors
    /// [`CharacterError::Option`] if the span is empty or the rate is out of range.
    pub fn sampled(&self, from: f64, to: f64, rate: f64) -> Result<Self, CharacterError> {
        OptionError::check(to > from && (to - from).is_finite(), "end", to, "later than the start, s")?;
        let few = rate > 0.0 && (to - from) * rate < MAX_KEYS;
        OptionError::check(few, "rate", rate, "above 0 per second, at most 10⁶ keys")?;
        // 1e-9: a span that is a multiple of the interval up to rounding gets no extra key.
        let steps = ((to - from) * rate - 1e-9).ceil().max(1.0);
        let times: Vec<f64> =
            (0..=steps as u32).map(|k| if f64::from(k) == steps { to - from } else { f64::from(k) / rate }).collect();
        self.each_curve(&Samples { from, times })
    }

    fn each_curve(&self, change: &impl Retiming) -> Result<Self, CharacterError> {
        let track = |track: &Track| {
            let curve = match &track.curve {
                Curve::Translation(keys) => Curve::Translation(change.keys(keys)?),
                Curve::Scale(keys) => Curve::Scale(change.keys(keys)?),
                Curve::Rotation(keys) => Curve::Rotation(change.rotation(keys)?),
            };
            Ok(Track { joint: track.joint, curve })
        };
        let morph = |m: &MorphTrack| Ok(MorphTrack { target: m.target, keys: change.keys(&m.keys)? });
        let tracks = self.tracks.iter().map(track).collect::<Result<_, CharacterError>>()?;
        let morphs = self.morphs.iter().map(morph).collect::<Result<_, CharacterError>>()?;
        Self::new(self.name.clone(), tracks, morphs)
    }
}

trait Retiming {
    fn keys<const N: usize>(&self, keys: &Keys<N>) -> Result<Keys<N>, CharacterError>;
    fn rotation(&self, keys: &RotationKeys) -> Result<RotationKeys, CharacterError>;
}

/// `t ↦ start + t / speed`.
struct Change {
    start: f64,
    speed: f64,
}

impl Retiming for Change {
    fn keys<const N: usize>(&self, keys: &Keys<N>) -> Result<Keys<N>, CharacterError> {
        let mut times: Vec<f64> = keys.times.iter().map(|t| self.start + t / self.speed).collect();
        let mut values = keys.values.clone();
        let scaled =
            |tangents: &[[f64; N]]| -> Vec<[f64; N]> { tangents.iter().map(|v| v.map(|x| x * self.speed)).collect() };
        let mut interpolation = match &keys.interpolation {
            Interpolation::Cubic { arriving, leaving } => {
                Interpolation::Cubic { arriving: scaled(arriving), leaving: scaled(leaving) }
            }
            other => other.clone(),
        };
        if self.speed < 0.0 {
            times.reverse();
            values.reverse();
            interpolation = match interpolation {
                Interpolation::Cubic { mut arriving, mut leaving } => {
                    arriving.reverse();
                    leaving.reverse();
                    Interpolation::Cubic { arriving: leaving, leaving: arriving }
                }
                // Reversed, a step happens at the end of its interval: each value moves to the key before. The value of the
                // former last key, which no interval followed, is dropped.
                Interpolation::Step => {
                    values.rotate_left(1);
                    let last = values.len() - 1;
                    values[last] = keys.values[0];
                    Interpolation::Step
                }
                other => other,
            };
        }
        Keys::new(times, values, interpolation)
    }

    fn rotation(&self, keys: &RotationKeys) -> Result<RotationKeys, CharacterError> {
        RotationKeys::new(self.keys(keys.keys())?)
    }
}

/// Samples at these times after `from`.
struct Samples {
    from: f64,
    times: Vec<f64>,
}

impl Retiming for Samples {
    fn keys<const N: usize>(&self, keys: &Keys<N>) -> Result<Keys<N>, CharacterError> {
        let values = self.times.iter().map(|t| keys.at(self.from + t)).collect();
        Keys::new(self.times.clone(), values, Interpolation::Linear)
    }

    fn rotation(&self, keys: &RotationKeys) -> Result<RotationKeys, CharacterError> {
        let turns: Vec<UnitQuaternion<f64>> = self.times.iter().map(|t| keys.at(self.from + t)).collect();
        rotations(self.times.clone(), &turns, Interpolation::Linear)
    }
}
