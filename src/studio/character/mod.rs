//! The character workspace: a skeleton found or made by hand, weights, poses, movements.
//!
//! The document ([`document`]) has what the files say; edits (`edit`) are functions of it. What takes long (extraction, weights) is
//! computed on threads of its own (`background`) and kept by what it was computed from (`rig`). The pose is found by the call of the stage `character.pose`
//! (`solve`), so that a saved document, run, gives the surface that was shown.

mod background;
pub mod document;
mod edit;
mod export;
mod files;
pub mod message;
pub mod pipeline_text;
mod rig;
mod solve;
mod state;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use nalgebra::{Matrix4, Point3};

use crate::error::StudioError;
use crate::files::DocumentFiles;
use crate::outbox::Outbox;
use crate::workspace::{Answer, Step, Work, Workspace};
use background::Computed;
use document::{CharacterDocument, PoseDocument, SkeletonSource};
use edit::Around;
use message::{Ask, BufferKind, Compared, METHODS, SkinningMethod, State, Tab, View};
use plumbline_num::run::Run;
use plumbline_shape::character::{Pose, Skeleton, Skin, SkinWeights};
use plumbline_shape::mesh::{Model, ReadLimits, TriMesh, neighbors_of_vertices, read_model};
use plumbline_shape::surface::DistortionMetrics;
use rig::{Following, Rigs, fault};

/// Bounds of a mesh that a browser can show.
const MAX_MESH_BYTES: u64 = 2 << 30;
const MAX_ELEMENTS: u64 = 1 << 25;
/// Joints of a vertex that the page is sent.
const SENT: usize = 4;

/// What changed since it was sent.
#[derive(Clone, Copy, Debug, Default)]
#[expect(clippy::struct_excessive_bools, reason = "a set of independent parts, each named")]
struct Stale {
    skeleton: bool,
    weights: bool,
    heat: bool,
    pose: bool,
    compare: bool,
}

impl Stale {
    const ALL: Self = Self { skeleton: true, weights: true, heat: true, pose: true, compare: true };
}

/// The character workspace.
#[derive(Debug)]
pub struct CharacterWorkspace {
    model: Model,
    mesh: Arc<TriMesh>,
    neighbors: Vec<Vec<u32>>,
    center: Point3<f64>,
    files: DocumentFiles,
    rigs: Rigs,
    metrics: DistortionMetrics,
    name: String,
    view: View,
    /// The pose of the clip is shown, not that of the document.
    plays: bool,
    shown: Option<Shown>,
    drawn: Option<CharacterDocument>,
    compared: Vec<Compared>,
    stale: Stale,
    notices: Vec<String>,
}

/// A pose, and what it is shown of.
#[derive(Debug)]
struct Shown {
    pose: Pose,
    skeleton: Arc<Skeleton>,
    of: Arc<PoseDocument>,
    /// The time in the clip, where it is a pose of one.
    time: Option<f64>,
}

/// What is known of a document: skeleton, weights, skin.
struct Known {
    skeleton: Arc<Skeleton>,
    weights: Arc<SkinWeights>,
    skin: Arc<Skin>,
}

impl Known {
    /// How the surface follows by a method.
    fn following<'a>(&'a self, document: &'a CharacterDocument, method: SkinningMethod) -> Following<'a> {
        Following {
            skeleton: &self.skeleton,
            skin: &self.skin,
            weights: &self.weights,
            method,
            model: document.model.as_ref(),
            details: document.pipeline.settings().details,
        }
    }
}

impl CharacterWorkspace {
    fn around(&mut self, document: &CharacterDocument) -> Result<Around<'_>, StudioError> {
        Ok(Around {
            shown: self.shown_now(document)?,
            time: self.time(document),
            mesh: &self.mesh,
            neighbors: &self.neighbors,
            rigs: &mut self.rigs,
            files: &self.files,
            model: &self.model,
        })
    }

    fn tab(&self) -> Tab {
        self.view.tab.unwrap_or_default()
    }

    /// The time in the clip, where the pose of one is shown.
    fn time(&self, document: &CharacterDocument) -> Option<f64> {
        document.shown_clip().filter(|_| self.plays).map(|_| self.view.time.unwrap_or(0.0))
    }

    /// The pose that the last slice showed, found again where the document or the time is another one by now.
    fn shown_now(&self, document: &CharacterDocument) -> Result<Option<Pose>, StudioError> {
        let Some(skeleton) = self.rigs.skeleton(&document.skeleton) else { return Ok(None) };
        let is_of =
            |s: &&Shown| s.time.is_none() && Arc::ptr_eq(&s.of, &document.pose) && Arc::ptr_eq(&s.skeleton, &skeleton);
        match self.shown.as_ref().filter(is_of) {
            Some(shown) if self.time(document).is_none() => Ok(Some(shown.pose.clone())),
            _ => self.pose(document, &skeleton, &Run::default()).map(Some),
        }
    }

    /// The pose that is shown.
    fn pose(&self, document: &CharacterDocument, skeleton: &Skeleton, run: &Run) -> Result<Pose, StudioError> {
        match document.shown_clip().zip(self.time(document)) {
            Some((clip, time)) => solve::clip_pose(skeleton, clip, time),
            None => Ok(solve::solved(skeleton, document, run)?.pose),
        }
    }

    fn known(&mut self, document: &CharacterDocument) -> Result<Option<Known>, StudioError> {
        let Some(skeleton) = self.rigs.skeleton(&document.skeleton) else { return Ok(None) };
        let Some(weights) = self.rigs.weights(&document.weights, &skeleton) else { return Ok(None) };
        let skin = self.rigs.skin(&skeleton, &weights)?;
        Ok(Some(Known { skeleton, weights, skin }))
    }

    fn frames(&self, kind: BufferKind, item: u32, globals: &[Matrix4<f64>], out: &mut Outbox) {
        let shift = Matrix4::new_translation(&solve::shift(&self.center));
        let numbers: Vec<f32> =
            globals.iter().flat_map(|g| (shift * g).iter().map(|c| *c as f32).collect::<Vec<_>>()).collect();
        out.buffer(kind.number(), item, &numbers);
    }

    fn relative(&self, positions: &[Point3<f64>]) -> Vec<[f32; 3]> {
        let relative = |p: &Point3<f64>| {
            let d = p - self.center;
            [d.x as f32, d.y as f32, d.z as f32]
        };
        positions.iter().map(relative).collect()
    }

    fn send_weights(weights: Option<&SkinWeights>, out: &mut Outbox) {
        let rows = weights.map(|w| w.rows().collect::<Vec<_>>()).unwrap_or_default();
        let at = |row: &[plumbline_shape::character::Influence], k: usize| {
            row.get(k).map_or((0, 0.0), |i| (i.joint, i.weight))
        };
        let joints: Vec<u16> = rows.iter().flat_map(|row| (0..SENT).map(|k| at(row, k).0 as u16)).collect();
        let values: Vec<f32> = rows
            .iter()
            .flat_map(|row| {
                let sum: f64 = (0..SENT).map(|k| at(row, k).1).sum();
                (0..SENT).map(move |k| (at(row, k).1 / sum.max(f64::MIN_POSITIVE)) as f32)
            })
            .collect();
        out.buffer(BufferKind::SkinJoints.number(), 0, &joints);
        out.buffer(BufferKind::SkinWeights.number(), 0, &values);
    }

    fn send_heat(&self, weights: Option<&SkinWeights>, out: &mut Outbox) {
        let joint = self.view.joint.filter(|_| self.tab() == Tab::Weights);
        let heat = weights.zip(joint).filter(|(w, j)| (*j as usize) < w.joint_count());
        let heat: Vec<f32> =
            heat.map_or_else(Vec::new, |(w, j)| (0..w.vertex_count()).map(|v| w.weight(v, j) as f32).collect());
        out.buffer(BufferKind::Heat.number(), 0, &heat);
    }

    /// Frames and surface in the pose.
    fn send_pose(&mut self, document: &CharacterDocument, out: &mut Outbox, run: &Run) -> Result<(), StudioError> {
        let Some(skeleton) = self.rigs.skeleton(&document.skeleton) else {
            self.shown = None;
            self.frames(BufferKind::PosedFrames, 0, &[], out);
            out.buffer::<f32>(BufferKind::Positions.number(), 0, &[]);
            return Ok(());
        };
        let pose = self.pose(document, &skeleton, run)?;
        let globals = skeleton.globals(&pose).map_err(fault)?;
        self.frames(BufferKind::PosedFrames, 0, &globals, out);
        let (time, of) = (self.time(document), document.pose.clone());
        self.shown = Some(Shown { pose, skeleton: skeleton.clone(), of, time });
        let mut positions = Vec::new();
        // The page skins linearly itself, and with as many joints as it was sent.
        let here = |known: &Known| {
            let plain = document.skinning == SkinningMethod::Linear && document.pipeline.settings().details.is_none();
            plain && known.weights.most_influences() <= SENT
        };
        if let Some(known) = self.known(document)?
            && !here(&known)
        {
            let posed = self.rigs.positions(&known.following(document, document.skinning), &globals, run)?;
            positions = self.relative(&posed);
        }
        out.buffer(BufferKind::Positions.number(), 0, positions.as_flattened());
        self.send_onion(document, &skeleton, out)
    }

    /// Poses of the clip before and after the time that is shown.
    fn send_onion(
        &self,
        document: &CharacterDocument,
        skeleton: &Skeleton,
        out: &mut Outbox,
    ) -> Result<(), StudioError> {
        /// More would hide the character.
        const MAX_ONION: u32 = 12;
        let Some((count, apart)) = self.view.onion.filter(|o| o.0 > 0 && o.1 > 0.0 && o.1.is_finite()) else {
            return Ok(());
        };
        let Some(clip) = document.shown_clip().filter(|_| self.tab() == Tab::Animate) else { return Ok(()) };
        let count = count.min(MAX_ONION);
        let now = self.view.time.unwrap_or(0.0);
        for item in 0..2 * count {
            let steps = if item < count { f64::from(item) - f64::from(count) } else { f64::from(item - count + 1) };
            let pose = solve::clip_pose(skeleton, clip, now + steps * apart)?;
            self.frames(BufferKind::Onion, item, &skeleton.globals(&pose).map_err(fault)?, out);
        }
        Ok(())
    }

    /// Methods that are compared: regression where a trained skin fits.
    fn methods(&self, document: &CharacterDocument, skeleton: &Skeleton) -> Vec<SkinningMethod> {
        let trained = edit::model_fault(document, &self.mesh, skeleton).is_none();
        METHODS.iter().map(|m| m.0).chain(trained.then_some(SkinningMethod::Regression)).collect()
    }

    /// Every method in the pose, one a slice.
    fn compare(&mut self, document: &CharacterDocument, out: &mut Outbox, run: &Run) -> Result<Work, StudioError> {
        let (Some(known), Some(shown)) = (self.known(document)?, &self.shown) else { return Ok(Work::Rest) };
        let globals = known.skeleton.globals(&shown.pose).map_err(fault)?;
        let methods = self.methods(document, &known.skeleton);
        let item = self.compared.len();
        let Some(method) = methods.get(item).copied() else { return Ok(Work::Rest) };
        let posed = self.rigs.positions(&known.following(document, method), &globals, run)?;
        let shape = self.metrics.measure(&posed);
        let volume = shape.volume_ratio.unwrap_or(1.0);
        self.compared.push(Compared { method, volume, stretch: shape.rms_stretch });
        out.buffer(BufferKind::Compared.number(), item as u32, self.relative(&posed).as_flattened());
        Ok(if self.compared.len() < methods.len() { Work::More } else { Work::Rest })
    }

    /// What takes long: a look at what runs, or its result.
    fn compute(
        &mut self,
        document: &CharacterDocument,
        out: &mut Outbox,
        run: &Run,
    ) -> Result<Computed<()>, StudioError> {
        let Some(skeleton) = self.rigs.skeleton(&document.skeleton) else {
            let SkeletonSource::Found(finding) = &document.skeleton else { return Ok(Computed::Failed) };
            return Ok(self.rigs.find(finding, run)?.map(|found| {
                found.notices.iter().for_each(|text| out.notice(text.clone()));
                self.stale = Stale::ALL;
            }));
        };
        if self.rigs.weights(&document.weights, &skeleton).is_some() {
            return Ok(Computed::Failed);
        }
        Ok(self.rigs.weigh(&document.weights, &skeleton, run)?.map(|notices| {
            out.notices.extend(notices);
            self.stale = Stale { skeleton: self.stale.skeleton, ..Stale::ALL };
        }))
    }

    fn send(&mut self, document: &CharacterDocument, out: &mut Outbox, run: &Run) -> Result<(), StudioError> {
        let skeleton = self.rigs.skeleton(&document.skeleton);
        if std::mem::take(&mut self.stale.skeleton) {
            let rest = skeleton.as_ref().map(|s| s.rest_globals()).unwrap_or_default();
            self.frames(BufferKind::RestFrames, 0, &rest, out);
        }
        let weights = skeleton.and_then(|s| self.rigs.weights(&document.weights, &s));
        if std::mem::take(&mut self.stale.weights) {
            Self::send_weights(weights.as_deref(), out);
        }
        if std::mem::take(&mut self.stale.heat) {
            self.send_heat(weights.as_deref(), out);
        }
        if std::mem::take(&mut self.stale.pose) {
            self.stale.compare = true;
            self.send_pose(document, out, run)?;
        }
        Ok(())
    }
}

fn not_ready() -> StudioError {
    StudioError::NotReady("skeleton and weights are still being computed")
}

impl Workspace for CharacterWorkspace {
    type Document = CharacterDocument;
    type Edit = message::Edit;
    type View = View;
    type Ask = Ask;
    type State = State;

    const NAME: &'static str = "character";

    fn open(files: &mut DocumentFiles, run: &Run) -> Result<(Self, Self::Document), StudioError> {
        let pipeline = files::pipeline(files)?;
        let path = files.confined(pipeline.mesh())?;
        let limits = ReadLimits { max_bytes: MAX_MESH_BYTES, max_elements: MAX_ELEMENTS, ..ReadLimits::default() };
        let input = |why: String| StudioError::Input { path: pipeline.mesh().to_owned(), why };
        let model = read_model(&path, &limits, run).map_err(|e| input(e.to_string()))?;
        if model.mesh().triangle_count() == 0 {
            return Err(input("has no triangles: there is no surface to pose".to_owned()));
        }
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let opened = files::open(files, pipeline.clone(), model)?;
        let mesh = Arc::new(opened.model.mesh().clone());
        let (low, high) = mesh.bounding_box().unwrap_or_default();
        let workspace = Self {
            neighbors: neighbors_of_vertices(mesh.vertex_count(), mesh.triangles()),
            center: nalgebra::center(&low, &high),
            files: files.clone(),
            rigs: Rigs::new(mesh.clone()),
            metrics: DistortionMetrics::new(&mesh),
            model: opened.model,
            mesh,
            name,
            view: View::default(),
            plays: false,
            shown: None,
            drawn: None,
            compared: Vec::new(),
            stale: Stale::ALL,
            notices: opened.notices,
        };
        Ok((workspace, opened.document))
    }

    fn edit(&mut self, document: &Self::Document, edit: Self::Edit) -> Result<Step<Self::Document>, StudioError> {
        edit::apply(document, edit, &mut self.around(document)?)
    }

    fn view(&mut self, _document: &Self::Document, view: Self::View) -> Result<(), StudioError> {
        if let Some(time) = view.time {
            if !time.is_finite() {
                return Err(StudioError::request(format!("{time} is no time")));
            }
            self.view.time = Some(time);
        }
        if let Some(tab) = view.tab {
            // Methods are compared in what was shown last: the pose or the clip.
            if tab != Tab::Compare {
                self.plays = tab == Tab::Animate;
            }
            (self.view.tab, self.view.joint) = (Some(tab), view.joint);
            self.stale.heat = true;
        }
        if view.onion.is_some() {
            self.view.onion = view.onion;
        }
        self.stale.pose = true;
        Ok(())
    }

    fn changed(&mut self, document: &Self::Document) {
        let old = self.drawn.replace(document.clone());
        let same = old.as_ref();
        let skeleton = same.is_none_or(|d| d.skeleton != document.skeleton);
        let weights = skeleton || same.is_none_or(|d| !same_weights(&d.weights, &document.weights));
        self.rigs.stop_others(&document.skeleton, &document.weights);
        self.stale.skeleton |= skeleton;
        self.stale.weights |= weights;
        self.stale.heat |= weights;
        self.stale.pose = true;
    }

    fn state(&self, document: &Self::Document) -> Self::State {
        self.state_of(document)
    }

    fn greet(&mut self, document: &Self::Document, out: &mut Outbox) {
        out.buffer(BufferKind::Triangles.number(), 0, self.mesh.triangles().as_flattened());
        out.buffer(BufferKind::Rest.number(), 0, self.relative(self.mesh.positions()).as_flattened());
        self.notices.drain(..).for_each(|text| out.notice(text));
        let _ = document;
        self.stale = Stale::ALL;
    }

    fn work(&mut self, document: &Self::Document, out: &mut Outbox, run: &Run) -> Result<Work, StudioError> {
        // What is known is shown while the rest is computed.
        self.send(document, out, run)?;
        if !matches!(self.compute(document, out, run)?, Computed::Failed) {
            return Ok(Work::More);
        }
        if self.tab() != Tab::Compare {
            return Ok(Work::Rest);
        }
        if std::mem::take(&mut self.stale.compare) {
            self.compared.clear();
        }
        self.compare(document, out, run)
    }

    fn save(&self, document: &Self::Document, files: &mut DocumentFiles) -> Result<(), StudioError> {
        if document.skeleton == SkeletonSource::None {
            return files::save_without_skeleton(document, files);
        }
        let skeleton = self.rigs.skeleton(&document.skeleton).ok_or_else(not_ready)?;
        let weights = self.rigs.weights(&document.weights, &skeleton).ok_or_else(not_ready)?;
        files::save(document, (&skeleton, &weights), files)
    }

    fn ask(
        &mut self,
        document: &Self::Document,
        ask: Self::Ask,
        _files: &DocumentFiles,
        run: &Run,
    ) -> Result<Answer, StudioError> {
        match ask {
            Ask::Export { format } => self.export(document, format, run),
            Ask::ExportFrames { rate } => self.export_frames(document, rate, run),
            Ask::CopyPose => self.copy_pose(document),
            Ask::Command => Ok(Answer::Value(Self::command(document).into())),
        }
    }
}

fn same_weights(a: &document::WeightSource, b: &document::WeightSource) -> bool {
    use document::WeightSource::{Computed, Given};
    match (a, b) {
        (Computed(a), Computed(b)) => a == b,
        (Given(a, _), Given(b, _)) => Arc::ptr_eq(a, b),
        _ => false,
    }
}
