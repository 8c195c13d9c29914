//! Polygonal faces and their triangulation.

use std::ops::Range;

use nalgebra::{Point2, Point3, Vector3};

/// Maximum number of corners of a polygon triangulated by ear clipping, which takes quadratic time in their number: bounds the
/// time for a hostile file with one huge polygon. Larger polygons become fans.
const MAX_EARS: usize = 2048;
/// Maximum number of tests of a point in a triangle, over the square of the number of corners: simple polygons take up to one.
const MAX_WORK: usize = 4;

/// Polygons in compressed form: one list of corners, with the first corner of each polygon.
///
/// Invariants: `starts` is ascending, begins with 0 and ends with the number of corners.
#[derive(Clone, Debug, PartialEq)]
pub struct Faces {
    starts: Vec<u32>,
    vertices: Vec<u32>,
}

impl Default for Faces {
    fn default() -> Self {
        Self { starts: vec![0], vertices: Vec::new() }
    }
}

impl Faces {
    /// Adds a polygon.
    pub fn push(&mut self, vertices: &[u32]) {
        self.vertices.extend_from_slice(vertices);
        self.starts.push(self.vertices.len() as u32);
    }

    /// Number of polygons.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Whether there are no polygons.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Total number of corners.
    pub fn corner_count(&self) -> usize {
        self.vertices.len()
    }

    /// Vertex of each corner, polygon by polygon.
    pub fn vertices(&self) -> &[u32] {
        &self.vertices
    }

    /// Corners of a polygon, as a range of indices into [`Self::vertices`].
    #[inline]
    pub fn corners(&self, face: usize) -> Range<usize> {
        self.starts[face] as usize..self.starts[face + 1] as usize
    }

    /// Vertices of a polygon.
    #[inline]
    pub fn get(&self, face: usize) -> &[u32] {
        &self.vertices[self.corners(face)]
    }

    /// Polygons in order.
    pub fn iter(&self) -> impl Iterator<Item = &[u32]> {
        (0..self.len()).map(|face| self.get(face))
    }

    /// Triangulation of all polygons: three corner indices per triangle, and the polygon of each triangle. All vertex indices
    /// must be in range of `positions`.
    pub(super) fn triangulate(&self, positions: &[Point3<f64>]) -> (Vec<[u32; 3]>, Vec<u32>) {
        let (mut triangles, mut face_of) = (Vec::with_capacity(self.len()), Vec::with_capacity(self.len()));
        for face in 0..self.len() {
            let corners = self.corners(face);
            let first = corners.start as u32;
            if corners.len() == 3 {
                triangles.push([first, first + 1, first + 2]);
            } else {
                let outline: Vec<_> = self.get(face).iter().map(|&v| positions[v as usize]).collect();
                triangles.extend(cut(&outline).into_iter().map(|t| t.map(|k| first + k as u32)));
            }
            face_of.resize(triangles.len(), face as u32);
        }
        (triangles, face_of)
    }
}

/// Vector area of a polygon times two (Newell's method): the mean normal scaled by twice the area; zero for a degenerate
/// polygon.
pub(super) fn newell(outline: &[Point3<f64>]) -> Vector3<f64> {
    let Some(&first) = outline.first() else { return Vector3::zeros() };
    let next = outline.iter().skip(1).chain(outline.first());
    outline.iter().zip(next).map(|(p, q)| (p - first).cross(&(q - first))).sum()
}

/// Triangulates a polygon: a fan if it is convex or has more than [`MAX_EARS`] corners, else ear clipping in the projection
/// along its mean normal.
fn cut(outline: &[Point3<f64>]) -> Vec<[usize; 3]> {
    let n = outline.len();
    let flat = flattened(outline);
    let doubled_area = |a: usize, b: usize, c: usize| (flat[b] - flat[a]).perp(&(flat[c] - flat[a]));
    let convex = (0..n).all(|k| doubled_area(k, (k + 1) % n, (k + 2) % n) >= 0.0);
    if convex || n > MAX_EARS {
        return (2..n).map(|k| [0, k - 1, k]).collect();
    }
    // Ear clipping: remove a convex corner whose triangle contains no other remaining corner.
    let (mut left, mut triangles): (Vec<usize>, Vec<_>) = ((0..n).collect(), Vec::with_capacity(n - 2));
    let (mut at, mut since_ear, mut work) = (0, 0, 0);
    while left.len() > 3 {
        let m = left.len();
        let [a, b, c] = [left[at % m], left[(at + 1) % m], left[(at + 2) % m]];
        let inside =
            |p: usize| doubled_area(a, b, p) >= 0.0 && doubled_area(b, c, p) >= 0.0 && doubled_area(c, a, p) >= 0.0;
        let is_convex = doubled_area(a, b, c) > 0.0;
        work += if is_convex { m } else { 1 };
        let is_ear = is_convex && !left.iter().any(|&p| p != a && p != b && p != c && inside(p));
        // A self-intersecting polygon may have no ear left: after a full pass without one, clip the current corner. Passes that find
        // one ear each take cubic time: after as much work as many times what a simple polygon takes, clip it too.
        if is_ear || since_ear > m || work > MAX_WORK * n * n {
            triangles.push([a, b, c]);
            left.remove((at + 1) % m);
            since_ear = 0;
        } else {
            at += 1;
            since_ear += 1;
        }
        at %= left.len();
    }
    triangles.push([left[0], left[1], left[2]]);
    triangles
}

/// Projection of the outline to a coordinate plane, counterclockwise: the dominant axis of the mean normal is dropped.
fn flattened(outline: &[Point3<f64>]) -> Vec<Point2<f64>> {
    let normal = newell(outline);
    let axis = normal.iamax();
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let (u, v) = if normal[axis] < 0.0 { (v, u) } else { (u, v) };
    outline.iter().map(|p| Point2::new(p[u], p[v])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area_of(outline: &[Point3<f64>], triangles: &[[usize; 3]]) -> (f64, f64) {
        let parts = triangles.iter().map(|t| newell(&t.map(|k| outline[k])));
        (parts.clone().map(|n| n.norm()).sum(), parts.sum::<Vector3<f64>>().norm())
    }

    #[test]
    fn triangles_of_a_polygon_cover_it_once_without_folds() {
        let comb: Vec<_> = (0..12)
            .map(|k| [k as f64, if k % 2 == 0 { 1.0 } else { 5.0 }])
            .chain([[11.0, 0.0], [0.0, 0.0]])
            .rev()
            .collect();
        let outlines: [Vec<[f64; 2]>; 4] = [
            vec![[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]],
            vec![[0.0, 0.0], [4.0, -1.0], [1.0, 0.0], [4.0, 1.0]],
            vec![[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [2.0, 3.0], [2.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]],
            comb,
        ];
        let rotation = nalgebra::Rotation3::from_euler_angles(0.4, -1.1, 2.0);
        for outline in outlines {
            for start in 0..outline.len() {
                let points: Vec<_> = (0..outline.len())
                    .map(|k| outline[(k + start) % outline.len()])
                    .map(|[x, y]| rotation * Point3::new(x, y, 0.5))
                    .collect();
                let triangles = cut(&points);
                assert_eq!(triangles.len(), points.len() - 2);
                let (absolute, signed) = area_of(&points, &triangles);
                let whole = newell(&points).norm();
                assert!(
                    (absolute - whole).abs() < 1e-12 * whole && (signed - whole).abs() < 1e-12 * whole,
                    "{outline:?}"
                );
            }
        }
    }

    #[test]
    fn what_has_no_area_is_cut_all_the_same() {
        for outline in [vec![Point3::origin(); 5], (0..6).map(|k| Point3::new(f64::from(k % 4), 0.0, 0.0)).collect()] {
            assert_eq!(cut(&outline).len(), outline.len() - 2);
        }
        let crossing = [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0], [0.5, 2.0]];
        assert_eq!(cut(&crossing.map(|[x, y]| Point3::new(x, y, 0.0))).len(), 3);
    }
}
