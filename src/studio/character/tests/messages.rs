//! The types of the messages, for the page.

use std::fmt::Write as _;
use std::path::Path;

use ts_rs::{Config, TS};

use super::super::message::*;

/// The text of `ui/src/generated/character.ts`.
fn text() -> String {
    let mut text = "// Messages of the character workspace. Written by a test of `src/studio/character`: REGENERATE=1 cargo test -p plumbline-studio\n\n\
                    export type V3 = [number, number, number];\nexport type Q4 = [number, number, number, number];\n"
        .to_owned();
    let config = Config::default();
    macro_rules! declare {
        ($($t:ty),*) => { $( let _ = writeln!(text, "\nexport {}", <$t>::decl(&config)); )* };
    }
    declare!(
        BrushOp,
        WeightMethod,
        SkinningMethod,
        InterpolationKind,
        ExtractionOptions,
        EndsWord,
        Ends,
        Limits,
        TargetKind,
        Target,
        Edit,
        Tab,
        View,
        Format,
        Ask,
        MeshState,
        JointState,
        Track,
        ExtractionState,
        WeightsState,
        Compared,
        ModelState,
        UnkeyedState,
        RunState,
        State
    );
    text.push_str("\n/** Kinds of buffers. */\nexport const KINDS = {\n");
    let kinds = [
        ("triangles", BufferKind::Triangles),
        ("rest", BufferKind::Rest),
        ("skinJoints", BufferKind::SkinJoints),
        ("skinWeights", BufferKind::SkinWeights),
        ("restFrames", BufferKind::RestFrames),
        ("posedFrames", BufferKind::PosedFrames),
        ("heat", BufferKind::Heat),
        ("positions", BufferKind::Positions),
        ("onion", BufferKind::Onion),
        ("compared", BufferKind::Compared),
    ];
    for (name, kind) in kinds {
        let _ = writeln!(text, "  {name}: {},", kind.number());
    }
    text.push_str("} as const;\n");
    text
}

#[test]
fn the_types_of_the_page_are_those_of_the_messages() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("ui/src/generated/character.ts");
    let text = text();
    if std::env::var_os("REGENERATE").is_some() {
        std::fs::write(&path, &text).unwrap();
    }
    let known = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(known == text, "{} is out of date: run the test with REGENERATE=1", path.display());
}
