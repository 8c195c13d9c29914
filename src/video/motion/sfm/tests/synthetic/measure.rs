//! Errors of a reconstruction against the ground truth.

use nalgebra::{Matrix3, UnitQuaternion};

use plumbline_camera::{CameraPose, Vec3};

/// Errors of camera paths after similarity alignment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PathError {
    /// Root mean square distance of the centers, as a fraction of the length of the true path.
    pub(crate) position: f64,
    /// Root mean square angle between the cameras' axes, rad, after alignment by a common rotation.
    pub(crate) rotation: f64,
    /// Root mean square angular error of the rotations from one frame to the next, rad.
    pub(crate) frame_to_frame: f64,
}

/// Compares the frames known to both paths.
///
/// # Reference
/// S. Umeyama, *Least-squares estimation of transformation parameters between two point patterns*, PAMI 13 (1991).
pub(crate) fn path_error(found: &[Option<CameraPose>], truth: &[Option<CameraPose>]) -> PathError {
    let pairs: Vec<_> = found.iter().zip(truth).filter_map(|(f, t)| Some(((*f)?, (*t)?))).collect();
    let n = pairs.len().max(1) as f64;
    let mean = |of: fn(&(CameraPose, CameraPose)) -> Vec3| pairs.iter().map(of).sum::<Vec3>() / n;
    let (mean_found, mean_truth) = (mean(|p| p.0.center().coords), mean(|p| p.1.center().coords));
    let centered = |p: &(CameraPose, CameraPose)| (p.0.center().coords - mean_found, p.1.center().coords - mean_truth);
    let moments: Matrix3<f64> = pairs.iter().map(centered).map(|(f, t)| t * f.transpose()).sum();
    let spread: f64 = pairs.iter().map(centered).map(|(f, _)| f.norm_squared()).sum();
    let (rotation, scale) = umeyama(&moments, spread);
    let apart = pairs.iter().map(centered).map(|(f, t)| (scale * (rotation * f) - t).norm_squared()).sum::<f64>();
    let length: f64 = pairs.windows(2).map(|w| (w[1].1.center() - w[0].1.center()).norm()).sum();
    let angle = |a: UnitQuaternion<f64>, b: UnitQuaternion<f64>| a.angle_to(&b).powi(2);
    let common = common_rotation(&pairs);
    let rotated = pairs.iter().map(|(f, t)| angle(f.rotation * common, t.rotation)).sum::<f64>();
    let step = |a: &CameraPose, b: &CameraPose| b.rotation * a.rotation.inverse();
    let steps = pairs.windows(2).map(|w| angle(step(&w[0].0, &w[1].0), step(&w[0].1, &w[1].1))).sum::<f64>();
    PathError {
        position: (apart / n).sqrt() / length.max(f64::MIN_POSITIVE),
        rotation: (rotated / n).sqrt(),
        frame_to_frame: (steps / (n - 1.0).max(1.0)).sqrt(),
    }
}

/// Rotation and scale that align the estimated centers with the true ones.
fn umeyama(moments: &Matrix3<f64>, spread: f64) -> (Matrix3<f64>, f64) {
    let svd = moments.svd(true, true);
    let (u, v_t) = (svd.u.expect("asked for"), svd.v_t.expect("asked for"));
    let sign = if (u * v_t).determinant() < 0.0 { -1.0 } else { 1.0 };
    let flip = Matrix3::from_diagonal(&Vec3::new(1.0, 1.0, sign));
    let scale = svd.singular_values.dot(&flip.diagonal()) / spread.max(f64::MIN_POSITIVE);
    (u * flip * v_t, scale)
}

/// `C` that minimizes the sum of squared angles between `R_found C` and `R_true`, to first order about that of the
/// first pair.
fn common_rotation(pairs: &[(CameraPose, CameraPose)]) -> UnitQuaternion<f64> {
    let Some(first) = pairs.first() else { return UnitQuaternion::identity() };
    let between = |p: &(CameraPose, CameraPose)| p.0.rotation.inverse() * p.1.rotation;
    let start = between(first);
    let mean = pairs.iter().map(|p| (start.inverse() * between(p)).scaled_axis()).sum::<Vec3>() / pairs.len() as f64;
    start * UnitQuaternion::from_scaled_axis(mean)
}
