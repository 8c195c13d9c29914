//! The virtual camera: the crop window of each frame that makes the clip steady.
//!
//! Frame `t` moves by the similarity `F_t` (`this_from_previous`, estimated). The output shows the window
//! `B_t = src_from_out` of the frame, so the viewer sees the motion `B_t⁻¹ F_t B_{t−1}`. A path is good when that motion
//! is smooth, the window inside the frame, and the window large. The kinds:
//!
//! - [`PathKind::Optimal`]: a quadratic program balances the three under hard constraints (`optimal.rs`);
//! - [`PathKind::Gaussian`]: the camera's path convolved with a Gaussian, constrained to the frame;
//! - [`PathKind::Linear`], [`PathKind::Parabolic`]: the least-squares polynomial of degree 1 or 2 over the whole shot,
//!   constrained to the frame;
//! - [`PathKind::Tripod`]: no motion while the frame allows it.
//!
//! Paths in space are smoothed ([`smoothed_poses`]) or fitted to a shape ([`shaped_poses`]) from the recovered cameras, up to
//! the fraction at which the frame covers the view ([`attainable_fractions`]); [`plan_toward`] finds the windows.
//!
//! Shots are independent. Within a shot the program is solved in overlapping windows of time, so memory does not grow
//! with the clip. Everything is computed in units of half the frame's diagonal and in seconds: resolution and frame rate
//! scale the result and do not change it.
//!
//! # Reference
//! M. Grundmann, V. Kwatra, I. Essa, *Auto-directed video stabilization with robust L1 optimal camera paths*, CVPR 2011:
//! the window's pose as the unknown of a convex program, linear in the similarity's parameters.

mod beyond;
mod camera_path;
mod chain;
mod fraction;
mod ideal;
mod level;
mod local_linear;
mod lowpass;
mod optimal;
mod orbit;
mod plan;
mod pose;
mod regression;
mod subspace;
mod toward;
mod trajectory;
mod virtual_camera;

use std::fmt;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use plumbline_num::math::{Homography, Similarity2};
use plumbline_num::options::OptionError;
use plumbline_num::run::Stopped;

pub use beyond::{BeyondOptions, Margins, MovingObject, shown_beyond};
pub use camera_path::{PathShape, SeenPoint, shaped_poses};
pub use fraction::{attainable_fractions, smoothed_fractions};
pub use level::{leveled, roll, upward};
pub use lowpass::lowpass;
pub use plan::{plan, plan_along};
pub use toward::plan_toward;
pub use trajectory::{Anchor, TrackedPoint, TrajectoryOptions, TrajectorySmoother};
pub use virtual_camera::{SteadyView, VirtualCamera, smoothed_poses};

/// Motion of one frame's content since the previous frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InterFrame {
    /// Maps previous-frame px to this-frame px.
    pub similarity: Similarity2,
    /// The same as a projective map, where it was estimated; the similarity otherwise.
    pub homography: Homography,
    /// False where the estimate is a guess (too few points, blur, black frame): the path bridges the gap.
    pub reliable: bool,
}

/// Input of the planner. Slices have one entry per frame of the clip.
#[derive(Clone, Copy, Debug)]
pub struct Clip<'a> {
    /// Frame width, px, > 0.
    pub width: u32,
    /// Frame height, px, > 0.
    pub height: u32,
    /// Presentation times, s, increasing; they may be uneven.
    pub times_s: &'a [f64],
    /// Motion since the previous frame; the entry of a shot's first frame is ignored.
    pub motion: &'a [InterFrame],
    /// Frame ranges without a cut inside: in order, not empty, together all frames.
    pub shots: &'a [Range<usize>],
    /// How far the window may reach beyond each side of each frame, where its neighbors show the scene ([`shown_beyond`]); empty:
    /// nowhere.
    pub beyond: &'a [Margins],
}

impl Clip<'_> {
    /// Mean time from frame to frame in a range of them, s; 1 where there are fewer than two.
    pub fn period_s(&self, frames: &Range<usize>) -> f64 {
        let times = &self.times_s[frames.clone()];
        match times {
            [first, .., last] if last > first => (last - first) / (times.len() - 1) as f64,
            _ => 1.0,
        }
    }
}

/// Kind of path of the virtual camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathKind {
    /// The quadratic program: shake, acceleration and crop balanced.
    Optimal,
    /// The Gaussian mean of the path.
    Gaussian,
    /// The least-squares line: constant velocity.
    Linear,
    /// The least-squares parabola: constant acceleration.
    Parabolic,
    /// No motion.
    Tripod,
}

/// How the picture is enlarged to hide the borders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Zoom {
    /// One zoom for the whole clip
    Fixed,
    /// A zoom that changes slowly with the need
    #[default]
    Adaptive,
    /// No zoom: borders may show
    None,
}

impl fmt::Display for Zoom {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// Options of the planner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathOptions {
    /// Kind of path.
    pub kind: PathKind,
    /// Time constant of the smoothing, s, 0.05 to 30: motion much slower than this is kept, faster is removed.
    pub smoothness_s: f64,
    /// Smallest window, as a fraction of the frame's width, 0.3 to 1.
    pub keep: f64,
    /// Size of the window over time.
    pub zoom: Zoom,
    /// The output may reach outside the source (the renderer fills it): no zoom, and only the central `keep` part of
    /// the output must be covered.
    pub border_allows_outside: bool,
    /// Level horizon: the window cancels the camera's roll, relative to the mean roll of the shot.
    pub horizon_lock: bool,
    /// Margin between window and frame, as a fraction of the window's width, 0 to 0.1: a later mesh warp moves the border of
    /// the frame by up to this much.
    pub reserve: f64,
}

impl PathOptions {
    /// Refuses options out of range.
    pub(crate) fn check(&self) -> Result<(), PathError> {
        for (name, value, valid, range) in [
            ("smoothness", self.smoothness_s, 0.05..=30.0, "0.05 to 30"),
            ("keep", self.keep, 0.3..=1.0, "0.3 to 1"),
            ("reserve", self.reserve, 0.0..=0.1, "0 to 0.1"),
        ] {
            OptionError::check(valid.contains(&value), name, value, range)?;
        }
        if self.zoom == Zoom::None && !self.border_allows_outside {
            let remedy = "allow the border to show, or choose zoom `fixed` or `adaptive`";
            return Err(PathError::Options(format!("zoom `none` leaves no room to move the picture: {remedy}")));
        }
        Ok(())
    }

    /// Size of the rectangle that the frame must cover, relative to the output.
    fn window(&self) -> f64 {
        if self.border_allows_outside { self.keep } else { (1.0 + self.reserve).min(1.0 / self.keep) }
    }

    /// The smallest width of the rectangle, as a fraction of the frame's width.
    fn smallest_window(&self) -> f64 {
        self.window() * if self.border_allows_outside { 1.0 } else { self.keep }
    }
}

impl Default for PathOptions {
    fn default() -> Self {
        Self {
            kind: PathKind::Optimal,
            smoothness_s: 0.5,
            keep: 0.8,
            zoom: Zoom::Adaptive,
            border_allows_outside: false,
            horizon_lock: false,
            reserve: 0.0,
        }
    }
}

/// How a segment was treated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum SegmentOutcome {
    /// The path was smoothed.
    Smoothed,
    /// The path was given and is followed.
    Given,
    /// The frames are not moved.
    Unchanged,
}

/// Consecutive frames treated alike.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Segment {
    /// Frames of the clip.
    pub frames: Range<usize>,
    /// Treatment.
    pub outcome: SegmentOutcome,
    /// Reason, for the user.
    pub reason: String,
}

/// The planned path.
#[derive(Clone, Debug)]
pub struct VirtualPath {
    /// Per frame, source px to output px; the output has the source's size and the zoom is included.
    pub out_from_src: Vec<Homography>,
    /// Per frame, width of the window as a fraction of the frame's width; 1 shows the whole frame.
    pub crop: Vec<f64>,
    /// Per frame the virtual camera in space, where there is one; empty where none was requested.
    pub cameras: Vec<Option<VirtualCamera>>,
    /// All frames in order.
    pub segments: Vec<Segment>,
}

/// Errors of the planner.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PathError {
    /// An option is out of its range, or the options leave no room to move the picture.
    #[error("{0}")]
    Options(String),
    /// A frame without area, or parts of the clip that disagree about its length.
    #[error("{0}")]
    Input(String),
    /// The run was interrupted, or its time is used up.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}

impl From<OptionError> for PathError {
    fn from(error: OptionError) -> Self {
        Self::Options(error.to_string())
    }
}
