//! A saved character, run as `plumbline run` does.

use std::sync::atomic::AtomicBool;

use super::*;
use plumbline_app::pipeline::execute::{Backend, execute};
use plumbline_app::pipeline::progress::Silent;
use plumbline_app::pipeline::{Source, read};
use plumbline_app::stages::BuiltinStages;

const PIPELINE: &str = "person.character.toml";

/// The surface that the saved pipeline writes.
fn run(opened: &Opened) -> Vec<Point3<f64>> {
    let text = std::fs::read_to_string(opened.path(PIPELINE)).unwrap();
    let base = Some(opened.folder.path().canonicalize().unwrap());
    let pipeline = read(Source { name: PIPELINE.to_owned(), text, base }, &[]).expect("a pipeline");
    let instances = pipeline.instances().expect("one item");
    let backend = Backend { stages: &BuiltinStages, workers: None };
    let report = execute(&pipeline, &instances, backend, &Silent, &Arc::new(AtomicBool::new(false)));
    assert_eq!(report.failures().map(|(key, e)| format!("{key}: {e}")).collect::<Vec<_>>(), Vec::<String>::new());
    let written = instances[0].outputs().remove(0);
    let model = read_model(&written, &ReadLimits::default(), &Run::default()).unwrap();
    std::fs::remove_file(written).unwrap();
    model.mesh().positions().to_vec()
}

#[test]
fn a_saved_character_run_gives_the_surface_that_was_shown_by_every_method() {
    let mut opened = Opened::person();
    let (hand, foot, spine) = (opened.joint("hand.L"), opened.joint("foot.R"), opened.joint("spine"));
    opened.edit(json!({"do": "pin", "joint": foot, "orientation": true})).unwrap();
    opened.edit(json!({"do": "rotate", "joint": spine, "rotation": [0.0, 0.1, 0.0, 1.0]})).unwrap();
    let at = opened.position("hand.L");
    let to = [at.x - 0.1, at.y + 0.3, at.z + 0.1];
    opened.edit(json!({"do": "drag", "joint": hand, "point": [0, 0, 0], "to": to})).unwrap();
    let at = opened.position("forearm.L");
    opened
        .edit(json!({"do": "paint", "joint": hand, "op": "add", "center": [at.x, at.y, at.z], "radius": 0.3, "strength": 0.4,
                     "value": 1, "mirror": true}))
        .unwrap();
    let rest = opened.workspace.mesh.positions().to_vec();
    let diagonal = opened.workspace.mesh.diagonal();
    let farthest =
        |a: &[Point3<f64>], b: &[Point3<f64>]| a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    for method in ["linear", "dual-quaternion", "centers", "mixed"] {
        opened.edit(json!({"do": "skinning", "method": method})).unwrap();
        let shown = opened.exported();
        opened.save();
        let written = run(&opened);
        assert_eq!(written.len(), shown.len());
        assert!(farthest(&shown, &rest) > 0.05 * diagonal, "{method}: it moves");
        assert!(farthest(&shown, &written) < 1e-6 * diagonal, "{method}: {}", farthest(&shown, &written));
    }
}
