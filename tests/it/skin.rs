//! Skins through the built program: weights, and what is refused.

use std::fs;
use std::path::Path;

use nalgebra::{UnitQuaternion, Vector3};
use plumbline::num::run::Run;
use plumbline::shape::character::regression::SkinModel;
use plumbline::shape::character::skeleton_file::SkeletonFile;
use plumbline::shape::character::skinning::{Skinner, SkinningMethod};
use plumbline::shape::character::weights::{WeightOptions, bone_weights};
use plumbline::shape::character::{Pose, Skin, WeightsFile};
use plumbline::shape::mesh::{Model, ReadLimits, TriMesh, read_model, shapes, write_model};

use crate::support::missing::real_media;
use crate::support::program::{err, names, plumbline_in, succeed};

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
    for method in ["heat", "biharmonic", "distance"] {
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

/// The bar's knee bent about x by as many degrees.
fn knee(folder: &Path, degrees: f64) -> Pose {
    let skeleton = SkeletonFile::read(&folder.join("bones.json")).expect("a skeleton").skeleton;
    let mut pose = skeleton.rest_pose();
    pose.locals[1].rotation = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), degrees.to_radians());
    pose
}

/// The bar bent by dual quaternions, as `NAME.off` in a folder of examples.
fn examples(folder: &Path, poses: &[(&str, f64)]) {
    fs::create_dir_all(folder.join("poses")).expect("writable");
    let skeleton = SkeletonFile::read(&folder.join("bones.json")).expect("a skeleton").skeleton;
    let rest = read_model(&folder.join("bar.off"), &ReadLimits::default(), &Run::default()).expect("a mesh");
    let (weights, _) =
        bone_weights(rest.mesh(), &skeleton, &WeightOptions::default(), &Run::default()).expect("weights");
    let skin = Skin::bound(weights, &skeleton).expect("not flat");
    let skinner = Skinner::new(rest.mesh(), None, &skeleton, &skin, SkinningMethod::DualQuaternion, &Run::default())
        .expect("fits");
    for (name, degrees) in poses {
        let globals = skeleton.globals(&knee(folder, *degrees)).expect("valid");
        let positions = skinner.positions(&skin.joint_matrices(&globals).expect("valid")).expect("fits");
        let model = rest.with_positions(positions).expect("as many");
        write_model(&folder.join(format!("poses/{name}.off")), &model).expect("writable");
    }
}

const BENT: [(&str, f64); 5] = [("a", -40.0), ("b", 0.0), ("c", 30.0), ("d", 60.0), ("e", 90.0)];

#[test]
fn a_skin_is_learnt_from_poses_and_puts_the_mesh_into_others() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    bar_and_bones(folder);
    examples(folder, &BENT);
    let train =
        ["skin", "train", "bar.off", "--examples", "poses", "--skeleton", "bones.json", "--held-out", "poses/c.off"];
    for (output, more) in [("full.skin", &[][..]), ("few.skin", &["--prototypes", "3"])] {
        let run = succeed(folder, &[&train[..], &["-o", output, "--report", "r.json", "--overwrite"], more].concat());
        assert!(err(&run).contains("4 poses, ") && err(&run).contains("; 1 held out, "), "{}", err(&run));
        let report: serde_json::Value =
            serde_json::from_slice(&fs::read(folder.join("r.json")).expect("written")).expect("JSON");
        let files = |key: &str| report[key].as_array().expect("a list").len();
        assert_eq!((files("examples"), files("held_out")), (4, 1));
        let diagonal = report["diagonal"].as_f64().expect("a number");
        assert!(report["rms"][0].as_f64().expect("a number") < 0.01 * diagonal, "{report:#}");
        let model = SkinModel::read(&folder.join(output)).expect("a model");
        assert_eq!((model.is_reduced(), model.joints().len()), (output == "few.skin", 3));
    }
    let bent = r#"{"format": "plumbline.pose", "version": 1, "joints": {"knee": {"turn_deg": [45, 0, 0]}}}"#;
    fs::write(folder.join("p.json"), bent).expect("writable");
    let pose = ["pose", "bar.off", "--skeleton", "bones.json", "--pose", "p.json", "--skinning", "regression"];
    let positions = |file: &str| {
        let model = read_model(&folder.join(file), &ReadLimits::default(), &Run::default()).expect("a mesh");
        model.mesh().positions().to_vec()
    };
    let skeleton = SkeletonFile::read(&folder.join("bones.json")).expect("a skeleton").skeleton;
    let rest = read_model(&folder.join("bar.off"), &ReadLimits::default(), &Run::default()).expect("a mesh");
    let skin = Skin::bound(SkinModel::read(&folder.join("full.skin")).expect("a model").weights().weights, &skeleton);
    let globals = skeleton.globals(&knee(folder, 45.0)).expect("valid");
    let matrices = skin.expect("not flat").joint_matrices(&globals).expect("valid");
    for name in ["full", "few"] {
        let (model, out) = (format!("{name}.skin"), format!("{name}.off"));
        succeed(folder, &[&pose[..], &["--model", &model, "-o", &out]].concat());
        let mut bound = SkinModel::read(&folder.join(model))
            .expect("a model")
            .bound(rest.mesh(), &skeleton, &Run::default())
            .expect("its own");
        let expected = bound.positions(&matrices).expect("fits");
        let far = positions(&out).iter().zip(&expected).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        assert!(far < 1e-9, "{name}: {far}");
    }
    succeed(folder, &[&pose[..], &["--model", "full.skin", "--details", "1", "-o", "kept.off"]].concat());
    assert_ne!(positions("kept.off"), positions("full.off"));
}

#[test]
fn what_nothing_can_be_learnt_from_is_refused_file_by_file() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    bar_and_bones(folder);
    examples(folder, &BENT);
    let rest = read_model(&folder.join("bar.off"), &ReadLimits::default(), &Run::default()).expect("a mesh");
    let mut triangles = rest.mesh().triangles().to_vec();
    triangles[3].rotate_left(1);
    let other = TriMesh::new(rest.mesh().positions().to_vec(), triangles).expect("the same vertices");
    write_model(&folder.join("other.off"), &Model::of_mesh(other)).expect("writable");
    write_model(&folder.join("plane.off"), &Model::of_mesh(shapes::plane(3))).expect("writable");
    let millimeters = rest.mesh().positions().iter().map(|p| p * 1000.0).collect();
    let large = rest.with_positions(millimeters).expect("as many");
    write_model(&folder.join("large.off"), &large).expect("writable");
    fs::write(folder.join("bad.skin"), "no skin at all").expect("writable");
    let before = names(folder);
    let train = ["skin", "train", "bar.off", "--skeleton", "bones.json", "-o", "m.skin", "--examples"];
    let cases: [(&[&str], &[&str]); 6] = [
        (&["poses/a.off"], &["1 examples are too few to learn from (at least 2)"]),
        (&["poses", "--held-out", "poses/*.off"], &["0 examples are too few", "5 held out"]),
        (&["poses", "plane.off", "other.off"], &["plane.off: 16 vertices", "other.off: face 3 has the vertices"]),
        (&["poses", "large.off"], &["large.off: 1000.000 times as large (expected 0.5 to 2)"]),
        (&["none-*.off"], &["no mesh matches"]),
        (&["poses", "--poses", "p/*.json"], &["no pose file is called `a`"]),
    ];
    for (args, expected) in cases {
        let run = plumbline_in(folder, &[&train[..], args].concat());
        assert_eq!(run.status.code(), Some(65), "{args:?}: {}", err(&run));
        assert!(expected.iter().all(|e| err(&run).contains(e)), "{args:?}: {}", err(&run));
        assert_eq!(names(folder), before);
    }
    let pose = ["pose", "bar.off", "--skeleton", "bones.json", "-o", "x.off"];
    let cases: [(&[&str], i32, &str); 3] = [
        (&["--skinning", "regression", "--model", "bad.skin"], 65, "bad.skin: not a trained skin"),
        (&["--skinning", "regression"], 2, "belong together"),
        (&["--model", "bad.skin"], 2, "belong together"),
    ];
    for (args, status, expected) in cases {
        let run = plumbline_in(folder, &[&pose[..], args].concat());
        assert_eq!(run.status.code(), Some(status), "{args:?}: {}", err(&run));
        assert!(err(&run).contains(expected), "{args:?}: {}", err(&run));
        assert_eq!(names(folder), before);
    }
}

#[test]
fn weights_of_a_file_bind_a_mesh_that_is_posed() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    bar_and_bones(folder);
    let bent = r#"{"format": "plumbline.pose", "version": 1, "joints": {"knee": {"turn_deg": [90, 0, 0]}}}"#;
    fs::write(folder.join("p.json"), bent).expect("writable");
    let rest = read_model(&folder.join("bar.off"), &ReadLimits::default(), &Run::default()).expect("a mesh");
    let count = rest.mesh().vertex_count();
    // All of the bar follows the foot, which stays.
    let rows = |count: usize| vec!["[0, 1]"; count].join(",");
    let text = |rows: String| {
        format!("{{\"format\": \"plumbline.weights\", \"version\": 1, \"joints\": [\"foot\"], \"rows\": [{rows}]}}")
    };
    fs::write(folder.join("w.json"), text(rows(count))).expect("writable");
    fs::write(folder.join("few.json"), text(rows(7))).expect("writable");
    fs::write(folder.join("who.json"), text(rows(count)).replace("foot", "fot")).expect("writable");
    let pose = ["pose", "bar.off", "--skeleton", "bones.json", "--pose", "p.json", "-o", "x.off", "--weights"];
    succeed(folder, &[&pose[..], &["w.json"]].concat());
    let posed = read_model(&folder.join("x.off"), &ReadLimits::default(), &Run::default()).expect("a mesh");
    let far = rest.mesh().positions().iter().zip(posed.mesh().positions()).map(|(a, b)| (a - b).norm());
    assert!(far.fold(0.0, f64::max) < 1e-12);
    for (file, expected) in [
        ("few.json", "few.json: 7 rows of weights do not fit a mesh of"),
        ("who.json", "who.json: there is no joint \"fot\"; did you mean \"foot\"?"),
        ("none.json", "none.json"),
    ] {
        let run = plumbline_in(folder, &[&pose[..], &[file, "--overwrite"]].concat());
        assert_eq!(run.status.code(), Some(65), "{file}: {}", err(&run));
        assert!(err(&run).contains(expected), "{file}: {}", err(&run));
    }
}

#[test]
fn held_out_real_poses_are_fitted_better_than_by_the_best_linear_blend() {
    let Some(poses) = real_media("mesh/seq") else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let horse = (1..=10).map(|k| format!("horse/horse-{k:02}.obj")).collect::<Vec<_>>();
    let cat = (2..=9).map(|k| format!("catlow/cat_{k:06}.obj")).collect::<Vec<_>>();
    for (rest, all) in [("horse/horse_ref.obj", horse), ("catlow/cat_000001.obj", cat)] {
        let path = |name: &str| poses.join(name).display().to_string();
        let (rest, all) = (path(rest), all.iter().map(|name| path(name)).collect::<Vec<_>>());
        let held: Vec<&str> = all.iter().skip(1).step_by(3).map(String::as_str).collect();
        succeed(folder, &["skeleton", &rest, "-o", "bones.json", "--overwrite"]);
        let mut args = vec!["skin", "train", &rest, "--skeleton", "bones.json", "-o", "m.skin", "--report", "r.json"];
        args.extend(["--overwrite", "--examples"]);
        args.extend(all.iter().map(String::as_str));
        args.push("--held-out");
        args.extend(held);
        succeed(folder, &args);
        let report: serde_json::Value =
            serde_json::from_slice(&fs::read(folder.join("r.json")).expect("written")).expect("JSON");
        for set in 0..2 {
            let rms = |key: &str| report[key][set].as_f64().expect("a number");
            assert!(rms("rms") < 0.98 * rms("linear_rms"), "{rest}: {report:#}");
        }
    }
}

#[test]
fn a_mesh_with_a_skin_of_its_own_needs_no_other_skeleton_to_learn_with() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    bar_and_bones(folder);
    examples(folder, &BENT);
    succeed(folder, &["pose", "bar.off", "--skeleton", "bones.json", "--rig", "-o", "own.glb"]);
    let train = ["skin", "train", "--examples", "poses", "-o", "own.skin"];
    succeed(folder, &[&train[..], &["own.glb"]].concat());
    let model = SkinModel::read(&folder.join("own.skin")).expect("a model");
    assert_eq!(model.joints(), ["foot", "knee", "hip"]);
    let pose = ["pose", "own.glb", "--skinning", "regression", "--model", "own.skin", "-o", "posed.obj"];
    succeed(folder, &pose);
    let refused = plumbline_in(folder, &["skin", "train", "bar.off", "--examples", "poses", "-o", "no.skin"]);
    assert_eq!(refused.status.code(), Some(65), "{}", err(&refused));
    assert!(err(&refused).contains("`--skeleton`") && !folder.join("no.skin").exists(), "{}", err(&refused));
    let bound = ["skin", "train", "own.glb", "--weights", "heat", "--examples", "poses", "-o", "no.skin"];
    let refused = plumbline_in(folder, &bound);
    assert_eq!(refused.status.code(), Some(2), "{}", err(&refused));
}
