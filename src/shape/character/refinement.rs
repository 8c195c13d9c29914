//! Restores surface detail after skinning:
//!
//! ```text
//! x = argmin Σᵢ |L(x)ᵢ − Tᵢ L(p)ᵢ|² / mᵢ + Σᵢ μ |xᵢ − yᵢ|²
//! ```
//!
//! `y` is the skinned surface, `Tᵢ` the mean rotation of the joints of vertex `i` (normalized weighted sum of quaternions, signs
//! aligned with the strongest joint), `mᵢ` the vertex area. For rigid motion both terms vanish. Where skinning collapses or bulges,
//! the rotated differential coordinates restore the shape; `μ` limits the deviation from `y`. The matrix is constant, so a frame
//! costs back-substitutions only.
//!
//! Limitation: the energy is linear. A tube twisted by `τ'` per radius keeps `1/(1 + τ'²)` of its radius, because the Laplacian of a
//! twisted tube is also longer than at rest. Bends and weight seams improve more than narrow twists.
//!
//! # Reference
//! The energy is that of O. Sorkine et al., *Laplacian surface editing*, SGP 2004, with prescribed rotations; see
//! [`crate::surface::DetailPreserving`].

use nalgebra::{Matrix3, Matrix4, Point3, Quaternion, UnitQuaternion};

use super::skinning::joint_rotations;
use super::{CharacterError, SkinWeights};
use crate::mesh::TriMesh;
use crate::surface::{Constraint, DeformOptions, DetailPreserving, HandlePose, Handles};
use plumbline_num::run::Run;

/// Prefactored detail restoration for one mesh and its weights; it works with every skinning method.
#[derive(Debug)]
pub struct DetailRefiner {
    weights: SkinWeights,
    solver: DetailPreserving,
}

impl DetailRefiner {
    /// Factors the system. `hold` is `μ`, above 0, dimensionless: at 1 the skinned position of a vertex weighs as much as its
    /// neighbors; large values reproduce the skinned surface.
    ///
    /// # Errors
    /// [`CharacterError::PerVertex`] for weights of another mesh; [`CharacterError::Surface`] if the system cannot be factored or
    /// `hold` is not above 0.
    pub fn new(mesh: &TriMesh, weights: &SkinWeights, hold: f64, run: &Run) -> Result<Self, CharacterError> {
        let vertices = mesh.vertex_count();
        CharacterError::check_per_vertex("rows of weights", weights.vertex_count(), vertices)?;
        let handles = Handles::new((0..vertices as u32).map(|v| (v, Constraint::Soft(hold))))?;
        let solver = DetailPreserving::new(mesh, &handles, &DeformOptions::default(), run)?;
        Ok(Self { weights: weights.clone(), solver })
    }

    /// The refined surface for `skinned` positions in the pose of `matrices`.
    ///
    /// # Errors
    /// [`CharacterError::PerVertex`] for positions of another mesh, [`CharacterError::Input`] for another number of joints,
    /// [`CharacterError::Interrupted`].
    pub fn refined(
        &mut self,
        skinned: Vec<Point3<f64>>,
        matrices: &[Matrix4<f64>],
        run: &Run,
    ) -> Result<Vec<Point3<f64>>, CharacterError> {
        CharacterError::check_per_vertex("skinned positions", skinned.len(), self.weights.vertex_count())?;
        CharacterError::check_matrices(self.weights.joint_count(), matrices.len())?;
        let rotations = joint_rotations(matrices);
        let vertex_rotations: Vec<Matrix3<f64>> = self.weights.rows().map(|row| blended(&rotations, row)).collect();
        Ok(self.solver.solve(&vertex_rotations, &HandlePose::new(skinned), run)?.positions)
    }
}

/// Normalized weighted sum of the joints' quaternions, signs aligned with the strongest.
fn blended(rotations: &[UnitQuaternion<f64>], row: &[super::Influence]) -> Matrix3<f64> {
    let pivot = rotations[row[0].joint as usize];
    let term = |i: &super::Influence| {
        let q = rotations[i.joint as usize];
        q.into_inner() * if q.dot(&pivot) < 0.0 { -i.weight } else { i.weight }
    };
    let sum = row.iter().map(term).fold(Quaternion::from_imag(nalgebra::Vector3::zeros()), |a, b| a + b);
    let mean = UnitQuaternion::try_new(sum, 0.0).unwrap_or(pivot);
    mean.to_rotation_matrix().into_inner()
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::super::skinning::tests::{matrices, tube, turn};
    use super::super::skinning::{Skinner, SkinningMethod};
    use super::super::{Skeleton, Skin};
    use super::*;
    use plumbline_num::math::Trs;

    /// Linear blend skinning, refined.
    struct Refined {
        skinner: Skinner,
        refiner: DetailRefiner,
    }

    impl Refined {
        fn at(&mut self, m: &[Matrix4<f64>]) -> Vec<Point3<f64>> {
            self.refiner.refined(self.skinner.positions(m).expect("fits"), m, &Run::default()).expect("of its mesh")
        }
    }

    fn refiner(hold: f64) -> (TriMesh, Skeleton, Skin, Refined) {
        let (mesh, skeleton, skin) = tube(2, 16, 40);
        let skinner =
            Skinner::new(&mesh, None, &skeleton, &skin, SkinningMethod::LinearBlend, &Run::default()).expect("fits");
        let refiner = DetailRefiner::new(&mesh, skin.weights(), hold, &Run::default()).expect("bound");
        (mesh, skeleton, skin, Refined { skinner, refiner })
    }

    #[test]
    fn rigid_motion_is_reproduced() {
        let (mesh, skeleton, skin, mut refined) = refiner(0.01);
        let motion = Trs::rigid(turn([1.0, 0.4, 2.0], 2.0), Vector3::new(3.0, -5.0, 1.0));
        let m: Vec<_> = matrices(&skeleton, &skin, |_| ()).iter().map(|m| motion.matrix() * m).collect();
        for (x, p) in refined.at(&m).iter().zip(mesh.positions()) {
            assert!((x - motion.transform(p)).norm() < 1e-9);
        }
    }

    #[test]
    fn a_collapsed_twist_opens_as_the_weight_falls_and_a_large_weight_gives_the_skinned_surface() {
        // Radius of the ring at the joint: linear blending leaves cos 75°.
        let waist = |hold: f64| {
            let (mesh, skeleton, skin, mut refined) = refiner(hold);
            let m = matrices(&skeleton, &skin, |p| p.locals[1].rotation = turn([1.0, 0.0, 0.0], 150_f64.to_radians()));
            let x = refined.at(&m);
            let ring = mesh.positions().iter().zip(&x).filter(|(p, _)| (p.x - 3.0).abs() < 1e-9);
            ring.map(|(_, x)| x.y.hypot(x.z)).fold(f64::INFINITY, f64::min)
        };
        let [firm, middle, loose, free] = [1e6, 1e-2, 1e-4, 1e-8].map(waist);
        let skinned = 75_f64.to_radians().cos();
        assert!((firm - skinned).abs() < 1e-3, "{firm} {skinned}");
        assert!(skinned < middle && middle < loose && loose < free, "{skinned} {middle} {loose} {free}");
        // A twist of 150° within two radii: 0.25 by the formula of a tube of infinite length, more in a short one.
        assert!(free > 2.0 * skinned && free < 1.0, "{free}");
    }

    #[test]
    fn a_weight_of_zero_and_data_of_another_mesh_are_rejected() {
        let (mesh, skeleton, skin) = tube(2, 6, 4);
        let message = DetailRefiner::new(&mesh, skin.weights(), 0.0, &Run::default()).expect_err("0").to_string();
        assert!(message.contains("weight 0 of vertex 0"), "{message}");
        assert!(DetailRefiner::new(&TriMesh::default(), skin.weights(), 1.0, &Run::default()).is_err());
        let mut refiner = DetailRefiner::new(&mesh, skin.weights(), 1.0, &Run::default()).expect("bound");
        let m = matrices(&skeleton, &skin, |_| ());
        assert!(refiner.refined(Vec::new(), &m, &Run::default()).is_err());
        assert!(refiner.refined(mesh.positions().to_vec(), &m[1..], &Run::default()).is_err());
    }
}
