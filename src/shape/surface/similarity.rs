//! Laplacian editing with linearized similarities.
//!
//! ```text
//! E(x) = Σᵢ |(L x)ᵢ − Tᵢ(x) δᵢ|² / mᵢ,        Tᵢ v = sᵢ v + hᵢ × v
//! (s, h)ᵢ = argmin Σ_{j ∈ N(i)} |s e_ij + h × e_ij − e'_ij|²:
//! sᵢ = Σ e · e' / Σ |e|²,       hᵢ = (Σ |e|² I − e eᵀ)⁻¹ Σ e × e'
//! ```
//!
//! Scale and rotation of each vertex are linear functions of its one-ring, eliminated in one system of `3n` unknowns. Rotations are
//! exact to first order only; large handle rotations inflate the surface.
//!
//! With fewer than three handles some similarities have zero energy; a small elastic term `ε Σ w |e' − e|²` regularizes them.
//!
//! # Reference
//! Sorkine et al., *Laplacian surface editing*, SGP 2004, section 3.3.

use std::sync::Arc;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::SurfaceError;
use super::bound::Bound;
use super::components::FIXED;
use super::detail_preserving::{DetailPreserving, laplacian};
use super::lanes::Lanes;
use crate::mesh::operators::{EdgeWeights, Forming, max_multiplications};
use plumbline_num::run::Run;
use plumbline_num::sparse::{CompactFactor, Ordering, Pattern, SparseError, SparseMatrix};

/// ε relative to the mean diagonal of the energy: far above rounding, and too small for a visible effect.
const REGULARIZATION: f64 = 1e-8;

/// The Jacobian of the residual of one vertex: a block per vertex of its one-ring, itself included.
type Row = Vec<(u32, Matrix3<f64>)>;

/// The factored system of `3n` unknowns.
#[derive(Debug)]
pub(super) struct SimilarityEditing {
    rows: Vec<Row>,
    weights: Vec<f64>,
    edges: EdgeWeights,
    regularization: f64,
    factor: CompactFactor,
}

impl SimilarityEditing {
    pub(super) fn new(details: &DetailPreserving, run: &Run) -> Result<Self, SurfaceError> {
        let (bound, weights) = (&details.bound, details.inverse_mass().to_vec());
        let mut ring: Vec<Vec<(u32, f64)>> = vec![Vec::new(); bound.rest.len()];
        for (i, j, w) in details.weights.iter() {
            ring[i].push((j as u32, w));
            ring[j].push((i as u32, w));
        }
        let delta = laplacian(&details.weights, &bound.rest);
        let rows: Vec<Row> = (0..ring.len()).map(|i| row(i, &ring[i], &bound.rest, delta[i])).collect();
        let unknown = |v: u32| bound.unknowns.unknown[v as usize];
        check(&rows)?;
        let pairs = rows.iter().flat_map(|row| row.iter().flat_map(move |a| row.iter().map(move |b| (a.0, b.0))));
        let entries = pairs
            .map(|(a, b)| (unknown(a), unknown(b)))
            .filter(|&(a, b)| a != FIXED && b != FIXED && a >= b)
            .flat_map(|(a, b)| (0..9).map(move |k| (3 * a as usize + k / 3, 3 * b as usize + k % 3)));
        let pattern = Arc::new(Pattern::new(3 * bound.unknowns.free.len(), entries)?);
        let mut matrix = SparseMatrix::zeros(Arc::clone(&pattern));
        for (row, &w) in rows.iter().zip(&weights) {
            for (a, ja) in row {
                for (b, jb) in row {
                    let (a, b) = (unknown(*a), unknown(*b));
                    if a == FIXED || b == FIXED || a < b {
                        continue;
                    }
                    let block = ja.transpose() * jb * w;
                    for (k, l) in (0..9).map(|k| (k / 3, k % 3)).filter(|&(k, l)| a > b || k >= l) {
                        let slot =
                            pattern.slot(3 * a as usize + k, 3 * b as usize + l).expect("an entry of this pattern");
                        matrix.values_mut()[slot] += block[(k, l)];
                    }
                }
            }
        }
        let diagonal = |v: usize| pattern.column_starts()[v] as usize;
        let mean = (0..pattern.n()).map(|v| matrix.values()[diagonal(v)]).sum::<f64>() / pattern.n().max(1) as f64;
        let edges = EdgeWeights::uniform(bound.metrics.rest());
        let regularization = REGULARIZATION * mean;
        for (i, j, w) in edges.iter().map(|(i, j, w)| (unknown(i as u32), unknown(j as u32), regularization * w)) {
            for c in 0..3 {
                let row = |v: u32| 3 * v as usize + c;
                for v in [i, j].into_iter().filter(|&v| v != FIXED) {
                    matrix.values_mut()[diagonal(row(v))] += w;
                }
                if i != FIXED && j != FIXED {
                    let slot = pattern.slot(row(i), row(j)).expect("an edge is an entry of this pattern");
                    matrix.values_mut()[slot] -= w;
                }
            }
        }
        for &(k, weight) in &bound.unknowns.soft {
            let unknown = unknown(bound.unknowns.handles.vertices()[k]) as usize;
            for c in 0..3 {
                matrix.values_mut()[pattern.column_starts()[3 * unknown + c] as usize] += weight;
            }
        }
        let factor = CompactFactor::of_within(&matrix, &Ordering::Amd, max_multiplications(pattern.n()), run)
            .map_err(|error| SurfaceError::of_factor(error, 3, |unknown| bound.unknowns.free[unknown] as usize))?;
        Ok(Self { rows, weights, edges, regularization, factor })
    }

    /// The minimizer and its energy, computed in a frame rotated with the handles, where the remaining rotations are small.
    pub(super) fn solve(&mut self, bound: &Bound, frame: &UnitQuaternion<f64>, targets: &[Lanes]) -> (Vec<Lanes>, f64) {
        let rotated = |q: &UnitQuaternion<f64>, x: &Lanes| Lanes::point((q * Vector3::from(x.xyz())).into());
        let back = frame.inverse();
        let within: Vec<Lanes> = targets.iter().map(|t| rotated(&back, t)).collect();
        let (mut x, energy) = self.solve_in_frame(bound, &within);
        for x in &mut x {
            *x = rotated(frame, x);
        }
        bound.impose(targets, &mut x);
        (x, energy)
    }

    fn solve_in_frame(&mut self, bound: &Bound, targets: &[Lanes]) -> (Vec<Lanes>, f64) {
        let mut x = bound.rest.clone();
        bound.impose(targets, &mut x);
        // The second pass is the iterative refinement.
        for _ in 0..2 {
            let mut slope = vec![Vector3::zeros(); x.len()];
            for (row, &w) in self.rows.iter().zip(&self.weights) {
                let weighted = residual(row, &x) * w;
                for (v, j) in row {
                    slope[*v as usize] += j.transpose() * weighted;
                }
            }
            for (i, j, w) in self.edges.iter() {
                let change =
                    Vector3::from(((x[i] - x[j]) - (bound.rest[i] - bound.rest[j])).xyz()) * (self.regularization * w);
                slope[i] += change;
                slope[j] -= change;
            }
            for &(k, weight) in &bound.unknowns.soft {
                let v = bound.unknowns.handles.vertices()[k] as usize;
                slope[v] += Vector3::from((x[v] - targets[k]).xyz()) * weight;
            }
            let mut step: Vec<f64> =
                bound.unknowns.free.iter().flat_map(|&v| <[f64; 3]>::from(slope[v as usize])).collect();
            self.factor.solve(&mut step);
            for (step, &v) in step.as_chunks().0.iter().zip(&bound.unknowns.free) {
                x[v as usize] -= Lanes::point(*step);
            }
        }
        let energy = self.rows.iter().zip(&self.weights).map(|(row, w)| w * residual(row, &x).norm_squared()).sum();
        (x, energy)
    }
}

/// Refuses rows whose vertices, each with each other, have more blocks of 3 × 3 than a surface.
fn check(rows: &[Row]) -> Result<(), SparseError> {
    let Some((vertex, densest)) = rows.iter().enumerate().max_by_key(|(_, row)| row.len()) else { return Ok(()) };
    let forming =
        Forming { unknowns: 3 * rows.len(), per_vertex: 3, vertex, neighbors: densest.len().saturating_sub(1) };
    forming.check_clique()?;
    forming.check_entries(rows.iter().map(|row| 9 * row.len() * (row.len() + 1) / 2).sum())
}

fn residual(row: &Row, x: &[Lanes]) -> Vector3<f64> {
    row.iter().fold(Vector3::zeros(), |sum, (v, j)| sum + j * Vector3::from(x[*v as usize].xyz()))
}

/// `(L x)ᵢ − sᵢ(x) δᵢ − hᵢ(x) × δᵢ` as a linear function of the one-ring.
fn row(i: usize, ring: &[(u32, f64)], rest: &[Lanes], delta: Lanes) -> Row {
    let delta = Vector3::from(delta.xyz());
    let edge = |j: u32| Vector3::from((rest[j as usize] - rest[i]).xyz());
    let squares: f64 = ring.iter().map(|&(j, _)| edge(j).norm_squared()).sum();
    let inertia = ring.iter().fold(Matrix3::zeros(), |sum, &(j, _)| {
        let e = edge(j);
        sum + Matrix3::identity() * e.norm_squared() - e * e.transpose()
    });
    // A collinear one-ring does not determine the rotation about its line.
    let inverse = inertia.pseudo_inverse(1e-9 * squares).unwrap_or_else(|_| Matrix3::zeros());
    let per_square = if squares > 0.0 { 1.0 / squares } else { 0.0 };
    let mut row: Row = vec![(i as u32, Matrix3::zeros())];
    for &(j, w) in ring {
        let e = edge(j);
        // s δ = δ (eᵀ e') / Σ|e|²,   h × δ = −[δ]ₓ C⁻¹ [e]ₓ e'.
        let rotated = delta * e.transpose() * per_square - delta.cross_matrix() * inverse * e.cross_matrix();
        let block = Matrix3::identity() * -w - rotated;
        row.push((j, block));
        row[0].1 -= block;
    }
    row
}
