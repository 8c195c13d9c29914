//! What lies between a vertex and a bone: a tree of boxes over the triangles.

use nalgebra::{Point3, Vector3};

use crate::mesh::TriMesh;

/// Triangles of a leaf.
const LEAF: usize = 4;
/// A segment that passes this close outside an edge, in barycentric coordinates, still meets the triangle: rays through the edges
/// of symmetric models must not slip between two triangles.
const EDGE: f64 = 1e-9;

/// A box, and its triangles or its two halves.
#[derive(Clone, Copy, Debug)]
struct Node {
    low: Vector3<f64>,
    high: Vector3<f64>,
    /// First triangle of a leaf; else the second half (the first follows the node).
    first: u32,
    /// Triangles of a leaf; 0 for a node with halves.
    count: u32,
}

/// A corner, the edges from it, and the three vertices.
#[derive(Clone, Copy, Debug)]
struct Triangle {
    a: Point3<f64>,
    ab: Vector3<f64>,
    ac: Vector3<f64>,
    corners: [u32; 3],
}

/// The triangles of a mesh, sorted in space.
#[derive(Debug)]
pub(super) struct Occluders {
    nodes: Vec<Node>,
    triangles: Vec<Triangle>,
}

impl Occluders {
    pub(super) fn new(mesh: &TriMesh) -> Self {
        let triangle = |t: usize| {
            let [a, b, c] = mesh.corners(t);
            Triangle { a, ab: b - a, ac: c - a, corners: mesh.triangles()[t] }
        };
        let mut triangles: Vec<Triangle> = (0..mesh.triangle_count()).map(triangle).collect();
        let mut nodes = Vec::with_capacity(triangles.len());
        if !triangles.is_empty() {
            let end = triangles.len();
            split(&mut triangles, 0, end, &mut nodes);
        }
        Self { nodes, triangles }
    }

    /// Whether a triangle that does not have `vertex` for a corner meets the segment from `from` to `to`, ends left out.
    pub(super) fn between(&self, vertex: u32, from: &Point3<f64>, to: &Point3<f64>) -> bool {
        let along = to - from;
        let inverse = along.map(|c| 1.0 / c);
        let mut stack = vec![0_u32];
        while let Some(n) = stack.pop() {
            let Some(node) = self.nodes.get(n as usize) else { return false };
            if !meets(node, from, &inverse) {
                continue;
            }
            if node.count == 0 {
                stack.extend([n + 1, node.first]);
                continue;
            }
            let leaf = &self.triangles[node.first as usize..][..node.count as usize];
            if leaf.iter().any(|t| !t.corners.contains(&vertex) && t.crossed(from, &along)) {
                return true;
            }
        }
        false
    }
}

/// Whether a segment meets a box, slab by slab.
fn meets(node: &Node, from: &Point3<f64>, inverse: &Vector3<f64>) -> bool {
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for k in 0..3 {
        if inverse[k].is_infinite() {
            // Across the axis; in the slab all along, or never.
            if from[k] < node.low[k] || from[k] > node.high[k] {
                return false;
            }
            continue;
        }
        let (a, b) = ((node.low[k] - from[k]) * inverse[k], (node.high[k] - from[k]) * inverse[k]);
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    // Rounding must not lose a triangle on the side of its box.
    enter <= leave * (1.0 + 1e-12) + 1e-12
}

impl Triangle {
    fn middle(&self) -> Vector3<f64> {
        self.a.coords + (self.ab + self.ac) / 3.0
    }

    /// Möller and Trumbore's intersection, within the segment.
    fn crossed(&self, from: &Point3<f64>, along: &Vector3<f64>) -> bool {
        let p = along.cross(&self.ac);
        let det = self.ab.dot(&p);
        if det == 0.0 {
            return false;
        }
        let s = from - self.a;
        let u = s.dot(&p) / det;
        let q = s.cross(&self.ab);
        let v = along.dot(&q) / det;
        let t = self.ac.dot(&q) / det;
        u >= -EDGE && v >= -EDGE && u + v <= 1.0 + EDGE && t > 0.0 && t < 1.0
    }
}

/// Sorts triangles `start .. end` into a tree; halves by the median along the longest side.
fn split(triangles: &mut [Triangle], start: usize, end: usize, nodes: &mut Vec<Node>) {
    let own = &mut triangles[start..end];
    let mut low = Vector3::repeat(f64::INFINITY);
    let mut high = -low;
    for t in own.iter() {
        for p in [t.a.coords, t.a.coords + t.ab, t.a.coords + t.ac] {
            low = low.inf(&p);
            high = high.sup(&p);
        }
    }
    let n = nodes.len();
    nodes.push(Node { low, high, first: start as u32, count: (end - start) as u32 });
    if end - start <= LEAF {
        return;
    }
    let axis = (high - low).imax();
    let half = own.len() / 2;
    own.select_nth_unstable_by(half, |a, b| a.middle()[axis].total_cmp(&b.middle()[axis]));
    split(triangles, start, start + half, nodes);
    let second = nodes.len() as u32;
    split(triangles, start + half, end, nodes);
    nodes[n].first = second;
    nodes[n].count = 0;
}

#[cfg(test)]
mod tests {
    use super::super::super::skinning::tests::tube;
    use super::*;

    #[test]
    fn the_tree_finds_what_looking_at_every_triangle_finds() {
        let (mesh, _, _) = tube(2, 20, 30);
        let occluders = Occluders::new(&mesh);
        let mut random = fastrand::Rng::with_seed(3);
        let (mut blocked, mut clear) = (0, 0);
        for _ in 0..2000 {
            let mut point =
                || Point3::new(random.f64() * 8.0 - 1.0, random.f64() * 4.0 - 2.0, random.f64() * 4.0 - 2.0);
            let (from, to) = (point(), point());
            let all = occluders.triangles.iter().any(|t| !t.corners.contains(&7) && t.crossed(&from, &(to - from)));
            assert_eq!(occluders.between(7, &from, &to), all);
            if all { blocked += 1 } else { clear += 1 }
        }
        assert!(blocked > 200 && clear > 200, "{blocked} {clear}");
    }

    #[test]
    fn a_segment_along_an_axis_through_an_edge_is_seen() {
        let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [5.0, 5.0, 5.0]];
        let mesh = TriMesh::new(positions.map(Point3::from).to_vec(), vec![[0, 1, 2], [0, 2, 3]]).expect("valid");
        let occluders = Occluders::new(&mesh);
        let (from, to) = (Point3::new(0.5, 0.5, 1.0), Point3::new(0.5, 0.5, -1.0));
        assert!(occluders.between(4, &from, &to));
        // Along the side of the box.
        assert!(occluders.between(4, &Point3::new(1.0, 0.5, 1.0), &Point3::new(1.0, 0.5, -1.0)));
        assert!(!occluders.between(4, &from, &Point3::new(0.5, 0.5, 0.5)));
        assert!(!occluders.between(0, &from, &to), "both triangles have the vertex");
    }
}
