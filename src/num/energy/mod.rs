//! The energy core: sparse weighted least squares, factored once and solved many times.
//!
//! ```text
//! E(x) = Σᵣ wᵣ ‖Σⱼ aᵣⱼ xⱼ − bᵣ‖²      s.t.  x_f = c_f  for f in the fixed set
//! ```
//!
//! There are two doors. [`LeastSquares`] reads like the paper: residuals are expressions, unknowns are points of `D`
//! coordinates that act alike (or, for `D` = 1, scalars that terms may mix: [`PlaneExpr`]). [`QuadraticEnergy`] is the fast
//! one: coefficients go straight into a matrix whose pattern is known, nothing is allocated. They give the same minimizer.
//! [`BorderedEnergy`] adds to the fast one a few unknowns that rows of many elements share.
//!
//! Three things may change, each at its own price: targets `b` and fixed values `c` at every [`Factored::solve`], weights
//! at a [`Factored::reweight`] (one numeric factorization), the fixed *set* and the rows only with a new
//! [`LeastSquares::factor`]. [`LocalGlobal`] and [`Reweighted`] alternate the first two with a fit of the caller's or a
//! robust loss.

mod bordered;
mod error;
mod expr;
mod factored;
mod fixed;
mod least_squares;
mod local_global;
mod plane_expr;
mod quadratic;
mod robust;

pub use crate::sparse::{Complex, Ordering, Scalar};
pub use bordered::BorderedEnergy;
pub use error::EnergyError;
pub use expr::Expr;
pub use factored::{Factored, Targets};
pub use fixed::{FixedSet, FixedValues};
pub use least_squares::{LeastSquares, Term};
pub use local_global::{Convergence, LocalGlobal, Report};
pub use plane_expr::PlaneExpr;
pub use quadratic::QuadraticEnergy;
pub use robust::{Loss, Reweighted};

/// The value of one unknown: `D` coordinates.
pub type Value<const D: usize> = nalgebra::SVector<f64, D>;
