//! Surface from prescribed triangle gradients and approximate vertex positions (screened Poisson equation):
//!
//! ```text
//! x = argmin Σ_t Σ_{edges of t} ½ cot · |(x_a − x_b) − D_t (p_a − p_b)|²  +  μ Σ_i s_i |x_i − y_i|²
//! ```
//!
//! `s_i` is the fraction of vertex `i` in the area of its component, so that `μ` is dimensionless: features longer than `√(area / μ)` follow
//! the positions, shorter ones the gradients. The centroid of each component is that of its positions for every `μ`.

use nalgebra::{Matrix3, Point3, Vector3};

use super::super::CharacterError;
use crate::mesh::TriMesh;
use crate::mesh::operators::{CotangentRule, Cotangents, EdgeWeights, barycentric_areas, factored_laplacian};
use plumbline_num::energy::{ConstrainedLaplacian, FactoredLaplacian};
use plumbline_num::run::Run;
use plumbline_num::sparse::Ordering;
use plumbline_num::spatial::UnionFind;

/// The factored screened Laplacian.
#[derive(Clone, Debug)]
pub(super) struct SurfaceOfGradients {
    rest: Vec<Point3<f64>>,
    triangles: Vec<[u32; 3]>,
    half: Vec<[f64; 3]>,
    /// `μ s_i`, above 0.
    hold: Vec<f64>,
    system: FactoredLaplacian,
    right: Vec<[f64; 3]>,
}

impl SurfaceOfGradients {
    /// Factors the matrix. `hold` is `μ`, above 0.
    pub(super) fn new(mesh: &TriMesh, hold: f64, run: &Run) -> Result<Self, CharacterError> {
        run.check()?;
        let cotangents = Cotangents::new(mesh, CotangentRule::Raw).limited(MAX_COTANGENT);
        let edges = EdgeWeights::cotangent(mesh.vertex_count(), &cotangents);
        let shares = shares(&barycentric_areas(mesh), &pieces(&edges));
        let hold: Vec<f64> = shares.iter().map(|s| (hold * s).max(MIN_WEIGHT)).collect();
        let soft = hold.iter().enumerate().map(|(v, &w)| (v, v, w));
        let laplacian = ConstrainedLaplacian::new(mesh.vertex_count(), edges.iter().chain(soft), |_| false)?;
        let system = factored_laplacian(laplacian, &Ordering::Amd, run)?;
        Ok(Self {
            rest: mesh.positions().to_vec(),
            triangles: mesh.triangles().to_vec(),
            half: cotangents.half().to_vec(),
            right: vec![[0.0; 3]; hold.len()],
            hold,
            system,
        })
    }

    /// The rest surface.
    pub(super) fn rest(&self) -> &[Point3<f64>] {
        &self.rest
    }

    /// Triangle areas at rest.
    pub(super) fn areas(&self) -> Vec<f64> {
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| self.rest[v as usize]);
            0.5 * (b - a).cross(&(c - a)).norm()
        };
        self.triangles.iter().map(area).collect()
    }

    /// Replaces the rest surface. The matrix remains that of the original surface.
    pub(super) fn set_rest(&mut self, rest: &[Point3<f64>]) -> Result<(), CharacterError> {
        CharacterError::check_per_vertex("positions at rest", rest.len(), self.rest.len())?;
        self.rest.copy_from_slice(rest);
        Ok(())
    }

    /// Vertex positions for a gradient per triangle and a position per vertex.
    pub(super) fn solve(
        &mut self,
        gradient: impl Fn(usize) -> Matrix3<f64>,
        position: impl Fn(usize) -> Vector3<f64>,
    ) -> Vec<Point3<f64>> {
        for (v, (right, hold)) in self.right.iter_mut().zip(&self.hold).enumerate() {
            *right = (position(v) * *hold).into();
        }
        for (t, (corners, half)) in self.triangles.iter().zip(&self.half).enumerate() {
            let map = gradient(t);
            for (k, h) in half.iter().enumerate() {
                let (a, b) = (corners[(k + 1) % 3] as usize, corners[(k + 2) % 3] as usize);
                let edge = map * (self.rest[a] - self.rest[b]) * *h;
                for c in 0..3 {
                    self.right[a][c] += edge[c];
                    self.right[b][c] -= edge[c];
                }
            }
        }
        self.system.solve(&mut self.right);
        self.right.iter().map(|x| Point3::from(*x)).collect()
    }
}

/// Lower bound of the position weight, for vertices of zero area: far below relevant cotangents, above singularity.
const MIN_WEIGHT: f64 = 1e-9;

/// Upper bound of half cotangents: slivers of 1:2000 keep theirs.
const MAX_COTANGENT: f64 = 1e3;

/// Lowest vertex of each vertex's component.
fn pieces(edges: &EdgeWeights) -> Vec<u32> {
    let mut sets = UnionFind::new(edges.vertex_count());
    for &[i, j] in edges.edges() {
        sets.join(i, j);
    }
    sets.roots()
}

/// Areas relative to those of the components; uniform for components of zero area.
fn shares(areas: &[f64], piece: &[u32]) -> Vec<f64> {
    let (mut total, mut count) = (vec![0.0; areas.len()], vec![0.0; areas.len()]);
    for (a, &p) in areas.iter().zip(piece) {
        total[p as usize] += a;
        count[p as usize] += 1.0;
    }
    let share =
        |(a, &p): (&f64, &u32)| if total[p as usize] > 0.0 { a / total[p as usize] } else { 1.0 / count[p as usize] };
    areas.iter().zip(piece).map(share).collect()
}
