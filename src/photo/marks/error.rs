//! Why a file with marks was refused.

use plumbline_num::document::DocumentError;

/// A file with marks that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MarksError {
    /// Input: no such document, or one that cannot be read.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// Pixel centers that are neither at the corner nor in the middle.
    #[error("pixel_center is {found} (expected 0.5 or 0)")]
    PixelCenter {
        /// The value found.
        found: f64,
    },
    /// Marked in another picture, or in this one at another size.
    #[error(
        "the file is for a picture of {}×{} px and this one has {}×{}: mark this picture, or scale the file's positions",
        .file.0, .file.1, .picture.0, .picture.1
    )]
    Size {
        /// Width and height in the file, px.
        file: (u32, u32),
        /// Width and height of the picture, px.
        picture: (u32, u32),
    },
    /// A mark with a value that it cannot have.
    #[error("{mark}: {field} is {value} (expected {expected})")]
    Value {
        /// The mark by its number in the file and its name.
        mark: String,
        /// The key.
        field: String,
        /// The value found.
        value: String,
        /// The values allowed.
        expected: String,
    },
    /// A line without extent.
    #[error("{mark}: all points lie within a pixel; mark two points that are apart, or remove the line")]
    ZeroLength {
        /// The line.
        mark: String,
    },
    /// Two marks of one name.
    #[error("{first} and {second} have the same name: give each its own")]
    SameName {
        /// The earlier mark.
        first: String,
        /// The later mark.
        second: String,
    },
    /// The same line twice, to lie differently.
    #[error("{first} and {second} are the same line and shall be {one} and {other}: remove one, or switch it off")]
    Contradiction {
        /// The earlier line.
        first: String,
        /// The later line.
        second: String,
        /// Orientation of the earlier.
        one: String,
        /// Orientation of the later.
        other: String,
    },
    /// More than any person marks.
    #[error("{found} {what} are too many (at most {limit}): is this the right file?")]
    TooMany {
        /// `lines`, `faces` or `points`.
        what: &'static str,
        /// How many there are.
        found: u64,
        /// How many may be.
        limit: u64,
    },
}
