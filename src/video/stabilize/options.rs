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

/// What [`Stabilizer`](super::Stabilizer) does, step by step.
///
/// By default a clip is stabilized in the picture. With `motion.cameras` the cameras in space are recovered too, which takes
/// longer than all other steps together, and used shot by shot where that is better.
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
    /// How points are followed through the frames
    pub track: TrackingOptions,
    /// How the camera's motion is estimated from them
    pub motion: CameraMotionOptions,
    /// How the virtual camera moves
    pub path: SmoothingOptions,
    /// How each frame is warped
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
    /// [`StabilizeError::Option`] for the first one that is not.
    pub fn check(&self) -> Result<(), StabilizeError> {
        self.track.check()?;
        self.path.check()?;
        self.warp.check()
    }
}

/// Refuses a value outside `low..=high`; NaN is outside.
fn in_range(option: &'static str, value: f64, (low, high): (f64, f64)) -> Result<(), StabilizeError> {
    if value >= low && value <= high { Ok(()) } else { Err(StabilizeError::Option { option, value, low, high }) }
}

/// How points are followed through the frames.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct TrackingOptions {
    /// Points kept alive per frame; more follow finer motion and cost time in proportion
    #[cfg_attr(feature = "schema", schemars(range(min = 50, max = 20_000)))]
    pub points: u32,
    /// Picture of the clip's shape: nothing is tracked where it is white (a logo, a dashboard)
    #[cfg_attr(feature = "schema", schemars(extend("format" = "path")))]
    pub mask: Option<PathBuf>,
}

impl Default for TrackingOptions {
    fn default() -> Self {
        Self { points: TrackOptions::default().points as u32, mask: None }
    }
}

impl TrackingOptions {
    fn check(&self) -> Result<(), StabilizeError> {
        in_range("points", f64::from(self.points), (50.0, 20_000.0))
    }
}

/// How the camera's motion is estimated from the points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct CameraMotionOptions {
    /// Rolling-shutter correction: estimated, off, or the sensor's readout time in seconds
    pub rolling_shutter: RollingShutter,
    /// Also recover where the camera stood in space, and the points it saw
    pub cameras: bool,
}

/// How the virtual camera moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum PathMethod {
    /// The smoothest path that keeps the picture inside the crop budget: rests, even pans and soft turns
    #[default]
    Optimal,
    /// The camera's own path, low-passed
    Gaussian,
    /// On a line at even speed, turning evenly
    Linear,
    /// Evenly accelerated, on a parabola
    Parabolic,
    /// The camera stands still
    Tripod,
    /// In space, on a circle about what the camera looks at; without cameras there, as linear
    Orbit,
    /// In space, on a line at even speed, looking in one direction; without cameras there, as linear
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

/// What is made of cameras in space, where they were recovered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum InSpace {
    /// Shot by shot, they are smoothed in space where that comes out no worse than in the picture
    #[default]
    Auto,
    /// They are smoothed in space
    Always,
    /// Only their rotation is smoothed, as if everything were far away
    #[serde(alias = "turn")]
    Rotation,
}

/// How the path of the virtual camera is planned.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct SmoothingOptions {
    /// How the virtual camera moves
    #[serde(alias = "method")]
    #[cfg_attr(feature = "schema", schemars(extend("aliases" = ["method"])))]
    pub path: PathMethod,
    /// Keep the horizon level, as far as the crop allows
    #[serde(alias = "horizon")]
    #[cfg_attr(feature = "schema", schemars(extend("aliases" = ["horizon"])))]
    pub horizon_lock: bool,
    /// Time over which motion is evened out, seconds
    #[cfg_attr(feature = "schema", schemars(range(min = 0.05, max = 30.0)))]
    pub smoothness: f64,
    /// Minimum fraction of the picture's width and height that is kept, such as 0.8 or 80%; smaller values allow a steadier path
    #[serde(alias = "min_crop")]
    #[cfg_attr(
        feature = "schema",
        schemars(range(min = 0.3, max = 1.0), extend("format" = "fraction", "aliases" = ["min_crop"]))
    )]
    pub keep: f64,
    /// How the picture is enlarged to hide the borders
    pub zoom: Zoom,
    /// Room kept between the picture and the border of the source, as a part of the picture's width: the mesh needs it to bend the border
    #[cfg_attr(feature = "schema", schemars(range(min = 0.0, max = 0.1)))]
    pub reserve: f64,
    /// What is made of cameras in space, where video.motion recovered them
    pub in_space: InSpace,
    /// Wanted cameras, and the input's to align them by: this file says the path, not the method
    #[cfg_attr(feature = "schema", schemars(extend("format" = "path")))]
    pub path_file: Option<PathBuf>,
    /// The picture may not show anything outside the source; false where the renderer fills its borders
    pub keep_inside: bool,
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
        }
    }
}

impl SmoothingOptions {
    /// `zoom = "none"` leaves no room to move the picture while no border may show.
    pub fn leaves_no_room(&self) -> bool {
        self.zoom == Zoom::None && self.keep_inside
    }

    fn check(&self) -> Result<(), StabilizeError> {
        in_range("smoothness", self.smoothness, (0.05, 30.0))?;
        in_range("keep", self.keep, (0.3, 1.0))?;
        in_range("reserve", self.reserve, (0.0, 0.1))?;
        if self.leaves_no_room() { Err(crate::path::PathError::NoRoom.into()) } else { Ok(()) }
    }

    /// The same for the planner of paths in the picture.
    pub(super) fn in_picture(&self) -> PathOptions {
        PathOptions {
            kind: self.path.kind(),
            smoothness_s: self.smoothness,
            min_crop: self.keep,
            zoom: self.zoom,
            border_allows_outside: !self.keep_inside,
            level: self.horizon_lock,
            reserve: self.reserve,
        }
    }
}

/// Which motion model a frame may be warped with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum ModelChoice {
    /// The freest model that does no worse than the next lower one
    #[default]
    Auto,
    /// What a camera in space would have seen, where the cameras can be recovered; a mesh elsewhere
    #[serde(rename = "3d")]
    ThreeD,
    /// A mesh drawn by trajectories that share a few modes
    Subspace,
    /// What a camera that only turned would have seen
    Rotation,
    /// A content-preserving mesh
    Mesh,
    /// One homography per frame
    Homography,
    /// Shift, rotation and scale
    Similarity,
}

/// How each frame is warped.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct WarpOptions {
    /// How freely a frame may be bent
    pub mode: ModelChoice,
    /// Cells of the mesh across the picture
    #[cfg_attr(feature = "schema", schemars(range(min = 2, max = 256)))]
    pub columns: u32,
    /// Cells of the mesh down the picture
    #[cfg_attr(feature = "schema", schemars(range(min = 2, max = 256)))]
    pub rows: u32,
    /// Weight of keeping each cell's shape against following the points, in cell units
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

    fn check(&self) -> Result<(), StabilizeError> {
        in_range("columns", f64::from(self.columns), (2.0, 256.0))?;
        in_range("rows", f64::from(self.rows), (2.0, 256.0))?;
        in_range("alpha", self.alpha, (0.001, 1_000_000.0))
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
