//! `video.encode`: decodes the clip again, renders each frame through its map, and writes it.
//!
//! Four threads, joined by bounded queues: decode → map → render (on the job's pool) → encode. Order is kept, since each
//! queue has one reader and one writer; whichever thread fails, the others run dry and stop.

use std::path::PathBuf;

use crossbeam::channel::{self, Receiver, Sender};

use super::analysis::Tracks;
use super::context::{Context, media_error};
use super::maps::Maps;
use super::stream::{QUEUE, decode};
use super::tiers::Tiers;
use crate::image::Frame;
use crate::media::{Codec, FramePool, Output, VideoInfo, VideoWriter, WriteOptions, WriteReport};
use crate::motion::{ClipMotion, Tier};
use crate::path::VirtualPath;
use crate::pipeline::graph::Graph;
use crate::pipeline::job::Job;
use crate::pipeline::kinds::{self, EncodeSettings, RenderSettings, WarpSettings};
use crate::pipeline::run_error::RunError;
use crate::pipeline::summary::{SegmentSummary, Summary};
use crate::render::{Border, Interpolation, RenderOptions, Renderer};
use crate::warp::Lattice;

/// Writes one clip.
pub(super) fn run(context: &mut Context<'_, '_>, stage: usize, settings: &EncodeSettings) -> Result<(), RunError> {
    let frames = context.required(stage, "frames")?.from;
    let render = context.stage(frames).settings.clone();
    let decode_stage = match render.get::<RenderSettings>() {
        Some(_) => context.required(frames, "frames")?.from,
        None => frames,
    };
    let (input, reader) = context.open(decode_stage)?;
    let info = reader.info().clone();
    let analyzed = render.get::<RenderSettings>().map(|_| analyzed_frames(context, frames)).transpose()?.flatten();
    context.job.progress.begin(context.pass.index, "render", analyzed.or(info.frames_estimate));

    let output = Output::parse(&settings.path);
    let writer =
        VideoWriter::create(&output, &input, &info, &write_options(settings, context.job)).map_err(media_error)?;
    let tiers = render.get::<RenderSettings>().map(|_| tiers(context, frames)).transpose()?;
    let sampler = match (render.get::<RenderSettings>(), &tiers) {
        (Some(render), Some(tiers)) => Some(Sampler::new(context, frames, render, tiers, &writer)?),
        _ => None,
    };
    let (read, written) = stream(context.job, reader, sampler, writer)?;
    context.tell_damage(&read);
    tell(context.summary, &output, &info, written);
    if let Some(tiers) = &tiers {
        tell_path(context, frames, tiers)?;
    }
    Ok(())
}

fn write_options(settings: &EncodeSettings, job: &Job<'_>) -> WriteOptions {
    WriteOptions {
        codec: match settings.codec {
            kinds::Codec::H264 => Codec::H264,
            kinds::Codec::Hevc => Codec::Hevc,
            kinds::Codec::Av1 => Codec::Av1,
            kinds::Codec::Prores => Codec::Prores,
            kinds::Codec::Ffv1 => Codec::Ffv1,
        },
        encoder: None,
        crf: settings.crf,
        preset: settings.preset.clone(),
        bitrate: settings.bitrate.map(|b| b.0),
        threads: job.threads,
        overwrite: job.overwrite,
        strict: settings.strict,
    }
}

/// The warp stage that feeds a render stage, if any.
fn warp_stage(graph: &Graph, render: usize) -> Option<usize> {
    graph.stages[render].edges.iter().find(|e| e.port.name == "warps").map(|e| e.from)
}

/// Frames that the analysis of a render stage's warp saw.
fn analyzed_frames(context: &Context<'_, '_>, render: usize) -> Result<Option<u64>, RunError> {
    let Some(warp) = warp_stage(context.job.graph(), render) else { return Ok(None) };
    let tracks: &Tracks = context.values.get(context.required(warp, "tracks")?)?;
    Ok(Some(tracks.store.frames() as u64))
}

/// Map and render of one stream.
struct Sampler<'v> {
    maps: Maps<'v>,
    renderer: Renderer,
    pool: FramePool,
}

impl<'v> Sampler<'v> {
    fn new(
        context: &'v Context<'_, '_>,
        stage: usize,
        settings: &RenderSettings,
        tiers: &'v Tiers,
        writer: &VideoWriter,
    ) -> Result<Self, RunError> {
        let (warp, path) = warp_and_path(context, stage)?;
        let settings_of_warp = warp_settings(context, warp)?;
        let tracks = context.values.get(context.required(warp, "tracks")?)?;
        let maps = Maps::new(tracks, path, motion(context, warp)?, tiers, settings_of_warp)?;
        let renderer = Renderer::new(RenderOptions {
            interpolation: match settings.interpolation {
                kinds::Interpolation::Bicubic => Interpolation::Bicubic,
                kinds::Interpolation::Lanczos3 => Interpolation::Lanczos3,
            },
            border: match settings.border {
                kinds::Border::Mirror | kinds::Border::Fill => Border::Mirror,
                kinds::Border::Replicate => Border::Replicate,
                kinds::Border::Black | kinds::Border::Crop => Border::Black,
            },
        });
        Ok(Self { maps, renderer, pool: writer.frame_pool() })
    }
}

/// The one warp stage of a render stage, and the path it follows.
fn warp_and_path<'v>(context: &'v Context<'_, '_>, render: usize) -> Result<(usize, &'v VirtualPath), RunError> {
    let none = || RunError::Internal(format!("`{}` has no map", context.stage(render).name));
    let warp = warp_stage(context.job.graph(), render).ok_or_else(none)?;
    Ok((warp, context.values.get(context.required(warp, "path")?)?))
}

fn warp_settings<'v>(context: &'v Context<'_, '_>, warp: usize) -> Result<&'v WarpSettings, RunError> {
    let not_a_warp = || RunError::Internal(format!("`{}` gives no map", context.stage(warp).name));
    context.stage(warp).settings.get::<WarpSettings>().ok_or_else(not_a_warp)
}

/// The clip's motion, where the warp stage is given it.
fn motion<'v>(context: &'v Context<'_, '_>, warp: usize) -> Result<Option<&'v ClipMotion>, RunError> {
    context.edge(warp, "motion").map(|edge| context.values.get(edge)).transpose()
}

/// The tiers of a render stage's frames.
fn tiers(context: &Context<'_, '_>, render: usize) -> Result<Tiers, RunError> {
    let (warp, path) = warp_and_path(context, render)?;
    Ok(Tiers::new(warp_settings(context, warp)?.mode, motion(context, warp)?, path))
}

type Ends = (crate::media::ReadReport, WriteReport);

/// Runs the threads of one stream to their end.
fn stream(
    job: &Job<'_>,
    reader: crate::media::VideoReader,
    sampler: Option<Sampler<'_>>,
    writer: VideoWriter,
) -> Result<Ends, RunError> {
    let (to_work, decoded) = channel::bounded(QUEUE);
    let (to_encoder, rendered) = channel::bounded(QUEUE);
    std::thread::scope(|scope| {
        let decoder = scope.spawn(move || decode(reader, &to_work));
        let encoder = scope.spawn(move || encode(job, writer, &rendered));
        let worked = match sampler {
            Some(sampler) => sample(job, sampler, decoded, &to_encoder),
            None => decoded.iter().try_for_each(|frame| hand_on(&to_encoder, frame)),
        };
        drop(to_encoder);
        let failed = |name: &str| RunError::Internal(format!("the {name}'s thread failed"));
        let read = decoder.join().map_err(|_| failed("decoder"))?.map_err(media_error)?;
        let written = encoder.join().map_err(|_| failed("encoder"))??;
        worked?;
        Ok((read, written))
    })
}

/// Passes something on; a closed queue means that its reader failed and will say why.
fn hand_on<T>(queue: &Sender<T>, item: T) -> Result<(), RunError> {
    queue.send(item).map_err(|_| RunError::Interrupted)
}

/// Maps on a thread of their own, renders here.
fn sample(
    job: &Job<'_>,
    sampler: Sampler<'_>,
    decoded: Receiver<Frame>,
    rendered: &Sender<Frame>,
) -> Result<(), RunError> {
    let Sampler { mut maps, renderer, pool } = sampler;
    let (to_render, mapped) = channel::bounded::<(Frame, Lattice)>(QUEUE);
    std::thread::scope(|scope| {
        let mapper = scope.spawn(move || -> Result<(), RunError> {
            for frame in &decoded {
                job.check_cancel()?;
                let lattice = maps.next(&frame)?;
                hand_on(&to_render, (frame, lattice))?;
            }
            Ok(())
        });
        let sampled = mapped.iter().try_for_each(|(frame, lattice)| {
            let mut out = pool.get().map_err(media_error)?;
            renderer.render(&frame, &lattice, &mut out).map_err(|e| RunError::Internal(e.to_string()))?;
            hand_on(rendered, out)
        });
        drop(mapped);
        let mapped = mapper.join().map_err(|_| RunError::Internal("the mapper's thread failed".to_owned()))?;
        sampled.and(mapped)
    })
}

fn encode(job: &Job<'_>, mut writer: VideoWriter, rendered: &Receiver<Frame>) -> Result<WriteReport, RunError> {
    for (done, frame) in rendered.iter().enumerate() {
        job.check_cancel()?;
        writer.write(frame).map_err(media_error)?;
        job.progress.frames(done as u64 + 1);
    }
    job.check_cancel()?;
    writer.finish().map_err(media_error)
}

fn tell(summary: &mut Summary, output: &Output, info: &VideoInfo, written: WriteReport) {
    summary.outputs.push(PathBuf::from(output.path()));
    summary.frames = written.frames;
    summary.size = Some((info.width as u32, info.height as u32));
    for warning in written.warnings {
        if !summary.warnings.contains(&warning) {
            summary.warnings.push(warning);
        }
    }
}

/// Tells mode and crop of the path that a render stage followed.
fn tell_path(context: &mut Context<'_, '_>, render: usize, tiers: &Tiers) -> Result<(), RunError> {
    let (_, path) = warp_and_path(context, render)?;
    let crop = &path.crop;
    let mean = crop.iter().sum::<f64>() / crop.len().max(1) as f64;
    let least = crop.iter().copied().fold(1.0, f64::min);
    context.summary.crop = Some(mean);
    context.summary.least_crop = Some(least);
    context.summary.segments.extend(tiers.segments.iter().map(|s| SegmentSummary {
        frames: s.frames.start as u64..s.frames.end as u64,
        mode: tier_name(s.tier).to_owned(),
        reason: s.reason.clone(),
    }));
    Ok(())
}

fn tier_name(tier: Tier) -> &'static str {
    match tier {
        Tier::Untouched => "unchanged",
        Tier::Similarity => "similarity",
        Tier::Homography => "homography",
        Tier::Mesh => "mesh",
    }
}
