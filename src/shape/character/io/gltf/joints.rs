//! Selection of the nodes that become joints.

use std::collections::HashSet;

use nalgebra::Matrix4;

use crate::character::character::free_name;
use crate::character::{Joint, RigFileError, Skeleton};
use crate::mesh::NO_VALUE;
use crate::mesh::model::articulation::{Articulation, NodeTransform};
use plumbline_num::math::Trs;

/// Largest error of a translation–rotation–scale frame, relative to the largest entry: single-precision matrices pass.
const SHEAR_TOLERANCE: f64 = 1e-5;

/// The nodes that move the surface.
pub(super) struct Joints {
    pub(super) skeleton: Skeleton,
    /// Joint of each node; [`NO_VALUE`] for others.
    pub(super) of_node: Vec<u32>,
    /// Node of each joint.
    pub(super) nodes: Vec<u32>,
}

impl Joints {
    /// Joints of skins first, in their order, then nodes of unskinned meshes, then the ancestors of all these. Of a file without meshes all
    /// nodes.
    pub(super) fn of(articulation: &Articulation, warnings: &mut Vec<String>) -> Result<Self, RigFileError> {
        let used = |skin: usize| articulation.instances.iter().any(|i| i.skin == Some(skin as u32));
        let skins = articulation.skins.iter().enumerate().filter(|(s, _)| used(*s)).flat_map(|(_, s)| &s.joints);
        let rigid = articulation.instances.iter().filter(|i| i.skin.is_none()).map(|i| &i.node);
        let mut nodes: Vec<u32> = Vec::new();
        let mut of_node = vec![NO_VALUE; articulation.nodes.len()];
        let mut add = |nodes: &mut Vec<u32>, node: u32| {
            let new = of_node[node as usize] == NO_VALUE;
            if new {
                of_node[node as usize] = nodes.len() as u32;
                nodes.push(node);
            }
            new
        };
        for &node in skins.chain(rigid) {
            add(&mut nodes, node);
        }
        if articulation.instances.is_empty() {
            for node in 0..articulation.nodes.len() as u32 {
                add(&mut nodes, node);
            }
        }
        for first in 0..nodes.len() {
            let mut above = articulation.nodes[nodes[first] as usize].parent;
            while let Some(node) = above.filter(|&node| add(&mut nodes, node)) {
                above = articulation.nodes[node as usize].parent;
            }
        }
        if nodes.is_empty() {
            return Err(RigFileError::NoSkin);
        }
        let names = names(articulation, &nodes, warnings);
        let mut joints = Vec::with_capacity(nodes.len());
        for (&node, name) in nodes.iter().zip(names) {
            let described = &articulation.nodes[node as usize];
            let sheared = || {
                let supported = "a joint supports translation, rotation and scale only";
                RigFileError::Content(format!("the matrix of node {name:?} has shear; {supported}"))
            };
            let rest = frame(&described.transform).ok_or_else(sheared)?;
            let parent = described.parent.map(|p| of_node[p as usize]).filter(|&p| p != NO_VALUE);
            let limits = super::limits::read(described.extras.as_ref(), &name)?;
            joints.push(Joint { name, parent, rest, limits });
        }
        Ok(Self { skeleton: Skeleton::new(joints)?, of_node, nodes })
    }
}

/// A unique name for each node.
fn names(articulation: &Articulation, nodes: &[u32], warnings: &mut Vec<String>) -> Vec<String> {
    let mut taken = HashSet::new();
    let mut renamed = 0;
    let mut name = |&node: &u32| {
        let own = articulation.nodes[node as usize].name.clone().filter(|name| !name.is_empty());
        let named = own.is_some();
        let base = own.unwrap_or_else(|| format!("node {node}"));
        let name = free_name(&base, |name| taken.contains(name));
        renamed += usize::from(named && name != base);
        taken.insert(name.clone());
        name
    };
    let names = nodes.iter().map(&mut name).collect();
    if renamed > 0 {
        warnings.push(format!("{renamed} joints have the name of another; a number is put behind theirs"));
    }
    names
}

fn frame(transform: &NodeTransform) -> Option<Trs> {
    match transform {
        NodeTransform::Trs { translation, scale, rotation: [x, y, z, w] } => {
            let quaternion = nalgebra::Quaternion::new(*w, *x, *y, *z);
            let rotation = nalgebra::UnitQuaternion::try_new(quaternion, 0.0).unwrap_or_default();
            Some(Trs { translation: (*translation).into(), rotation, scale: (*scale).into() })
        }
        NodeTransform::Matrix(matrix) => {
            let trs = Trs::from_matrix(matrix);
            let lost: Matrix4<f64> = trs.matrix() - matrix;
            let linear = matrix.fixed_view::<3, 3>(0, 0).amax();
            (trs.is_finite() && lost.amax() <= SHEAR_TOLERANCE * linear).then_some(trs)
        }
    }
}
