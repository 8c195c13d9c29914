//! Laplacian smoothing of weights.

use std::collections::BTreeMap;

use super::super::{CharacterError, SkinWeights};
use crate::mesh::TriMesh;
use crate::mesh::operators::EdgeWeights;
use plumbline_num::run::Run;

impl SkinWeights {
    /// Each iteration replaces the weights of every vertex by the average of its own and the mean of its neighbors. Rows gain the
    /// neighbors' joints.
    ///
    /// # Errors
    /// [`CharacterError::PerVertex`] for another mesh.
    pub fn smoothed(&self, mesh: &TriMesh, iterations: usize, run: &Run) -> Result<Self, CharacterError> {
        let (given, vertices) = (self.vertex_count(), mesh.vertex_count());
        CharacterError::check_per_vertex("rows of weights", given, vertices)?;
        let mut neighbors = vec![Vec::new(); vertices];
        for &[i, j] in EdgeWeights::uniform(mesh).edges() {
            neighbors[i as usize].push(j as usize);
            neighbors[j as usize].push(i as usize);
        }
        let mut weights = self.clone();
        for _ in 0..iterations {
            run.check()?;
            let row = |(v, around): (usize, &Vec<usize>)| {
                let mut sum: BTreeMap<u32, f64> = BTreeMap::new();
                let own = if around.is_empty() { 1.0 } else { 0.5 };
                weights.row(v).iter().for_each(|i| *sum.entry(i.joint).or_default() += own * i.weight);
                let share = 0.5 / around.len().max(1) as f64;
                let others = around.iter().flat_map(|&n| weights.row(n));
                others.for_each(|i| *sum.entry(i.joint).or_default() += share * i.weight);
                sum
            };
            let rows: Vec<_> = neighbors.iter().enumerate().map(row).collect();
            weights = Self::new(self.joint_count(), rows)?;
        }
        Ok(weights)
    }

    /// The rows of these vertices, in their order.
    #[must_use]
    pub(super) fn gathered(&self, vertices: &[u32]) -> Self {
        let row = |v: &u32| self.row(*v as usize).iter().map(|i| (i.joint, i.weight)).collect::<Vec<_>>();
        Self::new(self.joint_count(), vertices.iter().map(row)).expect("rows that were valid")
    }
}
