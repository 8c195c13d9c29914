//! Laws of extraction on procedural shapes.

use std::ops::ControlFlow;

use nalgebra::{Point3, Rotation3, Vector3};

use super::*;
use crate::mesh::shapes;
use plumbline_num::run::{Run, Stopped};

fn curve_of(mesh: &TriMesh) -> (CurveSkeleton, ExtractionReport) {
    extract(mesh, &ExtractionOptions::default(), &mut |_| ControlFlow::Continue(()), &Run::default()).unwrap()
}

fn moved(mesh: &TriMesh, place: impl Fn(&Point3<f64>) -> Point3<f64>) -> TriMesh {
    mesh.with_positions(mesh.positions().iter().map(place).collect()).unwrap()
}

/// A capsule of radius 1 about a curve of unit speed in the plane `z = 0`, `length` long.
fn capsule(length: f64, along: impl Fn(f64) -> (Point3<f64>, Vector3<f64>)) -> TriMesh {
    let (around, rings, caps) = (32, 60, 10);
    let mut profile: Vec<(f64, f64)> = Vec::new();
    let quarter = std::f64::consts::FRAC_PI_2;
    profile.extend((1..caps).map(|k| {
        let a = quarter * f64::from(k) / f64::from(caps);
        (-a.cos(), a.sin())
    }));
    profile.extend((0..=rings).map(|k| (length * f64::from(k) / f64::from(rings), 1.0)));
    profile.extend((1..caps).rev().map(|k| {
        let a = quarter * f64::from(k) / f64::from(caps);
        (length + a.cos(), a.sin())
    }));
    let frame = |s: f64| {
        let (p, t) = along(s.clamp(0.0, length));
        (p + t * (s - s.clamp(0.0, length)), Vector3::new(-t.y, t.x, 0.0), Vector3::z())
    };
    let mut positions = vec![frame(-1.0).0];
    for &(s, r) in &profile {
        let (p, u, v) = frame(s);
        positions.extend((0..around).map(|k| {
            let a = std::f64::consts::TAU * f64::from(k) / f64::from(around);
            p + (u * a.cos() + v * a.sin()) * r
        }));
    }
    positions.push(frame(length + 1.0).0);
    let last = positions.len() as u32 - 1;
    let n = around as u32;
    let mut triangles = Vec::new();
    for k in 0..n {
        let next = (k + 1) % n;
        triangles.push([0, 1 + next, 1 + k]);
        for ring in 0..profile.len() as u32 - 1 {
            let (a, b) = (1 + ring * n + k, 1 + ring * n + next);
            triangles.extend([[a, b, b + n], [a, b + n, a + n]]);
        }
        let ring = 1 + (profile.len() as u32 - 1) * n;
        triangles.push([last, ring + k, ring + next]);
    }
    TriMesh::new(positions, triangles).unwrap()
}

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
    assert_eq!(refused.unwrap_err().to_string(), "mesh has zero surface area");
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
            "medial 0 is invalid (expected more than 0, at most 1000)",
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
        assert!(!sheet::is_solid(&mesh, &mesh.vertex_normals()), "{name}");
    }
    assert!(sheet::thickened(&shapes::book(5)).is_none(), "where three pages meet there are no two sides");
    let ball = shapes::icosphere(3);
    let open = TriMesh::new(ball.positions().to_vec(), ball.triangles()[40..].to_vec()).unwrap();
    assert!(sheet::is_solid(&open, &open.vertex_normals()), "a ball with a hole has an inside");
}

#[test]
fn a_ball_has_one_short_bone() {
    let ball = shapes::icosphere(3);
    let small = moved(&ball, |p| Point3::from(p.coords * 0.5 + Vector3::x() * 3.0));
    let (curve, report) = curve_of(&shapes::disjoint(&[ball, small]));
    assert_eq!((report.parts, report.junctions), (2, 0));
    assert!(skeleton_of(&curve, None).unwrap().joint_count() <= 4);
}

/// A row of nodes beside the axis of a capsule, and a side branch of one node from its middle.
fn comb(from: f64, to: f64, side: f64) -> curve_graph::CurveGraph {
    let along = |k: usize| from + (to - from) * k as f64 / 20.0;
    let mut nodes: Vec<_> = (0..=20).map(|k| Point3::new(along(k), 0.02, 0.01)).collect();
    let mut edges: Vec<[u32; 2]> = (0..20).map(|k| [k, k + 1]).collect();
    nodes.push(Point3::new(along(10), side, 0.0));
    edges.push([10, 21]);
    curve_graph::CurveGraph::new(nodes, &edges, Vec::new())
}

#[test]
fn branches_covered_by_the_rest_are_pruned() {
    let mesh = capsule(10.0, |s| (Point3::new(s, 0.0, 0.0), Vector3::x()));
    let tree = aabb::AabbTree::new(mesh.positions(), mesh.triangles());
    for side in [0.3, 0.9] {
        let mut graph = comb(0.0, 10.0, side);
        let radii = centering::radii(&graph, &tree);
        pruning::prune(&mut graph, &tree, &radii, 1.0, &Run::default()).expect("a run that never stops");
        assert_eq!(graph.alive().filter(|v| graph.degree(*v) == 1).count(), 2, "a branch {side} long");
        assert!([0, 20].iter().all(|v| graph.is_alive(*v)), "the ends of the capsule stay");
        let mut all = comb(0.0, 10.0, side);
        pruning::prune(&mut all, &tree, &radii, 0.0, &Run::default()).expect("a run that never stops");
        assert!(all.is_alive(21), "nothing goes at zero");
    }
}

#[test]
fn the_curve_ends_at_a_tip_that_it_runs_through() {
    let mut graph = comb(0.0, 2.0, 0.5);
    let (knot, end) = (5, (0..21).find(|v| graph.degree(*v) == 1).unwrap());
    let sides: Vec<u32> = graph.neighbors(knot).to_vec();
    assert_eq!(sides.len(), 2);
    graph.nodes[knot as usize].y = 3.0;
    for node in [knot, end] {
        let tip = graph.nodes[node as usize] + Vector3::new(0.0, 0.7, 0.2);
        tips::end_at(&mut graph, &[(node, tip)]);
        let ends = graph.alive().filter(|v| graph.degree(*v) == 1 && graph.nodes[*v as usize] == tip);
        assert_eq!(ends.count(), 1);
    }
    let [p, q] = [sides[0], sides[1]].map(|v| graph.nodes[v as usize]);
    assert_eq!((graph.degree(knot), graph.nodes[knot as usize]), (3, nalgebra::center(&p, &q)));
}

#[test]
fn ends_come_to_the_center_of_the_cap_from_both_sides() {
    let mesh = capsule(10.0, |s| (Point3::new(s, 0.0, 0.0), Vector3::x()));
    let tree = aabb::AabbTree::new(mesh.positions(), mesh.triangles());
    for (from, to) in [(2.0, 8.0), (-0.9, 10.9)] {
        let mut graph = comb(from, to, 0.0);
        graph.merge(21, 10);
        tips::trim(&mut graph, &tree, &|p| tree.encloses(p));
        tips::extend(&mut graph, &tree);
        let ends: Vec<f64> =
            graph.alive().filter(|v| graph.degree(*v) == 1).map(|v| graph.nodes[v as usize].x).collect();
        assert_eq!(ends.len(), 2);
        for end in ends {
            let off = end.min((10.0 - end).abs()).abs();
            assert!(off < 0.35, "from {from} to {to}: an end at {end}");
        }
    }
}

#[test]
fn smoothing_preserves_constants_and_sums_and_reaches_farther_where_the_shape_is_wide() {
    let graph = comb(0.0, 2.0, 0.5);
    let alive: Vec<u32> = graph.alive().collect();
    let spread = |radius: f64| {
        let radii = vec![radius; graph.nodes.len()];
        let mut fairing = fairing::Fairing::new(&graph, &alive, &radii, 0.5, |_| false, &Run::default()).unwrap();
        let mut same = vec![Vector3::new(1.0, -2.0, 3.0); graph.nodes.len()];
        fairing.apply(&mut same);
        assert!(same.iter().all(|v| (v - Vector3::new(1.0, -2.0, 3.0)).norm() < 1e-9));
        let mut one = vec![Vector3::zeros(); graph.nodes.len()];
        one[5] = Vector3::x();
        fairing.apply(&mut one);
        assert!((one.iter().sum::<Vector3<f64>>() - Vector3::x()).norm() < 1e-9);
        one[5].x
    };
    assert!(spread(0.05) > 0.5 && spread(1.0) < 0.2, "{} {}", spread(0.05), spread(1.0));
}

#[test]
fn a_visible_curve_does_not_move() {
    let mesh = capsule(10.0, |s| (Point3::new(s, 0.0, 0.0), Vector3::x()));
    let tree = aabb::AabbTree::new(mesh.positions(), mesh.triangles());
    let mut graph = comb(0.0, 10.0, 0.3);
    let before = graph.nodes.clone();
    sight::draw(&mut graph, &tree, mesh.positions(), &Run::default()).unwrap();
    assert!(graph.nodes.iter().zip(&before).all(|(p, q)| nalgebra::distance(p, q) < 1e-9));
}

#[test]
fn an_edge_that_passes_outside_goes_round() {
    let half = std::f64::consts::PI;
    let arch = capsule(2.0 * half, |s| {
        let a = half - 0.5 * s;
        (Point3::new(2.0 * a.cos(), 2.0 * a.sin(), 0.0), Vector3::new(a.sin(), -a.cos(), 0.0))
    });
    let tree = aabb::AabbTree::new(arch.positions(), arch.triangles());
    let feet = vec![Point3::new(-2.0, 0.1, 0.0), Point3::new(2.0, 0.1, 0.0)];
    let mut graph = curve_graph::CurveGraph::new(feet, &[[0, 1]], vec![0; arch.vertex_count()]);
    centering::keep_inside(&mut graph, &tree);
    let mut length = 0.0;
    for v in graph.alive() {
        for u in graph.neighbors(v).iter().filter(|u| v < **u) {
            length += graph.length(v, *u);
            for t in [0.1, 0.3, 0.5, 0.7, 0.9] {
                let place = graph.nodes[v as usize] + (graph.nodes[*u as usize] - graph.nodes[v as usize]) * t;
                assert!(tree.encloses(&place), "{place} is outside");
            }
        }
    }
    assert!(length < 2.0 * half, "{length}: longer than the axis of the arch");
}

#[test]
fn centering_converges() {
    let bar = shapes::bar([8, 8, 40], [1.0, 1.0, 5.0]);
    let tree = aabb::AabbTree::new(bar.positions(), bar.triangles());
    let middle = bar.positions().iter().map(|p| p.coords).sum::<Vector3<f64>>() / bar.vertex_count() as f64;
    let nodes: Vec<_> =
        (0..40).map(|k| Point3::from(middle + Vector3::new(0.2, 0.1, -2.0 + 0.1 * f64::from(k)))).collect();
    let edges: Vec<[u32; 2]> = (1..40).map(|k| [k - 1, k]).collect();
    let after = |passes: usize| {
        let mut graph = curve_graph::CurveGraph::new(nodes.clone(), &edges, vec![0; 1]);
        centering::center(&mut graph, &tree, true, passes, &Run::default()).unwrap();
        graph.nodes
    };
    let inner = |nodes: &[Point3<f64>]| nodes[8..32].iter().map(|p| (p.coords - middle).xy()).collect::<Vec<_>>();
    let moved = |passes: usize| {
        let (before, now) = (inner(&after(passes)), inner(&after(passes + 1)));
        before.iter().zip(&now).map(|(p, q)| (p - q).norm()).fold(0.0, f64::max)
    };
    let (early, late) = (moved(6), moved(30));
    assert!(late < 0.5 * early, "{late} after thirty passes, {early} after six");
    assert!(inner(&after(30)).iter().all(|off| off.norm() < 0.05));
}

#[test]
fn ends_do_not_depend_on_the_resolution() {
    for resolution in [24, 30, 40, 56] {
        let (_, report) = curve_of(&shapes::cactus(resolution));
        assert_eq!(report.ends, 4, "at {resolution}");
    }
}

/// A row of nodes through the points, with edges about a twentieth long.
fn row(places: &[[f64; 3]]) -> curve_graph::CurveGraph {
    let mut nodes = vec![Point3::from(places[0])];
    for pair in places.windows(2) {
        let [p, q] = [pair[0], pair[1]].map(Point3::from);
        let parts = (nalgebra::distance(&p, &q) / 0.05).ceil();
        nodes.extend((1..=parts as usize).map(|k| p + (q - p) * (k as f64 / parts)));
    }
    let edges: Vec<[u32; 2]> = (1..nodes.len() as u32).map(|k| [k - 1, k]).collect();
    curve_graph::CurveGraph::new(nodes, &edges, Vec::new())
}

#[test]
fn detours_are_removed_and_a_bent_limb_is_kept() {
    let mesh = capsule(10.0, |s| (Point3::new(s, 0.0, 0.0), Vector3::x()));
    let tree = aabb::AabbTree::new(mesh.positions(), mesh.triangles());
    let mut graph = row(&[[0.0, 0.0, 0.0], [4.9, 0.0, 0.0], [5.0, 0.8, 0.0], [5.1, 0.0, 0.0], [10.0, 0.0, 0.0]]);
    let radii = centering::radii(&graph, &tree);
    detours::cut(&mut graph, &tree, &radii, &Run::default()).expect("a run that never stops");
    assert!(graph.alive().all(|v| graph.nodes[v as usize].y < 0.1), "the detour is left");
    assert!((graph.branches().iter().map(|b| graph.branch_length(b)).sum::<f64>() - 10.0).abs() < 0.05);
    let bent = capsule(10.0, |s| {
        let a: f64 = s / 2.0;
        (Point3::new(2.0 * a.sin(), 2.0 * (1.0 - a.cos()), 0.0), Vector3::new(a.cos(), a.sin(), 0.0))
    });
    let tree = aabb::AabbTree::new(bent.positions(), bent.triangles());
    let axis: Vec<[f64; 3]> = (0..=100)
        .map(|k| {
            let a = 0.05 * f64::from(k);
            [2.0 * a.sin(), 2.0 * (1.0 - a.cos()), 0.0]
        })
        .collect();
    let mut graph = row(&axis);
    let before = graph.alive().count();
    let radii = centering::radii(&graph, &tree);
    detours::cut(&mut graph, &tree, &radii, &Run::default()).expect("a run that never stops");
    assert_eq!(graph.alive().count(), before);
}

#[test]
fn detours_to_pinned_nodes_are_kept() {
    let mesh = capsule(10.0, |s| (Point3::new(s, 0.0, 0.0), Vector3::x()));
    let tree = aabb::AabbTree::new(mesh.positions(), mesh.triangles());
    let mut graph = row(&[[0.0, 0.0, 0.0], [4.9, 0.0, 0.0], [5.0, 0.8, 0.0], [5.1, 0.0, 0.0], [10.0, 0.0, 0.0]]);
    let top = graph.alive().max_by(|a, b| graph.nodes[*a as usize].y.total_cmp(&graph.nodes[*b as usize].y)).unwrap();
    graph.pinned[top as usize] = true;
    let radii = centering::radii(&graph, &tree);
    detours::cut(&mut graph, &tree, &radii, &Run::default()).expect("a run that never stops");
    assert!(graph.is_alive(top) && graph.nodes[top as usize].y == 0.8);
}

#[test]
fn sharp_bends_are_smoothed_as_far_as_the_surface_allows() {
    let mesh = capsule(10.0, |s| (Point3::new(s, 0.0, 0.0), Vector3::x()));
    let tree = aabb::AabbTree::new(mesh.positions(), mesh.triangles());
    let nodes: Vec<_> = (0..=50).map(|k| Point3::new(0.2 * f64::from(k), 0.3 * f64::from(k % 2), 0.0)).collect();
    let edges: Vec<[u32; 2]> = (1..=50).map(|k| [k - 1, k]).collect();
    let mut graph = curve_graph::CurveGraph::new(nodes, &edges, Vec::new());
    bends::round_off(&mut graph, &tree);
    for k in 2..49 {
        let [p, c, q] = [k - 1, k, k + 1].map(|v: usize| graph.nodes[v]);
        assert!((c - p).angle(&(q - c)) < 0.9, "a sharp bend at {c}");
    }
    // A square around the hole of a ring cannot move its corners halfway.
    let ring = shapes::holed_torus(1, 24);
    let tree = aabb::AabbTree::new(ring.positions(), ring.triangles());
    let (curve, _) = curve_of(&ring);
    let few: Vec<_> = web_loop(&curve).into_iter().step_by(curve.nodes.len().div_ceil(6)).collect();
    let n = few.len() as u32;
    let edges: Vec<[u32; 2]> = (0..n).map(|k| [k, (k + 1) % n]).collect();
    let mut graph = curve_graph::CurveGraph::new(few, &edges, Vec::new());
    let crosses = |graph: &curve_graph::CurveGraph| {
        let hit = |&[a, b]: &&[u32; 2]| {
            let (p, q) = (graph.nodes[*a as usize], graph.nodes[*b as usize]);
            tree.is_hit(&p, &(q - p), 1.0)
        };
        edges.iter().filter(hit).count()
    };
    assert_eq!(crosses(&graph), 0, "too few nodes for this test");
    bends::round_off(&mut graph, &tree);
    assert_eq!(crosses(&graph), 0);
}

/// The nodes of a loop in order.
fn web_loop(curve: &CurveSkeleton) -> Vec<Point3<f64>> {
    let graph = curve_graph::CurveGraph::new(curve.nodes.clone(), &curve.edges, Vec::new());
    let branches = graph.branches();
    let longest = branches.iter().max_by_key(|b| b.len()).unwrap();
    longest[1..].iter().map(|v| graph.nodes[*v as usize]).collect()
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

#[test]
fn a_straight_cone_is_a_tip_and_one_that_turns_aside_a_hook() {
    let mesh = shapes::bar([10, 10, 40], [1.0, 1.0, 4.0]);
    let tree = aabb::AabbTree::new(mesh.positions(), mesh.triangles());
    let (low, high) = mesh.bounding_box().unwrap();
    let middle = nalgebra::center(&low, &high);
    let top = [middle.x, middle.y, high.z - 0.5];
    let corner = [high.x - 0.01, high.y - 0.01, high.z - 0.01];
    let mut hooked = row(&[[middle.x, middle.y, low.z + 0.5], top, corner]);
    let radii = centering::radii(&hooked, &tree);
    corner_branches::remove_rim_hooks(&mut hooked, &radii);
    let end = hooked.alive().map(|v| hooked.nodes[v as usize].z).fold(f64::MIN, f64::max);
    assert!((end - top[2]).abs() < 0.06, "the end is at {end}");
    // The same corner approached straight: the cone is the tip of the bar.
    let straight = [0, 1, 2].map(|k| top[k] - (corner[k] - top[k]));
    let mut tip = row(&[straight, top, corner]);
    let before = tip.alive().count();
    let radii = centering::radii(&tip, &tree);
    corner_branches::remove_rim_hooks(&mut tip, &radii);
    assert_eq!(tip.alive().count(), before);
}

/// A ball of radius 1 with spikes of this height and approximate width.
fn spiked_ball(spikes: &[Vector3<f64>], high: f64, wide: f64) -> TriMesh {
    moved(&shapes::icosphere(5), |p| {
        let along = p.coords.normalize();
        let spike = |s: &Vector3<f64>| high * (-(along.angle(s) / wide).powi(2)).exp();
        Point3::from(along * (1.0 + spikes.iter().map(spike).sum::<f64>()))
    })
}

#[test]
fn arms_of_a_ball_are_found_and_bumps_are_not() {
    let aside = Rotation3::new(Vector3::z() * 0.6) * Vector3::x();
    let arms = [Vector3::x(), -Vector3::x(), Vector3::y(), Vector3::z(), aside];
    for (high, wide) in [(0.8, 0.12), (0.5, 0.1), (0.4, 0.1)] {
        let (curve, report) = curve_of(&spiked_ball(&arms, high, wide));
        assert_eq!(report.ends, arms.len(), "arms {high} long");
        for arm in &arms {
            let end = arm * (1.0 + high);
            let nearest = curve.nodes.iter().map(|p| (p.coords - end).norm()).fold(f64::MAX, f64::min);
            assert!(nearest < 0.15, "the curve is {nearest} from an end {high} long");
        }
    }
    let (_, report) = curve_of(&spiked_ball(&arms, 0.05, 0.2));
    assert!(report.ends <= 2, "{} ends on bumps", report.ends);
}

#[test]
fn persistence_is_the_length_of_a_tip_and_known_components_are_skipped() {
    let mesh = capsule(10.0, |s| (Point3::new(s, 0.0, 0.0), Vector3::x()));
    let complex = complex::Complex::new(mesh.positions().to_vec(), mesh.triangles().to_vec());
    let extrema = geodesic_extrema::GeodesicExtrema::new(&complex);
    let tips = |unit: f64, known: &[u32]| -> Vec<geodesic_extrema::Maximum> {
        let mut maxima = extrema.maxima(&|_| unit, known);
        maxima.retain(|t| t.persistence > 3.0 / unit);
        maxima
    };
    let ends = [0, mesh.vertex_count() as u32 - 1];
    let [first, second] = &tips(1.0, &[])[..] else { panic!("two ends") };
    assert!(first.persistence.is_infinite() && (3.0..4.5).contains(&second.persistence), "{}", second.persistence);
    let on_a_cap = |v: u32| !(0.0..=10.0).contains(&mesh.positions()[v as usize].x);
    assert!(on_a_cap(first.vertex) && on_a_cap(second.vertex));
    assert!((tips(0.5, &[])[1].persistence - 2.0 * second.persistence).abs() < 1e-9);
    let side = |v: u32| usize::from(mesh.positions()[v as usize].x > 5.0);
    assert_ne!(side(first.vertex), side(second.vertex));
    // Any vertex of a component marks it as known.
    let left = tips(1.0, &[ends[side(first.vertex)]]);
    assert_eq!(left.iter().map(|t| t.vertex).collect::<Vec<_>>(), [second.vertex]);
    assert!(tips(1.0, &[ends[side(second.vertex)]]).is_empty());
}

#[test]
fn tips_merged_into_one_node_get_an_end_each() {
    let nodes = vec![Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(2.0, 0.0, 0.0)];
    let ends = |node: u32| {
        let mut graph = curve_graph::CurveGraph::new(nodes.clone(), &[[0, 1], [1, 2]], Vec::new());
        let tips = [3.0, 4.0, 5.0].map(|y| Point3::new(2.0, y, 0.0));
        tips::end_at(&mut graph, &tips.map(|p| (node, p)));
        assert!(tips.iter().all(|tip| graph.alive().any(|v| graph.nodes[v as usize] == *tip && graph.degree(v) == 1)));
        graph.alive().filter(|v| graph.degree(*v) == 1).count()
    };
    assert_eq!(ends(2), 4);
    assert_eq!(ends(1), 5);
    let mut point = curve_graph::CurveGraph::new(vec![Point3::origin()], &[], Vec::new());
    tips::end_at(&mut point, &[(0, Point3::new(1.0, 0.0, 0.0)), (0, Point3::new(0.0, 1.0, 0.0))]);
    assert_eq!((point.alive().count(), point.degree(0)), (3, 2));
}

#[test]
fn redundant_nodes_are_removed_unless_they_lead_around_the_outside() {
    let mesh = capsule(10.0, |s| (Point3::new(s, 0.0, 0.0), Vector3::x()));
    let tree = aabb::AabbTree::new(mesh.positions(), mesh.triangles());
    let places: Vec<Point3<f64>> = (0..=100).map(|k| Point3::new(0.1 * f64::from(k), 0.0, 0.0)).collect();
    let edges: Vec<[u32; 2]> = (1..=100).map(|k| [k - 1, k]).collect();
    let mut graph = curve_graph::CurveGraph::new(places, &edges, Vec::new());
    resampling::thin(&mut graph, &tree, 0.4);
    let lengths: Vec<f64> = graph.branches()[0].windows(2).map(|w| graph.length(w[0], w[1])).collect();
    assert!((lengths.iter().sum::<f64>() - 10.0).abs() < 1e-9);
    assert!(lengths.windows(2).all(|w| w[0] + w[1] >= 0.4), "{lengths:?}");
    // In the bend of an arch the middle one of three is the only path inside.
    let half = std::f64::consts::PI;
    let arch = capsule(2.0 * half, |s| {
        let a = half - 0.5 * s;
        (Point3::new(2.0 * a.cos(), 2.0 * a.sin(), 0.0), Vector3::new(a.sin(), -a.cos(), 0.0))
    });
    let tree = aabb::AabbTree::new(arch.positions(), arch.triangles());
    let three = vec![Point3::new(-2.0, 0.0, 0.0), Point3::new(0.0, 2.0, 0.0), Point3::new(2.0, 0.0, 0.0)];
    let mut graph = curve_graph::CurveGraph::new(three, &[[0, 1], [1, 2]], Vec::new());
    resampling::thin(&mut graph, &tree, 100.0);
    assert_eq!(graph.alive().count(), 3);
}

#[test]
fn wandering_within_the_last_ball_is_trimmed() {
    let mesh = capsule(10.0, |s| (Point3::new(s, 0.0, 0.0), Vector3::x()));
    let tree = aabb::AabbTree::new(mesh.positions(), mesh.triangles());
    // Along the axis to the center of the cap, aside to the wall, and along it: no ball on the way back contains the one before.
    let mut graph = row(&[[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [10.0, 0.9, 0.0], [10.3, 0.85, 0.0], [10.0, 0.9, 0.2]]);
    tips::trim(&mut graph, &tree, &|p| tree.encloses(p));
    let farthest = graph.alive().map(|v| graph.nodes[v as usize].coords.yz().norm()).fold(0.0, f64::max);
    assert!(farthest < 1e-9, "a node is {farthest} off the axis");
    let end = graph.alive().map(|v| graph.nodes[v as usize].x).fold(0.0, f64::max);
    assert!((9.8..=10.0).contains(&end), "the curve ends at {end}");
}

#[test]
fn round_limbs_are_centered_on_their_axis_and_flat_ones_unchanged() {
    let iteration = capsule(10.0, |s| (Point3::new(s, 0.0, 0.0), Vector3::x()));
    let flat = moved(&iteration, |p| Point3::new(p.x, p.y, 0.5 * p.z));
    for (mesh, is_round) in [(&iteration, true), (&flat, false)] {
        let tree = aabb::AabbTree::new(mesh.positions(), mesh.triangles());
        let mut graph = row(&[[0.0, 0.05, -0.03], [10.0, 0.05, -0.03]]);
        graph.pinned[100] = true;
        let pinned = graph.nodes[100];
        axis::settle(&mut graph, &tree, &Run::default()).unwrap();
        assert_eq!(graph.nodes[100], pinned, "what is pinned stays");
        for v in (40..=160).filter(|v| !(90..=110).contains(v)) {
            let off = graph.nodes[v].y.hypot(graph.nodes[v].z);
            assert!(if is_round { off < 0.005 } else { (off - 0.05_f64.hypot(0.03)).abs() < 1e-12 }, "{v}: {off}");
        }
    }
}

#[test]
fn the_last_radius_continues_the_bend_and_stays_where_that_is_narrow() {
    let mesh = capsule(10.0, |s| (Point3::new(s, 0.0, 0.0), Vector3::x()));
    let tree = aabb::AabbTree::new(mesh.positions(), mesh.triangles());
    let mut graph = row(&[[0.0, 0.0, 0.0], [9.2, 0.0, 0.0], [10.0, 0.1, 0.0]]);
    tips::extrapolate_ends(&mut graph, &tree);
    let off = graph.alive().map(|v| graph.nodes[v as usize].y.abs()).fold(0.0, f64::max);
    assert!(off < 0.03, "{off} off the axis");
    // A straight continuation would lead to the wall.
    let mut graph = row(&[[0.0, 0.0, 0.0], [7.0, -0.6, 0.0], [8.5, 0.3, 0.0], [9.3, 0.0, 0.0]]);
    let before: Vec<Point3<f64>> = graph.nodes.clone();
    tips::extrapolate_ends(&mut graph, &tree);
    assert!(graph.nodes.iter().zip(&before).all(|(p, q)| nalgebra::distance(p, q) < 1e-9));
}
