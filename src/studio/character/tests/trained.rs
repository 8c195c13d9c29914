//! Skins that were trained on example poses.

use super::runs::{farthest, run};
use super::*;
use plumbline_shape::character::regression::{Example, RegressionModel, RegressionOptions, SkinModel};

/// A skin of the person, trained on arms that swell as they bend.
fn trained(opened: &Opened) -> SkinModel {
    let mesh = &opened.workspace.mesh;
    let skeleton = opened.workspace.rigs.skeleton(&opened.document.skeleton).unwrap();
    let weights = opened.workspace.rigs.weights(&opened.document.weights, &skeleton).unwrap();
    let skin = Skin::bound((*weights).clone(), &skeleton).unwrap();
    let example = |k: usize| {
        let mut pose = skeleton.rest_pose();
        let angle = 0.25 * k as f64;
        let joint = skeleton.named("forearm.L").unwrap() as usize;
        pose.locals[joint].rotation *= nalgebra::UnitQuaternion::from_axis_angle(&nalgebra::Vector3::y_axis(), angle);
        let matrices = skin.joint_matrices(&skeleton.globals(&pose).unwrap()).unwrap();
        let method = plumbline_shape::character::skinning::SkinningMethod::LinearBlend;
        let skinner =
            plumbline_shape::character::skinning::Skinner::new(mesh, None, &skeleton, &skin, method, &Run::default());
        let mut positions = skinner.unwrap().positions(&matrices).unwrap();
        for (p, rest) in positions.iter_mut().zip(mesh.positions()) {
            let near = (-((rest.x - 0.4) / 0.1).powi(2)).exp();
            p.z += 0.1 * angle * near * (rest.z - p.z.min(0.0)).abs().min(0.3);
        }
        Example { matrices, positions }
    };
    let examples: Vec<Example> = (0..4).map(example).collect();
    let options = RegressionOptions::default();
    let (model, _) = RegressionModel::train(mesh, &skeleton, &weights, &examples, &options, &Run::default()).unwrap();
    SkinModel::of(mesh, &skeleton, &model).unwrap()
}

fn bend(opened: &mut Opened) {
    let joint = opened.joint("forearm.L");
    opened.edit(json!({"do": "rotate", "joint": joint, "rotation": [0.0, 0.3, 0.0, 0.95]})).unwrap();
}

#[test]
fn a_trained_skin_is_imported_compared_followed_and_run_as_it_was_shown() {
    let mut opened = Opened::person();
    std::fs::write(opened.path("learnt.skin"), trained(&opened).to_bytes()).unwrap();
    bend(&mut opened);
    assert!(opened.state().model.is_none());
    let refused = opened.edit(json!({"do": "skinning", "method": "regression"})).unwrap_err().to_string();
    assert!(refused.contains("skin train"), "{refused}");
    opened.edit(json!({"do": "import", "path": "learnt.skin"})).unwrap();
    opened.view(json!({"tab": "compare", "joint": null}));
    let state = opened.state();
    assert_eq!(state.compare.iter().map(|c| c.method).next_back(), Some(SkinningMethod::Regression));
    assert_eq!((state.model.unwrap().fault, state.skinning), (None, SkinningMethod::DualQuaternion));
    let blended = opened.exported();
    opened.edit(json!({"do": "skinning", "method": "regression"})).unwrap();
    let (shown, diagonal) = (opened.exported(), opened.workspace.mesh.diagonal());
    assert!(farthest(&shown, &blended) > 1e-4 * diagonal, "it is another surface");
    opened.save();
    assert!(opened.path("person.skin").exists());
    assert!(farthest(&shown, &run(&opened)) < 1e-6 * diagonal);
    // The same files in a new session, and the skin kept where another method is chosen.
    let mut again = opened.again("person.character.toml");
    assert_eq!(again.state().skinning, SkinningMethod::Regression);
    assert!(farthest(&shown, &again.exported()) < 1e-9 * diagonal);
    again.edit(json!({"do": "skinning", "method": "linear"})).unwrap();
    again.save();
    let third = again.again("person.character.toml");
    assert_eq!(third.state().skinning, SkinningMethod::Linear);
    assert_eq!(third.state().model.map(|m| m.name).as_deref(), Some("person.skin"));
}

#[test]
fn a_trained_skin_of_other_joints_or_another_mesh_is_refused_and_one_that_fits_no_more_is_left() {
    let mut opened = Opened::person();
    std::fs::write(opened.path("learnt.skin"), trained(&opened).to_bytes()).unwrap();
    std::fs::write(opened.path("broken.skin"), b"plumbline.skin").unwrap();
    let error = opened.edit(json!({"do": "import", "path": "broken.skin"})).unwrap_err().to_string();
    assert!(error.contains("broken.skin") && error.contains("not a trained skin"), "{error}");
    opened.edit(json!({"do": "import", "path": "learnt.skin"})).unwrap();
    opened.edit(json!({"do": "skinning", "method": "regression"})).unwrap();
    let before = opened.document.clone();
    let hand = opened.joint("hand.L");
    let label = opened.edit(json!({"do": "rename", "joint": hand, "name": "wrist.L"})).unwrap();
    assert!(label.contains("does not fit any more"), "{label}");
    let state = opened.state();
    assert_eq!(state.skinning, SkinningMethod::DualQuaternion);
    assert!(state.model.unwrap().fault.unwrap().contains("hand.L"));
    let error = opened.edit(json!({"do": "import", "path": "learnt.skin"})).unwrap_err().to_string();
    assert!(error.contains("hand.L"), "{error}");
    opened.document = before;
    opened.workspace.changed(&opened.document);
    opened.rest();
    assert_eq!(opened.state().model.unwrap().fault, None, "undone");
    // The same skin beside another mesh: opened without it, and told.
    let mut bar = Opened::bar();
    std::fs::copy(opened.path("learnt.skin"), bar.path("bar.skin")).unwrap();
    bar.edit(json!({"do": "add", "at": [0.5, 0.5, 1]})).unwrap();
    bar.save();
    let bar = bar.again("bar.character.toml");
    assert!(bar.state().model.is_none());
    let named = bar.path("named.character.toml");
    let text = bar.document.pipeline.text();
    let text =
        text.replace("\"character.pose\"", "\"character.pose\"\nskinning = \"regression\"\nmodel = \"bar.skin\"");
    std::fs::write(&named, text).unwrap();
    let mut files = DocumentFiles::new(named, std::collections::BTreeMap::default());
    let error =
        CharacterWorkspace::open(&mut files, &Run::default()).map(drop).expect_err("of another mesh").to_string();
    assert!(error.contains("bar.skin") && error.contains("vertices"), "{error}");
}
