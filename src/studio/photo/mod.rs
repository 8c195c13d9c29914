//! The photo workspace: lines, faces and a lens for a photo, and the rectified picture beside it.
//!
//! The document is the pipeline file with its files of marks (`document`); everything else is computed from it and the photo. After
//! an edit the map is solved quickly and drawn from a small copy (`solver::Draft`); at rest it is solved and sampled as the pipeline
//! does. What is found in the photo (importance, faces, lines) is searched between the letters (`analysis`).

mod analysis;
mod ask;
mod document;
mod edit;
mod pictures;
mod pipeline_text;
mod protocol;
mod shown;
mod solver;
mod state;
#[cfg(test)]
mod tests;

use std::path::PathBuf;

pub use document::PhotoDocument;
pub use protocol::{Ask, BufferKind, Edit, State, View};

use crate::error::StudioError;
use crate::files::DocumentFiles;
use crate::outbox::Outbox;
use crate::workspace::{Answer, Step, Work, Workspace};
use analysis::Analysis;
use document::Selection;
use edit::Known;
use plumbline_app::pipeline::RunError;
use plumbline_app::stages::photo_steps::FoundLens;
use plumbline_camera::Projection;
use plumbline_num::run::{Run, Stopped};
use shown::Shown;
use solver::Draft;

/// The photo workspace.
#[derive(Debug)]
pub struct PhotoWorkspace {
    files: DocumentFiles,
    /// The photo, without links.
    path: PathBuf,
    name: String,
    analysis: Analysis,
    view: Looks,
    due: Due,
    draft: Draft,
    lens: Option<FoundLens>,
    problem: Option<String>,
    shown: Option<Shown>,
    /// In no history: undo undoes what was done, not what was clicked.
    selection: Selection,
    /// Notes of opening, for the first slice.
    notes: Vec<String>,
}

/// What windows look at.
#[derive(Clone, Debug)]
struct Looks {
    /// Of the result, px of the screen.
    size: (usize, usize),
    part: [f64; 4],
    source_part: Option<[f64; 4]>,
    grid: bool,
}

/// What is out of date.
#[derive(Clone, Copy, Debug, Default)]
#[expect(clippy::struct_excessive_bools, reason = "a set of independent parts, each named")]
struct Due {
    /// Marks and their courses.
    marks: bool,
    /// The quick map.
    draft: bool,
    /// The map at rest.
    exact: bool,
    /// The picture, from the map at rest.
    picture: bool,
    /// The part of the source that is seen.
    source: bool,
    /// What the next drag starts from.
    next_drag: bool,
}

impl Due {
    const ALL: Self = Self { marks: true, draft: true, exact: true, picture: true, source: true, next_drag: false };
}

impl Workspace for PhotoWorkspace {
    type Document = PhotoDocument;
    type Edit = Edit;
    type View = View;
    type Ask = Ask;
    type State = State;
    const NAME: &'static str = "photo";

    fn open(files: &mut DocumentFiles, run: &Run) -> Result<(Self, PhotoDocument), StudioError> {
        let pipeline = document::opened_pipeline(files)?;
        let photo = pipeline.said().photo.clone();
        lens_is_open(files, &pipeline.said().map.lens)?;
        let path = files.confined(std::path::Path::new(&photo.path))?;
        let mut analysis = Analysis::open(&path, &photo, run)?;
        let mut notes = std::mem::take(&mut analysis.warnings);
        let size = (analysis.size.0 as u32, analysis.size.1 as u32);
        let document = document::read(files, pipeline, size, &mut notes)?;
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let workspace = Self {
            files: files.clone(),
            path,
            name,
            analysis,
            view: Looks { size: (640, 480), part: [0.0, 0.0, 1.0, 1.0], source_part: None, grid: false },
            due: Due::ALL,
            draft: Draft::default(),
            lens: None,
            problem: None,
            shown: None,
            selection: Selection::default(),
            notes,
        };
        Ok((workspace, document))
    }

    fn edit(&mut self, document: &PhotoDocument, edit: Edit) -> Result<Step<PhotoDocument>, StudioError> {
        let edit = match edit {
            Edit::SnapLine { line } => return self.snap(document, line),
            Edit::SetLens { ref lens, .. } => {
                lens_is_open(&self.files, lens)?;
                edit
            }
            edit => edit,
        };
        let found = self.analysis.found.as_ref().map_or(&[][..], |found| &found.lines);
        let known = Known {
            size: self.analysis.sides(),
            found,
            found_in_use: document.pipeline.said().found.is_some() && self.lens.is_some(),
            faces: self.analysis.faces.as_deref(),
        };
        let selected = PhotoDocument { selection: self.selection.clone(), ..document.clone() };
        let mut step = edit::apply(&selected, edit, known)?;
        self.selection = std::mem::take(&mut step.document.selection);
        Ok(step)
    }

    fn view(&mut self, _: &PhotoDocument, view: View) -> Result<(), StudioError> {
        self.look(&view)
    }

    fn changed(&mut self, document: &PhotoDocument) {
        self.selection.clamp(document);
        self.due = Due { source: self.due.source, ..Due::ALL };
    }

    fn state(&self, document: &PhotoDocument) -> State {
        state::of(self, document)
    }

    fn greet(&mut self, document: &PhotoDocument, out: &mut Outbox) {
        if let Ok(bytes) = self.source() {
            out.buffer(BufferKind::Source as u32, 0, &bytes);
        }
        self.send_marks(document, out);
        // Pictures come with the next slice: the page says how large it is first.
        self.due = Due { draft: self.due.draft, exact: self.due.exact, next_drag: self.due.next_drag, ..Due::ALL };
    }

    fn work(&mut self, document: &PhotoDocument, out: &mut Outbox, run: &Run) -> Result<Work, StudioError> {
        self.notes.drain(..).for_each(|note| out.notice(note));
        let done = self.slice(document, out, run);
        match done {
            Err(StudioError::Method(why)) => {
                // Told once, in the panel: the page shows it where the result would be.
                self.problem = Some(why);
                self.due = Due { marks: self.due.marks, source: self.due.source, ..Due::default() };
                Ok(Work::More)
            }
            done => done,
        }
    }

    fn save(&self, document: &PhotoDocument, files: &mut DocumentFiles) -> Result<(), StudioError> {
        document::save(document, (self.analysis.size.0 as u32, self.analysis.size.1 as u32), files);
        Ok(())
    }

    fn ask(&mut self, document: &PhotoDocument, ask: Ask, _: &DocumentFiles, run: &Run) -> Result<Answer, StudioError> {
        match ask {
            Ask::Export => self.export(document, run),
            Ask::Command => Ok(Answer::Value(ask::command(document).into())),
            Ask::LensFiles => Ok(Answer::Value(ask::lens_files(document).into())),
        }
    }
}

/// Refuses a lens file outside the folders of the document.
fn lens_is_open(files: &DocumentFiles, lens: &str) -> Result<(), StudioError> {
    if lens == "auto" || Projection::named(lens).is_some() {
        return Ok(());
    }
    files.confined(&plumbline_app::pipeline::paths::to_path(lens)).map(drop)
}

/// An error of a step of the pipeline as one of the studio.
fn method(error: RunError) -> StudioError {
    match error {
        RunError::Interrupted => StudioError::Stopped(Stopped::Interrupted),
        error => StudioError::Method(error.to_string()),
    }
}
