//! The command line: one file per subcommand. Each builds or reads a pipeline and hands it to the same executor.
//!
//! Standard output carries results only; progress, summaries and errors go to standard error. Exit statuses: [`Exit`].

mod blend;
mod check;
mod clip;
mod completions;
mod compose;
mod deform;
mod failure;
mod graph;
mod interrupt;
mod job;
mod mesh;
mod modes;
mod morph;
mod motion;
mod options;
mod photo;
mod photo_clip;
mod plan;
mod pose;
mod probe;
mod rectify;
mod render;
mod retarget;
mod run;
mod schema;
mod skeleton;
mod skin;
mod solve;
mod stabilize;
mod stages;

use std::io::Write;
use std::process::ExitCode;

use clap::{Args, CommandFactory, Parser, Subcommand};

use crate::pipeline::{Exit, Pipeline, PipelineFile, StageRunner};
use failure::Failure;
pub use rectify::RectifyArgs;
pub use retarget::RetargetArgs;
pub use stabilize::StabilizeArgs;

/// Deshake video, defish and retarget photos; deform, auto-rig, skin and morph meshes
#[derive(Debug, Parser)]
#[command(name = "plumbline", version, max_term_width = 100, propagate_version = true)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Hold shaky clips steady
    Stabilize(Box<StabilizeArgs>),
    /// Make the lines of wide-angle photos straight, and keep shapes; take the lens out of clips
    Rectify(Box<RectifyArgs>),
    /// Give photos and clips another shape that spares what matters
    Retarget(Box<RetargetArgs>),
    /// Recover how the camera moved, in the picture and in space
    Motion(Box<motion::MotionArgs>),
    /// Look at mesh files, repair and convert them
    Mesh(mesh::MeshArgs),
    /// Bend meshes the way they would bend: a few vertices are held or moved, the rest follows
    Deform(Box<deform::DeformArgs>),
    /// Find how a mesh bends most easily, and its near-rigid parts
    Modes(modes::ModesArgs),
    /// Find how a surface follows a skeleton
    Skin(skin::SkinArgs),
    /// Find the skeletons of meshes
    Skeleton(Box<skeleton::SkeletonArgs>),
    /// Put characters into poses and through movements
    Pose(Box<pose::PoseArgs>),
    /// Find the shapes between two meshes
    Morph(Box<morph::MorphArgs>),
    /// Mix two meshes, each place as far from one to the other as is painted there
    Blend(Box<blend::BlendArgs>),
    /// Make one mesh of parts of two
    Compose(Box<compose::ComposeArgs>),
    /// Draw meshes, without a graphics card
    Render(Box<render::RenderArgs>),
    /// Run a pipeline file
    Run(run::RunArgs),
    /// Check a pipeline file, touching no input
    Check(check::CheckArgs),
    /// Show the passes of a pipeline and what each holds in memory
    Plan(plan::PlanArgs),
    /// Draw the stages of a pipeline
    Graph(graph::GraphArgs),
    /// Describe the kinds of stages: ports, settings, defaults
    Stages(stages::StagesArgs),
    /// Print the JSON schema of pipeline files, or of another format that is read
    Schema(schema::SchemaArgs),
    /// Solve a sparse linear system; compare elimination orders
    Solve(Box<solve::SolveArgs>),
    /// Tell what is in a clip
    Probe(probe::ProbeArgs),
    /// Print completions for a shell
    Completions(completions::CompletionsArgs),
}

/// Which pipeline file, and what to change in it.
#[derive(Debug, Args)]
struct PipelineArgs {
    /// A pipeline file, or the name of a shipped one: stabilize, stabilize-3d, rectify, retarget, vertical-video, deform-mesh,
    /// rig-and-pose, morph
    #[arg(value_name = "FILE|NAME")]
    file: String,
    /// Change a setting; NAME is a stage, or vars, batch or run
    #[arg(long, value_name = "NAME.KEY=VALUE")]
    set: Vec<String>,
}

impl PipelineArgs {
    fn read(&self) -> Result<Pipeline, Failure> {
        let source = crate::pipeline::shipped::find_source(&self.file).map_err(Failure::usage)?;
        Ok(crate::pipeline::read(source, &self.set)?)
    }
}

/// Runs the program on the process's own arguments.
pub fn main(backend: &dyn StageRunner) -> ExitCode {
    let cli = Cli::parse();
    start_log();
    let exit = dispatch(cli.command, backend).unwrap_or_else(|failure| {
        failure.tell();
        failure.exit
    });
    ExitCode::from(exit as u8)
}

/// The command line's definition, for help and completions.
pub fn command() -> clap::Command {
    Cli::command()
}

/// The pipeline that a command which means one builds from these arguments, the program's name first.
///
/// # Errors
/// What clap says of them, or why they do not fit together.
pub fn pipeline_of<I: IntoIterator<Item = T>, T: Into<std::ffi::OsString> + Clone>(
    args: I,
) -> Result<PipelineFile, String> {
    match Cli::try_parse_from(args).map_err(|e| e.to_string())?.command {
        Command::Stabilize(args) => args.pipeline().map_err(|f| f.message),
        Command::Rectify(args) => args.pipeline().map_err(|f| f.message),
        Command::Retarget(args) => args.pipeline().map_err(|f| f.message),
        Command::Deform(args) => args.pipeline().map_err(|f| f.message),
        Command::Modes(args) => Ok(args.pipeline()),
        Command::Skin(args) => Ok(args.pipeline()),
        Command::Skeleton(args) => args.pipeline().map_err(|f| f.message),
        Command::Pose(args) => args.pipeline().map_err(|f| f.message),
        Command::Morph(args) => Ok(args.pipeline()),
        Command::Blend(args) => Ok(args.pipeline()),
        Command::Compose(args) => Ok(args.pipeline()),
        Command::Render(args) => args.pipeline().map_err(|f| f.message),
        _ => Err("not a command that builds a pipeline".to_owned()),
    }
}

fn dispatch(command: Command, backend: &dyn StageRunner) -> Result<Exit, Failure> {
    match command {
        Command::Stabilize(args) => args.run(backend),
        Command::Rectify(args) => args.run(backend),
        Command::Retarget(args) => args.run(backend),
        Command::Motion(args) => args.run(backend),
        Command::Mesh(args) => args.run(),
        Command::Deform(args) => args.run(backend),
        Command::Modes(args) => args.run(backend),
        Command::Skin(args) => args.run(backend),
        Command::Skeleton(args) => args.run(backend),
        Command::Pose(args) => args.run(backend),
        Command::Morph(args) => args.run(backend),
        Command::Blend(args) => args.run(backend),
        Command::Compose(args) => args.run(backend),
        Command::Render(args) => args.run(backend),
        Command::Run(args) => args.run(backend),
        Command::Check(args) => args.run(),
        Command::Plan(args) => args.run(backend),
        Command::Graph(args) => args.run(),
        Command::Stages(args) => args.run(),
        Command::Schema(args) => Ok(args.run()),
        Command::Solve(args) => args.run(),
        Command::Probe(args) => args.run(backend),
        Command::Completions(args) => Ok(args.run()),
    }
}

/// `PLUMBLINE_LOG` chooses what is logged, as `error`, `warn`, `info`, `debug` or by module.
fn start_log() {
    let filter = tracing_subscriber::EnvFilter::try_from_env("PLUMBLINE_LOG").unwrap_or_else(|_| "off".into());
    // A second start in one process keeps the first subscriber, which is as good.
    let _ = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).try_init();
}

/// Writes a result to standard output. A reader that went away has read enough.
fn tell(text: &str) {
    let mut out = std::io::stdout().lock();
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}
