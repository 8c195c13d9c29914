//! `mesh.deform`: binds a method to the mesh without faults, and solves pose by pose.

use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;

use nalgebra::Point3;

use super::handles::Bound;
use super::solvable::Solvable;
use super::{Posed, mesh_at, report};
use crate::pipeline::kinds::MeshDeformSettings;
use crate::pipeline::run_error::RunError;
use crate::pipeline::stages::context::Context;
use plumbline_num::run::Run;
use plumbline_shape::surface::handle_file::{HandleFile, MeshHandles};
use plumbline_shape::surface::{Convergence, DeformOptions, DeformReport, Deformer, Start, SurfaceError, bind};

/// A handle turns by no more between two solves: from there, the shortest way would soon be the wrong one.
const MOST_TURN: f64 = 0.8 * PI;
/// Rounds of solves on the way to a pose: they only have to lead the right way round.
const ON_THE_WAY: usize = 10;

/// A pose and how it was found.
pub(super) struct Solved {
    pub(super) time: f64,
    pub(super) report: DeformReport,
}

/// Deforms the mesh.
pub(super) fn run(context: &mut Context<'_, '_>, stage: usize, settings: &MeshDeformSettings) -> Result<(), RunError> {
    let posed = mesh_at(context, stage)?;
    let path = Path::new(&settings.handles);
    let of_file = |e: &dyn std::fmt::Display| RunError::Input(format!("{}: {e}", path.display()));
    let rest = posed.last().to_vec();
    let handles = HandleFile::read(path).and_then(|file| file.of_mesh(&rest)).map_err(|e| of_file(&e))?;
    let mesh = posed.model.mesh().with_positions(rest).map_err(|e| RunError::Internal(e.to_string()))?;
    let solvable = Solvable::new(&mesh, &context.job.run())?;
    let bound = Bound::new(&handles, mesh.positions(), &solvable, settings.roi).map_err(|e| match e {
        RunError::Input(text) => of_file(&text),
        other => other,
    })?;
    bound.warnings.iter().for_each(|w| context.warn(w.clone()));
    let options = DeformOptions {
        cotangents: settings.cotangents.rule(),
        solver: settings.solver.option(),
        laplacian: settings.laplacian.option(),
        turning: settings.turning.option(),
        unheld: settings.unheld.option(),
        ..DeformOptions::default()
    };
    let deformer =
        bind(settings.method.0, &solvable.mesh, &bound.set()?, &options, &context.job.run()).map_err(surface_error)?;
    let mut solver = Solver { bound: &bound, deformer, settings, at: None };
    let mut poses = Vec::with_capacity(settings.frames as usize);
    let mut solved = Vec::with_capacity(settings.frames as usize);
    for time in times(&handles, settings.frames) {
        context.job.check_cancel()?;
        let (positions, report) = solver.pose(time, &context.job.run())?;
        poses.push(solvable.carry_back(mesh.positions(), &positions));
        solved.push(Solved { time, report });
    }
    report::tell(context, &solvable, &solved, settings);
    if let Some(path) = &settings.report {
        report::write(context, Path::new(path), &solvable, &solved, settings)?;
    }
    let marks = marks(&handles);
    context.values.put(stage, "mesh", Posed { model: posed.model, poses: Arc::new(poses), handles: Arc::new(marks) });
    Ok(())
}

/// Times of the poses: the last alone, or evenly from the first to the last.
fn times(handles: &MeshHandles, frames: u32) -> impl Iterator<Item = f64> + use<> {
    let (first, last) = handles.times();
    let share = move |i: u32| if frames <= 1 { 1.0 } else { f64::from(i) / f64::from(frames - 1) };
    (0..frames.max(1)).map(move |i| first * (1.0 - share(i)) + last * share(i))
}

/// Vertices of handles, and whether they move.
fn marks(handles: &MeshHandles) -> Vec<(u32, bool)> {
    let of = |h: &plumbline_shape::surface::handle_file::MeshHandle| {
        let moves = h.track.times().is_some();
        h.vertices.iter().map(move |v| (*v, moves)).collect::<Vec<_>>()
    };
    handles.handles.iter().flat_map(of).collect()
}

/// A bound method, and the time of the pose that it solved last.
struct Solver<'b, 'h> {
    bound: &'b Bound<'h>,
    deformer: Box<dyn Deformer>,
    settings: &'b MeshDeformSettings,
    at: Option<f64>,
}

impl Solver<'_, '_> {
    /// The pose at a time. Where a handle turns too far from the last pose, or from rest, there are solves on the way.
    fn pose(&mut self, time: f64, run: &Run) -> Result<(Vec<Point3<f64>>, DeformReport), RunError> {
        let from = self.at.unwrap_or(self.bound.start());
        let turn = self.bound.turn(from, time);
        let steps = (turn / MOST_TURN).ceil().clamp(1.0, 1000.0) as u32;
        for step in 1..steps {
            let between = from + (time - from) * f64::from(step) / f64::from(steps);
            self.solve(between, ON_THE_WAY, run)?;
        }
        let deformed = self.solve(time, self.settings.iterations as usize, run)?;
        Ok((deformed.positions, deformed.report))
    }

    fn solve(
        &mut self,
        time: f64,
        iterations: usize,
        run: &Run,
    ) -> Result<plumbline_shape::surface::Deformation, RunError> {
        let convergence = Convergence {
            max_iterations: iterations.min(self.settings.iterations as usize),
            tolerance: self.settings.tolerance,
        };
        let start = if self.at.is_some() { Start::Last } else { self.settings.start.option() };
        let deformed = self.deformer.deform(&self.bound.pose(time), start, &convergence, run).map_err(surface_error)?;
        self.at = Some(time);
        Ok(deformed)
    }
}

/// An error of a method in the terms of a run.
#[expect(clippy::needless_pass_by_value, reason = "the signature that map_err wants")]
pub(super) fn surface_error(error: SurfaceError) -> RunError {
    match error {
        SurfaceError::Interrupted(stopped) => stopped.into(),
        SurfaceError::Option { .. } | SurfaceError::Convergence(_) => RunError::Usage(error.to_string()),
        SurfaceError::Pose { .. } | SurfaceError::PerVertex { .. } => RunError::Internal(error.to_string()),
        _ => RunError::Input(error.to_string()),
    }
}
