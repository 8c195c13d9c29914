//! Sparse linear systems: storage, fill-reducing orderings, factorizations, iterative solvers.
//!
//! Every energy of this crate ends in `A x = b` with `A` symmetric positive definite (Hermitian for complex unknowns),
//! whose *pattern* is known long before its values. The work is split accordingly: [`Pattern`] and [`Cholesky::analyze`]
//! once, [`Cholesky::factor`] whenever values change (no allocation), [`Cholesky::solve_in_place`] for each right-hand side,
//! or, where there are many of them, [`CompactFactor`].
//!
//! For matrices of any kind a [`SparseBuilder`] collects entries, [`GeneralMatrix::factor`] finds the
//! factorization that fits ([`Method`]), [`GeneralMatrix::factor_ata`] solves weighted least squares, [`Eliminated`] and
//! [`Multipliers`] impose constraints, [`Updated`] adds and removes them, [`conjugate_gradients`] does without a factor.
//! [`Factor::condition`] and [`Factor::refine`] say how far a solution can be trusted.
//!
//! Symmetric matrices are stored as their lower triangle, compressed by columns, rows ascending, every diagonal entry present.
//! Factorizations are multifrontal ones of our own, large fronts going through faer's dense products, on one thread: its
//! threaded mode is slower at every size met here. Of faer there are besides the minimum-degree orderings only. This is the only
//! module that names it.
//!
//! # Reference
//! T. A. Davis, *Direct Methods for Sparse Linear Systems*, SIAM 2006; A. George, *Nested dissection of a regular finite
//! element mesh*, SIAM J. Numer. Anal. 10 (1973); J. W. H. Liu, *The role of elimination trees in sparse factorization*,
//! SIAM J. Matrix Anal. Appl. 11 (1990).

mod banded;
mod block_matrix;
mod blocks;
mod cholesky;
mod compact;
mod condition;
mod constrained;
mod cuthill_mckee;
mod direct;
mod dissection;
mod error;
mod etree;
mod front;
mod general;
mod inner_products;
mod iterative;
mod matrix;
mod matrix_market;
mod multifrontal;
mod normal_equations;
mod ordering;
mod pattern;
mod permuted;
mod scalar;
mod structure;
mod sweep;
mod updated;
mod wide_registers;

pub use banded::BandedMatrix;
pub use block_matrix::{BlockGaussSeidel, BlockMatrix};
pub use cholesky::Cholesky;
pub use compact::CompactFactor;
pub use condition::{Refinement, backward_error, inverse_norm_1};
pub use constrained::{Constrained, Eliminated, Multipliers};
pub use direct::{Factor, Method};
pub use error::{Component, SparseError};
pub use general::{GeneralMatrix, SparseBuilder};
pub(crate) use inner_products::subtract_inner_products;
pub use iterative::{
    GaussSeidel, IncompleteCholesky, IterativeReport, Jacobi, Plain, Preconditioner, Stop, SymmetricOperator,
    conjugate_gradients,
};
pub use matrix::SparseMatrix;
pub use matrix_market::{read_matrix_market, write_matrix_market};
pub use normal_equations::NormalEquations;
pub use ordering::{Ordering, Permutation};
pub use pattern::Pattern;
pub use scalar::{Complex, Scalar};
pub use structure::FactorStructure;
pub use sweep::Stored;
pub use updated::Updated;
