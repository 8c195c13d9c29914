//! Model selection between models of different dimension: the geometric robust information criterion (GRIC, Torr).
//!
//! ```text
//! GRIC = Σᵢ min(rᵢ²/σ², λ₃ (4 − d)) + λ₁ d n + λ₂ k,     λ₁ = ln 4, λ₂ = ln 4n, λ₃ = 2.
//! ```
//!
//! `d` is the dimension of the model's manifold in the four-dimensional space of pair coordinates, `k` the number of
//! its parameters. The model of lowest score is selected; scores are comparable only under one `σ`.
//!
//! # Reference
//! P. Torr, *Bayesian model estimation and selection for epipolar geometry and generic manifold fitting*, IJCV 50(1), 2002.

/// Size of a model: dimension of its manifold of pairs, number of parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ModelSize {
    /// `d`.
    pub dimension: u32,
    /// `k`.
    pub parameters: u32,
}

impl ModelSize {
    /// A homography.
    pub const HOMOGRAPHY: Self = Self { dimension: 2, parameters: 8 };
    /// The homography of a rotating camera with unknown focal length.
    pub const ROTATION: Self = Self { dimension: 2, parameters: 4 };
    /// An essential matrix.
    pub const ESSENTIAL: Self = Self { dimension: 3, parameters: 5 };
    /// A fundamental matrix.
    pub const FUNDAMENTAL: Self = Self { dimension: 3, parameters: 7 };
}

/// The score of a model with squared residuals `squared` and noise of standard deviation `sigma` per coordinate.
pub fn gric(squared: impl IntoIterator<Item = f64>, sigma: f64, size: ModelSize) -> f64 {
    let d = f64::from(size.dimension);
    let (cap, inverse) = (2.0 * (4.0 - d), 1.0 / (sigma * sigma));
    let (mut sum, mut n) = (0.0, 0.0);
    for r in squared {
        // NaN counts as an outlier.
        sum += (r * inverse).min(cap);
        n += 1.0;
    }
    sum + 4.0_f64.ln() * d * n + (4.0 * n).ln() * f64::from(size.parameters)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_two_models_with_equal_residuals_the_smaller_wins() {
        let zeros = || std::iter::repeat_n(0.0, 100);
        let sizes = [ModelSize::ROTATION, ModelSize::HOMOGRAPHY, ModelSize::ESSENTIAL, ModelSize::FUNDAMENTAL];
        let scores = sizes.map(|size| gric(zeros(), 1.0, size));
        assert!(scores.is_sorted(), "{scores:?}");
    }

    #[test]
    fn an_outlier_costs_no_more_than_the_cap_and_neither_does_nan() {
        let with = |r: f64| gric([r], 1.0, ModelSize::ESSENTIAL) - gric([0.0], 1.0, ModelSize::ESSENTIAL);
        assert_eq!([with(1e9), with(f64::NAN), with(f64::INFINITY)].map(|c| (c * 1e9).round() / 1e9), [2.0; 3]);
    }
}
