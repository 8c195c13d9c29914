//! `video.retarget`: a map per frame to another shape.

use super::lens_undistort::{Undistorted, even_size};
use super::prelude::*;
use super::video_importance::EstimatedImportance;
use crate::pipeline::graph::Graph;
use crate::pipeline::sizes::{PictureSize, TargetSize};
use crate::pipeline::summary::WindowSummary;
use crate::stages::LensUndistortSettings;
use plumbline_media::VideoInfo;
use plumbline_num::math::{Homography, PointMap, Similarity2};
use plumbline_photo::AspectRatio;
use plumbline_photo::temporal::{ClipData, ClipGrids, ClipRetargetOptions, retarget_clip};
use plumbline_video::motion::ClipMotion;
use plumbline_video::path::VirtualPath;

/// Settings of `video.retarget`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct VideoRetargetSettings {
    /// The new size as it is shown: 1080x1920, 800x, x600 or 60%; or the new shape, such as 9:16
    pub size: Option<TargetSize>,
    /// Changes of shape below this factor crop first, and warp the rest: 1 only crops, 0 only warps
    #[schemars(range(min = 0.0, max = 1.0))]
    pub crop_below: f64,
}

impl Default for VideoRetargetSettings {
    fn default() -> Self {
        Self { size: None, crop_below: ClipRetargetOptions::default().crop_below }
    }
}

impl Stage for VideoRetargetSettings {
    const KIND: &'static str = "video.retarget";
    const SUMMARY: &'static str = "finds the map of each frame to another shape that keeps and spares what matters";
    const INPUTS: &'static [Port] = &[
        Port::one("importance", PortType::Importance, "the importance of each position of the clip"),
        Port::one("motion", PortType::Motion, "shots, and the motion along which importance is followed"),
        Port::optional("path", PortType::Path, "the virtual camera, where the clip is stabilized first"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("warp", PortType::Warp, "one map per frame")];
    const REQUIRED: &'static [&'static str] = &["size"];
    const MAP: Option<MapStep> = Some(MapStep::Shape);
    type Input = Wired;
    type Output = HandedOn;

    fn memory(&self) -> Vec<MemoryCost> {
        // Positions of sixty rows and columns per moment, twice while they are evened out.
        vec![MemoryCost { what: "rows and columns", bytes_per_clip_frame: 200.0, ..MemoryCost::default() }]
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        let estimated: &EstimatedImportance = context.values.get(context.required(stage, "importance")?)?;
        let motion: &ClipMotion = context.values.get(context.required(stage, "motion")?)?;
        let path: Option<&VirtualPath> =
            context.edge(stage, "path").map(|edge| context.values.get(edge)).transpose()?;
        let lens = lens_behind(context.job.graph(), stage).and_then(|at| context.values.at::<Undistorted>(at, "warp"));
        let size = (motion.width as usize, motion.height as usize);
        let judged = lens.map(|lens| (lens as &dyn PointMap, lens.source));
        let times_s: Vec<f64> = motion.frames.iter().map(|f| motion.timebase.seconds(f.pts)).collect();
        let steps: Vec<Similarity2> = motion.frames.iter().map(|f| f.similarity).collect();
        let shown: &[Homography] = path.map_or(&[], |p| &p.out_from_src);
        let clip =
            ClipData { size, times_s: &times_s, shots: &motion.shots, motion: &steps, shown_from_src: shown, judged };
        let options = ClipRetargetOptions { crop_below: self.crop_below, ..ClipRetargetOptions::default() };
        let wanted = self.size.ok_or_else(|| RunError::Internal("a size is required".to_owned()))?;
        let out = coded_size(wanted, size, &estimated.video);
        let grids: ClipGrids = retarget_clip(&clip, &estimated.importance, out, &options, &context.job.run())?;
        context.summary.window = grids
            .window()
            .map(|w| WindowSummary { kept: [w.fraction.0, w.fraction.1], range_px: [w.range_px.0, w.range_px.1] });
        context.values.put(stage, "warp", grids);
        Ok(HandedOn)
    }
}

/// The `lens.undistort` stage whose map the motion was carried through.
fn lens_behind(graph: &Graph, stage: usize) -> Option<usize> {
    let mut waiting: Vec<usize> = graph.stages[stage].edges.iter().map(|e| e.from).collect();
    while let Some(at) = waiting.pop() {
        if graph.stages[at].settings.get::<LensUndistortSettings>().is_some() {
            return Some(at);
        }
        waiting.extend(graph.stages[at].edges.iter().map(|e| e.from));
    }
    None
}

/// The size of the coded picture that a player shows as asked: rotated where the clip is, in its pixels, with even sides.
fn coded_size(target: TargetSize, size: (usize, usize), video: &VideoInfo) -> (usize, usize) {
    let rotated = (video.rotation_deg / 90.0).round().rem_euclid(2.0) == 1.0;
    match target {
        TargetSize::Size(PictureSize::Pixels(size)) => {
            let (width, height) = (size.width as usize, size.height as usize);
            if rotated { (height, width) } else { (width, height) }
        }
        TargetSize::Size(relative) => {
            let shown = relative.pixels(if rotated { (size.1, size.0) } else { size });
            let (width, height) = if rotated { (shown.1, shown.0) } else { shown };
            even_size((width as f64, height as f64), video)
        }
        TargetSize::Shape(AspectRatio { width: across, height: down }) => {
            let (across, down) = if rotated { (down, across) } else { (across, down) };
            let pixel = video.sample_aspect.map_or(1.0, plumbline_media::Ratio::value);
            let ratio = AspectRatio::new(across / pixel, down).value();
            let (width, height) = (size.0 as f64, size.1 as f64);
            even_size((width.min(height * ratio), height.min(width / ratio)), video)
        }
    }
}
