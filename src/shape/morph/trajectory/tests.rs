use std::f64::consts::PI;

use super::*;
use crate::mesh::shapes;
use crate::morph::folds::conformities;
use plumbline_num::run::Run;

fn turned(mesh: &TriMesh, turn: Vector3<f64>, pivot: Point3<f64>) -> TriMesh {
    let rotation = UnitQuaternion::from_scaled_axis(turn);
    mesh.with_positions(mesh.positions().iter().map(|p| pivot + rotation * (p - pivot)).collect()).unwrap()
}

fn worst(a: &[Point3<f64>], b: &[Point3<f64>]) -> f64 {
    a.iter().zip(b).map(|(p, q)| (p - q).norm()).fold(0.0, f64::max)
}

/// A bar of height 4 whose slices turn by up to `angle` about its axis, and bend.
fn twisted(angle: f64, bend: f64) -> (TriMesh, TriMesh) {
    let bar = shapes::bar([3, 3, 24], [0.6, 0.6, 4.0]);
    let place = |p: &Point3<f64>| {
        let (x, y, s) = (p.x - 0.3, p.y - 0.3, p.z / 4.0);
        let (sine, cosine) = (angle * s).sin_cos();
        let (x, y) = (cosine * x - sine * y, sine * x + cosine * y);
        if bend == 0.0 {
            return Point3::new(x, y, p.z);
        }
        let (radius, (sine, cosine)) = (4.0 / bend, (bend * s).sin_cos());
        Point3::new((radius + x) * cosine - radius, y, (radius + x) * sine)
    };
    let moved = bar.with_positions(bar.positions().iter().map(place).collect()).unwrap();
    (bar, moved)
}

#[test]
fn rotations_by_any_angle_are_interpolated_as_rotations() {
    let mesh = shapes::cactus(10);
    let axis = Vector3::new(0.3, -1.0, 0.6).normalize();
    for (degrees, full_rotations) in [(170.0, 0), (270.0, -1), (20.0, 0), (-170.0, 0), (400.0, 1)] {
        for pivot in [Point3::origin(), Point3::new(3.0, -1.0, 2.0)] {
            let turn = axis * f64::to_radians(degrees);
            let second = turned(&mesh, turn, pivot);
            // 270° is −90°, whose axis points the other way, and one turn against it.
            let options = TrajectoryOptions { full_rotations, ..Default::default() };
            let mut trajectory = Trajectory::new(&mesh, &second, &options, &Run::default()).unwrap();
            for time in [0.25, 0.5, 0.9] {
                let expected = turned(&mesh, turn * time, pivot);
                let error =
                    worst(&trajectory.at(time, &Run::default()).expect("a run that never stops"), expected.positions());
                assert!(error < 1e-9 * mesh.diagonal(), "{degrees}°, {time}: {error}");
            }
        }
    }
}

#[test]
fn both_poses_are_exact_and_the_path_is_continuous_there() {
    let (first, second) = twisted(2.0, 1.0);
    let mut trajectory = Trajectory::new(&first, &second, &TrajectoryOptions::default(), &Run::default()).unwrap();
    assert_eq!(trajectory.at(0.0, &Run::default()).expect("a run that never stops"), first.positions());
    assert_eq!(trajectory.at(1.0, &Run::default()).expect("a run that never stops"), second.positions());
    assert!(worst(&trajectory.at(1e-9, &Run::default()).expect("a run that never stops"), first.positions()) < 1e-7);
    assert!(
        worst(&trajectory.at(1.0 - 1e-9, &Run::default()).expect("a run that never stops"), second.positions()) < 1e-7
    );
}

#[test]
fn the_path_is_symmetric_in_the_two_poses() {
    for (first, second) in [twisted(2.0, 1.5), twisted(4.5, 0.0)] {
        for iterations in [0, 10] {
            let options = TrajectoryOptions { iterations, ..Default::default() };
            let mut there = Trajectory::new(&first, &second, &options, &Run::default()).unwrap();
            let mut back = Trajectory::new(&second, &first, &options, &Run::default()).unwrap();
            for time in [0.1, 0.37, 0.5, 0.8] {
                let error = worst(
                    &there.at(time, &Run::default()).expect("a run that never stops"),
                    &back.at(1.0 - time, &Run::default()).expect("a run that never stops"),
                );
                assert!(error < 1e-9 * first.diagonal(), "{iterations} iterations, {time}: {error}");
            }
        }
    }
}

#[test]
fn a_bar_twisted_by_540_degrees_is_half_as_twisted_at_half_time() {
    let (first, second) = twisted(3.0 * PI, 0.0);
    let mut trajectory =
        Trajectory::new(&first, &second, &TrajectoryOptions { iterations: 0, full_rotations: 0 }, &Run::default())
            .unwrap();
    let middle = trajectory.at(0.5, &Run::default()).expect("a run that never stops");
    let linear = trajectory.linear(0.5);
    // The bar with half the twist, up to a rigid motion.
    let half = twisted(1.5 * PI, 0.0).1;
    let apart = |x: &[Point3<f64>]| {
        let (map, _) = nearest_similarity(half.positions(), x, &vec![1.0; x.len()], false);
        let squares: f64 = half.positions().iter().zip(x).map(|(p, q)| (map * p - q).norm_squared()).sum();
        (squares / x.len() as f64).sqrt()
    };
    // Not quite that bar: halfway, triangles are stretched half as much, which does not fit together exactly.
    assert!(apart(&middle) < 0.25 * apart(&linear), "{} {}", apart(&middle), apart(&linear));
}

#[test]
fn the_energy_decreases_with_the_iterations() {
    let (first, second) = twisted(2.5, 2.0);
    for time in [0.3, 0.5] {
        let mut last = f64::INFINITY;
        for iterations in [0, 1, 2, 5, 20, 60] {
            let mut trajectory =
                Trajectory::new(&first, &second, &TrajectoryOptions { iterations, full_rotations: 0 }, &Run::default())
                    .unwrap();
            let x = trajectory.at(time, &Run::default()).expect("a run that never stops");
            let energy = trajectory.energy(time, &x);
            assert!(energy <= last * (1.0 + 1e-12), "{iterations}: {energy} after {last}");
            assert!(energy < trajectory.energy(time, &trajectory.linear(time)));
            last = energy;
        }
    }
}

#[test]
fn a_blend_with_equal_times_is_the_interpolation() {
    let (first, second) = twisted(1.0, 2.0);
    let mut trajectory = Trajectory::new(&first, &second, &TrajectoryOptions::default(), &Run::default()).unwrap();
    for time in [0.0, 0.3, 1.0] {
        assert_eq!(
            trajectory.blend(&vec![time; first.vertex_count()], &Run::default()).expect("a run that never stops"),
            trajectory.at(time, &Run::default()).expect("a run that never stops")
        );
    }
}

#[test]
fn components_and_unreferenced_vertices_are_interpolated_and_degenerate_triangles_harmless() {
    let pair = shapes::disjoint(&[shapes::icosphere(1), shapes::bar([2, 2, 2], [1.0, 1.0, 1.0])]);
    let mut positions = pair.positions().to_vec();
    positions.push(Point3::new(5.0, 5.0, 5.0));
    let mut triangles = pair.triangles().to_vec();
    triangles.push([0, 1, 1]);
    let first = TriMesh::new(positions, triangles).unwrap();
    let turn = Vector3::new(0.0, 0.0, 1.2);
    let second = turned(&first, turn, Point3::new(1.0, 2.0, 3.0));
    let mut trajectory = Trajectory::new(&first, &second, &TrajectoryOptions::default(), &Run::default()).unwrap();
    let middle = trajectory.at(0.5, &Run::default()).expect("a run that never stops");
    let expected = turned(&first, turn * 0.5, Point3::new(1.0, 2.0, 3.0));
    assert!(worst(&middle, expected.positions()) < 1e-9);
}

#[test]
fn meshes_with_other_connectivity_are_rejected() {
    let mesh = shapes::icosphere(1);
    let other = shapes::icosphere(2);
    let refused =
        |a: &TriMesh, b: &TriMesh| Trajectory::new(a, b, &TrajectoryOptions::default(), &Run::default()).unwrap_err();
    assert_eq!(refused(&mesh, &other), MorphError::VertexCounts { first: 42, second: 162 });
    let mut triangles = mesh.triangles().to_vec();
    triangles[7].swap(0, 1);
    let swapped = TriMesh::new(mesh.positions().to_vec(), triangles).unwrap();
    assert!(matches!(refused(&mesh, &swapped), MorphError::Triangles { triangle: 7, .. }));
    let mut fewer = mesh.triangles().to_vec();
    fewer.pop();
    let fewer = TriMesh::new(mesh.positions().to_vec(), fewer).unwrap();
    assert!(matches!(refused(&mesh, &fewer), MorphError::Triangles { triangle: 79, second: None, .. }));
}

#[test]
fn untangling_never_adds_intersections() {
    let bar = shapes::bar([30, 2, 8], [6.0, 0.3, 1.5]);
    let bent = |angle: f64| {
        let place = |p: &Point3<f64>| {
            let s = p.x / 6.0;
            let (radius, (sine, cosine)) = (6.0 / angle, (angle * (s - 0.5)).sin_cos());
            Point3::new((radius + p.y) * sine, (radius + p.y) * cosine - radius, p.z)
        };
        bar.with_positions(bar.positions().iter().map(place).collect()).unwrap()
    };
    // Nearly closed rings, open like a spring to one side, then to the other: halfway the ends are nearest.
    let first = bent(1.9 * PI);
    let second = {
        let tilted = first.positions().iter().map(|p| Point3::new(p.x, p.y, p.z + 2.4 * (p.x / 1.2).tanh()));
        first.with_positions(tilted.collect()).unwrap()
    };
    let mirrored = first.positions().iter().map(|p| Point3::new(p.x, p.y, p.z - 2.4 * (p.x / 1.2).tanh())).collect();
    let first = first.with_positions(mirrored).unwrap();
    let mut trajectory = Trajectory::new(&first, &second, &TrajectoryOptions::default(), &Run::default()).unwrap();
    for time in [0.0, 0.3, 0.5, 1.0] {
        let Untangled { positions: x, intersections } =
            trajectory.untangled(time, 10, &Run::default()).expect("a run that never stops");
        let [before, after] = intersections.expect("few tests");
        let count =
            crate::morph::intersections::self_intersections(&first.with_positions(x.clone()).unwrap(), &Run::default())
                .expect("a run that never stops")
                .expect("few tests")
                .len();
        assert_eq!(count, after);
        assert!(
            after <= before && (before == 0 || time == 0.0 || time == 1.0 || after < before),
            "{time}: {before} to {after}"
        );
        if before == 0 {
            assert_eq!(x, trajectory.at(time, &Run::default()).expect("a run that never stops"));
        }
    }
}

#[test]
fn iterations_keep_the_centroid_and_the_global_rotation() {
    let (first, second) = twisted(2.0, 1.5);
    let carried = second.positions().iter().map(|p| p + Vector3::new(7.0, -2.0, 1.0)).collect();
    let second = second.with_positions(carried).unwrap();
    let shape = |iterations: usize, time: f64| {
        let options = TrajectoryOptions { iterations, full_rotations: 0 };
        let mut trajectory = Trajectory::new(&first, &second, &options, &Run::default()).unwrap();
        let wanted = centroid(&trajectory.guess(&vec![time; first.vertex_count()]), &trajectory.weights);
        let x = trajectory.at(time, &Run::default()).expect("a run that never stops");
        assert!((centroid(&x, &trajectory.weights) - wanted).norm() < 1e-12, "{iterations} iterations, {time}");
        (x, trajectory.weights)
    };
    for time in [0.2, 0.5, 0.7] {
        let (start, weights) = shape(0, time);
        let (improved, _) = shape(40, time);
        let turn = nearest_similarity(&improved, &start, &weights, false).0.isometry.rotation;
        assert!(turn.angle() < 1e-7, "{}", turn.angle());
    }
}

#[test]
fn shapes_that_leave_the_box_of_both_poses_are_refused_by_name_and_rotations_are_not() {
    let bar = crate::mesh::shapes::bar([2, 2, 10], [1.0, 1.0, 5.0]);
    let turned = bar.positions().iter().map(|p| Point3::new(-p.x + 7.0, p.y, -p.z)).collect();
    let turned = bar.with_positions(turned).expect("finite");
    let mut trajectory = Trajectory::new(&bar, &turned, &TrajectoryOptions::default(), &Run::default()).expect("poses");
    let mut middle = trajectory.at(0.5, &Run::default()).expect("not stopped");
    trajectory.check_extent(0.5, &middle).expect("a half turn sweeps outside both boxes, but not in the moving frame");
    middle[0] += Vector3::new(0.0, 20.0, 0.0);
    let refused = trajectory.check_extent(0.5, &middle).expect_err("burst").to_string();
    assert!(refused.contains("check of the bounding box") && refused.contains("landmarks"), "{refused}");
}

#[test]
fn weights_of_slivers_are_bounded_and_others_are_cotangents() {
    let triangle = |height: f64| {
        TriMesh::new(vec![Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.4, height, 0.0)], vec![[0, 1, 2]])
            .unwrap()
    };
    let of = |height: f64| mean_weights(&triangle(height), &triangle(height))[0];
    let exact = Cotangents::new(&triangle(0.3), CotangentRule::Raw);
    assert_eq!(of(0.3), exact.half()[0]);
    for height in [1e-2, 1e-6, 1e-12, 0.0] {
        let [a, b, c] = of(height);
        assert!([a, b, c].iter().all(|h| h.abs() <= 1.0 / (4.0 * MIN_AREA)), "{height}: {a} {b} {c}");
        // Positive definite over the two edges from a corner.
        assert!(a + b > 0.0 && a * b + b * c + c * a > 0.0, "{height}: {a} {b} {c}");
    }
}

#[test]
fn shapes_of_unlike_size_mix_in_the_size_of_their_time() {
    let bar = shapes::bar([2, 2, 10], [1.0, 1.0, 5.0]);
    let longer = bar.positions().iter().map(|p| Point3::new(p.x, p.y, 2.0 * p.z) * 1000.0).collect();
    let longer = bar.with_positions(longer).unwrap();
    let size = (longer.area() / bar.area()).sqrt();
    let mut trajectory = Trajectory::new(&bar, &longer, &TrajectoryOptions::default(), &Run::default()).unwrap();
    let extent = |time: f64, trajectory: &mut Trajectory| {
        let x = trajectory.at(time, &Run::default()).expect("a run that never stops");
        let (low, high) = bar.with_positions(x).unwrap().bounding_box().expect("not empty");
        high - low
    };
    for time in [0.1, 0.5, 0.9] {
        let mixed = |first: f64, second: f64| (1.0 - time) * first + time * second / size;
        let expected = Vector3::new(mixed(1.0, 1000.0), mixed(1.0, 1000.0), mixed(5.0, 10_000.0));
        let expected = expected * (1.0 + (size - 1.0) * time);
        let found = extent(time, &mut trajectory);
        assert!((found - expected).norm() < 1e-9 * expected.norm(), "{time}: {found} for {expected}");
    }
}

#[test]
fn a_limb_behind_triangles_that_are_turned_over_goes_the_short_way() {
    let (first, second) = twisted(0.0, 1.9);
    // The slice at a third of the length is turned by 160° about the axis of the bar there: triangles on both sides turn over.
    let base = |v: usize| (first.positions()[v].z - 4.0 / 3.0).abs() < 1e-9;
    let ring: Vec<usize> = (0..first.vertex_count()).filter(|&v| base(v)).collect();
    let middle = ring.iter().map(|&v| second.positions()[v].coords).sum::<Vector3<f64>>() / ring.len() as f64;
    let (sine, cosine) = (1.9_f64 / 3.0).sin_cos();
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(-sine, 0.0, cosine) * 160_f64.to_radians());
    let mut positions = second.positions().to_vec();
    for &v in &ring {
        positions[v] = Point3::from(middle + turn * (positions[v].coords - middle));
    }
    let tangled = second.with_positions(positions).unwrap();
    let mut clean = Trajectory::new(&first, &second, &TrajectoryOptions::default(), &Run::default()).unwrap();
    let mut trajectory = Trajectory::new(&first, &tangled, &TrajectoryOptions::default(), &Run::default()).unwrap();
    let expected = clean.at(0.5, &Run::default()).expect("a run that never stops");
    let found = trajectory.at(0.5, &Run::default()).expect("a run that never stops");
    let tip = |x: &[Point3<f64>]| x.iter().max_by(|a, b| a.z.total_cmp(&b.z)).copied().expect("not empty");
    assert!((tip(&found) - tip(&expected)).norm() < 0.4, "{} for {}", tip(&found), tip(&expected));
}

#[test]
fn shapes_toward_a_folded_end_fold_less() {
    let bar = shapes::bar([6, 6, 30], [0.4, 0.4, 2.0]);
    // A ring is turned by 160° about the axis: the triangles beside it turn over.
    let about = UnitQuaternion::from_scaled_axis(Vector3::z() * 160_f64.to_radians());
    let center = Vector3::new(0.2, 0.2, 0.0);
    let place = |p: &Point3<f64>| if (p.z - 1.0).abs() < 0.01 { about * (p - center) + center } else { *p };
    let folded = bar.with_positions(bar.positions().iter().map(place).collect()).unwrap();
    let folds = |x: &[Point3<f64>]| conformities(bar.triangles(), x).iter().filter(|c| **c < 0.0).count();
    let run = Run::default();
    for (first, second) in [(&bar, &folded), (&folded, &bar)] {
        let mut trajectory = Trajectory::new(first, second, &TrajectoryOptions::default(), &run).unwrap();
        let at = |trajectory: &mut Trajectory, time: f64| trajectory.at(time, &run).expect("a run that never stops");
        let shapes = [0.25, 0.5, 0.75].map(|time| at(&mut trajectory, time));
        for time in [0.1, 0.9, 1.0, 0.0] {
            let jump = worst(&at(&mut trajectory, time - 1e-6), &at(&mut trajectory, time + 1e-6));
            assert!(jump < 1e-3, "at {time}: {jump}");
        }
        trajectory.follows.fill(Follows::Both);
        let means = [0.25, 0.5, 0.75].map(|time| at(&mut trajectory, time));
        let [found, mean] = [shapes, means].map(|x| x.iter().map(|x| folds(x)).sum::<usize>());
        assert!(2 * found < mean, "{found} folds for {mean} of the means");
    }
}
