//! Statistics of a triangle soup before repair.

use std::fmt;

use serde::Serialize;

use super::report::{components, negative_cotangents};
use crate::mesh::TriMesh;
use crate::mesh::half_edges::edge_groups;

/// Counts and measures of an unmodified mesh.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct MeshFacts {
    /// Number of vertices.
    pub vertices: usize,
    /// Number of triangles.
    pub triangles: usize,
    /// Number of edges.
    pub edges: usize,
    /// Boundary edges: one incident triangle.
    pub boundary_edges: usize,
    /// Non-manifold edges: more than two incident triangles.
    pub non_manifold_edges: usize,
    /// Edges with two incident triangles of inconsistent orientation.
    pub inconsistent_edges: usize,
    /// Connected components, over common vertices.
    pub components: usize,
    /// Euler characteristic V − E + F, over the referenced vertices.
    pub euler: isize,
    /// Minimum corner of the bounding box; `None` without vertices.
    pub low: Option<[f64; 3]>,
    /// Maximum corner of the bounding box.
    pub high: Option<[f64; 3]>,
    /// Area, squared units of the positions.
    pub area: f64,
    /// Enclosed volume; `None` unless closed and oriented.
    pub volume: Option<f64>,
    /// Corners with an angle above 90°.
    pub obtuse_corners: usize,
    /// Edges whose cotangent weight is negative.
    pub negative_weights: usize,
}

impl MeshFacts {
    /// Surveys a mesh.
    pub fn of(mesh: &TriMesh) -> Self {
        let origins = mesh.triangles().as_flattened();
        let mut facts = Self { vertices: mesh.vertex_count(), triangles: mesh.triangle_count(), ..Self::default() };
        // Edge statistics.
        for edge in edge_groups(origins).iter() {
            facts.edges += 1;
            match edge {
                [_] => facts.boundary_edges += 1,
                [(_, g), (_, h)] => {
                    facts.inconsistent_edges += usize::from(origins[*g as usize] == origins[*h as usize]);
                }
                _ => facts.non_manifold_edges += 1,
            }
        }
        // Components and Euler characteristic; isolated vertices do not count.
        let parts = components(mesh).1;
        let named: usize = parts.iter().filter(|part| part.triangles > 0).map(|part| part.vertices).sum();
        facts.components = parts.iter().filter(|part| part.triangles > 0).count();
        facts.euler = named.cast_signed() - facts.edges.cast_signed() + facts.triangles.cast_signed();
        (facts.low, facts.high) = mesh.bounding_box().map(|(low, high)| (low.into(), high.into())).unzip();
        facts.area = mesh.area();
        let closed =
            facts.boundary_edges + facts.non_manifold_edges + facts.inconsistent_edges == 0 && facts.triangles > 0;
        facts.volume = closed.then(|| mesh.volume());
        (facts.obtuse_corners, facts.negative_weights) = negative_cotangents(mesh);
        facts
    }
}

impl fmt::Display for MeshFacts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} vertices, {} triangles, {} edges", self.vertices, self.triangles, self.edges)?;
        let s = if self.components == 1 { "" } else { "s" };
        write!(f, "{} component{s}, Euler number {}", self.components, self.euler)?;
        match (self.boundary_edges, self.non_manifold_edges, self.inconsistent_edges) {
            (0, 0, 0) => writeln!(f, ", closed and oriented")?,
            (open, crowded, turned) => {
                writeln!(
                    f,
                    ", {open} boundary edges, {crowded} non-manifold edges, {turned} edges between turned triangles"
                )?;
            }
        }
        if let (Some([x0, y0, z0]), Some([x1, y1, z1])) = (self.low, self.high) {
            writeln!(f, "box ({x0}, {y0}, {z0}) to ({x1}, {y1}, {z1})")?;
        }
        write!(f, "area {:.6}", self.area)?;
        if let Some(volume) = self.volume {
            write!(f, ", volume {volume:.6}")?;
        }
        write!(
            f,
            "\n{} obtuse corners, {} edges with negative cotangent weight",
            self.obtuse_corners, self.negative_weights
        )
    }
}
