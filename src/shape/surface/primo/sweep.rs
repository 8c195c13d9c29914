//! Local shape matching: one cluster after another moves to where its neighbors want it.
//!
//! With the neighbors fixed the best rigid motion `x ↦ ȳ + D (x − x̄)` of a cluster has a closed form: over the joints that leave
//! it, `x = T_i(o)` on its own side and `y = T_j(o)` on the other, weighted means `x̄`, `ȳ`, and
//!
//! ```text
//! D = nearest rotation to  Σ w (y − ȳ)(x − x̄)ᵀ + R_j S R_iᵀ.
//! ```

use nalgebra::{Matrix3, Vector3};

use super::clusters::Clusters;
use super::shell::{BodyPose, Shell};
use plumbline_num::math::nearest_rotation;

/// One round over all clusters, each seeing the motions of those before it. The energy does not rise.
pub(super) fn sweep(shell: &Shell, clusters: &Clusters, poses: &mut [BodyPose]) {
    for c in 0..clusters.count {
        if let Some((turn, from, to)) = best_motion(shell, clusters, poses, c) {
            for &body in clusters.members(c) {
                let pose = &mut poses[body as usize];
                pose.at = to + turn * (pose.at - from);
                pose.turn = turn * pose.turn;
            }
        }
    }
}

/// Rotation, and a point with where it goes; `None` for a cluster that nothing holds.
fn best_motion(
    shell: &Shell,
    clusters: &Clusters,
    poses: &[BodyPose],
    c: usize,
) -> Option<(Matrix3<f64>, Vector3<f64>, Vector3<f64>)> {
    let sides = clusters.leaving(c).iter().map(|&k| {
        let joint = &shell.joints[k as usize];
        let [a, b] = shell.seen(poses, joint);
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
                + other.turn * joint.moment * own.turn.transpose()
        })
        .sum();
    Some((nearest_rotation(&covariance), from, to))
}
