//! One JSON object per line: `{"t": seconds, "ev": "task.progress", "task": …, "done": …, "total": …, "fps": …}`.

use std::io::Write;
use std::sync::Mutex;
use std::time::Instant;

use serde_json::{Value, json};

use super::{Event, Progress};

/// Events as JSON lines.
pub(super) struct JsonLines<W> {
    started: Instant,
    out: Mutex<W>,
}

impl<W: Write + Send> JsonLines<W> {
    pub(super) fn new(out: W) -> Self {
        Self { started: Instant::now(), out: Mutex::new(out) }
    }
}

impl<W: Write + Send> Progress for JsonLines<W> {
    fn event(&self, event: &Event<'_>) {
        let mut object = object(event);
        let t = (self.started.elapsed().as_secs_f64() * 1e3).round() / 1e3;
        object["t"] = t.into();
        if let Ok(mut out) = self.out.lock() {
            // A reader that went away is no reason to stop the work.
            let _ = writeln!(out, "{object}");
        }
    }
}

fn object(event: &Event<'_>) -> Value {
    match event {
        Event::RunStart { items } => json!({"ev": "run.start", "items": items}),
        Event::TaskStart { task } => json!({"ev": "task.start", "task": task}),
        Event::TaskProgress { task, tick } => json!({
            "ev": "task.progress", "task": task, "pass": tick.pass, "passes": tick.passes, "label": tick.label,
            "done": tick.done, "total": tick.total, "unit": "frame", "fps": tick.fps, "eta_s": tick.eta_s,
        }),
        Event::TaskRetry { task, attempt, error } => {
            json!({"ev": "task.retry", "task": task, "attempt": attempt, "error": error})
        }
        Event::TaskDone { task, summary } => json!({"ev": "task.done", "task": task, "summary": summary}),
        Event::TaskFail { task, error, code } => json!({"ev": "task.fail", "task": task, "error": error, "code": code}),
        Event::RunEnd { done, failed, seconds } => {
            json!({"ev": "run.end", "done": done, "failed": failed, "seconds": seconds})
        }
    }
}
