//! Files of painted times.
//!
//! ```json
//! { "format": "plumbline.paint", "version": 1, "elsewhere": 0,
//!   "paint": [ { "time": 0, "vertices": [3, 17, [0.1, 2, 0]] },
//!              { "time": 1, "sphere": { "center": [0, 2, 0.3], "radius": 0.4 } } ] }
//! ```
//!
//! Later strokes override earlier ones. Between strokes times are interpolated harmonically.

use std::path::Path;

use nalgebra::Point3;
use serde::Deserialize;

use super::MorphError;
use super::correspondence::VertexRef;
use crate::mesh::TriMesh;
use crate::mesh::region::{Ball, HalfSpace};
use plumbline_num::document::Kind;

/// 128 MiB: about ten million painted vertices.
const KIND: Kind = Kind { name: "a file of painted times", format: "plumbline.paint", max_bytes: 1 << 27 };

fn malformed(fault: String) -> MorphError {
    MorphError::Malformed { name: KIND.name, fault }
}

/// Times painted on the vertices of the first mesh.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Paint {
    /// Always `plumbline.paint`.
    #[expect(dead_code, reason = "checked before the rest is read")]
    format: String,
    /// Always 1.
    #[expect(dead_code, reason = "checked before the rest is read")]
    version: u32,
    /// Time of connected components without strokes.
    #[serde(default)]
    elsewhere: f64,
    /// Strokes; later ones override earlier ones.
    #[cfg_attr(feature = "schema", schemars(length(min = 1)))]
    #[serde(rename = "paint")]
    strokes: Vec<Stroke>,
}

/// A time for `vertices`, and for those in `sphere` and `half_space`.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct Stroke {
    /// Time, 0 (the first mesh) to 1 (the second).
    #[cfg_attr(feature = "schema", schemars(range(min = 0.0, max = 1.0)))]
    time: f64,
    /// Vertices.
    #[serde(default)]
    vertices: Vec<VertexRef>,
    /// All vertices in a ball, boundary included.
    #[serde(default)]
    sphere: Option<Ball>,
    /// All vertices on one side of a plane.
    #[serde(default)]
    half_space: Option<HalfSpace>,
}

/// The JSON schema of files of painted times.
#[cfg(feature = "schema")]
pub fn paint_schema() -> schemars::Schema {
    schemars::schema_for!(Paint)
}

impl Paint {
    /// Reads a file.
    ///
    /// # Errors
    /// [`MorphError::Malformed`], also where it cannot be read.
    pub fn read(path: &Path) -> Result<Self, MorphError> {
        Self::parse(&KIND.text(path)?)
    }

    /// Reads the text of a file.
    ///
    /// # Errors
    /// [`MorphError::Malformed`].
    pub fn parse(text: &str) -> Result<Self, MorphError> {
        let file = KIND.parse::<Self>(text)?;
        let times = file.strokes.iter().map(|s| s.time).chain([file.elsewhere]);
        if let Some(time) = times.into_iter().find(|t| !(0.0..=1.0).contains(t)) {
            return Err(malformed(format!("a time is {time} (expected 0 to 1)")));
        }
        Ok(file)
    }

    /// Time of connected components without strokes.
    pub fn elsewhere(&self) -> f64 {
        self.elsewhere
    }

    /// The painted time of each vertex of a mesh.
    ///
    /// # Errors
    /// [`MorphError::NoSuchVertex`]; [`MorphError::Value`] for a stroke without vertices.
    pub fn of_mesh(&self, mesh: &TriMesh) -> Result<Vec<Option<f64>>, MorphError> {
        let mut painted = vec![None; mesh.vertex_count()];
        if self.strokes.is_empty() {
            return Err(malformed("no stroke is given (expected at least one)".to_owned()));
        }
        for (k, stroke) in self.strokes.iter().enumerate() {
            let context = format!("stroke {k}");
            let vertices = stroke.vertices_of(mesh, &context)?;
            if vertices.is_empty() {
                let expected = "vertices, a sphere or a half_space with vertices of the first mesh".to_owned();
                return Err(MorphError::Value { what: context, value: "without vertices".to_owned(), expected });
            }
            for v in vertices {
                painted[v as usize] = Some(stroke.time);
            }
        }
        Ok(painted)
    }
}

impl Stroke {
    fn vertices_of(&self, mesh: &TriMesh, context: &str) -> Result<Vec<u32>, MorphError> {
        let named: Result<Vec<u32>, MorphError> =
            self.vertices.iter().map(|p| p.vertex(mesh, "first", context)).collect();
        let selects = |p: &Point3<f64>| {
            self.sphere.as_ref().is_some_and(|ball| ball.contains(p))
                || self.half_space.as_ref().is_some_and(|side| side.contains(p))
        };
        let selected = (0..).zip(mesh.positions()).filter(|(_, p)| selects(p)).map(|(v, _)| v);
        Ok(named?.into_iter().chain(selected).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    const GOOD: &str = r#"{"format": "plumbline.paint", "version": 1, "elsewhere": 0.5, "paint": [
        {"time": 0, "half_space": {"point": [0, 0, -0.5], "normal": [0, 0, -1]}},
        {"time": 1, "sphere": {"center": [0, 0, 1], "radius": 0.6}}, {"time": 0.25, "vertices": [0]}]}"#;

    #[test]
    fn later_strokes_override_earlier_ones() {
        let ball = shapes::icosphere(2);
        let painted = Paint::parse(GOOD).unwrap().of_mesh(&ball).unwrap();
        for (v, (p, time)) in ball.positions().iter().zip(&painted).enumerate() {
            let expected = match () {
                () if v == 0 => Some(0.25),
                () if (p - Point3::new(0.0, 0.0, 1.0)).norm() <= 0.6 => Some(1.0),
                () if p.z <= -0.5 => Some(0.0),
                () => None,
            };
            assert_eq!(*time, expected);
        }
    }

    #[test]
    fn invalid_paint_is_rejected() {
        let ball = shapes::icosphere(1);
        for (from, to, expected) in [
            ("\"time\": 1", "\"time\": 1.5", "a time is 1.5"),
            ("[0]", "[900]", "no vertex 900"),
            ("\"radius\": 0.6", "\"radius\": -1", "without vertices"),
            ("plumbline.paint", "plumbline.lines", "plumbline.paint"),
            ("\"version\": 1", "\"version\": 9", "version 9"),
            ("sphere", "cube", "cube"),
        ] {
            let message = Paint::parse(&GOOD.replace(from, to)).and_then(|p| p.of_mesh(&ball)).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}
