//! Options of the stabilizer, grouped by step.
//!
//! Each group belongs to one step: [`TrackingOptions`] and [`CameraMotionOptions`] the analysis,
//! [`SmoothingOptions`] the planning of the path, [`WarpOptions`] the map of each frame.

use std::fmt;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::error::StabilizeError;
use super::rolling_shutter::RollingShutter;
use crate::path::{PathKind, PathOptions, PathShape, Zoom};
use crate::track::TrackOptions;
use plumbline_num::options::OptionError;

/// Options of [`Stabilizer`](super::Stabilizer), step by step.
///
/// By default a clip is stabilized in the picture. With `motion.cameras` the cameras in space are recovered too, which takes
/// longer than all other steps together, and used on the shots where that is better.
///
/// ```
/// use plumbline_video::stabilize::{ModelChoice, StabilizerOptions};
///
/// let mut options = StabilizerOptions::default().with_keep(0.85);
/// options.warp.mode = ModelChoice::Homography;
/// assert!(options.check().is_ok());
/// options.path.smoothness = f64::NAN;
/// assert_eq!(options.check().unwrap_err().to_string(), "smoothness NaN is invalid (expected 0.05 to 30)");
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct StabilizerOptions {
    /// Feature tracking
    pub track: TrackingOptions,
    /// Estimation of the camera's motion
    pub motion: CameraMotionOptions,
    /// Path of the virtual camera
    pub path: SmoothingOptions,
    /// Warp of each frame
    pub warp: WarpOptions,
}

impl StabilizerOptions {
    /// The same options with at least the fraction `keep` of the picture's width and height kept, 0.3 to 1.
    #[must_use]
    pub fn with_keep(mut self, keep: f64) -> Self {
        self.path.keep = keep;
        self
    }

    /// Whether every value is in its range.
    ///
    /// # Errors
    /// [`StabilizeError::Options`] for the first one that is not.
    pub fn check(&self) -> Result<(), StabilizeError> {
        self.track.check()?;
        self.path.in_picture().check()?;
        Ok(self.warp.check()?)
    }
}

/// Feature tracking.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct TrackingOptions {
    /// Tracked points per frame; raise it for scenes with many small moving parts (time grows in proportion)
    #[cfg_attr(feature = "schema", schemars(range(min = 50, max = 20_000)))]
    pub points: u32,
    /// Mask image of the clip's aspect ratio; nothing is tracked where it is white (a logo, a dashboard)
    #[cfg_attr(feature = "schema", schemars(extend("format" = "path")))]
    pub mask: Option<PathBuf>,
}

impl Default for TrackingOptions {
    fn default() -> Self {
        Self { points: TrackOptions::default().points as u32, mask: None }
    }
}

impl TrackingOptions {
    fn check(&self) -> Result<(), OptionError> {
        let valid = (50..=20_000).contains(&self.points);
        OptionError::check(valid, "points", f64::from(self.points), "50 to 20000")
    }
}

/// Estimation of the camera's motion from the points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct CameraMotionOptions {
    /// Rolling-shutter correction: auto (estimated from the clip), off, or the sensor's readout time in seconds
    pub rolling_shutter: RollingShutter,
    /// Recover camera poses and scene points in space (structure from motion; slower than all other steps together)
    pub cameras: bool,
}

/// Path of the virtual camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum PathMethod {
    /// The smoothest path within the crop budget
    #[default]
    Optimal,
    /// The camera's path, Gaussian low-passed
    Gaussian,
    /// Constant velocity: the least-squares line through the path
    Linear,
    /// Constant acceleration: the least-squares parabola through the path
    Parabolic,
    /// No motion
    Tripod,
    /// In space, a circle about the point of interest; without recovered cameras as linear
    Orbit,
    /// In space, a straight line at constant speed and view direction; without recovered cameras as linear
    Dolly,
}

impl PathMethod {
    /// The kind of path in the picture.
    pub(super) fn kind(self) -> PathKind {
        match self {
            Self::Optimal => PathKind::Optimal,
            Self::Gaussian => PathKind::Gaussian,
            Self::Linear | Self::Orbit | Self::Dolly => PathKind::Linear,
            Self::Parabolic => PathKind::Parabolic,
            Self::Tripod => PathKind::Tripod,
        }
    }

    /// The shape of the path in space, where the method prescribes one.
    pub(super) fn shape(self) -> Option<PathShape> {
        match self {
            Self::Optimal | Self::Gaussian => None,
            Self::Linear => Some(PathShape::Linear),
            Self::Parabolic => Some(PathShape::Parabolic),
            Self::Tripod => Some(PathShape::Tripod),
            Self::Orbit => Some(PathShape::Orbit),
            Self::Dolly => Some(PathShape::Dolly),
        }
    }

    /// Only a camera in space can follow the path.
    pub(super) fn needs_cameras(self) -> bool {
        matches!(self, Self::Orbit | Self::Dolly)
    }
}

/// Use of recovered cameras in space.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum InSpace {
    /// Smooth in space on the shots where that is no worse than in the picture
    #[default]
    Auto,
    /// Smooth in space
    Always,
    /// Smooth only the rotations, as if all points were far away
    #[serde(alias = "turn")]
    Rotation,
}

/// Options of the path of the virtual camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct SmoothingOptions {
    /// Path of the virtual camera
    #[serde(alias = "method")]
    #[cfg_attr(feature = "schema", schemars(extend("aliases" = ["method"])))]
    pub path: PathMethod,
    /// Level horizon, as far as the crop allows
    #[serde(alias = "horizon")]
    #[cfg_attr(feature = "schema", schemars(extend("aliases" = ["horizon"])))]
    pub horizon_lock: bool,
    /// Time constant of the smoothing, seconds; slower motion is kept, faster removed
    #[cfg_attr(feature = "schema", schemars(range(min = 0.05, max = 30.0)))]
    pub smoothness: f64,
    /// Minimum fraction of the picture's width and height that is kept, such as 0.8 or 80%; smaller values allow a steadier path
    #[serde(alias = "min_crop")]
    #[cfg_attr(
        feature = "schema",
        schemars(range(min = 0.3, max = 1.0), extend("format" = "fraction", "aliases" = ["min_crop"]))
    )]
    pub keep: f64,
    /// Enlargement of the picture that hides the borders
    pub zoom: Zoom,
    /// Margin between the picture and the border of the source, as a fraction of the picture's width; the mesh warp moves the border within it
    #[cfg_attr(feature = "schema", schemars(range(min = 0.0, max = 0.1)))]
    pub reserve: f64,
    /// Use of cameras in space, where video.motion recovered them
    pub in_space: InSpace,
    /// File of target cameras and the input's own to align them by; replaces the method
    #[cfg_attr(feature = "schema", schemars(extend("format" = "path")))]
    pub path_file: Option<PathBuf>,
    /// The picture may not show anything outside the source; false where the renderer fills its borders
    pub keep_inside: bool,
    /// What is outside is filled from neighboring frames: show no more of it than they do, and nothing where something moves on its own (that
    /// is known by the tracks)
    pub filled: bool,
}

impl Default for SmoothingOptions {
    fn default() -> Self {
        Self {
            path: PathMethod::default(),
            horizon_lock: false,
            smoothness: 0.5,
            keep: 0.8,
            zoom: Zoom::default(),
            reserve: 0.01,
            in_space: InSpace::default(),
            path_file: None,
            keep_inside: true,
            filled: false,
        }
    }
}

impl SmoothingOptions {
    /// Whether the window may leave the frame, but only as far as its neighbors show the scene.
    pub(super) fn is_bounded_by_neighbors(&self) -> bool {
        self.filled && !self.keep_inside && self.zoom != Zoom::None
    }

    /// Whether `zoom = "none"` is combined with borders that may not show, which leaves no room to move the picture.
    pub fn leaves_no_room(&self) -> bool {
        self.zoom == Zoom::None && self.keep_inside
    }

    /// The same for the planner of paths in the picture.
    pub(super) fn in_picture(&self) -> PathOptions {
        let bounded = self.is_bounded_by_neighbors();
        PathOptions {
            kind: self.path.kind(),
            smoothness_s: self.smoothness,
            keep: self.keep,
            zoom: self.zoom,
            border_allows_outside: !self.keep_inside && !bounded,
            horizon_lock: self.horizon_lock,
            // Where the border is filled, the mesh may move it.
            reserve: if bounded { 0.0 } else { self.reserve },
        }
    }
}

/// Motion model of the frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum ModelChoice {
    /// The most flexible model that is no worse than the next simpler one
    #[default]
    Auto,
    /// A mesh toward the view of the virtual camera in space, where cameras can be recovered; a mesh elsewhere
    #[serde(rename = "3d")]
    ThreeD,
    /// A mesh toward trajectories smoothed in their common subspace
    Subspace,
    /// The view of a camera that only rotates
    Rotation,
    /// A content-preserving mesh
    Mesh,
    /// One homography per frame
    Homography,
    /// Translation, rotation and scale
    Similarity,
}

/// Options of the warp of each frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct WarpOptions {
    /// Motion model of the frames
    pub mode: ModelChoice,
    /// Columns of the mesh
    #[cfg_attr(feature = "schema", schemars(range(min = 2, max = 256)))]
    pub columns: u32,
    /// Rows of the mesh
    #[cfg_attr(feature = "schema", schemars(range(min = 2, max = 256)))]
    pub rows: u32,
    /// Stiffness: weight of keeping each cell's shape against following the points, in cell units; raise it where straight lines bend
    #[cfg_attr(feature = "schema", schemars(range(min = 0.001, max = 1_000_000.0)))]
    pub alpha: f64,
}

impl Default for WarpOptions {
    fn default() -> Self {
        Self { mode: ModelChoice::default(), columns: 64, rows: 36, alpha: Self::ALPHA }
    }
}

impl WarpOptions {
    /// Stiffness of cells. The paper's 20 is for targets far from the pre-warp, as a new camera position makes them; here targets
    /// are a pixel away, and at 20 the mesh ignores half of that: wobble 1.19 on nus-regular-6, against 0.85 at 0.8. Below 0.2 the
    /// noise of single tracks begins to show.
    const ALPHA: f64 = 0.8;

    fn check(&self) -> Result<(), OptionError> {
        for (name, cells) in [("columns", self.columns), ("rows", self.rows)] {
            OptionError::check((2..=256).contains(&cells), name, f64::from(cells), "2 to 256")?;
        }
        OptionError::check((0.001..=1e6).contains(&self.alpha), "alpha", self.alpha, "0.001 to 1000000")
    }
}

/// The word of a choice, as files and options spell it.
macro_rules! display_as_serialized {
    ($($name:ty),*) => {$(
        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.serialize(f)
            }
        }
    )*};
}
display_as_serialized!(PathMethod, InSpace, ModelChoice);

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(feature = "schema")]
    #[test]
    fn the_ranges_of_the_schema_are_those_that_are_checked() {
        let at = |key: &str, value: f64| {
            let mut options = StabilizerOptions::default();
            match key {
                "points" => options.track.points = value as u32,
                "smoothness" => options.path.smoothness = value,
                "keep" => options.path.keep = value,
                "reserve" => options.path.reserve = value,
                "columns" => options.warp.columns = value as u32,
                "rows" => options.warp.rows = value as u32,
                "alpha" => options.warp.alpha = value,
                other => panic!("the range of `{other}` is not checked"),
            }
            options.check()
        };
        let groups = [
            schemars::schema_for!(TrackingOptions),
            schemars::schema_for!(SmoothingOptions),
            schemars::schema_for!(WarpOptions),
        ];
        let mut ranges = 0;
        for (key, property) in
            groups.iter().flat_map(|g| g.get("properties").and_then(|p| p.as_object()).expect("a struct"))
        {
            let Some((low, high)) = property["minimum"].as_f64().zip(property["maximum"].as_f64()) else { continue };
            ranges += 1;
            assert!(at(key, low).is_ok() && at(key, high).is_ok(), "{key}: {low} to {high}");
            assert!(at(key, high + 1.0).is_err(), "{key}: above {high}");
            let below = at(key, low - 1.0).expect_err(key).to_string();
            assert!(low == 0.0 || below.starts_with(&format!("{key} ")), "{below}");
        }
        assert_eq!(ranges, 7);
    }

    #[test]
    fn choices_are_displayed_by_their_words() {
        assert_eq!(ModelChoice::ThreeD.to_string(), "3d");
        assert_eq!(PathMethod::Optimal.to_string(), "optimal");
        assert_eq!(InSpace::Rotation.to_string(), "rotation");
        assert_eq!(Zoom::Adaptive.to_string(), "adaptive");
    }

    #[test]
    fn a_zoom_that_leaves_no_room_is_refused() {
        let mut options = StabilizerOptions::default();
        options.path.zoom = Zoom::None;
        assert!(options.check().is_err());
        options.path.keep_inside = false;
        assert!(options.check().is_ok());
    }
}
