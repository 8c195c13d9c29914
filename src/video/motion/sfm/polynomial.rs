//! Real roots of polynomials of low degree.
//!
//! Between two adjacent roots of `p′` a polynomial `p` is monotone: it has one root there or none, decided by the
//! signs at both ends. Proceeding degree by degree from the last derivative upwards, this brackets all roots of `p`
//! without polynomial division, and Newton's method inside each bracket converges to the last digit. Roots outside
//! `[−1, 1]` are the inverses of the roots of the reversed polynomial inside, which avoids overflow.
//!
//! # Reference
//! C. Yuksel, *High-Performance Polynomial Root Finding for Graphics*, HPG 2022.

use plumbline_num::math::polynomial::{value, value_and_slope};

/// Maximum degree supported by [`real_roots`].
pub(super) const MAX_DEGREE: usize = 10;

/// Maximum number of Newton steps per bracket; a step that does not halve the bracket is replaced by a bisection.
const MAX_STEPS: usize = 80;

/// A value at a stationary point below this fraction of `Σ|cₖ|` counts as a double root. The coefficients come from
/// eliminations that cost up to nine digits. Too small a fraction misses double roots that this error shifts off the
/// axis; too large a fraction adds false roots, which callers must reject where they matter.
const TOUCHING: f64 = 1e-6;

/// Roots of one polynomial, in no particular order.
#[derive(Clone, Copy, Debug)]
pub(super) struct Roots {
    values: [f64; 2 * MAX_DEGREE],
    count: usize,
}

impl Roots {
    fn none() -> Self {
        Self { values: [0.0; 2 * MAX_DEGREE], count: 0 }
    }

    fn push(&mut self, value: f64) {
        self.values[self.count] = value;
        self.count += 1;
    }

    /// The roots found.
    pub(super) fn as_slice(&self) -> &[f64] {
        &self.values[..self.count]
    }
}

/// Real roots of `Σ cₖ zᵏ` with `c[k]` the coefficient of `zᵏ`, up to degree [`MAX_DEGREE`]; none for the zero
/// polynomial. A double root is returned once, or twice if rounding splits it.
pub(super) fn real_roots(c: &[f64]) -> Roots {
    debug_assert!(!c.is_empty() && c.len() <= MAX_DEGREE + 1);
    if c.iter().all(|&k| k == 0.0) {
        return Roots::none();
    }
    let mut roots = roots_within_one(c);
    let mut reversed = [0.0; MAX_DEGREE + 1];
    let reversed = &mut reversed[..c.len()];
    reversed.copy_from_slice(c);
    reversed.reverse();
    for &u in roots_within_one(reversed).as_slice() {
        // |u| = 1 was found above; u = 0 is a root at infinity, from a zero leading coefficient.
        if u.abs() < 1.0 && u != 0.0 {
            roots.push(1.0 / u);
        }
    }
    roots
}

/// Roots in `[−1, 1]`.
fn roots_within_one(c: &[f64]) -> Roots {
    let degree = c.len() - 1;
    let mut stationary = Roots::none();
    for order in (0..degree).rev() {
        let mut derivative = [0.0; MAX_DEGREE + 1];
        let derivative = &mut derivative[..=degree - order];
        for (k, d) in derivative.iter_mut().enumerate() {
            *d = c[k + order] * falling(k + order, order);
        }
        stationary = bracketed_roots(derivative, stationary.as_slice(), order == 0);
    }
    stationary
}

/// `n (n − 1) ⋯ (n − order + 1)`.
fn falling(n: usize, order: usize) -> f64 {
    (n - order + 1..=n).map(|k| k as f64).product()
}

/// Roots of `c` in `[−1, 1]`, given the ascending roots of its derivative there.
fn bracketed_roots(c: &[f64], stationary: &[f64], touching: bool) -> Roots {
    let mut roots = Roots::none();
    let tiny = TOUCHING * c.iter().map(|v| v.abs()).sum::<f64>();
    let (mut low, mut at_low) = (-1.0, value(c, -1.0));
    if at_low == 0.0 {
        roots.push(low);
    }
    for (k, &high) in stationary.iter().chain(&[1.0]).enumerate() {
        let at_high = value(c, high);
        if at_low * at_high < 0.0 {
            roots.push(newton_in_bracket(c, low, high, at_low < 0.0));
        } else if at_high == 0.0 || (touching && k < stationary.len() && at_high.abs() <= tiny) {
            roots.push(high);
        }
        (low, at_low) = (high, at_high);
    }
    roots
}

/// The root of a monotone interval: Newton's method safeguarded by the bracket `[low, high]`.
fn newton_in_bracket(c: &[f64], mut low: f64, mut high: f64, rising: bool) -> f64 {
    let mut z = 0.5 * (low + high);
    let mut width = high - low;
    for _ in 0..MAX_STEPS {
        let (p, slope) = value_and_slope(c, z);
        if p == 0.0 {
            return z;
        }
        if (p < 0.0) == rising {
            low = z;
        } else {
            high = z;
        }
        let newton = z - p / slope;
        let next =
            if newton > low && newton < high && (newton - z).abs() < 0.5 * width { newton } else { 0.5 * (low + high) };
        width = (next - z).abs();
        let settled = width <= 2.0 * f64::EPSILON * z.abs().max(f64::EPSILON);
        z = next;
        if settled {
            break;
        }
    }
    z
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Coefficients of `Π (z − rₖ)`, ascending.
    fn with_roots(roots: &[f64]) -> Vec<f64> {
        roots.iter().fold(vec![1.0], |p, r| {
            let mut q = vec![0.0; p.len() + 1];
            for (k, c) in p.iter().enumerate() {
                q[k + 1] += c;
                q[k] -= r * c;
            }
            q
        })
    }

    fn sorted(c: &[f64]) -> Vec<f64> {
        let mut found = real_roots(c).as_slice().to_vec();
        found.sort_by(f64::total_cmp);
        found
    }

    #[test]
    fn separated_roots_are_found_wherever_they_lie() {
        let mut rng = fastrand::Rng::with_seed(5);
        for _ in 0..500 {
            let mut roots: Vec<f64> = (0..3 + rng.usize(0..5)).map(|k| (k as f64 - 3.0) + 0.6 * rng.f64()).collect();
            roots.sort_by(f64::total_cmp);
            let found = sorted(&with_roots(&roots));
            assert_eq!(found.len(), roots.len(), "{roots:?} against {found:?}");
            assert!(found.iter().zip(&roots).all(|(f, r)| (f - r).abs() < 1e-8), "{roots:?} against {found:?}");
        }
    }

    #[test]
    fn huge_and_tiny_roots_are_found_to_relative_precision() {
        let roots = [-4e5, -2e-6, 0.5, 3e4];
        let found = sorted(&with_roots(&roots));
        assert_eq!(found.len(), 4);
        assert!(found.iter().zip(roots).all(|(f, r)| (f / r - 1.0).abs() < 1e-9), "{found:?}");
    }

    #[test]
    fn a_polynomial_without_real_roots_has_none_and_a_touching_root_is_one() {
        assert!(real_roots(&[1.0, 0.0, 1.0]).as_slice().is_empty());
        assert!(real_roots(&[2.0, 1.0, 3.0, 0.0, 1.0]).as_slice().is_empty());
        let touching = sorted(&with_roots(&[0.3, 0.3]));
        assert!(!touching.is_empty() && touching.iter().all(|z| (z - 0.3).abs() < 3e-3), "{touching:?}");
    }

    #[test]
    fn vanishing_leading_coefficients_lower_the_degree() {
        let mut c = with_roots(&[0.25, -3.0]);
        c.push(0.0);
        assert_eq!(sorted(&c).len(), 2);
        assert!(real_roots(&[1.0]).as_slice().is_empty() && real_roots(&[0.0, 0.0]).as_slice().is_empty());
    }
}
