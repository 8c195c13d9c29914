//! Buffers for the page: positions relative to the center of the mesh, so that 32-bit numbers hold a mesh far from its origin.

use nalgebra::{Point3, Vector3};
use serde::Serialize;

use plumbline_shape::mesh::TriMesh;
use plumbline_shape::surface::SolvableMesh;

/// Kinds of buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[repr(u32)]
pub enum BufferKind {
    /// Three `u32` per triangle of the file.
    Triangles = 100,
    /// Per vertex of the file three `f32`, relative to the center; then per vertex four `i16`: the normal, 32767 for 1, and zero.
    Positions = 101,
    /// One `f32` per vertex: the overlay.
    Scalars = 102,
    /// `u32`: the selected vertices, ascending.
    Selection = 103,
    /// One `u16` per vertex: 1 + its handle, 0 for none, 65535 outside the region.
    Owners = 104,
    /// `f32`: energies of the running solve.
    Energies = 105,
    /// As positions: the pose of one frame, the item.
    Frame = 106,
}

impl BufferKind {
    /// Its number in the header of a buffer.
    pub fn number(self) -> u32 {
        self as u32
    }
}

/// What is the same for all poses of a mesh.
#[derive(Debug)]
pub struct Encoder {
    /// Center of the bounding box at rest.
    pub center: Point3<f64>,
    /// Of the vertices of the file: the vertex of the surface that they became, or [`GONE`].
    vertex_of_source: Vec<u32>,
    /// Rest positions of those of which nothing is left, relative to the center.
    gone: Vec<(u32, [f32; 3])>,
    normals: Vec<[f32; 3]>,
    packed: Vec<[i16; 4]>,
}

const GONE: u32 = u32::MAX;

impl Encoder {
    /// For a mesh and its surface.
    pub fn new(mesh: &TriMesh, solvable: &SolvableMesh) -> Self {
        let center = mesh.bounding_box().map_or(Point3::origin(), |(low, high)| nalgebra::center(&low, &high));
        let vertex_of_source = solvable.vertex_of_source.iter().map(|v| v.unwrap_or(GONE)).collect::<Vec<_>>();
        let is_gone = |v: &usize| vertex_of_source[*v] == GONE;
        let gone = (0..vertex_of_source.len()).filter(is_gone);
        let gone = gone.map(|v| (v as u32, relative(&mesh.positions()[v], &center))).collect();
        Self { center, vertex_of_source, gone, normals: Vec::new(), packed: Vec::new() }
    }

    /// The payload of [`BufferKind::Positions`] for positions of the surface.
    pub fn positions(&mut self, solvable: &SolvableMesh, positions: &[Point3<f64>]) -> Vec<u8> {
        self.pack_normals(solvable.mesh.triangles(), positions);
        let count = self.vertex_of_source.len();
        let mut bytes = vec![0_u8; 20 * count];
        let (points, normals) = bytes.split_at_mut(12 * count);
        let mut gone = self.gone.iter();
        let each = self.vertex_of_source.iter().zip(points.chunks_exact_mut(12)).zip(normals.chunks_exact_mut(8));
        for ((&at, point), normal) in each {
            let (p, n) = match at {
                GONE => (gone.next().map_or([0.0; 3], |g| g.1), [0; 4]),
                at => (relative(&positions[at as usize], &self.center), self.packed[at as usize]),
            };
            point.copy_from_slice(bytemuck::bytes_of(&p));
            normal.copy_from_slice(bytemuck::bytes_of(&n));
        }
        bytes
    }

    /// Normals of the surface, weighted by area.
    fn pack_normals(&mut self, triangles: &[[u32; 3]], positions: &[Point3<f64>]) {
        self.normals.clear();
        self.normals.resize(positions.len(), [0.0; 3]);
        for t in triangles {
            let [a, b, c] = t.map(|v| positions[v as usize]);
            let n = (b - a).cross(&(c - a));
            for &v in t {
                let sum = &mut self.normals[v as usize];
                (0..3).for_each(|k| sum[k] += n[k] as f32);
            }
        }
        self.packed.clear();
        self.packed.extend(self.normals.iter().map(|n| {
            let n = Vector3::from(*n);
            let scale = 32767.0 / n.norm().max(f32::MIN_POSITIVE);
            [(n.x * scale) as i16, (n.y * scale) as i16, (n.z * scale) as i16, 0]
        }));
    }

    /// Values of the surface's vertices for those of the file; NaN for those of which nothing is left.
    pub fn scalars(&self, values: &[f64]) -> Vec<f32> {
        let value = |at: &u32| values.get(*at as usize).map_or(f32::NAN, |v| *v as f32);
        self.vertex_of_source.iter().map(value).collect()
    }
}

fn relative(p: &Point3<f64>, center: &Point3<f64>) -> [f32; 3] {
    let d = p - center;
    [d.x as f32, d.y as f32, d.z as f32]
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_num::run::Run;
    use plumbline_shape::mesh::shapes;

    fn decoded(bytes: &[u8], count: usize) -> (Vec<[f32; 3]>, Vec<[i16; 4]>) {
        let points = bytes[..12 * count].chunks_exact(12).map(bytemuck::pod_read_unaligned).collect();
        (points, bytes[12 * count..].chunks_exact(8).map(bytemuck::pod_read_unaligned).collect())
    }

    #[test]
    fn a_mesh_far_from_its_origin_keeps_its_shape_in_32_bits() {
        let ball = shapes::icosphere(3);
        let far = Vector3::new(1e6, -2e6, 3e6);
        let moved = ball.with_positions(ball.positions().iter().map(|p| p + far).collect()).unwrap();
        let solvable = SolvableMesh::new(&moved, &Run::default()).unwrap();
        let mut encoder = Encoder::new(&moved, &solvable);
        let (points, normals) = decoded(&encoder.positions(&solvable, solvable.mesh.positions()), moved.vertex_count());
        for ((p, n), expected) in points.iter().zip(&normals).zip(ball.positions()) {
            let p = Vector3::from(*p).map(f64::from);
            assert!((p - expected.coords).norm() < 1e-6, "{p} {expected}");
            let n = Vector3::new(n[0], n[1], n[2]).map(f64::from) / 32767.0;
            assert!((n - expected.coords).norm() < 0.05, "the normal of a ball is its radius");
        }
    }

    #[test]
    fn vertices_on_no_triangle_stay_where_they_are() {
        let ball = shapes::icosphere(0);
        let mut positions = ball.positions().to_vec();
        positions.push(Point3::new(0.5, 0.25, 0.0));
        let mesh = TriMesh::new(positions, ball.triangles().to_vec()).unwrap();
        let solvable = SolvableMesh::new(&mesh, &Run::default()).unwrap();
        let mut encoder = Encoder::new(&mesh, &solvable);
        let (points, _) = decoded(&encoder.positions(&solvable, solvable.mesh.positions()), 13);
        let expected = relative(&Point3::new(0.5, 0.25, 0.0), &encoder.center);
        assert_eq!(points[12], expected);
        assert!(encoder.scalars(&[1.0; 12])[12].is_nan());
    }
}
