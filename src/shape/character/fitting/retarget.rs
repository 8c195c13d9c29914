//! Retargeting of template clips to the fitted skeleton.
//!
//! The frames of fitted joints are those of the template, rotated with the bones. The character takes the template's world pose, regardless of
//! its own rest pose, rotated by the global rotation `R`:
//!
//! ```text
//! W_j(t) = R G_j(t)                                        so that a T-pose and an A-pose at rest walk alike:
//!
//! root           q'(t) = R q(t)                            p'(t) = p'₀ + s R (p(t) − p₀)
//! joints         q'(t) = q(t)                              p'(t) = p'₀ + s (p(t) − p₀)
//! ends of limbs  q'(t) = q(t) q₀⁻¹ q'₀
//! ```
//!
//! with `p₀, q₀` the template's and `p'₀, q'₀` the fitted rest transforms in the parent frames, and `s` the stretch of the limbs at the joint,
//! so that steps scale with the legs. The end of a limb keeps its rest rotation relative to the limb: the curve's end in a foot does not
//! determine the direction of its sole.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::TemplateFit;
use crate::character::clip::{Curve, Interpolation, RotationKeys, Track};
use crate::character::{CharacterError, Clip, Keys, Skeleton};

impl TemplateFit {
    /// Retargets a clip of the template. Morph tracks are dropped: they belong to the template's surface.
    ///
    /// # Errors
    /// [`CharacterError`]: tracks of joints that `template` does not have.
    pub fn retargeted(&self, template: &Skeleton, clip: &Clip) -> Result<Clip, CharacterError> {
        clip.check(template.joint_count(), usize::MAX)?;
        let start = clip.span().map_or(0.0, |span| span.0);
        let mut tracks = clip.tracks().iter().map(|t| self.track(template, t)).collect::<Result<Vec<_>, _>>()?;
        for joint in 0..template.joint_count() as u32 {
            let rotations = |t: &&Track| t.joint == joint && matches!(t.curve, Curve::Rotation(_));
            if clip.tracks().iter().any(|t| rotations(&t)) {
                continue;
            }
            let [left, right] = self.beside(template, joint);
            let still = left * template.joints()[joint as usize].rest.rotation * right;
            // A joint without a rotation track gets a constant one if its world rotation at rest changed.
            if still.angle_to(&self.skeleton.joints()[joint as usize].rest.rotation) > ROTATION_TOLERANCE {
                let keys = Keys::new(vec![start], vec![still.coords.into()], Interpolation::Step)?;
                tracks.push(Track { joint, curve: Curve::Rotation(RotationKeys::new(keys)?) });
            }
        }
        Clip::new(clip.name(), tracks, Vec::new())
    }

    fn track(&self, template: &Skeleton, track: &Track) -> Result<Track, CharacterError> {
        let joint = track.joint;
        let (before, now) = (&template.joints()[joint as usize], &self.skeleton.joints()[joint as usize]);
        let curve = match &track.curve {
            Curve::Rotation(keys) => {
                let [left, right] = self.beside(template, joint).map(UnitQuaternion::into_inner);
                let rotated = |q: &[f64; 4]| -> [f64; 4] { (left * Quaternion::from(*q) * right).coords.into() };
                Curve::Rotation(RotationKeys::new(mapped(keys.keys(), rotated, rotated)?)?)
            }
            Curve::Translation(keys) => {
                let rotation = if before.parent.is_none() { self.rotation } else { UnitQuaternion::identity() };
                let size = self.size_at(joint);
                let along = |v: &[f64; 3]| rotation * (Vector3::from(*v) * size);
                let moved = |p: &[f64; 3]| -> [f64; 3] {
                    let from = Vector3::from(*p) - before.rest.translation;
                    (now.rest.translation + along(&from.into())).into()
                };
                Curve::Translation(mapped(keys, moved, |v| along(v).into())?)
            }
            Curve::Scale(keys) => Curve::Scale(keys.clone()),
        };
        Ok(Track { joint, curve })
    }

    /// Left and right factors of the template's rotations.
    fn beside(&self, template: &Skeleton, joint: u32) -> [UnitQuaternion<f64>; 2] {
        let none = UnitQuaternion::identity();
        let (before, now) = (&template.joints()[joint as usize], &self.skeleton.joints()[joint as usize]);
        let is_end = |j: &u32| template.children(*j).is_empty();
        if before.parent.is_none() {
            [self.rotation, none]
        } else if template.children(joint).iter().all(is_end) {
            [none, before.rest.rotation.inverse() * now.rest.rotation]
        } else {
            [none, none]
        }
    }

    /// Length ratio of the limbs at a joint.
    fn size_at(&self, joint: u32) -> f64 {
        let at = |l: &&super::FittedLimb| l.from == joint || l.to == joint;
        let stretches: Vec<f64> = self.limbs.iter().filter(at).filter_map(|l| l.stretch).collect();
        let mean = stretches.iter().sum::<f64>() / stretches.len() as f64;
        self.scale * if stretches.is_empty() { 1.0 } else { mean }
    }
}

/// Rotation difference above which a joint without a rotation track gets one, rad: above rounding.
const ROTATION_TOLERANCE: f64 = 1e-9;

/// Keys with mapped values; tangents are mapped by `slope`.
fn mapped<const N: usize>(
    keys: &Keys<N>,
    value: impl Fn(&[f64; N]) -> [f64; N],
    slope: impl Fn(&[f64; N]) -> [f64; N],
) -> Result<Keys<N>, CharacterError> {
    let interpolation = match keys.interpolation() {
        Interpolation::Cubic { arriving, leaving } => Interpolation::Cubic {
            arriving: arriving.iter().map(&slope).collect(),
            leaving: leaving.iter().map(&slope).collect(),
        },
        other => other.clone(),
    };
    Keys::new(keys.times().to_vec(), keys.values().iter().map(value).collect(), interpolation)
}
