//! Where a surface is nearest, and where rays meet it: a tree of boxes around its triangles.
//!
//! Triangles are halved by the middle of the widest axis of their centers until few are left; a node stands before its left
//! half, so that the tree is one array.
//!
//! A place is inside where the surface goes round it, once or more: limbs that pass into one another have one inside. Where the triangles at
//! an edge are not oriented alike there is no telling how often it does; there, what is met an odd number of times is inside.

use nalgebra::{Point3, Vector3};

use super::caps;

/// Triangles by place.
pub(super) struct AabbTree {
    nodes: Vec<Node>,
    corners: Vec<[Point3<f64>; 3]>,
    /// Unit normal of each triangle, zero where it has none.
    normals: Vec<Vector3<f64>>,
    /// Whether each half-edge has one that runs the other way.
    oriented: bool,
}

struct Node {
    low: Point3<f64>,
    high: Point3<f64>,
    /// Triangles of a leaf; none in a node with halves.
    triangles: std::ops::Range<u32>,
    /// The node of the right half; the left one follows its node.
    right: u32,
}

/// Triangles of a leaf at most.
const LEAF: usize = 4;

impl AabbTree {
    pub(super) fn new(positions: &[Point3<f64>], triangles: &[[u32; 3]]) -> Self {
        let mut corners: Vec<_> = triangles.iter().map(|t| t.map(|v| positions[v as usize])).collect();
        let mut nodes = Vec::with_capacity(corners.len());
        if !corners.is_empty() {
            divide(&mut corners, 0, &mut nodes);
        }
        let normal = |[a, b, c]: &[Point3<f64>; 3]| (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_default();
        Self {
            nodes,
            normals: corners.iter().map(normal).collect(),
            corners,
            oriented: caps::boundary(triangles).is_empty(),
        }
    }

    /// The point of the surface nearest to `p`.
    pub(super) fn nearest(&self, p: &Point3<f64>) -> Option<Point3<f64>> {
        let mut best = (Point3::origin(), f64::INFINITY);
        if !self.nodes.is_empty() {
            self.near(0, p, &mut best);
        }
        (best.1 < f64::INFINITY).then_some(best.0)
    }

    /// The point of the surface nearest to `p`, found the sooner the nearer to `p` the `guess` is, a point of the surface.
    pub(super) fn nearest_from(&self, p: &Point3<f64>, guess: &Point3<f64>) -> Point3<f64> {
        let mut best = (*guess, nalgebra::distance_squared(p, guess));
        self.near(0, p, &mut best);
        best.0
    }

    fn near(&self, at: usize, p: &Point3<f64>, best: &mut (Point3<f64>, f64)) {
        let node = &self.nodes[at];
        if !node.triangles.is_empty() {
            for t in node.triangles.clone() {
                // No point of a triangle is nearer than its plane.
                if self.normals[t as usize].dot(&(p - self.corners[t as usize][0])).powi(2) >= best.1 {
                    continue;
                }
                let q = nearest_of_triangle(p, &self.corners[t as usize]);
                let d = nalgebra::distance_squared(p, &q);
                if d < best.1 {
                    *best = (q, d);
                }
            }
            return;
        }
        let halves = [at + 1, node.right as usize].map(|n| (n, self.nodes[n].squared_distance(p)));
        let [first, second] = if halves[1].1 < halves[0].1 { [halves[1], halves[0]] } else { halves };
        for (half, distance) in [first, second] {
            if distance < best.1 {
                self.near(half, p, best);
            }
        }
    }

    /// Parameter `t > 0` of the first point `origin + t direction` on the surface.
    pub(super) fn first_hit(&self, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<f64> {
        let mut first = f64::INFINITY;
        self.along(&Ray::new(origin, direction), first, &mut |t, _| {
            first = t;
            t
        });
        (first < f64::INFINITY).then_some(first)
    }

    /// True where the surface is met by `origin + t direction` for `0 < t ≤ until`.
    pub(super) fn is_hit(&self, origin: &Point3<f64>, direction: &Vector3<f64>, until: f64) -> bool {
        let mut hit = false;
        self.along(&Ray::new(origin, direction), until, &mut |_, _| {
            hit = true;
            f64::NEG_INFINITY
        });
        hit
    }

    /// True where the surface goes round `p`, by the majority of three directions.
    pub(super) fn encloses(&self, p: &Point3<f64>) -> bool {
        // No direction that a modeler would choose for an edge.
        const DIRECTIONS: [[f64; 3]; 3] = [[0.751, 0.433, 0.499], [-0.267, 0.802, -0.534], [0.302, -0.503, 0.810]];
        let inside = |d: [f64; 3]| {
            let (mut count, mut turns) = (0, 0);
            self.along(&Ray::new(p, &Vector3::from(d)), f64::INFINITY, &mut |_, leaves| {
                count += 1;
                turns += if leaves { 1 } else { -1 };
                f64::INFINITY
            });
            if self.oriented { turns != 0 } else { count % 2 == 1 }
        };
        let [first, second, third] = DIRECTIONS;
        let said = inside(first);
        if inside(second) == said { said } else { inside(third) }
    }

    /// Calls `meet` for points of the surface up to the parameter `until`, near boxes first, and with whether the ray leaves there; it returns
    /// up to where others matter.
    fn along(&self, ray: &Ray, mut until: f64, meet: &mut impl FnMut(f64, bool) -> f64) {
        // A direction of no length enters every box and meets nothing.
        let leads_on = ray.direction.norm_squared() > 0.0;
        if leads_on && self.nodes.first().and_then(|root| root.entry(ray)).is_some() {
            self.follow(0, ray, &mut until, meet);
        }
    }

    fn follow(&self, at: usize, ray: &Ray, until: &mut f64, meet: &mut impl FnMut(f64, bool) -> f64) {
        let node = &self.nodes[at];
        if !node.triangles.is_empty() {
            for t in node.triangles.clone() {
                let met = meets(&ray.origin, &ray.direction, &self.corners[t as usize]);
                if let Some((t, leaves)) = met.filter(|(t, _)| t <= until) {
                    *until = meet(t, leaves);
                }
            }
            return;
        }
        let [left, right] = [at + 1, node.right as usize].map(|n| (n, self.nodes[n].entry(ray)));
        for (half, entry) in if right.1 < left.1 { [right, left] } else { [left, right] } {
            if entry.is_some_and(|t| t <= *until) {
                self.follow(half, ray, until, meet);
            }
        }
    }
}

/// A half-line, and one over its direction.
struct Ray {
    origin: Point3<f64>,
    direction: Vector3<f64>,
    inverse: Vector3<f64>,
}

impl Ray {
    fn new(origin: &Point3<f64>, direction: &Vector3<f64>) -> Self {
        Self { origin: *origin, direction: *direction, inverse: direction.map(|c| 1.0 / c) }
    }
}

fn divide(corners: &mut [[Point3<f64>; 3]], first: usize, nodes: &mut Vec<Node>) {
    let all = corners.iter().flatten();
    let (low, high) = all.fold((corners[0][0], corners[0][0]), |(low, high), p| (low.inf(p), high.sup(p)));
    let at = nodes.len();
    let leaf = corners.len() <= LEAF;
    let triangles = if leaf { first as u32..(first + corners.len()) as u32 } else { 0..0 };
    nodes.push(Node { low, high, triangles, right: 0 });
    if leaf {
        return;
    }
    let axis = (high - low).imax();
    let center = |t: &[Point3<f64>; 3]| t[0][axis] + t[1][axis] + t[2][axis];
    let middle = corners.len() / 2;
    corners.select_nth_unstable_by(middle, |a, b| center(a).total_cmp(&center(b)));
    let (left, right) = corners.split_at_mut(middle);
    divide(left, first, nodes);
    nodes[at].right = nodes.len() as u32;
    divide(right, first + middle, nodes);
}

impl Node {
    fn squared_distance(&self, p: &Point3<f64>) -> f64 {
        (self.low - p).sup(&(p - self.high)).sup(&Vector3::zeros()).norm_squared()
    }

    /// Where a ray enters the box, 0 from within; `None` where it does not.
    fn entry(&self, ray: &Ray) -> Option<f64> {
        let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
        for k in 0..3 {
            let [a, b] = [self.low[k], self.high[k]].map(|side| (side - ray.origin[k]) * ray.inverse[k]);
            // A ray in the plane of a side gives NaN, which min and max pass over.
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        (enter <= leave).then_some(enter)
    }
}

/// The point of a triangle nearest to `p` (C. Ericson, *Real-Time Collision Detection*, section 5.1.5).
fn nearest_of_triangle(p: &Point3<f64>, [a, b, c]: &[Point3<f64>; 3]) -> Point3<f64> {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return *a;
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return *b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return *c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let sum = va + vb + vc;
    a + ab * (vb / sum) + ac * (vc / sum)
}

/// Parameter at which a ray meets a triangle, and whether it goes the way of its normal (T. Möller, B. Trumbore, *Fast, minimum storage
/// ray/triangle intersection*, 1997).
fn meets(o: &Point3<f64>, d: &Vector3<f64>, [a, b, c]: &[Point3<f64>; 3]) -> Option<(f64, bool)> {
    let (e1, e2) = (b - a, c - a);
    let p = d.cross(&e2);
    let det = e1.dot(&p);
    if det == 0.0 {
        return None;
    }
    let s = o - a;
    let u = s.dot(&p) / det;
    let q = s.cross(&e1);
    let v = d.dot(&q) / det;
    let t = e2.dot(&q) / det;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some((t, det < 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn nearest_points_and_hits_are_those_that_a_search_of_all_finds() {
        let mesh = shapes::holed_torus(2, 8);
        let tree = AabbTree::new(mesh.positions(), mesh.triangles());
        for k in 0..100 {
            let k = f64::from(k);
            let p = Point3::new((k * 0.37).sin() * 2.0, (k * 0.73).cos(), (k * 1.31).sin() * 0.5);
            let d = Vector3::new((k * 0.91).cos(), (k * 0.17).sin(), (k * 0.53).cos());
            let all = || (0..mesh.triangle_count()).map(|t| mesh.corners(t));
            let near =
                all().map(|t| nalgebra::distance(&p, &nearest_of_triangle(&p, &t))).fold(f64::INFINITY, f64::min);
            let hit = all().filter_map(|t| meets(&p, &d, &t)).map(|(t, _)| t).fold(f64::INFINITY, f64::min);
            assert!((nalgebra::distance(&tree.nearest(&p).unwrap(), &p) - near).abs() < 1e-14);
            let guess = mesh.positions()[k as usize];
            assert!((nalgebra::distance(&tree.nearest_from(&p, &guess), &p) - near).abs() < 1e-14);
            assert_eq!(tree.first_hit(&p, &d).unwrap_or(f64::INFINITY), hit);
            assert_eq!(tree.is_hit(&p, &d, 0.7), hit <= 0.7);
        }
        for nowhere in [Vector3::zeros(), Vector3::repeat(f64::NAN)] {
            assert!(tree.first_hit(&Point3::origin(), &nowhere).is_none());
        }
    }

    #[test]
    fn inside_is_inside() {
        let mesh = shapes::icosphere(3);
        let tree = AabbTree::new(mesh.positions(), mesh.triangles());
        assert!(tree.encloses(&Point3::new(0.1, 0.2, 0.3)) && tree.encloses(&Point3::new(0.0, 0.0, 0.98)));
        assert!(!tree.encloses(&Point3::new(0.0, 1.01, 0.0)) && !tree.encloses(&Point3::new(5.0, 0.0, 0.0)));
    }

    #[test]
    fn what_two_balls_share_is_inside_and_without_orientation_what_is_met_oddly() {
        let ball = shapes::icosphere(3);
        let beside: Vec<_> = ball.positions().iter().map(|p| p + Vector3::x()).collect();
        let positions = [ball.positions(), &beside].concat();
        let n = ball.vertex_count() as u32;
        let other = ball.triangles().iter().map(|t| t.map(|v| v + n));
        let mut triangles: Vec<[u32; 3]> = ball.triangles().iter().copied().chain(other).collect();
        let (shared, own) = (Point3::new(0.5, 0.01, 0.02), Point3::new(-0.5, 0.01, 0.02));
        let tree = AabbTree::new(&positions, &triangles);
        assert!(tree.encloses(&shared) && tree.encloses(&own));
        triangles[0].swap(0, 1);
        let tree = AabbTree::new(&positions, &triangles);
        assert!(!tree.encloses(&shared) && tree.encloses(&own));
    }
}
