//! Details kept after skinning:
//!
//! ```text
//! x = argmin Σᵢ |L(x)ᵢ − Tᵢ L(p)ᵢ|² / mᵢ + Σᵢ μ |xᵢ − yᵢ|²
//! ```
//!
//! `y` is the skinned surface, `Tᵢ` the turn that the joints of vertex `i` have on average (the normalized sum of their quaternions,
//! signs turned toward the strongest). Where skinning is rigid both terms vanish; where it collapses or bulges, differential
//! coordinates that only turned bring the shape back, as far as `μ` lets it leave the skinned one. The matrix does not depend on the
//! pose: a frame costs substitutions with one factor.
//!
//! It is linear: a tube that twists by `τ'` per radius keeps `1/(1 + τ'²)` of its radius, for the Laplacian of a twisted tube is
//! longer than that at rest, not only turned. Bends and seams of weights gain more than narrow twists.
//!
//! # Reference
//! The energy is that of O. Sorkine et al., *Laplacian surface editing*, SGP 2004, with the rotations given; see
//! [`crate::surface::DetailPreserving`].

use nalgebra::{Matrix3, Matrix4, Point3, Quaternion, UnitQuaternion};

use super::skinning::joint_rotations;
use super::{CharacterError, SkinWeights};
use crate::mesh::TriMesh;
use crate::surface::{Constraint, DeformOptions, DetailPreserving, HandlePose, Handles};
use plumbline_num::run::Run;

/// The factor that refines a skinned surface, by whichever method it is skinned.
#[derive(Debug)]
pub struct DetailRefiner {
    weights: SkinWeights,
    solver: DetailPreserving,
}

impl DetailRefiner {
    /// Prepares the factor. `hold` is `μ`, above 0, dimensionless: 1 holds a vertex as strongly as its neighbors do; large values
    /// give the skinned surface.
    ///
    /// # Errors
    /// [`CharacterError::PerVertex`] for weights of another mesh; [`CharacterError::Surface`] where the surface cannot be bound or
    /// `hold` is not above 0.
    pub fn new(mesh: &TriMesh, weights: &SkinWeights, hold: f64, run: &Run) -> Result<Self, CharacterError> {
        let (vertices, given) = (mesh.vertex_count(), weights.vertex_count());
        if given != vertices {
            return Err(CharacterError::PerVertex { what: "rows of weights", given, vertices });
        }
        let handles = Handles::new((0..vertices as u32).map(|v| (v, Constraint::Soft(hold))))?;
        let solver = DetailPreserving::new(mesh, &handles, &DeformOptions::default(), run)?;
        Ok(Self { weights: weights.clone(), solver })
    }

    /// The refined surface: `skinned` is where a method has the vertices in the pose of `matrices`.
    ///
    /// # Errors
    /// [`CharacterError::PerVertex`] for positions of another mesh, [`CharacterError::Matrices`] for another number of joints,
    /// [`CharacterError::Interrupted`].
    pub fn refined(
        &mut self,
        skinned: Vec<Point3<f64>>,
        matrices: &[Matrix4<f64>],
        run: &Run,
    ) -> Result<Vec<Point3<f64>>, CharacterError> {
        let (vertices, given) = (self.weights.vertex_count(), skinned.len());
        if given != vertices {
            return Err(CharacterError::PerVertex { what: "skinned positions", given, vertices });
        }
        let joints = self.weights.joint_count();
        if matrices.len() != joints {
            return Err(CharacterError::Matrices { joints, matrices: matrices.len() });
        }
        let rotations = joint_rotations(matrices);
        let turns: Vec<Matrix3<f64>> = self.weights.rows().map(|row| blended(&rotations, row)).collect();
        Ok(self.solver.solve(&turns, &HandlePose::new(skinned), run)?.positions)
    }
}

/// The normalized sum of the joints' quaternions.
fn blended(rotations: &[UnitQuaternion<f64>], row: &[super::Influence]) -> Matrix3<f64> {
    let pivot = rotations[row[0].joint as usize];
    let term = |i: &super::Influence| {
        let q = rotations[i.joint as usize];
        q.into_inner() * if q.dot(&pivot) < 0.0 { -i.weight } else { i.weight }
    };
    let sum = row.iter().map(term).fold(Quaternion::from_imag(nalgebra::Vector3::zeros()), |a, b| a + b);
    let turn = UnitQuaternion::try_new(sum, 0.0).unwrap_or(pivot);
    turn.to_rotation_matrix().into_inner()
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::super::skinning::tests::{matrices, tube, turn};
    use super::super::skinning::{Skinner, SkinningMethod};
    use super::super::{Skeleton, Skin};
    use super::*;
    use plumbline_num::math::Trs;

    /// Linear blending, refined.
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
    fn what_moves_rigidly_is_left_as_it_is() {
        let (mesh, skeleton, skin, mut refined) = refiner(0.01);
        let motion = Trs::rigid(turn([1.0, 0.4, 2.0], 2.0), Vector3::new(3.0, -5.0, 1.0));
        let m: Vec<_> = matrices(&skeleton, &skin, |_| ()).iter().map(|m| motion.matrix() * m).collect();
        for (x, p) in refined.at(&m).iter().zip(mesh.positions()) {
            assert!((x - motion.transform(p)).norm() < 1e-9);
        }
    }

    #[test]
    fn a_twist_that_collapsed_opens_as_the_hold_loosens_and_a_firm_hold_gives_the_skinned_surface() {
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
    fn a_hold_of_nothing_and_what_is_of_another_mesh_are_refused() {
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
