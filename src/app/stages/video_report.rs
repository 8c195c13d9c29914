//! `video.report`: gathers the results of the other stages, and writes them as a page or as JSON.
//!
//! The pictures are taken while the result is encoded ([`Album`]); all else is there when the last file is whole.

mod album;
mod in_plane;
mod in_space;
mod shown;

use in_plane::{Windows, curves};
use shown::Shown;

use super::clip::encoding;
use super::files::try_begin;
use super::prelude::*;
use crate::pipeline::paths::to_path;
use crate::pipeline::summary::Summary;
use crate::report::{Chart, Clip, Crop, Curve, Curves, Outcome, Report, ReportFormat};
pub(super) use album::Album;
use plumbline_video::motion::ClipMotion;
use plumbline_video::path::VirtualPath;
use plumbline_video::stabilize::PathDeviations;

/// Settings of `video.report`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ReportSettings {
    /// The report to write: NAME.html, a page complete in itself, or NAME.json
    #[schemars(extend("format" = "path", "report" = true))]
    pub path: String,
}

impl Stage for ReportSettings {
    const KIND: &'static str = "video.report";
    const SUMMARY: &'static str =
        "writes a report: figures and the path; as a page also plots, and pictures before and after";
    const INPUTS: &'static [Port] = &[
        Port::one("frames", PortType::Frames, "the pictures of the result"),
        Port::one("path", PortType::Path, "the virtual camera"),
        Port::one("motion", PortType::Motion, "the camera's own motion"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the report")];
    const REQUIRED: &'static [&'static str] = &["path"];
    type Input = Wired;
    type Output = HandedOn;

    fn memory(&self) -> Vec<MemoryCost> {
        // A dozen pictures of at most 640 px, twice while the page is put together; a dozen plots with two curves each, as
        // numbers and as text.
        vec![MemoryCost {
            what: "pictures and plots",
            bytes: 4 << 20,
            bytes_per_clip_frame: 480.0,
            ..MemoryCost::default()
        }]
    }

    fn writes(&self) -> Vec<String> {
        vec![self.path.clone()]
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        encoding::run(context, stage)?;
        context.job.check_cancel()?;
        let format = ReportFormat::of(&self.path).map_err(RunError::Usage)?;
        let text = gathered(context, stage)?.written(format);
        context.write_file(&to_path(&self.path), text)?;
        Ok(HandedOn)
    }

    fn preflight(&self) -> Result<(), RunError> {
        try_begin(&to_path(&self.path))
    }
}

/// The content of the report.
fn gathered(context: &Context<'_, '_>, stage: usize) -> Result<Report, RunError> {
    let pictures = context.required(stage, "frames")?.from;
    let album: Option<&Option<Album>> = context.values.at(pictures, Album::PORT);
    let no_album = || RunError::Internal("no pictures were taken for the report".to_owned());
    let album = album.and_then(Option::as_ref).ok_or_else(no_album)?;
    let motion: &ClipMotion = context.values.get(context.required(stage, "motion")?)?;
    let path: &VirtualPath = context.values.get(context.required(stage, "path")?)?;
    let summary = &*context.summary;
    let shown = album.shown();
    let windows = Windows::of(motion, path, shown);
    let shots = motion.shots.clone();
    Ok(Report {
        clip: clip(summary, motion),
        outcome: outcome(summary),
        shake: summary.shake,
        crop: summary.crop.map(|mean| Crop { mean, least: summary.least_crop }),
        readout_s: summary.readout_s,
        times_s: times_s(motion),
        shots,
        segments: summary.segments.clone(),
        path: plots(motion, path, &windows, shown),
        path_note: in_plane::NOTE.to_owned(),
        crop_over_time: Some(crop_chart(path)),
        cameras: motion.cameras.as_ref().map(|cameras| in_space::cameras(cameras, path, shown)),
        moments: album.moments(&windows, path),
        warnings: summary.warnings.clone(),
    })
}

fn clip(summary: &Summary, motion: &ClipMotion) -> Clip {
    let name = summary.input.as_ref().map_or_else(String::new, |i| i.name.clone());
    let fps = summary.input.as_ref().and_then(|i| i.fps);
    Clip { name, size: (motion.width, motion.height), rotation: motion.rotation, fps }
}

fn outcome(summary: &Summary) -> Outcome {
    Outcome {
        files: summary.outputs.iter().map(|p| p.display().to_string()).collect(),
        size: summary.size,
        frames: summary.frames,
        encoder: summary.encoder.clone(),
    }
}

fn times_s(motion: &ClipMotion) -> Vec<f64> {
    let seconds: Vec<f64> = motion.frames.iter().map(|f| motion.timebase.seconds(f.pts)).collect();
    let first = seconds.first().copied().unwrap_or(0.0);
    seconds.into_iter().map(|s| s - first).collect()
}

/// Shake and the path in the picture.
fn plots(motion: &ClipMotion, path: &VirtualPath, windows: &Windows, shown: Shown) -> Vec<Chart> {
    let [before, after] = PathDeviations::of(motion, &path.out_from_src).distances_px();
    let shake = Chart {
        title: "Shake".to_owned(),
        unit: "px from its course".to_owned(),
        least_span: 1.0,
        curves: curves(before, after),
    };
    std::iter::once(shake).chain(in_plane::charts(motion, windows, shown)).collect()
}

fn crop_chart(path: &VirtualPath) -> Chart {
    let values = path.crop.iter().map(|c| 100.0 * c.min(1.0)).collect();
    Chart {
        title: "Picture kept".to_owned(),
        unit: "% of width and height".to_owned(),
        least_span: 4.0,
        curves: Curves::One(Curve { name: "result".to_owned(), values }),
    }
}
