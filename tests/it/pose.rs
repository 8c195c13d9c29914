//! Characters through the built program: posed, moved, written, and what is refused.

use std::fs;
use std::path::Path;

use nalgebra::Point3;
use plumbline::app::pipeline::read;
use plumbline::app::pipeline::shipped::shipped;
use plumbline::num::run::Run;
use plumbline::shape::character::Extrapolation;
use plumbline::shape::character::io::character_of;
use plumbline::shape::character::skinning::{Skinner, SkinningMethod};
use plumbline::shape::mesh::Model;

use crate::support::missing::real_media;
use crate::support::models::{far_apart, humanoid, model};
use crate::support::program::{err, names, plumbline_in, succeed};

const REACHING: &str = r#"{"format": "plumbline.pose", "version": 1,
    "joints": {"head": {"turn_deg": [0, 20, 0]}},
    "targets": [{"joint": "hand.L", "position": [0.3, 1.2, 0.35], "chain": 3}]}"#;

#[test]
fn a_movement_is_written_frame_by_frame_as_the_skin_has_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    succeed(folder, &["pose", &humanoid(), "--clip", "walk", "-o", "frames/", "--frames", "3", "--skinning", "lbs"]);
    assert_eq!(names(&folder.join("frames")), ["humanoid_0000.obj", "humanoid_0001.obj", "humanoid_0002.obj"]);
    let person = character_of(&model(Path::new(&humanoid()))).expect("a character");
    let skinner = Skinner::new(
        person.model.mesh(),
        None,
        &person.skeleton,
        &person.skin,
        SkinningMethod::LinearBlend,
        &Run::default(),
    );
    let (clip, skinner) = (person.clip("walk").expect("there"), skinner.expect("of one mesh"));
    let (first, last) = clip.span().expect("keys");
    let middle = clip.pose(&person.skeleton, 0.5 * (first + last), Extrapolation::Constant).expect("valid");
    let matrices = person.skin.joint_matrices(&person.skeleton.globals(&middle).expect("valid")).expect("valid");
    let written = model(&folder.join("frames/humanoid_0001.obj"));
    let expected = skinner.positions(&matrices).expect("valid");
    assert!(far_apart(written.mesh().positions(), &expected) < 1e-9);
}

#[test]
fn a_rig_that_is_kept_poses_like_the_baked_surface() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    fs::write(folder.join("p.json"), REACHING).expect("writable");
    let pose = ["pose", &humanoid(), "--pose", "p.json", "--skinning", "lbs"];
    succeed(folder, &[&pose[..], &["-o", "baked.glb", "--render", "p.png"]].concat());
    succeed(folder, &[&pose[..], &["-o", "rig.glb", "--rig"]].concat());
    let person = character_of(&model(&folder.join("rig.glb"))).expect("it keeps its skin");
    let names: Vec<&str> = person.clips.iter().map(plumbline::shape::character::Clip::name).collect();
    assert_eq!(names, ["walk", "wave"]);
    let skinner = Skinner::new(
        person.model.mesh(),
        None,
        &person.skeleton,
        &person.skin,
        SkinningMethod::LinearBlend,
        &Run::default(),
    );
    let matrices = person.skin.joint_matrices(&person.skeleton.rest_globals()).expect("valid");
    let posed = skinner.expect("of one mesh").positions(&matrices).expect("valid");
    assert!(far_apart(model(&folder.join("baked.glb")).mesh().positions(), &posed) < 1e-5);
    let hand = person.skeleton.rest_positions()[person.skeleton.named("hand.L").expect("there") as usize];
    assert!((hand - Point3::new(0.3, 1.2, 0.35)).norm() < 1e-5, "{hand}");
}

#[test]
fn a_plain_mesh_is_bound_to_a_skeleton_of_another_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    fs::write(folder.join("bones.tgf"), "1 0.5 0.5 0\n2 0.5 0.5 2.5\n3 0.5 0.5 5\n#\n1 2\n2 3\n").expect("writable");
    fs::write(
        folder.join("p.json"),
        r#"{"format": "plumbline.pose", "version": 1, "joints": {"2": {"turn_deg": [60, 0, 0]}}}"#,
    )
    .expect("writable");
    let bar = Path::new(env!("CARGO_MANIFEST_DIR")).join("media/mesh-bar.ply").display().to_string();
    let args = ["pose", &bar, "--skeleton", "bones.tgf", "--pose", "p.json", "-o", "bent.ply"];
    succeed(folder, &args);
    let (rest, bent) = (model(Path::new(&bar)), model(&folder.join("bent.ply")));
    let (low, _) = rest.mesh().bounding_box().expect("vertices");
    for (p, q) in rest.mesh().positions().iter().zip(bent.mesh().positions()) {
        let moves = (p - q).norm();
        assert!(p.z - low.z > 1e-9 || moves < 0.05, "the foot stays: {p} {q}");
    }
    assert!(far_apart(rest.mesh().positions(), bent.mesh().positions()) > 1.0);
}

#[test]
fn what_cannot_be_posed_is_refused_and_nothing_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    fs::write(folder.join("p.json"), r#"{"format": "plumbline.pose", "version": 1, "joints": {"haed": {}}}"#)
        .expect("writable");
    fs::write(folder.join("ring.bvh"), "HIERARCHY\nROOT a\n{\n OFFSET 0 0\n").expect("writable");
    let bar = Path::new(env!("CARGO_MANIFEST_DIR")).join("media/mesh-bar.ply").display().to_string();
    let person = humanoid();
    let cases: [(&[&str], i32, &str); 6] = [
        (&[&bar, "-o", "x.obj"], 65, "the model has no skin and nothing that moves"),
        (&[&person, "--clip", "run", "-o", "x.obj"], 65, "there is no clip \"run\" (known: \"walk\", \"wave\")"),
        (
            &[&person, "--pose", "p.json", "-o", "x.obj"],
            65,
            "p.json: there is no joint \"haed\"; did you mean \"head\"?",
        ),
        (&[&bar, "--skeleton", "ring.bvh", "-o", "x.obj"], 65, "ring.bvh: BVH, line 4"),
        (&[&person, "--rig", "-o", "x.obj"], 2, "--rig needs an output that can hold a skeleton"),
        (&[&person, "--clip", "walk", "--start", "1", "--end", "0.5", "-o", "x.obj"], 2, "it is before the start"),
    ];
    let before = names(folder);
    for (args, status, message) in cases {
        let ran = plumbline_in(folder, &[&["pose"], args].concat());
        assert_eq!(ran.status.code(), Some(status), "{args:?}: {}", err(&ran));
        assert!(err(&ran).contains(message), "{args:?}: {}", err(&ran));
        assert_eq!(names(folder), before);
    }
}

#[test]
fn the_shipped_pipeline_is_what_the_command_builds() {
    let file =
        read(shipped("rig-and-pose").expect("shipped"), &[]).unwrap_or_else(|p| panic!("{}", p.render(false, 100)));
    let args = [
        "plumbline",
        "pose",
        "mesh.obj",
        "--skeleton",
        "skeleton.json",
        "--pose",
        "pose.json",
        "-o",
        "posed.obj",
        "--render",
        "posed.png",
    ];
    let built = plumbline::app::cli::pipeline_of(args).expect("options in order");
    assert_eq!(file.file.stages.len(), built.stages.len());
}

/// Rows of numbers.
fn numbers(path: &Path) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(path).expect("a reference");
    text.lines().map(|l| l.split_whitespace().map(|w| w.parse().expect("a number")).collect()).collect()
}

/// References were computed from 32-bit files at 0 and at 35 % of each first clip; of the model's diagonal.
const SINGLE: f64 = 2e-7;

#[test]
fn real_characters_stand_as_their_references_do() {
    let Some(folder) = real_media("mesh/gltf") else { return };
    for (name, later) in [("CesiumMan", "0.7000"), ("RiggedSimple", "2.3333"), ("Fox", "1.1958")] {
        let person = character_of(&model(&folder.join(format!("{name}.glb")))).expect("a character");
        let clip = &person.clips[0];
        let (first, last) = clip.span().expect("keys");
        for (label, time) in [("0.0000", first), (later, 0.35 * last)] {
            let pose = clip.pose(&person.skeleton, time, Extrapolation::Constant).expect("valid");
            let matrices = person.skin.joint_matrices(&person.skeleton.globals(&pose).expect("valid")).expect("valid");
            let scale = person.model.mesh().diagonal();
            for (j, row) in numbers(&folder.join(format!("{name}.t{label}.joint_matrices.txt"))).iter().enumerate() {
                let worst = (0..16).map(|k| (matrices[j][(k / 4, k % 4)] - row[k]).abs()).fold(0.0, f64::max);
                assert!(worst < 1e-5 * scale.max(1.0), "{name} {label} joint {j}: {worst:e}");
            }
            let (mesh, skin) = (person.model.mesh(), &person.skin);
            let skinner =
                Skinner::new(mesh, None, &person.skeleton, skin, SkinningMethod::LinearBlend, &Run::default());
            let posed = skinner.expect("of one mesh").positions(&matrices).expect("valid");
            let expected = numbers(&folder.join(format!("{name}.t{label}.lbs.txt")));
            let expected: Vec<_> = expected.iter().map(|p| Point3::new(p[0], p[1], p[2])).collect();
            let worst = far_apart(&posed, &expected) / scale;
            assert!(worst < SINGLE, "{name} {label}: {worst:e} of the diagonal");
        }
    }
}

#[test]
fn a_template_is_fitted_to_a_mesh_of_another_size_and_bound_to_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let person = character_of(&model(Path::new(&humanoid()))).expect("a character");
    let rest = person.model.mesh();
    let larger: Vec<Point3<f64>> = rest.positions().iter().map(|p| Point3::from(p.coords * 40.0)).collect();
    let mesh = Model::of_mesh(rest.with_positions(larger).expect("finite"));
    plumbline::shape::mesh::write_model(&folder.join("giant.off"), &mesh).expect("written");
    let told = succeed(folder, &["skeleton", "giant.off", "--template", &humanoid(), "-o", "rig.glb"]);
    let told = String::from_utf8_lossy(&told.stderr).into_owned() + &String::from_utf8_lossy(&told.stdout);
    assert!(told.contains("6 of 6 limbs on the curve"), "{told}");
    let rigged = character_of(&model(&folder.join("rig.glb"))).expect("a character");
    let names = |c: &plumbline::shape::character::Character| -> Vec<String> {
        c.skeleton.joints().iter().map(|j| j.name.clone()).collect()
    };
    assert_eq!(names(&rigged), names(&person));
    // The movements come along.
    let clips = |c: &plumbline::shape::character::Character| -> Vec<String> {
        c.clips.iter().map(|clip| clip.name().to_owned()).collect()
    };
    assert_eq!(clips(&rigged), clips(&person));
    succeed(folder, &["pose", "rig.glb", "--clip", "walk", "--frames", "2", "-o", "walk.obj"]);
    // A tenth of a forearm's 0.24, and of the head what the curve ends before the surface does.
    for (name, allowed) in [("hand.L", 0.03), ("forearm.R", 0.03), ("shin.L", 0.03), ("foot.R", 0.03), ("head", 0.1)] {
        let at = |c: &plumbline::shape::character::Character| {
            c.skeleton.rest_positions()[c.skeleton.named(name).expect("there") as usize]
        };
        let off = (at(&rigged).coords / 40.0 - at(&person).coords).norm();
        assert!(off < allowed, "{name}: {off}");
    }

    fs::write(folder.join("point.tgf"), "1 0 0 0\n#\n").expect("writable");
    let corner = Point3::new(1.4, 1.4, 1.4);
    let ball = plumbline::shape::mesh::shapes::level_set(|p| p.coords.norm() - 1.0, -corner, corner, 0.2);
    let ball = Model::of_mesh(ball);
    plumbline::shape::mesh::write_model(&folder.join("ball.off"), &ball).expect("written");
    let out = plumbline_in(folder, &["skeleton", "ball.off", "--template", &humanoid(), "-o", "no.glb"]);
    assert!(out.status.code() == Some(65) && err(&out).contains("ball.off: the curve"), "{}", err(&out));
    for (args, rc, expected) in [
        (&["--template", "point.tgf"][..], 65, "point.tgf: the template has 1 joints at one position"),
        (&["--template", "none.json"][..], 65, "none.json"),
        (&["--template", "point.tgf", "--joints", "9"][..], 2, "cannot be used with"),
    ] {
        let out = plumbline_in(folder, &[&["skeleton", "giant.off", "-o", "no.glb"], args].concat());
        assert_eq!(out.status.code(), Some(rc), "{args:?}: {}", err(&out));
        assert!(err(&out).contains(expected), "{}", err(&out));
    }
    assert!(!folder.join("no.glb").exists());
}

#[test]
fn ends_to_keep_are_listed_as_vertices_are_in_other_files_or_as_numbers() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let corner = Point3::new(1.4, 1.4, 1.4);
    let ball = plumbline::shape::mesh::shapes::level_set(|p| p.coords.norm() - 1.0, -corner, corner, 0.2);
    plumbline::shape::mesh::write_model(&folder.join("ball.off"), &Model::of_mesh(ball.clone())).expect("written");
    let position = ball.positions()[7];
    let skeleton = |list: &str| {
        fs::write(folder.join("ends.json"), list).expect("writable");
        plumbline_in(folder, &["skeleton", "ball.off", "--keep", "ends.json", "-o", "rig.json", "--overwrite"])
    };
    let [x, y, z]: [f64; 3] = position.coords.into();
    let lists =
        ["7 90".to_owned(), "[7, 90]".into(), format!(r#"[{{"position": [{x}, {y}, {z}]}}, {{"vertex": 90}}]"#)];
    let rigs = lists.map(|list| {
        let out = skeleton(&list);
        assert!(out.status.success(), "{list}: {}", err(&out));
        fs::read_to_string(folder.join("rig.json")).expect("written")
    });
    assert!(rigs[0] == rigs[1] && rigs[1] == rigs[2]);
    for (list, expected) in [
        ("7 x", "ends.json: `x` is no number of a vertex"),
        ("[[0, 0]]", "ends.json: not a list of vertices"),
        (r#"[{"vertex": 99999}]"#, "ends.json: there is no vertex 99999"),
    ] {
        let out = skeleton(list);
        assert!(out.status.code() == Some(65) && err(&out).contains(expected), "{list}: {}", err(&out));
    }
}

/// The humanoid's file with other names of its joints, of the same length.
fn renamed(path: &Path, names: &[(&str, &str)]) {
    let mut bytes = fs::read(humanoid()).expect("the file");
    for (from, to) in names {
        let [from, to] = [from, to].map(|name| format!("\"name\":\"{name}\""));
        assert_eq!(from.len(), to.len());
        let at = bytes.windows(from.len()).position(|w| w == from.as_bytes()).unwrap_or_else(|| panic!("no {from}"));
        bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
    }
    fs::write(path, bytes).expect("writable");
}

const OTHER_NAMES: [(&str, &str); 4] =
    [("forearm.L", "Elbow.L__"), ("forearm.R", "Elbow.R__"), ("shin.L", "calf_l"), ("shin.R", "calf_r")];

#[test]
fn the_movements_of_another_character_are_carried_over_and_kept_beside_its_own() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    renamed(&folder.join("other.glb"), &OTHER_NAMES);
    let ran =
        plumbline_in(folder, &["pose", "other.glb", "--motion-from", &humanoid(), "--clip", "walk", "-o", "walks.glb"]);
    assert_eq!(ran.status.code(), Some(0), "{}", err(&ran));
    let found = character_of(&model(&folder.join("walks.glb"))).expect("it keeps its skin");
    let names: Vec<&str> = found.clips.iter().map(plumbline::shape::character::Clip::name).collect();
    assert_eq!(names, ["walk", "walk (2)", "wave"]);
    let (own, carried) = (&found.clips[1], &found.clips[0]);
    for t in [0.0, 0.4, 0.85] {
        let at = |clip: &plumbline::shape::character::Clip| {
            let pose = clip.pose(&found.skeleton, t, Extrapolation::Constant).expect("valid");
            found.skeleton.globals(&pose).expect("valid")
        };
        let off = at(own).iter().zip(at(carried)).map(|(a, b)| (a - b).amax()).fold(0.0, f64::max);
        assert!(off < 2e-3, "{t}: {off}");
    }
    // A map overrides names, and what it does not know is refused.
    let map = |joints: &str| format!(r#"{{"format": "plumbline.joint-map", "version": 1, "joints": {{{joints}}}}}"#);
    fs::write(folder.join("map.json"), map(r#""head": null"#)).expect("writable");
    fs::write(folder.join("bad.json"), map(r#""haed": null"#)).expect("writable");
    let args = ["pose", "other.glb", "--motion-from", &humanoid(), "--clip", "wave", "-o", "waves.glb", "--map"];
    succeed(folder, &[&args[..], &["map.json"]].concat());
    let found = character_of(&model(&folder.join("waves.glb"))).expect("it keeps its skin");
    let head = found.skeleton.named("head").expect("there");
    assert!(found.clips[0].tracks().iter().all(|track| track.joint != head));
    let refused = plumbline_in(folder, &[&args[..6], &["-o", "x.glb", "--map", "bad.json"]].concat());
    assert_eq!(refused.status.code(), Some(65));
    assert!(err(&refused).contains("bad.json: the target: there is no joint \"haed\""), "{}", err(&refused));
    let refused = plumbline_in(folder, &["pose", "other.glb", "--motion-from", &humanoid(), "-o", "x.obj"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(err(&refused).contains("names one of the movements \"walk\", \"wave\""), "{}", err(&refused));
}

#[test]
fn a_rate_of_poses_gives_morph_targets_of_one_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    succeed(folder, &["pose", &humanoid(), "--clip", "walk", "--fps", "10", "-o", "walk.glb"]);
    assert_eq!(names(folder), ["walk.glb"]);
    let walk = model(&folder.join("walk.glb"));
    let moving = walk.articulation().expect("it moves");
    let channel = &moving.animations[0].channels[0];
    assert_eq!((moving.instances[0].targets.len(), channel.times.len()), (12, 13));
    assert!((channel.times[12] - 1.2).abs() < 1e-5);
    succeed(
        folder,
        &["pose", &humanoid(), "--clip", "walk", "--fps", "5", "--start", "0.2", "--end", "0.6", "-o", "w.ply"],
    );
    assert_eq!(names(folder), ["w_0000.ply", "w_0001.ply", "w_0002.ply", "walk.glb"]);
    let refused =
        plumbline_in(folder, &["pose", &humanoid(), "--clip", "walk", "--fps", "1000", "--end", "90", "-o", "x.glb"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(err(&refused).contains("90001 poses (at most 9999)"), "{}", err(&refused));
}

#[test]
fn pinned_feet_stay_where_the_hips_go() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let pose = r#"{"format": "plumbline.pose", "version": 1, "targets": [{"joint": "hips", "position": [0, 0.8, 0]}]}"#;
    fs::write(folder.join("p.json"), pose).expect("writable");
    let args = ["pose", &humanoid(), "--pose", "p.json", "--pin", "foot.L", "foot.R", "-o", "rig.glb", "--rig"];
    let ran = plumbline_in(folder, &args);
    assert_eq!((ran.status.code(), err(&ran).contains("missed")), (Some(0), false), "{}", err(&ran));
    let rest = character_of(&model(Path::new(&humanoid()))).expect("a character");
    let crouched = character_of(&model(&folder.join("rig.glb"))).expect("a character");
    let at = |c: &plumbline::shape::character::Character, joint: &str| {
        c.skeleton.rest_positions()[c.skeleton.named(joint).expect("there") as usize]
    };
    for foot in ["foot.L", "foot.R"] {
        assert!((at(&rest, foot) - at(&crouched, foot)).norm() < 1e-4, "{foot}");
    }
    assert!((at(&crouched, "hips").y - 0.8).abs() < 1e-4);
}
