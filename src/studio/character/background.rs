//! A long computation on a thread of its own, so that letters do not begin it again.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use crate::error::StudioError;
use plumbline_num::run::{Interrupt, Progress, Run};

/// Longest wait for a result in a slice of work: how often the page hears of the progress.
const SLICE: Duration = Duration::from_millis(100);
/// Longest time in which a waiting slice does not see that it is interrupted.
const GLANCE: Duration = Duration::from_millis(4);

/// What is known of a computation.
#[derive(Debug)]
pub(super) enum Computed<T> {
    /// Its result.
    Ready(T),
    /// It runs.
    Running,
    /// It failed, which was said.
    Failed,
}

impl<T> Computed<T> {
    /// The same with another result.
    pub(super) fn map<U>(self, change: impl FnOnce(T) -> U) -> Computed<U> {
        match self {
            Self::Ready(found) => Computed::Ready(change(found)),
            Self::Running => Computed::Running,
            Self::Failed => Computed::Failed,
        }
    }
}

/// At most one computation, by what it depends on.
#[derive(Debug)]
pub(super) struct Background<K, T> {
    job: Option<Job<K, T>>,
    failed: Option<K>,
}

#[derive(Debug)]
struct Job<K, T> {
    key: K,
    interrupt: Interrupt,
    /// Bits of the fraction that is done.
    done: Arc<AtomicU64>,
    result: Receiver<Result<T, StudioError>>,
}

impl<K, T> Drop for Job<K, T> {
    fn drop(&mut self) {
        self.interrupt.stop();
    }
}

impl<K, T> Default for Background<K, T> {
    fn default() -> Self {
        Self { job: None, failed: None }
    }
}

impl<K: Clone + PartialEq, T: Send + 'static> Background<K, T> {
    /// The result for a key. Where nothing runs for it `compute` begins, and what runs for another key is stopped. Waits a little, less
    /// where `run` is interrupted.
    ///
    /// # Errors
    /// What `compute` says, once.
    pub(super) fn get(
        &mut self,
        key: &K,
        run: &Run,
        compute: impl FnOnce(&Run) -> Result<T, StudioError> + Send + 'static,
    ) -> Result<Computed<T>, StudioError> {
        if self.failed.as_ref() == Some(key) {
            return Ok(Computed::Failed);
        }
        let job = match self.job.take().filter(|job| job.key == *key) {
            Some(job) => job,
            None => Job::begin(key.clone(), compute)?,
        };
        match job.wait(run) {
            None => {
                self.job = Some(job);
                Ok(Computed::Running)
            }
            Some(Ok(found)) => Ok(Computed::Ready(found)),
            Some(Err(error)) => {
                self.failed = Some(key.clone());
                Err(error)
            }
        }
    }

    /// Stops what runs for another key than this, and forgets that another failed.
    pub(super) fn keep_only(&mut self, key: Option<&K>) {
        self.job = self.job.take().filter(|job| Some(&job.key) == key);
        self.failed = self.failed.take().filter(|failed| Some(failed) == key);
    }

    /// The fraction that is done of what runs.
    pub(super) fn progress(&self) -> Option<f64> {
        self.job.as_ref().map(|job| f64::from_bits(job.done.load(Ordering::Relaxed)))
    }
}

impl<K, T: Send + 'static> Job<K, T> {
    fn begin(
        key: K,
        compute: impl FnOnce(&Run) -> Result<T, StudioError> + Send + 'static,
    ) -> Result<Self, StudioError> {
        let (sender, result) = channel();
        let (interrupt, done) = (Interrupt::new(), Arc::new(AtomicU64::new(0)));
        let heard = Arc::clone(&done);
        let progress = Progress::new(move |fraction| heard.store(fraction.to_bits(), Ordering::Relaxed));
        let run = Run { progress, ..Run::with_interrupt(&interrupt) };
        // Who no longer waits for the result has dropped the receiver.
        let work = move || drop(sender.send(compute(&run)));
        let thread = std::thread::Builder::new().name("studio computation".to_owned()).spawn(work);
        thread.map_err(|e| StudioError::Environment(format!("no thread for a computation: {e}")))?;
        Ok(Self { key, interrupt, done, result })
    }

    fn wait(&self, run: &Run) -> Option<Result<T, StudioError>> {
        let until = Instant::now() + SLICE;
        loop {
            match self.result.recv_timeout(GLANCE) {
                Ok(found) => return Some(found),
                Err(RecvTimeoutError::Disconnected) => {
                    return Some(Err(StudioError::Method("internal error: the computation panicked".to_owned())));
                }
                Err(RecvTimeoutError::Timeout) if run.check().is_err() || Instant::now() >= until => return None,
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn a_moment() {
        let (_sender, never) = channel::<()>();
        let _ = never.recv_timeout(Duration::from_millis(1));
    }

    fn result(background: &mut Background<u32, u32>, key: u32, count: &Arc<AtomicU64>) -> u32 {
        loop {
            let count = Arc::clone(count);
            let slow = move |run: &Run| {
                count.fetch_add(1, Ordering::Relaxed);
                for k in 0..300 {
                    a_moment();
                    run.step(f64::from(k) / 300.0)?;
                }
                Ok(key)
            };
            // Every slice is interrupted at once, as by letters that come all the time.
            let interrupt = Interrupt::new();
            interrupt.stop();
            match background.get(&key, &Run::with_interrupt(&interrupt), slow).unwrap() {
                Computed::Ready(found) => return found,
                Computed::Running => assert!(background.progress().is_some()),
                Computed::Failed => panic!("it does not fail"),
            }
        }
    }

    #[test]
    fn a_computation_runs_once_however_often_its_slices_are_interrupted() {
        let (mut background, count) = (Background::default(), Arc::default());
        assert_eq!(result(&mut background, 7, &count), 7);
        assert_eq!(count.load(Ordering::Relaxed), 1);
        assert_eq!(background.progress(), None);
    }

    #[test]
    fn another_key_stops_what_runs_and_a_failure_is_said_once() {
        let mut background = Background::<u32, ()>::default();
        let stopped = Arc::new(AtomicU64::new(0));
        let seen = Arc::clone(&stopped);
        let forever = move |run: &Run| {
            while run.check().is_ok() {
                a_moment();
            }
            seen.store(1, Ordering::Relaxed);
            Ok(())
        };
        assert!(matches!(background.get(&1, &Run::default(), forever), Ok(Computed::Running)));
        let fails = |_: &Run| Err(StudioError::Method("no".to_owned()));
        assert!(background.get(&2, &Run::default(), fails).is_err());
        assert!(matches!(background.get(&2, &Run::default(), fails), Ok(Computed::Failed)));
        background.keep_only(Some(&3));
        assert!(background.get(&2, &Run::default(), fails).is_err(), "it is tried again after a change");
        let started = Instant::now();
        while stopped.load(Ordering::Relaxed) == 0 {
            assert!(started.elapsed().as_secs() < 10, "the other one stops");
        }
    }
}
