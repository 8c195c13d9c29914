//! The transition band around a seam.
//!
//! First the gap is closed by ARAP: every triangle keeps its shape on its own surface up to a rotation,
//!
//! ```text
//! min over x, Rₜ   Σ_t Σ_{e ∈ t} h_e |e(x) − Rₜ e|²,      x fixed outside the band
//! ```
//!
//! (one factor; rotations and positions alternate). Then the crease is removed: the mean curvature normals `δ` are preserved, except
//! on the seam and beside it, where they are interpolated harmonically between the two sides,
//!
//! ```text
//! min over x   Σᵢ |(L x)ᵢ − mᵢ δᵢ|² / mᵢ,      x fixed outside the inner band.
//! ```
//!
//! # Reference
//! Y. Yu et al., *Mesh editing with Poisson-based gradient field manipulation*, SIGGRAPH 2004 (merging); O. Sorkine et al.,
//! *Laplacian surface editing*, SGP 2004 (transplanting).

use nalgebra::{Matrix3, Point3, Vector3};

use super::super::MorphError;
use super::super::elastic_solve::ElasticSolve;
use super::super::trajectory::{Frame, opposite_edges};
use crate::mesh::TriMesh;
use crate::mesh::operators::{CotangentRule, Cotangents, EdgeWeights, barycentric_areas, max_multiplications};
use plumbline_num::run::Run;
use plumbline_num::sparse::{CompactFactor, Ordering, SparseMatrix};

/// Local/global iterations. The gap is small relative to the band: more iterations make no visible difference.
const ITERATIONS: usize = 8;

/// Gauss–Seidel sweeps of the curvature interpolation.
const SWEEPS: usize = 100;

/// Rings on either side of the seam with interpolated curvature: the seam and its neighbors.
const CREASE_RINGS: usize = 1;

/// Positions of all vertices.
type Positions = Vec<Point3<f64>>;

/// Two joined surfaces with a gap at the seam.
pub(super) struct Transition<'a> {
    /// The joined triangles, at their initial positions.
    pub(super) joined: &'a TriMesh,
    /// Edges of every triangle on its own surface.
    pub(super) edges: Vec<[Vector3<f64>; 3]>,
    /// Half cotangents of every triangle on its own surface.
    pub(super) half: Vec<[f64; 3]>,
    /// Distance of each vertex from the seam in edges.
    pub(super) ring: &'a [usize],
    /// Vertices nearer to the seam than this may move.
    pub(super) band: usize,
}

impl Transition<'_> {
    /// The positions after the first step, and after both for every width of the inner band. Slivers at the seam may spoil the second
    /// step, depending on the width.
    pub(super) fn solve(self, run: &Run) -> Result<(Positions, Vec<Positions>), MorphError> {
        let mut x = self.joined.positions().to_vec();
        let fixed: Vec<bool> = self.ring.iter().map(|r| *r >= self.band).collect();
        let mut elastic = ElasticSolve::new(self.joined.triangles(), self.half.clone(), &x, Some(&fixed), run)?;
        elastic.follow(|t| self.edges[t], &mut x);
        for _ in 0..ITERATIONS {
            run.check()?;
            let rotated: Vec<[Vector3<f64>; 3]> = (0..self.edges.len()).map(|t| self.rotated(t, &x)).collect();
            elastic.follow(|t| rotated[t], &mut x);
        }
        let widths = 1..=(self.band - 1).min(CREASE_RINGS + 2);
        let smooth = widths.map(|inner| self.without_crease(x.clone(), inner, run)).collect::<Result<_, _>>()?;
        Ok((x, smooth))
    }

    /// Edges of a triangle on its own surface, rotated to its current orientation.
    fn rotated(&self, t: usize, x: &[Point3<f64>]) -> [Vector3<f64>; 3] {
        let [a, b, c] = self.edges[t];
        let rest = [Point3::origin(), Point3::from(c), Point3::from(-b)];
        let now = self.joined.triangles()[t].map(|v| x[v as usize]);
        let frames = Frame::new(&rest).zip(Frame::new(&now));
        let rotation = frames.map_or_else(Matrix3::identity, |(rest, now)| rest.best_rotation_to(&now, &self.half[t]));
        debug_assert!((opposite_edges(&rest)[0] - a).norm() <= 1e-6 * (b.norm() + c.norm()));
        [a, b, c].map(|e| rotation * e)
    }

    /// The positions with interpolated curvature at the seam.
    fn without_crease(&self, x: Vec<Point3<f64>>, inner: usize, run: &Run) -> Result<Vec<Point3<f64>>, MorphError> {
        let n = x.len();
        let free: Vec<usize> = (0..n).filter(|&v| self.ring[v] < inner).collect();
        let near: Vec<bool> = self.ring.iter().map(|r| *r <= inner).collect();
        if free.is_empty() {
            return Ok(x);
        }
        run.check()?;
        let now = self.joined.with_positions(x)?;
        let weights = EdgeWeights::cotangent(n, &Cotangents::new(&now, CotangentRule::Clamped));
        let masses = barycentric_areas(&now);
        let mut rows: Vec<Vec<(usize, f64)>> = vec![Vec::new(); n];
        for (i, j, w) in weights.iter().filter(|&(i, j, _)| near[i] || near[j]) {
            rows[i].push((j, w));
            rows[j].push((i, w));
        }
        let curvature = self.interpolated_curvature(&rows, &masses, now.positions(), inner);
        let mut unknown = vec![None; n];
        free.iter().enumerate().for_each(|(k, &v)| unknown[v] = Some(k));
        let (mut triplets, mut rhs) = (Vec::new(), vec![[0.0; 3]; free.len()]);
        for i in (0..n).filter(|&i| near[i] && masses[i] > 0.0) {
            let mut row: Vec<(usize, f64)> = rows[i].iter().map(|&(j, w)| (j, -w)).collect();
            row.push((i, rows[i].iter().map(|r| r.1).sum()));
            // The residual at the current positions: the unknowns are displacements.
            let l: Vector3<f64> = row.iter().map(|&(j, a)| now.positions()[j].coords * a).sum();
            let residual = curvature[i] * masses[i] - l;
            for (k, &(j, a)) in row.iter().enumerate() {
                let Some(u) = unknown[j] else { continue };
                (0..3).for_each(|c| rhs[u][c] += a * residual[c] / masses[i]);
                let with = row[..=k].iter().filter_map(|&(h, b)| unknown[h].map(|w| (u, w, a * b / masses[i])));
                triplets.extend(with);
            }
        }
        let points = free.iter().map(|&v| now.positions()[v].coords.into()).collect();
        let matrix = SparseMatrix::from_triplets(free.len(), &triplets)?;
        let most = max_multiplications(matrix.n());
        CompactFactor::of_within(&matrix, &Ordering::NestedDissection(points), most, run)?.solve_points(&mut rhs);
        let mut moved = now.positions().to_vec();
        free.iter().zip(&rhs).for_each(|(&v, step)| moved[v] += Vector3::from(*step));
        Ok(moved)
    }

    /// Mean curvature normals, interpolated harmonically near the seam.
    fn interpolated_curvature(
        &self,
        rows: &[Vec<(usize, f64)>],
        masses: &[f64],
        x: &[Point3<f64>],
        inner: usize,
    ) -> Vec<Vector3<f64>> {
        let of = |i: usize| -> Vector3<f64> {
            let sum: Vector3<f64> = rows[i].iter().map(|&(j, w)| (x[i] - x[j]) * w).sum();
            if masses[i] > 0.0 { sum / masses[i] } else { Vector3::zeros() }
        };
        let mut curvature: Vec<Vector3<f64>> = (0..rows.len()).map(of).collect();
        let crease: Vec<usize> = (0..rows.len()).filter(|&v| self.ring[v] <= CREASE_RINGS.min(inner)).collect();
        // Gauss–Seidel: a hundred sweeps converge on a band a few vertices wide.
        for _ in 0..SWEEPS {
            for &v in &crease {
                let total: f64 = rows[v].iter().map(|r| r.1).sum();
                if total > 0.0 {
                    curvature[v] = rows[v].iter().map(|&(j, w)| curvature[j] * w).sum::<Vector3<f64>>() / total;
                }
            }
        }
        curvature
    }
}
