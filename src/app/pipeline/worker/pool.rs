//! The run's side: starts workers, hands them orders, and sees when one dies.

use std::ffi::OsString;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, PoisonError};

use super::{Order, RECORDED, Reply};
use crate::pipeline::job::Publishing;
use crate::pipeline::paths::Paths;
use crate::pipeline::progress::{Event, Progress};
use crate::pipeline::run_error::{Exit, RunError};
use crate::pipeline::summary::Summary;

/// Length of a reply, bytes: a summary that lists a hundred thousand files is shorter.
const MAX_REPLY: u64 = 64 << 20;

/// The program whose processes are workers, and its arguments.
#[derive(Clone, Debug)]
pub struct WorkerProgram {
    /// The program.
    pub path: PathBuf,
    /// What makes a worker of it.
    pub args: Vec<OsString>,
}

/// Standard input of a worker; taken, it ends.
type Orders = Arc<Mutex<Option<ChildStdin>>>;

/// All workers of a run.
#[derive(Debug)]
pub struct Pool {
    program: WorkerProgram,
    orders: Mutex<Vec<Orders>>,
}

/// A worker process, started with its first order and again after a crash.
#[derive(Debug)]
pub struct Worker<'a> {
    pool: &'a Pool,
    process: Option<Process>,
}

#[derive(Debug)]
struct Process {
    child: Child,
    orders: Orders,
    replies: BufReader<ChildStdout>,
}

impl Pool {
    /// No worker yet.
    pub fn new(program: WorkerProgram) -> Self {
        Self { program, orders: Mutex::default() }
    }

    /// A place for one worker.
    pub fn worker(&self) -> Worker<'_> {
        Worker { pool: self, process: None }
    }

    /// Stops all workers, whatever they are at.
    pub fn stop(&self) {
        for orders in locked(&self.orders).drain(..) {
            drop(locked(&orders).take());
        }
    }

    fn start(&self) -> Result<Process, RunError> {
        let mut command = Command::new(&self.program.path);
        let piped = command.args(&self.program.args).stdin(Stdio::piped()).stdout(Stdio::piped());
        let failed = |e| RunError::Temporary(format!("cannot start a worker process: {e}; use fewer jobs"));
        let mut child = piped.spawn().map_err(failed)?;
        let (Some(orders), Some(replies)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(RunError::Internal("a worker without pipes".to_owned()));
        };
        let orders = Arc::new(Mutex::new(Some(orders)));
        locked(&self.orders).push(Arc::clone(&orders));
        Ok(Process { child, orders, replies: BufReader::new(replies) })
    }
}

impl Worker<'_> {
    /// Does an order, and passes on how far it is; `publishing` is asked before a result gets its name.
    ///
    /// # Errors
    /// What the worker reports; [`RunError::Internal`] where it dies of a crash, [`RunError::Temporary`] where it is killed.
    pub fn run(
        &mut self,
        order: &Order,
        task: &str,
        progress: &dyn Progress,
        publishing: &Publishing<'_>,
    ) -> Result<Summary, RunError> {
        let process = match self.process.take() {
            Some(process) => process,
            None => self.pool.start()?,
        };
        let process = self.process.insert(process);
        // A worker that died takes no order, and sends no reply either.
        let _ = serde_json::to_string(order).map_err(Into::into).and_then(|order| process.send(&order));
        loop {
            match process.reply() {
                Some(Reply::Tick(tick)) => progress.event(&Event::TaskProgress { task, tick: &tick }),
                Some(Reply::Publishing(Paths(paths))) => {
                    let known = paths.as_chunks::<2>().0.iter().try_for_each(|[file, target]| publishing(file, target));
                    // What no record can tell of does not get its name: the worker stops.
                    if known.is_ok() {
                        let _ = process.send(RECORDED);
                    } else {
                        drop(locked(&process.orders).take());
                    }
                }
                Some(Reply::Done(summary)) => return Ok(*summary),
                Some(Reply::Failed(exit, message)) => return Err(RunError::of_message(exit, message)),
                None => break,
            }
        }
        Err(self.process.take().map_or(RunError::Interrupted, Process::buried))
    }
}

impl Drop for Worker<'_> {
    fn drop(&mut self) {
        if let Some(process) = self.process.take() {
            process.buried();
        }
    }
}

impl Process {
    fn send(&self, line: &str) -> std::io::Result<()> {
        locked(&self.orders).as_mut().map_or(Ok(()), |orders| orders.write_all(format!("{line}\n").as_bytes()))
    }

    /// `None` where no more can come.
    fn reply(&mut self) -> Option<Reply> {
        let mut line = String::new();
        (&mut self.replies).take(MAX_REPLY).read_line(&mut line).ok()?;
        serde_json::from_str(&line).ok()
    }

    /// Lets it end, and says how it did.
    fn buried(mut self) -> RunError {
        drop(locked(&self.orders).take());
        match self.child.wait() {
            Ok(status) => end_of(status),
            Err(e) => RunError::Internal(format!("a worker process was lost: {e}")),
        }
    }
}

/// What an end without a reply means for the item.
fn end_of(status: ExitStatus) -> RunError {
    let stopped = [Exit::Interrupted, Exit::Terminated, Exit::HungUp].map(|exit| i32::from(exit as u8));
    match (status.code(), signal(status)) {
        (Some(code), _) if stopped.contains(&code) => RunError::Interrupted,
        (Some(code), _) if code == i32::from(Exit::Temporary as u8) => {
            RunError::Temporary("its worker process ran into a limit of the system, named above".to_owned())
        }
        (_, Some(libc::SIGINT | libc::SIGTERM | libc::SIGHUP)) => RunError::Interrupted,
        (_, Some(libc::SIGKILL)) => {
            let why = "as systems do that run out of memory; use fewer jobs or threads";
            RunError::Temporary(format!("its worker process was killed, {why}"))
        }
        _ => RunError::Internal(format!("its worker process crashed ({status})")),
    }
}

#[cfg(unix)]
fn signal(status: ExitStatus) -> Option<i32> {
    std::os::unix::process::ExitStatusExt::signal(&status)
}

#[cfg(not(unix))]
fn signal(_: ExitStatus) -> Option<i32> {
    None
}

fn locked<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
