//! Laws of the linear methods, and of all methods.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};

use super::detail_preserving::laplacian;
use super::lanes::Lanes;
use super::test_meshes::{placed, sheet, tube};
use super::*;
use crate::mesh::TriMesh;
use crate::mesh::operators::{Cotangents, EdgeWeights, Gradient};
use plumbline_num::run::Run;

const ESTIMATIONS: [RotationEstimation; 4] = [
    RotationEstimation::Spread,
    RotationEstimation::FirstSolve,
    RotationEstimation::Alternating,
    RotationEstimation::Linear,
];

/// Every method that moves vertices, with each of its options.
fn methods() -> Vec<(Method, DeformOptions)> {
    let cotangents = CotangentRule::Clamped;
    let vertices = Method::ALL.into_iter().filter(|&m| m != Method::Primo);
    let mut all: Vec<_> = vertices.map(|m| (m, DeformOptions { cotangents, ..Default::default() })).collect();
    for (rotation_estimation, laplacian) in
        ESTIMATIONS.into_iter().flat_map(|t| [LaplacianKind::Cotangent, LaplacianKind::Uniform].map(|l| (t, l)))
    {
        all.push((
            Method::Laplacian,
            DeformOptions { cotangents, laplacian, rotation_estimation, ..Default::default() },
        ));
    }
    all
}

fn solve(
    (method, options): &(Method, DeformOptions),
    mesh: &TriMesh,
    handles: &Handles,
    targets: Vec<Point3<f64>>,
) -> Deformation {
    let mut bound = Deformer::new(*method, mesh, handles, options, &Run::default())
        .unwrap_or_else(|e| panic!("{method:?} {options:?}: {e}"));
    let convergence = Convergence { max_iterations: 60, tolerance: 1e-9 };
    bound.deform(&HandlePose::new(targets), InitialGuess::Spread, &convergence, &Run::default()).unwrap()
}

/// The left end of a tube stays, the right one is moved by an isometry.
fn ends(mesh: &TriMesh, motion: &Isometry3<f64>) -> (Handles, Vec<Point3<f64>>) {
    let end = |v: &u32| !(0.15..1.85).contains(&mesh.positions()[*v as usize].x);
    let fixed: Vec<u32> = (0..mesh.vertex_count() as u32).filter(end).collect();
    let target = |p: Point3<f64>| if p.x < 1.0 { p } else { motion * p };
    let targets = fixed.iter().map(|&v| target(mesh.positions()[v as usize])).collect();
    (Handles::exact(fixed).unwrap(), targets)
}

#[test]
fn every_method_moves_rigidly_with_its_handles() {
    let mesh = sheet(9);
    let motion = Isometry3::new(Vector3::new(0.7, -1.9, 0.4), Vector3::new(1.1, -0.6, 2.0));
    let handles = Handles::exact([0, 1, 9, 10, 44, 80]).unwrap();
    for method in methods() {
        let targets = handles.vertices().iter().map(|&v| motion * mesh.positions()[v as usize]).collect();
        let done = solve(&method, &mesh, &handles, targets);
        for (p, x) in mesh.positions().iter().zip(&done.positions) {
            assert!((motion * p - x).norm() < 1e-9 * mesh.diagonal(), "{method:?}");
        }
        assert!(done.report.shape.worst_stretch < 1e-7 && done.report.constraint_error == 0.0);
    }
}

#[test]
fn every_method_is_equivariant_to_translation_and_scale() {
    let mesh = tube(14, 9);
    let (handles, targets) = ends(&mesh, &Isometry3::new(Vector3::new(-0.3, 0.4, 0.1), Vector3::new(0.2, 0.0, 0.8)));
    for method in methods() {
        let plain = solve(&method, &mesh, &handles, targets.clone());
        for (scale, offset, digits) in [(1e-3, 0.0, 1e-9), (1e3, 0.0, 1e-9), (1.0, 1e6, 1e-6)] {
            let offset = Vector3::repeat(offset);
            let there = targets.iter().map(|p| p * scale + offset).collect();
            let done = solve(&method, &placed(&mesh, scale, offset), &handles, there);
            for (x, y) in plain.positions.iter().zip(&done.positions) {
                assert!((x * scale + offset - y).norm() < digits * scale, "{method:?} {scale} {offset}");
            }
        }
    }
}

#[test]
fn every_method_survives_degenerate_faces() {
    let mut positions: Vec<Point3<f64>> = sheet(6).positions().to_vec();
    let mut triangles = sheet(6).triangles().to_vec();
    positions.extend([
        positions[7],
        positions[8] + Vector3::z() * 1e-9,
        nalgebra::center(&positions[3], &positions[4]),
    ]);
    triangles.extend([[7, 8, 36], [7, 7, 12], [7, 8, 37], [3, 38, 4], [9, 9, 9], [0, 1, 6], [0, 1, 6]]);
    let mesh = TriMesh::new(positions, triangles).unwrap();
    let handles = Handles::exact([0, 1, 35]).unwrap();
    for method in methods() {
        let targets = vec![mesh.positions()[0], mesh.positions()[1], Point3::new(1.0, 1.0, 1.0)];
        let done = solve(&method, &mesh, &handles, targets);
        assert!(done.positions.iter().all(|p| p.coords.iter().all(|c| c.is_finite())), "{method:?}");
    }
}

#[test]
fn one_triangle_and_one_vertex_can_be_deformed() {
    let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(Point3::from).to_vec();
    for triangles in [vec![[0, 1, 2]], vec![]] {
        let mesh = TriMesh::new(positions.clone(), triangles).unwrap();
        for method in methods() {
            let done = solve(&method, &mesh, &Handles::exact([1]).unwrap(), vec![Point3::new(2.0, 3.0, 4.0)]);
            assert_eq!(done.positions[1], Point3::new(2.0, 3.0, 4.0));
            let offset = if mesh.triangle_count() == 0 { Vector3::zeros() } else { Vector3::new(1.0, 3.0, 4.0) };
            assert!((done.positions[0] - mesh.positions()[0] - offset).norm() < 1e-12, "{method:?}");
        }
    }
}

/// Differences from rest as vectors.
fn displacement(mesh: &TriMesh, done: &Deformation) -> Vec<Lanes> {
    let moved = done.positions.iter().zip(mesh.positions());
    moved.map(|(x, p)| Lanes::point((x - p).into())).collect()
}

#[test]
fn translated_handles_move_the_surface_harmonically_in_poisson_and_biharmonically_in_laplacian_editing() {
    let mesh = tube(14, 9);
    let (handles, targets) = ends(&mesh, &Isometry3::translation(0.3, 0.5, -0.2));
    let weights = EdgeWeights::cotangent(mesh.vertex_count(), &Cotangents::new(&mesh, CotangentRule::Raw));
    let free = |v: &usize| handles.vertices().binary_search(&(*v as u32)).is_err();
    let still = vec![UnitQuaternion::identity(); handles.len()];
    let pose = HandlePose::new(targets).with_rotations(still);
    let deform = |method| {
        let mut bound = Deformer::new(method, &mesh, &handles, &DeformOptions::default(), &Run::default()).unwrap();
        displacement(
            &mesh,
            &bound.deform(&pose, InitialGuess::Spread, &Convergence::default(), &Run::default()).unwrap(),
        )
    };
    let harmonic = laplacian(&weights, &deform(Method::Poisson));
    let mut curved = laplacian(&weights, &deform(Method::Laplacian));
    let areas = crate::mesh::operators::barycentric_areas(&mesh);
    curved.iter_mut().zip(&areas).for_each(|(c, a)| *c = *c * Lanes::splat(1.0 / a));
    let biharmonic = laplacian(&weights, &curved);
    for v in (0..mesh.vertex_count()).filter(free) {
        assert!(harmonic[v].dot(harmonic[v]).sqrt() < 1e-13, "{v}");
        assert!(biharmonic[v].dot(biharmonic[v]).sqrt() < 1e-9 / areas[v], "{v}");
    }
    assert!(curved.iter().any(|c| c.dot(*c) > 1e-3));
}

#[test]
fn poisson_editing_reproduces_integrable_gradients() {
    // A rolled strip: rotations that vary along it by column are integrated by the arc only.
    let mesh = tube(30, 8);
    let (handles, targets) = ends(&mesh, &Isometry3::rotation(Vector3::new(0.0, 0.0, 0.4)));
    let mut poisson =
        Deformer::new(Method::Poisson, &mesh, &handles, &DeformOptions::default(), &Run::default()).unwrap();
    let done = poisson
        .deform(&HandlePose::new(targets), InitialGuess::Spread, &Convergence::default(), &Run::default())
        .unwrap();
    let moved = mesh.with_positions(done.positions).unwrap();
    let gradient = Gradient::new(&mesh);
    let stretch = |axis: usize| gradient.apply(&moved.positions().iter().map(|p| p[axis]).collect::<Vec<_>>());
    let rows: [Vec<Vector3<f64>>; 3] = std::array::from_fn(stretch);
    for (t, ((x, y), z)) in rows[0].iter().zip(&rows[1]).zip(&rows[2]).enumerate() {
        let j = Matrix3::from_rows(&[x.transpose(), y.transpose(), z.transpose()]);
        let s = j.svd(false, false).singular_values;
        assert!(s[0] < 1.3 && s[1] > 0.7 && s[2] < 1e-12, "{t} {s}");
    }
}

#[test]
fn details_follow_the_given_transforms() {
    let mesh = sheet(12);
    let rotation = Rotation3::new(Vector3::new(0.3, 1.0, -0.4));
    for laplacian in [LaplacianKind::Cotangent, LaplacianKind::Uniform] {
        let options = DeformOptions { laplacian, ..Default::default() };
        let handles = Handles::exact([0]).unwrap();
        let mut details = DetailPreserving::new(&mesh, &handles, &options, &Run::default()).unwrap();
        let pose = HandlePose::new(vec![Point3::new(1.0, 2.0, 3.0)]);
        // A similarity of the whole surface.
        let done = details.solve(&[rotation.matrix() * 2.0; 144], &pose, &Run::default()).unwrap();
        for (p, x) in mesh.positions().iter().zip(&done.positions) {
            let expected = pose.positions()[0] + rotation * (p - mesh.positions()[0]) * 2.0;
            assert!((expected - x).norm() < 1e-9, "{laplacian:?}");
        }
        assert!(done.report.energies[0] < 1e-18);
        let few = details.solve(&[Matrix3::identity(); 3], &pose, &Run::default()).unwrap_err();
        assert_eq!(few.to_string(), "3 transforms for a mesh of 144 vertices: give one for each");
    }
}

#[test]
fn rotation_estimation_preserves_lengths_that_naive_editing_loses() {
    let mesh = tube(24, 12);
    let (handles, targets) = ends(&mesh, &Isometry3::new(Vector3::new(0.83, -0.8, 0.0), Vector3::new(0.0, 0.0, 1.2)));
    let mut naive = DetailPreserving::new(&mesh, &handles, &DeformOptions::default(), &Run::default()).unwrap();
    let pose = HandlePose::new(targets.clone());
    let worst = naive
        .solve(&vec![Matrix3::identity(); mesh.vertex_count()], &pose, &Run::default())
        .unwrap()
        .report
        .shape
        .rms_stretch;
    for rotation_estimation in ESTIMATIONS {
        let method = (Method::Laplacian, DeformOptions { rotation_estimation, ..Default::default() });
        let done = solve(&method, &mesh, &handles, targets.clone());
        assert!(
            done.report.shape.rms_stretch < 0.8 * worst,
            "{rotation_estimation:?} {} {worst}",
            done.report.shape.rms_stretch
        );
    }
}

#[test]
fn the_error_of_soft_constraints_falls_with_their_weight_in_every_method() {
    let mesh = tube(14, 9);
    let (handles, targets) = ends(&mesh, &Isometry3::new(Vector3::new(-0.3, 0.4, 0.1), Vector3::new(0.0, 0.0, 0.8)));
    for method in methods() {
        let errors = [1e-1, 1e2, 1e5].map(|weight| {
            let soft = Handles::new(handles.vertices().iter().map(|&v| (v, Constraint::Soft(weight)))).unwrap();
            solve(&method, &mesh, &soft, targets.clone()).report.constraint_error
        });
        assert!(errors[0] > errors[1] && errors[1] > errors[2] && errors[2] < 1e-3, "{method:?} {errors:?}");
    }
}
