//! Effect of each edit on a list of joints.

use nalgebra::{Matrix4, Point3, Unit, UnitQuaternion, Vector3};

use super::{Edit, Edited, mirror};
use crate::character::{CharacterError, Joint, Skeleton};
use plumbline_num::math::Trs;

/// Largest error of a translation–rotation–scale frame, relative to the largest matrix entry: above rounding, below visible shear.
const SHEAR_TOLERANCE: f64 = 1e-9;

/// The joints after an edit, and the index map.
pub(super) fn apply(joints: &[Joint], edit: &Edit) -> Result<(Vec<Joint>, Edited), CharacterError> {
    let rig = Rig::of(joints);
    let mut after = joints.to_vec();
    let mut edited = Edited { joint_of: (0..joints.len() as u32).map(Some).collect(), added: Vec::new() };
    match edit {
        Edit::Add { name, parent, at } => {
            let world = Matrix4::new_translation(&finite(at)?.coords);
            rig.add(&mut after, &mut edited, (name, *parent), &world)?;
        }
        Edit::Extrude { joint, name, at } => {
            let mut world = rig.world(*joint)?;
            world.fixed_view_mut::<3, 1>(0, 3).copy_from(&finite(at)?.coords);
            rig.add(&mut after, &mut edited, (name, Some(*joint)), &world)?;
        }
        Edit::Split { joint, fraction, name } => split(&rig, &mut after, &mut edited, (*joint, *fraction, name))?,
        Edit::Dissolve { joint } => {
            let parent = rig.joint(*joint)?.parent;
            for child in rig.children(*joint) {
                after[child as usize].parent = parent;
                after[child as usize].rest = rig.local(child, parent, &rig.world(child)?)?;
            }
            remove_joints(&mut after, &mut edited, |j| j == *joint, parent);
        }
        Edit::Remove { joint } => {
            let parent = rig.joint(*joint)?.parent;
            remove_joints(&mut after, &mut edited, |j| rig.is_below(j, *joint), parent);
        }
        Edit::Reparent { joint, parent } => {
            let world = rig.world(*joint)?;
            if let Some(parent) = parent {
                let above = &rig.joint(*parent)?.name;
                if rig.is_below(*parent, *joint) {
                    let name = &rig.joint(*joint)?.name;
                    return refused(format!("joint {name:?} cannot be a child of {above:?}, its own descendant"));
                }
            }
            after[*joint as usize].parent = *parent;
            after[*joint as usize].rest = rig.local(*joint, *parent, &world)?;
        }
        Edit::Mirror { joint, plane } => mirror::apply(&rig, &mut after, &mut edited, *joint, plane)?,
        Edit::Move { joint, to, with_children } => {
            let mut world = rig.world(*joint)?;
            world.fixed_view_mut::<3, 1>(0, 3).copy_from(&finite(to)?.coords);
            rig.set_world(&mut after, *joint, &world, *with_children)?;
        }
        Edit::Roll { joint, angle } => {
            if !angle.is_finite() {
                return refused("the angle is not finite");
            }
            let (world, bone) = (rig.world(*joint)?, rig.bone(*joint)?);
            let mut linear = Matrix4::from(UnitQuaternion::from_axis_angle(&bone, *angle).to_homogeneous());
            linear *= world;
            linear.set_column(3, &world.column(3));
            rig.set_world(&mut after, *joint, &linear, false)?;
        }
        Edit::Rename { joint, name } => {
            rig.joint(*joint)?;
            after[*joint as usize].name.clone_from(name);
        }
        Edit::Limit { joint, limits } => {
            rig.joint(*joint)?;
            after[*joint as usize].limits = *limits;
        }
    }
    // Without joints there is no skeleton, as before the first is added.
    if !after.is_empty() {
        Skeleton::new(after.clone())?;
    }
    Ok((after, edited))
}

pub(super) fn refused<T>(fault: impl Into<String>) -> Result<T, CharacterError> {
    Err(CharacterError::Input(fault.into()))
}

fn finite(p: &Point3<f64>) -> Result<&Point3<f64>, CharacterError> {
    if p.iter().all(|x| x.is_finite()) { Ok(p) } else { refused("the position is not finite") }
}

/// Joints and their world frames.
pub(super) struct Rig<'a> {
    pub(super) joints: &'a [Joint],
    worlds: Vec<Matrix4<f64>>,
}

impl<'a> Rig<'a> {
    fn of(joints: &'a [Joint]) -> Self {
        let worlds = Skeleton::new(joints.to_vec()).map_or_else(|_| Vec::new(), |s| s.rest_globals());
        Self { joints, worlds }
    }

    pub(super) fn joint(&self, j: u32) -> Result<&'a Joint, CharacterError> {
        let joints = self.joints.len();
        self.joints
            .get(j as usize)
            .map_or_else(|| refused(format!("there is no joint {j}; there are {joints}, numbered from 0")), Ok)
    }

    /// `world_from_joint` at rest.
    pub(super) fn world(&self, j: u32) -> Result<Matrix4<f64>, CharacterError> {
        self.joint(j).map(|_| self.worlds[j as usize])
    }

    pub(super) fn children(&self, j: u32) -> Vec<u32> {
        (0..self.joints.len() as u32).filter(|&c| self.joints[c as usize].parent == Some(j)).collect()
    }

    /// Whether a joint is `other` or one of its descendants.
    pub(super) fn is_below(&self, joint: u32, other: u32) -> bool {
        let parent = |j: u32| self.joints[j as usize].parent;
        std::iter::successors(Some(joint), |&j| parent(j)).any(|j| j == other)
    }

    /// The local frame under `parent` that gives this world frame.
    pub(super) fn local(&self, joint: u32, parent: Option<u32>, world: &Matrix4<f64>) -> Result<Trs, CharacterError> {
        let above = parent.map_or(Ok(Matrix4::identity()), |p| self.world(p))?;
        self.frame(joint, &above, world)
    }

    fn frame(&self, joint: u32, above: &Matrix4<f64>, world: &Matrix4<f64>) -> Result<Trs, CharacterError> {
        let sheared = || {
            let name = self.joints.get(joint as usize).map_or("", |j| &j.name);
            CharacterError::Input(format!("joint {name:?} would be sheared: the frames above it are scaled unevenly"))
        };
        let matrix = above.try_inverse().ok_or_else(sheared)? * world;
        let frame = Trs::from_matrix(&matrix);
        // The negated comparison also rejects NaN.
        let kept = (frame.matrix() - matrix).amax() <= SHEAR_TOLERANCE * matrix.amax();
        if kept { Ok(frame) } else { Err(sheared()) }
    }

    pub(super) fn add(
        &self,
        after: &mut Vec<Joint>,
        edited: &mut Edited,
        (name, parent): (&str, Option<u32>),
        world: &Matrix4<f64>,
    ) -> Result<(), CharacterError> {
        let rest = self.local(after.len() as u32, parent, world)?;
        edited.added.push(after.len() as u32);
        after.push(Joint { name: name.to_owned(), parent, rest, limits: None });
        Ok(())
    }

    /// Sets the world frame of a joint; its children follow if `along`, else keep their world frames.
    fn set_world(
        &self,
        after: &mut [Joint],
        joint: u32,
        world: &Matrix4<f64>,
        along: bool,
    ) -> Result<(), CharacterError> {
        after[joint as usize].rest = self.local(joint, self.joint(joint)?.parent, world)?;
        for child in self.children(joint).into_iter().filter(|_| !along) {
            after[child as usize].rest = self.frame(child, world, &self.world(child)?)?;
        }
        Ok(())
    }

    /// Direction of the bone that a joint's frame is aligned with.
    fn bone(&self, joint: u32) -> Result<Unit<Vector3<f64>>, CharacterError> {
        let at = |j: u32| self.worlds[j as usize].fixed_view::<3, 1>(0, 3).into_owned();
        let children = self.children(joint);
        let along = match (children.as_slice(), self.joint(joint)?.parent) {
            ([child], _) => at(*child) - at(joint),
            (_, Some(parent)) => at(joint) - at(parent),
            (_, None) => Vector3::zeros(),
        };
        let name = &self.joints[joint as usize].name;
        let fault = "has no bone to roll about: it needs one child, or a parent, at some distance";
        Unit::try_new(along, 0.0).map_or_else(|| refused(format!("joint {name:?} {fault}")), Ok)
    }
}

fn split(
    rig: &Rig<'_>,
    after: &mut Vec<Joint>,
    edited: &mut Edited,
    (joint, fraction, name): (u32, f64, &str),
) -> Result<(), CharacterError> {
    if !(fraction > 0.0 && fraction < 1.0) {
        return refused(format!("fraction {fraction} of the bone is invalid (expected more than 0, less than 1)"));
    }
    let described = rig.joint(joint)?;
    let Some(parent) = described.parent else {
        return refused(format!("joint {:?} has no bone to split: it has no parent", described.name));
    };
    // The new joint has the frame of its parent, so that both halves of the bone share it.
    let rest = Trs::from_translation(described.rest.translation * fraction);
    let new = after.len() as u32;
    after.push(Joint { name: name.to_owned(), parent: Some(parent), rest, limits: None });
    after[joint as usize].parent = Some(new);
    after[joint as usize].rest.translation = described.rest.translation - rest.translation;
    edited.added.push(new);
    Ok(())
}

/// Removes joints and renumbers the others; `heir` replaces the removed ones.
fn remove_joints(after: &mut Vec<Joint>, edited: &mut Edited, goes: impl Fn(u32) -> bool, heir: Option<u32>) {
    let mut next = 0;
    let numbers: Vec<Option<u32>> = (0..after.len() as u32)
        .map(|j| {
            let stays = !goes(j);
            next += u32::from(stays);
            stays.then(|| next - 1)
        })
        .collect();
    let number = |j: u32| numbers[j as usize];
    let mut k = 0;
    after.retain_mut(|joint| {
        let stays = numbers[k].is_some();
        joint.parent = joint.parent.and_then(number);
        k += 1;
        stays
    });
    edited.joint_of = (0..numbers.len()).map(|j| numbers[j].or(heir.and_then(number))).collect();
}
