//! Keeps the output covered: no bending may pull the border of the source into view.
//!
//! A homography `H` carries each side of the source to a straight line, and the virtual camera is planned such that the
//! output rectangle `R` lies inside the four. A content-preserving mesh moves the vertices of that side by small `uᵢ`
//! towards the inside. Let `D(s)` be the clearance between the side and `R`, a convex piecewise linear function along
//! the side. Wherever `uᵢ > D(sᵢ)` the vertex is moved back by the difference, and the vertices behind it by a share
//! that falls to nothing over a few cells. All of it is continuous in the mesh, so nothing pops from frame to frame.

use crate::grid::GridMesh;
use plumbline_num::math::{Point2, Vec2};

/// Rows of cells over which a correction at the border decays. Fewer visibly squeeze the border cells, more displace
/// interior anchors.
const FALLOFF_CELLS: usize = 8;

/// Moves vertices of `mesh` outwards until the rectangle `[0,width]×[0,height]` is covered again, given that it is
/// covered by `pre_warped`, the mesh before it was bent. Returns the largest correction, px of the output.
pub fn keep_covered(mesh: &mut GridMesh, pre_warped: &GridMesh, width: f64, height: f64) -> f64 {
    let corners = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)].map(|(x, y)| Point2::new(x, y));
    Side::all(mesh.cols, mesh.rows).iter().fold(0.0, |worst, side| worst.max(side.push_out(mesh, pre_warped, &corners)))
}

/// One side of the grid: `n + 1` border vertices, and the stride to the vertices behind each.
struct Side {
    start: usize,
    along: isize,
    inward: isize,
    n: usize,
    depth: usize,
}

impl Side {
    /// Top, right, bottom, left of a grid of `cols × rows` cells.
    fn all(cols: usize, rows: usize) -> [Self; 4] {
        let stride = cols + 1;
        let (down, up) = (stride.cast_signed(), -stride.cast_signed());
        [
            Self { start: 0, along: 1, inward: down, n: cols, depth: rows },
            Self { start: cols, along: down, inward: -1, n: rows, depth: cols },
            Self { start: rows * stride + cols, along: -1, inward: up, n: cols, depth: rows },
            Self { start: rows * stride, along: up, inward: 1, n: rows, depth: cols },
        ]
    }

    /// Index of the vertex `depth` cells behind border vertex `i`.
    fn vertex(&self, i: usize, depth: usize) -> usize {
        self.start.wrapping_add_signed(self.along * i.cast_signed() + self.inward * depth.cast_signed())
    }

    fn push_out(&self, mesh: &mut GridMesh, pre_warped: &GridMesh, corners: &[Point2; 4]) -> f64 {
        let (from, to) = (pre_warped.vertices[self.vertex(0, 0)], pre_warped.vertices[self.vertex(self.n, 0)]);
        let length = (to - from).norm();
        if !(length > 0.0) {
            return 0.0;
        }
        let tangent = (to - from) / length;
        let normal = inward_normal(tangent, from, corners);
        let clearance = Clearance::new(from, tangent, normal, corners);
        let mut worst = 0.0_f64;
        for i in 0..=self.n {
            let moved = mesh.vertices[self.vertex(i, 0)] - from;
            let excess = moved.dot(&normal) - clearance.at(moved.dot(&tangent));
            if excess > 0.0 {
                self.relax(mesh, i, -excess * normal);
                worst = worst.max(excess);
            }
        }
        worst
    }

    /// Adds `shift` to border vertex `i`, and a falling share of it to the vertices behind.
    fn relax(&self, mesh: &mut GridMesh, i: usize, shift: Vec2) {
        let reach = FALLOFF_CELLS.min(self.depth);
        for d in 0..reach {
            let share = 1.0 - d as f64 / reach as f64;
            mesh.vertices[self.vertex(i, d)] += shift * share;
        }
    }
}

/// The unit normal of a side that points towards the output rectangle.
fn inward_normal(tangent: Vec2, from: Point2, corners: &[Point2; 4]) -> Vec2 {
    let normal = Vec2::new(-tangent.y, tangent.x);
    let middle = nalgebra::center(&corners[0], &corners[2]);
    if (middle - from).dot(&normal) < 0.0 { -normal } else { normal }
}

/// Distance from a side to the output rectangle, along the side: the lower boundary of the rectangle in the coordinates
/// (along the side, inwards).
struct Clearance {
    corners: [Vec2; 4],
    least: f64,
    most: f64,
}

impl Clearance {
    fn new(from: Point2, tangent: Vec2, normal: Vec2, corners: &[Point2; 4]) -> Self {
        let corners = corners.map(|c| Vec2::new((c - from).dot(&tangent), (c - from).dot(&normal)));
        let (least, most) =
            corners.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, m), c| (l.min(c.x), m.max(c.x)));
        Self { corners, least, most }
    }

    /// Clearance at `s` px along the side; beyond the rectangle that of its nearest corner.
    fn at(&self, s: f64) -> f64 {
        let s = s.clamp(self.least, self.most);
        let edges = (0..4).map(|i| (self.corners[i], self.corners[(i + 1) % 4]));
        edges.map(|(a, b)| self.edge_at(s, a, b)).fold(f64::INFINITY, f64::min)
    }

    /// Height of an edge above the side at `s`; infinite beside the edge.
    fn edge_at(&self, s: f64, a: Vec2, b: Vec2) -> f64 {
        let (a, b) = if a.x <= b.x { (a, b) } else { (b, a) };
        let tolerance = 1e-9 * (self.most - self.least);
        if s < a.x - tolerance || s > b.x + tolerance {
            f64::INFINITY
        } else if b.x - a.x <= tolerance {
            a.y.min(b.y)
        } else {
            a.y + (b.y - a.y) * ((s - a.x) / (b.x - a.x)).clamp(0.0, 1.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Grid;
    use plumbline_num::math::Similarity2;

    const W: f64 = 640.0;
    const H: f64 = 360.0;

    fn pre_warped() -> GridMesh {
        let about = Similarity2::about(Point2::new(W / 2.0, H / 2.0), 0.05, 1.2, Vec2::new(11.0, -6.0));
        warped(|p| about.apply(p))
    }

    fn warped(map: impl Fn(Point2) -> Point2) -> GridMesh {
        let mut mesh = Grid { cols: 32, rows: 18, width: W, height: H }.to_mesh();
        for v in &mut mesh.vertices {
            *v = map(*v);
        }
        mesh
    }

    /// How far the border polyline of `mesh` enters the output rectangle, px; 0 where it is covered.
    fn intrusion(mesh: &GridMesh) -> f64 {
        let depth = |p: Point2| p.x.min(W - p.x).min(p.y).min(H - p.y);
        let mut worst = 0.0_f64;
        for side in Side::all(mesh.cols, mesh.rows) {
            for i in 0..side.n {
                let (a, b) = (mesh.vertices[side.vertex(i, 0)], mesh.vertices[side.vertex(i + 1, 0)]);
                for k in 0..=10 {
                    worst = worst.max(depth(a + (b - a) * (f64::from(k) / 10.0)));
                }
            }
        }
        worst
    }

    #[test]
    fn a_mesh_that_covers_the_output_is_not_touched() {
        let (pre, mut mesh) = (pre_warped(), pre_warped());
        for v in &mut mesh.vertices {
            *v += Vec2::new(0.5, -0.5);
        }
        let before = mesh.clone();
        assert_eq!(keep_covered(&mut mesh, &pre, W, H), 0.0);
        assert_eq!(mesh.vertices, before.vertices);
    }

    #[test]
    fn any_bending_of_the_border_is_pushed_out_of_view() {
        let pre = pre_warped();
        let mut rng = fastrand::Rng::with_seed(5);
        for amplitude in [10.0, 40.0, 80.0] {
            let (fx, fy) = (rng.f64() * 0.03, rng.f64() * 0.03);
            let mut mesh = pre.clone();
            for v in &mut mesh.vertices {
                *v += Vec2::new((fy * v.y).sin(), (fx * v.x + 1.0).cos()) * amplitude;
            }
            let before = intrusion(&mesh);
            keep_covered(&mut mesh, &pre, W, H);
            let after = intrusion(&mesh);
            assert!(after < 0.05 * (1.0 + before / 10.0), "{amplitude}: {before} before, {after} after");
        }
    }

    #[test]
    fn a_source_that_just_covers_the_output_may_not_shrink_at_all() {
        let pre = warped(|p| p);
        let mut mesh = warped(|p| Point2::new(W / 2.0, H / 2.0) + (p - Point2::new(W / 2.0, H / 2.0)) * 0.98);
        assert!(keep_covered(&mut mesh, &pre, W, H) > 3.0);
        assert!(intrusion(&mesh) < 1e-9, "{}", intrusion(&mesh));
        let middle = mesh.vertices[9 * 33 + 16];
        assert!((middle - Point2::new(W / 2.0, H / 2.0)).norm() < 1e-9, "the middle is left to its anchors");
    }
}
