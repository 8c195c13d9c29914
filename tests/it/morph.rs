//! Shapes between shapes, and shapes made of several, through the built program.

use std::fs;
use std::path::Path;

use nalgebra::{Point3, UnitQuaternion, Vector3};
use plumbline::app::cli::pipeline_of;
use plumbline::app::pipeline::draw::{GraphFormat, draw};
use plumbline::app::pipeline::shipped::shipped;
use plumbline::app::pipeline::{check, print, read};
use plumbline::num::run::Run;
use plumbline::shape::mesh::{HalfEdges, Model, ReadLimits, TriMesh, read_model, shapes, write_model};
use serde_json::Value as Json;

use crate::pipeline::source;
use crate::support::program::{err, names, plumbline_in, succeed};

fn save(folder: &Path, name: &str, mesh: &TriMesh) {
    write_model(&folder.join(name), &Model::of_mesh(mesh.clone())).expect("a mesh file");
}

fn load(folder: &Path, name: &str) -> TriMesh {
    read_model(&folder.join(name), &ReadLimits::default(), &Run::default()).expect("a mesh file").mesh().clone()
}

fn moved(mesh: &TriMesh, place: impl Fn(&Point3<f64>) -> Point3<f64>) -> TriMesh {
    mesh.with_positions(mesh.positions().iter().map(place).collect()).expect("finite")
}

fn turned(mesh: &TriMesh, degrees: f64) -> TriMesh {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(1.0, 2.0, -0.5).normalize() * degrees.to_radians());
    moved(mesh, |p| turn * p)
}

fn farthest(a: &TriMesh, b: &TriMesh) -> f64 {
    let apart = a.positions().iter().zip(b.positions()).map(|(p, q)| (p - q).norm());
    apart.fold(0.0, f64::max) / a.diagonal()
}

fn json(folder: &Path, name: &str) -> Json {
    serde_json::from_str(&fs::read_to_string(folder.join(name)).expect("a report")).expect("JSON")
}

#[test]
fn a_rotation_by_270_degrees_is_interpolated_along_its_whole_angle() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let mesh = shapes::cactus(10);
    save(folder, "a.off", &mesh);
    for (degrees, turns) in [(170.0, "0"), (270.0, "-1")] {
        save(folder, "b.off", &turned(&mesh, degrees));
        let out = format!("f{degrees}/");
        let args = [
            "morph",
            "a.off",
            "b.off",
            "-o",
            &out,
            "--frames",
            "5",
            "--full-rotations",
            turns,
            "--report",
            "r.json",
            "--overwrite",
        ];
        succeed(folder, &args);
        for k in 0..5 {
            let shape = load(folder, &format!("{out}morph_{k:04}.off"));
            let expected = turned(&mesh, degrees * f64::from(k) / 4.0);
            // Files of text hold positions to the last digit or nearly so.
            assert!(farthest(&shape, &expected) < 1e-9, "{degrees}, {k}: {}", farthest(&shape, &expected));
        }
        let report = json(folder, "r.json");
        assert!((report["turn_deg"].as_f64().expect("a number") - degrees).abs() < 1e-6);
        assert_eq!(report["shapes"].as_array().map(Vec::len), Some(5));
        assert_eq!(load(folder, &format!("{out}morph_0004.off")).positions(), load(folder, "b.off").positions());
    }
}

#[test]
fn polygons_and_copies_of_vertices_are_kept_and_the_ends_are_the_meshes() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let soup = shapes::soup(&shapes::icosphere(2));
    save(folder, "a.ply", &soup);
    save(folder, "b.ply", &moved(&soup, |p| Point3::new(2.0 * p.x, p.y, p.z + 0.3 * p.x * p.x)));
    succeed(folder, &["morph", "a.ply", "b.ply", "-o", "m.ply", "--frames", "3"]);
    let middle = load(folder, "m_0001.ply");
    assert_eq!(middle.triangles(), soup.triangles());
    // Copies of one vertex stay together.
    for (t, corners) in soup.triangles().iter().enumerate().step_by(17) {
        for &v in corners {
            let same = |w: &usize| soup.positions()[*w] == soup.positions()[v as usize];
            let copies = (0..soup.vertex_count()).filter(same);
            assert!(
                copies.map(|w| (middle.positions()[w] - middle.positions()[v as usize]).norm()).all(|d| d < 1e-9),
                "{t}"
            );
        }
    }
    assert!(farthest(&load(folder, "m_0002.ply"), &load(folder, "b.ply")) == 0.0);
}

#[test]
fn landmarks_lay_one_mesh_over_another_and_refinement_finds_its_features() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let (coarse, fine) = (shapes::icosphere(2), shapes::icosphere(4));
    let bumpy =
        moved(&fine, |p| p + p.coords * (0.25 * (-12.0 * (p - Point3::new(0.0, 0.0, 1.0)).norm_squared()).exp()));
    save(folder, "a.obj", &coarse);
    save(folder, "b.obj", &bumpy);
    let pairs: Vec<String> = (0..12).map(|v| format!("[{v}, {v}]")).collect();
    let text = format!("{{\"format\": \"plumbline.landmarks\", \"version\": 1, \"pairs\": [{}]}}", pairs.join(", "));
    fs::write(folder.join("l.json"), text).expect("a small file");
    let run = |out: &str, more: &[&str]| {
        let args = [
            "morph",
            "a.obj",
            "b.obj",
            "-o",
            out,
            "--landmarks",
            "l.json",
            "--frames",
            "2",
            "--report",
            "r.json",
            "--overwrite",
        ];
        succeed(folder, &[&args[..], more].concat());
        let report = json(folder, "r.json");
        (report["correspondence"]["missed_worst"].as_f64().expect("a number"), report)
    };
    let (missed, report) = run("p.obj", &[]);
    assert_eq!(report["correspondence"]["landmark_error"], 0.0);
    assert_eq!(load(folder, "p_0000.obj").triangles(), coarse.triangles());
    let (refined, _) = run("q.obj", &["--refine", "0.002"]);
    assert!(refined < missed && refined <= 0.002, "{refined} {missed}");
    let (first, last) = (load(folder, "q_0000.obj"), load(folder, "q_0001.obj"));
    assert!(first.vertex_count() > coarse.vertex_count() && first.triangles() == last.triangles());
}

#[test]
fn a_blend_is_the_first_mesh_where_0_is_painted_and_the_second_where_1_is() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let bar = shapes::bar([3, 3, 24], [1.0, 1.0, 8.0]);
    save(folder, "a.obj", &bar);
    save(folder, "b.obj", &moved(&bar, |p| Point3::new(2.0 * p.x, 2.0 * p.y, p.z)));
    let paint = r#"{"format": "plumbline.paint", "version": 1, "paint": [
        {"time": 0, "half_space": {"point": [0, 0, 2], "normal": [0, 0, -1]}},
        {"time": 1, "half_space": {"point": [0, 0, 6], "normal": [0, 0, 1]}}]}"#;
    fs::write(folder.join("p.json"), paint).expect("a small file");
    succeed(folder, &["blend", "a.obj", "b.obj", "--paint", "p.json", "-o", "c.obj"]);
    let blended = load(folder, "c.obj");
    let width = |z: f64| {
        let of_slice = bar.positions().iter().zip(blended.positions()).filter(|(p, _)| (p.z - z).abs() < 0.1);
        let xs: Vec<f64> = of_slice.map(|(_, q)| q.x).collect();
        xs.iter().copied().fold(f64::MIN, f64::max) - xs.iter().copied().fold(f64::MAX, f64::min)
    };
    assert!((width(0.0) - 1.0).abs() < 0.05 && (width(8.0) - 2.0).abs() < 0.1, "{} {}", width(0.0), width(8.0));
    let middle = width(4.0);
    assert!((1.2..1.8).contains(&middle), "{middle}");
}

#[test]
fn two_halves_are_composed_to_a_closed_mesh() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    save(folder, "a.obj", &shapes::icosphere(3));
    save(folder, "b.obj", &moved(&shapes::icosphere(4), |p| Point3::new(3.0 + p.x, p.y, p.z)));
    let seam = r#"{"format": "plumbline.seam", "version": 1, "base": {"plane": {"point": [0, 0, 0.1], "normal": [0, 0, -1]}},
        "part": {"plane": {"point": [3, 0, 0.1], "normal": [0, 0, 1]}}, "band": 4}"#;
    fs::write(folder.join("s.json"), seam).expect("a small file");
    succeed(folder, &["compose", "a.obj", "b.obj", "--seam", "s.json", "-o", "c.obj", "--report", "r.json"]);
    let composed = load(folder, "c.obj");
    assert_eq!(HalfEdges::new(&composed).expect("a manifold").boundary_edge_count(), 0);
    assert!((composed.volume() / shapes::icosphere(4).volume() - 1.0).abs() < 0.02);
    assert!(json(folder, "r.json")["seam_vertices"].as_array().is_some_and(|s| s.len() > 20));
}

#[test]
fn bad_input_is_named_and_nothing_is_written() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    save(folder, "a.obj", &shapes::icosphere(2));
    save(folder, "b.obj", &shapes::icosphere(3));
    for (name, text) in [
        ("few.json", r#"{"format": "plumbline.landmarks", "version": 1, "pairs": [[0, 0], [1, 1]]}"#),
        ("none.json", r#"{"format": "plumbline.landmarks", "version": 1, "pairs": [[0, 0], [1, 9999], [2, 2]]}"#),
        (
            "open.json",
            r#"{"format": "plumbline.seam", "version": 1, "base": {"lasso": {"vertices": [0, 1, 0, 1], "keep": 5}},
            "part": {"plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}}"#,
        ),
        (
            "miss.json",
            r#"{"format": "plumbline.seam", "version": 1, "base": {"plane": {"point": [0, 0, 9], "normal": [0, 0, 1]}},
            "part": {"plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}}"#,
        ),
        ("paint.json", r#"{"format": "plumbline.paint", "version": 1, "paint": [{"time": 2, "vertices": [0]}]}"#),
    ] {
        fs::write(folder.join(name), text).expect("a small file");
    }
    let before = names(folder);
    for (args, told) in [
        (&["morph", "a.obj", "b.obj", "-o", "m.obj"][..], "the meshes differ: 162 and 642 vertices"),
        (
            &["morph", "a.obj", "b.obj", "-o", "m.obj", "--landmarks", "few.json"],
            "2 landmarks do not determine a similarity",
        ),
        (
            &["morph", "a.obj", "b.obj", "-o", "m.obj", "--landmarks", "none.json"],
            "landmark 1: the second mesh has no vertex 9999",
        ),
        (
            &["morph", "a.obj", "b.obj", "-o", "m.obj", "--landmarks", "paint.json"],
            "paint.json: not a file of landmarks",
        ),
        (&["blend", "a.obj", "a.obj", "-o", "m.obj", "--paint", "paint.json"], "a time is 2 (expected 0 to 1)"),
        (
            &["compose", "a.obj", "b.obj", "-o", "m.obj", "--seam", "miss.json"],
            "the seam of the base mesh does not meet the surface",
        ),
        (&["compose", "a.obj", "b.obj", "-o", "m.obj", "--seam", "open.json"], "the seam of the base mesh"),
    ] {
        let run = plumbline_in(folder, args);
        assert_eq!(run.status.code(), Some(65), "{args:?}: {}", err(&run));
        assert!(err(&run).contains(told), "{args:?}: {}", err(&run));
        assert_eq!(names(folder), before, "{args:?}");
    }
}

#[test]
fn the_command_builds_the_shipped_graph_and_prints_what_it_builds() {
    let file =
        pipeline_of(["plumbline", "morph", "first.obj", "second.obj", "-o", "morph.obj"]).expect("options in order");
    let built = check(file.clone()).unwrap_or_else(|p| panic!("{}", p.render(false, 100)));
    let ours = read(shipped("morph").expect("shipped"), &[]).unwrap_or_else(|p| panic!("{}", p.render(false, 100)));
    assert_eq!(draw(&built.graph, GraphFormat::Mermaid), draw(&ours.graph, GraphFormat::Mermaid));
    for stage in &ours.graph.stages {
        let same = built.graph.stage(&stage.name).expect("the same stages");
        assert_eq!(same.settings.to_json(), stage.settings.to_json(), "{}", stage.name);
    }
    for command in [
        &["morph", "a.obj", "b.obj", "-o", "f/", "--landmarks", "l.cons", "--refine", "0.01", "--full-rotations", "-1"]
            [..],
        &["blend", "a.obj", "b.obj", "--paint", "p.json", "-o", "c.glb", "--frames", "3"],
        &["compose", "a.obj", "b.obj", "--seam", "s.json", "-o", "c.ply", "--report", "r.json"],
    ] {
        let file = pipeline_of(["plumbline"].iter().chain(command)).expect("options in order");
        let printed = print(&file);
        let built = check(file).unwrap_or_else(|p| panic!("{}", p.render(false, 100)));
        let loaded = read(source(&printed), &[]).unwrap_or_else(|p| panic!("{printed}\n{}", p.render(false, 100)));
        assert_eq!(loaded, built, "{printed}");
    }
}

#[test]
fn a_glb_moves_through_the_shapes_that_files_hold_one_by_one() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let mesh = shapes::cactus(10);
    save(folder, "a.off", &mesh);
    save(folder, "b.off", &turned(&mesh, 120.0));
    let morph = ["morph", "a.off", "b.off", "--frames", "4"];
    succeed(folder, &[&morph[..], &["-o", "files/"]].concat());
    succeed(folder, &[&morph[..], &["-o", "moving.glb", "--seconds", "6"]].concat());
    assert_eq!(names(folder), ["a.off", "b.off", "files", "moving.glb"]);
    let model = read_model(&folder.join("moving.glb"), &ReadLimits::default(), &Run::default()).expect("a mesh file");
    let moving = model.articulation().expect("it moves");
    let channel = &moving.animations[0].channels[0];
    assert_eq!(channel.times, [0.0, 2.0, 4.0, 6.0]);
    let targets = &moving.instances[0].targets;
    assert_eq!((targets.len(), channel.values.len()), (3, 12));
    for k in 0..4 {
        let file = load(&folder.join("files"), &format!("morph_{k:04}.off"));
        let mut positions = model.mesh().positions().to_vec();
        for (target, weight) in targets.iter().zip(&channel.values[3 * k..]) {
            for (v, offset) in target.vertices.iter().zip(&target.offsets) {
                positions[*v as usize] += Vector3::from(*offset) * *weight;
            }
        }
        let shape = model.mesh().with_positions(positions).expect("finite");
        assert!(farthest(&shape, &file) < 1e-6, "{k}: {}", farthest(&shape, &file));
    }
}

#[test]
fn meshes_without_faces_are_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    fs::write(folder.join("nothing.off"), "OFF\n0 0 0\n").expect("writable");
    fs::write(folder.join("points.off"), "OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n").expect("writable");
    save(folder, "ball.off", &shapes::icosphere(1));
    for (first, second) in [("nothing.off", "nothing.off"), ("points.off", "points.off"), ("ball.off", "points.off")] {
        let ran = plumbline_in(folder, &["morph", first, second, "-o", "out/"]);
        assert_eq!(ran.status.code(), Some(65), "{first} {second}: {}", err(&ran));
        assert_eq!(names(folder), ["ball.off", "nothing.off", "points.off"], "{first} {second}");
    }
    // Nor folders around folders; but one that was there stays, even if empty.
    fs::create_dir(folder.join("kept")).expect("a folder");
    let ran = plumbline_in(folder, &["morph", "points.off", "points.off", "-o", "kept/deep/out/"]);
    assert_eq!(ran.status.code(), Some(65), "{}", err(&ran));
    assert_eq!(names(&folder.join("kept")), [""; 0]);
    let ran = plumbline_in(folder, &["morph", "points.off", "points.off", "-o", "out/"]);
    assert!(err(&ran).contains("the first mesh has no triangle of positive area"), "{}", err(&ran));
}
