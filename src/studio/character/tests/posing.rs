//! Poses that are not keyed, locked joints, copies of poses, templates of files, extractions among letters.

use super::*;

fn rotate(joint: u32, angle: f64) -> Value {
    json!({"do": "rotate", "joint": joint, "rotation": [0.0, 0.0, (0.5 * angle).sin(), (0.5 * angle).cos()]})
}

/// A person with keys of an arm at 0 s and 1 s.
fn waving() -> Opened {
    let mut opened = Opened::person();
    let arm = opened.joint("arm.L");
    opened.view(json!({"tab": "animate", "joint": null, "time": 0.0}));
    opened.edit(json!({"do": "add_clip", "name": "wave"})).unwrap();
    for (time, angle) in [(0.0, 0.0), (1.0, 0.8)] {
        opened.view(json!({"time": time}));
        opened.edit(rotate(arm, angle)).unwrap();
        opened.edit(json!({"do": "key", "joints": [arm], "time": time})).unwrap();
    }
    opened
}

#[test]
fn a_pose_that_is_not_keyed_stays_at_its_time_until_it_is_keyed_or_discarded() {
    let mut opened = waving();
    let (arm, leg) = (opened.joint("arm.L"), opened.joint("leg.R"));
    let rest = opened.document.pose.clone();
    opened.view(json!({"time": 0.5}));
    let keyed = opened.position("foot.R");
    opened.edit(rotate(leg, 0.6)).unwrap();
    let posed = opened.position("foot.R");
    assert!((posed - keyed).norm() > 0.1);
    assert_eq!(opened.state().unkeyed[0].joints, ["leg.R"], "the arm is where its keys have it");
    opened.view(json!({"time": 0.7}));
    assert!((opened.position("foot.R") - keyed).norm() < 1e-9, "at other times the keys are shown");
    // Another one at another time, and a look at the pose of the document, which is none of both.
    opened.edit(rotate(arm, -0.5)).unwrap();
    opened.view(json!({"tab": "pose", "joint": null}));
    assert!((opened.position("foot.R") - keyed).norm() < 1e-9);
    assert!(opened.document.pose == rest);
    opened.save();
    let mut again = opened.again("person.character.toml");
    again.view(json!({"tab": "animate", "joint": null, "time": 0.5}));
    assert!((again.position("foot.R") - posed).norm() < 1e-9, "it is saved");
    assert_eq!(again.state().unkeyed.iter().map(|pose| pose.time).collect::<Vec<_>>(), [0.5, 0.7]);
    assert_eq!(again.state().clips, ["wave"]);
    again.edit(json!({"do": "key_unkeyed", "time": 0.5})).unwrap();
    again.edit(json!({"do": "discard_unkeyed", "time": 0.7})).unwrap();
    let state = again.state();
    assert!(state.unkeyed.is_empty());
    assert!((again.position("foot.R") - posed).norm() < 1e-9);
    assert_eq!(state.tracks.iter().find(|t| t.joint == leg).unwrap().times, [0.5]);
    let keyed = again.document.clone();
    again.edit(json!({"do": "key_unkeyed", "time": 0.5})).unwrap();
    assert!(again.document == keyed, "everything is keyed");
}

#[test]
fn a_pose_is_keyed_joint_by_joint_and_is_none_where_it_is_rotated_back() {
    let mut opened = waving();
    let (arm, leg) = (opened.joint("arm.L"), opened.joint("leg.R"));
    opened.view(json!({"time": 0.5}));
    opened.edit(rotate(leg, 0.6)).unwrap();
    opened.edit(rotate(arm, -0.3)).unwrap();
    // Without a slice between: the key is of the last pose, not of the last picture.
    opened.edit(json!({"do": "key", "joints": [arm], "time": 0.5})).unwrap();
    assert_eq!(opened.state().unkeyed[0].joints, ["leg.R"]);
    opened.edit(rotate(leg, 0.0)).unwrap();
    assert!(opened.state().unkeyed.is_empty());
    opened.edit(json!({"do": "rename", "joint": leg, "name": "shank.R"})).unwrap();
    opened.edit(rotate(leg, 0.2)).unwrap();
    assert_eq!(opened.state().unkeyed[0].joints, ["shank.R"]);
    // The pose of the clip, with what is not keyed, becomes that of the document.
    let shown = opened.position("foot.R");
    opened.edit(json!({"do": "take_pose"})).unwrap();
    opened.view(json!({"tab": "pose", "joint": null}));
    assert!((opened.position("foot.R") - shown).norm() < 1e-9);
}

#[test]
fn edits_that_come_before_the_next_picture_add_up() {
    let mut opened = Opened::person();
    let (arm, leg) = (opened.joint("arm.L"), opened.joint("leg.R"));
    for edit in [rotate(arm, 0.5), rotate(leg, 0.4)] {
        let step = opened.workspace.edit(&opened.document, serde_json::from_value(edit).unwrap()).unwrap();
        opened.document = step.document;
        opened.workspace.changed(&opened.document);
    }
    assert_eq!(opened.document.pose.joints.len(), 2);
}

#[test]
fn the_character_follows_its_root_and_what_is_pinned_stays() {
    let mut opened = Opened::person();
    let (hips, foot) = (opened.joint("hips"), opened.joint("foot.L"));
    opened.edit(json!({"do": "pin", "joint": foot, "orientation": false})).unwrap();
    let (at, foot, hand) = (opened.position("hips"), opened.position("foot.L"), opened.position("hand.R"));
    let by = nalgebra::Vector3::new(0.02, -0.1, 0.05);
    let to = at + by;
    opened.edit(json!({"do": "drag", "joint": hips, "point": [0, 0, 0], "to": [to.x, to.y, to.z]})).unwrap();
    assert!((opened.position("hips") - to).norm() < 1e-9);
    assert!((opened.position("hand.R") - hand - by).norm() < 1e-9, "the rest of the body goes along");
    assert!((opened.position("foot.L") - foot).norm() < 1e-4, "the foot is pinned");
}

#[test]
fn a_locked_joint_keeps_its_rotation_while_a_hand_is_dragged() {
    let mut opened = Opened::person();
    let (hand, forearm) = (opened.joint("hand.L"), opened.joint("forearm.L"));
    let rotation = |opened: &Opened| opened.workspace.shown.as_ref().unwrap().pose.locals[forearm as usize].rotation;
    let before = rotation(&opened);
    opened.edit(json!({"do": "lock", "joints": [forearm], "locked": true})).unwrap();
    assert!(opened.state().joints[forearm as usize].locked);
    let at = opened.position("hand.L");
    let drag = json!({"do": "drag", "joint": hand, "point": [0, 0, 0], "to": [at.x - 0.2, at.y + 0.2, at.z]});
    opened.edit(drag.clone()).unwrap();
    assert!((opened.position("hand.L") - at).norm() > 0.05, "the arm follows");
    assert!(rotation(&opened).angle_to(&before) < 1e-12);
    opened.save();
    let mut again = opened.again("person.character.toml");
    assert!(again.state().joints[forearm as usize].locked, "it is saved");
    again.edit(json!({"do": "lock", "joints": [forearm], "locked": false})).unwrap();
    again.edit(drag).unwrap();
    assert!(rotation(&again).angle_to(&before) > 1e-3);
    assert!(again.edit(json!({"do": "lock", "joints": [], "locked": true})).is_err());
}

#[test]
fn a_copied_pose_is_pasted_whole_mirrored_and_for_chosen_joints() {
    let mut opened = Opened::person();
    let arm = opened.joint("arm.L");
    opened.edit(rotate(arm, 0.5)).unwrap();
    let hand = opened.position("hand.L");
    let answer = opened.workspace.ask(&opened.document, Ask::CopyPose, &opened.files, &Run::default()).unwrap();
    let Answer::Value(text) = answer else { panic!("a text") };
    opened.edit(json!({"do": "reset_pose"})).unwrap();
    let rest = opened.position("hand.L");
    let paste = |mirrored: bool, joints: Value| json!({"do": "paste_pose", "text": text, "mirrored": mirrored, "joints": joints});
    opened.edit(paste(false, json!([opened.joint("leg.L")]))).unwrap();
    assert!((opened.position("hand.L") - rest).norm() < 1e-9, "only what was chosen");
    opened.edit(paste(false, Value::Null)).unwrap();
    assert!((opened.position("hand.L") - hand).norm() < 1e-9);
    opened.edit(paste(true, Value::Null)).unwrap();
    assert!((opened.position("hand.R") - Point3::new(-hand.x, hand.y, hand.z)).norm() < 1e-6);
    assert!((opened.position("hand.L") - rest).norm() < 1e-9);
    for text in [
        "",
        "{}",
        "{\"format\": \"plumbline.pose\", \"version\": 1, \"joints\": {\"wing\": {\"turn_deg\": [1, 2, 3]}}}",
    ] {
        assert!(opened.edit(json!({"do": "paste_pose", "text": text, "mirrored": false})).is_err(), "{text}");
    }
}

#[test]
fn a_skeleton_of_a_file_is_a_template_and_a_document_may_lose_its_last_joint() {
    let mut opened = Opened::person();
    let names: Vec<String> = opened.state().joints.iter().map(|j| j.name.clone()).collect();
    // The same skeleton, smaller and elsewhere: it is fitted, not taken as it is.
    let mut joints = opened.workspace.rigs.skeleton(&opened.document.skeleton).unwrap().joints().to_vec();
    for joint in &mut joints {
        joint.rest.translation *= 0.5;
    }
    let small =
        SkeletonFile { skeleton: Skeleton::new(joints).unwrap(), curve: None, proposed_names: None, clips: Vec::new() };
    std::fs::write(opened.path("small.json"), small.to_json()).unwrap();
    let head = opened.position("head");
    let label = opened.edit(json!({"do": "template_file", "path": "small.json"})).unwrap();
    assert_eq!(label, "Fit the template small");
    assert_eq!(opened.state().joints.iter().map(|j| j.name.clone()).collect::<Vec<_>>(), names);
    assert!((opened.position("head") - head).norm() < 0.1, "{} {head}", opened.position("head"));
    assert!(opened.edit(json!({"do": "template_file", "path": "../small.json"})).is_err());
    opened.edit(json!({"do": "remove", "joints": [opened.joint("hips")]})).unwrap();
    assert!(opened.state().joints.is_empty() && opened.document.skeleton == SkeletonSource::None);
    opened.save();
    let mut again = opened.again("person.character.toml");
    assert!(again.state().joints.is_empty(), "it is saved so");
    again.edit(json!({"do": "add", "at": [0, 1, 0]})).unwrap();
    assert_eq!(again.state().joints.len(), 1);
}

#[test]
fn a_file_of_weights_is_imported_for_the_skeleton() {
    let mut opened = Opened::person();
    let skeleton = opened.workspace.rigs.skeleton(&opened.document.skeleton).unwrap();
    let vertices = opened.workspace.mesh.vertex_count();
    let rigid = SkinWeights::rigid(skeleton.joint_count(), &vec![0; vertices]).unwrap();
    let file = plumbline_shape::character::WeightsFile::of(&skeleton, &rigid).unwrap();
    std::fs::write(opened.path("rigid.json"), file.to_json()).unwrap();
    opened.edit(json!({"do": "import", "path": "rigid.json"})).unwrap();
    assert_eq!(opened.state().weights.painted, 1);
    assert_eq!(*opened.workspace.known(&opened.document).unwrap().unwrap().weights, rigid);
}

#[test]
fn an_extraction_goes_on_while_letters_come_and_stops_where_its_options_change() {
    let mut opened = Opened::person();
    let options = serde_json::to_value(opened.state().extraction.options).unwrap();
    let extract = |opened: &mut Opened, joints: Value, options: &Value| {
        let edit = json!({"do": "extract", "options": options, "joints": joints});
        opened.document =
            opened.workspace.edit(&opened.document, serde_json::from_value(edit).unwrap()).unwrap().document;
        opened.workspace.changed(&opened.document);
    };
    extract(&mut opened, Value::Null, &options);
    let letters = plumbline_num::run::Interrupt::new();
    letters.stop();
    let run = Run::with_interrupt(&letters);
    let (mut slices, started) = (0, Instant::now());
    while opened.state().joints.is_empty() {
        // Each slice is interrupted at once; views, names of joints to find and saves come between.
        assert_eq!(opened.workspace.work(&opened.document, &mut opened.out, &run).unwrap(), Work::More);
        opened.workspace.view(&opened.document, serde_json::from_value(json!({"tab": "pose"})).unwrap()).unwrap();
        if slices == 2 {
            assert!(opened.state().extraction.running.is_some());
            extract(&mut opened, json!(12), &options);
        }
        slices += 1;
        assert!(started.elapsed().as_secs() < 60, "it comes to its end");
    }
    assert!(slices > 3, "{slices} slices");
    assert_eq!(opened.state().extraction.running, None);
    let mut other = options;
    other["contraction"] = json!(0.5);
    extract(&mut opened, Value::Null, &other);
    opened.workspace.work(&opened.document, &mut opened.out, &run).unwrap();
    assert!(opened.state().extraction.running.is_some());
    other["contraction"] = json!(0.6);
    extract(&mut opened, Value::Null, &other);
    assert_eq!(opened.state().extraction.running, None, "what ran for other options is stopped");
}
