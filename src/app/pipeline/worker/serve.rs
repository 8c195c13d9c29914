//! The worker's side: takes orders until there are no more.

use std::io::{BufRead, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError, mpsc};

use super::{Order, RECORDED, Reply};
use crate::pipeline::execute::do_work;
use crate::pipeline::job::{Job, Publishing, StageRunner};
use crate::pipeline::paths::Paths;
use crate::pipeline::progress::{Event, Progress, TaskProgress};
use crate::pipeline::run_error::RunError;
use crate::pipeline::summary::Summary;

/// Does the orders that `orders` holds, one per line, and writes replies to `replies`.
///
/// `stopped` is called where the orders end while one is at work: whoever gave it is gone, or wants it stopped.
///
/// # Errors
/// A thread that cannot be started; replies that nobody reads.
pub fn serve(
    orders: impl BufRead + Send + 'static,
    replies: impl Write + Send,
    backend: &dyn StageRunner,
    cancel: &Arc<AtomicBool>,
    stopped: impl Fn() + Send + 'static,
) -> Result<(), RunError> {
    let working = Arc::new(AtomicBool::new(false));
    let (sender, receiver) = mpsc::channel();
    let (recorded, records) = mpsc::channel();
    let at_work = Arc::clone(&working);
    let read = move || {
        for line in orders.lines().map_while(Result::ok) {
            if line == RECORDED {
                let _ = recorded.send(());
                continue;
            }
            at_work.store(true, Ordering::SeqCst);
            if sender.send(line).is_err() {
                return;
            }
        }
        if at_work.load(Ordering::SeqCst) {
            stopped();
        }
    };
    let no_thread = |e| RunError::Temporary(format!("no thread for a worker: {e}"));
    std::thread::Builder::new().name("orders".to_owned()).spawn(read).map_err(no_thread)?;
    let replies = Replies(Mutex::new(replies));
    let records = Mutex::new(records);
    let publishing = |file: &Path, target: &Path| {
        // One at a time, so that each waits for its own answer.
        let records = records.lock().unwrap_or_else(PoisonError::into_inner);
        let asked = replies.send(&Reply::Publishing(Paths(vec![file.to_owned(), target.to_owned()])));
        if asked.is_ok() && records.recv().is_ok() { Ok(()) } else { Err(RunError::Interrupted) }
    };
    for line in receiver {
        let reply = Reply::from(done(&line, backend, &replies, cancel, &publishing));
        // Before the reply: once it is read, the orders may end.
        working.store(false, Ordering::SeqCst);
        replies.send(&reply).map_err(|e| RunError::Temporary(format!("nobody reads what a worker says: {e}")))?;
    }
    Ok(())
}

fn done(
    line: &str,
    backend: &dyn StageRunner,
    progress: &dyn Progress,
    cancel: &Arc<AtomicBool>,
    publishing: &Publishing<'_>,
) -> Result<Summary, RunError> {
    let order: Order = serde_json::from_str(line).map_err(|e| RunError::Internal(format!("an order: {e}")))?;
    let instance = order.instance().map_err(RunError::Internal)?;
    let progress = TaskProgress::new(progress, &instance.key, instance.plan.passes.len());
    do_work(&Job::new(&instance, &order.options, &progress, cancel, Some(publishing)), backend)
}

/// Where replies go.
struct Replies<W>(Mutex<W>);

impl<W: Write> Replies<W> {
    fn send(&self, reply: &Reply) -> std::io::Result<()> {
        let mut out = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let line = serde_json::to_string(reply)?;
        writeln!(out, "{line}").and_then(|()| out.flush())
    }
}

impl<W: Write + Send> Progress for Replies<W> {
    fn event(&self, event: &Event<'_>) {
        if let Event::TaskProgress { tick, .. } = event {
            // Where nobody reads, the result says so.
            let _ = self.send(&Reply::Tick((*tick).clone()));
        }
    }
}
