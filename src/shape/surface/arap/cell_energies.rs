//! The ARAP energy cell by cell: where a surface resists.
//!
//! ```text
//! Eᵢ(x) = min over R   ⅓ Σ_{t ∋ i} Σ_{e ∈ t} h_e |e'(x) − R e|²,        Σᵢ Eᵢ(x) = E(x) of spokes and rims
//! ```

use nalgebra::{Point3, Vector3};

use super::cells::{CellKind, Cells};
use crate::mesh::TriMesh;
use crate::mesh::operators::{CotangentRule, Cotangents};
use crate::surface::SurfaceError;
use crate::surface::lanes::Lanes;

/// ARAP energies of the vertex cells of a surface (spokes and rims) against its rest shape, squared mesh units. Their sum is the energy
/// that [`Method::Arap`](crate::surface::Method::Arap) minimizes, whichever method gave the positions.
///
/// ```
/// use plumbline_shape::mesh::shapes;
/// use plumbline_shape::surface::{CellEnergies, CotangentRule};
///
/// let bar = shapes::bar([2, 2, 10], [1.0, 1.0, 5.0]);
/// let mut energies = CellEnergies::new(&bar, CotangentRule::default());
/// let shifted: Vec<_> = bar.positions().iter().map(|p| p + nalgebra::Vector3::x()).collect();
/// assert!(energies.of_vertices(&shifted)?.iter().all(|e| e.abs() < 1e-12));
/// # Ok::<(), plumbline_shape::surface::SurfaceError>(())
/// ```
#[derive(Clone, Debug)]
pub struct CellEnergies {
    cotangents: Cotangents,
    cells: Cells,
    rest: Vec<Lanes>,
    center: Vector3<f64>,
}

impl CellEnergies {
    /// The cells of a surface at rest.
    pub fn new(rest: &TriMesh, cotangents: CotangentRule) -> Self {
        let center = rest.bounding_box().map_or(Vector3::zeros(), |(low, high)| nalgebra::center(&low, &high).coords);
        let positions: Vec<Lanes> = rest.positions().iter().map(|p| Lanes::point((p.coords - center).into())).collect();
        let cotangents = Cotangents::new(rest, cotangents);
        let cells = Cells::new(CellKind::SpokesAndRims, &positions, &cotangents, 1.0);
        Self { cotangents, cells, rest: positions, center }
    }

    /// The energy of each vertex cell at these positions, one per vertex. Not negative but for rounding, and for surfaces with negative
    /// areas of their cells.
    ///
    /// # Errors
    /// [`SurfaceError::PerVertex`] for another number of positions.
    pub fn of_vertices(&mut self, positions: &[Point3<f64>]) -> Result<Vec<f64>, SurfaceError> {
        let vertices = self.rest.len();
        if positions.len() != vertices {
            return Err(SurfaceError::PerVertex { what: "positions", given: positions.len(), vertices });
        }
        let x: Vec<Lanes> = positions.iter().map(|p| Lanes::point((p.coords - self.center).into())).collect();
        self.cells.reset();
        self.cells.fit(&x, &mut vec![Lanes::ZERO; vertices]);
        let vector = |v: &[Lanes], i: u32, j: u32| Vector3::from((v[j as usize] - v[i as usize]).xyz());
        let mut energies = vec![0.0; vertices];
        for (corners, edges) in self.cotangents.triangles().iter().zip(self.cotangents.edges()) {
            for &v in corners {
                let rotation = self.cells.rotation(v as usize);
                let residual = |(i, j, h): (u32, u32, f64)| {
                    h * (vector(&x, i, j) - rotation * vector(&self.rest, i, j)).norm_squared()
                };
                energies[v as usize] += edges.into_iter().map(residual).sum::<f64>() / 3.0;
            }
        }
        Ok(energies)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;
    use crate::surface::{Convergence, DeformOptions, Deformer, HandlePose, Handles, InitialGuess, Method};
    use plumbline_num::run::Run;

    #[test]
    fn the_energies_of_all_cells_sum_to_that_of_the_method() {
        let bar = shapes::bar([3, 3, 12], [1.0, 1.0, 4.0]);
        let handles = Handles::exact([0, bar.vertex_count() as u32 - 1]).unwrap();
        let mut targets: Vec<_> = handles.vertices().iter().map(|v| bar.positions()[*v as usize]).collect();
        targets[1] += Vector3::new(1.0, 0.5, -0.8);
        let run = Run::default();
        let mut deformer = Deformer::new(Method::Arap, &bar, &handles, &DeformOptions::default(), &run).unwrap();
        let convergence = Convergence { max_iterations: 500, tolerance: 1e-12 };
        let done = deformer.deform(&HandlePose::new(targets), InitialGuess::Auto, &convergence, &run).unwrap();
        let expected = *done.report.energies.last().unwrap();
        let mut energies = CellEnergies::new(&bar, CotangentRule::default());
        let of_vertices = energies.of_vertices(&done.positions).unwrap();
        let sum: f64 = of_vertices.iter().sum();
        assert!((sum - expected).abs() < 1e-6 * expected, "{sum} {expected}");
        assert!(of_vertices.iter().all(|e| *e >= -1e-12), "spokes and rims are not negative");
    }

    #[test]
    fn another_number_of_positions_is_refused() {
        let ball = shapes::icosphere(1);
        let error = CellEnergies::new(&ball, CotangentRule::default()).of_vertices(&[]).unwrap_err();
        assert!(error.to_string().contains("0 positions for a mesh of 42 vertices"), "{error}");
    }
}
