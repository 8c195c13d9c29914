//! The motions that a surface gives way to most easily, and the parts that hardly change their shape in them.
//!
//! ```text
//! H u = λ M u,     H the ARAP energy near rest (`hessian`),  M the areas of the vertices' cells
//! ```
//!
//! Of each connected part the six rigid motions cost nothing and are left out. The low modes that follow bend where the
//! shape is weak: at the joints of limbs.
//!
//! # Reference
//! Q. Huang, M. Wicke, B. Adams, L. Guibas, *Shape decomposition using modal analysis*, Computer Graphics Forum 28 (2009).

mod hessian;
mod parts;
mod start;
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
use plumbline_num::sparse::{Cholesky, Ordering};
use plumbline_num::spatial::components;

pub use parts::{PartCount, Parts, PartsOptions, parts};
pub use start::modal_start;

/// σ over the mean of `H` against that of `M`. It should lie below the lowest mode, for speed, and above rounding.
const SHIFT: f64 = 1e-9;
/// Least area of a vertex's cell, over the mean: vertices of triangles without area have one of none.
const MIN_MASS: f64 = 1e-6;

/// How modes are computed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default)]
pub struct ModesOptions {
    /// How weights of edges are taken from angles.
    pub cotangents: CotangentRule,
    /// Residual under which a mode is accepted, in (0, 1); its value is then right to about the square of it.
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
    /// A displacement per vertex; `Σ m ‖u‖² = 1` with the area `m` of each vertex's cell. Vertices of no triangle do not move.
    pub vectors: Vec<Vec<Vector3<f64>>>,
    /// How far `1/λ` may be off, relatively: residuals of the inverted pencil.
    pub residuals: Vec<f64>,
    /// Rigid motions that were left out: six of each part, fewer of one that is a line or a point.
    pub rigid: usize,
    /// Whether all residuals met the tolerance.
    pub converged: bool,
}

/// The `count` lowest modes of a surface but for rigid motions; fewer where it has no more.
///
/// # Errors
/// [`SurfaceError::Option`] for a tolerance out of range, [`SurfaceError::Solve`] where the surface is too large to be
/// factored, [`SurfaceError::Interrupted`].
pub fn modes(mesh: &TriMesh, count: usize, options: &ModesOptions, run: &Run) -> Result<Modes, SurfaceError> {
    let tolerance = options.tolerance;
    OptionError::check(tolerance > 0.0 && tolerance < 1.0, "tolerance", tolerance, "above 0 and below 1")?;
    let (used, named) = referenced(mesh);
    if used.triangle_count() == 0 {
        return Ok(Modes { values: vec![], vectors: vec![], residuals: vec![], rigid: 0, converged: true });
    }
    run.check()?;
    let h = hessian::hessian(&used, &Cotangents::new(&used, options.cotangents))?;
    let mass = masses(&used);
    let diagonal = |i: usize| h.values()[h.pattern().column(i).start];
    let mean = (0..h.n()).map(diagonal).sum::<f64>() / mass.iter().sum::<f64>();
    let shift = if mean > 0.0 { SHIFT * mean } else { 1.0 };
    let mut shifted = h.clone();
    for (i, m) in mass.iter().enumerate() {
        let slot = h.pattern().column(i).start;
        shifted.values_mut()[slot] += shift * m;
    }
    let places = used.positions().iter().flat_map(|p| [p.coords.into(); 3]).collect();
    run.check()?;
    let mut factor = Cholesky::analyze(h.pattern(), &Ordering::NestedDissection(places))?;
    factor.factor(&shifted, run)?;
    let known = hessian::rigid_motions(&used, &components(used.vertex_count(), used.triangles()));
    let mut pencil = ShiftedPencil { matrix: &h, mass: &mass, shift, factor: &mut factor, known: &known };
    let found = pencil.lowest(count, &LanczosOptions { tolerance, ..LanczosOptions::default() }, run)?;
    let spread = |x: &Vec<f64>| {
        let mut displacements = vec![Vector3::zeros(); mesh.vertex_count()];
        for (&v, d) in named.iter().zip(x.chunks_exact(3)) {
            displacements[v as usize] = Vector3::from_column_slice(d);
        }
        displacements
    };
    Ok(Modes {
        vectors: found.vectors.iter().map(spread).collect(),
        residuals: found.residuals,
        values: found.values,
        rigid: found.known,
        converged: found.converged,
    })
}

/// The mesh without vertices of no triangle, and the vertices that are left.
fn referenced(mesh: &TriMesh) -> (TriMesh, Vec<u32>) {
    let mut number = vec![u32::MAX; mesh.vertex_count()];
    mesh.triangles().iter().flatten().for_each(|&v| number[v as usize] = 0);
    let named: Vec<u32> = (0..number.len() as u32).filter(|&v| number[v as usize] == 0).collect();
    named.iter().zip(0..).for_each(|(&v, k)| number[v as usize] = k);
    let triangles = mesh.triangles().iter().map(|t| t.map(|v| number[v as usize])).collect();
    let positions = named.iter().map(|&v| mesh.positions()[v as usize]).collect();
    (TriMesh::new(positions, triangles).expect("part of a mesh"), named)
}

/// Area of each vertex's cell, three times over: one per coordinate.
fn masses(mesh: &TriMesh) -> Vec<f64> {
    let areas = barycentric_areas(mesh);
    let mean = areas.iter().sum::<f64>() / areas.len() as f64;
    let least = if mean > 0.0 { MIN_MASS * mean } else { 1.0 };
    areas.iter().flat_map(|&a| [a.max(least); 3]).collect()
}
