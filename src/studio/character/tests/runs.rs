//! A saved character, run as `plumbline run` does.

use std::sync::atomic::AtomicBool;

use super::*;
use plumbline_app::pipeline::execute::{Backend, execute};
use plumbline_app::pipeline::progress::Silent;
use plumbline_app::pipeline::{Source, read};
use plumbline_app::stages::BuiltinStages;

const PIPELINE: &str = "person.character.toml";

/// The surfaces that the saved pipeline writes.
pub(super) fn run_all(opened: &Opened) -> Vec<Vec<Point3<f64>>> {
    let text = std::fs::read_to_string(opened.path(PIPELINE)).unwrap();
    let base = Some(opened.folder.path().canonicalize().unwrap());
    let pipeline = read(Source { name: PIPELINE.to_owned(), text, base }, &[]).expect("a pipeline");
    let instances = pipeline.instances().expect("one item");
    let backend = Backend { stages: &BuiltinStages, workers: None };
    let report = execute(&pipeline, &instances, backend, &Silent, &Arc::new(AtomicBool::new(false)));
    assert_eq!(report.failures().map(|(key, e)| format!("{key}: {e}")).collect::<Vec<_>>(), Vec::<String>::new());
    let read = |written: PathBuf| {
        let model = read_model(&written, &ReadLimits::default(), &Run::default()).unwrap();
        std::fs::remove_file(written).unwrap();
        model.mesh().positions().to_vec()
    };
    instances[0].outputs().into_iter().map(read).collect()
}

/// The surface that the saved pipeline writes.
pub(super) fn run(opened: &Opened) -> Vec<Point3<f64>> {
    run_all(opened).remove(0)
}

/// The largest distance of two vertices.
pub(super) fn farthest(a: &[Point3<f64>], b: &[Point3<f64>]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
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

#[test]
fn a_run_writes_the_frames_of_the_clip_that_were_exported_where_it_is_asked_to() {
    let mut opened = Opened::person();
    let arm = opened.joint("arm.L");
    opened.view(json!({"tab": "animate", "joint": null, "time": 0.5}));
    opened.edit(json!({"do": "add_clip", "name": "wave"})).unwrap();
    opened.edit(json!({"do": "key", "joints": [arm], "time": 0.5})).unwrap();
    opened.view(json!({"time": 1.0}));
    opened.edit(json!({"do": "rotate", "joint": arm, "rotation": [0.0, 0.0, 0.4, 0.9]})).unwrap();
    opened.edit(json!({"do": "key_unkeyed", "time": 1.0})).unwrap();
    let ask = Ask::ExportFrames { rate: 8.0 };
    let answer = opened.workspace.ask(&opened.document, ask, &opened.files, &Run::default()).unwrap();
    let Answer::Download { bytes, name } = answer else { panic!("a file") };
    assert_eq!(name, "person-frames.tar");
    let frames = frames_of(&bytes);
    assert_eq!(frames.len(), 5);
    opened.edit(json!({"do": "run_writes", "frames": 5})).unwrap();
    opened.edit(json!({"do": "rename_clip", "name": "greeting"})).unwrap();
    assert_eq!(opened.state().run.clip.as_deref(), Some("greeting"));
    opened.save();
    let (written, diagonal) = (run_all(&opened), opened.workspace.mesh.diagonal());
    assert_eq!(written.len(), frames.len());
    for (written, exported) in written.iter().zip(&frames) {
        assert!(farthest(written, exported) < 1e-9 * diagonal);
    }
    assert!(farthest(&frames[0], &frames[4]) > 0.05 * diagonal, "it moves");
    opened.edit(json!({"do": "remove_clip", "name": "greeting"})).unwrap();
    assert_eq!((opened.state().run.clip, opened.document.pipeline.settings().frames), (None, 1));
    opened.save();
    assert_eq!(run_all(&opened).len(), 1, "the pose again");
}

/// Positions of the files of an archive.
fn frames_of(tar: &[u8]) -> Vec<Vec<Point3<f64>>> {
    let (mut frames, mut at) = (Vec::new(), 0);
    while tar[at] != 0 {
        let text =
            |from: usize, to: usize| std::str::from_utf8(&tar[from..to]).unwrap().trim_end_matches('\0').to_owned();
        assert_eq!(text(at, at + 100), format!("person-posed_{:04}.obj", frames.len()));
        let size = usize::from_str_radix(text(at + 124, at + 135).trim(), 8).unwrap();
        let (file, limits) = (&tar[at + 512..at + 512 + size], ReadLimits::default());
        let model =
            plumbline_shape::mesh::io::decode_model(file, MeshFormat::Obj, None, &limits, &Run::default()).unwrap();
        frames.push(model.mesh().positions().to_vec());
        at += 512 + size.next_multiple_of(512);
    }
    frames
}

#[test]
fn details_of_the_pipeline_are_shown_as_a_run_writes_them() {
    let mut opened = Opened::person();
    let arm = opened.joint("arm.L");
    opened.edit(json!({"do": "rotate", "joint": arm, "rotation": [0.0, 0.0, 0.4, 0.9]})).unwrap();
    let plain = opened.exported();
    opened.save();
    let text = std::fs::read_to_string(opened.path(PIPELINE)).unwrap();
    std::fs::write(opened.path(PIPELINE), text.replace("\"character.pose\"", "\"character.pose\"\ndetails = 0.1"))
        .unwrap();
    let mut again = opened.again(PIPELINE);
    let (shown, written, diagonal) = (again.exported(), run(&again), again.workspace.mesh.diagonal());
    assert!(farthest(&shown, &plain) > 1e-4 * diagonal, "details change the surface");
    assert!(farthest(&shown, &written) < 1e-6 * diagonal, "{}", farthest(&shown, &written));
}
