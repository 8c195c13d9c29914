//! Exports and questions.

use std::io::Cursor;
use std::path::Path;

use super::document::PhotoDocument;
use super::{PhotoWorkspace, method};
use crate::error::StudioError;
use crate::workspace::Answer;
use plumbline_app::pipeline::paths::to_path;
use plumbline_app::stages::photo_steps::written;
use plumbline_image::still::StillFormat;
use plumbline_num::run::Run;

/// Extensions of files that describe lenses.
const LENS_FILES: [&str; 5] = ["json", "yaml", "yml", "xml", "txt"];
/// Most files that are listed.
const MAX_LISTED: usize = 500;

impl PhotoWorkspace {
    /// The picture at full size, by the calls of the pipeline's stages.
    pub(super) fn export(&mut self, document: &PhotoDocument, run: &Run) -> Result<Answer, StudioError> {
        let said = document.pipeline.said();
        let path = to_path(&said.save.path);
        StillFormat::of_name(&path).map_err(|e| StudioError::request(e.to_string()))?;
        let warp = self.map_at_rest(document, run)?;
        let bytes = self.analysis.with_whole(&self.path, &said.photo, |photo| {
            let mut bytes = Cursor::new(Vec::new());
            written(photo, warp, (&said.render, &said.save), &mut bytes, run).map_err(method)?;
            Ok(bytes.into_inner())
        })?;
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Answer::Download { name, bytes })
    }

    /// The map at rest, once everything that it depends on is known.
    fn map_at_rest(&mut self, document: &PhotoDocument, run: &Run) -> Result<plumbline_photo::PhotoWarp, StudioError> {
        let said = document.pipeline.said();
        while self.analysis.search_photo(said.faces_found.as_ref(), run)? {}
        self.exact(document, run)?;
        let lens = self.lens.clone().filter(|_| self.shown.is_some());
        let nothing = || StudioError::request(self.problem.clone().unwrap_or_else(|| "there is no result".to_owned()));
        let lens = lens.ok_or_else(nothing)?;
        // What is shown stays: the export has a map of its own.
        let input = self.exact_input(document, &lens, run)?;
        let importance = self.analysis.importance.as_ref().filter(|_| said.importance);
        input.exact(importance.map(|importance| importance.plane()), run).map_err(method)
    }
}

/// The command that makes the picture, run in the folder of the pipeline.
pub(super) fn command(document: &PhotoDocument) -> String {
    let name = document.pipeline.path().file_name().unwrap_or_default().to_string_lossy().into_owned();
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./".contains(c);
    let quoted = if name.chars().all(plain) { name } else { format!("'{}'", name.replace('\'', r"'\''")) };
    format!("plumbline run {quoted}")
}

/// Names of files beside the pipeline that may describe lenses: marks and pipelines are none.
pub(super) fn lens_files(document: &PhotoDocument) -> Vec<String> {
    let folder = plumbline_num::files::folder_of(document.pipeline.path());
    let is_lens = |name: &str| {
        let extension = Path::new(name).extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        let marks = [".lines.json", ".faces.json", ".handles.json", ".truth.json"];
        LENS_FILES.contains(&extension.as_str()) && !marks.iter().any(|ending| name.ends_with(ending))
    };
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok()).filter(|name| is_lens(name));
    let mut names: Vec<String> = names.take(MAX_LISTED).collect();
    names.sort();
    names
}
