//! PriMo: a surface as rigid prisms with elastic joints, which shells bend like.
//!
//! Every triangle is raised by `±h/2` along the normals of its vertices to a prism; neighbors meet on a face in the rest
//! shape, and are held together there:
//!
//! ```text
//! E(T) = Σ_{i~j} w_ij ∫_{face} ‖T_i(f) − T_j(f)‖² df,     w_ij = ‖e_ij‖² / (A_i + A_j),     T_i ∈ SE(3),
//! ```
//!
//! over the unit square of the bilinear face. `h` is what bending costs: with `h → 0` only stretch and shear do. A vertex is
//! the mean of the copies that the prisms around it carry.
//!
//! Prisms whose corners are all held exactly are fixed. Other held vertices are tied to their targets by springs, stiff ones
//! where the hold is exact (the vertex itself is then put onto its target).
//!
//! The energy is minimized over rigid motions of *clusters* of prisms, from some sixty down to the single prisms: on each level
//! by Gauss–Newton in velocities (`global`) and local shape matching (`sweep`). Clusters move what is posed already, so a
//! finer level starts exactly where the coarser one ended and the energy never rises. (The paper simplifies the mesh
//! instead, and restricts to one level with either solver.)
//!
//! # Reference
//! M. Botsch, M. Pauly, M. Gross, L. Kobbelt, *PriMo: coupled prisms for intuitive surface modeling*, SGP 2006.

mod clusters;
mod global;
mod prisms;
mod shell;
mod solver;
mod sweep;

use crate::mesh::TriMesh;
use plumbline_num::energy::Convergence;
use plumbline_num::run::Run;

use super::bound::{Begin, Bound};
use super::deformer::DeformSolver;
use super::{DeformOptions, Deformation, HandlePose, Handles, Hold, Method, Start, Stop, SurfaceError};
use plumbline_num::options::OptionError;
use shell::BodyPose;
use solver::{Anchor, Solver, Wish};

/// Weight of the springs of a vertex that is held exactly, edges having about 1: a prism is off by a thousandth of what its
/// neighbors pull. Stiffer springs slow local shape matching down.
const STIFF_SPRING: f64 = 1e3;

/// How the shell is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrimoOptions {
    /// `h` as a multiple of the mean length of the edges, ≥ 0. Thin shells buckle and crease (a bar of 20 cells twisted by
    /// 135° collapses at 1), thick ones bend in wide arcs and cost few iterations; from 3 to 6 little changes.
    pub thickness: f64,
    /// Most clusters that are solved for at once, ≥ 1; beyond, levels above it and local shape matching take turns. A system
    /// of 20 000 takes about a second to factor and 200 MB.
    pub largest_system: usize,
}

impl Default for PrimoOptions {
    fn default() -> Self {
        Self { thickness: 3.0, largest_system: 30_000 }
    }
}

/// What a shell is made of, triangle by triangle.
#[derive(Clone, Copy, Debug, Default)]
pub struct Fabric<'a> {
    /// Factor on the joints of each triangle, > 0 (at an edge the mean of both sides counts): parts that are to keep their
    /// shape more than others.
    pub stiffness: Option<&'a [f64]>,
    /// The direction in which each triangle is stiff to bend, as a reed mat is along its reeds: bending in it costs `1 + ‖g‖²`
    /// times as much, bending across it no more than without.
    pub grain: Option<&'a [nalgebra::Vector3<f64>]>,
    /// Triangles of the same number move as one body, but for those that handles hold: bones and armor.
    pub rigid: Option<&'a [Option<u32>]>,
}

impl PrimoOptions {
    /// The same prisms over a coarser copy of a mesh.
    pub(super) fn of_copy(&self, mesh: &TriMesh, copy: &TriMesh) -> Self {
        let (from, to) = (prisms::mean_edge(mesh), prisms::mean_edge(copy));
        Self { thickness: if to > 0.0 { self.thickness * from / to } else { self.thickness }, ..*self }
    }
}

/// PriMo, bound to a mesh and a set of handles.
#[derive(Debug)]
pub(super) struct Primo {
    bound: Bound,
    solver: Solver,
    last: Option<Vec<BodyPose>>,
}

impl Primo {
    /// Makes the prisms.
    ///
    /// # Errors
    /// [`SurfaceError::NoHandle`], [`SurfaceError::NoSuchVertex`], [`SurfaceError::Unheld`], [`SurfaceError::Option`],
    /// [`SurfaceError::Interrupted`].
    pub(super) fn new(
        mesh: &TriMesh,
        handles: &Handles,
        options: &DeformOptions,
        run: &Run,
    ) -> Result<Self, SurfaceError> {
        Self::of_fabric(mesh, handles, options, &Fabric::default(), run)
    }

    /// The same for a shell that is not alike everywhere.
    ///
    /// # Errors
    /// As [`Self::new`]; [`SurfaceError::Option`] for a stiffness that is not positive, or a grain that is not finite.
    ///
    /// # Panics
    /// Where a list of the fabric has not one entry per triangle.
    pub(super) fn of_fabric(
        mesh: &TriMesh,
        handles: &Handles,
        options: &DeformOptions,
        fabric: &Fabric<'_>,
        run: &Run,
    ) -> Result<Self, SurfaceError> {
        let refused = |name, value, range| Err(OptionError { name, value, range }.into());
        let thickness = options.primo.thickness;
        if !(thickness >= 0.0 && thickness.is_finite()) {
            return refused("thickness", thickness, "a finite number, 0 or more");
        }
        if options.primo.largest_system == 0 {
            return refused("largest_system", 0.0, "1 or more");
        }
        if let Some(&bad) = fabric.stiffness.unwrap_or_default().iter().find(|&&s| !(s > 0.0 && s.is_finite())) {
            return refused("stiffness", bad, "finite numbers above 0");
        }
        let lengths = fabric.grain.unwrap_or_default().iter().map(nalgebra::Vector3::norm);
        if let Some(bad) = lengths.into_iter().find(|length| !length.is_finite()) {
            return refused("grain", bad, "finite vectors");
        }
        let triangles = mesh.triangle_count();
        let lists = [fabric.stiffness.map(<[_]>::len), fabric.grain.map(<[_]>::len), fabric.rigid.map(<[_]>::len)];
        assert!(lists.into_iter().flatten().all(|n| n == triangles), "one entry per triangle");
        run.check()?;
        let bound = Bound::new(mesh, handles, options)?;
        let anchor = |(&vertex, hold): (&u32, &Hold)| {
            let soft = if let Hold::Soft(weight) = *hold { Some(weight) } else { None };
            Anchor { vertex, soft }
        };
        let anchors = handles.vertices().iter().zip(handles.holds()).map(anchor).collect();
        let solver = Solver::new(mesh, anchors, &bound.still(), &options.primo, fabric);
        run.check()?;
        Ok(Self { bound, solver, last: None })
    }

    /// Poses to start from.
    fn start(&mut self, wishes: &[Wish], start: Start<'_>) -> Result<Vec<BodyPose>, SurfaceError> {
        let solver = &self.solver;
        let candidates = match self.bound.begin(start, self.last.take())? {
            Begin::Last(last) => vec![last],
            Begin::Rest => vec![solver.shell.rest()],
            Begin::At(positions) => vec![solver.fitted(&positions)],
            Begin::Itself => vec![solver.shell.rest(), solver.moved_whole(wishes)],
        };
        Ok(solver.best_of(candidates, wishes))
    }
}

impl DeformSolver for Primo {
    fn method(&self) -> Method {
        Method::Primo
    }

    fn deform(
        &mut self,
        pose: &HandlePose,
        start: Start<'_>,
        convergence: &Convergence,
        run: &Run,
    ) -> Result<Deformation, SurfaceError> {
        convergence.check()?;
        pose.check(&self.bound.held.handles)?;
        let turns = pose.rotations();
        let turn = |k: usize| turns.map(|turns| turns[k].to_rotation_matrix().into_inner());
        let wish = |(k, &position)| Wish { position, turn: turn(k) };
        let wishes: Vec<Wish> = pose.positions().iter().enumerate().map(wish).collect();
        let start = self.start(&wishes, start)?;
        let found = self.solver.minimize(start, convergence, run)?;
        let positions = self.solver.positions(&found.poses, &wishes);
        let stop = if found.converged { Stop::Converged } else { Stop::IterationsUsedUp };
        let counts = (0, self.solver.degenerate);
        self.last = Some(found.poses);
        Ok(self.bound.reported(positions, pose, found.energies, stop, counts))
    }
}

#[cfg(test)]
mod tests;
