//! Inverses of increasing functions, by Newton's method kept inside a bracket.

/// Maximum number of iterations. Newton takes four to six; 60 bisections exhaust a double.
const MAX_STEPS: usize = 80;

/// Relative step at which the iteration ends: Newton's next step would be its square, times a curvature far below 10⁴
/// except at a fold.
const SMALL_STEP: f64 = 1e-10;

/// `x` in `[0, limit]` with `f(x) = target`, for `f` increasing on it with `f(0) = 0`; `function` returns `(f, f′)`.
/// `None` if `target` is outside `[0, f(limit)]` or NaN.
pub(super) fn increasing(target: f64, limit: f64, start: f64, function: impl Fn(f64) -> (f64, f64)) -> Option<f64> {
    if !(target >= 0.0 && limit > 0.0 && target <= function(limit).0) {
        return None;
    }
    let (mut low, mut high) = (0.0, limit);
    let mut x = if start > 0.0 && start < limit { start } else { 0.5 * limit };
    for _ in 0..MAX_STEPS {
        let (value, slope) = function(x);
        let miss = value - target;
        if miss > 0.0 {
            high = x;
        } else {
            low = x;
        }
        let newton = x - miss / slope;
        let next = if newton >= low && newton <= high { newton } else { 0.5 * (low + high) };
        if (next - x).abs() <= SMALL_STEP * x.abs() {
            return Some(next);
        }
        x = next;
    }
    Some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_is_found_from_any_start() {
        let cubic = |x: f64| (x - x * x * x / 3.0, 1.0 - x * x);
        for start in [0.0, 1e-9, 0.5, 0.999, 1.0, f64::NAN] {
            for x in [1e-12, 0.2, 0.9, 0.9999] {
                let found = increasing(cubic(x).0, 1.0, start, cubic).expect("on the branch");
                assert!((found - x).abs() < 1e-10 * (1.0 + 1e-3 / (1.0 - x)), "{start} {x} {found}");
            }
        }
    }

    #[test]
    fn values_beyond_the_branch_have_no_inverse() {
        let cubic = |x: f64| (x - x * x * x / 3.0, 1.0 - x * x);
        for target in [-0.1, 0.7, f64::NAN, f64::INFINITY] {
            assert_eq!(increasing(target, 1.0, 0.5, cubic), None);
        }
        assert_eq!(increasing(0.0, 0.0, 0.5, cubic), None);
    }
}
