//! The camera for a model: a viewing direction, and the nearest position with the whole model in the picture.
//!
//! With the axes of the camera given, a vertex `(X, Y, Z)` is inside the picture of a camera at `c` where
//! `|X − c_x| ≤ τ_x (Z − c_z)` and `|Y − c_y| ≤ τ_y (Z − c_z)`, `τ` the tangents of half the field of view. Each side of the
//! frustum is a plane of known direction, so that the least feasible distance needs no search: with `A = max(X − τ_x Z)` and
//! `B = max(−X − τ_x Z)`, `c_z = −(A + B)/2τ_x` is the largest that the width allows, and `c_x = (A − B)/2` its middle; likewise
//! the height. The smaller `c_z` of both counts.

use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use plumbline_camera::CameraPose;
use plumbline_num::math::Point2;

/// Which axis of the model points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum UpAxis {
    /// +y up, the front looks along +z.
    ///
    /// So do glTF, and most of OBJ.
    #[default]
    Y,
    /// +z up, the front looks along -y.
    ///
    /// So do drawings of parts and buildings, and scans.
    Z,
}

/// From where a model is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewDirection {
    /// Angle of the viewer about the up axis, rad: 0 before the front, π/2 at the model's left hand, which is +x.
    pub yaw: f64,
    /// Height of the viewer over the model's horizon, rad; π/2 above it.
    pub pitch: f64,
}

impl ViewDirection {
    /// Named directions with yaw and pitch, degrees.
    pub const NAMED: [(&'static str, f64, f64); 7] = [
        ("front", 0.0, 0.0),
        ("back", 180.0, 0.0),
        ("left", 90.0, 0.0),
        ("right", -90.0, 0.0),
        ("top", 0.0, 90.0),
        ("bottom", 0.0, -90.0),
        ("corner", 35.0, 25.0),
    ];

    /// From angles in degrees.
    pub fn degrees(yaw: f64, pitch: f64) -> Self {
        Self { yaw: yaw.to_radians(), pitch: pitch.to_radians() }
    }

    /// The direction of that name.
    pub fn named(name: &str) -> Option<Self> {
        let (_, yaw, pitch) = Self::NAMED.iter().find(|(known, ..)| *known == name)?;
        Some(Self::degrees(*yaw, *pitch))
    }

    /// Camera axes (rows: right, down, forward) in model axes.
    fn camera_from_model(self, up: UpAxis) -> Rotation3<f64> {
        let ((sin_yaw, cos_yaw), (sin, cos)) = (self.yaw.sin_cos(), self.pitch.sin_cos());
        let right = Vector3::new(cos_yaw, 0.0, -sin_yaw);
        let forward = -Vector3::new(sin_yaw * cos, sin, cos_yaw * cos);
        let down = forward.cross(&right);
        let y_up = Matrix3::from_rows(&[right.transpose(), down.transpose(), forward.transpose()]);
        let model = match up {
            UpAxis::Y => Matrix3::identity(),
            UpAxis::Z => Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0),
        };
        Rotation3::from_matrix_unchecked(y_up * model)
    }
}

impl Default for ViewDirection {
    /// From the side and above, so that three sides of a box are visible.
    fn default() -> Self {
        Self::degrees(35.0, 25.0)
    }
}

/// A pinhole camera that looks at a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceCamera {
    /// Position and orientation.
    pub pose: CameraPose,
    /// Focal length, px.
    pub focal_px: f64,
    /// Width and height of the picture, px.
    pub size: (usize, usize),
    /// Distance of the near plane, in units of the model.
    pub near: f64,
}

/// Margin around the model as a fraction of half the picture's side: outlines and marks at the rim stay whole.
const MARGIN: f64 = 0.06;
/// Field of view along the shorter side, rad: 28° as of a portrait lens, a compromise between flat and bulged shapes.
const FIELD_OF_VIEW: f64 = 0.49;

impl SurfaceCamera {
    /// The camera of `size` px that looks at the points from `direction`, as near as possible with all of them in the picture.
    /// Without points it looks at the origin.
    pub fn fit<'p>(
        points: impl IntoIterator<Item = &'p Point3<f64>>,
        direction: ViewDirection,
        up: UpAxis,
        size: (usize, usize),
    ) -> Self {
        let rotation = direction.camera_from_model(up);
        let size = (size.0.max(1), size.1.max(1));
        let focal_px = size.0.min(size.1) as f64 / 2.0 / (FIELD_OF_VIEW / 2.0).tan();
        let tangents = [size.0, size.1].map(|side| side as f64 / 2.0 / focal_px * (1.0 - MARGIN));
        let mut extent = Extent::new(tangents);
        points.into_iter().for_each(|p| extent.include(&rotation, p));
        let (center, distance) = extent.center();
        let world = extent.origin.unwrap_or_else(Point3::origin) + rotation.inverse() * center.coords;
        let pose = CameraPose::looking_from(world, UnitQuaternion::from_rotation_matrix(&rotation));
        Self { pose, focal_px, size, near: distance * 1e-3 }
    }

    /// Normalized ray `(X, Y)`, with Z = 1, through a pixel position.
    #[inline]
    pub(super) fn ray(&self, x: f64, y: f64) -> (f64, f64) {
        ((x - self.size.0 as f64 / 2.0) / self.focal_px, (y - self.size.1 as f64 / 2.0) / self.focal_px)
    }

    /// Projection of a point in camera coordinates, px; meaningless for points behind the camera.
    #[inline]
    pub(super) fn project(&self, p: &Point3<f64>) -> Point2 {
        let scale = self.focal_px / p.z;
        Point2::new(p.x * scale + self.size.0 as f64 / 2.0, p.y * scale + self.size.1 as f64 / 2.0)
    }
}

/// Extent of points along the sides of a frustum, relative to the first point so that distant models lose no digits.
struct Extent {
    tangents: [f64; 2],
    origin: Option<Point3<f64>>,
    /// `max(X − τ Z)` and `max(−X − τ Z)` of each axis.
    reach: [[f64; 2]; 2],
    nearest: f64,
    farthest: f64,
}

impl Extent {
    fn new(tangents: [f64; 2]) -> Self {
        let none = f64::NEG_INFINITY;
        Self { tangents, origin: None, reach: [[none; 2]; 2], nearest: f64::INFINITY, farthest: none }
    }

    fn include(&mut self, rotation: &Rotation3<f64>, p: &Point3<f64>) {
        if !p.coords.iter().all(|c| c.is_finite()) {
            return;
        }
        let origin = *self.origin.get_or_insert(*p);
        let v = rotation * (p - origin);
        for (axis, tangent) in self.tangents.into_iter().enumerate() {
            let reach = &mut self.reach[axis];
            reach[0] = reach[0].max(v[axis] - tangent * v.z);
            reach[1] = reach[1].max(-v[axis] - tangent * v.z);
        }
        self.nearest = self.nearest.min(v.z);
        self.farthest = self.farthest.max(v.z);
    }

    /// The camera position in camera axes relative to the first point, and the distance to the middle of the depth range.
    fn center(&self) -> (Point3<f64>, f64) {
        if self.origin.is_none() {
            return (Point3::new(0.0, 0.0, -1.0), 1.0);
        }
        let [x, y] = [0, 1].map(|i| (self.reach[i][0] - self.reach[i][1]) / 2.0);
        let farthest_back = |i: usize| -(self.reach[i][0] + self.reach[i][1]) / (2.0 * self.tangents[i]);
        let mut z = farthest_back(0).min(farthest_back(1));
        let middle = 0.5 * (self.nearest + self.farthest);
        // A point, or a line along the viewing axis, fits at any distance: use its own length, or one unit.
        let depth = self.farthest - self.nearest;
        if !(self.nearest - z > 1e-6 * depth) {
            z = self.nearest - if depth > 0.0 { depth } else { 1.0 };
        }
        (Point3::new(x, y, z), middle - z)
    }
}
