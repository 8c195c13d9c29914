//! Normal equations of a contraction iteration and their factorization.
//!
//! With `L` the cotangent Laplacian of the surface and `W` a weight per row,
//!
//! `A = Lᵀ W² L + D`,   `Lᵢⱼ = wᵢⱼ = ½ (cot αᵢⱼ + cot βᵢⱼ)`,   `Lᵢᵢ = −Σⱼ wᵢⱼ`,
//!
//! couples each vertex with its two-ring. Column `j` of the product is the sum of the rows of `L` around `j`, each times its entry at `j`.
//!
//! The row of a hub, a vertex with hundreds of neighbors, would couple all of them with each other, and memory would grow with the square of
//! their number: such rows have the weight 0.

use std::sync::Arc;

use nalgebra::Point3;

use super::complex::{Complex, NONE};
use crate::character::CharacterError;
use plumbline_num::run::Run;
use plumbline_num::sparse::{Cholesky, Ordering, Pattern, SparseError, SparseMatrix};

/// Bound of cotangents, reached by slivers about to collapse: larger ones cost the factorization its digits; much smaller ones let the tips
/// of limbs shrink (at 10 fingers lose half their length).
const MAX_COTANGENT: f64 = 1e3;

/// Number of neighbors above which a vertex is a hub. Reduced surfaces have at most about twenty; with this bound six thousand vertices have at
/// most six million entries.
const MAX_VALENCE: usize = 300;

/// The normal equations for one connectivity.
pub(super) struct NormalEquations {
    /// Unknowns: the remaining vertices, ascending.
    pub(super) vertices: Vec<u32>,
    number: Vec<u32>,
    rings: Rings,
    matrix: SparseMatrix,
    factor: Cholesky,
}

/// One-ring of each unknown, ascending, with edge weights.
struct Rings {
    starts: Vec<usize>,
    to: Vec<u32>,
    weights: Vec<f64>,
}

impl NormalEquations {
    /// Symbolic analysis for the current connectivity; `None` if the factorization would take more than `most` multiplications whatever the
    /// order of elimination.
    ///
    /// With `cᵢ` the entries of column `i` of the factor, it takes `Σ cᵢ² ≥ (Σ cᵢ)² / n`, and `Σ cᵢ` is at least the number of entries of the
    /// matrix: dense systems are refused before their entries take gigabytes.
    pub(super) fn analyze(complex: &Complex, most: f64) -> Result<Option<Self>, CharacterError> {
        let vertices: Vec<u32> = complex.vertices().collect();
        let mut number = vec![NONE; complex.positions.len()];
        vertices.iter().zip(0..).for_each(|(v, i)| number[*v as usize] = i);
        let rings = Rings::of(complex, &vertices, &number);
        let entries = (most * vertices.len() as f64).sqrt() as usize;
        let Some(pairs) = rings.pairs(entries) else { return Ok(None) };
        let pattern = Arc::new(Pattern::new(vertices.len(), pairs)?);
        let at = |v: &u32| complex.positions[*v as usize].coords.into();
        let ordering = Ordering::NestedDissection(vertices.iter().map(at).collect());
        let mut factor = Cholesky::analyze(&pattern, &ordering)?;
        factor.reserve_columns(3);
        Ok(Some(Self { vertices, number, rings, matrix: SparseMatrix::zeros(pattern), factor }))
    }

    /// Numeric values for the current positions, with `W` and `D` given by their diagonals; edge weights are clamped to be non-negative.
    pub(super) fn set(&mut self, complex: &Complex, w: &[f64], d: &[f64]) {
        self.rings.weigh(complex, &self.number);
        let n = self.vertices.len();
        let rings = &self.rings;
        let sums: Vec<f64> = (0..n).map(|i| rings.around(i).map(|(_, w)| w).sum()).collect();
        let mut column = vec![0.0; n];
        let pattern = Arc::clone(self.matrix.pattern());
        for j in 0..n {
            let mut add_row = |i: usize, entry: f64| {
                if rings.is_hub(i) {
                    return;
                }
                let scaled = entry * w[i] * w[i];
                column[i] -= scaled * sums[i];
                for (k, weight) in rings.around(i) {
                    column[k] += scaled * weight;
                }
            };
            add_row(j, -sums[j]);
            rings.around(j).for_each(|(i, weight)| add_row(i, weight));
            column[j] += d[j];
            for slot in pattern.column(j) {
                self.matrix.values_mut()[slot] = column[pattern.rows()[slot] as usize];
            }
            column[j] = 0.0;
            for (i, _) in rings.around(j) {
                column[i] = 0.0;
                if !rings.is_hub(i) {
                    rings.around(i).for_each(|(k, _)| column[k] = 0.0);
                }
            }
        }
    }

    /// Multiplications of the factorization.
    pub(super) fn multiplications(&self) -> f64 {
        self.factor.flops()
    }

    /// The one-ring of an unknown.
    pub(super) fn around(&self, i: usize) -> impl Iterator<Item = usize> + Clone + '_ {
        self.rings.around(i).map(|(j, _)| j)
    }

    /// Factors and solves for three concatenated right-hand sides, those of `x` before. Where the digits do not suffice for `A`, a proximal
    /// term pulls the solution toward `x`: `A + δ diag A`, with `δ diag A · x` on the right-hand side. Whether there is a solution.
    pub(super) fn solve_in_place(&mut self, rhs: &mut [f64], x: &[f64], run: &Run) -> Result<bool, CharacterError> {
        let diagonal: Vec<(usize, f64)> = {
            let entries = self.matrix.pattern().entries().filter(|(i, j, _)| i == j);
            entries.map(|(.., slot)| (slot, self.matrix.values()[slot])).collect()
        };
        for delta in [0.0, 1e-10, 1e-7, 1e-4] {
            for &(slot, value) in &diagonal {
                self.matrix.values_mut()[slot] = value * (1.0 + delta);
            }
            match self.factor.factor(&self.matrix, run) {
                Ok(()) => {
                    let (n, terms) = (diagonal.len(), diagonal.iter().cycle());
                    debug_assert_eq!(3 * n, rhs.len());
                    if delta > 0.0 {
                        rhs.iter_mut().zip(x).zip(terms).for_each(|((b, x), (_, value))| *b += delta * value * x);
                    }
                    self.factor.solve_in_place(rhs);
                    return Ok(true);
                }
                Err(SparseError::Singular { .. } | SparseError::NotPositiveDefinite { .. }) => {}
                Err(SparseError::NotFinite { .. }) => return Ok(false),
                Err(error) => return Err(error.into()),
            }
        }
        Ok(false)
    }
}

impl Rings {
    fn of(complex: &Complex, vertices: &[u32], number: &[u32]) -> Self {
        let (mut starts, mut to, mut around) = (vec![0], Vec::with_capacity(6 * vertices.len()), Vec::new());
        for v in vertices {
            complex.neighbors(*v, &mut around);
            to.extend(around.iter().map(|u| number[*u as usize]));
            starts.push(to.len());
        }
        Self { starts, weights: vec![0.0; to.len()], to }
    }

    fn around(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + Clone + '_ {
        let range = self.starts[i]..self.starts[i + 1];
        self.to[range.clone()].iter().zip(&self.weights[range]).map(|(j, w)| (*j as usize, *w))
    }

    /// Whether a vertex has too many neighbors for a row.
    fn is_hub(&self, i: usize) -> bool {
        self.starts[i + 1] - self.starts[i] > MAX_VALENCE
    }

    /// Pairs of distinct unknowns within two edges, each once; two edges that meet at a hub do not count. `None` if there are more
    /// than `most`.
    fn pairs(&self, most: usize) -> Option<Vec<(usize, usize)>> {
        let n = self.starts.len() - 1;
        let mut pairs = Vec::with_capacity(10 * n);
        let mut seen_from = vec![usize::MAX; n];
        for j in 0..n {
            for (i, _) in self.around(j) {
                let beyond = self.around(i).map(|(k, _)| k).filter(|_| !self.is_hub(i));
                for k in std::iter::once(i).chain(beyond) {
                    if k > j && seen_from[k] != j {
                        seen_from[k] = j;
                        pairs.push((j, k));
                    }
                }
            }
            if pairs.len() > most {
                return None;
            }
        }
        Some(pairs)
    }

    /// Computes the edge weights.
    fn weigh(&mut self, complex: &Complex, number: &[u32]) {
        self.weights.fill(0.0);
        for t in complex.faces() {
            let p = t.map(|v| complex.positions[v as usize]);
            for k in 0..3 {
                let (a, b) = (number[t[(k + 1) % 3] as usize], number[t[(k + 2) % 3] as usize]);
                let cotangent = half_cotangent(&p[k], &p[(k + 1) % 3], &p[(k + 2) % 3]);
                for (from, to) in [(a as usize, b), (b as usize, a)] {
                    let first = self.starts[from];
                    let slot = self.to[first..self.starts[from + 1]].iter().position(|u| *u == to);
                    self.weights[first + slot.expect("edges join neighbors")] += cotangent;
                }
            }
        }
        for w in &mut self.weights {
            *w = w.max(0.0);
        }
    }
}

/// Half the cotangent of the angle at `o`.
fn half_cotangent(o: &Point3<f64>, a: &Point3<f64>, b: &Point3<f64>) -> f64 {
    let (u, v) = (a - o, b - o);
    let cross = u.cross(&v).norm();
    let dot = u.dot(&v);
    0.5 * (dot / cross.max(f64::MIN_POSITIVE)).clamp(-MAX_COTANGENT, MAX_COTANGENT)
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn the_matrix_is_the_square_of_the_weighted_laplacian_and_the_diagonal() {
        let ball = shapes::icosphere(1);
        let squeezed: Vec<_> =
            ball.positions().iter().map(|p| Point3::new(p.x, 1.5 * p.y + 0.2 * p.z, 0.7 * p.z)).collect();
        let complex = Complex::new(squeezed.clone(), ball.triangles().to_vec());
        let n = squeezed.len();
        let w: Vec<f64> = (0..n).map(|i| 1.0 + 0.1 * (i as f64).sin()).collect();
        let d: Vec<f64> = (0..n).map(|i| 2.0 + (i as f64).cos()).collect();
        let mut l = DMatrix::zeros(n, n);
        for t in complex.faces() {
            let p = t.map(|v| squeezed[v as usize]);
            for k in 0..3 {
                let (a, b) = (t[(k + 1) % 3] as usize, t[(k + 2) % 3] as usize);
                let cotangent = half_cotangent(&p[k], &p[(k + 1) % 3], &p[(k + 2) % 3]);
                l[(a, b)] += cotangent;
                l[(b, a)] += cotangent;
            }
        }
        l.apply(|c: &mut f64| *c = c.max(0.0));
        for i in 0..n {
            l[(i, i)] = -l.row(i).sum();
            l.row_mut(i).scale_mut(w[i]);
        }
        let wanted = l.transpose() * &l + DMatrix::from_diagonal(&d.clone().into());
        let mut system = NormalEquations::analyze(&complex, f64::INFINITY).unwrap().unwrap();
        // Values of the previous matrix leave no trace.
        system.set(&complex, &d, &w);
        system.set(&complex, &w, &d);
        let mut outside = wanted.clone();
        for (i, j, slot) in system.matrix.pattern().entries() {
            let (found, wanted) = (system.matrix.values()[slot], wanted[(i, j)]);
            assert!((found - wanted).abs() < 1e-12 * wanted.abs().max(1.0), "({i}, {j}): {found}, not {wanted}");
            outside[(i, j)] = 0.0;
            outside[(j, i)] = 0.0;
        }
        assert_eq!(outside.amax(), 0.0);
        let x: Vec<f64> = (0..3 * n).map(|i| (i as f64).sin()).collect();
        let mut rhs: Vec<f64> = x
            .chunks(n)
            .flat_map(|x| (&wanted * nalgebra::DVector::from_row_slice(x)).as_slice().to_vec())
            .collect::<Vec<f64>>();
        assert!(system.solve_in_place(&mut rhs, &x, &Run::default()).unwrap());
        assert!(rhs.iter().zip(&x).all(|(found, x)| (found - x).abs() < 1e-10));
    }

    #[test]
    fn dense_systems_are_refused_before_their_entries_are_listed() {
        let n = 60;
        let point = |k: u32| Point3::new(f64::from(k).sin(), f64::from(k).cos(), f64::from(k));
        let all = (0..n).flat_map(|a| (0..a).map(move |b| [a, b, (b + 1) % n])).filter(|[a, _, c]| a != c);
        let complex = Complex::new((0..n).map(point).collect(), all.collect());
        // A dense factor of 60 columns takes 60³/3 multiplications.
        assert!(NormalEquations::analyze(&complex, 1e5).unwrap().is_some_and(|s| s.multiplications() <= 1e5));
        assert!(NormalEquations::analyze(&complex, 2e4).unwrap().is_none());
    }
}
