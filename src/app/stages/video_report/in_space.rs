//! The cameras in space, before and after.
//!
//! Poses are relative to the first camera of their shot, in its axes as a player shows them. With `O` the directions of a camera's
//! axes there (x right, y down, z ahead), `O = R_y(yaw) R_x(pitch) R_z(roll)`.

use std::ops::Range;

use nalgebra::{Matrix3, Vector3};

use super::shown::Shown;
use crate::report::{Cameras, Change, Chart, Curve, Curves, ShotVerdict};
use plumbline_camera::CameraPose;
use plumbline_video::motion::{ClipCameras, ShotCameras};
use plumbline_video::path::VirtualPath;
use plumbline_video::stabilize::verdict_name;

/// x, y, z, yaw, pitch, roll: lengths of the scene and degrees.
type CameraState = [f64; 6];

/// Titles, units and least extents of the plots.
const AXES: [(&str, &str, f64); 6] = [
    ("x, to the right", "scene units", 0.0),
    ("y, down", "scene units", 0.0),
    ("z, ahead", "scene units", 0.0),
    ("Yaw, to the right", "°", 0.5),
    ("Pitch, up", "°", 0.5),
    ("Roll, clockwise", "°", 0.5),
];

/// Verdicts on all shots, and the paths of the cameras that are drawn.
pub(super) fn cameras(cameras: &ClipCameras, path: &VirtualPath, shown: Shown) -> Cameras {
    let drawn = path.cameras.iter().any(Option::is_some);
    Cameras {
        shots: cameras.shots.iter().map(verdict).collect(),
        path: if drawn { charts(cameras, path, shown) } else { Vec::new() },
    }
}

fn verdict(shot: &ShotCameras) -> ShotVerdict {
    let f = &shot.figures;
    ShotVerdict {
        frames: shot.frames.clone(),
        verdict: verdict_name(shot.verdict).to_owned(),
        reason: shot.reason.clone(),
        registered: f.registered,
        points: f.points,
        reprojection_px: f.reprojection_px,
        angle_deg: f.angle.to_degrees(),
        coverage: f.coverage,
        focal_px: f.focal,
        sigma_ln_focal: f.sigma_ln_focal,
    }
}

fn charts(cameras: &ClipCameras, path: &VirtualPath, shown: Shown) -> Vec<Chart> {
    let (mut before, mut after) = (Vec::new(), Vec::new());
    for shot in &cameras.shots {
        let (own, drawn) = shot_states(cameras, path, &shot.frames, shown);
        before.extend(own);
        after.extend(drawn);
    }
    let curve = |name: &str, states: &[CameraState], i: usize| Curve {
        name: name.to_owned(),
        values: states.iter().map(|p| p[i]).collect(),
    };
    let chart = |(i, (title, unit, least_span)): (usize, (&str, &str, f64))| {
        let curves = Change { before: curve("real camera", &before, i), after: curve("virtual camera", &after, i) };
        Chart { title: title.to_owned(), unit: unit.to_owned(), least_span, curves: Curves::Two(curves) }
    };
    AXES.into_iter().enumerate().map(chart).collect()
}

/// Real and virtual cameras of a shot; gaps where none is known, and everywhere if no virtual one is.
fn shot_states(
    cameras: &ClipCameras,
    path: &VirtualPath,
    shot: &Range<usize>,
    shown: Shown,
) -> (Vec<CameraState>, Vec<CameraState>) {
    let real = |f: usize| cameras.frames.get(f).copied().flatten().map(|c| c.pose);
    let virtual_one = |f: usize| path.cameras.get(f).copied().flatten().map(|c| c.pose);
    let first = shot.clone().find_map(real).filter(|_| shot.clone().any(|f| virtual_one(f).is_some()));
    let along = |pose: &dyn Fn(usize) -> Option<CameraPose>| {
        let state = |f| first.zip(pose(f)).map_or([f64::NAN; 6], |(first, pose)| state(&first, &pose, shown));
        let mut states: Vec<CameraState> = shot.clone().map(state).collect();
        unwrap(&mut states);
        states
    };
    (along(&real), along(&virtual_one))
}

/// Where `pose` is and looks, from `first`.
fn state(first: &CameraPose, pose: &CameraPose, shown: Shown) -> CameraState {
    let axes = shown.axes();
    let at: Vector3<f64> = axes * (first.rotation * (pose.center() - first.center()));
    let rotation = (first.rotation * pose.rotation.inverse()).to_rotation_matrix();
    let o: Matrix3<f64> = axes * rotation.matrix() * axes.transpose();
    let yaw = o[(0, 2)].atan2(o[(2, 2)]);
    let pitch = (-o[(1, 2)]).clamp(-1.0, 1.0).asin();
    let roll = o[(1, 0)].atan2(o[(1, 1)]);
    [at.x, at.y, at.z, yaw.to_degrees(), pitch.to_degrees(), roll.to_degrees()]
}

/// Unwraps yaw and roll.
fn unwrap(states: &mut [CameraState]) {
    for angle in [3, 5] {
        let mut last = 0.0;
        for state in states.iter_mut().filter(|p| p[angle].is_finite()) {
            state[angle] -= 360.0 * ((state[angle] - last) / 360.0).round();
            last = state[angle];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;
    use plumbline_camera::{Point3, Vec3};

    const UPRIGHT: Shown = Shown { rotation_deg: 0.0, mirrored: false };

    /// A camera at `at` whose axes are rotated by `rotation` against those of the world.
    fn pose(at: Vec3, rotation: UnitQuaternion<f64>) -> CameraPose {
        CameraPose::looking_from(Point3::from(at), rotation.inverse())
    }

    fn near(a: CameraState, b: CameraState) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9), "{a:?} is not {b:?}");
    }

    #[test]
    fn places_and_angles_are_those_of_the_first_camera_s_axes() {
        let world = UnitQuaternion::from_scaled_axis(Vec3::new(0.3, -1.1, 0.4));
        let first = pose(Vec3::new(4.0, 5.0, 6.0), world);
        let axis = |v: Vec3, degrees: f64| UnitQuaternion::from_scaled_axis(v * degrees.to_radians());
        let (yaw, pitch, roll) = (axis(Vec3::y(), 20.0), axis(Vec3::x(), 10.0), axis(Vec3::z(), 5.0));
        let moved = Vec3::new(1.0, -2.0, 3.0);
        let other = pose(Vec3::new(4.0, 5.0, 6.0) + world * moved, world * yaw * pitch * roll);
        near(state(&first, &first, UPRIGHT), [0.0; 6]);
        near(state(&first, &other, UPRIGHT), [1.0, -2.0, 3.0, 20.0, 10.0, 5.0]);
        let upside_down = Shown { rotation_deg: 180.0, mirrored: false };
        let [x, y, z, .., roll] = state(&first, &other, upside_down);
        near([x, y, z, 0.0, 0.0, 0.0], [-1.0, 2.0, 3.0, 0.0, 0.0, 0.0]);
        assert!(roll > 0.0, "a rotation about the view's axis is the same from above");
        let mirrored = Shown { rotation_deg: 0.0, mirrored: true };
        near(state(&first, &other, mirrored), [-1.0, -2.0, 3.0, -20.0, 10.0, -5.0]);
    }

    #[test]
    fn a_camera_that_turns_round_does_not_jump() {
        let yaw = |degrees: f64| [0.0, 0.0, 0.0, degrees, 0.0, 0.0];
        let mut states = [170.0, 179.0, f64::NAN, -172.0, -90.0, 10.0].map(yaw);
        unwrap(&mut states);
        let yaws = states.map(|p| p[3]);
        assert_eq!((yaws[0], yaws[1], yaws[3], yaws[4], yaws[5]), (170.0, 179.0, 188.0, 270.0, 370.0));
    }
}
