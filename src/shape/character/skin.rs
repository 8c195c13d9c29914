//! The binding of a surface to joints.

use nalgebra::Matrix4;

use super::{CharacterError, Skeleton, SkinWeights};

/// Skin weights and inverse bind matrices.
#[derive(Clone, Debug, PartialEq)]
pub struct Skin {
    weights: SkinWeights,
    inverse_bind: Vec<Matrix4<f64>>,
}

impl Skin {
    /// A skin with given inverse bind matrices (`joint_from_world` in the bind pose), one per joint.
    ///
    /// # Errors
    /// [`CharacterError::Input`] if the numbers of joints and matrices differ or a matrix is not affine.
    pub fn new(weights: SkinWeights, inverse_bind: Vec<Matrix4<f64>>) -> Result<Self, CharacterError> {
        CharacterError::check_matrices(weights.joint_count(), inverse_bind.len())?;
        check_affine(&inverse_bind)?;
        Ok(Self { weights, inverse_bind })
    }

    /// A skin bound to a skeleton in its rest pose.
    ///
    /// # Errors
    /// [`CharacterError::Input`] for weights of another skeleton or a joint with zero scale.
    pub fn bound(weights: SkinWeights, skeleton: &Skeleton) -> Result<Self, CharacterError> {
        let flat = |j: usize| CharacterError::flat_joint(&skeleton.joints()[j].name);
        let globals = skeleton.rest_globals();
        let inverses = globals.iter().enumerate().map(|(j, g)| g.try_inverse().ok_or_else(|| flat(j)));
        Self::new(weights, inverses.collect::<Result<_, _>>()?)
    }

    /// Influence of each joint on each vertex.
    pub fn weights(&self) -> &SkinWeights {
        &self.weights
    }

    /// Inverse bind matrices: `joint_from_world` in the bind pose, one per joint.
    pub fn inverse_bind(&self) -> &[Matrix4<f64>] {
        &self.inverse_bind
    }

    /// Skin matrices: `world_from_joint · joint_from_world` of the bind pose.
    ///
    /// # Errors
    /// [`CharacterError::Input`] for a wrong number of joints or a matrix that is not affine.
    pub fn joint_matrices(&self, globals: &[Matrix4<f64>]) -> Result<Vec<Matrix4<f64>>, CharacterError> {
        CharacterError::check_matrices(self.inverse_bind.len(), globals.len())?;
        check_affine(globals)?;
        Ok(globals.iter().zip(&self.inverse_bind).map(|(g, b)| g * b).collect())
    }
}

/// Rejects matrices that are not finite or not affine. 1e-6: files store the last row in single precision at best.
pub(super) fn check_affine(matrices: &[Matrix4<f64>]) -> Result<(), CharacterError> {
    for (joint, m) in matrices.iter().enumerate() {
        if !m.iter().all(|c| c.is_finite()) {
            return Err(invalid_matrix(joint, "not finite"));
        }
        if (m.row(3) - Matrix4::identity().row(3)).amax() > 1e-6 {
            return Err(invalid_matrix(joint, "projective"));
        }
    }
    Ok(())
}

pub(super) fn invalid_matrix(joint: usize, fault: &str) -> CharacterError {
    CharacterError::Input(format!("the matrix of joint {joint} is {fault} (expected a finite affine map)"))
}
