//! `NAME.faces.json`.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::check;
use super::header::{MAX_BYTES, Parsed, Source, check_size, name_or_number, one_per_line, parse};
use crate::PhotoError;
use plumbline_num::document::{Kind, VERSION};
use plumbline_num::math::{Point2, Rect, Vec2};

const KIND: Kind = Kind { name: "a file of marked faces", format: "plumbline.faces", max_bytes: MAX_BYTES };

/// A face with its switch.
#[derive(Clone, Debug, PartialEq)]
pub struct MarkedFace {
    /// What messages call it.
    pub name: String,
    /// Where it is, px.
    pub rect: Rect,
    /// Kept in the file and not used.
    pub off: bool,
}

/// Faces of a picture, as in a file.
#[derive(Clone, Debug, PartialEq)]
pub struct FacesFile {
    /// Width and height of the picture as shown, px.
    pub size: (u32, u32),
    /// All faces, in the order of the file.
    pub faces: Vec<MarkedFace>,
}

/// A file of marked faces.
#[derive(Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct Document {
    /// Always `plumbline.faces`.
    format: String,
    /// Always 1.
    version: u32,
    /// The picture that was marked.
    source: Source,
    /// The faces.
    faces: Vec<Entry>,
}

/// The rectangle from `(x, y)` to `(x + w, y + h)`, px, edges of pixels at integers.
#[derive(Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct Entry {
    /// Name in messages; default: its number in the file.
    #[serde(default, alias = "id", deserialize_with = "name_or_number", skip_serializing_if = "Option::is_none")]
    name: Option<String>,
    /// Left edge.
    x: f64,
    /// Top edge.
    y: f64,
    /// Width, above 0.
    w: f64,
    /// Height, above 0.
    h: f64,
    /// Kept in the file and not used.
    #[serde(default)]
    off: bool,
}

/// The JSON schema of the faces file.
#[cfg(feature = "schema")]
pub fn faces_schema() -> schemars::Schema {
    schemars::schema_for!(Document)
}

impl FacesFile {
    /// Reads the faces of a picture of `size` px from a file.
    ///
    /// # Errors
    /// [`PhotoError`]: as for [`FacesFile::parse`], a file that is too large or cannot be read.
    pub fn read(path: &Path, size: (u32, u32)) -> Result<Self, PhotoError> {
        Self::parse(&KIND.text(path)?, size)
    }

    /// The faces of a picture of `size` px from a file's text. A face may reach beyond the picture, as detectors' boxes do,
    /// but its middle must lie inside.
    ///
    /// # Errors
    /// [`PhotoError`]: not JSON of this shape, another version, another picture's size, a face without area or outside the
    /// picture, equal names, or too many.
    pub fn parse(text: &str, size: (u32, u32)) -> Result<Self, PhotoError> {
        let entries: Vec<Entry> = match parse::<Document, Entry>(&KIND, text)? {
            Parsed::Document(document) => {
                check_size(document.source, size)?;
                document.faces
            }
            Parsed::List(list) => list,
        };
        check::count("faces", entries.len(), check::MAX_MARKS)?;
        let faces: Result<Vec<_>, _> = entries.into_iter().enumerate().map(|(i, e)| face(i, e, size)).collect();
        let faces = faces?;
        check::names("face", faces.iter().map(|f| f.name.as_str()))?;
        Ok(Self { size, faces })
    }

    /// The text of the file, one face per line.
    pub fn to_json(&self) -> String {
        let entry = |f: &MarkedFace| Entry {
            name: Some(f.name.clone()),
            x: f.rect.min.x,
            y: f.rect.min.y,
            w: f.rect.width(),
            h: f.rect.height(),
            off: f.off,
        };
        let (format, source) = (KIND.format.into(), Source::of(self.size));
        let document = Document { format, version: VERSION, source, faces: Vec::new() };
        one_per_line(&document, self.faces.iter().map(entry))
    }

    /// The faces in use.
    pub fn in_use(&self) -> impl Iterator<Item = &MarkedFace> {
        self.faces.iter().filter(|f| !f.off)
    }
}

fn face(i: usize, e: Entry, (width, height): (u32, u32)) -> Result<MarkedFace, PhotoError> {
    let name = e.name.unwrap_or_else(|| format!("face {}", i + 1));
    let refused = |field: &str, value: String, expected: &str| {
        Err(check::refused(&check::described("face", i, &name), field, &value, expected))
    };
    for (field, side) in [("w", e.w), ("h", e.h)] {
        if !(side > 0.0 && side.is_finite()) {
            return refused(field, side.to_string(), "a finite number above 0");
        }
    }
    let min = Point2::new(e.x, e.y);
    let rect = Rect { min, max: min + Vec2::new(e.w, e.h) };
    let middle = rect.center();
    if !Rect::of_size(f64::from(width), f64::from(height)).contains(middle) {
        let expected = format!("inside the picture of {width}×{height} px");
        return refused("the middle", format!("({}, {})", middle.x, middle.y), &expected);
    }
    Ok(MarkedFace { name, rect, off: e.off })
}
