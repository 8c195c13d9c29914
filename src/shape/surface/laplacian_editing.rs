//! Laplacian editing: differential coordinates keep their shape while handles move.
//!
//! ```text
//! E(x) = Σᵢ |(L x)ᵢ − Rᵢ δᵢ|² / mᵢ,     δ = L p
//! ```
//!
//! Differential coordinates know nothing of rotations, so `Rᵢ` has to come from somewhere ([`Turning`]). Each way is a single
//! solve, or a few, with the factor of [`DetailPreserving`]. What is not to change at all is held exactly: the rest is the
//! region of interest. The rotation that carries all handles best is taken first, so that every way reproduces their rigid
//! motion. Dragging without turning shears details in all linear forms; that is their nature.
//!
//! # Reference
//! Sorkine et al., *Laplacian surface editing*, SGP 2004; Lipman et al., *Differential coordinates for interactive mesh
//! editing*, SMI 2004; O. K.-C. Au, C.-L. Tai, L. Liu, H. Fu, *Dual Laplacian editing for meshes*, TVCG 12 (2006), for the
//! alternation.

use nalgebra::{Matrix3, UnitQuaternion};
use serde::{Deserialize, Serialize};

use super::arap::{CellKind, Cells};
use super::bound::Begin;
use super::deformer::DeformSolver;
use super::detail_preserving::DetailPreserving;
use super::held_laplacian::HeldLaplacian;
use super::lanes::Lanes;
use super::similarity::SimilarityEditing;
use super::spread::{Patches, overall_turn};
use super::{DeformOptions, Deformation, HandlePose, Handles, Method, Start, Stop, SurfaceError};
use crate::mesh::TriMesh;
use crate::mesh::operators::{CotangentRule, Cotangents};
use plumbline_num::energy::Convergence;
use plumbline_num::run::{Run, Stopped};

/// Where the rotations of differential coordinates come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Turning {
    /// The handles', spread smoothly.
    ///
    /// They are spread harmonically.
    #[default]
    Spread,
    /// Fitted to a first solve.
    ///
    /// The first solve is under one rotation for all.
    FirstSolve,
    /// Fitted again and again.
    ///
    /// Fitted to the last solve until the surface stands still.
    Alternating,
    /// Linear in the positions: one solve, for small turns.
    ///
    /// Similarities that are linear in the positions, in one solve of a three times larger system. Exact for small turns against
    /// the rotation of all handles together.
    Linear,
}

/// Laplacian editing, bound to a mesh and handles.
#[derive(Debug)]
pub(super) struct LaplacianEditing {
    details: DetailPreserving,
    turns: Turns,
    last: Option<Vec<Lanes>>,
}

#[derive(Debug)]
enum Turns {
    Spread(Patches, HeldLaplacian),
    Fitted { cells: Cells, rounds_given: bool },
    Linear(SimilarityEditing),
}

impl LaplacianEditing {
    pub(super) fn new(
        mesh: &TriMesh,
        handles: &Handles,
        options: &DeformOptions,
        run: &Run,
    ) -> Result<Self, SurfaceError> {
        let details = DetailPreserving::new(mesh, handles, options, run)?;
        let fitted = |rounds_given| Turns::Fitted {
            // Only to fit rotations: weights that are never negative turn no cell against its surroundings.
            cells: Cells::new(
                CellKind::Spokes,
                &details.bound.rest,
                &Cotangents::new(mesh, CotangentRule::Clamped),
                1.0,
            ),
            rounds_given,
        };
        let turns = match options.turning {
            Turning::Spread => {
                let system = HeldLaplacian::new(&details.weights, 1.0, &details.bound.held, run)?;
                Turns::Spread(Patches::new(&details.bound), system)
            }
            Turning::FirstSolve => fitted(false),
            Turning::Alternating => fitted(true),
            Turning::Linear => Turns::Linear(SimilarityEditing::new(&details, run)?),
        };
        Ok(Self { details, turns, last: None })
    }

    fn solve(
        &mut self,
        pose: &HandlePose,
        targets: &[Lanes],
        start: Option<Vec<Lanes>>,
        convergence: &Convergence,
        run: &Run,
    ) -> Result<(Vec<Lanes>, Vec<f64>, Stop), Stopped> {
        let details = &mut self.details;
        let rest = details.bound.rest.clone();
        let overall = overall_turn(&details.bound, targets);
        match &mut self.turns {
            Turns::Spread(patches, system) => {
                let turns = patches.turns(&details.bound, system, pose, targets);
                let (x, energy) = details.solve_inner(|v| matrix(&turns[v]), targets, rest, run)?;
                Ok((x, vec![energy], Stop::Solved))
            }
            Turns::Linear(linear) => {
                let (x, energy) = linear.solve(&details.bound, &overall, targets);
                Ok((x, vec![energy], Stop::Solved))
            }
            Turns::Fitted { cells, rounds_given } => {
                let mut unused = rest.clone();
                let mut x = match start {
                    Some(x) => x,
                    None => details.solve_inner(|_| matrix(&overall), targets, rest, run)?.0,
                };
                let rounds = if *rounds_given { convergence.max_iterations } else { 1 };
                let mut energies = Vec::new();
                for k in 0..rounds {
                    run.step(k as f64 / rounds as f64)?;
                    cells.fit(&x, &mut unused);
                    let energy;
                    (x, energy) = details.solve_inner(|v| matrix(&cells.turn(v)), targets, x, run)?;
                    energies.push(energy);
                    if stands_still(&energies, convergence) {
                        return Ok((x, energies, Stop::Converged));
                    }
                }
                Ok((x, energies, if *rounds_given { Stop::IterationsUsedUp } else { Stop::Solved }))
            }
        }
    }
}

/// The rotations are not those that would lower the energy most, so that it may rise; it settles all the same.
fn stands_still(energies: &[f64], convergence: &Convergence) -> bool {
    matches!(energies, [.., a, b] if (a - b).abs() <= convergence.tolerance * b.abs())
}

fn matrix(turn: &UnitQuaternion<f64>) -> Matrix3<f64> {
    turn.to_rotation_matrix().into_inner()
}

impl DeformSolver for LaplacianEditing {
    fn method(&self) -> Method {
        Method::Laplacian
    }

    fn deform(
        &mut self,
        pose: &HandlePose,
        start: Start<'_>,
        convergence: &Convergence,
        run: &Run,
    ) -> Result<Deformation, SurfaceError> {
        convergence.check()?;
        let targets = self.details.bound.targets(pose)?;
        let start = match self.details.bound.begin(start, self.last.take())? {
            Begin::Itself => None,
            Begin::Rest => Some(self.details.bound.rest.clone()),
            Begin::Last(x) | Begin::At(x) => Some(x),
        };
        let (x, energies, stop) = self.solve(pose, &targets, start, convergence, run)?;
        let counts = (self.details.weights.negative(), self.details.degenerate);
        let done = self.details.bound.done(&x, pose, energies, stop, counts);
        self.last = Some(x);
        Ok(done)
    }
}
