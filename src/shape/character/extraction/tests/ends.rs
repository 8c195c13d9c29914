//! Laws of tips and ends.

use super::*;

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
    let tree = aabb::AabbTree::new(mesh.positions(), mesh.triangles(), &Run::default());
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
fn an_end_that_turns_into_a_corner_is_cut_and_a_straight_one_keeps_to_the_axis() {
    let mesh = shapes::bar([10, 10, 40], [1.0, 1.0, 4.0]);
    let tree = aabb::AabbTree::new(mesh.positions(), mesh.triangles(), &Run::default());
    let (low, high) = mesh.bounding_box().unwrap();
    let middle = nalgebra::center(&low, &high);
    let [bottom, top] = [low.z + 0.5, high.z - 0.5].map(|z| [middle.x, middle.y, z]);
    let corner = [high.x - 0.01, high.y - 0.01, high.z - 0.01];
    for places in [&[bottom, top, corner][..], &[bottom, top]] {
        let mut graph = row(places);
        let radii = inside::radii(&graph, &tree);
        pruning::cut_ends(&mut graph, &tree, &radii, 1.05);
        tips::extend(&mut graph, &tree);
        let farthest = |off: &dyn Fn(&Point3<f64>) -> f64| {
            graph.alive().map(|v| off(&graph.nodes[v as usize])).fold(f64::MIN, f64::max)
        };
        assert!(farthest(&|p| (p - middle).xy().norm()) < 0.01, "an end leaves the axis");
        let end = farthest(&|p| p.z);
        assert!((end - top[2]).abs() < 0.1, "an end at {end}");
    }
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
fn persistence_is_the_length_of_a_tip() {
    let mesh = capsule(10.0, |s| (Point3::new(s, 0.0, 0.0), Vector3::x()));
    let complex = complex::Complex::new(mesh.positions().to_vec(), mesh.triangles().to_vec());
    let extrema = geodesic_extrema::GeodesicExtrema::new(&complex);
    let tips = |unit: f64| -> Vec<geodesic_extrema::Maximum> {
        let mut maxima = extrema.maxima(&|_| unit);
        maxima.retain(|t| t.persistence > 3.0 / unit);
        maxima
    };
    let [first, second] = &tips(1.0)[..] else { panic!("two ends") };
    assert!(first.persistence.is_infinite() && (3.0..4.5).contains(&second.persistence), "{}", second.persistence);
    let on_a_cap = |v: u32| !(0.0..=10.0).contains(&mesh.positions()[v as usize].x);
    assert!(on_a_cap(first.vertex) && on_a_cap(second.vertex));
    assert!((tips(0.5)[1].persistence - 2.0 * second.persistence).abs() < 1e-9);
    let side = |v: u32| usize::from(mesh.positions()[v as usize].x > 5.0);
    assert_ne!(side(first.vertex), side(second.vertex));
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
fn wandering_within_the_last_ball_is_trimmed() {
    let mesh = capsule(10.0, |s| (Point3::new(s, 0.0, 0.0), Vector3::x()));
    let tree = aabb::AabbTree::new(mesh.positions(), mesh.triangles(), &Run::default());
    // Along the axis to the center of the cap, aside to the wall, and along it: no ball on the way back contains the one before.
    let mut graph = row(&[[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [10.0, 0.9, 0.0], [10.3, 0.85, 0.0], [10.0, 0.9, 0.2]]);
    tips::trim(&mut graph, &tree, &|p| tree.encloses(p));
    let farthest = graph.alive().map(|v| graph.nodes[v as usize].coords.yz().norm()).fold(0.0, f64::max);
    assert!(farthest < 1e-9, "a node is {farthest} off the axis");
    let end = graph.alive().map(|v| graph.nodes[v as usize].x).fold(0.0, f64::max);
    assert!((9.8..=10.0).contains(&end), "the curve ends at {end}");
}
