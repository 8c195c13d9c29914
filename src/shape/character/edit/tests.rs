use nalgebra::{UnitQuaternion, Vector3};

use super::*;
use crate::mesh::shapes::icosphere;
use plumbline_num::math::Trs;
use plumbline_num::spatial::Ray;

/// A trunk with an arm on the left, with arbitrary frames.
fn rig() -> RigEditor {
    let joint = |name: &str, parent, x: [f64; 3], turn: [f64; 3]| Joint {
        name: name.into(),
        parent,
        rest: Trs::rigid(UnitQuaternion::from_scaled_axis(turn.into()), x.into()),
        limits: None,
    };
    let joints = vec![
        joint("hip", None, [0.0, 1.0, 0.2], [0.3, 0.1, 0.0]),
        joint("chest", Some(0), [0.0, 0.5, 0.1], [0.0, -0.4, 0.2]),
        joint("arm.L", Some(1), [0.3, 0.2, 0.0], [0.5, 0.6, -0.7]),
        joint("hand.L", Some(2), [0.1, 0.6, 0.0], [0.0, 0.0, 0.9]),
    ];
    RigEditor::new(Some(&Skeleton::new(joints).expect("valid")))
}

fn worlds(editor: &RigEditor) -> Vec<nalgebra::Matrix4<f64>> {
    editor.skeleton().expect("some").rest_globals()
}

fn at(editor: &RigEditor, name: &str) -> Point3<f64> {
    let skeleton = editor.skeleton().expect("some");
    skeleton.rest_positions()[skeleton.find(name).expect("there") as usize]
}

fn middle() -> Plane {
    Plane { point: Point3::origin(), normal: Vector3::x_axis() }
}

fn all_edits() -> Vec<Edit> {
    let limits = Limits::cone(Vector3::y_axis(), 0.5, 0.2);
    vec![
        Edit::Add { name: "tail".into(), parent: Some(0), at: Point3::new(0.0, 0.9, -0.5) },
        Edit::Extrude { joint: 3, name: "thumb".into(), at: Point3::new(0.5, 2.0, 0.3) },
        Edit::Split { joint: 3, fraction: 0.4, name: "elbow.L".into() },
        Edit::Mirror { joint: 2, plane: middle() },
        Edit::Move { joint: 2, to: Point3::new(0.4, 1.8, 0.0), with_children: false },
        Edit::Move { joint: 1, to: Point3::new(0.1, 1.6, 0.0), with_children: true },
        Edit::Roll { joint: 2, angle: 0.7 },
        Edit::Reparent { joint: 3, parent: Some(0) },
        Edit::Rename { joint: 0, name: "pelvis".into() },
        Edit::Limit { joint: 2, limits: Some(limits) },
        Edit::Dissolve { joint: 1 },
        Edit::Remove { joint: 1 },
    ]
}

#[test]
fn every_edit_is_undone_and_redone_bit_for_bit() {
    let mut editor = rig();
    let mut states = vec![editor.joints().to_vec()];
    for edit in all_edits() {
        editor.apply(edit).expect("valid");
        states.push(editor.joints().to_vec());
    }
    let edits = all_edits();
    assert!(editor.history().eq(&edits));
    for (state, edit) in states.iter().zip(&edits).rev() {
        assert_eq!(editor.undo(), Some(edit));
        assert_eq!(editor.joints(), state);
    }
    assert_eq!(editor.undo(), None);
    for (state, edit) in states[1..].iter().zip(&edits) {
        assert_eq!(editor.redo(), Some(edit));
        assert_eq!(editor.joints(), state);
    }
    assert_eq!(editor.redo(), None);
    editor.undo();
    editor.apply(Edit::Rename { joint: 0, name: "root".into() }).expect("valid");
    assert_eq!(editor.redo(), None, "what was undone is gone with the next edit");
}

#[test]
fn a_rig_whose_last_joint_is_removed_is_as_before_the_first() {
    for edit in [Edit::Remove { joint: 0 }, Edit::Dissolve { joint: 0 }] {
        let mut editor = rig();
        let edited = editor.apply(Edit::Remove { joint: 1 }).expect("valid");
        assert_eq!((edited.joint_of, editor.joints().len()), (vec![Some(0); 4], 1));
        let edited = editor.apply(edit).expect("valid");
        assert_eq!((editor.skeleton(), edited.joint_of.as_slice(), edited.joint_count()), (None, &[None][..], 0));
        assert!(edited.carried(&SkinWeights::rigid(1, &[0, 0]).expect("valid")).is_err(), "weights of no joint");
        editor.apply(Edit::Add { name: "new".into(), parent: None, at: Point3::origin() }).expect("valid");
        assert_eq!(editor.joints().len(), 1);
    }
}

#[test]
fn a_rejected_edit_changes_nothing() {
    let told = |edit: Edit| {
        let mut editor = rig();
        let e = editor.apply(edit).expect_err("to be refused").to_string();
        assert_eq!((&editor, editor.history().len()), (&rig(), 0));
        e
    };
    let nan = Point3::new(f64::NAN, 0.0, 0.0);
    assert_eq!(told(Edit::Dissolve { joint: 9 }), "there is no joint 9; there are 4, numbered from 0");
    assert_eq!(told(Edit::Move { joint: 1, to: nan, with_children: true }), "the position is not finite");
    assert_eq!(
        told(Edit::Reparent { joint: 1, parent: Some(3) }),
        "joint \"chest\" cannot be a child of \"hand.L\", its own descendant"
    );
    assert!(told(Edit::Reparent { joint: 1, parent: Some(1) }).contains("cannot be a child of"));
    assert!(
        told(Edit::Split { joint: 3, fraction: 1.0, name: "x".into() })
            .starts_with("fraction 1 of the bone is invalid")
    );
    assert!(told(Edit::Split { joint: 0, fraction: 0.5, name: "x".into() }).contains("has no parent"));
    assert!(told(Edit::Rename { joint: 0, name: "chest".into() }).contains("both named \"chest\""));
    assert!(told(Edit::Mirror { joint: 0, plane: Plane { point: nan, ..middle() } }).contains("plane is not finite"));
    let mut editor = RigEditor::new(None);
    editor.apply(Edit::Add { name: "spine".into(), parent: None, at: Point3::origin() }).expect("valid");
    let e = editor.apply(Edit::Mirror { joint: 0, plane: middle() }).expect_err("to be refused");
    assert!(e.to_string().contains("have no side in their names"));
}

#[test]
fn edited_joints_are_at_their_positions_and_others_are_unchanged() {
    let near = |a: Point3<f64>, b: [f64; 3]| assert!((a - Point3::from(b)).norm() < 1e-12, "{a} {b:?}");
    let mut editor = rig();
    let before = worlds(&editor);
    editor.apply(Edit::Add { name: "tail".into(), parent: Some(1), at: Point3::new(0.0, 0.9, -0.5) }).expect("valid");
    near(at(&editor, "tail"), [0.0, 0.9, -0.5]);
    editor.apply(Edit::Extrude { joint: 3, name: "thumb".into(), at: Point3::new(0.5, 2.0, 0.3) }).expect("valid");
    near(at(&editor, "thumb"), [0.5, 2.0, 0.3]);
    assert!((worlds(&editor)[..4].iter().zip(&before)).all(|(a, b)| a == b));
    assert!(editor.joints()[5].rest.rotation.angle() < 1e-12, "turned as its parent");

    let hand = at(&editor, "hand.L");
    editor.apply(Edit::Move { joint: 2, to: Point3::new(0.4, 1.8, 0.0), with_children: false }).expect("valid");
    near(at(&editor, "arm.L"), [0.4, 1.8, 0.0]);
    assert!((at(&editor, "hand.L") - hand).norm() < 1e-12);
    let step = hand - at(&editor, "arm.L");
    editor.apply(Edit::Move { joint: 2, to: Point3::origin(), with_children: true }).expect("valid");
    assert!((at(&editor, "hand.L").coords - step).norm() < 1e-12);

    let before = worlds(&editor);
    for edit in [Edit::Reparent { joint: 3, parent: Some(0) }, Edit::Reparent { joint: 2, parent: None }] {
        editor.apply(edit).expect("valid");
        assert!(worlds(&editor).iter().zip(&before).all(|(a, b)| (a - b).amax() < 1e-12));
    }
}

#[test]
fn splitting_and_dissolving_keeps_all_world_frames() {
    let mut editor = rig();
    let before = worlds(&editor);
    let edited = editor.apply(Edit::Split { joint: 3, fraction: 0.25, name: "elbow".into() }).expect("valid");
    assert_eq!(edited, Edited { joint_of: vec![Some(0), Some(1), Some(2), Some(3)], added: vec![4] });
    let (arm, hand) = (at(&editor, "arm.L"), at(&editor, "hand.L"));
    assert!((at(&editor, "elbow") - (arm + (hand - arm) * 0.25)).norm() < 1e-12);
    assert!(worlds(&editor)[..4].iter().zip(&before).all(|(a, b)| (a - b).amax() < 1e-12));
    let edited = editor.apply(Edit::Dissolve { joint: 4 }).expect("valid");
    assert_eq!(edited.joint_of, [Some(0), Some(1), Some(2), Some(3), Some(2)], "the parent takes its part");
    assert!(worlds(&editor).iter().zip(&before).all(|(a, b)| (a - b).amax() < 1e-12));
    let edited = editor.apply(Edit::Remove { joint: 2 }).expect("valid");
    assert_eq!((edited.joint_of, editor.joints().len()), (vec![Some(0), Some(1), Some(1), Some(1)], 2));
}

#[test]
fn rolling_rotates_the_frame_about_its_bone_and_nothing_else() {
    let mut editor = rig();
    let before = worlds(&editor);
    let along = at(&editor, "hand.L") - at(&editor, "arm.L");
    editor.apply(Edit::Roll { joint: 2, angle: 0.7 }).expect("valid");
    let after = worlds(&editor);
    assert!((0..4).filter(|&j| j != 2).all(|j| (after[j] - before[j]).amax() < 1e-12));
    let turn = after[2] * before[2].try_inverse().expect("rigid");
    let turn = nalgebra::Rotation3::from_matrix_unchecked(turn.fixed_view::<3, 3>(0, 0).into_owned());
    assert!((turn.scaled_axis() - along.normalize() * 0.7).norm() < 1e-12);
}

#[test]
fn the_mirrored_side_is_and_rotates_as_the_mirror_image() {
    let mut editor = rig();
    // The trunk in the middle must be its own mirror image for the arms to be mirror images.
    for (joint, name) in [(1, "chest"), (0, "hip")] {
        let to = Point3::new(0.0, at(&editor, name).y, at(&editor, name).z);
        editor.apply(Edit::Move { joint, to, with_children: false }).expect("valid");
    }
    let limits = Limits { swing: [0.5, 0.3], twist: [-0.1, 0.4], ..Limits::cone(Vector3::y_axis(), 1.0, 1.0) };
    editor.apply(Edit::Limit { joint: 2, limits: Some(limits) }).expect("valid");
    let edited = editor.apply(Edit::Mirror { joint: 2, plane: middle() }).expect("valid");
    assert_eq!(edited.added, [4, 5]);
    let names: Vec<&str> = editor.joints()[4..].iter().map(|j| j.name.as_str()).collect();
    assert_eq!(names, ["arm.R", "hand.R"]);
    let mirrored = |p: Point3<f64>| Point3::new(-p.x, p.y, p.z);
    assert!((at(&editor, "hand.R") - mirrored(at(&editor, "hand.L"))).norm() < 1e-12);
    // The arm rotates within its limits; the other arm by the mirrored rotation, within its own.
    let skeleton = editor.skeleton().expect("some");
    let mut pose = skeleton.rest_pose();
    let turn = limits.rotation(&crate::character::SwingTwist { swing: nalgebra::Vector2::new(0.4, 0.1), twist: 0.35 });
    let v = turn.scaled_axis();
    let other = UnitQuaternion::from_scaled_axis(Vector3::new(v.x, -v.y, -v.z));
    pose.locals[2].rotation *= turn;
    pose.locals[4].rotation *= other;
    let there = skeleton.globals(&pose).expect("valid");
    let hand = |j: usize| Point3::from(there[j].fixed_view::<3, 1>(0, 3).into_owned());
    assert!((hand(5) - mirrored(hand(3))).norm() < 1e-12);
    let own = skeleton.joints()[4].limits.expect("mirrored");
    assert!(own.allows(&other, 1e-9) && !own.allows(&other.inverse(), 1e-2));
    // Again: the other side is moved, not added twice.
    editor.apply(Edit::Move { joint: 3, to: Point3::new(0.9, 1.1, 0.3), with_children: true }).expect("valid");
    let edited = editor.apply(Edit::Mirror { joint: 2, plane: middle() }).expect("valid");
    assert!(edited.added.is_empty() && (at(&editor, "hand.R") - Point3::new(-0.9, 1.1, 0.3)).norm() < 1e-12);
}

#[test]
fn names_swap_their_side() {
    let pairs = [
        ("arm.L", Some("arm.R")),
        ("l_knee", Some("r_knee")),
        ("LeftFoot", Some("RightFoot")),
        ("hand_right", Some("hand_left")),
        ("R-ear", Some("L-ear")),
        ("skull", None),
        ("Lamp", None),
        ("tail", None),
        ("left", None),
    ];
    for (name, other) in pairs {
        assert_eq!(other_side(name).as_deref(), other, "{name}");
    }
}

#[test]
fn a_ray_finds_the_middle_of_the_body_it_passes() {
    let ball = icosphere(3);
    let ray = |from: [f64; 3], along: [f64; 3]| Ray::new(&from.into(), &along.into());
    for (k, along) in [[0.0, 0.0, 1.0], [0.3, -0.2, 2.0], [1.0, 1.0, 0.1]].into_iter().enumerate() {
        let from = Point3::origin() - Vector3::from(along) * (3.0 + k as f64);
        let center = volume_center(&ball, &Ray::new(&from, &along.into())).expect("met");
        assert!(center.coords.norm() < 1e-9, "{center}");
    }
    let off = volume_center(&ball, &ray([0.5, 0.0, -4.0], [0.0, 0.0, 1.0])).expect("met");
    assert!((off - Point3::new(0.5, 0.0, 0.0)).norm() < 0.02);
    assert_eq!(volume_center(&ball, &ray([2.0, 0.0, -4.0], [0.0, 0.0, 1.0])), None);
    assert_eq!(volume_center(&ball, &ray([0.0, 0.0, -4.0], [0.0, 0.0, -1.0])), None, "behind");
}
