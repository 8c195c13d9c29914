//! The source of frames: a clip that can be read repeatedly.

use plumbline_image::Frame;
use plumbline_num::time::Timebase;

/// A clip whose frames can be read from the start any number of times.
///
/// The stabilizer reads it once to analyze; its user reads it again to render. Every reading must give the same frames.
pub trait FrameSource {
    /// Why a frame cannot be read.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Properties common to all frames.
    fn info(&self) -> ClipInfo;

    /// Opens the clip anew: its frames in order of presentation.
    ///
    /// # Errors
    /// The clip cannot be opened; an item of the iterator is an error where a frame cannot be read.
    fn frames(&self) -> Result<impl Iterator<Item = Result<Frame, Self::Error>>, Self::Error>;
}

/// Properties common to all frames of a clip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClipInfo {
    /// Width of the coded pictures, px.
    pub width: usize,
    /// Height of the coded pictures, px.
    pub height: usize,
    /// Length of one tick of the time stamps.
    pub timebase: Timebase,
    /// Clockwise rotation at which the pictures are shown: 0, 90, 180 or 270 degrees.
    pub rotation: u16,
    /// Width over height of one pixel, as a fraction.
    pub pixel_aspect: (u32, u32),
    /// Mean frame rate, 1/s, where it is known without reading the frames.
    pub frame_rate: Option<f64>,
    /// Number of frames, where it is known without reading them.
    pub frames: Option<u64>,
    /// Focal length by the metadata of the clip, px.
    pub focal_px: Option<f64>,
}

impl ClipInfo {
    /// Upright pictures of `width × height` square pixels, and nothing else known.
    pub fn new(width: usize, height: usize, timebase: Timebase) -> Self {
        Self {
            width,
            height,
            timebase,
            rotation: 0,
            pixel_aspect: (1, 1),
            frame_rate: None,
            frames: None,
            focal_px: None,
        }
    }
}
