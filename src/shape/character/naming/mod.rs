//! Names that a skeleton without names may have: those of the parts of a biped or a quadruped, with sides.
//!
//! A body has two pairs of limbs of about equal length at the two ends of a trunk, and a head at one of them. Pairs are found by path lengths
//! on the tree of joints, which no pose changes, and by a plane between their limbs, near which the head is; their directions decide what
//! the body is:
//!
//! | body | limbs at the end without the head | limbs at the head |
//! | --- | --- | --- |
//! | biped | legs: go on from the trunk, away from the head | arms: in any direction |
//! | quadruped | legs across the trunk | legs in the same direction |
//!
//! Where both ends have a further limb, the thicker one is the head, the other a tail. Left is `up × forward`. Of a quadruped forward is from
//! hips to head; of a biped it is the direction of the feet, and where they show none the convention of files: +z where y is up, −y
//! where z is up. [`Sides`] says which. Neither depends on the position, rotation or scale of the model but the convention. What fits no
//! body has no names.

mod body;
#[cfg(test)]
mod tests;

use std::collections::{HashMap, HashSet};

use super::character::free_name;
use super::{CharacterError, CurveSkeleton, Joint, Skeleton};
use body::Body;

/// A body plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyPlan {
    /// Two legs, two arms and a head.
    Biped,
    /// Four legs and a head, with or without a tail.
    Quadruped,
}

/// How left and right were decided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    /// By the direction of the feet.
    Feet,
    /// By the direction from the hips to the head.
    Head,
    /// By the convention that a model faces +z where y is up, or −y where z is up: the shape does not tell.
    Convention,
    /// Not at all: limbs of a pair are numbered.
    Unknown,
}

/// Proposed names.
#[derive(Clone, Debug, PartialEq)]
pub struct ProposedNames {
    /// One per joint; joints that belong to no part keep theirs.
    pub names: Vec<String>,
    /// The body.
    pub body: BodyPlan,
    /// How left and right were decided.
    pub sides: Sides,
}

impl ProposedNames {
    /// A sentence for the user.
    pub fn summary(&self) -> String {
        let body = match self.body {
            BodyPlan::Biped => "a biped",
            BodyPlan::Quadruped => "a quadruped",
        };
        let sides = match self.sides {
            Sides::Feet => "left and right by the direction of the feet",
            Sides::Head => "left and right by the direction of the head",
            Sides::Convention => "left and right assumed: it faces +z if y is up, -y if z is up",
            Sides::Unknown => "left and right not known",
        };
        format!("proposed for {body}; {sides}")
    }

    /// The skeleton with these names.
    ///
    /// # Errors
    /// [`CharacterError::Input`] for another skeleton.
    pub fn applied(&self, skeleton: &Skeleton) -> Result<Skeleton, CharacterError> {
        CharacterError::check_pose(self.names.len(), skeleton.joint_count())?;
        let named =
            skeleton.joints().iter().zip(&self.names).map(|(j, name)| Joint { name: name.clone(), ..j.clone() });
        Skeleton::new(named.collect())
    }
}

/// Largest skeleton that gets names: the search is quadratic, and bodies have fewer joints.
const MAX_JOINTS: usize = 2000;

/// Proposes names for the joints of a skeleton that was extracted from a curve; `None` for what is neither a biped nor a quadruped.
///
/// ```
/// use plumbline_shape::character::CurveSkeleton;
/// use plumbline_shape::character::humanoid::humanoid;
/// use plumbline_shape::character::naming::{BodyPlan, Sides, propose_names};
///
/// let skeleton = humanoid(0.1)?.skeleton;
/// let found = propose_names(&skeleton, &CurveSkeleton::default()).expect("a person");
/// assert_eq!((found.body, found.sides), (BodyPlan::Biped, Sides::Feet));
/// let hand = skeleton.named("hand end.L")? as usize;
/// assert_eq!(found.names[hand], "hand end.L");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn propose_names(skeleton: &Skeleton, curve: &CurveSkeleton) -> Option<ProposedNames> {
    if skeleton.joint_count() > MAX_JOINTS {
        return None;
    }
    let body = Body::find(skeleton, curve)?;
    let mut names: Vec<Option<String>> = vec![None; skeleton.joint_count()];
    let mut used = HashMap::new();
    let mut give = |joint: u32, part: &str, side: &str| {
        let own = &mut names[joint as usize];
        if own.is_none() {
            let count = used.entry(format!("{part}{side}")).or_insert(0_u32);
            *count += 1;
            *own = Some(if *count == 1 { format!("{part}{side}") } else { format!("{part} {count}{side}") });
        }
    };
    let (first, last) = (body.trunk[0], body.trunk[body.trunk.len() - 1]);
    give(first, "hips", "");
    give(last, "chest", "");
    body.trunk.iter().for_each(|j| give(*j, "spine", ""));
    let ends = body.head.len();
    for (k, &joint) in body.head.iter().enumerate() {
        let part = match ends - k {
            1 if ends > 2 => "head end",
            1 => "head",
            2 if ends > 2 => "head",
            _ => "neck",
        };
        give(joint, part, "");
    }
    body.tail.iter().for_each(|j| give(*j, "tail", ""));
    let sides = if body.sides == Sides::Unknown { [".1", ".2"] } else { [".L", ".R"] };
    let front = match body.plan {
        BodyPlan::Biped => ["arm", "forearm", "hand", "hand end"],
        BodyPlan::Quadruped => ["front leg", "front shin", "front foot", "front toes"],
    };
    for (pair, parts, bends) in [(&body.hind, ["leg", "shin", "foot", "toes"], LEG), (&body.front, front, ARM)] {
        for (limb, side) in pair.iter().zip(sides) {
            let total = limb.lengths.last().copied().unwrap_or(1.0);
            let last = limb.joints.len().saturating_sub(1);
            let part = |k: usize| bends.iter().position(|b| limb.lengths[k] / total < *b).unwrap_or(2);
            for (k, &joint) in limb.joints.iter().enumerate() {
                // The end of a limb is beyond its last joint, where it has one before.
                let end = k == last && k > 0 && part(k - 1) == 2;
                give(joint, parts[if end { 3 } else { part(k) }], side);
            }
        }
    }
    // Names of other joints stay, unless one was given away.
    let given: HashSet<String> = names.iter().flatten().cloned().collect();
    let name = |(own, joint): (Option<String>, &Joint)| {
        own.unwrap_or_else(|| free_name(&joint.name, |name| given.contains(name)))
    };
    let names = names.into_iter().zip(skeleton.joints()).map(name).collect();
    Some(ProposedNames { names, body: body.plan, sides: body.sides })
}

/// Fractions of the length of a limb, from the trunk, up to which its joints are the first and the second part; the third begins behind
/// them. Proportions of people and of quadrupeds differ less than bends are off: the ankle is at .8 to .9 of the path to the toes.
const LEG: [f64; 2] = [0.3, 0.7];
/// The same of arms, which begin in the middle of the chest: shoulders are at a quarter, elbows at a half, wrists at .8.
const ARM: [f64; 2] = [0.38, 0.7];
