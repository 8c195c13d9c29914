//! Nodes, skins, morph targets and animations of a file, as plain data.
//!
//! A file with a scene graph may reference a mesh several times: each *instance* is a mesh at a node. The vertices of a model
//! are in the world space of the rest pose of their instance (in the space of the bind pose where it has a skin), so that code
//! that uses only the triangles can ignore the nodes. The data suffice to write the file again and to build a character;
//! nothing here interprets them.

use nalgebra::{Matrix4, Quaternion, UnitQuaternion, Vector3};
use serde_json::Value;

use super::{Faces, NO_VALUE};
use crate::mesh::MeshError;
use plumbline_num::math::Trs;
use plumbline_num::spatial::UnionFind;

/// Node hierarchy, skins and animations of a model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Articulation {
    /// The nodes, a forest: each has at most one parent, and there is no cycle.
    pub nodes: Vec<Node>,
    /// Root nodes of the scene.
    pub roots: Vec<u32>,
    /// The skins.
    pub skins: Vec<NodeSkin>,
    /// Instances of meshes.
    pub instances: Vec<Instance>,
    /// The instance of each vertex; `#V`.
    pub instance_of_vertex: Vec<u32>,
    /// Joints and skinning weights of the vertices of skinned instances; `#V` rows.
    pub influences: Influences,
    /// The animations.
    pub animations: Vec<Animation>,
}

/// A node of the transform hierarchy.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Node {
    /// Its name.
    pub name: Option<String>,
    /// Its parent; `None` for a root.
    pub parent: Option<u32>,
    /// Local transform, `parent_from_node`.
    pub transform: NodeTransform,
    /// Other data of the file, passed through.
    pub extras: Option<Value>,
}

/// Local transform of a node, `parent_from_node`.
#[derive(Clone, Debug, PartialEq)]
pub enum NodeTransform {
    /// x → t + R (s ∘ x).
    Trs {
        /// Translation t.
        translation: [f64; 3],
        /// Rotation R as a quaternion x, y, z, w.
        rotation: [f64; 4],
        /// Scale s per axis.
        scale: [f64; 3],
    },
    /// Any affine map.
    Matrix(Matrix4<f64>),
}

impl Default for NodeTransform {
    fn default() -> Self {
        Self::Trs { translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0], scale: [1.0; 3] }
    }
}

impl NodeTransform {
    /// The transform as a homogeneous matrix. A zero quaternion counts as the identity.
    pub fn matrix(&self) -> Matrix4<f64> {
        match self {
            Self::Matrix(matrix) => *matrix,
            Self::Trs { translation, rotation: [x, y, z, w], scale } => {
                let rotation = UnitQuaternion::try_new(Quaternion::new(*w, *x, *y, *z), 0.0).unwrap_or_default();
                let [translation, scale] = [translation, scale].map(|v| Vector3::from(*v));
                Trs { translation, rotation, scale }.matrix()
            }
        }
    }
}

/// A skin: the nodes that deform a mesh by linear blend skinning.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NodeSkin {
    /// Its name.
    pub name: Option<String>,
    /// Node of each joint.
    pub joints: Vec<u32>,
    /// Inverse bind matrix `joint_from_bind` of each joint.
    pub inverse_binds: Vec<Matrix4<f64>>,
}

/// A mesh at a node (an instance).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Instance {
    /// The node.
    pub node: u32,
    /// The skin of the mesh; without one the mesh follows the node rigidly.
    pub skin: Option<u32>,
    /// Name of the mesh.
    pub mesh: Option<String>,
    /// Its morph targets.
    pub targets: Vec<MorphTarget>,
}

/// A morph target (blend shape) of an instance, as offsets from the base shape.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MorphTarget {
    /// Its name.
    pub name: Option<String>,
    /// Morph weight at rest: 0 for the base shape, 1 for the full target.
    pub weight: f64,
    /// Vertices of the model with an offset, in ascending order.
    pub vertices: Vec<u32>,
    /// Offset of each of these vertices.
    pub offsets: Vec<[f64; 3]>,
    /// Normal offsets; empty if the file has none.
    pub normals: Vec<[f64; 3]>,
}

/// Joints and skinning weights per vertex, as compressed sparse rows (CSR).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Influences {
    /// First entry of the row of each vertex, followed by the end of the last row; empty if no vertex is skinned.
    pub starts: Vec<u32>,
    /// Joint indices into the skin of the vertex's instance.
    pub joints: Vec<u32>,
    /// Weights: positive, summing to one in each non-empty row.
    pub weights: Vec<f64>,
}

impl Influences {
    /// Joints and weights of a vertex.
    pub fn row(&self, vertex: usize) -> impl Iterator<Item = (u32, f64)> {
        let end = |at: usize| self.starts.get(at).map_or(0, |&start| start as usize);
        let range = end(vertex)..end(vertex + 1).max(end(vertex));
        self.joints[range.clone()].iter().copied().zip(self.weights[range].iter().copied())
    }

    /// Appends the row of the next vertex.
    pub fn push(&mut self, row: impl IntoIterator<Item = (u32, f64)>) {
        if self.starts.is_empty() {
            self.starts.push(0);
        }
        for (joint, weight) in row {
            self.joints.push(joint);
            self.weights.push(weight);
        }
        self.starts.push(self.joints.len() as u32);
    }

    /// The rows of the given vertices, in their order.
    fn of(&self, vertices: &[u32]) -> Self {
        let mut rows = Self::default();
        if !self.joints.is_empty() {
            for &v in vertices {
                rows.push(self.row(v as usize));
            }
        }
        rows
    }
}

/// An animation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Animation {
    /// Its name.
    pub name: Option<String>,
    /// Its channels, one per animated property of a node.
    pub channels: Vec<Channel>,
}

/// A keyframe track of one property of a node.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// The node.
    pub node: u32,
    /// The animated property.
    pub property: Property,
    /// Interpolation between keys.
    pub interpolation: ChannelInterpolation,
    /// Key times, s: finite, strictly increasing, at least one.
    pub times: Vec<f64>,
    /// Values at the keys, concatenated; for each key of a cubic spline the in-tangent, the value and the out-tangent.
    pub values: Vec<f64>,
}

/// An animated property of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Property {
    /// Three numbers.
    Translation,
    /// A quaternion x, y, z, w.
    Rotation,
    /// Three numbers.
    Scale,
    /// One number per morph target of the instance at the node.
    Weights,
}

/// Interpolation between keys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ChannelInterpolation {
    /// Constant: the value of the preceding key.
    Step,
    /// Linear; spherical linear (slerp) for rotations.
    #[default]
    Linear,
    /// Cubic Hermite spline; normalized for rotations.
    CubicSpline,
}

impl ChannelInterpolation {
    /// Stored values per key.
    pub fn per_key(self) -> usize {
        if self == Self::CubicSpline { 3 } else { 1 }
    }
}

/// A node from which the chain of parents does not end, if there is a cycle.
pub(in crate::mesh) fn cycle(nodes: &[Node]) -> Option<usize> {
    // A path to the root has at most as many steps as there are nodes; `done` marks nodes whose path is known to end.
    let mut done = vec![false; nodes.len()];
    for start in 0..nodes.len() {
        let (mut path, mut at) = (Vec::new(), Some(start));
        while let Some(node) = at.filter(|&node| !done[node]) {
            if path.len() > nodes.len() {
                return Some(start);
            }
            path.push(node);
            at = nodes[node].parent.map(|p| p as usize);
        }
        for node in path {
            done[node] = true;
        }
    }
    None
}

impl Articulation {
    /// `world_from_node` of every node in the rest pose.
    pub fn world_from_nodes(&self) -> Vec<Matrix4<f64>> {
        let mut world: Vec<Option<Matrix4<f64>>> = vec![None; self.nodes.len()];
        for start in 0..self.nodes.len() {
            // The nodes from `start` up to the first ancestor with a known transform, then down again.
            let mut path = vec![start];
            while let Some(parent) = self.nodes[path[path.len() - 1]].parent.filter(|&p| world[p as usize].is_none()) {
                path.push(parent as usize);
            }
            for node in path.into_iter().rev() {
                let parent = self.nodes[node].parent.and_then(|p| world[p as usize]);
                world[node] = Some(parent.unwrap_or_else(Matrix4::identity) * self.nodes[node].transform.matrix());
            }
        }
        world.into_iter().map(|m| m.unwrap_or_else(Matrix4::identity)).collect()
    }

    /// The instance at a node.
    pub fn instance_at(&self, node: u32) -> Option<usize> {
        self.instances.iter().position(|instance| instance.node == node)
    }

    /// Checks that all indices are in range, the nodes form a forest and each face belongs to one instance.
    pub(super) fn check(&self, vertices: usize, faces: &Faces) -> Result<(), MeshError> {
        let fault = |fault: String| Err(MeshError::Articulation { fault });
        // Nodes: indices in range, no cycle.
        let (nodes, skins, instances) = (self.nodes.len(), self.skins.len(), self.instances.len());
        let mut named = self.roots.iter().chain(self.nodes.iter().filter_map(|n| n.parent.as_ref()));
        if let Some(node) = named.find(|&&n| n as usize >= nodes) {
            return fault(format!("node {node} is named, but there are {nodes}"));
        }
        if let Some(node) = cycle(&self.nodes) {
            return fault(format!("node {node} is its own ancestor"));
        }
        // Skins: joints in range, one inverse bind matrix each.
        for (k, skin) in self.skins.iter().enumerate() {
            let known = skin.joints.iter().all(|&j| (j as usize) < nodes);
            if !known || skin.joints.len() != skin.inverse_binds.len() {
                let (joints, matrices) = (skin.joints.len(), skin.inverse_binds.len());
                return fault(format!("skin {k} has {joints} joints among {nodes} nodes, and {matrices} matrices"));
            }
        }
        // Instances: node and skin in range; one instance per vertex.
        let known = |i: &Instance| (i.node as usize) < nodes && i.skin.is_none_or(|s| (s as usize) < skins);
        if let Some(k) = self.instances.iter().position(|i| !known(i)) {
            return fault(format!("instance {k} names a node or a skin that does not exist"));
        }
        if self.instance_of_vertex.len() != vertices
            || self.instance_of_vertex.iter().any(|&i| i as usize >= instances)
            || !(self.influences.starts.is_empty() || self.influences.starts.len() == vertices + 1)
        {
            return fault(format!("each of {vertices} vertices must lie in one of {instances} instances"));
        }
        // Skinning weights: joints within the skin of the vertex's instance.
        for vertex in 0..vertices {
            let skin = self.instances[self.instance_of_vertex[vertex] as usize].skin;
            let joints = skin.map_or(0, |s| self.skins[s as usize].joints.len());
            if let Some((joint, _)) = self.influences.row(vertex).find(|&(j, _)| j as usize >= joints) {
                return fault(format!("vertex {vertex} follows joint {joint}, but its skin has {joints}"));
            }
        }
        // Faces: all corners in one instance.
        let of = |&v: &u32| self.instance_of_vertex[v as usize];
        if faces.iter().any(|face| face.iter().any(|v| of(v) != of(&face[0]))) {
            return fault("a face joins vertices of several instances".to_owned());
        }
        self.check_movement(vertices)
    }

    /// Checks the morph targets and the animation channels.
    fn check_movement(&self, vertices: usize) -> Result<(), MeshError> {
        let fault = |fault: String| Err(MeshError::Articulation { fault });
        for target in self.instances.iter().flat_map(|i| &i.targets) {
            let full = |values: usize| values == target.vertices.len();
            if !full(target.offsets.len()) || !(target.normals.is_empty() || full(target.normals.len())) {
                return fault("a morph target needs one offset per vertex that it moves".to_owned());
            }
            if target.vertices.iter().any(|&v| v as usize >= vertices) {
                return fault(format!("a morph target moves a vertex beyond the {vertices} of the mesh"));
            }
        }
        for channel in self.animations.iter().flat_map(|a| &a.channels) {
            if channel.node as usize >= self.nodes.len() || channel.times.is_empty() {
                return fault(format!("a channel of node {} has no such node, or no key", channel.node));
            }
        }
        Ok(())
    }

    /// The articulation restricted to the given vertices, with `faces` over the new indices; `None` where a face joins
    /// instances that move differently.
    pub(super) fn of(&self, vertices: &[u32], faces: &Faces) -> Option<Self> {
        let mut kept = self.clone();
        kept.instance_of_vertex = vertices.iter().map(|&v| self.instance_of_vertex[v as usize]).collect();
        kept.influences = self.influences.of(vertices);
        // Morph targets: keep the offsets of the remaining vertices, in ascending order of the new indices.
        let mut new_of_old = vec![NO_VALUE; self.instance_of_vertex.len()];
        vertices.iter().enumerate().for_each(|(new, &old)| new_of_old[old as usize] = new as u32);
        for target in kept.instances.iter_mut().flat_map(|i| &mut i.targets) {
            let mut moved: Vec<_> = (0..target.vertices.len())
                .map(|k| (new_of_old[target.vertices[k] as usize], k))
                .filter(|&(new, _)| new != NO_VALUE)
                .collect();
            moved.sort_unstable();
            target.vertices = moved.iter().map(|&(new, _)| new).collect();
            target.offsets = moved.iter().map(|&(_, k)| target.offsets[k]).collect();
            if !target.normals.is_empty() {
                target.normals = moved.iter().map(|&(_, k)| target.normals[k]).collect();
            }
        }
        kept.joined_by(faces).then_some(kept)
    }

    /// Merges instances that faces join; returns whether the merged ones move alike: the same skin and no morph targets.
    fn joined_by(&mut self, faces: &Faces) -> bool {
        let mut sets = UnionFind::new(self.instances.len());
        for face in faces.iter() {
            for pair in face.windows(2) {
                let [a, b] = [pair[0], pair[1]].map(|v| self.instance_of_vertex[v as usize]);
                sets.join(a, b);
            }
        }
        let leader = sets.roots();
        let alike = |i: usize| {
            let (a, b) = (&self.instances[i], &self.instances[leader[i] as usize]);
            i == leader[i] as usize
                || a.skin.is_some() && a.skin == b.skin && a.targets.is_empty() && b.targets.is_empty()
        };
        let all_alike = (0..leader.len()).all(alike);
        self.instance_of_vertex.iter_mut().for_each(|i| *i = leader[*i as usize]);
        all_alike
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_follow_their_parents_in_any_order_of_nodes() {
        let at = |x: f64, parent| Node {
            parent,
            transform: NodeTransform::Trs {
                translation: [x, 0.0, 0.0],
                rotation: [0.0, 0.0, 0.0, 1.0],
                scale: [2.0; 3],
            },
            ..Node::default()
        };
        let tree =
            Articulation { nodes: vec![at(3.0, Some(2)), at(5.0, Some(0)), at(1.0, None)], ..Default::default() };
        let x: Vec<f64> = tree.world_from_nodes().iter().map(|m| m[(0, 3)]).collect();
        assert_eq!(x, [1.0 + 2.0 * 3.0, 1.0 + 2.0 * (3.0 + 2.0 * 5.0), 1.0]);
        assert_eq!(cycle(&tree.nodes), None);
        let ring = Articulation { nodes: vec![at(0.0, Some(1)), at(0.0, Some(0))], ..Default::default() };
        assert_eq!(cycle(&ring.nodes), Some(0));
    }
}
