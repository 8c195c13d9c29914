//! The types of messages in TypeScript.

use ts_rs::{Config, TS};

use super::*;

/// All types, in the order of their file.
fn typescript() -> String {
    let cfg = Config::default().with_large_int("number");
    let kinds = [
        BufferKind::Triangles,
        BufferKind::Positions,
        BufferKind::Scalars,
        BufferKind::Selection,
        BufferKind::Owners,
        BufferKind::Energies,
        BufferKind::Frame,
    ];
    let kinds: Vec<String> = kinds.iter().map(|k| format!("{k:?}: {}", k.number())).collect();
    let types = [
        vertices::Combine::decl(&cfg),
        message::HandleKind::decl(&cfg),
        message::KeyId::decl(&cfg),
        message::Edit::decl(&cfg),
        Overlay::decl(&cfg),
        View::decl(&cfg),
        ask::Ask::decl(&cfg),
        MeshInfo::decl(&cfg),
        HandleState::decl(&cfg),
        SelectionState::decl(&cfg),
        SetState::decl(&cfg),
        SolveState::decl(&cfg),
        OverlayState::decl(&cfg),
        State::decl(&cfg),
    ];
    let types: Vec<String> = types.iter().map(|t| format!("export {t}\n")).collect();
    format!(
        "// Messages of the mesh workspace. Written by a test of `src/studio/mesh`: REGENERATE=1 cargo test -p plumbline-studio\n\n\
         /** Kinds of buffers. */\nexport const BufferKind = {{ {} }} as const;\n\n{}",
        kinds.join(", "),
        types.join("\n")
    )
}

#[test]
fn the_types_of_the_page_are_those_of_the_workspace() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("ui/src/generated/mesh.ts");
    let text = typescript();
    if std::env::var_os("REGENERATE").is_some() {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, &text).unwrap();
    }
    let known = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(known == text, "{} is out of date: run the test with REGENERATE=1", path.display());
}
