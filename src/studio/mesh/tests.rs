//! Laws of the mesh workspace, called as the session calls it.

use std::path::{Path, PathBuf};
use std::time::Instant;

use nalgebra::{Point3, Vector3};
use serde_json::{Value, json};

use super::*;
use plumbline_shape::mesh::{shapes, write_model};
use plumbline_shape::surface::KeyframedDeformer;
use plumbline_shape::surface::handle_file::HandleFile;

mod edits;
mod files;
mod messages;
mod solving;

/// An opened document, as a session has it.
struct Opened {
    folder: tempfile::TempDir,
    files: DocumentFiles,
    workspace: MeshWorkspace,
    document: MeshDocument,
    out: Outbox,
}

const BAR: [usize; 3] = [3, 3, 12];

fn bar() -> Model {
    Model::of_mesh(shapes::bar(BAR, [1.0, 1.0, 4.0]))
}

/// A folder with a mesh `bar.obj`.
fn folder_with(model: &Model) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_model(&folder.path().join("bar.obj"), model).unwrap();
    folder
}

impl Opened {
    fn new() -> Self {
        Self::of(folder_with(&bar()), "bar.obj")
    }

    fn of(folder: tempfile::TempDir, name: &str) -> Self {
        let mut files =
            DocumentFiles::new(folder.path().canonicalize().unwrap().join(name), std::collections::BTreeMap::default());
        let (mut workspace, document) = MeshWorkspace::open(&mut files, &Run::default()).unwrap();
        let mut out = Outbox::default();
        workspace.changed(&document);
        workspace.greet(&document, &mut out);
        Self { folder, files, workspace, document, out }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().canonicalize().unwrap().join(name)
    }

    fn edit(&mut self, edit: Value) -> Result<String, StudioError> {
        let edit = serde_json::from_value(edit).map_err(|e| StudioError::request(e.to_string()))?;
        let step = self.workspace.edit(&self.document, edit)?;
        self.go(step.document);
        Ok(step.label)
    }

    fn go(&mut self, document: MeshDocument) {
        self.document = document;
        self.workspace.changed(&self.document);
    }

    /// Works until nothing is left to do.
    fn rest(&mut self) {
        let started = Instant::now();
        while self.workspace.work(&self.document, &mut self.out, &Run::default()).unwrap() == Work::More {
            assert!(started.elapsed().as_secs() < 60, "it comes to rest");
        }
    }

    fn state(&self) -> State {
        self.workspace.state(&self.document)
    }

    fn save(&mut self) {
        self.workspace.save(&self.document, &mut self.files).unwrap();
        self.files.publish().unwrap();
    }

    /// Both ends as handles: the lower fixed, the upper moved.
    fn with_handles() -> Self {
        let mut opened = Self::new();
        opened.edit(half_space(0.1, -1.0)).unwrap();
        opened.edit(json!({"do": "add_handle", "kind": "fixed", "name": "foot"})).unwrap();
        opened.edit(half_space(3.9, 1.0)).unwrap();
        opened.edit(json!({"do": "add_handle", "kind": "rigid"})).unwrap();
        opened
    }

    fn drag(&mut self, gesture: u32, translation: [f64; 3]) {
        self.edit(drag(1, gesture, 1.0, translation)).unwrap();
    }

    fn ask(&mut self, ask: Value) -> Result<Answer, StudioError> {
        let ask = serde_json::from_value(ask).unwrap();
        self.workspace.ask(&self.document, ask, &self.files, &Run::default())
    }

    fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }
}

fn half_space(z: f64, side: f64) -> Value {
    json!({"do": "select_half_space", "point": [0, 0, z], "normal": [0, 0, side]})
}

fn drag(handle: usize, gesture: u32, time: f64, translation: [f64; 3]) -> Value {
    json!({"do": "drag", "handle": handle, "gesture": gesture, "time": time, "translation": translation,
           "rotation": [1, 0, 0, 0], "scale": [1, 1, 1]})
}

/// The surface as the stage `mesh.deform` computes it from files.
fn as_the_stage(pipeline: &Path) -> Vec<Vec<Point3<f64>>> {
    let text = std::fs::read_to_string(pipeline).unwrap();
    let read = PipelineText::read(pipeline, &text).unwrap();
    let run = Run::default();
    let model = read_model(read.mesh(), &ReadLimits::default(), &run).unwrap();
    let handles = HandleFile::read(&read.handles()).unwrap().of_mesh(model.mesh().positions()).unwrap();
    let times: Vec<f64> = handles.frame_times(read.settings().frames).collect();
    let solvable = Arc::new(SolvableMesh::new(model.mesh(), &run).unwrap());
    let mut deformer =
        KeyframedDeformer::new(model.mesh(), solvable, handles, &read.settings().keyframed(), &run).unwrap();
    let poses = times.into_iter().map(|t| deformer.pose(t, &run).unwrap().positions).collect::<Vec<_>>();
    poses.iter().map(|pose| deformer.carry_back(pose)).collect()
}

fn farthest(a: &[Point3<f64>], b: &[Point3<f64>]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}
