//! Edits: functions from a document to another one. Found lines and faces, which are in no file, are handed in.

use std::sync::Arc;

use toml_edit::{Array, Value};

use super::document::{PhotoDocument, Selection};
use super::pipeline_text::Part;
use super::protocol::{Edit, OrientationSetting};
use crate::error::StudioError;
use crate::workspace::Step;
use plumbline_image::feature::Face;
use plumbline_num::math::{Point2, Rect, Vec2};
use plumbline_photo::marks::{MarkedFace, MarkedLine};
use plumbline_photo::{Line, Orientation};

/// Maximum number of lines and of faces, as files have.
const MAX_MARKS: usize = 10_000;
/// Maximum number of points of a line.
const MAX_POINTS: usize = 1000;
/// Maximum length of a name, characters.
const MAX_NAME: usize = 200;

/// What an edit may refer to beside the document.
#[derive(Clone, Copy, Debug)]
pub(super) struct Known<'k> {
    /// Width and height of the photo, px.
    pub(super) size: (f64, f64),
    /// Lines that were found, and whether the result is made with those that are not switched off.
    pub(super) found: &'k [Line],
    pub(super) found_in_use: bool,
    /// Faces that were found; `None` where they are not known yet.
    pub(super) faces: Option<&'k [Face]>,
}

type Edited = Result<Step<PhotoDocument>, StudioError>;

/// The document after an edit, except [`Edit::SnapLine`], which needs the picture.
pub(super) fn apply(document: &PhotoDocument, edit: Edit, known: Known<'_>) -> Edited {
    match edit {
        Edit::Select { lines, point, faces } => select(document, Selection { lines, point, faces }),
        Edit::SetLens { lens, fov, fov_axis } => set_lens(document, &lens, fov, fov_axis.as_deref()),
        Edit::Set { key, value } => set(document, &key, &value),
        Edit::Adopt { names } => adopt(document, &names, known),
        Edit::SwitchFound { names, off } => switch_found(document, names, off, known),
        Edit::AddLine { points, orientation } => add_line(document, &points, orientation.as_ref(), known),
        edit @ (Edit::AddFace { .. }
        | Edit::SetFace { .. }
        | Edit::RenameFace { .. }
        | Edit::SwitchFaces { .. }
        | Edit::DeleteFaces { .. }
        | Edit::FindFaces) => edit_faces(document, edit, known),
        edit => edit_lines(document, edit, known),
    }
}

fn edit_lines(document: &PhotoDocument, edit: Edit, known: Known<'_>) -> Edited {
    let mut next = document.clone();
    let lines = Arc::make_mut(&mut next.lines);
    let (label, merge) = match edit {
        Edit::MovePoint { line, point, x, y } => {
            let marked = line_mut(lines, line)?;
            let p = checked(&[[x, y]], known.size)?[0];
            *marked.line.points.get_mut(point).ok_or_else(|| no_point(point, line))? = p;
            if marked.line.points.iter().all(|q| (q - marked.line.points[0]).norm() < 1.0) {
                return Err(StudioError::request("all points would lie within a pixel: delete the line instead"));
            }
            next.selection = Selection { lines: vec![line], point: Some(point), faces: Vec::new() };
            (format!("Move a point of {}", lines[line].line.name), Some(format!("point {line} {point}")))
        }
        Edit::SetPoints { line, points } => {
            line_mut(lines, line)?.line.points = checked_line(&points, known.size)?;
            (format!("Move {}", lines[line].line.name), Some(format!("points {line}")))
        }
        Edit::InsertPoint { line, at, x, y } => {
            let marked = line_mut(lines, line)?;
            let p = checked(&[[x, y]], known.size)?[0];
            let fits = at <= marked.line.points.len() && marked.line.points.len() < MAX_POINTS;
            fits.then(|| marked.line.points.insert(at, p)).ok_or_else(|| no_point(at, line))?;
            next.selection = Selection { lines: vec![line], point: Some(at), faces: Vec::new() };
            (format!("Add a point to {}", lines[line].line.name), None)
        }
        Edit::RemovePoint { line, point } => {
            let points = &mut line_mut(lines, line)?.line.points;
            if points.len() < 3 {
                return Err(StudioError::request("a line has two points or more: delete the line instead"));
            }
            (point < points.len()).then(|| points.remove(point)).ok_or_else(|| no_point(point, line))?;
            next.selection.point = None;
            (format!("Remove a point of {}", lines[line].line.name), None)
        }
        Edit::DeleteLines { lines: numbers } => {
            remove(lines, &numbers, "line")?;
            next.selection = Selection::default();
            (counted("Delete", numbers.len(), "line"), None)
        }
        Edit::Orient { lines: numbers, orientation } => {
            let wanted = orientation_of(&orientation)?;
            each(lines, &numbers, |marked| marked.line.orientation = wanted)?;
            (format!("Orientation of {}", counted("", numbers.len(), "line").trim()), None)
        }
        Edit::RenameLine { line, name } => {
            let name =
                new_name(&name, lines.iter().enumerate().filter(|(k, _)| *k != line).map(|(_, m)| &m.line.name))?;
            line_mut(lines, line)?.line.name = name;
            ("Rename a line".to_owned(), None)
        }
        Edit::SwitchLines { lines: numbers, off } => {
            each(lines, &numbers, |marked| marked.off = off)?;
            (counted(if off { "Switch off" } else { "Switch on" }, numbers.len(), "line"), None)
        }
        _ => return Err(StudioError::request("this edit is none of lines")),
    };
    next.lines_file = true;
    Ok(Step { document: next, label, merge })
}

fn edit_faces(document: &PhotoDocument, edit: Edit, known: Known<'_>) -> Edited {
    if matches!(edit, Edit::FindFaces) {
        let pipeline = document.pipeline.with_found_faces()?;
        let next = PhotoDocument { pipeline, faces: None, selection: Selection::default(), ..document.clone() };
        return Ok(Step::new(next, "Find faces again"));
    }
    let mut next = with_own_faces(document, known)?;
    let faces = next.faces.as_mut().map(Arc::make_mut).ok_or_else(no_faces)?;
    let (label, merge) = match edit {
        Edit::AddFace { rect } => {
            let name = free_name("face", faces.iter().map(|f| f.name.as_str()));
            (faces.len() < MAX_MARKS).then_some(()).ok_or_else(|| StudioError::request("too many faces"))?;
            faces.push(MarkedFace { name, rect: face_rect(rect, known.size)?, off: false });
            next.selection = Selection { faces: vec![faces.len() - 1], ..Selection::default() };
            ("Add a face".to_owned(), None)
        }
        Edit::SetFace { face, rect } => {
            let rect = face_rect(rect, known.size)?;
            face_mut(faces, face)?.rect = rect;
            next.selection = Selection { faces: vec![face], ..Selection::default() };
            (format!("Move {}", faces[face].name), Some(format!("face {face}")))
        }
        Edit::RenameFace { face, name } => {
            let name = new_name(&name, faces.iter().enumerate().filter(|(k, _)| *k != face).map(|(_, f)| &f.name))?;
            face_mut(faces, face)?.name = name;
            ("Rename a face".to_owned(), None)
        }
        Edit::SwitchFaces { faces: numbers, off } => {
            each(faces, &numbers, |face| face.off = off)?;
            (counted(if off { "Switch off" } else { "Switch on" }, numbers.len(), "face"), None)
        }
        Edit::DeleteFaces { faces: numbers } => {
            remove(faces, &numbers, "face")?;
            next.selection = Selection::default();
            (counted("Delete", numbers.len(), "face"), None)
        }
        _ => return Err(StudioError::request("this edit is none of faces")),
    };
    Ok(Step { document: next, label, merge })
}

/// The document with faces of its own, begun with those that were found.
fn with_own_faces(document: &PhotoDocument, known: Known<'_>) -> Result<PhotoDocument, StudioError> {
    if document.faces.is_some() {
        return Ok(document.clone());
    }
    let found = known.faces.ok_or_else(|| StudioError::request("faces are still being searched"))?;
    let photo = std::path::Path::new(&document.pipeline.said().photo.path);
    let pipeline = document.pipeline.with_faces_of(&super::document::beside(photo, ".faces.json"))?;
    let marked =
        |(k, face): (usize, &Face)| MarkedFace { name: format!("face {}", k + 1), rect: face.rect, off: false };
    let faces = Some(Arc::new(found.iter().enumerate().map(marked).collect()));
    Ok(PhotoDocument { pipeline, faces, ..document.clone() })
}

fn add_line(
    document: &PhotoDocument,
    points: &[[f64; 2]],
    orientation: Option<&OrientationSetting>,
    known: Known<'_>,
) -> Edited {
    let orientation = orientation.map_or(Ok(Orientation::Free), orientation_of)?;
    let points = checked_line(points, known.size)?;
    // The pipeline takes found lines only where none are marked: those in use stay in use as marked ones.
    let keeps = known.found_in_use && !document.has_lines_in_use();
    let mut next = if keeps { adopted(document, known, |_| true)? } else { document.clone() };
    let adopted = next.lines.len() - document.lines.len();
    let lines = with_file(&mut next)?;
    (lines.len() < MAX_MARKS).then_some(()).ok_or_else(|| StudioError::request("too many lines"))?;
    let name = free_name("line", lines.iter().map(|m| m.line.name.as_str()));
    let label = match adopted {
        0 => format!("Draw {name}"),
        n => format!("Draw {name}, keep {}", counted("", n, "found line").trim()),
    };
    lines.push(MarkedLine { line: Line { name, points, orientation }, off: false });
    next.selection = Selection { lines: vec![next.lines.len() - 1], ..Selection::default() };
    Ok(Step::new(next, label))
}

fn adopt(document: &PhotoDocument, names: &[String], known: Known<'_>) -> Edited {
    let missing = names.iter().find(|name| !known.found.iter().any(|line| line.name == **name));
    if let Some(name) = missing {
        return Err(StudioError::request(format!("there is no found line `{name}`")));
    }
    let mut next = adopted(document, known, |line| names.contains(&line.name))?;
    let first = document.lines.len();
    next.selection = Selection { lines: (first..next.lines.len()).collect(), ..Selection::default() };
    Ok(Step::new(next, counted("Adopt", names.len(), "found line")))
}

/// The document with found lines that are not switched off as marked ones, each under a name of its own.
fn adopted(
    document: &PhotoDocument,
    known: Known<'_>,
    wanted: impl Fn(&Line) -> bool,
) -> Result<PhotoDocument, StudioError> {
    let without = document.pipeline.said().found.as_ref().map_or(&[][..], |found| &found.without);
    let chosen = known.found.iter().filter(|line| wanted(line) && !without.contains(&line.name));
    let mut next = document.clone();
    let lines = with_file(&mut next)?;
    for line in chosen {
        // As the file keeps them: what is shown is what a saved document gives.
        let points = checked(&line.points.iter().map(|p| [p.x, p.y]).collect::<Vec<_>>(), known.size)?;
        if lines.iter().any(|m| m.line.points == points) {
            continue;
        }
        let taken = lines.iter().any(|m| m.line.name == line.name);
        let name =
            if taken { free_name(&line.name, lines.iter().map(|m| m.line.name.as_str())) } else { line.name.clone() };
        lines.push(MarkedLine { line: Line { name, points, orientation: line.orientation }, off: false });
    }
    Ok(next)
}

/// The lines, of a document that has a file for them.
fn with_file(document: &mut PhotoDocument) -> Result<&mut Vec<MarkedLine>, StudioError> {
    if document.pipeline.lines_path().is_none() {
        return Err(StudioError::request("the pipeline reads no marked lines: add a stage lines.load to it"));
    }
    document.lines_file = true;
    Ok(Arc::make_mut(&mut document.lines))
}

fn switch_found(document: &PhotoDocument, names: Vec<String>, off: bool, known: Known<'_>) -> Edited {
    let found = document.pipeline.said().found.as_ref();
    let found = found.ok_or_else(|| StudioError::request("the pipeline finds no lines"))?;
    let mut without: Vec<String> = found.without.clone();
    without.retain(|name| !names.contains(name));
    let count = names.len();
    if off {
        let is_known = |name: &String| known.found.iter().any(|line| line.name == *name);
        let unknown = names.iter().find(|name| !is_known(name));
        if let Some(name) = unknown {
            return Err(StudioError::request(format!("there is no found line `{name}`")));
        }
        without.extend(names);
    }
    let list = (!without.is_empty()).then(|| Value::Array(without.iter().map(String::as_str).collect::<Array>()));
    let pipeline = document.pipeline.with(&[(Part::Found, "without", list)])?;
    let label = counted(if off { "Switch off" } else { "Switch on" }, count, "found line");
    Ok(Step::new(PhotoDocument { pipeline, ..document.clone() }, label))
}

fn set_lens(document: &PhotoDocument, lens: &str, fov: Option<f64>, axis: Option<&str>) -> Edited {
    if lens.trim().is_empty() || lens.chars().count() > 4096 {
        return Err(StudioError::request("a lens is auto, a file, or a model with a field of view"));
    }
    let escaped = plumbline_app::pipeline::file::literal_path(std::path::Path::new(lens));
    let changes = [Part::Map, Part::Found].into_iter().flat_map(|part| {
        [
            (part, "lens", Some(Value::from(escaped.as_str()))),
            (part, "fov", fov.map(Value::from)),
            (part, "fov_axis", axis.filter(|a| *a != "h").map(Value::from)),
        ]
    });
    let pipeline = document.pipeline.with(&changes.collect::<Vec<_>>())?;
    let label = fov.map_or_else(|| format!("Lens {lens}"), |fov| format!("Lens {lens}, {fov:.1}°"));
    Ok(Step::new(PhotoDocument { pipeline, ..document.clone() }, label).merged(format!("lens {lens}")))
}

/// Settings by key: the stage that has it, and what it is called in the history.
const SETTINGS: [(&str, Part, &str); 9] = [
    ("to", Part::Map, "Projection"),
    ("crop", Part::Map, "Crop"),
    ("view", Part::Map, "View direction"),
    ("view_field", Part::Map, "Field of the view"),
    ("size", Part::Map, "Size"),
    ("border", Part::Render, "Border"),
    ("interpolation", Part::Render, "Interpolation"),
    ("path", Part::Save, "File to write"),
    ("quality", Part::Save, "JPEG quality"),
];

fn set(document: &PhotoDocument, key: &str, value: &str) -> Edited {
    let (key, part, label) = SETTINGS
        .into_iter()
        .find(|(name, ..)| *name == key)
        .ok_or_else(|| StudioError::request(format!("`{key}` is not set here")))?;
    let value = value.trim();
    let new = match key {
        "quality" => value.parse::<i64>().ok().map(Value::from),
        "path" => Some(Value::from(file_name(value)?)),
        _ => (!value.is_empty()).then(|| Value::from(value)),
    };
    let pipeline = document.pipeline.with(&[(part, key, new)])?;
    Ok(Step::new(PhotoDocument { pipeline, ..document.clone() }, format!("{label} {value}"))
        .merged(format!("set {key}")))
}

/// A name of a file beside the pipeline.
fn file_name(name: &str) -> Result<String, StudioError> {
    let path = std::path::Path::new(name);
    if path.components().count() == 1 && path.file_name().is_some() {
        return Ok(plumbline_app::pipeline::file::literal_path(path));
    }
    Err(StudioError::request(format!("`{name}` is not a file name (expected NAME.jpg, beside the pipeline)")))
}

fn select(document: &PhotoDocument, selection: Selection) -> Edited {
    let (lines, faces) = (document.lines.len(), document.faces.as_ref().map_or(MAX_MARKS, |f| f.len()));
    let outside = selection.lines.iter().any(|k| *k >= lines) || selection.faces.iter().any(|k| *k >= faces);
    let points =
        selection.lines.last().map_or(0, |k| document.lines[*k.min(&lines.saturating_sub(1))].line.points.len());
    if outside || selection.point.is_some_and(|k| k >= points) {
        return Err(StudioError::request("there is nothing of this number to select"));
    }
    Ok(Step::new(PhotoDocument { selection, ..document.clone() }, "Select").merged("select"))
}

/// Points of a line, inside the picture and not all one.
pub(super) fn checked_line(points: &[[f64; 2]], size: (f64, f64)) -> Result<Vec<Point2>, StudioError> {
    if !(2..=MAX_POINTS).contains(&points.len()) {
        return Err(StudioError::request(format!("a line has {} points (expected 2 to {MAX_POINTS})", points.len())));
    }
    let points = checked(points, size)?;
    if points.iter().all(|p| (p - points[0]).norm() < 1.0) {
        return Err(StudioError::request("all points lie within a pixel: draw the line longer"));
    }
    Ok(points)
}

/// Positions in the picture; a pointer that left it is brought back to its edge.
fn checked(points: &[[f64; 2]], size: (f64, f64)) -> Result<Vec<Point2>, StudioError> {
    if !points.iter().flatten().all(|v| v.is_finite()) {
        return Err(StudioError::request("a position is not finite"));
    }
    // Files keep a thousandth of a pixel.
    let kept = |v: f64, side: f64| (v.clamp(0.0, side) * 1e3).round() / 1e3;
    Ok(points.iter().map(|[x, y]| Point2::new(kept(*x, size.0), kept(*y, size.1))).collect())
}

fn face_rect([x, y, w, h]: [f64; 4], size: (f64, f64)) -> Result<Rect, StudioError> {
    let sound = [x, y, w, h].iter().all(|v| v.is_finite() && v.abs() < 1e6) && w >= 1.0 && h >= 1.0;
    let min = Point2::new(x, y);
    let rect = Rect { min, max: min + Vec2::new(w, h) };
    if sound && Rect::of_size(size.0, size.1).contains(rect.center()) {
        return Ok(rect);
    }
    Err(StudioError::request(format!(
        "a face of {w}×{h} px at ({x}, {y}) (expected 1 px or more, its middle in the picture)"
    )))
}

pub(super) fn orientation_of(setting: &OrientationSetting) -> Result<Orientation, StudioError> {
    let expected = "expected free, horizontal, vertical, or -360 to 360 degrees";
    match setting {
        OrientationSetting::Word(word) => match word.as_str() {
            "free" => Ok(Orientation::Free),
            "horizontal" => Ok(Orientation::Horizontal),
            "vertical" => Ok(Orientation::Vertical),
            other => Err(StudioError::request(format!("`{other}` is no orientation ({expected})"))),
        },
        OrientationSetting::Degrees(degrees) if degrees.abs() <= 360.0 => Ok(match degrees.rem_euclid(180.0) {
            0.0 => Orientation::Horizontal,
            90.0 => Orientation::Vertical,
            turned => Orientation::Angle(turned.to_radians()),
        }),
        OrientationSetting::Degrees(degrees) => {
            Err(StudioError::request(format!("an orientation of {degrees}° ({expected})")))
        }
    }
}

fn line_mut(lines: &mut [MarkedLine], k: usize) -> Result<&mut MarkedLine, StudioError> {
    lines.get_mut(k).ok_or_else(|| StudioError::request(format!("there is no line {k}")))
}

fn face_mut(faces: &mut [MarkedFace], k: usize) -> Result<&mut MarkedFace, StudioError> {
    faces.get_mut(k).ok_or_else(|| StudioError::request(format!("there is no face {k}")))
}

fn no_point(point: usize, line: usize) -> StudioError {
    StudioError::request(format!("line {line} has no point {point}"))
}

fn no_faces() -> StudioError {
    StudioError::request("there are no faces")
}

fn each<T>(list: &mut [T], numbers: &[usize], mut change: impl FnMut(&mut T)) -> Result<(), StudioError> {
    for k in numbers {
        change(list.get_mut(*k).ok_or_else(|| StudioError::request(format!("there is nothing of number {k}")))?);
    }
    Ok(())
}

fn remove<T>(list: &mut Vec<T>, numbers: &[usize], what: &str) -> Result<(), StudioError> {
    if let Some(k) = numbers.iter().find(|k| **k >= list.len()) {
        return Err(StudioError::request(format!("there is no {what} {k}")));
    }
    let mut k = 0;
    list.retain(|_| {
        k += 1;
        !numbers.contains(&(k - 1))
    });
    Ok(())
}

fn new_name<'n>(name: &str, mut others: impl Iterator<Item = &'n String>) -> Result<String, StudioError> {
    let name = name.trim();
    if name.is_empty() || name.chars().count() > MAX_NAME {
        return Err(StudioError::request(format!("a name has 1 to {MAX_NAME} characters")));
    }
    if others.any(|other| other == name) {
        return Err(StudioError::request(format!("another one is called `{name}`")));
    }
    Ok(name.to_owned())
}

/// `WORD N` with the first number that no name has.
fn free_name<'n>(word: &str, names: impl IntoIterator<Item = &'n str>) -> String {
    let names: Vec<&str> = names.into_iter().collect();
    // One of more names than are taken is free.
    let mut all = (1..=names.len() + 1).map(|n| format!("{word} {n}"));
    all.find(|name| !names.contains(&name.as_str())).unwrap_or_default()
}

fn counted(verb: &str, count: usize, noun: &str) -> String {
    if count == 1 { format!("{verb} a {noun}") } else { format!("{verb} {count} {noun}s") }
}
