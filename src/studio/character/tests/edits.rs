//! Edits, files, hostile messages.

use super::*;

fn rotate(joint: u32, angle: f64) -> Value {
    json!({"do": "rotate", "joint": joint, "rotation": [0.0, 0.0, (0.5 * angle).sin(), (0.5 * angle).cos()]})
}

#[test]
fn a_skeleton_is_made_by_hand_and_every_edit_is_undone_by_its_document() {
    let mut opened = Opened::bar();
    assert!(opened.state().joints.is_empty());
    let mut history = vec![opened.document.clone()];
    let edits = [
        json!({"do": "add_along", "origin": [-5, 0.5, 1], "direction": [1, 0, 0]}),
        json!({"do": "extrude", "joint": 0, "at": [0.5, 0.5, 3]}),
        json!({"do": "extrude", "joint": 1, "at": [0.5, 0.5, 5]}),
        json!({"do": "split", "joint": 2, "fraction": 0.5}),
        json!({"do": "rename", "joint": 0, "name": "hip"}),
        json!({"do": "move", "joint": 1, "to": [0.6, 0.5, 3], "with_children": false}),
        json!({"do": "dissolve", "joints": [3]}),
    ];
    for edit in edits {
        opened.edit(edit.clone()).unwrap_or_else(|e| panic!("{edit}: {e}"));
        history.push(opened.document.clone());
    }
    let state = opened.state();
    assert_eq!(state.joints.iter().map(|j| j.parent).collect::<Vec<_>>(), [None, Some(0), Some(1)]);
    assert_eq!(state.joints[0].name, "hip");
    let at = opened.position("hip");
    assert!((at - Point3::new(0.5, 0.5, 1.0)).norm() < 1e-9, "in the middle of the volume: {at}");
    for document in history.iter().rev() {
        opened.document = document.clone();
        opened.workspace.changed(&opened.document);
        opened.rest();
    }
    assert!(opened.state().joints.is_empty());
}

#[test]
fn a_saved_pose_gives_the_same_surface_when_it_is_opened_again() {
    let mut opened = Opened::person();
    let (hand, foot) = (opened.joint("hand.L"), opened.joint("foot.R"));
    opened.edit(json!({"do": "pin", "joint": foot, "orientation": false})).unwrap();
    let at = opened.position("hand.L");
    opened
        .edit(json!({"do": "drag", "joint": hand, "point": [0, 0, 0], "to": [at.x - 0.1, at.y + 0.3, at.z + 0.1]}))
        .unwrap();
    let spine = opened.joint("spine");
    opened.edit(rotate(spine, 0.3)).unwrap();
    let shown = opened.exported();
    let names = ["person.character.toml", "person.pose.json", "person.weights.json", "person.skeleton.json"];
    opened.save();
    assert!(names.iter().all(|name| opened.path(name).exists()));
    let diagonal = opened.workspace.mesh.diagonal();
    let mut again = opened.again("person.character.toml");
    let far = shown.iter().zip(again.exported()).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    assert!(far < 1e-9 * diagonal, "{far}");
}

#[test]
fn a_drag_brings_the_hand_to_the_pointer_keeps_bones_and_pins_and_goes_on_from_rotations() {
    let mut opened = Opened::person();
    let (hand, foot, arm) = (opened.joint("hand.L"), opened.joint("foot.L"), opened.joint("arm.L"));
    opened.edit(json!({"do": "pin", "joint": foot, "orientation": false})).unwrap();
    let before = opened.position("foot.L");
    opened.edit(rotate(arm, 0.4)).unwrap();
    let (turned, elbow) = (opened.position("hand.L"), opened.position("forearm.L"));
    let length = (turned - elbow).norm();
    let to = turned + nalgebra::Vector3::new(-0.02, 0.03, 0.02);
    opened.edit(json!({"do": "drag", "joint": hand, "point": [0, 0, 0], "to": [to.x, to.y, to.z]})).unwrap();
    assert!((opened.position("hand.L") - to).norm() < 1e-4, "{}", opened.position("hand.L"));
    let now = (opened.position("hand.L") - opened.position("forearm.L")).norm();
    assert!((now - length).abs() < 1e-9, "bones keep their lengths");
    assert!((opened.position("foot.L") - before).norm() < 1e-4, "the foot is pinned");
}

#[test]
fn weights_are_painted_in_rows_that_sum_to_one_and_survive_a_new_joint() {
    let mut opened = Opened::person();
    let arm = opened.joint("forearm.L");
    let at = opened.position("forearm.L");
    let paint = json!({"do": "paint", "joint": arm, "op": "add", "center": [at.x, at.y, at.z], "radius": 0.2, "strength": 0.5,
        "value": 1, "mirror": true});
    let before = opened.workspace.known(&opened.document).unwrap().unwrap().weights;
    opened.edit(paint).unwrap();
    let painted = opened.workspace.known(&opened.document).unwrap().unwrap().weights;
    assert!(painted.sums().all(|s| (s - 1.0).abs() < 1e-9));
    let other = opened.joint("forearm.R");
    let more = |j: u32| (0..painted.vertex_count()).any(|v| painted.weight(v, j) > before.weight(v, j) + 1e-3);
    assert!(more(arm) && more(other), "both sides");
    assert_eq!(opened.state().weights.painted, 1);
    opened.edit(json!({"do": "extrude", "joint": arm, "at": [at.x, at.y, at.z + 0.1]})).unwrap();
    let grown = opened.workspace.known(&opened.document).unwrap().unwrap().weights;
    assert_eq!(grown.joint_count(), painted.joint_count() + 1);
    assert!(grown.sums().all(|s| (s - 1.0).abs() < 1e-9));
}

#[test]
fn keys_play_the_poses_that_were_keyed_and_are_moved_and_removed() {
    let mut opened = Opened::person();
    let arm = opened.joint("arm.L");
    opened.view(json!({"tab": "animate", "joint": null}));
    opened.view(json!({"time": 0.0}));
    opened.edit(json!({"do": "add_clip", "name": "wave"})).unwrap();
    opened.edit(json!({"do": "key", "joints": [arm], "time": 0.0})).unwrap();
    opened.view(json!({"time": 1.0}));
    opened.edit(rotate(arm, 0.8)).unwrap();
    let posed = opened.position("hand.L");
    opened.edit(json!({"do": "key", "joints": [arm], "time": 1.0})).unwrap();
    assert!((opened.position("hand.L") - posed).norm() < 1e-9, "the key is the pose that was shown");
    opened.view(json!({"time": 0.0}));
    assert!((opened.position("hand.L") - posed).norm() > 0.05, "at the first key it rests");
    assert_eq!(opened.state().tracks[0].times, [0.0, 1.0]);
    opened.edit(json!({"do": "move_keys", "keys": [[arm, 1.0]], "by": 0.5})).unwrap();
    assert_eq!((opened.state().tracks[0].times.clone(), opened.state().duration), (vec![0.0, 1.5], 1.5));
    opened.save();
    let mut again = opened.again("person.character.toml");
    assert_eq!(again.state().clips, ["wave"]);
    again.edit(json!({"do": "remove_keys", "keys": [[arm, 0.0], [arm, 1.5]]})).unwrap();
    assert!(again.state().tracks.is_empty());
}

#[test]
fn a_pose_of_the_library_comes_back_and_a_mirrored_pose_twice_is_itself() {
    let mut opened = Opened::person();
    let arm = opened.joint("arm.L");
    opened.edit(rotate(arm, 0.5)).unwrap();
    let hand = opened.position("hand.L");
    opened.edit(json!({"do": "store_pose", "name": "up"})).unwrap();
    opened.edit(json!({"do": "mirror_pose"})).unwrap();
    let other = opened.position("hand.R");
    assert!((other - Point3::new(-hand.x, hand.y, hand.z)).norm() < 1e-6, "{other} {hand}");
    opened.edit(json!({"do": "mirror_pose"})).unwrap();
    assert!((opened.position("hand.L") - hand).norm() < 1e-9);
    opened.edit(json!({"do": "reset_pose"})).unwrap();
    opened.save();
    let mut again = opened.again("person.character.toml");
    again.edit(json!({"do": "apply_pose", "name": "up"})).unwrap();
    assert!((again.position("hand.L") - hand).norm() < 1e-9);
}

#[test]
fn messages_that_do_not_fit_change_nothing_and_say_why() {
    let mut opened = Opened::person();
    let before = opened.document.clone();
    let bad = [
        json!({"do": "rotate", "joint": 999, "rotation": [0, 0, 0, 1]}),
        json!({"do": "rotate", "joint": 0, "rotation": [0, 0, 0, 0]}),
        json!({"do": "drag", "joint": 0, "point": [0, 0, 0], "to": [null, 0, 0]}),
        json!({"do": "reparent", "joints": [0], "parent": 1}),
        json!({"do": "rename", "joint": 0, "name": ""}),
        json!({"do": "rename", "joint": 0, "name": "x".repeat(10_000)}),
        json!({"do": "paint", "joint": 0, "op": "add", "center": [0, 0, 0], "radius": -1, "strength": 1, "value": 1, "mirror": false}),
        json!({"do": "influences", "max": 0}),
        json!({"do": "compute_weights", "method": "heat", "influences": 4_000_000_000_u32, "smooth": 0}),
        json!({"do": "key", "joints": [0], "time": -1}),
        json!({"do": "apply_pose", "name": "none"}),
        json!({"do": "template", "name": "dragon"}),
        json!({"do": "remove_target", "index": 7}),
        json!({"do": "import", "path": "/etc/passwd"}),
        json!({"do": "import", "path": "../other.bvh"}),
        json!({"do": "fly"}),
        json!({"do": "split", "joint": 1, "fraction": 2}),
    ];
    for edit in bad {
        let error = opened.edit(edit.clone()).expect_err(&edit.to_string());
        assert!(!error.to_string().is_empty());
        assert!(opened.document == before, "{edit}");
    }
}

#[test]
fn a_skeleton_file_with_a_cycle_is_refused_with_its_path() {
    let folder = tempfile::tempdir().unwrap();
    let bar = Model::of_mesh(shapes::bar([2, 2, 12], [1.0, 1.0, 6.0]));
    write_model(&folder.path().join("bar.obj"), &bar).unwrap();
    let joint = |name: &str, parent: &str| json!({"name": name, "parent": parent, "translation": [0, 0, 0]});
    let cycle = json!({"format": "plumbline.skeleton", "version": 1, "joints": [joint("a", "b"), joint("b", "a")]});
    std::fs::write(folder.path().join("bar.skeleton.json"), cycle.to_string()).unwrap();
    let mut files = DocumentFiles::new(
        folder.path().canonicalize().unwrap().join("bar.obj"),
        std::collections::BTreeMap::default(),
    );
    let error = CharacterWorkspace::open(&mut files, &Run::default()).map(drop).expect_err("a cycle").to_string();
    assert!(error.contains("bar.skeleton.json"), "{error}");
}

#[test]
fn a_character_is_begun_for_a_mesh_by_the_name_of_its_pipeline_file() {
    let folder = tempfile::tempdir().unwrap();
    let bar = Model::of_mesh(shapes::bar([2, 2, 12], [1.0, 1.0, 6.0]));
    write_model(&folder.path().join("bar.ply"), &bar).unwrap();
    let opened = Opened::of(folder, "bar.character.toml");
    assert_eq!(opened.state().mesh.vertices, bar.mesh().vertex_count());
    let mut files = DocumentFiles::new(opened.path("none.character.toml"), std::collections::BTreeMap::default());
    assert!(CharacterWorkspace::open(&mut files, &Run::default()).is_err());
}

#[test]
fn a_document_whose_skeleton_is_still_sought_says_so_and_is_saved_afterwards() {
    let mut opened = Opened::bar();
    let state = opened.state();
    let options = serde_json::to_value(state.extraction.options).unwrap();
    let edit = serde_json::from_value(json!({"do": "extract", "options": options})).unwrap();
    opened.document = opened.workspace.edit(&opened.document, edit).unwrap().document;
    opened.workspace.changed(&opened.document);
    let refused = opened.workspace.save(&opened.document, &mut opened.files);
    assert!(matches!(refused, Err(StudioError::NotReady(_))), "{refused:?}");
    opened.rest();
    opened.save();
    assert!(opened.path("bar.skeleton.json").exists() && !opened.state().joints.is_empty());
}
