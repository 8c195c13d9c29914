//! Mirroring of joint chains.
//!
//! A plane with normal `n` maps `p` to `M p`. A mirrored frame `M F` is left-handed; it is replaced by `M F D`, where `D` mirrors the x axis
//! of the frame. Rotations about the bone (y) and about z thus change their signs, as on the other side of a body.

use nalgebra::{Matrix4, Point3, Unit, Vector3};

use super::Edited;
use super::operations::{Rig, refused};
use crate::character::{CharacterError, Joint, Limits};

/// A mirror plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// A point on it.
    pub point: Point3<f64>,
    /// Its normal.
    pub normal: Unit<Vector3<f64>>,
}

impl Plane {
    /// The reflection.
    fn matrix(&self) -> Matrix4<f64> {
        let n = self.normal.into_inner();
        let linear = nalgebra::Matrix3::identity() - 2.0 * n * n.transpose();
        let mut matrix = linear.to_homogeneous();
        let shift = n * (2.0 * n.dot(&self.point.coords));
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&shift);
        matrix
    }
}

/// Mirrors a joint and its descendants.
pub(super) fn apply(
    rig: &Rig<'_>,
    after: &mut Vec<Joint>,
    edited: &mut Edited,
    joint: u32,
    plane: &Plane,
) -> Result<(), CharacterError> {
    rig.joint(joint)?;
    if !plane.point.iter().chain(plane.normal.iter()).all(|x| x.is_finite()) {
        return refused("the plane is not finite");
    }
    let map = plane.matrix();
    let flip = Matrix4::new_nonuniform_scaling(&Vector3::new(-1.0, 1.0, 1.0));
    let below: Vec<u32> = parents_first(rig, joint);
    if below.iter().all(|&j| other_side(&rig.joints[j as usize].name).is_none()) {
        let name = &rig.joint(joint)?.name;
        let fault = "have no side in their names (such as .L, _left, Right…) that could be swapped";
        return refused(format!("joint {name:?} and its descendants {fault}"));
    }
    let mut twin: Vec<Option<u32>> = vec![None; rig.joints.len()];
    let mut worlds: Vec<Option<Matrix4<f64>>> = vec![None; rig.joints.len()];
    for j in below {
        let described = rig.joint(j)?;
        let name = other_side(&described.name).unwrap_or_else(|| format!("{} mirrored", described.name));
        let world = map * rig.world(j)? * flip;
        // The parent's counterpart if the parent has a side; the parent itself if it is in the middle.
        let parent = described.parent;
        let on_other_side = parent.map(|p| match (twin[p as usize], other_side(&rig.joints[p as usize].name)) {
            (Some(twin), _) => (twin, worlds[p as usize]),
            (None, Some(name)) => (rig.joints.iter().position(|k| k.name == name).map_or(p, |k| k as u32), None),
            (None, None) => (p, None),
        });
        let above = match on_other_side {
            None => Matrix4::identity(),
            Some((_, Some(world))) => world,
            Some((p, None)) => rig.world(p)?,
        };
        let rest =
            plumbline_num::math::Trs::from_matrix(&(above.try_inverse().unwrap_or_else(Matrix4::identity) * world));
        let parent = on_other_side.map(|(p, _)| p);
        let mirrored = Joint { name, parent, rest, limits: described.limits.map(|l| other_limits(&l)) };
        let existing = rig.joints.iter().position(|k| k.name == mirrored.name).map(|k| k as u32);
        let number = existing.unwrap_or(after.len() as u32);
        if let Some(k) = existing {
            after[k as usize] = mirrored;
        } else {
            edited.added.push(number);
            after.push(mirrored);
        }
        twin[j as usize] = Some(number);
        worlds[j as usize] = Some(world);
    }
    Ok(())
}

/// A joint and its descendants, parents before children.
fn parents_first(rig: &Rig<'_>, joint: u32) -> Vec<u32> {
    let (mut order, mut next) = (vec![joint], 0);
    while next < order.len() {
        let children = rig.children(order[next]);
        order.extend(children);
        next += 1;
    }
    order
}

/// Mirrored limits. A rotation `R` becomes `D R D`: its vector `(x, y, z)` becomes `(x, −y, −z)`. A twist about `a` becomes one about
/// `a' = −D a`; expressed about `D a`, its angle changes sign.
fn other_limits(limits: &Limits) -> Limits {
    let d = |v: &Unit<Vector3<f64>>| Unit::new_unchecked(Vector3::new(-v.x, v.y, v.z));
    let [least, largest] = limits.twist;
    Limits { axis: d(&limits.axis), across: d(&limits.across), swing: limits.swing, twist: [-largest, -least] }
}

/// Names of the sides.
const SIDES: [(&str, &str); 8] = [
    ("left", "right"),
    ("right", "left"),
    ("Left", "Right"),
    ("Right", "Left"),
    ("LEFT", "RIGHT"),
    ("RIGHT", "LEFT"),
    ("L", "R"),
    ("R", "L"),
];

/// The name with its side swapped: `.L`, `_r`, `l_`, `Left`, `right` and so on, as prefix or suffix; single letters only if a separator
/// sets them apart. `None` for a name without a side.
pub fn other_side(name: &str) -> Option<String> {
    const SEPARATORS: [char; 4] = ['.', '_', '-', ' '];
    let is_word = |word: &str| word.len() > 1;
    for (side, other) in SIDES.into_iter().chain([("l", "r"), ("r", "l")]) {
        if let Some(rest) = name.strip_suffix(side)
            && (is_word(side) && !rest.is_empty() || rest.len() > 1 && rest.ends_with(SEPARATORS))
        {
            return Some(format!("{rest}{other}"));
        }
        if let Some(rest) = name.strip_prefix(side)
            && (is_word(side) && !rest.is_empty() || rest.len() > 1 && rest.starts_with(SEPARATORS))
        {
            return Some(format!("{other}{rest}"));
        }
    }
    None
}
