//! Nodes, skins, morph targets and animations of a file, as plain data.
//!
//! A file that moves places its surface several times over: each *instance* is a mesh at a node. The vertices of a model lie where
//! the instance stands at rest (in the space of its bind pose where it has a skin), so that whoever reads triangles alone need not
//! know of nodes. What stands here is enough to write the file again, and to make a character of it; nothing here interprets it.

use nalgebra::{Matrix3, Matrix4, Quaternion, Rotation3, UnitQuaternion, Vector3};
use serde_json::Value;

use super::{Faces, NO_VALUE};
use crate::mesh::MeshError;
use plumbline_num::spatial::UnionFind;

/// Node hierarchy, skins and animations of a model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Articulation {
    /// The nodes, a forest: each has at most one parent and is not its own ancestor.
    pub nodes: Vec<Node>,
    /// Nodes that the scene begins with.
    pub roots: Vec<u32>,
    /// The skins.
    pub skins: Vec<NodeSkin>,
    /// Placements of meshes.
    pub instances: Vec<Instance>,
    /// The instance of each vertex; `#V`.
    pub instance_of_vertex: Vec<u32>,
    /// What the vertices of skinned instances follow; `#V` rows.
    pub influences: Influences,
    /// The animations.
    pub animations: Vec<Animation>,
}

/// A node of the transform hierarchy.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Node {
    /// Its name.
    pub name: Option<String>,
    /// Its parent.
    pub parent: Option<u32>,
    /// Local transform.
    pub transform: NodeTransform,
    /// Other data of the file, passed through.
    pub extras: Option<Value>,
}

/// `parent_from_node`.
#[derive(Clone, Debug, PartialEq)]
pub enum NodeTransform {
    /// x → t + R (s ∘ x).
    Trs {
        /// t.
        translation: [f64; 3],
        /// R as a quaternion x, y, z, w.
        rotation: [f64; 4],
        /// s.
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
    /// The map as a matrix.
    pub fn matrix(&self) -> Matrix4<f64> {
        match self {
            Self::Matrix(matrix) => *matrix,
            Self::Trs { translation, rotation: [x, y, z, w], scale } => {
                let quaternion = Quaternion::new(*w, *x, *y, *z);
                let turn = UnitQuaternion::try_new(quaternion, 0.0).unwrap_or_else(UnitQuaternion::identity);
                let linear = Rotation3::from(turn).into_inner() * Matrix3::from_diagonal(&Vector3::from(*scale));
                let mut matrix = linear.to_homogeneous();
                matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&Vector3::from(*translation));
                matrix
            }
        }
    }
}

/// Nodes that a mesh follows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NodeSkin {
    /// Its name.
    pub name: Option<String>,
    /// The nodes that are its joints.
    pub joints: Vec<u32>,
    /// `joint_from_bind` of each joint.
    pub inverse_binds: Vec<Matrix4<f64>>,
}

/// A mesh at a node.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Instance {
    /// The node.
    pub node: u32,
    /// The skin that its vertices follow; without one they follow the node.
    pub skin: Option<u32>,
    /// Name of the mesh.
    pub mesh: Option<String>,
    /// Its morph targets.
    pub targets: Vec<MorphTarget>,
}

/// Another shape of an instance, as differences.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MorphTarget {
    /// Its name.
    pub name: Option<String>,
    /// How far the instance is morphed at rest; 0 is not at all, 1 wholly.
    pub weight: f64,
    /// Vertices of the model that move, in ascending order.
    pub vertices: Vec<u32>,
    /// How far each of them moves.
    pub offsets: Vec<[f64; 3]>,
    /// Normal offsets; empty if the file has none.
    pub normals: Vec<[f64; 3]>,
}

/// Joints that vertices follow, and how closely; compressed rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Influences {
    /// Where the row of each vertex begins, and where the last ends; empty where no vertex follows a joint.
    pub starts: Vec<u32>,
    /// Joints, numbered as in the skin of the vertex's instance.
    pub joints: Vec<u32>,
    /// Weights: positive, with a sum of one in each row that is not empty.
    pub weights: Vec<f64>,
}

impl Influences {
    /// Joints and weights of a vertex.
    pub fn row(&self, vertex: usize) -> impl Iterator<Item = (u32, f64)> {
        let end = |at: usize| self.starts.get(at).map_or(0, |&start| start as usize);
        let range = end(vertex)..end(vertex + 1).max(end(vertex));
        self.joints[range.clone()].iter().copied().zip(self.weights[range].iter().copied())
    }

    /// Adds the row of the next vertex.
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

    /// The rows of these vertices, in their order.
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

/// A movement.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Animation {
    /// Its name.
    pub name: Option<String>,
    /// What moves.
    pub channels: Vec<Channel>,
}

/// How one property of a node changes.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// The node.
    pub node: u32,
    /// What of it.
    pub property: Property,
    /// How values between keys are found.
    pub interpolation: ChannelInterpolation,
    /// Key times, s: finite, strictly increasing, at least one.
    pub times: Vec<f64>,
    /// Values at the keys, all numbers of one after the other; for each key of a cubic spline the tangent in, the value and the
    /// tangent out.
    pub values: Vec<f64>,
}

/// What moves.
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

/// How values between keys are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ChannelInterpolation {
    /// The last key's.
    Step,
    /// On the straight line; on the great circle for rotations.
    #[default]
    Linear,
    /// Cubic Hermite; normalized for rotations.
    CubicSpline,
}

impl ChannelInterpolation {
    /// Values per key.
    pub fn per_key(self) -> usize {
        if self == Self::CubicSpline { 3 } else { 1 }
    }
}

impl Articulation {
    /// `world_from_node` of every node at rest.
    pub fn world_from_nodes(&self) -> Vec<Matrix4<f64>> {
        let mut world: Vec<Option<Matrix4<f64>>> = vec![None; self.nodes.len()];
        for start in 0..self.nodes.len() {
            let mut way = vec![start];
            while let Some(parent) = self.nodes[way[way.len() - 1]].parent.filter(|&p| world[p as usize].is_none()) {
                way.push(parent as usize);
            }
            for node in way.into_iter().rev() {
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

    /// Checks that all indices are in range and every face is in one instance.
    pub(super) fn check(&self, vertices: usize, faces: &Faces) -> Result<(), MeshError> {
        let fault = |fault: String| Err(MeshError::Articulation { fault });
        let (nodes, skins, instances) = (self.nodes.len(), self.skins.len(), self.instances.len());
        let mut named = self.roots.iter().chain(self.nodes.iter().filter_map(|n| n.parent.as_ref()));
        if let Some(node) = named.find(|&&n| n as usize >= nodes) {
            return fault(format!("node {node} is named, but there are {nodes}"));
        }
        if let Some(node) = self.cycle() {
            return fault(format!("node {node} is its own ancestor"));
        }
        for (k, skin) in self.skins.iter().enumerate() {
            let known = skin.joints.iter().all(|&j| (j as usize) < nodes);
            if !known || skin.joints.len() != skin.inverse_binds.len() {
                let (joints, matrices) = (skin.joints.len(), skin.inverse_binds.len());
                return fault(format!("skin {k} has {joints} joints among {nodes} nodes, and {matrices} matrices"));
            }
        }
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
        for vertex in 0..vertices {
            let skin = self.instances[self.instance_of_vertex[vertex] as usize].skin;
            let joints = skin.map_or(0, |s| self.skins[s as usize].joints.len());
            if let Some((joint, _)) = self.influences.row(vertex).find(|&(j, _)| j as usize >= joints) {
                return fault(format!("vertex {vertex} follows joint {joint}, but its skin has {joints}"));
            }
        }
        let of = |&v: &u32| self.instance_of_vertex[v as usize];
        if faces.iter().any(|face| face.iter().any(|v| of(v) != of(&face[0]))) {
            return fault("a face joins vertices of several instances".to_owned());
        }
        self.check_movement(vertices)
    }

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

    /// A node that is its own ancestor.
    fn cycle(&self) -> Option<usize> {
        // A path to the root has at most as many steps as nodes; `done` marks nodes whose path is known to end.
        let mut done = vec![false; self.nodes.len()];
        for start in 0..self.nodes.len() {
            let mut way = Vec::new();
            let mut at = Some(start);
            while let Some(node) = at.filter(|&node| !done[node]) {
                if way.len() > self.nodes.len() {
                    return Some(start);
                }
                way.push(node);
                at = self.nodes[node].parent.map(|p| p as usize);
            }
            for node in way {
                done[node] = true;
            }
        }
        None
    }

    /// What is left where vertices of the model are chosen, and faces made of them; `None` where faces then join instances that
    /// move in different ways.
    pub(super) fn of(&self, vertices: &[u32], faces: &Faces) -> Option<Self> {
        let mut kept = self.clone();
        kept.instance_of_vertex = vertices.iter().map(|&v| self.instance_of_vertex[v as usize]).collect();
        kept.influences = self.influences.of(vertices);
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

    /// Makes one of instances that faces join; whether they move alike.
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
        assert_eq!(tree.cycle(), None);
        let ring = Articulation { nodes: vec![at(0.0, Some(1)), at(0.0, Some(0))], ..Default::default() };
        assert_eq!(ring.cycle(), Some(0));
    }
}
