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
        Event::RunStart { items, up_to_date } => {
            json!({"ev": "run.start", "items": items, "up_to_date": up_to_date})
        }
        Event::TaskSkip { task } => json!({"ev": "task.skip", "task": task, "reason": "up to date"}),
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

#[cfg(test)]
mod tests {
    use super::super::Tick;
    use super::*;
    use crate::pipeline::Summary;

    #[test]
    fn every_event_is_one_line_with_its_time_and_name() {
        let sink = JsonLines::new(Vec::new());
        let tick =
            Tick { pass: 1, passes: 2, label: "analyze".into(), done: 120, total: Some(480), fps: 31.5, eta_s: None };
        let summary = Summary { frames: 480, ..Summary::default() };
        let events = [
            Event::RunStart { items: 2, up_to_date: 1 },
            Event::TaskStart { task: "tour" },
            Event::TaskProgress { task: "tour", tick: &tick },
            Event::TaskRetry { task: "tour", attempt: 2, error: "device\nbusy" },
            Event::TaskDone { task: "tour", summary: &summary },
            Event::TaskFail { task: "x", error: "no video", code: 65 },
            Event::TaskSkip { task: "y" },
            Event::RunEnd { done: 1, failed: 1, seconds: 2.0 },
        ];
        for event in &events {
            sink.event(event);
        }
        let text = String::from_utf8(sink.out.into_inner().expect("not poisoned")).expect("UTF-8");
        let lines: Vec<Value> = text.lines().map(|l| serde_json::from_str(l).expect("JSON")).collect();
        let names: Vec<&str> = lines.iter().filter_map(|l| l["ev"].as_str()).collect();
        let expected = [
            "run.start",
            "task.start",
            "task.progress",
            "task.retry",
            "task.done",
            "task.fail",
            "task.skip",
            "run.end",
        ];
        assert_eq!(names, expected);
        assert!(lines.iter().all(|l| l["t"].as_f64().is_some_and(|t| t >= 0.0)));
        let progress = (&lines[2]["done"], &lines[2]["total"], &lines[2]["fps"], &lines[2]["unit"], &lines[2]["eta_s"]);
        assert_eq!(progress, (&120.into(), &480.into(), &31.5.into(), &"frame".into(), &Value::Null));
        assert_eq!((&lines[0]["items"], &lines[0]["up_to_date"]), (&2.into(), &1.into()));
        assert_eq!((&lines[4]["summary"]["frames"], &lines[5]["code"]), (&480.into(), &65.into()));
    }
}
