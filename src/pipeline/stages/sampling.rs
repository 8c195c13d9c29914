//! `video.render`: each frame through its map, once.

use crossbeam::channel::{self, Receiver};

use super::analysis::Tracks;
use super::context::{Context, changed, media_error};
use super::maps::Maps;
use super::stream::{QUEUE, hand_on};
use super::tiers::Tiers;
use crate::image::Frame;
use crate::media::{FramePool, VideoInfo};
use crate::motion::ClipMotion;
use crate::path::VirtualPath;
use crate::pipeline::job::Job;
use crate::pipeline::kinds::{self, RenderSettings, WarpSettings};
use crate::pipeline::run_error::RunError;
use crate::render::{Border, Interpolation, RenderOptions, Renderer};
use crate::warp::Lattice;

/// What feeds a render stage.
#[derive(Clone, Copy)]
pub(super) struct Feed<'v> {
    pub(super) tracks: &'v Tracks,
    pub(super) path: &'v VirtualPath,
    pub(super) motion: Option<&'v ClipMotion>,
    pub(super) warp: &'v WarpSettings,
}

impl<'v> Feed<'v> {
    /// What earlier passes handed on to the render stage `render`.
    pub(super) fn of(context: &'v Context<'_, '_>, render: usize) -> Result<Self, RunError> {
        let stage = context.required(render, "warps")?.from;
        let not_a_warp = || RunError::Internal(format!("`{}` gives no map", context.stage(stage).name));
        Ok(Self {
            tracks: context.values.get(context.required(stage, "tracks")?)?,
            path: context.values.get(context.required(stage, "path")?)?,
            motion: context.edge(stage, "motion").map(|edge| context.values.get(edge)).transpose()?,
            warp: context.stage(stage).settings.get::<WarpSettings>().ok_or_else(not_a_warp)?,
        })
    }

    /// The tiers of the frames.
    pub(super) fn tiers(&self) -> Tiers {
        Tiers::new(self.warp.mode, self.motion, self.path)
    }

    /// Refuses a clip that is not the one analyzed.
    pub(super) fn check(&self, name: &str, video: &VideoInfo) -> Result<(), RunError> {
        let (before, now) = ((self.tracks.clip.width, self.tracks.clip.height), (video.width, video.height));
        if before == now {
            return Ok(());
        }
        let sizes = format!("{}×{} px, then {}×{} px", before.0, before.1, now.0, now.1);
        Err(changed(name, &sizes))
    }
}

/// A frame of the source and what was made of it.
pub(super) struct Sampled {
    /// The source's frame, where the result is another.
    source: Option<Frame>,
    /// The frame to show.
    pub(super) result: Frame,
}

impl Sampled {
    /// A frame that stays as it is.
    pub(super) fn untouched(frame: Frame) -> Self {
        Self { source: None, result: frame }
    }

    /// The frame of the source.
    pub(super) fn original(&self) -> &Frame {
        self.source.as_ref().unwrap_or(&self.result)
    }
}

/// Map and render of one stream.
pub(super) struct Sampler<'v> {
    maps: Maps<'v>,
    renderer: Renderer,
    pool: FramePool,
}

impl<'v> Sampler<'v> {
    pub(super) fn new(
        feed: Feed<'v>,
        tiers: &'v Tiers,
        settings: &RenderSettings,
        video: &VideoInfo,
    ) -> Result<Self, RunError> {
        Ok(Self {
            maps: Maps::new(feed.tracks, feed.path, feed.motion, tiers, feed.warp)?,
            renderer: Renderer::new(options(settings)),
            pool: FramePool::new(video).map_err(media_error)?,
        })
    }

    /// Hands every frame to `sink` in order: mapped on a thread of its own, rendered here.
    pub(super) fn run(
        self,
        job: &Job<'_>,
        frames: Receiver<Frame>,
        mut sink: impl FnMut(Sampled) -> Result<(), RunError>,
    ) -> Result<(), RunError> {
        let Self { mut maps, renderer, pool } = self;
        let (to_render, mapped) = channel::bounded::<(Frame, Lattice)>(QUEUE);
        std::thread::scope(|scope| {
            let mapper = scope.spawn(move || {
                frames.iter().try_for_each(|frame| {
                    job.check_cancel()?;
                    let lattice = maps.next(&frame)?;
                    hand_on(&to_render, (frame, lattice))
                })
            });
            let sampled = mapped.iter().try_for_each(|(frame, lattice)| {
                let mut result = pool.get().map_err(media_error)?;
                renderer.render(&frame, &lattice, &mut result).map_err(|e| RunError::Internal(e.to_string()))?;
                sink(Sampled { source: Some(frame), result })
            });
            drop(mapped);
            let mapped = mapper.join().map_err(|_| RunError::Internal("the mapper's thread failed".to_owned()))?;
            sampled.and(mapped)
        })
    }
}

fn options(settings: &RenderSettings) -> RenderOptions {
    RenderOptions {
        interpolation: match settings.interpolation {
            kinds::Interpolation::Bicubic => Interpolation::Bicubic,
            kinds::Interpolation::Lanczos3 => Interpolation::Lanczos3,
        },
        border: match settings.border {
            kinds::Border::Mirror | kinds::Border::Fill => Border::Mirror,
            kinds::Border::Replicate => Border::Replicate,
            kinds::Border::Black | kinds::Border::Crop => Border::Black,
        },
    }
}
