//! Modal analysis: the low vibration modes of a surface, and its near-rigid parts.
//!
//! ```text
//! H u = λ M u,     H the ARAP energy near rest (`hessian`),  M the areas of the vertices' cells
//! ```
//!
//! The six rigid motions of each connected component have `λ = 0` and are excluded. The lowest modes that follow bend the surface
//! where it is compliant: at the joints of limbs.
//!
//! # Reference
//! Q. Huang, M. Wicke, B. Adams, L. Guibas, *Shape decomposition using modal analysis*, Computer Graphics Forum 28 (2009).

mod hessian;
mod parts;
#[cfg(test)]
mod tests;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::SurfaceError;
use crate::mesh::TriMesh;
use crate::mesh::operators::{CotangentRule, Cotangents, barycentric_areas};
use plumbline_num::optim::lanczos::{LanczosOptions, ShiftedPencil};
use plumbline_num::options::OptionError;
use plumbline_num::run::Run;
use plumbline_num::sparse::{CompactFactor, Ordering};

pub use parts::{PartCount, Parts, PartsOptions, parts};

/// Shift σ of the shift-and-invert iteration, relative to the ratio of the mean diagonals of `H` and `M`: below the lowest mode
/// for fast convergence, above rounding for a stable factor.
const SHIFT: f64 = 1e-9;
/// Minimum vertex area over the mean: that of vertices of degenerate triangles would be 0.
const MIN_MASS: f64 = 1e-6;

/// Options of the modal analysis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default)]
pub struct ModesOptions {
    /// Cotangent weights of edges; change it where obtuse triangles give negative weights.
    pub cotangents: CotangentRule,
    /// Residual below which a mode has converged, in (0, 1); default 10⁻⁶. The relative error of its value is about the square.
    #[serde(skip)]
    pub tolerance: f64,
}

impl Default for ModesOptions {
    fn default() -> Self {
        Self { cotangents: CotangentRule::Raw, tolerance: 1e-6 }
    }
}

/// Low modes of a surface, lowest first.
#[derive(Clone, Debug, PartialEq)]
pub struct Modes {
    /// `λ`: energy over mean squared displacement; 1/length².
    pub values: Vec<f64>,
    /// Displacement of each vertex; `Σ m ‖u‖² = 1` with the vertex areas `m`. 0 for vertices of no triangle.
    pub vectors: Vec<Vec<Vector3<f64>>>,
    /// Relative errors of `1/λ`: residuals of the shifted and inverted pencil.
    pub residuals: Vec<f64>,
    /// Number of excluded rigid motions: six per component, fewer for one that is a line or a point.
    pub rigid: usize,
    /// Whether all residuals are below the tolerance.
    pub converged: bool,
}

/// The `count` lowest modes of a surface without rigid motions; fewer if there are no more.
///
/// # Errors
/// [`SurfaceError::Option`] for a tolerance out of range, [`SurfaceError::IllConditioned`] where triangles are too thin, [`SurfaceError::Solve`] where the surface is too large to be
/// factored or so many triangles meet at vertices that the work would be out of proportion to its size, [`SurfaceError::Interrupted`].
pub fn modes(mesh: &TriMesh, count: usize, options: &ModesOptions, run: &Run) -> Result<Modes, SurfaceError> {
    let tolerance = options.tolerance;
    OptionError::check(tolerance > 0.0 && tolerance < 1.0, "tolerance", tolerance, "above 0 and below 1")?;
    let (vertices, _) = mesh.referenced_and_isolated();
    let used = mesh.restricted(&vertices, mesh.triangles().iter().copied());
    if used.triangle_count() == 0 {
        return Ok(Modes { values: vec![], vectors: vec![], residuals: vec![], rigid: 0, converged: true });
    }
    run.check()?;
    let positions = used.positions().iter().map(|p| p.coords.into()).collect();
    let order = Ordering::NestedDissection(positions);
    let h = hessian::hessian(&used, &Cotangents::new(&used, options.cotangents), &order, run)
        .map_err(|error| SurfaceError::of_factor(error, 1, |vertex| vertices[vertex] as usize))?;
    let mass = masses(&used);
    let diagonal = |i: usize| h.values()[h.pattern().column(i).start];
    let mean = (0..h.n()).map(diagonal).sum::<f64>() / mass.iter().sum::<f64>();
    let shift = if mean > 0.0 { SHIFT * mean } else { 1.0 };
    let mut shifted = h.clone();
    for (i, m) in mass.iter().enumerate() {
        let slot = h.pattern().column(i).start;
        shifted.values_mut()[slot] += shift * m;
    }
    let coordinates = used.positions().iter().flat_map(|p| [p.coords.into(); 3]).collect();
    run.check()?;
    let mut factor = CompactFactor::of(&shifted, &Ordering::NestedDissection(coordinates), run)
        .map_err(|error| SurfaceError::of_factor(error, 3, |vertex| vertices[vertex] as usize))?;
    let known = hessian::rigid_motions(&used);
    let mut pencil = ShiftedPencil { matrix: &h, mass: &mass, shift, factor: &mut factor, known: &known };
    let found = pencil.lowest(count, &LanczosOptions { tolerance, ..LanczosOptions::default() }, run)?;
    let displacements = |x: &Vec<f64>| {
        let mut moved = vec![Vector3::zeros(); mesh.vertex_count()];
        for (&v, d) in vertices.iter().zip(x.chunks_exact(3)) {
            moved[v as usize] = Vector3::from_column_slice(d);
        }
        moved
    };
    Ok(Modes {
        vectors: found.vectors.iter().map(displacements).collect(),
        residuals: found.residuals,
        values: found.values,
        rigid: found.known,
        converged: found.converged,
    })
}

/// Vertex areas, one entry per coordinate.
fn masses(mesh: &TriMesh) -> Vec<f64> {
    let areas = barycentric_areas(mesh);
    let mean = areas.iter().sum::<f64>() / areas.len() as f64;
    let min = if mean > 0.0 { MIN_MASS * mean } else { 1.0 };
    areas.iter().flat_map(|&a| [a.max(min); 3]).collect()
}
