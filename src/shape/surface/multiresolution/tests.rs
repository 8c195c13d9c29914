//! Laws of multiresolution initial guesses.

use nalgebra::{Isometry3, Vector3};

use super::super::test_meshes::{placed, tube};
use super::super::{Convergence, Deformer};
use super::*;
use plumbline_num::run::Run;

type Case = (TriMesh, Handles, HandlePose);

/// A tube that is bent by an angle and pushed together, with constrained ends.
fn bent(rings: usize, around: usize, angle: f64, constraint: Constraint) -> Case {
    let mesh = tube(rings, around);
    let ends = (0..mesh.vertex_count() as u32).filter(|&v| !(0.15..1.85).contains(&mesh.positions()[v as usize].x));
    let handles = Handles::new(ends.map(|v| (v, constraint))).unwrap();
    let motion = Isometry3::new(Vector3::new(-0.6, 0.4, 0.1), Vector3::new(0.2 * angle, 0.0, angle));
    let target = |&v: &u32| {
        let p = mesh.positions()[v as usize];
        if p.x < 1.0 { p } else { motion * p }
    };
    let pose = HandlePose::new(handles.vertices().iter().map(target).collect());
    (mesh, handles, pose)
}

/// The iterative methods, without rotation smoothness: its local/global steps do not converge on coarse levels.
fn methods() -> Vec<(Method, DeformOptions)> {
    let plain = [Method::Arap, Method::ArapSpokes, Method::ArapElements, Method::GaussNewton, Method::Primo];
    let mut all: Vec<_> = plain.into_iter().map(|m| (m, DeformOptions::default())).collect();
    all.push((
        Method::Laplacian,
        DeformOptions { rotation_estimation: RotationEstimation::Alternating, ..Default::default() },
    ));
    all
}

fn run(
    (method, options): (Method, &DeformOptions),
    (mesh, handles, pose): &Case,
    start: InitialGuess<'_>,
    max_iterations: usize,
    tolerance: f64,
) -> Deformation {
    let convergence = Convergence { max_iterations, tolerance };
    Deformer::new(method, mesh, handles, options, &Run::default())
        .unwrap()
        .deform(pose, start, &convergence, &Run::default())
        .unwrap()
}

fn last(done: &Deformation) -> f64 {
    done.report.energies[done.report.energies.len() - 1]
}

#[test]
fn the_prolonged_guess_has_less_energy_than_interpolated_rotations() {
    let case = bent(60, 40, 1.6, Constraint::Hard);
    for (method, options) in methods() {
        let first = |start| run((method, &options), &case, start, 1, 0.0).report.energies[0];
        let (spread, coarse) = (first(InitialGuess::Spread), first(InitialGuess::Coarse));
        assert!(coarse < spread, "{method:?}: {coarse} against {spread}");
    }
}

#[test]
fn every_method_reaches_the_same_minimum_without_coarse_levels() {
    let case = bent(60, 40, 1.2, Constraint::Hard);
    // Spokes of negative weight have several minima, and elements fold in many ways of almost the same energy.
    for (method, options) in
        methods().into_iter().filter(|m| ![Method::ArapSpokes, Method::ArapElements].contains(&m.0))
    {
        let [spread, coarse] =
            [InitialGuess::Spread, InitialGuess::Coarse].map(|s| run((method, &options), &case, s, 1000, 1e-8));
        let (a, b) = (last(&spread), last(&coarse));
        assert!((b / a - 1.0).abs() < 1e-4, "{method:?}: {b} against {a}");
        assert_eq!(coarse.report.constraint_error, 0.0);
    }
}

#[test]
fn coarse_levels_are_as_stiff_as_the_fine_surface() {
    let case = bent(60, 40, 1.6, Constraint::Hard);
    let options = DeformOptions::default();
    let fine = last(&run((Method::Arap, &options), &case, InitialGuess::Spread, 1000, 1e-9));
    let mut coarse =
        Coarse::new(Method::Arap, &case.0, &case.1, &options, &Run::default()).expect("a run that never stops");
    let level = coarse.levels.last_mut().unwrap();
    let enough = Convergence { max_iterations: 1000, tolerance: 1e-9 };
    let done = level.bound.deform(&level.pose(&case.2), InitialGuess::Spread, &enough, &Run::default()).unwrap();
    assert!((0.8..1.25).contains(&(last(&done) / fine)), "{} {fine}", last(&done));
}

#[test]
fn rigid_motions_are_reproduced_and_results_scale_with_the_mesh() {
    let (mesh, handles, pose) = bent(60, 40, 1.2, Constraint::Hard);
    let motion = Isometry3::new(Vector3::new(0.7, -1.9, 0.4), Vector3::new(1.1, -0.6, 2.0));
    let moved = HandlePose::new(handles.vertices().iter().map(|&v| motion * mesh.positions()[v as usize]).collect());
    let options = DeformOptions::default();
    let done = run((Method::Arap, &options), &(mesh.clone(), handles.clone(), moved), InitialGuess::Coarse, 1000, 1e-9);
    for (p, x) in mesh.positions().iter().zip(&done.positions) {
        assert!((motion * p - x).norm() < 1e-9 * mesh.diagonal());
    }
    let case = (mesh.clone(), handles.clone(), pose.clone());
    let plain = run((Method::Arap, &options), &case, InitialGuess::Coarse, 3, 0.0);
    // Powers of two, so that ties between edges of equal cost are resolved alike.
    for scale in [1.0 / 1024.0, 1024.0] {
        let there = HandlePose::new(pose.positions().iter().map(|p| p * scale).collect());
        let case = (placed(&mesh, scale, Vector3::zeros()), handles.clone(), there);
        let done = run((Method::Arap, &options), &case, InitialGuess::Coarse, 3, 0.0);
        for (x, y) in plain.positions.iter().zip(&done.positions) {
            assert!((x * scale - y).norm() < 1e-9 * scale, "{scale}");
        }
    }
}

#[test]
fn a_first_drag_uses_coarse_levels_and_the_next_the_last_result() {
    let case = bent(60, 40, 1.2, Constraint::Hard);
    let options = DeformOptions::default();
    let mut bound = Deformer::new(Method::Arap, &case.0, &case.1, &options, &Run::default()).unwrap();
    let enough = Convergence { max_iterations: 1000, tolerance: 1e-9 };
    let first = bound.deform(&case.2, InitialGuess::Last, &enough, &Run::default()).unwrap();
    assert_eq!(first.positions, run((Method::Arap, &options), &case, InitialGuess::Coarse, 1000, 1e-9).positions);
    let next = bound.deform(&case.2, InitialGuess::Last, &enough, &Run::default()).unwrap();
    assert!(next.report.iterations <= 2, "{}", next.report.iterations);
}

#[test]
fn small_and_degenerate_surfaces_are_supported() {
    let small = bent(12, 8, 0.7, Constraint::Hard);
    let [spread, coarse] = [InitialGuess::Spread, InitialGuess::Coarse]
        .map(|start| run((Method::Arap, &DeformOptions::default()), &small, start, 99, 1e-9));
    assert_eq!(spread.positions, coarse.positions, "no vertex is too many");
    // Two parts, one of them without a handle, a fin, and triangles that are none.
    let (mesh, handles, pose) = bent(60, 40, 0.8, Constraint::Hard);
    let count = mesh.vertex_count() as u32;
    let mut positions = mesh.positions().to_vec();
    let mut triangles = mesh.triangles().to_vec();
    positions.extend(mesh.positions().iter().map(|p| p + Vector3::new(0.0, 3.0, 0.0)));
    triangles.extend(mesh.triangles().iter().map(|t| t.map(|v| v + count)));
    positions.push(positions[900] + Vector3::new(0.0, 0.3, 0.2));
    triangles.extend([[900, 901, 2 * count], [5, 6, 5], [77, 77, 77], [300, 301, 302], [300, 301, 302]]);
    let case = (TriMesh::new(positions, triangles).unwrap(), handles, pose);
    let second = count as usize..2 * count as usize;
    for (method, options) in methods() {
        let done = run((method, &options), &case, InitialGuess::Coarse, 30, 1e-6);
        assert!(done.positions.iter().all(|p| p.coords.iter().all(|c| c.is_finite())), "{method:?}");
        for (x, p) in done.positions[second.clone()].iter().zip(&case.0.positions()[second.clone()]) {
            assert!((x - p).norm() < 1e-12, "{method:?}");
        }
    }
}

#[test]
fn the_default_guess_ends_in_the_lowest_minimum_of_a_large_twist() {
    let mesh = tube(40, 24);
    let ends = (0..mesh.vertex_count() as u32).filter(|&v| !(0.15..1.85).contains(&mesh.positions()[v as usize].x));
    let handles = Handles::exact(ends).unwrap();
    for angle in [1.2, 2.0, 2.9] {
        let twist = Isometry3::new(Vector3::zeros(), angle * Vector3::x());
        let target = |&v: &u32| {
            let p = mesh.positions()[v as usize];
            if p.x < 1.0 { p } else { twist * p }
        };
        let pose = HandlePose::new(handles.vertices().iter().map(target).collect());
        let case = (mesh.clone(), handles.clone(), pose);
        let energy = |guess| last(&run((Method::Arap, &DeformOptions::default()), &case, guess, 1000, 1e-7));
        let lowest = energy(InitialGuess::Rest).min(energy(InitialGuess::Spread));
        assert!(energy(InitialGuess::Auto) <= 1.001 * lowest, "{angle}");
    }
}

#[test]
fn the_way_of_a_screw_motion_is_covered_in_proportion() {
    let (mesh, handles, _) = bent(20, 12, 0.0, Constraint::Hard);
    let deformer = single_level(Method::Arap, &mesh, &handles, &DeformOptions::default(), &Run::default()).unwrap();
    let motion = |fraction: f64| Isometry3::new(fraction * Vector3::new(0.3, 0.0, 0.0), 2.0 * fraction * Vector3::x());
    let moved = |fraction: f64| {
        let target = |&v: &u32| motion(fraction) * mesh.positions()[v as usize];
        HandlePose::new(handles.vertices().iter().map(target).collect())
    };
    let (half, expected) = (deformer.partway(&moved(1.0), 0.5).unwrap(), moved(0.5));
    for (p, q) in half.positions().iter().zip(expected.positions()) {
        assert!((p - q).norm() < 1e-9, "{p} {q}");
    }
    assert!(deformer.largest_rotation(&moved(1.0)).unwrap() < 1e-6, "no handle rotates against another");
}
