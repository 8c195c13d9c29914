//! `mesh.deform`: moves a few vertices and lets the rest follow.

use std::sync::Arc;

use super::mesh::report;
use super::prelude::*;
use super::values::Posed;
use crate::pipeline::paths::to_path;
use plumbline_shape::surface::handle_file::{HandleFile, MeshHandle, MeshHandles};
use plumbline_shape::surface::{
    Convergence, DeformOptions, DeformReport, InitialGuess, KeyframedDeformer, KeyframedOptions, Method, SolvableMesh,
    SurfaceError,
};

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

impl Default for MeshDeformSettings {
    fn default() -> Self {
        let KeyframedOptions { method, options, init, reach, convergence } = KeyframedOptions::default();
        Self {
            handles: String::new(),
            method,
            options,
            init,
            roi: reach,
            iterations: convergence.max_iterations as u32,
            tolerance: convergence.tolerance,
            frames: 1,
            report: None,
        }
    }
}

impl MeshDeformSettings {
    /// The settings in the terms of the library.
    pub fn keyframed(&self) -> KeyframedOptions {
        let convergence = Convergence { max_iterations: self.iterations as usize, tolerance: self.tolerance };
        KeyframedOptions { method: self.method, options: self.options, init: self.init, reach: self.roi, convergence }
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
        let run = context.job.run();
        let solvable = Arc::new(SolvableMesh::new(&mesh, &run)?);
        let marks = marks(&handles);
        let times: Vec<f64> = handles.frame_times(self.frames).collect();
        let mut deformer =
            KeyframedDeformer::new(&mesh, solvable.clone(), handles, &self.keyframed(), &run).map_err(|e| match e {
                e @ (SurfaceError::HandleNotOnSurface { .. } | SurfaceError::JoinedHandles { .. }) => of_file(&e),
                other => other.into(),
            })?;
        deformer.warnings().iter().for_each(|w| context.warn(w.clone()));
        let mut poses = Vec::with_capacity(times.len());
        let mut solved = Vec::with_capacity(times.len());
        for time in times {
            context.job.check_cancel()?;
            let pose = deformer.pose(time, &run)?;
            poses.push(deformer.carry_back(&pose.positions));
            solved.push(Solved { time, report: pose.report });
        }
        report::report_deformation(context, &solvable, &solved, self);
        if let Some(path) = &self.report {
            report::write(context, path, &solvable, &solved, self)?;
        }
        Ok((Posed { model: posed.model, poses: Arc::new(poses), handles: Arc::new(marks) },))
    }
}

/// A pose and how it was found.
pub(crate) struct Solved {
    pub(crate) time: f64,
    pub(crate) report: DeformReport,
}

/// Vertices of handles, and whether they move.
fn marks(handles: &MeshHandles) -> Vec<(u32, bool)> {
    let of = |h: &MeshHandle| {
        let moves = h.track.times().is_some();
        h.vertices.iter().map(move |v| (*v, moves)).collect::<Vec<_>>()
    };
    handles.handles.iter().flat_map(of).collect()
}
