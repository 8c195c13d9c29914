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
//! The energy has several minima where handles rotate far against one another. The coarsest level is then solved from three initial
//! guesses: interpolated handle rotations, rest, and the motion of the handles in steps. Minima that are distinct and not much higher
//! than the lowest are prolonged and solved again on each level, up to the finest of at most [`MAX_TRIAL_VERTICES`]; the lowest there is
//! the initial guess of the next level. Of twenty bends and twists by 60 to 170 degrees the first guess alone misses the lowest minimum
//! on four, by 2.6 to 37 %.
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
/// Vertices of the finest level on which the lowest minimum is chosen, so that finer ones are solved once. The minimum from rest is tried
/// again there: folds of the fine surface have no counterpart on the coarsest. A trial takes as long as a deformation of that size, .3 s.
const MAX_TRIAL_VERTICES: usize = 16_384;
/// Convergence of that trial. From rest a minimum may be left by a slow descent of a few tenths of a percent per iteration.
const TRIAL_CONVERGENCE: Convergence = Convergence { max_iterations: 500, tolerance: 1e-5 };
/// Rotation between handles, in radians, up to which the interpolated handle rotations lead to the lowest minimum: 45 degrees.
const MAX_SINGLE_ANGLE: f64 = std::f64::consts::FRAC_PI_4;
/// Rotation between handles per step along their motion, in radians: 30 degrees.
const PATH_STEP: f64 = std::f64::consts::FRAC_PI_6;
/// Minima whose root mean square distance is no more than this fraction of the diagonal are the same: they have not yet converged.
const SAME_DISTANCE: f64 = 0.01;
/// Minima whose energy exceeds the lowest of the level by more than this fraction of it are dropped. The energies of a level differ from
/// those of the fine surface by up to 30 %.
const MAX_RELATIVE_EXCESS: f64 = 0.5;

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
    fn prolonged(
        &mut self,
        pose: &HandlePose,
        several: bool,
        run: &Run,
    ) -> Result<Option<Vec<Point3<f64>>>, SurfaceError> {
        pose.check(&self.handles)?;
        let coarse = if let Some(coarse) = self.coarse.take() {
            coarse
        } else {
            round_large(&mut *self.fine, self.mesh.vertex_count());
            Coarse::new(self.method, &self.mesh, &self.handles, &self.options, run)?
        };
        self.coarse.insert(coarse).solve(&mut *self.fine, pose, several, run)
    }
}

impl DeformSolver for Multiresolution {
    fn method(&self) -> Method {
        self.fine.method()
    }

    fn solve(&mut self, request: &Request<'_>) -> Result<Deformation, SurfaceError> {
        let &Request { pose, guess, convergence, run, measured } = request;
        convergence.check()?;
        let coarse = match guess {
            InitialGuess::Coarse => true,
            InitialGuess::Auto => self.pays_off(),
            InitialGuess::Last => !self.solved && self.pays_off(),
            InitialGuess::Spread | InitialGuess::Rest | InitialGuess::At(_) => false,
        };
        // Coarse levels take little time: no progress is reported for them.
        let at = if coarse { self.prolonged(pose, measured, &run.silent())? } else { None };
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

    /// Follows the local minima from the coarsest level to the finest; returns the one with the lowest energy, as the initial guess of
    /// `fine`.
    fn solve(
        &mut self,
        fine: &mut dyn DeformSolver,
        pose: &HandlePose,
        several: bool,
        run: &Run,
    ) -> Result<Option<Vec<Point3<f64>>>, SurfaceError> {
        let trial = (0..=self.levels.len()).find(|&l| self.hierarchy.vertices(l).len() <= MAX_TRIAL_VERTICES);
        let several = several && trial.is_some() && fine.largest_rotation(pose)? > MAX_SINGLE_ANGLE;
        let mut guesses: Option<Vec<Vec<Point3<f64>>>> = None;
        for level in (0..=self.levels.len()).rev() {
            let tries_rest = several && Some(level) == trial;
            // Nothing is left to choose: the fine surface is solved once, by the caller.
            if level == 0 && !tries_rest && (guesses.is_some() || !several) {
                break;
            }
            let (solver, pose): (&mut dyn DeformSolver, _) = match level.checked_sub(1) {
                None => (&mut *fine, pose.clone()),
                Some(coarse) => {
                    let level = &mut self.levels[coarse];
                    let pose = level.pose(pose);
                    (&mut *level.bound, pose)
                }
            };
            let convergence = if tries_rest { &TRIAL_CONVERGENCE } else { &COARSE_CONVERGENCE };
            let mut minima = match guesses {
                None => first_minima(solver, &pose, several, run)?,
                Some(guesses) => guesses
                    .iter()
                    .map(|guess| Minimum::from(solver, &pose, InitialGuess::At(guess), convergence, run))
                    .collect::<Result<_, _>>()?,
            };
            if tries_rest {
                minima.push(Minimum::from(solver, &pose, InitialGuess::Rest, convergence, run)?);
            }
            let mut minima = distinct(minima, self.hierarchy.mesh(level).diagonal());
            if tries_rest {
                minima.truncate(1);
            }
            let prolonged = |minimum: Minimum| match level.checked_sub(1) {
                None => minimum.positions,
                Some(finer) => {
                    let positions = minimum.positions;
                    let rotations = self.hierarchy.rotations(level, &positions);
                    self.hierarchy.prolong_pose(finer, &LevelPose { positions, rotations }).positions
                }
            };
            guesses = Some(minima.into_iter().map(prolonged).collect());
        }
        Ok(guesses.and_then(|guesses| guesses.into_iter().next()))
    }
}

/// Levels finer than those of trials start from the solution of a coarser one: there a preconditioner suffices, and memory counts.
fn round_large(solver: &mut dyn DeformSolver, vertices: usize) {
    if vertices > MAX_TRIAL_VERTICES {
        solver.round();
    }
}

/// A local minimum on a level.
struct Minimum {
    positions: Vec<Point3<f64>>,
    energy: f64,
}

impl Minimum {
    fn from(
        solver: &mut dyn DeformSolver,
        pose: &HandlePose,
        guess: InitialGuess<'_>,
        convergence: &Convergence,
        run: &Run,
    ) -> Result<Self, SurfaceError> {
        let found = solver.deform(pose, guess, convergence, run)?;
        let energy = found.report.energies.last().copied().unwrap_or(f64::INFINITY);
        Ok(Self { positions: found.positions, energy })
    }
}

/// The minima of the coarsest level: from interpolated handle rotations; of `several`, also along the motion of the handles and from rest.
fn first_minima(
    solver: &mut dyn DeformSolver,
    pose: &HandlePose,
    several: bool,
    run: &Run,
) -> Result<Vec<Minimum>, SurfaceError> {
    let mut from =
        |pose: &HandlePose, guess: InitialGuess<'_>| Minimum::from(solver, pose, guess, &COARSE_CONVERGENCE, run);
    let mut minima = vec![from(pose, InitialGuess::Spread)?];
    if several {
        minima.push(from(pose, InitialGuess::Rest)?);
        minima.push(followed(solver, pose, run)?);
    }
    Ok(minima)
}

/// The minimum that is reached when the handles move to their targets step by step.
fn followed(solver: &mut dyn DeformSolver, pose: &HandlePose, run: &Run) -> Result<Minimum, SurfaceError> {
    let steps = (solver.largest_rotation(pose)? / PATH_STEP).ceil().max(1.0);
    let mut at: Option<Minimum> = None;
    for step in 1..=steps as u32 {
        let guess = at.as_ref().map_or(InitialGuess::Rest, |at| InitialGuess::At(&at.positions));
        let partway = solver.partway(pose, f64::from(step) / steps)?;
        at = Some(Minimum::from(solver, &partway, guess, &COARSE_CONVERGENCE, run)?);
    }
    Ok(at.expect("one step or more"))
}

/// The minima that may be the lowest of the fine surface, each once, the lowest first.
fn distinct(mut minima: Vec<Minimum>, diagonal: f64) -> Vec<Minimum> {
    minima.sort_by(|a, b| a.energy.total_cmp(&b.energy));
    let lowest = minima.first().map_or(0.0, |m| m.energy);
    let mut kept: Vec<Minimum> = Vec::new();
    for minimum in minima {
        let same = |other: &Minimum| rms_distance(&other.positions, &minimum.positions) <= SAME_DISTANCE * diagonal;
        if minimum.energy - lowest <= MAX_RELATIVE_EXCESS * lowest.abs() && !kept.iter().any(same) {
            kept.push(minimum);
        }
    }
    kept
}

fn rms_distance(a: &[Point3<f64>], b: &[Point3<f64>]) -> f64 {
    (a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()).sum::<f64>() / a.len() as f64).sqrt()
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
        let mut bound = single_level(method, copy, &Handles::new(constrained)?, &options, run)?;
        round_large(&mut *bound, copy.vertex_count());
        Ok(Self { bound, handles: remaining })
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
