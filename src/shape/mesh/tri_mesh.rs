//! Triangle mesh as an indexed face set: vertex positions, and three vertex indices per triangle.
//!
//! Invariants: all coordinates are finite and all indices are in range. The mesh may be open, disconnected, non-manifold or
//! degenerate.

use nalgebra::{Point3, Vector3};

use super::MeshError;
use plumbline_num::math::Lists;

/// Indexed face set. The corners of a triangle are in counterclockwise order seen from outside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriMesh {
    positions: Vec<Point3<f64>>,
    triangles: Vec<[u32; 3]>,
}

impl TriMesh {
    /// A mesh of the given vertices and triangles.
    ///
    /// # Errors
    /// [`MeshError::TooManyVertices`] for more than `u32::MAX` vertices, [`MeshError::NotFinite`] with the first vertex that is
    /// not finite, [`MeshError::NoSuchVertex`] with the first index out of range.
    pub fn new(positions: Vec<Point3<f64>>, triangles: Vec<[u32; 3]>) -> Result<Self, MeshError> {
        let vertices = positions.len();
        if u32::try_from(vertices).is_err() {
            return Err(MeshError::TooManyVertices { vertices });
        }
        check_finite(&positions)?;
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= vertices) {
                return Err(MeshError::NoSuchVertex { triangle, vertex, vertices });
            }
        }
        Ok(Self { positions, triangles })
    }

    /// A mesh with the same connectivity and new vertex positions.
    ///
    /// # Errors
    /// [`MeshError::NotFinite`] for a NaN or infinite coordinate.
    ///
    /// # Panics
    /// If the number of positions differs from the number of vertices.
    pub fn with_positions(&self, positions: Vec<Point3<f64>>) -> Result<Self, MeshError> {
        assert_eq!(positions.len(), self.positions.len(), "one position per vertex");
        check_finite(&positions)?;
        Ok(Self { positions, triangles: self.triangles.clone() })
    }

    /// Positions of the vertices.
    pub fn positions(&self) -> &[Point3<f64>] {
        &self.positions
    }

    /// Vertex indices of the triangles.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Number of vertices, including isolated ones.
    pub fn vertex_count(&self) -> usize {
        self.positions.len()
    }

    /// Number of triangles.
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// Positions of a triangle's corners.
    #[inline]
    pub fn corners(&self, triangle: usize) -> [Point3<f64>; 3] {
        self.triangles[triangle].map(|v| self.positions[v as usize])
    }

    /// Area-weighted normal of a triangle, of length twice its area; zero if degenerate.
    #[inline]
    pub fn area_normal(&self, triangle: usize) -> Vector3<f64> {
        let [a, b, c] = self.corners(triangle);
        (b - a).cross(&(c - a))
    }

    /// Unit vertex normals: the area-weighted average of the incident triangle normals; zero where they cancel.
    pub fn vertex_normals(&self) -> Vec<Vector3<f64>> {
        let mut normals = vec![Vector3::zeros(); self.positions.len()];
        for (t, corners) in self.triangles.iter().enumerate() {
            let normal = self.area_normal(t);
            for &v in corners {
                normals[v as usize] += normal;
            }
        }
        for normal in &mut normals {
            *normal = normal.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
        }
        normals
    }

    /// Surface area, in squared units of the positions.
    pub fn area(&self) -> f64 {
        (0..self.triangles.len()).map(|t| 0.5 * self.area_normal(t).norm()).sum()
    }

    /// Signed volume enclosed by a closed, oriented surface (divergence theorem), computed about the center of the bounding box
    /// to avoid cancellation for a mesh far from the origin. Meaningless for an open surface.
    pub fn volume(&self) -> f64 {
        let Some((low, high)) = self.bounding_box() else { return 0.0 };
        let middle = nalgebra::center(&low, &high);
        let cone = |t: usize| {
            let [a, b, c] = self.corners(t).map(|p| p - middle);
            a.dot(&b.cross(&c))
        };
        (0..self.triangles.len()).map(cone).sum::<f64>() / 6.0
    }

    /// The triangles around each vertex, ascending.
    pub fn triangles_of_vertices(&self) -> Lists<u32> {
        let corners = (0..).zip(&self.triangles).flat_map(|(t, corners)| corners.map(|v| (v, t)));
        Lists::new(self.positions.len(), corners)
    }

    /// The vertices of triangles, ascending, and the isolated ones, which are in no triangle.
    pub fn referenced_and_isolated(&self) -> (Vec<u32>, Vec<u32>) {
        let mut referenced = vec![false; self.positions.len()];
        self.triangles.iter().flatten().for_each(|&v| referenced[v as usize] = true);
        (0..referenced.len() as u32).partition(|&v| referenced[v as usize])
    }

    /// The mesh of some vertices, ascending, and triangles over them, given by their vertices in this mesh.
    ///
    /// # Panics
    /// If a triangle has another vertex.
    #[must_use]
    pub fn restricted(&self, vertices: &[u32], triangles: impl IntoIterator<Item = [u32; 3]>) -> Self {
        let mut number = vec![u32::MAX; self.positions.len()];
        vertices.iter().zip(0..).for_each(|(&v, k)| number[v as usize] = k);
        let positions = vertices.iter().map(|&v| self.positions[v as usize]).collect();
        let triangles = triangles.into_iter().map(|t| t.map(|v| number[v as usize])).collect();
        Self::new(positions, triangles).expect("part of a mesh")
    }

    /// Axis-aligned bounding box as its minimum and maximum corners; `None` without vertices.
    pub fn bounding_box(&self) -> Option<(Point3<f64>, Point3<f64>)> {
        let first = *self.positions.first()?;
        Some(self.positions.iter().fold((first, first), |(low, high), p| (low.inf(p), high.sup(p))))
    }

    /// Length of the bounding box diagonal: the reference length of scale-invariant tolerances.
    pub fn diagonal(&self) -> f64 {
        self.bounding_box().map_or(0.0, |(low, high)| (high - low).norm())
    }
}

pub(super) fn is_finite(position: &Point3<f64>) -> bool {
    position.iter().all(|c| c.is_finite())
}

/// Rejects NaN and infinite coordinates; the error has the first such vertex.
fn check_finite(positions: &[Point3<f64>]) -> Result<(), MeshError> {
    match positions.iter().position(|p| !is_finite(p)) {
        None => Ok(()),
        Some(vertex) => {
            let [x, y, z] = positions[vertex].coords.into();
            Err(MeshError::NotFinite { vertex, x, y, z })
        }
    }
}

/// One-ring neighbors of each of `vertices` vertices, ascending; the triangles may be non-manifold.
pub fn neighbors_of_vertices(vertices: usize, triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let mut rings = vec![Vec::new(); vertices];
    for &[a, b, c] in triangles {
        for (i, j) in [(a, b), (b, c), (c, a)] {
            rings[i as usize].push(j);
            rings[j as usize].push(i);
        }
    }
    for ring in &mut rings {
        ring.sort_unstable();
        ring.dedup();
    }
    rings
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron(at: Vector3<f64>) -> TriMesh {
        let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        TriMesh::new(positions.map(|p| Point3::from(p) + at).to_vec(), triangles).expect("valid")
    }

    #[test]
    fn a_corner_tetrahedron_has_its_area_and_volume_wherever_it_stands() {
        for at in [Vector3::zeros(), Vector3::new(1e6, -2e6, 3e6)] {
            let mesh = tetrahedron(at);
            assert!((mesh.area() - (1.5 + 0.75_f64.sqrt())).abs() < 1e-8);
            assert!((mesh.volume() - 1.0 / 6.0).abs() < 1e-8);
            assert!((mesh.diagonal() - 3.0_f64.sqrt()).abs() < 1e-8);
        }
    }

    #[test]
    fn the_faulty_vertex_is_named() {
        let mut positions = tetrahedron(Vector3::zeros()).positions().to_vec();
        positions[2].y = f64::NAN;
        assert!(matches!(TriMesh::new(positions, vec![]), Err(MeshError::NotFinite { vertex: 2, .. })));
        let beyond = TriMesh::new(vec![Point3::origin(); 3], vec![[0, 1, 2], [0, 1, 3]]);
        assert_eq!(beyond, Err(MeshError::NoSuchVertex { triangle: 1, vertex: 3, vertices: 3 }));
    }

    #[test]
    fn normals_point_away_and_are_units() {
        let mesh = tetrahedron(Vector3::zeros());
        let middle = mesh.positions().iter().map(|p| p.coords).sum::<Vector3<f64>>() / 4.0;
        for (p, n) in mesh.positions().iter().zip(mesh.vertex_normals()) {
            assert!((n.norm() - 1.0).abs() < 1e-12 && n.dot(&(p.coords - middle)) > 0.0);
        }
        assert_eq!(
            TriMesh::new(vec![Point3::origin(); 3], vec![[0, 1, 2]]).expect("valid").vertex_normals()[0],
            Vector3::zeros()
        );
    }
}
