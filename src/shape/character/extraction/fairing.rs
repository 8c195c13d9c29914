//! Values along the curve are evened out as far as the shape is wide.
//!
//! Of values `x` at the nodes, those `y` are found that minimize
//!
//! `Σᵢ mᵢ ‖yᵢ − xᵢ‖² + Σ_(i,j) (σ r / l)² ‖yᵢ − yⱼ‖²`
//!
//! over nodes and edges, `l` the length of an edge and `r` the radius of the shape about it: along an even branch, a mean with weights that
//! fall by `e` over `σ r`. Within a trunk the way of a curve says little below the width of the trunk, within a finger much: the same
//! `σ` is right for both. A large mass `m` holds a node.

use nalgebra::Vector3;

use super::error::ExtractionError;
use super::web::Web;
use plumbline_num::energy::ConstrainedLaplacian;
use plumbline_num::run::Run;
use plumbline_num::sparse::{Cholesky, Ordering};

/// Mass of a node that is held.
const HELD: f64 = 1e6;
/// Edges count as at least this long.
const MIN_LENGTH: f64 = 1e-3;

/// The factored system of one curve.
pub(super) struct Fairing {
    number: Vec<u32>,
    masses: Vec<f64>,
    factor: Cholesky,
}

impl Fairing {
    /// Of width `share` times the radius about each node; nodes that are `held` keep their values.
    pub(super) fn new(
        web: &Web,
        alive: &[u32],
        radii: &[f64],
        share: f64,
        held: impl Fn(u32) -> bool,
        run: &Run,
    ) -> Result<Self, ExtractionError> {
        let mut number = vec![u32::MAX; web.nodes.len()];
        alive.iter().zip(0..).for_each(|(v, i)| number[*v as usize] = i);
        let slot = |v: u32| number[v as usize] as usize;
        let edges =
            || alive.iter().flat_map(|v| web.neighbors(*v).iter().filter(move |u| *v < **u).map(move |u| (*v, *u)));
        let masses: Vec<f64> = alive.iter().map(|v| if held(*v) { HELD } else { 1.0 }).collect();
        let weighted = edges().map(|(a, b)| {
            let r = 0.5 * (radii[a as usize] + radii[b as usize]);
            (slot(a), slot(b), (share * r / web.length(a, b).max(MIN_LENGTH)).powi(2))
        });
        let terms = masses.iter().enumerate().map(|(i, mass)| (i, i, *mass)).chain(weighted);
        let at = alive.iter().map(|v| web.nodes[*v as usize].coords.into()).collect();
        let factored = ConstrainedLaplacian::new(alive.len(), terms, |_| false).and_then(|laplacian| {
            let mut factor = Cholesky::analyze(laplacian.matrix().pattern(), &Ordering::NestedDissection(at))?;
            factor.reserve_columns(3);
            factor.factor(laplacian.matrix(), run)?;
            Ok(factor)
        });
        let factor = factored.map_err(ExtractionError::from_sparse)?;
        Ok(Self { number, masses, factor })
    }

    /// Evens values of the nodes out.
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
