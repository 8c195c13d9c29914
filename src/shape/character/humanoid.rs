//! A procedural humanoid with joints, limits, weights and two clips, for tests and pictures.
//!
//! About 1.75 units high, y up, facing +z, arms stretched out (T-pose); joint frames at rest are axis-aligned. The twist axis of hinges
//! (elbows and knees) is the hinge axis, so that an interval limits them to one side.

use std::sync::Arc;

use nalgebra::{Point3, Unit, UnitQuaternion, Vector3};

use super::clip::rotations;
use super::weights::{WeightOptions, bone_weights};
use super::{Character, CharacterError, Clip, Curve, Interpolation, Joint, Keys, Limits, Skeleton, Skin, Track};
use crate::mesh::Model;
use crate::mesh::shapes::level_set;
use plumbline_num::math::Trs;
use plumbline_num::run::Run;

/// Name, parent and world position; of symmetric pairs the left one.
const JOINTS: [(&str, &str, [f64; 3]); 14] = [
    ("hips", "", [0.0, 0.95, 0.0]),
    ("spine", "hips", [0.0, 1.12, 0.0]),
    ("chest", "spine", [0.0, 1.3, 0.0]),
    ("neck", "chest", [0.0, 1.47, 0.0]),
    ("head", "neck", [0.0, 1.57, 0.0]),
    ("head end", "head", [0.0, 1.72, 0.0]),
    ("arm.L", "chest", [0.18, 1.4, 0.0]),
    ("forearm.L", "arm.L", [0.45, 1.4, 0.0]),
    ("hand.L", "forearm.L", [0.69, 1.4, 0.0]),
    ("hand end.L", "hand.L", [0.82, 1.4, 0.0]),
    ("leg.L", "hips", [0.1, 0.9, 0.0]),
    ("shin.L", "leg.L", [0.1, 0.5, 0.0]),
    ("foot.L", "shin.L", [0.1, 0.09, -0.02]),
    ("toes.L", "foot.L", [0.1, 0.05, 0.14]),
];

/// Radius of the capsule around the bone that ends at a joint, units of the model.
const THICK: [(&str, f64); 13] = [
    ("spine", 0.13),
    ("chest", 0.14),
    ("neck", 0.07),
    ("head", 0.06),
    ("head end", 0.105),
    ("arm.L", 0.085),
    ("forearm.L", 0.055),
    ("hand.L", 0.045),
    ("hand end.L", 0.04),
    ("leg.L", 0.1),
    ("shin.L", 0.075),
    ("foot.L", 0.055),
    ("toes.L", 0.045),
];

/// Width over which the union of two capsules is smoothed, units of the model: about the thinnest limb radius.
const CREASE: f64 = 0.04;

/// A humanoid of capsules, meshed with this cell size; 0.036 gives about seven thousand vertices.
///
/// # Errors
/// [`CharacterError`] if the cells are so coarse that the surface is empty.
pub fn humanoid(cell: f64) -> Result<Character, CharacterError> {
    let skeleton = skeleton()?;
    let limbs = limbs(&skeleton);
    let inside = |x: &Point3<f64>| limbs.iter().map(|l| l.distance(x)).reduce(joined).unwrap_or(1.0);
    let mesh = level_set(inside, Point3::new(-1.0, -0.1, -0.3), Point3::new(1.0, 1.95, 0.35), cell);
    let (weights, _) = bone_weights(&mesh, &skeleton, &WeightOptions::default(), &Run::default())?;
    let skin = Arc::new(Skin::bound(weights, &skeleton)?);
    let clips = vec![walk(&skeleton)?, wave(&skeleton)?];
    Ok(Character { clips, ..Character::new(Model::of_mesh(mesh), skeleton, skin)? })
}

/// Name of the right counterpart.
fn right(name: &str) -> Option<String> {
    name.strip_suffix(".L").map(|base| format!("{base}.R"))
}

fn skeleton() -> Result<Skeleton, CharacterError> {
    let position = |name: &str| JOINTS.iter().find(|j| j.0 == name).map_or(Vector3::zeros(), |j| Vector3::from(j.2));
    let mut joints: Vec<Joint> = Vec::new();
    let mut number = std::collections::HashMap::new();
    for mirrored in [false, true] {
        for (name, parent, at) in JOINTS {
            let own = if mirrored { right(name) } else { Some(name.to_owned()) };
            let Some(own) = own else { continue };
            let side = if mirrored { Vector3::new(-1.0, 1.0, 1.0) } else { Vector3::repeat(1.0) };
            let above = if mirrored { right(parent).unwrap_or_else(|| parent.to_owned()) } else { parent.to_owned() };
            let offset = (Vector3::from(at) - position(parent)).component_mul(&side);
            let limits = limits(name, if mirrored { -1.0 } else { 1.0 });
            let parent = number.get(&above).copied();
            number.insert(own.clone(), joints.len() as u32);
            joints.push(Joint { name: own, parent, rest: Trs::from_translation(offset), limits });
        }
    }
    Skeleton::new(joints)
}

/// Limits of a joint; `side` is 1 on the left.
fn limits(name: &str, side: f64) -> Option<Limits> {
    let hinge = |axis: Vector3<f64>, most: f64| Limits {
        swing: [0.0, 0.0],
        twist: [0.0, most],
        ..Limits::cone(Unit::new_normalize(axis), 0.0, 0.0)
    };
    let cone = |axis: Vector3<f64>, swing: f64, twist: f64| Limits::cone(Unit::new_normalize(axis), swing, twist);
    Some(match name {
        "spine" | "chest" => cone(Vector3::y(), 0.5, 0.4),
        "neck" | "head" => cone(Vector3::y(), 0.6, 0.8),
        "arm.L" => cone(Vector3::x() * side, 2.1, 1.2),
        "forearm.L" => hinge(Vector3::y() * -side, 2.5),
        "hand.L" => cone(Vector3::x() * side, 1.0, 1.0),
        "leg.L" => cone(-Vector3::y(), 1.7, 0.7),
        "shin.L" => hinge(Vector3::x(), 2.5),
        "foot.L" => cone(-Vector3::y(), 0.7, 0.3),
        _ => return None,
    })
}

/// A capsule between two joints.
struct Limb {
    ends: [Point3<f64>; 2],
    radius: f64,
}

impl Limb {
    fn distance(&self, x: &Point3<f64>) -> f64 {
        let [a, b] = self.ends;
        let (along, from) = (b - a, x - a);
        let t = (from.dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
        (from - along * t).norm() - self.radius
    }
}

fn limbs(skeleton: &Skeleton) -> Vec<Limb> {
    let at = skeleton.rest_positions();
    let thick = |name: &str| {
        let left = name.strip_suffix(".R").map_or_else(|| name.to_owned(), |base| format!("{base}.L"));
        THICK.iter().find(|(n, _)| *n == left).map(|(_, r)| *r)
    };
    let limb = |(j, joint): (usize, &Joint)| {
        Some(Limb { ends: [at[joint.parent? as usize], at[j]], radius: thick(&joint.name)? })
    };
    skeleton.joints().iter().enumerate().filter_map(limb).collect()
}

/// Smooth minimum of two distances (quadratic polynomial).
fn joined(a: f64, b: f64) -> f64 {
    let h = (CREASE - (a - b).abs()).max(0.0) / CREASE;
    a.min(b) - 0.25 * CREASE * h * h
}

/// Duration of the clips, s, and their number of key intervals.
const LENGTH: f64 = 1.2;
const KEYS: u32 = 12;

fn times() -> Vec<f64> {
    (0..=KEYS).map(|k| LENGTH * f64::from(k) / f64::from(KEYS)).collect()
}

/// A rotation track sampled over the phase of the clip, 0 to 2π.
fn turning(
    skeleton: &Skeleton,
    name: &str,
    rotation: impl Fn(f64) -> UnitQuaternion<f64>,
) -> Result<Track, CharacterError> {
    let keys: Vec<_> = times().iter().map(|t| rotation(std::f64::consts::TAU * t / LENGTH)).collect();
    Ok(Track {
        joint: skeleton.named(name)?,
        curve: Curve::Rotation(rotations(times(), &keys, Interpolation::Smooth)?),
    })
}

fn about(axis: Vector3<f64>, angle: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(axis * angle)
}

/// Angle of the lowered arms from the T-pose, rad.
const HANGING: f64 = 1.25;

fn walk(skeleton: &Skeleton) -> Result<Clip, CharacterError> {
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    let mut tracks = Vec::new();
    for (side, phase, sign) in [("L", 0.0, 1.0), ("R", std::f64::consts::PI, -1.0)] {
        let name = |part: &str| format!("{part}.{side}");
        tracks.push(turning(skeleton, &name("leg"), |t| about(x, -0.15 - 0.5 * (t + phase).sin()))?);
        tracks.push(turning(skeleton, &name("shin"), |t| about(x, 0.45 + 0.4 * (t + phase + 0.9).cos()))?);
        tracks.push(turning(skeleton, &name("foot"), |t| about(x, -0.1 + 0.2 * (t + phase).cos()))?);
        let swing = move |t: f64| about(x, 0.45 * (t + phase).sin()) * about(z, -sign * HANGING);
        tracks.push(turning(skeleton, &name("arm"), swing)?);
        tracks.push(turning(skeleton, &name("forearm"), |t| about(y, -sign * (0.4 - 0.2 * (t + phase).sin())))?);
    }
    tracks.push(turning(skeleton, "spine", |t| about(y, 0.12 * t.sin()))?);
    let hips = skeleton.joints()[skeleton.named("hips")? as usize].rest.translation;
    let height = |t: &f64| [hips.x, hips.y - 0.03 + 0.02 * (2.0 * std::f64::consts::TAU * t / LENGTH).cos(), hips.z];
    let keys = Keys::new(times(), times().iter().map(height).collect(), Interpolation::Smooth)?;
    tracks.push(Track { joint: skeleton.named("hips")?, curve: Curve::Translation(keys) });
    Clip::new("walk", tracks, Vec::new())
}

fn wave(skeleton: &Skeleton) -> Result<Clip, CharacterError> {
    let (y, z) = (Vector3::y(), Vector3::z());
    let tracks = vec![
        turning(skeleton, "arm.L", |_| about(z, -HANGING))?,
        turning(skeleton, "arm.R", |t| about(z, -0.9 + 0.1 * t.sin()) * about(Vector3::x(), -1.1))?,
        turning(skeleton, "forearm.R", |t| about(y, 0.8 + 0.5 * (2.0 * t).sin()))?,
        turning(skeleton, "head", |t| about(z, 0.1 * t.sin()))?,
    ];
    Clip::new("wave", tracks, Vec::new())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::character::Extrapolation;
    use crate::mesh::HalfEdges;

    #[test]
    fn the_humanoid_is_closed_symmetric_and_moves_within_its_limits() {
        let person = humanoid(0.05).expect("made");
        let edges = HalfEdges::new(person.model.mesh()).expect("an oriented manifold");
        assert!(edges.boundary_loops().is_empty());
        for (joint, p) in person.skeleton.joints().iter().zip(person.skeleton.rest_positions()) {
            if let Some(other) = crate::character::edit::other_side(&joint.name) {
                let q = person.skeleton.rest_positions()[person.skeleton.named(&other).expect("a pair") as usize];
                assert!((p - Point3::new(-q.x, q.y, q.z)).norm() < 1e-12, "{}", joint.name);
            }
        }
        for clip in &person.clips {
            for k in 0..=60 {
                let pose = clip.pose(&person.skeleton, f64::from(k) * 0.02, Extrapolation::Constant).expect("valid");
                for (joint, local) in person.skeleton.joints().iter().zip(&pose.locals) {
                    assert!(
                        joint.limits.is_none_or(|l| l.allows(&local.rotation, 0.02)),
                        "{} {} {k}",
                        clip.name(),
                        joint.name
                    );
                }
            }
            let [first, last] =
                [0.0, LENGTH].map(|t| clip.pose(&person.skeleton, t, Extrapolation::Constant).expect("valid"));
            assert!(
                first.locals.iter().zip(&last.locals).all(|(a, b)| (a.matrix() - b.matrix()).amax() < 1e-9),
                "it repeats"
            );
        }
    }
}
