use std::sync::Arc;

use nalgebra::{Point3, UnitQuaternion, Vector3};

use super::*;
use crate::character::clip::{Interpolation, rotations};
use crate::character::ik::IkMethod;
use crate::character::{Clip, Curve, Joint, MorphShape, Skeleton, Skin, SkinWeights, Track};
use crate::mesh::{Model, TriMesh};
use plumbline_num::math::Trs;
use plumbline_num::run::Run;

fn character() -> Character {
    let joint = |k: u32| Joint {
        name: ["hip", "knee", "foot"][k as usize].into(),
        parent: k.checked_sub(1),
        rest: Trs::from_translation(Vector3::y() * f64::from(k.min(1))),
        limits: None,
    };
    let skeleton = Skeleton::new((0..3).map(joint).collect()).expect("valid");
    let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(Point3::from).to_vec();
    let mesh = TriMesh::new(corners, vec![[0, 1, 2]]).expect("valid");
    let skin = Skin::bound(SkinWeights::rigid(3, &[0, 1, 2]).expect("valid"), &skeleton).expect("valid");
    let turns = [0.0, 1.0].map(|x| UnitQuaternion::from_scaled_axis(Vector3::z() * x));
    let track = Track {
        joint: 1,
        curve: Curve::Rotation(rotations(vec![0.0, 1.0], &turns, Interpolation::Linear).expect("valid")),
    };
    let clip = Clip::new("walk", vec![track], vec![]).expect("valid");
    let smile = MorphShape { name: "smile".into(), ..MorphShape::default() };
    let plain = Character::new(Model::of_mesh(mesh), skeleton, Arc::new(skin)).expect("valid");
    Character { clips: vec![clip], targets: vec![smile], ..plain }
}

fn parse(body: &str) -> Result<TargetPose, RigFileError> {
    TargetPose::parse(&format!(r#"{{"format": "plumbline.pose", "version": 1{body}}}"#), &character())
}

#[test]
fn rotations_are_applied_to_the_clip_and_targets_after_them() {
    let wanted = parse(
        r#", "from": {"clip": "walk", "time": 0.5}, "locked": ["hip"], "morphs": {"smile": 0.7},
           "joints": {"knee": {"turn_deg": [0, 0, 90], "move": [0, 1, 0]}, "hip": {"rotation": [0, 2, 0, 0], "scale": [2, 2, 2]}},
           "targets": [{"joint": "foot", "position": [0.5, 0.5, 0], "weight": 2, "chain": 1},
                       {"joint": "foot", "look_at": [0, 0, 9]}, {"joint": "knee", "orientation": [1, 0, 0, 0]},
                       {"joint": "foot", "pole": [0, 0, 1], "root": "hip", "middle": "knee"}]"#,
    )
    .expect("valid");
    let knee = wanted.start.locals[1];
    assert!((knee.rotation.scaled_axis() - Vector3::z() * (0.5 + std::f64::consts::FRAC_PI_2)).norm() < 1e-12);
    assert_eq!((knee.translation.y, wanted.start.locals[0].scale.x), (2.0, 2.0));
    assert!((wanted.start.locals[0].rotation.scaled_axis().norm() - std::f64::consts::PI).abs() < 1e-12);
    assert_eq!((wanted.locked, wanted.weights, wanted.targets.len()), (vec![0], vec![0.7], 4));
    assert_eq!((wanted.targets[0].weight, wanted.targets[0].chain), (2.0, Some(1)));
}

#[test]
fn targets_are_reached() {
    let wanted = parse(r#", "targets": [{"joint": "foot", "position": [1.2, 0.4, 0.3]}]"#).expect("valid");
    let found = wanted.solve(&character(), IkMethod::default(), 100, &Run::default()).expect("valid");
    assert!(found.residuals[0] < 1e-6, "{}", found.residuals[0]);
}

#[test]
fn errors_list_the_known_names() {
    let told = |body: &str| parse(body).expect_err("to be refused").to_string();
    assert_eq!(told(r#", "joints": {"kne": {}}"#), "there is no joint \"kne\"; did you mean \"knee\"?");
    assert_eq!(told(r#", "from": {"clip": "run"}"#), "there is no clip \"run\" (known: \"walk\")");
    assert!(told(r#", "morphs": {"frown": 1}"#).contains("the character has none of this name (known: smile)"));
    assert!(told(r#", "speed": 1"#).contains("unknown field `speed`"));
    assert!(told(r#", "targets": [{"joint": "foot"}]"#).starts_with("target 0: needs exactly one of"));
    assert!(told(r#", "targets": [{"joint": "foot", "pole": [0, 0, 1]}]"#).contains("a pole needs `root`"));
    assert!(told(r#", "joints": {"hip": {"rotation": [0, 0, 0, 0]}}"#).contains("has no length"));
    assert!(told(r#", "joints": {"hip": {"rotation": [1, 0, 0, 0], "turn_deg": [0, 0, 0]}}"#).contains("has both"));
    let other = |text: &str| TargetPose::parse(text, &character()).expect_err("to be refused").to_string();
    assert!(other(r#"{"format": "plumbline.skeleton", "version": 1}"#).contains("expected \"plumbline.pose\""));
    assert!(
        other(r#"{"format": "plumbline.pose", "version": 2}"#).starts_with("version 2 of a pose file is not supported")
    );
    assert!(other("{").starts_with("not a pose file"));
}

#[test]
fn pinned_joints_stay_where_the_initial_pose_has_them() {
    let person = crate::character::humanoid::humanoid(0.15).expect("made");
    let text = r#"{"format": "plumbline.pose", "version": 1, "from": {"clip": "walk", "time": 0.2},
        "joints": {"hips": {"move": [0, -0.05, 0]}}, "pinned": ["foot.L", "foot.R"]}"#;
    let wanted = TargetPose::parse(text, &person).expect("valid");
    let found = wanted.solve(&person, IkMethod::LeastSquares, 200, &Run::default()).expect("valid");
    let at = |pose: &Pose, joint: &str| {
        let globals = person.skeleton.globals(pose).expect("valid");
        Trs::from_matrix(&globals[person.skeleton.named(joint).expect("there") as usize])
    };
    for foot in ["foot.L", "foot.R"] {
        let (before, now) = (at(&wanted.from, foot), at(&found.pose, foot));
        assert!((before.translation - now.translation).norm() < 1e-5, "{foot}");
        assert!(before.rotation.angle_to(&now.rotation) < 1e-4, "{foot}");
    }
    let sunk = at(&wanted.from, "hips").translation.y - at(&found.pose, "hips").translation.y;
    assert!((sunk - 0.05).abs() < 1e-9, "the root is as the file has it: {sunk}");
    let refused = TargetPose::parse(&text.replace("foot.R", "paw"), &person).expect_err("unknown");
    assert!(refused.to_string().starts_with("there is no joint \"paw\""), "{refused}");
}
