//! `video.encode`: decodes the clip again, renders each frame through its map, and writes it.
//!
//! ```text
//! decode → map → render ─┬→ encode           each arrow a bounded queue between two threads
//!                        ├→ side by side → encode
//!                        └→ album                      a few pictures for a report
//! ```
//!
//! Encode and report stages that take the same pictures share one stream: a frame is decoded and rendered once, however many
//! files it goes to. Order is kept, since each queue has one reader and one writer; whichever thread fails, the others run
//! dry and stop. A file gets its name only after every thread has reached the end without a fault.

use crossbeam::channel::{self, Receiver};

use super::chain::Chain;
use super::sampling::{Sampled, Sampler};
use super::sink::{Branch, Sink, distribute};
use super::stream::{QUEUE, decode};
use super::summary::{report_file, report_plan};
use crate::pipeline::job::Job;
use crate::pipeline::run_error::RunError;
use crate::pipeline::summary::FillSummary;
use crate::pipeline::threads::start;
use crate::stages::context::Context;
use crate::stages::video_report::Album;
use crate::stages::{Border, EncodeSettings, RenderSettings, ReportSettings};
use plumbline_image::Frame;
use plumbline_media::{Input, PassthroughStreams, ReadReport, VideoInfo, VideoReader};

/// Writes the files of all encode stages that take the same pictures as `stage`, and fills the album of their reports, if
/// `stage` is the first of them.
pub(crate) fn run(context: &mut Context<'_, '_>, stage: usize) -> Result<(), RunError> {
    let pictures = context.required(stage, "frames")?.from;
    let stages = takers_of(context, pictures);
    if stages.first() != Some(&stage) {
        return Ok(());
    }
    let render = context.stage(pictures).settings.clone();
    match render.get::<RenderSettings>() {
        Some(settings) => rendered(context, &stages, pictures, settings),
        None => copied(context, &stages, pictures),
    }
}

/// Encode and report stages of this pass that take the pictures of stage `pictures`.
fn takers_of(context: &Context<'_, '_>, pictures: usize) -> Vec<usize> {
    let takes = |&s: &usize| {
        let settings = &context.stage(s).settings;
        (settings.get::<EncodeSettings>().is_some() || settings.get::<ReportSettings>().is_some())
            && context.edge(s, "frames").is_some_and(|e| e.from == pictures)
    };
    context.pass.stages.iter().copied().filter(takes).collect()
}

/// Writes the pictures of the decode stage `source` as they are.
fn copied(context: &mut Context<'_, '_>, stages: &[usize], source: usize) -> Result<(), RunError> {
    let (input, reader) = context.open(source)?;
    context.job.progress.begin(context.pass.index, "encode", reader.info().frames_estimate);
    let others = other_inputs(context, stages, source)?;
    let sinks = sinks(context, stages, source, &input, reader.info(), &others)?;
    let mut album = Album::wanted(context, stages, reader.info())?;
    let Streamed { read, sinks, .. } =
        Stream { job: context.job, reader, sampler: None, album: album.as_mut() }.run(sinks)?;
    finish(context, sinks)?;
    context.report_damage(&read);
    context.values.put(source, Album::PORT, album);
    Ok(())
}

/// Writes the pictures of the render stage `render`.
fn rendered(
    context: &mut Context<'_, '_>,
    stages: &[usize],
    render: usize,
    settings: &RenderSettings,
) -> Result<(), RunError> {
    let source = context.required(render, "frames")?.from;
    let (input, reader) = context.open(source)?;
    let others = other_inputs(context, stages, source)?;
    let chain = Chain::of(context, render, settings.border == Border::Crop)?;
    chain.check(input.name(), reader.info())?;
    context.job.progress.begin(context.pass.index, "render", chain.frames().or(reader.info().frames_estimate));

    let models = chain.models(&context.job.run())?;
    let sampler = Sampler::new(&chain, models.as_ref(), settings, reader.info())?;
    let sinks = sinks(context, stages, source, &input, &chain.shown(reader.info()), &others)?;
    let mut album = Album::wanted(context, stages, reader.info())?;
    let stream = Stream { job: context.job, reader, sampler: Some(sampler), album: album.as_mut() };
    let Streamed { read, sinks, filled } = stream.run(sinks)?;
    chain.check_length(input.name(), read.frames)?;
    let plan = chain.plan(models.as_ref());
    finish(context, sinks)?;
    context.report_damage(&read);
    if let Some(plan) = plan {
        report_plan(context.summary, plan);
    }
    context.summary.filled = filled;
    context.values.put(render, Album::PORT, album);
    Ok(())
}

/// The clips other than that of decode stage `source` from which `stages` take their sound.
fn other_inputs(
    context: &mut Context<'_, '_>,
    stages: &[usize],
    source: usize,
) -> Result<Vec<(usize, Input)>, RunError> {
    let donors = stages.iter().filter_map(|&s| context.edge(s, "audio")).map(|e| e.from).filter(|&s| s != source);
    let donors: Vec<usize> = donors.collect();
    donors.into_iter().map(|stage| Ok((stage, context.input(stage)?))).collect()
}

/// Starts the files of the encode stages among `stages`, whose pictures come from the decode stage `source`.
pub(crate) fn sinks(
    context: &Context<'_, '_>,
    stages: &[usize],
    source: usize,
    input: &Input,
    video: &VideoInfo,
    others: &[(usize, Input)],
) -> Result<Vec<Sink>, RunError> {
    let sink = |&stage: &usize| {
        let no_encode = || RunError::Internal(format!("`{}` writes no file", context.stage(stage).name));
        let settings = context.stage(stage).settings.get::<EncodeSettings>().ok_or_else(no_encode)?;
        let passthrough = match context.edge(stage, "audio").map(|e| e.from) {
            None => PassthroughStreams::None,
            Some(from) if from == source => PassthroughStreams::OfSource,
            Some(from) => match others.iter().find(|(at, _)| *at == from) {
                Some((_, other)) => PassthroughStreams::Of(other.clone()),
                None => return Err(RunError::Internal(format!("`{}` is not open", context.stage(from).name))),
            },
        };
        Sink::create(settings, context.job, input, video, passthrough, context.edge(stage, "side_by_side").is_some())
    };
    let encodes = stages.iter().filter(|s| context.stage(**s).settings.get::<EncodeSettings>().is_some());
    encodes.map(sink).collect()
}

/// Gives the files their names and reports them.
pub(crate) fn finish(context: &mut Context<'_, '_>, sinks: Vec<Sink>) -> Result<(), RunError> {
    for sink in sinks {
        let (output, size, written) = sink.finish(context.job)?;
        report_file(context.summary, &output, size, written);
    }
    Ok(())
}

/// What a stream gives back.
pub(crate) struct Streamed {
    pub(crate) read: ReadReport,
    /// Their files are whole but unfinished.
    pub(crate) sinks: Vec<Sink>,
    /// What was filled at the borders.
    pub(crate) filled: Option<FillSummary>,
}

/// One stream from a decoder to its sinks.
pub(crate) struct Stream<'v, 'j> {
    pub(crate) job: &'v Job<'j>,
    pub(crate) reader: VideoReader,
    pub(crate) sampler: Option<Sampler<'v>>,
    pub(crate) album: Option<&'v mut Album>,
}

impl Stream<'_, '_> {
    /// Runs the threads to their end.
    pub(crate) fn run(self, sinks: Vec<Sink>) -> Result<Streamed, RunError> {
        let Self { job, reader, sampler, album } = self;
        let (to_work, decoded) = channel::bounded(QUEUE);
        std::thread::scope(|scope| {
            let decoder = start(scope, "decoder", move || decode(reader, &to_work))?;
            let (mut branches, mut encoders) = (Vec::<Branch>::new(), Vec::new());
            for sink in sinks {
                let (queue, pictures) = channel::bounded(QUEUE);
                branches.push(sink.branch(queue));
                encoders.push(start(scope, "encoder", move || sink.encode(job, &pictures))?);
            }
            let worked = work(job, sampler, decoded, &branches, album);
            drop(branches);
            let failed = |name: &str| RunError::Internal(format!("the {name}'s thread failed"));
            let read = decoder.join().map_err(|_| failed("decoder"))??;
            let encoded = encoders.into_iter().map(|e| e.join().map_err(|_| failed("encoder"))?);
            let sinks = encoded.collect::<Result<Vec<Sink>, RunError>>()?;
            Ok(Streamed { read, sinks, filled: worked? })
        })
    }
}

/// Samples the frames and hands them to the album and the branches; reports progress.
fn work(
    job: &Job<'_>,
    sampler: Option<Sampler<'_>>,
    decoded: Receiver<Frame>,
    branches: &[Branch],
    mut album: Option<&mut Album>,
) -> Result<Option<FillSummary>, RunError> {
    let mut done = 0;
    let mut hand_out = |sampled: Sampled| {
        job.check_cancel()?;
        if let Some(album) = &mut album {
            album.look(&sampled);
        }
        distribute(sampled, branches)?;
        done += 1;
        job.progress.frames(done);
        Ok(())
    };
    match sampler {
        Some(sampler) => sampler.run(job, decoded, hand_out),
        None => decoded.iter().try_for_each(|frame| hand_out(Sampled::untouched(frame))).map(|()| None),
    }
}
