//! Convergence of a deformation, and distortion metrics of its result.

use nalgebra::Point3;

use super::Component;
use crate::mesh::TriMesh;

/// Why an iteration ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The energy decrease fell below the tolerance.
    Converged,
    /// The iteration limit was reached first.
    IterationLimit,
    /// A single linear solve gives the minimizer.
    Solved,
}

impl Stop {
    /// True unless the iteration limit was reached.
    pub fn converged(self) -> bool {
        self != Self::IterationLimit
    }
}

impl std::fmt::Display for Stop {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Converged => "converged",
            Self::IterationLimit => "iteration limit reached",
            Self::Solved => "solved",
        })
    }
}

/// The report of a deformation.
#[derive(Clone, Debug, PartialEq)]
pub struct DeformReport {
    /// Number of global solves.
    pub iterations: usize,
    /// Energy of the initial guess and after each iteration; squared mesh units for elastic energies.
    pub energies: Vec<f64>,
    /// Why the iteration ended.
    pub stop: Stop,
    /// Largest distance of a constrained vertex from its target, mesh units; 0 with hard constraints.
    pub constraint_error: f64,
    /// Distortion against the rest shape.
    pub shape: Distortion,
    /// Number of edges with a negative weight.
    pub negative_weights: usize,
    /// Number of triangles without area, weighted as equilateral ones.
    pub degenerate_faces: usize,
    /// Connected components without a handle, which were kept fixed.
    pub fixed_components: Vec<Component>,
}

/// Distortion of a deformed surface against its rest shape.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distortion {
    /// Largest relative change of an edge length.
    pub worst_stretch: f64,
    /// Root mean square of the relative changes of all edge lengths.
    pub rms_stretch: f64,
    /// Number of faces that are inverted against their neighborhood and were not at rest.
    pub flipped_faces: usize,
    /// Volume over the rest volume; `None` for a surface that is open or has no volume.
    pub volume_ratio: Option<f64>,
}

/// Distortion metrics of a surface: measures deformed positions against the rest shape.
#[derive(Clone, Debug)]
pub struct DistortionMetrics {
    rest: TriMesh,
    /// Edges with their rest lengths, without those of length 0.
    edges: Vec<([u32; 2], f64)>,
    /// Triangles that are inverted at rest.
    inverted: Vec<bool>,
    volume: Option<f64>,
}

/// A volume below this fraction of the cubed diagonal is rounding: of a flat sheet, or of a surface that covers itself twice with
/// opposite orientation.
const MIN_RELATIVE_VOLUME: f64 = 1e-9;

impl DistortionMetrics {
    /// Metrics against this rest shape.
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
        let encloses = closed && volume.abs() > MIN_RELATIVE_VOLUME * mesh.diagonal().powi(3);
        Self { edges, inverted: inverted_triangles(mesh), volume: encloses.then_some(volume), rest: mesh.clone() }
    }

    /// The rest shape.
    pub fn rest(&self) -> &TriMesh {
        &self.rest
    }

    /// Root mean square of the relative changes of the edge lengths at each vertex, dimensionless; 0 for a vertex without edges.
    ///
    /// # Panics
    /// If there are fewer positions than vertices.
    pub fn stretch_of_vertices(&self, positions: &[Point3<f64>]) -> Vec<f64> {
        let mut sums = vec![(0.0, 0_u32); self.rest.vertex_count()];
        for &([i, j], rest) in &self.edges {
            let stretch = (positions[i as usize] - positions[j as usize]).norm() / rest - 1.0;
            for v in [i, j] {
                let (sum, count) = &mut sums[v as usize];
                *sum += stretch * stretch;
                *count += 1;
            }
        }
        sums.into_iter().map(|(sum, count)| (sum / f64::from(count.max(1))).sqrt()).collect()
    }

    /// The faces that are inverted against their neighborhood and were not at rest, ascending.
    ///
    /// # Panics
    /// If there is another number of positions than of vertices.
    pub fn flipped(&self, positions: &[Point3<f64>]) -> Vec<u32> {
        let Ok(mesh) = self.rest.with_positions(positions.to_vec()) else { return Vec::new() };
        let now = inverted_triangles(&mesh).into_iter().zip(&self.inverted).enumerate();
        now.filter(|(_, (now, before))| *now && !**before).map(|(t, _)| t as u32).collect()
    }

    /// The distortion of these positions, finite and one per vertex.
    pub fn measure(&self, positions: &[Point3<f64>]) -> Distortion {
        let Ok(mesh) = self.rest.with_positions(positions.to_vec()) else {
            return Distortion { worst_stretch: f64::NAN, rms_stretch: f64::NAN, ..Default::default() };
        };
        let stretches = self
            .edges
            .iter()
            .map(|&([i, j], rest)| ((positions[i as usize] - positions[j as usize]).norm() / rest - 1.0).abs());
        let (worst, squares) = stretches.fold((0.0, 0.0), |(worst, sum): (f64, f64), s| (worst.max(s), sum + s * s));
        let flipped =
            inverted_triangles(&mesh).into_iter().zip(&self.inverted).filter(|&(now, &before)| now && !before);
        Distortion {
            worst_stretch: worst,
            rms_stretch: (squares / self.edges.len().max(1) as f64).sqrt(),
            flipped_faces: flipped.count(),
            volume_ratio: self.volume.map(|v| mesh.volume() / v),
        }
    }
}

/// Triangles whose normal opposes the sum of the vertex normals at their corners.
fn inverted_triangles(mesh: &TriMesh) -> Vec<bool> {
    let normals = mesh.vertex_normals();
    let inverted = |(t, v): (usize, &[u32; 3])| {
        let around = v.iter().fold(nalgebra::Vector3::zeros(), |sum, &v| sum + normals[v as usize]);
        mesh.area_normal(t).dot(&around) < 0.0
    };
    mesh.triangles().iter().enumerate().map(inverted).collect()
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
        let metrics = DistortionMetrics::new(&mesh);
        let same = metrics.measure(mesh.positions());
        assert_eq!((same.worst_stretch, same.flipped_faces), (0.0, 0));
        let stretched: Vec<_> = mesh.positions().iter().map(|p| Point3::new(1.5 * p.x, p.y, p.z)).collect();
        let shape = metrics.measure(&stretched);
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
        let shape = DistortionMetrics::new(&mesh).measure(&moved);
        assert_eq!((shape.flipped_faces, shape.volume_ratio), (2, None));
    }
}
