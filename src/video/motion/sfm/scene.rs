//! The scene: cameras, points, lens and readout to be estimated, and the image observations.
//!
//! A point is represented by the ray `m = (x, y, 1)` on which its *anchor* frame observes it and by its inverse depth
//! `w` there, so that points at infinity (`w = 0`) need no special case. In another camera `i`, up to scale,
//!
//! ```text
//! Y = R_ia m + w (t_i − R_ia t_a),     R_ia = R_i R_aᵀ.
//! ```

use super::TrackTable;
use plumbline_camera::{CameraPose, Intrinsics, Point3, Vec3};
use plumbline_num::math::{Point2, Vec2};

/// An observation of a point in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Index of the frame.
    pub frame: u32,
    /// Index of the point, the same along its track.
    pub point: u32,
    /// Observed position, px.
    pub pixel: Point2,
}

/// A point of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScenePoint {
    /// The frame in whose camera the other fields are expressed.
    pub anchor: u32,
    /// `(x, y)` of the ray, normalized image coordinates of the anchor's camera.
    pub ray: Vec2,
    /// `w`, one over the depth along the anchor's optical axis; 0 at infinity, negative behind.
    pub inverse_depth: f64,
}

impl ScenePoint {
    /// `m`.
    pub fn direction(&self) -> Vec3 {
        Vec3::new(self.ray.x, self.ray.y, 1.0)
    }

    /// `Y`: coordinates in the camera `pose`, scaled by `w > 0`; the point is in front if the third one is positive.
    pub fn scaled_in(&self, pose: &CameraPose, anchor: &CameraPose) -> Vec3 {
        let from_anchor = *pose * anchor.inverse();
        from_anchor.rotation * self.direction() + self.inverse_depth * from_anchor.translation
    }

    /// Its position in the world; `None` at infinity and behind its anchor.
    pub fn in_world(&self, anchor: &CameraPose) -> Option<Point3> {
        (self.inverse_depth > 0.0).then(|| anchor.inverse().apply(&Point3::from(self.direction() / self.inverse_depth)))
    }
}

/// A reconstruction.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The lens, shared by all frames.
    pub intrinsics: Intrinsics,
    /// Time from the first row's capture to the last row's, in frame periods; 0 for a global shutter.
    pub readout: f64,
    /// By frame; `None` if the camera is unknown.
    pub poses: Vec<Option<CameraPose>>,
    /// By track; `None` if the point is unknown or not static.
    pub points: Vec<Option<ScenePoint>>,
}

impl Scene {
    /// The scene of `table` before anything is known but a guess of the lens.
    pub(super) fn unknown(table: &TrackTable, intrinsics: Intrinsics) -> Self {
        Self { intrinsics, readout: 0.0, poses: vec![None; table.frames()], points: vec![None; table.points()] }
    }

    /// Projection of a point into a frame, px, for a global shutter; `None` if either is unknown or the point is
    /// behind the camera.
    pub fn project(&self, frame: u32, point: u32) -> Option<Point2> {
        let point = self.points.get(point as usize).copied().flatten()?;
        let pose = |f: u32| self.poses.get(f as usize).copied().flatten();
        let seen = point.scaled_in(&pose(frame)?, &pose(point.anchor)?);
        self.intrinsics.project(&Point3::from(seen))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;

    #[test]
    fn a_point_is_where_its_ray_and_depth_say_in_every_camera() {
        let pose = |x: f64| CameraPose {
            rotation: UnitQuaternion::from_scaled_axis(Vec3::new(0.1, x, -0.2)),
            translation: Vec3::new(x, 0.3, -0.1),
        };
        let (anchor, other) = (pose(0.2), pose(-0.4));
        let point = ScenePoint { anchor: 0, ray: Vec2::new(0.3, -0.2), inverse_depth: 0.25 };
        let world = point.in_world(&anchor).expect("four units in front");
        assert!((anchor.apply(&world).coords - 4.0 * point.direction()).norm() < 1e-13);
        assert!((point.scaled_in(&other, &anchor) - 0.25 * other.apply(&world).coords).norm() < 1e-13);
        let scene = Scene {
            intrinsics: Intrinsics::centered(500.0, 640, 360),
            readout: 0.0,
            poses: vec![Some(anchor), Some(other), None],
            points: vec![Some(point)],
        };
        let expected = scene.intrinsics.project(&other.apply(&world)).expect("in front");
        assert!((scene.project(1, 0).expect("known") - expected).norm() < 1e-10);
        assert!(scene.project(2, 0).is_none() && scene.project(0, 1).is_none());
    }

    #[test]
    fn a_point_at_infinity_moves_with_rotation_only() {
        let far = ScenePoint { anchor: 0, ray: Vec2::new(0.3, -0.2), inverse_depth: 0.0 };
        let anchor = CameraPose::identity();
        let moved = CameraPose { translation: Vec3::new(5.0, 1.0, 2.0), ..anchor };
        assert_eq!(far.scaled_in(&moved, &anchor), far.direction());
        assert!(far.in_world(&anchor).is_none());
    }
}
