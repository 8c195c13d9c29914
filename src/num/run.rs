//! How a long call runs: when it must stop, and whom it reports its progress to.
//!
//! Each call that can take longer than 100 ms takes a [`&Run`](Run) and checks it at least ten times a second.
//! [`Run::default()`] never stops and reports to nobody.
//!
//! ```
//! use std::time::Duration;
//! use plumbline_num::run::{Budget, Interrupt, Run, Stopped};
//!
//! let interrupt = Interrupt::new();
//! let run = Run { interrupt: interrupt.clone(), ..Run::default() };
//! assert!(run.check().is_ok());
//! interrupt.stop(); // from a signal handler, a button, another thread
//! assert_eq!(run.check(), Err(Stopped::Interrupted));
//!
//! let run = Run { budget: Budget::time(Duration::ZERO), ..Run::default() };
//! assert_eq!(run.check(), Err(Stopped::OutOfTime));
//! ```

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// When a long call must stop, and whom it reports its progress to.
///
/// Clones share the same interrupt flag and the same listener.
#[derive(Clone, Debug, Default)]
pub struct Run {
    /// Stops the call from outside.
    pub interrupt: Interrupt,
    /// Hears how far the call is.
    pub progress: Progress,
    /// The time that the call may take.
    pub budget: Budget,
}

impl Run {
    /// A run that `interrupt` stops.
    #[must_use]
    pub fn with_interrupt(interrupt: &Interrupt) -> Self {
        Self { interrupt: interrupt.clone(), ..Self::default() }
    }

    /// The same run without its listener: for parts of a call that do not know which fraction of the whole they are.
    #[must_use]
    pub fn silent(&self) -> Self {
        Self { progress: Progress::default(), ..self.clone() }
    }

    /// The same run for a part of the call: its progress from 0 to 1 is reported as from `start` to `end`.
    #[must_use]
    pub fn part(&self, start: f64, end: f64) -> Self {
        Self { progress: self.progress.part(start, end), ..self.clone() }
    }

    /// Whether the call may go on. Costs an atomic load, and a clock reading where there is a time limit.
    ///
    /// # Errors
    /// [`Stopped`], with the reason.
    #[inline]
    pub fn check(&self) -> Result<(), Stopped> {
        if self.interrupt.is_stopped() {
            return Err(Stopped::Interrupted);
        }
        self.budget.check()
    }

    /// `found`, unless the run has ended: for results of parts that were cut short without a word. A run that has ended stays
    /// so, hence one check at the end is for all of them.
    ///
    /// # Errors
    /// As [`Run::check`].
    pub fn complete<T>(&self, found: T) -> Result<T, Stopped> {
        self.check().map(|()| found)
    }

    /// Reports that `fraction` of the call is done, in [0, 1], and checks whether it may go on.
    ///
    /// # Errors
    /// As [`Run::check`].
    pub fn step(&self, fraction: f64) -> Result<(), Stopped> {
        self.progress.report(fraction);
        self.check()
    }
}

/// Why a call stopped before it was done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Stopped {
    /// [`Interrupt::stop`] was called.
    #[error("interrupted")]
    Interrupted,
    /// The [`Budget`] is used up.
    #[error("the time limit was reached")]
    OutOfTime,
}

/// A flag that stops a run from any thread. The default one can never be raised.
#[derive(Clone, Default)]
pub struct Interrupt(Option<Arc<AtomicBool>>);

impl Interrupt {
    /// A flag that is not raised.
    pub fn new() -> Self {
        Self(Some(Arc::default()))
    }

    /// The flag that a signal handler raises.
    pub fn from_flag(flag: Arc<AtomicBool>) -> Self {
        Self(Some(flag))
    }

    /// Raises the flag.
    pub fn stop(&self) {
        if let Some(flag) = &self.0 {
            flag.store(true, Ordering::Relaxed);
        }
    }

    /// Whether the flag is raised.
    #[inline]
    pub fn is_stopped(&self) -> bool {
        self.0.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed))
    }
}

impl fmt::Debug for Interrupt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Interrupt").field(&self.is_stopped()).finish()
    }
}

/// A listener of progress. The default one ignores it.
#[derive(Clone, Default)]
pub struct Progress {
    listener: Option<Arc<dyn Fn(f64) + Send + Sync>>,
    start: f64,
    length: f64,
}

impl Progress {
    /// `listener` is called with the fraction done, in [0, 1], from whichever thread works; it must return quickly.
    pub fn new(listener: impl Fn(f64) + Send + Sync + 'static) -> Self {
        Self { listener: Some(Arc::new(listener)), start: 0.0, length: 1.0 }
    }

    /// Reports that `fraction` is done; values outside [0, 1] are clamped.
    pub fn report(&self, fraction: f64) {
        if let Some(listener) = &self.listener {
            listener(self.start + self.length * fraction.clamp(0.0, 1.0));
        }
    }

    fn part(&self, start: f64, end: f64) -> Self {
        let (start, end) = (start.clamp(0.0, 1.0), end.clamp(0.0, 1.0));
        Self {
            listener: self.listener.clone(),
            start: self.start + self.length * start,
            length: self.length * (end - start).max(0.0),
        }
    }
}

impl fmt::Debug for Progress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Progress").field("listens", &self.listener.is_some()).finish_non_exhaustive()
    }
}

/// The time that a call may take. The default one has no limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Budget {
    deadline: Option<Instant>,
}

impl Budget {
    /// `limit` from now on.
    pub fn time(limit: Duration) -> Self {
        Self { deadline: Instant::now().checked_add(limit) }
    }

    fn check(self) -> Result<(), Stopped> {
        match self.deadline {
            Some(deadline) if Instant::now() >= deadline => Err(Stopped::OutOfTime),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    #[test]
    fn the_default_run_never_stops() {
        let run = Run::default();
        run.interrupt.stop();
        assert_eq!(run.step(0.5), Ok(()));
    }

    #[test]
    fn clones_share_their_interrupt() {
        let run = Run::with_interrupt(&Interrupt::new());
        let clone = run.silent();
        run.interrupt.stop();
        assert_eq!(clone.check(), Err(Stopped::Interrupted));
    }

    #[test]
    fn progress_of_nested_parts_is_a_fraction_of_the_whole() {
        let heard = Arc::new(Mutex::new(Vec::new()));
        let listener = Arc::clone(&heard);
        let progress = Progress::new(move |f| listener.lock().expect("no thread panics here").push(f));
        let run = Run { progress, ..Run::default() };
        let half = run.part(0.5, 1.0);
        half.progress.report(0.0);
        half.part(0.5, 1.0).progress.report(1.0);
        half.part(0.0, 0.5).progress.report(1.0);
        run.progress.report(7.0);
        assert_eq!(*heard.lock().expect("no thread panics here"), [0.5, 1.0, 0.75, 1.0]);
    }

    #[test]
    fn a_budget_without_end_is_no_limit() {
        assert_eq!(Budget::time(Duration::MAX).check(), Ok(()));
    }
}
