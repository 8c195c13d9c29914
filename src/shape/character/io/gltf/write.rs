//! Conversion of characters to glTF models.

use crate::character::{Character, Clip, Curve, Interpolation, Keys, RotationKeys};
use crate::mesh::model::articulation::{
    Animation, Articulation, Channel, ChannelInterpolation, Influences, Instance, MorphTarget, Node, NodeSkin,
    NodeTransform, Property,
};
use crate::mesh::{MeshError, Model};
use plumbline_num::math::Trs;

/// Samples per second of smooth curves, which glTF lacks: a frame of common displays.
const SMOOTH_RATE: f64 = 60.0;

impl Character {
    /// The model with skeleton, skin, morph targets and clips as glTF stores them. Nodes are in `pose`, or at rest without one. Smooth
    /// curves are sampled at 60 keys per second.
    ///
    /// # Errors
    /// [`MeshError::Articulation`] for a pose of another skeleton.
    pub fn to_model(&self, pose: Option<&crate::character::Pose>) -> Result<Model, MeshError> {
        let joints = self.skeleton.joints();
        let locals: Vec<Trs> = pose.map_or_else(|| joints.iter().map(|j| j.rest).collect(), |p| p.locals.clone());
        if locals.len() != joints.len() {
            let fault = format!("a pose of {} joints for a skeleton of {}", locals.len(), joints.len());
            return Err(MeshError::Articulation { fault });
        }
        let node = |(joint, local): (&crate::character::Joint, &Trs)| Node {
            name: Some(joint.name.clone()),
            parent: joint.parent,
            transform: NodeTransform::Trs {
                translation: local.translation.into(),
                rotation: local.rotation.coords.into(),
                scale: local.scale.into(),
            },
            extras: joint.limits.as_ref().map(super::limits::written),
        };
        let mut nodes: Vec<Node> = joints.iter().zip(&locals).map(node).collect();
        let mesh_node = nodes.len() as u32;
        nodes.push(Node { name: Some(free_name(&nodes, "surface")), ..Node::default() });
        let mut influences = Influences::default();
        for row in self.skin.weights().rows() {
            influences.push(row.iter().map(|i| (i.joint, i.weight)));
        }
        let skin = NodeSkin {
            name: None,
            joints: (0..joints.len() as u32).collect(),
            inverse_binds: self.skin.inverse_bind().to_vec(),
        };
        let targets = self.targets.iter().map(|t| MorphTarget {
            name: Some(t.name.clone()),
            weight: t.weight,
            vertices: t.vertices.clone(),
            offsets: t.offsets.clone(),
            normals: Vec::new(),
        });
        let instance = Instance { node: mesh_node, skin: Some(0), mesh: None, targets: targets.collect() };
        let articulation = Articulation {
            roots: self.skeleton.roots().chain([mesh_node]).collect(),
            skins: vec![skin],
            instances: vec![instance],
            instance_of_vertex: vec![0; self.model.mesh().vertex_count()],
            influences,
            animations: self.clips.iter().map(|clip| animation(clip, mesh_node, &self.rest_weights())).collect(),
            nodes,
        };
        self.model.clone().with_articulation(Some(articulation))
    }
}

/// The name, numbered if a node has it already.
fn free_name(nodes: &[Node], name: &str) -> String {
    let taken = |name: &str| nodes.iter().any(|n| n.name.as_deref() == Some(name));
    let numbered = (1..).map(|k| if k == 1 { name.to_owned() } else { format!("{name} {k}") });
    numbered.into_iter().find(|name| !taken(name)).expect("there is no end of numbers")
}

fn animation(clip: &Clip, mesh_node: u32, rest: &[f64]) -> Animation {
    let channel = |track: &crate::character::Track| {
        let (property, (times, values, interpolation)) = match &track.curve {
            Curve::Translation(keys) => (Property::Translation, numbers(keys)),
            Curve::Scale(keys) => (Property::Scale, numbers(keys)),
            Curve::Rotation(keys) => (Property::Rotation, rotations(keys)),
        };
        Channel { node: track.joint, property, interpolation, times, values }
    };
    let mut channels: Vec<Channel> = clip.tracks().iter().map(channel).collect();
    channels.extend(weights(clip, mesh_node, rest));
    Animation { name: Some(clip.name().to_owned()), channels }
}

/// Times, values and interpolation.
type Numbers = (Vec<f64>, Vec<f64>, ChannelInterpolation);

fn numbers<const N: usize>(keys: &Keys<N>) -> Numbers {
    match keys.interpolation() {
        Interpolation::Step => (keys.times().to_vec(), keys.values().concat(), ChannelInterpolation::Step),
        Interpolation::Linear => (keys.times().to_vec(), keys.values().concat(), ChannelInterpolation::Linear),
        Interpolation::Smooth => {
            let times = fine(keys.times());
            let values = times.iter().flat_map(|&t| keys.at(t)).collect();
            (times, values, ChannelInterpolation::Linear)
        }
        Interpolation::Cubic { arriving, leaving } => {
            let rows = arriving.iter().zip(keys.values()).zip(leaving);
            let values = rows.flat_map(|((a, v), l)| [*a, *v, *l].concat()).collect();
            (keys.times().to_vec(), values, ChannelInterpolation::CubicSpline)
        }
    }
}

fn rotations(keys: &RotationKeys) -> Numbers {
    if *keys.keys().interpolation() != Interpolation::Smooth {
        return numbers(keys.keys());
    }
    let times = fine(keys.keys().times());
    let values = times.iter().flat_map(|&t| <[f64; 4]>::from(keys.at(t).coords)).collect();
    (times, values, ChannelInterpolation::Linear)
}

/// The keys and sample times between them.
fn fine(keys: &[f64]) -> Vec<f64> {
    let mut times = vec![keys[0]];
    for pair in keys.windows(2) {
        let steps = ((pair[1] - pair[0]) * SMOOTH_RATE).ceil().clamp(1.0, 1e5) as u32;
        times.extend((1..steps).map(|k| pair[0] + (pair[1] - pair[0]) * f64::from(k) / f64::from(steps)));
        times.push(pair[1]);
    }
    times
}

/// One channel for all morph targets: with their own keys if all have the same times, else sampled at every key.
fn weights(clip: &Clip, node: u32, rest: &[f64]) -> Option<Channel> {
    let first = clip.morphs().first().filter(|_| !rest.is_empty())?;
    let plain = |b: &Interpolation<1>| matches!(b, Interpolation::Step | Interpolation::Linear);
    let same =
        |keys: &Keys<1>| keys.times() == first.keys.times() && keys.interpolation() == first.keys.interpolation();
    let all_same = plain(first.keys.interpolation()) && clip.morphs().iter().all(|m| same(&m.keys));
    let step = *first.keys.interpolation() == Interpolation::Step;
    let mut times: Vec<f64> = clip
        .morphs()
        .iter()
        .flat_map(|m| if plain(m.keys.interpolation()) { m.keys.times().to_vec() } else { fine(m.keys.times()) })
        .collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    let value = |target: usize, t: f64| {
        let track = clip.morphs().iter().find(|m| m.target as usize == target);
        track.map_or(rest[target], |m| m.keys.at(t)[0])
    };
    let values = times.iter().flat_map(|&t| (0..rest.len()).map(move |k| (k, t))).map(|(k, t)| value(k, t)).collect();
    let interpolation = if all_same && step { ChannelInterpolation::Step } else { ChannelInterpolation::Linear };
    Some(Channel { node, property: Property::Weights, interpolation, times, values })
}
