//! Coarse to fine: a start for every method that iterates.
//!
//! The method is bound to coarser copies of the surface too ([`Hierarchy`]), whose handles are those that are left there. The
//! coarsest starts with rotations spread from the handles; each solution is prolonged to the next finer level and starts it
//! there. What is long-waved in a pose, which iterations on the fine surface find last, costs next to nothing on a coarse one.
//!
//! ARAP resists bending by the square of the size of its cells. A copy with a quarter of the vertices would be four times as
//! stiff and come to rest elsewhere, so that it is given a quarter of the resistance ([`DeformOptions::bending`]): its energy
//! is then that of the fine surface to a few percent, not to a factor. Prisms are as thick on each level.
//!
//! Only the start comes from there; the fine surface ends where its own energy is least.
//!
//! # Reference
//! J. Manson, S. Schaefer, *Hierarchical deformation of locally rigid meshes*, Computer Graphics Forum 30 (2011).

use nalgebra::Point3;

use super::deformer::{DeformSolver, single_level};
use super::hierarchy::{Hierarchy, LevelPose};
use super::{
    DeformOptions, Deformation, HandlePose, Handles, Hold, Method, Solver, Start, SurfaceError, Turning, Unheld,
};
use crate::mesh::TriMesh;
use plumbline_num::energy::Convergence;
use plumbline_num::run::{Run, Stopped};

/// Vertices of the coarsest level: a solve costs next to nothing, and fingers are still there.
const MIN_VERTICES: usize = 500;
/// When a coarse level is done: what prolongation spoils need not be found to more digits.
const GOOD_ENOUGH: Convergence = Convergence { max_iterations: 100, tolerance: 1e-3 };

/// A method that can start from coarser copies of its surface.
#[derive(Debug)]
pub(super) struct Multiresolution {
    method: Method,
    options: DeformOptions,
    mesh: TriMesh,
    handles: Handles,
    fine: Box<dyn DeformSolver>,
    /// Made when a start first asks for it.
    coarse: Option<Coarse>,
    /// Whether there is an end of a last call to go on from.
    solved: bool,
}

/// The coarser copies.
#[derive(Debug)]
struct Coarse {
    hierarchy: Hierarchy,
    /// Levels 1, 2 and so on of the hierarchy.
    levels: Vec<Level>,
}

/// The method on one coarse level.
#[derive(Debug)]
struct Level {
    bound: Box<dyn DeformSolver>,
    /// Numbers of the handles that are left.
    left: Vec<usize>,
}

impl Multiresolution {
    pub(super) fn new(
        method: Method,
        mesh: &TriMesh,
        handles: &Handles,
        options: &DeformOptions,
        fine: Box<dyn DeformSolver>,
    ) -> Self {
        let (mesh, handles) = (mesh.clone(), handles.clone());
        Self { method, options: *options, mesh, handles, fine, coarse: None, solved: false }
    }

    /// Whether a method has any use for a start.
    pub(super) fn iterates(method: Method, options: &DeformOptions) -> bool {
        match method {
            Method::Poisson => false,
            Method::Laplacian => options.turning == Turning::Alternating,
            _ => true,
        }
    }

    /// Whether a coarse start is known to be quicker. Clusters of prisms are levels of their own, Laplacian editing has no
    /// slow waves, and smooth rotations are found by so many plain steps that coarse levels are dear and still far from rest.
    fn gains(&self) -> bool {
        let elastic =
            matches!(self.method, Method::Arap | Method::ArapSpokes | Method::ArapElements | Method::GaussNewton);
        elastic && self.options.smoothness == 0.0
    }

    /// Where the fine surface starts; none where there is no coarser one.
    fn prolonged(&mut self, pose: &HandlePose, run: &Run) -> Result<Option<Vec<Point3<f64>>>, SurfaceError> {
        pose.check(&self.handles)?;
        let coarse = match self.coarse.take() {
            Some(coarse) => coarse,
            None => Coarse::new(self.method, &self.mesh, &self.handles, &self.options, run)?,
        };
        self.coarse.insert(coarse).solve(pose, run)
    }
}

impl DeformSolver for Multiresolution {
    fn method(&self) -> Method {
        self.fine.method()
    }

    fn deform(
        &mut self,
        pose: &HandlePose,
        start: Start<'_>,
        convergence: &Convergence,
        run: &Run,
    ) -> Result<Deformation, SurfaceError> {
        convergence.check()?;
        let coarse = match start {
            Start::Coarse => true,
            Start::Auto => self.gains(),
            Start::Last => !self.solved && self.gains(),
            Start::Spread | Start::Rest | Start::At(_) => false,
        };
        // How far the coarse levels are is not reported: they are quick.
        let at = if coarse { self.prolonged(pose, &run.silent())? } else { None };
        let done = self.fine.deform(pose, at.as_ref().map_or(start, |at| Start::At(at)), convergence, run);
        match &done {
            Ok(_) => self.solved = true,
            // Where the last call ended is lost with the call that went on from there.
            Err(SurfaceError::Interrupted(_)) => self.solved = false,
            Err(_) => {}
        }
        done
    }
}

impl Coarse {
    /// No levels where one of them cannot be solved: the fine surface then starts by itself.
    fn new(
        method: Method,
        mesh: &TriMesh,
        handles: &Handles,
        options: &DeformOptions,
        run: &Run,
    ) -> Result<Self, Stopped> {
        let hierarchy = Hierarchy::new(mesh, handles.vertices(), MIN_VERTICES, run)?;
        let level = |level: usize| Level::new(method, &hierarchy, level, handles, options, run);
        let levels = match (1..hierarchy.levels()).map(level).collect::<Result<_, _>>() {
            Err(SurfaceError::Interrupted(stopped)) => return Err(stopped),
            levels => levels.unwrap_or_default(),
        };
        Ok(Self { hierarchy, levels })
    }

    /// Solves from the coarsest level on, and prolongs to the fine surface.
    fn solve(&mut self, pose: &HandlePose, run: &Run) -> Result<Option<Vec<Point3<f64>>>, SurfaceError> {
        let mut at: Option<Vec<Point3<f64>>> = None;
        for (level, of) in self.levels.iter_mut().enumerate().rev() {
            let start = at.as_ref().map_or(Start::Spread, |at| Start::At(at));
            let positions = of.bound.deform(&of.pose(pose), start, &GOOD_ENOUGH, run)?.positions;
            let rotations = self.hierarchy.rotations(level + 1, &positions);
            at = Some(self.hierarchy.prolong_pose(level, &LevelPose { positions, rotations }).positions);
        }
        Ok(at)
    }
}

impl Level {
    fn new(
        method: Method,
        hierarchy: &Hierarchy,
        level: usize,
        handles: &Handles,
        options: &DeformOptions,
        run: &Run,
    ) -> Result<Self, SurfaceError> {
        let names = hierarchy.vertices(level);
        let number = |k: &usize| names.binary_search(&handles.vertices()[*k]).ok();
        let left: Vec<usize> = (0..handles.len()).filter(|k| number(k).is_some()).collect();
        let soft = |k: &usize| handles.holds()[*k] != Hold::Exact;
        // A region that is held softly is held as firmly by the vertices that are left of it.
        let firmer = (0..handles.len()).filter(soft).count() as f64 / left.iter().copied().filter(soft).count() as f64;
        let held = left.iter().map(|k| {
            let hold = match handles.holds()[*k] {
                Hold::Exact => Hold::Exact,
                Hold::Soft(weight) => Hold::Soft(weight * firmer),
            };
            (number(k).expect("a handle that is left") as u32, hold)
        });
        let (mesh, copy) = (hierarchy.mesh(0), hierarchy.mesh(level));
        let options = DeformOptions {
            solver: Solver::Accelerated,
            bending: options.bending * copy.vertex_count() as f64 / mesh.vertex_count() as f64,
            unheld: Unheld::Still,
            primo: options.primo.of_copy(mesh, copy),
            ..*options
        };
        Ok(Self { bound: single_level(method, copy, &Handles::new(held)?, &options, run)?, left })
    }

    /// The pose of the handles that are left.
    fn pose(&self, pose: &HandlePose) -> HandlePose {
        let left = HandlePose::new(self.left.iter().map(|&k| pose.positions()[k]).collect());
        match pose.rotations() {
            Some(turns) => left.with_rotations(self.left.iter().map(|&k| turns[k]).collect()),
            None => left,
        }
    }
}

#[cfg(test)]
mod tests;
