//! Quadratic energies with a sparse matrix: assembled, factored, solved many times.
//!
//! ```text
//! E(x) = Σᵣ wᵣ |Σⱼ aᵣⱼ xⱼ − bᵣ|²      Σᵣ wᵣ aᵣᴴ aᵣ x = Σᵣ wᵣ aᵣᴴ bᵣ
//! ```
//!
//! | energy | its matrix | who minimizes it |
//! | --- | --- | --- |
//! | [`ConstrainedLaplacian`] | fixed; hard and soft constraints; many right-hand sides | deformation, skin weights, morphing |
//! | [`QuadraticEnergy`] | fixed pattern, values refilled before every solve without an allocation | image warps, retargeting, rectangling |
//! | [`BorderedEnergy`] | the same, with a few unknowns that rows of many elements share | rectifying |
//!
//! [`Convergence`] says when an iteration over such solves stops, [`Loss`] what outliers cost. Energies that are not quadratic are
//! minimized by [`crate::optim`].

mod bordered;
mod convergence;
mod error;
mod laplacian;
mod loss;
mod quadratic;

pub use crate::sparse::{Complex, Ordering, Scalar};
pub use bordered::BorderedEnergy;
pub use convergence::Convergence;
pub use error::EnergyError;
pub use laplacian::{ConstrainedLaplacian, FIXED, FactoredLaplacian};
pub use loss::Loss;
pub use quadratic::QuadraticEnergy;
