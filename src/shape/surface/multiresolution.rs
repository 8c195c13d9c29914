//! Multiresolution initial guesses for the iterative methods.
//!
//! The method is also prefactored on coarser levels of the surface ([`Hierarchy`]), with the handles that remain there. The
//! coarsest level starts from interpolated handle rotations; each solution is prolonged to the next finer level as its initial
//! guess. Low-frequency components of the deformation converge last on the fine surface and fast on a coarse one.
//!
//! The bending resistance of ARAP grows with the square of the cell size. A level with a quarter of the vertices would be four
//! times as stiff and have another minimum, hence its resistance is divided by four ([`DeformOptions::bending`]): its energy then
//! agrees with that of the fine surface to a few percent. PriMo keeps the thickness of its prisms on all levels.
//!
//! The coarse levels give the initial guess only; the result is the minimum of the fine energy.
//!
//! # Reference
//! J. Manson, S. Schaefer, *Hierarchical deformation of locally rigid meshes*, Computer Graphics Forum 30 (2011).

use nalgebra::Point3;

use super::deformer::{DeformSolver, Request, single_level};
use super::hierarchy::{Hierarchy, LevelPose};
use super::{
    Constraint, DeformOptions, Deformation, HandlePose, Handles, InitialGuess, Method, RotationEstimation, Solver,
    SurfaceError, Unconstrained,
};
use crate::mesh::TriMesh;
use plumbline_num::energy::Convergence;
use plumbline_num::run::{Run, Stopped};

/// Vertices of the coarsest level: a solve takes milliseconds, and features such as fingers are still resolved.
const MIN_VERTICES: usize = 500;
/// Convergence of a coarse level: prolongation adds an error larger than this tolerance.
const COARSE_CONVERGENCE: Convergence = Convergence { max_iterations: 100, tolerance: 1e-3 };

/// A method with initial guesses from coarser levels.
#[derive(Debug)]
pub(super) struct Multiresolution {
    method: Method,
    options: DeformOptions,
    mesh: TriMesh,
    handles: Handles,
    fine: Box<dyn DeformSolver>,
    /// Built at first use.
    coarse: Option<Coarse>,
    /// Whether there is a result of a previous call.
    solved: bool,
}

/// The coarser levels.
#[derive(Debug)]
struct Coarse {
    hierarchy: Hierarchy,
    /// Levels 1, 2, … of the hierarchy.
    levels: Vec<Level>,
}

/// The method on one coarse level.
#[derive(Debug)]
struct Level {
    bound: Box<dyn DeformSolver>,
    /// Indices of the handles that remain.
    handles: Vec<usize>,
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

    /// Whether a method uses an initial guess.
    pub(super) fn iterates(method: Method, options: &DeformOptions) -> bool {
        match method {
            Method::Poisson => false,
            Method::Laplacian => options.rotation_estimation == RotationEstimation::Alternating,
            _ => true,
        }
    }

    /// Whether coarse levels pay off. PriMo has cluster levels of its own; Laplacian editing converges in a few iterations; with
    /// rotation smoothness local/global iterations converge slowly on the coarse levels too.
    fn pays_off(&self) -> bool {
        let elastic =
            matches!(self.method, Method::Arap | Method::ArapSpokes | Method::ArapElements | Method::GaussNewton);
        elastic && self.options.smoothness == 0.0
    }

    /// The initial guess of the fine surface; `None` without coarser levels.
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

    fn solve(&mut self, request: &Request<'_>) -> Result<Deformation, SurfaceError> {
        let &Request { pose, guess, convergence, run, .. } = request;
        convergence.check()?;
        let coarse = match guess {
            InitialGuess::Coarse => true,
            InitialGuess::Auto => self.pays_off(),
            InitialGuess::Last => !self.solved && self.pays_off(),
            InitialGuess::Spread | InitialGuess::Rest | InitialGuess::At(_) => false,
        };
        // Coarse levels take little time: no progress is reported for them.
        let at = if coarse { self.prolonged(pose, &run.silent())? } else { None };
        let guess = at.as_ref().map_or(guess, |at| InitialGuess::At(at));
        let done = self.fine.solve(&Request { guess, ..*request });
        match &done {
            Ok(_) => self.solved = true,
            // The interrupted call has consumed the previous result.
            Err(SurfaceError::Interrupted(_)) => self.solved = false,
            Err(_) => {}
        }
        done
    }
}

impl Coarse {
    /// Has no levels if one of them cannot be factored; the fine method then uses its own initial guess.
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

    /// Solves from the coarsest to the finest coarse level, and prolongs to the fine surface.
    fn solve(&mut self, pose: &HandlePose, run: &Run) -> Result<Option<Vec<Point3<f64>>>, SurfaceError> {
        let mut at: Option<Vec<Point3<f64>>> = None;
        for (level, of) in self.levels.iter_mut().enumerate().rev() {
            let guess = at.as_ref().map_or(InitialGuess::Spread, |at| InitialGuess::At(at));
            let positions = of.bound.deform(&of.pose(pose), guess, &COARSE_CONVERGENCE, run)?.positions;
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
        let vertices = hierarchy.vertices(level);
        let vertex_of = |k: &usize| vertices.binary_search(&handles.vertices()[*k]).ok();
        let remaining: Vec<usize> = (0..handles.len()).filter(|k| vertex_of(k).is_some()).collect();
        let soft = |k: &usize| handles.constraints()[*k] != Constraint::Hard;
        // The total weight of the soft constraints stays the same.
        let factor =
            (0..handles.len()).filter(soft).count() as f64 / remaining.iter().copied().filter(soft).count() as f64;
        let constrained = remaining.iter().map(|k| {
            let constraint = match handles.constraints()[*k] {
                Constraint::Hard => Constraint::Hard,
                Constraint::Soft(weight) => Constraint::Soft(weight * factor),
            };
            (vertex_of(k).expect("a handle that remains on this level") as u32, constraint)
        });
        let (mesh, copy) = (hierarchy.mesh(0), hierarchy.mesh(level));
        let options = DeformOptions {
            solver: Solver::Accelerated,
            bending: options.bending * copy.vertex_count() as f64 / mesh.vertex_count() as f64,
            unconstrained: Unconstrained::Keep,
            primo: options.primo.of_copy(mesh, copy),
            ..*options
        };
        Ok(Self { bound: single_level(method, copy, &Handles::new(constrained)?, &options, run)?, handles: remaining })
    }

    /// The pose of the remaining handles.
    fn pose(&self, pose: &HandlePose) -> HandlePose {
        let restricted = HandlePose::new(self.handles.iter().map(|&k| pose.positions()[k]).collect());
        match pose.rotations() {
            Some(rotations) => restricted.with_rotations(self.handles.iter().map(|&k| rotations[k]).collect()),
            None => restricted,
        }
    }
}

#[cfg(test)]
mod tests;
