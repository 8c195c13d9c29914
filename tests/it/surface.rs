//! Meshes through the built program: drawn, deformed, and what is refused.

use std::fs;
use std::path::Path;

use nalgebra::{Point3, Vector3};
use plumbline::app::cli::pipeline_of;
use plumbline::app::pipeline::draw::{GraphFormat, draw};
use plumbline::app::pipeline::shipped::shipped;
use plumbline::app::pipeline::{check, print, read};
use plumbline::image::still::{LoadOptions, load, rgb_of_frame};
use plumbline::num::run::Run;
use plumbline::shape::mesh::{Model, ReadLimits, TriMesh, read_model, shapes, write_model};
use serde_json::Value as Json;

use crate::pipeline::source;
use crate::support::program::{err, names, plumbline_in, succeed};

/// A bar of 4 × 4 × 16 cells along z, one unit wide.
fn bar() -> TriMesh {
    shapes::bar([4, 4, 16], [1.0, 1.0, 4.0])
}

fn save(folder: &Path, name: &str, mesh: TriMesh) {
    write_model(&folder.join(name), &Model::of_mesh(mesh)).expect("a mesh file");
}

fn positions(folder: &Path, name: &str) -> Vec<Point3<f64>> {
    let model = read_model(&folder.join(name), &ReadLimits::default(), &Run::default()).expect("a mesh file");
    model.mesh().positions().to_vec()
}

/// Handles on both ends of a mesh along z; `motion` moves the upper one.
fn ends(folder: &Path, mesh: &TriMesh, motion: &str) {
    let (low, high) = mesh.bounding_box().expect("vertices");
    let slab = 1e-6 * (high.z - low.z);
    let end = |z: f64, up: i32| format!("{{\"half_space\": {{\"point\": [0, 0, {z}], \"normal\": [0, 0, {up}]}}}}");
    let text = format!(
        "{{\"format\": \"plumbline.handles\", \"version\": 1, \"handles\": [\n\
         {{\"name\": \"foot\", \"vertices\": {}}},\n{{\"name\": \"tip\", \"vertices\": {}, {motion}}}]}}",
        end(low.z + slab, -1),
        end(high.z - slab, 1)
    );
    fs::write(folder.join("h.json"), text).expect("a small file");
}

fn rms(a: &[Point3<f64>], b: &[Point3<f64>]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(p, q)| nalgebra::distance_squared(p, q)).sum();
    (sum / a.len() as f64).sqrt()
}

#[test]
fn a_bar_bends_with_its_ends_where_the_handles_want_them() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    save(folder, "bar.obj", bar());
    let motion = "\"rigid\": {\"rotation\": {\"axis\": [0, 1, 0], \"angle_deg\": 60}, \"translation\": [1, 0, 0]}";
    ends(folder, &bar(), motion);
    let args =
        ["deform", "bar.obj", "--handles", "h.json", "-o", "bent.obj", "--report", "r.json", "--render", "p.png"];
    let run = succeed(folder, &args);
    assert_eq!(names(folder), ["bar.obj", "bent.obj", "h.json", "p.png", "r.json"]);
    assert!(err(&run).contains("deform    arap: converged"), "{}", err(&run));
    let (rest, bent) = (bar().positions().to_vec(), positions(folder, "bent.obj"));
    let middle = Point3::new(0.0, 0.0, rest.iter().map(|p| p.z).fold(f64::MIN, f64::max));
    let tip: Vec<usize> = (0..rest.len()).filter(|v| (rest[*v].z - middle.z).abs() < 1e-9).collect();
    let center = tip.iter().map(|v| rest[*v].coords).sum::<Vector3<f64>>() / tip.len() as f64;
    let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::y_axis(), 60_f64.to_radians());
    for v in tip {
        let wanted = center + turn * (rest[v].coords - center) + Vector3::x();
        assert!((bent[v].coords - wanted).norm() < 1e-9, "vertex {v} of the handle");
    }
    let report: Json = serde_json::from_slice(&fs::read(folder.join("r.json")).expect("written")).expect("JSON");
    let pose = &report["poses"][0];
    assert_eq!((pose["converged"].as_bool(), pose["constraint_error"].as_f64()), (Some(true), Some(0.0)));
    assert!(pose["worst_stretch"].as_f64().is_some_and(|s| s > 0.0 && s < 0.6), "{pose}");
    let energies: Vec<f64> = pose["energies"].as_array().expect("a list").iter().filter_map(Json::as_f64).collect();
    assert!(energies.windows(2).all(|w| w[1] <= w[0] * (1.0 + 1e-9)), "{energies:?}");
    let picture = load(&folder.join("p.png"), LoadOptions::default()).expect("a picture").frame;
    let orange = rgb_of_frame(&picture).expect("RGB").iter().filter(|[r, _, b]| *r > 200 && *b < 60).count();
    assert!(orange > 50, "the handle that moves is marked: {orange} px");
}

#[test]
fn handles_that_move_as_one_body_move_everything_as_one_body() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    save(folder, "bar.off", bar());
    let (low, high) = bar().bounding_box().expect("vertices");
    let text = format!(
        "{{\"format\": \"plumbline.handles\", \"version\": 1, \"handles\": [{{\"vertices\": {{\"not\": {{\"box\": {{\"low\": \
         [-9, -9, {}], \"high\": [9, 9, {}]}}}}}}, \"rigid\": {{\"pivot\": [1, 2, 3], \"rotation\": {{\"axis\": [1, 1, 0], \
         \"angle_deg\": 100}}, \"translation\": [5, 0, 0]}}}}]}}",
        low.z + 1e-6,
        high.z - 1e-6
    );
    fs::write(folder.join("h.json"), text).expect("a small file");
    let turn = nalgebra::Rotation3::new(Vector3::new(1.0, 1.0, 0.0).normalize() * 100_f64.to_radians());
    let pivot = Point3::new(1.0, 2.0, 3.0);
    let wanted: Vec<_> = bar().positions().iter().map(|p| pivot + turn * (p - pivot) + Vector3::x() * 5.0).collect();
    for method in plumbline::shape::surface::Method::ALL.map(plumbline::shape::surface::Method::name) {
        let args = ["deform", "bar.off", "--handles", "h.json", "-o", "moved.off", "--overwrite", "--method", method];
        succeed(folder, &args);
        let error = rms(&positions(folder, "moved.off"), &wanted);
        assert!(error < 1e-9 * bar().diagonal(), "{method}: {error}");
    }
}

#[test]
fn frames_go_from_rest_to_the_last_key_by_the_longer_rotation() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    save(folder, "bar.ply", bar());
    ends(folder, &bar(), "\"rigid\": {\"rotation\": {\"axis\": [0, 0, 1], \"angle_deg\": 225}}");
    let args = ["deform", "bar.ply", "--handles", "h.json", "-o", "f.ply", "--frames", "3", "--iterations", "60"];
    succeed(folder, &args);
    assert_eq!(names(folder), ["bar.ply", "f_0000.ply", "f_0001.ply", "f_0002.ply", "h.json"]);
    let rest = positions(folder, "bar.ply");
    assert!(rms(&positions(folder, "f_0000.ply"), &rest) < 1e-6, "the first key is rest");
    // Half way up the bar is turned by half the angle, not by half of the 135° the other way.
    let last = positions(folder, "f_0002.ply");
    let (low, high) = bar().bounding_box().expect("vertices");
    let middle: Vec<usize> =
        (0..rest.len()).filter(|v| (rest[*v].z - f64::midpoint(low.z, high.z)).abs() < 1e-9).collect();
    let axis = nalgebra::center(&low, &high);
    let off = |degrees: f64| {
        let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), degrees.to_radians());
        middle.iter().map(|v| (axis + turn * (rest[*v] - axis) - last[*v]).norm()).sum::<f64>()
    };
    assert!(!middle.is_empty() && off(112.5) < 0.5 * off(-67.5), "{} {}", off(112.5), off(-67.5));
}

#[test]
fn vertices_outside_the_region_of_interest_stay() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    save(folder, "plane.obj", shapes::plane(20));
    let text = "{\"format\": \"plumbline.handles\", \"version\": 1, \"handles\": [{\"vertices\": {\"nearest\": [[0.5, 0.5, 0]]}, \
                \"rigid\": {\"translation\": [0, 0, 0.2]}}]}";
    fs::write(folder.join("h.json"), text).expect("a small file");
    succeed(folder, &["deform", "plane.obj", "--handles", "h.json", "-o", "out.obj", "--roi", "0.3"]);
    let (rest, moved) = (positions(folder, "plane.obj"), positions(folder, "out.obj"));
    let center = Point3::new(0.5, 0.5, 0.0);
    let lifted = rest.iter().zip(&moved).filter(|(a, b)| nalgebra::distance(a, b) > 1e-9).count();
    assert!(lifted > 20, "{lifted}");
    let far = rest.iter().zip(&moved).filter(|(p, _)| nalgebra::distance(p, &center) > 0.3 + 1e-9);
    assert!(far.clone().count() > 100 && far.clone().all(|(a, b)| a == b));
}

#[test]
fn the_model_that_was_read_is_written_back_in_another_pose() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let cube = "mtllib wood.mtl\no box\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\nv 9 9 9\n\
                vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\ng floor\nusemtl oak\nf 1/1 4/2 3/3 2/4\ng rest\nf 5/1 6/2 7/3 8/4\n\
                f 1/1 2/2 6/3 5/4\nf 2/1 3/2 7/3 6/4\nf 3/1 4/2 8/3 7/4\nf 4/1 1/2 5/3 8/4\n";
    fs::write(folder.join("cube.obj"), cube).expect("a small file");
    let text = "{\"format\": \"plumbline.handles\", \"version\": 1, \"handles\": [{\"vertices\": {\"range\": [0, 3]}}, \
                {\"vertices\": {\"indices\": [4, 5, 6, 7]}, \"rigid\": {\"translation\": [0, 0, 1]}}]}";
    fs::write(folder.join("h.json"), text).expect("a small file");
    let run = succeed(folder, &["deform", "cube.obj", "--handles", "h.json", "-o", "tall.obj"]);
    assert!(err(&run).contains("repair    1 vertices left out that no triangle names (first: 8)"), "{}", err(&run));
    let read =
        |name: &str| read_model(&folder.join(name), &ReadLimits::default(), &Run::default()).expect("a mesh file");
    let (before, after) = (read("cube.obj"), read("tall.obj"));
    assert_eq!(after.faces(), before.faces(), "quads stay quads");
    assert_eq!(
        (after.texture(), after.groups(), after.materials()),
        (before.texture(), before.groups(), before.materials())
    );
    let z: Vec<f64> = after.mesh().positions().iter().map(|p| p.z).collect();
    assert_eq!(z, [0.0, 0.0, 0.0, 0.0, 2.0, 2.0, 2.0, 2.0, 9.0], "the vertex of no face is still there");
}

#[test]
fn hostile_meshes_are_finished_and_reported() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let far =
        TriMesh::new(bar().positions().iter().map(|p| p + Vector3::repeat(1e6)).collect(), bar().triangles().to_vec());
    let mut flipped = bar().triangles().to_vec();
    flipped.iter_mut().step_by(7).for_each(|t| t.swap(0, 1));
    flipped.push([0, 0, 1]);
    flipped.push(flipped[3]);
    let messy = TriMesh::new(bar().positions().to_vec(), flipped).expect("corners exist");
    let aside = [[3.0, 0.0, 2.0], [4.0, 0.0, 2.0], [3.0, 1.0, 2.0]].map(Point3::from);
    let aside = TriMesh::new(aside.to_vec(), vec![[0, 1, 2]]);
    let cases = [
        ("soup", shapes::soup(&bar()), "vertices joined with another"),
        ("far", far.expect("finite"), "converged"),
        ("messy", messy, "triangles turned around"),
        ("parts", shapes::disjoint(&[bar(), aside.expect("finite")]), "no handle is on the part of 3 vertices"),
    ];
    for (name, mesh, told) in cases {
        let (file, out) = (format!("{name}.off"), format!("{name}.out.off"));
        save(folder, &file, mesh);
        let read = read_model(&folder.join(&file), &ReadLimits::default(), &Run::default()).expect("a mesh file");
        ends(folder, read.mesh(), "\"rigid\": {\"rotation\": {\"axis\": [1, 0, 0], \"angle_deg\": 40}}");
        let run = succeed(folder, &["deform", &file, "--handles", "h.json", "-o", &out]);
        assert!(err(&run).contains(told), "{name}: {}", err(&run));
        let moved = positions(folder, &out);
        assert_eq!(moved.len(), read.mesh().vertex_count(), "{name}");
        assert!(rms(&moved, read.mesh().positions()) > 0.05, "{name}");
    }
}

#[test]
fn pages_of_a_book_move_together_though_they_are_taken_apart_for_repair() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let book = shapes::book(4);
    save(folder, "book.off", book.clone());
    // The spine is held at one page alone.
    let text = "{\"format\": \"plumbline.handles\", \"version\": 1, \"handles\": [{\"vertices\": {\"indices\": [0, 1, 2]}, \
                \"rigid\": {\"rotation\": {\"axis\": [0, 1, 0], \"angle_deg\": 30}, \"translation\": [0, 0, 5]}}]}";
    fs::write(folder.join("h.json"), text).expect("a small file");
    let run = succeed(folder, &["deform", "book.off", "--handles", "h.json", "-o", "moved.off"]);
    assert!(!err(&run).contains("it stays"), "{}", err(&run));
    let (rest, moved) = (positions(folder, "book.off"), positions(folder, "moved.off"));
    for &[a, b, c] in book.triangles() {
        for (v, w) in [(a, b), (b, c), (c, a)] {
            let length = |p: &[Point3<f64>]| nalgebra::distance(&p[v as usize], &p[w as usize]);
            assert!((length(&moved) / length(&rest) - 1.0).abs() < 1e-6, "pages are stiff");
        }
    }
}

#[test]
fn modes_and_parts_are_written_by_the_vertices_of_the_file() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let mut places = bar().positions().to_vec();
    places.push(Point3::new(9.0, 9.0, 9.0));
    let mesh = TriMesh::new(places, bar().triangles().to_vec()).expect("finite");
    let vertices = mesh.vertex_count();
    save(folder, "bar.off", mesh);
    let run =
        succeed(folder, &["modes", "bar.off", "-k", "4", "-o", "m.npz", "--parts", "p.json", "--part-count", "3"]);
    assert!(err(&run).contains("modes     4 beside 6 rigid motions"), "{}", err(&run));
    let archive = fs::read(folder.join("m.npz")).expect("written");
    let text = String::from_utf8_lossy(&archive);
    assert!(text.contains("values.npy") && text.contains(&format!("'shape': (4, {vertices}, 3,)")));
    let parts: Json = serde_json::from_slice(&fs::read(folder.join("p.json")).expect("written")).expect("JSON");
    let of_vertex = parts["of_vertex"].as_array().expect("a list");
    assert_eq!((parts["count"].as_u64(), of_vertex.len()), (Some(3), vertices));
    assert!(of_vertex[vertices - 1].is_null(), "the vertex of no triangle is in no part");
    let part = |z: f64| {
        let v = (0..vertices - 1).find(|v| (bar().positions()[*v].z - z).abs() < 1e-9).expect("a vertex there");
        of_vertex[v].as_u64()
    };
    let (low, high) = bar().bounding_box().expect("vertices");
    assert_ne!(part(low.z), part(high.z), "the ends of a bar bend apart");
    let nothing = plumbline_in(folder, &["modes", "bar.off"]);
    assert_eq!(nothing.status.code(), Some(2), "{}", err(&nothing));
}

#[test]
fn pictures_show_the_mesh_from_the_side_asked_for_in_the_colors_asked_for() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    save(folder, "bar.stl", bar());
    let inked = |args: &[&str]| {
        let all =
            [&["render", "bar.stl", "-o", "p.png", "--overwrite", "--size", "300x200", "--background", "black"], args];
        succeed(folder, &all.concat());
        let frame = load(&folder.join("p.png"), LoadOptions::default()).expect("a picture").frame;
        assert_eq!((frame.width, frame.height), (300, 200));
        let pixels = rgb_of_frame(&frame).expect("RGB");
        let seen = |p: &&[u8; 3]| **p != [0; 3];
        let strong = |p: &&[u8; 3]| p.iter().max().unwrap_or(&0) - p.iter().min().unwrap_or(&0) > 60;
        (pixels.iter().filter(seen).count(), pixels.iter().filter(strong).count())
    };
    // From the front its square end is seen, filling the height; from the left its long side, filling the width.
    let (front, plain) = inked(&["--view", "front"]);
    let (left, _) = inked(&["--view", "left"]);
    assert!(front > 25_000 && left < 25_000 && left > 10_000, "{front} {left}");
    assert_eq!(plain, 0, "clay has little color");
    assert!(inked(&["--view", "left", "--scalar", "z"]).1 > 5_000);
    let (flat, _) = inked(&["--view=-120,30", "--flat", "--wireframe", "--mark-back", "--up", "z"]);
    assert!(flat > 3_000);
    let bad = plumbline_in(folder, &["render", "bar.stl", "-o", "q.png", "--scalar", "speed"]);
    assert_eq!(bad.status.code(), Some(65), "{}", err(&bad));
    assert!(err(&bad).contains("expected a NumPy file, or one of x, y, z"), "{}", err(&bad));
    succeed(folder, &["render", "*.stl", "--out-dir", "all"]);
    assert_eq!(names(&folder.join("all")), ["bar.png"]);
}

#[test]
fn a_skeleton_is_seen_through_the_mesh_around_it() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    save(folder, "bar.obj", bar());
    fs::write(folder.join("two.tgf"), "1 0.5 0.5 1\n2 0.5 0.5 3\n#\n1 2 1\n").expect("a small file");
    succeed(folder, &["skeleton", "bar.obj", "-o", "own.json"]);
    let red = |args: &[&str]| {
        let all = [&["render", "bar.obj", "-o", "p.png", "--overwrite", "--size", "300x200", "--view", "left"], args];
        succeed(folder, &all.concat());
        let frame = load(&folder.join("p.png"), LoadOptions::default()).expect("a picture").frame;
        let pixels = rgb_of_frame(&frame).expect("RGB");
        pixels.iter().filter(|[r, g, b]| *r > 150 && *g < 120 && *b < 120).count()
    };
    assert_eq!(red(&[]), 0, "clay is not red");
    for file in ["own.json", "two.tgf"] {
        assert!(red(&["--skeleton", file]) > 20, "{file}: ends are seen");
    }
    assert_eq!(red(&["--skeleton", "two.tgf", "--opacity", "1"]), 0, "through glass alone");
    let bad = plumbline_in(folder, &["render", "bar.obj", "-o", "q.png", "--skeleton", "none.json"]);
    assert!(bad.status.code().is_some_and(|code| code != 0) && err(&bad).contains("none.json"), "{}", err(&bad));
    let bad = plumbline_in(folder, &["render", "bar.obj", "-o", "q.png", "--opacity", "2"]);
    assert_eq!(bad.status.code(), Some(2), "{}", err(&bad));
    assert!(!folder.join("q.png").exists());
}

#[test]
fn faults_are_reported_with_their_file_and_leave_nothing() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    save(folder, "bar.obj", bar());
    fs::write(folder.join("nan.obj"), "v 0 0 0\nv 1 nan 0\nv 0 1 0\nf 1 2 3\n").expect("a small file");
    fs::write(folder.join("empty.obj"), "").expect("a small file");
    fs::write(folder.join("none.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\n").expect("a small file");
    let handles = |body: &str| format!("{{\"format\": \"plumbline.handles\", \"version\": 1, \"handles\": [{body}]}}");
    let vertex = "{\"vertices\": {\"indices\": [0]}}";
    for (name, text) in [
        ("good.json", handles(vertex)),
        ("beyond.json", handles("{\"name\": \"tip\", \"vertices\": {\"indices\": [100000]}}")),
        ("twice.json", handles(&format!("{vertex}, {vertex}"))),
        ("broken.json", "{\"format\": \"plumbline.handles\"".to_owned()),
    ] {
        fs::write(folder.join(name), text).expect("a small file");
    }
    let before = names(folder);
    for (mesh, handles, output, status, message) in [
        ("bar.obj", "beyond.json", "o.obj", 65, "beyond.json: handle \"tip\": the mesh has no vertex 100000"),
        ("bar.obj", "twice.json", "o.obj", 65, "twice.json: vertex 0 is in handle 1 and in handle 2"),
        ("bar.obj", "broken.json", "o.obj", 65, "broken.json: not a file of handles: EOF"),
        ("bar.obj", "missing.json", "o.obj", 65, "missing.json: "),
        ("nan.obj", "good.json", "o.obj", 65, "nan.obj: "),
        ("empty.obj", "good.json", "o.obj", 65, "empty.obj: "),
        ("none.obj", "good.json", "o.obj", 65, "on the surface after repair"),
        ("missing.obj", "good.json", "o.obj", 65, "missing.obj: "),
        ("bar.obj", "good.json", "o.xyz", 2, "names no format to write (expected .obj"),
        ("bar.obj", "good.json", "bar.obj", 2, "would be written over its input"),
    ] {
        let run = plumbline_in(folder, &["deform", mesh, "--handles", handles, "-o", output]);
        assert_eq!(run.status.code(), Some(status), "{message}: {}", err(&run));
        assert!(err(&run).contains(message), "{message}: {}", err(&run));
        assert_eq!(names(folder), before, "{message}");
    }
    for (args, message) in [
        (["--method", "arab"], "a similar value exists: 'arap'"),
        (["--tolerance", "nan"], "out of range"),
        (["--roi=-1", "--overwrite"], "out of range"),
        (["--frames", "0"], "1..=9999"),
    ] {
        let all = [&["deform", "bar.obj", "--handles", "good.json", "-o", "o.obj"][..], &args].concat();
        let run = plumbline_in(folder, &all);
        assert_eq!(run.status.code(), Some(2), "{}", err(&run));
        assert!(err(&run).contains(message), "{message}: {}", err(&run));
    }
}

#[test]
fn the_command_builds_the_shipped_graph_and_prints_it() {
    let args = ["plumbline", "deform", "mesh.obj", "--handles", "handles.json", "-o", "deformed.obj"];
    let file = pipeline_of(args.iter().chain(&["--render", "deformed.png"])).expect("options in order");
    let printed = print(&file);
    let built = check(file).unwrap_or_else(|p| panic!("{}", p.render(false, 100)));
    let ours =
        read(shipped("deform-mesh").expect("shipped"), &[]).unwrap_or_else(|p| panic!("{}", p.render(false, 100)));
    assert_eq!(draw(&built.graph, GraphFormat::Mermaid), draw(&ours.graph, GraphFormat::Mermaid));
    for stage in &ours.graph.stages {
        let same = built.graph.stage(&stage.name).expect("the same stages");
        assert_eq!(same.settings.to_json(), stage.settings.to_json(), "{}", stage.name);
    }
    let loaded = read(source(&printed), &[]).unwrap_or_else(|p| panic!("{printed}\n{}", p.render(false, 100)));
    assert_eq!(loaded, built, "{printed}");
    insta::assert_snapshot!("print_pipeline_deform", printed);
    let options = ["--frames", "9", "--method", "arap-elements", "--roi", "0.5", "--report", "r.json"];
    insta::assert_snapshot!(
        "print_pipeline_deform_frames",
        print(&pipeline_of(args.iter().chain(&options)).expect("options"))
    );
    let render =
        ["plumbline", "render", "a.ply", "-o", "a.png", "--view", "top", "--wireframe", "--background", "white"];
    insta::assert_snapshot!("print_pipeline_render", print(&pipeline_of(render).expect("options in order")));
}

#[test]
fn schemas_of_handles_are_printed_and_accept_the_documented_example() {
    let schema = succeed(Path::new("."), &["schema", "handles"]);
    let schema: Json = serde_json::from_slice(&schema.stdout).expect("JSON");
    assert!(schema["properties"]["handles"].is_object());
    let source = fs::read_to_string("src/shape/surface/handle_file/mod.rs").expect("the module");
    let lines = source.lines().skip_while(|l| !l.contains("```json")).skip(1).take_while(|l| !l.contains("```"));
    let example: String = lines.map(|l| l.trim_start_matches("//!")).collect();
    plumbline::shape::surface::handle_file::HandleFile::parse(&example).expect("what the document shows can be read");
}
