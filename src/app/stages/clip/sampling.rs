//! `video.render`: each frame through its map, once.

use std::sync::Arc;

use crossbeam::channel::{self, Receiver};

use super::chain::{Chain, ChainMaps};
use super::filling::Filling;
use super::stream::{QUEUE, hand_on};
use crate::pipeline::job::Job;
use crate::pipeline::run_error::RunError;
use crate::pipeline::summary::FillSummary;
use crate::pipeline::threads::start;
use crate::stages::context::Context;
use crate::stages::{Border, Interpolation, RenderSettings, WarpSettings};
use plumbline_image::Frame;
use plumbline_image::render::{self, RenderOptions, Renderer};
use plumbline_image::warp::Lattice;
use plumbline_media::{FramePool, VideoInfo};
use plumbline_num::run::Run;
use plumbline_video::stabilize::{FrameModels, RenderInputs};

/// What earlier passes handed on to the warp stage `stage`; `covered`: the source must cover the output.
pub(crate) fn render_inputs<'v>(
    context: &'v Context<'_, '_>,
    stage: usize,
    covered: bool,
) -> Result<RenderInputs<'v>, RunError> {
    let not_a_warp = || RunError::Internal(format!("`{}` gives no map", context.stage(stage).name));
    Ok(RenderInputs {
        tracks: context.values.get(context.required(stage, "tracks")?)?,
        path: context.values.get(context.required(stage, "path")?)?,
        motion: context.edge(stage, "motion").map(|edge| context.values.get(edge)).transpose()?,
        warp: context.stage(stage).settings.get::<WarpSettings>().ok_or_else(not_a_warp)?,
        covered,
    })
}

/// A frame of the source and what was made of it.
pub(crate) struct Sampled {
    /// The source's frame, where the result is another.
    source: Option<Arc<Frame>>,
    /// The frame to show.
    pub(crate) result: Frame,
}

impl Sampled {
    /// `result`, made of `source`.
    pub(crate) fn new(source: Arc<Frame>, result: Frame) -> Self {
        Self { source: Some(source), result }
    }

    /// A frame that stays as it is.
    pub(crate) fn untouched(frame: Frame) -> Self {
        Self { source: None, result: frame }
    }

    /// The frame of the source.
    pub(crate) fn original(&self) -> &Frame {
        self.source.as_deref().unwrap_or(&self.result)
    }
}

/// Map and render of one stream.
pub(crate) struct Sampler<'v> {
    maps: ChainMaps<'v>,
    drawer: Drawer,
    filling: Option<Filling<'v>>,
}

impl<'v> Sampler<'v> {
    pub(crate) fn new(
        chain: &Chain<'v>,
        models: Option<&'v FrameModels>,
        settings: &RenderSettings,
        video: &VideoInfo,
    ) -> Result<Self, RunError> {
        Ok(Self {
            maps: chain.maps(models, video)?,
            drawer: Drawer {
                renderer: Renderer::new(options(settings)),
                pool: FramePool::new(&chain.shown(video))?,
                averages: chain.shrinks(),
            },
            filling: (settings.border == Border::Fill).then(|| filling(chain, settings)).transpose()?,
        })
    }

    /// For a stream that begins with frame `first` of the clip.
    pub(crate) fn from_frame(
        chain: &Chain<'v>,
        models: Option<&'v FrameModels>,
        settings: &RenderSettings,
        video: &VideoInfo,
        first: usize,
    ) -> Result<Self, RunError> {
        let mut sampler = Self::new(chain, models, settings, video)?;
        sampler.maps.seek(first)?;
        Ok(sampler)
    }

    /// Hands every frame to `sink` in order: mapped on a thread of its own, rendered here. Gives what was filled.
    pub(crate) fn run(
        self,
        job: &Job<'_>,
        frames: Receiver<Frame>,
        mut sink: impl FnMut(Sampled) -> Result<(), RunError>,
    ) -> Result<Option<FillSummary>, RunError> {
        let Self { mut maps, drawer, filling } = self;
        let (to_render, mapped) = channel::bounded::<(Frame, Lattice)>(QUEUE);
        std::thread::scope(|scope| {
            let mapper = start(scope, "mapper", move || {
                frames.iter().try_for_each(|frame| {
                    job.check_cancel()?;
                    let lattice = maps.next(&frame)?;
                    hand_on(&to_render, (frame, lattice))
                })
            })?;
            let sampled = match filling {
                Some(filling) => fill_all(&mapped, filling, &drawer, &mut sink).map(Some),
                None => render_all(&mapped, &drawer, &mut sink).map(|()| None),
            };
            drop(mapped);
            let mapped = mapper.join().map_err(|_| RunError::Internal("the mapper's thread failed".to_owned()))?;
            let filled = sampled?;
            mapped.map(|()| filled)
        })
    }
}

type Mapped = Receiver<(Frame, Lattice)>;

fn render_all(
    mapped: &Mapped,
    drawer: &Drawer,
    sink: &mut impl FnMut(Sampled) -> Result<(), RunError>,
) -> Result<(), RunError> {
    mapped.iter().try_for_each(|(frame, lattice)| {
        let result = drawer.draw(&frame, &lattice)?;
        sink(Sampled::new(Arc::new(frame), result))
    })
}

fn fill_all(
    mapped: &Mapped,
    mut filling: Filling<'_>,
    drawer: &Drawer,
    sink: &mut impl FnMut(Sampled) -> Result<(), RunError>,
) -> Result<FillSummary, RunError> {
    for (frame, lattice) in mapped {
        filling.push(frame, lattice);
        while let Some(sampled) = filling.pop(false, &drawer.renderer, &drawer.pool)? {
            sink(sampled)?;
        }
    }
    while let Some(sampled) = filling.pop(true, &drawer.renderer, &drawer.pool)? {
        sink(sampled)?;
    }
    Ok(filling.summary())
}

/// What makes a frame of one.
struct Drawer {
    renderer: Renderer,
    pool: FramePool,
    /// Pixels become means where the map shrinks.
    averages: bool,
}

impl Drawer {
    fn draw(&self, frame: &Frame, lattice: &Lattice) -> Result<Frame, RunError> {
        let mut result = self.pool.get()?;
        let drawn = if self.averages {
            self.renderer.render_averaged(frame, lattice, &mut result, &Run::default())
        } else {
            self.renderer.render(frame, lattice, &mut result)
        };
        drawn.map_err(|e| RunError::Internal(e.to_string()))?;
        Ok(result)
    }
}

fn filling<'v>(chain: &Chain<'v>, settings: &RenderSettings) -> Result<Filling<'v>, RunError> {
    if chain.shrinks() {
        let help = "take `border = \"crop\"`, or another";
        return Err(RunError::Usage(format!("borders can be filled only where a clip keeps shape and lens; {help}")));
    }
    let no_motion = || RunError::Internal("a border cannot be filled without the clip's motion".to_owned());
    let motion = chain.steady.and_then(|inputs| inputs.motion);
    Ok(Filling::new(settings, motion.ok_or_else(no_motion)?))
}

fn options(settings: &RenderSettings) -> RenderOptions {
    RenderOptions {
        interpolation: match settings.interpolation {
            Interpolation::Bicubic => render::Interpolation::Bicubic,
            Interpolation::Lanczos3 => render::Interpolation::Lanczos3,
        },
        border: match settings.border {
            Border::Mirror | Border::Fill => render::Border::Mirror,
            // Nothing outside is shown, but kernels reach over the edge: black would darken the outermost pixels.
            Border::Replicate | Border::Crop => render::Border::Replicate,
            Border::Black => render::Border::Black,
        },
    }
}
