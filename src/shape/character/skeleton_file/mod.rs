//! Skeleton files of our own:
//!
//! ```json
//! { "format": "plumbline.skeleton", "version": 1,
//!   "joints": [
//!     {"name": "hip", "translation": [0, 0.9, 0]},
//!     {"name": "knee", "parent": "hip", "translation": [0, -0.4, 0], "rotation": [1, 0, 0, 0], "scale": [1, 1, 1],
//!      "limits": {"axis": [0, -1, 0], "across": [1, 0, 0], "swing_deg": [140, 5], "twist_deg": [-10, 10]}} ],
//!   "curve": {"nodes": [[0, 0.9, 0]], "edges": [], "radius": [0.1], "node_of_vertex": [0, 0]} }
//! ```
//!
//! It is neither a pose nor a skin: it says where joints are at rest, in the frame of their parents. `rotation` is `[w, x, y, z]`;
//! what is left out changes nothing. Lengths are in units of the model. `curve` is what the joints were made of, where they were
//! found in a surface. Unknown keys are refused.

mod document;
mod error;
#[cfg(test)]
mod tests;

use std::path::Path;

#[cfg(feature = "schema")]
pub use document::skeleton_file_schema;
pub use error::SkeletonFileError;

use super::{CurveSkeleton, Skeleton};
use document::Document;
use plumbline_num::document::Kind;

/// At most as large as the mapping of ten million vertices.
const KIND: Kind = Kind { name: "a file of a skeleton", format: "plumbline.skeleton", max_bytes: 1 << 27 };

/// A skeleton, and the curve it was made of.
#[derive(Clone, Debug, PartialEq)]
pub struct SkeletonFile {
    /// The joints.
    pub skeleton: Skeleton,
    /// The curve in the middle of the surface in which they were found.
    pub curve: Option<CurveSkeleton>,
}

impl SkeletonFile {
    /// Reads a file.
    ///
    /// # Errors
    /// What [`Self::parse`] refuses; [`SkeletonFileError::Document`].
    pub fn read(path: &Path) -> Result<Self, SkeletonFileError> {
        Self::parse(&KIND.text(path)?)
    }

    /// Reads a text.
    ///
    /// # Errors
    /// [`SkeletonFileError`]: not JSON of this shape, another format or version, joints that are no skeleton, a curve that names
    /// nodes it does not have.
    pub fn parse(text: &str) -> Result<Self, SkeletonFileError> {
        KIND.parse::<Document>(text)?.into_skeleton()
    }

    /// As text, which [`Self::parse`] reads back to the same bits.
    pub fn to_json(&self) -> String {
        Document::of(self).to_json()
    }
}
