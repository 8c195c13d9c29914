//! One plain line per change and every few seconds between: for logs.

use std::collections::HashMap;
use std::io::Write;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use super::{Event, Progress, Tick, clock};

/// Events as plain lines.
pub(super) struct Lines<W> {
    state: Mutex<State<W>>,
}

struct State<W> {
    out: W,
    told: HashMap<String, (usize, Instant)>,
}

impl<W: Write + Send> Lines<W> {
    /// A log reader wants to see that the work goes on, not every frame of it.
    const GAP: Duration = Duration::from_secs(5);

    pub(super) fn new(out: W) -> Self {
        Self { state: Mutex::new(State { out, told: HashMap::new() }) }
    }
}

impl<W: Write + Send> Progress for Lines<W> {
    fn event(&self, event: &Event<'_>) {
        let Ok(mut state) = self.state.lock() else { return };
        if let Event::TaskProgress { task, tick } = event {
            let now = Instant::now();
            let last = state.told.get(*task).copied();
            if last.is_some_and(|(pass, at)| pass == tick.pass && now - at < Self::GAP) {
                return;
            }
            state.told.insert((*task).to_owned(), (tick.pass, now));
        }
        if let Some(line) = line(event) {
            // A reader that went away is no reason to stop the work.
            let _ = writeln!(state.out, "{line}");
        }
    }
}

fn line(event: &Event<'_>) -> Option<String> {
    Some(match event {
        Event::TaskProgress { task, tick } => format!("{task}: {}", tick_text(tick)),
        Event::TaskRetry { task, attempt, error } => format!("{task}: {error}; try {attempt} follows"),
        Event::TaskFail { task, error, .. } => format!("{task}: failed: {error}"),
        Event::RunEnd { done, failed, seconds } if done + failed > 1 => {
            format!("{done} done, {failed} failed, {}", clock(*seconds))
        }
        _ => return None,
    })
}

/// `analyze (1 of 2) 120/300 frames, 61.2 fps, 0:12 to go`.
pub(super) fn tick_text(tick: &Tick) -> String {
    let total = tick.total.map(|t| format!("/{t}")).unwrap_or_default();
    let eta = tick.eta_s.map(|s| format!(", {} to go", clock(s))).unwrap_or_default();
    format!("{} ({} of {}) {}{total} frames, {:.1} fps{eta}", tick.label, tick.pass, tick.passes, tick.done, tick.fps)
}
