//! Movements of a template for the skeleton that was fitted.
//!
//! Frames of the fitted joints are those of the template, turned with the bones. The character shall stand as the template does, whatever
//! it stood like at rest, turned with the whole (`R`):
//!
//! ```text
//! W_j(t) = R G_j(t)                                        so that a T and an A at rest walk alike:
//!
//! root           q'(t) = R q(t)                            p'(t) = p'₀ + s R (p(t) − p₀)
//! joints         q'(t) = q(t)                              p'(t) = p'₀ + s (p(t) − p₀)
//! ends of limbs  q'(t) = q(t) q₀⁻¹ q'₀
//! ```
//!
//! with `p₀, q₀` of the template at rest, `p'₀, q'₀` of what was fitted, in the frames of the parents, and `s` how much longer the limbs at
//! the joint are, so that steps are as long as the legs. What ends a limb keeps how it stood on the limb at rest: where a curve ends in
//! a foot says little of where its sole is.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::TemplateFit;
use crate::character::clip::{Between, Curve, RotationKeys, Track};
use crate::character::{Clip, ClipError, Keys, Skeleton};

impl TemplateFit {
    /// A movement of the template as one of the fitted skeleton. Weights of morph targets are left out: they belong to the template's
    /// surface.
    ///
    /// # Errors
    /// [`ClipError`]: a movement of joints that `template` does not have.
    pub fn retargeted(&self, template: &Skeleton, clip: &Clip) -> Result<Clip, ClipError> {
        clip.check(template.joint_count(), usize::MAX)?;
        let start = clip.span().map_or(0.0, |span| span.0);
        let mut tracks = clip.tracks().iter().map(|t| self.track(template, t)).collect::<Result<Vec<_>, _>>()?;
        for joint in 0..template.joint_count() as u32 {
            let turns = |t: &&Track| t.joint == joint && matches!(t.curve, Curve::Rotation(_));
            if clip.tracks().iter().any(|t| turns(&t)) {
                continue;
            }
            let [left, right] = self.beside(template, joint);
            let still = left * template.joints()[joint as usize].rest.rotation * right;
            if still.angle_to(&self.skeleton.joints()[joint as usize].rest.rotation) > STILL {
                let keys = Keys::new(vec![start], vec![still.coords.into()], Between::Step)?;
                tracks.push(Track { joint, curve: Curve::Rotation(RotationKeys::new(keys)?) });
            }
        }
        Clip::new(clip.name(), tracks, Vec::new())
    }

    fn track(&self, template: &Skeleton, track: &Track) -> Result<Track, ClipError> {
        let joint = track.joint;
        let (before, now) = (&template.joints()[joint as usize], &self.skeleton.joints()[joint as usize]);
        let curve = match &track.curve {
            Curve::Rotation(keys) => {
                let [left, right] = self.beside(template, joint).map(UnitQuaternion::into_inner);
                let turned = |q: &[f64; 4]| -> [f64; 4] { (left * Quaternion::from(*q) * right).coords.into() };
                Curve::Rotation(RotationKeys::new(mapped(keys.keys(), turned, turned)?)?)
            }
            Curve::Translation(keys) => {
                let turn = if before.parent.is_none() { self.rotation } else { UnitQuaternion::identity() };
                let size = self.size_at(joint);
                let along = |v: &[f64; 3]| turn * (Vector3::from(*v) * size);
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

    /// What turns of the template are multiplied by on the left and on the right.
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

    /// How much longer than in the template the limbs at a joint are.
    fn size_at(&self, joint: u32) -> f64 {
        let at = |l: &&super::FittedLimb| l.from == joint || l.to == joint;
        let stretches: Vec<f64> = self.limbs.iter().filter(at).filter_map(|l| l.stretch).collect();
        let mean = stretches.iter().sum::<f64>() / stretches.len() as f64;
        self.scale * if stretches.is_empty() { 1.0 } else { mean }
    }
}

/// Joints that the movement does not turn get a key of their own where they stood otherwise by more than that, rad.
const STILL: f64 = 1e-9;

/// Keys with other values; tangents go by `slope`.
fn mapped<const N: usize>(
    keys: &Keys<N>,
    value: impl Fn(&[f64; N]) -> [f64; N],
    slope: impl Fn(&[f64; N]) -> [f64; N],
) -> Result<Keys<N>, ClipError> {
    let between = match keys.between() {
        Between::Cubic { arriving, leaving } => Between::Cubic {
            arriving: arriving.iter().map(&slope).collect(),
            leaving: leaving.iter().map(&slope).collect(),
        },
        other => other.clone(),
    };
    Keys::new(keys.times().to_vec(), keys.values().iter().map(value).collect(), between)
}
