//! Smoothing of values along the curve, proportional to the local width of the shape.
//!
//! For values `x` at the nodes, the smoothed values `y` minimize
//!
//! `Σᵢ mᵢ ‖yᵢ − xᵢ‖² + Σ_(i,j) (σ r / l)² ‖yᵢ − yⱼ‖²`
//!
//! over nodes and edges, with `l` the length of an edge and `r` the local radius: along a uniform branch a weighted mean with weights that fall
//! by `e` over `σ r`. Below the width of a trunk the course of a curve is not significant, within a finger it is: the same `σ` suits both. A
//! large mass `m` fixes a node.

use nalgebra::Vector3;

use super::curve_graph::CurveGraph;
use crate::character::CharacterError;
use plumbline_num::energy::ConstrainedLaplacian;
use plumbline_num::run::Run;
use plumbline_num::sparse::{Cholesky, Ordering};

/// Mass of a fixed node: large beside the smoothing weights, without loss of digits in the factorization.
const FIXED_MASS: f64 = 1e6;
/// Lower bound of edge lengths: bounds the weights.
const MIN_LENGTH: f64 = 1e-3;

/// Upper bound of the smoothing weights: keeps the system well conditioned. Weights are at most 10⁶ where the shape is as wide as the
/// sphere of equal area.
const MAX_WEIGHT: f64 = 1e8;

/// The factored system of a curve.
pub(super) struct Fairing {
    number: Vec<u32>,
    masses: Vec<f64>,
    factor: Cholesky,
}

impl Fairing {
    /// Smoothing width `share` times the local radius; nodes with `fixed` keep their values.
    pub(super) fn new(
        graph: &CurveGraph,
        alive: &[u32],
        radii: &[f64],
        share: f64,
        fixed: impl Fn(u32) -> bool,
        run: &Run,
    ) -> Result<Self, CharacterError> {
        let mut number = vec![u32::MAX; graph.nodes.len()];
        alive.iter().zip(0..).for_each(|(v, i)| number[*v as usize] = i);
        let slot = |v: u32| number[v as usize] as usize;
        let edges =
            || alive.iter().flat_map(|v| graph.neighbors(*v).iter().filter(move |u| *v < **u).map(move |u| (*v, *u)));
        let masses: Vec<f64> = alive.iter().map(|v| if fixed(*v) { FIXED_MASS } else { 1.0 }).collect();
        let weighted = edges().map(|(a, b)| {
            let r = 0.5 * (radii[a as usize] + radii[b as usize]);
            (slot(a), slot(b), (share * r / graph.length(a, b).max(MIN_LENGTH)).powi(2).min(MAX_WEIGHT))
        });
        let terms = masses.iter().enumerate().map(|(i, mass)| (i, i, *mass)).chain(weighted);
        let at = alive.iter().map(|v| graph.nodes[*v as usize].coords.into()).collect();
        let laplacian = ConstrainedLaplacian::new(alive.len(), terms, |_| false)?;
        let mut factor = Cholesky::analyze(laplacian.matrix().pattern(), &Ordering::NestedDissection(at))?;
        factor.reserve_columns(3);
        factor.factor(laplacian.matrix(), run)?;
        Ok(Self { number, masses, factor })
    }

    /// Smooths values at the nodes.
    pub(super) fn apply(&mut self, values: &mut [Vector3<f64>]) {
        let n = self.masses.len();
        let mut rhs = vec![0.0; 3 * n];
        let alive = || self.number.iter().enumerate().filter(|(_, i)| **i != u32::MAX).map(|(v, i)| (v, *i as usize));
        for (v, i) in alive() {
            for k in 0..3 {
                rhs[k * n + i] = self.masses[i] * values[v][k];
            }
        }
        self.factor.solve_in_place(&mut rhs);
        for (v, i) in alive() {
            values[v] = Vector3::new(rhs[i], rhs[n + i], rhs[2 * n + i]);
        }
    }
}
