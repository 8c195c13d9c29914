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
        clip_named(&self.clips, name)
    }

    /// Puts clips before those of the character, which keep their names, numbered where one is taken.
    ///
    /// ```
    /// use plumbline_shape::character::humanoid::humanoid;
    ///
    /// let mut person = humanoid(0.1)?;
    /// let walk = person.clip("walk")?.clone();
    /// person.prepend_clips(vec![walk]);
    /// let names: Vec<&str> = person.clips.iter().map(|clip| clip.name()).collect();
    /// assert_eq!(names, ["walk", "walk (2)", "wave"]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn prepend_clips(&mut self, clips: Vec<Clip>) {
        for clip in std::mem::replace(&mut self.clips, clips) {
            let name = free_name(clip.name(), |name| self.clips.iter().any(|c| c.name() == name));
            self.clips.push(clip.named(name));
        }
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
/// The clip with this name.
pub(super) fn clip_named<'a>(clips: &'a [Clip], name: &str) -> Result<&'a Clip, CharacterError> {
    let unknown = || {
        let known: Vec<String> = clips.iter().map(|c| format!("{:?}", c.name())).collect();
        let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
        CharacterError::Input(format!("there is no clip {name:?} (known: {known})"))
    };
    clips.iter().find(|clip| clip.name() == name).ok_or_else(unknown)
}

/// The name, numbered where it is taken.
pub(super) fn free_name(name: &str, taken: impl Fn(&str) -> bool) -> String {
    let numbered = (1..).map(|k| if k == 1 { name.to_owned() } else { format!("{name} ({k})") });
    numbered.into_iter().find(|name| !taken(name)).expect("there is no end of numbers")
}
