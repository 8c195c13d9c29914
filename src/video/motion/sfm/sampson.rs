//! Sampson distance to the epipolar constraint, and its least-squares minimization over any parametrized family of
//! matrices.
//!
//! For a matrix `M` (essential or fundamental) and a pair `x₁`, `x₂` the distance, in image coordinates, of the pair to the
//! nearest one that satisfies `x₂ᵀ M x₁ = 0` is to first order
//!
//! ```text
//! r = N / √D,    N = x₂ᵀ M x₁,    D = ‖(M x₁)_xy‖² + ‖(Mᵀ x₂)_xy‖².
//! ```
//!
//! With tangents `Tₖ = ∂M/∂θₖ` its derivative is `(Nₖ − ½ r Dₖ/√D) / √D`, `Nₖ = x₂ᵀ Tₖ x₁`, `Dₖ = 2 (M x₁)_xy·(Tₖ
//! x₁)_xy + 2 (Mᵀ x₂)_xy·(Tₖᵀ x₂)_xy`. [`refined`] minimizes `Σ wᵢ rᵢ²` by the Levenberg–Marquardt algorithm in the
//! coordinates of a [`Chart`].
//!
//! # Reference
//! Hartley, Zisserman, *Multiple View Geometry*, 2nd ed., section 11.4.3.

use nalgebra::{Const, DimMin, Matrix3, SMatrix, SVector};

use super::correspondence::Correspondence;

/// Relative energy decrease per step below which the minimization has converged.
const TOLERANCE: f64 = 1e-12;

/// A point of a `P`-dimensional manifold of matrices, with local coordinates around it.
pub(super) trait Chart<const P: usize>: Clone {
    /// `M` at this point.
    fn matrix(&self) -> Matrix3<f64>;

    /// `∂M/∂θₖ` at this point.
    fn tangents(&self) -> [Matrix3<f64>; P];

    /// The point at local coordinates `step`.
    fn moved(&self, step: &SVector<f64, P>) -> Self;
}

/// `r²`; infinite if the points of the pair are the two epipoles.
pub(super) fn squared_distance(m: &Matrix3<f64>, c: &Correspondence) -> f64 {
    let (line, back) = (m * c.first, m.tr_mul(&c.second));
    let n = c.second.dot(&line);
    let d = line.xy().norm_squared() + back.xy().norm_squared();
    if d > 0.0 { n * n / d } else { f64::INFINITY }
}

/// `Σ w r²` with its Gauss–Newton matrix and half of its gradient.
#[derive(Clone, Debug)]
pub(super) struct NormalEquations<const P: usize> {
    pub(super) normal: SMatrix<f64, P, P>,
    pub(super) gradient: SVector<f64, P>,
    pub(super) energy: f64,
}

/// The normal equations at the point `at`.
pub(super) fn normal_equations<const P: usize, C: Chart<P>>(
    at: &C,
    pairs: &[Correspondence],
    weights: &[f64],
) -> NormalEquations<P> {
    let (m, tangents): (Matrix3<f64>, [Matrix3<f64>; P]) = (at.matrix(), at.tangents());
    let mut sum = NormalEquations::<P> { normal: SMatrix::zeros(), gradient: SVector::zeros(), energy: 0.0 };
    for (c, &w) in pairs.iter().zip(weights) {
        let (line, back) = (m * c.first, m.tr_mul(&c.second));
        let d = line.xy().norm_squared() + back.xy().norm_squared();
        if !(w > 0.0 && d > 0.0) {
            continue;
        }
        let inverse = 1.0 / d.sqrt();
        let r = c.second.dot(&line) * inverse;
        let slope = SVector::<f64, P>::from_fn(|k, _| {
            let (t_line, t_back) = (tangents[k] * c.first, tangents[k].tr_mul(&c.second));
            let half_d = line.xy().dot(&t_line.xy()) + back.xy().dot(&t_back.xy());
            (c.second.dot(&t_line) - r * half_d * inverse) * inverse
        });
        sum.normal += (slope * w) * slope.transpose();
        sum.gradient += slope * (w * r);
        sum.energy += w * r * r;
    }
    sum
}

/// `Σ w r²` at the point `at`.
pub(super) fn energy<const P: usize, C: Chart<P>>(at: &C, pairs: &[Correspondence], weights: &[f64]) -> f64 {
    let m = at.matrix();
    let carrying = pairs.iter().zip(weights).filter(|(_, w)| **w > 0.0);
    carrying.map(|(c, w)| w * squared_distance(&m, c)).sum()
}

/// Local minimum of `Σ w r²` from the initial guess `initial`, after at most `steps` steps.
pub(super) fn refined<const P: usize, C: Chart<P>>(
    initial: C,
    pairs: &[Correspondence],
    weights: &[f64],
    steps: usize,
) -> C
where
    Const<P>: DimMin<Const<P>, Output = Const<P>>,
{
    let (mut at, mut damping) = (initial, 1e-4);
    let mut here = normal_equations(&at, pairs, weights);
    for _ in 0..steps {
        let mut damped = here.normal;
        for k in 0..P {
            damped[(k, k)] += damping * here.normal[(k, k)].max(1e-12 * here.normal.trace());
        }
        let Some(factor) = damped.cholesky() else { break };
        let next = at.moved(&-factor.solve(&here.gradient));
        let there = energy(&next, pairs, weights);
        if there < here.energy {
            let settled = here.energy - there <= TOLERANCE * here.energy;
            (at, damping) = (next, damping * 0.1);
            if settled {
                break;
            }
            here = normal_equations(&at, pairs, weights);
        } else {
            damping *= 10.0;
        }
    }
    at
}

/// Checks the tangents of a chart against central differences of [`Chart::moved`].
#[cfg(test)]
pub(super) fn assert_tangents<const P: usize, C: Chart<P>>(at: &C) {
    let h = 1e-6;
    for (k, tangent) in at.tangents().iter().enumerate() {
        let mut step = SVector::<f64, P>::zeros();
        step[k] = h;
        let numeric = (at.moved(&step).matrix() - at.moved(&-step).matrix()) / (2.0 * h);
        assert!((numeric - tangent).norm() < 1e-8, "tangent {k}: {numeric} against {tangent}");
    }
}
