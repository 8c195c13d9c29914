//! A mix of linear blend and dual quaternion skinning by the amount of twist:
//!
//! ```text
//! x' = (1 − β) x'_linear + β x'_dual
//!
//! β = Σ_{j<k} wⱼ wₖ κⱼₖ / Σ_{j<k} wⱼ wₖ        κⱼₖ = (a · n)²
//! ```
//!
//! `n` is the axis of the relative rotation of joints `j` and `k`, `a` the axis of their common bone: that of the child if one is the other's
//! parent, else the mean over both. A pure twist (`n` along the bone) uses dual quaternions, which preserve the radius; a pure swing uses
//! the linear blend, which does not bulge. Without relative rotation `κ` is undefined, but both methods agree.
//!
//! # Reference
//! The split into twist and swing: L. Kavan, O. Sorkine, *Elasticity-inspired deformers for character articulation*, ACM TOG 31
//! (2012), section 4.

use nalgebra::{Matrix4, Point3, UnitQuaternion, Vector3};

use super::super::{Influence, Skeleton};
use super::dual_quaternion::DualQuaternionPose;
use super::linear_blend::LinearPose;
use super::{Jet, PosedMethod, Posing, joint_rotations};

/// Parents and bone axes of joints.
#[derive(Clone, Debug)]
pub struct Twisting {
    parents: Vec<Option<u32>>,
    /// Direction of the bone that moves with each joint, at rest, world; zero if it has none.
    axes: Vec<Vector3<f64>>,
}

impl Twisting {
    /// Bone axes of a skeleton with these joint frames in the bind pose.
    pub(super) fn new(skeleton: &Skeleton, frames: &[Matrix4<f64>]) -> Self {
        let at = |j: u32| Vector3::new(frames[j as usize].m14, frames[j as usize].m24, frames[j as usize].m34);
        let axis = |j: u32| {
            let children = skeleton.children(j);
            let ahead: Vector3<f64> = children.iter().map(|&c| at(c) - at(j)).sum();
            let behind = skeleton.joints()[j as usize].parent.map_or_else(Vector3::zeros, |p| at(j) - at(p));
            // A leaf joint takes the direction of the bone that ends there.
            ahead.try_normalize(0.0).or_else(|| behind.try_normalize(0.0)).unwrap_or_else(Vector3::zeros)
        };
        Self {
            parents: skeleton.joints().iter().map(|j| j.parent).collect(),
            axes: (0..skeleton.joint_count() as u32).map(axis).collect(),
        }
    }

    /// `κ` of two joints in a pose: 0 for a pure swing, 1 for a pure twist.
    fn twist(&self, rotations: &[UnitQuaternion<f64>], j: u32, k: u32) -> f64 {
        let rotation = rotations[j as usize].rotation_to(&rotations[k as usize]);
        // Expressed in rest space: R_k = R_j R', R' = R_jᵀ R_k.
        let rotation = rotations[j as usize].inverse() * rotation * rotations[j as usize];
        let Some(axis) = rotation.imag().try_normalize(1e-12) else { return 0.0 };
        let along = |of: u32| axis.dot(&self.axes[of as usize]).powi(2);
        match (self.parents[j as usize] == Some(k), self.parents[k as usize] == Some(j)) {
            (true, _) => along(j),
            (_, true) => along(k),
            _ => 0.5 * (along(j) + along(k)),
        }
    }
}

/// The method in one pose.
pub(super) struct TwistSwingPose<'a> {
    linear: LinearPose<'a>,
    dual: DualQuaternionPose<'a>,
    posing: Posing<'a>,
    twisting: &'a Twisting,
    rotations: Vec<UnitQuaternion<f64>>,
}

impl<'a> TwistSwingPose<'a> {
    pub(super) fn new(posing: Posing<'a>, twisting: &'a Twisting) -> Self {
        let rotations = joint_rotations(posing.matrices);
        let (linear, dual) = (LinearPose::new(posing), DualQuaternionPose::new(posing));
        Self { linear, dual, posing, twisting, rotations }
    }

    /// `β` and its derivatives for weights with these slopes.
    fn blend(&self, row: &[Influence], slopes: &[[f64; 2]]) -> (f64, [f64; 2]) {
        let (mut twist, mut all) = ([0.0; 3], [0.0; 3]);
        for (n, (a, da)) in row.iter().zip(slopes).enumerate() {
            for (b, db) in row.iter().zip(slopes).skip(n + 1) {
                let kappa = self.twisting.twist(&self.rotations, a.joint, b.joint);
                let along = |k: usize| da[k] * b.weight + a.weight * db[k];
                let product = [a.weight * b.weight, along(0), along(1)];
                for k in 0..3 {
                    twist[k] += kappa * product[k];
                    all[k] += product[k];
                }
            }
        }
        if !(all[0] > 0.0) {
            return (0.0, [0.0; 2]);
        }
        let beta = twist[0] / all[0];
        (beta, [1, 2].map(|k| (twist[k] - beta * all[k]) / all[0]))
    }
}

impl PosedMethod for TwistSwingPose<'_> {
    fn position(&self, vertex: usize) -> Point3<f64> {
        let Posing { rest, weights, .. } = self.posing;
        let (beta, _) = self.blend(weights.row(vertex), rest.slopes(vertex));
        let linear = self.linear.position(vertex);
        linear + beta * (self.dual.position(vertex) - linear)
    }

    fn jet(&self, vertex: usize) -> Jet {
        let Posing { rest, weights, .. } = self.posing;
        let (beta, slopes) = self.blend(weights.row(vertex), rest.slopes(vertex));
        let (linear, dual) = (self.linear.jet(vertex), self.dual.jet(vertex));
        let apart = dual.position - linear.position;
        let along = [0, 1].map(|k| linear.along[k] + beta * (dual.along[k] - linear.along[k]) + slopes[k] * apart);
        Jet { position: linear.position + beta * apart, along }
    }
}
