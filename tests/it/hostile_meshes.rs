//! Meshes that are valid and hurt: far vertices, specks, lengths of many orders of magnitude, triangles that all overlap. Each is
//! solved within bounds of time and memory, and what is left out is said.

use std::fs;
use std::ops::ControlFlow;

use nalgebra::{Point3, Vector3};
use plumbline::num::run::Run;
use plumbline::shape::character::extraction::{ExtractionOptions, ExtractionReport, extract};
use plumbline::shape::character::io::parse_tgf;
use plumbline::shape::character::weights::{WeightMethod, WeightOptions, bone_weights};
use plumbline::shape::character::{CharacterError, CurveSkeleton};
use plumbline::shape::mesh::{Model, TriMesh, shapes, write_model};
use plumbline::shape::morph::{Trajectory, TrajectoryOptions};
use plumbline::shape::surface::modal::{ModesOptions, modes};
use plumbline::shape::surface::{Handles, Method, SurfaceError, deform};

use crate::support::program::{err, plumbline_in, succeed};

/// An ellipsoid, four times as long as wide, along z.
fn body(level: u32) -> TriMesh {
    let ball = shapes::icosphere(level);
    let stretched = ball.positions().iter().map(|p| Point3::new(0.5 * p.x, 0.5 * p.y, 2.0 * p.z)).collect();
    ball.with_positions(stretched).expect("finite")
}

fn moved(mesh: &TriMesh, vertex: usize, to: Point3<f64>) -> TriMesh {
    let mut positions = mesh.positions().to_vec();
    positions[vertex] = to;
    mesh.with_positions(positions).expect("finite")
}

fn curve(mesh: &TriMesh) -> Result<(CurveSkeleton, ExtractionReport), CharacterError> {
    extract(mesh, &ExtractionOptions::default(), &mut |_| ControlFlow::Continue(()), &Run::default())
}

#[test]
fn an_outlier_is_left_out_and_the_curve_is_that_of_the_body() {
    let clean = body(3);
    let (expected, _) = curve(&clean).expect("a body");
    for far in [1e3, 1e6, 1e12] {
        let (found, report) = curve(&moved(&clean, 100, Point3::new(far, 0.5 * far, far))).expect("a body");
        assert_eq!((report.outliers.as_slice(), report.parts, report.ends), (&[100][..], 1, 2), "{far}");
        assert!(found.nodes.iter().all(|p| p.z.abs() < 2.0 && p.x.hypot(p.y) < 0.2), "{far}");
        assert!(found.nodes.len().abs_diff(expected.nodes.len()) < 4, "{far}: {}", found.nodes.len());
        assert_eq!(found.node_of_vertex.len(), clean.vertex_count());
    }
}

#[test]
fn specks_are_left_out_and_counted_and_small_parts_are_not() {
    let tiny = |k: u32| {
        let (k, speck) = (f64::from(k), shapes::icosphere(0));
        let at = Vector3::new((k * 1.3).sin(), (k * 2.7).cos(), (k * 0.9).sin()) * 3.0;
        speck.with_positions(speck.positions().iter().map(|p| p * 1e-3 + at).collect()).expect("finite")
    };
    let eye = shapes::icosphere(2);
    let eye = eye.with_positions(eye.positions().iter().map(|p| p * 0.05 + Vector3::x()).collect()).expect("finite");
    let parts: Vec<TriMesh> = [body(3), eye].into_iter().chain((0..200).map(tiny)).collect();
    let (found, report) = curve(&shapes::disjoint(&parts)).expect("a body");
    assert_eq!((report.parts, report.specks, report.speck_vertices), (2, 200, 2400));
    assert!(found.nodes.iter().all(|p| p.coords.norm() < 2.1), "no node is at a speck");
}

/// A tube of radius 1 along x.
fn tube(length: f64, rings: u32) -> TriMesh {
    let around = 8;
    let ring = |k: u32| {
        let x = length * f64::from(k) / f64::from(rings);
        (0..around).map(move |i| {
            let angle = std::f64::consts::TAU * f64::from(i) / f64::from(around);
            Point3::new(x, angle.cos(), angle.sin())
        })
    };
    let cell = |k: u32, i: u32| {
        let [a, b] = [i, (i + 1) % around].map(|i| k * around + i);
        [[a, b, b + around], [a, b + around, a + around]]
    };
    let triangles = (0..rings).flat_map(|k| (0..around).flat_map(move |i| cell(k, i))).collect();
    TriMesh::new((0..=rings).flat_map(ring).collect(), triangles).expect("corners exist")
}

#[test]
fn the_number_of_nodes_is_bounded_however_long_and_thin_a_tube_is() {
    let (found, report) = curve(&tube(1e6, 400)).expect("a tube");
    assert!(report.spacing > 1.0 && found.nodes.len() < 3000, "{} {}", report.spacing, found.nodes.len());
    let (_, short) = curve(&tube(20.0, 40)).expect("a tube");
    assert_eq!(short.spacing, 1.0);
}

/// Sheets around a common edge chain.
fn book(sheets: u32, segments: u32) -> TriMesh {
    let at = |k: u32| f64::from(k) / f64::from(segments);
    let mut positions: Vec<Point3<f64>> = (0..=segments).map(|k| Point3::new(0.0, 0.0, at(k))).collect();
    let mut triangles = Vec::new();
    for s in 0..sheets {
        let angle = std::f64::consts::TAU * f64::from(s) / f64::from(sheets);
        let first = positions.len() as u32;
        positions.extend((0..=segments).map(|k| Point3::new(angle.cos(), angle.sin(), at(k))));
        triangles.extend((0..segments).flat_map(|k| [[k, first + k, first + k + 1], [k, first + k + 1, k + 1]]));
    }
    TriMesh::new(positions, triangles).expect("corners exist")
}

#[test]
fn a_vertex_of_many_sheets_costs_no_more_than_its_triangles() {
    let (found, report) = curve(&book(400, 4)).expect("sheets");
    assert!(report.parts == 1 && !found.nodes.is_empty());
    assert!(found.nodes.iter().all(|p| p.iter().all(|c| c.is_finite())));
}

/// A disk whose `n` triangles meet at its center.
fn fan(n: u32) -> TriMesh {
    let angle = |k: u32| std::f64::consts::TAU * f64::from(k) / f64::from(n);
    let rim = (0..n).map(|k| Point3::new(angle(k).cos(), angle(k).sin(), 0.0));
    let positions = std::iter::once(Point3::new(0.0, 0.0, 1.0)).chain(rim).collect();
    TriMesh::new(positions, (0..n).map(|k| [0, 1 + k, 1 + (k + 1) % n]).collect()).expect("corners exist")
}

#[test]
fn a_star_of_triangles_at_one_vertex_has_a_curve() {
    // Of 82 000 triangles it takes 5 s; when every edge of the hub was looked up among all others it took minutes.
    let (found, report) = curve(&fan(12_000)).expect("a disk");
    assert_eq!(report.parts, 1);
    assert!(found.nodes.iter().all(|p| p.coords.norm() < 2.0), "the curve is near the disk");
}

/// Triangles between any of `vertices` points in a unit cube.
fn soup(vertices: u32, triangles: usize) -> TriMesh {
    let mut random = fastrand::Rng::with_seed(11);
    let positions = (0..vertices).map(|_| Point3::from([(); 3].map(|()| random.f64()))).collect();
    let corner = |random: &mut fastrand::Rng| random.u32(0..vertices);
    let distinct = |[a, b, c]: &[u32; 3]| a != b && b != c && c != a;
    let any = std::iter::repeat_with(|| [(); 3].map(|()| corner(&mut random)));
    TriMesh::new(positions, any.filter(distinct).take(triangles).collect()).expect("corners exist")
}

#[test]
fn a_soup_of_triangles_between_many_vertices_ends() {
    let (found, report) = curve(&soup(600, 6000)).expect("a soup");
    assert_eq!((report.parts, found.node_of_vertex.len()), (1, 600));
    assert!(found.nodes.iter().flat_map(|p| p.iter()).all(|c| (-0.5..1.5).contains(c)), "the curve is near the cube");
}

#[test]
fn modes_of_many_parts_leave_out_the_rigid_motions_of_each() {
    let part = |k: u32| {
        let ball = shapes::icosphere(0);
        let at = Vector3::x() * (5.0 * f64::from(k));
        ball.with_positions(ball.positions().iter().map(|p| p + at).collect()).expect("finite")
    };
    let parts = shapes::disjoint(&(0..150).map(part).collect::<Vec<_>>());
    let found = modes(&parts, 3, &ModesOptions::default(), &Run::default()).expect("a small system");
    assert_eq!(found.rigid, 6 * 150);
    assert!(found.values.iter().all(|v| *v > 0.0 && v.is_finite()));
}

#[test]
fn modes_of_a_hub_are_refused_before_they_take_memory_and_time() {
    // Every two of 6000 vertices share the cell of the hub: 1.5 GB of entries, and a dense factor of 18 000 unknowns.
    let refused = modes(&fan(6000), 3, &ModesOptions::default(), &Run::default()).unwrap_err().to_string();
    assert!(refused.contains("too many unknowns depend on one another") && refused.contains("remesh"), "{refused}");
    let found = modes(&fan(300), 3, &ModesOptions::default(), &Run::default()).expect("a small hub");
    assert_eq!(found.values.len(), 3);
}

/// Deforms by moving one of four vertices.
fn deformed(mesh: &TriMesh, method: Method) -> Result<(), SurfaceError> {
    let handles = Handles::exact([1, 2, 3, 4]).expect("four vertices");
    let mut targets: Vec<_> = (1..5).map(|v| mesh.positions()[v]).collect();
    targets[3] += Vector3::new(0.1, 0.2, 0.3);
    deform(mesh, &handles, &targets, method).map(|_| ())
}

#[test]
fn squared_laplacians_of_a_hub_are_refused_with_another_method() {
    // The product of 20 000 triangles at a vertex has two hundred million entries: 13 GB.
    let hub = fan(20_000);
    let refused = deformed(&hub, Method::Laplacian).unwrap_err();
    assert!(matches!(refused, SurfaceError::TooDense { .. }), "{refused}");
    let text = refused.to_string();
    assert!(text.contains("unknown 0 on 20000 others") && text.contains("arap") && text.contains("remesh"), "{text}");
    deformed(&hub, Method::Arap).expect("its Laplacian has the edges of the mesh alone");
    deformed(&fan(1000), Method::Laplacian).expect("a hub that can be solved");
    let skeleton = parse_tgf("1 -1 0 0\n2 0 0 0\n3 1 0 0\n#\n1 2\n2 3\n").expect("a skeleton").skeleton;
    let weights = |mesh: &TriMesh, method| {
        let options = WeightOptions { method, ..WeightOptions::default() };
        bone_weights(mesh, &skeleton, &options, &Run::default())
    };
    for method in [WeightMethod::Heat, WeightMethod::BoundedBiharmonic] {
        weights(&hub, method).expect("no squares");
    }
}

#[test]
fn systems_of_a_large_soup_are_refused_before_their_factors_are_allocated() {
    let soup = soup(20_000, 40_000);
    for method in [Method::Arap, Method::Laplacian] {
        let refused = deformed(&soup, method).unwrap_err().to_string();
        assert!(refused.contains("too many unknowns depend on one another"), "{method:?}: {refused}");
    }
    let refused = modes(&soup, 3, &ModesOptions::default(), &Run::default()).unwrap_err().to_string();
    assert!(refused.contains("remesh"), "{refused}");
    let turned = soup.with_positions(soup.positions().iter().map(|p| Point3::new(p.y, p.x, p.z)).collect());
    let options = TrajectoryOptions::default();
    let refused = Trajectory::new(&soup, &turned.expect("finite"), &options, &Run::default());
    let refused = refused.err().map(|e| e.to_string());
    assert!(refused.as_ref().is_some_and(|r| r.contains("too many unknowns")), "{refused:?}");
}

#[test]
fn needles_that_double_precision_does_not_resolve_are_refused_with_a_remedy() {
    let mut random = fastrand::Rng::with_seed(3);
    let mut point = || Point3::from([(); 3].map(|()| random.f64()));
    let needle = |k: u32| (0..3).map(move |c| 3 * k + c);
    let positions = (0..300).flat_map(|_| {
        let (a, b) = (point(), point());
        [a, b, b + Vector3::new(1e-9, 2e-9, -1e-9)]
    });
    let triangles = (0..300).map(|k| needle(k).collect::<Vec<_>>().try_into().expect("three corners")).collect();
    let needles = TriMesh::new(positions.collect(), triangles).expect("corners exist");
    let refused = modes(&needles, 3, &ModesOptions::default(), &Run::default()).unwrap_err();
    let SurfaceError::IllConditioned { vertex, vertices, .. } = refused else { panic!("{refused}") };
    assert!(vertex < 900 && vertices <= 3, "{refused}");
    assert!(refused.to_string().contains("too thin") && refused.to_string().contains("remesh"), "{refused}");
}

#[test]
fn lengths_beyond_double_precision_are_refused_with_a_remedy() {
    let ball = shapes::icosphere(3);
    let scaled = |scale: f64| {
        ball.with_positions(ball.positions().iter().map(|p| Point3::from(p.coords * scale)).collect()).expect("finite")
    };
    for scale in [1e-200, 1e200] {
        let refused = curve(&scaled(scale)).unwrap_err().to_string();
        assert!(refused.contains("scale it to a size near 1"), "{refused}");
    }
    for scale in [1e-12, 1e12] {
        assert_eq!(curve(&scaled(scale)).expect("a ball").1.parts, 1);
    }
    let handles = Handles::exact([0, 1, 2]).expect("three vertices");
    let huge = scaled(1e200);
    let mut targets: Vec<_> = (0..3).map(|v| huge.positions()[v]).collect();
    targets[1].x *= 1.5;
    for method in [Method::Arap, Method::Poisson, Method::Laplacian, Method::Primo] {
        match deform(&huge, &handles, &targets, method) {
            Ok(found) => assert!(found.iter().all(|p| p.iter().all(|c| c.is_finite())), "{method:?}"),
            Err(
                SurfaceError::Diverged { .. }
                | SurfaceError::IllConditioned { .. }
                | SurfaceError::Solve(_)
                | SurfaceError::NotFinite { .. },
            ) => {}
            Err(other) => panic!("{method:?}: {other}"),
        }
    }
}

#[test]
fn of_thousands_of_joints_that_move_nothing_a_few_are_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    write_model(&folder.join("a.off"), &Model::of_mesh(shapes::icosphere(1))).expect("a file");
    let joint = |k: u32| format!("{} {} 0 0\n", k + 1, f64::from(k) / 3000.0);
    let bone = |k: u32| format!("{k} {}\n", k + 1);
    let chain = (0..3000).map(joint).chain(["#\n".to_owned()]).chain((1..3000).map(bone)).collect::<String>();
    fs::write(folder.join("a.tgf"), chain).expect("a file");
    let run = succeed(folder, &["skin", "weights", "a.off", "--skeleton", "a.tgf", "-o", "a.json"]);
    let said = err(&run);
    assert!(said.contains("no vertex follows ") && said.contains(" others"), "{}", said.len());
    assert!(said.len() < 1000, "{} characters", said.len());
}

#[test]
fn the_program_says_what_it_left_out() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    write_model(&folder.join("far.off"), &Model::of_mesh(moved(&body(3), 100, Point3::new(1e6, 0.0, 0.0))))
        .expect("a file");
    let run = succeed(folder, &["skeleton", "far.off", "-o", "far.json"]);
    assert!(err(&run).contains("1 outliers left out (first: vertex 100)"), "{}", err(&run));
    fs::write(folder.join("zero.off"), "OFF\n3 1 0\n0 0 0\n1 0 0\n2 0 0\n3 0 1 2\n").expect("a file");
    let refused = plumbline_in(folder, &["skeleton", "zero.off", "-o", "zero.json"]);
    assert_eq!(refused.status.code(), Some(65), "{}", err(&refused));
    assert!(!folder.join("zero.json").exists());
}
