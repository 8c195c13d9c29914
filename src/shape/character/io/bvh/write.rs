//! BVH writer.

use std::fmt::Write as _;

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::{END, FORMAT, MAX_DEPTH};
use crate::character::clip::Extrapolation;
use crate::character::{Clip, Pose, RigFileError, Skeleton};

/// Frames per second if the clip's keys are not evenly spaced: the common rate of BVH files.
const RATE: f64 = 30.0;
/// Largest deviation of evenly spaced keys from their grid, in intervals: the rounding of stored times.
const EVEN_TOLERANCE: f64 = 1e-4;
/// Largest indentation: the text of a deep skeleton stays in proportion to its joints.
const MAX_INDENT: usize = 40;
/// Largest number of frames: nine hours at 30 per second.
const MAX_FRAMES: f64 = 1e6;

/// Writes a skeleton and a clip (the rest pose without one): one frame per key if keys are evenly spaced, else 30 per second. Names keep
/// single spaces, one of spaces alone becomes `_`. Second result: what the format cannot represent.
///
/// # Errors
/// [`RigFileError::Content`] for several roots, joints too deep below one another, too many frames, or numbers beyond double precision;
/// [`RigFileError::Character`] for a clip of another skeleton. What is written can be read.
pub fn bvh_text(skeleton: &Skeleton, clip: Option<&Clip>) -> Result<(String, Vec<&'static str>), RigFileError> {
    let mut roots = skeleton.roots();
    let (root, others) = (roots.next(), roots.count());
    let unwritable = |fault: String| RigFileError::Content(format!("{FORMAT} cannot hold the skeleton: {fault}"));
    let Some(root) = root.filter(|_| others == 0) else {
        return Err(unwritable(format!("it has {} roots, and one is allowed", others + 1)));
    };
    let frames = Frames::of(clip).ok_or_else(|| unwritable(format!("more than {MAX_FRAMES} frames")))?;
    let mut poses = Vec::with_capacity(frames.count);
    for k in 0..frames.count {
        poses.push(match clip {
            Some(clip) => clip.pose(skeleton, frames.start + k as f64 * frames.step, Extrapolation::Constant)?,
            None => skeleton.rest_pose(),
        });
    }
    let file = File::of(skeleton, &poses, root);
    if file.depth > MAX_DEPTH {
        return Err(unwritable(format!("more than {MAX_DEPTH} joints are one below the other")));
    }
    let mut text = String::from("HIERARCHY\n");
    file.joint(&mut text, root, 0);
    let _ = writeln!(text, "MOTION\nFrames: {}\nFrame Time: {}", frames.count, frames.step);
    for pose in &poses {
        file.frame(&mut text, pose);
    }
    if !poses.iter().chain([&skeleton.rest_pose()]).all(|pose| file.is_finite(pose)) {
        return Err(unwritable("its positions are beyond double precision; scale it to a size near 1".to_owned()));
    }
    let scaled =
        poses.iter().chain([&skeleton.rest_pose()]).flat_map(|p| &p.locals).any(|l| l.scale != Vector3::repeat(1.0));
    let limited = skeleton.joints().iter().any(|j| j.limits.is_some());
    let morphed = clip.is_some_and(|c| !c.morphs().is_empty());
    let lost = [(scaled, "scales of joints"), (limited, "limits of joints"), (morphed, "weights of morph targets")];
    Ok((text, lost.into_iter().filter(|(lost, _)| *lost).map(|(_, what)| what).collect()))
}

/// Sample times of the frames.
struct Frames {
    start: f64,
    step: f64,
    count: usize,
}

impl Frames {
    fn of(clip: Option<&Clip>) -> Option<Self> {
        let alone = Self { start: 0.0, step: 1.0 / RATE, count: 1 };
        let Some((first, last)) = clip.and_then(Clip::span) else { return Some(alone) };
        if last <= first {
            return Some(Self { start: first, ..alone });
        }
        let longest = clip.into_iter().flat_map(Clip::tracks).map(|t| t.curve.times()).max_by_key(|t| t.len());
        let times = longest.unwrap_or(&[]);
        let steps = times.len().saturating_sub(1) as f64;
        let step = (last - first) / steps;
        let even = |(k, t): (usize, &f64)| (t - first - k as f64 * step).abs() <= EVEN_TOLERANCE * step;
        let even = steps >= 1.0 && times.iter().enumerate().all(even);
        let step = if even { step } else { 1.0 / RATE };
        let count = ((last - first) / step + EVEN_TOLERANCE).floor() + 1.0;
        (count <= MAX_FRAMES).then_some(Self { start: first, step, count: count as usize })
    }
}

struct File<'a> {
    skeleton: &'a Skeleton,
    /// Joints in file order.
    order: Vec<u32>,
    /// How many of them are one below the other.
    depth: usize,
    /// Whether each joint has position channels.
    moved: Vec<bool>,
    /// World rotation of each joint at rest.
    rest: Vec<UnitQuaternion<f64>>,
}

impl<'a> File<'a> {
    fn of(skeleton: &'a Skeleton, poses: &[Pose], root: u32) -> Self {
        let still = |j: usize| poses.iter().all(|p| p.locals[j].translation == skeleton.joints()[j].rest.translation);
        let moved = (0..skeleton.joint_count()).map(|j| j == root as usize || !still(j)).collect();
        let rest = rotations(skeleton, &skeleton.rest_pose());
        let mut file = Self { skeleton, order: Vec::new(), depth: 0, moved, rest };
        let mut open = vec![(root, 1)];
        while let Some((j, depth)) = open.pop() {
            file.order.push(j);
            file.depth = file.depth.max(depth);
            let joints = skeleton.children(j).iter().rev().filter(|&&c| !file.is_end(c));
            open.extend(joints.map(|&c| (c, depth + 1)));
        }
        file
    }

    /// Whether a joint is written as an `End Site`.
    fn is_end(&self, joint: u32) -> bool {
        let joints = self.skeleton.joints();
        let parent = joints[joint as usize].parent;
        let named = parent.is_some_and(|parent| self.name(joint) == format!("{}{END}", self.name(parent)));
        let alone = joints[joint as usize].parent.is_some_and(|p| self.skeleton.children(p).len() == 1);
        let apart = joints[joint as usize].rest.translation != Vector3::zeros();
        named && alone && apart && !self.moved[joint as usize] && self.skeleton.children(joint).is_empty()
    }

    /// The name in the file: words with single spaces between them.
    fn name(&self, joint: u32) -> String {
        let words: Vec<&str> = self.skeleton.joints()[joint as usize].name.split_whitespace().collect();
        if words.is_empty() { "_".to_owned() } else { words.join(" ") }
    }

    /// The rotation at rest of what a joint's position is given in.
    fn above(&self, joint: u32) -> UnitQuaternion<f64> {
        let parent = self.skeleton.joints()[joint as usize].parent;
        parent.map_or_else(UnitQuaternion::identity, |p| self.rest[p as usize])
    }

    fn offset(&self, joint: u32) -> Vector3<f64> {
        self.above(joint) * self.skeleton.joints()[joint as usize].rest.translation
    }

    /// How far a joint of a pose is from its place at rest.
    fn moved_by(&self, pose: &Pose, joint: u32) -> Vector3<f64> {
        let rest = self.skeleton.joints()[joint as usize].rest.translation;
        self.above(joint) * (pose.locals[joint as usize].translation - rest)
    }

    /// Whether a reader finds finite positions in what is written of a pose.
    fn is_finite(&self, pose: &Pose) -> bool {
        let finite = |j| (self.offset(j) + self.moved_by(pose, j)).iter().all(|x| x.is_finite());
        (0..self.skeleton.joint_count() as u32).all(finite)
    }

    fn joint(&self, text: &mut String, joint: u32, depth: usize) {
        // Depth first with an explicit stack: a chain of joints may be long.
        let mut open = vec![(joint, depth, false)];
        while let Some((joint, depth, done)) = open.pop() {
            let pad = "\t".repeat(depth.min(MAX_INDENT));
            if done {
                let _ = writeln!(text, "{pad}}}");
                continue;
            }
            open.push((joint, depth, true));
            let name = self.name(joint);
            let [x, y, z] = self.offset(joint).into();
            let children = self.skeleton.children(joint);
            if depth > 0 && self.is_end(joint) {
                let _ = writeln!(text, "{pad}End Site\n{pad}{{\n{pad}\tOFFSET {x} {y} {z}");
                continue;
            }
            let kind = if depth == 0 { "ROOT" } else { "JOINT" };
            // The last brace of the line opens the joint; one that ends the name needs another one after it.
            let brace = if name.ends_with('{') { " {".to_owned() } else { format!("\n{pad}{{") };
            let _ = writeln!(text, "{pad}{kind} {name}{brace}\n{pad}\tOFFSET {x} {y} {z}");
            let channels = if self.moved[joint as usize] { "6 Xposition Yposition Zposition" } else { "3" };
            let _ = writeln!(text, "{pad}\tCHANNELS {channels} Zrotation Yrotation Xrotation");
            if children.is_empty() {
                let _ = writeln!(text, "{pad}\tEnd Site\n{pad}\t{{\n{pad}\t\tOFFSET 0 0 0\n{pad}\t}}");
            }
            open.extend(children.iter().rev().map(|&c| (c, depth + 1, false)));
        }
    }

    fn frame(&self, text: &mut String, pose: &Pose) {
        let world = rotations(self.skeleton, pose);
        let from_rest = |j: u32| world[j as usize] * self.rest[j as usize].inverse();
        let mut numbers: Vec<String> = Vec::new();
        for &joint in &self.order {
            let parent = self.skeleton.joints()[joint as usize].parent;
            let above = parent.map_or_else(UnitQuaternion::identity, from_rest);
            if self.moved[joint as usize] {
                numbers.extend(self.moved_by(pose, joint).iter().map(ToString::to_string));
            }
            let rotation: Matrix3<f64> = (above.inverse() * from_rest(joint)).to_rotation_matrix().into_inner();
            // R = R_z R_y R_x.
            let (roll, pitch, yaw) = Rotation3::from_matrix_unchecked(rotation).euler_angles();
            numbers.extend([yaw, pitch, roll].map(|angle| angle.to_degrees().to_string()));
        }
        let _ = writeln!(text, "{}", numbers.join(" "));
    }
}

/// World rotation of each joint.
fn rotations(skeleton: &Skeleton, pose: &Pose) -> Vec<UnitQuaternion<f64>> {
    let mut rotations = vec![UnitQuaternion::identity(); skeleton.joint_count()];
    for &j in skeleton.parents_first() {
        let parent = skeleton.joints()[j as usize].parent;
        let above = parent.map_or_else(UnitQuaternion::identity, |p| rotations[p as usize]);
        rotations[j as usize] = above * pose.locals[j as usize].rotation;
    }
    rotations
}
