//! Writer of nodes, skins, morph targets and animations.

use nalgebra::{Matrix4, Vector3};
use serde_json::{Map, Value, json};

use super::super::articulation::{INTERPOLATIONS, PROPERTIES};
use super::parts::Part;
use super::{File, Key, named};
use crate::mesh::model::articulation::{
    Articulation, Channel, ChannelInterpolation, Instance, MorphTarget, NodeTransform, Property,
};
use plumbline_num::document::gltf::ARRAY_BUFFER;

/// Maximum number of influences written per vertex: two sets of four, `JOINTS_0` and `JOINTS_1`, as many as the reader reads.
pub(in crate::mesh::io) const MAX_INFLUENCES: usize = 8;

impl File<'_> {
    /// `JOINTS_n` and `WEIGHTS_n` of the vertices of a part.
    pub(super) fn influences(&mut self, part: &Part, keys: &[Key], attributes: &mut Map<String, Value>) {
        let model = self.model;
        let Some((articulation, instance)) = model.articulation().zip(part.instance) else { return };
        if articulation.instances[instance].skin.is_none() {
            return;
        }
        let rows: Vec<Vec<(u32, f64)>> = keys.iter().map(|k| kept(articulation, k[0] as usize)).collect();
        let sets = rows.iter().map(Vec::len).max().unwrap_or(0).div_ceil(4).max(1);
        let wide = rows.iter().flatten().any(|&(joint, _)| joint > u32::from(u8::MAX));
        for set in 0..sets {
            let item = |row: &Vec<(u32, f64)>, k: usize| row.get(4 * set + k).copied().unwrap_or((0, 0.0));
            let joints: Vec<[u16; 4]> = rows.iter().map(|row| std::array::from_fn(|k| item(row, k).0 as u16)).collect();
            let weights: Vec<[f32; 4]> =
                rows.iter().map(|row| std::array::from_fn(|k| item(row, k).1 as f32)).collect();
            let joints = self.joints(&joints, wide);
            attributes.insert(format!("JOINTS_{set}"), json!(joints));
            let weights = self.buffer.floats(&weights, "VEC4", Some(ARRAY_BUFFER));
            attributes.insert(format!("WEIGHTS_{set}"), json!(weights));
        }
    }

    fn joints(&mut self, joints: &[[u16; 4]], wide: bool) -> usize {
        let bytes: Vec<u8> = if wide {
            joints.iter().flatten().flat_map(|j| j.to_le_bytes()).collect()
        } else {
            joints.iter().flatten().map(|&j| j as u8).collect()
        };
        self.buffer.accessor(&bytes, if wide { 5123 } else { 5121 }, joints.len(), "VEC4", Some(ARRAY_BUFFER))
    }

    /// Morph targets of a part, in the form of the primitives.
    pub(super) fn targets(&mut self, part: &Part, keys: &[Key]) -> Vec<Value> {
        let model = self.model;
        let Some((articulation, instance)) = model.articulation().zip(part.instance) else { return Vec::new() };
        let targets = &articulation.instances[instance].targets;
        targets.iter().map(|target| self.target(target, part, keys)).collect()
    }

    fn target(&mut self, target: &MorphTarget, part: &Part, keys: &[Key]) -> Value {
        let linear = part.from_model.fixed_view::<3, 3>(0, 0).into_owned();
        let transformed = |value: [f64; 3]| -> [f32; 3] { (linear * Vector3::from(value)).map(|x| x as f32).into() };
        let rows = |values: &[[f64; 3]]| -> Vec<[f32; 3]> {
            let value = |k: &Key| target.vertices.binary_search(&k[0]).ok().and_then(|at| values.get(at).copied());
            keys.iter().map(|k| value(k).map_or([0.0; 3], transformed)).collect()
        };
        let offsets = rows(&target.offsets);
        let mut attributes = json!({ "POSITION": self.buffer.bounded(&offsets, "VEC3", Some(ARRAY_BUFFER)) });
        if !target.normals.is_empty() && self.normals {
            attributes["NORMAL"] = json!(self.buffer.floats(&rows(&target.normals), "VEC3", Some(ARRAY_BUFFER)));
        }
        attributes
    }

    /// Writes the nodes with their children and meshes, the skins and the animations. `mesh_of_instance` has the index of the
    /// written mesh of each instance.
    pub(super) fn articulation(&mut self, articulation: &Articulation, mesh_of_instance: &[Option<usize>]) {
        // Nodes and their hierarchy.
        self.nodes = articulation.nodes.iter().map(|node| transform(&node.transform)).collect();
        for (k, node) in articulation.nodes.iter().enumerate() {
            named(&mut self.nodes[k], node.name.as_deref());
            if let Some(extras) = &node.extras {
                self.nodes[k]["extras"] = extras.clone();
            }
            if let Some(parent) = node.parent {
                match self.nodes[parent as usize].get_mut("children").and_then(Value::as_array_mut) {
                    Some(children) => children.push(json!(k)),
                    None => self.nodes[parent as usize]["children"] = json!([k]),
                }
            }
        }
        // Meshes and skins of the instances.
        for (instance, mesh) in articulation.instances.iter().zip(mesh_of_instance) {
            let Some(mesh) = mesh else { continue };
            let node = &mut self.nodes[instance.node as usize];
            node["mesh"] = json!(mesh);
            if let Some(skin) = instance.skin {
                node["skin"] = json!(skin);
            }
            morphed(&mut self.meshes[*mesh], instance);
        }
        // Skins, with column-major inverse bind matrices.
        for skin in &articulation.skins {
            let columns: Vec<[f32; 16]> =
                skin.inverse_binds.iter().map(|m| std::array::from_fn(|k| m.as_slice()[k] as f32)).collect();
            let mut written =
                json!({ "joints": skin.joints, "inverseBindMatrices": self.buffer.floats(&columns, "MAT4", None) });
            named(&mut written, skin.name.as_deref());
            self.skins.push(written);
        }
        self.roots = articulation.roots.iter().map(|&root| root as usize).collect();
        self.animations(articulation, mesh_of_instance);
    }

    fn animations(&mut self, articulation: &Articulation, mesh_of_instance: &[Option<usize>]) {
        for animation in &articulation.animations {
            let (mut channels, mut samplers) = (Vec::new(), Vec::new());
            // Channels often have the same key times: write them once.
            let mut known: Vec<(&[f64], usize)> = Vec::new();
            for channel in &animation.channels {
                let at = articulation.instance_at(channel.node);
                if channel.property == Property::Weights && at.and_then(|i| mesh_of_instance[i]).is_none() {
                    continue;
                }
                let input = if let Some(&(_, input)) = known.iter().find(|(times, _)| *times == channel.times) {
                    input
                } else {
                    let input = self.times(&channel.times);
                    known.push((&channel.times, input));
                    input
                };
                let property = PROPERTIES.iter().find(|(property, ..)| *property == channel.property);
                let &(_, path, kind) = property.expect("every property is listed");
                let interpolation = INTERPOLATIONS.iter().find(|(known, _)| *known == channel.interpolation);
                let (_, interpolation) = interpolation.expect("every interpolation is listed");
                let output = self.values(channel, kind);
                channels.push(json!({ "sampler": samplers.len(), "target": { "node": channel.node, "path": path } }));
                samplers.push(json!({ "input": input, "output": output, "interpolation": interpolation }));
            }
            if !channels.is_empty() {
                let mut written = json!({ "channels": channels, "samplers": samplers });
                named(&mut written, animation.name.as_deref());
                self.animations.push(written);
            }
        }
    }

    /// Key times in single precision; equal ones are moved to the next representable number.
    fn times(&mut self, times: &[f64]) -> usize {
        let mut last = f32::NEG_INFINITY;
        let mut apart = |t: &f64| {
            last = (*t as f32).max(last.next_up());
            [last]
        };
        let times: Vec<[f32; 1]> = times.iter().map(&mut apart).collect();
        self.buffer.bounded(&times, "SCALAR", None)
    }

    fn values(&mut self, channel: &Channel, kind: &str) -> usize {
        let mut values = channel.values.clone();
        // With cubic splines two of three are tangents.
        if channel.property == Property::Rotation && channel.interpolation != ChannelInterpolation::CubicSpline {
            for rotation in values.as_chunks_mut::<4>().0 {
                let norm = rotation.iter().map(|x| x * x).sum::<f64>().sqrt();
                *rotation = rotation.map(|x| if norm > 0.0 { x / norm } else { x });
            }
        }
        let values: Vec<f32> = values.iter().map(|&x| x as f32).collect();
        match kind {
            "VEC4" => self.buffer.floats(values.as_chunks::<4>().0, kind, None),
            "VEC3" => self.buffer.floats(values.as_chunks::<3>().0, kind, None),
            _ => self.buffer.floats(values.as_chunks::<1>().0, kind, None),
        }
    }
}

/// The [`MAX_INFLUENCES`] largest influences of a vertex, renormalized. A vertex without influences follows the first joint.
fn kept(articulation: &Articulation, vertex: usize) -> Vec<(u32, f64)> {
    let mut row: Vec<(u32, f64)> = articulation.influences.row(vertex).collect();
    row.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    row.truncate(MAX_INFLUENCES);
    if row.is_empty() {
        return vec![(0, 1.0)];
    }
    let sum: f64 = row.iter().map(|(_, w)| w).sum();
    for (_, w) in &mut row {
        *w /= sum;
    }
    // The largest weight absorbs the rounding of the others, so that the rounded weights sum to one as well.
    let rest: f64 = row[1..].iter().map(|(_, w)| f64::from(*w as f32)).sum();
    row[0].1 = 1.0 - rest;
    row
}

fn transform(transform: &NodeTransform) -> Value {
    let mut node = json!({});
    match transform {
        NodeTransform::Matrix(matrix) if *matrix != Matrix4::identity() => node["matrix"] = json!(matrix.as_slice()),
        NodeTransform::Matrix(_) => {}
        NodeTransform::Trs { translation, rotation, scale } => {
            let norm = rotation.iter().map(|x| x * x).sum::<f64>().sqrt();
            if *translation != [0.0; 3] {
                node["translation"] = json!(translation);
            }
            if *rotation != [0.0, 0.0, 0.0, 1.0] && norm > 0.0 {
                node["rotation"] = json!(rotation.map(|x| x / norm));
            }
            if *scale != [1.0; 3] {
                node["scale"] = json!(scale);
            }
        }
    }
    node
}

/// Weights and names of the morph targets.
fn morphed(mesh: &mut Value, instance: &Instance) {
    if instance.targets.is_empty() {
        return;
    }
    mesh["weights"] = json!(instance.targets.iter().map(|t| t.weight).collect::<Vec<_>>());
    if instance.targets.iter().any(|t| t.name.is_some()) {
        let names: Vec<_> = instance.targets.iter().map(|t| t.name.clone().unwrap_or_default()).collect();
        mesh["extras"] = json!({ "targetNames": names });
    }
}
