//! A long clip as a graph of tasks: its analysis windows, its plan, its chunks, and their joining.
//!
//! ```text
//! tracks-0 ─┐         ┌─ leading-0 ─┬─ cameras-0 ─┐       ┌─ render-0 ─┐
//! tracks-1 ─┼─ motion ┼─ leading-1 ─┼─ cameras-1 ─┼─ plan ┼─ render-1 ─┼─ tour.mp4
//! tracks-2 ─┘         └─ leading-2 ─┴─ cameras-2 ─┘       └─ render-2 ─┘
//! ```
//!
//! All names but the last begin with `tour.mp4.`. Where no cameras are asked for, the plan follows the motion.
//!
//! The last one is the task of the whole clip: what it makes counts as done for all others too, for other engines and for
//! `plumbline run`. Parts are in a folder of their own beside the result, which the last task removes.
//!
//! A clip is split by its length in seconds and not into a number of parts, since a batch has clips of any length. Chunks are equal to
//! within a frame: the longest one decides when the clip is done.

use std::ops::Range;
use std::path::{Path, PathBuf};

use super::{Ids, Task, TaskPlan, key_of};
use crate::pipeline::batch::Instance;
use crate::pipeline::estimate::Estimate;
use crate::pipeline::graph::{Edge, Graph, Stage};
use crate::pipeline::items::RECORDS_FOLDER;
use crate::pipeline::job::StageRunner;
use crate::pipeline::kind::Settings;
use crate::pipeline::paths::{to_path, to_text};
use crate::pipeline::plan::Plan;
use crate::pipeline::run_error::RunError;
use crate::pipeline::worker::Order;
use crate::stages::parts::{
    CamerasPartSettings, ChunkSettings, Chunks, ClipParts, KnownTracksSettings, MAX_CHUNKS, MotionPartSettings,
    PartName, PlanSettings, WindowsSettings,
};
use crate::stages::{
    Border, DecodeSettings, EncodeSettings, EncoderChoice, MotionExportSettings, MotionSettings, RenderSettings,
    SmoothSettings, TrackSettings, WarpSettings, find_in_task,
};
use plumbline_media::FrameSpan;
use plumbline_num::time::Timestamp;
use plumbline_video::track::AnalysisWindows;

/// Folder of parts, in [`RECORDS_FOLDER`] beside the result.
const PARTS_FOLDER: &str = "parts";

impl TaskPlan {
    /// Splits clips that are longer than `seconds` into tasks of about this length; `root` is that of the plan. To be called after
    /// [`Self::state_contents`]. Returns, in words, which long clips stay one task and why.
    ///
    /// # Errors
    /// [`RunError::Input`] for a clip that cannot be read; [`RunError::Internal`]: none is known.
    pub fn split(&mut self, root: &Path, seconds: f64, runner: &dyn StageRunner) -> Result<Vec<String>, RunError> {
        let mut ids = Ids { taken: self.tasks.iter().map(|task| task.id.clone()).collect() };
        let (mut tasks, mut notes) = (Vec::new(), Vec::new());
        for task in std::mem::take(&mut self.tasks) {
            let instance = task.instance().map_err(RunError::Internal)?;
            let Some(decode) = instance.graph.stages.iter().find_map(|s| s.settings.get::<DecodeSettings>()) else {
                tasks.push(task);
                continue;
            };
            let path = root.join(to_path(&decode.path));
            // One that cannot be read is an error of its own task.
            let length = runner.clip_seconds(&path).unwrap_or(None);
            let chunks = length.map_or(1, |length| (length / seconds).round().clamp(1.0, MAX_CHUNKS as f64) as usize);
            if chunks < 2 {
                tasks.push(task);
                continue;
            }
            match Stabilization::of(&instance) {
                Err(reason) => {
                    notes.push(format!("{} stays one task: {reason}", task.id));
                    tasks.push(task);
                }
                Ok(stages) => {
                    let times = runner.frame_times(&path, decode)?;
                    if times.is_empty() {
                        tasks.push(task);
                        continue;
                    }
                    let chunks = Chunks::new(times.len(), chunks);
                    tasks.extend(Splitter { task, instance: &instance, stages, times, chunks }.tasks(&mut ids)?);
                }
            }
        }
        self.tasks = tasks;
        Ok(notes)
    }
}

impl Task {
    /// The folder of the parts that this task joins, relative to the root; empty for a task that has no results.
    ///
    /// It follows from the first result and the key, so that parts of another plan are not taken for these, and that a plan cannot name
    /// another folder to be removed.
    pub fn parts_folder(&self) -> String {
        let Some(first) = self.outputs.first() else { return String::new() };
        let digest = blake3::hash(self.key.as_bytes()).to_hex();
        let folder = to_path(first).parent().map(Path::to_owned).unwrap_or_default();
        to_text(folder.join(RECORDS_FOLDER).join(PARTS_FOLDER).join(format!("{}-{}", self.id, &digest[..16])))
    }

    /// Removes the parts that this task joined; to be called at the root.
    ///
    /// # Errors
    /// The system's error.
    pub fn remove_parts(&self) -> std::io::Result<()> {
        let folder: PathBuf = to_path(&self.parts_folder());
        if self.parts.is_none() || !folder.is_dir() {
            return Ok(());
        }
        std::fs::remove_dir_all(&folder)?;
        // The folder of parts of all clips goes with the last of them.
        let _ = folder.parent().map(std::fs::remove_dir);
        Ok(())
    }
}

/// The stages of a clip that is stabilized and nothing else, by index.
struct Stabilization {
    decode: usize,
    track: usize,
    motion: usize,
    warp: usize,
    render: usize,
    encode: usize,
    export: Option<usize>,
}

impl Stabilization {
    /// The stages of `instance`, or why it is not split.
    fn of(instance: &Instance) -> Result<Self, String> {
        let stages = &instance.graph.stages;
        let only = |is: fn(&dyn Settings) -> bool, what: &str| {
            let mut found = stages.iter().enumerate().filter(|(_, s)| is(s.settings.as_ref())).map(|(at, _)| at);
            match (found.next(), found.next()) {
                (Some(at), None) => Ok(at),
                (None, _) => Err(format!("no stage {what}")),
                (Some(_), Some(_)) => Err(format!("several stages {what}")),
            }
        };
        let decode = only(|s| s.get::<DecodeSettings>().is_some(), "reads a clip")?;
        let track = only(|s| s.get::<TrackSettings>().is_some(), "tracks points")?;
        let motion = only(|s| s.get::<MotionSettings>().is_some(), "estimates motion")?;
        let smooth = only(|s| s.get::<SmoothSettings>().is_some(), "plans a path")?;
        let warp = only(|s| s.get::<WarpSettings>().is_some(), "stabilizes")?;
        let render = only(|s| s.get::<RenderSettings>().is_some(), "samples pixels")?;
        let encode = only(|s| s.get::<EncodeSettings>().is_some(), "writes a clip")?;
        let export = stages.iter().position(|s| s.settings.get::<MotionExportSettings>().is_some());
        let known: Vec<usize> =
            [decode, track, motion, smooth, warp, render, encode].into_iter().chain(export).collect();
        if let Some(other) = (0..stages.len()).find(|at| !known.contains(at)) {
            return Err(format!("stage `{}` needs the whole clip", stages[other].name));
        }
        let this = Self { decode, track, motion, warp, render, encode, export };
        this.check(stages).map_or(Ok(this), Err)
    }

    /// Why settings keep the clip from being split.
    fn check(&self, stages: &[Stage]) -> Option<String> {
        let edge = |stage: usize, port: &str| stages[stage].edges.iter().find(|e| e.port.name == port);
        let decode = stages[self.decode].settings.get::<DecodeSettings>()?;
        let render = stages[self.render].settings.get::<RenderSettings>()?;
        let encode = stages[self.encode].settings.get::<EncodeSettings>()?;
        let export = self.export.and_then(|at| stages[at].settings.get::<MotionExportSettings>());
        let reasons = [
            (decode.start.is_some() || decode.end.is_some(), "only a span of it is read"),
            (decode.fps.is_some() || decode.path.contains('%'), "it is a sequence of pictures"),
            (decode.allow_playlist, "it may be a playlist"),
            (edge(self.track, "lens").is_some(), "its lens is undistorted first"),
            (edge(self.warp, "motion").is_none(), "its frames are warped without their motion"),
            (edge(self.render, "warps").is_none_or(|e| e.from != self.warp), "its frames take other maps"),
            (render.border == Border::Fill, "borders are filled from neighboring frames"),
            (edge(self.encode, "side_by_side").is_some(), "the original is shown beside it"),
            (encode.path.contains('%') || encode.path == "-", "the result is no file"),
            (edge(self.encode, "audio").is_some_and(|e| e.from != self.decode), "its sound is of another clip"),
            (
                matches!(encode.encoder, EncoderChoice::Auto | EncoderChoice::Hardware),
                "each machine may have another encoder",
            ),
            (
                export.is_some_and(|e| e.path.is_none() || e.colmap.is_some() || e.gltf.is_some() || e.csv.is_some()),
                "its motion is written in other formats than the motion file",
            ),
        ];
        reasons.into_iter().find(|(applies, _)| *applies).map(|(_, reason)| reason.to_owned())
    }
}

/// Makes the tasks of a clip.
struct Splitter<'a> {
    task: Task,
    instance: &'a Instance,
    stages: Stabilization,
    times: Vec<Timestamp>,
    chunks: Chunks,
}

impl Splitter<'_> {
    /// The tasks of the clip, in their order.
    fn tasks(self, ids: &mut Ids) -> Result<Vec<Task>, RunError> {
        let mut tasks: Vec<Task> = Vec::new();
        let named = |tasks: &[Task]| tasks.iter().map(|task| task.id.clone()).collect::<Vec<_>>();
        let windows = AnalysisWindows::default();
        let groups = Chunks::new(windows.count(self.times.len()), self.chunks.count);
        for (k, group) in groups.ranges().enumerate() {
            tasks.push(self.part(ids, &format!("tracks-{k}"), self.windows(&windows, group)?, &[])?);
        }
        let motion = self.part(ids, "motion", self.motion(), &named(&tasks))?;
        let mut before = vec![motion.id.clone()];
        tasks.push(motion);
        if self.settings::<MotionSettings>(self.stages.motion).cameras {
            let chunks = 0..self.chunks.count;
            let leading = |k| self.part(ids, &format!("leading-{k}"), self.cameras(k, true), &before);
            let mut leading = chunks.clone().map(leading).collect::<Result<Vec<_>, _>>()?;
            let known = named(&leading);
            tasks.append(&mut leading);
            // The shots of a chunk began in it or in front of it.
            let following = |k| self.part(ids, &format!("cameras-{k}"), self.cameras(k, false), &known[..=k]);
            let mut following = chunks.map(following).collect::<Result<Vec<_>, _>>()?;
            before = named(&following);
            tasks.append(&mut following);
        }
        let mut plan = self.part(ids, "plan", self.plan(), &before)?;
        plan.resources.cpus = self.task.resources.cpus;
        let before = [plan.id.clone()];
        tasks.push(plan);
        let spans = self.chunks.ranges().map(|frames| self.span(frames)).collect::<Result<Vec<_>, _>>()?;
        let chunk = |(k, span)| self.part(ids, &format!("render-{k}"), self.chunk(k, span), &before);
        let mut rendered = spans.iter().enumerate().map(chunk).collect::<Result<Vec<_>, _>>()?;
        let after = named(&rendered);
        tasks.append(&mut rendered);
        let mut whole = self.task;
        (whole.after, whole.parts, whole.resources.cpus) = (after, Some(ClipParts { chunks: spans }), 1);
        whole.estimate = Estimate::of_joining(&whole.estimate);
        tasks.push(whole);
        Ok(tasks)
    }

    /// A task of a part, which waits for the tasks `after`.
    fn part(&self, ids: &mut Ids, name: &str, stages: Vec<Stage>, after: &[String]) -> Result<Task, RunError> {
        let id = ids.next(&format!("{}.{name}", self.task.id));
        let graph = Graph { stages };
        let instance = Instance { key: id.clone(), item: None, plan: Plan::of(&graph).into(), graph };
        let order = Order::of(&instance, self.task.order.options.clone());
        let mut resources = self.task.resources;
        // A clip in parts gains by more tasks at once, not by more threads in each.
        resources.cpus = 1;
        let estimate = Estimate::of(&instance, &self.task.estimate.work, resources.cpus);
        Ok(Task {
            id,
            key: key_of(&order, &self.task.inputs)?,
            after: after.to_vec(),
            outputs: instance.outputs().iter().map(to_text).collect(),
            resources,
            estimate,
            part_of: Some(self.task.id.clone()),
            order,
            ..self.task.clone()
        })
    }

    fn span(&self, frames: Range<usize>) -> Result<FrameSpan, RunError> {
        let none = || RunError::Internal(format!("no frames {frames:?} in {}", self.task.id));
        FrameSpan::of(&self.times, frames.clone()).ok_or_else(none)
    }

    /// A stage with new settings, which takes what `edges` give it.
    fn stage(name: &str, kind: &str, settings: std::sync::Arc<dyn Settings>, edges: Vec<Edge>) -> Stage {
        let kind = find_in_task(kind).expect("a kind of this program");
        Stage { name: name.to_owned(), kind, settings, deferred: Vec::new(), edges }
    }

    /// Stage number `at` of the clip.
    fn original(&self, at: usize) -> &Stage {
        &self.instance.graph.stages[at]
    }

    fn settings<S: crate::pipeline::kind::Stage + Clone>(&self, at: usize) -> S {
        self.original(at).settings.get::<S>().cloned().unwrap_or_default()
    }

    /// A stage that takes the frames of the clip alone, behind the one that decodes it.
    fn of_frames<S: crate::pipeline::kind::Stage>(&self, name: &str, settings: S) -> Vec<Stage> {
        let source = self.original(self.stages.decode).clone();
        let kind = find_in_task(S::KIND).expect("a kind of this program");
        let frames = Edge { port: &kind.inputs[0], from: 0, output: &source.kind.outputs[0] };
        let stage = Self::stage(name, S::KIND, std::sync::Arc::new(settings), vec![frames]);
        vec![source, stage]
    }

    fn windows(&self, windows: &AnalysisWindows, group: Range<usize>) -> Result<Vec<Stage>, RunError> {
        let first = windows.read(group.start).start;
        let end = windows.owned(group.end - 1).end.min(self.times.len());
        let settings = WindowsSettings {
            folder: self.task.parts_folder(),
            windows: group,
            span: self.span(first..end)?,
            track: self.settings(self.stages.track),
        };
        Ok(self.of_frames("windows", settings))
    }

    fn motion(&self) -> Vec<Stage> {
        let (folder, track) = (self.task.parts_folder(), self.settings(self.stages.track));
        self.of_frames("motion", MotionPartSettings { folder, chunks: self.chunks, track })
    }

    fn cameras(&self, chunk: usize, leading: bool) -> Vec<Stage> {
        let (folder, motion) = (self.task.parts_folder(), self.settings(self.stages.motion));
        self.of_frames("cameras", CamerasPartSettings { folder, chunks: self.chunks, chunk, leading, motion })
    }

    fn chunk(&self, chunk: usize, span: &FrameSpan) -> Vec<Stage> {
        let settings = ChunkSettings {
            folder: self.task.parts_folder(),
            chunks: self.chunks,
            chunk,
            span: span.clone(),
            warp: self.settings(self.stages.warp),
            render: self.settings(self.stages.render),
            encode: self.settings(self.stages.encode),
        };
        self.of_frames("chunk", settings)
    }

    /// The stages up to the path, of which the tracking is a reading, and the plan in place of warp, render and encode.
    fn plan(&self) -> Vec<Stage> {
        let folder = self.task.parts_folder();
        let mut stages: Vec<Stage> = Vec::new();
        // Where a stage of the clip went.
        let mut at = vec![None; self.instance.graph.stages.len()];
        for (old, stage) in self.instance.graph.stages.iter().enumerate() {
            let mut stage = stage.clone();
            if old == self.stages.track {
                let settings = KnownTracksSettings {
                    folder: folder.clone(),
                    chunks: self.chunks,
                    track: self.settings(old),
                    cameras: Some(self.settings(self.stages.motion)).filter(|motion: &MotionSettings| motion.cameras),
                };
                stage = Self::stage(&stage.name, "part.tracks", std::sync::Arc::new(settings), stage.edges);
            } else if old == self.stages.warp {
                let settings = PlanSettings {
                    folder: folder.clone(),
                    warp: self.settings(old),
                    covered: self.settings::<RenderSettings>(self.stages.render).border == Border::Crop,
                };
                stage = Self::stage("plan", "part.plan", std::sync::Arc::new(settings), stage.edges);
            } else if Some(old) == self.stages.export {
                let path = Some(PartName::Export.text(&folder));
                let settings = std::sync::Arc::new(MotionExportSettings { path, ..MotionExportSettings::default() });
                stage = Self::stage(&stage.name, stage.kind.name, settings, stage.edges);
            } else if [self.stages.render, self.stages.encode].contains(&old) {
                continue;
            }
            for edge in &mut stage.edges {
                // Stages are behind those that they take from.
                edge.from = at[edge.from].unwrap_or(0);
            }
            at[old] = Some(stages.len());
            stages.push(stage);
        }
        stages
    }
}
