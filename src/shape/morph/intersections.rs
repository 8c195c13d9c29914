//! Self-intersections of a surface.
//!
//! Two triangles without a common edge intersect if an edge of one crosses the other; with a common vertex only the opposite edges
//! are tested. Coplanar triangles do not count. The signs are those of rounded determinants.

use nalgebra::{Point3, Vector3};

use super::bvh::Bvh;
use crate::mesh::TriMesh;
use plumbline_num::run::{Run, Stopped};

/// Largest number of tests of two triangles in a surface, and the same for each triangle: a few seconds. Surfaces need some dozens a
/// triangle.
const MAX_TESTS: usize = 50_000_000;
const MAX_TESTS_PER_TRIANGLE: usize = 1000;

/// Intersecting pairs of triangles, the lower index first; ascending. `None` where triangles lie so close to one another that it
/// takes more than 1000 tests of two of them for each, and over 50 million.
///
/// # Errors
/// [`Stopped`].
///
/// # Examples
/// ```
/// use plumbline_num::run::Run;
/// use plumbline_shape::mesh::shapes;
/// use plumbline_shape::morph::intersections::self_intersections;
///
/// let ball = shapes::icosphere(2);
/// assert_eq!(self_intersections(&ball, &Run::default())?, Some(vec![]));
/// # Ok::<(), plumbline_num::run::Stopped>(())
/// ```
pub fn self_intersections(mesh: &TriMesh, run: &Run) -> Result<Option<Vec<[u32; 2]>>, Stopped> {
    let mut found = Vec::new();
    let most = MAX_TESTS.max(MAX_TESTS_PER_TRIANGLE * mesh.triangle_count());
    let within = Bvh::new(mesh).pairs(
        most,
        |t, u| {
            if intersect(mesh, t as usize, u as usize) {
                found.push([t, u]);
            }
        },
        run,
    )?;
    found.sort_unstable();
    found.dedup();
    Ok(within.then_some(found))
}

/// An edge that crosses a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Crossing {
    pub(super) edge: [u32; 2],
    pub(super) triangle: u32,
}

fn intersect(mesh: &TriMesh, t: usize, u: usize) -> bool {
    crossings(mesh, t, u).next().is_some()
}

/// Edges of either triangle that cross the other.
pub(super) fn crossings(mesh: &TriMesh, t: usize, u: usize) -> impl Iterator<Item = Crossing> {
    let (a, b) = (mesh.triangles()[t], mesh.triangles()[u]);
    let (p, q) = (mesh.corners(t), mesh.corners(u));
    // Vertices at equal positions are identified: a texture seam is not an intersection.
    let same = |k: &usize| a[k / 3] == b[k % 3] || p[k / 3] == q[k % 3];
    let mut shared = (0..9).filter(same);
    let (first, second) = (shared.next(), shared.next());
    // With one common corner, the opposite edges; with a common edge, none.
    let of = move |corner: Option<usize>| {
        (0..3).filter(move |k| second.is_none() && corner.is_none_or(|c| (c + 1) % 3 == *k))
    };
    let edge = |of: &[u32; 3], k: usize| [of[k], of[(k + 1) % 3]];
    let ours = of(first.map(|k| k / 3)).filter(move |&k| crosses(&p[k], &p[(k + 1) % 3], &q));
    let theirs = of(first.map(|k| k % 3)).filter(move |&k| crosses(&q[k], &q[(k + 1) % 3], &p));
    let ours = ours.map(move |k| Crossing { edge: edge(&a, k), triangle: u as u32 });
    ours.chain(theirs.map(move |k| Crossing { edge: edge(&b, k), triangle: t as u32 }))
}

/// Whether the segment crosses the interior of the triangle.
fn crosses(from: &Point3<f64>, to: &Point3<f64>, [a, b, c]: &[Point3<f64>; 3]) -> bool {
    let volume = |p: &Point3<f64>, u: &Point3<f64>, v: &Point3<f64>, w: &Point3<f64>| -> f64 {
        let (u, v, w): (Vector3<f64>, Vector3<f64>, Vector3<f64>) = (u - p, v - p, w - p);
        u.dot(&v.cross(&w))
    };
    let (above, below) = (volume(from, a, b, c), volume(to, a, b, c));
    if !(above * below < 0.0) {
        return false;
    }
    let sides = [volume(from, to, a, b), volume(from, to, b, c), volume(from, to, c, a)];
    sides.iter().all(|s| *s > 0.0) || sides.iter().all(|s| *s < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    fn found(mesh: &TriMesh) -> Vec<[u32; 2]> {
        self_intersections(mesh, &Run::default()).expect("a run that never stops").expect("few tests")
    }

    #[test]
    fn triangles_that_all_overlap_are_not_tested_without_end() {
        let triangle = |k: usize| [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 1e-9 * k as f64]].map(Point3::from);
        let positions = (0..12_000).flat_map(triangle).collect();
        let layers = TriMesh::new(positions, (0..12_000).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect()).unwrap();
        assert_eq!(self_intersections(&layers, &Run::default()), Ok(None));
    }

    #[test]
    fn a_sphere_through_a_wall_intersects_it_along_a_circle_only() {
        let sphere = shapes::icosphere(2);
        assert!(found(&sphere).is_empty());
        let wall = shapes::plane(8);
        let placed: Vec<_> =
            wall.positions().iter().map(|p| Point3::new(6.0 * p.x - 3.03, 6.0 * p.y - 2.98, 0.11)).collect();
        let first = sphere.vertex_count() as u32;
        let positions = [sphere.positions(), &placed].concat();
        let moved = wall.triangles().iter().map(|t| t.map(|v| v + first));
        let both = TriMesh::new(positions, sphere.triangles().iter().copied().chain(moved).collect()).unwrap();
        let pairs = found(&both);
        let n = sphere.triangle_count() as u32;
        let strays = pairs.iter().filter(|[t, u]| *t >= n || *u < n).count();
        assert!(pairs.len() > 20 && strays == 0, "{} {strays}", pairs.len());
        // The same pairs as an exhaustive search.
        let mut all = Vec::new();
        for t in 0..both.triangle_count() {
            all.extend(
                (t + 1..both.triangle_count()).filter(|&u| intersect(&both, t, u)).map(|u| [t as u32, u as u32]),
            );
        }
        assert_eq!(pairs, all);
        for [t, _] in pairs {
            let z: Vec<f64> = sphere.corners(t as usize).iter().map(|p| p.z).collect();
            assert!(z.iter().any(|z| *z > 0.11) && z.iter().any(|z| *z < 0.11));
        }
    }

    #[test]
    fn neighbors_at_a_vertex_intersect_where_the_opposite_edge_crosses() {
        let p = [[0.0, 0.0, 0.0], [2.0, -1.0, 0.0], [2.0, 1.0, 0.0], [1.0, 0.1, 1.0], [1.0, 0.1, -1.0]];
        let mesh = TriMesh::new(p.map(Point3::from).to_vec(), vec![[0, 1, 2], [0, 3, 4]]).unwrap();
        assert_eq!(found(&mesh), [[0, 1]]);
        let apart = TriMesh::new(mesh.positions().to_vec(), vec![[0, 1, 2], [1, 3, 4]]).unwrap();
        assert_eq!(found(&apart), [[0, 1]]);
        let neighbors = TriMesh::new(mesh.positions().to_vec(), vec![[0, 1, 2], [1, 0, 4]]).unwrap();
        assert!(found(&neighbors).is_empty());
    }
}
