//! Rigid motions as dual quaternions:
//!
//! ```text
//! q̂ = r + ε d      d = ½ t r      |r| = 1,  r · d = 0         x ↦ r x r* + 2 d r*
//! ```
//!
//! `q̂` and `−q̂` are the same motion. Sums of them, divided by their length, are again rigid motions, and that of two is close to
//! the screw motion halfway: which is what skinning wants of a blend.
//!
//! # Reference
//! L. Kavan, S. Collins, J. Žára, C. O'Sullivan, *Geometric skinning with approximate dual quaternion blending*, ACM TOG 27
//! (2008).

use std::ops::{Add, Mul, Neg};

use nalgebra::{Point3, Quaternion, UnitQuaternion, Vector3};

/// `real + ε dual`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DualQuaternion {
    /// The rotation, where it is a motion.
    pub real: Quaternion<f64>,
    /// Half the translation times the rotation, where it is a motion.
    pub dual: Quaternion<f64>,
}

impl DualQuaternion {
    /// The motion that changes nothing.
    pub fn identity() -> Self {
        Self { real: Quaternion::identity(), dual: Quaternion::from_imag(Vector3::zeros()) }
    }

    /// Zero, the empty sum.
    pub fn zero() -> Self {
        Self { real: Quaternion::from_imag(Vector3::zeros()), dual: Quaternion::from_imag(Vector3::zeros()) }
    }

    /// The motion that rotates, then moves.
    pub fn from_rigid(rotation: &UnitQuaternion<f64>, translation: &Vector3<f64>) -> Self {
        let real = rotation.into_inner();
        Self { real, dual: Quaternion::from_imag(*translation) * real * 0.5 }
    }

    /// `Σ wᵢ q̂ᵢ` with each sign made that of the largest weight (the first of equals), as a motion; `None` where the
    /// sum vanishes.
    ///
    /// The pivot makes the blend depend neither on the order nor on the signs in which the motions come.
    pub fn blend(motions: impl Iterator<Item = (Self, f64)> + Clone) -> Option<Self> {
        let heavier = |best: (Self, f64), next: (Self, f64)| if next.1 > best.1 { next } else { best };
        let (pivot, _) = motions.clone().reduce(heavier)?;
        let turned = |(q, w): (Self, f64)| q * if q.real.dot(&pivot.real) < 0.0 { -w } else { w };
        motions.map(turned).fold(Self::zero(), Add::add).normalized()
    }

    /// Divided by its (dual) length, so that it is a motion; `None` where the real part vanishes or is not finite.
    pub fn normalized(&self) -> Option<Self> {
        let length = self.real.norm();
        if !(length > 0.0 && length.is_finite()) {
            return None;
        }
        let (real, dual) = (self.real / length, self.dual / length);
        Some(Self { real, dual: dual - real * real.dot(&dual) })
    }

    /// Rotation of a motion.
    pub fn rotation(&self) -> UnitQuaternion<f64> {
        UnitQuaternion::new_unchecked(self.real)
    }

    /// Translation of a motion, after its rotation: `2 d r*`.
    pub fn translation(&self) -> Vector3<f64> {
        let (r, d) = (self.real.imag(), self.dual.imag());
        2.0 * (self.real.w * d - self.dual.w * r + r.cross(&d))
    }

    /// Where a motion takes a point.
    pub fn transform(&self, p: &Point3<f64>) -> Point3<f64> {
        self.rotation() * p + self.translation()
    }
}

/// Composition: the right one first.
impl Mul for DualQuaternion {
    type Output = Self;

    fn mul(self, first: Self) -> Self {
        Self { real: self.real * first.real, dual: self.real * first.dual + self.dual * first.real }
    }
}

impl Mul<f64> for DualQuaternion {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self { real: self.real * factor, dual: self.dual * factor }
    }
}

impl Add for DualQuaternion {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { real: self.real + other.real, dual: self.dual + other.dual }
    }
}

impl Neg for DualQuaternion {
    type Output = Self;

    fn neg(self) -> Self {
        self * -1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion(seed: f64) -> (UnitQuaternion<f64>, Vector3<f64>) {
        let rotation = UnitQuaternion::from_euler_angles(seed, 2.0 * seed - 1.0, 0.3 - seed);
        (rotation, Vector3::new(seed, -3.0 * seed, 2.0 - seed))
    }

    #[test]
    fn a_motion_comes_back_and_moves_points_as_it_does() {
        let (rotation, translation) = motion(0.7);
        let q = DualQuaternion::from_rigid(&rotation, &translation);
        let p = Point3::new(0.4, -0.2, 5.0);
        assert!((q.translation() - translation).norm() < 1e-14);
        assert!((q.transform(&p) - (rotation * p + translation)).norm() < 1e-14);
        assert!(((-q).transform(&p) - q.transform(&p)).norm() < 1e-14);
    }

    #[test]
    fn products_compose_and_the_right_one_comes_first() {
        let [(r1, t1), (r2, t2)] = [motion(0.7), motion(-1.3)];
        let q = DualQuaternion::from_rigid(&r2, &t2) * DualQuaternion::from_rigid(&r1, &t1);
        let p = Point3::new(0.4, -0.2, 5.0);
        assert!((q.transform(&p) - (r2 * (r1 * p + t1) + t2)).norm() < 1e-14);
    }

    #[test]
    fn a_blend_is_rigid_and_sees_neither_signs_nor_order() {
        let q: Vec<_> = [0.1, 0.9, -1.4].map(motion).iter().map(|(r, t)| DualQuaternion::from_rigid(r, t)).collect();
        let w = [0.2, 0.5, 0.3];
        let blend = |order: [usize; 3], sign: [f64; 3]| {
            DualQuaternion::blend(order.iter().map(|&i| (q[i] * sign[i], w[i]))).expect("does not vanish")
        };
        let expected = blend([0, 1, 2], [1.0; 3]);
        assert!((expected.real.norm() - 1.0).abs() < 1e-15 && expected.real.dot(&expected.dual).abs() < 1e-15);
        let p = Point3::new(0.4, -0.2, 5.0);
        for order in [[0, 1, 2], [2, 0, 1], [1, 2, 0]] {
            for signs in 0..8 {
                let sign = [0, 1, 2].map(|k| if signs >> k & 1 == 1 { -1.0 } else { 1.0 });
                assert!((blend(order, sign).transform(&p) - expected.transform(&p)).norm() < 1e-13);
            }
        }
    }

    #[test]
    fn halfway_between_two_motions_lies_half_the_screw() {
        let (axis, angle) = (Vector3::z_axis(), 1.2);
        let end =
            DualQuaternion::from_rigid(&UnitQuaternion::from_axis_angle(&axis, angle), &Vector3::new(0.0, 0.0, 3.0));
        let half = DualQuaternion::blend([(DualQuaternion::identity(), 0.5), (end, 0.5)].into_iter()).expect("defined");
        assert!((half.rotation().angle() - 0.6).abs() < 1e-14);
        assert!((half.translation() - Vector3::new(0.0, 0.0, 1.5)).norm() < 1e-14);
        assert!(DualQuaternion::zero().normalized().is_none());
    }
}
