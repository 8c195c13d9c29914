use nalgebra::{Rotation3, Vector3};

use super::*;
use plumbline_num::run::Run;

/// A closed tube of `rings × around` vertices along x with two caps, bumpy so that nothing is symmetric.
fn tube(rings: usize, around: usize) -> TriMesh {
    let mut positions = Vec::new();
    for i in 0..rings {
        for k in 0..around {
            let angle = std::f64::consts::TAU * k as f64 / around as f64;
            let r = 1.0 + 0.1 * (3.0 * angle + 0.7 * i as f64).sin();
            positions.push(Point3::new(6.0 * i as f64 / rings as f64, r * angle.cos(), r * angle.sin()));
        }
    }
    let at = |i: usize, k: usize| (i * around + k % around) as u32;
    let mut triangles = Vec::new();
    for i in 0..rings - 1 {
        for k in 0..around {
            triangles.push([at(i, k), at(i, k + 1), at(i + 1, k)]);
            triangles.push([at(i, k + 1), at(i + 1, k + 1), at(i + 1, k)]);
        }
    }
    for (ring, x) in [(0, -0.3), (rings - 1, 6.1)] {
        let tip = positions.len() as u32;
        positions.push(Point3::new(x, 0.0, 0.0));
        for k in 0..around {
            let rim = [at(ring, k), at(ring, k + 1)];
            triangles.push(if ring == 0 { [rim[1], rim[0], tip] } else { [rim[0], rim[1], tip] });
        }
    }
    TriMesh::new(positions, triangles).expect("a sound case")
}

/// An open sheet of `n × n` vertices.
fn sheet(n: usize) -> TriMesh {
    let point = |i: usize| Point3::new((i % n) as f64, (i / n) as f64, 0.0);
    let mut triangles = Vec::new();
    for i in (0..n * (n - 1)).filter(|i| i % n + 1 < n) {
        let (a, b, c, d) = (i as u32, (i + 1) as u32, (i + n) as u32, (i + n + 1) as u32);
        triangles.extend([[a, b, d], [a, d, c]]);
    }
    TriMesh::new((0..n * n).map(point).collect(), triangles).expect("a sound case")
}

/// Number of edges by how many triangles they lie in (1, 2, more).
fn edges(mesh: &TriMesh) -> [usize; 3] {
    let mut all: Vec<(u32, u32)> = Vec::new();
    for &[a, b, c] in mesh.triangles() {
        all.extend([(a, b), (b, c), (c, a)].map(|(i, j)| (i.min(j), i.max(j))));
    }
    all.sort_unstable();
    let mut counts = [0; 3];
    for group in all.chunk_by(|a, b| a == b) {
        counts[group.len().min(3) - 1] += 1;
    }
    counts
}

fn positions_of(hierarchy: &Hierarchy, level: usize) -> Vec<Point3<f64>> {
    hierarchy.mesh(level).positions().to_vec()
}

#[test]
fn levels_are_nested_subsets_down_to_the_requested_size() {
    let mesh = tube(60, 40);
    let hierarchy = Hierarchy::new(&mesh, &[], 100, &Run::default()).expect("a run that never stops");
    assert_eq!(hierarchy.levels(), 3, "2402 vertices in steps of about 4");
    assert_eq!(hierarchy.mesh(0), &mesh);
    for level in 1..hierarchy.levels() {
        let (coarse, names) = (hierarchy.mesh(level), hierarchy.vertices(level));
        assert!(names.windows(2).all(|w| w[0] < w[1]));
        for (p, &v) in coarse.positions().iter().zip(names) {
            assert_eq!(*p, mesh.positions()[v as usize]);
        }
    }
    assert!(hierarchy.mesh(2).vertex_count().abs_diff(100) <= 2, "{}", hierarchy.mesh(2).vertex_count());
}

#[test]
fn a_coarse_level_keeps_topology_and_volume() {
    let mesh = tube(60, 40);
    let hierarchy = Hierarchy::new(&mesh, &[], 100, &Run::default()).expect("a run that never stops");
    let coarse = hierarchy.mesh(hierarchy.levels() - 1);
    let [open, inner, more] = edges(coarse);
    assert_eq!((open, more), (0, 0), "closed and manifold");
    assert_eq!(coarse.vertex_count() + coarse.triangle_count() - inner, 2, "Euler's number of a sphere");
    let loss = 1.0 - coarse.volume() / mesh.volume();
    assert!((0.0..0.15).contains(&loss), "{loss} of the volume is lost");
}

#[test]
fn an_open_sheet_keeps_its_rim_and_its_corners() {
    let hierarchy = Hierarchy::new(&sheet(33), &[], 40, &Run::default()).expect("a run that never stops");
    let coarse = hierarchy.mesh(hierarchy.levels() - 1);
    assert!((coarse.area() - 32.0 * 32.0).abs() < 1e-9, "{}", coarse.area());
    assert_eq!(coarse.vertex_count() + coarse.triangle_count() - edges(coarse).iter().sum::<usize>(), 1);
}

#[test]
fn handles_stay_and_a_constrained_region_keeps_its_boundary() {
    let mesh = tube(60, 40);
    let region: Vec<u32> = (0..12 * 40).collect();
    let keep: Vec<u32> = region.iter().copied().chain([1500, 2000]).collect();
    let hierarchy = Hierarchy::new(&mesh, &keep, 150, &Run::default()).expect("a run that never stops");
    let names = hierarchy.vertices(hierarchy.levels() - 1);
    let stays = |v: u32| names.binary_search(&v).is_ok();
    assert!(stays(1500) && stays(2000));
    assert!((11 * 40..12 * 40).all(stays), "the boundary of the region");
    let inside = (0..11 * 40).filter(|&v| stays(v)).count();
    assert!(inside < 200, "{inside} of 440 stay in the interior");
}

#[test]
fn prolongation_reproduces_the_rest_shape() {
    let shifted: Vec<_> = tube(60, 40).positions().iter().map(|p| p + Vector3::new(1e6, -3e5, 7.0)).collect();
    for mesh in [tube(60, 40), sheet(30), tube(60, 40).with_positions(shifted).expect("a sound case")] {
        let hierarchy = Hierarchy::new(&mesh, &[], 60, &Run::default()).expect("a run that never stops");
        let diagonal = mesh.diagonal();
        for level in (0..hierarchy.levels() - 1).rev() {
            let back = hierarchy.prolong(level, &positions_of(&hierarchy, level + 1));
            let worst = back.iter().zip(hierarchy.mesh(level).positions()).map(|(a, b)| (a - b).norm());
            assert!(worst.fold(0.0, f64::max) <= 1e-14 * diagonal);
        }
    }
}

#[test]
fn prolongation_reproduces_rigid_motions() {
    for mesh in [tube(60, 40), sheet(30)] {
        let hierarchy = Hierarchy::new(&mesh, &[], 60, &Run::default()).expect("a run that never stops");
        for angle in [0.1, 1.5, 3.1] {
            let r = Rotation3::new(Vector3::new(0.6, -0.64, 0.48) * angle);
            let moved = |p: &Point3<f64>| r * p + Vector3::new(10.0, -20.0, 5.0);
            let last = hierarchy.levels() - 1;
            let mut pose: Vec<_> = hierarchy.mesh(last).positions().iter().map(moved).collect();
            for level in (0..last).rev() {
                pose = hierarchy.prolong(level, &pose);
                for (p, rest) in pose.iter().zip(hierarchy.mesh(level).positions()) {
                    let error = (p - moved(rest)).norm() / mesh.diagonal();
                    assert!(error < 1e-12, "{error} at level {level}, {angle} rad");
                }
            }
        }
    }
}

#[test]
fn prolongation_reproduces_linear_maps_of_a_plane_in_the_interior() {
    let mesh = sheet(30);
    let hierarchy = Hierarchy::new(&mesh, &[], 60, &Run::default()).expect("a run that never stops");
    let stretched = |p: &Point3<f64>| Point3::new(1.5 * p.x + 0.2 * p.y, 0.7 * p.y, 0.0);
    let coarse: Vec<_> = hierarchy.mesh(1).positions().iter().map(stretched).collect();
    let inner = |p: &Point3<f64>| [p.x, p.y].iter().all(|&c| c > 0.0 && c < 29.0);
    for (p, rest) in hierarchy.prolong(0, &coarse).iter().zip(mesh.positions()).filter(|(_, rest)| inner(rest)) {
        // A vertex may be prolonged from boundary vertices, which move along the boundary.
        assert!((p - stretched(rest)).norm() < 0.3, "{rest} came to {p}");
    }
}

#[test]
fn details_rotate_with_a_bend() {
    let mesh = tube(80, 30);
    let hierarchy = Hierarchy::new(&mesh, &[], 200, &Run::default()).expect("a run that never stops");
    let bend = |p: &Point3<f64>| {
        let (sin, cos) = (p.x * 0.3).sin_cos();
        let radius = 1.0 / 0.3 - p.y;
        Point3::new(radius * sin, 1.0 / 0.3 - radius * cos, p.z)
    };
    let last = hierarchy.levels() - 1;
    let mut pose: Vec<_> = hierarchy.mesh(last).positions().iter().map(bend).collect();
    for level in (0..last).rev() {
        pose = hierarchy.prolong(level, &pose);
    }
    let sum: f64 = pose.iter().zip(mesh.positions()).map(|(p, rest)| (p - bend(rest)).norm_squared()).sum();
    let rms = (sum / pose.len() as f64).sqrt();
    assert!(rms < 0.006 * mesh.diagonal(), "{rms}");
}

#[test]
fn degenerate_input_is_kept_and_results_are_finite() {
    let mut positions = tube(20, 12).positions().to_vec();
    let mut triangles = tube(20, 12).triangles().to_vec();
    // A loose vertex, a fin on an edge, a triangle without area, one named twice, one of a single vertex.
    positions.extend([[9.0, 9.0, 9.0], [3.0, 4.0, 0.0]].map(Point3::from));
    let fin = positions.len() as u32 - 1;
    triangles.extend([[100, 101, fin], [5, 6, 5], [40, 40, 40], [60, 61, 62], [60, 61, 62]]);
    positions[33] = positions[34];
    let mesh = TriMesh::new(positions, triangles).expect("a sound case");
    let hierarchy = Hierarchy::new(&mesh, &[], 10, &Run::default()).expect("a run that never stops");
    assert!(hierarchy.levels() > 1);
    for level in (0..hierarchy.levels() - 1).rev() {
        let turned: Vec<_> = positions_of(&hierarchy, level + 1).iter().map(|p| Point3::new(-p.x, p.z, p.y)).collect();
        let back = hierarchy.prolong(level, &turned);
        assert!(back.iter().all(|p| p.coords.iter().all(|c| c.is_finite())));
    }
    let empty = TriMesh::new(vec![], vec![]).expect("a sound case");
    assert_eq!(Hierarchy::new(&empty, &[], 10, &Run::default()).expect("a run that never stops").levels(), 1);
    let one =
        TriMesh::new(vec![Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.0)], vec![[0, 1, 2]]);
    assert_eq!(
        Hierarchy::new(&one.expect("a sound case"), &[], 1, &Run::default()).expect("a run that never stops").levels(),
        1
    );
}
