//! Rigid bodies and the elastic joints between them.
//!
//! A joint is the common face of two prisms at rest. Its energy is an integral over that face,
//!
//! ```text
//! w ∫ ‖T_i(f) − T_j(f)‖² df  =  w ‖T_i(o) − T_j(o)‖²  +  tr (R_i − R_j) S (R_i − R_j)ᵀ,
//! ```
//!
//! and depends on the face only by its center `o` and its second moment `S = w ∫ (f − o)(f − o)ᵀ df` about it: for the
//! bilinear patch over four corners `Σ M_kl (x_k − o)(x_l − o)ᵀ` with the matrix `M` below.

use nalgebra::{Matrix3, Matrix4, Vector3};

use plumbline_num::math::nearest_rotation;

/// `∫ b_k b_l` over the unit square, `b` the bilinear weights of the corners in cyclic order.
#[rustfmt::skip]
const BILINEAR: Matrix4<f64> = Matrix4::new(
    4.0 / 36.0, 2.0 / 36.0, 1.0 / 36.0, 2.0 / 36.0,
    2.0 / 36.0, 4.0 / 36.0, 2.0 / 36.0, 1.0 / 36.0,
    1.0 / 36.0, 2.0 / 36.0, 4.0 / 36.0, 2.0 / 36.0,
    2.0 / 36.0, 1.0 / 36.0, 2.0 / 36.0, 4.0 / 36.0,
);

/// An elastic joint between two bodies.
#[derive(Clone, Debug)]
pub(super) struct Joint {
    /// The two bodies.
    pub(super) bodies: [u32; 2],
    /// `w`, dimensionless.
    pub(super) weight: f64,
    /// `o`, in the rest shape.
    pub(super) center: Vector3<f64>,
    /// `S`, squared length; symmetric, no negative eigenvalue.
    pub(super) moment: Matrix3<f64>,
}

impl Joint {
    /// A joint over a face with these corners, in cyclic order.
    pub(super) fn over(bodies: [u32; 2], weight: f64, corners: &[Vector3<f64>; 4]) -> Self {
        let center = corners.iter().sum::<Vector3<f64>>() / 4.0;
        let arms = corners.map(|c| c - center);
        let mut moment = Matrix3::zeros();
        for (k, a) in arms.iter().enumerate() {
            for (l, b) in arms.iter().enumerate() {
                moment += a * b.transpose() * (weight * BILINEAR[(k, l)]);
            }
        }
        Self { bodies, weight, center, moment: (moment + moment.transpose()) * 0.5 }
    }

    /// Adds the fraction `added` of the moment in the direction `up`, which resists bending.
    pub(super) fn stiffen(&mut self, up: &Vector3<f64>, added: f64) {
        if let Some(up) = up.try_normalize(0.0) {
            self.moment += up * up.transpose() * (added * up.dot(&(self.moment * up)));
        }
    }

    /// A spring at a point, which does not resist rotation.
    pub(super) fn spring(bodies: [u32; 2], weight: f64, center: Vector3<f64>) -> Self {
        Self { bodies, weight, center, moment: Matrix3::zeros() }
    }
}

/// The pose of a body: `T(x) = at + R (x − c)` with its rest center `c`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BodyPose {
    /// `R`.
    pub(super) rotation: Matrix3<f64>,
    /// Position of the center.
    pub(super) at: Vector3<f64>,
}

/// Bodies with joints.
#[derive(Clone, Debug, Default)]
pub(super) struct Shell {
    /// Rest centers of the bodies.
    pub(super) centers: Vec<Vector3<f64>>,
    /// Whether a body may move.
    pub(super) free: Vec<bool>,
    /// Joints with at least one free body.
    pub(super) joints: Vec<Joint>,
}

impl Shell {
    /// The rest poses.
    pub(super) fn rest(&self) -> Vec<BodyPose> {
        self.centers.iter().map(|&at| BodyPose { rotation: Matrix3::identity(), at }).collect()
    }

    /// `T_b(x)`.
    pub(super) fn carry(&self, poses: &[BodyPose], body: usize, x: &Vector3<f64>) -> Vector3<f64> {
        poses[body].at + poses[body].rotation * (x - self.centers[body])
    }

    /// The current position of a joint on both of its bodies.
    pub(super) fn sides(&self, poses: &[BodyPose], joint: &Joint) -> [Side; 2] {
        joint.bodies.map(|b| {
            let rotation = poses[b as usize].rotation;
            Side { at: self.carry(poses, b as usize, &joint.center), rotation }
        })
    }

    /// Energy of all joints, squared length.
    pub(super) fn energy(&self, poses: &[BodyPose]) -> f64 {
        self.joints.iter().map(|joint| self.joint_energy(poses, joint)).sum()
    }

    fn joint_energy(&self, poses: &[BodyPose], joint: &Joint) -> f64 {
        let [i, j] = self.sides(poses, joint);
        let difference = i.rotation - j.rotation;
        joint.weight * (i.at - j.at).norm_squared() + (difference * joint.moment).component_mul(&difference).sum()
    }

    /// The best rigid motion between two point sets with equal weights, as the pose of a body with this center.
    pub(super) fn fit(center: &Vector3<f64>, from: &[Vector3<f64>], to: &[Vector3<f64>]) -> BodyPose {
        let n = from.len() as f64;
        let (a, b) = (from.iter().sum::<Vector3<f64>>() / n, to.iter().sum::<Vector3<f64>>() / n);
        let covariance: Matrix3<f64> = from.iter().zip(to).map(|(x, y)| (y - b) * (x - a).transpose()).sum();
        let rotation = nearest_rotation(&covariance);
        BodyPose { rotation, at: b + rotation * (center - a) }
    }
}

/// A joint on one of its bodies.
#[derive(Clone, Copy, Debug)]
pub(super) struct Side {
    /// `T(o)`.
    pub(super) at: Vector3<f64>,
    /// `R`.
    pub(super) rotation: Matrix3<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    #[test]
    fn the_energy_of_a_joint_is_the_integral_over_its_face() {
        let corners = [[0.0, 0.1, 0.0], [2.0, 0.0, 0.3], [2.1, 0.2, 1.0], [0.0, -0.2, 0.8]].map(Vector3::from);
        let weight = 1.7;
        let shell = Shell {
            centers: vec![Vector3::new(0.5, 1.0, 0.0), Vector3::new(0.3, -1.0, 0.2)],
            free: vec![true; 2],
            joints: vec![Joint::over([0, 1], weight, &corners)],
        };
        let mut poses = shell.rest();
        for (k, pose) in poses.iter_mut().enumerate() {
            pose.rotation = Rotation3::new(Vector3::new(0.4, -0.3 + k as f64, 0.9)).into_inner();
            pose.at += Vector3::new(0.1, 0.2 * k as f64, -0.3);
        }
        // Gauss's rule of two points is exact for the square of a bilinear function.
        let at = [0.5 - 0.75_f64.sqrt() / 3.0, 0.5 + 0.75_f64.sqrt() / 3.0];
        let mut integral = 0.0;
        for (u, v) in [(at[0], at[0]), (at[0], at[1]), (at[1], at[0]), (at[1], at[1])] {
            let [a, b, c, d] = corners;
            let f = (a * (1.0 - u) + b * u) * (1.0 - v) + (d * (1.0 - u) + c * u) * v;
            integral += 0.25 * weight * (shell.carry(&poses, 0, &f) - shell.carry(&poses, 1, &f)).norm_squared();
        }
        assert!((shell.energy(&poses) - integral).abs() < 1e-13 * integral);
    }
}
