//! Skins through the built program: weights, and what is refused.

use std::fs;
use std::path::Path;

use plumbline::character::WeightsFile;
use plumbline::mesh::{Model, shapes, write_model};

use crate::support::program::{err, plumbline_in, succeed};

/// A bar along z from −2 to 2, and two bones in it.
fn bar_and_bones(folder: &Path) {
    let mesh = shapes::bar([4, 4, 16], [1.0, 1.0, 4.0]);
    let (low, high) = mesh.bounding_box().expect("vertices");
    let middle = nalgebra::center(&low, &high);
    write_model(&folder.join("bar.off"), &Model::of_mesh(mesh)).expect("a mesh file");
    let (x, y, z, half) = (middle.x, middle.y, low.z, 0.5 * (high.z - low.z));
    let text = format!(
        "{{\"format\": \"plumbline.skeleton\", \"version\": 1, \"joints\": [\n\
         {{\"name\": \"foot\", \"translation\": [{x}, {y}, {z}]}},\n\
         {{\"name\": \"knee\", \"parent\": \"foot\", \"translation\": [0, 0, {half}]}},\n\
         {{\"name\": \"hip\", \"parent\": \"knee\", \"translation\": [0, 0, {half}]}}]}}"
    );
    fs::write(folder.join("bones.json"), text).expect("written");
}

#[test]
fn weights_are_written_by_the_vertices_of_the_file_and_the_names_of_the_joints() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    bar_and_bones(folder);
    let mesh = shapes::bar([4, 4, 16], [1.0, 1.0, 4.0]);
    let (low, high) = mesh.bounding_box().expect("vertices");
    for method in ["heat", "bbw", "distance"] {
        let args = ["skin", "weights", "bar.off", "--skeleton", "bones.json", "-o", "w.json", "--method", method];
        let run = succeed(folder, &[&args[..], &["--overwrite"]].concat());
        assert!(err(&run).contains("weights   3 joints, 2 at most"), "{}", err(&run));
        let file = WeightsFile::read(&folder.join("w.json")).expect("weights");
        assert_eq!(file.joints, ["foot", "knee", "hip"]);
        assert_eq!(file.weights.vertex_count(), mesh.vertex_count());
        for (v, p) in mesh.positions().iter().enumerate() {
            let along = (p.z - low.z) / (high.z - low.z);
            let strongest = file.weights.row(v)[0].joint;
            assert!(along == 0.5 || strongest == u32::from(along > 0.5), "{method}: {along} follows {strongest}");
        }
    }
}

#[test]
fn a_skeleton_that_is_none_is_refused_by_name_and_nothing_is_written() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    bar_and_bones(folder);
    let text = fs::read_to_string(folder.join("bones.json")).expect("written");
    for (from, to, expected) in [
        ("\"parent\": \"foot\"", "\"parent\": \"hip\"", "joints form a cycle"),
        ("\"parent\": \"foot\"", "\"parent\": \"fot\"", "did you mean \"foot\"?"),
        ("\"name\": \"hip\"", "\"name\": \"knee\"", "both named \"knee\""),
    ] {
        fs::write(folder.join("bad.json"), text.replace(from, to)).expect("written");
        let run = plumbline_in(folder, &["skin", "weights", "bar.off", "--skeleton", "bad.json", "-o", "w.json"]);
        assert_eq!(run.status.code(), Some(65), "{}", err(&run));
        assert!(err(&run).contains("bad.json") && err(&run).contains(expected), "{}", err(&run));
        assert!(!folder.join("w.json").exists());
    }
}
