use nalgebra::{Point3, Rotation3, Vector3};

use super::clusters::{self, FIXED};
use super::global::Global;
use super::multigrid::Transfer;
use super::prisms::{mean_edge, prisms};
use super::shell::{BodyPose, Shell};
use super::solver::{Minimized, Solver};
use super::*;
use crate::mesh::TriMesh;
use crate::surface::Constraint;
use plumbline_num::energy::Convergence;
use plumbline_num::run::Run;
use plumbline_num::sparse::SymmetricOperator;

/// A closed bar of `n` square cells along x, `1 × 1` across.
fn bar(n: usize) -> TriMesh {
    let mut positions = Vec::new();
    for i in 0..=n {
        positions
            .extend([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[y, z]| Point3::new(i as f64 * 0.5, y, z)));
    }
    let mut triangles = vec![[0, 2, 1], [0, 3, 2]];
    for i in 0..n as u32 {
        for k in 0..4 {
            let (a, b) = (4 * i + k, 4 * i + (k + 1) % 4);
            triangles.extend([[a, b, a + 4], [b, b + 4, a + 4]]);
        }
    }
    let end = 4 * n as u32;
    triangles.extend([[end, end + 1, end + 2], [end, end + 2, end + 3]]);
    TriMesh::new(positions, triangles).expect("a sound case")
}

fn shaken(shell: &Shell, seed: u64) -> Vec<BodyPose> {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut vector = |size: f64| Vector3::from_fn(|_, _| size * (random.f64() - 0.5));
    let shake =
        |&at: &Vector3<f64>| BodyPose { rotation: Rotation3::new(vector(0.8)).into_inner(), at: at + vector(0.4) };
    shell.centers.iter().map(shake).collect()
}

fn handles_at(mesh: &TriMesh, ends: impl Fn(&Point3<f64>) -> bool) -> Handles {
    let numbered = mesh.positions().iter().zip(0..);
    Handles::exact(numbered.filter(|(p, _)| ends(p)).map(|(_, vertex)| vertex)).expect("a sound case")
}

fn pose(mesh: &TriMesh, handles: &Handles, motion: impl Fn(&Point3<f64>) -> Point3<f64>) -> HandlePose {
    HandlePose::new(handles.vertices().iter().map(|&v| motion(&mesh.positions()[v as usize])).collect())
}

fn solve(
    mesh: &TriMesh,
    handles: &Handles,
    options: &PrimoOptions,
    motion: impl Fn(&Point3<f64>) -> Point3<f64>,
) -> (Minimized, Vec<Point3<f64>>) {
    let still = vec![false; mesh.vertex_count()];
    let mut solver = Solver::new(mesh, handles, &still, options, &ShellMaterial::default());
    let targets = pose(mesh, handles, motion);
    let start = solver.best_of(vec![solver.shell.rest(), solver.rigidly_moved(&targets)], &targets);
    let convergence = Convergence { max_iterations: 200, tolerance: 1e-10 };
    let found = solver.minimize(start, &convergence, &Run::default()).expect("a sound case");
    let positions = solver.positions(&found.poses, &targets);
    (found, positions)
}

/// Rotates the far end of a bar of this `length` by `angle` about x.
fn twist(length: f64, angle: f64) -> impl Fn(&Point3<f64>) -> Point3<f64> {
    move |p| {
        let (sin, cos) = if p.x > 0.5 * length { angle.sin_cos() } else { (0.0, 1.0) };
        let (y, z) = (p.y - 0.5, p.z - 0.5);
        Point3::new(p.x, 0.5 + cos * y - sin * z, 0.5 + sin * y + cos * z)
    }
}

#[test]
fn the_gradient_is_that_of_central_differences_on_every_level() {
    let mut shell = prisms(&bar(6), 0.7, &ShellMaterial::default());
    for fixed in [0, 1, 20] {
        shell.free[fixed] = false;
    }
    let poses = shaken(&shell, 1);
    for clusters in clusters::levels(&shell, None, 4) {
        let mut global = Global::new(&shell, &clusters, false).expect("a sound case");
        let gradient = global.gradient(&shell, &clusters, &poses).to_vec();
        for (k, g) in gradient.iter().enumerate() {
            let (c, step) = (k / 6, 1e-5);
            let center = clusters.members(c).iter().map(|&b| poses[b as usize].at).sum::<Vector3<f64>>()
                / clusters.members(c).len() as f64;
            let at = |t: f64| {
                let mut moved = poses.clone();
                let mut velocity = [0.0; 6];
                velocity[k % 6] = t;
                let rotation = Rotation3::new(Vector3::from_column_slice(&velocity[..3]));
                for &b in clusters.members(c) {
                    let pose = &mut moved[b as usize];
                    pose.at = center + rotation * (pose.at - center) + Vector3::from_column_slice(&velocity[3..]);
                    pose.rotation = rotation.matrix() * pose.rotation;
                }
                0.5 * shell.energy(&moved)
            };
            let difference = (at(step) - at(-step)) / (2.0 * step);
            assert!((g - difference).abs() < 1e-7 * (1.0 + g.abs()), "{k}: {g} against {difference}");
        }
    }
}

#[test]
fn the_energy_is_the_same_wherever_the_whole_stands_and_grows_with_the_square_of_the_unit() {
    let mesh = bar(6);
    let shell = prisms(&mesh, 0.7, &ShellMaterial::default());
    let poses = shaken(&shell, 2);
    let energy = shell.energy(&poses);
    let r = Rotation3::new(Vector3::new(0.3, -2.0, 0.8)).into_inner();
    let moved: Vec<_> = poses
        .iter()
        .map(|p| BodyPose { rotation: r * p.rotation, at: r * p.at + Vector3::new(3.0, 1.0, -7.0) })
        .collect();
    assert!((shell.energy(&moved) - energy).abs() < 1e-12 * energy);
    let scaled = |s: f64| {
        let large = mesh.with_positions(mesh.positions().iter().map(|p| p * s).collect()).expect("a sound case");
        let shell = prisms(&large, 0.7 * s, &ShellMaterial::default());
        let poses: Vec<_> = poses.iter().map(|p| BodyPose { rotation: p.rotation, at: p.at * s }).collect();
        shell.energy(&poses)
    };
    for s in [1e-3, 1e3] {
        assert!((scaled(s) - s * s * energy).abs() < 1e-12 * s * s * energy);
    }
}

#[test]
fn without_thickness_a_hinge_is_free_and_with_it_bending_costs_the_square() {
    let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, -1.0, 0.0]].map(Point3::from).to_vec();
    let sheet = TriMesh::new(positions, vec![[0, 1, 2], [1, 0, 3]]).expect("a sound case");
    let folded = |h: f64| {
        let shell = prisms(&sheet, h, &ShellMaterial::default());
        let mut poses = shell.rest();
        let rotation = Rotation3::new(Vector3::x() * 0.9).into_inner();
        poses[1] = BodyPose { rotation, at: rotation * poses[1].at };
        shell.energy(&poses)
    };
    assert!(folded(0.0) < 1e-30, "{}", folded(0.0));
    assert!(folded(0.1) > 0.0 && (folded(0.1) / folded(0.05) - 4.0).abs() < 1e-9);
}

#[test]
fn a_rigid_motion_of_the_handles_moves_the_whole_rigidly() {
    for far in [Vector3::zeros(), Vector3::new(1e6, 2e6, -1e6)] {
        let mesh = bar(20);
        let mesh = mesh.with_positions(mesh.positions().iter().map(|p| p + far).collect()).expect("a sound case");
        let r = Rotation3::new(Vector3::new(1.0, -0.5, 2.0));
        let motion = |p: &Point3<f64>| r * (p - far) + far + Vector3::new(4.0, 5.0, -6.0);
        let handles = handles_at(&mesh, |p| (p.x - far.x - 5.0).abs() > 4.9);
        let (found, positions) = solve(&mesh, &handles, &PrimoOptions::default(), motion);
        assert!(found.converged);
        for (p, rest) in positions.iter().zip(mesh.positions()) {
            assert!((p - motion(rest)).norm() < 1e-9 * mesh.diagonal(), "{p} is not {}", motion(rest));
        }
    }
}

#[test]
fn the_energy_never_increases_and_the_gradient_vanishes_at_the_end() {
    let mesh = bar(40);
    let handles = handles_at(&mesh, |p| p.x < 0.6 || p.x > 19.4);
    let mut solver = Solver::new(
        &mesh,
        &handles,
        &vec![false; mesh.vertex_count()],
        &PrimoOptions::default(),
        &ShellMaterial::default(),
    );
    assert!(solver.levels.len() > 1);
    let targets = pose(&mesh, &handles, twist(20.0, 2.0));
    let start = solver.best_of(vec![solver.shell.rest(), solver.rigidly_moved(&targets)], &targets);
    let found = solver
        .minimize(start, &Convergence { max_iterations: 300, tolerance: 1e-14 }, &Run::default())
        .expect("a sound case");
    assert!(found.converged, "{:?}", found.energies);
    assert!(found.energies.windows(2).all(|w| w[1] <= w[0] * (1.0 + 1e-12)), "{:?}", found.energies);
    let mut global = Global::new(&solver.shell, &solver.levels[0], false).expect("a sound case");
    let steepest =
        global.gradient(&solver.shell, &solver.levels[0], &found.poses).iter().fold(0.0, |a: f64, g| a.max(g.abs()));
    assert!(steepest < 1e-6 * found.last(), "{steepest} at {}", found.last());
}

/// An open tube along x, of radius 1.
fn tube(rings: u32, sides: u32) -> TriMesh {
    let around = |k: u32| std::f64::consts::TAU * f64::from(k) / f64::from(sides);
    let vertex = |i: u32| Point3::new(0.25 * f64::from(i / sides), around(i % sides).cos(), around(i % sides).sin());
    let triangles = (0..(rings - 1) * sides).flat_map(|a| {
        let b = a / sides * sides + (a + 1) % sides;
        [[a, b, a + sides], [b, b + sides, a + sides]]
    });
    TriMesh::new((0..rings * sides).map(vertex).collect(), triangles.collect()).expect("a sound case")
}

#[test]
fn systems_that_are_not_factored_lead_to_the_same_minimum() {
    let mesh = tube(33, 24);
    let handles = handles_at(&mesh, |p| p.x < 0.3 || p.x > 7.7);
    let still = vec![false; mesh.vertex_count()];
    let targets = pose(&mesh, &handles, |p| if p.x > 4.0 { Point3::new(p.x - 0.2, p.y + 0.3, p.z) } else { *p });
    let minimize = |thickness: f64, largest_system: usize| {
        let options = PrimoOptions { thickness, largest_system };
        let mut solver = Solver::new(&mesh, &handles, &still, &options, &ShellMaterial::default());
        let start = solver.best_of(vec![solver.shell.rest(), solver.rigidly_moved(&targets)], &targets);
        let convergence = Convergence { max_iterations: 300, tolerance: 1e-8 };
        let found = solver.minimize(start, &convergence, &Run::default()).expect("a sound case");
        assert!(found.converged, "{thickness}: {:?}", found.energies);
        (found.last(), solver.positions(&found.poses, &targets), solver.systems[0].is_factored())
    };
    let (all, found) = (minimize(3.0, 10_000), minimize(3.0, 160));
    assert!(all.2 && !found.2 && (found.0 / all.0 - 1.0).abs() < 1e-9, "{} against {}", found.0, all.0);
    let apart = found.1.iter().zip(&all.1).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    assert!(apart < 1e-5 * mesh.diagonal(), "{apart}");
    // A thin shell, which has many minima, has soft modes, too: it is factored after all.
    assert!(minimize(0.01, 160).2);
}

#[test]
fn what_goes_to_a_coarser_level_is_the_energy_of_its_rigid_motions() {
    let mut shell = prisms(&bar(20), 0.5, &ShellMaterial::default());
    shell.free[3] = false;
    let poses = shaken(&shell, 3);
    let levels = clusters::levels(&shell, None, 20);
    let centers = |c: usize| -> Vec<Vector3<f64>> {
        let mean = |members: &[u32]| {
            members.iter().map(|&b| poses[b as usize].at).sum::<Vector3<f64>>() / members.len() as f64
        };
        (0..levels[c].count).map(|k| mean(levels[c].members(k))).collect()
    };
    let (fine, coarse) = (centers(0), centers(1));
    let transfer = Transfer::new((&levels[0], &fine), (&levels[1], &coarse));
    let mut global = Global::new(&shell, &levels[0], false).expect("a sound case");
    global.gradient(&shell, &levels[0], &poses);
    let mut coarser = Global::new(&shell, &levels[1], false).expect("a sound case").matrix;
    transfer.coarsen(&global.matrix, &mut coarser);
    let wave = |n: usize, phase: f64| (0..6 * n).map(|k| (k as f64 * 1.3 + phase).sin()).collect::<Vec<f64>>();
    let (x, r) = (wave(coarse.len(), 0.0), wave(fine.len(), 1.0));
    let mut carried = vec![0.0; r.len()];
    transfer.prolong(&x, &mut carried);
    // A part moves as its whole does.
    let part = levels[1].members(2)[0] as usize;
    let own = levels[0].of_body[part] as usize;
    let [angular, linear] = [0, 3].map(|k| Vector3::from_column_slice(&x[12 + k..15 + k]));
    let velocity = linear + angular.cross(&(poses[part].at - coarse[2]));
    assert!((Vector3::from_column_slice(&carried[6 * own + 3..6 * own + 6]) - velocity).norm() < 1e-14);
    // Restriction is the transpose, and the coarse matrix their product around the fine one.
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    assert!((dot(&transfer.restrict(&r), &x) - dot(&r, &carried)).abs() < 1e-12);
    let (mut on_fine, mut on_coarse) = (vec![0.0; r.len()], vec![0.0; x.len()]);
    global.matrix.multiply(&carried, &mut on_fine);
    coarser.multiply(&x, &mut on_coarse);
    let apart = transfer.restrict(&on_fine).iter().zip(&on_coarse).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(apart < 1e-12 && on_coarse.iter().any(|v| v.abs() > 0.1), "{apart}");
}

#[test]
fn clusters_are_connected_cover_the_free_bodies_and_shrink() {
    let mut shell = prisms(&bar(60), 0.5, &ShellMaterial::default());
    shell.free[7] = false;
    let levels = clusters::levels(&shell, None, 30);
    assert!(levels.len() >= 3 && levels.windows(2).all(|w| w[1].count * 2 < w[0].count));
    for level in &levels {
        assert_eq!(level.of_body[7], FIXED);
        let members: usize = (0..level.count).map(|c| level.members(c).len()).sum();
        assert_eq!(members, shell.centers.len() - 1);
        let largest = (0..level.count).map(|c| level.members(c).len()).max().expect("a sound case");
        assert!(largest <= 6 * members / level.count, "{largest} of {members} in one of {}", level.count);
    }
}

#[test]
fn a_single_vertex_pulls_and_a_soft_one_pulls_less() {
    let mesh = bar(12);
    let fixed = handles_at(&mesh, |p| p.x < 0.6);
    let tip = mesh.vertex_count() as u32 - 1;
    let up = |p: &Point3<f64>| p + if p.x > 3.0 { Vector3::new(0.0, 0.0, 1.0) } else { Vector3::zeros() };
    let mut reached = Vec::new();
    for constraint in [Constraint::Hard, Constraint::Soft(1.0), Constraint::Soft(1e-3)] {
        let hard = fixed.vertices().iter().map(|&v| (v, Constraint::Hard));
        let handles = Handles::new(hard.chain([(tip, constraint)])).expect("a sound case");
        let (found, positions) = solve(&mesh, &handles, &PrimoOptions::default(), up);
        assert!(found.converged);
        reached.push(positions[tip as usize].z - mesh.positions()[tip as usize].z);
    }
    assert_eq!(reached[0], 1.0);
    assert!(reached[0] > reached[1] && reached[1] > 2.0 * reached[2] && reached[2] > 0.0, "{reached:?}");
}

#[test]
fn broken_triangles_stay_finite() {
    let mesh = bar(8);
    let mut positions = mesh.positions().to_vec();
    let mut triangles = mesh.triangles().to_vec();
    positions[13] = positions[12];
    positions.extend([[9.0, 9.0, 9.0], [2.0, 3.0, 0.5]].map(Point3::from));
    let fin = positions.len() as u32 - 1;
    triangles.extend([[16, 17, fin], [5, 6, 5], [8, 8, 8], [20, 21, 22], [20, 21, 22]]);
    let mesh = TriMesh::new(positions, triangles).expect("a sound case");
    let handles = handles_at(&mesh, |p| p.x < 0.6 || p.x > 3.9);
    for thickness in [0.0, 1e-6, 1.0, 100.0] {
        let options = PrimoOptions { thickness, ..PrimoOptions::default() };
        let (found, positions) = solve(&mesh, &handles, &options, twist(4.0, 1.5));
        assert!(positions.iter().all(|p| p.coords.iter().all(|c| c.is_finite())), "thickness {thickness}");
        assert!(found.energies.windows(2).all(|w| w[1] <= w[0] * (1.0 + 1e-12)));
    }
    assert!(mean_edge(&mesh) > 0.0);
}

#[test]
fn components_without_handle_are_fixed_and_a_drag_continues_from_the_last_result() {
    let near = bar(12);
    let count = near.vertex_count() as u32;
    let far = near.positions().iter().map(|p| p + Vector3::new(0.0, 9.0, 0.0));
    let positions: Vec<_> = near.positions().iter().copied().chain(far).collect();
    let second = near.triangles().iter().map(|t| t.map(|v| v + count));
    let mesh = TriMesh::new(positions, near.triangles().iter().copied().chain(second).collect()).expect("a sound case");
    let handles = handles_at(&near, |p| p.x < 0.6 || p.x > 5.4);
    let mut primo =
        super::super::Deformer::new(Method::Primo, &mesh, &handles, &DeformOptions::default(), &Run::default())
            .expect("a sound case");
    let pose = pose(&near, &handles, twist(6.0, 0.8));
    let convergence = Convergence { max_iterations: 100, tolerance: 1e-9 };
    let first = primo.deform(&pose, InitialGuess::Spread, &convergence, &Run::default()).expect("a sound case");
    assert_eq!((first.report.stop, first.report.constraint_error), (Stop::Converged, 0.0));
    assert_eq!(first.report.fixed_components.len(), 1);
    assert_eq!(first.positions[count as usize..], mesh.positions()[count as usize..]);
    for (k, guess) in
        [InitialGuess::Last, InitialGuess::At(&first.positions), InitialGuess::Rest].into_iter().enumerate()
    {
        let again = primo.deform(&pose, guess, &convergence, &Run::default()).expect("a sound case");
        let (now, before) =
            (again.report.energies.last().expect("a sound case"), first.report.energies.last().expect("a sound case"));
        assert!((now / before - 1.0).abs() < 1e-6, "{now} against {before}");
        assert!(k > 0 || again.report.iterations < first.report.iterations);
    }
}

#[test]
fn invalid_shells_are_rejected() {
    let (mesh, handles) = (bar(2), Handles::exact([0]).expect("a sound case"));
    let said = |primo: PrimoOptions| {
        let options = DeformOptions { primo, ..DeformOptions::default() };
        Primo::new(&mesh, &handles, &options, &ShellMaterial::default(), &Run::default())
            .expect_err("a faulty case")
            .to_string()
    };
    let thickness = PrimoOptions { thickness: -1.0, ..PrimoOptions::default() };
    assert_eq!(said(thickness), "thickness -1 is invalid (expected a finite number, 0 or more)");
    let system = PrimoOptions { largest_system: 0, ..PrimoOptions::default() };
    assert_eq!(said(system), "largest_system 0 is invalid (expected 1 or more)");
    let soft = vec![0.0; mesh.triangle_count()];
    let material = ShellMaterial { stiffness: Some(&soft), ..ShellMaterial::default() };
    let refused =
        Primo::new(&mesh, &handles, &DeformOptions::default(), &material, &Run::default()).expect_err("a faulty case");
    assert_eq!(refused.to_string(), "stiffness 0 is invalid (expected finite numbers above 0)");
}

#[test]
fn a_stiffer_part_keeps_its_shape_better() {
    let mesh = bar(20);
    let handles = handles_at(&mesh, |p| p.x < 0.6 || p.x > 9.4);
    let pose = pose(&mesh, &handles, twist(10.0, 1.2));
    // How far the first half is twisted, as the angle of a ring in the middle.
    let angle = |factor: f64| {
        let middle = |t: usize| mesh.corners(t).iter().map(|p| p.x).sum::<f64>() / 3.0;
        let stiffness: Vec<f64> =
            (0..mesh.triangle_count()).map(|t| if middle(t) < 5.0 { factor } else { 1.0 }).collect();
        let options = DeformOptions::default();
        let material = ShellMaterial { stiffness: Some(&stiffness), ..ShellMaterial::default() };
        let mut primo = Primo::new(&mesh, &handles, &options, &material, &Run::default()).expect("a sound case");
        let done =
            primo.deform(&pose, InitialGuess::Spread, &Convergence::default(), &Run::default()).expect("a sound case");
        let ring = &done.positions[40..44];
        let side = ring[1] - ring[0] + (ring[2] - ring[3]);
        side.z.atan2(side.y)
    };
    assert!((angle(1.0) - 0.6).abs() < 0.02, "{}", angle(1.0));
    assert!(angle(20.0) < 0.15 && angle(0.05) > 1.05, "{} {}", angle(20.0), angle(0.05));
}

#[test]
fn a_grain_stiffens_bending_across_it_alone() {
    let corners = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.5, 0.0], [-1.0, 0.5, 0.0]].map(Point3::from);
    let mesh = TriMesh::new(corners.to_vec(), vec![[0, 2, 1], [0, 1, 3]]).expect("a sound case");
    // One of two triangles turned about the middle of their common edge, which lies along y.
    let energy = |grain: Option<Vector3<f64>>, axis: Vector3<f64>| {
        let grain = grain.map(|g| [g; 2]);
        let shell =
            prisms(&mesh, 0.5, &ShellMaterial { grain: grain.as_ref().map(|g| &g[..]), ..ShellMaterial::default() });
        let mut poses = shell.rest();
        let (rotation, hinge) = (Rotation3::new(axis * 0.3), Vector3::new(0.0, 0.5, 0.0));
        poses[1] = BodyPose { rotation: rotation.into_inner(), at: hinge + rotation * (poses[1].at - hinge) };
        shell.energy(&poses)
    };
    let (bend, shear) = (Vector3::y(), Vector3::z());
    for (grain, factor) in [(Vector3::x() * 2.0, 5.0), (Vector3::y() * 2.0, 1.0), (Vector3::new(1.0, 1.0, 0.0), 2.0)] {
        assert!((energy(Some(grain), bend) / energy(None, bend) - factor).abs() < 1e-12, "{grain}");
        assert!((energy(Some(grain), shear) / energy(None, shear) - 1.0).abs() < 1e-12, "{grain}");
    }
}

#[test]
fn triangles_of_one_number_move_as_one_body_and_the_rest_gives_way() {
    let mesh = bar(20);
    let handles = handles_at(&mesh, |p| p.x < 0.6 || p.x > 9.4);
    let pose = pose(&mesh, &handles, twist(10.0, 1.2));
    let middle = |t: usize| mesh.corners(t).iter().map(|p| p.x).sum::<f64>() / 3.0;
    // A bone of some rings, and one that a handle holds in part.
    let number = |t: usize| match middle(t) {
        x if (3.0..5.0).contains(&x) => Some(7),
        x if x > 9.0 => Some(9),
        _ => None,
    };
    let rigid: Vec<Option<u32>> = (0..mesh.triangle_count()).map(number).collect();
    let material = ShellMaterial { rigid: Some(&rigid), ..ShellMaterial::default() };
    let mut primo =
        Primo::new(&mesh, &handles, &DeformOptions::default(), &material, &Run::default()).expect("a sound case");
    let convergence = Convergence { max_iterations: 200, tolerance: 1e-10 };
    let done = primo.deform(&pose, InitialGuess::Spread, &convergence, &Run::default()).expect("a sound case");
    let inner: Vec<usize> = (0..mesh.vertex_count()).filter(|&v| (3.4..4.6).contains(&mesh.positions()[v].x)).collect();
    assert!(inner.len() >= 8);
    for (&v, &w) in inner.iter().zip(&inner[1..]).chain(inner.iter().zip(&inner[4..])) {
        let length = |p: &[Point3<f64>]| nalgebra::distance(&p[v], &p[w]);
        assert!((length(&done.positions) - length(mesh.positions())).abs() < 1e-12 * mesh.diagonal());
    }
    let energies = &done.report.energies;
    assert!(energies.windows(2).all(|w| w[1] <= w[0] * (1.0 + 1e-12)));
    let mut free = Primo::new(&mesh, &handles, &DeformOptions::default(), &ShellMaterial::default(), &Run::default())
        .expect("a sound case");
    let free = free.deform(&pose, InitialGuess::Spread, &convergence, &Run::default()).expect("a sound case");
    let least = free.report.energies.last().expect("the energy at the start");
    assert!(energies[energies.len() - 1] > 1.02 * least, "what must not bend costs");
    // From any positions bones start straight.
    let again =
        primo.deform(&pose, InitialGuess::At(&free.positions), &convergence, &Run::default()).expect("a sound case");
    let (a, b) = (again.report.energies.last().expect("the energy"), energies.last().expect("the energy"));
    assert!((a / b - 1.0).abs() < 1e-6, "{a} {b}");
}

#[test]
fn results_are_equivariant_to_similarities() {
    let mesh = bar(10);
    let handles = handles_at(&mesh, |p| p.x < 0.6 || p.x > 4.4);
    let (plain, expected) = solve(&mesh, &handles, &PrimoOptions::default(), twist(5.0, 1.0));
    for (scale, offset) in [(1e-3, 0.0), (1e3, 0.0), (1.0, 1e6)] {
        let rotation = Rotation3::new(Vector3::new(0.4, -1.0, 2.0));
        let moved_to = |p: &Point3<f64>| rotation * (p * scale) + Vector3::repeat(offset);
        let there = mesh.with_positions(mesh.positions().iter().map(moved_to).collect()).expect("a sound case");
        let back = |p: &Point3<f64>| rotation.inverse() * (p - Vector3::repeat(offset)) / scale;
        let (found, positions) =
            solve(&there, &handles, &PrimoOptions::default(), |p| moved_to(&twist(5.0, 1.0)(&back(p))));
        let digits = if offset > 0.0 { 1e-6 } else { 1e-9 };
        let (e, f) = (plain.last() * scale * scale, found.last());
        assert!((f / e - 1.0).abs() < digits, "{scale} {offset}: {e} {f}");
        for (x, y) in expected.iter().zip(&positions) {
            assert!((moved_to(x) - y).norm() < digits * scale * mesh.diagonal(), "{scale} {offset}");
        }
    }
}
