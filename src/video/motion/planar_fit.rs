//! Weighted least-squares fits of planar motion to matched points.
//!
//! Similarity: `min Σ wᵢ ‖[a −b; b a] pᵢ + t − qᵢ‖²`, linear in all four parameters, solved in closed form.
//!
//! Homography: the one through four pairs, or the similarity, is the initial guess, and Gauss–Newton minimizes
//!
//! ```text
//! Σ wᵢ ‖π(H pᵢ) − qᵢ‖² + κ ‖(h₁₁ − h₂₂, h₁₂ + h₂₁, h₃₁, h₃₂)‖²
//! ```
//!
//! in coordinates that put the frame's center at the origin and its corners at distance 1. The four terms behind `κ` vanish
//! for every similarity: they are the shear, stretch and perspective that few or clustered points cannot determine. With
//! `κ = 0` the fit is plain least squares of the transfer error.
//!
//! # Reference
//! Hartley, Zisserman, *Multiple View Geometry*, 2nd ed., section 4.1.

use nalgebra::{Matrix3, SMatrix, SVector};

use plumbline_num::math::{Homography, Point2, Similarity2, Vec2};

/// A point correspondence between the previous frame and this one, px.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// Position in the previous frame, px.
    pub previous: Point2,
    /// Position in this frame, px.
    pub this: Point2,
}

/// Coordinates in which a frame of `width × height` px has its center at 0 and its corners at distance 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameScale {
    center: Vec2,
    radius: f64,
}

impl FrameScale {
    /// The scale of a frame of `width × height` px.
    pub fn new(width: u32, height: u32) -> Self {
        let half = Vec2::new(f64::from(width), f64::from(height)) / 2.0;
        Self { center: half, radius: half.norm().max(1.0) }
    }

    /// Half the frame's diagonal, px.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// `p`, px, in frame units.
    pub fn normalized(&self, p: Point2) -> Point2 {
        Point2::from((p.coords - self.center) / self.radius)
    }

    /// The 3×3 matrix of [`Self::normalized`].
    fn matrix(&self) -> Matrix3<f64> {
        let s = 1.0 / self.radius;
        Matrix3::new(s, 0.0, -self.center.x * s, 0.0, s, -self.center.y * s, 0.0, 0.0, 1.0)
    }

    fn inverse(&self) -> Matrix3<f64> {
        let r = self.radius;
        Matrix3::new(r, 0.0, self.center.x, 0.0, r, self.center.y, 0.0, 0.0, 1.0)
    }

    /// `h`, px to px, in frame units.
    pub fn normalized_map(&self, h: &Homography) -> Matrix3<f64> {
        let m = self.matrix() * h.matrix() * self.inverse();
        m / m[(2, 2)]
    }

    /// The map in px of a map in frame units.
    pub fn pixel_map(&self, m: &Matrix3<f64>) -> Homography {
        Homography::new(self.inverse() * m * self.matrix())
    }
}

/// The weighted least-squares similarity from `previous` to `this`; `None` for fewer than two distinct points with weight.
pub fn similarity(pairs: &[Pair], weights: &[f64]) -> Option<Similarity2> {
    let (mut total, mut p_sum, mut q_sum) = (0.0, Vec2::zeros(), Vec2::zeros());
    for (pair, &w) in pairs.iter().zip(weights) {
        total += w;
        p_sum += w * pair.previous.coords;
        q_sum += w * pair.this.coords;
    }
    if !(total > 0.0) {
        return None;
    }
    let (p_mean, q_mean) = (p_sum / total, q_sum / total);
    let (mut a, mut b, mut spread) = (0.0, 0.0, 0.0);
    for (pair, &w) in pairs.iter().zip(weights) {
        let (p, q) = (pair.previous.coords - p_mean, pair.this.coords - q_mean);
        a += w * p.dot(&q);
        b += w * p.perp(&q);
        spread += w * p.norm_squared();
    }
    // Below a spread of 1e-12 px² per unit weight the points are one point.
    if !(spread > 1e-12 * total) {
        return None;
    }
    let linear = Similarity2 { a: a / spread, b: b / spread, t: Vec2::zeros() };
    let t = q_mean - linear.apply(Point2::from(p_mean)).coords;
    (linear.a.is_finite() && linear.b.is_finite()).then_some(Similarity2 { t, ..linear })
}

/// The homography through four pairs, by the direct linear transform in frame units; `None` where three of the points are
/// collinear or the map is degenerate.
pub fn homography_of_four(pairs: [Pair; 4], scale: &FrameScale) -> Option<Homography> {
    let mut a = SMatrix::<f64, 8, 8>::zeros();
    let mut rhs = SVector::<f64, 8>::zeros();
    for (k, pair) in pairs.iter().enumerate() {
        let (p, q) = (scale.normalized(pair.previous), scale.normalized(pair.this));
        let rows = [
            [p.x, p.y, 1.0, 0.0, 0.0, 0.0, -q.x * p.x, -q.x * p.y],
            [0.0, 0.0, 0.0, p.x, p.y, 1.0, -q.y * p.x, -q.y * p.y],
        ];
        for (j, row) in rows.iter().enumerate() {
            a.row_mut(2 * k + j).copy_from_slice(row);
            rhs[2 * k + j] = q[j];
        }
    }
    let h = a.lu().solve(&rhs)?;
    let m = matrix_of(&h);
    (is_sane(&m)).then(|| scale.pixel_map(&m))
}

/// Gauss–Newton on the weighted transfer error from the initial guess `initial`, with the regularization `kappa` of the module's
/// formula (squared frame units, in the scale of `weights`).
///
/// `None` where the normal equations are singular (`kappa = 0` and collinear points) or the map is degenerate.
pub fn homography(
    pairs: &[Pair],
    weights: &[f64],
    initial: &Homography,
    kappa: f64,
    scale: &FrameScale,
    iterations: usize,
) -> Option<Homography> {
    let mut m = scale.normalized_map(initial);
    for _ in 0..iterations {
        let (normal, gradient) = normal_equations(pairs, weights, &m, kappa, scale);
        let step = normal.cholesky()?.solve(&gradient);
        m -= matrix_of(&step) - Matrix3::from_partial_diagonal(&[0.0, 0.0, 1.0]);
        if step.norm() < 1e-13 {
            break;
        }
    }
    is_sane(&m).then(|| scale.pixel_map(&m))
}

type Normal = (SMatrix<f64, 8, 8>, SVector<f64, 8>);

fn normal_equations(pairs: &[Pair], weights: &[f64], m: &Matrix3<f64>, kappa: f64, scale: &FrameScale) -> Normal {
    let mut normal = SMatrix::<f64, 8, 8>::zeros();
    let mut gradient = SVector::<f64, 8>::zeros();
    let mut add = |row: &SVector<f64, 8>, residual: f64, w: f64| {
        normal.ger(w, row, row, 1.0);
        gradient.axpy(w * residual, row, 1.0);
    };
    for (pair, &w) in pairs.iter().zip(weights) {
        if !(w > 0.0) {
            continue;
        }
        let (p, q) = (scale.normalized(pair.previous), scale.normalized(pair.this));
        let z = m * p.coords.push(1.0);
        let inv = 1.0 / z.z;
        let (x, y) = (z.x * inv, z.y * inv);
        let (u, v) = (p.x * inv, p.y * inv);
        add(&SVector::from([u, v, inv, 0.0, 0.0, 0.0, -x * u, -x * v]), x - q.x, w);
        add(&SVector::from([0.0, 0.0, 0.0, u, v, inv, -y * u, -y * v]), y - q.y, w);
    }
    add(&SVector::from([1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0]), m[(0, 0)] - m[(1, 1)], kappa);
    add(&SVector::from([0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]), m[(0, 1)] + m[(1, 0)], kappa);
    add(&SVector::from([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]), m[(2, 0)], kappa);
    add(&SVector::from([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]), m[(2, 1)], kappa);
    (normal, gradient)
}

fn matrix_of(h: &SVector<f64, 8>) -> Matrix3<f64> {
    Matrix3::new(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], 1.0)
}

/// True where `m`, in frame units, keeps the frame's orientation and stays away from infinity on the unit disc.
fn is_sane(m: &Matrix3<f64>) -> bool {
    let perspective = m[(2, 0)].hypot(m[(2, 1)]);
    m.iter().all(|v| v.is_finite()) && perspective < 0.5 && m.determinant() > 0.1 && m.determinant() < 10.0
}
