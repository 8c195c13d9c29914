//! Bars of the character workspace of the studio, in CPU time of this process, p95: inverse kinematics, painted weights, undo.
//!
//! ```sh
//! cargo run --release --example studio_character_bars
//! ```
//!
//! The character is the humanoid with fingers and split bones: 63 joints, on a surface of about 20 000 vertices (23 000 for the brush).
//! Sends the edits of a hand to the workspace, as the session does, and reads what comes back.

#![allow(clippy::print_stdout)] // a table of figures is its result

#[path = "../measure.rs"]
mod measure;

use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use measure::{Started, quantile, report, report_memory};
use nalgebra::{Point3, Vector3};
use plumbline::num::math::Trs;
use plumbline::num::run::Run;
use plumbline::shape::character::edit::{Edit, RigEditor};
use plumbline::shape::character::humanoid::humanoid;
use plumbline::shape::character::weights::{WeightOptions, bone_weights};
use plumbline::shape::character::{Character, Skeleton, Skin};
use plumbline::shape::mesh::write_model;
use plumbline_studio::character::CharacterWorkspace;
use plumbline_studio::character::message::BufferKind;
use plumbline_studio::files::DocumentFiles;
use plumbline_studio::outbox::Outbox;
use plumbline_studio::workspace::{Work, Workspace};
use serde_json::{Value, json};

/// Edits of a drag and of a stroke.
const EDITS: u32 = 200;
/// Joints of a character for games, with fingers.
const JOINTS: usize = 63;
/// Sizes of the cells of the surface that give the numbers of vertices of the bars.
const CELL_OF_20K: f64 = 0.0213;
const CELL_OF_23K: f64 = 0.0199;

type Document = <CharacterWorkspace as Workspace>::Document;
type Failure = Box<dyn Error>;
/// What the files say.
type Texts = BTreeMap<PathBuf, Arc<[u8]>>;

fn main() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let folder = folder.path().canonicalize()?;
    let posed = folder.join("posed.glb");
    write_model(&posed, &character(CELL_OF_20K)?.to_model(None)?)?;
    let mut bench = Bench::open(&posed)?;
    let history = bench.drags()?;
    bench.undo(&history)?;
    let painted = folder.join("painted.glb");
    write_model(&painted, &character(CELL_OF_23K)?.to_model(None)?)?;
    let mut bench = Bench::open(&painted)?;
    let history = bench.strokes()?;
    bench.undo(&history)?;
    report_memory()
}

/// The humanoid with more joints, weighted anew.
fn character(cell: f64) -> Result<Character, Failure> {
    let person = humanoid(cell)?;
    let skeleton = with_fingers(&person.skeleton)?;
    let mesh = person.model.mesh();
    let (weights, _) = bone_weights(mesh, &skeleton, &WeightOptions::default(), &Run::default())?;
    let skin = Arc::new(Skin::bound(weights, &skeleton)?);
    Ok(Character::new(person.model.clone(), skeleton, skin)?)
}

/// Four fingers of four joints per hand, then bones split in two until there are enough.
fn with_fingers(skeleton: &Skeleton) -> Result<Skeleton, Failure> {
    let mut rig = RigEditor::new(Some(skeleton));
    for side in ["L", "R"] {
        let hand = find(&rig, &format!("hand.{side}"))?;
        let at = world(&rig)?[hand as usize];
        let out = Vector3::x() * at.x.signum();
        for finger in 0..4 {
            let mut joint = hand;
            for k in 0..4 {
                let at = at + out * (0.05 + 0.02 * f64::from(k)) + Vector3::z() * (0.012 * f64::from(finger) - 0.018);
                let name = format!("finger {finger} {k}.{side}");
                joint = added(&mut rig, Edit::Extrude { joint, name, at })?;
            }
        }
    }
    let mut bones = ["spine", "chest", "neck", "forearm.L", "forearm.R", "shin.L", "shin.R", "arm.L", "arm.R"].iter();
    while rig.joints().len() < JOINTS {
        let bone = *bones.next().ok_or("too few bones")?;
        let joint = find(&rig, bone)?;
        added(&mut rig, Edit::Split { joint, fraction: 0.5, name: format!("{bone} half") })?;
    }
    rig.skeleton().ok_or_else(|| "no skeleton".into())
}

fn added(rig: &mut RigEditor, edit: Edit) -> Result<u32, Failure> {
    Ok(*rig.apply(edit)?.added.first().ok_or("no joint was added")?)
}

fn find(rig: &RigEditor, name: &str) -> Result<u32, Failure> {
    let found = rig.joints().iter().position(|joint| joint.name == name);
    Ok(found.ok_or_else(|| format!("no joint {name}"))? as u32)
}

/// Positions of the joints at rest.
fn world(rig: &RigEditor) -> Result<Vec<Point3<f64>>, Failure> {
    let skeleton = rig.skeleton().ok_or("no skeleton")?;
    let globals = skeleton.globals(&skeleton.rest_pose())?;
    Ok(globals.iter().map(|frame| Point3::from(Trs::from_matrix(frame).translation)).collect())
}

struct Bench {
    files: DocumentFiles,
    workspace: CharacterWorkspace,
    document: Document,
    out: Outbox,
    /// Names of the joints, in their order.
    joints: Vec<String>,
}

impl Bench {
    fn open(file: &Path) -> Result<Self, Failure> {
        let mut files = DocumentFiles::new(file, std::collections::BTreeMap::default());
        let started = Started::now();
        let (mut workspace, document) = CharacterWorkspace::open(&mut files, &Run::default())?;
        workspace.changed(&document);
        let mut out = Outbox::default();
        workspace.greet(&document, &mut out);
        let mut bench = Self { files, workspace, document, out, joints: Vec::new() };
        bench.settle()?;
        let state = bench.state()?;
        let joints = state["joints"].as_array().ok_or("no joints")?;
        bench.joints = joints.iter().filter_map(|joint| Some(joint["name"].as_str()?.to_owned())).collect();
        println!("{} joints, {} vertices", bench.joints.len(), state["mesh"]["vertices"]);
        report("opening to rest", started.spent());
        Ok(bench)
    }

    fn state(&self) -> Result<Value, Failure> {
        Ok(serde_json::to_value(self.workspace.state(&self.document))?)
    }

    fn joint(&self, name: &str) -> Result<u32, Failure> {
        let found = self.joints.iter().position(|joint| joint == name);
        Ok(found.ok_or_else(|| format!("no joint {name}"))? as u32)
    }

    fn edit(&mut self, edit: Value) -> Result<(), Failure> {
        let step = self.workspace.edit(&self.document, serde_json::from_value(edit)?)?;
        self.document = step.document;
        self.workspace.changed(&self.document);
        Ok(())
    }

    fn view(&mut self, view: Value) -> Result<(), Failure> {
        Ok(self.workspace.view(&self.document, serde_json::from_value(view)?)?)
    }

    fn settle(&mut self) -> Result<(), Failure> {
        while self.workspace.work(&self.document, &mut self.out, &Run::default())? == Work::More {}
        self.out.buffers.clear();
        Ok(())
    }

    /// Slices until a buffer of this kind is there.
    fn until(&mut self, kind: BufferKind) -> Result<(), Failure> {
        self.out.buffers.clear();
        loop {
            let work = self.workspace.work(&self.document, &mut self.out, &Run::default())?;
            if self.out.buffers.iter().any(|buffer| buffer.kind == kind.number()) {
                return Ok(());
            }
            if work == Work::Rest {
                return Err(format!("no {kind:?} came").into());
            }
        }
    }

    /// Edits, each with its picture. The documents before each.
    fn repeat(&mut self, what: &str, kind: BufferKind, edit: impl Fn(f64) -> Value) -> Result<Vec<Document>, Failure> {
        let (mut history, mut times) = (Vec::new(), Vec::new());
        for k in 1..=EDITS {
            history.push(self.document.clone());
            let started = Started::now();
            self.edit(edit(f64::from(k) / f64::from(EDITS)))?;
            self.until(kind)?;
            times.push(started.spent());
        }
        let worst = quantile(&times, 0.95);
        report(what, worst);
        println!("{:<34} {:8.1} per second", "", 1.0 / worst.cpu.as_secs_f64());
        Ok(history)
    }

    /// A hand that drags the left hand in the plane of the screen, with three pins.
    fn drags(&mut self) -> Result<Vec<Document>, Failure> {
        self.view(json!({"tab": "pose"}))?;
        for name in ["foot.L", "foot.R", "hand.R"] {
            let joint = self.joint(name)?;
            self.edit(json!({"do": "pin", "joint": joint, "orientation": true}))?;
        }
        self.settle()?;
        let hand = self.joint("hand.L")?;
        let to = |t: f64| [0.69 - 0.35 * t, 1.4 - 0.5 * (3.0 * t).sin(), 0.3 * (5.0 * t).sin().abs()];
        self.repeat(
            "IK, three pins: solve + encode, p95",
            BufferKind::PosedFrames,
            |t| json!({"do": "drag", "joint": hand, "point": [0, 0, 0], "to": to(t)}),
        )
    }

    /// A brush along the left arm, mirrored.
    fn strokes(&mut self) -> Result<Vec<Document>, Failure> {
        let joint = self.joint("forearm.L")?;
        self.view(json!({"tab": "weights", "joint": joint}))?;
        self.settle()?;
        self.repeat("brush, mirrored: paint + encode, p95", BufferKind::SkinWeights, |t| {
            let center = [0.3 + 0.3 * t, 1.4, 0.05];
            json!({"do": "paint", "joint": joint, "op": "add", "center": center, "radius": 0.08, "strength": 0.2,
                   "value": 1.0, "mirror": true})
        })
    }

    fn texts(&self) -> Result<Texts, Failure> {
        let mut files = self.files.clone();
        self.workspace.save(&self.document, &mut files)?;
        Ok(files.pending().clone())
    }

    /// Undo of all edits: to the changed document and its state, and to rest; the files of every tenth are compared.
    fn undo(&mut self, history: &[Document]) -> Result<(), Failure> {
        let every = 10;
        let before = self.document.clone();
        let mut expected = Vec::new();
        for document in history.iter().step_by(every) {
            self.document = document.clone();
            expected.push(self.texts()?);
        }
        self.document = before;
        self.workspace.changed(&self.document);
        self.settle()?;
        let (mut replies, mut pictures) = (Vec::new(), Vec::new());
        for (k, document) in history.iter().enumerate().rev() {
            let started = Started::now();
            self.document = document.clone();
            self.workspace.changed(&self.document);
            let state = serde_json::to_string(&self.workspace.state(&self.document))?;
            replies.push(started.spent());
            self.settle()?;
            pictures.push(started.spent());
            if state.is_empty() || (k % every == 0 && self.texts()? != expected[k / every]) {
                return Err("undo gave another document".into());
            }
        }
        report("undo, p95", quantile(&replies, 0.95));
        report("undo to the picture, p95", quantile(&pictures, 0.95));
        Ok(())
    }
}
