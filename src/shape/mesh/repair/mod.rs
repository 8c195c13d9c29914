//! Repairs triangle soups to oriented manifolds and reports the changes.
//!
//! Steps, in this order:
//!
//! 1. Weld coincident vertices.
//! 2. Remove triangles with a repeated vertex, and duplicates except the first.
//! 3. Remove triangles of zero area without leaving a crack: short edges collapse, long edges flip.
//! 4. Pair two triangles at each edge.
//! 5. Orient adjacent triangles consistently and closed components outwards; non-orientable surfaces are cut open.
//! 6. Split vertices until each has one fan.
//!
//! The result is invariant under similarity transforms of the input. Index maps relate the vertices of the result to those of
//! the input, so that a deformation of the result can be transferred back to the input.
//!
//! # Reference
//! M. Botsch, L. Kobbelt, M. Pauly, P. Alliez, B. Lévy, *Polygon Mesh Processing*, 2010, chapter 8.

mod flat;
mod report;
mod sheets;
mod survey;
mod weld;

use nalgebra::Point3;

use super::TriMesh;
use plumbline_num::run::{Run, Stopped};
use plumbline_num::spatial::UnionFind;

pub use report::{BoundaryLoop, Component, RepairReport};
pub use survey::MeshFacts;

/// Which vertices are welded.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Weld {
    /// None.
    Never,
    /// Vertices with equal coordinates, as triangle soups, STL files and texture seams require. Never joins distinct positions.
    #[default]
    Exact,
    /// Those, and vertices at open edges within this fraction of the shortest edge at either, as triangles and parts require whose corners
    /// were rounded one by one. Sizes of the mesh and of its triangles do not matter.
    Gaps(f64),
    /// Vertices within this fraction of the bounding box diagonal of all referenced vertices, and chains of such vertices.
    Within(f64),
}

impl Weld {
    /// A hundredth of an edge: what is that narrow beside the edges around it is no shape.
    pub const GAPS: Self = Self::Gaps(0.01);
}

/// Thresholds of mesh repair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RepairOptions {
    /// Which vertices are welded.
    pub weld: Weld,
    /// Maximum ratio of the height of a degenerate triangle to its longest edge; default 10⁻⁸. Cotangents reach the inverse of
    /// it: larger values remove more needles, below 10⁻⁸ only noise of 32-bit coordinates remains.
    pub flat: f64,
}

impl Default for RepairOptions {
    fn default() -> Self {
        Self { weld: Weld::default(), flat: 1e-8 }
    }
}

/// A repaired mesh, the report, and the index maps to the input.
#[derive(Clone, Debug, PartialEq)]
pub struct Repaired {
    /// Oriented and manifold, without degenerate or duplicate triangles and without isolated vertices.
    pub mesh: TriMesh,
    /// The changes, and properties of the result.
    pub report: RepairReport,
    /// Source vertex in the input of each vertex of the result.
    pub source_of_vertex: Vec<u32>,
    /// Vertex of the result for each vertex of the input; `None` if it was removed.
    pub vertex_of_source: Vec<Option<u32>>,
    /// Source corner `3t + k` in the input of each corner of the result.
    pub source_corners: Vec<[u32; 3]>,
    /// Component index of each vertex, as in [`RepairReport::components`].
    pub component_of_vertex: Vec<u32>,
}

impl Repaired {
    /// Positions of the input vertices when those of the result move to `moved`. Removed vertices keep their positions.
    ///
    /// # Panics
    /// If the number of positions differs from the number of vertices of the result.
    pub fn carry_back(&self, source: &TriMesh, moved: &[Point3<f64>]) -> Vec<Point3<f64>> {
        assert_eq!(moved.len(), self.source_of_vertex.len(), "one position per vertex of the repaired mesh");
        let current =
            |(vertex, position): (&Option<u32>, &Point3<f64>)| vertex.map_or(*position, |v| moved[v as usize]);
        self.vertex_of_source.iter().zip(source.positions()).map(current).collect()
    }
}

/// Triangle soup under repair: triangles over corners of the input, and the welded vertices as a union–find structure.
struct Soup<'a> {
    mesh: &'a TriMesh,
    /// Representative of each input vertex: the lowest vertex of its welded set.
    joined: UnionFind,
    /// Three input corners `3t + k` per remaining triangle.
    corners: Vec<[u32; 3]>,
}

impl Soup<'_> {
    /// The input vertex of an input corner.
    fn source(&self, corner: u32) -> u32 {
        self.mesh.triangles()[corner as usize / 3][corner as usize % 3]
    }

    /// The welded vertex of an input corner.
    fn vertex(&self, corner: u32) -> u32 {
        self.joined.root(self.source(corner))
    }

    fn vertices(&self, triangle: usize) -> [u32; 3] {
        self.corners[triangle].map(|corner| self.vertex(corner))
    }

    fn position(&self, vertex: u32) -> Point3<f64> {
        self.mesh.positions()[vertex as usize]
    }

    /// Removes triangles with a repeated vertex; returns their input triangles.
    fn drop_collapsed(&mut self) -> Vec<u32> {
        let dead: Vec<bool> = (0..self.corners.len())
            .map(|t| {
                let [a, b, c] = self.vertices(t);
                a == b || b == c || c == a
            })
            .collect();
        self.drop_dead(&dead)
    }

    /// Removes all but the first of the triangles with equal vertices, regardless of orientation; returns their input
    /// triangles.
    fn drop_duplicates(&mut self) -> Vec<u32> {
        let key = |t: usize| {
            let mut vertices = self.vertices(t);
            vertices.sort_unstable();
            (vertices, t)
        };
        let mut keys: Vec<_> = (0..self.corners.len()).map(key).collect();
        keys.sort_unstable();
        let mut dead = vec![false; self.corners.len()];
        for pair in keys.windows(2) {
            dead[pair[1].1] = pair[0].0 == pair[1].0;
        }
        self.drop_dead(&dead)
    }

    /// Removes the flagged triangles; returns their input triangles.
    fn drop_dead(&mut self, dead: &[bool]) -> Vec<u32> {
        let gone = (0..dead.len()).filter(|&t| dead[t]).map(|t| self.corners[t][0] / 3).collect();
        let mut flags = dead.iter();
        self.corners.retain(|_| !flags.next().expect("one flag per triangle"));
        gone
    }
}

/// Repairs a mesh.
///
/// # Errors
/// [`Stopped`] if the run is interrupted.
pub fn repair(mesh: &TriMesh, options: &RepairOptions, run: &Run) -> Result<Repaired, Stopped> {
    let mut report = RepairReport {
        vertices_before: mesh.vertex_count(),
        triangles_before: mesh.triangle_count(),
        ..RepairReport::default()
    };
    (_, report.unreferenced) = mesh.referenced_and_isolated();
    // Step 1: weld.
    let (joined, bridged) = weld::join(mesh, options.weld, &report.unreferenced, run)?;
    (report.welded, report.bridged) = (joined.joined(), bridged);
    let corners = (0..mesh.triangle_count() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let mut soup = Soup { mesh, joined, corners };
    run.check()?;
    // Steps 2 and 3: degenerate and duplicate triangles.
    report.collapsed = soup.drop_collapsed();
    report.duplicates = soup.drop_duplicates();
    flat::remove(&mut soup, options.flat, &mut report, run)?;
    // Steps 4 to 6: pairing, orientation, vertex splits.
    sheets::finish(&soup, report, run)
}

#[cfg(test)]
mod tests;
