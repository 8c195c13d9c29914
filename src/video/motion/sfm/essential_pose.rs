//! The pose of an essential matrix, selected by the cheirality test.
//!
//! `E = ±[t]× R` has two rotations and two signs of `t`. A pair of rays `x₁`, `x₂` intersects at depths `λ₂ x₂ = λ₁ R
//! x₁ + t`; both are positive for only one of the four poses (*cheirality*).
//!
//! # Reference
//! Hartley, Zisserman, *Multiple View Geometry*, 2nd ed., sections 9.6 and 21.3.

use nalgebra::{Matrix3, UnitQuaternion};

use super::correspondence::Correspondence;
use super::essential::{left_null_vector, rotations_of};
use plumbline_camera::{CameraPose, Vec3};

/// The four poses of an essential matrix, translations of length 1; `None` for a singular decomposition.
pub fn poses_of_essential(e: &Matrix3<f64>) -> Option<[CameraPose; 4]> {
    let [a, b] = rotations_of(e)?.map(|r| UnitQuaternion::from_rotation_matrix(&r));
    let t = left_null_vector(e)?;
    let pose = |rotation, translation| CameraPose { rotation, translation };
    Some([pose(a, t), pose(a, -t), pose(b, t), pose(b, -t)])
}

/// The pose of `e` with the most selected points in front of both cameras, and their number.
///
/// `counted` selects the correspondences (normalized image coordinates) that are tested. `None` for a singular matrix.
pub fn pose_of_essential(e: &Matrix3<f64>, pairs: &[Correspondence], counted: &[bool]) -> Option<(CameraPose, usize)> {
    let asked = |pose: &CameraPose| pairs.iter().zip(counted).filter(|(p, c)| **c && is_in_front(pose, p)).count();
    let mut best: Option<(CameraPose, usize)> = None;
    for pose in poses_of_essential(e)? {
        let count = asked(&pose);
        if best.is_none_or(|(_, most)| count > most) {
            best = Some((pose, count));
        }
    }
    best
}

/// Whether the rays of a pair intersect in front of both cameras.
pub(super) fn is_in_front(second_from_first: &CameraPose, pair: &Correspondence) -> bool {
    let (rotated, t) = (second_from_first.rotation * pair.first, second_from_first.translation);
    let crossed = pair.second.cross(&rotated);
    // λ₁ (x₂ × R x₁) = −(x₂ × t) and λ₂ (R x₁ × x₂) = R x₁ × t, both projected on x₂ × R x₁.
    -pair.second.cross(&t).dot(&crossed) > 0.0 && -rotated.cross(&t).dot(&crossed) > 0.0
}

/// Triangulation angle of a pair, rad.
pub(super) fn ray_angle(second_from_first: &CameraPose, pair: &Correspondence) -> f64 {
    let rotated: Vec3 = second_from_first.rotation * pair.first;
    rotated.cross(&pair.second).norm().atan2(rotated.dot(&pair.second))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::sfm::tests::synthetic_views::{TwoViews, direction_error, random_pose, rotation_error};

    #[test]
    fn all_points_are_in_front_of_the_true_pose_and_of_no_other() {
        let mut rng = fastrand::Rng::with_seed(11);
        for _ in 0..100 {
            let pose = random_pose(&mut rng, 0.4, 1.0);
            let views = TwoViews::general(pose, 20, &mut rng);
            for sign in [1.0, -1.0] {
                let e = sign * views.essential();
                let (found, count) = pose_of_essential(&e, &views.correspondences, &[true; 20]).expect("regular");
                assert_eq!(count, 20);
                assert!(rotation_error(&found, &pose) < 1e-7 && direction_error(&found, &pose) < 1e-7);
                let all = poses_of_essential(&e).expect("regular");
                let counts = all.map(|p| views.correspondences.iter().filter(|c| is_in_front(&p, c)).count());
                assert_eq!(counts.iter().filter(|n| **n > 0).count(), 1, "{counts:?}");
            }
        }
    }

    #[test]
    fn the_angle_of_two_rays_is_that_under_which_their_point_sees_the_cameras() {
        let mut rng = fastrand::Rng::with_seed(12);
        let pose = random_pose(&mut rng, 0.4, 1.0);
        let views = TwoViews::general(pose, 5, &mut rng);
        for (point, pair) in views.points.iter().zip(&views.correspondences) {
            let expected = point.coords.angle(&(point - pose.center()));
            assert!((ray_angle(&pose, pair) - expected).abs() < 1e-9);
        }
    }
}
