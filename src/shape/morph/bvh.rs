//! Boxes around boxes around triangles: the nearest place of a surface, and pairs of triangles that may meet.

use nalgebra::{Point3, Vector3};

use crate::mesh::TriMesh;
use plumbline_num::run::{Run, Stopped};

/// Triangles in a leaf.
const LEAF: usize = 4;

/// A place on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// The triangle.
    pub triangle: u32,
    /// Its barycentric coordinates, which sum to 1.
    pub weights: [f64; 3],
    /// Where it is.
    pub point: Point3<f64>,
    /// How far, squared.
    pub squared: f64,
}

#[derive(Clone, Debug)]
struct Node {
    low: Point3<f64>,
    high: Point3<f64>,
    /// Children, or a range of `order` where the second is 0.
    first: u32,
    second: u32,
    count: u32,
}

/// A hierarchy of boxes over the triangles of a mesh.
#[derive(Clone, Debug)]
pub struct Bvh {
    nodes: Vec<Node>,
    order: Vec<u32>,
    corners: Vec<[Point3<f64>; 3]>,
}

impl Bvh {
    /// The hierarchy of a mesh.
    pub fn new(mesh: &TriMesh) -> Self {
        let corners: Vec<[Point3<f64>; 3]> = (0..mesh.triangle_count()).map(|t| mesh.corners(t)).collect();
        let mut this = Self { nodes: Vec::new(), order: (0..corners.len() as u32).collect(), corners };
        if !this.order.is_empty() {
            this.build(0, this.order.len());
        }
        this
    }

    fn build(&mut self, start: usize, end: usize) -> u32 {
        let of = |t: &u32| self.corners[*t as usize];
        let all = self.order[start..end].iter().flat_map(of);
        let (low, high) = bounds(all);
        let number = self.nodes.len() as u32;
        self.nodes.push(Node { low, high, first: start as u32, second: 0, count: (end - start) as u32 });
        if end - start > LEAF {
            let axis = (high - low).imax();
            let corners = &self.corners;
            let middle = |t: &u32| corners[*t as usize].iter().map(|p| p[axis]).sum::<f64>();
            let half = usize::midpoint(start, end);
            self.order[start..end]
                .select_nth_unstable_by(half - start, |a, b| middle(a).total_cmp(&middle(b)).then(a.cmp(b)));
            let first = self.build(start, half);
            let second = self.build(half, end);
            (self.nodes[number as usize].first, self.nodes[number as usize].second) = (first, second);
        }
        number
    }

    /// The place nearest to a point among the triangles that are wanted; of equally near ones that of the lowest number. `None`
    /// where none is.
    pub fn nearest(&self, point: &Point3<f64>, wanted: impl Fn(u32) -> bool) -> Option<Nearest> {
        let mut best: Option<Nearest> = None;
        let mut stack = if self.nodes.is_empty() { vec![] } else { vec![(0, 0.0)] };
        while let Some((node, squared)) = stack.pop() {
            if best.is_some_and(|b| squared > b.squared) {
                continue;
            }
            let node: &Node = &self.nodes[node as usize];
            if node.second == 0 {
                for &t in &self.order[node.first as usize..(node.first + node.count) as usize] {
                    let (place, weights) = nearest_of_triangle(point, &self.corners[t as usize]);
                    let squared = (place - point).norm_squared();
                    let better = |b: Nearest| (squared, t) < (b.squared, b.triangle);
                    if best.is_none_or(better) && wanted(t) {
                        best = Some(Nearest { triangle: t, weights, point: place, squared });
                    }
                }
                continue;
            }
            let mut children = [node.first, node.second].map(|c| (c, self.distance(c, point)));
            children.sort_by(|a, b| b.1.total_cmp(&a.1));
            stack.extend(children);
        }
        best
    }

    fn distance(&self, node: u32, point: &Point3<f64>) -> f64 {
        let node = &self.nodes[node as usize];
        let clamped = point.sup(&node.low).inf(&node.high);
        (clamped - point).norm_squared()
    }

    /// Visits each pair of triangles `t < u` whose boxes meet.
    pub(super) fn pairs(&self, mut visit: impl FnMut(u32, u32), run: &Run) -> Result<(), Stopped> {
        let mut stack = if self.nodes.is_empty() { vec![] } else { vec![(0, 0)] };
        while let Some((a, b)) = stack.pop() {
            run.check()?;
            let (p, q) = (&self.nodes[a as usize], &self.nodes[b as usize]);
            if !meet((&p.low, &p.high), (&q.low, &q.high)) {
                continue;
            }
            match (p.second == 0, q.second == 0) {
                (true, true) => self.pairs_of_leaves(a == b, p, q, &mut visit),
                _ if a == b => stack.extend([(p.first, p.first), (p.second, p.second), (p.first, p.second)]),
                (false, _) if q.second == 0 || p.count >= q.count => stack.extend([(p.first, b), (p.second, b)]),
                _ => stack.extend([(a, q.first), (a, q.second)]),
            }
        }
        Ok(())
    }

    fn pairs_of_leaves(&self, same: bool, p: &Node, q: &Node, visit: &mut impl FnMut(u32, u32)) {
        let range = |n: &Node| n.first as usize..(n.first + n.count) as usize;
        for (i, &t) in self.order[range(p)].iter().enumerate() {
            let from = if same { i + 1 } else { 0 };
            for &u in &self.order[range(q)][from..] {
                let [a, b] = [t, u].map(|t| bounds(self.corners[t as usize]));
                if meet((&a.0, &a.1), (&b.0, &b.1)) {
                    visit(t.min(u), t.max(u));
                }
            }
        }
    }
}

fn bounds(points: impl IntoIterator<Item = Point3<f64>>) -> (Point3<f64>, Point3<f64>) {
    let start = (Point3::from(Vector3::repeat(f64::INFINITY)), Point3::from(Vector3::repeat(f64::NEG_INFINITY)));
    points.into_iter().fold(start, |(low, high), p| (low.inf(&p), high.sup(&p)))
}

fn meet(a: (&Point3<f64>, &Point3<f64>), b: (&Point3<f64>, &Point3<f64>)) -> bool {
    (0..3).all(|k| a.0[k] <= b.1[k] && b.0[k] <= a.1[k])
}

/// The nearest place of a triangle, by the part of the plane (corner, edge, inside) in which the point lies.
///
/// # Reference
/// C. Ericson, *Real-time collision detection*, 2005, section 5.1.5.
fn nearest_of_triangle(p: &Point3<f64>, [a, b, c]: &[Point3<f64>; 3]) -> (Point3<f64>, [f64; 3]) {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let at = |weights: [f64; 3]| (a + ab * weights[1] + ac * weights[2], weights);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return at([1.0, 0.0, 0.0]);
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return at([0.0, 1.0, 0.0]);
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let v = d1 / (d1 - d3);
        return at([1.0 - v, v, 0.0]);
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return at([0.0, 0.0, 1.0]);
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let w = d2 / (d2 - d6);
        return at([1.0 - w, 0.0, w]);
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return at([0.0, 1.0 - w, w]);
    }
    let sum = va + vb + vc;
    at([va / sum, vb / sum, vc / sum])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn the_nearest_place_is_the_one_that_looking_everywhere_finds() {
        let mesh = shapes::cactus(8);
        let bvh = Bvh::new(&mesh);
        let mut rng = fastrand::Rng::with_seed(4);
        let (low, high) = mesh.bounding_box().unwrap();
        for _ in 0..200 {
            let p = low + (high - low).component_mul(&Vector3::from_fn(|_, _| 1.4 * rng.f64() - 0.2));
            let odd = rng.bool();
            let wanted = |t: u32| !odd || t % 2 == 1;
            let found = bvh.nearest(&p, wanted).unwrap();
            let everywhere = (0..mesh.triangle_count() as u32).filter(|&t| wanted(t)).map(|t| {
                // Sampled: never nearer.
                let [a, b, c] = mesh.corners(t as usize);
                (0..=8)
                    .flat_map(move |i| (0..=8 - i).map(move |j| (f64::from(i) / 8.0, f64::from(j) / 8.0)))
                    .map(|(u, v)| (a + (b - a) * u + (c - a) * v - p).norm_squared())
                    .fold(f64::MAX, f64::min)
            });
            let sampled = everywhere.fold(f64::MAX, f64::min);
            assert!(wanted(found.triangle) && found.squared <= sampled + 1e-12, "{} {sampled}", found.squared);
            let corners = mesh.corners(found.triangle as usize);
            let place: Vector3<f64> = corners.iter().zip(found.weights).map(|(p, w)| p.coords * w).sum();
            assert!((place - found.point.coords).norm() < 1e-12 && found.weights.iter().all(|w| *w >= -1e-15));
            assert!(((found.point - p).norm_squared() - found.squared).abs() < 1e-15);
        }
        assert!(bvh.nearest(&low, |_| false).is_none());
    }
}
