use nalgebra::{DMatrix, Point3, Rotation3, SymmetricEigen};

use super::*;
use plumbline_num::run::Run;
use plumbline_num::sparse::SparseMatrix;

/// A closed bar of `n` cells along x, half as long each as it is wide, its rings scaled by `width(x)`.
fn bar(n: usize, width: impl Fn(f64) -> f64) -> TriMesh {
    let mut positions = Vec::new();
    for i in 0..=n {
        let x = i as f64 * 0.5;
        positions.extend(
            [[-1.0, -0.7], [1.0, -0.7], [1.0, 0.7], [-1.0, 0.7]]
                .map(|[y, z]| Point3::new(x, y * 0.5 * width(x), z * 0.5 * width(x))),
        );
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

/// `E` by its definition, with the best rotation of each cell.
fn energy(mesh: &TriMesh, d: &[Vector3<f64>]) -> f64 {
    let cotangents = Cotangents::new(mesh, CotangentRule::Raw);
    let edges: Vec<_> = cotangents.edges().collect();
    let mut sum = 0.0;
    for i in 0..mesh.vertex_count() as u32 {
        let cell: Vec<_> =
            (0..edges.len()).filter(|&t| mesh.triangles()[t].contains(&i)).flat_map(|t| edges[t]).collect();
        let arms = |&(a, b, w): &(u32, u32, f64)| {
            let e: Vector3<f64> = mesh.positions()[a as usize] - mesh.positions()[b as usize];
            (e, d[a as usize] - d[b as usize], w)
        };
        let (mut normal, mut right) = (nalgebra::Matrix3::zeros(), Vector3::zeros());
        for (e, change, w) in cell.iter().map(arms) {
            let across = e.cross_matrix();
            normal += across.transpose() * across * w;
            right -= across.transpose() * change * w;
        }
        let rotation = normal.try_inverse().expect("a sound case") * right;
        sum +=
            cell.iter().map(arms).map(|(e, change, w)| w * (change - rotation.cross(&e)).norm_squared()).sum::<f64>();
    }
    sum / 3.0
}

fn product(h: &plumbline_num::sparse::SparseMatrix, d: &[Vector3<f64>]) -> f64 {
    let x: Vec<f64> = d.iter().flat_map(|d| [d.x, d.y, d.z]).collect();
    let mut y = vec![0.0; x.len()];
    h.multiply(&x, &mut y);
    x.iter().zip(&y).map(|(x, y)| x * y).sum()
}

fn random(n: usize, seed: u64) -> Vec<Vector3<f64>> {
    let mut random = fastrand::Rng::with_seed(seed);
    (0..n).map(|_| Vector3::from_fn(|_, _| random.f64() - 0.5)).collect()
}

fn form(mesh: &TriMesh) -> SparseMatrix {
    let cotangents = Cotangents::new(mesh, CotangentRule::Raw);
    hessian::hessian(mesh, &cotangents, &Ordering::Amd, &Run::default()).expect("a sound case")
}

#[test]
fn the_form_is_the_energy_of_the_best_rotations_and_rigid_motions_have_none() {
    let mesh = bar(5, |x| 1.0 + 0.2 * x.sin());
    let h = form(&mesh);
    let d = random(mesh.vertex_count(), 1);
    let expected = energy(&mesh, &d);
    assert!((product(&h, &d) - expected).abs() < 1e-12 * expected, "{} against {expected}", product(&h, &d));
    let motions = hessian::rigid_motions(&mesh).into_iter().flat_map(|component| {
        assert!(component.support.iter().copied().eq(0..h.n() as u32), "one component with all vertices");
        component.vectors
    });
    for motion in motions {
        let d: Vec<_> = motion.chunks_exact(3).map(Vector3::from_column_slice).collect();
        assert!(product(&h, &d).abs() < 1e-12);
    }
}

#[test]
fn near_rest_the_nonlinear_energy_is_the_form() {
    use crate::surface::{DeformOptions, Deformer, HandlePose, Handles, InitialGuess, Method};
    let mesh = bar(5, |x| 1.0 + 0.2 * x.sin());
    let h = form(&mesh);
    let handles = Handles::exact([0, 1, 2]).expect("a sound case");
    let options = DeformOptions::default();
    let mut arap = Deformer::new(Method::Arap, &mesh, &handles, &options, &Run::default()).expect("a sound case");
    let d: Vec<_> = random(mesh.vertex_count(), 2).into_iter().map(|d| d * 1e-4).collect();
    let moved: Vec<_> = mesh.positions().iter().zip(&d).map(|(p, d)| p + d).collect();
    let criterion = plumbline_num::energy::Convergence { max_iterations: 1, tolerance: 0.0 };
    let done = arap
        .deform(&HandlePose::new(moved[..3].to_vec()), InitialGuess::At(&moved), &criterion, &Run::default())
        .expect("a sound case");
    let (full, form) = (done.report.energies[0], product(&h, &d));
    assert!((full / form - 1.0).abs() < 1e-3, "{full} against {form}");
}

#[test]
fn modes_are_the_lowest_of_the_dense_problem_after_six_zeros() {
    let mesh = bar(12, |x| 1.0 + 0.3 * (1.3 * x).sin());
    let found = modes(&mesh, 10, &ModesOptions::default(), &Run::default()).expect("a sound case");
    assert!(found.converged && found.rigid == 6, "{:?}", found.residuals);
    let h = form(&mesh);
    let (mass, n) = (masses(&mesh), h.n());
    let mut full = DMatrix::zeros(n, n);
    for (i, j, s) in h.pattern().entries() {
        full[(i, j)] = h.values()[s] / (mass[i] * mass[j]).sqrt();
        full[(j, i)] = full[(i, j)];
    }
    let mut values: Vec<f64> = SymmetricEigen::new(full).eigenvalues.iter().copied().collect();
    values.sort_by(f64::total_cmp);
    assert!(values[..6].iter().all(|v| v.abs() < 1e-9 * values[6]), "{:?}", &values[..8]);
    for (value, expected) in found.values.iter().zip(&values[6..]) {
        assert!((value / expected - 1.0).abs() < 1e-8, "{value} against {expected}");
    }
    // As `tests/oracle/modes.py` prints them.
    let oracle =
        [0.036_116_191_489, 0.046_634_800_673, 0.102_972_707_82, 0.182_982_196_01, 0.265_710_650_00, 0.303_256_894_26];
    for (value, expected) in found.values.iter().zip(oracle) {
        assert!((value / expected - 1.0).abs() < 1e-8, "{value} against {expected}");
    }
}

#[test]
fn modes_are_equivariant_and_values_fall_with_the_square_of_the_size() {
    let mesh = bar(12, |x| 1.0 + 0.3 * (1.3 * x).sin());
    let found = modes(&mesh, 6, &ModesOptions::default(), &Run::default()).expect("a sound case");
    let r = Rotation3::new(Vector3::new(0.4, -1.0, 0.3));
    let moved = mesh.positions().iter().map(|p| r * p * 1e3 + Vector3::new(1e5, -1e5, 0.0)).collect();
    let other = modes(&mesh.with_positions(moved).expect("a sound case"), 6, &ModesOptions::default(), &Run::default())
        .expect("a sound case");
    for k in 0..6 {
        assert!((other.values[k] * 1e6 / found.values[k] - 1.0).abs() < 1e-6);
        // Lengths too have grown, and with them the area that norms a mode.
        let along: f64 = found.vectors[k].iter().zip(&other.vectors[k]).map(|(u, v)| (r * u).dot(&(v * 1e3))).sum();
        let own: f64 = found.vectors[k].iter().map(Vector3::norm_squared).sum();
        assert!((along.abs() / own - 1.0).abs() < 1e-4, "{k}: {along} against {own}");
    }
}

#[test]
fn unreferenced_vertices_are_fixed_and_each_component_has_its_own_rigid_motions() {
    let mesh = bar(6, |_| 1.0);
    let count = mesh.vertex_count() as u32;
    let far = mesh.positions().iter().map(|p| p + Vector3::new(0.0, 8.0, 0.0));
    let positions = mesh.positions().iter().copied().chain([Point3::new(50.0, 0.0, 0.0)]).chain(far).collect();
    let second = mesh.triangles().iter().map(|t| t.map(|v| v + count + 1));
    let both = TriMesh::new(positions, mesh.triangles().iter().copied().chain(second).collect()).expect("a sound case");
    let (one, two) = (
        modes(&mesh, 3, &ModesOptions::default(), &Run::default()),
        modes(&both, 6, &ModesOptions::default(), &Run::default()),
    );
    let (one, two) = (one.expect("a sound case"), two.expect("a sound case"));
    assert_eq!(two.rigid, 12);
    for k in 0..6 {
        assert!((two.values[k] / one.values[k / 2] - 1.0).abs() < 1e-6, "{:?} {:?}", one.values, two.values);
        assert_eq!(two.vectors[k][count as usize], Vector3::zeros());
    }
}

#[test]
fn empty_surfaces_have_no_modes_and_degenerate_ones_finite_modes() {
    let empty = TriMesh::default();
    assert!(modes(&empty, 5, &ModesOptions::default(), &Run::default()).expect("a sound case").values.is_empty());
    let point = TriMesh::new(vec![Point3::origin()], vec![]).expect("a sound case");
    assert!(modes(&point, 5, &ModesOptions::default(), &Run::default()).expect("a sound case").vectors.is_empty());
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(Point3::from).to_vec();
    let one = modes(
        &TriMesh::new(corners, vec![[0, 1, 2]]).expect("a sound case"),
        5,
        &ModesOptions::default(),
        &Run::default(),
    )
    .expect("a sound case");
    assert_eq!((one.values.len(), one.rigid), (3, 6), "a triangle can be stretched and sheared");
    let good = bar(8, |_| 1.0);
    let mut positions = good.positions().to_vec();
    let mut triangles = good.triangles().to_vec();
    positions[9] = positions[8];
    positions.push(Point3::new(2.0, 3.0, 0.0));
    let fin = positions.len() as u32 - 1;
    triangles.extend([[16, 17, fin], [5, 6, 5], [8, 8, 8], [20, 21, 22], [20, 21, 22]]);
    let broken = TriMesh::new(positions, triangles).expect("a sound case");
    let found = modes(&broken, 8, &ModesOptions::default(), &Run::default()).expect("a sound case");
    assert!(found.vectors.iter().flatten().all(|u| u.iter().all(|c| c.is_finite())) && found.values.len() == 8);
    let refused = modes(&good, 3, &ModesOptions { tolerance: 0.0, ..Default::default() }, &Run::default())
        .expect_err("a faulty case");
    assert_eq!(refused.to_string(), "tolerance 0 is invalid (expected above 0 and below 1)");
}

#[test]
fn a_bar_with_thin_joints_falls_into_the_parts_between_them() {
    // Three blocks of equal length.
    let mesh = bar(48, |x| if (x - 8.0).abs() < 0.6 || (x - 16.0).abs() < 0.6 { 0.25 } else { 1.5 });
    let low = modes(&mesh, 8, &ModesOptions::default(), &Run::default()).expect("a sound case");
    let found = parts(&mesh, &low, &PartsOptions { count: PartCount::Exactly(3) }, &Run::default())
        .expect("a run that never stops");
    assert_eq!(found.count, 3);
    let block = |x: f64| usize::from(x > 8.0) + usize::from(x > 16.0);
    for (p, &part) in mesh.positions().iter().zip(&found.of_vertex) {
        let near = |x: f64| (p.x - x).abs() < 1.1;
        let first = found.of_vertex[4 * (8 + 16 * block(p.x))];
        assert!(part == first || near(8.0) || near(16.0), "{} is in part {part}, not {first}", p.x);
    }
    assert!(*found.unexplained.last().expect("a sound case") < 0.05, "{:?}", found.unexplained);
    assert!(found.unexplained.windows(2).all(|w| w[1] < w[0]));
    assert_eq!(parts(&mesh, &low, &PartsOptions::default(), &Run::default()).expect("a run that never stops").count, 3);
}

#[test]
fn parts_are_connected_and_each_vertex_is_in_one() {
    let mesh = bar(40, |x| 1.0 + 0.4 * x.sin());
    let low = modes(&mesh, 12, &ModesOptions::default(), &Run::default()).expect("a sound case");
    let found = parts(&mesh, &low, &PartsOptions { count: PartCount::Exactly(7) }, &Run::default())
        .expect("a run that never stops");
    let inside = mesh
        .triangles()
        .iter()
        .filter(|t| t.iter().all(|&v| found.of_vertex[v as usize] == found.of_vertex[t[0] as usize]));
    let pieces = plumbline_num::spatial::components(mesh.vertex_count(), &inside.copied().collect::<Vec<_>>());
    let mut largest = vec![0; found.count];
    for p in 0..mesh.vertex_count() {
        let size = pieces.iter().filter(|&&q| q as usize == p).count();
        let part = found.of_vertex[p] as usize;
        largest[part] = largest[part].max(size);
    }
    let whole: usize = largest.iter().sum();
    assert!(whole + 8 >= mesh.vertex_count() && largest.iter().all(|&n| n > 0), "{whole} of {}", mesh.vertex_count());
}
