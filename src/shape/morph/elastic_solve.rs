//! Poisson reconstruction of positions from edge vectors: one factor, any number of right-hand sides.
//!
//! ```text
//! min Σ_t Σ_{e ∈ t} h_e |xᵢ − xⱼ − d_e|²       ⇔       L x = Σ ± h d
//! ```
//!
//! With constrained vertices, `x` is solved for the others. Without them `L` determines each connected component up to a
//! translation, which [`ElasticSolve::center`] fixes by the weighted mean of its vertices.

use nalgebra::{Point3, Vector3};

use super::MorphError;
use crate::mesh::operators::factored_laplacian;
use plumbline_num::energy::{ConstrainedLaplacian, FactoredLaplacian};
use plumbline_num::run::Run;
use plumbline_num::sparse::Ordering;
use plumbline_num::spatial::numbered_components;

/// A factored Laplacian of a surface.
#[derive(Debug)]
pub(super) struct ElasticSolve {
    triangles: Vec<[u32; 3]>,
    half: Vec<[f64; 3]>,
    system: FactoredLaplacian,
    /// Connected component of each vertex; unused with constrained vertices.
    component: Vec<u32>,
    components: usize,
}

impl ElasticSolve {
    /// With some vertices constrained, at least one per component, or without constraints.
    pub(super) fn new(
        triangles: &[[u32; 3]],
        half: Vec<[f64; 3]>,
        at: &[Point3<f64>],
        fixed: Option<&[bool]>,
        run: &Run,
    ) -> Result<Self, MorphError> {
        let (component, components) = numbered_components(at.len(), triangles);
        let mut met = vec![false; components];
        let first_of_component = |&p: &u32| !std::mem::replace(&mut met[p as usize], true);
        let fixed = fixed.map_or_else(|| component.iter().map(first_of_component).collect(), <[bool]>::to_vec);
        let edges = triangles
            .iter()
            .zip(&half)
            .flat_map(|(t, h)| (0..3).map(move |k| (t[(k + 1) % 3] as usize, t[(k + 2) % 3] as usize, h[k])));
        let laplacian = ConstrainedLaplacian::new(at.len(), edges, |v| fixed[v])?;
        let positions = at.iter().map(|p| p.coords.into()).collect();
        let system = factored_laplacian(laplacian, &Ordering::NestedDissection(positions), run)?;
        Ok(Self { triangles: triangles.to_vec(), half, system, component, components })
    }

    /// Weights of edges, by the corner opposite.
    pub(super) fn half(&self) -> &[[f64; 3]] {
        &self.half
    }

    /// Updates `x` so that its edges, each opposite a corner of a triangle, fit `edges` best. Constrained vertices stay, or the
    /// first vertex of each component.
    pub(super) fn follow(&mut self, edges: impl Fn(usize) -> [Vector3<f64>; 3], x: &mut [Point3<f64>]) {
        self.follow_pushed(edges, &[], x);
    }

    /// The same with a force on every vertex, or none.
    pub(super) fn follow_pushed(
        &mut self,
        edges: impl Fn(usize) -> [Vector3<f64>; 3],
        forces: &[Vector3<f64>],
        x: &mut [Point3<f64>],
    ) {
        let unknown = self.system.unknowns();
        let mut rhs = vec![[0.0; 3]; self.system.free().len()];
        for (force, &k) in forces.iter().zip(unknown) {
            if let Some(sum) = rhs.get_mut(k as usize) {
                *sum = (*force).into();
            }
        }
        for (t, (v, h)) in self.triangles.iter().zip(&self.half).enumerate() {
            let wanted = edges(t);
            for k in 0..3 {
                let (i, j) = (v[(k + 1) % 3] as usize, v[(k + 2) % 3] as usize);
                let missing = (wanted[k] - (x[j] - x[i])) * h[k];
                for (v, sign) in [(j, 1.0), (i, -1.0)] {
                    if let Some(sum) = rhs.get_mut(unknown[v] as usize) {
                        (0..3).for_each(|c| sum[c] += sign * missing[c]);
                    }
                }
            }
        }
        self.system.solve(&mut rhs);
        for (x, &k) in x.iter_mut().zip(self.system.unknowns()) {
            if let Some(step) = rhs.get(k as usize) {
                *x += Vector3::from(*step);
            }
        }
    }

    /// Weights of the edges at each vertex, summed.
    pub(super) fn diagonal(&self) -> Vec<f64> {
        let mut sums = vec![0.0; self.component.len()];
        for (v, h) in self.triangles.iter().zip(&self.half) {
            (0..3).for_each(|k| sums[v[k] as usize] += h[(k + 1) % 3] + h[(k + 2) % 3]);
        }
        sums
    }

    /// Translates each component so that the weighted mean of its vertices is that in `like`.
    pub(super) fn center(&self, x: &mut [Point3<f64>], like: &[Point3<f64>], weights: &[f64]) {
        let mut sums = vec![(Vector3::zeros(), 0.0); self.components];
        for (v, (x, y)) in x.iter().zip(like).enumerate() {
            let sum = &mut sums[self.component[v] as usize];
            *sum = (sum.0 + (y - x) * weights[v], sum.1 + weights[v]);
        }
        for (x, &component) in x.iter_mut().zip(&self.component) {
            let (sum, weight) = sums[component as usize];
            *x += if weight > 0.0 { sum / weight } else { sum };
        }
    }

    /// Component of each vertex, and their number.
    pub(super) fn components(&self) -> (&[u32], usize) {
        (&self.component, self.components)
    }
}
