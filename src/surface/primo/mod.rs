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

use crate::energy::Convergence;
use crate::mesh::TriMesh;

use super::bound::Bound;
use super::{
    DeformOptions, DeformReport, Deformation, Deformer, HandlePose, Handles, Hold, Method, Start, Stop, SurfaceError,
};
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

/// PriMo, bound to a mesh and a set of handles.
#[derive(Debug)]
pub struct Primo {
    bound: Bound,
    solver: Solver,
    last: Option<Vec<BodyPose>>,
}

impl Primo {
    /// Makes the prisms.
    ///
    /// # Errors
    /// [`SurfaceError::NoHandle`], [`SurfaceError::NoSuchVertex`], [`SurfaceError::Unheld`], [`SurfaceError::Option`].
    pub fn new(mesh: &TriMesh, handles: &Handles, options: &DeformOptions) -> Result<Self, SurfaceError> {
        Self::with_stiffness(mesh, handles, options, None)
    }

    /// The same with a factor on the joints of each triangle, > 0 (at an edge the mean of both sides counts): parts that
    /// are to keep their shape more than others.
    ///
    /// # Errors
    /// As [`Self::new`]; [`SurfaceError::Option`] for a factor that is not positive.
    ///
    /// # Panics
    /// Where there is not one factor per triangle.
    pub fn with_stiffness(
        mesh: &TriMesh,
        handles: &Handles,
        options: &DeformOptions,
        stiffness: Option<&[f64]>,
    ) -> Result<Self, SurfaceError> {
        let refused = |name, value, range| Err(SurfaceError::Option { name, value, range });
        let thickness = options.primo.thickness;
        if !(thickness >= 0.0 && thickness.is_finite()) {
            return refused("thickness", thickness, "a finite number, 0 or more");
        }
        if options.primo.largest_system == 0 {
            return refused("largest_system", 0.0, "1 or more");
        }
        if let Some(&bad) = stiffness.unwrap_or_default().iter().find(|&&s| !(s > 0.0 && s.is_finite())) {
            return refused("stiffness", bad, "finite numbers above 0");
        }
        assert!(stiffness.is_none_or(|s| s.len() == mesh.triangle_count()), "one factor per triangle");
        let bound = Bound::new(mesh, handles, options)?;
        let anchor = |(&vertex, hold): (&u32, &Hold)| {
            let soft = if let Hold::Soft(weight) = *hold { Some(weight) } else { None };
            Anchor { vertex, soft }
        };
        let anchors = handles.vertices().iter().zip(handles.holds()).map(anchor).collect();
        let solver = Solver::new(mesh, anchors, &bound.still(), &options.primo, stiffness);
        Ok(Self { bound, solver, last: None })
    }

    /// Poses to start from.
    fn start(&mut self, wishes: &[Wish], start: Start<'_>) -> Result<Vec<BodyPose>, SurfaceError> {
        let solver = &self.solver;
        let candidates = match (start, self.last.take()) {
            (Start::Last, Some(last)) => vec![last],
            (Start::Rest, _) => vec![solver.shell.rest()],
            (Start::At(positions), _) => {
                self.bound.check_start(positions)?;
                vec![solver.fitted(positions)]
            }
            (Start::Spread | Start::Last, _) => vec![solver.shell.rest(), solver.moved_whole(wishes)],
        };
        Ok(solver.best_of(candidates, wishes))
    }
}

impl Deformer for Primo {
    fn method(&self) -> Method {
        Method::Primo
    }

    fn deform(
        &mut self,
        pose: &HandlePose,
        start: Start<'_>,
        convergence: &Convergence,
    ) -> Result<Deformation, SurfaceError> {
        convergence.check()?;
        pose.check(&self.bound.held.handles)?;
        let turns = pose.rotations();
        let turn = |k: usize| turns.map(|turns| turns[k].to_rotation_matrix().into_inner());
        let wish = |(k, &position)| Wish { position, turn: turn(k) };
        let wishes: Vec<Wish> = pose.positions().iter().enumerate().map(wish).collect();
        let start = self.start(&wishes, start)?;
        let found = self.solver.minimize(start, convergence)?;
        let positions = self.solver.positions(&found.poses, &wishes);
        let report = DeformReport {
            iterations: found.energies.len() - 1,
            stop: if found.converged { Stop::Converged } else { Stop::IterationsUsedUp },
            constraint_error: self.bound.constraint_error(&positions, pose),
            shape: self.bound.gauge.measure(&positions),
            negative_weights: 0,
            degenerate_faces: self.solver.degenerate,
            held_still: self.bound.held.still.clone(),
            energies: found.energies,
        };
        self.last = Some(found.poses);
        Ok(Deformation { positions, report })
    }
}

#[cfg(test)]
mod tests;
