//! A document on a thread of its own, and the windows that look at it.
//!
//! The thread takes letters one after another and works in slices between them (`thread`); what it sends waits in a queue per
//! window (`window`). A [`Document`] is the handle: it does not depend on the workspace.

mod mailbox;
mod save;
mod thread;
mod window;

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tokio::sync::watch;

pub use mailbox::{Letter, Mailbox, Posted, Request};
pub use window::{Outgoing, Window, WindowId};

use crate::downloads::Downloads;
use crate::protocol::{Hello, Level, Notice, PROTO, Reply, ToPage, read};
use crate::recovery::Recovery;
use crate::workspace::Workspace;

/// What a document needs beside its file.
#[derive(Clone, Debug, Default)]
pub struct Surroundings {
    /// Where unsaved changes are kept; none are where this is missing.
    pub recovery: Option<Recovery>,
    /// Files offered to windows.
    pub downloads: Arc<Downloads>,
    /// Folders whose files the document may name, beside its own.
    pub allowed: Arc<[PathBuf]>,
    /// When things happen by themselves.
    pub timing: Timing,
}

/// When things happen by themselves.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    /// From a change to its copy in the recovery folder.
    pub autosave: Duration,
    /// Between two looks at the files of the document.
    pub poll: Duration,
}

impl Default for Timing {
    fn default() -> Self {
        Self { autosave: Duration::from_secs(1), poll: Duration::from_secs(2) }
    }
}

/// How far the opening of a document is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Status {
    /// It is being read.
    Opening,
    /// It can be edited.
    Open,
    /// It could not be opened, or was closed.
    Gone(String),
}

/// The handle of a document.
#[derive(Debug)]
pub struct Document {
    /// What its windows are told first.
    pub hello: Hello,
    /// The file that was opened, an absolute path.
    pub path: PathBuf,
    mailbox: Arc<Mailbox>,
    status: watch::Receiver<Status>,
    threads: Mutex<Vec<JoinHandle<()>>>,
}

impl Document {
    /// Begins to open the file on a thread of its own.
    ///
    /// # Errors
    /// A thread that cannot be started.
    pub fn open<W: Workspace>(id: &str, path: &Path, surroundings: Surroundings) -> std::io::Result<Arc<Self>> {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let hello = Hello { proto: PROTO, workspace: W::NAME.to_owned(), document: id.to_owned(), name };
        let mailbox = Arc::new(Mailbox::default());
        let (report, status) = watch::channel(Status::Opening);
        let pacer = {
            let mailbox = Arc::clone(&mailbox);
            std::thread::Builder::new().name("studio pacer".to_owned()).spawn(move || mailbox.pace())?
        };
        let start = thread::Start { mailbox: Arc::clone(&mailbox), path: path.to_owned(), surroundings };
        let started = std::thread::Builder::new()
            .name(format!("studio {}", W::NAME))
            .stack_size(STACK_BYTES)
            .spawn(move || start.run::<W>(&report));
        let worker = started.inspect_err(|_| mailbox.close())?;
        let threads = Mutex::new(vec![pacer, worker]);
        Ok(Arc::new(Self { hello, path: path.to_owned(), mailbox, status, threads }))
    }

    /// How far the opening is.
    pub fn status(&self) -> Status {
        self.status.borrow().clone()
    }

    /// Waits until the document is open.
    ///
    /// # Errors
    /// Why it is not.
    pub async fn opened(&self) -> Result<(), String> {
        let mut status = self.status.clone();
        let gone = || "the document is closed".to_owned();
        let found = status.wait_for(|s| *s != Status::Opening).await.map_err(|_| gone())?.clone();
        match found {
            Status::Gone(why) => Err(why),
            Status::Opening | Status::Open => Ok(()),
        }
    }

    /// Connects a window: it is sent everything that is known.
    pub fn attach(&self) -> Arc<Window> {
        let window = Window::new();
        window.send(&ToPage::Hello(self.hello.clone()));
        if self.mailbox.post(Letter::Attach(Arc::clone(&window))) == Posted::Refused {
            window.send(&ToPage::Closed(true));
            window.close();
        }
        window
    }

    /// Forgets a window.
    pub fn detach(&self, window: &Window) {
        window.close();
        self.mailbox.post(Letter::Detach(window.id));
    }

    /// Passes a message of a window on; one that cannot be read is answered here.
    pub fn message(&self, window: &Window, text: &str) {
        let (id, command) = match read(text) {
            Ok(read) => read,
            Err(malformed) => {
                window.reply(&Reply::failed(malformed.id, malformed.why));
                return;
            }
        };
        match self.mailbox.post(Letter::Command(Request { window: window.id, id, command })) {
            Posted::Waits | Posted::Replaced(None) => {}
            Posted::Replaced(Some(earlier)) => window.reply(&Reply::replaced(earlier)),
            Posted::Refused => {
                let why = "too many messages wait, or the document is closed";
                window.reply(&Reply::failed(id, why));
            }
        }
    }

    /// Asks the document to end: unsaved changes stay in the recovery folder.
    pub fn close(&self) {
        self.mailbox.close();
    }

    /// Waits until its threads have ended, until `deadline` at most. True where they have.
    pub fn join(&self, deadline: Instant) -> bool {
        let mut threads = self.threads.lock().unwrap_or_else(PoisonError::into_inner);
        while threads.iter().any(|t| !t.is_finished()) && Instant::now() < deadline {
            std::thread::park_timeout(Duration::from_millis(5));
        }
        let (finished, left): (Vec<_>, Vec<_>) = threads.drain(..).partition(JoinHandle::is_finished);
        // A panic was reported where it happened.
        for thread in finished {
            drop(thread.join());
        }
        *threads = left;
        threads.is_empty()
    }
}

/// Stack of a document's thread: recursion of solvers and readers, as on the main thread.
const STACK_BYTES: usize = 8 << 20;

fn notice(level: Level, text: impl Into<String>) -> ToPage {
    ToPage::Notice(Notice { level, text: text.into() })
}

#[cfg(all(test, target_os = "linux"))]
mod full_disk_tests;
#[cfg(test)]
mod test_document;
#[cfg(test)]
mod tests;
