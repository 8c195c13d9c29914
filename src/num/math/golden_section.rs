//! Minimum of a function of one variable.
//!
//! # Reference
//! J. Kiefer, *Sequential minimax search for a maximum*, Proc. AMS 4, 1953.

/// Steps: each shrinks the interval to 0.618 of its length, all of them to a 10⁻⁸th.
const STEPS: usize = 40;

/// Place of the minimum of a unimodal function between `low` and `high`.
pub fn golden_section(cost: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut a, mut b) = (high - ratio * (high - low), low + ratio * (high - low));
    let (mut at_a, mut at_b) = (cost(a), cost(b));
    for _ in 0..STEPS {
        if at_a < at_b {
            (high, b, at_b) = (b, a, at_a);
            a = high - ratio * (high - low);
            at_a = cost(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + ratio * (high - low);
            at_b = cost(b);
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_minimum_is_found_inside_and_at_the_ends() {
        assert!((golden_section(|x| (x - 0.3).powi(2), -1.0, 2.0) - 0.3).abs() < 1e-7);
        assert!((golden_section(|x| x, -1.0, 2.0) + 1.0).abs() < 1e-7);
    }
}
