//! The thread of a document: letters one after another, slices of work between them.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde::de::DeserializeOwned;
use serde_json::Value;
use tokio::sync::watch;

use super::mailbox::{Letter, Mailbox, Request};
use super::window::{Window, WindowId};
use super::{Status, Surroundings, notice};
use crate::error::StudioError;
use crate::files::DocumentFiles;
use crate::history::History;
use crate::outbox::Outbox;
use crate::protocol::{Command, HistoryList, HistoryStep, Level, Reply, ToPage};
use crate::workspace::{Answer, Step, Work, Workspace};

/// Shortest time for a slice that edits do not stop: the picture of a drag takes 10 to 30 ms.
const MIN_PATIENCE: Duration = Duration::from_millis(50);
/// Longest: where pictures take longer, a drag shows some of them, and a long solve is stopped by the next edit.
const MAX_PATIENCE: Duration = Duration::from_millis(250);

/// Notices that wait for a window: the first ones, which say why the others came.
const MAX_UNSEEN: usize = 100;

/// What a document's thread begins with.
pub(super) struct Start {
    pub(super) mailbox: Arc<Mailbox>,
    pub(super) path: PathBuf,
    pub(super) surroundings: Surroundings,
}

impl Start {
    /// Opens the document and serves it until its mailbox is closed.
    pub(super) fn run<W: Workspace>(self, status: &watch::Sender<Status>) {
        let mailbox = Arc::clone(&self.mailbox);
        let served = catch_unwind(AssertUnwindSafe(|| match Session::<W>::open(self) {
            Ok(mut session) => {
                status.send_replace(Status::Open);
                session.serve();
                "the document is closed".to_owned()
            }
            Err(error) => error.to_string(),
        }));
        mailbox.close();
        let why = served.unwrap_or_else(|panic| panic_text(panic.as_ref()));
        status.send_replace(Status::Gone(why));
    }
}

/// A workspace and the files that it was opened from.
pub(super) struct Loaded<W> {
    pub(super) workspace: W,
    pub(super) files: DocumentFiles,
}

/// A document, and how often files had been read again before it.
pub(super) struct Dated<D> {
    pub(super) reading: usize,
    pub(super) document: D,
}

/// A document that is open.
pub(super) struct Session<W: Workspace> {
    pub(super) mailbox: Arc<Mailbox>,
    pub(super) path: PathBuf,
    pub(super) surroundings: Surroundings,
    /// One for each time that the files were read; those that no step needs are gone.
    pub(super) readings: Vec<Option<Loaded<W>>>,
    pub(super) history: History<Dated<W::Document>>,
    pub(super) windows: Vec<Arc<Window>>,
    /// What is shown is out of date.
    pub(super) busy: bool,
    working: bool,
    patience: Duration,
    /// The slice is the first one since an edit.
    first_slice: bool,
    /// Drags to be answered after the next slice.
    dragged: Vec<(WindowId, u32)>,
    /// Notices that no window was there to show: the next one is sent them.
    unseen: Vec<ToPage>,
    last_state: String,
    last_history: HistoryList,
    pub(super) timers: super::save::Timers,
}

impl<W: Workspace> Session<W> {
    fn open(start: Start) -> Result<Self, StudioError> {
        let Start { mailbox, path, surroundings } = start;
        let opened = super::save::open::<W>(&path, &surroundings, &mailbox.whole_run())?;
        let label = if opened.recovered { "Restored unsaved changes" } else { "Opened" };
        let dated = Dated { reading: 0, document: opened.document };
        let mut session = Self {
            mailbox,
            path,
            timers: super::save::Timers::new(surroundings.timing, opened.recovered),
            surroundings,
            readings: vec![Some(opened.loaded)],
            history: History::new(dated, label, !opened.recovered),
            windows: Vec::new(),
            busy: true,
            working: false,
            patience: MIN_PATIENCE,
            first_slice: true,
            dragged: Vec::new(),
            unseen: Vec::new(),
            last_state: String::new(),
            last_history: HistoryList { steps: Vec::new(), at: 0, saved_at: None },
        };
        opened.notice.into_iter().for_each(|text| session.notify(Level::Warning, text));
        session.changed();
        Ok(session)
    }

    fn serve(&mut self) {
        while !self.mailbox.is_closed() {
            // Those that wait now, and no more: letters that come all the time do not keep work from its turn.
            for _ in 0..self.mailbox.waiting() {
                if let Some(letter) = self.mailbox.take(Some(Instant::now())) {
                    self.handle(letter);
                }
            }
            self.look_at_timers();
            if self.busy {
                self.slice();
            } else if let Some(letter) = self.mailbox.take(Some(self.timers.next())) {
                self.handle(letter);
            }
        }
        self.end();
    }

    fn end(&mut self) {
        self.keep_unsaved();
        for letter in self.mailbox.left() {
            match letter {
                Letter::Attach(window) => self.windows.push(window),
                Letter::Detach(id) => self.windows.retain(|w| w.id != id),
                Letter::Command(request) => {
                    if let Some(window) = self.windows.iter().find(|w| w.id == request.window) {
                        window.reply(&Reply::failed(request.id, "the document is closed"));
                    }
                }
            }
        }
        for window in self.windows.drain(..) {
            window.send(&ToPage::Closed(true));
            window.close();
        }
    }

    fn handle(&mut self, letter: Letter) {
        match letter {
            Letter::Attach(window) => self.attach(window),
            Letter::Detach(id) => self.windows.retain(|w| w.id != id),
            Letter::Command(request) => self.request(request),
        }
    }

    fn attach(&mut self, window: Arc<Window>) {
        window.send(&ToPage::History(self.history_list()));
        let state = self.state().unwrap_or(Value::Null);
        window.send(&ToPage::State(state));
        window.send(&ToPage::Working(self.working));
        self.unseen.drain(..).for_each(|notice| window.send(&notice));
        if !self.timers.changed_on_disk.is_empty() {
            window.send(&self.timers.disk_message());
        }
        let mut out = Outbox::default();
        let greeted = self.call(|loaded, document| {
            loaded.workspace.greet(document, &mut out);
            Ok(())
        });
        if let Err(error) = greeted {
            window.send(&notice(Level::Error, error.to_string()));
        }
        window.buffers(&out.buffers);
        self.windows.push(window);
    }

    fn request(&mut self, request: Request) {
        let Request { window, id, command } = request;
        let asks = matches!(command, Command::Ask(_));
        let drags = matches!(command, Command::Edit { newest: true, .. });
        let done = self.command(command);
        let sender = self.windows.iter().find(|w| w.id == window).cloned();
        if let (Some(window), Some(id), false) = (&sender, id, asks) {
            window.applied(id);
        }
        // Before the reply, so that who waits for rest after it does not see the rest before it.
        self.show_working(self.busy);
        self.send_state();
        let (Some(window), Some(id)) = (sender, id) else {
            if let Err(error) = done {
                self.notify(Level::Error, error.to_string());
            }
            return;
        };
        if drags && done.is_ok() && self.busy {
            self.dragged.push((window.id, id));
            return;
        }
        window.reply(&self.reply(id, done));
    }

    fn reply(&self, id: u32, done: Result<Option<Answer>, StudioError>) -> Reply {
        match done {
            Ok(None) => Reply::done(id),
            Ok(Some(Answer::Value(value))) => Reply { result: Some(value), ..Reply::done(id) },
            Ok(Some(Answer::Download { name, bytes })) => {
                Reply { download: Some(self.surroundings.downloads.offer(name, bytes)), ..Reply::done(id) }
            }
            Err(error) => Reply::failed(Some(id), error.to_string()),
        }
    }

    fn command(&mut self, command: Command) -> Result<Option<Answer>, StudioError> {
        match command {
            Command::Edit { edit, .. } => self.edit(edit)?,
            Command::View(view) => self.view(view)?,
            Command::Ask(ask) => return self.ask(ask).map(Some),
            Command::Undo => self.go(History::undo, "nothing to undo")?,
            Command::Redo => self.go(History::redo, "nothing to redo")?,
            Command::GoTo(k) => self.go(|history| history.go_to(k), "there is no such step")?,
            Command::Seal => self.history.seal(),
            Command::Save => self.save()?,
            Command::Disk(choice) => self.settle_disk(choice)?,
        }
        Ok(None)
    }

    fn edit(&mut self, edit: Value) -> Result<(), StudioError> {
        let edit: W::Edit = typed(edit)?;
        let step = self.call(|loaded, document| loaded.workspace.edit(document, edit))?;
        if step.document == self.history.current().document {
            return Ok(());
        }
        let Step { document, label, merge } = step;
        let reading = self.history.current().reading;
        self.history.push(Step { document: Dated { reading, document }, label, merge });
        self.changed();
        Ok(())
    }

    fn view(&mut self, view: Value) -> Result<(), StudioError> {
        let view: W::View = typed(view)?;
        self.busy = true;
        self.call(|loaded, document| loaded.workspace.view(document, view))
    }

    fn ask(&mut self, ask: Value) -> Result<Answer, StudioError> {
        let ask: W::Ask = typed(ask)?;
        let run = self.mailbox.whole_run();
        self.call(|loaded, document| loaded.workspace.ask(document, ask, &loaded.files, &run))
    }

    fn go(
        &mut self,
        step: impl FnOnce(&mut History<Dated<W::Document>>) -> bool,
        none: &str,
    ) -> Result<(), StudioError> {
        if !step(&mut self.history) {
            return Err(StudioError::request(none));
        }
        self.changed();
        Ok(())
    }

    /// The document is another one now.
    pub(super) fn changed(&mut self) {
        self.busy = true;
        self.first_slice = true;
        self.timers.changed();
        let told = self.call(|loaded, document| {
            loaded.workspace.changed(document);
            Ok(())
        });
        if let Err(error) = told {
            self.notify(Level::Error, error.to_string());
        }
    }

    fn slice(&mut self) {
        let Some(run) = self.mailbox.start_slice(self.patience, self.timers.autosave) else { return };
        self.show_working(true);
        let (mut out, started) = (Outbox::default(), Instant::now());
        let worked = self.call(|loaded, document| loaded.workspace.work(document, &mut out, &run));
        let stopped = self.mailbox.end_slice();
        self.pace(started.elapsed(), stopped);
        for text in out.notices {
            self.notify(Level::Warning, text);
        }
        self.windows.retain(|window| !window.is_closed());
        self.windows.iter().for_each(|window| window.buffers(&out.buffers));
        self.busy = match worked {
            Ok(work) => work == Work::More,
            Err(StudioError::Stopped(_)) => stopped,
            Err(error) => {
                self.notify(Level::Error, error.to_string());
                false
            }
        };
        self.send_state();
        self.answer_drags();
        if !self.busy {
            self.show_working(false);
        }
    }

    /// How long edits wait for the next slices: half as long again as pictures take.
    fn pace(&mut self, took: Duration, stopped: bool) {
        if stopped {
            self.patience = (self.patience * 2).min(MAX_PATIENCE);
        } else if std::mem::take(&mut self.first_slice) {
            self.patience = took.mul_f64(1.5).clamp(MIN_PATIENCE, MAX_PATIENCE);
        }
    }

    fn answer_drags(&mut self) {
        for (window, id) in self.dragged.drain(..) {
            if let Some(window) = self.windows.iter().find(|w| w.id == window) {
                window.reply(&Reply::done(id));
            }
        }
    }

    fn show_working(&mut self, working: bool) {
        if working != self.working {
            self.working = working;
            self.broadcast(&ToPage::Working(working));
        }
    }

    /// Tells the user something: all windows, or the next one where none is there. A document works before its page is connected.
    pub(super) fn notify(&mut self, level: Level, text: impl Into<String>) {
        let notice = notice(level, text);
        if self.windows.iter().all(|window| window.is_closed()) {
            self.unseen.truncate(MAX_UNSEEN - 1);
            self.unseen.push(notice);
        } else {
            self.broadcast(&notice);
        }
    }

    pub(super) fn broadcast(&self, message: &ToPage) {
        self.windows.iter().for_each(|window| window.send(message));
    }

    /// Sends history and state where they differ from what was sent last. The history first: who sees a state can undo it.
    pub(super) fn send_state(&mut self) {
        let history = self.history_list();
        if history != self.last_history {
            self.last_history = self.history_list();
            self.broadcast(&ToPage::History(history));
        }
        let state = self.state().unwrap_or(Value::Null);
        let text = state.to_string();
        if text != self.last_state {
            self.last_state = text;
            self.broadcast(&ToPage::State(state));
        }
    }

    fn state(&mut self) -> Result<Value, StudioError> {
        let state = self.call(|loaded, document| Ok(loaded.workspace.state(document)))?;
        serde_json::to_value(state).map_err(|e| StudioError::Method(format!("the state cannot be written: {e}")))
    }

    fn history_list(&self) -> HistoryList {
        let steps = self.history.labels().map(|label| HistoryStep { label: label.to_owned() }).collect();
        HistoryList { steps, at: self.history.at(), saved_at: self.history.saved_at() }
    }

    /// Calls the workspace of the present document. After a panic in it the workspace is made anew from the files and the document.
    pub(super) fn call<T>(
        &mut self,
        call: impl FnOnce(&mut Loaded<W>, &W::Document) -> Result<T, StudioError>,
    ) -> Result<T, StudioError> {
        let Dated { reading, document } = self.history.current();
        let loaded = self.readings[*reading].as_mut().ok_or_else(lost)?;
        match catch_unwind(AssertUnwindSafe(|| call(loaded, document))) {
            Ok(result) => result,
            Err(panic) => {
                self.renew_workspace();
                Err(StudioError::Method(panic_text(panic.as_ref())))
            }
        }
    }
}

fn lost() -> StudioError {
    StudioError::Method("the document cannot be edited after an internal error; open it again".to_owned())
}

/// A message of a window as the workspace's own type.
fn typed<T: DeserializeOwned>(value: Value) -> Result<T, StudioError> {
    serde_json::from_value(value).map_err(|e| StudioError::Request(format!("malformed message: {e}")))
}

/// What a panic said. The place is in the log.
fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    let said = panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
    format!("internal error: {}; the document is as it was", said.unwrap_or("no reason is known"))
}
