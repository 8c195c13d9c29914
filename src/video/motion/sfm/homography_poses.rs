//! Decomposition of a calibrated homography into poses.
//!
//! Two views of the plane `n·x = d` in the first camera are related by `H ∝ R + (t/d) nᵀ`, scaled so that its middle
//! singular value is 1. With `HᵀH = V diag(σ₁², 1, σ₃²) Vᵀ`, two planes through `v₂` are mapped isometrically; on each
//! of them `H` acts as a rotation. This gives two rotations, and with the sign of the normal four solutions.
//!
//! # Reference
//! Y. Ma, S. Soatto, J. Košecká, S. Sastry, *An Invitation to 3-D Vision*, Springer 2004, section 5.3.3; E. Malis, M. Vargas,
//! *Deeper understanding of the homography decomposition*, INRIA RR-6303, 2007.

use nalgebra::{Matrix3, Rotation3, SymmetricEigen, UnitQuaternion};

use super::correspondence::Correspondence;
use plumbline_camera::{CameraPose, Vec3};

/// `σ₁ − σ₃` below which a homography is a pure rotation: the plane's normal is then rounding error.
const ROTATION: f64 = 1e-9;

/// One solution of the decomposition: pose and plane normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarPose {
    /// `second_from_first`, the translation in units of the plane's distance from the first camera.
    pub pose: CameraPose,
    /// Unit normal of the plane in the first camera, pointing away from it: `n·x > 0` for points in front.
    pub normal: Vec3,
}

/// `H` scaled to middle singular value 1, with the sign that keeps points in front; `None` for a singular matrix or
/// without points.
pub fn calibrated_homography(h: &Matrix3<f64>, pairs: &[Correspondence], counted: &[bool]) -> Option<Matrix3<f64>> {
    let squared = SymmetricEigen::new(h.transpose() * h).eigenvalues;
    let middle = squared.sum() - squared.max() - squared.min();
    let (mut ahead, mut behind) = (0, 0);
    for (c, _) in pairs.iter().zip(counted).filter(|(_, c)| **c) {
        if c.second.dot(&(h * c.first)) > 0.0 {
            ahead += 1;
        } else {
            behind += 1;
        }
    }
    let scale = if ahead >= behind { middle.sqrt() } else { -middle.sqrt() };
    (middle > 0.0 && ahead + behind > 0).then(|| h / scale)
}

/// All decompositions of a homography scaled by [`calibrated_homography`]: four, or one without translation for a
/// rotation.
///
/// Opposite normals come in pairs; the points select among them ([`visible_planar_poses`]).
pub fn poses_of_homography(h: &Matrix3<f64>) -> Vec<PlanarPose> {
    let eigen = SymmetricEigen::new(h.transpose() * h);
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let (s1, s3) = (eigen.eigenvalues[order[0]].max(1.0), eigen.eigenvalues[order[2]].clamp(0.0, 1.0));
    if !(s1.sqrt() - s3.sqrt() > ROTATION) {
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(h));
        return vec![PlanarPose { pose: CameraPose { rotation, translation: Vec3::zeros() }, normal: Vec3::z() }];
    }
    let column = |k: usize| eigen.eigenvectors.column(order[k]).into_owned();
    let (v1, v2, v3) = (column(0), column(1), column(2));
    let (a, b) = (((1.0 - s3) / (s1 - s3)).sqrt(), ((s1 - 1.0) / (s1 - s3)).sqrt());
    let mut poses = Vec::with_capacity(4);
    for u in [v1 * a + v3 * b, v1 * a - v3 * b] {
        let normal = v2.cross(&u);
        let before = Matrix3::from_columns(&[v2, u, normal]);
        let (w2, w) = (h * v2, h * u);
        let after = Matrix3::from_columns(&[w2, w, w2.cross(&w)]);
        let rotation = Rotation3::from_matrix(&(after * before.transpose()));
        let translation = (h - rotation.matrix()) * normal;
        let rotation = UnitQuaternion::from_rotation_matrix(&rotation);
        poses.push(PlanarPose { pose: CameraPose { rotation, translation }, normal });
        poses.push(PlanarPose { pose: CameraPose { rotation, translation: -translation }, normal: -normal });
    }
    poses
}

/// The decompositions for which most of the counted points are in front of the first camera: one or two.
pub fn visible_planar_poses(h: &Matrix3<f64>, pairs: &[Correspondence], counted: &[bool]) -> Vec<PlanarPose> {
    let asked = || pairs.iter().zip(counted).filter(|(_, c)| **c);
    let half = asked().count() / 2;
    let seen = |p: &PlanarPose| asked().filter(|(c, _)| p.normal.dot(&c.first) > 0.0).count() > half;
    let mut poses = poses_of_homography(h);
    poses.retain(seen);
    poses
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::sfm::tests::synthetic_views::{TwoViews, random_pose, rotation_error};

    #[test]
    fn one_visible_decomposition_is_the_truth_and_all_give_the_homography_back() {
        for seed in 0..200 {
            let mut rng = fastrand::Rng::with_seed(seed);
            let pose = random_pose(&mut rng, 0.3, 1.0);
            let views = TwoViews::planar(pose, 30, &mut rng);
            // n·x = d in the first camera, the plane of the synthetic points.
            let plane = Vec3::new(0.3, -0.4, 1.0);
            let (n, d) = (plane.normalize(), 6.0 / plane.norm());
            let h = pose.rotation.to_rotation_matrix().matrix() + pose.translation * n.transpose() / d;
            let scaled = calibrated_homography(&(h * -0.7), &views.correspondences, &[true; 30]).expect("regular");
            assert!((scaled - h).norm() < 1e-12);
            for p in poses_of_homography(&scaled) {
                let again = p.pose.rotation.to_rotation_matrix().matrix() + p.pose.translation * p.normal.transpose();
                assert!((again - h).norm() < 1e-6, "seed {seed}: {again} against {h}");
            }
            let visible = visible_planar_poses(&scaled, &views.correspondences, &[true; 30]);
            assert!((1..=2).contains(&visible.len()), "seed {seed}: {}", visible.len());
            let right = |p: &PlanarPose| {
                rotation_error(&p.pose, &pose) < 1e-6
                    && (p.pose.translation * d - pose.translation).norm() < 1e-6
                    && (p.normal - n).norm() < 1e-6
            };
            assert!(visible.iter().any(right), "seed {seed}");
        }
    }

    #[test]
    fn a_rotation_has_one_decomposition_and_no_translation() {
        let mut rng = fastrand::Rng::with_seed(5);
        let pose = random_pose(&mut rng, 0.4, 1.0);
        let poses = poses_of_homography(pose.rotation.to_rotation_matrix().matrix());
        assert_eq!(poses.len(), 1);
        assert!(rotation_error(&poses[0].pose, &pose) < 1e-12 && poses[0].pose.translation.norm() == 0.0);
    }
}
