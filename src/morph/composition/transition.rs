//! The band around a seam in which two surfaces become one.
//!
//! First the gap is closed: every triangle keeps the shape it had on its own surface, turned as it needs,
//!
//! ```text
//! min over x, Rₜ   Σ_t Σ_{e ∈ t} h_e |e(x) − Rₜ e|²,      x fixed outside the band
//! ```
//!
//! (one factor; rotations and positions in turn). Then the crease goes: vertices lie off the middles of their neighbors by the `δ` by
//! which they do now, but on the seam and beside it by what continues the two sides harmonically,
//!
//! ```text
//! min over x   Σᵢ |xᵢ − mean of its neighbors − δᵢ|²,      x fixed outside the inner band.
//! ```
//!
//! All neighbors count alike: a seam has triangles of any shape, and by cotangents slivers would decide.
//!
//! # Reference
//! Y. Yu et al., *Mesh editing with Poisson-based gradient field manipulation*, SIGGRAPH 2004 (merging); O. Sorkine et al.,
//! *Laplacian surface editing*, SGP 2004 (transplanting).

use nalgebra::{Matrix3, Point3, Vector3};

use super::super::MorphError;
use super::super::elastic_solve::{ElasticSolve, factored};
use super::super::trajectory::{Frame, opposite_edges};
use crate::mesh::TriMesh;

/// Rounds of rotations and positions. The gap is small against the band: more do not show.
const ROUNDS: usize = 8;

/// Rings on either side of the seam whose curvature is taken from their neighbors.
const CREASE: usize = 1;

/// A surface in parts that do not quite fit.
pub(super) struct Transition<'a> {
    /// The joined triangles, at positions to start from.
    pub(super) joined: &'a TriMesh,
    /// Edges of every triangle on its own surface.
    pub(super) edges: Vec<[Vector3<f64>; 3]>,
    /// Half cotangents of every triangle on its own surface.
    pub(super) half: Vec<[f64; 3]>,
    /// Edges from each vertex to the seam.
    pub(super) ring: &'a [usize],
    /// Vertices nearer to the seam than this move.
    pub(super) band: usize,
}

impl Transition<'_> {
    /// The positions after both steps.
    pub(super) fn solve(self) -> Result<Vec<Point3<f64>>, MorphError> {
        let mut x = self.joined.positions().to_vec();
        let held: Vec<bool> = self.ring.iter().map(|r| *r >= self.band).collect();
        let mut elastic = ElasticSolve::held(self.joined.triangles(), self.half.clone(), &x, &held)?;
        elastic.follow(|t| self.edges[t], &mut x);
        for _ in 0..ROUNDS {
            let turned: Vec<[Vector3<f64>; 3]> = (0..self.edges.len()).map(|t| self.turned(t, &x)).collect();
            elastic.follow(|t| turned[t], &mut x);
        }
        self.without_crease(x)
    }

    /// Edges of a triangle on its own surface, turned to where it is now.
    fn turned(&self, t: usize, x: &[Point3<f64>]) -> [Vector3<f64>; 3] {
        let [a, b, c] = self.edges[t];
        let rest = [Point3::origin(), Point3::from(c), Point3::from(-b)];
        let now = self.joined.triangles()[t].map(|v| x[v as usize]);
        let frames = Frame::new(&rest).zip(Frame::new(&now));
        let turn = frames.map_or_else(Matrix3::identity, |(rest, now)| rest.best_rotation_to(&now, &self.half[t]));
        debug_assert!((opposite_edges(&rest)[0] - a).norm() <= 1e-6 * (b.norm() + c.norm()));
        [a, b, c].map(|e| turn * e)
    }

    fn without_crease(&self, mut x: Vec<Point3<f64>>) -> Result<Vec<Point3<f64>>, MorphError> {
        let inner = (self.band - 1).min(CREASE + 2);
        let n = x.len();
        let free: Vec<usize> = (0..n).filter(|&v| self.ring[v] < inner).collect();
        let near: Vec<bool> = self.ring.iter().map(|r| *r <= inner).collect();
        if inner == 0 || free.is_empty() {
            return Ok(x);
        }
        let rows = self.neighbors(&near);
        let offsets = self.continued(&rows, &x, inner);
        let mut unknown = vec![None; n];
        free.iter().enumerate().for_each(|(k, &v)| unknown[v] = Some(k));
        let (mut triplets, mut rhs) = (Vec::new(), vec![[0.0; 3]; free.len()]);
        for i in (0..n).filter(|&i| near[i] && !rows[i].is_empty()) {
            let share = 1.0 / rows[i].len() as f64;
            let row: Vec<(usize, f64)> =
                std::iter::once((i, 1.0)).chain(rows[i].iter().map(|&j| (j, -share))).collect();
            // What is missing with all where they are now: steps are solved for.
            let missing = offsets[i] - offset(&rows[i], &x, i);
            for (k, &(j, a)) in row.iter().enumerate() {
                let Some(u) = unknown[j] else { continue };
                (0..3).for_each(|c| rhs[u][c] += a * missing[c]);
                triplets.extend(row[..=k].iter().filter_map(|&(h, b)| unknown[h].map(|w| (u, w, a * b))));
            }
        }
        let places = free.iter().map(|&v| x[v].coords.into()).collect();
        if let Some(mut factor) = factored(free.len(), &triplets, places)? {
            factor.solve_3(&mut rhs);
        }
        free.iter().zip(&rhs).for_each(|(&v, step)| x[v] += Vector3::from(*step));
        Ok(x)
    }

    /// Neighbors of the vertices of the band and of those beside it.
    fn neighbors(&self, near: &[bool]) -> Vec<Vec<usize>> {
        let mut rows: Vec<Vec<usize>> = vec![Vec::new(); near.len()];
        for t in self.joined.triangles() {
            for k in 0..3 {
                let (i, j) = (t[k] as usize, t[(k + 1) % 3] as usize);
                if near[i] || near[j] {
                    rows[i].push(j);
                    rows[j].push(i);
                }
            }
        }
        for row in &mut rows {
            row.sort_unstable();
            row.dedup();
        }
        rows
    }

    /// How far vertices lie off the middles of their neighbors; near the seam, as both sides go on.
    fn continued(&self, rows: &[Vec<usize>], x: &[Point3<f64>], inner: usize) -> Vec<Vector3<f64>> {
        let mut offsets: Vec<Vector3<f64>> = (0..rows.len()).map(|i| offset(&rows[i], x, i)).collect();
        let crease: Vec<usize> = (0..rows.len()).filter(|&v| self.ring[v] <= CREASE.min(inner)).collect();
        // A few vertices across: a hundred sweeps settle them.
        for _ in 0..100 {
            for &v in crease.iter().filter(|v| !rows[**v].is_empty()) {
                offsets[v] = rows[v].iter().map(|j| offsets[*j]).sum::<Vector3<f64>>() / rows[v].len() as f64;
            }
        }
        offsets
    }
}

/// How far a vertex lies off the middle of its neighbors.
fn offset(row: &[usize], x: &[Point3<f64>], i: usize) -> Vector3<f64> {
    if row.is_empty() {
        Vector3::zeros()
    } else {
        row.iter().map(|j| x[i] - x[*j]).sum::<Vector3<f64>>() / row.len() as f64
    }
}
