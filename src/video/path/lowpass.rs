//! Gaussian low-pass of a signal that keeps linear trends exactly, to its very ends.

/// The signal convolved with a Gaussian of `sigma` samples, truncated at four sigma; unchanged for `sigma` below 0.3 samples,
/// where the neighbors weigh less than 0.4 %.
///
/// Beyond its ends the signal is continued by point reflection, `x₋ₖ = 2x₀ − xₖ`, so a straight line stays that line.
pub fn lowpass(x: &[f64], sigma: f64) -> Vec<f64> {
    let (&[first, .., last], true) = (x, sigma >= 0.3) else { return x.to_vec() };
    let (n, kernel) = (x.len(), half_kernel(sigma));
    let before = |i: usize, k: usize| if k <= i { x[i - k] } else { 2.0 * first - x[(k - i).min(n - 1)] };
    let after = |i: usize, k: usize| {
        if i + k < n { x[i + k] } else { 2.0 * last - x[(2 * (n - 1)).saturating_sub(i + k)] }
    };
    (0..n)
        .map(|i| {
            let sides = kernel.iter().enumerate().skip(1);
            kernel[0] * x[i] + sides.map(|(k, w)| w * (before(i, k) + after(i, k))).sum::<f64>()
        })
        .collect()
}

/// Weights at distance 0, 1, 2, …; the whole, symmetric kernel sums to one.
pub(super) fn half_kernel(sigma: f64) -> Vec<f64> {
    let reach = (4.0 * sigma + 1.0) as usize;
    let mut w: Vec<f64> = (0..=reach).map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp()).collect();
    let total = w[0] + 2.0 * w[1..].iter().sum::<f64>();
    for v in &mut w {
        *v /= total;
    }
    w
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_line_stays_itself() {
        let line: Vec<f64> = (0..40).map(|i| 3.0 - 0.7 * f64::from(i)).collect();
        for (a, b) in line.iter().zip(lowpass(&line, 5.0)) {
            assert!((a - b).abs() < 1e-12, "{a} became {b}");
        }
    }

    #[test]
    fn a_sine_is_damped_by_the_gaussian_transfer_function() {
        let (sigma, omega) = (4.0_f64, 0.3_f64);
        let sine: Vec<f64> = (0..400).map(|i| (omega * f64::from(i)).sin()).collect();
        let gain = (-0.5 * (sigma * omega).powi(2)).exp();
        let low = lowpass(&sine, sigma);
        for i in 100..300 {
            assert!((low[i] - gain * sine[i]).abs() < 1e-3, "sample {i}: {} against {}", low[i], gain * sine[i]);
        }
    }
}
