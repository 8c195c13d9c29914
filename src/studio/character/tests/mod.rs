//! Laws of the character workspace, called as the session calls it.

use std::path::PathBuf;
use std::time::Instant;

use serde_json::{Value, json};

use super::*;
use message::Format;
use plumbline_shape::character::humanoid::humanoid;
use plumbline_shape::character::skeleton_file::SkeletonFile;
use plumbline_shape::mesh::{MeshFormat, shapes, write_model};

mod edits;
mod joints;
mod messages;
mod posing;
mod runs;
mod trained;

/// An opened document, as a session has it.
pub(super) struct Opened {
    folder: tempfile::TempDir,
    files: DocumentFiles,
    pub(super) workspace: CharacterWorkspace,
    pub(super) document: CharacterDocument,
    out: Outbox,
}

impl Opened {
    /// A bar without a skeleton.
    pub(super) fn bar() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let bar = Model::of_mesh(shapes::bar([2, 2, 12], [1.0, 1.0, 6.0]));
        write_model(&folder.path().join("bar.obj"), &bar).unwrap();
        Self::of(folder, "bar.obj")
    }

    /// A person with a skeleton and computed weights.
    pub(super) fn person() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let person = humanoid(0.1).unwrap();
        let still = person.model.clone().with_articulation(None).unwrap();
        write_model(&folder.path().join("person.obj"), &still).unwrap();
        let skeleton = SkeletonFile { skeleton: person.skeleton, curve: None, proposed_names: None, clips: Vec::new() };
        std::fs::write(folder.path().join("person.skeleton.json"), skeleton.to_json()).unwrap();
        let mut opened = Self::of(folder, "person.obj");
        opened.rest();
        opened
    }

    pub(super) fn of(folder: tempfile::TempDir, name: &str) -> Self {
        let mut files =
            DocumentFiles::new(folder.path().canonicalize().unwrap().join(name), std::collections::BTreeMap::default());
        let (mut workspace, document) = CharacterWorkspace::open(&mut files, &Run::default()).unwrap();
        let mut out = Outbox::default();
        workspace.changed(&document);
        workspace.greet(&document, &mut out);
        Self { folder, files, workspace, document, out }
    }

    pub(super) fn edit(&mut self, edit: Value) -> Result<String, StudioError> {
        let edit = serde_json::from_value(edit).map_err(|e| StudioError::request(e.to_string()))?;
        let step = self.workspace.edit(&self.document, edit)?;
        self.document = step.document;
        self.workspace.changed(&self.document);
        self.rest();
        Ok(step.label)
    }

    pub(super) fn view(&mut self, view: Value) {
        self.workspace.view(&self.document, serde_json::from_value(view).unwrap()).unwrap();
        self.rest();
    }

    pub(super) fn rest(&mut self) {
        let started = Instant::now();
        while self.workspace.work(&self.document, &mut self.out, &Run::default()).unwrap() == Work::More {
            assert!(started.elapsed().as_secs() < 60, "it comes to rest");
        }
    }

    pub(super) fn state(&self) -> State {
        self.workspace.state(&self.document)
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().canonicalize().unwrap().join(name)
    }

    pub(super) fn joint(&self, name: &str) -> u32 {
        let found = self.state().joints.iter().position(|j| j.name == name);
        found.unwrap_or_else(|| panic!("no joint {name}")) as u32
    }

    /// Where a joint is in the pose that is shown.
    pub(super) fn position(&self, name: &str) -> Point3<f64> {
        let skeleton = self.workspace.rigs.skeleton(&self.document.skeleton).unwrap();
        let globals = skeleton.globals(&self.workspace.shown.as_ref().unwrap().pose).unwrap();
        let g = globals[self.joint(name) as usize];
        Point3::new(g.m14, g.m24, g.m34)
    }

    pub(super) fn save(&mut self) {
        self.workspace.save(&self.document, &mut self.files).unwrap();
        self.files.publish().unwrap();
    }

    /// The same files in a new session.
    pub(super) fn again(self, name: &str) -> Self {
        let mut opened = Self::of(self.folder, name);
        opened.rest();
        opened
    }

    /// The surface that is exported.
    pub(super) fn exported(&mut self) -> Vec<Point3<f64>> {
        let ask = Ask::Export { format: Format::Obj };
        let answer = self.workspace.ask(&self.document, ask, &self.files, &Run::default()).unwrap();
        let Answer::Download { bytes, .. } = answer else { panic!("a file") };
        let limits = ReadLimits::default();
        let model =
            plumbline_shape::mesh::io::decode_model(&bytes, MeshFormat::Obj, None, &limits, &Run::default()).unwrap();
        model.mesh().positions().to_vec()
    }
}
