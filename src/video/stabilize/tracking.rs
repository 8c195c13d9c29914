//! The streaming part of the analysis: takes each frame once, returns tracks and planar motion at the end.
//!
//! A clip is tracked in analysis windows of fixed length, each from nothing ([`AnalysisWindows`]). There are two paths to the same
//! bits: [`ClipTracker`] takes the frames of the clip in order and keeps the one or two windows that read the present one;
//! [`WindowTracker`] takes the frames of one window, wherever and whenever, and [`WindowJoiner`] the windows in order.

use super::error::StabilizeError;
use super::measurement::MotionMeasurement;
use super::options::TrackingOptions;
use super::source::ClipInfo;
use super::tracks::{PointCarrier, Tracks};
use crate::motion::ClipMotion;
use crate::track::{AnalysisWindows, FrameTracks, TrackJoiner, TrackOptions, Tracker, WindowTracks};
use plumbline_image::Frame;
use plumbline_image::feature::Mask;

use std::collections::VecDeque;
use std::ops::Range;

/// Dilation radius of the mask, px of the analysis picture: half a window of the matcher, which must not overlap the masked
/// area. A smaller one lets the rim of a logo be tracked, a larger one excludes usable points beside it.
const MASK_RADIUS_PX: usize = 10;

/// Makes the tracker of each window of a clip.
struct Trackers {
    size: (usize, usize),
    settings: TrackOptions,
    mask: Option<Mask>,
}

impl Trackers {
    fn new(info: &ClipInfo, options: &TrackingOptions) -> Result<Self, StabilizeError> {
        let size = (info.width, info.height);
        let settings = settings(options);
        let analysis_size = settings.analysis_size(size.0, size.1);
        let open = |path| Mask::open(path, analysis_size.0, analysis_size.1, MASK_RADIUS_PX);
        let mask = options.mask.as_deref().map(open).transpose()?;
        Ok(Self { size, settings, mask })
    }

    fn tracker(&self) -> Result<Tracker, StabilizeError> {
        Ok(Tracker::new(self.size.0, self.size.1, self.settings, self.mask.clone())?)
    }
}

fn settings(options: &TrackingOptions) -> TrackOptions {
    TrackOptions { points: options.points as usize, ..TrackOptions::default() }
}

/// Tracks points through one analysis window of a clip. The result depends on the frames of the window and on nothing else.
#[derive(Debug)]
pub struct WindowTracker {
    tracker: Tracker,
    frames: Range<usize>,
    tracks: WindowTracks,
}

impl WindowTracker {
    /// A tracker for window `window` of the clip that `info` describes.
    ///
    /// # Errors
    /// [`StabilizeError::Options`]; [`StabilizeError::Input`]: the mask.
    pub fn new(
        info: &ClipInfo,
        options: &TrackingOptions,
        windows: AnalysisWindows,
        window: usize,
    ) -> Result<Self, StabilizeError> {
        let trackers = Trackers::new(info, options)?;
        let tracks = WindowTracks { size: trackers.size, window, frames: Vec::new() };
        Ok(Self { tracker: trackers.tracker()?, frames: windows.read(window), tracks })
    }

    /// The frames of the clip that are to be pushed, in their order; fewer where the clip ends.
    pub fn frames(&self) -> Range<usize> {
        self.frames.clone()
    }

    /// Tracks the points into the next frame of the window.
    pub fn push(&mut self, frame: &Frame) {
        self.tracks.frames.push(self.tracker.push(frame));
    }

    /// The tracks of the window.
    pub fn finish(self) -> WindowTracks {
        self.tracks
    }
}

/// Joins the windows of a clip and measures its motion, in bounded memory.
pub struct WindowJoiner<'a> {
    info: ClipInfo,
    joiner: TrackJoiner,
    carrier: Option<PointCarrier<'a>>,
    measurement: MotionMeasurement,
}

impl<'a> WindowJoiner<'a> {
    /// For the clip that `info` describes, tracked with these options; its points are carried through `carrier`, if there is one.
    ///
    /// # Errors
    /// [`StabilizeError::Store`]: no temporary file.
    pub fn new(
        info: &ClipInfo,
        options: &TrackingOptions,
        windows: AnalysisWindows,
        carrier: Option<PointCarrier<'a>>,
    ) -> Result<Self, StabilizeError> {
        let size = (info.width, info.height);
        let joiner = TrackJoiner::new(windows, size, settings(options).analysis_size(size.0, size.1).0);
        let measurement = MotionMeasurement::new(carrier.map_or(size, |carrier| carrier.size))?;
        Ok(Self { info: *info, joiner, carrier, measurement })
    }

    /// Takes the next window of the clip.
    ///
    /// # Errors
    /// [`StabilizeError::Input`]: a window that is not the next one, or of another clip; [`StabilizeError::Store`]: the temporary
    /// folder is full.
    pub fn push(&mut self, window: WindowTracks) -> Result<(), StabilizeError> {
        let (expected, found) = ((self.info.width, self.info.height), window.size);
        if found != expected {
            let text =
                format!("analysis window {} is of a clip of {found:?} px (expected {expected:?})", window.window);
            return Err(StabilizeError::Input(text));
        }
        window.frames.into_iter().try_for_each(|tracks| self.push_frame(window.window, tracks))
    }

    fn push_frame(&mut self, window: usize, tracks: FrameTracks) -> Result<(), StabilizeError> {
        self.joiner.push(window, tracks)?.map_or(Ok(()), |joined| measure(&mut self.measurement, self.carrier, joined))
    }

    /// The motion of the clip in the picture, and its tracks.
    ///
    /// # Errors
    /// [`StabilizeError::Input`] where no frame was pushed; [`StabilizeError::Store`]: the temporary folder is full.
    pub fn finish(self) -> Result<(ClipMotion, Tracks), StabilizeError> {
        let Self { info, joiner, carrier, mut measurement } = self;
        joiner.finish().try_for_each(|last| measure(&mut measurement, carrier, last))?;
        if measurement.frames() == 0 {
            return Err(StabilizeError::Input("the clip has no frame that could be decoded".to_owned()));
        }
        Ok(measurement.finish(&info))
    }
}

fn measure(
    measurement: &mut MotionMeasurement,
    carrier: Option<PointCarrier<'_>>,
    mut tracks: FrameTracks,
) -> Result<(), StabilizeError> {
    if let Some(carrier) = carrier {
        carrier.carry(&mut tracks);
    }
    measurement.push(tracks)
}

/// Tracks points through the frames of a clip and measures its motion from them.
pub struct ClipTracker<'a> {
    windows: AnalysisWindows,
    trackers: Trackers,
    /// The trackers of the windows that read the present frame, by window.
    active: VecDeque<(usize, Tracker)>,
    /// Frames pushed so far.
    frames: usize,
    joiner: WindowJoiner<'a>,
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
        Self::in_windows(info, options, AnalysisWindows::default(), carrier)
    }

    /// [`Self::new`] with another partition.
    ///
    /// # Errors
    /// As there.
    pub fn in_windows(
        info: &ClipInfo,
        options: &TrackingOptions,
        windows: AnalysisWindows,
        carrier: Option<PointCarrier<'a>>,
    ) -> Result<Self, StabilizeError> {
        let trackers = Trackers::new(info, options)?;
        let active = VecDeque::from([(0, trackers.tracker()?)]);
        let joiner = WindowJoiner::new(info, options, windows, carrier)?;
        Ok(Self { windows, trackers, active, frames: 0, joiner })
    }

    /// Tracks the points into the next frame; returns whether it begins a new shot.
    ///
    /// # Errors
    /// [`StabilizeError::Store`]: the temporary folder is full.
    pub fn push(&mut self, frame: &Frame) -> Result<bool, StabilizeError> {
        self.push_noting(frame, |_, _| ())
    }

    /// [`Self::push`]; `note` is given the tracks of each window that reads the frame, before they are joined.
    ///
    /// # Errors
    /// As there.
    pub fn push_noting(
        &mut self,
        frame: &Frame,
        mut note: impl FnMut(usize, &FrameTracks),
    ) -> Result<bool, StabilizeError> {
        let readers = self.windows.of(self.frames);
        self.active.retain(|(window, _)| readers.contains(window));
        let mut cut = false;
        for window in readers.clone() {
            if self.active.back().is_none_or(|(last, _)| *last < window) {
                self.active.push_back((window, self.trackers.tracker()?));
            }
        }
        for (window, tracker) in &mut self.active {
            let tracks = tracker.push(frame);
            cut |= window == readers.start() && tracks.quality.starts_shot();
            note(*window, &tracks);
            self.joiner.push_frame(*window, tracks)?;
        }
        self.frames += 1;
        Ok(cut)
    }

    /// The motion of the clip in the picture, and its tracks.
    ///
    /// # Errors
    /// [`StabilizeError::Input`] where no frame was pushed; [`StabilizeError::Store`]: the temporary folder is full.
    pub fn finish(self) -> Result<(ClipMotion, Tracks), StabilizeError> {
        self.joiner.finish()
    }
}
