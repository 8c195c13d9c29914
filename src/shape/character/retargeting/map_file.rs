//! Joint maps:
//!
//! ```json
//! { "format": "plumbline.joint-map", "version": 1,
//!   "joints": { "hand.L": "mixamorig:LeftHand", "tail": null } }
//! ```
//!
//! Names of joints of the target, each with the joint of the source that it follows; `null` for a joint that follows none. Other joints are
//! matched as without the file. Unknown keys and unknown joints are rejected.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use serde::Deserialize;

use crate::character::{RigFileError, Skeleton};
use plumbline_num::document::Kind;

/// Size limit: a hundred thousand joints.
const KIND: Kind = Kind { name: "a joint map", format: "plumbline.joint-map", max_bytes: 1 << 24 };

/// Which joints of a target follow which of a source.
#[derive(Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct Document {
    /// Always `plumbline.joint-map`.
    #[expect(dead_code, reason = "checked before the rest is read")]
    format: String,
    /// Always 1.
    #[expect(dead_code, reason = "checked before the rest is read")]
    version: u32,
    /// Names of joints of the source, by names of joints of the target; null for a joint that follows none.
    joints: BTreeMap<String, Option<String>>,
}

/// The JSON schema of joint maps.
#[cfg(feature = "schema")]
pub fn joint_map_schema() -> schemars::Schema {
    schemars::schema_for!(Document)
}

/// A joint map: for joints of the target the joint of the source that it follows, or none.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct JointMap {
    /// Target joint, and source joint or none; each target joint once.
    pub pairs: Vec<(u32, Option<u32>)>,
}

impl JointMap {
    /// Reads a file for two skeletons.
    ///
    /// # Errors
    /// [`RigFileError::Document`] and all errors of [`Self::parse`].
    pub fn read(path: &Path, source: &Skeleton, target: &Skeleton) -> Result<Self, RigFileError> {
        Self::parse(&KIND.text(path)?, source, target)
    }

    /// Parses a document for two skeletons.
    ///
    /// # Errors
    /// [`RigFileError`]: not this format or version; joints that the skeletons do not have.
    pub fn parse(text: &str, source: &Skeleton, target: &Skeleton) -> Result<Self, RigFileError> {
        let document: Document = KIND.parse(text)?;
        let index = |skeleton: &Skeleton| -> HashMap<String, u32> {
            skeleton.joints().iter().zip(0..).map(|(joint, j)| (joint.name.clone(), j)).collect()
        };
        let (ours, theirs) = (index(source), index(target));
        let number = |index: &HashMap<String, u32>, skeleton: &Skeleton, name: &str, of: &str| match index.get(name) {
            Some(joint) => Ok(*joint),
            None => skeleton.named(name).map_err(|e| RigFileError::Content(format!("{of}: {e}"))),
        };
        let pair = |(name, follows): (&String, &Option<String>)| {
            let joint = number(&theirs, target, name, "the target")?;
            let followed = follows.as_ref().map(|name| number(&ours, source, name, "the source")).transpose()?;
            Ok((joint, followed))
        };
        Ok(Self { pairs: document.joints.iter().map(pair).collect::<Result<_, RigFileError>>()? })
    }
}
