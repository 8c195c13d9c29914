//! Which content files have.

use super::*;

fn media(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../media").join(name)
}

#[test]
fn files_of_media_are_told_apart() {
    for (name, expected) in [
        ("giraffe.ply", Content::Mesh),
        ("mesh-moebius.off", Content::Mesh),
        ("mesh-hourglass.stl", Content::Mesh),
        ("mesh-polygons.obj", Content::Mesh),
        ("mesh-outside.gltf", Content::Mesh),
        ("humanoid.glb", Content::Character),
        ("street-fisheye.jpg", Content::Photo),
    ] {
        assert_eq!(Content::of(&media(name)).expect(name), expected, "{name}");
    }
    for name in ["street-walk.mp4", "room-eucm.lens.json", "missing.ply", ""] {
        assert!(Content::of(&media(name)).is_err(), "{name}");
    }
}

#[test]
fn an_fbx_file_with_a_skin_is_a_character() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("a.fbx");
    for (body, expected) in [(b"S\x07\0\0\0Cluster", Content::Character), (b"S\x07\0\0\0Clutter", Content::Mesh)] {
        std::fs::write(&path, [b"Kaydara FBX Binary  \0\x1a\0".as_slice(), body].concat()).expect("written");
        assert_eq!(Content::of(&path).expect("known"), expected);
    }
}

#[test]
fn a_pipeline_is_known_by_its_stages() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("a.toml");
    std::fs::write(&path, "version = 1\n[stage.a]\nuse = \"mesh.load\"\n[stage.b]\nuse = \"mesh.deform\"\n")
        .expect("written");
    let content = Content::of(&path).expect("a pipeline");
    assert_eq!(content, Content::Pipeline(vec!["mesh.load".into(), "mesh.deform".into()]));
    assert!(content.has_stage(&["mesh.deform"]) && !content.has_stage(&["character.", "skin."]));
    std::fs::write(&path, "stage = 3").expect("written");
    assert_eq!(Content::of(&path).expect("TOML"), Content::Pipeline(Vec::new()));
    for bad in [b"a = ".as_slice(), b"\xff"] {
        std::fs::write(&path, bad).expect("written");
        assert!(Content::of(&path).is_err());
    }
}
