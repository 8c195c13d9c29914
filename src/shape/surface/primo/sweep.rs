//! Local shape matching: block Gauss–Seidel over the rigid motions of the clusters.
//!
//! With fixed neighbors the best rigid motion `x ↦ ȳ + D (x − x̄)` of a cluster has a closed form: over its joints to other
//! bodies, `x = T_i(o)` on its own side and `y = T_j(o)` on the other, weighted means `x̄`, `ȳ`, and
//!
//! ```text
//! D = nearest rotation to  Σ w (y − ȳ)(x − x̄)ᵀ + R_j S R_iᵀ.
//! ```

use nalgebra::{Matrix3, Vector3};

use super::clusters::Clusters;
use super::shell::{BodyPose, Shell};
use plumbline_num::math::nearest_rotation;

/// One pass over all clusters in order. The energy does not increase.
pub(super) fn sweep(shell: &Shell, clusters: &Clusters, poses: &mut [BodyPose]) {
    for c in 0..clusters.count {
        if let Some((rotation, from, to)) = best_motion(shell, clusters, poses, c) {
            for &body in clusters.members(c) {
                let pose = &mut poses[body as usize];
                pose.at = to + rotation * (pose.at - from);
                pose.rotation = rotation * pose.rotation;
            }
        }
    }
}

/// Rotation, center, and target of the center; `None` for a cluster without joints to others.
fn best_motion(
    shell: &Shell,
    clusters: &Clusters,
    poses: &[BodyPose],
    c: usize,
) -> Option<(Matrix3<f64>, Vector3<f64>, Vector3<f64>)> {
    let sides = clusters.leaving(c).iter().map(|&k| {
        let joint = &shell.joints[k as usize];
        let [a, b] = shell.sides(poses, joint);
        let first = clusters.of_body[joint.bodies[0] as usize] as usize == c;
        if first { (joint, a, b) } else { (joint, b, a) }
    });
    let (mut weight, mut from, mut to) = (0.0, Vector3::zeros(), Vector3::zeros());
    for (joint, own, other) in sides.clone() {
        weight += joint.weight;
        from += own.at * joint.weight;
        to += other.at * joint.weight;
    }
    if !(weight > 0.0) {
        return None;
    }
    (from, to) = (from / weight, to / weight);
    let covariance: Matrix3<f64> = sides
        .map(|(joint, own, other)| {
            (other.at - to) * (own.at - from).transpose() * joint.weight
                + other.rotation * joint.moment * own.rotation.transpose()
        })
        .sum();
    Some((nearest_rotation(&covariance), from, to))
}
