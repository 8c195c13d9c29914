//! The maps of a render stage as one: the lens undistorted, the clip stabilized, its shape changed.
//!
//! ```text
//! src_from_out = lens ∘ steady ∘ shape,          each a backward map; any may be missing,
//! ```
//!
//! composed per frame as geometry and sampled on one lattice, so that pixels are interpolated once whatever was asked for.

use super::sampling::render_inputs;
use crate::pipeline::run_error::RunError;
use crate::stages::context::{Context, changed};
use crate::stages::lens_undistort::Undistorted;
use crate::stages::{LensUndistortSettings, VideoRetargetSettings};
use plumbline_image::Frame;
use plumbline_image::warp::{Lattice, Map, WarpField};
use plumbline_media::VideoInfo;
use plumbline_num::run::Run;
use plumbline_photo::temporal::ClipGrids;
use plumbline_video::stabilize::{FrameMaps, FrameModels, PlanSummary, RenderInputs, select_models};

/// What a render stage applies to each frame.
pub(crate) struct Chain<'v> {
    lens: Option<&'v Undistorted>,
    pub(crate) steady: Option<RenderInputs<'v>>,
    shape: Option<&'v ClipGrids>,
}

impl<'v> Chain<'v> {
    /// What earlier passes and stages handed on to the render stage `render`; `covered`: the source must cover the output.
    pub(crate) fn of(context: &'v Context<'_, '_>, render: usize, covered: bool) -> Result<Self, RunError> {
        let mut chain = Self { lens: None, steady: None, shape: None };
        for edge in context.stage(render).edges.iter().filter(|e| e.port.name == "warps") {
            let settings = &context.stage(edge.from).settings;
            if settings.get::<LensUndistortSettings>().is_some() {
                chain.lens = Some(context.values.get(edge)?);
            } else if settings.get::<VideoRetargetSettings>().is_some() {
                chain.shape = Some(context.values.get(edge)?);
            } else {
                chain.steady = Some(render_inputs(context, edge.from, covered)?);
            }
        }
        Ok(chain)
    }

    /// A stabilization alone.
    pub(crate) fn of_steady(inputs: RenderInputs<'v>) -> Self {
        Self { lens: None, steady: Some(inputs), shape: None }
    }

    /// Refuses a clip that is not the one analyzed.
    pub(crate) fn check(&self, name: &str, video: &VideoInfo) -> Result<(), RunError> {
        let before = match (self.lens, &self.steady) {
            (Some(lens), _) => lens.source,
            (None, Some(inputs)) => (inputs.tracks.width, inputs.tracks.height),
            (None, None) => return Ok(()),
        };
        if before == (video.width, video.height) {
            return Ok(());
        }
        let sizes = format!("{}×{} px, then {}×{} px", before.0, before.1, video.width, video.height);
        Err(changed(name, &sizes))
    }

    /// Frames that the analysis saw, where there was one.
    pub(crate) fn frames(&self) -> Option<u64> {
        self.steady.as_ref().map(|inputs| inputs.tracks.store.frames() as u64)
    }

    /// Refuses a clip of another length than the one analyzed.
    pub(crate) fn check_length(&self, name: &str, frames: u64) -> Result<(), RunError> {
        match self.frames() {
            Some(before) if before != frames => Err(changed(name, &format!("{before} frames, then {frames}"))),
            _ => Ok(()),
        }
    }

    /// The video that becomes of `video`.
    pub(crate) fn shown(&self, video: &VideoInfo) -> VideoInfo {
        let mut shown = video.clone();
        let own = (video.width, video.height);
        let undistorted = self.lens.map_or(own, Undistorted::size);
        (shown.width, shown.height) = self.shape.map_or(undistorted, ClipGrids::size);
        shown
    }

    /// Some map may shrink the picture so far that it must be averaged.
    pub(crate) fn shrinks(&self) -> bool {
        self.lens.is_some() || self.shape.is_some()
    }

    /// The motion models of the frames, where they are stabilized.
    pub(crate) fn models(&self, run: &Run) -> Result<Option<FrameModels>, RunError> {
        Ok(self.steady.as_ref().map(|inputs| select_models(inputs, run)).transpose()?)
    }

    /// The figures of the path and the models that the frames follow, where they are stabilized.
    pub(crate) fn plan(&self, models: Option<&FrameModels>) -> Option<PlanSummary> {
        let (inputs, models) = self.steady.as_ref().zip(models)?;
        Some(PlanSummary::of(inputs.motion, inputs.path, models))
    }

    /// Maps of successive frames of `video`.
    pub(crate) fn maps(&self, models: Option<&'v FrameModels>, video: &VideoInfo) -> Result<ChainMaps<'v>, RunError> {
        let steady = self.steady.as_ref().zip(models);
        let shown = self.shown(video);
        Ok(ChainMaps {
            lens: self.lens,
            steady: steady.map(|(inputs, models)| FrameMaps::new(inputs, models)).transpose()?,
            shape: self.shape,
            size: (shown.width, shown.height),
            constant: None,
            next: 0,
        })
    }
}

/// The composed maps of successive frames.
pub(crate) struct ChainMaps<'v> {
    lens: Option<&'v Undistorted>,
    steady: Option<FrameMaps<'v>>,
    shape: Option<&'v ClipGrids>,
    /// Size of the output, px.
    size: (usize, usize),
    /// The map, where it is the same for all frames.
    constant: Option<Lattice>,
    next: usize,
}

impl ChainMaps<'_> {
    /// Makes `frame` the next frame.
    pub(crate) fn seek(&mut self, frame: usize) -> Result<(), RunError> {
        self.next = frame;
        Ok(self.steady.as_mut().map_or(Ok(()), |steady| steady.seek(frame))?)
    }

    /// The map of the next frame, sampled for rendering.
    pub(crate) fn next(&mut self, frame: &Frame) -> Result<Lattice, RunError> {
        if let Some(constant) = &self.constant {
            return Ok(constant.clone());
        }
        let mut field = WarpField::identity();
        if let Some(grids) = self.shape {
            field = field.then(Map::Radial(Box::new(grids.frame(self.next).map())));
        }
        if let Some(steady) = &mut self.steady {
            field.chain.extend(steady.next(frame)?.chain);
        }
        if let Some(lens) = self.lens {
            field = field.then(Map::Radial(Box::new(lens.clone())));
        }
        self.next += 1;
        let lattice = Lattice::between(&field, self.size, (frame.width, frame.height));
        if self.steady.is_none() && self.shape.is_none() {
            self.constant = Some(lattice.clone());
        }
        Ok(lattice)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_camera::{FieldAxis, FieldOfView, Lens, Projection};
    use plumbline_image::{Layout, PixelFormat};
    use plumbline_num::math::{Point2, PointMap, Similarity2};
    use plumbline_num::run::Run;
    use plumbline_photo::rectify::{OutputSize, RectifyInput, RectifyOptions, Target, rectify};
    use plumbline_photo::temporal::{ClipData, ClipImportance, ClipRetargetOptions, retarget_clip};

    #[test]
    fn the_lens_comes_first_and_the_shape_last() {
        let fov = FieldOfView::degrees(100.0, FieldAxis::Horizontal);
        let lens = Lens::from_field_of_view(Projection::Equidistant, fov, (640.0, 360.0)).expect("a lens");
        let input = RectifyInput { lens: &lens, lines: &[], soft_lines: &[], found: false, faces: &[], saliency: None };
        let target = Target::Fixed(Projection::Rectilinear);
        let options = RectifyOptions { target, size: OutputSize::Exact(640, 360), ..RectifyOptions::default() };
        let lens = Undistorted::new(rectify(&input, &options, &Run::default()).expect("a map"), (640, 360));
        let (times_s, importance) = ([0.0, 0.04], ClipImportance::new((640, 360)));
        let motion = [Similarity2::IDENTITY; 2];
        let clip = ClipData {
            size: (640, 360),
            times_s: &times_s,
            shots: std::slice::from_ref(&(0..2)),
            motion: &motion,
            shown_from_src: &[],
            judged: None,
        };
        let grids = retarget_clip(&clip, &importance, (202, 360), &ClipRetargetOptions::default(), &Run::default())
            .expect("grids");
        let map = |lens, shape, size| ChainMaps { lens, steady: None, shape, size, constant: None, next: 0 };
        let frame = Frame::new(PixelFormat::opaque(Layout::Gray, 8), 640, 360);
        let both = map(Some(&lens), Some(&grids), (202, 360)).next(&frame).expect("a map");
        for p in [(1.0, 2.0), (100.0, 180.0), (201.0, 350.0), (30.0, 300.0)].map(|(x, y)| Point2::new(x, y)) {
            let expected = lens.map(grids.frame(0).map().map(p).expect("defined")).expect("shown");
            let found = both.src_from_out(p).expect("shown");
            assert!((found - expected).norm() < 0.05, "{p}: {found}, not {expected}");
        }
        assert_eq!(both.size(), (202, 360));
    }
}
