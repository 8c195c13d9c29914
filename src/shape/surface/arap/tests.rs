//! Laws of ARAP.

use nalgebra::{Isometry3, Point3, Vector3};

use super::super::test_meshes::{placed, sheet, tube};
use super::super::{Deformer, Hold};
use super::*;
use crate::mesh::operators::{CotangentRule, EdgeWeights};
use plumbline_num::options::OptionError;
use plumbline_num::run::Run;

const KINDS: [CellKind; 3] = [CellKind::Spokes, CellKind::SpokesAndRims, CellKind::Elements];

fn motion() -> Isometry3<f64> {
    Isometry3::new(Vector3::new(0.7, -1.9, 0.4), Vector3::new(1.1, -0.6, 2.0))
}

/// Both ends of a tube, the right one bent by an angle about z and moved.
fn bend(mesh: &TriMesh, angle: f64) -> (Handles, HandlePose) {
    let ends = |p: &Point3<f64>| p.x < 0.15 || p.x > 1.85;
    let held: Vec<u32> = (0..mesh.vertex_count() as u32).filter(|&v| ends(&mesh.positions()[v as usize])).collect();
    let turn = Isometry3::rotation(Vector3::new(0.3 * angle, 0.0, angle));
    let pose = held.iter().map(|&v| {
        let p = mesh.positions()[v as usize];
        if p.x < 1.0 { p } else { Point3::new(1.2, 0.5, 0.1) + turn * (p - Point3::new(2.0, 0.0, 0.0)) }
    });
    (Handles::exact(held.iter().copied()).unwrap(), HandlePose::new(pose.collect()))
}

fn tight(max_iterations: usize) -> Convergence {
    Convergence { max_iterations, tolerance: 0.0 }
}

#[test]
fn a_rigid_motion_of_the_handles_moves_everything() {
    let mesh = sheet(9);
    for kind in KINDS {
        // Spokes of negative weight would rather turn their cell against the motion.
        let cotangents = if kind == CellKind::Spokes { CotangentRule::Clamped } else { CotangentRule::Raw };
        for held in [vec![0, 1, 2, 9, 40, 80], vec![3, 77], vec![44]] {
            for start in [Start::Spread, Start::Last] {
                let handles = Handles::exact(held.iter().copied()).unwrap();
                let options = DeformOptions { cotangents, ..Default::default() };
                let mut arap = Arap::new(kind, &mesh, &handles, &options, &Run::default()).unwrap();
                let targets = held.iter().map(|&v| motion() * mesh.positions()[v as usize]).collect();
                let done = arap.deform(&HandlePose::new(targets), start, &tight(3), &Run::default()).unwrap();
                let edges = EdgeWeights::uniform(&mesh);
                for (i, j, _) in edges.iter() {
                    let length = |p: &[Point3<f64>]| (p[i] - p[j]).norm();
                    let change = length(&done.positions) - length(mesh.positions());
                    assert!(change.abs() < 1e-11 * mesh.diagonal(), "{kind:?} {held:?}: {change}");
                }
                if held.len() > 2 {
                    for (p, x) in mesh.positions().iter().zip(&done.positions) {
                        assert!((motion() * p - x).norm() < 1e-11 * mesh.diagonal());
                    }
                }
                assert!(done.report.energies.last().unwrap().abs() < 1e-20 * arap.elastic.at_rest, "{:?}", done.report);
            }
        }
    }
}

const SOLVERS: [Solver; 3] = [Solver::LocalGlobal, Solver::Accelerated, Solver::GaussNewton];

#[test]
fn the_energy_never_rises_and_is_the_one_defined_edge_by_edge() {
    let mesh = tube(24, 12);
    let (handles, pose) = bend(&mesh, 1.8);
    for (kind, solver) in KINDS.into_iter().flat_map(|kind| SOLVERS.map(|solver| (kind, solver))) {
        for (start, bending) in [(Start::Rest, 1.0), (Start::Spread, 1.0), (Start::Rest, 0.3), (Start::Spread, 0.01)] {
            let options = DeformOptions { solver, bending, ..Default::default() };
            let mut arap = Arap::new(kind, &mesh, &handles, &options, &Run::default()).unwrap();
            let targets = arap.bound.targets(&pose).unwrap();
            let mut x = arap.start(&pose, &targets, start).unwrap();
            let (energies, _) =
                arap.minimize(&targets, &mut x, &tight(60), &Run::default()).expect("a run that never stops");
            for pair in energies.windows(2) {
                assert!(pair[1] <= pair[0] * (1.0 + 1e-12), "{kind:?} {solver:?} {pair:?}");
            }
            let exact = arap.elastic.defined(&arap.bound.rest, &x);
            assert!((energies.last().unwrap() - exact).abs() < 1e-12 * arap.elastic.at_rest, "{kind:?} {solver:?}");
        }
    }
}

#[test]
fn all_solvers_and_starts_end_at_the_same_minimum() {
    let mesh = tube(20, 10);
    let (handles, pose) = bend(&mesh, 1.2);
    for kind in [CellKind::Spokes, CellKind::SpokesAndRims] {
        for hold in [Hold::Exact, Hold::Soft(3.0)] {
            let handles = Handles::new(handles.vertices().iter().map(|&v| (v, hold))).unwrap();
            let mut ends = Vec::new();
            for (solver, start) in SOLVERS.into_iter().flat_map(|s| [(s, Start::Rest), (s, Start::Spread)]) {
                // Spokes of negative weight have several minima.
                let options = DeformOptions { solver, cotangents: CotangentRule::Clamped, ..Default::default() };
                let mut arap = Arap::new(kind, &mesh, &handles, &options, &Run::default()).unwrap();
                let done = arap
                    .deform(&pose, start, &Convergence { max_iterations: 20_000, tolerance: 1e-13 }, &Run::default())
                    .unwrap();
                ends.push((*done.report.energies.last().unwrap(), done.report.iterations));
            }
            for &(energy, _) in &ends {
                assert!((energy - ends[0].0).abs() < 1e-9 * ends[0].0, "{kind:?} {hold:?} {ends:?}");
            }
            // Local–global steps are the slow ones, from either start.
            assert!(ends[0].1 > 3 * ends[2].1 && ends[0].1 > ends[4].1, "{ends:?}");
            assert!(ends[1].1 > 3 * ends[3].1 && ends[1].1 > ends[5].1, "{ends:?}");
        }
    }
}

#[test]
fn the_pull_of_the_cells_is_minus_half_the_gradient_beside_the_laplacian() {
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
fn results_move_and_grow_with_the_mesh() {
    let mesh = tube(16, 9);
    let (handles, pose) = bend(&mesh, 1.2);
    let solve = |mesh: &TriMesh, pose: &HandlePose| {
        let mut arap = Deformer::new(Method::Arap, mesh, &handles, &DeformOptions::default(), &Run::default()).unwrap();
        // As many rounds for all: near the end rounding decides when to stop.
        arap.deform(pose, Start::Spread, &tight(20), &Run::default()).unwrap()
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
fn soft_handles_come_nearer_the_heavier_they_are() {
    let mesh = tube(16, 9);
    let (handles, pose) = bend(&mesh, 1.2);
    let error = |weight: f64| {
        let soft = Handles::new(handles.vertices().iter().map(|&v| (v, Hold::Soft(weight)))).unwrap();
        let mut arap = Deformer::new(Method::Arap, &mesh, &soft, &DeformOptions::default(), &Run::default()).unwrap();
        let done = arap.deform(&pose, Start::Spread, &tight(200), &Run::default()).unwrap();
        done.report.constraint_error / mesh.diagonal()
    };
    let errors = [1e-2, 1.0, 1e2, 1e4, 1e6].map(error);
    assert!(errors.is_sorted_by(|a, b| a > b), "{errors:?}");
    assert!(errors[0] > 1e-2 && errors[4] < 1e-6, "{errors:?}");
}

#[test]
fn a_part_without_handle_stays_and_is_named() {
    let (a, b) = (sheet(4), placed(&sheet(5), 1.0, Vector3::new(5.0, 0.0, 0.0)));
    let positions = [a.positions(), b.positions(), &[Point3::new(9.0, 9.0, 9.0)]].concat();
    let second = b.triangles().iter().map(|t| t.map(|v| v + 16));
    let mesh = TriMesh::new(positions, a.triangles().iter().copied().chain(second).collect()).unwrap();
    let handles = Handles::exact([0, 15]).unwrap();
    let pose = HandlePose::new(vec![Point3::origin(), Point3::new(2.0, 1.0, 0.5)]);
    let mut arap = Deformer::new(Method::Arap, &mesh, &handles, &DeformOptions::default(), &Run::default()).unwrap();
    let done = arap.deform(&pose, Start::Spread, &Convergence::default(), &Run::default()).unwrap();
    assert_eq!(done.report.held_still, [super::super::Part { vertex: 16, vertices: 25 }]);
    assert_eq!(done.positions[16..], mesh.positions()[16..]);
    let options = DeformOptions { unheld: super::super::Unheld::Refused, ..Default::default() };
    let refused = Deformer::new(Method::Arap, &mesh, &handles, &options, &Run::default()).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "nothing holds the part of 25 vertices that contains vertex 16: hold one of them or let it stay where it is"
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
                .deform(&HandlePose::new(targets), Start::Spread, &Convergence::default(), &Run::default())
                .unwrap();
            assert!(done.positions.iter().all(|p| p.coords.iter().all(|c| c.is_finite())), "{method:?} {rule:?}");
            // Flips may take up a face without area.
            let counted = done.report.degenerate_faces;
            assert!(counted == 4 || rule == CotangentRule::IntrinsicDelaunay && counted > 0, "{rule:?} {counted}");
        }
    }
}

#[test]
fn what_cannot_be_held_is_refused() {
    let mesh = sheet(3);
    let refused = |handles: Handles| {
        Deformer::new(Method::Arap, &mesh, &handles, &DeformOptions::default(), &Run::default()).unwrap_err()
    };
    assert_eq!(refused(Handles::default()), SurfaceError::NoHandle);
    let beyond = refused(Handles::exact([9]).unwrap());
    assert_eq!(beyond.to_string(), "a handle names vertex 9, but the mesh has 9 vertices, numbered from 0");
    let empty = TriMesh::default();
    let nothing = Deformer::new(Method::Arap, &empty, &Handles::default(), &DeformOptions::default(), &Run::default())
        .unwrap_err();
    assert_eq!(nothing, SurfaceError::NoHandle);
}

#[test]
fn smooth_rotations_differ_less_and_the_energy_still_falls() {
    let mesh = tube(24, 12);
    let (handles, pose) = bend(&mesh, 1.8);
    let mut rough = f64::INFINITY;
    for smoothness in [1e-4, 2e-2, 1.0] {
        for kind in [CellKind::Spokes, CellKind::SpokesAndRims] {
            let options = DeformOptions { smoothness, ..Default::default() };
            let mut arap = Arap::new(kind, &mesh, &handles, &options, &Run::default()).unwrap();
            let done = arap.deform(&pose, Start::Rest, &tight(400), &Run::default()).unwrap();
            for pair in done.report.energies.windows(2) {
                assert!(pair[1] <= pair[0] * (1.0 + 1e-12), "{kind:?} {smoothness} {pair:?}");
            }
            if kind == CellKind::SpokesAndRims {
                let turns = arap.elastic.cells.turn_matrices(mesh.vertex_count());
                let unit = Smoothness::new(&arap.elastic.weights, 1.0).energy(&turns);
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
