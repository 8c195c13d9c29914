//! Ctrl-C, SIGTERM and SIGHUP: the first asks the work to stop and clean up; where the program has not ended soon after, or at
//! the second, its unfinished files are removed and it ends, whatever a library is doing.
//!
//! Handlers set flags and write a byte to a socket; a thread that does nothing else waits at its other end.
#![allow(unsafe_code)] // Whether a signal was ignored from the start is asked of the system.

use std::io::Read as _;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::{flag, low_level};

use super::failure::Failure;
use crate::pipeline::{Exit, RunError};
use plumbline_num::files::remove_partial_files;
use plumbline_num::limits::Shortage;
use plumbline_num::run::Run;

/// Time that the work has to stop by itself: within two seconds of a signal the program has ended, and removing files and giving back
/// memory take some of that (.4 to .6 s where the vibration modes of 700,000 vertices are computed on a busy machine).
pub(super) const GRACE: Duration = Duration::from_millis(1500);

/// What the signals set.
#[derive(Debug)]
pub(super) struct Interrupt {
    /// Asks the work to stop.
    pub cancel: Arc<AtomicBool>,
    signal: Arc<AtomicUsize>,
}

impl Interrupt {
    /// Takes over the signals; `grace`: how long the work may take to stop.
    pub(super) fn install(grace: Duration) -> Result<Self, Failure> {
        let interrupt = Self { cancel: Arc::default(), signal: Arc::default() };
        interrupt.watch(grace).map_err(|error| match Shortage::of_io(&error) {
            Some(shortage) => RunError::Temporary(format!("cannot watch for signals: {shortage}")),
            None => RunError::Internal(format!("cannot handle signals: {error}")),
        })?;
        Ok(interrupt)
    }

    fn watch(&self, grace: Duration) -> std::io::Result<()> {
        let (end, bell) = UnixStream::pair()?;
        let signal = Arc::clone(&self.signal);
        // Before the handlers: from the first signal on somebody waits for the bell.
        std::thread::Builder::new().name("signals".to_owned()).spawn(move || wait(end, grace, &signal))?;
        for signal in [SIGINT, SIGTERM, SIGHUP] {
            // `nohup` and shells that start programs in the background ask for this.
            if is_ignored(signal) {
                continue;
            }
            flag::register_usize(signal, Arc::clone(&self.signal), signal as usize)?;
            flag::register(signal, Arc::clone(&self.cancel))?;
            low_level::pipe::register(signal, bell.try_clone()?)?;
        }
        // A file beyond the limit of `ulimit -f` is an error of writing; unheeded, the signal would end the program.
        flag::register(SIGXFSZ, Arc::default()).map(drop)
    }

    /// How a long call runs: it stops once a signal came.
    pub(super) fn run(&self) -> Run {
        Run::with_interrupt(&plumbline_num::run::Interrupt::from_flag(Arc::clone(&self.cancel)))
    }

    /// The exit status of the signal that came.
    pub(super) fn exit(&self) -> Exit {
        exit_of(&self.signal)
    }
}

/// Ends the process once a signal came and either its time is over or another one came.
fn wait(mut end: UnixStream, grace: Duration, signal: &AtomicUsize) {
    let mut bell = [0];
    if !matches!(end.read(&mut bell), Ok(1)) {
        return;
    }
    if !grace.is_zero() && end.set_read_timeout(Some(grace)).is_ok() {
        // A byte, or none in time.
        let _ = end.read(&mut bell);
    }
    remove_partial_files();
    low_level::exit(i32::from(exit_of(signal) as u8));
}

fn exit_of(signal: &AtomicUsize) -> Exit {
    match signal.load(Ordering::Relaxed) as i32 {
        SIGTERM => Exit::Terminated,
        SIGHUP => Exit::HungUp,
        _ => Exit::Interrupted,
    }
}

fn is_ignored(signal: i32) -> bool {
    let mut action = std::mem::MaybeUninit::<libc::sigaction>::zeroed();
    // SAFETY: no new action is set; the present one is written to memory that is valid for it, all of whose bits may be zero.
    unsafe {
        libc::sigaction(signal, std::ptr::null(), action.as_mut_ptr()) == 0
            && action.assume_init().sa_sigaction == libc::SIG_IGN
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_signal_asks_to_stop_and_names_itself() {
        let interrupt = Interrupt::install(Duration::from_hours(1)).expect("signals can be handled");
        assert!(!interrupt.cancel.load(Ordering::Relaxed));
        low_level::raise(SIGTERM).expect("a process may signal itself");
        assert!(interrupt.cancel.load(Ordering::Relaxed));
        assert_eq!(interrupt.exit(), Exit::Terminated);
        assert_eq!(interrupt.run().check(), Err(plumbline_num::run::Stopped::Interrupted));
    }
}
