use nalgebra::{Point3, Similarity3, Vector3};

use super::*;
use crate::mesh::shapes;
use plumbline_num::run::Run;

/// Every so many vertices as landmarks to themselves.
fn own(mesh: &TriMesh, every: usize) -> Vec<(u32, u32)> {
    (0..mesh.vertex_count() as u32).step_by(every).map(|v| (v, v)).collect()
}

fn farthest(laid: &TriMesh, second: &TriMesh) -> f64 {
    let worst = laid.positions().iter().zip(second.positions()).map(|(p, q)| (p - q).norm()).fold(0.0, f64::max);
    worst / second.diagonal()
}

#[test]
fn the_registration_of_a_surface_to_itself_is_the_identity() {
    let mesh = shapes::cactus(9);
    let map = Similarity3::new(Vector3::new(30.0, -4.0, 7.0), Vector3::new(0.4, 2.0, -1.0), 12.0);
    let moved = mesh.with_positions(mesh.positions().iter().map(|p| map * p).collect()).unwrap();
    let landmarks = own(&mesh, mesh.vertex_count() / 9);
    for second in [&mesh, &moved] {
        let laid = correspond(&mesh, second, &landmarks, &CorrespondenceOptions::default(), &Run::default()).unwrap();
        assert!(farthest(&laid.mapped, second) < 1e-6, "{}", farthest(&laid.mapped, second));
        assert_eq!((laid.quality.flipped, laid.quality.collapsed, laid.quality.landmark_error), (0, 0, 0.0));
        assert!((laid.quality.stretch - 1.0).abs() < 1e-6);
    }
}

#[test]
fn landmarks_are_met_exactly_and_vertices_are_on_the_target() {
    // A ball laid over an egg with a bump, of other triangles.
    let ball = shapes::icosphere(3);
    let fine = shapes::icosphere(4);
    let bent = |p: &Point3<f64>| Point3::new(1.6 * p.x + 0.3 * p.z * p.z, 0.9 * p.y, p.z * (1.0 + 0.2 * p.x));
    let second = fine.with_positions(fine.positions().iter().map(bent).collect()).unwrap();
    let landmarks: Vec<(u32, u32)> = (0..12).map(|v| (v, v)).collect();
    let laid = correspond(&ball, &second, &landmarks, &CorrespondenceOptions::default(), &Run::default()).unwrap();
    assert_eq!(laid.quality.landmark_error, 0.0);
    assert_eq!((laid.quality.flipped, laid.quality.collapsed), (0, 0));
    let target = registration::Target::new(&second, "second", 0).unwrap();
    for (p, on) in laid.mapped.positions().iter().zip(&laid.points) {
        assert!(target.nearest(p).unwrap().squared < 1e-20);
        let corners = second.corners(on.triangle as usize);
        let point: Vector3<f64> = corners.iter().zip(on.weights).map(|(c, w)| c.coords * w).sum();
        assert!((point - p.coords).norm() < 1e-12);
    }
    assert!(laid.quality.missed_worst < 0.01 && laid.quality.stretch < 1.2, "{:?}", laid.quality);
}

#[test]
fn searches_of_a_surface_of_layers_end() {
    // Triangles from corner to corner of a cube: many are about as near to any point.
    let mut rng = fastrand::Rng::with_seed(7);
    let mut point = || Point3::new(rng.f64(), rng.f64(), rng.f64());
    let positions: Vec<Point3<f64>> = (0..900).map(|_| point()).collect();
    let soup = TriMesh::new(positions, (0..300).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect()).unwrap();
    let target = registration::Target::new(&soup, "second", 0).unwrap();
    let ended = (0..1_500_000).find_map(|_| target.nearest(&point()).err());
    assert_eq!(ended, Some(MorphError::Layered { which: "second", most: 1_500_000 }));
    // What removal of fold-overs had is kept.
    let ball = shapes::icosphere(1);
    let mut points = vec![target.vertex(0); ball.vertex_count()];
    let before = points.clone();
    unfolding::unfold(&ball, &target, &vec![false; points.len()], &mut points, &Run::default()).unwrap();
    assert_eq!(points, before);
}

#[test]
fn a_component_without_a_landmark_is_mapped_too() {
    let both = shapes::disjoint(&[shapes::icosphere(2), shapes::icosphere(1)]);
    let landmarks: Vec<(u32, u32)> = (0..10).map(|v| (v, v)).collect();
    let laid = correspond(&both, &both, &landmarks, &CorrespondenceOptions::default(), &Run::default()).unwrap();
    assert!(farthest(&laid.mapped, &both) < 1e-6);
}

#[test]
fn too_few_landmarks_and_surfaces_without_area_or_beyond_numbers_are_rejected() {
    let mesh = shapes::icosphere(1);
    let refused = |second: &TriMesh, landmarks: &[(u32, u32)]| {
        correspond(&mesh, second, landmarks, &CorrespondenceOptions::default(), &Run::default()).unwrap_err()
    };
    assert_eq!(refused(&mesh, &[(0, 0), (1, 1)]), MorphError::Landmarks { given: 2, expected: 3 });
    let points = TriMesh::new(mesh.positions().to_vec(), Vec::new()).unwrap();
    assert_eq!(refused(&points, &[(0, 0), (1, 1), (2, 2)]), MorphError::Empty { which: "second" });
    for factor in [1e80, 1e-90] {
        let scaled = mesh.with_positions(mesh.positions().iter().map(|p| p * factor).collect()).unwrap();
        let error = refused(&scaled, &[(0, 0), (1, 1), (2, 2)]);
        assert_eq!(error, MorphError::Size { which: "second", diagonal: scaled.diagonal() });
    }
    let bar = shapes::bar([4, 1, 1], [4.0, 1.0, 1.0]);
    let line: Vec<(u32, u32)> = (0..bar.vertex_count() as u32)
        .filter(|&v| {
            let p = bar.positions()[v as usize];
            p.y == 0.0 && p.z == 0.0
        })
        .map(|v| (v, v))
        .collect();
    let on_line = correspond(&bar, &bar, &line, &CorrespondenceOptions::default(), &Run::default()).unwrap_err();
    assert!(matches!(on_line, MorphError::Landmarks { .. }), "{on_line}");
}
