//! PriMo: a shell of rigid prisms with elastic joints.
//!
//! Every triangle is extruded by `±h/2` along the normals of its vertices to a prism. Neighboring prisms share a face at rest and
//! are coupled there:
//!
//! ```text
//! E(T) = Σ_{i~j} w_ij ∫_{face} ‖T_i(f) − T_j(f)‖² df,     w_ij = ‖e_ij‖² / (A_i + A_j),     T_i ∈ SE(3),
//! ```
//!
//! over the unit square of the bilinear face. The bending resistance grows with `h`; with `h → 0` only stretch and shear remain.
//! The position of a vertex is the mean over the prisms around it.
//!
//! Prisms with hard constraints at all three vertices are fixed. Other constrained vertices are tied to their targets by springs,
//! stiff ones for hard constraints (the vertex itself is then set to its target).
//!
//! The energy is minimized over rigid motions of *clusters* of prisms, from some sixty clusters to single prisms: on each level by
//! Gauss–Newton or Newton steps in velocities (`global`), whose systems the coarser levels help to solve (`multigrid`). Clusters
//! move the current poses, so that a finer level continues from the result of the coarser one and the energy never increases.
//! Departure from the paper, which simplifies the mesh instead. Its local shape matching is not used: sweeps of it after
//! each step saved steps but no time, and led into higher minima under turns of 170°.
//!
//! # Reference
//! M. Botsch, M. Pauly, M. Gross, L. Kobbelt, *PriMo: coupled prisms for intuitive surface modeling*, SGP 2006.

mod clusters;
mod global;
mod multigrid;
mod prisms;
mod shell;
mod solver;

use crate::mesh::TriMesh;
use plumbline_num::run::Run;

use super::bound::{Bound, Guess};
use super::deformer::{DeformSolver, Request};
use super::{DeformOptions, Deformation, HandlePose, Handles, InitialGuess, Method, Stop, SurfaceError};
use plumbline_num::options::OptionError;
use shell::BodyPose;
use solver::Solver;

/// Total spring weight of a hard constraint, relative to about 1 for edges: the error of a prism is a thousandth of the force of
/// its neighbors. Stiffer springs cost digits of the linear systems.
const HARD_SPRING_WEIGHT: f64 = 1e3;

/// Options of PriMo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrimoOptions {
    /// Shell thickness `h` as a multiple of the mean edge length, ≥ 0; default 3. Thin shells buckle and crease (a bar of 20 cells
    /// twisted by 135° collapses at 1), thick ones bend in wide arcs and need few iterations; from 3 to 6 little changes.
    pub thickness: f64,
    /// Maximum number of clusters of a linear system that is factored at once, ≥ 1; default 3000. Larger systems are solved by
    /// conjugate gradients with the help of coarser ones, which takes a third of the time at 20 000 prisms and finds the same minimum;
    /// where they converge slowly (thickness below .1) systems up to ten times as large are factored after all.
    pub largest_system: usize,
}

impl Default for PrimoOptions {
    fn default() -> Self {
        Self { thickness: 3.0, largest_system: 3000 }
    }
}

/// Material of a shell, per triangle.
#[derive(Clone, Copy, Debug, Default)]
pub struct ShellMaterial<'a> {
    /// Stiffness factor on the joints of each triangle, > 0; a joint has the mean of its two triangles.
    pub stiffness: Option<&'a [f64]>,
    /// Anisotropic bending: the direction `g` in which each triangle is stiffer. Bending along it costs `1 + ‖g‖²` times as much,
    /// bending across it is unchanged.
    pub grain: Option<&'a [nalgebra::Vector3<f64>]>,
    /// Rigid parts (bones, armor): triangles of the same number move as one body, except those fixed by handles.
    pub rigid: Option<&'a [Option<u32>]>,
}

impl PrimoOptions {
    /// The options with the same absolute thickness on a coarse copy of a mesh.
    pub(super) fn of_copy(&self, mesh: &TriMesh, copy: &TriMesh) -> Self {
        let (from, to) = (prisms::mean_edge(mesh), prisms::mean_edge(copy));
        Self { thickness: if to > 0.0 { self.thickness * from / to } else { self.thickness }, ..*self }
    }
}

/// PriMo, prefactored for a mesh and handles.
#[derive(Debug)]
pub(super) struct Primo {
    bound: Bound,
    solver: Solver,
    last: Option<Vec<BodyPose>>,
}

impl Primo {
    /// Builds the prisms of a shell.
    ///
    /// # Errors
    /// [`SurfaceError::NoHandle`], [`SurfaceError::NoSuchVertex`], [`SurfaceError::Unconstrained`], [`SurfaceError::Option`],
    /// also for a stiffness that is not positive, or a direction that is not finite, [`SurfaceError::Interrupted`].
    ///
    /// # Panics
    /// If a list of the material does not have one entry per triangle.
    pub(super) fn new(
        mesh: &TriMesh,
        handles: &Handles,
        options: &DeformOptions,
        material: &ShellMaterial<'_>,
        run: &Run,
    ) -> Result<Self, SurfaceError> {
        let reject = |name, value, range| Err(OptionError { name, value, range }.into());
        let thickness = options.primo.thickness;
        if !(thickness >= 0.0 && thickness.is_finite()) {
            return reject("thickness", thickness, "a finite number, 0 or more");
        }
        if options.primo.largest_system == 0 {
            return reject("largest_system", 0.0, "1 or more");
        }
        if let Some(&bad) = material.stiffness.unwrap_or_default().iter().find(|&&s| !(s > 0.0 && s.is_finite())) {
            return reject("stiffness", bad, "finite numbers above 0");
        }
        let lengths = material.grain.unwrap_or_default().iter().map(nalgebra::Vector3::norm);
        if let Some(bad) = lengths.into_iter().find(|length| !length.is_finite()) {
            return reject("grain", bad, "finite vectors");
        }
        let triangles = mesh.triangle_count();
        let lists =
            [material.stiffness.map(<[_]>::len), material.grain.map(<[_]>::len), material.rigid.map(<[_]>::len)];
        assert!(lists.into_iter().flatten().all(|n| n == triangles), "one entry per triangle");
        run.check()?;
        let bound = Bound::new(mesh, handles, options)?;
        let solver = Solver::new(mesh, handles, &bound.unconstrained(), &options.primo, material);
        run.check()?;
        Ok(Self { bound, solver, last: None })
    }

    /// The initial poses: the candidate with the least energy.
    fn initial(&mut self, pose: &HandlePose, guess: InitialGuess<'_>) -> Result<Vec<BodyPose>, SurfaceError> {
        let solver = &self.solver;
        let candidates = match self.bound.guess(guess, self.last.take())? {
            Guess::Last(last) => vec![last],
            Guess::Rest => vec![solver.shell.rest()],
            Guess::At(positions) => vec![solver.fitted(&positions)],
            Guess::Own => vec![solver.shell.rest(), solver.rigidly_moved(pose)],
        };
        Ok(solver.best_of(candidates, pose))
    }
}

impl DeformSolver for Primo {
    fn method(&self) -> Method {
        Method::Primo
    }

    fn solve(
        &mut self,
        &Request { pose, guess, convergence, run, .. }: &Request<'_>,
    ) -> Result<Deformation, SurfaceError> {
        pose.check(&self.bound.unknowns.handles)?;
        let initial = self.initial(pose, guess)?;
        let found = self.solver.minimize(initial, convergence, run)?;
        let positions = self.solver.positions(&found.poses, pose);
        let stop = if found.converged { Stop::Converged } else { Stop::IterationLimit };
        let counts = (0, self.solver.degenerate);
        self.last = Some(found.poses);
        Ok(self.bound.reported(positions, pose, found.energies, stop, counts))
    }
}

#[cfg(test)]
mod tests;
