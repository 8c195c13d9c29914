//! Ctrl-C and SIGTERM: the first asks the work to stop and clean up, the second ends the program at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use signal_hook::consts::{SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::flag;

use super::failure::Failure;
use crate::pipeline::{Exit, RunError};

/// What the signals set.
pub(super) struct Interrupt {
    /// Asks the work to stop.
    pub cancel: Arc<AtomicBool>,
    signal: Arc<AtomicUsize>,
}

impl Interrupt {
    /// Takes over the signals.
    pub(super) fn install() -> Result<Self, Failure> {
        let failed = |e| RunError::Internal(format!("cannot handle signals: {e}"));
        let interrupt = Self { cancel: Arc::default(), signal: Arc::default() };
        for (signal, exit) in [(SIGINT, Exit::Interrupted), (SIGTERM, Exit::Terminated)] {
            interrupt.watch(signal, exit).map_err(failed)?;
        }
        // A file beyond the limit of `ulimit -f` is an error of writing; unheeded, the signal would end the program.
        flag::register(SIGXFSZ, Arc::default()).map_err(failed)?;
        Ok(interrupt)
    }

    /// Order matters: the shutdown looks at the flag before the same signal sets it.
    fn watch(&self, signal: i32, exit: Exit) -> std::io::Result<()> {
        flag::register_conditional_shutdown(signal, i32::from(exit as u8), Arc::clone(&self.cancel))?;
        flag::register_usize(signal, Arc::clone(&self.signal), signal as usize)?;
        flag::register(signal, Arc::clone(&self.cancel)).map(drop)
    }

    /// The exit status of the signal that came.
    pub(super) fn exit(&self) -> Exit {
        if self.signal.load(Ordering::Relaxed) == SIGTERM as usize { Exit::Terminated } else { Exit::Interrupted }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_signal_asks_to_stop_and_names_itself() {
        let interrupt = Interrupt::install().expect("signals can be handled");
        assert!(!interrupt.cancel.load(Ordering::Relaxed));
        signal_hook::low_level::raise(SIGTERM).expect("a process may signal itself");
        assert!(interrupt.cancel.load(Ordering::Relaxed));
        assert_eq!(interrupt.exit(), Exit::Terminated);
    }
}
