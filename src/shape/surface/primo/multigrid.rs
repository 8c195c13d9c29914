//! The linear system over many clusters: conjugate gradients, preconditioned by a multigrid cycle over the coarser ones.
//!
//! A rigid motion `(ω, v)` of a cluster is one of each of its parts: `ω` is the same, and the velocity of the center of a part at
//! the arm `a` is `v + ω × a`. This is the prolongation `P`; its transpose restricts. On each level but the last one a sweep of
//! Gauss–Seidel goes before the correction by the next level and one, backwards, after it; the last level is factored.
//!
//! # Reference
//! U. Trottenberg, C. W. Oosterlee, A. Schüller, *Multigrid*, 2001, sections 2.4 and 7.8.

use nalgebra::{Matrix6, Vector3};

use super::clusters::Clusters;
use plumbline_num::sparse::{BlockGaussSeidel, BlockMatrix, Cholesky, Preconditioner, SparseError};

/// How the clusters of a level are parts of those of the next one.
#[derive(Debug)]
pub(super) struct Transfer {
    /// For each cluster, the one of the next level that it is a part of, and its arm there: from that center to its own.
    parts: Vec<(u32, Vector3<f64>)>,
    /// Number of clusters of the next level.
    parents: usize,
}

impl Transfer {
    /// From one partition to a coarser one, with the centers of both.
    pub(super) fn new(
        (fine, centers): (&Clusters, &[Vector3<f64>]),
        (coarse, parents): (&Clusters, &[Vector3<f64>]),
    ) -> Self {
        let part = |(c, center): (usize, &Vector3<f64>)| {
            let parent = coarse.of_body[fine.members(c)[0] as usize];
            (parent, center - parents[parent as usize])
        };
        Self { parts: centers.iter().enumerate().map(part).collect(), parents: coarse.count }
    }

    /// `Pᵀ A P`.
    pub(super) fn coarsen(&self, fine: &BlockMatrix<6>, coarse: &mut BlockMatrix<6>) {
        coarse.clear();
        for (i, &(row, row_arm)) in self.parts.iter().enumerate() {
            for (j, block) in fine.row(i).skip_while(|&(j, _)| j < i) {
                let (column, column_arm) = self.parts[j];
                let block = carried(block, &row_arm, &column_arm);
                match (row == column, i == j) {
                    (false, _) => coarse.add(row as usize, column as usize, &block),
                    (true, true) => coarse.add_diagonal(row as usize, &block),
                    (true, false) => coarse.add_diagonal(row as usize, &(block + block.transpose())),
                }
            }
        }
    }

    /// `Pᵀ r`.
    pub(super) fn restrict(&self, r: &[f64]) -> Vec<f64> {
        let mut sums = vec![0.0; 6 * self.parents];
        for (r, (parent, arm)) in r.chunks_exact(6).zip(&self.parts) {
            let (torque, force) = (Vector3::from_column_slice(&r[..3]), Vector3::from_column_slice(&r[3..]));
            let torque = torque + arm.cross(&force);
            let sum = &mut sums[6 * *parent as usize..][..6];
            for k in 0..3 {
                sum[k] += torque[k];
                sum[3 + k] += force[k];
            }
        }
        sums
    }

    /// Adds `P x`.
    pub(super) fn prolong(&self, x: &[f64], z: &mut [f64]) {
        for (z, (parent, arm)) in z.chunks_exact_mut(6).zip(&self.parts) {
            let x = &x[6 * *parent as usize..][..6];
            let angular = Vector3::from_column_slice(&x[..3]);
            let linear = Vector3::from_column_slice(&x[3..]) + angular.cross(arm);
            for k in 0..3 {
                z[k] += angular[k];
                z[3 + k] += linear[k];
            }
        }
    }
}

/// `P_iᵀ A P_j` for two parts at these arms: `v + ω × a = v − [a] ω`.
fn carried(block: &Matrix6<f64>, row_arm: &Vector3<f64>, column_arm: &Vector3<f64>) -> Matrix6<f64> {
    let mut block = *block;
    let linear = block.fixed_view::<6, 3>(0, 3) * column_arm.cross_matrix();
    let mut angular = block.fixed_view_mut::<6, 3>(0, 0);
    angular -= linear;
    let linear = row_arm.cross_matrix() * block.fixed_view::<3, 6>(3, 0);
    let mut angular = block.fixed_view_mut::<3, 6>(0, 0);
    angular += linear;
    block
}

/// One cycle over all levels.
pub(super) struct Cycle<'a> {
    levels: Vec<(BlockGaussSeidel<'a, 6>, Transfer)>,
    last: &'a mut Cholesky,
}

impl<'a> Cycle<'a> {
    /// Levels from fine to coarse, each with its way to the next one; the factor of the last.
    ///
    /// # Errors
    /// [`SparseError::Pivot`] where a block of a diagonal is not positive definite.
    pub(super) fn new(
        levels: impl Iterator<Item = (&'a BlockMatrix<6>, Transfer)>,
        last: &'a mut Cholesky,
    ) -> Result<Self, SparseError> {
        let level = |(matrix, transfer)| Ok((BlockGaussSeidel::new(matrix)?, transfer));
        Ok(Self { levels: levels.map(level).collect::<Result<_, SparseError>>()?, last })
    }
}

impl Preconditioner for Cycle<'_> {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        cycle(&self.levels, self.last, r, z);
    }
}

fn cycle(levels: &[(BlockGaussSeidel<'_, 6>, Transfer)], last: &mut Cholesky, r: &[f64], z: &mut [f64]) {
    let Some(((smoother, transfer), coarser)) = levels.split_first() else {
        z.copy_from_slice(r);
        return last.solve_in_place(z);
    };
    let mut left = vec![0.0; r.len()];
    smoother.forwards_from_zero(r, z, &mut left);
    let restricted = transfer.restrict(&left);
    let mut correction = vec![0.0; restricted.len()];
    cycle(coarser, last, &restricted, &mut correction);
    transfer.prolong(&correction, z);
    smoother.backwards(r, z);
}
