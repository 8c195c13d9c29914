//! Bars of the mesh workspace of the studio, in CPU time of this process, p95.
//!
//! ```sh
//! cargo run --release --example studio_bars -- PLUMBLINE_MEDIA/igl/armadillo.obj [10k|43k|173k]
//! ```
//!
//! Sends the edits of a hand that drags to the workspace, as the session does, and reads what comes back. A mesh of another size is
//! made from the given one: a level of its hierarchy, or every triangle in four.

#![allow(clippy::print_stdout)] // a table of figures is its result

#[path = "../measure.rs"]
mod measure;

use std::collections::HashMap;
use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use measure::{Started, ms, quantile, report, report_memory};
use serde_json::{Value, json};

use plumbline::num::run::{Interrupt, Run};
use plumbline::shape::mesh::{Model, ReadLimits, TriMesh, read_model, write_model};
use plumbline::shape::surface::{Hierarchy, KeyframedDeformer, SolvableMesh};
use plumbline_studio::error::StudioError;
use plumbline_studio::files::DocumentFiles;
use plumbline_studio::mesh::MeshWorkspace;
use plumbline_studio::mesh::encode::BufferKind;
use plumbline_studio::mesh::handle_text;
use plumbline_studio::outbox::Outbox;
use plumbline_studio::workspace::{Work, Workspace};

const DRAGS: u32 = 200;

type Document = <MeshWorkspace as Workspace>::Document;
type Failure = Box<dyn Error>;

fn main() -> Result<(), Failure> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let path = args.first().ok_or("a mesh is needed: PLUMBLINE_MEDIA/igl/armadillo.obj")?;
    let size = args.get(1).map_or("43k", String::as_str);
    let folder = tempfile::tempdir()?;
    let file = folder.path().canonicalize()?.join("mesh.obj");
    write_model(&file, &Model::of_mesh(of_size(Path::new(path), size)?))?;
    let mut bench = Bench::open(&file)?;
    bench.settle()?;
    bench.make_handles()?;
    let history = bench.drags()?;
    bench.rest()?;
    bench.undo(&history)?;
    bench.settle()?;
    report_memory()
}

/// The mesh with about a quarter, all, or four times its vertices.
fn of_size(path: &Path, size: &str) -> Result<TriMesh, Failure> {
    let mesh = read_model(path, &ReadLimits::default(), &Run::default())?.mesh().clone();
    Ok(match size {
        "43k" => mesh,
        "10k" => Hierarchy::new(&mesh, &[], 500, &Run::default())?.mesh(1).clone(),
        "173k" => in_four(&mesh)?,
        other => return Err(format!("`{other}` is no size (expected 10k, 43k or 173k)").into()),
    })
}

/// Every triangle in four, by the middles of its edges.
fn in_four(mesh: &TriMesh) -> Result<TriMesh, Failure> {
    let mut positions = mesh.positions().to_vec();
    let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
    let mut triangles = Vec::with_capacity(4 * mesh.triangle_count());
    for &[a, b, c] in mesh.triangles() {
        let mut middle = |i: u32, j: u32| {
            *middles.entry([i.min(j), i.max(j)]).or_insert_with(|| {
                positions.push(nalgebra::center(&positions[i as usize], &positions[j as usize]));
                positions.len() as u32 - 1
            })
        };
        let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
        triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    Ok(TriMesh::new(positions, triangles)?)
}

struct Bench {
    files: DocumentFiles,
    workspace: MeshWorkspace,
    document: Document,
    out: Outbox,
    height: (f64, f64),
}

impl Bench {
    fn open(file: &Path) -> Result<Self, Failure> {
        let mut files = DocumentFiles::new(file, std::collections::BTreeMap::default());
        let started = Started::now();
        let (mut workspace, document) = MeshWorkspace::open(&mut files, &Run::default())?;
        workspace.changed(&document);
        let mut out = Outbox::default();
        workspace.greet(&document, &mut out);
        let state = serde_json::to_value(workspace.state(&document))?;
        println!("{} vertices, {} triangles", state["mesh"]["vertices"], state["mesh"]["triangles"]);
        report("opening to the first picture", started.spent());
        let points = out.buffers.iter().find(|b| b.kind == BufferKind::Positions.number()).ok_or("no picture")?;
        let count = points.bytes.len() / 20;
        let y = |v: usize| f32::from_le_bytes(points.bytes[12 * v + 4..12 * v + 8].try_into().unwrap_or_default());
        let center = state["mesh"]["center"][1].as_f64().unwrap_or(0.0);
        let ends = (0..count).map(y).fold((f32::MAX, f32::MIN), |(low, high), y| (low.min(y), high.max(y)));
        let height = (center + f64::from(ends.0), center + f64::from(ends.1));
        Ok(Self { files, workspace, document, out, height })
    }

    fn edit(&mut self, edit: Value) -> Result<(), Failure> {
        let step = self.workspace.edit(&self.document, serde_json::from_value(edit)?)?;
        self.document = step.document;
        self.workspace.changed(&self.document);
        Ok(())
    }

    /// Slices until a picture of the surface is there.
    fn picture(&mut self) -> Result<(), Failure> {
        self.out.buffers.clear();
        while !self.out.buffers.iter().any(|b| b.kind == BufferKind::Positions.number()) {
            if self.workspace.work(&self.document, &mut self.out, &Run::default())? == Work::Rest {
                break;
            }
        }
        Ok(())
    }

    fn settle(&mut self) -> Result<(), Failure> {
        while self.workspace.work(&self.document, &mut self.out, &Run::default())? == Work::More {}
        self.out.buffers.clear();
        Ok(())
    }

    /// The lowest sixth is fixed, the highest twelfth is moved.
    fn make_handles(&mut self) -> Result<(), Failure> {
        let (low, high) = self.height;
        let at = |fraction: f64| low + (high - low) * fraction;
        self.edit(json!({"do": "select_half_space", "point": [0, at(1.0 / 6.0), 0], "normal": [0, -1, 0]}))?;
        self.edit(json!({"do": "add_handle", "kind": "fixed"}))?;
        self.edit(json!({"do": "select_half_space", "point": [0, at(11.0 / 12.0), 0], "normal": [0, 1, 0]}))?;
        let started = Started::now();
        self.edit(json!({"do": "add_handle", "kind": "rigid"}))?;
        self.drag(0)?;
        self.picture()?;
        report("first drag after making handles", started.spent());
        Ok(())
    }

    fn drag(&mut self, step: u32) -> Result<(), Failure> {
        let size = self.height.1 - self.height.0;
        let t = f64::from(step) / f64::from(DRAGS);
        let to = [0.3 * size * t, 0.1 * size * (6.0 * t).sin(), 0.2 * size * t * t];
        self.edit(json!({"do": "drag", "handle": 1, "gesture": step, "time": 1.0, "translation": to.map(|c| c / f64::from(DRAGS) * 4.0),
                         "rotation": [1.0, 0.0, 0.002, 0.0], "scale": [1, 1, 1]}))
    }

    /// A hand that drags, one picture per edit. The documents before each.
    fn drags(&mut self) -> Result<Vec<Document>, Failure> {
        let mut history = Vec::new();
        let mut times = Vec::new();
        for step in 1..=DRAGS {
            history.push(self.document.clone());
            let started = Started::now();
            self.drag(step)?;
            self.picture()?;
            times.push(started.spent());
        }
        report("drag: solve + encode, p95", quantile(&times, 0.95));
        Ok(history)
    }

    /// The energy after one second of the processor's time at rest, against the headless result.
    fn rest(&mut self) -> Result<(), Failure> {
        let started = Started::now();
        let interrupt = Interrupt::new();
        let watch = {
            let interrupt = interrupt.clone();
            std::thread::spawn(move || {
                while started.spent().cpu < Duration::from_secs(1) && !interrupt.is_stopped() {
                    std::thread::park_timeout(Duration::from_millis(5)); // nobody wakes it: a pause
                }
                interrupt.stop();
            })
        };
        let run = Run::with_interrupt(&interrupt);
        while !interrupt.is_stopped() {
            match self.workspace.work(&self.document, &mut self.out, &run) {
                Ok(Work::Rest) | Err(StudioError::Stopped(_)) => break,
                Ok(Work::More) => {}
                Err(error) => return Err(error.into()),
            }
        }
        let spent = started.spent();
        interrupt.stop();
        watch.join().map_err(|_| "the watch failed")?;
        let state = serde_json::to_value(self.workspace.state(&self.document))?;
        let energy = state["solve"]["energy"].as_f64().ok_or("no energy")?;
        self.workspace.save(&self.document, &mut self.files)?;
        self.files.publish()?;
        let expected = self.headless()?;
        println!(
            "1 s after rest: energy / headless  {:10.6}  ({}, {:.0} ms CPU)",
            energy / expected,
            state["solve"]["phase"],
            ms(spent.cpu)
        );
        Ok(())
    }

    fn headless(&self) -> Result<f64, Failure> {
        let run = Run::default();
        let pipeline = &self.document.pipeline;
        let model = read_model(pipeline.mesh(), &ReadLimits::default(), &run)?;
        let solvable = Arc::new(SolvableMesh::new(model.mesh(), &run)?);
        let handles = self.document.mesh_handles();
        let last = handles.times().1;
        let started = Started::now();
        let mut deformer =
            KeyframedDeformer::new(model.mesh(), solvable, handles, &pipeline.settings().keyframed(), &run)?;
        let pose = deformer.pose(last, &run)?;
        report("headless: factorization and solve", started.spent());
        Ok(*pose.report.energies.last().ok_or("no energy")?)
    }

    /// Undo of all drags: to the changed document and its files.
    fn undo(&mut self, history: &[Document]) -> Result<(), Failure> {
        let texts: Vec<String> = history.iter().map(handle_text::write).collect();
        let mut times = Vec::new();
        for (document, text) in history.iter().zip(&texts).rev() {
            let started = Started::now();
            self.document = document.clone();
            self.workspace.changed(&self.document);
            let state = serde_json::to_string(&self.workspace.state(&self.document))?;
            times.push(started.spent());
            if state.is_empty() || handle_text::write(&self.document) != *text {
                return Err("undo gave another document".into());
            }
        }
        report("undo, p95", quantile(&times, 0.95));
        Ok(())
    }
}
