//! Real polynomials: values, and the first sign change above zero.
//!
//! Roots are separated by those of the derivative: between two neighbors the polynomial is monotone, so that a change of sign
//! at the ends means one root, found by bisection. Nothing can be missed or counted twice, whatever the coefficients.

pub(super) use plumbline_num::math::polynomial::{value, value_and_slope};

/// Coefficients of the derivative.
pub(super) fn derivative(c: &[f64]) -> Vec<f64> {
    c.iter().enumerate().skip(1).map(|(i, c)| i as f64 * c).collect()
}

/// Coefficients of the product.
pub(super) fn product(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut c = vec![0.0; (a.len() + b.len()).saturating_sub(1)];
    for (i, a) in a.iter().enumerate() {
        for (j, b) in b.iter().enumerate() {
            c[i + j] += a * b;
        }
    }
    c
}

/// First `x` in `(0, limit]` beyond which the polynomial, positive at 0, is no longer positive; `limit` where it stays so
/// and 0 where it does not start so (NaN among the coefficients included).
pub(super) fn positive_up_to(c: &[f64], limit: f64) -> f64 {
    if !c.iter().all(|c| c.is_finite()) || !(value(c, 0.0) > 0.0) {
        return 0.0;
    }
    sign_changes(c, limit).first().copied().unwrap_or(limit)
}

/// Places in `(0, limit)` where the polynomial changes its sign, ascending.
fn sign_changes(c: &[f64], limit: f64) -> Vec<f64> {
    if c.len() < 2 {
        return Vec::new();
    }
    let mut ends = sign_changes(&derivative(c), limit);
    ends.push(limit);
    let (mut from, mut changes) = (0.0, Vec::new());
    for to in ends {
        if (value(c, from) > 0.0) != (value(c, to) > 0.0) {
            changes.push(bisected(c, from, to));
        }
        from = to;
    }
    changes
}

/// The sign change between `low` and `high`, to double precision.
fn bisected(c: &[f64], mut low: f64, mut high: f64) -> f64 {
    let sign = value(c, low) > 0.0;
    loop {
        let middle = 0.5 * (low + high);
        if !(low < middle && middle < high) {
            return low;
        }
        if (value(c, middle) > 0.0) == sign {
            low = middle;
        } else {
            high = middle;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_root_is_found_however_close_the_next_one_is() {
        for (a, b) in [(0.3, 0.300_001), (0.3, 2.5), (1e-6, 1.0)] {
            let c = product(&product(&[a, -1.0], &[b, -1.0]), &[3.0, 0.2, 1.0]);
            assert!((positive_up_to(&c, 10.0) - a).abs() < 1e-9, "{a} {b}");
        }
    }

    #[test]
    fn touching_zero_is_no_sign_change_and_no_root_means_the_limit() {
        assert_eq!(positive_up_to(&[1.0, 0.0, 1.0], 7.0), 7.0);
        assert_eq!(positive_up_to(&[1.0, -0.1], 7.0), 7.0);
        assert_eq!(positive_up_to(&[1.0], 7.0), 7.0);
    }

    #[test]
    fn what_does_not_start_positive_has_no_range() {
        for c in [&[-1.0, 5.0][..], &[0.0, 1.0], &[f64::NAN], &[1.0, f64::INFINITY], &[]] {
            assert_eq!(positive_up_to(c, 7.0), 0.0);
        }
    }

    #[test]
    fn the_slope_is_that_of_the_derivative() {
        let c = [0.5, -2.0, 0.25, 1.5];
        let (v, s) = value_and_slope(&c, 0.7);
        assert!((v - value(&c, 0.7)).abs() < 1e-15 && (s - value(&derivative(&c), 0.7)).abs() < 1e-15);
    }
}
