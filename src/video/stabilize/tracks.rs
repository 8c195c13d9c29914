//! The tracks of a clip, and the map applied to them before anything else is computed from them.

use std::ops::Range;

use super::error::StabilizeError;
use crate::motion::ClipMotion;
use crate::track::{FrameQuality, FrameTracks, TrackStore, WindowTracks};
use plumbline_num::math::Point2;
use plumbline_num::time::Timebase;

/// The points of a clip, frame by frame.
#[derive(Debug)]
pub struct Tracks {
    /// The points, in a temporary file.
    pub store: TrackStore,
    /// Width of their pictures, px.
    pub width: usize,
    /// Height of these pictures, px.
    pub height: usize,
    /// Length of one tick of their time stamps.
    pub timebase: Timebase,
}

impl Tracks {
    /// The points of the background in `frames`, which are all that maps of frames take, with the index of the first frame as that of the
    /// window.
    ///
    /// # Errors
    /// [`StabilizeError::Store`].
    pub fn background(&self, frames: Range<usize>) -> Result<WindowTracks, StabilizeError> {
        let window = frames.start;
        let mut frames = self.store.window(frames)?;
        for frame in &mut frames {
            frame.observations.retain(|o| o.background);
        }
        Ok(WindowTracks { size: (self.width, self.height), window, frames })
    }

    /// The tracks of the clip of `motion`, of which those of some frames are known: [`Self::background`] read back.
    ///
    /// # Errors
    /// [`StabilizeError::Input`] for points of another clip; [`StabilizeError::Store`].
    pub fn of_background(known: &WindowTracks, motion: &ClipMotion) -> Result<Self, StabilizeError> {
        let (width, height) = (motion.width as usize, motion.height as usize);
        let frames = known.window..known.window.saturating_add(known.frames.len());
        let times = motion.frames.get(frames.clone()).map(|frames| frames.iter().map(|f| f.pts));
        if known.size != (width, height) || !times.is_some_and(|times| times.eq(known.frames.iter().map(|f| f.pts))) {
            return Err(StabilizeError::Input("the tracks of a part are not of this clip; plan it again".to_owned()));
        }
        let mut store = TrackStore::new()?;
        for (index, frame) in motion.frames.iter().enumerate() {
            let (pts, quality) = (frame.pts, FrameQuality::default());
            match index.checked_sub(frames.start).and_then(|k| known.frames.get(k)) {
                Some(known) => store.push(known)?,
                None => store.push(&FrameTracks { pts, observations: Vec::new(), quality })?,
            }
        }
        Ok(Self { store, width, height, timebase: motion.timebase })
    }
}

/// A map of the whole clip that precedes the stabilization, such as the undistortion of the lens.
///
/// Points are tracked in the clip's own pictures and mapped; motion, path and warp are those of the mapped picture.
#[derive(Clone, Copy)]
pub struct PointCarrier<'a> {
    /// Size of the mapped picture, px.
    pub size: (usize, usize),
    /// Maps a point of the clip to the mapped picture; `None` where that does not contain it.
    pub out_from_src: &'a dyn Fn(Point2) -> Option<Point2>,
}

impl PointCarrier<'_> {
    /// Maps the points of a frame; drops those outside the mapped picture.
    pub fn carry(&self, tracks: &mut FrameTracks) {
        let (width, height) = (self.size.0 as f64, self.size.1 as f64);
        tracks.observations.retain_mut(|o| {
            let shown = (self.out_from_src)(Point2::new(f64::from(o.x), f64::from(o.y)));
            let inside = shown.filter(|p| p.x >= 0.0 && p.y >= 0.0 && p.x <= width && p.y <= height);
            if let Some(p) = inside {
                (o.x, o.y) = (p.x as f32, p.y as f32);
            }
            inside.is_some()
        });
    }
}
