//! What a sparse solve can refuse.

/// A connected part of the graph whose edges are the non-zero entries of a matrix.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Component {
    /// Its unknowns, ascending.
    pub unknowns: Vec<usize>,
}

impl std::fmt::Display for Component {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let first = self.unknowns.first().copied().unwrap_or(0);
        write!(f, "component of {} unknown(s) that holds unknown {first}", self.unknowns.len())
    }
}

/// Why a sparse system could not be set up or factored.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SparseError {
    /// Numerics: the system leaves something free.
    #[error("the system is singular: the {component} is held by nothing; fix one of its unknowns or give it a weight")]
    Singular {
        /// The part of the system that contains the vanishing pivot.
        component: Component,
    },
    /// Numerics: some weight is negative, or the matrix was not assembled from squares.
    #[error("the matrix is not positive definite in the {component}; weights must not be negative")]
    NotPositiveDefinite {
        /// The part of the system that contains the negative pivot.
        component: Component,
    },
    /// Numerics: a matrix that is not positive definite, or not finite.
    #[error("elimination met no positive pivot at unknown {unknown}; damp the system or fix the unknown")]
    Pivot {
        /// The unknown.
        unknown: usize,
    },
    /// Input: a NaN or infinite entry.
    #[error("entry ({row}, {col}) of the matrix is not finite")]
    NotFinite {
        /// Row of the entry, ≥ `col`.
        row: usize,
        /// Column of the entry.
        col: usize,
    },
    /// Input: an index beyond the matrix.
    #[error("unknown {index} does not exist (the system has {unknowns}, numbered from 0)")]
    OutOfRange {
        /// The index that was asked for.
        index: usize,
        /// Number of unknowns.
        unknowns: usize,
    },
    /// Input: more unknowns or entries than 32-bit indices can number.
    #[error("the system is too large: {size} entries (at most 2147483647)")]
    TooLarge {
        /// Entries or unknowns asked for.
        size: usize,
    },
    /// Environment: the factor does not fit into memory.
    #[error("out of memory for the factor of {unknowns} unknowns")]
    OutOfMemory {
        /// Number of unknowns.
        unknowns: usize,
    },
}
