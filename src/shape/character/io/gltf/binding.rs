//! A common binding for all skins of a file.

use nalgebra::Matrix4;

use super::joints::Joints;
use crate::character::{CharacterError, RigFileError};
use crate::mesh::model::articulation::Articulation;

/// Largest difference of consistent bind matrices, relative to the largest entry: products of single-precision matrices.
const BIND_TOLERANCE: f64 = 1e-4;

/// One inverse bind matrix per joint, and the maps that make all instances consistent with them.
pub(super) struct Bound {
    pub(super) inverse_bind: Vec<Matrix4<f64>>,
    /// Map of the vertices of each instance to the pose in which these matrices bind them.
    pub(super) world_from_instance: Vec<Matrix4<f64>>,
}

pub(super) fn bind(articulation: &Articulation, joints: &Joints) -> Result<Bound, RigFileError> {
    let mut inverse_bind: Vec<Option<Matrix4<f64>>> = vec![None; joints.nodes.len()];
    let mut of_skin: Vec<Option<Matrix4<f64>>> = vec![None; articulation.skins.len()];
    for (skin, map) in of_skin.iter_mut().enumerate() {
        if articulation.instances.iter().any(|i| i.skin == Some(skin as u32)) {
            *map = Some(skin_map(articulation, joints, skin, &mut inverse_bind)?);
        }
    }
    let world = articulation.world_from_nodes();
    let mut world_from_instance = Vec::new();
    for instance in &articulation.instances {
        let map = if let Some(skin) = instance.skin {
            of_skin[skin as usize].unwrap_or_else(Matrix4::identity)
        } else {
            let joint = joints.of_node[instance.node as usize] as usize;
            let flat = || CharacterError::flat_joint(&joints.skeleton.joints()[joint].name);
            let back = world[instance.node as usize].try_inverse().ok_or_else(flat)?;
            // The vertices are in the rest pose of the node; B⁻¹ W⁻¹ maps them to the bind pose of B.
            let bind = *inverse_bind[joint].get_or_insert(back);
            if bind == back { Matrix4::identity() } else { bind.try_inverse().ok_or_else(flat)? * back }
        };
        world_from_instance.push(map);
    }
    let rest = |joint: usize| world[joints.nodes[joint] as usize].try_inverse().unwrap_or_else(Matrix4::identity);
    let inverse_bind = inverse_bind.into_iter().enumerate().map(|(j, b)| b.unwrap_or_else(|| rest(j))).collect();
    Ok(Bound { inverse_bind, world_from_instance })
}

/// The map M of a skin with B' = B M; registers the bind matrices of joints that no earlier skin bound.
fn skin_map(
    articulation: &Articulation,
    joints: &Joints,
    number: usize,
    inverse_bind: &mut [Option<Matrix4<f64>>],
) -> Result<Matrix4<f64>, RigFileError> {
    let skin = &articulation.skins[number];
    let joint = |k: usize| joints.of_node[skin.joints[k] as usize] as usize;
    let refused = |k: usize| {
        let name = &joints.skeleton.joints()[joint(k)].name;
        let fault = "otherwise than the skins before it, and not by one map for all its joints";
        RigFileError::Content(format!("skin {number} binds joint {name:?} {fault}"))
    };
    let known = (0..skin.joints.len()).find_map(|k| Some((k, inverse_bind[joint(k)]?)));
    let map = match known {
        None => Matrix4::identity(),
        Some((k, first)) if first == skin.inverse_binds[k] => Matrix4::identity(),
        Some((k, first)) => first.try_inverse().ok_or_else(|| refused(k))? * skin.inverse_binds[k],
    };
    let back = map.try_inverse();
    for (k, bind) in skin.inverse_binds.iter().enumerate() {
        match inverse_bind[joint(k)] {
            Some(first) if (first * map - bind).amax() > BIND_TOLERANCE * bind.amax() => return Err(refused(k)),
            Some(_) => {}
            None => inverse_bind[joint(k)] = Some(bind * back.ok_or_else(|| refused(k))?),
        }
    }
    Ok(map)
}
