//! `plumbline deform`: a mesh in another pose. Builds the same graph as `pipeline/deform-mesh.toml`.

use std::path::PathBuf;

use clap::Args;

use super::failure::Failure;
use super::job::JobArgs;
use super::run::run_or_print;
use crate::pipeline::file::literal_path;
use crate::pipeline::kinds::{
    CotangentWish, ImageSaveSettings, LaplacianWish, MeshDeformSettings, MeshLoadSettings, MeshRenderSettings,
    MeshSaveSettings, SolverWish, StartWish, TurningWish, UnheldWish,
};
use crate::pipeline::surfaces::{MethodName, ViewWish};
use crate::pipeline::{Backend, Exit, PipelineFile, StageEntry, number_for};

/// Options of `plumbline deform`.
#[derive(Debug, Args)]
pub(super) struct DeformArgs {
    /// The mesh: OBJ, PLY, OFF, STL, glTF or GLB
    #[arg(value_name = "MESH")]
    input: PathBuf,
    /// Which vertices are held and which are moved: a file of handles (`plumbline schema handles` describes it)
    #[arg(long, value_name = "FILE.json")]
    handles: PathBuf,
    /// The file to write; its extension chooses the format
    #[arg(short, long, value_name = "OUTPUT")]
    output: PathBuf,

    #[arg(long, default_value_t, value_name = "METHOD", help_heading = "Method", help = method_help())]
    method: MethodName,
    /// The surface moves up to this far from handles that move, along edges, in units of the mesh; all of it if left out
    #[arg(long, value_name = "DISTANCE", help_heading = "Method")]
    #[arg(value_parser = |text: &str| number_for::<MeshDeformSettings>("roi", text))]
    roi: Option<f64>,
    /// Rounds at most
    #[arg(long, default_value_t = MeshDeformSettings::default().iterations, value_name = "N", help_heading = "Method")]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    iterations: u32,
    /// It has converged when a round lowers the energy by no more than this share of it
    #[arg(long, default_value_t = MeshDeformSettings::default().tolerance, value_name = "SHARE", help_heading = "Method")]
    #[arg(value_parser = |text: &str| number_for::<MeshDeformSettings>("tolerance", text))]
    tolerance: f64,
    /// How weights of edges are taken from angles
    #[arg(long, value_enum, default_value_t, value_name = "HOW", help_heading = "Method")]
    cotangents: CotangentWish,
    /// How the energy of arap methods is minimized
    #[arg(long, value_enum, default_value_t, value_name = "HOW", help_heading = "Method")]
    solver: SolverWish,
    /// Where rounds start
    #[arg(long, value_enum, default_value_t, value_name = "FROM", help_heading = "Method")]
    start: StartWish,
    /// What the method laplacian keeps
    #[arg(long, value_enum, default_value_t, value_name = "WHAT", help_heading = "Method")]
    laplacian: LaplacianWish,
    /// Where the method laplacian takes its rotations from
    #[arg(long, value_enum, default_value_t, value_name = "FROM", help_heading = "Method")]
    turning: TurningWish,
    /// What happens to parts on which no handle is
    #[arg(long, value_enum, default_value_t, value_name = "HOW", help_heading = "Method")]
    unheld: UnheldWish,

    /// Poses from the first key of the handles to the last, as NAME_0000.EXT and so on
    #[arg(long, default_value_t = 1, value_name = "N", help_heading = "Writing")]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=9999))]
    frames: u32,
    /// Also write how it went, as JSON
    #[arg(long, value_name = "FILE.json", help_heading = "Writing")]
    report: Option<PathBuf>,
    /// Also draw the last pose, with the handles as dots
    #[arg(long, value_name = "FILE.png", help_heading = "Writing")]
    render: Option<PathBuf>,
    /// From where it is drawn: corner, front, back, left, right, top, bottom, or YAW,PITCH in degrees
    #[arg(
        long,
        default_value_t,
        value_name = "VIEW",
        allow_hyphen_values = true,
        requires = "render",
        help_heading = "Writing"
    )]
    view: ViewWish,

    #[command(flatten)]
    job: JobArgs,
}

fn method_help() -> String {
    format!("How the rest of the surface follows: {}", MethodName::all().join(", "))
}

impl DeformArgs {
    pub(super) fn run(self, backend: &dyn Backend) -> Result<Exit, Failure> {
        run_or_print(self.pipeline()?, self.job.print_pipeline, backend)
    }

    /// The pipeline that the options mean.
    #[expect(clippy::unnecessary_wraps, reason = "as every command that builds a pipeline")]
    pub(super) fn pipeline(&self) -> Result<PipelineFile, Failure> {
        let load = MeshLoadSettings { path: literal_path(&self.input), ..MeshLoadSettings::default() };
        let deform = MeshDeformSettings {
            handles: literal_path(&self.handles),
            method: self.method,
            cotangents: self.cotangents,
            solver: self.solver,
            start: self.start,
            laplacian: self.laplacian,
            turning: self.turning,
            roi: self.roi,
            iterations: self.iterations,
            tolerance: self.tolerance,
            frames: self.frames,
            unheld: self.unheld,
            report: self.report.as_ref().map(|path| literal_path(path)),
        };
        let save = MeshSaveSettings { path: literal_path(&self.output), frames: self.frames, ..Default::default() };
        let mut stages = vec![
            StageEntry::built("mesh", &load),
            StageEntry::built("posed", &deform).input("mesh", "mesh"),
            StageEntry::built("out", &save).input("mesh", "posed"),
        ];
        if let Some(path) = &self.render {
            let render = MeshRenderSettings { view: self.view, ..MeshRenderSettings::default() };
            let picture = ImageSaveSettings { path: literal_path(path), ..ImageSaveSettings::default() };
            stages.push(StageEntry::built("drawn", &render).input("mesh", "posed"));
            stages.push(StageEntry::built("picture", &picture).input("image", "drawn"));
        }
        Ok(PipelineFile { name: Some("deform".to_owned()), run: self.job.run(), stages, ..PipelineFile::default() })
    }
}
