//! Harmonic interpolation of painted times.
//!
//! ```text
//! min Σ w_ij (τᵢ − τⱼ)²      s.t.  τ = the painted times
//! ```
//!
//! with the non-negative weights of the intrinsic Delaunay triangulation: no time is outside the range of the painted ones.
//! Connected components without paint have a given time.

use nalgebra::Point3;

use super::MorphError;
use crate::mesh::TriMesh;
use crate::mesh::operators::{CotangentRule, Cotangents, EdgeWeights, factored_laplacian};
use plumbline_num::energy::ConstrainedLaplacian;
use plumbline_num::run::Run;
use plumbline_num::sparse::Ordering;
use plumbline_num::spatial::numbered_components;

/// Minimum edge weight relative to the mean: keeps the matrix positive definite whatever the angles.
const MIN_WEIGHT: f64 = 1e-6;

/// The harmonic interpolation of painted times; `elsewhere` on connected components without paint.
///
/// # Errors
/// [`MorphError::Numerics`].
///
/// # Panics
/// Unless there is one entry per vertex.
pub fn time_field(mesh: &TriMesh, painted: &[Option<f64>], elsewhere: f64, run: &Run) -> Result<Vec<f64>, MorphError> {
    assert_eq!(painted.len(), mesh.vertex_count(), "one entry per vertex");
    let (component, count) = numbered_components(mesh.vertex_count(), mesh.triangles());
    let mut reached = vec![false; count];
    painted
        .iter()
        .zip(&component)
        .filter(|(p, _)| p.is_some())
        .for_each(|(_, component)| reached[*component as usize] = true);
    let given: Vec<Option<f64>> = painted
        .iter()
        .zip(&component)
        .map(|(p, component)| p.or((!reached[*component as usize]).then_some(elsewhere)))
        .collect();
    let cotangents = Cotangents::new(mesh, CotangentRule::IntrinsicDelaunay);
    let weights = EdgeWeights::cotangent(mesh.vertex_count(), &cotangents);
    let mean = weights.weights().iter().sum::<f64>() / weights.weights().len().max(1) as f64;
    let edges = weights.iter().map(|(i, j, w)| (i, j, w.max(MIN_WEIGHT * mean)));
    let laplacian = ConstrainedLaplacian::new(mesh.vertex_count(), edges, |v| given[v].is_some())?;
    let positions = mesh.positions().iter().map(|p: &Point3<f64>| p.coords.into()).collect();
    let mut solver = factored_laplacian(laplacian, &Ordering::NestedDissection(positions), run)?;
    Ok(solver.interpolate(|v| [given[v].unwrap_or_default()]).as_flattened().to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn times_are_linear_along_a_tube_with_painted_ends() {
        let tube = shapes::tube(12, 20, 1.0, 5.0);
        let z: Vec<f64> = tube.positions().iter().map(|p| p.z).collect();
        let (low, high) = z.iter().fold((f64::MAX, f64::MIN), |(l, h), z| (l.min(*z), h.max(*z)));
        let paint = |z: &f64| if *z < low + 1e-9 { Some(0.2) } else { (*z > high - 1e-9).then_some(0.8) };
        let painted: Vec<_> = z.iter().map(paint).collect();
        let field = time_field(&tube, &painted, 0.0, &Run::default()).unwrap();
        for (t, z) in field.iter().zip(&z) {
            assert!((t - (0.2 + 0.6 * (z - low) / (high - low))).abs() < 1e-9);
        }
    }

    #[test]
    fn times_obey_the_maximum_principle_and_unpainted_components_have_their_own() {
        let first = shapes::cactus(9);
        let n = first.vertex_count();
        let both = shapes::disjoint(&[first, shapes::icosphere(1)]);
        let mut painted = vec![None; both.vertex_count()];
        (painted[3], painted[n / 2], painted[n - 1]) = (Some(0.0), Some(1.0), Some(0.4));
        let field = time_field(&both, &painted, 0.7, &Run::default()).unwrap();
        assert!(field[..n].iter().all(|t| (-1e-9..=1.0 + 1e-9).contains(t)));
        assert!(field[n..].iter().all(|t| *t == 0.7));
        assert_eq!((field[3], field[n / 2], field[n - 1]), (0.0, 1.0, 0.4));
    }
}
