//! The streaming part of the analysis: takes each frame once, returns tracks and planar motion at the end.

use super::error::StabilizeError;
use super::measurement::MotionMeasurement;
use super::options::TrackingOptions;
use super::source::ClipInfo;
use super::tracks::{PointCarrier, Tracks};
use crate::motion::ClipMotion;
use crate::track::{TrackOptions, Tracker};
use plumbline_image::Frame;
use plumbline_image::feature::Mask;

/// Dilation radius of the mask, px of the analysis picture: half a window of the matcher, which must not overlap the masked
/// area. A smaller one lets the rim of a logo be tracked, a larger one excludes usable points beside it.
const MASK_RADIUS_PX: usize = 10;

/// Tracks points through the frames of a clip and measures its motion from them.
pub struct ClipTracker<'a> {
    info: ClipInfo,
    tracker: Tracker,
    carrier: Option<PointCarrier<'a>>,
    measurement: MotionMeasurement,
}

impl<'a> ClipTracker<'a> {
    /// A tracker for the clip that `info` describes; its points are carried through `carrier`, if there is one.
    ///
    /// # Errors
    /// [`StabilizeError::Options`]; [`StabilizeError::Input`]: the mask; [`StabilizeError::Store`]: no temporary file.
    pub fn new(
        info: &ClipInfo,
        options: &TrackingOptions,
        carrier: Option<PointCarrier<'a>>,
    ) -> Result<Self, StabilizeError> {
        let (width, height) = (info.width, info.height);
        let settings = TrackOptions { points: options.points as usize, ..TrackOptions::default() };
        let analysis_size = settings.analysis_size(width, height);
        let open = |path| Mask::open(path, analysis_size.0, analysis_size.1, MASK_RADIUS_PX);
        let mask = options.mask.as_deref().map(open).transpose()?;
        let tracker = Tracker::new(width, height, settings, mask)?;
        let measurement = MotionMeasurement::new(carrier.map_or((width, height), |carrier| carrier.size))?;
        Ok(Self { info: *info, tracker, carrier, measurement })
    }

    /// Tracks the points into the next frame; returns whether it begins a new shot.
    ///
    /// # Errors
    /// [`StabilizeError::Store`]: the temporary folder is full.
    pub fn push(&mut self, frame: &Frame) -> Result<bool, StabilizeError> {
        let mut tracks = self.tracker.push(frame);
        let cut = tracks.quality.starts_shot();
        if let Some(carrier) = &self.carrier {
            carrier.carry(&mut tracks);
        }
        self.measurement.push(tracks)?;
        Ok(cut)
    }

    /// The motion of the clip in the picture, and its tracks.
    ///
    /// # Errors
    /// [`StabilizeError::Input`] where no frame was pushed.
    pub fn finish(self) -> Result<(ClipMotion, Tracks), StabilizeError> {
        if self.measurement.frames() == 0 {
            Err(StabilizeError::Input("the clip has no frame that could be decoded".to_owned()))
        } else {
            Ok(self.measurement.finish(&self.info))
        }
    }
}
