use nalgebra::{UnitQuaternion, Vector3};

use super::*;
use crate::character::clip::{Interpolation, rotations};
use crate::character::{Clip, Curve, Extrapolation, Joint, Keys, Limits, MorphTrack, Pose, Skeleton, Track};
use crate::mesh::io::{MeshFormat, ReadLimits, WriteOptions, decode_model, encode_model};
use crate::mesh::model::articulation::{Influences, Instance, Node, NodeSkin, NodeTransform};
use crate::mesh::shapes::bar;
use plumbline_num::math::Trs;
use plumbline_num::run::Run;

/// A bar along y on a chain of three joints, with a clip of each interpolation and two morph targets.
fn character() -> Character {
    let mesh = bar([1, 4, 1], [0.2, 1.0, 0.2]);
    let rest = |k: u32| {
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.2, -0.1, 0.4) * f64::from(k));
        Trs::rigid(turn, Vector3::new(0.05, if k == 0 { 0.0 } else { 0.33 }, 0.02))
    };
    let limits = Limits::cone(Vector3::y_axis(), 1.1, 0.3);
    let limits = |k: u32| (k == 1).then_some(limits);
    let joint = |k: u32| Joint { name: format!("j{k}"), parent: k.checked_sub(1), rest: rest(k), limits: limits(k) };
    let skeleton = Skeleton::new((0..3).map(joint).collect()).expect("valid");
    let row = |p: &Point3<f64>| [(0, (1.0 - p.y).max(0.01)), (1, 0.3), (2, p.y.max(0.0))];
    let rows: Vec<_> = mesh.positions().iter().map(row).collect();
    let (weights, _) = SkinWeights::normalized(3, rows, None).expect("valid");
    let skin = Arc::new(Skin::bound(weights, &skeleton).expect("valid"));
    let shape = |name: &str, vertices: Vec<u32>| MorphShape {
        name: name.into(),
        weight: 0.25,
        offsets: vertices.iter().map(|&v| [0.1, f64::from(v) * 0.01, -0.2]).collect(),
        vertices,
    };
    let times = vec![0.0, 0.4, 1.0];
    let turns: Vec<_> = times.iter().map(|&t| UnitQuaternion::from_scaled_axis(Vector3::new(0.3, 0.7, t))).collect();
    let values = vec![[0.0, 0.3, 0.0], [0.1, 0.3, 0.0], [0.0, 0.2, 0.1]];
    let cubic = Interpolation::Cubic { arriving: values.clone(), leaving: values.clone() };
    let keys = |between| Keys::new(times.clone(), values.clone(), between).expect("valid");
    let weights = Keys::new(times.clone(), vec![[0.0], [1.0], [0.5]], Interpolation::Linear).expect("valid");
    let tracks = vec![
        Track {
            joint: 1,
            curve: Curve::Rotation(rotations(times.clone(), &turns, Interpolation::Linear).expect("valid")),
        },
        Track { joint: 1, curve: Curve::Translation(keys(cubic)) },
        Track { joint: 2, curve: Curve::Scale(keys(Interpolation::Step)) },
    ];
    let clip = Clip::new("wave", tracks, vec![MorphTrack { target: 1, keys: weights }]).expect("valid");
    let plain = Character::new(Model::of_mesh(mesh), skeleton, skin).expect("valid");
    Character { targets: vec![shape("a", vec![0, 3]), shape("b", vec![1, 2, 7])], clips: vec![clip], ..plain }
}

fn through_a_file(character: &Character, format: MeshFormat) -> Character {
    let model = character.to_model(None).expect("valid");
    let bytes = encode_model(&model, format, &WriteOptions::default(), &Run::default()).expect("valid");
    let read = decode_model(&bytes, format, None, &ReadLimits::default(), &Run::default()).expect("own files are read");
    character_of(&read).expect("own files are characters")
}

/// Linear blend skinning, by the definition.
fn posed(character: &Character, pose: &Pose, weights: &[f64]) -> Vec<Point3<f64>> {
    let globals = character.skeleton.globals(pose).expect("valid");
    let matrices = character.skin.joint_matrices(&globals).expect("valid");
    let morphed = character.morphed(weights).expect("valid");
    let rows = character.skin.weights().rows();
    let blend = |(p, row): (&Point3<f64>, &[crate::character::Influence])| {
        row.iter()
            .fold(Point3::origin(), |sum, i| sum + matrices[i.joint as usize].transform_point(p).coords * i.weight)
    };
    morphed.iter().zip(rows).map(blend).collect()
}

#[test]
fn a_character_survives_a_round_trip() {
    let character = character();
    for format in [MeshFormat::Gltf, MeshFormat::Glb] {
        let again = through_a_file(&character, format);
        let names = |c: &Character| c.skeleton.joints().iter().map(|j| (j.name.clone(), j.parent)).collect::<Vec<_>>();
        assert_eq!(names(&again)[..3], names(&character)[..]);
        let kept = again.skeleton.joints()[1].limits.expect("limits are kept");
        assert!((kept.swing[0] - 1.1).abs() < 1e-12 && (kept.twist[0] + 0.3).abs() < 1e-12);
        assert_eq!(
            again.targets.iter().map(|t| (t.name.as_str(), t.weight)).collect::<Vec<_>>(),
            [("a", 0.25), ("b", 0.25)]
        );
        assert_eq!((again.clips.len(), again.clips[0].name(), again.clips[0].tracks().len()), (1, "wave", 3));
        // At a step key the 32-bit time of the file may be on either side.
        for t in [0.0, 0.2, 0.41, 0.77, 1.1] {
            let at = |c: &Character| {
                let pose = c.clips[0].pose(&c.skeleton, t, Extrapolation::Constant).expect("valid");
                posed(c, &pose, &c.clips[0].weights(&c.rest_weights(), t, Extrapolation::Constant).expect("valid"))
            };
            for (p, q) in at(&again).iter().zip(at(&character)) {
                assert!((p - q).norm() < 2e-6, "{t}: {p} {q}");
            }
        }
        let rest = posed(&again, &again.skeleton.rest_pose(), &[0.0, 0.0]);
        assert!(rest.iter().zip(character.model.mesh().positions()).all(|(p, q)| (p - q).norm() < 1e-6));
    }
}

#[test]
fn nodes_are_written_in_the_given_pose() {
    let character = character();
    let pose = character.clips[0].pose(&character.skeleton, 0.4, Extrapolation::Constant).expect("valid");
    let model = character.to_model(Some(&pose)).expect("valid");
    let again = character_of(&model).expect("valid");
    let near = |(a, b): (&Trs, &Trs)| (a.matrix() - b.matrix()).amax() < 1e-12;
    assert!(again.skeleton.rest_pose().locals.iter().zip(&pose.locals).all(near));
    assert!(character.to_model(Some(&Pose { locals: vec![] })).is_err());
}

#[test]
fn smooth_curves_are_sampled() {
    let mut character = character();
    let smooth =
        Keys::new(vec![0.0, 1.0, 1.5], vec![[1.0; 3], [2.0; 3], [1.0; 3]], Interpolation::Smooth).expect("valid");
    let track = Track { joint: 0, curve: Curve::Scale(smooth.clone()) };
    character.clips = vec![Clip::new("grow", vec![track], vec![]).expect("valid")];
    let again = through_a_file(&character, MeshFormat::Glb);
    for t in (0..150).map(|k| f64::from(k) * 0.01) {
        let scale = again.clips[0].pose(&again.skeleton, t, Extrapolation::Constant).expect("valid").locals[0].scale;
        assert!((scale.x - smooth.at(t)[0]).abs() < 1e-3, "{t}");
    }
}

/// Two triangles at two nodes of a chain: the first unskinned, the second with a skin of both nodes.
fn assembled(second_bind: Matrix4<f64>) -> Model {
    let transform = |x: f64| NodeTransform::Trs {
        translation: [x, 0.0, 0.0],
        rotation: [0.0, 0.0, 0.6, 0.8],
        scale: [1.0, 1.0, 1.0],
    };
    let node = |name: &str, parent, transform| Node { name: Some(name.into()), parent, transform, extras: None };
    let corners = |z: f64| [[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]].map(Point3::from);
    let mesh =
        crate::mesh::TriMesh::new([corners(0.0), corners(1.0)].concat(), vec![[0, 1, 2], [3, 4, 5]]).expect("valid");
    let nodes = vec![
        node("", None, transform(0.5)),
        node("arm", Some(0), transform(1.0)),
        node("arm", Some(1), NodeTransform::Matrix(Matrix4::new_translation(&Vector3::z()))),
        node("skinned", None, NodeTransform::default()),
    ];
    let articulation = Articulation { nodes, ..Articulation::default() };
    let world = articulation.world_from_nodes();
    let inverse = |j: usize| world[j].try_inverse().expect("rigid");
    let mut influences = Influences::default();
    (0..3).for_each(|_| influences.push([]));
    (0..3).for_each(|_| influences.push([(0, 0.4), (1, 0.6)]));
    let skin = |by: Matrix4<f64>| NodeSkin {
        name: None,
        joints: vec![1, 2],
        inverse_binds: vec![inverse(1) * by, inverse(2) * by],
    };
    let instance = |node, skin| Instance { node, skin, ..Instance::default() };
    let articulation = Articulation {
        roots: vec![0, 3],
        skins: vec![skin(second_bind)],
        instances: vec![instance(2, None), instance(3, Some(0))],
        instance_of_vertex: vec![0, 0, 0, 1, 1, 1],
        influences,
        ..articulation
    };
    Model::of_mesh(mesh).with_articulation(Some(articulation)).expect("valid")
}

#[test]
fn unskinned_parts_follow_their_node_and_all_parts_share_one_binding() {
    let shifted = Matrix4::new_translation(&Vector3::new(0.3, -1.0, 2.0));
    let model = assembled(shifted);
    let character = character_of(&model).expect("valid");
    let names: Vec<_> = character.skeleton.joints().iter().map(|j| j.name.as_str()).collect();
    assert_eq!(names, ["arm", "arm (2)", "node 0"]);
    assert!(character.warnings[0].starts_with("1 joints have the name of another"));
    let rest = posed(&character, &character.skeleton.rest_pose(), &[]);
    let expected = |v: usize, p: &Point3<f64>| if v < 3 { *p } else { shifted.transform_point(p) };
    for (v, (p, q)) in model.mesh().positions().iter().zip(&rest).enumerate() {
        assert!((expected(v, p) - q).norm() < 1e-12, "{v}: {p} {q}");
    }
    let mut pose = character.skeleton.rest_pose();
    pose.locals[1].translation += Vector3::new(0.0, 0.5, 0.0);
    let turned = posed(&character, &pose, &[]);
    let moved = character.skeleton.globals(&pose).expect("valid")[1]
        * character.skeleton.rest_globals()[1].try_inverse().expect("rigid");
    for v in 0..3 {
        assert!((moved.transform_point(&rest[v]) - turned[v]).norm() < 1e-12, "{v}");
    }
}

#[test]
fn inconsistent_bind_matrices_are_rejected_by_name() {
    let model = assembled(Matrix4::identity());
    let mut articulation = model.articulation().expect("some").clone();
    let mut other = articulation.skins[0].clone();
    other.inverse_binds[0] *= Matrix4::new_translation(&Vector3::x());
    articulation.skins.push(other);
    articulation.instances[0].skin = Some(1);
    articulation.influences = Influences::default();
    (0..6).for_each(|_| articulation.influences.push([(0, 1.0)]));
    let refused =
        character_of(&model.with_articulation(Some(articulation)).expect("valid")).expect_err("to be refused");
    assert_eq!(
        refused.to_string(),
        "skin 1 binds joint \"arm (2)\" otherwise than the skins before it, and not by one map for all its joints"
    );
}

#[test]
fn nodes_with_shear_and_static_models_are_rejected() {
    let model = assembled(Matrix4::identity());
    let mut articulation = model.articulation().expect("some").clone();
    let mut matrix = Matrix4::identity();
    matrix[(0, 1)] = 0.5;
    articulation.nodes[2].transform = NodeTransform::Matrix(matrix);
    let refused = character_of(&model.clone().with_articulation(Some(articulation)).expect("valid"));
    assert!(refused.expect_err("to be refused").to_string().starts_with("the matrix of node \"arm (2)\" has shear"));
    let still = character_of(&model.with_articulation(None).expect("valid"));
    assert!(still.expect_err("to be refused").to_string().starts_with("the model has no skin"));
}
