//! BVH reader.

use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector3};

use super::super::Rig;
use super::super::text::{Words, shown};
use super::{END, FORMAT, MAX_DEPTH};
use crate::character::clip::{Curve, Interpolation, Keys, RotationKeys, Track};
use crate::character::skeleton::MAX_JOINTS;
use crate::character::{Clip, Joint, RigFileError, Skeleton};
use plumbline_num::document::max_memory_of;
use plumbline_num::math::Trs;

/// Largest number of frames: nineteen hours at 60 per second.
const MAX_FRAMES: usize = 1 << 22;
/// Part of the memory of a file that names of joints at the ends may take: each is made from its parent's, so that a short text may
/// ask for many copies of a long name. They are held four times while duplicates are looked for.
const NAMES_OF_ENDS: u64 = 4;

/// What a channel moves: translation along or rotation about an axis.
#[derive(Clone, Copy)]
enum Move {
    Along(usize),
    About(usize),
}

/// Channels of a joint.
struct Channels {
    joint: usize,
    moves: Vec<Move>,
}

impl Channels {
    fn shifts(&self) -> bool {
        self.moves.iter().any(|m| matches!(m, Move::Along(_)))
    }

    fn turns(&self) -> bool {
        self.moves.iter().any(|m| matches!(m, Move::About(_)))
    }
}

/// Parses a skeleton and its animation, named `motion`.
///
/// # Errors
/// [`RigFileError::Content`], and errors of the joints.
pub fn parse_bvh(text: &str) -> Result<Rig, RigFileError> {
    let mut words = Words::new(FORMAT, text);
    words.expect("HIERARCHY")?;
    let mut hierarchy = Hierarchy::within(max_memory_of(text.len() as u64) / NAMES_OF_ENDS);
    loop {
        match words.word("ROOT or MOTION")? {
            "ROOT" => hierarchy.tree(&mut words)?,
            "MOTION" => break,
            other => return Err(words.fault(format!("{:?}, where ROOT or MOTION is expected", shown(other)))),
        }
    }
    let Hierarchy { mut joints, channels, .. } = hierarchy;
    unique(&mut joints);
    let clip = movement(&mut words, &joints, &channels, text.len())?;
    Ok(Rig { skeleton: Skeleton::new(joints)?, clips: clip.into_iter().collect(), warnings: Vec::new() })
}

/// The joints, as far as they are read.
struct Hierarchy {
    joints: Vec<Joint>,
    channels: Vec<Channels>,
    /// Bytes that names of joints at the ends may still take.
    names_of_ends: u64,
}

impl Hierarchy {
    fn within(names_of_ends: u64) -> Self {
        Self { joints: Vec::new(), channels: Vec::new(), names_of_ends }
    }

    /// A root and its descendants.
    fn tree(&mut self, words: &mut Words<'_>) -> Result<(), RigFileError> {
        let mut open: Vec<u32> = vec![self.begin(words, None)?];
        while let Some(&joint) = open.last() {
            if open.len() > MAX_DEPTH {
                return Err(words.fault(format!("more than {MAX_DEPTH} joints one below the other")));
            }
            match words.word("a part of the joint, or }")? {
                "OFFSET" => self.joints[joint as usize].rest.translation = words.triple("the offset")?.into(),
                "CHANNELS" => {
                    let moves = moves(words)?;
                    // Without a number in any frame there is nothing to store either.
                    if !moves.is_empty() {
                        self.channels.push(Channels { joint: joint as usize, moves });
                    }
                }
                "JOINT" => open.push(self.begin(words, Some(joint))?),
                "End" => self.end(words, joint)?,
                "}" => drop(open.pop()),
                other => {
                    let expected = "OFFSET, CHANNELS, JOINT, End Site or } is expected";
                    return Err(words.fault(format!("{:?}, where {expected}", shown(other))));
                }
            }
        }
        Ok(())
    }

    fn begin(&mut self, words: &mut Words<'_>, parent: Option<u32>) -> Result<u32, RigFileError> {
        let mut name = words.rest_of_line();
        let opened = name.last() == Some(&"{");
        if opened {
            name.pop();
        }
        if name.is_empty() {
            return Err(words.fault("a joint without a name"));
        }
        let name = name.join(" ");
        if !opened {
            words.expect("{")?;
        }
        if self.joints.len() >= MAX_JOINTS {
            return Err(words.fault(format!("more than {MAX_JOINTS} joints")));
        }
        self.joints.push(Joint { name, parent, rest: Trs::identity(), limits: None });
        Ok(self.joints.len() as u32 - 1)
    }

    fn end(&mut self, words: &mut Words<'_>, parent: u32) -> Result<(), RigFileError> {
        words.expect("Site")?;
        words.expect("{")?;
        words.expect("OFFSET")?;
        let offset = Vector3::from(words.triple("the offset")?);
        words.expect("}")?;
        if offset == Vector3::zeros() || self.joints.len() >= MAX_JOINTS {
            return Ok(());
        }
        let of_parent = &self.joints[parent as usize].name;
        let Some(left) = self.names_of_ends.checked_sub((of_parent.len() + END.len()) as u64) else {
            let (name, bytes) = (shown(of_parent), of_parent.len());
            return Err(words.fault(format!(
                "too many end sites of joints with long names, as {name:?} of {bytes} bytes, after which they are named: shorten the names"
            )));
        };
        self.names_of_ends = left;
        let name = format!("{of_parent}{END}");
        self.joints.push(Joint { name, parent: Some(parent), rest: Trs::from_translation(offset), limits: None });
        Ok(())
    }
}

fn moves(words: &mut Words<'_>) -> Result<Vec<Move>, RigFileError> {
    let count = words.count("the number of channels", 6)?;
    let mut moves = Vec::with_capacity(count);
    for _ in 0..count {
        let name = words.word("a channel")?;
        let lower = name.to_ascii_lowercase();
        let axis = b"xyz".iter().position(|axis| lower.as_bytes().first() == Some(axis));
        moves.push(match (axis, lower.get(1..)) {
            (Some(axis), Some("position")) => Move::Along(axis),
            (Some(axis), Some("rotation")) => Move::About(axis),
            _ => return Err(words.fault(format!("{:?} is no channel (Xposition … Zrotation)", shown(name)))),
        });
    }
    Ok(moves)
}

/// Makes duplicate names unique by a number.
fn unique(joints: &mut [Joint]) {
    let mut taken = std::collections::HashSet::new();
    // The number to try next, by name: counting from 1 for each of many equal names takes quadratic time.
    let mut next = std::collections::HashMap::<String, usize>::new();
    for joint in joints {
        let k = next.entry(joint.name.clone()).or_insert(1);
        let numbered = |k: usize| if k == 1 { joint.name.clone() } else { format!("{} ({k})", joint.name) };
        while taken.contains(&numbered(*k)) {
            *k += 1;
        }
        joint.name = numbered(*k);
        taken.insert(joint.name.clone());
    }
}

/// The motion of a text of `length` bytes.
fn movement(
    words: &mut Words<'_>,
    joints: &[Joint],
    channels: &[Channels],
    length: usize,
) -> Result<Option<Clip>, RigFileError> {
    words.expect("Frames:")?;
    let frames = words.count("the number of frames", MAX_FRAMES)?;
    words.expect("Frame")?;
    words.expect("Time:")?;
    let step = words.number("the time between frames")?;
    if frames > 1 && !(step > 0.0) {
        return Err(words.fault(format!("{step} s between frames (expected more than 0)")));
    }
    let stored = stored_frames(words, frames, channels, length)?;
    let mut curves: Vec<Values> = channels.iter().map(|of_joint| Values::new(of_joint, stored)).collect();
    for frame in 0..frames {
        for (of_joint, values) in channels.iter().zip(&mut curves) {
            values.read(words, of_joint, &joints[of_joint.joint], frame)?;
        }
    }
    if let Some(more) = words.next() {
        return Err(words.fault(format!("{:?} after the last of {frames} frames", shown(more))));
    }
    if frames == 0 {
        return Ok(None);
    }
    let times: Arc<[f64]> = (0..frames).map(|k| k as f64 * step).collect();
    let mut tracks = Vec::new();
    for (of_joint, values) in channels.iter().zip(curves) {
        let joint = of_joint.joint as u32;
        if let Some(positions) = values.positions {
            let keys = Keys::new(times.clone(), positions, Interpolation::Linear)?;
            tracks.push(Track { joint, curve: Curve::Translation(keys) });
        }
        if let Some(rotations) = values.rotations {
            let keys = RotationKeys::new(Keys::new(times.clone(), rotations, Interpolation::Linear)?)?;
            tracks.push(Track { joint, curve: Curve::Rotation(keys) });
        }
    }
    Ok(Some(Clip::new("motion", tracks, Vec::new())?))
}

/// How many of the announced frames a text of `length` bytes can hold.
///
/// # Errors
/// Their values would take more memory than a file of that size may: a rotation of one digit takes 2 bytes there and 32 here.
fn stored_frames(
    words: &Words<'_>,
    frames: usize,
    channels: &[Channels],
    length: usize,
) -> Result<usize, RigFileError> {
    let numbers: usize = channels.iter().map(|c| c.moves.len()).sum();
    // A number and the space after it are two bytes: a text that announces more is cut short.
    let stored = frames.min(length / (2 * numbers.max(1)) + 1);
    let per_frame: usize = channels.iter().map(Values::per_frame).sum();
    let (bytes, most) = (stored as u64 * per_frame as u64, max_memory_of(length as u64));
    if bytes > most {
        return Err(words.fault(format!(
            "{frames} frames of {numbers} numbers take {bytes} bytes in memory (at most {most} for a text of {length} bytes): give \
             fewer frames, or numbers with more digits"
        )));
    }
    Ok(stored)
}

/// Values of a joint over time, as [`Keys`] store them: they are the largest part of the memory that a motion takes, and are moved
/// from here into the clip.
struct Values {
    positions: Option<Vec<[f64; 3]>>,
    rotations: Option<Vec<[f64; 4]>>,
}

impl Values {
    fn new(channels: &Channels, frames: usize) -> Self {
        Self {
            positions: channels.shifts().then(|| Vec::with_capacity(frames)),
            rotations: channels.turns().then(|| Vec::with_capacity(frames)),
        }
    }

    /// Bytes of a frame.
    fn per_frame(channels: &Channels) -> usize {
        size_of::<[f64; 3]>() * usize::from(channels.shifts()) + size_of::<[f64; 4]>() * usize::from(channels.turns())
    }

    /// Reads the numbers of a frame.
    fn read(
        &mut self,
        words: &mut Words<'_>,
        channels: &Channels,
        joint: &Joint,
        frame: usize,
    ) -> Result<(), RigFileError> {
        let mut rotation = UnitQuaternion::identity();
        let mut position = joint.rest.translation;
        for &each in &channels.moves {
            let number = words.number_of(|| format!("a number of {:?} in frame {frame}", shown(&joint.name)))?;
            match each {
                Move::Along(axis) => position[axis] += number,
                Move::About(axis) => {
                    rotation *= UnitQuaternion::from_axis_angle(&Vector3::ith_axis(axis), number.to_radians());
                }
            }
        }
        if let Some(rotations) = &mut self.rotations {
            rotations.push(rotation.coords.into());
        }
        if let Some(positions) = &mut self.positions {
            positions.push(position.into());
        }
        Ok(())
    }
}
