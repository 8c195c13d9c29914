//! Weight files:
//!
//! ```json
//! { "format": "plumbline.weights", "version": 1,
//!   "joints": ["hip", "knee"],
//!   "rows": [[0, 1], [0, 0.7, 1, 0.3]] }
//! ```
//!
//! One row per vertex, in the order of the mesh file: pairs of a joint index (into `joints`, from 0) and its weight. Rows sum to one.
//! Joints are matched to a skeleton by name. Unknown keys are rejected.

use std::fmt::Write as _;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{CharacterError, RigFileError, Skeleton, SkinWeights};
use plumbline_num::document::Kind;

/// Size limit: eight influences for each of two million vertices.
const KIND: Kind = Kind { name: "a file of weights", format: "plumbline.weights", max_bytes: 1 << 29 };

/// Skin weights and the names of their joints.
#[derive(Clone, Debug, PartialEq)]
pub struct WeightsFile {
    /// Names of the joints, by index.
    pub joints: Vec<String>,
    /// The weights.
    pub weights: SkinWeights,
}

/// Skin weights of a mesh.
#[derive(Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct Document {
    /// Always `plumbline.weights`.
    format: String,
    /// Always 1.
    version: u64,
    /// Names of joints.
    #[serde(default)]
    joints: Vec<String>,
    /// Per vertex: pairs of a joint index and its weight, flattened.
    #[serde(default)]
    rows: Vec<Vec<f64>>,
}

/// The JSON schema of weight files.
#[cfg(feature = "schema")]
pub fn weights_file_schema() -> schemars::Schema {
    schemars::schema_for!(Document)
}

impl WeightsFile {
    /// Weights of a skeleton with all its joint names.
    ///
    /// # Errors
    /// [`CharacterError::Input`] if the numbers of joints differ.
    pub fn of(skeleton: &Skeleton, weights: &SkinWeights) -> Result<Self, CharacterError> {
        CharacterError::check_pose(weights.joint_count(), skeleton.joint_count())?;
        let joints = skeleton.joints().iter().map(|j| j.name.clone()).collect();
        Ok(Self { joints, weights: weights.clone() })
    }

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
    /// [`RigFileError`]: not this format or version, malformed rows, weights that do not sum to one.
    pub fn parse(text: &str) -> Result<Self, RigFileError> {
        let document: Document = KIND.parse(text)?;
        let joints = document.joints.len();
        let rows = document.rows.iter().enumerate().map(|(row, numbers)| influences(row, numbers, joints));
        let rows: Vec<Vec<(u32, f64)>> = rows.collect::<Result<_, _>>()?;
        Ok(Self { weights: SkinWeights::new(joints, rows)?, joints: document.joints })
    }

    /// The document as text; [`Self::parse`] restores it bit for bit.
    pub fn to_json(&self) -> String {
        let names = serde_json::to_string(&self.joints).expect("strings");
        let mut text =
            format!("{{\n\"format\": \"{}\", \"version\": 1,\n\"joints\": {names},\n\"rows\": [\n", KIND.format);
        for (v, row) in self.weights.rows().enumerate() {
            let separator = if v == 0 { "[" } else { ",\n[" };
            text.push_str(separator);
            for (k, i) in row.iter().enumerate() {
                let comma = if k == 0 { "" } else { ", " };
                write!(text, "{comma}{}, {}", i.joint, i.weight).expect("a string takes everything");
            }
            text.push(']');
        }
        text.push_str("\n]}\n");
        text
    }

    /// The weights indexed by the joints of a skeleton, matched by name. Joints without influence may be missing from the skeleton.
    ///
    /// # Errors
    /// [`CharacterError::Input`] for a joint that the skeleton does not have.
    pub fn for_skeleton(&self, skeleton: &Skeleton) -> Result<SkinWeights, CharacterError> {
        let mut followed = vec![false; self.joints.len()];
        self.weights.rows().flatten().for_each(|i| followed[i.joint as usize] = true);
        let number = |(name, followed): (&String, bool)| if followed { skeleton.named(name) } else { Ok(0) };
        let numbers: Vec<u32> = self.joints.iter().zip(followed).map(number).collect::<Result<_, _>>()?;
        let row =
            |row: &[super::Influence]| row.iter().map(|i| (numbers[i.joint as usize], i.weight)).collect::<Vec<_>>();
        SkinWeights::new(skeleton.joint_count(), self.weights.rows().map(row))
    }
}

/// Splits a row into pairs of a joint index and its weight.
fn influences(row: usize, numbers: &[f64], joints: usize) -> Result<Vec<(u32, f64)>, RigFileError> {
    let refused = |what: String| {
        let expected = format!("pairs of a joint index, 0 to {}, and its weight", joints.saturating_sub(1));
        RigFileError::Content(format!("row {row}: {what} (expected {expected})"))
    };
    let (pairs, rest) = numbers.as_chunks::<2>();
    if !rest.is_empty() {
        return Err(refused(format!("{} numbers", numbers.len())));
    }
    let pair = |&[joint, weight]: &[f64; 2]| {
        if joint.fract() == 0.0 && joint >= 0.0 && joint < joints as f64 {
            Ok((joint as u32, weight))
        } else {
            Err(refused(format!("joint {joint}")))
        }
    };
    pairs.iter().map(pair).collect()
}

#[cfg(test)]
mod tests {
    use super::super::Joint;
    use super::*;
    use plumbline_num::math::Trs;

    const TEXT: &str = r#"{"format": "plumbline.weights", "version": 1, "joints": ["hip", "knee", "toe"],
        "rows": [[0, 1], [1, 0.7, 0, 0.3]]}"#;

    fn skeleton(names: &[&str]) -> Skeleton {
        let joint = |n: &&str| Joint { name: (*n).into(), parent: None, rest: Trs::identity(), limits: None };
        Skeleton::new(names.iter().map(joint).collect()).expect("a forest")
    }

    #[test]
    fn a_round_trip_is_bit_exact_and_joints_are_matched_by_name() {
        let file = WeightsFile::parse(TEXT).expect("valid");
        assert_eq!(WeightsFile::parse(&file.to_json()).expect("valid"), file);
        let thirds = SkinWeights::new(3, [vec![(0, 1.0 / 3.0), (1, 2.0 / 3.0)]]).expect("sums to 1");
        let of = WeightsFile::of(&skeleton(&["a", "b", "c"]), &thirds).expect("three joints");
        assert_eq!(WeightsFile::parse(&of.to_json()).expect("valid").weights, thirds);
        // The toe has no influence: the skeleton does not need it.
        let weights = file.for_skeleton(&skeleton(&["knee", "hip"])).expect("found");
        assert_eq!((weights.weight(1, 0), weights.weight(1, 1), weights.weight(0, 1)), (0.7, 0.3, 1.0));
        let message = file.for_skeleton(&skeleton(&["hip", "kneel"])).expect_err("no knee").to_string();
        assert!(message.contains("no joint \"knee\"; did you mean \"kneel\"?"), "{message}");
    }

    #[test]
    fn errors_name_the_row_and_the_value() {
        let cases = [
            ("plumbline.weights", "plumbline.skeleton", "not a file of weights"),
            ("\"version\": 1", "\"version\": 2", "version 2"),
            ("0.7, 0", "0.7, 3", "row 1: joint 3 (expected pairs of a joint index, 0 to 2"),
            ("0.7, 0", "0.7, 0.5", "row 1: joint 0.5"),
            ("[0, 1]", "[0]", "row 0: 1 numbers"),
            ("0.3]", "0.4]", "vertex 1 sum to 1.1"),
            ("[0, 1]", "[]", "1 vertices have no weight"),
            ("rows", "raws", "unknown field `raws`"),
        ];
        for (from, to, expected) in cases {
            let message = WeightsFile::parse(&TEXT.replace(from, to)).expect_err(to).to_string();
            assert!(message.contains(expected), "{to}: {message}");
        }
    }
}
