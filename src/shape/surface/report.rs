//! What a deformation did to the surface.

use nalgebra::Point3;

use super::Part;
use crate::mesh::TriMesh;

/// Why an iteration ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The energy stood still by the criterion.
    Converged,
    /// The iterations ran out first.
    IterationsUsedUp,
    /// One solve gives the minimizer.
    Solved,
}

impl Stop {
    /// True where nothing is left to gain by the criterion asked for.
    pub fn converged(self) -> bool {
        self != Self::IterationsUsedUp
    }
}

impl std::fmt::Display for Stop {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Converged => "converged",
            Self::IterationsUsedUp => "iterations used up",
            Self::Solved => "solved",
        })
    }
}

/// How a deformation went.
#[derive(Clone, Debug, PartialEq)]
pub struct DeformReport {
    /// Global solves done.
    pub iterations: usize,
    /// Energy at the start and after each iteration; squared mesh units for elastic energies.
    pub energies: Vec<f64>,
    /// Why it ended.
    pub stop: Stop,
    /// Largest distance of a held vertex from its target, mesh units: 0 for exact handles.
    pub constraint_error: f64,
    /// Shape against rest.
    pub shape: ShapeChange,
    /// Edges with a negative weight, where the energy has any.
    pub negative_weights: usize,
    /// Triangles that were weighted as equilateral ones because they have no area.
    pub degenerate_faces: usize,
    /// Parts of the surface without a handle: they stayed where they were.
    pub held_still: Vec<Part>,
}

/// How a surface differs from itself at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShapeChange {
    /// Largest relative change of the length of an edge.
    pub worst_stretch: f64,
    /// Root of the mean squared relative change of all edges.
    pub rms_stretch: f64,
    /// Faces that point against the surface around them and did not at rest.
    pub flipped_faces: usize,
    /// Volume over that at rest; none for a surface that is open or encloses nothing.
    pub volume_ratio: Option<f64>,
}

/// A surface at rest, ready to be compared with what becomes of it.
#[derive(Clone, Debug)]
pub struct Gauge {
    rest: TriMesh,
    /// Edges of some length, and that length.
    edges: Vec<([u32; 2], f64)>,
    against: Vec<bool>,
    volume: Option<f64>,
}

/// A volume below this fraction of the cubed diagonal is rounding: of a sheet, or of a surface that encloses itself twice.
const NO_VOLUME: f64 = 1e-9;

impl Gauge {
    /// A gauge of this surface at rest.
    pub fn new(mesh: &TriMesh) -> Self {
        let mut sides: Vec<(u32, u32, bool)> = Vec::with_capacity(3 * mesh.triangle_count());
        for &[a, b, c] in mesh.triangles() {
            sides.extend([(a, b), (b, c), (c, a)].map(|(i, j)| (i.min(j), i.max(j), i < j)));
        }
        sides.sort_unstable();
        let closed =
            sides.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).all(|e| e.iter().filter(|s| s.2).count() * 2 == e.len());
        sides.dedup_by_key(|s| (s.0, s.1));
        let p = mesh.positions();
        let length = |i: u32, j: u32| (p[i as usize] - p[j as usize]).norm();
        let edges = sides.iter().map(|&(i, j, _)| ([i, j], length(i, j))).filter(|e| e.1 > 0.0).collect();
        let volume = mesh.volume();
        let encloses = closed && volume.abs() > NO_VOLUME * mesh.diagonal().powi(3);
        Self { edges, against: against_neighbors(mesh), volume: encloses.then_some(volume), rest: mesh.clone() }
    }

    /// The surface at rest.
    pub fn rest(&self) -> &TriMesh {
        &self.rest
    }

    /// What changed. The positions must be finite, one per vertex.
    pub fn measure(&self, positions: &[Point3<f64>]) -> ShapeChange {
        let Ok(mesh) = self.rest.with_positions(positions.to_vec()) else {
            return ShapeChange { worst_stretch: f64::NAN, rms_stretch: f64::NAN, ..Default::default() };
        };
        let stretches = self
            .edges
            .iter()
            .map(|&([i, j], rest)| ((positions[i as usize] - positions[j as usize]).norm() / rest - 1.0).abs());
        let (worst, squares) = stretches.fold((0.0, 0.0), |(worst, sum): (f64, f64), s| (worst.max(s), sum + s * s));
        let flipped = against_neighbors(&mesh).into_iter().zip(&self.against).filter(|&(now, &before)| now && !before);
        ShapeChange {
            worst_stretch: worst,
            rms_stretch: (squares / self.edges.len().max(1) as f64).sqrt(),
            flipped_faces: flipped.count(),
            volume_ratio: self.volume.map(|v| mesh.volume() / v),
        }
    }
}

/// Faces whose normal points against the sum of their corners' normals.
fn against_neighbors(mesh: &TriMesh) -> Vec<bool> {
    let normals = mesh.vertex_normals();
    let against = |(t, v): (usize, &[u32; 3])| {
        let around = v.iter().fold(nalgebra::Vector3::zeros(), |sum, &v| sum + normals[v as usize]);
        mesh.area_normal(t).dot(&around) < 0.0
    };
    mesh.triangles().iter().enumerate().map(against).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn box_mesh() -> TriMesh {
        let positions = (0..8).map(|v| Point3::new((v & 1) as f64, (v >> 1 & 1) as f64, (v >> 2) as f64)).collect();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        TriMesh::new(positions, triangles).unwrap()
    }

    #[test]
    fn a_stretched_box_is_longer_and_larger_by_the_stretch() {
        let mesh = box_mesh();
        let gauge = Gauge::new(&mesh);
        let same = gauge.measure(mesh.positions());
        assert_eq!((same.worst_stretch, same.flipped_faces), (0.0, 0));
        let stretched: Vec<_> = mesh.positions().iter().map(|p| Point3::new(1.5 * p.x, p.y, p.z)).collect();
        let shape = gauge.measure(&stretched);
        assert!((shape.worst_stretch - 0.5).abs() < 1e-12 && (shape.volume_ratio.unwrap() - 1.5).abs() < 1e-12);
    }

    #[test]
    fn a_face_folded_over_is_flipped_and_an_open_surface_has_no_volume() {
        // A fan around a center that is pushed over its border.
        let ring = (0..6).map(|k| f64::from(k) * std::f64::consts::FRAC_PI_3);
        let positions = std::iter::once(Point3::origin()).chain(ring.map(|a| Point3::new(a.cos(), a.sin(), 0.0)));
        let triangles = (0..6).map(|k| [0, 1 + k, 1 + (k + 1) % 6]).collect();
        let mesh = TriMesh::new(positions.collect(), triangles).unwrap();
        let mut moved = mesh.positions().to_vec();
        moved[0].x = 1.4;
        let shape = Gauge::new(&mesh).measure(&moved);
        assert_eq!((shape.flipped_faces, shape.volume_ratio), (2, None));
    }
}
