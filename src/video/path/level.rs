//! The level horizon: the vertical of a shot, and cameras rotated to keep it upright.
//!
//! A level camera has its right axis `x_t = R_tᵀ(1, 0, 0)` perpendicular to the vertical, and its up axis
//! `y_t = R_tᵀ(0, −1, 0)` near it. The vertical of a shot is the direction most nearly perpendicular to the right axes,
//! regularized toward the mean `ȳ` of the up axes:
//!
//! ```text
//! u = argmin Σ (x_t · u)² / n + σ² |u − ȳ|²  =  σ² (X + σ² I)⁻¹ ȳ,      X = Σ x_t x_tᵀ / n,      scaled to length 1.
//! ```
//!
//! `X` has the variance of the pan along the view and that of the roll along the vertical: for a camera that looks down while
//! it pans by more than `σ`, the up axes alone would give a vertical that leans with the view.
//!
//! With `v = R u` the vertical in a camera, a rotation by `−ρ`, `ρ = atan2(v_x, −v_y)`, about its optical axis levels it.

use nalgebra::{Matrix3, UnitQuaternion};

use plumbline_camera::{CameraPose, Vec3};

/// `σ`, rad (3°): roll or pan of this standard deviation weighs as much as the up axes. It is the roll of a hand-hand_held camera.
const SIGMA: f64 = 0.052;

/// Length below which a direction is undefined (up axes that cancel, a view straight up or down): half of the digits are lost.
const MIN_DIRECTION_LENGTH: f64 = 1e-6;

/// The vertical, world coordinates, of cameras with these rotations (`cam_from_world`); `None` where it is undefined.
pub fn upward(rotations: &[UnitQuaternion<f64>]) -> Option<Vec3> {
    let n = rotations.len().max(1) as f64;
    let axis = |r: &UnitQuaternion<f64>, axis: Vec3| r.inverse() * axis;
    let mean: Vec3 = rotations.iter().map(|r| axis(r, -Vec3::y())).sum::<Vec3>() / n;
    let spread: Matrix3<f64> =
        rotations.iter().map(|r| axis(r, Vec3::x())).map(|x| x * x.transpose()).sum::<Matrix3<f64>>() / n;
    let prior = Matrix3::identity() * (SIGMA * SIGMA);
    mean.try_normalize(MIN_DIRECTION_LENGTH)?;
    (SIGMA * SIGMA * (spread + prior).try_inverse()? * mean).try_normalize(f64::MIN_POSITIVE)
}

/// Roll of a camera against `up`, rad; 0 where it looks straight along it.
pub fn roll(pose: &CameraPose, up: &Vec3) -> f64 {
    let seen = pose.rotation * up;
    if seen.xy().norm() > MIN_DIRECTION_LENGTH { seen.x.atan2(-seen.y) } else { 0.0 }
}

/// The camera with the same center and view direction, and `up` upright in its picture.
#[must_use]
pub fn leveled(pose: &CameraPose, up: &Vec3) -> CameraPose {
    let correction = UnitQuaternion::from_scaled_axis(Vec3::z() * -roll(pose, up));
    CameraPose { rotation: correction * pose.rotation, translation: correction * pose.translation }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_camera::Point3;

    fn about(axis: Vec3, degrees: f64) -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(axis * degrees.to_radians())
    }

    /// A camera that pans about the vertical −y, looks down by `pitch` and rolls, degrees.
    fn hand_held(pan: f64, pitch: f64, roll: f64) -> UnitQuaternion<f64> {
        about(Vec3::z(), roll) * about(Vec3::x(), pitch) * about(Vec3::y(), pan)
    }

    #[test]
    fn leveling_keeps_center_and_view_direction() {
        let up = Vec3::new(0.3, -2.0, 0.4).normalize();
        for k in 0..40 {
            let k = f64::from(k);
            let pose = CameraPose::looking_from(Point3::new(k, -1.0, 2.0), hand_held(9.0 * k, 2.0 * k - 40.0, 9.0 * k));
            let level = leveled(&pose, &up);
            assert!(roll(&level, &up).abs() < 1e-12, "{k}");
            assert!((level.rotation * up).y < 0.0, "{k}: upright");
            assert!((level.center() - pose.center()).norm() < 1e-12);
            let ahead = |p: &CameraPose| p.rotation.inverse() * Vec3::z();
            assert!((ahead(&level) - ahead(&pose)).norm() < 1e-12);
        }
    }

    #[test]
    fn the_vertical_of_a_camera_that_looks_down_while_it_pans_does_not_lean() {
        let pan: Vec<_> =
            (-30_i32..=30).map(|k| hand_held(f64::from(k), 20.0, f64::from(k.rem_euclid(3) - 1))).collect();
        let lean = upward(&pan).expect("a vertical").angle(&-Vec3::y()).to_degrees();
        assert!(lean < 1.0, "{lean} degrees");
    }

    #[test]
    fn a_camera_that_does_not_pan_is_level_in_the_mean() {
        let rolls = [1.0, -2.0, 4.0, -3.0, 0.0];
        let up = upward(&rolls.map(|r| hand_held(0.0, 15.0, r))).expect("a vertical");
        let found =
            rolls.map(|r| roll(&CameraPose { rotation: hand_held(0.0, 15.0, r), translation: Vec3::zeros() }, &up));
        let mean = found.iter().sum::<f64>() / 5.0;
        assert!(mean.abs() < 1e-3, "{found:?}");
        assert!((found[2] - found[3]).abs() > 0.1, "each keeps its own");
    }

    #[test]
    fn the_vertical_is_undefined_without_cameras_and_for_opposite_ones() {
        assert_eq!(upward(&[]), None);
        assert_eq!(upward(&[hand_held(0.0, 0.0, 0.0), hand_held(0.0, 0.0, 180.0)]), None);
        let down = CameraPose { rotation: hand_held(0.0, 90.0, 7.0), translation: Vec3::zeros() };
        assert_eq!(leveled(&down, &-Vec3::y()).rotation.angle_to(&down.rotation), 0.0, "straight down");
    }
}
