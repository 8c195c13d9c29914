//! `plumbline run --engine`: hands the tasks of a pipeline to another program.

use std::ffi::{OsStr, OsString};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use clap::{Args, ValueEnum};

use super::failure::Failure;
use super::path_map::PathMapArgs;
use super::session::Session;
use crate::pipeline::items::RECORDS_FOLDER;
use crate::pipeline::paths::to_name;
use crate::pipeline::tasks::{TaskFormat, TaskPlan, export};
use crate::pipeline::{Exit, Pipeline, RunError};
use crate::stages::files::write_whole;
use plumbline_num::files::IfExists;

/// Who runs the tasks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Engine {
    /// This program, on this machine
    #[default]
    Builtin,
    /// A Dask cluster, by the Python package plumbline-dask
    Dask,
    /// HyperQueue, by its program `hq`
    Hq,
}

#[derive(Debug, Args)]
pub(super) struct EngineArgs {
    /// Who does the work: this program, or a cluster on which it is installed
    #[arg(long, value_enum, default_value_t, value_name = "ENGINE", help_heading = "Other machines")]
    engine: Engine,
    /// The folder that all machines have, with inputs and results below it; the working directory if left out
    #[arg(long, value_name = "DIR", help_heading = "Other machines")]
    root: Option<PathBuf>,
    /// Where the other machines have that folder, if elsewhere
    #[arg(long, value_name = "DIR", help_heading = "Other machines")]
    remote_root: Option<PathBuf>,
    #[command(flatten)]
    path_map: PathMapArgs,
    /// Address of the Dask scheduler: tls://HOST:PORT, or tcp:// on this machine
    #[arg(long, value_name = "ADDRESS", help_heading = "Other machines")]
    scheduler: Option<String>,
    /// Split each stabilized clip that is longer into tasks of about this length, seconds
    #[arg(long, value_name = "SECONDS", value_parser = super::plan::seconds_of_split, help_heading = "Other machines")]
    split: Option<f64>,
    /// Permit tcp:// beyond this machine: anyone in the network could run programs on the cluster
    #[arg(long, help_heading = "Other machines")]
    insecure_scheduler: bool,
    /// Certificates of the authorities that the scheduler's certificate is checked by (PEM)
    #[arg(long, value_name = "FILE.pem", requires_all = ["tls_cert", "tls_key"], help_heading = "Other machines")]
    tls_ca: Option<PathBuf>,
    /// The certificate that is shown to the scheduler (PEM)
    #[arg(long, value_name = "FILE.pem", requires = "tls_ca", help_heading = "Other machines")]
    tls_cert: Option<PathBuf>,
    /// Its key (PEM)
    #[arg(long, value_name = "FILE.pem", requires = "tls_ca", help_heading = "Other machines")]
    tls_key: Option<PathBuf>,
}

impl EngineArgs {
    /// Runs a pipeline by the engine that is asked for; `None`: by this program.
    pub(super) fn run(&self, pipeline: &Pipeline, session: &Session<'_>) -> Result<Option<Exit>, Failure> {
        match self.engine {
            Engine::Builtin if self.split.is_some() => Err(Failure::usage(
                "--split makes tasks for other machines: choose them by --engine dask or hq, or leave it out",
            )),
            Engine::Builtin if !self.path_map.map()?.rules().is_empty() => Err(Failure::usage(
                "--path-map is for tasks on other machines: choose them by --engine dask or hq, or leave it out",
            )),
            Engine::Builtin => Ok(None),
            Engine::Dask => self.dask(pipeline, session).map(Some),
            Engine::Hq => self.hq(pipeline, session).map(Some),
        }
    }

    /// Another program does the work, so that options of the built-in executor have no effect.
    pub(super) fn is_elsewhere(&self) -> bool {
        self.engine != Engine::Builtin
    }

    /// The folder of this machine that others share.
    fn root(&self) -> PathBuf {
        self.root.clone().unwrap_or_else(|| PathBuf::from("."))
    }

    /// The same as other machines have it.
    fn remote_root(&self) -> PathBuf {
        self.remote_root.clone().unwrap_or_else(|| absolute(&self.root()))
    }

    /// Writes the plan below the root, where all machines see it; its path from there.
    fn write_plan(&self, pipeline: &Pipeline, session: &Session<'_>) -> Result<(TaskPlan, PathBuf), Failure> {
        let instances = pipeline.instances()?;
        let mut plan = TaskPlan::of(pipeline, &instances, &self.root(), session.runner)?;
        if let Some(seconds) = self.split {
            super::plan::split_clips(&mut plan, &self.root(), seconds, session)?;
        }
        let text = plan.to_text()?;
        let folder = PathBuf::from(RECORDS_FOLDER).join("plans");
        let name = folder.join(format!("{}.json", &blake3::hash(text.as_bytes()).to_hex()[..16]));
        let failed = |e| RunError::Output(format!("no folder for the plan below `{}`: {e}", self.root().display()));
        std::fs::create_dir_all(self.root().join(folder)).map_err(failed)?;
        write_whole(&self.root().join(&name), text, IfExists::Replace)?;
        Ok((plan, name))
    }

    fn dask(&self, pipeline: &Pipeline, session: &Session<'_>) -> Result<Exit, Failure> {
        let none = || Failure::usage("--engine dask needs --scheduler tls://HOST:PORT");
        let scheduler = self.scheduler.as_ref().ok_or_else(none)?;
        let python = std::env::var_os("PLUMBLINE_PYTHON").unwrap_or_else(|| "python3".into());
        let module = ["-c", "import plumbline_dask, distributed"];
        let there = Command::new(&python).args(module).stderr(Stdio::null()).status().is_ok_and(|s| s.success());
        if !there {
            let help = "install it there, or name another Python by the variable PLUMBLINE_PYTHON";
            let python = python.display();
            return Err(Failure::new(Exit::Temporary, format!("`{python}` has no package plumbline-dask: {help}")));
        }
        let (_, name) = self.write_plan(pipeline, session)?;
        let mut command = Command::new(&python);
        command.args(["-m", "plumbline_dask"]).arg(self.root().join(&name));
        command.args(["--scheduler", scheduler]).arg("--root").arg(self.remote_root());
        command.arg("--remote-plan").arg(self.remote_root().join(&name));
        for (option, file) in [("--tls-ca", &self.tls_ca), ("--tls-cert", &self.tls_cert), ("--tls-key", &self.tls_key)]
        {
            if let Some(file) = file {
                command.arg(option).arg(file);
            }
        }
        for rule in self.path_map.map()?.rules() {
            command.arg("--path-map").arg(to_name(&rule.to_text()));
        }
        command.args(self.insecure_scheduler.then_some("--insecure-scheduler"));
        if session.progress(pipeline.run.progress) == crate::pipeline::options::ProgressMode::Json {
            command.args(["--progress", "json"]);
        }
        exit_of(&mut command)
    }

    fn hq(&self, pipeline: &Pipeline, session: &Session<'_>) -> Result<Exit, Failure> {
        let (plan, name) = self.write_plan(pipeline, session)?;
        let job = self.root().join(&name).with_extension("toml");
        let (root, map) = (self.remote_root(), self.path_map.map()?);
        let text = export(&plan, &root.join(&name), &root, &map, TaskFormat::Hq);
        write_whole(&job, text, IfExists::Replace)?;
        exit_of(Command::new("hq").args([OsStr::new("job"), OsStr::new("submit-file")]).arg(job))
    }
}

fn absolute(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

/// Runs a program to its end. What it prints is for the user.
fn exit_of(command: &mut Command) -> Result<Exit, Failure> {
    let program: OsString = command.get_program().to_owned();
    let failed = |e: std::io::Error| {
        let program = program.display();
        let help = if e.kind() == ErrorKind::NotFound { "; is it installed, and on the PATH?" } else { "" };
        Failure::new(Exit::Temporary, format!("`{program}` does not start: {e}{help}"))
    };
    let status = command.status().map_err(failed)?;
    Ok(match status.code() {
        Some(0) => Exit::Done,
        Some(2) => Exit::Usage,
        Some(3) => Exit::Partial,
        Some(4) => Exit::OtherPlan,
        Some(130) | None => Exit::Interrupted,
        Some(_) => Exit::Temporary,
    })
}
