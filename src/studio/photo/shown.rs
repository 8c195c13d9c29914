//! What is shown, brought up to date slice by slice: first what follows the pointer, then what is exact.

use std::sync::Arc;

use super::analysis::{Found, smaller};
use super::document::PhotoDocument;
use super::edit::{self, checked_line};
use super::pictures::{self, Part, SOURCE_SIDE};
use super::protocol::{BufferKind, Edit, View};
use super::solver::MapInput;
use super::{Due, PhotoWorkspace, method};
use crate::error::StudioError;
use crate::outbox::Outbox;
use crate::workspace::{Step, Work};
use plumbline_app::stages::photo_steps::{FoundLens, LensRequest, find_lens};
use plumbline_image::Plane;
use plumbline_image::feature::Importance;
use plumbline_num::math::{Point2, Rect};
use plumbline_num::run::Run;
use plumbline_photo::line_detection::snapped;
use plumbline_photo::{Line, PhotoWarp};

/// Longest side of the picture while something is dragged, px.
const DRAFT_PICTURE: usize = 800;
/// Points of a line between its ends at least, as it is drawn.
const COURSE_PIECES: usize = 32;
/// Most pixels of the screen along a side that a window may ask for.
const MAX_SCREEN: u32 = 4096;
/// How far marks are moved to an edge, as a fraction of the picture's longer side: a finger's width on a screen.
const SNAP_REACH: f64 = 1.0 / 150.0;

/// The map that is shown.
#[derive(Debug)]
pub(super) struct Shown {
    pub(super) warp: PhotoWarp,
    /// As the pipeline makes it.
    pub(super) exact: bool,
}

impl PhotoWorkspace {
    /// What a window looks at.
    pub(super) fn look(&mut self, view: &View) -> Result<(), StudioError> {
        let part = |[a, b, c, d]: [f64; 4]| {
            let inside = |v: f64| (0.0..=1.0).contains(&v);
            let sound = [a, b, c, d].into_iter().all(inside) && c - a > 1e-4 && d - b > 1e-4;
            let why = "a part is left, top, right and bottom from 0 to 1";
            sound.then_some([a, b, c, d]).ok_or_else(|| StudioError::request(why))
        };
        if let Some(size) = view.size {
            let [w, h] = size.map(|side| side.clamp(16, MAX_SCREEN) as usize);
            self.view.size = (w, h);
        }
        if let Some(shown) = view.part {
            self.view.part = part(shown)?;
        }
        if let Some(shown) = view.source_part {
            self.view.source_part = Some(part(shown)?);
            self.due.source = true;
        }
        self.view.grid = view.grid.unwrap_or(self.view.grid);
        self.due.picture = true;
        Ok(())
    }

    /// The next slice of work.
    pub(super) fn slice(&mut self, document: &PhotoDocument, out: &mut Outbox, run: &Run) -> Result<Work, StudioError> {
        if self.due.marks {
            self.due.marks = false;
            self.send_marks(document, out);
        }
        if self.due.draft {
            self.due.draft = false;
            self.draft(document, out, run)?;
            return Ok(Work::More);
        }
        if self.due.source {
            self.send_source_part(out, run)?;
            self.due.source = false;
        }
        let said = document.pipeline.said();
        let skips_faces = document.faces.is_some() && self.analysis.importance.is_some();
        if !skips_faces && self.analysis.search_photo(said.faces_found.as_ref(), run)? {
            self.due.marks = true;
            return Ok(Work::More);
        }
        if self.due.exact {
            self.exact(document, run)?;
            self.due = Due { exact: false, picture: true, next_drag: true, ..self.due };
        }
        if self.due.picture {
            self.send_result(document, out, run)?;
            self.due.picture = false;
            return Ok(Work::More);
        }
        if self.due.next_drag {
            self.prepare_drag(document, run)?;
            self.due.next_drag = false;
            return Ok(Work::More);
        }
        if self.search_lines(document, self.lens.clone().as_ref(), run)? {
            self.send_found(document, out);
        }
        Ok(Work::Rest)
    }

    /// The quick map and its picture, where something like it was shown before or a lens is known at once.
    fn draft(&mut self, document: &PhotoDocument, out: &mut Outbox, run: &Run) -> Result<(), StudioError> {
        let Some(lens) = self.draft_lens(document, run) else { return Ok(()) };
        let (input, importance) = self.draft_input(document, &lens);
        self.lens = Some(lens);
        let warp = self.draft.solve(&input, importance.as_ref().map(|i| i.plane()), run).map_err(method)?;
        self.problem = None;
        self.shown = Some(Shown { warp, exact: false });
        self.send_picture(document, out, run)
    }

    /// What the next drag starts from. What it cannot be made of is no fault yet.
    fn prepare_drag(&mut self, document: &PhotoDocument, run: &Run) -> Result<(), StudioError> {
        let Some(lens) = self.lens.clone() else { return Ok(()) };
        let (input, importance) = self.draft_input(document, &lens);
        match self.draft.prepare(&input, importance.as_ref().map(|i| i.plane()), run).map_err(method) {
            Err(error @ StudioError::Stopped(_)) => Err(error),
            _ => Ok(()),
        }
    }

    /// What the quick map is made of, and the importance of each position.
    fn draft_input(&self, document: &PhotoDocument, lens: &FoundLens) -> (MapInput, Option<Arc<Importance>>) {
        // Before lines are found the first picture is shown without them.
        let lines = self.lines_in_use(document).unwrap_or_default();
        let importance = self.analysis.importance.clone().filter(|_| document.pipeline.said().importance);
        (self.map_input(document, lens, lines), importance)
    }

    /// The lens while something is dragged: the one that is known, unless the settings name another. Lines determine it at rest.
    fn draft_lens(&self, document: &PhotoDocument, run: &Run) -> Option<FoundLens> {
        let map = &document.pipeline.said().map;
        let request = LensRequest::of_rectify(map);
        if map.lens != "auto" || map.fov.is_some() {
            return find_lens(&self.analysis.clues, &[], request, run).ok();
        }
        let marked = || in_use(document).cloned().collect::<Vec<_>>();
        self.lens.clone().or_else(|| find_lens(&self.analysis.clues, &marked(), request, run).ok())
    }

    /// The map at rest, by the calls of the pipeline's stages.
    pub(super) fn exact(&mut self, document: &PhotoDocument, run: &Run) -> Result<(), StudioError> {
        let lens = self.lens_at_rest(document, run)?;
        let Some(lens) = lens else {
            (self.lens, self.shown) = (None, None);
            return Ok(());
        };
        self.search_lines(document, Some(&lens), run)?;
        let input = self.exact_input(document, &lens, run)?;
        self.lens = Some(lens);
        let importance = self.analysis.importance.clone();
        let saliency = importance.as_ref().filter(|_| document.pipeline.said().importance).map(|i| i.plane());
        let solved = input.exact(saliency, run).map_err(method);
        let warp = solved.inspect_err(|error| {
            if !matches!(error, StudioError::Stopped(_)) {
                self.shown = None;
            }
        })?;
        self.problem = None;
        self.shown = Some(Shown { warp, exact: true });
        Ok(())
    }

    /// The lens as the pipeline finds it; where it finds none, the problem says why.
    fn lens_at_rest(&mut self, document: &PhotoDocument, run: &Run) -> Result<Option<FoundLens>, StudioError> {
        let said = document.pipeline.said();
        let marked: Vec<Line> = in_use(document).cloned().collect();
        let of_found = said.found.as_ref().filter(|_| marked.is_empty()).and_then(LensRequest::of_lines);
        let request = of_found.unwrap_or_else(|| LensRequest::of_rectify(&said.map));
        match find_lens(&self.analysis.clues, &marked, request, run).map_err(method) {
            Ok(lens) => Ok(Some(lens)),
            Err(error @ StudioError::Stopped(_)) => Err(error),
            Err(error) => {
                self.problem = Some(error.to_string());
                Ok(None)
            }
        }
    }

    /// Lines that the result is made with; `None` where they are not found yet.
    pub(super) fn lines_in_use(&self, document: &PhotoDocument) -> Option<Vec<Line>> {
        let Some(found) = document.pipeline.said().found.as_ref().filter(|_| !document.has_lines_in_use()) else {
            return Some(in_use(document).cloned().collect());
        };
        let lines = &self.analysis.found.as_ref()?.lines;
        Some(lines.iter().filter(|line| !found.without.contains(&line.name)).cloned().collect())
    }

    pub(super) fn map_input(&self, document: &PhotoDocument, lens: &FoundLens, lines: Vec<Line>) -> MapInput {
        let settings = document.pipeline.said().map.clone();
        let (lens, faces) = (lens.lens.clone(), self.faces_in_use(document));
        MapInput { lens, lines, found: !document.has_lines_in_use(), soft: Vec::new(), faces, settings }
    }

    /// The same, with the lines over their whole visible length, and those that nobody marked.
    pub(super) fn exact_input(
        &self,
        document: &PhotoDocument,
        lens: &FoundLens,
        run: &Run,
    ) -> Result<MapInput, StudioError> {
        let input = self.map_input(document, lens, self.lines_in_use(document).unwrap_or_default());
        let Some(search) = &self.analysis.search else { return Ok(input) };
        let (lens, faces) = (&input.lens, &input.faces);
        let made = if input.found {
            search.of_found(input.lines, lens, faces)
        } else {
            search.of_marked(&input.lines, lens, faces, run)?
        };
        Ok(MapInput { lines: made.lines, soft: made.soft, ..input })
    }

    /// Boxes of the faces that are kept in shape.
    pub(super) fn faces_in_use(&self, document: &PhotoDocument) -> Vec<Rect> {
        let said = document.pipeline.said();
        match (&document.faces, &self.analysis.faces) {
            (Some(marked), _) => marked.iter().filter(|face| !face.off).map(|face| face.rect).collect(),
            (None, Some(found)) if said.faces_found.is_some() => found.iter().map(|face| face.rect).collect(),
            _ => Vec::new(),
        }
    }

    /// Searches lines where those that are known were found under another lens. True where it did.
    fn search_lines(
        &mut self,
        document: &PhotoDocument,
        lens: Option<&FoundLens>,
        run: &Run,
    ) -> Result<bool, StudioError> {
        let key = Self::search_key(document, lens);
        // Lines that the pipeline would find itself do as suggestions, too.
        let known = self.analysis.found.as_ref().is_some_and(|found| {
            found.key == key || document.has_lines_in_use() && lens.is_some() && found.key.starts_with("own ")
        });
        let Some(search) = self.analysis.search.as_ref().filter(|_| !known) else { return Ok(false) };
        let lines = search.lines(lens.map(|found| &found.lens), run)?;
        self.analysis.found = Some(Found { key, lines: lines.into() });
        Ok(true)
    }

    fn search_key(document: &PhotoDocument, lens: Option<&FoundLens>) -> String {
        let said = document.pipeline.said();
        let settings = format!("{} {:?} {:?}", said.map.lens, said.map.fov, said.map.fov_axis);
        match lens {
            None => "flat".to_owned(),
            Some(_) if document.has_lines_in_use() => format!("marked {settings}"),
            Some(_) => format!("own {settings}"),
        }
    }

    /// Marks and faces follow the document at once.
    pub(super) fn send_marks(&self, document: &PhotoDocument, out: &mut Outbox) {
        let points: Vec<Vec<Point2>> = document.lines.iter().map(|m| m.line.points.clone()).collect();
        pictures::marks(&points, out);
        let courses: Vec<_> = document.lines.iter().map(|m| self.course(&m.line)).collect();
        pictures::curves(BufferKind::Courses, &courses, out);
        self.send_found(document, out);
    }

    fn send_found(&self, document: &PhotoDocument, out: &mut Outbox) {
        let found = self.analysis.found.as_ref().map_or(&[][..], |found| &found.lines);
        let courses: Vec<_> = found.iter().map(|line| self.course(line)).collect();
        pictures::curves(BufferKind::FoundCourses, &courses, out);
        self.send_carried(document, out);
    }

    fn send_carried(&self, document: &PhotoDocument, out: &mut Outbox) {
        let Some(Shown { warp, .. }) = &self.shown else { return };
        let carried = |line: &Line| self.course(line).iter().filter_map(|p| (warp.forward)(*p)).collect::<Vec<_>>();
        let lines: Vec<_> = document.lines.iter().map(|m| carried(&m.line)).collect();
        pictures::curves(BufferKind::Carried, &lines, out);
        let found = self.lines_in_use(document).filter(|_| !document.has_lines_in_use()).unwrap_or_default();
        let found: Vec<_> = found.iter().map(carried).collect();
        pictures::curves(BufferKind::FoundCarried, &found, out);
    }

    fn course(&self, line: &Line) -> Vec<Point2> {
        let pieces = COURSE_PIECES.div_ceil(line.points.len().saturating_sub(1).max(1));
        line.course(self.lens.as_ref().map(|found| &found.lens), pieces)
    }

    /// The result, quick or exact, in the size of the window.
    fn send_result(&mut self, document: &PhotoDocument, out: &mut Outbox, run: &Run) -> Result<(), StudioError> {
        self.send_marks(document, out);
        self.send_picture(document, out, run)
    }

    fn send_picture(&mut self, document: &PhotoDocument, out: &mut Outbox, run: &Run) -> Result<(), StudioError> {
        let Some(Shown { warp, exact }) = &mut self.shown else { return Ok(()) };
        let screen = if *exact { self.view.size } else { smaller_screen(self.view.size) };
        let part = Part::of(warp.size, self.view.part, screen);
        let copy = if *exact { &self.analysis.detail } else { self.analysis.draft(part.scale(warp)) };
        let render = &document.pipeline.said().render;
        let frame =
            pictures::part_of_result(warp, part, (&copy.frame, self.analysis.size), render, run).map_err(method)?;
        pictures::picture(BufferKind::Result, part, &frame, out)?;
        if self.view.grid {
            pictures::grid(warp, out);
        }
        self.send_carried(document, out);
        Ok(())
    }

    /// The source in detail, where a part of it is seen.
    fn send_source_part(&self, out: &mut Outbox, run: &Run) -> Result<(), StudioError> {
        let Some(part) = self.view.source_part else { return Ok(()) };
        let part = Part::of(self.analysis.size, part, self.view.size);
        let frame = pictures::part_of_source(part, (&self.analysis.detail.frame, self.analysis.size), run);
        pictures::picture(BufferKind::SourcePart, part, &frame.map_err(method)?, out)
    }

    /// The source for the page.
    pub(super) fn source(&self) -> Result<Vec<u8>, StudioError> {
        let run = Run::default();
        pictures::source_jpeg(smaller(&self.analysis.detail, SOURCE_SIDE, &run)?)
    }

    /// The gray levels of the photo, and how many of its pixels each of theirs is.
    fn levels(&self) -> Option<(&Plane<f32>, (f64, f64))> {
        self.analysis.search.as_ref().map(|search| (search.levels(), search.scale()))
    }

    /// A line on the strongest edge near it.
    pub(super) fn snap(&self, document: &PhotoDocument, line: usize) -> Result<Step<PhotoDocument>, StudioError> {
        let missing = || StudioError::request(format!("there is no line {line}"));
        let marked = document.lines.get(line).ok_or_else(missing)?;
        let (levels, scale) = self.levels().ok_or_else(|| StudioError::request("the photo has no gray levels"))?;
        let small = |p: &Point2| Point2::new(p.x / scale.0, p.y / scale.1);
        let points: Vec<Point2> = marked.line.points.iter().map(small).collect();
        let reach = SNAP_REACH * levels.width().max(levels.height()) as f64;
        let moved: Vec<[f64; 2]> =
            snapped(levels.as_ref(), &points, reach).iter().map(|p| [p.x * scale.0, p.y * scale.1]).collect();
        let points = checked_line(&moved, self.analysis.sides())?;
        if points == marked.line.points {
            return Err(StudioError::request("there is no stronger edge near the line"));
        }
        let edit = Edit::SetPoints { line, points: moved };
        let known = edit::Known { size: self.analysis.sides(), found: &[], found_in_use: false, faces: None };
        let step = edit::apply(document, edit, known)?;
        Ok(Step::new(step.document, format!("Snap {} to the edge", marked.line.name)))
    }
}

/// Marked lines that are in use.
pub(super) fn in_use(document: &PhotoDocument) -> impl Iterator<Item = &Line> {
    document.lines.iter().filter(|m| !m.off).map(|m| &m.line)
}

fn smaller_screen((w, h): (usize, usize)) -> (usize, usize) {
    plumbline_image::analysis_size(w, h, DRAFT_PICTURE)
}
