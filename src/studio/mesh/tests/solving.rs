//! Laws of what is shown.

use super::*;

#[test]
fn what_is_shown_at_rest_is_what_the_stage_writes() {
    for method in ["arap", "gauss-newton", "laplacian", "poisson", "primo", "arap-spokes", "arap-elements"] {
        let mut opened = Opened::with_handles();
        opened.edit(json!({"do": "set_option", "name": "method", "value": method})).unwrap();
        opened.rest();
        for k in 1..4 {
            opened.drag(1, [0.2 * f64::from(k), 0.1, -0.3]);
            opened.workspace.work(&opened.document, &mut opened.out, &Run::default()).unwrap();
        }
        opened.rest();
        opened.save();
        let expected = as_the_stage(&opened.path("bar.deform.toml"));
        let shown = opened.workspace.solver.carried_back(opened.workspace.solver.shown());
        assert!(opened.state().solve.exact);
        assert_eq!(farthest(&shown, &expected[0]), 0.0, "{method}");
    }
}

#[test]
fn frames_are_those_of_the_stage_whatever_is_looked_at_between() {
    let mut opened = Opened::with_handles();
    opened
        .edit(json!({"do": "place", "handle": 1, "time": 1.0, "translation": [0.5, 0, 0], "axis": [0, 0, 1], "angle_deg": 200.0}))
        .unwrap();
    opened.edit(json!({"do": "set_frames", "frames": 7})).unwrap();
    for time in [0.3, 0.5, 0.9] {
        opened.workspace.view(&opened.document, View { time: Some(time), overlay: None }).unwrap();
        for _ in 0..4 {
            opened.workspace.work(&opened.document, &mut opened.out, &Run::default()).unwrap();
        }
    }
    opened.rest();
    opened.save();
    let expected = as_the_stage(&opened.path("bar.deform.toml"));
    let frames = opened.workspace.solver.frames().to_vec();
    assert_eq!(frames.len(), 7);
    for (frame, expected) in frames.iter().zip(&expected) {
        assert_eq!(farthest(&opened.workspace.solver.carried_back(frame), expected), 0.0);
    }
    opened.workspace.view(&opened.document, View { time: Some(0.5), overlay: None }).unwrap();
    assert_eq!(farthest(opened.workspace.solver.shown(), &frames[3]), 0.0, "a frame that is solved is shown at once");
}

#[test]
fn a_drag_shows_the_target_at_once_and_keeps_the_factorization() {
    let mut opened = Opened::with_handles();
    opened.rest();
    let prefactored = opened.workspace.solver.prefactored_in;
    opened.out.buffers.clear();
    opened.drag(1, [0.3, 0.0, 0.0]);
    opened.workspace.work(&opened.document, &mut opened.out, &Run::default()).unwrap();
    assert_eq!(opened.workspace.solver.prefactored_in, prefactored);
    assert!(opened.out.buffers.iter().any(|b| b.kind == BufferKind::Positions.number()));
    let v = opened.document.handles[1].mesh.vertices[0] as usize;
    let shown = opened.workspace.solver.carried_back(opened.workspace.solver.shown());
    let rest = opened.workspace.model.mesh().positions();
    assert!((shown[v] - rest[v] - Vector3::new(0.3, 0.0, 0.0)).norm() < 1e-12);
}

#[test]
fn an_interrupted_solve_goes_on_and_ends_at_the_same_surface() {
    use plumbline_num::run::{Interrupt, Stopped};
    let mut opened = Opened::with_handles();
    opened.drag(1, [0.8, 0.0, -0.5]);
    let mut stops = 0;
    let mut letters = 0;
    loop {
        letters += 1;
        let run = Run::with_interrupt(&Interrupt::new());
        if letters % 3 != 0 && letters < 40 {
            run.interrupt.stop();
        }
        match opened.workspace.work(&opened.document, &mut opened.out, &run) {
            Ok(Work::Rest) => break,
            Ok(Work::More) => {}
            Err(StudioError::Stopped(Stopped::Interrupted)) => stops += 1,
            Err(error) => panic!("{error}"),
        }
    }
    assert!(stops > 0);
    opened.save();
    let expected = as_the_stage(&opened.path("bar.deform.toml"));
    let shown = opened.workspace.solver.carried_back(opened.workspace.solver.shown());
    assert_eq!(farthest(&shown, &expected[0]), 0.0);
}

#[test]
fn without_handles_the_surface_is_at_rest_and_exports_as_it_was_read() {
    let mut opened = Opened::with_handles();
    opened.drag(1, [0.8, 0.0, 0.0]);
    opened.rest();
    opened.edit(json!({"do": "delete_handles", "handles": [0, 1]})).unwrap();
    opened.rest();
    let Answer::Download { name, bytes } = opened.ask(json!({"ask": "export", "format": "obj"})).unwrap() else {
        panic!("an export is a file");
    };
    assert_eq!(name, "bar-deformed.obj");
    assert_eq!(String::from_utf8(bytes).unwrap(), opened.text("bar.obj"));
}

#[test]
fn overlays_measure_what_they_say() {
    let mut opened = Opened::with_handles();
    opened.drag(1, [0.0, 0.0, 1.0]);
    for (name, least) in [("distortion", 0.05), ("energy", 1e-6), ("displacement", 0.9), ("flipped", 1.0)] {
        let overlay = serde_json::from_value(json!(name)).unwrap();
        opened.workspace.view(&opened.document, View { time: None, overlay: Some(overlay) }).unwrap();
        opened.out.buffers.clear();
        opened.rest();
        let high = opened.state().overlay.high;
        assert!(high >= least, "{name}: {high}");
        let scalars = opened.out.buffers.iter().rfind(|b| b.kind == BufferKind::Scalars.number()).unwrap();
        assert_eq!(scalars.bytes.len(), 4 * opened.state().mesh.vertices);
    }
    opened.workspace.view(&opened.document, View { time: None, overlay: Some(Overlay::None) }).unwrap();
    opened.rest();
    assert_eq!(opened.state().overlay.high, 0.0);
}

#[test]
fn a_method_that_fails_says_so_and_the_next_edit_tries_again() {
    let mut opened = Opened::with_handles();
    opened.edit(json!({"do": "set_option", "name": "unconstrained", "value": "reject"})).unwrap();
    opened.rest();
    let mut two = shapes::bar(BAR, [1.0, 1.0, 4.0]);
    let count = two.vertex_count() as u32;
    let other = two.positions().iter().map(|p| p + Vector3::x() * 9.0);
    let positions: Vec<_> = two.positions().iter().copied().chain(other).collect();
    let triangles = two.triangles().iter().copied().chain(two.triangles().iter().map(|t| t.map(|v| v + count)));
    two = plumbline_shape::mesh::TriMesh::new(positions, triangles.collect()).unwrap();
    let mut opened = Opened::of(folder_with(&Model::of_mesh(two)), "bar.obj");
    opened.edit(json!({"do": "set_option", "name": "unconstrained", "value": "reject"})).unwrap();
    opened.edit(json!({"do": "select", "vertices": [0]})).unwrap();
    opened.edit(json!({"do": "add_handle", "kind": "fixed"})).unwrap();
    let failed = loop {
        match opened.workspace.work(&opened.document, &mut opened.out, &Run::default()) {
            Ok(work) => assert_eq!(work, Work::More, "it comes to no rest"),
            Err(error) => break error.to_string(),
        }
    };
    assert!(failed.contains("has no handle"), "{failed}");
    assert!(opened.state().solve.error.is_some());
    opened.edit(json!({"do": "set_option", "name": "unconstrained", "value": null})).unwrap();
    opened.rest();
    assert_eq!(opened.state().solve.error, None);
}

#[test]
fn the_command_is_the_pipeline_in_words() {
    let mut opened = Opened::with_handles();
    opened.edit(json!({"do": "set_option", "name": "rotation_estimation", "value": "alternating"})).unwrap();
    opened.edit(json!({"do": "set_option", "name": "method", "value": "laplacian"})).unwrap();
    let Answer::Value(value) = opened.ask(json!({"ask": "command"})).unwrap() else { panic!("a text") };
    let command = value["command"].as_str().unwrap();
    assert!(command.starts_with("plumbline deform "), "{command}");
    assert!(
        command.contains("--method laplacian") && command.contains("--rotation-estimation alternating"),
        "{command}"
    );
    assert!(command.contains("bar.handles.json") && command.contains("bar-deformed.obj"), "{command}");
}

#[test]
fn every_format_is_exported_and_frames_become_one_moving_file_or_an_archive() {
    let mut opened = Opened::with_handles();
    opened.drag(1, [0.2, 0.0, 0.0]);
    for format in ["obj", "ply", "off", "stl", "gltf", "glb"] {
        assert!(
            matches!(opened.ask(json!({"ask": "export", "format": format})), Ok(Answer::Download { .. })),
            "{format}"
        );
    }
    let wrong = opened.ask(json!({"ask": "export", "format": "exe"})).unwrap_err().to_string();
    assert!(wrong.contains("expected obj"), "{wrong}");
    let one = opened.ask(json!({"ask": "export_frames", "format": "glb"})).unwrap_err().to_string();
    assert!(one.contains("one pose"), "{one}");
    opened.edit(json!({"do": "set_frames", "frames": 3})).unwrap();
    for (format, name) in [("glb", "bar-frames.glb"), ("obj", "bar-frames.tar")] {
        let Answer::Download { name: found, .. } =
            opened.ask(json!({"ask": "export_frames", "format": format})).unwrap()
        else {
            panic!("a file");
        };
        assert_eq!(found, name);
    }
}
