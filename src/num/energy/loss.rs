//! Robust losses: what outliers may cost.
//!
//! ```text
//! E(x) = Σₖ wₖ ρ(‖rₖ(x)‖²),      reweighted: wₖ ρ'(‖rₖ‖²) ‖rₖ(x)‖²
//! ```
//!
//! `ρ` is concave in the squared residual, so each reweighted quadratic is above `E` and touches it at the present `x`: with the
//! weight `ρ'` of the last iterate, `E` never rises. Geman–McClure is not convex; it needs an initial guess near the solution.
//!
//! # Reference
//! P. W. Holland, R. E. Welsch, *Robust regression using iteratively reweighted least-squares*, Comm. Statist. 6 (1977);
//! losses as in Ceres.

/// `ρ(s)` of a squared residual `s`; the parameter is a residual length, in the unit of the residual, > 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Loss {
    /// `s` up to `k²`, then `2k√s − k²`: outliers pull with constant force.
    Huber(f64),
    /// `c² ln(1 + s/c²)`: outliers pull ever less.
    Cauchy(f64),
    /// `c² s / (c² + s)`: outliers hardly pull at all.
    GemanMcClure(f64),
}

impl Loss {
    /// `ρ(s)`, with `ρ(s) ≈ s` for small `s`.
    pub fn value(self, s: f64) -> f64 {
        match self {
            Self::Huber(k) if s <= k * k => s,
            Self::Huber(k) => 2.0 * k * s.sqrt() - k * k,
            Self::Cauchy(c) => c * c * (s / (c * c)).ln_1p(),
            Self::GemanMcClure(c) => c * c * s / (c * c + s),
        }
    }

    /// `ρ'(s)`, in (0, 1].
    pub fn weight(self, s: f64) -> f64 {
        match self {
            Self::Huber(k) if s <= k * k => 1.0,
            Self::Huber(k) => k / s.sqrt(),
            Self::Cauchy(c) => 1.0 / (1.0 + s / (c * c)),
            Self::GemanMcClure(c) => (c * c / (c * c + s)).powi(2),
        }
    }
}
