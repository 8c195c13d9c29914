//! Seam files: the cuts of two surfaces, and how they are joined.
//!
//! ```json
//! { "format": "plumbline.seam", "version": 1,
//!   "base": { "plane": { "point": [0, 1, 0], "normal": [0, -1, 0] } },
//!   "part": { "loop": { "vertices": [3, 17, 250], "keep": 12 } },
//!   "landmarks": [[10, 4], [12, 9], [31, 2]],
//!   "band": 6 }
//! ```

use std::path::Path;

use nalgebra::{Point3, Vector3};
use serde::Deserialize;

use super::super::MorphError;
use super::super::correspondence::VertexRef;
use super::{ComposeOptions, Cut};
use crate::mesh::TriMesh;
use plumbline_num::document::Kind;

/// 128 MiB: about a million landmarks.
const KIND: Kind = Kind { name: "a file of seams", format: "plumbline.seam", max_bytes: 1 << 27 };

fn malformed(fault: String) -> MorphError {
    MorphError::Malformed { name: KIND.name, fault }
}

/// The content of a seam file.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SeamFile {
    /// Always `plumbline.seam`.
    #[expect(dead_code, reason = "checked before the rest is read")]
    format: String,
    /// Always 1.
    #[expect(dead_code, reason = "checked before the rest is read")]
    version: u32,
    /// Cut of the base; parts that do not touch the cut are kept.
    base: CutEntry,
    /// Cut of the part; only what touches the cut is kept.
    part: CutEntry,
    /// Corresponding vertices of base and part, at least three. Default: the part is aligned by the two cuts.
    #[serde(default)]
    landmarks: Vec<(VertexRef, VertexRef)>,
    /// Width of the transition band on either side of the seam, in rings of vertices.
    #[serde(default = "default_band")]
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 1000)))]
    band: u32,
}

fn default_band() -> u32 {
    super::DEFAULT_BAND as u32
}

/// A cut of a surface.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum CutEntry {
    /// By a plane, along its closed intersection curve nearest to its point.
    Plane(PlaneEntry),
    /// Along edges, on shortest paths from vertex to vertex and back to the first.
    Lasso(LineEntry),
    /// A smoothed lasso, across triangles.
    Loop(LineEntry),
    /// No cut: the existing boundary nearest to a point.
    Boundary([f64; 3]),
}

/// A plane.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct PlaneEntry {
    /// A point of the plane, near the cut.
    point: [f64; 3],
    /// Normal of the plane towards the kept side, of any length.
    normal: [f64; 3],
}

/// A closed curve through vertices.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct LineEntry {
    /// Vertices on the curve, in order.
    vertices: Vec<VertexRef>,
    /// A vertex of the kept side.
    keep: VertexRef,
}

/// The JSON schema of files of seams.
#[cfg(feature = "schema")]
pub fn seam_schema() -> schemars::Schema {
    schemars::schema_for!(SeamFile)
}

impl SeamFile {
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
        if !(1..=1000).contains(&file.band) {
            return Err(malformed(format!("the band is {} (expected 1 to 1000 rings)", file.band)));
        }
        Ok(file)
    }

    /// Resolves the file on two meshes.
    ///
    /// # Errors
    /// [`MorphError::NoSuchVertex`], [`MorphError::Value`].
    pub fn of_meshes(&self, base: &TriMesh, part: &TriMesh) -> Result<ComposeOptions, MorphError> {
        let pair = |(k, (a, b)): (usize, &(VertexRef, VertexRef))| {
            let context = format!("landmark {k}");
            Ok((a.vertex(base, "base", &context)?, b.vertex(part, "part", &context)?))
        };
        let landmarks: Result<Vec<_>, MorphError> = self.landmarks.iter().enumerate().map(pair).collect();
        Ok(ComposeOptions {
            base: self.base.cut(base, "base")?,
            part: self.part.cut(part, "part")?,
            landmarks: landmarks?,
            band: self.band as usize,
        })
    }
}

impl CutEntry {
    fn cut(&self, mesh: &TriMesh, which: &'static str) -> Result<Cut, MorphError> {
        let line = |entry: &LineEntry| {
            let vertex =
                |(k, reference): (usize, &VertexRef)| reference.vertex(mesh, which, &format!("seam vertex {k}"));
            let vertices: Result<Vec<u32>, MorphError> = entry.vertices.iter().enumerate().map(vertex).collect();
            Ok::<_, MorphError>((vertices?, entry.keep.vertex(mesh, which, "keep")?))
        };
        Ok(match self {
            Self::Plane(PlaneEntry { point, normal }) => {
                Cut::Plane { point: Point3::from(*point), normal: Vector3::from(*normal) }
            }
            Self::Lasso(entry) => line(entry).map(|(vertices, keep)| Cut::Lasso { vertices, keep })?,
            Self::Loop(entry) => line(entry).map(|(vertices, keep)| Cut::Loop { vertices, keep })?,
            Self::Boundary(near) => Cut::Boundary { near: Point3::from(*near) },
        })
    }
}
