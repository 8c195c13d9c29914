//! What a sparse solve can refuse.

use crate::limits::{Resource, Shortage};
use crate::run::Stopped;

/// A connected part of the graph whose edges are the non-zero entries of a matrix.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Component {
    /// Its unknowns, ascending.
    pub unknowns: Vec<usize>,
}

impl std::fmt::Display for Component {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let first = self.unknowns.first().copied().unwrap_or(0);
        write!(f, "component of {} unknown(s) that contains unknown {first}", self.unknowns.len())
    }
}

/// Why a sparse system could not be set up or factored.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SparseError {
    /// Numerics: the system leaves something free.
    #[error("the system is singular: the {component} has no constraint; fix one of its unknowns or give it a weight")]
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
    /// Numerics: a row taken away weighs as much as the matrix has in that direction, or more.
    #[error(
        "subtracting row {row} (of the rows subtracted, numbered from 0) leaves the matrix not positive definite in the \
         {component}; give the row smaller values or leave it out"
    )]
    Subtracted {
        /// Its number among the rows taken away, from 0.
        row: usize,
        /// The part of the system that has no minimum.
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
        /// What there is too little of.
        source: Shortage,
    },
    /// Input: a factorization beyond what its caller allows.
    #[error(
        "the factorization would take {flops:.0e} multiplications (at most {most:.0e} for a system of this size): too many unknowns depend on \
         one another (unknown {unknown} on {neighbors} others), as where hundreds of triangles meet at single vertices, or join them at \
         random; remesh, or solve a smaller part"
    )]
    TooDense {
        /// Multiplications that it takes, or a lower bound.
        flops: f64,
        /// Multiplications allowed.
        most: f64,
        /// The unknown that depends on the most others directly.
        unknown: usize,
        /// How many these are.
        neighbors: usize,
    },
    /// Input: an entry beyond the shape of its matrix.
    #[error("entry ({row}, {col}) is outside the {rows}×{columns} matrix (numbered from 0)")]
    OutOfBounds {
        /// Row of the entry.
        row: usize,
        /// Column of the entry.
        col: usize,
        /// Rows of the matrix.
        rows: usize,
        /// Columns of the matrix.
        columns: usize,
    },
    /// Input: a method for square matrices was given another.
    #[error("the matrix is {rows}×{columns}, not square: use QR or the normal equations")]
    NotSquare {
        /// Rows of the matrix.
        rows: usize,
        /// Columns of the matrix.
        columns: usize,
    },
    /// Input: fewer equations than unknowns.
    #[error("{rows} equations do not determine {columns} unknowns: add rows, or solve for the transposed matrix")]
    Underdetermined {
        /// Rows of the matrix.
        rows: usize,
        /// Columns of the matrix.
        columns: usize,
    },
    /// Input: a method for symmetric matrices was given another.
    #[error("the matrix is not symmetric: entry ({row}, {col}) differs from its mirror image; use LU")]
    NotSymmetric {
        /// Row of the entry.
        row: usize,
        /// Column of the entry.
        col: usize,
    },
    /// Input: right-hand sides that do not fit the matrix.
    #[error("{given} values are not whole columns of {expected}")]
    Columns {
        /// Values given.
        given: usize,
        /// Values of one column.
        expected: usize,
    },
    /// Input: a weight that is negative or not finite.
    #[error("row {row} has weight {weight} (expected a finite number, 0 or more)")]
    Weight {
        /// The row.
        row: usize,
        /// Its weight.
        weight: f64,
    },
    /// Numerics: no digit of a solution would be right.
    #[error("the matrix is singular to working precision: unknown {unknown} is among those that nothing determines")]
    Undetermined {
        /// The unknown with the largest part in what is left free.
        unknown: usize,
    },
    /// Input: a Matrix Market file that is not one, or not of a kind that is read.
    #[error("line {line}: {problem}")]
    MatrixMarket {
        /// Line of the file, from 1.
        line: usize,
        /// What is wrong, and what is expected.
        problem: String,
    },
    /// The run was interrupted, or its time is used up.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}

impl SparseError {
    /// Too little memory for a factor.
    pub(crate) fn out_of_memory(unknowns: usize) -> Self {
        Self::OutOfMemory { unknowns, source: Shortage(Resource::Memory) }
    }

    /// The same fault of a system from which row `row` was taken away.
    pub(crate) fn subtracting(self, row: usize) -> Self {
        match self {
            Self::Singular { component } | Self::NotPositiveDefinite { component } => {
                Self::Subtracted { row, component }
            }
            other => other,
        }
    }

    /// The same fault, its unknowns named by `old[k]` instead of `k`.
    pub(crate) fn renumbered(mut self, old: &[u32]) -> Self {
        if let Self::Singular { component } | Self::NotPositiveDefinite { component } = &mut self {
            component.unknowns.iter_mut().for_each(|k| *k = old[*k] as usize);
        } else if let Self::TooDense { unknown, .. } = &mut self {
            *unknown = old[*unknown] as usize;
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn too_little_memory_is_known_by_its_type_and_not_by_its_words() {
        let factor = SparseError::out_of_memory(7);
        assert_eq!(Shortage::of(&factor), Some(Shortage(Resource::Memory)));
        assert_eq!(Shortage::in_text(&factor.to_string()), None);
        assert_eq!(Shortage::of(&SparseError::Pivot { unknown: 7 }), None);
    }
}
