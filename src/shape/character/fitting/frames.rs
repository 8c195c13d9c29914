//! Frames of the fitted joints.
//!
//! ```text
//! Q_j = argmin over rotations  Σ_children |b̂ − Q â|²,   nearest to that of the parent among minimizers
//! ```
//!
//! with bone directions `a` of the template and `b` of the result: a joint with one child takes the shortest rotation. World frames of the
//! template are rotated by `Q` and keep their scales, so that limits keep their meaning relative to the bones. A joint without image follows
//! its parent: `p = p_h + s_h Q_h (x − x_h)`, with `s_h` the stretch of the limbs there; a root outside the surface follows the global
//! similarity.

use nalgebra::{Matrix3, Matrix4, Rotation3, Unit, Vector3};

use super::FittedLimb;
use super::graph::Graph;
use super::limbs::Layout;
use crate::character::{CharacterError, Skeleton};
use plumbline_num::math::{Trs, nearest_rotation};

/// Weight of the parent's rotation relative to the children's directions: only selects among minimizers.
const PARENT_WEIGHT: f64 = 1e-6;

/// Bone directions in the template and in the result.
type Directions = (Unit<Vector3<f64>>, Unit<Vector3<f64>>);

/// A fitted joint.
#[derive(Clone, Copy, Debug)]
struct Placed {
    position: Vector3<f64>,
    rotation: Matrix3<f64>,
    scale: f64,
}

/// The template at rest with the positions of a layout, and its limbs.
pub(super) fn posed(
    template: &Skeleton,
    bones: &Graph,
    branches: &Graph,
    layout: &Layout,
    positions: &[Option<Vector3<f64>>],
) -> Result<(Skeleton, Vec<FittedLimb>), CharacterError> {
    let mut placed = on_the_curve(template, bones, layout, positions);
    let limbs = limbs(bones, layout, &placed);
    // Joints without image follow their neighbors, breadth first.
    let mut queue: Vec<u32> = (0..placed.len() as u32).filter(|j| placed[*j as usize].is_some()).collect();
    let is_above = |j: u32, at: u32| template.joints()[at as usize].parent == Some(j);
    let whole = (layout.alignment.rotation, layout.scale());
    let mut next = 0;
    while let Some(at) = queue.get(next).copied() {
        next += 1;
        let Some(known) = placed[at as usize] else { continue };
        for &j in bones.neighbors(at) {
            if placed[j as usize].is_none() {
                let offset = bones.points[j as usize] - bones.points[at as usize];
                let (rotation, scale) = if is_above(j, at) { whole } else { (known.rotation, known.scale) };
                placed[j as usize] =
                    Some(Placed { position: known.position + rotation * offset * scale, rotation, scale });
                queue.push(j);
            }
        }
    }
    let all: Vec<Placed> = placed.into_iter().flatten().collect();
    Ok((rebuilt(template, branches, &all)?, limbs))
}

/// The joints with images: rotations from their children, scales from their limbs.
fn on_the_curve(
    template: &Skeleton,
    bones: &Graph,
    layout: &Layout,
    positions: &[Option<Vector3<f64>>],
) -> Vec<Option<Placed>> {
    let mut lengths = vec![[0.0; 2]; positions.len()];
    for limb in &layout.limbs {
        for j in &limb.joints {
            let [old, new] = &mut lengths[*j as usize];
            *old += limb.length;
            *new += limb.path.length();
        }
    }
    let mut placed: Vec<Option<Placed>> = vec![None; positions.len()];
    for &j in template.parents_first() {
        let Some(position) = positions[j as usize] else { continue };
        let parent = template.joints()[j as usize].parent.and_then(|p| placed[p as usize]);
        let base = parent.map_or(layout.alignment.rotation, |p| p.rotation);
        let bone = |c: &u32| {
            let (old, new) = (bones.points[*c as usize] - bones.points[j as usize], positions[*c as usize]? - position);
            Some((Unit::try_new(old, 1e-12)?, Unit::try_new(new, 1e-12)?))
        };
        let directions: Vec<Directions> = template.children(j).iter().filter_map(bone).collect();
        let [old, new] = lengths[j as usize];
        placed[j as usize] = Some(Placed { position, rotation: rotation(&base, &directions), scale: new / old });
    }
    placed
}

/// The rotation that best maps the first of each pair to the second.
fn rotation(base: &Matrix3<f64>, directions: &[Directions]) -> Matrix3<f64> {
    match directions {
        [] => *base,
        [(old, new)] => shortest(&(base * old.into_inner()), new) * base,
        several => {
            let sum: Matrix3<f64> = several.iter().map(|(old, new)| new.into_inner() * old.transpose()).sum();
            nearest_rotation(&(sum + base * PARENT_WEIGHT))
        }
    }
}

/// The shortest rotation between two directions; for opposite ones about any perpendicular axis.
fn shortest(from: &Vector3<f64>, to: &Vector3<f64>) -> Matrix3<f64> {
    let (axis, cos) = (from.cross(to), from.dot(to));
    let across = || Unit::new_normalize(from.cross(&Vector3::ith(from.iamin(), 1.0)));
    let about = Unit::try_new(axis, 1e-12).unwrap_or_else(across);
    Rotation3::from_axis_angle(&about, axis.norm().atan2(cos)).into_inner()
}

/// The skeleton with the template's world frames, rotated and moved.
fn rebuilt(template: &Skeleton, branches: &Graph, placed: &[Placed]) -> Result<Skeleton, CharacterError> {
    let old = template.rest_globals();
    let mut joints = template.joints().to_vec();
    let mut worlds: Vec<Matrix4<f64>> = vec![Matrix4::identity(); joints.len()];
    for &j in template.parents_first() {
        let Placed { position, rotation, .. } = placed[j as usize];
        let mut world = rotation.to_homogeneous() * old[j as usize];
        world.fixed_view_mut::<3, 1>(0, 3).copy_from(&branches.of_model(&position).coords);
        let above = joints[j as usize].parent.map_or_else(Matrix4::identity, |p| worlds[p as usize]);
        let flat = || {
            let name = &template.joints()[j as usize].name;
            CharacterError::Template(format!("a frame above joint {name:?} of the template has a scale of 0"))
        };
        let rest = Trs::from_matrix(&(above.try_inverse().ok_or_else(flat)? * world));
        worlds[j as usize] = above * rest.matrix();
        joints[j as usize].rest = rest;
    }
    Skeleton::new(joints)
}

/// All limbs: those on the curve, and those without image.
fn limbs(bones: &Graph, layout: &Layout, placed: &[Option<Placed>]) -> Vec<FittedLimb> {
    let scale = layout.scale();
    let stretch = |l: &super::limbs::Limb| FittedLimb {
        from: l.joints[0],
        to: l.joints[l.joints.len() - 1],
        stretch: Some(l.path.length() / (l.length * scale)),
    };
    let mut limbs: Vec<FittedLimb> = layout.limbs.iter().map(stretch).collect();
    let is_placed = |v: u32| placed[v as usize].is_some();
    let stops = |v: u32| is_placed(v) || bones.neighbors(v).len() != 2;
    for from in (0..placed.len() as u32).filter(|v| stops(*v)) {
        for &next in bones.neighbors(from) {
            let (mut before, mut to) = (from, next);
            while !stops(to) {
                let on = bones.neighbors(to).iter().copied().find(|v| *v != before).unwrap_or(to);
                (before, to) = (to, on);
            }
            // Reported once: from the side with an image, or from the lower index if neither has one.
            let first = is_placed(from) && !is_placed(to) || !is_placed(from) && !is_placed(to) && from < to;
            if first {
                limbs.push(FittedLimb { from, to, stretch: None });
            }
        }
    }
    limbs
}
