//! Translation, rotation and scale, as joints and glTF nodes have them:
//!
//! ```text
//! x ↦ t + R (s ∘ x)
//! ```
//!
//! It is not closed under composition: a rotation followed by scales that differ shears. Chains of joints are therefore
//! multiplied as matrices.

use nalgebra::{Matrix3, Matrix4, Point3, Rotation3, UnitQuaternion, Vector3};

use super::nearest_rotation;

/// `x ↦ t + R (s ∘ x)`: scales, then rotates, then moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trs {
    /// Where the origin goes.
    pub translation: Vector3<f64>,
    /// The rotation.
    pub rotation: UnitQuaternion<f64>,
    /// Factors along the axes, before the rotation; negative ones mirror.
    pub scale: Vector3<f64>,
}

impl Default for Trs {
    fn default() -> Self {
        Self::identity()
    }
}

impl Trs {
    /// What changes nothing.
    pub fn identity() -> Self {
        Self::rigid(UnitQuaternion::identity(), Vector3::zeros())
    }

    /// A displacement.
    pub fn from_translation(translation: Vector3<f64>) -> Self {
        Self::rigid(UnitQuaternion::identity(), translation)
    }

    /// A rigid motion: rotates, then moves.
    pub fn rigid(rotation: UnitQuaternion<f64>, translation: Vector3<f64>) -> Self {
        Self { translation, rotation, scale: Vector3::repeat(1.0) }
    }

    /// As a matrix of homogeneous coordinates; its last row is `0 0 0 1`.
    pub fn matrix(&self) -> Matrix4<f64> {
        let linear = self.rotation.to_rotation_matrix().into_inner() * Matrix3::from_diagonal(&self.scale);
        let mut matrix = linear.to_homogeneous();
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&self.translation);
        matrix
    }

    /// The nearest of an affine map: exact where its linear part is a rotation times a scale along the axes, else what it
    /// shears is lost. A map that mirrors gets three negative scales.
    pub fn from_matrix(matrix: &Matrix4<f64>) -> Self {
        let linear: Matrix3<f64> = matrix.fixed_view::<3, 3>(0, 0).into_owned();
        let mirror = if linear.determinant() < 0.0 { -1.0 } else { 1.0 };
        let lengths = Vector3::from_fn(|k, _| mirror * linear.column(k).norm());
        // Columns of unit length, so that the rotation does not lean toward the longest axis.
        let units = lengths.map(|l| if l == 0.0 { 0.0 } else { 1.0 / l });
        let rotation = Rotation3::from_matrix_unchecked(nearest_rotation(&(linear * Matrix3::from_diagonal(&units))));
        let scale = Vector3::from_fn(|k, _| rotation.matrix().column(k).dot(&linear.column(k)));
        let translation = matrix.fixed_view::<3, 1>(0, 3).into_owned();
        Self { translation, rotation: UnitQuaternion::from_rotation_matrix(&rotation), scale }
    }

    /// Where a point goes.
    #[inline]
    pub fn transform(&self, p: &Point3<f64>) -> Point3<f64> {
        Point3::from(self.translation + self.rotation * self.scale.component_mul(&p.coords))
    }

    /// Whether every number in it is finite.
    pub fn is_finite(&self) -> bool {
        let mut all = self.translation.iter().chain(self.rotation.coords.iter()).chain(self.scale.iter());
        all.all(|c| c.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn some() -> Trs {
        Trs {
            translation: Vector3::new(1.0, -2.0, 0.5),
            rotation: UnitQuaternion::from_euler_angles(0.3, -1.2, 2.5),
            scale: Vector3::new(2.0, 0.5, 1.5),
        }
    }

    #[test]
    fn the_matrix_maps_points_as_the_parts_do() {
        let p = Point3::new(0.2, 0.7, -3.0);
        let by_matrix = some().matrix().transform_point(&p);
        let by_hand = some().rotation * Vector3::new(0.4, 0.35, -4.5) + some().translation;
        assert!((by_matrix.coords - by_hand).norm() < 1e-14);
        assert!((some().transform(&p).coords - by_hand).norm() < 1e-14);
    }

    #[test]
    fn the_parts_come_back_from_the_matrix() {
        for scale in [[2.0, 0.5, 1.5], [1.0, 1.0, 1.0], [1e-3, 1e3, 1.0], [-1.0, -2.0, -3.0]] {
            let trs = Trs { scale: scale.into(), ..some() };
            let back = Trs::from_matrix(&trs.matrix());
            assert!((back.scale - trs.scale).amax() < 1e-12 * trs.scale.amax(), "{scale:?} {}", back.scale);
            assert!(back.rotation.angle_to(&trs.rotation) < 1e-7 && (back.translation - trs.translation).norm() == 0.0);
            assert!((back.matrix() - trs.matrix()).amax() < 1e-12 * trs.scale.amax());
        }
    }

    #[test]
    fn one_mirrored_axis_comes_back_as_the_same_map() {
        let trs = Trs { scale: Vector3::new(1.0, -2.0, 3.0), ..some() };
        assert!((Trs::from_matrix(&trs.matrix()).matrix() - trs.matrix()).amax() < 1e-12);
    }
}
