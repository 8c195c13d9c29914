//! `lens.undistort`: the one map that takes a lens out of every frame of a clip.
//!
//! Points that are tracked in the clip's own frames are carried through the map as they are stored; motion, path and what
//! bends a frame then live in the undistorted picture, and the renderer composes both maps.

use std::sync::Arc;

use nalgebra::Matrix2;

use super::photo::lens::{clip_lens, lens_file};
use super::photo::{rectified, view};
use super::prelude::*;
use super::video_track::focal_px_of;
use crate::pipeline::sizes::{PictureSize, ViewAngles};
use plumbline_camera::{FieldAxis, Projection};
use plumbline_media::VideoInfo;
use plumbline_num::math::{Point2, PointMap};
use plumbline_photo::PhotoWarp;
use plumbline_photo::rectify::{Crop, OutputSize, RectifyInput, RectifyOptions, Target};
use plumbline_video::stabilize::PointCarrier;

/// Settings of `lens.undistort`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LensUndistortSettings {
    /// The lens: auto (the focal length in the metadata of the clip, or fov), a file (lensfun XML, OpenCV or Kalibr YAML, Gyroflow JSON, COLMAP cameras.txt, OCam, our JSON), or a model such as equidistant
    #[schemars(extend("format" = "lens"))]
    pub lens: String,
    /// Field of view, degrees, for a lens named by its model
    #[schemars(range(min = 1.0, max = 360.0))]
    pub fov: Option<f64>,
    /// The direction along which the field of view is measured
    pub fov_axis: FieldAxis,
    /// How directions become the picture: perspective, stereographic, panini, panini:D, mercator, cylindrical, equirectangular or optimized
    pub to: Target,
    /// View direction relative to the camera's: yaw, pitch and roll in degrees
    pub view: ViewAngles,
    /// Crop: auto keeps the clip's aspect ratio, none keeps the curved border, or an aspect ratio such as 16:9
    pub crop: Crop,
    /// Size of the result: 1920x1080, 800x, x600 or 60%; that of the clip if left out
    pub size: Option<PictureSize>,
}

impl Default for LensUndistortSettings {
    fn default() -> Self {
        Self {
            lens: String::new(),
            fov: None,
            fov_axis: FieldAxis::default(),
            to: Target::Fixed(Projection::Rectilinear),
            view: ViewAngles::default(),
            crop: Crop::default(),
            size: None,
        }
    }
}

impl Stage for LensUndistortSettings {
    const KIND: &'static str = "lens.undistort";
    const SUMMARY: &'static str = "finds the one map that takes a lens out of every frame";
    const INPUTS: &'static [Port] = &[Port::one("frames", PortType::Frames, "the clip, for the size of its pictures")];
    const OUTPUTS: &'static [Port] = &[Port::one("warp", PortType::Warp, "the map")];
    const REQUIRED: &'static [&'static str] = &["lens"];
    const MAP: Option<MapStep> = Some(MapStep::Lens);
    type Input = Wired;
    type Output = HandedOn;

    fn over_time(&self) -> TemporalScope {
        TemporalScope::Once
    }

    fn reads(&self) -> Vec<&str> {
        lens_file(&self.lens).into_iter().collect()
    }

    fn memory(&self) -> Vec<MemoryCost> {
        vec![MemoryCost { what: "grid of the map", bytes: 16 << 20, ..MemoryCost::default() }]
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        let decode = context.required(stage, "frames")?.from;
        let (input, reader) = context.open(decode)?;
        let video = reader.info().clone();
        drop(reader);
        let found =
            clip_lens(&self.lens, self.fov, self.fov_axis, (video.width, video.height), || focal_px_of(&input))?;
        found.warnings.into_iter().for_each(|w| context.warn(w));
        let input =
            RectifyInput { lens: &found.lens, lines: &[], soft_lines: &[], found: false, faces: &[], saliency: None };
        let even = |natural| {
            let wanted = self.size.map_or(natural, |size| size.pixels(natural));
            even_size((wanted.0 as f64, wanted.1 as f64), &video)
        };
        let warp = rectified(&input, &options(self, &video), even, &context.job.run())?;
        context.values.put(stage, "warp", Undistorted::new(warp, (video.width, video.height)));
        Ok(HandedOn)
    }
}

/// The map of a clip's lens.
#[derive(Clone)]
pub(super) struct Undistorted {
    warp: Arc<PhotoWarp>,
    /// Size of the clip's own pictures, px.
    pub(super) source: (usize, usize),
}

/// What the settings ask for; if they do not say, the clip's own shape and size.
fn options(settings: &LensUndistortSettings, video: &VideoInfo) -> RectifyOptions {
    let own = OutputSize::Exact(video.width, video.height);
    RectifyOptions {
        target: settings.to.clone(),
        view: view(settings.view),
        crop: match settings.crop {
            // A clip keeps its size, so that `auto` has no border to straighten.
            Crop::Auto => Crop::Rectangle,
            crop => crop,
        },
        size: match (settings.size, settings.crop) {
            (Some(PictureSize::Pixels(size)), _) => OutputSize::Exact(size.width as usize, size.height as usize),
            (_, Crop::Aspect(_)) => OutputSize::Source,
            (_, _) => own,
        },
        ..RectifyOptions::default()
    }
}

/// The size in whole px; where chroma is subsampled, with the nearest even sides, which is what encoders take.
pub(super) fn even_size((width, height): (f64, f64), video: &VideoInfo) -> (usize, usize) {
    let format = video.format;
    let shared =
        (0..format.planes()).map(|i| format.subsampling(i)).fold((0, 0), |(x, y), (sx, sy)| (x.max(sx), y.max(sy)));
    let even = |side: f64, shift: u32, own: usize| {
        let exact = shift == 0 || (side - own as f64).abs() < 1e-9;
        if exact { (side.round() as usize).max(1) } else { 2 * ((side / 2.0).round() as usize).max(1) }
    };
    (even(width, shared.0, video.width), even(height, shared.1, video.height))
}

impl Undistorted {
    /// The map `warp` of a clip of `source` px.
    pub(super) fn new(warp: PhotoWarp, source: (usize, usize)) -> Self {
        Self { warp: Arc::new(warp), source }
    }

    /// Size of the undistorted picture, px.
    pub(super) fn size(&self) -> (usize, usize) {
        self.warp.size
    }

    /// Carries points of the clip's own pictures to where the undistorted picture shows them.
    pub(super) fn carrier(&self) -> PointCarrier<'_> {
        PointCarrier { size: self.warp.size, out_from_src: &*self.warp.forward }
    }
}

impl PointMap for Undistorted {
    fn map(&self, p: Point2) -> Option<Point2> {
        self.warp.field.map(p)
    }

    fn jacobian(&self, p: Point2) -> Option<Matrix2<f64>> {
        self.warp.field.jacobian(p)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_camera::{FieldOfView, Lens};
    use plumbline_num::run::Run;
    use plumbline_num::time::Timestamp;
    use plumbline_photo::rectify::rectify;
    use plumbline_video::track::{FrameQuality, FrameTracks, Observation};

    fn undistorted() -> Undistorted {
        let fov = FieldOfView::degrees(110.0, FieldAxis::Horizontal);
        let lens = Lens::from_field_of_view(Projection::Equidistant, fov, (640.0, 360.0)).expect("a lens");
        let input = RectifyInput { lens: &lens, lines: &[], soft_lines: &[], found: false, faces: &[], saliency: None };
        let target = Target::Fixed(Projection::Rectilinear);
        let options = RectifyOptions { target, size: OutputSize::Exact(640, 360), ..RectifyOptions::default() };
        Undistorted::new(rectify(&input, &options, &Run::default()).expect("a map"), (640, 360))
    }

    #[test]
    fn a_point_is_carried_to_where_the_picture_shows_it() {
        let lens = undistorted();
        let points = [(320.0, 180.0), (100.0, 90.0), (500.0, 300.0), (1.0, 1.0)];
        let observation = |(id, (x, y)): (usize, (f32, f32))| Observation { id: id as u32, x, y, background: true };
        let observations = points.into_iter().enumerate().map(observation).collect();
        let mut tracks = FrameTracks { pts: Timestamp(0), observations, quality: FrameQuality::default() };
        lens.carrier().carry(&mut tracks);
        assert_eq!(tracks.observations.len(), 3, "the corner is cut away");
        for o in &tracks.observations {
            let back = lens.map(Point2::new(f64::from(o.x), f64::from(o.y))).expect("shown");
            let (x, y) = points[o.id as usize];
            assert!((back - Point2::new(f64::from(x), f64::from(y))).norm() < 0.01, "{back} of {x}, {y}");
        }
    }
}
