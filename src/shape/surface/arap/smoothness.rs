//! Rotation smoothness: penalizes differences between neighboring rotations, which resists bending and keeps the volume of
//! twisted bars.
//!
//! ```text
//! E(x, R) = E_ARAP(x, R) + α A Σ_ij |w_ij| |Rᵢ − Rⱼ|²          A the area of the surface
//! ```
//!
//! All rotations are fitted at once to `Sᵢ + Σⱼ k_ij Rⱼᵀ + Σⱼ k_ij Rᵢᵀ`, with those of the previous iteration on the right and
//! `k = α A |w|`. The last term is constant on rotations; it makes the coupling convex, so that its linearization is a lower
//! bound of the maximized term and the energy never increases, whatever the order of the cells.
//!
//! # Reference
//! Z. Levi, C. Gotsman, *Smooth rotation enhanced as-rigid-as-possible mesh animation*, TVCG 21 (2015).

use nalgebra::Matrix3;

use crate::mesh::operators::EdgeWeights;
use plumbline_num::math::Lists;

/// The coupling of the rotations of vertex cells.
#[derive(Debug)]
pub(in crate::surface) struct Smoothness {
    /// Neighbors of each cell, with their coupling `k`.
    neighbors: Lists<(u32, f64)>,
}

impl Smoothness {
    /// Couplings `strength · |w_ij|`; `strength = α A` in squared mesh units.
    pub(super) fn new(weights: &EdgeWeights, strength: f64) -> Self {
        let both = weights.iter().flat_map(|(i, j, w)| {
            let (i, j, k) = (i as u32, j as u32, strength * w.abs());
            [(i, (j, k)), (j, (i, k))]
        });
        Self { neighbors: Lists::new(weights.vertex_count(), both) }
    }

    /// Number of cells.
    pub(super) fn len(&self) -> usize {
        self.neighbors.len()
    }

    /// `Σⱼ k_ij (Rⱼ + Rᵢ)`.
    pub(super) fn coupling(&self, cell: usize, rotations: &[Matrix3<f64>]) -> Matrix3<f64> {
        let own = rotations[cell];
        self.neighbors.of(cell).iter().fold(Matrix3::zeros(), |sum, &(j, k)| sum + (rotations[j as usize] + own) * k)
    }

    /// `Σ_ij k_ij |Rᵢ − Rⱼ|²`, each pair once.
    pub(super) fn energy(&self, rotations: &[Matrix3<f64>]) -> f64 {
        let of_cell = |cell: usize| {
            let neighbors = self.neighbors.of(cell).iter();
            neighbors.map(|&(j, k)| k * (rotations[j as usize] - rotations[cell]).norm_squared()).sum::<f64>()
        };
        0.5 * (0..self.len()).map(of_cell).sum::<f64>()
    }
}
