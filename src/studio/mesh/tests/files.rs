//! Laws of opening and saving.

use super::*;

#[test]
fn what_is_saved_opens_as_the_same_document() {
    let mut opened = Opened::with_handles();
    opened.drag(1, [0.4, 0.1, 0.0]);
    opened.edit(json!({"do": "set_interpolation", "handle": 1, "smooth": true})).unwrap();
    opened.edit(json!({"do": "set_weight", "handle": 0, "weight": 2.5})).unwrap();
    opened.edit(half_space(1.0, 1.0)).unwrap();
    opened.edit(json!({"do": "name_selection", "name": "upper part"})).unwrap();
    opened.edit(json!({"do": "region_from_selection"})).unwrap();
    opened.edit(json!({"do": "select_none"})).unwrap();
    opened.edit(json!({"do": "set_frames", "frames": 5})).unwrap();
    opened.save();
    let saved = opened.document.clone();
    for name in ["bar.deform.toml", "bar.obj"] {
        let mut again = Opened::of(copied(&opened), name);
        let (a, b) = (&saved, &again.document);
        assert_eq!(a.pipeline.text(), b.pipeline.text());
        assert_eq!(a.mesh_handles(), b.mesh_handles());
        assert_eq!(a.sets["upper part"].vertices, b.sets["upper part"].vertices);
        again.save();
        assert_eq!(again.text("bar.handles.json"), opened.text("bar.handles.json"), "saving again changes nothing");
    }
}

fn copied(opened: &Opened) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for entry in std::fs::read_dir(opened.folder.path()).unwrap() {
        let entry = entry.unwrap();
        std::fs::copy(entry.path(), folder.path().join(entry.file_name())).unwrap();
    }
    folder
}

#[test]
fn comments_variables_and_other_stages_stay() {
    let folder = folder_with(&bar());
    let text = "# my bar\nversion = 1\n\n[vars]\nmesh = \"bar.obj\"   # the one with the dent\n\n\
                [stage.mesh]\nuse = \"mesh.load\"\npath = \"${vars.mesh}\"\n\n\
                [stage.bent]\nuse = \"mesh.deform\"\ninputs = [\"mesh\"]\nhandles = \"grips.json\"\n\
                method = \"arap\"   # try primo\n\n\
                [stage.drawn]\nuse = \"mesh.render\"\ninputs = [\"bent\"]\n\n\
                [stage.picture]\nuse = \"image.save\"\ninputs = [\"drawn\"]\npath = \"bar.png\"\n";
    std::fs::write(folder.path().join("mine.toml"), text).unwrap();
    std::fs::write(
        folder.path().join("grips.json"),
        r#"{"format": "plumbline.handles", "version": 1, "sets": {"low": {"half_space": {"point": [0, 0, 0.1], "normal": [0, 0, -1]}}},
            "handles": [{"name": "foot", "vertices": "low"},
                        {"vertices": {"half_space": {"point": [0, 0, 3.9], "normal": [0, 0, 1]}}, "rigid": {"translation": [1, 0, 0]}}]}"#,
    )
    .unwrap();
    let mut opened = Opened::of(folder, "mine.toml");
    assert_eq!(opened.state().handles.len(), 2);
    opened.edit(json!({"do": "set_option", "name": "method", "value": "primo"})).unwrap();
    opened.edit(drag(1, 1, 1.0, [0.0, 0.5, 0.0])).unwrap();
    opened.save();
    assert_eq!(opened.text("mine.toml"), text.replace("method = \"arap\" ", "method = \"primo\" "));
    let handles: Value = serde_json::from_str(&opened.text("grips.json")).unwrap();
    assert_eq!(handles["handles"][0]["vertices"], "low", "vertices stay as they were described");
    assert!(handles["handles"][1]["vertices"]["half_space"].is_object());
    assert!(handles["sets"]["low"]["half_space"].is_object());
    opened.edit(json!({"do": "delete_set", "name": "low"})).unwrap();
    opened.save();
    let handles: Value = serde_json::from_str(&opened.text("grips.json")).unwrap();
    assert!(handles["handles"][0]["vertices"]["indices"].is_array(), "a set that is gone is named by nobody");
}

#[test]
fn what_is_no_deformation_is_refused_with_the_reason() {
    let cases = [
        ("version = 1\n", "no stage"),
        (
            "version = 1\n[stage.mesh]\nuse = \"mesh.load\"\npath = \"bar.obj\"\n[stage.out]\nuse = \"mesh.save\"\ninputs = [\"mesh\"]\npath = \"x.obj\"\n",
            "no stage mesh.deform",
        ),
        ("version = 1\n[stage.mesh]\nuse = \"mesh.lode\"\n", "line"),
        ("version = ", "line 1"),
    ];
    for (text, word) in cases {
        let folder = folder_with(&bar());
        std::fs::write(folder.path().join("x.toml"), text).unwrap();
        let path = folder.path().canonicalize().unwrap().join("x.toml");
        let error =
            MeshWorkspace::open(&mut DocumentFiles::new(path, std::collections::BTreeMap::default()), &Run::default());
        let error = error.expect_err(text).to_string();
        assert!(error.contains(word), "{text}: {error}");
    }
}

#[test]
fn a_mesh_that_is_not_finite_or_empty_is_refused_with_its_path() {
    for (text, word) in [("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "bad.obj"), ("v 0 0 0\n", "bad.obj")] {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("bad.obj"), text).unwrap();
        let path = folder.path().canonicalize().unwrap().join("bad.obj");
        let error =
            MeshWorkspace::open(&mut DocumentFiles::new(path, std::collections::BTreeMap::default()), &Run::default());
        let error = error.expect_err(text).to_string();
        assert!(error.contains(word), "{error}");
    }
}

#[test]
fn handles_of_another_mesh_are_refused_with_the_file_that_has_them() {
    let folder = folder_with(&bar());
    std::fs::write(
        folder.path().join("bar.handles.json"),
        r#"{"format": "plumbline.handles", "version": 1, "handles": [{"vertices": [999999]}]}"#,
    )
    .unwrap();
    let path = folder.path().canonicalize().unwrap().join("bar.obj");
    let error =
        MeshWorkspace::open(&mut DocumentFiles::new(path, std::collections::BTreeMap::default()), &Run::default());
    let error = error.expect_err("no such vertex").to_string();
    assert!(error.contains("bar.handles.json") && error.contains("999999"), "{error}");
}
