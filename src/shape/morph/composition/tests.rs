use nalgebra::{UnitQuaternion, Vector3, center};

use super::*;
use crate::mesh::shapes;
use plumbline_num::run::Run;

fn moved(mesh: &TriMesh, map: &Similarity3<f64>) -> TriMesh {
    mesh.with_positions(mesh.positions().iter().map(|p| map * p).collect()).unwrap()
}

fn genus(mesh: &TriMesh) -> i64 {
    let half_edges = HalfEdges::new(mesh).unwrap();
    assert_eq!(half_edges.boundary_edge_count(), 0, "closed");
    let euler = mesh.vertex_count() as i64 - half_edges.edge_count() as i64 + mesh.triangle_count() as i64;
    (2 - euler) / 2
}

fn plane(point: [f64; 3], normal: [f64; 3]) -> Cut {
    Cut::Plane { point: point.into(), normal: normal.into() }
}

fn somewhere() -> Similarity3<f64> {
    Similarity3::new(Vector3::new(4.0, -3.0, 2.0), Vector3::new(0.7, 0.2, -1.9), 1.7)
}

/// A sphere whose upper half comes from another one, elsewhere, larger, turned and finer.
fn two_spheres(band: usize, landmarks: bool) -> (TriMesh, TriMesh, Composition) {
    let (base, fine) = (shapes::icosphere(3), shapes::icosphere(4));
    let map = somewhere();
    let part = moved(&fine, &map);
    let up = map.isometry.rotation * Vector3::z();
    let at = map * Point3::new(0.0, 0.0, 0.1);
    let nearest = |mesh: &TriMesh, p: Point3<f64>| {
        (0..mesh.vertex_count())
            .min_by(|a, b| {
                let d = |v: usize| (mesh.positions()[v] - p).norm();
                d(*a).total_cmp(&d(*b))
            })
            .unwrap() as u32
    };
    // Vertices of the coarse sphere are vertices of the fine one.
    let pairs = (0..20).map(|v| (v, nearest(&part, map * base.positions()[v as usize]))).collect();
    let options = ComposeOptions {
        base: plane([0.0, 0.0, 0.1], [0.0, 0.0, -1.0]),
        part: Cut::Plane { point: at, normal: up },
        landmarks: if landmarks { pairs } else { Vec::new() },
        band,
    };
    let composed = compose(&base, &part, &options, &Run::default()).unwrap();
    (base, part, composed)
}

#[test]
fn two_halves_compose_to_a_sphere() {
    for landmarks in [true, false] {
        let (.., composed) = two_spheres(4, landmarks);
        assert_eq!(genus(&composed.mesh), 0);
        let off = composed.mesh.positions().iter().map(|p| (p.coords.norm() - 1.0).abs()).fold(0.0, f64::max);
        // The sagitta of the coarse sphere's edges is 0.0046; seams are made of their chords.
        assert!(off < 0.012, "landmarks {landmarks}: {off}");
        assert!((composed.mesh.volume() / shapes::icosphere(4).volume() - 1.0).abs() < 0.02);
        assert!(composed.crease < 0.2, "{}", composed.crease);
    }
}

#[test]
fn outside_the_band_the_base_is_unchanged_and_the_part_up_to_the_similarity() {
    let (base, part, composed) = two_spheres(3, true);
    let mut still = [0, 0];
    for (v, origin) in composed.origin.iter().enumerate() {
        if composed.ring[v] < 3 {
            continue;
        }
        match *origin {
            Origin::Base(b) => {
                assert_eq!(composed.mesh.positions()[v], base.positions()[b as usize]);
                still[0] += 1;
            }
            Origin::Part(p) => {
                assert_eq!(composed.mesh.positions()[v], composed.base_from_part * part.positions()[p as usize]);
                still[1] += 1;
            }
            Origin::Made => panic!("made far from the seam"),
        }
    }
    assert!(still[0] > 150 && still[1] > 500, "{still:?}");
}

#[test]
fn genera_add_up_and_a_seam_around_a_handle_is_rejected() {
    let torus = shapes::holed_torus(1, 12);
    assert_eq!(genus(&torus), 1);
    let (low, high) = torus.bounding_box().unwrap();
    let side = (0..3).max_by(|a, b| (high - low)[*a].total_cmp(&(high - low)[*b])).unwrap();
    let mut normal = [0.0; 3];
    normal[side] = -1.0;
    // A cap of the torus, where a plane meets it in one line.
    let mut point = center(&low, &high);
    point[side] = high[side] - 0.08 * (high - low)[side];
    let options = |base: Cut| ComposeOptions {
        base,
        part: plane([0.0, 0.0, 0.8], [0.0, 0.0, -1.0]),
        landmarks: Vec::new(),
        band: 3,
    };
    let ball = shapes::icosphere(3);
    let composed = compose(&torus, &ball, &options(plane(point.coords.into(), normal)), &Run::default()).unwrap();
    assert_eq!(genus(&composed.mesh), 1);
    // Two tori: genus 2.
    let cap = plane(point.coords.into(), normal);
    let both = compose(&torus, &torus, &ComposeOptions { part: cap.clone(), ..options(cap) }, &Run::default()).unwrap();
    assert_eq!(genus(&both.mesh), 2);
    // Through the middle the plane meets the ring twice: either line alone leaves it in one piece.
    let through = plane(center(&low, &high).coords.into(), normal);
    let refused = compose(&torus, &ball, &options(through), &Run::default()).unwrap_err();
    assert!(refused.to_string().contains("does not separate"), "{refused}");
}

#[test]
fn the_gap_between_cuts_of_different_sizes_is_closed_smoothly() {
    // A part whose cut is 15 % wider than that of the base.
    let base = shapes::cylinder(24, 20, 1.0, 4.0);
    let part = shapes::cylinder(31, 20, 1.15, 4.0);
    let axis = |mesh: &TriMesh| {
        let (low, high) = mesh.bounding_box().unwrap();
        (0..3).max_by(|a, b| (high - low)[*a].total_cmp(&(high - low)[*b])).unwrap()
    };
    let k = axis(&base);
    let middle = |mesh: &TriMesh| {
        let (low, high) = mesh.bounding_box().unwrap();
        center(&low, &high)
    };
    let along = |sign: f64| {
        let mut n = Vector3::zeros();
        n[k] = sign;
        n
    };
    // Landmarks say how the part lies: as it is, not scaled to fit.
    let far = |mesh: &TriMesh, p: Point3<f64>| {
        (0..mesh.vertex_count())
            .min_by(|a, b| (mesh.positions()[*a] - p).norm().total_cmp(&(mesh.positions()[*b] - p).norm()))
            .unwrap()
    };
    let mut named = base.positions().to_vec();
    let first = named.len();
    named.extend(
        [Vector3::x(), Vector3::y(), Vector3::z()].map(|d| part.positions()[far(&part, middle(&part) + d * 9.0)]),
    );
    let base = TriMesh::new(named, base.triangles().to_vec()).unwrap();
    let landmarks = [Vector3::x(), Vector3::y(), Vector3::z()]
        .iter()
        .enumerate()
        .map(|(j, d)| ((first + j) as u32, far(&part, middle(&part) + d * 9.0) as u32))
        .collect();
    let at = middle(&part) + along(0.05);
    let compose_with = |band: usize| {
        let options = ComposeOptions {
            base: Cut::Plane { point: at, normal: along(-1.0) },
            part: Cut::Plane { point: at, normal: along(1.0) },
            landmarks: Clone::clone(&landmarks),
            band,
        };
        let landmarks: &Vec<(u32, u32)> = &options.landmarks;
        assert_eq!(landmarks.len(), 3);
        compose(&base, &part, &options, &Run::default()).unwrap()
    };
    let (narrow, wide) = (compose_with(1), compose_with(6));
    let radius = |composed: &Composition| -> Vec<f64> {
        composed
            .seam
            .iter()
            .map(|v| {
                let mut p = composed.mesh.positions()[*v as usize] - at;
                p[k] = 0.0;
                p.norm()
            })
            .collect()
    };
    assert!(radius(&wide).iter().all(|r| (1.0..1.15).contains(r)), "{:?}", radius(&wide));
    // Steepest edge around the seam: with one ring the whole step is made there.
    let steepest = |composed: &Composition| {
        let half_edges = HalfEdges::new(&composed.mesh).unwrap();
        let near = |v: u32| composed.ring[v as usize] <= 2;
        let edges = half_edges.edges().filter(|&h| near(half_edges.origin(h)) && near(half_edges.destination(h)));
        let angle = |h: u32| {
            let [a, b] = [h, half_edges.twin(h)?].map(|h| composed.mesh.area_normal(HalfEdges::triangle(h) as usize));
            Some(a.angle(&b))
        };
        edges.filter_map(angle).fold(0.0, f64::max)
    };
    assert!(wide.gap > 0.0 && steepest(&wide) < steepest(&narrow), "{} {}", steepest(&wide), steepest(&narrow));
}

#[test]
fn lasso_and_loop_cut_the_same_cap_and_the_loop_is_shorter() {
    let ball = shapes::icosphere(4);
    let at = |angle: f64| {
        let p = Point3::new(0.8 * angle.cos(), 0.8 * angle.sin(), 0.6);
        (0..ball.vertex_count())
            .min_by(|a, b| (ball.positions()[*a] - p).norm().total_cmp(&(ball.positions()[*b] - p).norm()))
            .unwrap() as u32
    };
    let vertices: Vec<u32> = (0..5).map(|k| at(f64::from(k) / 5.0 * std::f64::consts::TAU)).collect();
    let top = (0..ball.vertex_count()).max_by(|a, b| ball.positions()[*a].z.total_cmp(&ball.positions()[*b].z)).unwrap()
        as u32;
    let lasso =
        cut(&ball, &Cut::Lasso { vertices: vertices.clone(), keep: top }, "part", false, &Run::default()).unwrap();
    let line =
        cut(&ball, &Cut::Loop { vertices: vertices.clone(), keep: top }, "part", false, &Run::default()).unwrap();
    let length = |c: &CutSurface| -> f64 {
        (0..c.seam.len())
            .map(|k| {
                (c.mesh.positions()[c.seam[k] as usize] - c.mesh.positions()[c.seam[(k + 1) % c.seam.len()] as usize])
                    .norm()
            })
            .sum()
    };
    assert!(length(&line) < length(&lasso), "{} {}", length(&line), length(&lasso));
    for c in [&lasso, &line] {
        let area = c.mesh.area();
        assert!((area - std::f64::consts::TAU * 0.4).abs() < 0.5, "{area}");
        let loops = HalfEdges::new(&c.mesh).unwrap().boundary_loops();
        assert_eq!((loops.len(), loops[0].len()), (1, c.seam.len()));
        // The surface is to the left: along the boundary as it runs.
        let start = loops[0].iter().position(|v| *v == c.seam[0]).unwrap();
        assert_eq!(loops[0][(start + 1) % loops[0].len()], c.seam[1]);
    }
    // The complement has the remaining area.
    let rest = cut(&ball, &Cut::Lasso { vertices, keep: 11 }, "base", true, &Run::default()).unwrap();
    assert!((rest.mesh.area() + lasso.mesh.area() - ball.area()).abs() < 1e-9);
    assert!(lasso.seam.iter().all(|v| lasso.source[*v as usize].is_some()));
}

#[test]
fn invalid_cuts_are_rejected() {
    let (ball, sheet) = (shapes::icosphere(2), shapes::plane(6));
    let refused = |mesh: &TriMesh, c: Cut| cut(mesh, &c, "base", true, &Run::default()).unwrap_err().to_string();
    assert!(refused(&ball, plane([0.0, 0.0, 5.0], [0.0, 0.0, 1.0])).contains("does not meet the surface"));
    assert!(refused(&sheet, plane([0.5, 0.5, 0.0], [1.0, 0.2, 0.0])).contains("does not close"));
    assert!(refused(&ball, plane([0.0, 0.0, 0.0], [0.0, 0.0, 0.0])).contains("normal is zero"));
    assert!(refused(&ball, Cut::Lasso { vertices: vec![1, 2, 999], keep: 0 }).contains("no vertex 999"));
    assert!(refused(&ball, Cut::Lasso { vertices: vec![1], keep: 0 }).contains("at least 2"));
    assert!(refused(&ball, Cut::Boundary { near: Point3::origin() }).contains("the surface is closed"));
}

#[test]
fn invalid_seam_files_are_rejected() {
    let good = r#"{"format": "plumbline.seam", "version": 1, "base": {"plane": {"point": [0, 0, 0.1], "normal": [0, 0, -1]}},
        "part": {"loop": {"vertices": [1, [0, 0, 1], 3], "keep": 7}}, "landmarks": [[0, 1], [[1, 0, 0], 2], [4, 4]]}"#;
    let ball = shapes::icosphere(1);
    let options = SeamFile::parse(good).unwrap().of_meshes(&ball, &ball).unwrap();
    assert_eq!((options.band, options.landmarks.len(), options.landmarks[0]), (6, 3, (0, 1)));
    assert_eq!(options.base, plane([0.0, 0.0, 0.1], [0.0, 0.0, -1.0]));
    assert!(matches!(&options.part, Cut::Loop { vertices, keep: 7 } if vertices.len() == 3));
    for (from, to, told) in [
        ("plumbline.seam", "plumbline.handles", "plumbline.seam"),
        ("\"version\": 1", "\"version\": 3", "version 3"),
        ("\"keep\": 7", "\"kept\": 7", "kept"),
        ("\"loop\"", "\"knot\"", "knot"),
        ("\"version\": 1", "\"version\": 1, \"band\": 0", "band is 0"),
    ] {
        let error = SeamFile::parse(&good.replace(from, to)).unwrap_err().to_string();
        assert!(error.contains(told), "{error}");
    }
    let beyond =
        SeamFile::parse(&good.replace("\"keep\": 7", "\"keep\": 700")).unwrap().of_meshes(&ball, &ball).unwrap_err();
    assert!(beyond.to_string().contains("keep: the part mesh has no vertex 700"), "{beyond}");
}

#[test]
fn components_away_from_the_cut_are_kept_in_the_base_and_dropped_from_the_part() {
    let ball = shapes::icosphere(3);
    let far = moved(&shapes::icosphere(1), &Similarity3::new(Vector3::new(5.0, 0.0, 3.0), Vector3::zeros(), 1.0));
    let first = ball.vertex_count() as u32;
    let both = TriMesh::new(
        [ball.positions(), far.positions()].concat(),
        ball.triangles().iter().copied().chain(far.triangles().iter().map(|t| t.map(|v| v + first))).collect(),
    )
    .unwrap();
    let options = ComposeOptions {
        base: plane([0.0, 0.0, 0.2], [0.0, 0.0, -1.0]),
        part: plane([0.0, 0.0, 0.2], [0.0, 0.0, 1.0]),
        landmarks: Vec::new(),
        band: 3,
    };
    let composed = compose(&both, &both, &options, &Run::default()).unwrap();
    let apart = composed.mesh.positions().iter().filter(|p| p.x > 3.0).count();
    assert_eq!(apart, far.vertex_count());
    let of_base = composed.origin.iter().filter(|o| matches!(o, Origin::Base(v) if *v >= first));
    assert_eq!(of_base.count(), far.vertex_count());
    assert_eq!(HalfEdges::new(&composed.mesh).unwrap().boundary_edge_count(), 0);
}

#[test]
fn a_cut_near_vertices_is_snapped_to_them() {
    // The equator of the ball is a line of edges.
    let ball = shapes::icosphere(3);
    let on_equator = ball.positions().iter().filter(|p| p.z.abs() < 1e-12).count();
    let kept = cut(&ball, &plane([0.0, 0.0, 1e-3], [0.0, 0.0, 1.0]), "base", true, &Run::default()).unwrap();
    assert_eq!(kept.seam.len(), on_equator);
    assert!(kept.seam.iter().all(|v| kept.source[*v as usize].is_some()));
}

#[test]
fn the_kept_component_must_touch_the_seam() {
    let two = shapes::disjoint(&[shapes::icosphere(2), shapes::icosphere(1)]);
    let first = shapes::icosphere(2);
    let other = first.vertex_count() as u32;
    let on_equator = |v: &u32| first.positions()[*v as usize].z.abs() < 1e-12;
    let angle = |v: &u32| first.positions()[*v as usize].y.atan2(first.positions()[*v as usize].x);
    let mut vertices: Vec<u32> = (0..other).filter(on_equator).collect();
    vertices.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    let refused =
        cut(&two, &Cut::Lasso { vertices, keep: other }, "base", true, &Run::default()).unwrap_err().to_string();
    assert!(refused.contains("does not touch the component"), "{refused}");
}

#[test]
fn the_band_is_limited_by_both_sides() {
    // Caps of one or two rings beside half a ball.
    let ball = shapes::icosphere(3);
    let caps = |base: f64, part: f64| {
        let options = ComposeOptions {
            base: plane([0.0, 0.0, base], [0.0, 0.0, -1.0]),
            part: plane([0.0, 0.0, part], [0.0, 0.0, 1.0]),
            landmarks: Vec::new(),
            band: 6,
        };
        let composed = compose(&ball, &ball, &options, &Run::default()).unwrap();
        let still = |base: bool| {
            let of_side = |o: &Origin| matches!(o, Origin::Base(_)) == base && *o != Origin::Made;
            let map = if base { Similarity3::identity() } else { composed.base_from_part };
            let from = |o: &Origin| match *o {
                Origin::Base(v) | Origin::Part(v) => map * ball.positions()[v as usize],
                Origin::Made => Point3::origin(),
            };
            let pairs = composed.origin.iter().zip(composed.mesh.positions()).filter(|(o, _)| of_side(o));
            pairs.filter(|(o, p)| (from(o) - **p).norm() < 1e-12).count()
        };
        (still(true), still(false))
    };
    for (base, part) in [(0.1, 0.85), (-0.85, -0.1)] {
        let (of_base, of_part) = caps(base, part);
        assert!(of_base > 0 && of_part > 0, "{of_base} {of_part}");
    }
}

#[test]
fn a_kink_at_the_seam_is_smoothed() {
    let tube = shapes::cylinder(40, 40, 1.0, 6.0);
    let (low, high) = tube.bounding_box().unwrap();
    let k = (0..3).max_by(|a, b| (high - low)[*a].total_cmp(&(high - low)[*b])).unwrap();
    let middle = center(&low, &high);
    let (mut along, mut across) = (Vector3::zeros(), Vector3::zeros());
    (along[k], across[(k + 1) % 3]) = (1.0, 1.0);
    // The part leans by half a radian; its landmarks say so.
    let lean = UnitQuaternion::from_scaled_axis(across * 0.5);
    let leaning: Vec<_> = tube.positions().iter().map(|p| middle + lean * (p - middle)).collect();
    let base = TriMesh::new([tube.positions(), &leaning].concat(), tube.triangles().to_vec()).unwrap();
    let n = tube.vertex_count() as u32;
    let landmarks: Vec<(u32, u32)> = (0..n).step_by(97).map(|v| (n + v, v)).collect();
    let crease = |band: usize| {
        let options = ComposeOptions {
            base: Cut::Plane { point: middle, normal: -along },
            part: Cut::Plane { point: middle, normal: along },
            landmarks: landmarks.clone(),
            band,
        };
        compose(&base, &tube, &options, &Run::default()).unwrap().crease
    };
    assert!(crease(6) < 0.6 * crease(1), "{} {}", crease(6), crease(1));
}
