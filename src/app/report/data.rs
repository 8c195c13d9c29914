//! The content of a report on a clip.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::pictures::Picture;
use plumbline_video::stabilize::ShakeSummary;

/// A run on one clip.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Report {
    /// What was read.
    pub clip: Clip,
    /// What was written.
    pub outcome: Outcome,
    /// Shake of the whole clip, where it was measured.
    pub shake: Option<ShakeSummary>,
    /// What was kept of the picture.
    pub crop: Option<Crop>,
    /// Readout time of the sensor that was corrected for, s.
    pub readout_s: Option<f64>,
    /// Time of each frame, s, from the first.
    pub times_s: Vec<f64>,
    /// Frames without a cut inside, in order.
    pub shots: Vec<Range<usize>>,
    /// Frames drawn alike, in order.
    pub segments: Vec<Segment>,
    /// The camera's path in the picture.
    pub path: Vec<Chart>,
    /// What the plots of the path mean.
    pub path_note: String,
    /// Part of the picture that was kept, over time.
    pub crop_over_time: Option<Chart>,
    /// The cameras in space, where they were looked for.
    pub cameras: Option<Cameras>,
    /// Frames to look at, in order.
    #[serde(skip)]
    pub moments: Vec<Moment>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// The input.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Clip {
    /// As the user named it.
    pub name: String,
    /// Width and height of the coded picture, px.
    pub size: (u32, u32),
    /// Clockwise turn at which the picture is shown, degrees.
    pub rotation: u16,
    /// Mean frame rate, 1/s, where it is known.
    pub fps: Option<f64>,
}

impl Clip {
    /// Its name without the folder.
    pub(super) fn short_name(&self) -> &str {
        let whole = self.name.trim_end_matches('/');
        whole.rsplit_once('/').map_or(whole, |(_, name)| name)
    }

    /// Width and height as they are shown, px; pixels count as square.
    pub(super) fn shown_size(&self) -> (u32, u32) {
        let (width, height) = self.size;
        if self.rotation % 180 == 90 { (height, width) } else { (width, height) }
    }
}

/// The results.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Outcome {
    /// Files written, this page left out.
    pub files: Vec<String>,
    /// Width and height of the picture, px.
    pub size: Option<(u32, u32)>,
    /// Frames written.
    pub frames: u64,
    /// Name of the encoder.
    pub encoder: Option<String>,
}

/// A quantity of the clip and of what was made of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Change<T> {
    /// Of the clip.
    pub before: T,
    /// Of the result.
    pub after: T,
}

/// Part of the picture's width and height that was kept; 1 = all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Crop {
    /// Mean over the frames.
    pub mean: f64,
    /// Least of any frame.
    pub least: Option<f64>,
}

/// A stretch of frames that were drawn alike.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Segment {
    /// Its frames.
    pub frames: Range<usize>,
    /// How they were drawn: `mesh`, `3d` and the like, or the verdict on cameras in space.
    pub mode: String,
    /// Why.
    pub reason: String,
    /// Part of width and height that was kept, mean.
    pub crop: Option<f64>,
    /// Shake, where it was measured.
    pub shake: Option<ShakeSummary>,
}

/// A quantity over the frames, in one or more curves.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Chart {
    /// What is plotted.
    pub title: String,
    /// Its unit; empty for plain numbers.
    pub unit: String,
    /// Least extent of the axis, in the unit: less is not worth magnifying.
    pub least_span: f64,
    /// The curves.
    pub curves: Curves,
}

/// The curves of a chart. One value per frame; NaN is a gap.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Curves {
    /// Of the result alone.
    One(Curve),
    /// Of the clip and of the result.
    Two(Change<Curve>),
}

impl Default for Curves {
    fn default() -> Self {
        Self::One(Curve::default())
    }
}

/// One line of a chart.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Curve {
    /// Its name in the legend.
    pub name: String,
    /// One value per frame; NaN is a gap.
    pub values: Vec<f64>,
}

/// What is known of the cameras in space.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Cameras {
    /// One per shot.
    pub shots: Vec<ShotVerdict>,
    /// Place and direction over time, where cameras are known and drawn.
    pub path: Vec<Chart>,
}

/// What the tracks of a shot allow to say about its cameras.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ShotVerdict {
    /// Its frames.
    pub frames: Range<usize>,
    /// The verdict in a word or two.
    pub verdict: String,
    /// Why.
    pub reason: String,
    /// Frames with a camera.
    pub registered: usize,
    /// Points with a place.
    pub points: usize,
    /// Mean distance of sightings from where the cameras see their points, px.
    pub reprojection_px: f64,
    /// Angle under which points are seen, degrees, median.
    pub angle_deg: f64,
    /// Share of the picture's cells that hold points, mean over the frames.
    pub coverage: f64,
    /// Focal length, px.
    pub focal_px: f64,
    /// Standard deviation of its logarithm, where it was determined.
    pub sigma_ln_focal: Option<f64>,
}

/// One frame, before and after.
#[derive(Clone, Debug)]
pub struct Moment {
    /// Which frame.
    pub frame: usize,
    /// What was done to it, in words.
    pub what: String,
    /// The pictures.
    pub pictures: Change<Picture>,
}
