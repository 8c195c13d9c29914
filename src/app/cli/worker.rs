//! `plumbline worker`: does the items of a batch for another process of this program. It is not for people.

use std::ffi::OsString;
use std::io::BufReader;
use std::path::PathBuf;

use signal_hook::consts::SIGTERM;

use super::failure::Failure;
use super::session::Session;
use crate::pipeline::Exit;
use crate::pipeline::worker::{WorkerProgram, serve};

/// The command's name.
const NAME: &str = "worker";

/// This program as a worker that logs by the options `log`; `None` where the system does not tell which program this is.
pub(super) fn this_program(log: &[OsString]) -> Option<WorkerProgram> {
    // The running program itself, also after its file was replaced by another version.
    let linux = PathBuf::from("/proc/self/exe");
    let path = if linux.exists() { linux } else { std::env::current_exe().ok()? };
    Some(WorkerProgram { path, args: [&[NAME.into()], log].concat() })
}

/// Takes orders from standard input until it ends.
pub(super) fn run(session: &Session<'_>) -> Result<Exit, Failure> {
    // As if the user had stopped this process: the same handler, the same time to clean up.
    let stopped = || drop(signal_hook::low_level::raise(SIGTERM));
    let orders = BufReader::new(std::io::stdin());
    serve(orders, std::io::stdout(), session.runner, &session.interrupt.cancel, stopped)?;
    Ok(Exit::Done)
}
