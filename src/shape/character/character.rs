//! A model with its skeleton, skin, morph targets and clips.

use std::sync::Arc;

use nalgebra::Point3;

use super::{CharacterError, Clip, Skeleton, Skin};
use crate::mesh::Model;

/// A model bound to a skeleton, with morph targets and clips.
#[derive(Clone, Debug, PartialEq)]
pub struct Character {
    /// The surface in its bind pose.
    pub model: Model,
    /// The skeleton.
    pub skeleton: Skeleton,
    /// Weights and inverse bind matrices.
    pub skin: Arc<Skin>,
    /// Morph targets.
    pub targets: Vec<MorphShape>,
    /// Animation clips.
    pub clips: Vec<Clip>,
    /// What the reader left out or changed.
    pub warnings: Vec<String>,
}

/// A morph target, stored as sparse vertex offsets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MorphShape {
    /// Name.
    pub name: String,
    /// Weight at rest: 0 is the unmorphed surface, 1 the full offsets.
    pub weight: f64,
    /// Vertices with an offset, ascending.
    pub vertices: Vec<u32>,
    /// Offset of each of these vertices, units of the model.
    pub offsets: Vec<[f64; 3]>,
}

impl Character {
    /// A model bound to a skeleton, without morph targets or clips.
    ///
    /// # Errors
    /// [`CharacterError::PerVertex`] if the weights belong to another mesh, [`CharacterError::Input`] if the matrices belong to another
    /// skeleton.
    pub fn new(model: Model, skeleton: Skeleton, skin: Arc<Skin>) -> Result<Self, CharacterError> {
        let vertices = model.mesh().vertex_count();
        CharacterError::check_per_vertex("rows of weights", skin.weights().vertex_count(), vertices)?;
        CharacterError::check_matrices(skeleton.joint_count(), skin.inverse_bind().len())?;
        Ok(Self { model, skeleton, skin, targets: Vec::new(), clips: Vec::new(), warnings: Vec::new() })
    }

    /// The clip with this name.
    ///
    /// # Errors
    /// [`CharacterError::Input`], with the names of all clips.
    pub fn clip(&self, name: &str) -> Result<&Clip, CharacterError> {
        let unknown = || {
            let known: Vec<String> = self.clips.iter().map(|c| format!("{:?}", c.name())).collect();
            let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
            CharacterError::Input(format!("there is no clip {name:?} (known: {known})"))
        };
        self.clips.iter().find(|clip| clip.name() == name).ok_or_else(unknown)
    }

    /// Weights of the morph targets at rest.
    pub fn rest_weights(&self) -> Vec<f64> {
        self.targets.iter().map(|t| t.weight).collect()
    }

    /// Morphed positions in the bind pose: `p + Σ wₖ dₖ`.
    ///
    /// # Errors
    /// [`CharacterError::Input`] if the number of weights differs from the number of targets.
    pub fn morphed(&self, weights: &[f64]) -> Result<Vec<Point3<f64>>, CharacterError> {
        if weights.len() != self.targets.len() {
            let (given, targets) = (weights.len(), self.targets.len());
            let fault = format!("{given} weights do not fit {targets} morph targets: give one for each");
            return Err(CharacterError::Input(fault));
        }
        let mut positions = self.model.mesh().positions().to_vec();
        for (target, &weight) in self.targets.iter().zip(weights).filter(|(_, w)| **w != 0.0) {
            for (&vertex, offset) in target.vertices.iter().zip(&target.offsets) {
                positions[vertex as usize] += nalgebra::Vector3::from(*offset) * weight;
            }
        }
        Ok(positions)
    }
}
