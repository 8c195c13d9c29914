//! Laws of edits.

use super::*;

#[test]
fn a_drag_is_one_step_from_where_it_began() {
    let mut opened = Opened::with_handles();
    let at = |opened: &Opened| opened.state().handles[1].translation.unwrap();
    opened.drag(1, [0.5, 0.0, 0.0]);
    opened.drag(1, [0.25, 0.5, 0.0]);
    assert_eq!(at(&opened), [0.25, 0.5, 0.0], "drags of one gesture do not add up");
    opened.drag(2, [1.0, 0.0, 0.0]);
    assert_eq!(at(&opened), [1.25, 0.5, 0.0], "the next gesture starts where the last one ended");
    let edit = |gesture| serde_json::from_value(drag(1, gesture, 1.0, [0.0; 3])).unwrap();
    let keys: Vec<_> = [7, 7, 8].map(|g| opened.workspace.edit(&opened.document, edit(g)).unwrap().merge).to_vec();
    assert_eq!(keys[0], keys[1]);
    assert_ne!(keys[1], keys[2]);
}

#[test]
fn a_rotation_by_hand_goes_on_past_half_a_turn() {
    let mut opened = Opened::with_handles();
    for step in 1..=30 {
        let half = f64::from(step) * 10.0_f64.to_radians() / 2.0;
        let edit = json!({"do": "drag", "handle": 1, "gesture": 3, "time": 1.0, "translation": [0, 0, 0],
                          "rotation": [half.cos(), 0.0, 0.0, half.sin()], "scale": [1, 1, 1]});
        opened.edit(edit).unwrap();
    }
    let handle = &opened.state().handles[1];
    assert!((handle.angle_deg.unwrap() - 300.0).abs() < 1e-9, "{:?}", handle.angle_deg);
    assert!(handle.axis.unwrap()[2] > 0.999);
}

#[test]
fn typed_numbers_are_the_motion_from_rest() {
    let mut opened = Opened::with_handles();
    opened
        .edit(json!({"do": "place", "handle": 1, "time": 1.0, "translation": [0.1, 0.2, 0.3], "axis": [0, 0, 2], "angle_deg": 450.0}))
        .unwrap();
    let handle = &opened.state().handles[1];
    assert_eq!(handle.translation, Some([0.1, 0.2, 0.3]));
    assert!((handle.angle_deg.unwrap() - 450.0).abs() < 1e-9);
    opened.edit(json!({"do": "reset", "handle": 1, "time": 1.0})).unwrap();
    assert_eq!(opened.state().handles[1].translation, Some([0.0; 3]));
}

#[test]
fn scaling_a_rigid_handle_frees_its_vertices_and_keeps_its_keys() {
    let mut opened = Opened::with_handles();
    opened.drag(1, [0.0, 1.0, 0.0]);
    opened
        .edit(json!({"do": "drag", "handle": 1, "gesture": 2, "time": 1.0, "translation": [0, 0, 0],
                     "rotation": [1, 0, 0, 0], "scale": [2, 2, 1]}))
        .unwrap();
    let state = opened.state();
    assert_eq!(state.handles[1].kind, message::HandleKind::Free);
    assert_eq!(state.handles[1].keys, [0.0, 1.0]);
    let handle = &opened.document.handles[1].mesh;
    let rest = opened.workspace.model.mesh().positions();
    let [before, after] = [0.0, 1.0].map(|t| handle.track.positions(&handle.vertices, rest, t));
    let width = |p: &[Point3<f64>]| {
        let x = |f: fn(f64, f64) -> f64, first| p.iter().map(|p| p.x).fold(first, f);
        x(f64::max, f64::MIN) - x(f64::min, f64::MAX)
    };
    assert!((width(&after) / width(&before) - 2.0).abs() < 1e-12);
}

#[test]
fn keys_are_added_moved_and_removed_and_one_is_left() {
    let mut opened = Opened::with_handles();
    opened.drag(1, [1.0, 0.0, 0.0]);
    opened.edit(json!({"do": "add_key", "handle": 1, "time": 0.25})).unwrap();
    let keys = |opened: &Opened| opened.state().handles[1].keys.clone();
    assert_eq!(keys(&opened), [0.0, 0.25, 1.0]);
    opened.edit(json!({"do": "move_keys", "keys": [{"handle": 1, "time": 0.25}], "by": 0.5, "gesture": 9})).unwrap();
    opened.edit(json!({"do": "move_keys", "keys": [{"handle": 1, "time": 0.25}], "by": 0.25, "gesture": 9})).unwrap();
    assert_eq!(keys(&opened), [0.0, 0.5, 1.0], "moves of one gesture do not add up");
    opened
        .edit(json!({"do": "delete_keys", "keys": [{"handle": 1, "time": 0.0}, {"handle": 1, "time": 0.5}]}))
        .unwrap();
    assert_eq!(keys(&opened), [1.0]);
    let last = opened.edit(json!({"do": "delete_keys", "keys": [{"handle": 1, "time": 1.0}]}));
    assert!(last.unwrap_err().to_string().contains("at least one key"));
}

#[test]
fn rings_and_components_do_not_stop_at_seams() {
    let soup = Model::of_mesh(shapes::soup(&shapes::bar(BAR, [1.0, 1.0, 4.0])));
    let mut opened = Opened::of(folder_with(&soup), "bar.obj");
    let count = opened.state().mesh.vertices;
    opened.edit(json!({"do": "select", "vertices": [0]})).unwrap();
    opened.edit(json!({"do": "select_rings", "rings": 1})).unwrap();
    let ring = opened.state().selection.count;
    assert!(ring > 3 && ring < count, "more than the triangle of the vertex, {ring}");
    opened.edit(json!({"do": "select_connected"})).unwrap();
    assert_eq!(opened.state().selection.count, count);
    opened.edit(json!({"do": "select_inverse"})).unwrap();
    assert_eq!(opened.state().selection.count, 0);
}

#[test]
fn selections_combine_and_have_names() {
    let mut opened = Opened::new();
    opened.edit(half_space(2.1, 1.0)).unwrap();
    let upper = opened.state().selection.count;
    opened.edit(json!({"do": "name_selection", "name": "upper"})).unwrap();
    opened.edit(json!({"do": "select_all"})).unwrap();
    opened.edit(json!({"do": "select_set", "name": "upper", "how": "remove"})).unwrap();
    assert_eq!(opened.state().selection.count, opened.state().mesh.vertices - upper);
    opened.edit(json!({"do": "select_set", "name": "upper", "how": "intersect"})).unwrap();
    assert_eq!(opened.state().selection.count, 0);
    opened.edit(json!({"do": "rename_set", "from": "upper", "to": "head"})).unwrap();
    assert_eq!(opened.state().sets[0].name, "head");
}

#[test]
fn a_vertex_is_in_one_handle() {
    let mut opened = Opened::with_handles();
    let of_foot = opened.state().handles[0].vertices;
    opened.edit(json!({"do": "select_all"})).unwrap();
    opened.edit(json!({"do": "add_handle", "kind": "free"})).unwrap();
    let state = opened.state();
    let total: usize = state.handles.iter().map(|h| h.vertices).sum();
    assert_eq!((total, state.handles[0].vertices), (state.mesh.vertices, of_foot));
    opened.edit(json!({"do": "select_handle", "handle": 0})).unwrap();
    let none = opened.edit(json!({"do": "add_handle", "kind": "fixed"})).unwrap_err().to_string();
    assert!(none.contains("in another handle"), "{none}");
}

#[test]
fn hostile_edits_are_refused_and_the_document_stays() {
    let mut opened = Opened::with_handles();
    let before = opened.document.clone();
    let huge = 1e300;
    let cases = [
        (json!({"do": "select", "vertices": [99_999]}), "no vertex 99999"),
        (json!({"do": "select", "vertices": [-1]}), "invalid value"),
        (json!({"do": "explode"}), "unknown variant"),
        (json!({"do": "reset", "handle": 0, "time": 1.0, "and": 1}), "unknown field"),
        (json!({"do": "select_half_space", "point": [0, 0, 0], "normal": [0, 0, 0]}), "no direction"),
        (json!({"do": "rename_handle", "handle": 7, "name": "x"}), "no handle 7 of 2"),
        (json!({"do": "rename_handle", "handle": 0, "name": "  "}), "1 to 200"),
        (json!({"do": "set_weight", "handle": 0, "weight": -1}), "expected above 0"),
        (drag(0, 1, 1.0, [1.0, 0.0, 0.0]), "is fixed"),
        (drag(1, 1, huge, [1.0, 0.0, 0.0]), "the time"),
        (drag(1, 1, 1.0, [huge, 0.0, 0.0]), "the motion is invalid"),
        (json!({"do": "set_option", "name": "method", "value": "magic"}), "magic"),
        (json!({"do": "set_option", "name": "tolerance", "value": 7.0}), "tolerance"),
        (json!({"do": "set_option", "name": "handles", "value": "/etc/passwd"}), "not set here"),
        (json!({"do": "set_option", "name": "roi", "value": [1]}), "is a number"),
        (json!({"do": "set_frames", "frames": 0}), "frames"),
        (json!({"do": "set_output", "name": "../x.obj"}), "file name"),
        (json!({"do": "move_keys", "keys": [{"handle": 1, "time": 1.0}], "by": huge, "gesture": 1}), "the time"),
        (json!({"do": "delete_handles", "handles": []}), "no handle"),
        (json!({"do": "select_set", "name": "nobody"}), "no set"),
    ];
    for (edit, word) in cases {
        let error = opened.edit(edit.clone()).expect_err(&edit.to_string()).to_string();
        assert!(error.contains(word), "{edit}: {error}");
        assert_eq!(opened.document, before, "{edit}");
    }
}

#[test]
fn undo_of_200_drags_gives_the_same_files_byte_for_byte() {
    let mut opened = Opened::with_handles();
    let mut history = vec![opened.document.clone()];
    let files = |document: &MeshDocument| (document.pipeline.text().to_owned(), handle_text::write(document));
    let mut texts = vec![files(&opened.document)];
    for k in 1..=200_u32 {
        opened.drag(k, [0.01 * f64::from(k % 7), 0.02, -0.01]);
        history.push(opened.document.clone());
        texts.push(files(&opened.document));
    }
    for (document, text) in history.into_iter().zip(&texts).rev() {
        opened.go(document);
        assert_eq!(files(&opened.document), *text);
    }
    opened.rest();
    let rest = opened.workspace.solver.solvable.mesh.positions().to_vec();
    assert!(farthest(opened.workspace.solver.shown(), &rest) < 1e-6, "before the first drag the surface is at rest");
}
