//! Regions of space in input files.

use nalgebra::{Point3, Vector3};
use serde::Deserialize;

/// A ball.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct Ball {
    /// Center.
    center: [f64; 3],
    /// Radius, above 0.
    pub(crate) radius: f64,
}

impl Ball {
    /// Whether a point is inside or on the boundary.
    pub(crate) fn contains(&self, p: &Point3<f64>) -> bool {
        nalgebra::distance(p, &Point3::from(self.center)) <= self.radius
    }
}

/// One side of a plane.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct HalfSpace {
    /// A point of the plane.
    point: [f64; 3],
    /// Normal of the plane, towards the selected side.
    pub(crate) normal: [f64; 3],
}

impl HalfSpace {
    /// Whether a point is on the selected side or on the plane.
    pub(crate) fn contains(&self, p: &Point3<f64>) -> bool {
        (p - Point3::from(self.point)).dot(&Vector3::from(self.normal)) >= 0.0
    }
}
