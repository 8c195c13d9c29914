//! A surface bound to joints.

use nalgebra::Matrix4;

use super::{CharacterError, Skeleton, SkinWeights};

/// Weights, and for each joint the inverse of its frame when the surface was bound to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Skin {
    weights: SkinWeights,
    inverse_bind: Vec<Matrix4<f64>>,
}

impl Skin {
    /// A skin whose matrices are given: `joint_from_world` at rest, one per joint.
    ///
    /// # Errors
    /// [`CharacterError::Matrices`] where weights name more joints than there are matrices, [`CharacterError::Matrix`].
    pub fn new(weights: SkinWeights, inverse_bind: Vec<Matrix4<f64>>) -> Result<Self, CharacterError> {
        if weights.joint_count() != inverse_bind.len() {
            let (joints, matrices) = (weights.joint_count(), inverse_bind.len());
            return Err(CharacterError::Matrices { joints, matrices });
        }
        check_affine(&inverse_bind)?;
        Ok(Self { weights, inverse_bind })
    }

    /// A skin bound to a skeleton at rest.
    ///
    /// # Errors
    /// [`CharacterError::Matrices`] for weights of another skeleton, [`CharacterError::FlatJoint`].
    pub fn bound(weights: SkinWeights, skeleton: &Skeleton) -> Result<Self, CharacterError> {
        let flat = |j: usize| CharacterError::FlatJoint { joint: skeleton.joints()[j].name.clone() };
        let globals = skeleton.rest_globals();
        let inverses = globals.iter().enumerate().map(|(j, g)| g.try_inverse().ok_or_else(|| flat(j)));
        Self::new(weights, inverses.collect::<Result<_, _>>()?)
    }

    /// How much each vertex follows each joint.
    pub fn weights(&self) -> &SkinWeights {
        &self.weights
    }

    /// `joint_from_world` when the surface was bound, one per joint.
    pub fn inverse_bind(&self) -> &[Matrix4<f64>] {
        &self.inverse_bind
    }

    /// How space moves with each joint: `world_from_joint · joint_from_world_at_rest`.
    ///
    /// # Errors
    /// [`CharacterError::Matrices`] for another number of joints, [`CharacterError::Matrix`].
    pub fn joint_matrices(&self, globals: &[Matrix4<f64>]) -> Result<Vec<Matrix4<f64>>, CharacterError> {
        if globals.len() != self.inverse_bind.len() {
            return Err(CharacterError::Matrices { joints: self.inverse_bind.len(), matrices: globals.len() });
        }
        check_affine(globals)?;
        Ok(globals.iter().zip(&self.inverse_bind).map(|(g, b)| g * b).collect())
    }
}

/// Refuses matrices that are no finite affine maps. Files store the last row in 32 bit at best.
pub(super) fn check_affine(matrices: &[Matrix4<f64>]) -> Result<(), CharacterError> {
    for (joint, m) in matrices.iter().enumerate() {
        if !m.iter().all(|c| c.is_finite()) {
            return Err(CharacterError::Matrix { joint, what: "not finite" });
        }
        if (m.row(3) - Matrix4::identity().row(3)).amax() > 1e-6 {
            return Err(CharacterError::Matrix { joint, what: "projective" });
        }
    }
    Ok(())
}
