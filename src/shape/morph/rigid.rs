//! The best similarity between two point sets, and screw motions.
//!
//! ```text
//! min over R, s, t of  Σ wᵢ |s R aᵢ + t − bᵢ|²        R = V diag(1, 1, ±1) Uᵀ  of  Σ w (a − ā)(b − b̄)ᵀ = U Σ Vᵀ
//! ```
//!
//! # Reference
//! S. Umeyama, *Least-squares estimation of transformation parameters between two point patterns*, PAMI 1991.

use nalgebra::{Matrix3, Point3, Rotation3, Similarity3, Translation3, UnitQuaternion, Vector3};

use super::MorphError;
use plumbline_num::math::without_reflection;

/// Singular values below this fraction of the largest are rounding and determine no direction.
const RANK_TOLERANCE: f64 = 1e-10;

/// Minimum `sin(θ/2)` of a rotation by more than 180° for a circular path: close to full turns the axis is undetermined, and the
/// arc would be more than twice as wide as the displacement is long. The path is straight below it.
const MIN_HALF_SINE: f64 = 0.25;

/// Mean of weighted points.
pub(super) fn centroid(points: &[Point3<f64>], weights: &[f64]) -> Point3<f64> {
    let Some(&first) = points.first() else { return Point3::origin() };
    let total: f64 = weights.iter().sum();
    let sum: Vector3<f64> = points.iter().zip(weights).map(|(p, w)| (p - first) * *w).sum();
    if total > 0.0 { first + sum / total } else { first }
}

/// The best similarity from `from` to `to` (a rigid motion unless `scaled`), and the rank of the point set.
pub(super) fn nearest_similarity(
    from: &[Point3<f64>],
    to: &[Point3<f64>],
    weights: &[f64],
    scaled: bool,
) -> (Similarity3<f64>, usize) {
    let (from_mean, to_mean) = (centroid(from, weights), centroid(to, weights));
    let (mut covariance, mut spread) = (Matrix3::zeros(), 0.0);
    for ((a, b), &w) in from.iter().zip(to).zip(weights) {
        let (a, b) = (a - from_mean, b - to_mean);
        covariance += a * b.transpose() * w;
        spread += w * a.norm_squared();
    }
    let (rotation, values) = rotation_of(&covariance);
    let rank = values.iter().filter(|v| **v > RANK_TOLERANCE * values[0]).count();
    let gain = (rotation.to_rotation_matrix().matrix() * covariance).trace() / spread;
    let scale = if scaled && gain > 0.0 && gain.is_finite() { gain } else { 1.0 };
    let translation = to_mean.coords - rotation * from_mean.coords * scale;
    (Similarity3::from_parts(Translation3::from(translation), rotation, scale), rank)
}

/// The similarity that fits pairs of landmarks best.
///
/// # Errors
/// [`MorphError::Landmarks`] for fewer than three or collinear ones.
pub(super) fn landmark_similarity(
    pairs: impl Iterator<Item = (Point3<f64>, Point3<f64>)>,
) -> Result<Similarity3<f64>, MorphError> {
    let (from, to): (Vec<_>, Vec<_>) = pairs.unzip();
    let (map, rank) = nearest_similarity(&from, &to, &vec![1.0; from.len()], true);
    if from.len() < 3 || rank < 2 {
        return Err(MorphError::Landmarks { given: from.len(), expected: 3 });
    }
    Ok(map)
}

/// The rotation that maximizes `tr(R S)`, and the singular values of `S`, descending.
fn rotation_of(s: &Matrix3<f64>) -> (UnitQuaternion<f64>, Vector3<f64>) {
    let largest = s.amax();
    if !(largest > 0.0 && largest.is_finite()) {
        return (UnitQuaternion::identity(), Vector3::zeros());
    }
    let svd = (s / largest).svd(true, true);
    let (u, v_t) = (svd.u.expect("asked for"), svd.v_t.expect("asked for"));
    let rotation = Rotation3::from_matrix_unchecked(without_reflection(v_t.transpose(), &u.transpose()));
    let mut rotation = UnitQuaternion::from_rotation_matrix(&rotation);
    rotation.renormalize();
    (rotation, svd.singular_values)
}

/// A screw motion, rotation about an axis and translation along it, and a linear change of size.
#[derive(Clone, Debug)]
pub(super) struct Screw {
    /// Rotation vector, full turns included.
    pub(super) rotation_vector: Vector3<f64>,
    /// Size at time 1, above 0.
    scale: f64,
    from: Point3<f64>,
    displacement: Vector3<f64>,
}

impl Screw {
    /// The motion from `from` to `to` with this rotation vector and change of size.
    pub(super) fn new(rotation_vector: Vector3<f64>, scale: f64, from: Point3<f64>, to: Point3<f64>) -> Self {
        Self { rotation_vector, scale, from, displacement: to - from }
    }

    /// The size at a time; 1 at time 0.
    pub(super) fn size(&self, time: f64) -> f64 {
        1.0 + (self.scale - 1.0) * time
    }

    /// The rotation at a time.
    pub(super) fn rotation(&self, time: f64) -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(self.rotation_vector * time)
    }

    /// The position of a point at a time.
    pub(super) fn at(&self, time: f64, point: &Point3<f64>) -> Point3<f64> {
        self.from + self.rotation(time) * (point - self.from) * self.size(time) + self.displacement_at(time)
    }

    /// The inverse motion of a point from time 1 to 0.
    pub(super) fn inverse(&self, point: &Point3<f64>) -> Point3<f64> {
        self.inverse_at(1.0, point)
    }

    /// The inverse motion of a point from a time to 0.
    pub(super) fn inverse_at(&self, time: f64, point: &Point3<f64>) -> Point3<f64> {
        let turned = point - (self.from + self.displacement_at(time));
        self.from + self.rotation(time).inverse() * turned / self.size(time)
    }

    /// The displacement of `from` at a time. Across the axis, `(e^{isθ} − 1)/(e^{iθ} − 1) = e^{i(s−1)θ/2} sin(sθ/2)/sin(θ/2)`.
    fn displacement_at(&self, time: f64) -> Vector3<f64> {
        let angle = self.rotation_vector.norm();
        let sine = (0.5 * angle).sin();
        let full_turns = angle > std::f64::consts::PI * (1.0 + 1e-12);
        if angle < 1e-12 || full_turns && sine.abs() < MIN_HALF_SINE {
            return self.displacement * time;
        }
        let axis = self.rotation_vector / angle;
        let along = axis * axis.dot(&self.displacement);
        let across =
            UnitQuaternion::from_scaled_axis(self.rotation_vector * (0.5 * (time - 1.0))) * (self.displacement - along);
        along * time + across * ((0.5 * time * angle).sin() / sine)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloud() -> Vec<Point3<f64>> {
        (0..20).map(f64::from).map(|k| Point3::new(k.sin(), (2.3 * k).cos(), 0.3 * k)).collect()
    }

    #[test]
    fn similarities_are_recovered() {
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.4, -2.0, 1.1));
        for (scale, offset) in [(1.0, 0.0), (3.5, 1e4), (0.01, -2.0)] {
            let map = Similarity3::from_parts(Translation3::new(offset, 2.0, -offset), rotation, scale);
            let to: Vec<_> = cloud().iter().map(|p| map * p).collect();
            let (found, rank) = nearest_similarity(&cloud(), &to, &[1.0; 20], true);
            assert_eq!(rank, 3);
            for (p, q) in cloud().iter().zip(&to) {
                assert!((found * p - q).norm() < 1e-12 * (1.0 + offset.abs()) * scale.max(1.0));
            }
        }
    }

    #[test]
    fn a_reflection_gives_a_rotation_and_collinear_points_rank_one() {
        let mirrored: Vec<_> = cloud().iter().map(|p| Point3::new(-p.x, p.y, p.z)).collect();
        let (found, _) = nearest_similarity(&cloud(), &mirrored, &[1.0; 20], false);
        assert!((found.isometry.rotation.to_rotation_matrix().matrix().determinant() - 1.0).abs() < 1e-12);
        let line: Vec<_> = (0..5).map(|k| Point3::new(f64::from(k), 2.0 * f64::from(k), 1.0)).collect();
        assert_eq!(nearest_similarity(&line, &line, &[1.0; 5], false).1, 1);
    }

    #[test]
    fn a_rotation_about_any_axis_is_a_circular_path_about_it() {
        for degrees in [170.0, 270.0, 1e-7, 350.0_f64] {
            let (axis, pivot) = (Vector3::new(1.0, 2.0, -0.5).normalize(), Point3::new(3.0, -4.0, 5.0));
            let turned = |s: f64, p: &Point3<f64>| {
                pivot + UnitQuaternion::from_scaled_axis(axis * (s * degrees.to_radians())) * (p - pivot)
            };
            let from = Point3::new(0.2, 0.1, 0.4);
            let screw = Screw::new(axis * degrees.to_radians(), 1.0, from, turned(1.0, &from));
            for (k, p) in cloud().iter().enumerate() {
                assert!((screw.inverse(&screw.at(1.0, p)) - p).norm() < 1e-12);
                // Close to full turns the path is straight.
                if degrees < 340.0 {
                    let s = k as f64 / 19.0;
                    assert!((screw.at(s, p) - turned(s, p)).norm() < 1e-8, "{degrees}, {s}");
                }
            }
        }
    }
}
