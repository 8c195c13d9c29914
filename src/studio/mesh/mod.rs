//! The mesh workspace: handles on a surface, moved by hand, over time.
//!
//! The document ([`document`]) is a pipeline file with a stage `mesh.deform` ([`pipeline_text`]), its file of handles ([`handle_text`]) and
//! the selection. Edits ([`edit`]) are functions of it. The surface that is shown is solved in slices ([`solver`]) and sent in buffers
//! ([`encode`]).

pub mod ask;
pub mod document;
pub mod edit;
pub mod encode;
pub mod handle_text;
pub mod keys;
pub mod message;
pub mod overlay;
pub mod pipeline_text;
pub mod solver;
pub mod state;
#[cfg(test)]
mod tests;
pub mod vertices;

use std::path::Path;
use std::sync::Arc;

use serde::Deserialize;

use crate::error::StudioError;
use crate::files::DocumentFiles;
use crate::outbox::Outbox;
use crate::workspace::{Answer, Step, Work, Workspace};
use document::MeshDocument;
use encode::{BufferKind, Encoder};
use overlay::{Overlay, Overlays};
use pipeline_text::PipelineText;
use plumbline_num::run::Run;
use plumbline_shape::mesh::{Model, ReadLimits, VertexGraph, read_model};
use plumbline_shape::surface::SolvableMesh;
use solver::{Phase, Shown, Solver};
use state::{HandleState, MeshInfo, OverlayState, SelectionState, SetState, SolveState, State};

/// Maximum size of a mesh file, bytes: above it a browser has no memory for the buffers.
const MAX_MESH_BYTES: u64 = 2 << 30;
/// Maximum number of vertices and of face corners.
const MAX_ELEMENTS: u64 = 1 << 25;
/// Maximum size of a pipeline file, bytes.
const MAX_PIPELINE_BYTES: u64 = 4 << 20;

/// What the windows look at; what is left out stays.
#[derive(Debug, Default, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(optional_fields))]
#[serde(default, deny_unknown_fields)]
pub struct View {
    /// The time that is shown.
    pub time: Option<f64>,
    /// What colors mean.
    pub overlay: Option<Overlay>,
}

/// What changed since it was sent.
#[derive(Clone, Copy, Debug, Default)]
struct Stale {
    surface: bool,
    selection: bool,
    owners: bool,
}

/// The mesh workspace.
#[derive(Debug)]
pub struct MeshWorkspace {
    model: Model,
    graph: VertexGraph,
    encoder: Encoder,
    info: MeshInfo,
    solver: Solver,
    /// The time that the page asked for; the last key without one.
    time: Option<f64>,
    overlay: OverlayState,
    overlays: Overlays,
    gesture: Option<edit::Gesture>,
    /// What was drawn last: documents share what they have in common.
    drawn: Option<MeshDocument>,
    stale: Stale,
}

impl MeshWorkspace {
    fn surface(&self) -> edit::Surface<'_> {
        edit::Surface { rest: self.model.mesh().positions(), solvable: &self.solver.solvable, graph: &self.graph }
    }

    fn time(&self, document: &MeshDocument) -> f64 {
        let (first, last) = document.times();
        self.time.unwrap_or(last).clamp(first.min(last), last.max(first))
    }

    fn next(&self) -> Work {
        if self.solver.phase() == Phase::Rest { Work::Rest } else { Work::More }
    }

    fn send_surface(&mut self, out: &mut Outbox) {
        let bytes = self.encoder.positions(&self.solver.solvable, self.solver.shown());
        out.buffer(BufferKind::Positions.number(), 0, &bytes);
        let energies: Vec<f32> = self.solver.curve.iter().map(|e| *e as f32).collect();
        out.buffer(BufferKind::Energies.number(), 0, &energies);
    }

    fn send_overlay(&mut self, document: &MeshDocument, out: &mut Outbox) -> Result<(), StudioError> {
        let cotangents = document.pipeline.settings().options.cotangents;
        let values = self.overlays.of(self.overlay.kind, &self.solver.solvable, self.solver.shown(), cotangents)?;
        self.overlay.high = values.as_ref().map_or(0.0, |v| v.high);
        let scalars = values.map_or_else(Vec::new, |v| self.encoder.scalars(&v.values));
        out.buffer(BufferKind::Scalars.number(), 0, &scalars);
        Ok(())
    }

    fn send_marks(&mut self, document: &MeshDocument, out: &mut Outbox) {
        if std::mem::take(&mut self.stale.selection) {
            out.buffer(BufferKind::Selection.number(), 0, &document.selection);
        }
        if std::mem::take(&mut self.stale.owners) {
            let mut owners = vec![0_u16; self.model.mesh().vertex_count()];
            document.region.outside.iter().for_each(|v| owners[*v as usize] = u16::MAX);
            for (k, handle) in document.handles.iter().enumerate() {
                handle.mesh.vertices.iter().for_each(|v| owners[*v as usize] = k as u16 + 1);
            }
            out.buffer(BufferKind::Owners.number(), 0, &owners);
        }
    }
}

impl Workspace for MeshWorkspace {
    type Document = MeshDocument;
    type Edit = message::Edit;
    type View = View;
    type Ask = ask::Ask;
    type State = State;

    const NAME: &'static str = "mesh";

    fn open(files: &mut DocumentFiles, run: &Run) -> Result<(Self, Self::Document), StudioError> {
        let pipeline = opened_pipeline(files)?;
        let path = files.confined(pipeline.mesh())?;
        let limits = ReadLimits { max_bytes: MAX_MESH_BYTES, max_elements: MAX_ELEMENTS, ..ReadLimits::default() };
        let input = |why: String| StudioError::Input { path: pipeline.mesh().to_owned(), why };
        let model = read_model(&path, &limits, run).map_err(|e| input(bare(&e)))?;
        if model.mesh().triangle_count() == 0 {
            return Err(input("has no triangles: there is no surface to deform".to_owned()));
        }
        let solvable = Arc::new(SolvableMesh::new(model.mesh(), run)?);
        let handles = pipeline.handles();
        let text = files.read(&handles, handle_text::MAX_BYTES)?;
        let document = handle_text::read(pipeline.clone(), text.as_deref(), &handles, model.mesh().positions())?;
        let encoder = Encoder::new(model.mesh(), &solvable);
        let graph = VertexGraph::new(&solvable.mesh);
        let solver = Solver::new(model.mesh(), solvable);
        let name = file_name(pipeline.mesh());
        let info = MeshInfo::new(&name, &model, &solver, &encoder.center);
        let workspace = Self {
            model,
            graph,
            encoder,
            info,
            solver,
            time: None,
            overlay: OverlayState::default(),
            overlays: Overlays::default(),
            gesture: None,
            drawn: None,
            stale: Stale { surface: true, selection: true, owners: true },
        };
        Ok((workspace, document))
    }

    fn edit(&mut self, document: &Self::Document, edit: Self::Edit) -> Result<Step<Self::Document>, StudioError> {
        let mut gesture = self.gesture.take();
        let step = edit::apply(document, edit, &self.surface(), &mut gesture);
        self.gesture = gesture;
        step
    }

    fn view(&mut self, document: &Self::Document, view: Self::View) -> Result<(), StudioError> {
        if let Some(time) = view.time {
            self.time = Some(keys::checked_time(time)?);
            self.solver.set(document, self.time(document));
        }
        if let Some(overlay) = view.overlay {
            self.overlay = OverlayState { kind: overlay, high: 0.0 };
        }
        self.stale.surface |= view.overlay.is_some() || self.solver.exact;
        Ok(())
    }

    fn changed(&mut self, document: &Self::Document) {
        let old = self.drawn.replace(document.clone());
        self.stale.selection |= old.as_ref().is_none_or(|d| !Arc::ptr_eq(&d.selection, &document.selection));
        let same_handles = |d: &MeshDocument| {
            let pairs = d.handles.iter().zip(&document.handles);
            d.handles.len() == document.handles.len()
                && pairs.into_iter().all(|(a, b)| Arc::ptr_eq(a, b) || a.mesh.vertices == b.mesh.vertices)
                && Arc::ptr_eq(&d.region, &document.region)
        };
        self.stale.owners |= old.as_ref().is_none_or(|d| !same_handles(d));
        self.solver.set(document, self.time(document));
        // Without handles there is nothing to solve, and the rest shape to be shown.
        let had_handles = old.as_ref().is_none_or(|d| !d.handles.is_empty());
        self.stale.surface |= had_handles && document.handles.is_empty();
    }

    fn state(&self, document: &Self::Document) -> Self::State {
        let time = self.time(document);
        let rest = self.model.mesh().positions();
        let (first, last) = document.times();
        let settings = document.pipeline.settings();
        let output = document.pipeline.output();
        State {
            mesh: self.info.clone(),
            handles: document.handles.iter().map(|h| HandleState::new(&h.mesh, rest, time)).collect(),
            active: document.active,
            selection: SelectionState::new(document, &self.solver),
            sets: document.sets.iter().map(|(n, s)| SetState { name: n.clone(), vertices: s.vertices.len() }).collect(),
            outside: document.region.outside.len(),
            time,
            times: [first, last],
            options: serde_json::to_value(settings).unwrap_or_default(),
            frames: settings.frames,
            frames_ready: self.solver.frames().len(),
            seconds: output.and_then(|o| o.seconds),
            output: output.map(|o| file_name(Path::new(&o.path))),
            solve: SolveState::new(&self.solver),
            overlay: self.overlay,
            files: [file_name(document.pipeline.path()), file_name(&document.pipeline.handles())],
        }
    }

    fn greet(&mut self, document: &Self::Document, out: &mut Outbox) {
        out.buffer(BufferKind::Triangles.number(), 0, self.model.mesh().triangles().as_flattened());
        self.send_surface(out);
        if self.send_overlay(document, out).is_err() {
            self.overlay = OverlayState::default();
        }
        self.stale = Stale { surface: false, selection: true, owners: true };
        self.send_marks(document, out);
        let frames: Vec<_> = self.solver.frames().to_vec();
        for (k, pose) in frames.iter().enumerate() {
            let bytes = self.encoder.positions(&self.solver.solvable, pose);
            out.buffer(BufferKind::Frame.number(), k as u32, &bytes);
        }
    }

    fn work(&mut self, document: &Self::Document, out: &mut Outbox, run: &Run) -> Result<Work, StudioError> {
        self.send_marks(document, out);
        // What was asked for is shown before a solve that may be long.
        if std::mem::take(&mut self.stale.surface) {
            self.send_surface(out);
            self.send_overlay(document, out)?;
            return Ok(self.next());
        }
        let shown = self.solver.slice(document, run);
        self.solver.take_warnings().into_iter().for_each(|text| out.notice(text));
        match shown {
            Ok(Shown::Frame(k)) => {
                let pose = self.solver.frames()[k].clone();
                let bytes = self.encoder.positions(&self.solver.solvable, &pose);
                out.buffer(BufferKind::Frame.number(), k as u32, &bytes);
            }
            Ok(Shown::Surface) => {
                self.send_surface(out);
                self.send_overlay(document, out)?;
            }
            Ok(Shown::Nothing) | Err(_) => {}
        }
        shown?;
        Ok(self.next())
    }

    fn save(&self, document: &Self::Document, files: &mut DocumentFiles) -> Result<(), StudioError> {
        files.write(document.pipeline.path(), document.pipeline.text().as_bytes());
        files.write(document.pipeline.handles(), handle_text::write(document).into_bytes());
        Ok(())
    }

    fn ask(
        &mut self,
        document: &Self::Document,
        ask: Self::Ask,
        _files: &DocumentFiles,
        run: &Run,
    ) -> Result<Answer, StudioError> {
        let mut asked = ask::Asked { document, model: &self.model, solver: &mut self.solver, run };
        let answer = ask::answer(&mut asked, ask);
        self.stale.surface = true;
        answer
    }
}

/// The pipeline that was opened, or a new one for the mesh that was.
fn opened_pipeline(files: &DocumentFiles) -> Result<PipelineText, StudioError> {
    let opened = files.opened().to_owned();
    let is_pipeline = opened.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
    let path = if is_pipeline { opened.clone() } else { files.side_file(".deform.toml") };
    match files.read(&path, MAX_PIPELINE_BYTES)? {
        Some(bytes) => {
            let text = std::str::from_utf8(&bytes)
                .map_err(|e| StudioError::Input { path: path.clone(), why: format!("is no text: {e}") })?;
            let found = PipelineText::read(&path, text)?;
            // Beside a mesh: the deformation that was made of it before.
            if is_pipeline || same_file(found.mesh(), &opened) {
                return Ok(found);
            }
            Err(StudioError::Input { path, why: format!("deforms {}, not this mesh", found.mesh().display()) })
        }
        None if is_pipeline => Err(StudioError::Input { path, why: "there is no such file".to_owned() }),
        None => PipelineText::begin(&path, &opened, &files.side_file(".handles.json")),
    }
}

fn same_file(a: &Path, b: &Path) -> bool {
    a == b || a.canonicalize().ok().zip(b.canonicalize().ok()).is_some_and(|(a, b)| a == b)
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// The message of an error without the path, which is shown beside it.
fn bare(error: &plumbline_shape::mesh::MeshError) -> String {
    use plumbline_shape::mesh::MeshError;
    match error {
        MeshError::InFile { .. } => {
            std::error::Error::source(error).map_or_else(|| error.to_string(), ToString::to_string)
        }
        other => other.to_string(),
    }
}
