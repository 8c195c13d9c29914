//! Laplacian editing: preserves rotated differential coordinates.
//!
//! ```text
//! E(x) = Σᵢ |(L x)ᵢ − Rᵢ δᵢ|² / mᵢ,     δ = L p
//! ```
//!
//! Differential coordinates are not rotation invariant: `Rᵢ` must be estimated ([`RotationEstimation`]). Each estimate costs one
//! or a few solves with the factor of [`DetailPreserving`]. The best rigid motion of all handles is applied first, so that all
//! estimates reproduce rigid motions. Translating a handle without rotating it shears details in all linear forms.
//!
//! # Reference
//! Sorkine et al., *Laplacian surface editing*, SGP 2004; Lipman et al., *Differential coordinates for interactive mesh
//! editing*, SMI 2004; O. K.-C. Au, C.-L. Tai, L. Liu, H. Fu, *Dual Laplacian editing for meshes*, TVCG 12 (2006), for the
//! iterative estimation.

use nalgebra::{Matrix3, UnitQuaternion};
use serde::{Deserialize, Serialize};

use super::arap::{CellKind, Cells};
use super::bound::Guess;
use super::deformer::{DeformSolver, Request};
use super::detail_preserving::DetailPreserving;
use super::handle_laplacian::HandleLaplacian;
use super::lanes::Lanes;
use super::similarity::SimilarityEditing;
use super::spread::{Patches, overall_rotation};
use super::{DeformOptions, Deformation, Handles, Method, Stop, SurfaceError};
use crate::mesh::TriMesh;
use crate::mesh::operators::{CotangentRule, Cotangents};
use plumbline_num::energy::Convergence;
use plumbline_num::run::{Run, Stopped};

/// Rotation estimation for the differential coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum RotationEstimation {
    /// Harmonic interpolation of the handle rotations.
    #[default]
    Spread,
    /// Fitted once, to a solution with one rotation for all vertices.
    FirstSolve,
    /// Fitted to the previous solution, iterated until convergence.
    Alternating,
    /// Linearized similarities in a single solve; for small rotations.
    ///
    /// Linear in the positions, with three times as many unknowns. Exact to first order relative to the best rotation of all
    /// handles.
    Linear,
}

/// Laplacian editing, prefactored for a mesh and handles.
#[derive(Debug)]
pub(super) struct LaplacianEditing {
    details: DetailPreserving,
    rotations: Rotations,
    last: Option<Vec<Lanes>>,
}

#[derive(Debug)]
enum Rotations {
    Spread(Patches, HandleLaplacian),
    Fitted { cells: Cells, iterate: bool },
    Linear(SimilarityEditing),
}

/// Methods whose systems have the edges of the mesh alone.
const INSTEAD: &str = "deform by another method (arap, poisson)";

impl LaplacianEditing {
    pub(super) fn new(
        mesh: &TriMesh,
        handles: &Handles,
        options: &DeformOptions,
        run: &Run,
    ) -> Result<Self, SurfaceError> {
        let details = DetailPreserving::new(mesh, handles, options, run).map_err(|error| error.instead(INSTEAD))?;
        let fitted = |iterate| Rotations::Fitted {
            // Used for fitting rotations only: weights without negative ones never invert a cell.
            cells: Cells::new(
                CellKind::Spokes,
                &details.bound.rest,
                &Cotangents::new(mesh, CotangentRule::Clamped),
                1.0,
            ),
            iterate,
        };
        let rotations = match options.rotation_estimation {
            RotationEstimation::Spread => {
                let system = HandleLaplacian::new(&details.weights, 1.0, &details.bound.unknowns, run)?;
                Rotations::Spread(Patches::new(&details.bound), system)
            }
            RotationEstimation::FirstSolve => fitted(false),
            RotationEstimation::Alternating => fitted(true),
            RotationEstimation::Linear => {
                let linear = SimilarityEditing::new(&details, run);
                Rotations::Linear(linear.map_err(|error| error.instead("estimate rotations in another way"))?)
            }
        };
        Ok(Self { details, rotations, last: None })
    }

    fn minimize(
        &mut self,
        &Request { pose, convergence, run, .. }: &Request<'_>,
        targets: &[Lanes],
        guess: Option<Vec<Lanes>>,
    ) -> Result<(Vec<Lanes>, Vec<f64>, Stop), Stopped> {
        let details = &mut self.details;
        let rest = details.bound.rest.clone();
        let overall = overall_rotation(&details.bound, targets);
        match &mut self.rotations {
            Rotations::Spread(patches, system) => {
                let rotations = patches.rotations(&details.bound, system, pose, targets);
                let (x, energy) = details.solve_inner(|v| matrix(&rotations[v]), targets, rest, run)?;
                Ok((x, vec![energy], Stop::Solved))
            }
            Rotations::Linear(linear) => {
                let (x, energy) = linear.solve(&details.bound, &overall, targets);
                Ok((x, vec![energy], Stop::Solved))
            }
            Rotations::Fitted { cells, iterate } => {
                let mut unused = rest.clone();
                let mut x = match guess {
                    Some(x) => x,
                    None => details.solve_inner(|_| matrix(&overall), targets, rest, run)?.0,
                };
                let iterations = if *iterate { convergence.max_iterations } else { 1 };
                let mut energies = Vec::new();
                for k in 0..iterations {
                    run.step(k as f64 / iterations as f64)?;
                    cells.fit(&x, &mut unused);
                    let energy;
                    (x, energy) = details.solve_inner(|v| matrix(&cells.rotation(v)), targets, x, run)?;
                    energies.push(energy);
                    if converged(&energies, convergence) {
                        return Ok((x, energies, Stop::Converged));
                    }
                }
                Ok((x, energies, if *iterate { Stop::IterationLimit } else { Stop::Solved }))
            }
        }
    }
}

/// The energy change is below the tolerance. It may increase, since the rotations are not the minimizers of this energy.
fn converged(energies: &[f64], convergence: &Convergence) -> bool {
    matches!(energies, [.., a, b] if (a - b).abs() <= convergence.tolerance * b.abs())
}

fn matrix(rotation: &UnitQuaternion<f64>) -> Matrix3<f64> {
    rotation.to_rotation_matrix().into_inner()
}

impl DeformSolver for LaplacianEditing {
    fn method(&self) -> Method {
        Method::Laplacian
    }

    fn solve(&mut self, request: &Request<'_>) -> Result<Deformation, SurfaceError> {
        let targets = self.details.bound.targets(request.pose)?;
        let guess = match self.details.bound.guess(request.guess, self.last.take())? {
            Guess::Own => None,
            Guess::Rest => Some(self.details.bound.rest.clone()),
            Guess::Last(x) | Guess::At(x) => Some(x),
        };
        let (x, energies, stop) = self.minimize(request, &targets, guess)?;
        let counts = (self.details.weights.negative(), self.details.degenerate);
        let done = self.details.bound.done(&x, request.pose, energies, stop, counts);
        self.last = Some(x);
        Ok(done)
    }
}
