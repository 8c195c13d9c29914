//! Parts of the body by the names of joints.
//!
//! A name is split into words at separators, at capitals and between letters and digits; a namespace (`mixamorig:`) is dropped. The words
//! give the side and the part, by the synonyms in use: `mixamorig:LeftForeArm`, `lowerarm_l`, `Bip01 L Forearm`, `J_Bip_L_LowerArm`, `lradius`
//! and `forearm.L` are one part. Words that mean two things are resolved by what else the side has: a `shoulder` is the collarbone beside an
//! arm, and the upper arm without one; a `leg` is the shin below a thigh, else the thigh; parts that are only numbered (`leg_1`, `leg_2`) are
//! taken in their order in the chain.

use std::collections::{BTreeMap, HashMap};

use crate::character::Skeleton;

/// Side of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Side {
    Left,
    Right,
    Middle,
}

/// Part of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Part {
    Hips,
    /// Spine and chest, from the hips up.
    Trunk,
    Neck,
    Head,
    Clavicle,
    UpperArm,
    Forearm,
    Hand,
    /// Thumb to little finger.
    Finger(u8),
    Thigh,
    Shin,
    Foot,
    Toes,
    Tail,
    /// Ambiguous words, resolved by what else there is.
    Shoulder,
    Arm,
    Leg,
}

/// A part, and its place in a chain of several.
pub(super) type Role = (Part, Side, u16);

/// Roles of the joints of a skeleton, by joint.
pub(super) fn roles(skeleton: &Skeleton) -> Vec<Option<Role>> {
    let mut found: BTreeMap<(Part, Side), Vec<u32>> = BTreeMap::new();
    for &j in skeleton.parents_first() {
        if let Some(part) = part(&skeleton.joints()[j as usize].name) {
            found.entry(part).or_default().push(j);
        }
    }
    for side in [Side::Left, Side::Right, Side::Middle] {
        let mut take = |part| found.remove(&(part, side)).unwrap_or_default();
        let arm = [take(Part::Clavicle), take(Part::UpperArm), take(Part::Forearm), take(Part::Hand)];
        let (shoulders, arms) = (take(Part::Shoulder), take(Part::Arm));
        let arm = resolved_arm(arm, shoulders, arms);
        let leg = [take(Part::Thigh), take(Part::Shin), take(Part::Foot), take(Part::Toes)];
        let leg = resolved_leg(leg, take(Part::Leg));
        let parts = [Part::Clavicle, Part::UpperArm, Part::Forearm, Part::Hand].into_iter().zip(arm);
        let parts = parts.chain([Part::Thigh, Part::Shin, Part::Foot, Part::Toes].into_iter().zip(leg));
        found.extend(parts.filter(|(_, joints)| !joints.is_empty()).map(|(part, joints)| ((part, side), joints)));
    }
    hips(skeleton, &mut found);
    let mut roles = vec![None; skeleton.joint_count()];
    for ((part, side), joints) in found {
        for (k, j) in joints.into_iter().enumerate().take(usize::from(u16::MAX)) {
            roles[j as usize] = Some((part, side, k as u16));
        }
    }
    roles
}

/// The hips are the joint from which both thighs go, where none is named; a joint of the trunk gives way.
fn hips(skeleton: &Skeleton, found: &mut BTreeMap<(Part, Side), Vec<u32>>) {
    if found.contains_key(&(Part::Hips, Side::Middle)) {
        return;
    }
    let thigh = |side| found.get(&(Part::Thigh, side)).and_then(|joints| joints.first().copied());
    let (Some(left), Some(right)) = (thigh(Side::Left), thigh(Side::Right)) else { return };
    let above: Vec<u32> = skeleton.ancestors(left).collect();
    let Some(common) = skeleton.ancestors(right).find(|j| above.contains(j)) else { return };
    for joints in found.values_mut() {
        joints.retain(|j| *j != common);
    }
    found.insert((Part::Hips, Side::Middle), vec![common]);
}

fn resolved_arm(
    [mut clavicle, mut upper, mut fore, mut hand]: [Vec<u32>; 4],
    shoulders: Vec<u32>,
    arms: Vec<u32>,
) -> [Vec<u32>; 4] {
    let mut arms = arms.into_iter();
    if upper.is_empty() {
        upper.extend(arms.next());
    }
    if fore.is_empty() {
        fore.extend(arms.next());
    }
    if hand.is_empty() {
        hand.extend(arms.next());
    }
    let mut shoulders = shoulders.into_iter();
    if upper.is_empty() {
        // Of two shoulders the first is the collarbone.
        if shoulders.len() > 1 && clavicle.is_empty() {
            clavicle.extend(shoulders.next());
        }
        upper.extend(shoulders.next());
    } else if clavicle.is_empty() {
        clavicle.extend(shoulders.next());
    }
    [clavicle, upper, fore, hand]
}

fn resolved_leg([mut thigh, mut shin, mut foot, mut toes]: [Vec<u32>; 4], legs: Vec<u32>) -> [Vec<u32>; 4] {
    let mut legs = legs.into_iter();
    for part in [&mut thigh, &mut shin, &mut foot, &mut toes] {
        if part.is_empty() {
            part.extend(legs.next());
        }
    }
    if toes.is_empty() && foot.len() > 1 {
        toes = foot.split_off(1);
    }
    [thigh, shin, foot, toes]
}

/// The words of a name, lower case: without namespace, split at separators, capitals and between letters and digits.
pub(super) fn words(name: &str) -> Vec<String> {
    let name = name.rsplit([':', '|']).next().unwrap_or(name);
    let letters: Vec<char> = name.chars().take(MAX_NAME).collect();
    let mut words: Vec<String> = Vec::new();
    let mut fresh = true;
    for (k, &c) in letters.iter().enumerate() {
        if !c.is_alphanumeric() {
            fresh = true;
            continue;
        }
        let before = k.checked_sub(1).map(|k| letters[k]);
        let after = letters.get(k + 1);
        let capital = c.is_uppercase()
            && before.is_some_and(|b| b.is_lowercase() || b.is_uppercase() && after.is_some_and(|a| a.is_lowercase()));
        let other_kind = before.is_some_and(|b| b.is_alphanumeric() && b.is_numeric() != c.is_numeric());
        if fresh || capital || other_kind {
            words.push(String::new());
            fresh = false;
        }
        if let Some(word) = words.last_mut() {
            word.extend(c.to_lowercase());
        }
    }
    words
}

/// Characters of a name that are read.
const MAX_NAME: usize = 200;

/// Words of joints that deform nothing of their own: helpers and ends of limbs.
const HELPERS: [&str; 19] = [
    "twist",
    "roll",
    "ik",
    "fk",
    "pole",
    "ctrl",
    "control",
    "helper",
    "target",
    "end",
    "nub",
    "tip",
    "site",
    "effector",
    "top",
    "heel",
    "palm",
    "metacarpal",
    "pocket",
];

/// Whether a name says that the joint is a helper that spreads a twist.
pub(super) fn spreads_twist(name: &str) -> bool {
    words(name).iter().any(|w| w == "twist" || w == "roll")
}

/// Words that name nothing: of tools, and of joints as such.
const GENERIC: [&str; 17] = [
    "joint",
    "jnt",
    "bone",
    "node",
    "bip",
    "bb",
    "def",
    "org",
    "b",
    "j",
    "cc",
    "base",
    "skeleton",
    "rig",
    "armature",
    "mixamorig",
    "c",
];

/// Whether a name says nothing of the part of the body: a number, or the word joint.
pub(super) fn is_generic(name: &str) -> bool {
    words(name).iter().all(|w| w.chars().all(char::is_numeric) || GENERIC.contains(&w.as_str()))
}

/// Words of parts.
fn word(word: &str) -> Option<Part> {
    Some(match word {
        "hips" | "hip" | "pelvis" => Part::Hips,
        "spine" | "chest" | "torso" | "abdomen" | "waist" | "back" | "thorax" | "belly" | "ribcage" | "upperchest"
        | "upperback" | "lowerback" => Part::Trunk,
        "neck" | "upperneck" | "lowerneck" => Part::Neck,
        "head" | "skull" => Part::Head,
        "clavicle" | "clav" | "collar" | "collarbone" | "scapula" => Part::Clavicle,
        "shoulder" | "shldr" => Part::Shoulder,
        "upperarm" | "uparm" | "humerus" | "bicep" => Part::UpperArm,
        "arm" => Part::Arm,
        "forearm" | "lowerarm" | "elbow" | "radius" | "ulna" => Part::Forearm,
        "hand" | "wrist" => Part::Hand,
        "thigh" | "upleg" | "upperleg" | "femur" => Part::Thigh,
        "leg" => Part::Leg,
        "shin" | "calf" | "knee" | "lowerleg" | "lowleg" | "tibia" => Part::Shin,
        "foot" | "ankle" | "paw" => Part::Foot,
        "toe" | "toes" | "toebase" | "ball" => Part::Toes,
        "thumb" => Part::Finger(0),
        "index" => Part::Finger(1),
        "middle" | "mid" => Part::Finger(2),
        "ring" => Part::Finger(3),
        "pinky" | "little" => Part::Finger(4),
        "tail" => Part::Tail,
        _ => return None,
    })
}

/// The part that a name means, and its side.
fn part(name: &str) -> Option<(Part, Side)> {
    let mut words = words(name);
    let mut side = Side::Middle;
    for w in &mut words {
        let (own, rest) = match w.as_str() {
            "l" | "left" | "lft" => (Side::Left, ""),
            "r" | "right" | "rgt" => (Side::Right, ""),
            // A side without separator: `lfemur`.
            other => match (other.strip_prefix('l'), other.strip_prefix('r')) {
                (Some(rest), _) if word(other).is_none() && word(rest).is_some() => (Side::Left, rest),
                (_, Some(rest)) if word(other).is_none() && word(rest).is_some() => (Side::Right, rest),
                _ => continue,
            },
        };
        side = own;
        *w = rest.to_owned();
    }
    let has = |any: &[&str]| words.iter().any(|w| any.contains(&w.as_str()));
    if has(&HELPERS) {
        return None;
    }
    let (upper, lower) = (has(&["up", "upper"]), has(&["low", "lower", "lo", "fore"]));
    // The most specific word counts: `LeftHandIndex1` is a finger, `LeftToeBase` toes.
    let parts: Vec<Part> = words.iter().filter_map(|w| word(w)).collect();
    let rank = |part: &Part| match part {
        Part::Finger(_) => 0,
        Part::Toes => 1,
        Part::Foot | Part::Hand => 2,
        _ => 3,
    };
    let only = |part: Part| parts.contains(&part);
    let part = *parts.iter().min_by_key(|p| rank(p))?;
    let fingers = matches!(part, Part::Finger(_)) && side == Side::Middle;
    let part = match part {
        // `spine_mid` is no finger.
        Part::Finger(_) if fingers => *parts.iter().find(|p| !matches!(p, Part::Finger(_)))?,
        part => part,
    };
    let part = match part {
        // The forelegs of an animal are its arms.
        Part::Leg if has(&["front", "fore"]) => Part::Arm,
        Part::Leg if upper => Part::Thigh,
        Part::Leg if lower => Part::Shin,
        Part::Arm if upper => Part::UpperArm,
        Part::Arm if lower => Part::Forearm,
        Part::Foot if has(&["front", "fore"]) => Part::Hand,
        Part::Shin if has(&["front", "fore"]) => Part::Forearm,
        Part::Thigh if has(&["front", "fore"]) => Part::UpperArm,
        Part::Toes if has(&["front", "fore"]) => return None,
        Part::Hips if side != Side::Middle => Part::Thigh,
        part => part,
    };
    (!(only(Part::Head) && part != Part::Head && part != Part::Neck)).then_some((part, side))
}

/// Pairs of joints, source and target, with one role.
pub(super) fn matched(source: &[Option<Role>], target: &[Option<Role>]) -> Vec<[u32; 2]> {
    let [ours, theirs] = [source, target].map(chains);
    let mut pairs = Vec::new();
    for (key, ours) in &ours {
        let Some(theirs) = theirs.get(key) else { continue };
        let spread = matches!(key.0, Part::Trunk | Part::Neck | Part::Tail);
        let (n, m) = (ours.len(), theirs.len());
        let count = n.min(m);
        // Of chains of different lengths both ends correspond, and joints between them evenly.
        let at = |k: usize, of: usize| match count {
            _ if !spread || of == count => k,
            1 => of - 1,
            _ => (k * (of - 1) + (count - 1) / 2) / (count - 1),
        };
        pairs.extend((0..count).map(|k| [ours[at(k, n)], theirs[at(k, m)]]));
    }
    pairs
}

fn chains(roles: &[Option<Role>]) -> HashMap<(Part, Side), Vec<u32>> {
    let mut all: Vec<(Role, u32)> = roles.iter().zip(0..).filter_map(|(role, j)| Some(((*role)?, j))).collect();
    all.sort_unstable();
    let mut chains: HashMap<(Part, Side), Vec<u32>> = HashMap::new();
    for ((part, side, _), j) in all {
        chains.entry((part, side)).or_default().push(j);
    }
    chains
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_many_tools_mean_one_part() {
        let forearm = Some((Part::Forearm, Side::Left));
        for name in [
            "mixamorig:LeftForeArm",
            "lowerarm_l",
            "Bip01 L Forearm",
            "J_Bip_L_LowerArm",
            "lradius",
            "forearm.L",
            "DEF-forearm.L",
            "LeftElbow",
            "l_forearm",
            "lForearm",
            "b_LeftForeArm_07",
            "LowerArm.Left",
        ] {
            assert_eq!(part(name), forearm, "{name}: {:?}", words(name));
        }
        let cases = [
            ("mixamorig:LeftUpLeg", Part::Thigh, Side::Left),
            ("RightUpperLeg", Part::Thigh, Side::Right),
            ("LeftHip", Part::Thigh, Side::Left),
            ("LHipJoint", Part::Thigh, Side::Left),
            ("Hips", Part::Hips, Side::Middle),
            ("calf_r", Part::Shin, Side::Right),
            ("LeftToeBase", Part::Toes, Side::Left),
            ("ball_l", Part::Toes, Side::Left),
            ("LeftHandIndex1", Part::Finger(1), Side::Left),
            ("spine_mid", Part::Trunk, Side::Middle),
            ("lowerback", Part::Trunk, Side::Middle),
            ("upper_arm.R", Part::UpperArm, Side::Right),
        ];
        for (name, expected, side) in cases {
            assert_eq!(part(name), Some((expected, side)), "{name}: {:?}", words(name));
        }
        for name in ["joint_12", "head end", "lowerarm_twist_01_l", "HeadTop_End", "Bone.001", "", "::", "ß"] {
            assert_eq!(part(name), None, "{name}");
        }
        assert!(is_generic("Bone.001") && is_generic("joint_12") && !is_generic("Hips"));
    }
}
