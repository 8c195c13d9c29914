//! Repairs triangle soups to oriented manifolds and reports the changes.
//!
//! In this order: equal vertices are joined; triangles that name a vertex twice go, and of equal triangles all but the first;
//! triangles without area are taken out so that no crack stays (short edges collapse, long ones flip); at each edge two triangles
//! are made neighbors; neighbors are oriented alike, closed parts outward; vertices are split until each has one fan. Where a surface
//! cannot be oriented it is cut open.
//!
//! What lies in the same place of two meshes that differ by a similarity is treated the same way, and numbers of vertices tell
//! which vertex of the input each one was, so that a deformation of the result can be carried back to the input.

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

/// Which vertices become one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Weld {
    /// None.
    Never,
    /// Those with equal coordinates: what soups, STL files and texture seams need. It never joins what was apart.
    #[default]
    Exact,
    /// Those within this fraction of the diagonal of the box of all named vertices, and chains of such.
    Within(f64),
}

/// What repair takes for a fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RepairOptions {
    /// Which vertices become one.
    pub weld: Weld,
    /// Height of a triangle, relative to its longest side, up to which it counts as degenerate. Cotangents reach its inverse:
    /// larger values take out more needles, below 10⁻⁸ nothing but noise of 32-bit coordinates is left to keep.
    pub flat: f64,
}

impl Default for RepairOptions {
    fn default() -> Self {
        Self { weld: Weld::default(), flat: 1e-8 }
    }
}

/// A repaired mesh and how it came about.
#[derive(Clone, Debug, PartialEq)]
pub struct Repaired {
    /// Oriented, manifold, without degenerate or equal triangles; every vertex is named by one.
    pub mesh: TriMesh,
    /// What was done, and what the result is.
    pub report: RepairReport,
    /// For each vertex of the result the vertex of the input that it was.
    pub source_of_vertex: Vec<u32>,
    /// For each vertex of the input the vertex of the result that it became; `None` where nothing is left of it.
    pub vertex_of_source: Vec<Option<u32>>,
    /// For each corner of the result the corner of the input, `3t + k`, that it replaces.
    pub source_corners: Vec<[u32; 3]>,
    /// Number of the component of each vertex, as in [`RepairReport::components`].
    pub component_of_vertex: Vec<u32>,
}

impl Repaired {
    /// Positions of the input after the result's vertices have moved to `moved`. What nothing is left of stays.
    ///
    /// # Panics
    /// Where there are not as many positions as vertices.
    pub fn carry_back(&self, source: &TriMesh, moved: &[Point3<f64>]) -> Vec<Point3<f64>> {
        assert_eq!(moved.len(), self.source_of_vertex.len(), "one position per vertex of the repaired mesh");
        let place = |(vertex, position): (&Option<u32>, &Point3<f64>)| vertex.map_or(*position, |v| moved[v as usize]);
        self.vertex_of_source.iter().zip(source.positions()).map(place).collect()
    }
}

/// Triangles in the making: corners of the input, whose vertices have been joined.
struct Soup<'a> {
    mesh: &'a TriMesh,
    /// Representative of each input vertex: the lowest vertex that was welded with it.
    joined: UnionFind,
    /// Three corners `3t + k` of the input per triangle.
    corners: Vec<[u32; 3]>,
}

impl Soup<'_> {
    /// The vertex of the input at a corner of the input.
    fn source(&self, corner: u32) -> u32 {
        self.mesh.triangles()[corner as usize / 3][corner as usize % 3]
    }

    /// The joined vertex at a corner of the input.
    fn vertex(&self, corner: u32) -> u32 {
        self.joined.root(self.source(corner))
    }

    fn vertices(&self, triangle: usize) -> [u32; 3] {
        self.corners[triangle].map(|corner| self.vertex(corner))
    }

    fn position(&self, vertex: u32) -> Point3<f64> {
        self.mesh.positions()[vertex as usize]
    }

    /// Removes triangles with a repeated corner; the triangles of the input that they were.
    fn drop_collapsed(&mut self) -> Vec<u32> {
        let dead: Vec<bool> = (0..self.corners.len())
            .map(|t| {
                let [a, b, c] = self.vertices(t);
                a == b || b == c || c == a
            })
            .collect();
        self.drop_dead(&dead)
    }

    /// Removes all but the first of triangles with equal vertices, whatever their orientation.
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
/// [`Stopped`].
pub fn repair(mesh: &TriMesh, options: &RepairOptions, run: &Run) -> Result<Repaired, Stopped> {
    let mut report = RepairReport {
        vertices_before: mesh.vertex_count(),
        triangles_before: mesh.triangle_count(),
        ..RepairReport::default()
    };
    report.unreferenced = unreferenced(mesh);
    let joined = weld::join(mesh, options.weld, &report.unreferenced, run)?;
    report.welded = joined.joined();
    let corners = (0..mesh.triangle_count() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let mut soup = Soup { mesh, joined, corners };
    run.check()?;
    report.collapsed = soup.drop_collapsed();
    report.duplicates = soup.drop_duplicates();
    flat::remove(&mut soup, options.flat, &mut report, run)?;
    sheets::finish(&soup, report, run)
}

fn unreferenced(mesh: &TriMesh) -> Vec<u32> {
    let mut named = vec![false; mesh.vertex_count()];
    mesh.triangles().iter().flatten().for_each(|&v| named[v as usize] = true);
    (0..named.len() as u32).filter(|&v| !named[v as usize]).collect()
}

#[cfg(test)]
mod tests;
