//! Polynomials over time, by least squares.
//!
//! Over times `u_t` brought to [−1, 1] the monomials are made orthogonal one after another,
//!
//! ```text
//! q_k = u q_{k−1} − Σ_{j<k} ⟨u q_{k−1}, q_j⟩ / ⟨q_j, q_j⟩ q_j,      ȳ = Σ_k ⟨y, q_k⟩ / ⟨q_k, q_k⟩ q_k,
//! ```
//!
//! so that no system is solved, and degrees that the samples do not determine are left out.

use std::iter::Sum;
use std::ops::{Add, Mul};

use plumbline_num::math::dot;

/// Squared norm, relative to that of the constant, below which a basis function vanishes on the given times: between rounding
/// (1e-32) and the smallest that distinct times of a clip give.
const MIN_SQUARED_NORM: f64 = 1e-12;

/// The values, at the same times, of the polynomial of at most `degree` that is nearest to `values`.
pub(super) fn polynomial<T>(times: &[f64], values: &[T], degree: usize) -> Vec<T>
where
    T: Copy + Add<Output = T> + Mul<f64, Output = T> + Sum,
{
    let basis = basis(times, degree);
    let project = |q: &Vec<f64>| values.iter().zip(q).map(|(y, q)| *y * *q).sum::<T>() * (1.0 / dot(q, q));
    let weights: Vec<T> = basis.iter().map(project).collect();
    (0..values.len()).map(|t| basis.iter().zip(&weights).map(|(q, w)| *w * q[t]).sum()).collect()
}

/// `q_0 … q_degree` as far as they do not vanish.
fn basis(times: &[f64], degree: usize) -> Vec<Vec<f64>> {
    let n = times.len();
    let (low, high) = times.iter().fold((f64::MAX, f64::MIN), |(low, high), t| (low.min(*t), high.max(*t)));
    let half = 0.5 * (high - low);
    let u: Vec<f64> = times.iter().map(|t| if half > 0.0 { (t - low - half) / half } else { 0.0 }).collect();
    let mut basis: Vec<Vec<f64>> = Vec::with_capacity(degree + 1);
    let mut next = vec![1.0; n];
    for _ in 0..=degree {
        // Orthogonalized twice, which removes the rounding errors of the first pass.
        for q in basis.iter().chain(&basis) {
            let along = dot(&next, q) / dot(q, q);
            next.iter_mut().zip(q).for_each(|(x, q)| *x -= along * q);
        }
        if !(dot(&next, &next) > MIN_SQUARED_NORM * n as f64) {
            break;
        }
        let higher = next.iter().zip(&u).map(|(x, u)| x * u).collect();
        basis.push(std::mem::replace(&mut next, higher));
    }
    basis
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_is_its_own_and_a_higher_one_is_not() {
        let times = [0.0, 0.03, 0.07, 0.2, 0.21, 0.4];
        for degree in 0..4 {
            let y: Vec<f64> = times.iter().map(|t| (0..=degree).map(|k| (t - 0.1_f64).powi(k) * 3.0).sum()).collect();
            let apart =
                |d: usize| polynomial(&times, &y, d).iter().zip(&y).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(apart(degree as usize) < 1e-13, "degree {degree}: {}", apart(degree as usize));
            assert!(degree == 0 || apart(degree as usize - 1) > 1e-3);
        }
    }

    #[test]
    fn residuals_are_orthogonal_to_the_polynomials() {
        let mut random = fastrand::Rng::with_seed(4);
        let times: Vec<f64> = (0..50).map(|t| f64::from(t) + random.f64()).collect();
        let y: Vec<f64> = times.iter().map(|_| random.f64()).collect();
        let left: Vec<f64> = y.iter().zip(polynomial(&times, &y, 2)).map(|(y, p)| y - p).collect();
        for k in 0..3 {
            let moment: f64 = times.iter().zip(&left).map(|(t, r)| (t / 50.0).powi(k) * r).sum();
            assert!(moment.abs() < 1e-12, "moment {k}: {moment}");
        }
    }

    #[test]
    fn fewer_samples_than_coefficients_are_interpolated() {
        assert_eq!(polynomial(&[3.0], &[7.0], 2), [7.0]);
        assert!(polynomial::<f64>(&[], &[], 2).is_empty());
        let two = polynomial(&[3.0, 4.0], &[7.0, 9.0], 2);
        assert!((two[0] - 7.0).abs() < 1e-13 && (two[1] - 9.0).abs() < 1e-13, "{two:?}");
        assert_eq!(polynomial(&[5.0, 5.0], &[1.0, 2.0], 1), [1.5, 1.5], "one time has one value");
    }
}
