//! The document: a pipeline file, marked lines and faces, the selection.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::pipeline_text::PipelineText;
use crate::error::StudioError;
use crate::files::DocumentFiles;
use plumbline_photo::marks::{FacesFile, LinesFile, MarkedFace, MarkedLine};

/// Maximum size of a pipeline file, bytes.
const MAX_PIPELINE_BYTES: u64 = 4 << 20;
/// Maximum size of a file of marks, bytes.
const MAX_MARKS_BYTES: u64 = 16 << 20;

/// What the files of a rectified photo say.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotoDocument {
    /// The pipeline.
    pub pipeline: PipelineText,
    /// Marked lines, switched off or not.
    pub lines: Arc<Vec<MarkedLine>>,
    /// The file of marked lines has been there, or has lines now.
    pub lines_file: bool,
    /// Faces that were corrected by hand; `None`: as they are found.
    pub faces: Option<Arc<Vec<MarkedFace>>>,
    /// What is selected while an edit is made; nothing in the history.
    pub selection: Selection,
}

/// What is selected: lines or faces, by index.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Selection {
    /// Lines.
    pub lines: Vec<usize>,
    /// A point of the last of the lines.
    pub point: Option<usize>,
    /// Faces.
    pub faces: Vec<usize>,
}

impl Selection {
    /// Without what the document does not have.
    pub(super) fn clamp(&mut self, document: &PhotoDocument) {
        self.lines.retain(|k| *k < document.lines.len());
        let faces = document.faces.as_ref().map_or(usize::MAX, |faces| faces.len());
        self.faces.retain(|k| *k < faces);
        let points = self.lines.last().map_or(0, |k| document.lines[*k].line.points.len());
        self.point = self.point.filter(|k| *k < points);
    }
}

impl PhotoDocument {
    /// Lines that are in use.
    pub fn has_lines_in_use(&self) -> bool {
        self.lines.iter().any(|line| !line.off)
    }
}

/// The pipeline that was opened, or the one of an opened photo.
pub(super) fn opened_pipeline(files: &DocumentFiles) -> Result<PipelineText, StudioError> {
    let opened = files.opened().to_owned();
    let is_pipeline = opened.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
    let path = if is_pipeline { opened.clone() } else { beside(&opened, ".rectify.toml") };
    match files.read(&path, MAX_PIPELINE_BYTES)? {
        Some(bytes) => {
            let why =
                |e: std::str::Utf8Error| StudioError::Input { path: path.clone(), why: format!("is no text: {e}") };
            let found = PipelineText::read(&path, std::str::from_utf8(&bytes).map_err(why)?)?;
            let photo = Path::new(&found.said().photo.path);
            if is_pipeline || same_file(photo, &opened) {
                return Ok(found);
            }
            Err(StudioError::Input { why: format!("rectifies {}, not this photo", photo.display()), path })
        }
        None if is_pipeline => Err(StudioError::Input { path, why: "there is no such file".to_owned() }),
        None => {
            let faces = beside(&opened, ".faces.json");
            let faces = files.read(&faces, MAX_MARKS_BYTES)?.map(|_| faces);
            PipelineText::begin(&path, &opened, &beside(&opened, ".lines.json"), faces.as_deref())
        }
    }
}

/// The document of a pipeline and a photo of `size` px; notes of what was put right go to `notes`.
pub(super) fn read(
    files: &DocumentFiles,
    pipeline: PipelineText,
    size: (u32, u32),
    notes: &mut Vec<String>,
) -> Result<PhotoDocument, StudioError> {
    let text = |path: &Path| -> Result<Option<String>, StudioError> {
        let bytes = files.read(path, MAX_MARKS_BYTES)?;
        let why = |e: std::string::FromUtf8Error| StudioError::Input { path: path.to_owned(), why: e.to_string() };
        bytes.map(|bytes| String::from_utf8(bytes.to_vec()).map_err(why)).transpose()
    };
    let fail =
        |path: &Path, e: plumbline_photo::PhotoError| StudioError::Input { path: path.to_owned(), why: e.to_string() };
    let (mut lines, mut lines_file) = (Vec::new(), false);
    if let Some(path) = pipeline.lines_path()
        && let Some(text) = text(path)?
    {
        let file = LinesFile::parse(&text, size).map_err(|e| fail(path, e))?;
        notes.extend(file.notes);
        (lines, lines_file) = (file.lines, true);
    }
    let mut faces = None;
    if let Some(path) = pipeline.said().faces.as_deref() {
        let missing = || StudioError::Input { path: path.to_owned(), why: "there is no such file".to_owned() };
        let text = text(path)?.ok_or_else(missing)?;
        faces = Some(Arc::new(FacesFile::parse(&text, size).map_err(|e| fail(path, e))?.faces));
    }
    let selection = Selection::default();
    Ok(PhotoDocument { pipeline, lines: Arc::new(lines), lines_file, faces, selection })
}

/// Writes what the document says.
pub(super) fn save(document: &PhotoDocument, size: (u32, u32), files: &mut DocumentFiles) {
    let PhotoDocument { pipeline, lines, lines_file, faces, .. } = document;
    if let Some(path) = pipeline.lines_path().filter(|_| *lines_file) {
        let file = LinesFile { size, lines: lines.to_vec(), notes: Vec::new() };
        files.write(path, file.to_json().into_bytes());
    }
    if let (Some(faces), Some(path)) = (faces, pipeline.said().faces.as_deref()) {
        let file = FacesFile { size, faces: faces.to_vec() };
        files.write(path, file.to_json().into_bytes());
    }
    files.write(pipeline.path(), pipeline.text().as_bytes());
}

/// `NAME` + `ending` beside `NAME.jpg`, as the stages and commands look for it.
pub(super) fn beside(photo: &Path, ending: &str) -> PathBuf {
    let stem = photo.file_stem().unwrap_or_default().to_string_lossy();
    photo.with_file_name(format!("{stem}{ending}"))
}

fn same_file(a: &Path, b: &Path) -> bool {
    a == b || a.canonicalize().ok().zip(b.canonicalize().ok()).is_some_and(|(a, b)| a == b)
}
