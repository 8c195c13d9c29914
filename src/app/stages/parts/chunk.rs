//! A chunk of a clip: some of its frames, rendered by the plan of the whole and encoded.

use std::io::Read;

use super::{Chunks, PartName, made_before, read_motion};
use crate::stages::clip::chain::Chain;
use crate::stages::clip::encoding::{Stream, Streamed};
use crate::stages::clip::sampling::Sampler;
use crate::stages::clip::sink::Sink;
use crate::stages::files::write_whole;
use crate::stages::prelude::*;
use crate::stages::{Border, EncodeSettings, RenderSettings, WarpSettings};
use plumbline_media::{FrameSpan, Output};
use plumbline_num::files::IfExists;
use plumbline_video::motion::ClipMotion;
use plumbline_video::path::VirtualPath;
use plumbline_video::stabilize::{FrameMaps, FrameModels, PlanFile, RenderInputs, Tracks};

/// Settings of a chunk.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct ChunkSettings {
    /// The folder of parts
    #[schemars(extend("format" = "path"))]
    pub(crate) folder: String,
    /// The chunks of the clip
    pub(crate) chunks: Chunks,
    /// Index of the chunk
    pub(crate) chunk: usize,
    /// Its frames
    pub(crate) span: FrameSpan,
    /// How frames are warped
    pub(crate) warp: WarpSettings,
    /// How they are sampled
    pub(crate) render: RenderSettings,
    /// How they are encoded; the path is that of the result
    pub(crate) encode: EncodeSettings,
}

impl Stage for ChunkSettings {
    const KIND: &'static str = "part.chunk";
    const SUMMARY: &'static str = "renders and encodes a chunk of a clip by the plan of the whole";
    const INPUTS: &'static [Port] = &[Port::one("frames", PortType::Frames, "the pictures")];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the encoded pictures")];
    type Input = Wired;
    type Output = HandedOn;

    fn memory(&self) -> Vec<MemoryCost> {
        [self.warp.memory(), self.render.memory(), self.encode.memory()].concat()
    }

    fn writes(&self) -> Vec<String> {
        vec![PartName::Chunk(self.chunk).text(&self.folder)]
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        let decode = context.required(stage, "frames")?.from;
        let (_, reader) = context.open_span(decode, &self.span)?;
        let plan = ChunkPlan::read(self, context)?;
        let inputs = plan.inputs(self);
        let chain = Chain::of_steady(inputs);
        let frames = self.span.frames.clone();
        context.job.progress.begin(context.pass.index, "render", Some(frames.len() as u64));
        let sampler = Sampler::from_frame(&chain, Some(&plan.models), &self.render, reader.info(), frames.start)?;
        let path = PartName::Chunk(self.chunk).in_folder(&self.folder);
        let sink = Sink::of_part(&self.encode, context.job, &chain.shown(reader.info()), &path)?;
        let stream = Stream { job: context.job, reader, sampler: Some(sampler), album: None };
        let Streamed { read, sinks, .. } = stream.run(vec![sink])?;
        for sink in sinks {
            let (_, size, written) = sink.finish(context.job)?;
            let part = Output::parse(&path);
            crate::stages::clip::summary::report_file(context.summary, &part, size, written);
        }
        context.report_damage(&read);
        if read.shortfall().is_some() {
            // The task of the whole clip reads no frame.
            write_whole(&PartName::CutShort.in_folder(&self.folder), "", IfExists::Replace)?;
        }
        Ok(HandedOn)
    }

    fn preflight(&self) -> Result<(), RunError> {
        Ok(plumbline_media::check_encoder(self.encode.codec(), &self.encode.encoder)?)
    }
}

/// The plan of a clip, with the tracks that one chunk takes.
struct ChunkPlan {
    motion: ClipMotion,
    path: VirtualPath,
    models: FrameModels,
    tracks: Tracks,
}

impl ChunkPlan {
    fn read(settings: &ChunkSettings, context: &Context<'_, '_>) -> Result<Self, RunError> {
        let motion = read_motion(&PartName::Motion.in_folder(&settings.folder))?;
        let mut text = String::new();
        let plan = PartName::Plan.in_folder(&settings.folder);
        let unreadable = |e| RunError::Input(format!("{}: {e}", plan.display()));
        made_before(&plan)?.take(MAX_PLAN_BYTES).read_to_string(&mut text).map_err(unreadable)?;
        let (path, models) = PlanFile::from_json(&text)?.into_plan(Some(&motion), &settings.warp)?;
        let tracks = Tracks::of_parts(std::iter::empty::<Result<_, RunError>>(), &motion)?;
        let mut this = Self { motion, path, models, tracks };
        let support = FrameMaps::new(&this.inputs(settings), &this.models)?.support(settings.span.frames.clone())?;
        this.tracks = context.joined_tracks(&settings.folder, settings.chunks, &support, &this.motion)?;
        Ok(this)
    }

    fn inputs<'a>(&'a self, settings: &'a ChunkSettings) -> RenderInputs<'a> {
        RenderInputs {
            tracks: &self.tracks,
            path: &self.path,
            motion: Some(&self.motion),
            warp: &settings.warp,
            covered: settings.render.border == Border::Crop,
        }
    }
}

/// Longest plan that is read, bytes: of a day at 60 frames/s, 200 bytes per frame, it is a fourth.
const MAX_PLAN_BYTES: u64 = 4 << 30;
