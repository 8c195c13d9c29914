//! Conversion between glTF models and characters.
//!
//! A glTF file places its meshes by nodes; each skin names some nodes as joints. A character has one skeleton and one skin for its whole
//! surface:
//!
//! ```text
//! joints       all joints of skins, all nodes of unskinned meshes, and the ancestors of both
//! binding      Bⱼ of the first skin with joint j; if a later skin has B'ⱼ = Bⱼ M for all its joints, M is applied to
//!              its vertices instead
//! rigid parts  an unskinned mesh follows its node rigidly
//! ```
//!
//! Every pose of the nodes thus gives the surface that the file describes.

mod binding;
mod clips;
mod joints;
mod limits;
mod write;

use std::sync::Arc;

use nalgebra::{Matrix4, Point3, Vector3};

use super::Rig;
use crate::character::{Character, CharacterError, MorphShape, RigFileError, Skin, SkinWeights};
use crate::mesh::Model;
use crate::mesh::model::articulation::Articulation;
use joints::Joints;

/// Converts a model to a character.
///
/// # Errors
/// [`RigFileError::NoSkin`]; [`RigFileError::Content`] for a sheared node or inconsistent bind matrices; errors of its joints, weights and
/// clips.
pub fn character_of(model: &Model) -> Result<Character, RigFileError> {
    let articulation = model.articulation().ok_or(RigFileError::NoSkin)?;
    let mut warnings = model.warnings().to_vec();
    let joints = Joints::of(articulation, &mut warnings)?;
    let bound = binding::bind(articulation, &joints)?;
    let positions = moved(model, articulation, &bound.world_from_instance);
    let weights = weights(articulation, &joints, &mut warnings)?;
    let clips = clips::read(articulation, &joints, &mut warnings)?;
    let targets = targets(articulation, &bound.world_from_instance);
    let still = model.clone().with_articulation(None)?;
    let still = match positions {
        Some(positions) => still.with_positions(positions)?,
        None => still,
    };
    let skin = Arc::new(Skin::new(weights, bound.inverse_bind)?);
    Ok(Character { targets, clips, warnings, ..Character::new(still, joints.skeleton, skin)? })
}

/// The skeleton of a file without meshes, of which all nodes are joints, with its clips; `None` where there are meshes, or no nodes that
/// are known to move.
pub(super) fn skeleton_of(model: &Model) -> Result<Option<Rig>, RigFileError> {
    let Some(articulation) = model.articulation().filter(|a| a.instances.is_empty()) else { return Ok(None) };
    let mut warnings = model.warnings().to_vec();
    let joints = Joints::of(articulation, &mut warnings)?;
    let clips = clips::read(articulation, &joints, &mut warnings)?;
    Ok(Some(Rig { skeleton: joints.skeleton, clips, warnings }))
}

/// Positions with all instances bound to common frames; `None` if unchanged.
fn moved(model: &Model, articulation: &Articulation, maps: &[Matrix4<f64>]) -> Option<Vec<Point3<f64>>> {
    if maps.iter().all(|m| *m == Matrix4::identity()) {
        return None;
    }
    let of = |v: usize| &maps[articulation.instance_of_vertex[v] as usize];
    let positions = model.mesh().positions();
    Some(positions.iter().enumerate().map(|(v, p)| of(v).transform_point(p)).collect())
}

fn weights(
    articulation: &Articulation,
    joints: &Joints,
    warnings: &mut Vec<String>,
) -> Result<SkinWeights, CharacterError> {
    let mut loose = 0;
    let mut row = |vertex: usize| -> Vec<(u32, f64)> {
        let instance = &articulation.instances[articulation.instance_of_vertex[vertex] as usize];
        let joint = |node: u32| joints.of_node[node as usize];
        let Some(skin) = instance.skin.map(|s| &articulation.skins[s as usize]) else {
            return vec![(joint(instance.node), 1.0)];
        };
        let row: Vec<_> =
            articulation.influences.row(vertex).map(|(j, w)| (joint(skin.joints[j as usize]), w)).collect();
        loose += usize::from(row.is_empty());
        if row.is_empty() { vec![(joint(skin.joints[0]), 1.0)] } else { row }
    };
    let rows: Vec<_> = (0..articulation.instance_of_vertex.len()).map(&mut row).collect();
    if loose > 0 {
        warnings.push(format!(
            "{loose} vertices of skinned meshes have no weights; they follow the first joint of the skin"
        ));
    }
    let (weights, _) = SkinWeights::normalized(joints.skeleton.joint_count(), rows, None)?;
    Ok(weights)
}

fn targets(articulation: &Articulation, maps: &[Matrix4<f64>]) -> Vec<MorphShape> {
    let mut shapes = Vec::new();
    for (instance, map) in articulation.instances.iter().zip(maps) {
        let linear = map.fixed_view::<3, 3>(0, 0);
        for target in &instance.targets {
            shapes.push(MorphShape {
                name: target.name.clone().unwrap_or_else(|| format!("target {}", shapes.len())),
                weight: target.weight,
                vertices: target.vertices.clone(),
                offsets: target.offsets.iter().map(|d| (linear * Vector3::from(*d)).into()).collect(),
            });
        }
    }
    shapes
}

#[cfg(test)]
mod tests;
