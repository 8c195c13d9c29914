//! `NAME.lines.json`.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::check;
use super::header::{MAX_BYTES, Parsed, Source, check_size, name_or_number, one_per_line, parse};
use super::orientation::Written;
use crate::{Line, PhotoError};
use plumbline_num::document::{Kind, VERSION, pixel_center_shift};
use plumbline_num::math::{Point2, Vec2};

const KIND: Kind = Kind { name: "a file of marked lines", format: "plumbline.lines", max_bytes: MAX_BYTES };

/// A line with its switch.
#[derive(Clone, Debug, PartialEq)]
pub struct MarkedLine {
    /// The line.
    pub line: Line,
    /// Kept in the file and not used.
    pub off: bool,
}

/// Lines of a picture, as in a file.
#[derive(Clone, Debug, PartialEq)]
pub struct LinesFile {
    /// Width and height of the picture as shown, px.
    pub size: (u32, u32),
    /// All lines, in the order of the file.
    pub lines: Vec<MarkedLine>,
    /// What was put right in reading, for the user.
    pub notes: Vec<String>,
}

/// A file of marked lines.
#[derive(Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct Document {
    /// Always `plumbline.lines`.
    format: String,
    /// Always 1.
    version: u32,
    /// Where the center of the first pixel lies: 0.5, or 0.
    #[serde(default = "half", alias = "pixel_centre")]
    pixel_center: f64,
    /// The picture that was marked.
    source: Source,
    /// The lines.
    lines: Vec<Entry>,
}

fn half() -> f64 {
    0.5
}

/// A marked line.
#[derive(Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct Entry {
    /// Name in messages; default: its number in the file.
    #[serde(default, alias = "id", deserialize_with = "name_or_number", skip_serializing_if = "Option::is_none")]
    name: Option<String>,
    /// Two or more positions in order along the line, px.
    #[cfg_attr(feature = "schema", schemars(length(min = 2)))]
    points: Vec<[f64; 2]>,
    #[serde(default, skip_serializing_if = "check::is_free")]
    orientation: Written,
    /// Kept in the file and not used.
    #[serde(default, skip_serializing_if = "is_false")]
    off: bool,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde calls it this way")]
fn is_false(value: &bool) -> bool {
    !value
}

/// The JSON schema of the lines file.
#[cfg(feature = "schema")]
pub fn lines_schema() -> schemars::Schema {
    schemars::schema_for!(Document)
}

impl LinesFile {
    /// A file of lines that are all in use.
    pub fn new(size: (u32, u32), lines: Vec<Line>) -> Self {
        let lines = lines.into_iter().map(|line| MarkedLine { line, off: false }).collect();
        Self { size, lines, notes: Vec::new() }
    }

    /// Reads the lines of a picture of `size` px from a file.
    ///
    /// # Errors
    /// [`PhotoError`]: as for [`LinesFile::parse`], a file that is too large or cannot be read.
    pub fn read(path: &Path, size: (u32, u32)) -> Result<Self, PhotoError> {
        Self::parse(&KIND.text(path)?, size)
    }

    /// The lines of a picture of `size` px from a file's text.
    ///
    /// # Errors
    /// [`PhotoError`]: not JSON of this shape, another version, another picture's size, points outside the picture, lines
    /// without extent, equal names, the same line with different orientations, or too many.
    pub fn parse(text: &str, size: (u32, u32)) -> Result<Self, PhotoError> {
        let (entries, by) = match parse::<Document, Entry>(&KIND, text)? {
            Parsed::Document(document) => {
                check_size(document.source, size)?;
                let found = document.pixel_center;
                let refused = || PhotoError::Input(format!("pixel_center is {found} (expected 0.5 or 0)"));
                (document.lines, pixel_center_shift(found).ok_or_else(refused)?)
            }
            Parsed::List(list) => (list, 0.5),
        };
        let lines = entries.into_iter().enumerate().map(|(i, entry)| marked(i, entry, by)).collect();
        let (lines, notes) = check::lines(lines, size)?;
        Ok(Self { size, lines, notes })
    }

    /// The text of the file, one line of the picture per line of text.
    pub fn to_json(&self) -> String {
        let entry = |m: &MarkedLine| Entry {
            name: Some(m.line.name.clone()),
            points: m.line.points.iter().map(|p| [p.x, p.y].map(rounded)).collect(),
            orientation: Written(m.line.orientation),
            off: m.off,
        };
        let document = Document {
            format: KIND.format.into(),
            version: VERSION,
            pixel_center: half(),
            source: Source::of(self.size),
            lines: Vec::new(),
        };
        let entries = self.lines.iter().map(entry);
        one_per_line(&document, entries)
    }

    /// The lines in use.
    pub fn in_use(&self) -> impl Iterator<Item = &Line> {
        self.lines.iter().filter(|m| !m.off).map(|m| &m.line)
    }
}

/// The line of an entry, its points moved by `by` px.
fn marked(i: usize, entry: Entry, by: f64) -> MarkedLine {
    let points = entry.points.iter().map(|[x, y]| Point2::new(*x, *y) + Vec2::new(by, by)).collect();
    let name = entry.name.unwrap_or_else(|| format!("line {}", i + 1));
    MarkedLine { line: Line { name, points, orientation: entry.orientation.0 }, off: entry.off }
}

/// To a thousandth of a pixel, below the accuracy of marks.
fn rounded(v: f64) -> f64 {
    (v * 1e3).round() / 1e3
}
