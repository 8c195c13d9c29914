//! Samples of a motion, and the clip through them.

use std::sync::Arc;

use nalgebra::{Point3, UnitQuaternion};

use super::MAX_FRAMES;
use crate::character::clip::{Curve, Interpolation, Keys, Track, rotations};
use crate::character::ik::Frames;
use crate::character::{CharacterError, Clip, Extrapolation, Pose, Skeleton};
use plumbline_num::run::Run;

/// Key times of a clip, and times between them where they are further apart than the rate asks.
pub(super) fn times(clip: &Clip, rate: f64) -> Result<Vec<f64>, CharacterError> {
    let mut keys: Vec<f64> = clip.tracks().iter().flat_map(|t| t.curve.times().iter().copied()).collect();
    keys.sort_by(f64::total_cmp);
    keys.dedup();
    let mut times: Vec<f64> = keys.first().copied().into_iter().collect();
    for pair in keys.windows(2) {
        // Keys that are written in single precision differ by rounding.
        let steps = ((pair[1] - pair[0]) * rate - 1e-3).ceil().max(1.0);
        if !(times.len() as f64 + steps <= MAX_FRAMES as f64) {
            let fault = format!("the clip {:?} of {} s is too long", clip.name(), keys[keys.len() - 1] - keys[0]);
            return Err(CharacterError::Input(format!("{fault} for {rate} samples per second; give a part of it")));
        }
        times.extend((1..=steps as usize).map(|k| pair[0] + (pair[1] - pair[0]) * (k as f64 / steps)));
    }
    if times.is_empty() {
        times.push(0.0);
    }
    Ok(times)
}

/// World rotations and positions of all joints at each sample.
pub(super) struct Motion {
    pub(super) locals: Vec<Pose>,
    pub(super) rotations: Vec<Vec<UnitQuaternion<f64>>>,
    pub(super) positions: Vec<Vec<Point3<f64>>>,
}

impl Motion {
    pub(super) fn sampled(skeleton: &Skeleton, clip: &Clip, times: &[f64], run: &Run) -> Result<Self, CharacterError> {
        let mut motion = Self { locals: Vec::new(), rotations: Vec::new(), positions: Vec::new() };
        for &time in times {
            run.check()?;
            let pose = clip.pose(skeleton, time, Extrapolation::Constant)?;
            let frames = Frames::of(skeleton, &pose)?;
            motion.positions.push(frames.positions());
            motion.rotations.push(frames.rotation);
            motion.locals.push(pose);
        }
        Ok(motion)
    }
}

/// Difference from rest above which a joint has a track: above rounding.
const MOVES: f64 = 1e-12;

/// The clip through poses at times.
pub(super) fn clip(name: &str, skeleton: &Skeleton, times: &[f64], poses: &[Pose]) -> Result<Clip, CharacterError> {
    let times: Arc<[f64]> = times.into();
    let mut tracks = Vec::new();
    for (j, joint) in skeleton.joints().iter().enumerate() {
        let locals = || poses.iter().map(|pose| &pose.locals[j]);
        if locals().any(|l| l.rotation.angle_to(&joint.rest.rotation) > MOVES) {
            let values: Vec<_> = locals().map(|l| l.rotation).collect();
            let curve = Curve::Rotation(rotations(times.clone(), &values, Interpolation::Linear)?);
            tracks.push(Track { joint: j as u32, curve });
        }
        let size = joint.rest.translation.norm().max(f64::MIN_POSITIVE);
        if locals().any(|l| (l.translation - joint.rest.translation).norm() > MOVES * size) {
            let keys =
                Keys::new(times.clone(), locals().map(|l| l.translation.into()).collect(), Interpolation::Linear)?;
            tracks.push(Track { joint: j as u32, curve: Curve::Translation(keys) });
        }
    }
    Clip::new(name, tracks, Vec::new())
}
