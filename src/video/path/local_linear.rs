//! Weights of local linear regression: its value at 0 is a weighted sum of the samples.
//!
//! ```text
//! α = Σ_k κ_k y_k,      κ_k = g_k (s₂ − s₁ u_k) / (s₀ s₂ − s₁²),      g_k = e^{−u_k²/2},   s_n = Σ_k g_k u_kⁿ
//! ```
//!
//! with `(α, β) = argmin Σ g_k (y_k − α − β u_k)²`, so that a straight line is reproduced, also from samples on one side.
//!
//! # Reference
//! W. S. Cleveland: *Robust locally weighted regression and smoothing scatterplots*, JASA 74, 1979.

/// `κ` of samples at the offsets `u`, in standard deviations of the kernel; the weighted mean where all offsets are equal.
pub(super) fn local_linear_weights(u: &[f64]) -> Vec<f64> {
    let g = |u: f64| (-0.5 * u * u).exp();
    let moment = |n: i32| u.iter().map(|&u| g(u) * u.powi(n)).sum::<f64>();
    let (s0, s1, s2) = (moment(0), moment(1), moment(2));
    let det = s0 * s2 - s1 * s1;
    let weight = |u: f64| if det > 1e-12 * s0 * s0 { g(u) * (s2 - s1 * u) / det } else { g(u) / s0 };
    u.iter().map(|&u| weight(u)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_gives_its_value_from_one_side_too() {
        for u in [vec![-2.0, -1.0, 0.0, 0.5, 2.0], vec![0.0, 0.3, 1.0, 1.7], vec![0.0]] {
            let weights = local_linear_weights(&u);
            let at = |a: f64, b: f64| weights.iter().zip(&u).map(|(w, u)| w * (a + b * u)).sum::<f64>();
            assert!((at(3.0, -2.0) - 3.0).abs() < 1e-12, "{u:?}");
        }
    }
}
