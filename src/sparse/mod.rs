//! Sparse symmetric systems: storage, fill-reducing orderings, Cholesky factorization.
//!
//! Every energy of this crate ends in `A x = b` with `A` symmetric positive definite (Hermitian for complex unknowns),
//! whose *pattern* is known long before its values. The work is split accordingly: [`Pattern`] and [`Cholesky::analyze`]
//! once, [`Cholesky::factor`] whenever values change (no allocation), [`Cholesky::solve_in_place`] for each right-hand side.
//!
//! Matrices are stored as their lower triangle, compressed by columns, rows ascending, every diagonal entry present.
//! The factorization itself is faer's supernodal one, run on one thread: its threaded mode is slower at every size met
//! here. Orderings and elimination-tree postordering are our own. This is the only module that names faer.
//!
//! # Reference
//! T. A. Davis, *Direct Methods for Sparse Linear Systems*, SIAM 2006; A. George, *Nested dissection of a regular finite
//! element mesh*, SIAM J. Numer. Anal. 10 (1973); J. W. H. Liu, *The role of elimination trees in sparse factorization*,
//! SIAM J. Matrix Anal. Appl. 11 (1990).

mod banded;
mod cholesky;
mod compact;
mod condition;
mod constrained;
mod cuthill_mckee;
mod direct;
mod dissection;
mod error;
mod etree;
mod general;
mod iterative;
mod matrix;
mod normal_equations;
mod ordering;
mod pattern;
mod scalar;
mod sweep;
mod updated;
mod wide_registers;

pub use banded::BandedMatrix;
pub use cholesky::Cholesky;
pub use compact::CompactFactor;
pub use condition::{Refinement, backward_error, inverse_norm_1};
pub use constrained::{Constrained, Eliminated, Multipliers};
pub use direct::{Factor, Method};
pub use error::{Component, SparseError};
pub use general::{GeneralMatrix, SparseBuilder};
pub use iterative::{
    GaussSeidel, IncompleteCholesky, IterativeReport, Jacobi, Plain, Preconditioner, Stop, conjugate_gradients,
};
pub use matrix::SparseMatrix;
pub use normal_equations::NormalEquations;
pub use ordering::{Ordering, Permutation};
pub use pattern::Pattern;
pub use scalar::{Complex, Scalar};
pub use updated::Updated;
