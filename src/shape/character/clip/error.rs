//! Errors of clips.

use plumbline_num::options::OptionError;

/// Why a clip could not be made or used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ClipError {
    /// Input: a curve without keys, or with a different number of values.
    #[error("{times} key times and {values} values: give at least one key, and one value for each")]
    Keys {
        /// Number of times.
        times: usize,
        /// Number of values or tangents.
        values: usize,
    },
    /// Input: key times that are not strictly increasing or not finite.
    #[error("key {key} is at {time} s, after one at {before} s; times of keys must be finite and ascend")]
    Order {
        /// The key, from 0.
        key: usize,
        /// Its time, s.
        time: f64,
        /// The time of the key before, s.
        before: f64,
    },
    /// Input: a key value or tangent that is not finite, or a quaternion of length zero.
    #[error("the value of key {key} is {what}")]
    Value {
        /// The key, from 0.
        key: usize,
        /// Why it is invalid.
        what: &'static str,
    },
    /// Input: two tracks for one property.
    #[error("clip {clip:?} has two tracks for the {what} {number}")]
    TwiceMoved {
        /// Name of the clip.
        clip: String,
        /// The property.
        what: &'static str,
        /// Index of the joint or morph target.
        number: u32,
    },
    /// Input: a track for a joint or morph target that does not exist.
    #[error("clip {clip:?} moves {what} {number}, but there are {there}, numbered from 0")]
    Unknown {
        /// Name of the clip.
        clip: String,
        /// Kind of the target.
        what: &'static str,
        /// Its index.
        number: u32,
        /// Number of joints or morph targets.
        there: usize,
    },
    /// Settings: a rate, speed or time span out of range.
    #[error(transparent)]
    Option(#[from] OptionError),
}
