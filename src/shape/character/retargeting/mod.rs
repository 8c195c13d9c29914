//! Motion retargeting: the motion of one skeleton carried to another, with other names, proportions, rest pose, number of joints, up axis
//! and scale.
//!
//! With `W` world rotations, `W⁰` those at rest, `i` the joint of the source that joint `j` of the target follows ([`Correspondence`]):
//!
//! ```text
//! rotations    Wⱼ(t) = R Wᵢ(t) Wᵢ⁰⁻¹ Rᵀ · Aⱼ Wⱼ⁰                 R    world of the source to that of the target
//! root         p(t)  = p⁰ + a + s R (q(t) − q⁰)                  s    ratio of leg lengths
//! ```
//!
//! `R` is the rotation that best maps the joints of the source at rest onto those that follow them (Kabsch), made exact where it is near a
//! rotation of coordinate axes. `Aⱼ` bends the rest pose of the target into that of the source: along limbs each bone is rotated, on the
//! shortest path, to the direction of its counterpart, so that a T-pose and an A-pose move alike; feet are only rotated about the vertical, so
//! that soles stay flat; the trunk, neck, head and collarbones keep their own shape. `a` stands the target so bent on its ground. Joints
//! of the target that follow none stay at rest relative to their parents; those between two of the trunk take rotations between, and
//! joints along a limb bone take the twist of its end in proportion.
//!
//! Then feet are held: where a foot of the source, scaled by its leg, is near the ground and slow, the foot of the target
//! follows it exactly but for a constant displacement, at the height that the ground of the target asks for. Between contacts the
//! displacement is interpolated. Inverse kinematics of the leg ([`super::ik::solve`]) moves the foot, which keeps its orientation; where the leg is too
//! short the root is lowered, smoothly. Joint limits of the target hold.
//!
//! It departs from Gleicher's spacetime constraints in that frames are solved one by one: corrections are smooth by their own interpolation,
//! not by an optimization over time.
//!
//! # Reference
//! M. Gleicher, *Retargetting Motion to New Characters*, SIGGRAPH 1998. J. Monzani, P. Baerlocher, R. Boulic, D. Thalmann, *Using an
//! Intermediate Skeleton and Inverse Kinematics for Motion Retargeting*, Eurographics 2000 (alignment of rest poses). L. Kovar, J. Schreiner,
//! M. Gleicher, *Footskate Cleanup for Motion Capture Editing*, SCA 2002 (constraints of feet, and their blending).

mod alignment;
mod contacts;
mod correspondence;
mod footing;
mod map_file;
mod names;
mod sampling;
#[cfg(test)]
mod tests;
mod transfer;

pub use correspondence::{Correspondence, MatchedBy};
pub use map_file::JointMap;
#[cfg(feature = "schema")]
pub use map_file::joint_map_schema;

use super::{CharacterError, Clip, Skeleton};
use alignment::Alignment;
use plumbline_num::options::OptionError;
use plumbline_num::run::Run;

/// Options of motion retargeting.
#[derive(Clone, Debug, PartialEq)]
pub struct RetargetingOptions {
    /// Smallest number of samples per second, 1 to 1000. Default 30. Keys of the source are samples, too.
    pub rate: f64,
    /// Whether feet that are on the ground in the source are held there. Default true.
    pub contacts: bool,
}

impl Default for RetargetingOptions {
    fn default() -> Self {
        Self { rate: 30.0, contacts: true }
    }
}

impl RetargetingOptions {
    fn check(&self) -> Result<(), OptionError> {
        OptionError::check((1.0..=1000.0).contains(&self.rate), "rate", self.rate, "1 to 1000 samples per second")
    }
}

/// A foot of the target.
#[derive(Clone, Debug, PartialEq)]
pub struct FootReport {
    /// The joint of the target that is held.
    pub joint: u32,
    /// Number of contacts with the ground.
    pub contacts: usize,
    /// Time on the ground, s.
    pub seconds: f64,
    /// Largest distance that the point on the ground slides during a contact, as a fraction of the leg length.
    pub slide: f64,
    /// The same of the source.
    pub source_slide: f64,
    /// The same of the target before feet were held.
    pub free_slide: f64,
    /// Largest distance of the point on the ground from the height of the ground, as a fraction of the leg length.
    pub height: f64,
}

/// How a motion was retargeted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RetargetingReport {
    /// Joints of the target that follow one of the source.
    pub followed: usize,
    /// Joints of the source that move and that no joint follows.
    pub left_out: Vec<u32>,
    /// Ratio of the leg lengths of target and source; of the extents of the skeletons where there are no legs.
    pub scale: f64,
    /// Feet, where contacts were sought.
    pub feet: Vec<FootReport>,
    /// Largest distance that a held foot missed, as a fraction of the leg length.
    pub missed: f64,
    /// Largest rotation by which the limits of the target changed a joint, rad.
    pub limited: f64,
}

/// Largest number of sampled frames of joints: 600 MB, twenty minutes of a person at 30 per second.
const MAX_FRAMES: usize = 1 << 22;

/// Largest number of joints of a skeleton: what follows what is found by walks along the hierarchy, whose number is cubic at worst.
const MAX_JOINTS: usize = 2000;

/// Refuses skeletons that are too large.
fn check_size(source: &Skeleton, target: &Skeleton) -> Result<(), CharacterError> {
    let joints = source.joint_count().max(target.joint_count());
    if joints <= MAX_JOINTS {
        return Ok(());
    }
    Err(CharacterError::Input(format!(
        "a skeleton of {joints} joints is too large to carry a motion (at most {MAX_JOINTS})"
    )))
}

/// Carries a clip of one skeleton to another. Morph weights are left out: they belong to the surface of the source.
///
/// The result has keys at the sample times, linear between them; it is in the limits of the target. To the same skeleton it is the clip
/// itself, at the sample times, but for limits.
///
/// # Errors
/// [`CharacterError::Input`]: a clip or correspondence of other skeletons, more than 2000 joints, a clip so long that its rotations would not fit in memory;
/// [`CharacterError::Option`]; [`CharacterError::Interrupted`].
///
/// ```
/// use plumbline_num::run::Run;
/// use plumbline_shape::character::humanoid::humanoid;
/// use plumbline_shape::character::retargeting::{Correspondence, JointMap, RetargetingOptions, retarget};
/// use plumbline_shape::character::{Joint, Skeleton};
///
/// let person = humanoid(0.1)?;
/// // The same body at half the size, with other names.
/// let renamed = person.skeleton.joints().iter().map(|joint| {
///     let mut small = joint.clone();
///     small.name = joint.name.replace(".L", "_left").replace(".R", "_right").replace("leg", "thigh");
///     small.rest.translation *= 0.5;
///     small
/// });
/// let child = Skeleton::new(renamed.collect())?;
/// let run = Run::default();
/// let map = Correspondence::find(&person.skeleton, &child, &JointMap::default(), &run)?;
/// let walk = person.clip("walk")?;
/// let (clip, report) = retarget(&person.skeleton, walk, &child, &map, &RetargetingOptions::default(), &run)?;
/// assert!((report.scale - 0.5).abs() < 1e-9 && report.left_out.is_empty());
/// assert_eq!(clip.span(), walk.span());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn retarget(
    source: &Skeleton,
    clip: &Clip,
    target: &Skeleton,
    map: &Correspondence,
    options: &RetargetingOptions,
    run: &Run,
) -> Result<(Clip, RetargetingReport), CharacterError> {
    options.check()?;
    check_size(source, target)?;
    clip.check(source.joint_count(), usize::MAX)?;
    CharacterError::check_pose(map.source_of.len(), target.joint_count())?;
    if let Some(joint) = map.source_of.iter().flatten().find(|j| **j as usize >= source.joint_count()) {
        let there = format!("but there are {}, numbered from 0", source.joint_count());
        return Err(CharacterError::Input(format!("the correspondence names joint {joint} of the source, {there}")));
    }
    let times = sampling::times(clip, options.rate)?;
    let joints = source.joint_count() + target.joint_count();
    if times.len().saturating_mul(joints) > MAX_FRAMES {
        let size = format!("{} samples of {joints} joints", times.len());
        return Err(CharacterError::Input(format!(
            "the clip {:?} is too long: {size}; give a part of it",
            clip.name()
        )));
    }
    let alignment = Alignment::new(source, target, map);
    let motion = sampling::Motion::sampled(source, clip, &times, run)?;
    let (mut poses, limited) = transfer::poses(source, &motion, target, map, &alignment, run)?;
    let mut report = RetargetingReport {
        followed: map.source_of.iter().flatten().count(),
        left_out: left_out(source, clip, map),
        scale: alignment.scale,
        limited,
        ..RetargetingReport::default()
    };
    if options.contacts {
        footing::hold_feet(&times, &motion, target, &alignment, &mut poses, &mut report, run)?;
    }
    Ok((sampling::clip(clip.name(), target, &times, &poses)?, report))
}

/// Joints of the source that rotate in a clip and that no joint follows, nor one below them.
fn left_out(source: &Skeleton, clip: &Clip, map: &Correspondence) -> Vec<u32> {
    let mut followed = vec![false; source.joint_count()];
    map.source_of.iter().flatten().for_each(|j| followed[*j as usize] = true);
    for &j in source.parents_first().iter().rev() {
        if let Some(parent) = source.joints()[j as usize].parent.filter(|_| followed[j as usize]) {
            followed[parent as usize] = true;
        }
    }
    let mut moved: Vec<u32> = clip.tracks().iter().map(|t| t.joint).filter(|j| !followed[*j as usize]).collect();
    moved.sort_unstable();
    moved.dedup();
    moved
}
