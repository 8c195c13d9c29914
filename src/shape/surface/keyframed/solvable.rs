//! The mesh that is deformed instead of the one that was read.
//!
//! Repair takes sheets apart where more than two meet, and a sheet that no handle is on would then stay while the others
//! move: the surface would tear. The operators of deformation sum over triangles and need no manifold, so the copies of
//! a vertex are joined again; what is left of the repair is that nothing is degenerate, double or apart at one position.

use std::collections::HashMap;

use nalgebra::Point3;

use crate::mesh::{RepairOptions, RepairReport, Repaired, TriMesh, repair};
use plumbline_num::run::{Run, Stopped};

/// A mesh without faults that hinder a solve, and where its vertices come from.
///
/// ```
/// use plumbline_num::run::Run;
/// use plumbline_shape::mesh::shapes;
/// use plumbline_shape::surface::SolvableMesh;
///
/// let soup = shapes::soup(&shapes::book(4)); // every triangle has vertices of its own
/// let solvable = SolvableMesh::new(&soup, &Run::default())?;
/// assert!(solvable.mesh.vertex_count() < soup.vertex_count());
/// # Ok::<(), plumbline_num::run::Stopped>(())
/// ```
#[derive(Clone, Debug)]
pub struct SolvableMesh {
    /// The mesh that is deformed: one vertex per position.
    pub mesh: TriMesh,
    /// What repair did.
    pub report: RepairReport,
    /// For each of its vertices the vertex of the file that it was.
    pub source_of_vertex: Vec<u32>,
    /// For each vertex of the file the vertex that it became; `None` where nothing is left of it.
    pub vertex_of_source: Vec<Option<u32>>,
}

impl SolvableMesh {
    /// Repairs a mesh with the default options and joins the copies of its vertices.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn new(mesh: &TriMesh, run: &Run) -> Result<Self, Stopped> {
        let Repaired { mesh, report, source_of_vertex: source, vertex_of_source, .. } =
            repair(mesh, &RepairOptions::default(), run)?;
        // Repair welds what is exactly at one position and moves nothing: copies are known by their position, in a soup too, where
        // each may come from another vertex of the file. Adding zero makes one of the two zeros.
        let mut number: HashMap<[u64; 3], u32> = HashMap::new();
        let (mut joined, mut source_of_vertex, mut positions) = (Vec::new(), Vec::new(), Vec::new());
        for (&source, &position) in source.iter().zip(mesh.positions()) {
            let key = position.coords.map(|c| (c + 0.0).to_bits());
            let vertex = *number.entry(key.into()).or_insert(positions.len() as u32);
            joined.push(vertex);
            if vertex as usize == positions.len() {
                positions.push(position);
                source_of_vertex.push(source);
            }
        }
        let triangles = mesh.triangles().iter().map(|t| t.map(|v| joined[v as usize])).collect();
        let mesh = TriMesh::new(positions, triangles).expect("positions and triangles of a mesh that was repaired");
        let vertex_of_source = vertex_of_source.into_iter().map(|v| v.map(|v| joined[v as usize])).collect();
        Ok(Self { mesh, report, source_of_vertex, vertex_of_source })
    }

    /// Positions of the file's vertices after this mesh's have moved. What nothing is left of stays at `rest`.
    pub fn carry_back(&self, rest: &[Point3<f64>], moved: &[Point3<f64>]) -> Vec<Point3<f64>> {
        let position = |(vertex, rest): (&Option<u32>, &Point3<f64>)| vertex.map_or(*rest, |v| moved[v as usize]);
        self.vertex_of_source.iter().zip(rest).map(position).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn sheets_that_meet_in_an_edge_stay_together_and_soups_become_surfaces() {
        for mesh in [shapes::book(5), shapes::hourglass(), shapes::soup(&shapes::book(4))] {
            let solvable = SolvableMesh::new(&mesh, &Run::default()).unwrap();
            let mut positions: Vec<_> = mesh.positions().iter().map(|p| p.coords.map(f64::to_bits)).collect();
            positions.sort_unstable_by_key(|p| [p.x, p.y, p.z]);
            positions.dedup();
            assert_eq!(solvable.mesh.vertex_count(), positions.len(), "one vertex per position");
            assert_eq!(solvable.mesh.triangle_count(), mesh.triangle_count());
            assert_eq!(solvable.carry_back(mesh.positions(), solvable.mesh.positions()), mesh.positions());
            for (v, source) in solvable.source_of_vertex.iter().enumerate() {
                assert_eq!(solvable.vertex_of_source[*source as usize], Some(v as u32));
            }
        }
    }
}
