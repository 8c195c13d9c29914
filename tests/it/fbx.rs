//! FBX through the built program: a character whose file is written here, in centimeters with z up, moves as its glTF file does.

use std::fs;
use std::path::Path;

use nalgebra::{Matrix3, Matrix4, Quaternion, UnitQuaternion, Vector3};
use plumbline::num::math::Trs;
use plumbline::shape::mesh::Model;
use plumbline::shape::mesh::model::articulation::{Articulation, Channel, Property};

use crate::support::models::{far_apart, humanoid, model};
use crate::support::program::{err, out, plumbline_in, succeed};
use writer::{Form, Key, Scene, linear, p, whole};

#[path = "../../src/shape/mesh/io/fbx/tests/writer.rs"]
pub(crate) mod writer;

const FORM: Form = Form { version: 7500, pack: Some(writer::stored) };

/// Axes and unit of the file from ours: z up, the front toward -y, centimeters.
fn file_from_ours() -> Matrix4<f64> {
    (Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0) * 100.0).to_homogeneous()
}

/// A transform in the axes and unit of the file.
fn in_file(matrix: &Matrix4<f64>) -> Matrix4<f64> {
    file_from_ours() * matrix * file_from_ours().try_inverse().expect("a similarity")
}

/// Euler angles x, y, z in degrees.
fn degrees(rotation: &UnitQuaternion<f64>) -> [f64; 3] {
    let (x, y, z) = rotation.euler_angles();
    [x, y, z].map(f64::to_degrees)
}

/// Keys of the three axes of a channel; angles go on where they would jump by a full circle.
fn keys(channel: &Channel) -> [Vec<Key>; 3] {
    let width = channel.values.len() / channel.times.len();
    let mut keys: [Vec<Key>; 3] = Default::default();
    let mut last = [0.0_f64; 3];
    for (&time, value) in channel.times.iter().zip(channel.values.chunks_exact(width)) {
        let mut trs = Trs::identity();
        match channel.property {
            Property::Translation => trs.translation = Vector3::from_column_slice(value),
            Property::Scale => trs.scale = Vector3::from_column_slice(value),
            _ => {
                trs.rotation =
                    UnitQuaternion::from_quaternion(Quaternion::from(Vector3::from_column_slice(value).push(value[3])));
            }
        }
        let trs = Trs::from_matrix(&in_file(&trs.matrix()));
        let numbers: [f64; 3] = match channel.property {
            Property::Translation => trs.translation.into(),
            Property::Scale => trs.scale.into(),
            _ => {
                let angles = degrees(&trs.rotation);
                std::array::from_fn(|k| angles[k] + 360.0 * ((last[k] - angles[k]) / 360.0).round())
            }
        };
        last = numbers;
        keys.iter_mut().zip(numbers).for_each(|(keys, x)| keys.push(linear(time, x as f32)));
    }
    keys
}

/// The model as an FBX file.
fn fbx_of(model: &Model) -> Scene {
    let articulation: &Articulation = model.articulation().expect("a character");
    let mut scene = Scene {
        settings: vec![
            whole("UpAxis", 2),
            whole("FrontAxis", 1),
            whole("FrontAxisSign", -1),
            p("UnitScaleFactor", &[1.0]),
        ],
        ..Scene::default()
    };
    let mut objects = vec![0; articulation.nodes.len()];
    let mut open = articulation.roots.clone();
    while let Some(node) = open.pop() {
        let described = &articulation.nodes[node as usize];
        let trs = Trs::from_matrix(&in_file(&described.transform.matrix()));
        let parent = described.parent.map_or(0, |p| objects[p as usize]);
        let parts = vec![
            p("Lcl Translation", trs.translation.as_slice()),
            p("Lcl Rotation", &degrees(&trs.rotation)),
            p("Lcl Scaling", trs.scale.as_slice()),
        ];
        objects[node as usize] = scene.model(described.name.as_deref().unwrap_or_default(), parent, parts);
        open.extend(
            (0..articulation.nodes.len() as u32).filter(|&n| articulation.nodes[n as usize].parent == Some(node)),
        );
    }
    let points: Vec<[f64; 3]> =
        model.mesh().positions().iter().map(|p| file_from_ours().transform_point(p).into()).collect();
    let faces: Vec<Vec<i32>> = model.faces().iter().map(|f| f.iter().map(|&v| v as i32).collect()).collect();
    let faces: Vec<&[i32]> = faces.iter().map(Vec::as_slice).collect();
    let mesh = scene.mesh(objects[articulation.instances[0].node as usize], &points, &faces, Vec::new());
    let (skin, described) = (scene.skin(mesh), &articulation.skins[0]);
    for (joint, bind) in described.inverse_binds.iter().enumerate() {
        let weights: Vec<(i32, f64)> = (0..points.len())
            .flat_map(|v| articulation.influences.row(v).map(move |(j, w)| (v as i32, j, w)))
            .filter(|&(_, j, _)| j as usize == joint)
            .map(|(v, _, w)| (v, w))
            .collect();
        let transform = in_file(bind);
        let link = transform.try_inverse().expect("a frame");
        let columns = |m: &Matrix4<f64>| -> [f64; 16] { m.as_slice().try_into().expect("sixteen") };
        scene.cluster(skin, objects[described.joints[joint] as usize], &weights, [columns(&transform), columns(&link)]);
    }
    for animation in &articulation.animations {
        let layer = scene.animation(animation.name.as_deref().unwrap_or_default());
        for channel in &animation.channels {
            let name = match channel.property {
                Property::Translation => "Lcl Translation",
                Property::Scale => "Lcl Scaling",
                _ => "Lcl Rotation",
            };
            let [x, y, z] = keys(channel);
            let curves = [("d|X", x), ("d|Y", y), ("d|Z", z)];
            scene.curves(layer, (objects[channel.node as usize], name), &curves);
        }
    }
    scene
}

#[test]
fn a_character_moves_as_its_gltf_file_does() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let original = model(Path::new(&humanoid()));
    fs::write(folder.join("person.fbx"), fbx_of(&original).bytes(FORM)).expect("a file");
    let read = model(&folder.join("person.fbx"));
    assert!(far_apart(read.mesh().positions(), original.mesh().positions()) < 1e-9);
    assert_eq!(read.faces(), original.faces());
    for clip in ["walk", "wave"] {
        for (name, to) in [("person.fbx", "fbx"), (&humanoid()[..], "glb")] {
            let to = format!("{to}-{clip}/");
            succeed(folder, &["pose", name, "--clip", clip, "-o", &to, "--frames", "9", "--skinning", "lbs"]);
        }
        for frame in 0..9 {
            let pose = |kind: &str, name: &str| model(&folder.join(format!("{kind}-{clip}/{name}_{frame:04}.obj")));
            let (ours, expected) = (pose("fbx", "person"), pose("glb", "humanoid"));
            let off = far_apart(ours.mesh().positions(), expected.mesh().positions());
            assert!(off < 2e-3, "{clip} {frame}: {off} m");
        }
    }
    // A picture, a character of another format, and back.
    succeed(folder, &["pose", "person.fbx", "--clip", "walk", "--rig", "-o", "person.glb", "--render", "person.png"]);
    let again = model(&folder.join("person.glb"));
    let names = |m: &Model| {
        let all = &m.articulation().expect("a character").animations;
        all.iter().filter_map(|a| a.name.clone()).collect::<Vec<_>>()
    };
    assert_eq!(names(&again), ["walk", "wave"]);
    assert!(folder.join("person.png").exists());
}

#[test]
fn commands_of_meshes_and_skeletons_take_fbx_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    fs::write(folder.join("arm.fbx"), writer::character().bytes(FORM)).expect("a file");
    let told = out(&succeed(folder, &["mesh", "info", "arm.fbx"]));
    assert!(
        told.contains("6 vertices, 4 triangles") && told.contains("2 polygons of more than three corners"),
        "{told}"
    );
    succeed(folder, &["mesh", "convert", "arm.fbx", "-o", "arm.obj"]);
    assert_eq!(model(&folder.join("arm.obj")).faces().len(), 2);
    succeed(folder, &["render", "arm.fbx", "-o", "arm.png", "--skeleton", "arm.fbx"]);
    // A skeleton that moves, without a mesh.
    let mut bones = Scene::default();
    let root = bones.model("root", 0, Vec::new());
    let tip = bones.model("tip", root, vec![p("Lcl Translation", &[0.0, 100.0, 0.0])]);
    let layer = bones.animation("nod");
    bones.curves(layer, (tip, "Lcl Rotation"), &[("d|X", vec![linear(0.0, 0.0), linear(1.0, 45.0)])]);
    fs::write(folder.join("bones.fbx"), bones.bytes(FORM)).expect("a file");
    let args = [
        "pose",
        "arm.obj",
        "--skeleton",
        "bones.fbx",
        "--clip",
        "nod",
        "--weights",
        "distance",
        "--frames",
        "2",
        "-o",
        "nod/",
    ];
    succeed(folder, &args);
}

#[test]
fn text_files_and_writing_are_refused_with_the_remedy() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    fs::write(folder.join("text.fbx"), "; FBX 7.4.0 project file\nFBXHeaderExtension:  {\n}\n").expect("a file");
    let ran = plumbline_in(folder, &["mesh", "info", "text.fbx"]);
    assert_eq!(ran.status.code(), Some(65));
    assert!(err(&ran).contains("only binary FBX is read"), "{}", err(&ran));
    let ran = plumbline_in(folder, &["mesh", "convert", &humanoid(), "-o", "out.fbx"]);
    assert_eq!(ran.status.code(), Some(2), "{}", err(&ran));
    assert!(!folder.join("out.fbx").exists());
}
