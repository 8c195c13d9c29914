//! Squared distances to planes, summed.

use nalgebra::Vector3;

/// `Q(y) = Σ w (n·y + d)²` over planes with unit normal `n`; `y` is relative to a point of its own, which is not stored here to
/// save memory for millions of quadrics.
///
/// # Reference
/// M. Garland, P. Heckbert, *Surface simplification using quadric error metrics*, SIGGRAPH 1997.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Quadric {
    /// `Σ w n nᵀ`: `xx, yy, zz, xy, xz, yz`.
    a: [f64; 6],
    /// `Σ w d n`.
    b: Vector3<f64>,
    /// `Σ w d²`.
    c: f64,
    /// Sum of the weights of surface planes: the area of the quadric.
    pub(super) area: f64,
}

impl Quadric {
    /// Adds the plane `n·y + d = 0`.
    pub(super) fn add_plane(&mut self, n: &Vector3<f64>, d: f64, weight: f64) {
        let products = [n.x * n.x, n.y * n.y, n.z * n.z, n.x * n.y, n.x * n.z, n.y * n.z];
        self.a.iter_mut().zip(products).for_each(|(a, p)| *a += weight * p);
        self.b += n * (d * weight);
        self.c += d * d * weight;
    }

    /// Adds another quadric, whose own point is at `−shift` from this one's.
    pub(super) fn add(&mut self, other: &Self, shift: &Vector3<f64>) {
        let a_shift = other.times(shift);
        self.a.iter_mut().zip(other.a).for_each(|(a, more)| *a += more);
        self.b += other.b + a_shift;
        self.c += other.c + shift.dot(&(other.b * 2.0 + a_shift));
        self.area += other.area;
    }

    /// `Q(y)`, area × squared length.
    pub(super) fn at(&self, y: &Vector3<f64>) -> f64 {
        (y.dot(&(self.times(y) + self.b * 2.0)) + self.c).max(0.0)
    }

    /// `Q(0)`.
    pub(super) fn here(&self) -> f64 {
        self.c
    }

    /// `A y`.
    fn times(&self, y: &Vector3<f64>) -> Vector3<f64> {
        let [xx, yy, zz, xy, xz, yz] = self.a;
        Vector3::new(xx * y.x + xy * y.y + xz * y.z, xy * y.x + yy * y.y + yz * y.z, xz * y.x + yz * y.y + zz * y.z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    #[test]
    fn sums_of_quadrics_measure_the_sum_of_squared_distances() {
        let far = Vector3::new(3e4, -1e4, 2e4);
        let (p, q) = (Point3::new(1.0, 2.0, 0.5) + far, Point3::new(-1.0, 0.0, 2.0) + far);
        let (n, m) = (Vector3::new(1.0, 2.0, 2.0) / 3.0, Vector3::new(0.0, 0.6, -0.8));
        let (mut one, mut other) = (Quadric::default(), Quadric::default());
        one.add_plane(&n, n.dot(&(p - q)), 2.0);
        other.add_plane(&m, m.dot(&(q - p)), 0.5);
        one.add(&other, &(p - q));
        let x = Point3::new(0.3, -0.7, 1.1) + far;
        let expected = 2.0 * n.dot(&(x - q)).powi(2) + 0.5 * m.dot(&(x - p)).powi(2);
        assert!((one.at(&(x - p)) - expected).abs() < 1e-9 * expected, "{} against {expected}", one.at(&(x - p)));
    }
}
