//! Laws of the steps: pruning, the energy of the curve, resampling.

use super::*;

#[test]
fn branches_covered_by_the_rest_are_pruned() {
    let mesh = capsule(10.0, |s| (Point3::new(s, 0.0, 0.0), Vector3::x()));
    let tree = aabb::AabbTree::new(mesh.positions(), mesh.triangles(), &Run::default());
    for side in [0.3, 0.9] {
        let mut graph = comb(0.0, 10.0, side);
        let radii = inside::radii(&graph, &tree);
        pruning::prune(&mut graph, &tree, &radii, 1.0, &Run::default()).expect("a run that never stops");
        assert_eq!(graph.alive().filter(|v| graph.degree(*v) == 1).count(), 2, "a branch {side} long");
        assert!([0, 20].iter().all(|v| graph.is_alive(*v)), "the ends of the capsule stay");
        let mut all = comb(0.0, 10.0, side);
        pruning::prune(&mut all, &tree, &radii, 0.0, &Run::default()).expect("a run that never stops");
        assert!(all.is_alive(21), "nothing goes at zero");
    }
}

#[test]
fn an_edge_that_passes_outside_goes_round() {
    let half = std::f64::consts::PI;
    let arch = capsule(2.0 * half, |s| {
        let a = half - 0.5 * s;
        (Point3::new(2.0 * a.cos(), 2.0 * a.sin(), 0.0), Vector3::new(a.sin(), -a.cos(), 0.0))
    });
    let tree = aabb::AabbTree::new(arch.positions(), arch.triangles(), &Run::default());
    let feet = vec![Point3::new(-2.0, 0.1, 0.0), Point3::new(2.0, 0.1, 0.0)];
    let mut graph = curve_graph::CurveGraph::new(feet, &[[0, 1]], vec![0; arch.vertex_count()]);
    inside::keep_inside(&mut graph, &tree);
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
fn redundant_nodes_are_removed_unless_they_lead_around_the_outside() {
    let mesh = capsule(10.0, |s| (Point3::new(s, 0.0, 0.0), Vector3::x()));
    let tree = aabb::AabbTree::new(mesh.positions(), mesh.triangles(), &Run::default());
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
    let tree = aabb::AabbTree::new(arch.positions(), arch.triangles(), &Run::default());
    let three = vec![Point3::new(-2.0, 0.0, 0.0), Point3::new(0.0, 2.0, 0.0), Point3::new(2.0, 0.0, 0.0)];
    let mut graph = curve_graph::CurveGraph::new(three, &[[0, 1], [1, 2]], Vec::new());
    resampling::thin(&mut graph, &tree, 100.0);
    assert_eq!(graph.alive().count(), 3);
}

#[test]
fn zigzags_are_straightened_and_nodes_stay_inside() {
    let mesh = capsule(10.0, |s| (Point3::new(s, 0.0, 0.0), Vector3::x()));
    let tree = aabb::AabbTree::new(mesh.positions(), mesh.triangles(), &Run::default());
    let nodes: Vec<_> = (0..=50).map(|k| Point3::new(0.2 * f64::from(k), 0.9 * f64::from(k % 2), 0.0)).collect();
    let edges: Vec<[u32; 2]> = (1..=50).map(|k| [k - 1, k]).collect();
    let mut graph = curve_graph::CurveGraph::new(nodes, &edges, Vec::new());
    for _ in 0..20 {
        curve_energy::minimize(&mut graph, &tree, &Rotation3::identity(), (1, 0.2), &Run::default()).unwrap();
        assert!(graph.nodes.iter().all(|p| tree.encloses(p)));
    }
    for k in 2..49 {
        let [p, c, q] = [k - 1, k, k + 1].map(|v: usize| graph.nodes[v]);
        assert!((c - p).angle(&(q - c)) < 0.01, "a bend at {c}");
    }
}

#[test]
fn a_row_beside_the_axis_comes_to_it_but_for_the_bend_at_a_pinned_node() {
    let mesh = capsule(10.0, |s| (Point3::new(s, 0.0, 0.0), Vector3::x()));
    let tree = aabb::AabbTree::new(mesh.positions(), mesh.triangles(), &Run::default());
    let mut graph = row(&[[0.0, 0.3, 0.2], [10.0, 0.3, 0.2]]);
    let pinned = graph.nodes.len() / 2;
    graph.pinned[pinned] = true;
    curve_energy::minimize(&mut graph, &tree, &Rotation3::identity(), (40, 0.05), &Run::default()).unwrap();
    let at = Point3::new(5.0, 0.3, 0.2);
    assert!(nalgebra::distance(&graph.nodes[pinned], &at) < 1e-6, "{}", graph.nodes[pinned]);
    for p in graph.nodes.iter().filter(|p| nalgebra::distance(p, &at) > 4.0) {
        assert!(p.y.hypot(p.z) < 0.01, "{p}");
    }
}
