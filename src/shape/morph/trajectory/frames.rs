//! Rotations between triangles, by local frames.
//!
//! In the frame `F = [u v n]`, with `u` along the first edge and the normal `n`, a triangle is four numbers. With the map `J = R₂ S₂`
//! between two triangles in their planes, the rotation in space is `R = F' R₂ Fᵀ` and maps normal to normal. `det J > 0` always,
//! so that `R₂` is unique:
//!
//! ```text
//! tan φ = (J₁₀ − J₀₁) / (J₀₀ + J₁₁)
//! ```

use nalgebra::{Matrix2, Matrix3, Point3, Rotation3, UnitQuaternion, Vector2, Vector3};

/// Minimum ratio of doubled area and squared longest edge; below it the plane of a triangle is rounding.
const MIN_RELATIVE_AREA: f64 = 1e-12;

/// A triangle in its own plane.
#[derive(Clone, Copy, Debug)]
pub(in crate::morph) struct Frame {
    axes: Matrix3<f64>,
    /// Edges from the first corner.
    edges: Matrix2<f64>,
}

impl Frame {
    /// The frame of a triangle; `None` if it is degenerate.
    pub(in crate::morph) fn new([a, b, c]: &[Point3<f64>; 3]) -> Option<Self> {
        let (e, f) = (b - a, c - a);
        let normal = e.cross(&f);
        let longest = e.norm_squared().max(f.norm_squared()).max((c - b).norm_squared());
        if !(normal.norm() > MIN_RELATIVE_AREA * longest) {
            return None;
        }
        let (u, n) = (e.normalize(), normal.normalize());
        let v = n.cross(&u);
        let edges = Matrix2::new(e.norm(), f.dot(&u), 0.0, f.dot(&v));
        Some(Self { axes: Matrix3::from_columns(&[u, v, n]), edges })
    }

    /// `R` of the polar decomposition of the map from this triangle to another.
    pub(in crate::morph) fn rotation_to(&self, other: &Self) -> Option<UnitQuaternion<f64>> {
        let j = other.edges * self.edges.try_inverse()?;
        let matrix = Rotation3::from_matrix_unchecked(self.lifted(other, &j));
        let mut rotation = UnitQuaternion::from_rotation_matrix(&matrix);
        rotation.renormalize();
        Some(rotation)
    }

    /// The rotation with the least `Σ h |e' − R e|²` over the three edges, `h` by the corner opposite.
    pub(in crate::morph) fn best_rotation_to(&self, other: &Self, half: &[f64; 3]) -> Matrix3<f64> {
        let pairs = self.opposite_edges().into_iter().zip(other.opposite_edges()).zip(half);
        let m = pairs.fold(Matrix2::zeros(), |sum, ((e, moved), h)| sum + moved * e.transpose() * *h);
        self.lifted(other, &m)
    }

    /// `F' R₂ Fᵀ` with the rotation `R₂` nearest to a matrix in the planes.
    fn lifted(&self, other: &Self, m: &Matrix2<f64>) -> Matrix3<f64> {
        let (sine, cosine) = (m[(1, 0)] - m[(0, 1)], m[(0, 0)] + m[(1, 1)]);
        let length = sine.hypot(cosine);
        let (s, c) = if length > 0.0 { (sine / length, cosine / length) } else { (0.0, 1.0) };
        other.axes * Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0) * self.axes.transpose()
    }

    fn opposite_edges(&self) -> [Vector2<f64>; 3] {
        let (e, f) = (self.edges.column(0).into_owned(), self.edges.column(1).into_owned());
        [f - e, -f, e]
    }
}

/// Edges of a triangle, each opposite a corner, counterclockwise.
pub(in crate::morph) fn opposite_edges([a, b, c]: &[Point3<f64>; 3]) -> [Vector3<f64>; 3] {
    [c - b, a - c, b - a]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rotation_of_a_triangle_is_that_of_its_polar_decomposition() {
        let p = [Point3::new(0.1, 0.2, 0.3), Point3::new(1.0, 0.4, -0.2), Point3::new(0.3, 1.5, 0.9)];
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(2.0, -1.0, 1.5));
        let stretch = Matrix3::new(1.4, 0.1, 0.3, 0.1, 0.9, -0.2, 0.3, -0.2, 1.2);
        for (moved, exact) in
            [(p.map(|p| rotation * p), true), (p.map(|p| rotation * Point3::from(stretch * p.coords)), false)]
        {
            let (from, to) = (Frame::new(&p).unwrap(), Frame::new(&moved).unwrap());
            let found = from.rotation_to(&to).unwrap();
            if exact {
                assert!(found.angle_to(&rotation) < 1e-7);
            }
            // The remaining stretch is symmetric in the plane.
            let back: Vec<_> = moved.iter().map(|q| found.inverse() * (q - moved[0])).collect();
            let (e, f) = (p[1] - p[0], p[2] - p[0]);
            let n = e.cross(&f);
            let left = Matrix3::from_columns(&[back[1], back[2], n])
                * Matrix3::from_columns(&[e, f, n]).try_inverse().unwrap();
            assert!((left - left.transpose()).amax() < 1e-12, "{left}");
        }
        assert!(Frame::new(&[p[0], p[0], p[1]]).is_none());
    }

    #[test]
    fn the_best_rotation_is_a_local_minimum() {
        let p = [Point3::new(0.0, 0.0, 0.0), Point3::new(1.0, 0.0, 0.0), Point3::new(0.2, 0.8, 0.0)];
        let q = [Point3::new(0.3, 0.0, 0.1), Point3::new(0.9, 0.9, 0.4), Point3::new(-0.6, 0.7, 0.9)];
        let half = [0.2, 0.5, 0.3];
        let best = Frame::new(&p).unwrap().best_rotation_to(&Frame::new(&q).unwrap(), &half);
        let misfit = |r: &Matrix3<f64>| -> f64 {
            opposite_edges(&p)
                .iter()
                .zip(opposite_edges(&q))
                .zip(half)
                .map(|((e, f), h)| h * (f - r * e).norm_squared())
                .sum()
        };
        assert!((best * best.transpose() - Matrix3::identity()).amax() < 1e-14);
        for k in 0..60 {
            let small = Vector3::new(f64::from(k).sin(), f64::from(2 * k).cos(), f64::from(3 * k).sin()) * 0.05;
            let other = Rotation3::from_scaled_axis(small).matrix() * best;
            assert!(misfit(&best) < misfit(&other));
        }
    }
}
