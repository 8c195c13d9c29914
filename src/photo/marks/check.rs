//! Validation of marked lines and faces.

use std::collections::HashMap;

use super::MarkedLine;
use super::orientation::Written;
use crate::{Orientation, PhotoError};
use plumbline_num::math::{Point2, Rect};

/// Maximum number of lines or faces of a file: far above what a person marks, far below what exhausts memory.
pub(super) const MAX_MARKS: usize = 10_000;
/// Maximum number of points of a file: ten per line.
const MAX_POINTS: usize = 100_000;
/// Tolerance, px, for points outside the picture: marks on the outermost pixel's outer edge in either pixel-center
/// convention.
const SLACK: f64 = 0.5;
/// Minimum extent of a line, px: shorter ones have no direction.
const MIN_EXTENT: f64 = 1.0;
/// Distance of the ends, px, below which two lines are duplicates: below the repeatability of marks by hand.
const SAME: f64 = 0.5;

/// A mark by its number, from 1, and its name.
pub(super) fn described(kind: &str, index: usize, name: &str) -> String {
    format!("{kind} {} ({name:?})", index + 1)
}

/// A mark with a value that it cannot have.
pub(super) fn refused(mark: &str, field: &str, value: &str, expected: &str) -> PhotoError {
    PhotoError::Input(format!("{mark}: {field} is {value} (expected {expected})"))
}

/// Refuses too many marks.
pub(super) fn count(what: &'static str, found: usize, limit: usize) -> Result<(), PhotoError> {
    let too_many = || format!("{found} {what} are too many (at most {limit}): is this the right file?");
    if found <= limit { Ok(()) } else { Err(PhotoError::Input(too_many())) }
}

/// Refuses two marks of one name.
pub(super) fn names<'a>(kind: &str, names: impl Iterator<Item = &'a str>) -> Result<(), PhotoError> {
    let mut seen = HashMap::new();
    for (i, name) in names.enumerate() {
        if let Some(first) = seen.insert(name, i) {
            let [first, second] = [first, i].map(|i| described(kind, i, name));
            return Err(PhotoError::Input(format!("{first} and {second} have the same name: give each its own")));
        }
    }
    Ok(())
}

/// Checks all lines on a picture of `size`, and drops duplicates, with a note for each.
pub(super) fn lines(marked: Vec<MarkedLine>, size: (u32, u32)) -> Result<(Vec<MarkedLine>, Vec<String>), PhotoError> {
    count("lines", marked.len(), MAX_MARKS)?;
    count("points", marked.iter().map(|m| m.line.points.len()).sum(), MAX_POINTS)?;
    names("line", marked.iter().map(|m| m.line.name.as_str()))?;
    for (i, m) in marked.iter().enumerate() {
        line(&described("line", i, &m.line.name), &m.line.points, size)?;
    }
    let (mut kept, mut notes) = (Vec::<(usize, MarkedLine)>::new(), Vec::new());
    let mut cells: HashMap<(i64, i64), Vec<usize>> = HashMap::new();
    for (i, m) in marked.into_iter().enumerate() {
        let here = described("line", i, &m.line.name);
        let twin = neighbors(&m).filter_map(|c| cells.get(&c)).flatten().map(|k| &kept[*k]).find(|(_, k)| same(k, &m));
        if let Some((first, twin)) = twin {
            let there = described("line", *first, &twin.line.name);
            let (one, other) = (twin.line.orientation, m.line.orientation);
            if one != other {
                let [one, other] = [one, other].map(|o| Written(o).to_string());
                let remedy = "remove one, or switch it off";
                return Err(PhotoError::Input(format!(
                    "{there} and {here} are the same line and shall be {one} and {other}: {remedy}"
                )));
            }
            notes.push(format!("{here} is left out: it is the same as {there}"));
            continue;
        }
        if !m.off {
            cells.entry(cell(middle(&m))).or_default().push(kept.len());
        }
        kept.push((i, m));
    }
    Ok((kept.into_iter().map(|(_, m)| m).collect(), notes))
}

/// Checks one line.
fn line(mark: &str, points: &[Point2], (w, h): (u32, u32)) -> Result<(), PhotoError> {
    if points.len() < 2 {
        return Err(refused(mark, "points", &format!("a list of {}", points.len()), "two or more"));
    }
    let mut allowed = Rect::of_size(f64::from(w), f64::from(h));
    (allowed.min, allowed.max) = (allowed.min.map(|v| v - SLACK), allowed.max.map(|v| v + SLACK));
    for (i, p) in points.iter().enumerate() {
        if !allowed.contains(*p) {
            let expected = format!("a point inside the picture of {w}×{h} px");
            return Err(refused(mark, &format!("points[{i}]"), &format!("({}, {})", p.x, p.y), &expected));
        }
    }
    if points.iter().all(|p| (p - points[0]).norm() < MIN_EXTENT) {
        let remedy = "mark two points that are apart, or remove the line";
        return Err(PhotoError::Input(format!("{mark}: all points lie within a pixel; {remedy}")));
    }
    Ok(())
}

/// Whether two lines in use are one, marked in either direction. A free line beside one with an orientation is the same.
fn same(a: &MarkedLine, b: &MarkedLine) -> bool {
    let ends = |m: &MarkedLine| [m.line.points[0], m.line.points[m.line.points.len() - 1]];
    let near = |p: Point2, q: Point2| (p - q).norm() < SAME;
    let ([a0, a1], [b0, b1]) = (ends(a), ends(b));
    !a.off && !b.off && (near(a0, b0) && near(a1, b1) || near(a0, b1) && near(a1, b0))
}

/// The middle between the ends.
fn middle(m: &MarkedLine) -> Point2 {
    nalgebra::center(&m.line.points[0], &m.line.points[m.line.points.len() - 1])
}

/// Cells of the side `SAME`: middles of equal lines lie in the same one or in neighbors.
fn cell(p: Point2) -> (i64, i64) {
    ((p.x / SAME).floor() as i64, (p.y / SAME).floor() as i64)
}

fn neighbors(m: &MarkedLine) -> impl Iterator<Item = (i64, i64)> {
    let (x, y) = cell(middle(m));
    (0..9).map(move |k| (x + k % 3 - 1, y + k / 3 - 1))
}

/// Free where nothing is asked.
pub(super) fn is_free(orientation: &Written) -> bool {
    orientation.0 == Orientation::Free
}
