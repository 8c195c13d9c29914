//! Files of an open document: saving, copies of unsaved changes, changes by other programs.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::thread::{Dated, Loaded, Session};
use super::{Surroundings, Timing};
use crate::error::StudioError;
use crate::files::DocumentFiles;
use crate::protocol::{DiskChoice, Level, ToPage};
use crate::recovery::Texts;
use crate::workspace::{Step, Workspace};
use plumbline_num::run::Run;

/// Copies of a document that changes all the time are at most so many times the usual pause apart.
const MAX_PAUSES: u32 = 5;

/// What happens by itself, and when.
pub(super) struct Timers {
    timing: Timing,
    /// When a copy of unsaved changes is due.
    pub(super) autosave: Option<Instant>,
    latest: Option<Instant>,
    poll: Instant,
    /// Files that another program changed, while the user has not chosen.
    pub(super) changed_on_disk: Vec<PathBuf>,
    /// A copy is in the recovery folder.
    kept: bool,
    /// A copy could not be written; said once.
    failed: bool,
}

impl Timers {
    pub(super) fn new(timing: Timing, kept: bool) -> Self {
        Self {
            timing,
            autosave: None,
            latest: None,
            poll: Instant::now() + timing.poll,
            changed_on_disk: Vec::new(),
            kept,
            failed: false,
        }
    }

    /// The document changed.
    pub(super) fn changed(&mut self) {
        let now = Instant::now();
        let latest = *self.latest.get_or_insert(now + MAX_PAUSES * self.timing.autosave);
        self.autosave = Some(latest.min(now + self.timing.autosave));
    }

    /// When something is due.
    pub(super) fn next(&self) -> Instant {
        self.autosave.map_or(self.poll, |autosave| autosave.min(self.poll))
    }

    pub(super) fn disk_message(&self) -> ToPage {
        ToPage::ChangedOnDisk(self.changed_on_disk.iter().map(|p| p.display().to_string()).collect())
    }
}

/// A document that was just opened.
pub(super) struct Opened<W: Workspace> {
    pub(super) loaded: Loaded<W>,
    pub(super) document: W::Document,
    pub(super) recovered: bool,
    /// What the user must know.
    pub(super) notice: Option<String>,
}

/// Opens a document, with unsaved changes of a session that ended early.
pub(super) fn open<W: Workspace>(path: &Path, around: &Surroundings, run: &Run) -> Result<Opened<W>, StudioError> {
    let kept = around.recovery.as_ref().map_or(Ok(None), |recovery| recovery.load(path));
    let (why, texts) = match kept {
        Ok(None) => return open_with(path, Texts::new(), around, run, None),
        Ok(Some(texts)) => match open_with(path, texts.clone(), around, run, Some(RESTORED.to_owned())) {
            Ok(opened) => return Ok(opened),
            Err(error @ StudioError::Stopped(_)) => return Err(error),
            Err(error) => (error.to_string(), Some(texts)),
        },
        Err(error) => (error.to_string(), None),
    };
    tracing::warn!(?path, why, texts = texts.map(|t| t.len()), "unsaved changes cannot be restored");
    let aside = around.recovery.as_ref().and_then(|recovery| recovery.put_aside(path).ok());
    let aside = aside.map_or(String::new(), |aside| format!("; they are in {}", aside.display()));
    let notice = format!("unsaved changes could not be restored: {why}{aside}");
    open_with(path, Texts::new(), around, run, Some(notice))
}

const RESTORED: &str = "changes that were not saved have been restored";

fn open_with<W: Workspace>(
    path: &Path,
    texts: Texts,
    around: &Surroundings,
    run: &Run,
    notice: Option<String>,
) -> Result<Opened<W>, StudioError> {
    let recovered = !texts.is_empty();
    let mut files = DocumentFiles::new(path, texts).with_allowed(around.allowed.clone());
    // A workspace that panics over its input has failed to open it.
    let opened = catch_unwind(AssertUnwindSafe(|| W::open(&mut files, run)));
    let (workspace, document) = opened.unwrap_or_else(|_| {
        let why = "internal error while opening it".to_owned();
        Err(StudioError::Input { path: path.to_owned(), why })
    })?;
    Ok(Opened { loaded: Loaded { workspace, files }, document, recovered, notice })
}

impl<W: Workspace> Session<W> {
    /// Writes the files of the document.
    pub(super) fn save(&mut self) -> Result<(), StudioError> {
        self.look_at_disk();
        if !self.timers.changed_on_disk.is_empty() {
            return Err(StudioError::request(
                "another program changed the files: choose to reload or to keep yours first",
            ));
        }
        self.call(|loaded, document| {
            loaded.workspace.save(document, &mut loaded.files)?;
            loaded.files.publish()
        })?;
        self.history.mark_saved();
        self.timers.autosave = None;
        self.timers.latest = None;
        self.forget_copy();
        Ok(())
    }

    /// Does what is due.
    pub(super) fn look_at_timers(&mut self) {
        let now = Instant::now();
        if self.timers.autosave.is_some_and(|at| at <= now) {
            self.keep_unsaved();
        }
        if self.timers.poll <= now {
            self.timers.poll = now + self.timers.timing.poll.max(Duration::from_millis(1));
            self.look_at_disk();
        }
    }

    /// Copies unsaved changes to the recovery folder, or removes the copy where there are none.
    pub(super) fn keep_unsaved(&mut self) {
        if self.timers.autosave.take().is_none() {
            return;
        }
        self.timers.latest = None;
        if self.history.is_saved() {
            self.forget_copy();
            return;
        }
        let Some(recovery) = self.surroundings.recovery.clone() else { return };
        let path = self.path.clone();
        let kept = self.call(|loaded, document| {
            let mut files = loaded.files.clone();
            loaded.workspace.save(document, &mut files)?;
            let fail = |e: std::io::Error| StudioError::Output { path: path.clone(), why: e.to_string() };
            recovery.store(&path, files.pending()).map_err(fail)
        });
        match kept {
            Ok(()) => (self.timers.kept, self.timers.failed) = (true, false),
            Err(StudioError::NotReady(_)) => self.timers.changed(),
            Err(error) if !self.timers.failed => {
                self.timers.failed = true;
                self.notify(Level::Error, format!("unsaved changes cannot be kept for a crash: {error}"));
            }
            Err(_) => {}
        }
    }

    fn forget_copy(&mut self) {
        let Some(recovery) = self.surroundings.recovery.as_ref().filter(|_| self.timers.kept) else { return };
        match recovery.remove(&self.path) {
            Ok(()) => self.timers.kept = false,
            Err(error) => tracing::warn!(%error, "a copy of changes that are saved stays"),
        }
    }

    /// Finds files that another program changed, and says so.
    fn look_at_disk(&mut self) {
        let reading = self.history.current().reading;
        let Some(loaded) = &self.readings[reading] else { return };
        let changed = loaded.files.changed_on_disk();
        if changed != self.timers.changed_on_disk {
            self.timers.changed_on_disk = changed;
            self.broadcast(&self.timers.disk_message());
        }
    }

    /// After the user has chosen what happens with files that another program changed.
    pub(super) fn settle_disk(&mut self, choice: DiskChoice) -> Result<(), StudioError> {
        if choice == DiskChoice::Reload {
            self.reload()?;
        } else if let Some(loaded) = &self.readings[self.history.current().reading] {
            loaded.files.accept_disk();
            self.history.forget_saved();
            self.timers.changed();
        }
        self.look_at_disk();
        Ok(())
    }

    /// Reads the files again: a step of the history, so that the document before it is not lost.
    fn reload(&mut self) -> Result<(), StudioError> {
        let run = self.mailbox.whole_run();
        let opened = open_with::<W>(&self.path, Texts::new(), &self.surroundings, &run, None)?;
        let before = self.history.current().reading;
        self.history.seal();
        let reading = self.readings.len();
        self.readings.push(Some(opened.loaded));
        let document = Dated { reading, document: opened.document };
        self.history.push(Step::new(document, "Read the files again"));
        self.history.mark_saved();
        // Of a mesh or a photo that was read there are two at most.
        self.history.forget_before(|dated| dated.reading >= before);
        self.readings[..before].iter_mut().for_each(|reading| *reading = None);
        self.changed();
        Ok(())
    }

    /// A workspace made anew for the present document, after a panic in the one before.
    pub(super) fn renew_workspace(&mut self) {
        let run = self.mailbox.whole_run();
        let reading = self.history.current().reading;
        let Some(before) = self.readings[reading].take() else { return };
        let mut files = before.files;
        let renewed = catch_unwind(AssertUnwindSafe(|| {
            let (mut workspace, _) = W::open(&mut files, &run)?;
            workspace.changed(&self.history.current().document);
            Ok::<W, StudioError>(workspace)
        }));
        // What is shown is as it was before the panic: the next change brings it up to date.
        self.busy = false;
        match renewed {
            Ok(Ok(workspace)) => self.readings[reading] = Some(Loaded { workspace, files }),
            Ok(Err(error)) => tracing::error!(%error, "a workspace cannot be made anew"),
            Err(_) => tracing::error!("a workspace cannot be made anew: it panics again"),
        }
    }
}
