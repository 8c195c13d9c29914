//! A surface with everything that moves it.

use std::sync::Arc;

use nalgebra::Point3;

use super::{CharacterError, Clip, Skeleton, Skin};
use crate::mesh::Model;

/// A model bound to a skeleton, its morph targets and its movements.
#[derive(Clone, Debug, PartialEq)]
pub struct Character {
    /// The surface as it was bound.
    pub model: Model,
    /// The joints.
    pub skeleton: Skeleton,
    /// How the surface follows them.
    pub skin: Arc<Skin>,
    /// Other shapes of the surface.
    pub targets: Vec<MorphShape>,
    /// Movements.
    pub clips: Vec<Clip>,
    /// What of a file was left out or taken otherwise than it stood.
    pub warnings: Vec<String>,
}

/// Another shape of a surface, as differences.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MorphShape {
    /// Its name.
    pub name: String,
    /// How far the surface is morphed at rest; 0 is not at all, 1 wholly.
    pub weight: f64,
    /// Vertices that move, ascending.
    pub vertices: Vec<u32>,
    /// How far each of them moves, units of the model.
    pub offsets: Vec<[f64; 3]>,
}

impl Character {
    /// A model bound to a skeleton, without movements.
    ///
    /// # Errors
    /// [`CharacterError::PerVertex`] where the skin is of another mesh, [`CharacterError::Matrices`] where it is of another
    /// skeleton.
    pub fn new(model: Model, skeleton: Skeleton, skin: Arc<Skin>) -> Result<Self, CharacterError> {
        let (given, vertices) = (skin.weights().vertex_count(), model.mesh().vertex_count());
        if given != vertices {
            return Err(CharacterError::PerVertex { what: "rows of weights", given, vertices });
        }
        let (joints, matrices) = (skeleton.joint_count(), skin.inverse_bind().len());
        if joints != matrices {
            return Err(CharacterError::Matrices { joints, matrices });
        }
        Ok(Self { model, skeleton, skin, targets: Vec::new(), clips: Vec::new(), warnings: Vec::new() })
    }

    /// The clip of a name; the names that there are otherwise.
    ///
    /// # Errors
    /// [`CharacterError::UnknownClip`].
    pub fn clip(&self, name: &str) -> Result<&Clip, CharacterError> {
        let known = || self.clips.iter().map(|c| format!("{:?}", c.name())).collect::<Vec<_>>().join(", ");
        let unknown = || CharacterError::UnknownClip { name: name.to_owned(), known: known() };
        self.clips.iter().find(|clip| clip.name() == name).ok_or_else(unknown)
    }

    /// Weights of the morph targets at rest.
    pub fn rest_weights(&self) -> Vec<f64> {
        self.targets.iter().map(|t| t.weight).collect()
    }

    /// Positions of the surface as it was bound, morphed: `p + Σ wₖ dₖ`.
    ///
    /// # Errors
    /// [`CharacterError::MorphWeights`] for another number of weights than of targets.
    pub fn morphed(&self, weights: &[f64]) -> Result<Vec<Point3<f64>>, CharacterError> {
        if weights.len() != self.targets.len() {
            return Err(CharacterError::MorphWeights { given: weights.len(), targets: self.targets.len() });
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
