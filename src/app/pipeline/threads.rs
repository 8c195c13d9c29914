//! Threads: started so that one that the system refuses is an error of the run, and as many as help.

use std::sync::OnceLock;
use std::thread::{Builder, Scope, ScopedJoinHandle};

use super::run_error::RunError;
use plumbline_num::limits::Shortage;

/// Starts a thread of `scope`, whose name says what it does.
pub(crate) fn start<'scope, T: Send + 'scope>(
    scope: &'scope Scope<'scope, '_>,
    name: &str,
    work: impl FnOnce() -> T + Send + 'scope,
) -> Result<ScopedJoinHandle<'scope, T>, RunError> {
    Builder::new().name(name.to_owned()).spawn_scoped(scope, work).map_err(|e| {
        let reason = Shortage::of_io(&e).map_or_else(|| e.to_string(), |shortage| shortage.to_string());
        RunError::Temporary(format!("cannot start the {name}'s thread: {reason}"))
    })
}

/// A pool of `threads` threads for the loops of one job. The first call also starts the pool for loops outside of any, which
/// would panic where it started by itself and could not.
pub(crate) fn pool(threads: usize) -> Result<rayon::ThreadPool, RunError> {
    static SHARED: OnceLock<Option<String>> = OnceLock::new();
    let refused = |reason: &str| RunError::Temporary(format!("cannot start {threads} threads: {reason}"));
    let built = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = built.map_err(|e| refused(&reason(&e)))?;
    let shared = SHARED.get_or_init(|| {
        // A global pool that could not be built cannot be built again: a second attempt is told that there is one.
        let all = std::thread::available_parallelism().map_or(threads, usize::from);
        let count = if Shortage::check(all, 0).is_ok() { all } else { threads };
        let built = rayon::ThreadPoolBuilder::new().num_threads(count).build_global();
        // One that is there already, of a program that uses this library, has no error of the system behind it.
        built.err().filter(|e| std::error::Error::source(e).is_some()).map(|e| reason(&e))
    });
    shared.as_ref().map_or(Ok(pool), |reason| Err(refused(reason)))
}

fn reason(error: &rayon::ThreadPoolBuildError) -> String {
    Shortage::of(error).map_or_else(|| error.to_string(), |shortage| shortage.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_is_started_under_its_name_and_a_pool_has_so_many() {
        let name = std::thread::scope(|scope| {
            let thread = start(scope, "decoder", || std::thread::current().name().map(str::to_owned));
            thread.expect("a thread").join().expect("no panic")
        });
        assert_eq!(name.as_deref(), Some("decoder"));
        assert_eq!(pool(3).expect("three threads").current_num_threads(), 3);
    }
}
