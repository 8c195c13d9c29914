//! The command line: one file per subcommand. Each builds or reads a pipeline and hands it to the same executor.
//!
//! Standard output carries results only; progress, summaries and errors go to standard error. Exit statuses: [`Exit`].

mod blend;
mod cache;
mod check;
mod clip;
mod completions;
mod compose;
mod defaults;
mod deform;
mod doctor;
mod engine;
mod extension;
mod failure;
mod graph;
mod help;
mod interrupt;
mod job;
mod mesh;
mod mesh_stages;
mod modes;
mod morph;
mod motion;
mod options;
mod out_of_memory;
mod path_map;
mod photo;
mod photo_clip;
mod plan;
mod pose;
mod prelude;
mod probe;
mod rectify;
mod render;
mod retarget;
mod run;
mod schema;
mod session;
mod skeleton;
mod skin;
mod solve;
mod spelling;
mod stabilize;
mod stages;
mod target;
mod task;
mod worker;

use std::ffi::OsString;
use std::io::Write;
use std::process::ExitCode;
use std::time::Duration;

use clap::{ArgMatches, Args, CommandFactory, FromArgMatches, Parser, Subcommand};

use crate::pipeline::paths::to_path;
use crate::pipeline::syntax::SourceId;
use crate::pipeline::{Exit, Instance, Pipeline, PipelineFile, Problem, Problems, StageRunner, shipped};
use defaults::Defaults;
pub use extension::Extension;
use failure::Failure;
use interrupt::{GRACE, Interrupt};
use job::{BuildsPipeline, JobArgs, JobCommand};
pub use out_of_memory::NotingAllocator;
use session::{GlobalArgs, Session};

/// Deshake video, defish and retarget photos; deform, auto-rig, skin and morph meshes
#[derive(Debug, Parser)]
#[command(name = "plumbline", version, max_term_width = 100, propagate_version = true)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    global: GlobalArgs,
}

impl Cli {
    /// Reads a command line of this crate, the program's name first, and the file of settings that it names.
    fn read<I, T>(args: I) -> Result<(Self, Option<Defaults>), Refusal>
    where
        I: IntoIterator<Item = T>,
        T: Into<OsString>,
    {
        let mut command = command();
        let (matches, defaults) = Self::matches(args, &mut command)?;
        let cli = Self::from_arg_matches(&matches).map_err(|error| error.format(&mut command))?;
        Ok((cli, defaults))
    }

    /// The arguments of a command line as `command` defines them.
    fn matches<I, T>(args: I, command: &mut clap::Command) -> Result<(ArgMatches, Option<Defaults>), Refusal>
    where
        I: IntoIterator<Item = T>,
        T: Into<OsString>,
    {
        let args: Vec<OsString> = args.into_iter().map(Into::into).collect();
        let mut defaults = None;
        if let Some((path, file)) = defaults::requested(command, &args) {
            let mut read = Defaults::read(&file)?;
            *command = read.set(std::mem::take(command), &path);
            defaults = Some(read);
        }
        Ok((command.try_get_matches_from_mut(args)?, defaults))
    }
}

/// Why a command line was not read.
enum Refusal {
    /// It is wrong, or asks for help.
    Line(clap::Error),
    /// The file of settings is wrong.
    Settings(Failure),
}

impl From<clap::Error> for Refusal {
    fn from(error: clap::Error) -> Self {
        Self::Line(error)
    }
}

impl From<Failure> for Refusal {
    fn from(failure: Failure) -> Self {
        Self::Settings(failure)
    }
}

#[derive(Debug, Subcommand)]
enum Command {
    #[command(flatten)]
    Job(PipelineCommand),
    #[command(flatten)]
    Tool(ToolCommand),
}

/// Commands that build a pipeline and run it.
#[derive(Debug, Subcommand)]
enum PipelineCommand {
    /// Stabilize shaky clips (deshake)
    Stabilize(Box<JobCommand<stabilize::StabilizeArgs>>),
    /// Straighten wide-angle and fisheye photos (defish, perspective correction); remove the lens distortion of clips
    Rectify(Box<JobCommand<rectify::RectifyArgs>>),
    /// Resize photos and clips to another aspect ratio, content-aware
    Retarget(Box<JobCommand<retarget::RetargetArgs>>),
    /// Recover the motion of the camera, in the image plane and in space
    Motion(Box<JobCommand<motion::MotionArgs>>),
    /// Deform meshes: a few vertices are fixed or moved, and the rest follows
    Deform(Box<JobCommand<deform::DeformArgs>>),
    /// Compute the vibration modes of a mesh, and its near-rigid parts
    Modes(Box<JobCommand<modes::ModesArgs>>),
    /// Compute skinning weights, or learn a skin from examples
    Skin(skin::SkinArgs),
    /// Extract the skeletons of meshes (auto-rig)
    Skeleton(Box<JobCommand<skeleton::SkeletonArgs>>),
    /// Pose and animate characters
    Pose(Box<JobCommand<pose::PoseArgs>>),
    /// Interpolate between two meshes
    Morph(Box<JobCommand<morph::MorphArgs>>),
    /// Blend two meshes with painted weights
    Blend(Box<JobCommand<blend::BlendArgs>>),
    /// Join parts of two meshes into one
    Compose(Box<JobCommand<compose::ComposeArgs>>),
    /// Render images of meshes, without a graphics card
    Render(Box<JobCommand<render::RenderArgs>>),
}

/// All other commands.
#[derive(Debug, Subcommand)]
enum ToolCommand {
    /// Inspect, repair and convert mesh files
    Mesh(mesh::MeshArgs),
    /// Run a pipeline file
    Run(Box<run::RunArgs>),
    /// Check a pipeline file and its batch without opening an input
    Check(check::CheckArgs),
    /// Show the passes of a pipeline and the memory that each needs
    Plan(Box<plan::PlanArgs>),
    /// Do one task of a plan, for an engine that hands them out
    Task(Box<task::TaskArgs>),
    /// Show what the cache holds and why, or remove it
    Cache(cache::CacheArgs),
    /// Draw the stages of a pipeline
    Graph(graph::GraphArgs),
    /// Describe the stage kinds: ports, settings, defaults
    Stages(stages::StagesArgs),
    /// Print the JSON schema of pipeline files, or of another input format
    Schema(schema::SchemaArgs),
    /// Solve a sparse linear system; compare elimination orders
    Solve(Box<solve::SolveArgs>),
    /// Show what is in a clip
    Probe(probe::ProbeArgs),
    /// Print versions, encoders and limits of this machine, for reports of faults
    Doctor,
    /// Print completions for a shell
    Completions(completions::CompletionsArgs),
    /// Do the items of a batch for another process of this program
    #[command(hide = true)]
    Worker,
}

impl PipelineCommand {
    /// The command's own options, and how the job runs.
    fn parts(&self) -> (&dyn BuildsPipeline, &JobArgs) {
        match self {
            Self::Stabilize(command) => command.parts(),
            Self::Rectify(command) => command.parts(),
            Self::Retarget(command) => command.parts(),
            Self::Motion(command) => command.parts(),
            Self::Deform(command) => command.parts(),
            Self::Modes(command) => command.parts(),
            Self::Skin(command) => command.parts(),
            Self::Skeleton(command) => command.parts(),
            Self::Pose(command) => command.parts(),
            Self::Morph(command) => command.parts(),
            Self::Blend(command) => command.parts(),
            Self::Compose(command) => command.parts(),
            Self::Render(command) => command.parts(),
        }
    }

    /// The pipeline that the options stand for.
    fn pipeline(&self) -> Result<PipelineFile, Failure> {
        let (own, job) = self.parts();
        job.complete(own)
    }
}

/// Which pipeline file, and what to change in it.
#[derive(Debug, Args)]
struct PipelineArgs {
    /// A pipeline file, or the name of a shipped one: stabilize, stabilize-3d, rectify, retarget, vertical-video, deform-mesh,
    /// rig-and-pose, morph
    #[arg(value_parser = job::path_text(), value_name = "FILE|NAME")]
    file: String,
    /// Change a setting; NAME is a stage, or vars, batch or run
    #[arg(long, value_parser = job::path_text(), value_name = "NAME.KEY=VALUE")]
    set: Vec<String>,
}

impl PipelineArgs {
    fn read(&self) -> Result<Pipeline, Failure> {
        let source = shipped::find_source(&self.file).map_err(Failure::usage)?;
        Ok(crate::pipeline::read(source, &self.set)?)
    }

    /// The instances as `run` would have them. A shipped pipeline can be looked at where there is nothing to work on: that its
    /// own pattern finds nothing is no fault.
    fn instances(&self, pipeline: &Pipeline) -> Result<Vec<Instance>, Problems> {
        let is_own = |problem: &Problem| {
            let shipped = shipped::shipped(&self.file).is_some() && !to_path(&self.file).exists();
            shipped
                && problem.code == "empty-batch"
                && problem.labels.iter().all(|(span, _)| span.source == SourceId(0))
        };
        match pipeline.instances() {
            Err(problems) if problems.problems.iter().all(is_own) => Ok(Vec::new()),
            instances => instances,
        }
    }
}

impl Command {
    /// How long the command may take to stop after a signal: nothing where it does not look for one.
    fn grace(&self) -> Duration {
        match self {
            Self::Job(_)
            | Self::Tool(
                ToolCommand::Run(_)
                | ToolCommand::Task(_)
                | ToolCommand::Mesh(_)
                | ToolCommand::Solve(_)
                | ToolCommand::Worker,
            ) => GRACE,
            Self::Tool(_) => Duration::ZERO,
        }
    }
}

/// What a command line asks for.
enum Job {
    /// A command of this crate, with the settings of a file.
    Own(Box<Command>, Option<Defaults>),
    /// A command of another crate.
    Other(Extension, ArgMatches),
}

/// Runs the program on the process's own arguments; `extensions` are commands of other crates.
pub fn main(runner: &dyn StageRunner, extensions: &[Extension]) -> ExitCode {
    out_of_memory::return_large_blocks();
    out_of_memory::install();
    let (global, job) = match read_line(extensions) {
        Ok(read) => read,
        Err(Refusal::Line(error)) => error.exit(),
        Err(Refusal::Settings(failure)) => {
            failure.report();
            return ExitCode::from(failure.exit as u8);
        }
    };
    let exit = run_job(&global, job, runner, extensions).unwrap_or_else(|failure| {
        failure.report();
        failure.exit
    });
    ExitCode::from(exit as u8)
}

/// Reads the process's own arguments.
fn read_line(extensions: &[Extension]) -> Result<(GlobalArgs, Job), Refusal> {
    let mut command = command_with(extensions);
    let (matches, defaults) = Cli::matches(std::env::args_os(), &mut command)?;
    if let Some((extension, below)) = Extension::named(extensions, &matches) {
        let global = GlobalArgs::from_arg_matches(&matches).map_err(|error| error.format(&mut command))?;
        return Ok((global, Job::Other(extension, below.clone())));
    }
    let cli = Cli::from_arg_matches(&matches).map_err(|error| error.format(&mut command))?;
    Ok((cli.global, Job::Own(Box::new(cli.command), defaults)))
}

fn run_job(global: &GlobalArgs, job: Job, runner: &dyn StageRunner, extensions: &[Extension]) -> Result<Exit, Failure> {
    global.start_log()?;
    let grace = match &job {
        Job::Own(command, _) => command.grace(),
        Job::Other(..) => GRACE,
    };
    let interrupt = Interrupt::install(grace)?;
    let (verbosity, log) = (global.verbosity(), global.log_args());
    match job {
        Job::Own(command, defaults) => {
            dispatch(*command, &Session { runner, verbosity, log, defaults, interrupt, extensions })
        }
        Job::Other(extension, matches) => {
            let run = interrupt.run();
            let exit = (extension.run)(&matches, &run.interrupt)?;
            Ok(if run.check().is_err() { interrupt.exit() } else { exit })
        }
    }
}

/// The command line's definition, for help and completions.
pub fn command() -> clap::Command {
    command_with(&[])
}

/// The same with commands of other crates.
fn command_with(extensions: &[Extension]) -> clap::Command {
    // `rectify --to` is the projection, so that there the end of a clip has one name.
    let retarget = |command: clap::Command| command.mut_arg("end", |end| end.visible_alias("to"));
    // `render --flat` is the shading.
    let render = |command: clap::Command| command.mut_arg("flat_tree", |flat| flat.long("flat-tree"));
    let command = Cli::command().mut_subcommand("retarget", retarget).mut_subcommand("render", render);
    let command = command.subcommands(extensions.iter().map(|extension| (extension.command)()));
    spelling::accept_british(help::complete(command, extensions))
}

/// The pipeline that a command builds from these arguments, the program's name first.
///
/// # Errors
/// The error message of the parser, or why the options exclude each other.
pub fn pipeline_of<I: IntoIterator<Item = T>, T: Into<OsString>>(args: I) -> Result<PipelineFile, String> {
    let (cli, defaults) = Cli::read(args).map_err(|refusal| match refusal {
        Refusal::Line(error) => error.to_string(),
        Refusal::Settings(failure) => failure.message,
    })?;
    let Command::Job(command) = cli.command else { return Err("not a command that builds a pipeline".to_owned()) };
    let mut file = command.pipeline().map_err(|f| f.message)?;
    if let Some(defaults) = defaults {
        defaults.apply(&mut file);
    }
    Ok(file)
}

fn dispatch(command: Command, session: &Session<'_>) -> Result<Exit, Failure> {
    let tool = match command {
        Command::Job(command) => {
            return run::run_or_print(command.pipeline()?, command.parts().1, session);
        }
        Command::Tool(tool) => tool,
    };
    match tool {
        ToolCommand::Mesh(args) => args.run(session),
        ToolCommand::Run(args) => args.run(session),
        ToolCommand::Check(args) => args.run(),
        ToolCommand::Plan(args) => args.run(session),
        ToolCommand::Task(args) => args.run(session),
        ToolCommand::Cache(args) => args.run(),
        ToolCommand::Graph(args) => args.run(),
        ToolCommand::Stages(args) => args.run(),
        ToolCommand::Schema(args) => Ok(args.run()),
        ToolCommand::Solve(args) => args.run(session),
        ToolCommand::Probe(args) => args.run(session),
        ToolCommand::Completions(args) => Ok(args.run(session)),
        ToolCommand::Doctor => Ok(doctor::run()),
        ToolCommand::Worker => worker::run(session),
    }
}

/// Writes a result to standard output. A reader that went away has read enough.
fn print(text: &str) {
    let mut out = std::io::stdout().lock();
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}
