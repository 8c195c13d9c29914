//! The skeleton: joints in a forest, each with a frame relative to its parent.

use std::collections::HashMap;

use nalgebra::{Matrix4, Point3};

use super::{CharacterError, Limits, Pose};
use plumbline_num::math::Trs;

/// Largest number of joints: indices are 16-bit, as in glTF.
pub(super) const MAX_JOINTS: usize = 1 << 16;

/// A joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Unique within the skeleton.
    pub name: String,
    /// Parent joint; `None` for a root.
    pub parent: Option<u32>,
    /// `parent_from_joint` at rest; `world_from_joint` of a root.
    pub rest: Trs,
    /// Limits of the rotation from rest; `None`: unlimited.
    pub limits: Option<Limits>,
}

/// The segment from a joint to one of its children; it moves rigidly with the joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bone {
    /// The joint at its start, whose frame it moves with.
    pub joint: u32,
    /// The joint at its end; `None` for the zero-length bone of a root without children.
    pub child: Option<u32>,
    /// Position of `joint`.
    pub from: Point3<f64>,
    /// Position of `child`.
    pub to: Point3<f64>,
}

/// Joints in a forest, in the order given; a parent may come after its children.
#[derive(Clone, Debug, PartialEq)]
pub struct Skeleton {
    joints: Vec<Joint>,
    children: Vec<Vec<u32>>,
    /// Topological order: parents before children.
    order: Vec<u32>,
}

impl Skeleton {
    /// Builds a skeleton.
    ///
    /// # Errors
    /// [`CharacterError::Input`]: no joints or too many, a parent that does not exist, a cycle, two joints of one name, a frame that is not
    /// finite, invalid limits.
    pub fn new(joints: Vec<Joint>) -> Result<Self, CharacterError> {
        if joints.is_empty() {
            return refused("the skeleton has no joint; give it at least one".to_owned());
        }
        if joints.len() > MAX_JOINTS {
            return refused(format!("{} joints are too many (at most {MAX_JOINTS})", joints.len()));
        }
        check_each(&joints)?;
        check_names(&joints)?;
        let mut children = vec![Vec::new(); joints.len()];
        for (j, joint) in joints.iter().enumerate() {
            if let Some(parent) = joint.parent {
                children[parent as usize].push(j as u32);
            }
        }
        let order = parents_first(&joints, &children)?;
        Ok(Self { joints, children, order })
    }

    /// The joints, in the order given.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// Number of joints.
    pub fn joint_count(&self) -> usize {
        self.joints.len()
    }

    /// Children of a joint, ascending.
    pub fn children(&self, joint: u32) -> &[u32] {
        &self.children[joint as usize]
    }

    /// Joints without a parent, ascending.
    pub fn roots(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.joints.len() as u32).filter(|&j| self.joints[j as usize].parent.is_none())
    }

    /// All joints in topological order, parents before children.
    pub fn parents_first(&self) -> &[u32] {
        &self.order
    }

    /// Index of the joint with this name.
    pub fn find(&self, name: &str) -> Option<u32> {
        self.joints.iter().position(|j| j.name == name).map(|j| j as u32)
    }

    /// Index of the joint with this name.
    ///
    /// # Errors
    /// [`CharacterError::Input`], with the closest existing name.
    pub fn named(&self, name: &str) -> Result<u32, CharacterError> {
        let names = || self.joints.iter().map(|j| j.name.as_str()).collect::<Vec<_>>();
        self.find(name).ok_or_else(|| unknown_name(name, &names()))
    }

    /// The rest pose.
    pub fn rest_pose(&self) -> Pose {
        Pose { locals: self.joints.iter().map(|j| j.rest).collect() }
    }

    /// `world_from_joint` of every joint in a pose.
    ///
    /// # Errors
    /// [`CharacterError::Input`] for a wrong number of joints or a frame that is not finite.
    pub fn globals(&self, pose: &Pose) -> Result<Vec<Matrix4<f64>>, CharacterError> {
        CharacterError::check_pose(pose.locals.len(), self.joints.len())?;
        if let Some(j) = pose.locals.iter().position(|t| !t.is_finite()) {
            return refused(format!("the pose of joint {:?} is not finite", self.joints[j].name));
        }
        Ok(self.chained(&pose.locals))
    }

    /// `world_from_joint` of every joint at rest.
    pub fn rest_globals(&self) -> Vec<Matrix4<f64>> {
        self.chained(&self.rest_pose().locals)
    }

    fn chained(&self, locals: &[Trs]) -> Vec<Matrix4<f64>> {
        // In topological order the parent's matrix is complete before its children need it.
        let mut globals = vec![Matrix4::identity(); locals.len()];
        for &j in &self.order {
            let local = locals[j as usize].matrix();
            globals[j as usize] = match self.joints[j as usize].parent {
                Some(parent) => globals[parent as usize] * local,
                None => local,
            };
        }
        globals
    }

    /// The parent of a joint, its parent, and so on to the root.
    pub(crate) fn ancestors(&self, joint: u32) -> impl Iterator<Item = u32> + '_ {
        let parent = |j: u32| self.joints[j as usize].parent;
        std::iter::successors(parent(joint), move |j| parent(*j))
    }

    /// Joint positions at rest, world.
    pub fn rest_positions(&self) -> Vec<Point3<f64>> {
        self.rest_globals().iter().map(origin).collect()
    }

    /// Segments from each joint to its children at rest; a root without children gets a zero-length bone.
    ///
    /// Leaf joints have no bone of their own: the surface around them moves with the bone that ends there.
    pub fn bones(&self) -> Vec<Bone> {
        let at = self.rest_positions();
        let mut bones = Vec::new();
        for (j, children) in self.children.iter().enumerate() {
            let (joint, from) = (j as u32, at[j]);
            if children.is_empty() && self.joints[j].parent.is_none() {
                bones.push(Bone { joint, child: None, from, to: from });
            }
            let segment = |&c: &u32| Bone { joint, child: Some(c), from, to: at[c as usize] };
            bones.extend(children.iter().map(segment));
        }
        bones
    }
}

/// Origin of a frame.
fn origin(frame: &Matrix4<f64>) -> Point3<f64> {
    Point3::new(frame[(0, 3)], frame[(1, 3)], frame[(2, 3)])
}

fn refused<T>(fault: String) -> Result<T, CharacterError> {
    Err(CharacterError::Input(fault))
}

fn check_each(joints: &[Joint]) -> Result<(), CharacterError> {
    for joint in joints {
        let (name, count) = (&joint.name, joints.len());
        if let Some(parent) = joint.parent.filter(|p| *p as usize >= count) {
            let there = format!("but the skeleton has {count} joints, numbered from 0");
            return refused(format!("joint {name:?} has the parent {parent}, {there}"));
        }
        if !joint.rest.is_finite() {
            return refused(format!("the rest frame of joint {name:?} is not finite"));
        }
        if let Some(limits) = &joint.limits {
            limits.check(&joint.name)?;
        }
    }
    Ok(())
}

fn check_names(joints: &[Joint]) -> Result<(), CharacterError> {
    let mut first_of = HashMap::with_capacity(joints.len());
    for (second, joint) in joints.iter().enumerate() {
        if let Some(first) = first_of.insert(joint.name.as_str(), second) {
            return refused(format!("joints {first} and {second} are both named {:?}; names must differ", joint.name));
        }
    }
    Ok(())
}

/// All joints in breadth-first order from the roots.
fn parents_first(joints: &[Joint], children: &[Vec<u32>]) -> Result<Vec<u32>, CharacterError> {
    let mut order: Vec<u32> = (0..joints.len() as u32).filter(|&j| joints[j as usize].parent.is_none()).collect();
    let mut next = 0;
    while next < order.len() {
        order.extend_from_slice(&children[order[next] as usize]);
        next += 1;
    }
    if order.len() == joints.len() {
        return Ok(order);
    }
    let mut reached = vec![false; joints.len()];
    for &j in &order {
        reached[j as usize] = true;
    }
    Err(cycle(joints, reached.iter().position(|r| !r).unwrap_or(0)))
}

/// Reports the cycle above a joint that is reachable from no root.
fn cycle(joints: &[Joint], start: usize) -> CharacterError {
    let mut seen = vec![false; joints.len()];
    let parent = |j: usize| joints[j].parent.map_or(j, |p| p as usize);
    let mut at = start;
    while !seen[at] {
        seen[at] = true;
        at = parent(at);
    }
    let (first, mut names) = (at, vec![joints[at].name.as_str()]);
    loop {
        at = parent(at);
        names.push(&joints[at].name);
        if at == first {
            let cycle = names.join(" → ");
            let remedy = "make one of them a root or give it another parent";
            return CharacterError::Input(format!("joints form a cycle: {cycle}; {remedy}"));
        }
    }
}

/// Reports an unknown joint with the closest known name, if its edit distance is at most half the length of `name`.
pub(super) fn unknown_name(name: &str, known: &[&str]) -> CharacterError {
    let like = |other: &&&str| edit_distance(name, other);
    let nearest = known.iter().min_by_key(like).filter(|other| like(other) <= name.chars().count() / 2);
    let hint = nearest.map_or_else(String::new, |n| format!("; did you mean {n:?}?"));
    CharacterError::Input(format!("there is no joint {name:?}{hint}"))
}

/// Levenshtein distance.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(x != *y);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}
