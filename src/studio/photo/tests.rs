//! Laws of the photo workspace, by calls of the trait.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use serde_json::{Value, json};

use super::*;
use crate::workspace::Work;
use plumbline_app::pipeline::execute::{Backend, execute};
use plumbline_app::pipeline::progress::Silent;
use plumbline_app::pipeline::{Source, read};
use plumbline_app::stages::BuiltinStages;
use plumbline_image::still::{Photo, rgb_of_frame};
use plumbline_num::run::Interrupt;

/// A folder with one photo of `media/`, and the workspace of what was opened in it.
struct Bench {
    folder: tempfile::TempDir,
    files: DocumentFiles,
    workspace: PhotoWorkspace,
    document: PhotoDocument,
}

fn media(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../media").join(name)
}

impl Bench {
    fn of(names: &[&str]) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        for name in names {
            std::fs::copy(media(name), folder.path().join(name)).expect("a copy");
        }
        Self::open(folder, names[0])
    }

    fn open(folder: tempfile::TempDir, name: &str) -> Self {
        let path = folder.path().canonicalize().expect("a folder").join(name);
        let mut files = DocumentFiles::new(path, std::collections::BTreeMap::new());
        let (workspace, document) = PhotoWorkspace::open(&mut files, &Run::default()).expect("a document");
        Self { folder, files, workspace, document }
    }

    fn edit(&mut self, edit: Value) -> Result<String, StudioError> {
        let edit = serde_json::from_value(edit).map_err(|e| StudioError::request(e.to_string()))?;
        let step = self.workspace.edit(&self.document, edit)?;
        self.document = step.document;
        self.workspace.changed(&self.document);
        Ok(step.label)
    }

    fn done(&mut self, edit: Value) -> String {
        let text = edit.to_string();
        self.edit(edit).unwrap_or_else(|e| panic!("{text}: {e}"))
    }

    fn rest(&mut self) -> Outbox {
        let mut out = Outbox::default();
        for _ in 0..100 {
            let work = self.workspace.work(&self.document, &mut out, &Run::default()).expect("work");
            if work == Work::Rest {
                return out;
            }
        }
        panic!("it does not come to rest");
    }

    fn state(&self) -> Value {
        serde_json::to_value(self.workspace.state(&self.document)).expect("a state")
    }

    fn save(&mut self) {
        let mut files = self.files.clone();
        self.workspace.save(&self.document, &mut files).expect("saved");
        files.publish().expect("written");
    }

    fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.folder.path().join(name)).expect("a file")
    }

    /// The picture that the saved pipeline writes.
    fn run(&self, pipeline: &str) -> PathBuf {
        let base = self.folder.path().canonicalize().expect("a folder");
        let source = Source { name: pipeline.to_owned(), text: self.text(pipeline), base: Some(base) };
        let pipeline = read(source, &[]).expect("a pipeline");
        let instances = pipeline.instances().expect("one item");
        let backend = Backend { stages: &BuiltinStages, workers: None };
        let report = execute(&pipeline, &instances, backend, &Silent, &Arc::new(AtomicBool::new(false)));
        assert_eq!(report.failures().map(|(key, e)| format!("{key}: {e}")).collect::<Vec<_>>(), Vec::<String>::new());
        instances[0].outputs().remove(0)
    }

    fn export(&mut self) -> Vec<u8> {
        match self.workspace.ask(&self.document, Ask::Export, &self.files.clone(), &Run::default()).expect("an export")
        {
            Answer::Download { bytes, .. } => bytes,
            Answer::Value(value) => panic!("{value}"),
        }
    }
}

/// A line of the room at a height: along the image of a straight edge under its lens.
fn marked(name: &str, count: usize) -> Vec<Value> {
    let text = std::fs::read_to_string(media(name)).expect("lines");
    let file: Value = serde_json::from_str(&text).expect("JSON");
    let list = file.as_array().cloned().unwrap_or_else(|| file["lines"].as_array().cloned().unwrap_or_default());
    list.into_iter().take(count).collect()
}

fn draw_room(bench: &mut Bench, count: usize) {
    for line in marked("room-kb-125.lines.json", count) {
        let points = line["points"].clone();
        bench.done(json!({ "do": "add_line", "points": points }));
    }
}

#[test]
fn a_selection_is_no_step_and_follows_what_the_document_has() {
    let mut bench = Bench::of(&["room-kb-125.jpg"]);
    draw_room(&mut bench, 2);
    let before = bench.document.clone();
    bench.done(json!({ "do": "select", "lines": [1], "point": 3 }));
    assert!(bench.document == before, "the session takes an equal document for no step");
    assert_eq!(bench.state()["selected"], json!({ "lines": [1], "point": 3, "faces": [] }));
    bench.done(json!({ "do": "delete_lines", "lines": [0] }));
    bench.document = before;
    bench.done(json!({ "do": "select", "lines": [1], "point": 3 }));
    bench.document = PhotoDocument { lines: Arc::default(), ..bench.document };
    bench.workspace.changed(&bench.document);
    assert_eq!(bench.state()["selected"], json!({ "lines": [], "point": null, "faces": [] }));
}

#[test]
fn what_the_saved_pipeline_writes_is_the_export_and_what_is_shown_is_made_of_the_same_map() {
    let mut bench = Bench::of(&["room-kb-125.jpg", "room-kb-125.lens.json"]);
    draw_room(&mut bench, 6);
    bench.done(json!({ "do": "set_lens", "lens": "room-kb-125.lens.json" }));
    bench.done(json!({ "do": "orient", "lines": [0], "orientation": "horizontal" }));
    // A crop would bend lines near the border to show 85 % of a picture that is turned by half a right angle.
    bench.done(json!({ "do": "set", "key": "crop", "value": "none" }));
    bench.rest();
    bench.done(json!({ "do": "add_face", "rect": [500.0, 300.0, 80.0, 90.0] }));
    let out = bench.rest();
    let state = bench.state();
    assert_eq!(state["problem"], Value::Null);
    assert_eq!((&state["result"]["exact"], &state["using"]), (&json!(true), &json!("marked")), "{state}");
    assert!(out.buffers.iter().any(|b| b.kind == BufferKind::Result as u32));
    let worst =
        state["lines"].as_array().expect("lines").iter().map(|l| l["report"]["max_px"].as_f64().expect("a number"));
    assert!(worst.clone().fold(0.0, f64::max) < 2.0, "{:?}", worst.collect::<Vec<_>>());
    bench.save();
    let exported = bench.export();
    let written = std::fs::read(bench.run("room-kb-125.rectify.toml")).expect("the result");
    assert!(exported == written, "{} and {} bytes", exported.len(), written.len());
    assert_eq!(bench.state()["result"]["exact"], true, "an export changes nothing that is shown");
}

#[test]
fn found_lines_make_the_picture_until_lines_are_marked_and_are_kept_with_the_first_one() {
    let mut bench = Bench::of(&["room-rectilinear-100.jpg", "room-rectilinear-100.lens.json"]);
    bench.done(json!({ "do": "set_lens", "lens": "rectilinear", "fov": 100.0 }));
    bench.rest();
    let state = bench.state();
    assert_eq!(state["using"], "found");
    let found = state["found"].as_array().expect("found lines").clone();
    assert!(found.len() > 5, "{found:?}");
    let name = found[0]["name"].as_str().expect("a name").to_owned();
    bench.done(json!({ "do": "switch_found", "names": [name], "off": true }));
    bench.rest();
    assert_eq!(bench.state()["found"][0]["off"], true);
    bench.save();
    assert!(bench.text("room-rectilinear-100.rectify.toml").contains(&format!("without = [\"{name}\"]")));
    let exported = bench.export();
    let written = std::fs::read(bench.run("room-rectilinear-100.rectify.toml")).expect("the result");
    assert!(exported == written);
    bench.rest();
    let label = bench.done(json!({ "do": "add_line", "points": [[100.0, 100.0], [400.0, 120.0]] }));
    let saved = plumbline_photo::marks::LinesFile {
        size: (1200, 800),
        lines: bench.document.lines.to_vec(),
        notes: Vec::new(),
    };
    let read = plumbline_photo::marks::LinesFile::parse(&saved.to_json(), saved.size).expect("our own file");
    assert_eq!(read.lines, *bench.document.lines, "adopted lines are as a file keeps them");
    assert_eq!(bench.document.lines.len(), found.len(), "all but the one that is off, and the new one: {label}");
    bench.done(json!({ "do": "delete_lines", "lines": (0..found.len()).collect::<Vec<_>>() }));
    bench.rest();
    assert_eq!(bench.state()["using"], "found", "without marks they are found again");
}

#[test]
fn a_photo_of_an_unknown_lens_asks_for_one_and_marked_lines_give_it() {
    // One edge, across the middle: too few for a lens.
    let folder = tempfile::tempdir().expect("a folder");
    let wall = image::GrayImage::from_fn(1200, 900, |_, y| image::Luma([if y < 450 { 90 } else { 170 }]));
    wall.save(folder.path().join("wall.png")).expect("a picture");
    let mut bench = Bench::open(folder, "wall.png");
    bench.rest();
    let state = bench.state();
    assert!(state["problem"].as_str().expect("a problem").contains("lens is not known"), "{state}");
    assert_eq!((&state["result"], &state["using"]), (&Value::Null, &json!("none")));
    assert!(!state["found"].as_array().expect("suggestions").is_empty());
    draw_room(&mut bench, 8);
    bench.rest();
    let state = bench.state();
    assert_eq!(state["problem"], Value::Null);
    assert!(state["lens"]["how"].as_str().expect("a lens").contains("from marked lines"), "{state}");
}

#[test]
fn a_drag_is_shown_at_once_from_the_last_map_and_at_rest_it_is_exact() {
    let mut bench = Bench::of(&["room-kb-125.jpg", "room-kb-125.lens.json"]);
    bench.done(json!({ "do": "set_lens", "lens": "room-kb-125.lens.json" }));
    draw_room(&mut bench, 6);
    bench.rest();
    let before = bench.document.lines[2].line.points[0];
    let mut labels = Vec::new();
    for k in 1..4 {
        let edit = json!({ "do": "move_point", "line": 2, "point": 0, "x": before.x + f64::from(k), "y": before.y });
        labels.push(bench.done(edit));
        let mut out = Outbox::default();
        let work = bench.workspace.work(&bench.document, &mut out, &Run::default()).expect("work");
        assert_eq!((work, &bench.state()["result"]["exact"]), (Work::More, &json!(false)));
        for kind in [BufferKind::Result, BufferKind::Marks, BufferKind::Carried] {
            assert!(out.buffers.iter().any(|b| b.kind == kind as u32), "{kind:?}");
        }
    }
    assert!(labels.iter().all(|label| label.starts_with("Move a point of")), "{labels:?}");
    bench.rest();
    assert_eq!(bench.state()["result"]["exact"], true);
}

#[test]
fn a_slice_that_is_stopped_changes_nothing_and_the_next_one_finishes() {
    let mut bench = Bench::of(&["room-kb-125.jpg", "room-kb-125.lens.json"]);
    bench.done(json!({ "do": "set_lens", "lens": "room-kb-125.lens.json" }));
    let interrupt = Interrupt::new();
    interrupt.stop();
    let stopped = Run::with_interrupt(&interrupt);
    let mut slices = 0;
    for _ in 0..5 {
        let worked = bench.workspace.work(&bench.document, &mut Outbox::default(), &stopped);
        slices += usize::from(matches!(worked, Err(StudioError::Stopped(_))));
    }
    assert!(slices > 0, "the interrupt is seen");
    // A raised interrupt stays raised: rest takes a run of its own.
    bench.rest();
    assert_eq!(bench.state()["result"]["exact"], true);
}

#[test]
fn saved_documents_are_read_back_with_their_marks_and_comments() {
    let mut bench = Bench::of(&["room-kb-125.jpg"]);
    draw_room(&mut bench, 3);
    bench.rest();
    bench.done(json!({ "do": "switch_lines", "lines": [1], "off": true }));
    bench.done(json!({ "do": "rename_line", "line": 0, "name": "cornice" }));
    bench.done(json!({ "do": "add_face", "rect": [10.0, 20.0, 30.0, 40.0] }));
    bench.done(json!({ "do": "set", "key": "to", "value": "panini:0.8" }));
    bench.done(json!({ "do": "set", "key": "crop", "value": "3:2" }));
    bench.save();
    let text = bench.text("room-kb-125.rectify.toml");
    assert!(text.contains("# the only stage that samples pixels") && text.contains("\"panini:0.8\""), "{text}");
    let Bench { folder, document, .. } = bench;
    for name in ["room-kb-125.jpg", "room-kb-125.rectify.toml"] {
        let path = folder.path().canonicalize().expect("a folder").join(name);
        let mut files = DocumentFiles::new(path, std::collections::BTreeMap::new());
        let (_, read) = PhotoWorkspace::open(&mut files, &Run::default()).expect("a document");
        assert_eq!((read.lines, read.faces), (document.lines.clone(), document.faces.clone()), "{name}");
        assert_eq!(read.pipeline.text(), document.pipeline.text());
    }
}

#[test]
fn edits_that_do_not_fit_are_refused_with_the_reason_and_change_nothing() {
    let mut bench = Bench::of(&["room-kb-125.jpg"]);
    draw_room(&mut bench, 1);
    let before = bench.document.clone();
    let cases = [
        (json!({ "do": "add_line", "points": [[1.0, 2.0]] }), "expected 2 to"),
        (json!({ "do": "add_line", "points": [[1.0, 2.0], [1.2, 2.1]] }), "within a pixel"),
        (json!({ "do": "add_line", "points": [[1.0, 2.0], [90.0, 2.1]], "orientation": "diagonal" }), "no orientation"),
        (json!({ "do": "add_line", "points": [[1.0, 2.0], [90.0, 2.1]], "orientation": 400.0 }), "360"),
        (json!({ "do": "move_point", "line": 7, "point": 0, "x": 1.0, "y": 1.0 }), "no line 7"),
        (json!({ "do": "move_point", "line": 0, "point": 9999, "x": 1.0, "y": 1.0 }), "no point 9999"),
        (json!({ "do": "delete_lines", "lines": [0, 5] }), "no line 5"),
        (json!({ "do": "rename_line", "line": 0, "name": "  " }), "1 to 200"),
        (json!({ "do": "adopt", "names": ["nowhere"] }), "no found line"),
        (json!({ "do": "set_lens", "lens": "periscope", "fov": 90.0 }), "periscope"),
        (json!({ "do": "set_lens", "lens": "/etc/passwd" }), "passwd"),
        (json!({ "do": "set_lens", "lens": "equidistant", "fov": 1e9 }), "fov"),
        (json!({ "do": "set", "key": "to", "value": "globe" }), "globe"),
        (json!({ "do": "set", "key": "path", "value": "../x.jpg" }), "file name"),
        (json!({ "do": "set", "key": "use", "value": "x" }), "not set here"),
        (json!({ "do": "add_face", "rect": [-500.0, 0.0, 10.0, 10.0] }), "still being searched"),
        (json!({ "do": "select", "lines": [4] }), "nothing of this number"),
        (json!({ "do": "select", "lines": [], "point": 0 }), "nothing of this number"),
        (json!({ "do": "explode" }), "unknown variant"),
        (json!({ "do": "snap_line", "line": 3 }), "no line 3"),
    ];
    for (edit, word) in cases {
        let why = bench.edit(edit.clone()).expect_err(word).to_string();
        assert!(why.contains(word), "{edit}: {why}");
        assert!(bench.document == before, "{edit}");
    }
}

#[test]
fn a_pixel_of_the_photo_is_where_its_mark_is_carried_to() {
    let folder = tempfile::tempdir().expect("a folder");
    let (w, h, x, y) = (301, 201, 40, 60);
    let mut samples = vec![0_u8; w * h * 3];
    samples[(y * w + x) * 3..][..3].fill(255);
    let frame = plumbline_image::still::frame_of_rgb(&samples, w, h).expect("a frame");
    let photo = Photo::new(frame);
    photo.save(folder.path().join("dot.png")).expect("written");
    let mut bench = Bench::open(folder, "dot.png");
    bench.done(json!({ "do": "set_lens", "lens": "equidistant", "fov": 110.0 }));
    bench.done(json!({ "do": "set", "key": "to", "value": "perspective" }));
    bench.done(json!({ "do": "add_line", "points": [[x as f64 + 0.5, y as f64 + 0.5], [260.5, 140.5]] }));
    bench.workspace.view(&bench.document, View { size: Some([4096, 4096]), ..View::default() }).expect("a view");
    let out = bench.rest();
    let last = |kind: BufferKind| out.buffers.iter().rev().find(|b| b.kind == kind as u32).expect("a buffer");
    // The carried line: one line of n points, the first is the mark.
    let carried = &last(BufferKind::Carried).bytes;
    let at: [f32; 2] = bytemuck::pod_read_unaligned(&carried[8..16]);
    // The brightest spot of the result, as the mean position of its light.
    let result = &last(BufferKind::Result).bytes;
    let [width, height]: [u32; 2] = bytemuck::pod_read_unaligned(&result[16..24]);
    let (mut sum, mut mean) = (0.0, [0.0; 2]);
    for (k, rgb) in result[24..].chunks_exact(3).enumerate() {
        let light = f64::from(rgb[1]);
        sum += light;
        mean[0] += light * ((k as u32 % width) as f64 + 0.5);
        mean[1] += light * ((k as u32 / width) as f64 + 0.5);
    }
    assert!(sum > 0.0 && height > 10);
    let off = [0, 1].map(|i| (mean[i] / sum - f64::from(at[i])).abs());
    assert!(off[0] < 0.1 && off[1] < 0.1, "{off:?} at {at:?} of {width}×{height}");
}

#[test]
fn parts_of_the_result_show_the_same_pixels_as_the_whole() {
    let mut bench = Bench::of(&["room-kb-125.jpg", "room-kb-125.lens.json"]);
    bench.done(json!({ "do": "set_lens", "lens": "room-kb-125.lens.json" }));
    let mut picture = |part: [f64; 4]| {
        let view = View { size: Some([4096, 4096]), part: Some(part), ..View::default() };
        bench.workspace.view(&bench.document, view).expect("a view");
        let out = bench.rest();
        let buffer = out.buffers.iter().rev().find(|b| b.kind == BufferKind::Result as u32).expect("a picture");
        let size: [u32; 2] = bytemuck::pod_read_unaligned(&buffer.bytes[16..24]);
        (size, buffer.bytes[24..].to_vec())
    };
    let (whole, all) = picture([0.0, 0.0, 1.0, 1.0]);
    let (half, right) = picture([0.5, 0.0, 1.0, 1.0]);
    assert_eq!(half, [whole[0] / 2, whole[1]]);
    let (x, y) = (10, 30);
    let at = |all: &[u8], width: u32, x: u32| all[((y * width + x) * 3) as usize];
    let both = (at(&all, whole[0], whole[0] / 2 + x), at(&right, half[0], x));
    assert!(both.0.abs_diff(both.1) < 6, "{both:?}");
    for part in [[0.5, 0.0, 0.4, 1.0], [f64::NAN, 0.0, 1.0, 1.0], [0.0, 0.0, 2.0, 1.0]] {
        let view = View { part: Some(part), ..View::default() };
        assert!(bench.workspace.view(&bench.document, view).is_err(), "{part:?}");
    }
}

#[test]
fn faces_are_corrected_from_those_that_are_found_and_can_be_found_again() {
    let mut bench = Bench::of(&["street-people.jpg"]);
    bench.done(json!({ "do": "set_lens", "lens": "rectilinear", "fov": 80.0 }));
    bench.rest();
    let count = bench.state()["faces"].as_array().expect("faces").len();
    bench.done(json!({ "do": "add_face", "rect": [100.0, 100.0, 60.0, 80.0] }));
    let state = bench.state();
    assert_eq!((state["faces"].as_array().expect("faces").len(), &state["faces_marked"]), (count + 1, &json!(true)));
    bench.done(json!({ "do": "set_face", "face": count, "rect": [110.0, 100.0, 70.0, 90.0] }));
    bench.done(json!({ "do": "rename_face", "face": count, "name": "the one at the left" }));
    bench.done(json!({ "do": "switch_faces", "faces": [count], "off": true }));
    bench.save();
    assert!(bench.text("street-people.rectify.toml").contains("faces.load"));
    assert!(bench.text("street-people.faces.json").contains("the one at the left"));
    bench.done(json!({ "do": "find_faces" }));
    assert_eq!(bench.state()["faces"].as_array().expect("faces").len(), count);
    assert!(bench.document.pipeline.text().contains("faces.detect"));
}

#[test]
fn a_pipeline_with_comments_of_its_own_keeps_them_and_batches_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::copy(media("room-kb-125.jpg"), folder.path().join("room.jpg")).expect("a copy");
    let text = "version = 1 # one\n\n[stage.p]\nuse = \"image.load\"\npath = \"room.jpg\"\n\n[stage.m]\nuse = \"photo.rectify\"\n\
                inputs = { image = \"p\" }\nlens = \"equidistant\"  # guessed\nfov = 125.0\n\n[stage.r]\nuse = \"image.render\"\n\
                inputs = { image = \"p\", warps = [\"m\"] }\n\n[stage.s]\nuse = \"image.save\"\ninputs = [\"r\"]\npath = \"o.jpg\"\n";
    std::fs::write(folder.path().join("mine.toml"), text).expect("written");
    let mut bench = Bench::open(folder, "mine.toml");
    bench.done(json!({ "do": "set_lens", "lens": "equisolid", "fov": 130.0 }));
    bench.rest();
    assert_eq!(bench.state()["result"]["exact"], true);
    let why = bench.edit(json!({ "do": "add_line", "points": [[0.0, 0.0], [90.0, 90.0]] })).expect_err("no lines.load");
    assert!(why.to_string().contains("lines.load"), "{why}");
    bench.save();
    let saved = bench.text("mine.toml");
    assert_eq!(saved, text.replace("\"equidistant\"", "\"equisolid\"").replace("125.0", "130.0"));
    let batch = text.replace("version = 1 # one", "version = 1\n[batch]\nforeach = \"*.jpg\"");
    std::fs::write(bench.folder.path().join("batch.toml"), batch).expect("written");
    let path = bench.folder.path().canonicalize().expect("a folder").join("batch.toml");
    let mut files = DocumentFiles::new(path, std::collections::BTreeMap::new());
    let why = PhotoWorkspace::open(&mut files, &Run::default()).expect_err("a batch").to_string();
    assert!(why.contains("open one of them"), "{why}");
}

#[test]
fn a_line_near_an_edge_snaps_onto_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let (w, h) = (400_usize, 300_usize);
    let samples: Vec<u8> = (0..w * h).flat_map(|k| [if k % w < 200 { 20 } else { 220 }; 3]).collect();
    let frame = plumbline_image::still::frame_of_rgb(&samples, w, h).expect("a frame");
    let photo = Photo::new(frame);
    photo.save(folder.path().join("edge.png")).expect("written");
    assert!(rgb_of_frame(&photo.frame).is_ok());
    let mut bench = Bench::open(folder, "edge.png");
    bench.done(json!({ "do": "add_line", "points": [[198.0, 20.0], [201.5, 280.0]] }));
    bench.done(json!({ "do": "snap_line", "line": 0 }));
    let points = &bench.document.lines[0].line.points;
    assert!(points.iter().all(|p| (p.x - 200.0).abs() < 0.4), "{points:?}");
    let again = bench.edit(json!({ "do": "snap_line", "line": 0 }));
    assert!(again.is_err() || bench.document.lines[0].line.points.iter().all(|p| (p.x - 200.0).abs() < 0.4));
}

#[test]
fn the_types_of_the_page_are_those_of_the_workspace() {
    use super::protocol::*;
    use ts_rs::TS;
    let config = ts_rs::Config::new();
    let declarations = [
        Edit::decl(&config),
        OrientationSetting::decl(&config),
        View::decl(&config),
        Ask::decl(&config),
        State::decl(&config),
        PhotoInfo::decl(&config),
        SettingsInfo::decl(&config),
        LensInfo::decl(&config),
        LineInfo::decl(&config),
        Straightness::decl(&config),
        FoundInfo::decl(&config),
        FaceInfo::decl(&config),
        Selected::decl(&config),
        ResultInfo::decl(&config),
    ];
    let kinds = [
        ("Source", BufferKind::Source),
        ("SourcePart", BufferKind::SourcePart),
        ("Result", BufferKind::Result),
        ("Grid", BufferKind::Grid),
        ("Marks", BufferKind::Marks),
        ("Courses", BufferKind::Courses),
        ("FoundCourses", BufferKind::FoundCourses),
        ("Carried", BufferKind::Carried),
        ("FoundCarried", BufferKind::FoundCarried),
    ];
    let list: Vec<String> = kinds.iter().map(|(name, kind)| format!("  {name}: {},", *kind as u32)).collect();
    let mut text = "// Types of the photo workspace's messages, written by its test (REGENERATE=1).\n\n".to_owned();
    let _ = write!(text, "export const BufferKind = {{\n{}\n}} as const;\n", list.join("\n"));
    for declaration in declarations {
        let _ = write!(text, "\nexport {declaration}\n");
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("ui/src/generated/photo.ts");
    if std::env::var_os("REGENERATE").is_some() {
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        std::fs::write(&path, &text).expect("written");
    }
    assert_eq!(std::fs::read_to_string(&path).unwrap_or_default(), text, "run this test with REGENERATE=1");
}
