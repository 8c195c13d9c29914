//! What a workspace (mesh, character, photo) is to the session that runs it.

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::StudioError;
use crate::files::DocumentFiles;
use crate::outbox::Outbox;
use plumbline_num::run::Run;

/// A kind of document, and what is computed from it.
///
/// All calls come from the document's own thread, one after another. A call other than [`open`](Self::open), [`work`](Self::work) and
/// [`ask`](Self::ask) returns within a few milliseconds.
pub trait Workspace: Sized + 'static {
    /// What the files say, and the selection. Large parts are shared (`Arc`), so that a clone is cheap; equal documents write equal
    /// files.
    type Document: Clone + PartialEq;
    /// A change of the document, as a window sends it. Becomes a step of the history.
    type Edit: DeserializeOwned + Send;
    /// What the windows look at: overlays, the time that is shown. In no file and no history.
    type View: DeserializeOwned + Send;
    /// A question or an action that changes nothing: an export, the equivalent command line.
    type Ask: DeserializeOwned + Send;
    /// What the page shows in its panels. Small: long lists go as buffers.
    type State: Serialize;

    /// The name in messages to the page: `mesh`, `character`, `photo`.
    const NAME: &'static str;

    /// Reads the document that was opened ([`DocumentFiles::opened`]): a pipeline file of this kind, or a mesh or photo for which
    /// one is begun. Side files are read through `files`, which also has what was recovered after a crash.
    ///
    /// # Errors
    /// A file that cannot be read, with its path.
    fn open(files: &mut DocumentFiles, run: &Run) -> Result<(Self, Self::Document), StudioError>;

    /// The document after an edit.
    ///
    /// # Errors
    /// [`StudioError::Request`] where the edit does not fit the document, which then stays.
    fn edit(&mut self, document: &Self::Document, edit: Self::Edit) -> Result<Step<Self::Document>, StudioError>;

    /// Another view.
    ///
    /// # Errors
    /// [`StudioError::Request`].
    fn view(&mut self, document: &Self::Document, view: Self::View) -> Result<(), StudioError>;

    /// The document is another one now, by an edit, undo, redo or reload: what was computed from parts that differ is out of date.
    fn changed(&mut self, document: &Self::Document);

    /// What the page shows of the document and of the running solve.
    fn state(&self, document: &Self::Document) -> Self::State;

    /// Puts every buffer that is known into the outbox: for a window that was just opened.
    fn greet(&mut self, document: &Self::Document, out: &mut Outbox);

    /// One slice of the work that brings what is shown up to date, about 10 to 30 ms where the method allows it. Called again until
    /// it is at [`Work::Rest`]. An exact solve may be one long slice: the arrival of a letter raises the run's interrupt, and
    /// [`StudioError::Stopped`] is no fault.
    ///
    /// # Errors
    /// What the method says; shown to the user once, and work rests until the document changes.
    fn work(&mut self, document: &Self::Document, out: &mut Outbox, run: &Run) -> Result<Work, StudioError>;

    /// Writes the pipeline file and its side files into `files`, comments of existing files kept. Used for saving and for the copy
    /// that is recovered after a crash.
    ///
    /// # Errors
    /// Where a document cannot be written as files.
    fn save(&self, document: &Self::Document, files: &mut DocumentFiles) -> Result<(), StudioError>;

    /// Answers a question, or exports something.
    ///
    /// # Errors
    /// Why not.
    fn ask(
        &mut self,
        document: &Self::Document,
        ask: Self::Ask,
        files: &DocumentFiles,
        run: &Run,
    ) -> Result<Answer, StudioError>;
}

/// A document after an edit.
#[derive(Debug)]
pub struct Step<D> {
    /// The document.
    pub document: D,
    /// What was done, in the history list: "Move handle 2".
    pub label: String,
    /// Steps in a row with the same key are one step of the history, until the window seals it (the pointer is released).
    pub merge: Option<String>,
}

impl<D> Step<D> {
    /// A step of its own.
    pub fn new(document: D, label: impl Into<String>) -> Self {
        Self { document, label: label.into(), merge: None }
    }

    /// One step with those before that have the same key.
    #[must_use]
    pub fn merged(self, key: impl Into<String>) -> Self {
        Self { merge: Some(key.into()), ..self }
    }
}

/// Whether there is more to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// Everything shown is up to date.
    Rest,
    /// Another slice is due.
    More,
}

/// The answer to a question.
#[derive(Debug)]
pub enum Answer {
    /// Data for the page.
    Value(serde_json::Value),
    /// A file for the user: offered as a single-use download.
    Download {
        /// Its name.
        name: String,
        /// Its content.
        bytes: Vec<u8>,
    },
}
