//! Laws of whole curves and of the joints on them.

use super::*;

#[test]
fn a_curve_has_as_many_loops_as_its_surface_has_handles() {
    let coarse = shapes::holed_torus(1, 6);
    for (name, mesh, handles) in [
        ("ball", shapes::icosphere(3), 0),
        ("bar", shapes::bar([4, 4, 20], [1.0, 1.0, 5.0]), 0),
        ("cactus", shapes::cactus(30), 0),
        ("torus", shapes::holed_torus(1, 16), 1),
        ("coarse torus", coarse, 1),
        ("two holes", shapes::holed_torus(2, 16), 2),
        ("three holes", shapes::holed_torus(3, 16), 3),
    ] {
        let (curve, report) = curve_of(&mesh);
        assert_eq!((report.handles, report.loops), (handles, handles), "{name}");
        assert_eq!(curve.edges.len() + 1, curve.nodes.len() + handles, "{name} is in pieces");
    }
}

#[test]
fn a_straight_capsule_gives_its_axis_and_a_bent_one_its_arc() {
    let straight = capsule(10.0, |s| (Point3::new(s, 0.0, 0.0), Vector3::x()));
    let (curve, report) = curve_of(&straight);
    assert_eq!((report.ends, report.junctions), (2, 0));
    for p in &curve.nodes {
        assert!(p.y.hypot(p.z) <= 0.01, "{p}");
    }
    for (length, radius) in [(10.0, 6.0), (4.0, 6.0)] {
        let bent = capsule(length, |s| {
            let a: f64 = s / radius;
            (Point3::new(radius * a.sin(), radius * (1.0 - a.cos()), 0.0), Vector3::new(a.cos(), a.sin(), 0.0))
        });
        let (curve, report) = curve_of(&bent);
        assert_eq!((report.ends, report.junctions), (2, 0));
        for p in &curve.nodes {
            let off = (p.x.hypot(p.y - radius) - radius).hypot(p.z);
            assert!(off <= 0.01, "{p} is {off} off");
        }
    }
}

#[test]
fn every_vertex_belongs_to_one_node_and_regions_are_connected() {
    let mesh = shapes::cactus(30);
    let (curve, _) = curve_of(&mesh);
    assert_eq!(curve.node_of_vertex.len(), mesh.vertex_count());
    let mut joined = UnionFind::new(mesh.vertex_count());
    let node = |v: usize| curve.node_of_vertex[v];
    for t in mesh.triangles() {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            if node(a as usize) == node(b as usize) {
                joined.join(a, b);
            }
        }
    }
    let mut pieces: Vec<(u32, u32)> = (0..mesh.vertex_count()).map(|v| (node(v), joined.root(v as u32))).collect();
    pieces.sort_unstable();
    pieces.dedup();
    let mut nodes: Vec<u32> = pieces.iter().map(|p| p.0).collect();
    nodes.dedup();
    assert!(nodes.iter().all(|n| (*n as usize) < curve.nodes.len()));
    assert_eq!(pieces.len(), nodes.len(), "a region is in pieces");
}

#[test]
fn the_curve_is_invariant_to_scale_rotation_and_position() {
    let mesh = shapes::cactus(30);
    let (curve, report) = curve_of(&mesh);
    let turn = Rotation3::from_euler_angles(0.3, 1.1, -0.7);
    let far = Vector3::new(1e6, -2e6, 5e5);
    let cases: [(&str, f64, Rotation3<f64>, Vector3<f64>); 4] = [
        ("scaled", 137.0, Rotation3::identity(), Vector3::zeros()),
        ("small", 1e-4, Rotation3::identity(), Vector3::zeros()),
        ("turned", 1.0, turn, Vector3::zeros()),
        ("moved", 1.0, Rotation3::identity(), far),
    ];
    for (name, scale, turn, by) in cases {
        let place = |p: &Point3<f64>| turn * (p * scale) + by;
        let (other, same) = curve_of(&moved(&mesh, place));
        assert_eq!(report, same, "{name}");
        assert_eq!((curve.edges.len(), &curve.node_of_vertex), (other.edges.len(), &other.node_of_vertex), "{name}");
        for (p, q) in curve.nodes.iter().zip(&other.nodes) {
            let off = nalgebra::distance(&place(p), q) / (mesh.diagonal() * scale);
            assert!(off <= 1e-6, "{name}: {off}");
        }
    }
}

#[test]
fn kept_vertices_end_a_branch() {
    let mesh = shapes::icosphere(3);
    let ends = vec![0, 7];
    let options = ExtractionOptions { keep: Keep::Vertices(ends.clone()), ..ExtractionOptions::default() };
    let (curve, _) = extract(&mesh, &options, &mut |_| ControlFlow::Continue(()), &Run::default()).unwrap();
    for v in ends {
        let p = mesh.positions()[v as usize];
        let (node, off) = (0..curve.nodes.len())
            .map(|n| (n, nalgebra::distance(&curve.nodes[n], &p)))
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap();
        assert!(off < 1e-9, "vertex {v} is {off} from the curve");
        assert_eq!(curve.edges.iter().flatten().filter(|n| **n as usize == node).count(), 1);
    }
    let options = ExtractionOptions { keep: Keep::Vertices(vec![9999]), ..ExtractionOptions::default() };
    let refused = extract(&mesh, &options, &mut |_| ControlFlow::Continue(()), &Run::default()).unwrap_err();
    assert_eq!(refused.to_string(), "vertex 9999 is to be kept, but the mesh has 642 vertices, numbered from 0");
}

#[test]
fn degenerate_surfaces_have_curves_too() {
    let whole = shapes::icosphere(3);
    let parts = shapes::disjoint(&[whole.clone(), shapes::one_triangle(), shapes::holed_torus(1, 12)]);
    for (name, mesh, parts) in [
        ("soup", shapes::soup(&whole), 1),
        ("plane", shapes::plane(12), 1),
        ("moebius", shapes::moebius(40, 4), 1),
        ("book", shapes::book(5), 1),
        ("hourglass", shapes::hourglass(), 1),
        ("parts", parts, 3),
    ] {
        let (curve, report) = curve_of(&mesh);
        assert_eq!(report.parts, parts, "{name}");
        assert_eq!(curve.node_of_vertex.len(), mesh.vertex_count());
        assert!(curve.nodes.iter().all(|p| p.coords.iter().all(|c| c.is_finite())), "{name}");
        let far = 0.2 * mesh.diagonal();
        let (low, high) = mesh.bounding_box().unwrap();
        let near = |p: &Point3<f64>| (0..3).all(|k| p[k] > low[k] - far && p[k] < high[k] + far);
        assert!(curve.nodes.iter().all(near), "{name} leaves its box");
    }
    let nothing = TriMesh::new(vec![Point3::origin(); 3], vec![[0, 1, 2]]).unwrap();
    let refused = extract(&nothing, &ExtractionOptions::default(), &mut |_| ControlFlow::Continue(()), &Run::default());
    assert!(refused.unwrap_err().to_string().starts_with("mesh has zero surface area"));
}

#[test]
fn iterations_are_reported_and_an_observer_can_stop_them() {
    let mesh = shapes::cactus(24);
    let mut left = vec![1.0];
    let mut iterations = 0;
    let stopped = extract(
        &mesh,
        &ExtractionOptions::default(),
        &mut |iteration| {
            left.push(iteration.area_left);
            iterations += 1;
            assert_eq!((iteration.part, iteration.parts, iteration.iteration), (0, 1, iterations));
            assert!(iteration.surface().triangle_count() > 0);
            if iterations == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        },
        &Run::default(),
    );
    assert_eq!(stopped.unwrap_err(), CharacterError::Interrupted(Stopped::Interrupted));
    assert!(left.len() == 4 && left[3] < 0.7, "{left:?}");
}

#[test]
fn options_are_checked() {
    let mesh = shapes::icosphere(1);
    for (options, message) in [
        (
            ExtractionOptions { prune: f64::NAN, ..ExtractionOptions::default() },
            "prune NaN is invalid (expected 0 to 100)",
        ),
        (
            ExtractionOptions { medial: 0.0, ..ExtractionOptions::default() },
            "medial 0 is invalid (expected 0.001 to 1000)",
        ),
    ] {
        let refused = extract(&mesh, &options, &mut |_| ControlFlow::Continue(()), &Run::default()).unwrap_err();
        assert_eq!(refused.to_string(), message);
    }
}

#[test]
fn joints_are_ends_junctions_and_bends_in_a_tree() {
    let mesh = shapes::cactus(30);
    let (curve, report) = curve_of(&mesh);
    let few = skeleton_of(&curve, Some(1)).unwrap();
    assert_eq!(few.joint_count(), report.ends + report.junctions);
    let many = skeleton_of(&curve, Some(30)).unwrap();
    assert_eq!(many.joint_count(), 30);
    assert_eq!(many.roots().count(), 1);
    for p in many.rest_positions() {
        assert!(curve.nodes.iter().any(|n| nalgebra::distance(n, &p) < 1e-9));
    }
    let joints = many.joints();
    for (j, joint) in joints.iter().enumerate().skip(1) {
        let parent = joint.parent.expect("one root") as usize;
        let along = parent == j - 1 || many.children(joints[j].parent.expect("one root")).len() > 1;
        assert!(along, "a limb is numbered from its begin to its end: {j} after {parent}");
    }
    let (ring, _) = curve_of(&shapes::holed_torus(1, 16));
    let tree = skeleton_of(&ring, None).unwrap();
    assert!(tree.joint_count() >= 3 && tree.roots().count() == 1, "a loop is cut once");
}

#[test]
fn sheets_have_as_many_loops_as_their_independent_cycles() {
    for (name, mesh, loops) in [("plane", shapes::plane(12), 0), ("moebius", shapes::moebius(40, 4), 1)] {
        let (curve, report) = curve_of(&mesh);
        assert_eq!((report.loops, report.handles), (loops, loops), "{name}");
        assert_eq!(curve.node_of_vertex.len(), mesh.vertex_count(), "{name}");
        let thick = sheet::thickened(&mesh).unwrap();
        assert_eq!(parts::handles(&thick.0), Some(loops), "{name}");
        assert!(!sheet::is_solid(&mesh, &mesh.vertex_normals(), &Run::default()), "{name}");
    }
    assert!(sheet::thickened(&shapes::book(5)).is_none(), "where three pages meet there are no two sides");
    let ball = shapes::icosphere(3);
    let open = TriMesh::new(ball.positions().to_vec(), ball.triangles()[40..].to_vec()).unwrap();
    assert!(sheet::is_solid(&open, &open.vertex_normals(), &Run::default()), "a ball with a hole has an inside");
}

#[test]
fn a_ball_has_one_short_bone() {
    let ball = shapes::icosphere(3);
    let small = moved(&ball, |p| Point3::from(p.coords * 0.5 + Vector3::x() * 3.0));
    let (curve, report) = curve_of(&shapes::disjoint(&[ball, small]));
    assert_eq!((report.parts, report.junctions), (2, 0));
    assert!(skeleton_of(&curve, None).unwrap().joint_count() <= 4);
}

#[test]
fn ends_do_not_depend_on_the_resolution() {
    for resolution in [24, 30, 40, 56] {
        let (_, report) = curve_of(&shapes::cactus(resolution));
        assert_eq!(report.ends, 4, "at {resolution}");
    }
}

#[test]
fn a_limb_that_is_cut_open_is_like_one_with_a_lid() {
    let whole = capsule(10.0, |s| (Point3::new(s, 0.0, 0.0), Vector3::x()));
    let kept = |t: &&[u32; 3]| t.iter().any(|v| whole.positions()[*v as usize].x < 10.0 - 1e-9);
    let triangles: Vec<[u32; 3]> = whole.triangles().iter().filter(kept).copied().collect();
    assert!(triangles.len() < whole.triangle_count());
    let open = TriMesh::new(whole.positions().to_vec(), triangles).unwrap();
    let (curve, report) = curve_of(&open);
    assert_eq!((report.ends, report.junctions, report.handles), (2, 0, 0));
    let end = curve.nodes.iter().map(|p| p.x).fold(0.0, f64::max);
    assert!(end > 8.5 && end < 10.0, "the curve ends at {end}");
    assert!(curve.nodes.iter().all(|p| p.y.hypot(p.z) < 0.1));
    assert_eq!(curve.node_of_vertex.len(), open.vertex_count());
}

#[test]
fn an_open_limb_may_come_inside_out() {
    let whole = capsule(10.0, |s| (Point3::new(s, 0.0, 0.0), Vector3::x()));
    let kept = |t: &usize| !t.is_multiple_of(97);
    let turned = (0..whole.triangle_count()).filter(kept).map(|t| whole.triangles()[t]).map(|[a, b, c]| [a, c, b]);
    let open = TriMesh::new(whole.positions().to_vec(), turned.collect()).unwrap();
    let (curve, report) = curve_of(&open);
    assert_eq!((report.ends, report.junctions), (2, 0));
    let off = curve.nodes.iter().map(|p| p.y.hypot(p.z)).fold(0.0, f64::max);
    assert!(off < 0.05, "{off} off the axis");
}

#[test]
fn corners_of_a_box_and_rims_of_a_cut_are_no_limbs() {
    for size in [[1.0, 1.0, 2.0], [1.0, 1.0, 3.0], [1.0, 1.0, 5.0]] {
        let bar = shapes::bar([10, 10, (10.0 * size[2]) as usize], size);
        let (curve, report) = curve_of(&bar);
        assert_eq!(report.ends, 2, "{size:?}");
        let (low, high) = bar.bounding_box().unwrap();
        let middle = nalgebra::center(&low, &high);
        for p in &curve.nodes {
            assert!((p - middle).xy().norm() < 0.15, "{size:?}: {p}");
        }
    }
}
