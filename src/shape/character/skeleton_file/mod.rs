//! Skeleton files:
//!
//! ```json
//! { "format": "plumbline.skeleton", "version": 1,
//!   "joints": [
//!     {"name": "hip", "translation": [0, 0.9, 0]},
//!     {"name": "knee", "parent": "hip", "translation": [0, -0.4, 0], "rotation": [1, 0, 0, 0], "scale": [1, 1, 1],
//!      "limits": {"axis": [0, -1, 0], "across": [1, 0, 0], "swing_deg": [140, 5], "twist_deg": [-10, 10]}} ],
//!   "curve": {"nodes": [[0, 0.9, 0]], "edges": [], "radius": [0.1], "node_of_vertex": [0, 0]},
//!   "clips": [ {"name": "kick", "tracks": [
//!     {"joint": "knee", "property": "rotation", "interpolation": "smooth", "times": [0, 0.5],
//!      "values": [[1, 0, 0, 0], [0.8, 0.6, 0, 0]]} ]} ] }
//! ```
//!
//! Joints hold the rest pose: frames relative to their parents. `rotation` is `[w, x, y, z]`; omitted transforms are identities.
//! Lengths are in units of the model. `curve` is the curve skeleton that the joints were derived from, if they were extracted from a
//! surface. `proposed_names` says of names that a program proposed for what and how. `clips` are animations; values of keys are in the parent frame, times in seconds. Unlike in glTF and BVH, splines keep their
//! keys. Unknown keys are rejected.

mod clips;
mod document;
#[cfg(test)]
mod tests;

use std::path::Path;

pub(super) use document::LimitsEntry;
#[cfg(feature = "schema")]
pub use document::skeleton_file_schema;

use super::{Clip, CurveSkeleton, RigFileError, Skeleton};
use document::Document;
use plumbline_num::document::Kind;

/// Size limit: the node indices of ten million vertices.
const KIND: Kind = Kind { name: "a file of a skeleton", format: "plumbline.skeleton", max_bytes: 1 << 27 };

/// A skeleton, the curve skeleton it was derived from, and its animations.
#[derive(Clone, Debug, PartialEq)]
pub struct SkeletonFile {
    /// The skeleton.
    pub skeleton: Skeleton,
    /// The curve skeleton, if the skeleton was extracted from a surface.
    pub curve: Option<CurveSkeleton>,
    /// How names of joints were proposed ([`super::naming`]); `None` for names that someone gave.
    pub proposed_names: Option<String>,
    /// Animation clips. Their curves of morph weights are not written: a skeleton has no surface.
    pub clips: Vec<Clip>,
}

impl SkeletonFile {
    /// Reads a file.
    ///
    /// # Errors
    /// [`RigFileError::Document`] and all errors of [`Self::parse`].
    pub fn read(path: &Path) -> Result<Self, RigFileError> {
        Self::parse(&KIND.text(path)?)
    }

    /// Parses a document.
    ///
    /// # Errors
    /// [`RigFileError`]: not this format or version, invalid joints, a curve with node indices out of range, clips of joints that do not
    /// exist or with invalid keys.
    pub fn parse(text: &str) -> Result<Self, RigFileError> {
        KIND.parse::<Document>(text)?.into_skeleton()
    }

    /// The document as text; [`Self::parse`] restores it bit for bit, without curves of morph weights.
    pub fn to_json(&self) -> String {
        Document::of(self).to_json()
    }
}
