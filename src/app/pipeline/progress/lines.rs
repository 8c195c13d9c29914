//! One plain line per change and every few seconds between: for logs.

use std::collections::HashMap;
use std::io::Write;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use super::super::paths::shown;
use super::{Event, Progress, Tick, clock, error_line, up_to_date_line};

/// Events as plain lines.
pub(super) struct Lines<W> {
    state: Mutex<State<W>>,
}

struct State<W> {
    out: W,
    /// The run has several items.
    many: bool,
    /// Pass and time of the last line of each task.
    last: HashMap<String, (usize, Instant)>,
}

impl<W: Write + Send> Lines<W> {
    /// A log reader wants to see that the work goes on, not every frame of it.
    const GAP: Duration = Duration::from_secs(5);

    pub(super) fn new(out: W) -> Self {
        Self { state: Mutex::new(State { out, many: false, last: HashMap::new() }) }
    }
}

impl<W: Write + Send> Progress for Lines<W> {
    fn event(&self, event: &Event<'_>) {
        let Ok(mut state) = self.state.lock() else { return };
        if let Event::RunStart { items, .. } = event {
            state.many = *items > 1;
        }
        if let Event::TaskProgress { task, tick } = event {
            let now = Instant::now();
            let last = state.last.get(*task).copied();
            if last.is_some_and(|(pass, at)| pass == tick.pass && now - at < Self::GAP) {
                return;
            }
            state.last.insert((*task).to_owned(), (tick.pass, now));
        }
        if let Some(line) = line(event, state.many) {
            // A reader that went away is no reason to stop the work.
            let _ = writeln!(state.out, "{}", shown(&line));
        }
    }

    fn shows_errors(&self) -> bool {
        true
    }
}

fn line(event: &Event<'_>, many: bool) -> Option<String> {
    Some(match event {
        Event::TaskProgress { task, tick } => format!("{task}: {}", tick_text(tick)),
        Event::TaskRetry { task, attempt, error } => format!("{task}: {error}; try {attempt} follows"),
        Event::TaskFail { task, error, .. } => error_line(task, error, many),
        Event::RunStart { items, up_to_date } => return up_to_date_line(*up_to_date, *items),
        Event::RunEnd { done, failed, seconds } if done + failed > 1 => {
            format!("{done} of {} items done in {}", done + failed, clock(*seconds))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_gets_a_line_per_pass_and_not_one_per_frame() {
        let sink = Lines::new(Vec::new());
        let mut tick = Tick {
            pass: 1,
            passes: 2,
            label: "analyze".into(),
            done: 1,
            total: Some(300),
            fps: 61.25,
            eta_s: Some(12.3),
        };
        sink.event(&Event::RunStart { items: 3, up_to_date: 1 });
        for done in 1..100 {
            tick.done = done;
            sink.event(&Event::TaskProgress { task: "a", tick: &tick });
        }
        (tick.pass, tick.label, tick.total) = (2, "warp".into(), None);
        sink.event(&Event::TaskProgress { task: "a", tick: &tick });
        sink.event(&Event::TaskFail { task: "b", error: "no video", code: 65 });
        sink.event(&Event::RunEnd { done: 1, failed: 1, seconds: 75.0 });
        let text = String::from_utf8(sink.state.into_inner().expect("not poisoned").out).expect("UTF-8");
        let expected = "1 up to date, 2 to do\n\
                        a: analyze (1 of 2) 1/300 frames, 61.2 fps, 0:12 to go\n\
                        a: warp (2 of 2) 99 frames, 61.2 fps, 0:12 to go\n\
                        error: b: no video\n\
                        1 of 2 items done in 1:15\n";
        assert_eq!(text, expected);
    }
}
