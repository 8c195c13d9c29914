//! A quadrilateral spanned bilinearly by its corners.
//!
//! ```text
//! x(s, t) = (1−s)(1−t) A + s(1−t) B + (1−s)t C + s t D,      A B
//!                                                            C D
//! ```

use plumbline_num::math::{Point2, Vec2};

/// Corners in the order of [`crate::grid::GridMesh`]: top left, top right, bottom left, bottom right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quad(pub [Point2; 4]);

fn cross(a: Vec2, b: Vec2) -> f64 {
    a.x * b.y - a.y * b.x
}

impl Quad {
    /// The four bilinear weights of `(s, t)`; they sum to 1.
    pub fn weights(s: f64, t: f64) -> [f64; 4] {
        [(1.0 - s) * (1.0 - t), s * (1.0 - t), (1.0 - s) * t, s * t]
    }

    /// The point at `(s, t)`.
    pub fn at(&self, s: f64, t: f64) -> Point2 {
        let w = Self::weights(s, t);
        let sum = self.0.iter().zip(w).fold(Vec2::zeros(), |sum, (p, w)| sum + p.coords * w);
        Point2::from(sum)
    }

    /// Signed area; positive while the corners keep their orientation (y down).
    pub fn area(&self) -> f64 {
        let [a, b, c, d] = self.0;
        0.5 * cross(d - a, c - b)
    }

    /// Smallest Jacobian determinant of `(s, t) ↦ x` over the cell, which it takes at a corner: not positive where the
    /// cell folds or collapses; NaN where a corner is.
    pub fn min_jacobian(&self) -> f64 {
        let [a, b, c, d] = self.0;
        let (top, bottom, left, right) = (b - a, d - c, c - a, d - b);
        // Not `f64::min`, which would pass over a NaN.
        let least = |least: f64, j: f64| if j < least || j.is_nan() { j } else { least };
        [(top, left), (top, right), (bottom, left), (bottom, right)]
            .into_iter()
            .map(|(along, down)| cross(along, down))
            .fold(f64::INFINITY, least)
    }

    /// The `(s, t)` with `x(s, t) = p`, by Newton's method from a guess; `None` where it does not converge.
    ///
    /// In a cell that does not fold and a point inside it, two or three steps reach rounding.
    pub fn inverse(&self, p: Point2, guess: (f64, f64)) -> Option<(f64, f64)> {
        let [a, b, c, d] = self.0;
        let twist = (d - c) - (b - a);
        let (mut s, mut t) = guess;
        for _ in 0..20 {
            let residual = p - self.at(s, t);
            let (ds, dt) = ((b - a) + twist * t, (c - a) + twist * s);
            let det = cross(ds, dt);
            let (step_s, step_t) = (cross(residual, dt) / det, cross(ds, residual) / det);
            s += step_s;
            t += step_t;
            if step_s.abs().max(step_t.abs()) < 1e-13 {
                return Some((s, t));
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Quad {
        let p = Point2::new;
        Quad([p(1.0, 2.0), p(9.0, 3.0), p(0.0, 10.0), p(12.0, 11.0)])
    }

    #[test]
    fn the_inverse_undoes_the_bilinear_map() {
        for (s, t) in [(0.0, 0.0), (0.3, 0.8), (1.0, 1.0), (0.5, 0.1)] {
            let (s1, t1) = sample().inverse(sample().at(s, t), (0.5, 0.5)).expect("inside a convex cell");
            assert!((s - s1).abs() < 1e-13 && (t - t1).abs() < 1e-13, "({s}, {t}) came back as ({s1}, {t1})");
        }
    }

    #[test]
    fn the_area_is_the_integral_of_the_jacobian() {
        let (q, n) = (sample(), 50);
        let jacobian = |s: f64, t: f64| {
            let h = 1e-4;
            cross(q.at(s + h, t) - q.at(s - h, t), q.at(s, t + h) - q.at(s, t - h)) / (4.0 * h * h)
        };
        let cell = |k: usize| (k as f64 + 0.5) / n as f64;
        let sum: f64 = (0..n * n).map(|k| jacobian(cell(k % n), cell(k / n))).sum();
        let integral = sum / (n * n) as f64;
        assert!((q.area() - integral).abs() < 1e-6 * q.area(), "{} against {integral}", q.area());
    }

    #[test]
    fn a_corner_pulled_across_the_diagonal_folds() {
        let mut q = sample();
        assert!(q.min_jacobian() > 0.0);
        q.0[3] = Point2::new(2.0, 4.0);
        assert!(q.min_jacobian() < 0.0);
        let mirrored = Quad([q.0[1], q.0[0], q.0[3], q.0[2]]);
        assert!(mirrored.area() < 0.0 && mirrored.min_jacobian() < 0.0);
    }
}
