//! Occlusion tests between vertices and bones, with a bounding volume hierarchy over the triangles.

use nalgebra::{Point3, Vector3};

use crate::mesh::TriMesh;
use plumbline_num::spatial::{BoxTree, Ray, ray_crosses_triangle};

/// Barycentric tolerance outside an edge: rays through the edges of symmetric models must not slip between two triangles. Rounding is
/// about 1e-15.
const EDGE: f64 = 1e-9;

/// First corner, the two edges from it, and the vertex indices.
#[derive(Clone, Copy, Debug)]
struct Triangle {
    a: Point3<f64>,
    ab: Vector3<f64>,
    ac: Vector3<f64>,
    corners: [u32; 3],
}

/// The triangles of a mesh in a bounding volume hierarchy.
#[derive(Debug)]
pub(super) struct Occluders {
    tree: BoxTree,
    /// In tree order.
    triangles: Vec<Triangle>,
}

impl Occluders {
    pub(super) fn new(mesh: &TriMesh) -> Self {
        let triangle = |t: &u32| {
            let [a, b, c] = mesh.corners(*t as usize);
            Triangle { a, ab: b - a, ac: c - a, corners: mesh.triangles()[*t as usize] }
        };
        let tree = BoxTree::of_triangles((0..mesh.triangle_count()).map(|t| mesh.corners(t)));
        let triangles = tree.order().iter().map(triangle).collect();
        Self { tree, triangles }
    }

    /// Whether a triangle not incident to `vertex` intersects the open segment from `from` to `to`.
    pub(super) fn between(&self, vertex: u32, from: &Point3<f64>, to: &Point3<f64>) -> bool {
        let ray = Ray::new(from, &(to - from));
        let mut found = false;
        self.tree.along(&ray, 1.0, |items| {
            found = found || self.triangles[items].iter().any(|t| !t.corners.contains(&vertex) && t.crossed(&ray));
            if found { f64::NEG_INFINITY } else { 1.0 }
        });
        found
    }
}

impl Triangle {
    /// Whether the open segment up to the ray parameter 1 intersects the triangle.
    fn crossed(&self, ray: &Ray) -> bool {
        ray_crosses_triangle(ray, &self.a, &self.ab, &self.ac)
            .is_some_and(|m| m.is_inside(EDGE) && m.t > 0.0 && m.t < 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::skinning::tests::tube;
    use super::*;

    #[test]
    fn the_tree_agrees_with_brute_force() {
        let (mesh, _, _) = tube(2, 20, 30);
        let occluders = Occluders::new(&mesh);
        let mut random = fastrand::Rng::with_seed(3);
        let (mut blocked, mut clear) = (0, 0);
        for _ in 0..2000 {
            let mut point =
                || Point3::new(random.f64() * 8.0 - 1.0, random.f64() * 4.0 - 2.0, random.f64() * 4.0 - 2.0);
            let (from, to) = (point(), point());
            let all = occluders
                .triangles
                .iter()
                .any(|t| !t.corners.contains(&7) && t.crossed(&Ray::new(&from, &(to - from))));
            assert_eq!(occluders.between(7, &from, &to), all);
            if all { blocked += 1 } else { clear += 1 }
        }
        assert!(blocked > 200 && clear > 200, "{blocked} {clear}");
    }

    #[test]
    fn a_segment_through_an_edge_along_an_axis_is_blocked() {
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
