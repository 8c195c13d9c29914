//! Laws of ARAP.

use nalgebra::{Isometry3, Point3, Vector3};

use super::super::test_meshes::{placed, sheet, tube};
use super::super::{Constraint, Deformer, HandlePose, InitialGuess};
use super::*;
use crate::mesh::operators::{CotangentRule, EdgeWeights};
use plumbline_num::energy::Convergence;
use plumbline_num::options::OptionError;
use plumbline_num::run::Run;

const KINDS: [CellKind; 3] = [CellKind::Spokes, CellKind::SpokesAndRims, CellKind::Elements];

fn motion() -> Isometry3<f64> {
    Isometry3::new(Vector3::new(0.7, -1.9, 0.4), Vector3::new(1.1, -0.6, 2.0))
}

/// Both ends of a tube, the right one bent by an angle about z and moved.
fn bend(mesh: &TriMesh, angle: f64) -> (Handles, HandlePose) {
    let ends = |p: &Point3<f64>| p.x < 0.15 || p.x > 1.85;
    let fixed: Vec<u32> = (0..mesh.vertex_count() as u32).filter(|&v| ends(&mesh.positions()[v as usize])).collect();
    let rotation = Isometry3::rotation(Vector3::new(0.3 * angle, 0.0, angle));
    let pose = fixed.iter().map(|&v| {
        let p = mesh.positions()[v as usize];
        if p.x < 1.0 { p } else { Point3::new(1.2, 0.5, 0.1) + rotation * (p - Point3::new(2.0, 0.0, 0.0)) }
    });
    (Handles::exact(fixed.iter().copied()).unwrap(), HandlePose::new(pose.collect()))
}

fn tight(max_iterations: usize) -> Convergence {
    Convergence { max_iterations, tolerance: 0.0 }
}

#[test]
fn a_rigid_motion_of_the_handles_moves_everything() {
    let mesh = sheet(9);
    for kind in KINDS {
        // Spokes of negative weight prefer the inverse rotation of their cell.
        let cotangents = if kind == CellKind::Spokes { CotangentRule::Clamped } else { CotangentRule::Raw };
        for vertices in [vec![0, 1, 2, 9, 40, 80], vec![3, 77], vec![44]] {
            for start in [InitialGuess::Spread, InitialGuess::Last] {
                let handles = Handles::exact(vertices.iter().copied()).unwrap();
                let options = DeformOptions { cotangents, ..Default::default() };
                let mut arap = Arap::new(kind, &mesh, &handles, &options, &Run::default()).unwrap();
                let targets = vertices.iter().map(|&v| motion() * mesh.positions()[v as usize]).collect();
                let done = arap.deform(&HandlePose::new(targets), start, &tight(3), &Run::default()).unwrap();
                let edges = EdgeWeights::uniform(&mesh);
                for (i, j, _) in edges.iter() {
                    let length = |p: &[Point3<f64>]| (p[i] - p[j]).norm();
                    let change = length(&done.positions) - length(mesh.positions());
                    assert!(change.abs() < 1e-11 * mesh.diagonal(), "{kind:?} {vertices:?}: {change}");
                }
                if vertices.len() > 2 {
                    for (p, x) in mesh.positions().iter().zip(&done.positions) {
                        assert!((motion() * p - x).norm() < 1e-11 * mesh.diagonal());
                    }
                }
                assert!(
                    done.report.energies.last().unwrap().abs() < 1e-20 * arap.elastic.constant,
                    "{:?}",
                    done.report
                );
            }
        }
    }
}

const SOLVERS: [Solver; 3] = [Solver::LocalGlobal, Solver::Accelerated, Solver::GaussNewton];

#[test]
fn the_energy_never_increases_and_equals_its_definition_edge_by_edge() {
    let mesh = tube(24, 12);
    let (handles, pose) = bend(&mesh, 1.8);
    for (kind, solver) in KINDS.into_iter().flat_map(|kind| SOLVERS.map(|solver| (kind, solver))) {
        for (start, bending) in [
            (InitialGuess::Rest, 1.0),
            (InitialGuess::Spread, 1.0),
            (InitialGuess::Rest, 0.3),
            (InitialGuess::Spread, 0.01),
        ] {
            let options = DeformOptions { solver, bending, ..Default::default() };
            let mut arap = Arap::new(kind, &mesh, &handles, &options, &Run::default()).unwrap();
            let targets = arap.bound.targets(&pose).unwrap();
            let (convergence, run) = (tight(60), Run::default());
            let request = Request { pose: &pose, guess: start, convergence: &convergence, run: &run, measured: true };
            let mut x = arap.initial(&request, &targets).unwrap();
            let (energies, _) = arap.minimize(&targets, &mut x, &request).expect("a run that never stops");
            for pair in energies.windows(2) {
                assert!(pair[1] <= pair[0] * (1.0 + 1e-12), "{kind:?} {solver:?} {pair:?}");
            }
            let exact = arap.elastic.exact_energy(&arap.bound.rest, &x);
            assert!((energies.last().unwrap() - exact).abs() < 1e-12 * arap.elastic.constant, "{kind:?} {solver:?}");
        }
    }
}

#[test]
fn all_solvers_and_initial_guesses_reach_the_same_minimum() {
    let mesh = tube(20, 10);
    let (handles, pose) = bend(&mesh, 1.2);
    for kind in [CellKind::Spokes, CellKind::SpokesAndRims] {
        for constraint in [Constraint::Hard, Constraint::Soft(3.0)] {
            let handles = Handles::new(handles.vertices().iter().map(|&v| (v, constraint))).unwrap();
            let mut ends = Vec::new();
            for (solver, start) in
                SOLVERS.into_iter().flat_map(|s| [(s, InitialGuess::Rest), (s, InitialGuess::Spread)])
            {
                // Spokes of negative weight have several minima.
                let options = DeformOptions { solver, cotangents: CotangentRule::Clamped, ..Default::default() };
                let mut arap = Arap::new(kind, &mesh, &handles, &options, &Run::default()).unwrap();
                let done = arap
                    .deform(&pose, start, &Convergence { max_iterations: 20_000, tolerance: 1e-13 }, &Run::default())
                    .unwrap();
                ends.push((*done.report.energies.last().unwrap(), done.report.iterations));
            }
            for &(energy, _) in &ends {
                assert!((energy - ends[0].0).abs() < 1e-9 * ends[0].0, "{kind:?} {constraint:?} {ends:?}");
            }
            // Local/global iterations converge most slowly, from either initial guess.
            assert!(ends[0].1 > 3 * ends[2].1 && ends[0].1 > ends[4].1, "{ends:?}");
            assert!(ends[1].1 > 3 * ends[3].1 && ends[1].1 > ends[5].1, "{ends:?}");
        }
    }
}

#[test]
fn the_right_hand_side_of_the_cells_is_laplacian_minus_half_the_gradient() {
    let mesh = sheet(6);
    for (kind, bending) in KINDS.into_iter().flat_map(|kind| [(kind, 1.0), (kind, 0.3)]) {
        let handles = Handles::exact([0, 5]).unwrap();
        let options = DeformOptions { bending, ..Default::default() };
        let mut arap = Arap::new(kind, &mesh, &handles, &options, &Run::default()).unwrap();
        let x: Vec<Lanes> = (0..36)
            .map(|v| {
                let [x, y, z] = arap.bound.rest[v].xyz();
                Lanes::point([x + 0.3 * y * y, 1.2 * y - 0.2 * x * z, z - 0.5 * x * x])
            })
            .collect();
        let (mut b, mut unused) = (x.clone(), x.clone());
        arap.elastic.fit(&x, &[], &mut b);
        let laplacian = arap.elastic.weights.laplacian().unwrap();
        for c in 0..3 {
            let column: Vec<f64> = x.iter().map(|x| x.0[c]).collect();
            let mut lx = column.clone();
            laplacian.multiply(&column, &mut lx);
            for v in [0, 7, 14, 35] {
                let gradient = 2.0 * (kind.laplacians() * lx[v] - b[v].0[c]);
                let mut energy_at = |step: f64| {
                    let mut moved = x.clone();
                    moved[v].0[c] += step;
                    arap.elastic.fit(&moved, &[], &mut unused)
                };
                let difference = (energy_at(1e-5) - energy_at(-1e-5)) / 2e-5;
                assert!((gradient - difference).abs() < 1e-8, "{kind:?} {gradient} {difference}");
            }
        }
    }
}

#[test]
fn results_are_equivariant_to_translation_and_scale() {
    let mesh = tube(16, 9);
    let (handles, pose) = bend(&mesh, 1.2);
    let solve = |mesh: &TriMesh, pose: &HandlePose| {
        let mut arap = Deformer::new(Method::Arap, mesh, &handles, &DeformOptions::default(), &Run::default()).unwrap();
        // The same number of iterations for all: near convergence rounding decides when to stop.
        arap.deform(pose, InitialGuess::Spread, &tight(20), &Run::default()).unwrap()
    };
    let plain = solve(&mesh, &pose);
    for (scale, offset, digits) in [(1e-3, 0.0, 1e-11), (1e3, 0.0, 1e-11), (1.0, 1e6, 1e-7)] {
        let offset = Vector3::repeat(offset);
        let there = HandlePose::new(pose.positions().iter().map(|p| p * scale + offset).collect());
        let done = solve(&placed(&mesh, scale, offset), &there);
        for (x, y) in plain.positions.iter().zip(&done.positions) {
            assert!((x * scale + offset - y).norm() < digits * scale, "{scale} {offset}");
        }
    }
}

#[test]
fn the_error_of_soft_constraints_falls_with_their_weight() {
    let mesh = tube(16, 9);
    let (handles, pose) = bend(&mesh, 1.2);
    let error = |weight: f64| {
        let soft = Handles::new(handles.vertices().iter().map(|&v| (v, Constraint::Soft(weight)))).unwrap();
        let mut arap = Deformer::new(Method::Arap, &mesh, &soft, &DeformOptions::default(), &Run::default()).unwrap();
        let done = arap.deform(&pose, InitialGuess::Spread, &tight(200), &Run::default()).unwrap();
        done.report.constraint_error / mesh.diagonal()
    };
    let errors = [1e-2, 1.0, 1e2, 1e4, 1e6].map(error);
    assert!(errors.is_sorted_by(|a, b| a > b), "{errors:?}");
    assert!(errors[0] > 1e-2 && errors[4] < 1e-6, "{errors:?}");
}

#[test]
fn a_component_without_handle_is_fixed_and_reported() {
    let (a, b) = (sheet(4), placed(&sheet(5), 1.0, Vector3::new(5.0, 0.0, 0.0)));
    let positions = [a.positions(), b.positions(), &[Point3::new(9.0, 9.0, 9.0)]].concat();
    let second = b.triangles().iter().map(|t| t.map(|v| v + 16));
    let mesh = TriMesh::new(positions, a.triangles().iter().copied().chain(second).collect()).unwrap();
    let handles = Handles::exact([0, 15]).unwrap();
    let pose = HandlePose::new(vec![Point3::origin(), Point3::new(2.0, 1.0, 0.5)]);
    let mut arap = Deformer::new(Method::Arap, &mesh, &handles, &DeformOptions::default(), &Run::default()).unwrap();
    let done = arap.deform(&pose, InitialGuess::Spread, &Convergence::default(), &Run::default()).unwrap();
    assert_eq!(done.report.fixed_components, [super::super::Component { vertex: 16, vertices: 25 }]);
    assert_eq!(done.positions[16..], mesh.positions()[16..]);
    let options = DeformOptions { unconstrained: super::super::Unconstrained::Reject, ..Default::default() };
    let refused = Deformer::new(Method::Arap, &mesh, &handles, &options, &Run::default()).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "the connected component of 25 vertices that contains vertex 16 has no handle: constrain one of its vertices, or keep such components fixed"
    );
}

#[test]
fn degenerate_faces_and_faces_on_the_same_edge_give_finite_positions() {
    let mut positions: Vec<Point3<f64>> = sheet(5).positions().to_vec();
    let mut triangles = sheet(5).triangles().to_vec();
    positions.extend([positions[7], positions[8] + Vector3::z(), nalgebra::center(&positions[3], &positions[4])]);
    triangles.extend([[7, 8, 25], [7, 7, 12], [7, 8, 26], [3, 27, 4], [9, 9, 9], [0, 1, 6], [0, 1, 6]]);
    let mesh = TriMesh::new(positions, triangles).unwrap();
    for rule in [CotangentRule::Raw, CotangentRule::Clamped, CotangentRule::IntrinsicDelaunay] {
        for method in Method::ALL {
            let handles = Handles::exact([0, 1, 24]).unwrap();
            let targets = vec![mesh.positions()[0], mesh.positions()[1], Point3::new(1.0, 1.0, 1.0)];
            let options = DeformOptions { cotangents: rule, ..Default::default() };
            let mut bound = Deformer::new(method, &mesh, &handles, &options, &Run::default()).unwrap();
            let done = bound
                .deform(&HandlePose::new(targets), InitialGuess::Spread, &Convergence::default(), &Run::default())
                .unwrap();
            assert!(done.positions.iter().all(|p| p.coords.iter().all(|c| c.is_finite())), "{method:?} {rule:?}");
            // Edge flips may absorb a face without area.
            let counted = done.report.degenerate_faces;
            assert!(counted == 4 || rule == CotangentRule::IntrinsicDelaunay && counted > 0, "{rule:?} {counted}");
        }
    }
}

#[test]
fn invalid_constraints_are_rejected() {
    let mesh = sheet(3);
    let rejected = |handles: Handles| {
        Deformer::new(Method::Arap, &mesh, &handles, &DeformOptions::default(), &Run::default()).unwrap_err()
    };
    assert_eq!(rejected(Handles::default()), SurfaceError::NoHandle);
    let beyond = rejected(Handles::exact([9]).unwrap());
    assert_eq!(beyond.to_string(), "a handle refers to vertex 9, but the mesh has 9 vertices, numbered from 0");
    let empty = TriMesh::default();
    let nothing = Deformer::new(Method::Arap, &empty, &Handles::default(), &DeformOptions::default(), &Run::default())
        .unwrap_err();
    assert_eq!(nothing, SurfaceError::NoHandle);
}

#[test]
fn rotation_smoothness_reduces_differences_and_the_energy_still_decreases() {
    let mesh = tube(24, 12);
    let (handles, pose) = bend(&mesh, 1.8);
    let mut rough = f64::INFINITY;
    for smoothness in [1e-4, 2e-2, 1.0] {
        for kind in [CellKind::Spokes, CellKind::SpokesAndRims] {
            let options = DeformOptions { smoothness, ..Default::default() };
            let mut arap = Arap::new(kind, &mesh, &handles, &options, &Run::default()).unwrap();
            let done = arap.deform(&pose, InitialGuess::Rest, &tight(400), &Run::default()).unwrap();
            for pair in done.report.energies.windows(2) {
                assert!(pair[1] <= pair[0] * (1.0 + 1e-12), "{kind:?} {smoothness} {pair:?}");
            }
            if kind == CellKind::SpokesAndRims {
                let rotations = arap.elastic.cells.rotation_matrices(mesh.vertex_count());
                let unit = Smoothness::new(&arap.elastic.weights, 1.0).energy(&rotations);
                assert!(unit < 0.9 * rough, "{smoothness}: {unit} {rough}");
                rough = unit;
            }
        }
    }
    for bending in [0.0, -1.0, 1.5, f64::NAN] {
        let options = DeformOptions { bending, ..Default::default() };
        let refused = Arap::new(CellKind::Spokes, &mesh, &handles, &options, &Run::default()).unwrap_err();
        assert!(matches!(refused, SurfaceError::Option(OptionError { name: "bending", .. })));
    }
    for (kind, smoothness) in [(CellKind::Elements, 0.1), (CellKind::Spokes, -1.0), (CellKind::Spokes, f64::NAN)] {
        let options = DeformOptions { smoothness, ..Default::default() };
        let refused = Arap::new(kind, &mesh, &handles, &options, &Run::default()).unwrap_err();
        assert!(matches!(refused, SurfaceError::Option(OptionError { name: "smoothness", .. })));
    }
}
