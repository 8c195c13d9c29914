//! Bars on a terminal: one per task at work, and one for the whole batch.

use std::collections::HashMap;
use std::io::Write;
use std::sync::Mutex;

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};

use super::super::paths::shown;
use super::{Event, Progress, Tick, clock, error_line, up_to_date_line};

/// Events as bars on standard error.
pub(super) struct Bars {
    all: MultiProgress,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    tasks: HashMap<String, ProgressBar>,
    batch: Option<ProgressBar>,
    /// The run has several items.
    many: bool,
}

impl Bars {
    pub(super) fn new() -> Self {
        Self { all: MultiProgress::new(), state: Mutex::new(State::default()) }
    }

    fn finish(&self, state: &mut State, task: &str, line: Option<String>) {
        if let Some(bar) = state.tasks.remove(task) {
            bar.finish_and_clear();
        }
        if let Some(batch) = &state.batch {
            batch.inc(1);
        }
        if let Some(line) = line {
            self.write(&line);
        }
    }

    /// Writes a line above the bars, also where the terminal cannot show bars.
    fn write(&self, line: &str) {
        // The terminal went away: nobody reads the line, and the work goes on.
        self.all.suspend(|| _ = writeln!(std::io::stderr(), "{}", shown(line)));
    }
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("█▉▊▋▌▍▎▏ ")
}

fn show(bar: &ProgressBar, tick: &Tick) {
    bar.set_length(tick.total.unwrap_or(tick.done));
    bar.set_position(tick.done);
    let eta = tick.eta_s.map(|s| format!(", {} to go", clock(s))).unwrap_or_default();
    bar.set_message(format!("{} ({} of {}), {:.1} fps{eta}", tick.label, tick.pass, tick.passes, tick.fps));
}

impl Progress for Bars {
    fn event(&self, event: &Event<'_>) {
        let Ok(mut state) = self.state.lock() else { return };
        match event {
            Event::RunStart { items, up_to_date } if *items > 1 => {
                state.many = true;
                if let Some(line) = up_to_date_line(*up_to_date, *items) {
                    self.write(&line);
                }
                let left = items.saturating_sub(*up_to_date) as u64;
                let bar = ProgressBar::new(left).with_style(style("{bar:30} {pos}/{len} clips  {elapsed}"));
                state.batch = Some(self.all.add(bar));
            }
            Event::RunStart { items, up_to_date } => {
                if let Some(line) = up_to_date_line(*up_to_date, *items) {
                    self.write(&line);
                }
            }
            Event::TaskSkip { .. } => {}
            Event::TaskStart { task } => {
                let bar = ProgressBar::no_length().with_style(style("{bar:30} {pos}/{len} {wide_msg}  {prefix}"));
                bar.set_prefix(shown(task).into_owned());
                state.tasks.insert((*task).to_owned(), self.all.insert(0, bar));
            }
            Event::TaskProgress { task, tick } => {
                if let Some(bar) = state.tasks.get(*task) {
                    show(bar, tick);
                }
            }
            Event::TaskRetry { task, attempt, error } => {
                self.write(&format!("{task}: {error}; try {attempt} follows"));
            }
            Event::TaskDone { task, .. } => self.finish(&mut state, task, None),
            Event::TaskFail { task, error, .. } => {
                let line = error_line(task, error, state.many);
                self.finish(&mut state, task, Some(line));
            }
            Event::RunEnd { .. } => {
                if let Some(bar) = state.batch.take() {
                    bar.finish_and_clear();
                }
            }
        }
    }

    fn shows_errors(&self) -> bool {
        true
    }
}
