//! Skeletons with world joint positions (`.skel`) and their animations (`.anim`).
//!
//! ```text
//! .skel    number of joints, then for each   x y z name parent          the parent of a root is called `root`,
//!                                                                       also of a root of that name
//! .anim    poses and joints, then for each pose   time, an axis x y z per joint, an angle in rad per joint
//! ```
//!
//! Frames at rest are axis-aligned. An animation may have fewer joints than the skeleton; the others stay at rest. Some files have times
//! that do not increase, because their original player ignores them; the pose index is used as time then.

use std::collections::HashMap;
use std::fmt::Write as _;

use nalgebra::{Unit, UnitQuaternion, Vector3};

use super::text::{Words, one_word, shown};
use crate::character::clip::{Curve, Interpolation, Track, rotations};
use crate::character::{Clip, Joint, RigFileError, Skeleton};
use plumbline_num::math::Trs;

/// Parent name of root joints.
const ROOT: &str = "root";
/// Largest number of joints and of poses: 16-bit indices, and five hours at 60 per second.
const MAX_JOINTS: usize = 1 << 16;
const MAX_POSES: usize = 1 << 20;

/// Parses a skeleton.
///
/// # Errors
/// [`RigFileError::Content`], and errors of the joints.
pub fn parse_skel(text: &str) -> Result<Skeleton, RigFileError> {
    let mut words = Words::new("skel", text);
    let count = words.count("the number of joints", MAX_JOINTS)?;
    let (mut at, mut names, mut parents) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..count {
        at.push(Vector3::from(words.triple(&format!("the place of joint {k}"))?));
        names.push(words.word(&format!("the name of joint {k}"))?);
        let parent = words.word(&format!("the parent of joint {k}"))?;
        parents.push((
            parent,
            words.fault(format!("there is no joint {:?}; a joint without a parent has `root`", shown(parent))),
        ));
    }
    // The first joint of each name.
    let mut number_of = HashMap::with_capacity(count);
    for (k, name) in names.iter().enumerate() {
        number_of.entry(*name).or_insert(k);
    }
    let mut joints = Vec::with_capacity(count);
    for (k, (parent, fault)) in parents.into_iter().enumerate() {
        let number = number_of.get(parent).copied();
        if number.is_none() && parent != ROOT {
            return Err(fault);
        }
        // A root may itself be named `root`.
        let number = number.filter(|p| parent != ROOT || *p != k);
        let from = number.map_or_else(Vector3::zeros, |p| at[p]);
        let rest = Trs::from_translation(at[k] - from);
        joints.push(Joint { name: names[k].to_owned(), parent: number.map(|p| p as u32), rest, limits: None });
    }
    Ok(Skeleton::new(joints)?)
}

/// Writes the rest pose. Spaces in names become `_`; with several roots a joint named `root` becomes `root_`, because the other roots
/// would read as its children.
pub fn skel_text(skeleton: &Skeleton) -> String {
    let joints = skeleton.joints();
    let several = joints.iter().filter(|j| j.parent.is_none()).count() > 1;
    let one_word = |name: &str| if several && name == ROOT { "root_".to_owned() } else { one_word(name) };
    let mut text = format!("{}\n", joints.len());
    for (joint, p) in joints.iter().zip(skeleton.rest_positions()) {
        let parent = joint.parent.map_or_else(|| ROOT.to_owned(), |j| one_word(&joints[j as usize].name));
        let _ = writeln!(text, "{} {} {} {} {parent}", p.x, p.y, p.z, one_word(&joint.name));
    }
    text
}

/// Parses an animation of a skeleton.
///
/// # Errors
/// [`RigFileError::Content`], and errors of the clip.
pub fn parse_anim(text: &str, name: &str, skeleton: &Skeleton) -> Result<Clip, RigFileError> {
    let mut words = Words::new("anim", text);
    let poses = words.count("the number of poses", MAX_POSES)?;
    let joints = words.count("the number of joints, no more than the skeleton has", skeleton.joint_count())?;
    let mut times = Vec::new();
    let mut joint_rotations: Vec<Vec<UnitQuaternion<f64>>> = vec![Vec::new(); joints];
    for k in 0..poses {
        let time = words.number(&format!("the time of pose {k}"))?;
        times.push(time);
        let mut axes = Vec::with_capacity(joints);
        for j in 0..joints {
            axes.push(Vector3::from(words.triple(&format!("the axis of joint {j} in pose {k}"))?));
        }
        for (j, axis) in axes.into_iter().enumerate() {
            let angle = words.number(&format!("the angle of joint {j} in pose {k}"))?;
            let axis = Unit::try_new(axis, 0.0);
            if axis.is_none() && angle != 0.0 {
                return Err(words.fault(format!("joint {j} turns by {angle} about an axis without length")));
            }
            joint_rotations[j]
                .push(axis.map_or_else(UnitQuaternion::identity, |a| UnitQuaternion::from_axis_angle(&a, angle)));
        }
    }
    if !times.windows(2).all(|t| t[0] < t[1]) {
        times = (0..poses).map(|k| k as f64).collect();
    }
    let moves = |t: &Vec<UnitQuaternion<f64>>| t.iter().any(|q| *q != UnitQuaternion::identity());
    let mut tracks = Vec::new();
    for (j, joint_rotations) in joint_rotations.iter().enumerate().filter(|(_, t)| moves(t)) {
        let rest = skeleton.joints()[j].rest.rotation;
        let joint_rotations: Vec<_> = joint_rotations.iter().map(|rotation| rest * rotation).collect();
        tracks.push(Track {
            joint: j as u32,
            curve: Curve::Rotation(rotations(times.clone(), &joint_rotations, Interpolation::Linear)?),
        });
    }
    Ok(Clip::new(name, tracks, Vec::new())?)
}
