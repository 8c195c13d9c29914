//! The energy core: sparse weighted least squares, factored once and solved many times.
//!
//! ```text
//! E(x) = Σᵣ wᵣ ‖Σⱼ aᵣⱼ xⱼ − bᵣ‖²      s.t.  x_f = c_f  for f in the fixed set
//! ```

mod error;
mod quadratic;

pub use crate::sparse::{Complex, Ordering, Scalar};
pub use error::EnergyError;
pub use quadratic::QuadraticEnergy;
