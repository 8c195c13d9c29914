//! Squared distances to planes, summed.

use nalgebra::{Matrix3, Point3, Vector3};

/// `Q(x) = Σ w (n·(x − o))²` over planes with unit normal `n` through `o`, weighted by area, written about a point of its own.
///
/// # Reference
/// M. Garland, P. Heckbert, *Surface simplification using quadric error metrics*, SIGGRAPH 1997.
#[derive(Clone, Copy, Debug)]
pub(super) struct Quadric {
    about: Point3<f64>,
    a: Matrix3<f64>,
    b: Vector3<f64>,
    c: f64,
    /// Sum of the weights of surface planes: the area that the quadric stands for.
    pub(super) area: f64,
}

impl Quadric {
    /// No plane yet.
    pub(super) fn zero(about: Point3<f64>) -> Self {
        Self { about, a: Matrix3::zeros(), b: Vector3::zeros(), c: 0.0, area: 0.0 }
    }

    /// Adds a plane through `through` with unit normal `n`.
    pub(super) fn add_plane(&mut self, n: &Vector3<f64>, through: &Point3<f64>, weight: f64) {
        let d = n.dot(&(self.about - through));
        self.a += n * n.transpose() * weight;
        self.b += n * (d * weight);
        self.c += d * d * weight;
    }

    /// Adds another quadric, which may be written about another point.
    pub(super) fn add(&mut self, other: &Self) {
        let shift = self.about - other.about;
        let a_shift = other.a * shift;
        self.a += other.a;
        self.b += other.b + a_shift;
        self.c += other.c + shift.dot(&(other.b * 2.0 + a_shift));
        self.area += other.area;
    }

    /// `Q(x)`, area × squared length.
    pub(super) fn at(&self, x: &Point3<f64>) -> f64 {
        let y = x - self.about;
        (y.dot(&(self.a * y + self.b * 2.0)) + self.c).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_of_quadrics_measure_the_sum_of_squared_distances() {
        let far = Vector3::new(3e4, -1e4, 2e4);
        let (p, q) = (Point3::new(1.0, 2.0, 0.5) + far, Point3::new(-1.0, 0.0, 2.0) + far);
        let (n, m) = (Vector3::new(1.0, 2.0, 2.0) / 3.0, Vector3::new(0.0, 0.6, -0.8));
        let (mut one, mut other) = (Quadric::zero(p), Quadric::zero(q));
        one.add_plane(&n, &q, 2.0);
        other.add_plane(&m, &p, 0.5);
        one.add(&other);
        let x = Point3::new(0.3, -0.7, 1.1) + far;
        let expected = 2.0 * n.dot(&(x - q)).powi(2) + 0.5 * m.dot(&(x - p)).powi(2);
        assert!((one.at(&x) - expected).abs() < 1e-9 * expected, "{} against {expected}", one.at(&x));
    }
}
