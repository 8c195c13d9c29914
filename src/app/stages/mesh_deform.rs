//! `mesh.deform`: moves a few vertices and lets the rest follow.

use std::f64::consts::PI;
use std::sync::Arc;

use nalgebra::Point3;

use super::mesh::handles::Bound;
use super::mesh::report;
use super::mesh::solvable::Solvable;
use super::prelude::*;
use super::values::Posed;
use crate::pipeline::paths::to_path;
use plumbline_num::run::Run;
use plumbline_shape::surface::handle_file::{HandleFile, MeshHandles};
use plumbline_shape::surface::{Convergence, DeformOptions, DeformReport, Deformer, InitialGuess, Method};

/// Settings of `mesh.deform`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct MeshDeformSettings {
    /// Fixed and moved vertices: a file of handles (`plumbline schema handles` describes it)
    #[schemars(extend("format" = "path"))]
    pub handles: String,
    /// How the rest of the surface follows
    pub method: Method,
    /// Options of the methods.
    #[serde(flatten)]
    pub options: DeformOptions,
    /// The initial guess; a pose after the first one starts from the one before
    #[serde(alias = "start")]
    #[schemars(extend("aliases" = ["start"]))]
    pub init: InitialGuess<'static>,
    /// The surface moves up to this far from handles that move, along edges, in units of the mesh; all of it if left out
    #[schemars(range(min = 0.0))]
    pub roi: Option<f64>,
    /// Maximum number of iterations
    #[schemars(range(min = 1, max = 1_000_000))]
    pub iterations: u32,
    /// Relative energy decrease per iteration below which the solver stops
    #[schemars(range(min = 0.0, max = 0.5))]
    pub tolerance: f64,
    /// Poses from the first key of the handles to the last, as NAME_0000.EXT and so on; 1: the last alone
    #[schemars(range(min = 1, max = 9999))]
    pub frames: u32,
    /// Also write a report: NAME.html or NAME.json
    #[schemars(extend("format" = "path", "report" = true))]
    pub report: Option<String>,
}

/// When a deformation is done. A bar that is twisted by 135 degrees rests on a symmetric saddle first, where iterations gain less
/// than 10⁻⁶ of the energy and end 3.5 % above the minimum; 10⁻⁸ costs half as many iterations again.
const DONE: Convergence = Convergence { max_iterations: 1000, tolerance: 1e-8 };

impl Default for MeshDeformSettings {
    fn default() -> Self {
        Self {
            handles: String::new(),
            method: Method::default(),
            options: DeformOptions::default(),
            init: InitialGuess::default(),
            roi: None,
            iterations: DONE.max_iterations as u32,
            tolerance: DONE.tolerance,
            frames: 1,
            report: None,
        }
    }
}

impl Stage for MeshDeformSettings {
    const KIND: &'static str = "mesh.deform";
    const SUMMARY: &'static str = "fixes and moves a few vertices; the rest of the surface follows and keeps its shape";
    const INPUTS: &'static [Port] = &[Port::one("mesh", PortType::Mesh, "the mesh at rest")];
    const OUTPUTS: &'static [Port] = &[Port::one("mesh", PortType::Mesh, "the mesh in its poses")];
    const REQUIRED: &'static [&'static str] = &["handles"];
    type Input = (Posed,);
    type Output = (Posed,);

    fn reads(&self) -> Vec<&str> {
        vec![&self.handles]
    }

    fn writes(&self) -> Vec<String> {
        self.report.iter().cloned().collect()
    }

    fn run(&self, (posed,): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        let path = &to_path(&self.handles);
        let of_file = |e: &dyn std::fmt::Display| RunError::Input(format!("{}: {e}", path.display()));
        let mesh = posed.mesh()?;
        let handles =
            HandleFile::read(path).and_then(|file| file.of_mesh(mesh.positions())).map_err(|e| of_file(&e))?;
        let solvable = Solvable::new(&mesh, &context.job.run())?;
        let bound = Bound::new(&handles, mesh.positions(), &solvable, self.roi).map_err(|e| match e {
            RunError::Input(text) => of_file(&text),
            other => other,
        })?;
        bound.warnings.iter().for_each(|w| context.warn(w.clone()));
        let deformer = Deformer::new(self.method, &solvable.mesh, &bound.set()?, &self.options, &context.job.run())?;
        let mut solver = PoseSolver { bound: &bound, deformer, settings: self, at: None };
        let mut poses = Vec::with_capacity(self.frames as usize);
        let mut solved = Vec::with_capacity(self.frames as usize);
        for time in times(&handles, self.frames) {
            context.job.check_cancel()?;
            let (positions, report) = solver.pose(time, &context.job.run())?;
            poses.push(solvable.carry_back(mesh.positions(), &positions));
            solved.push(Solved { time, report });
        }
        report::report_deformation(context, &solvable, &solved, self);
        if let Some(path) = &self.report {
            report::write(context, path, &solvable, &solved, self)?;
        }
        let marks = marks(&handles);
        Ok((Posed { model: posed.model, poses: Arc::new(poses), handles: Arc::new(marks) },))
    }
}

/// Largest rotation of a handle between two solves: nearer to half a rotation, the shortest rotation would soon be the wrong one.
const MAX_ROTATION: f64 = 0.8 * PI;
/// Iterations of the solves on the path to a pose: they only have to choose the direction of rotation.
const ON_THE_PATH: usize = 10;

/// A pose and how it was found.
pub(crate) struct Solved {
    pub(crate) time: f64,
    pub(crate) report: DeformReport,
}

/// Times of the poses: the last alone, or evenly from the first to the last.
fn times(handles: &MeshHandles, frames: u32) -> impl Iterator<Item = f64> + use<> {
    let (first, last) = handles.times();
    let fraction = move |i: u32| if frames <= 1 { 1.0 } else { f64::from(i) / f64::from(frames - 1) };
    (0..frames.max(1)).map(move |i| first * (1.0 - fraction(i)) + last * fraction(i))
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
struct PoseSolver<'b, 'h> {
    bound: &'b Bound<'h>,
    deformer: Deformer,
    settings: &'b MeshDeformSettings,
    at: Option<f64>,
}

impl PoseSolver<'_, '_> {
    /// The pose at a time. Where a handle rotates too far from the last pose, or from rest, there are solves between.
    fn pose(&mut self, time: f64, run: &Run) -> Result<(Vec<Point3<f64>>, DeformReport), RunError> {
        let from = self.at.unwrap_or(self.bound.start());
        let angle = self.bound.max_rotation(from, time);
        let steps = (angle / MAX_ROTATION).ceil().clamp(1.0, 1000.0) as u32;
        for step in 1..steps {
            let between = from + (time - from) * f64::from(step) / f64::from(steps);
            self.solve(between, ON_THE_PATH, run)?;
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
        let start = if self.at.is_some() { InitialGuess::Last } else { self.settings.init };
        let deformed = self.deformer.deform(&self.bound.pose(time), start, &convergence, run)?;
        self.at = Some(time);
        Ok(deformed)
    }
}
