//! Progress: events from the executor and the stages, written to standard error in one of three forms.

mod json;
mod lines;
mod terminal;

use std::sync::Mutex;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::options::ProgressMode;
use super::summary::Summary;

/// State of the pass at work.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tick {
    /// Pass, from 1.
    pub pass: usize,
    /// Passes of the task.
    pub passes: usize,
    /// What the pass does, such as `analyze`.
    pub label: String,
    /// Frames done.
    pub done: u64,
    /// Frames of the clip, if known.
    pub total: Option<u64>,
    /// Frames per second of this pass.
    pub fps: f64,
    /// Seconds to the end of the task, all passes taken to be equally long; `None` while there is too little to estimate it from.
    pub eta_s: Option<f64>,
}

/// What happened.
#[derive(Clone, Debug)]
pub enum Event<'a> {
    /// The run begins.
    RunStart {
        /// All items.
        items: usize,
        /// Those whose results are there already.
        up_to_date: usize,
    },
    /// A task begins.
    TaskStart {
        /// Key of the instance.
        task: &'a str,
    },
    /// Frames were done.
    TaskProgress {
        /// Key of the instance.
        task: &'a str,
        /// How far it is.
        tick: &'a Tick,
    },
    /// A task failed for the moment and is tried again.
    TaskRetry {
        /// Key of the instance.
        task: &'a str,
        /// Number of the try that follows, from 2.
        attempt: u32,
        /// What went wrong.
        error: &'a str,
    },
    /// A task is done.
    TaskDone {
        /// Key of the instance.
        task: &'a str,
        /// What it did.
        summary: &'a Summary,
    },
    /// A task failed.
    TaskFail {
        /// Key of the instance.
        task: &'a str,
        /// What went wrong.
        error: &'a str,
        /// Exit status of that class of fault.
        code: u8,
    },
    /// The results of a task are there already: nothing is done.
    TaskSkip {
        /// Key of the instance.
        task: &'a str,
    },
    /// The run is over.
    RunEnd {
        /// Tasks done.
        done: usize,
        /// Tasks that failed.
        failed: usize,
        /// Wall time.
        seconds: f64,
    },
}

/// A receiver of events.
pub trait Progress: Sync {
    /// Receives one.
    fn event(&self, event: &Event<'_>);

    /// Errors of failed tasks are shown to people as they occur: whoever reports the run need not print them again.
    fn shows_errors(&self) -> bool {
        false
    }
}

/// What people read of a failed task; `many`: the run has other items, so that the message names this one.
pub fn error_line(task: &str, error: &str, many: bool) -> String {
    // Most errors begin with the name of the file at fault, which often is the key.
    let named = !many || error.starts_with(&format!("{task}: "));
    if named { format!("error: {error}") } else { format!("error: {task}: {error}") }
}

/// What people read of a run of which some results are there already.
pub fn up_to_date_line(up_to_date: usize, items: usize) -> Option<String> {
    (up_to_date > 0).then(|| format!("{up_to_date} up to date, {} to do", items.saturating_sub(up_to_date)))
}

/// Ignores all events.
pub struct Silent;

impl Progress for Silent {
    fn event(&self, _: &Event<'_>) {}
}

/// The receiver for `mode`; `terminal`: standard error is one.
pub fn for_mode(mode: ProgressMode, terminal: bool) -> Box<dyn Progress> {
    match (mode, terminal) {
        (ProgressMode::None, _) => Box::new(Silent),
        (ProgressMode::Json, _) => Box::new(json::JsonLines::new(std::io::stderr())),
        (ProgressMode::Auto, true) => Box::new(terminal::Bars::new()),
        (ProgressMode::Auto | ProgressMode::Plain, _) => Box::new(lines::Lines::new(std::io::stderr())),
    }
}

/// `m:ss` or `h:mm:ss`.
pub(super) fn clock(seconds: f64) -> String {
    let s = seconds.clamp(0.0, 359_999.0).round() as u64;
    let (hours, minutes, seconds) = (s / 3600, s / 60 % 60, s % 60);
    if hours > 0 { format!("{hours}:{minutes:02}:{seconds:02}") } else { format!("{minutes}:{seconds:02}") }
}

/// Progress of one task; passes report to it, at any rate and from any thread.
pub struct TaskProgress<'a> {
    sink: &'a dyn Progress,
    task: &'a str,
    state: Mutex<State>,
}

struct State {
    tick: Tick,
    pass_started: Instant,
    reported: Option<Instant>,
}

impl<'a> TaskProgress<'a> {
    /// Events closer together than this are not reported.
    const MIN_INTERVAL: Duration = Duration::from_millis(100);

    /// For a task of `passes` passes.
    pub fn new(sink: &'a dyn Progress, task: &'a str, passes: usize) -> Self {
        let tick = Tick { pass: 1, passes, label: String::new(), done: 0, total: None, fps: 0.0, eta_s: None };
        let state = State { tick, pass_started: Instant::now(), reported: None };
        Self { sink, task, state: Mutex::new(state) }
    }

    /// A pass begins: `label` is a verb (`analyze`, `warp`), `total` its number of frames if known.
    pub fn begin(&self, pass: usize, label: &str, total: Option<u64>) {
        let Ok(mut state) = self.state.lock() else { return };
        state.tick =
            Tick { pass: pass + 1, label: label.to_owned(), done: 0, total, fps: 0.0, eta_s: None, ..state.tick };
        state.pass_started = Instant::now();
        state.reported = None;
    }

    /// `done` frames of the pass are done.
    pub fn frames(&self, done: u64) {
        let now = Instant::now();
        let Ok(mut state) = self.state.lock() else { return };
        let complete = state.tick.total == Some(done);
        if !complete && state.reported.is_some_and(|t| now - t < Self::MIN_INTERVAL) {
            return;
        }
        state.reported = Some(now);
        let in_pass = (now - state.pass_started).as_secs_f64();
        state.tick.update(done, in_pass);
        self.sink.event(&Event::TaskProgress { task: self.task, tick: &state.tick });
    }
}

impl Tick {
    /// Sets rate and time to go from the seconds spent in the pass and in the task.
    ///
    /// The rest of the pass goes on at the pass's own pace; each pass after it takes as long as this one does as a whole.
    fn update(&mut self, done: u64, in_pass_s: f64) {
        self.done = done;
        self.fps = if in_pass_s > 0.0 { done as f64 / in_pass_s } else { 0.0 };
        let part = self.total.filter(|t| *t > 0).map(|t| (done as f64 / t as f64).min(1.0));
        let later = self.passes.saturating_sub(self.pass) as f64;
        // The first half second and the first hundredth say nothing about the rest.
        self.eta_s = part.filter(|p| *p > 0.01 && in_pass_s > 0.5).map(|p| in_pass_s / p * (1.0 - p + later));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_to_go_is_what_the_rest_takes_at_the_pace_of_the_pass() {
        let mut tick =
            Tick { pass: 2, passes: 2, label: "warp".into(), done: 0, total: Some(100), fps: 0.0, eta_s: None };
        tick.update(25, 10.0);
        assert_eq!((tick.fps, tick.eta_s), (2.5, Some(30.0)), "however quick the first pass was");
        tick.pass = 1;
        tick.update(25, 10.0);
        assert_eq!(tick.eta_s, Some(70.0), "30 s of this pass and 40 s of the next");
        tick.update(50, 0.1);
        assert_eq!(tick.eta_s, None, "too early to estimate");
        tick.total = None;
        tick.update(50, 10.0);
        assert_eq!(tick.eta_s, None, "a clip of unknown length has no end in sight");
    }

    #[test]
    fn a_clock_reads_like_one() {
        for (seconds, text) in
            [(0.0, "0:00"), (59.6, "1:00"), (3661.0, "1:01:01"), (f64::NAN, "0:00"), (1e12, "99:59:59")]
        {
            assert_eq!(clock(seconds), text);
        }
    }
}
