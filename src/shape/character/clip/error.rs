//! What a movement can be refused for.

use plumbline_num::options::OptionError;

/// Why a movement could not be made, or not be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ClipError {
    /// Input: a curve without keys, or with another number of values.
    #[error("{times} key times and {values} values: give at least one key, and one value for each")]
    Keys {
        /// Number of times.
        times: usize,
        /// Number of values, or of tangents.
        values: usize,
    },
    /// Input: key times that do not ascend, or are not finite.
    #[error("key {key} is at {time} s, after one at {before} s; times of keys must be finite and ascend")]
    Order {
        /// The key, numbered from 0.
        key: usize,
        /// Its time.
        time: f64,
        /// The time before it.
        before: f64,
    },
    /// Input: a value or a tangent with a number that is not finite, or a rotation without length.
    #[error("the value of key {key} is {what}")]
    Value {
        /// The key, numbered from 0.
        key: usize,
        /// What is wrong with it.
        what: &'static str,
    },
    /// Input: two tracks for the same.
    #[error("clip {clip:?} has two tracks for the {what} {number}")]
    TwiceMoved {
        /// Name of the clip.
        clip: String,
        /// What both move.
        what: &'static str,
        /// The joint or target.
        number: u32,
    },
    /// Input: a movement of another skeleton.
    #[error("clip {clip:?} moves {what} {number}, but there are {there}, numbered from 0")]
    Unknown {
        /// Name of the clip.
        clip: String,
        /// What it moves.
        what: &'static str,
        /// Its number.
        number: u32,
        /// How many there are.
        there: usize,
    },
    /// Settings: a rate, a speed or a span out of range.
    #[error(transparent)]
    Option(#[from] OptionError),
}
