//! The tracks of a clip, and the map applied to them before anything else is computed from them.

use std::ops::Range;

use super::error::StabilizeError;
use crate::motion::{ClipMotion, FrameMotion};
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
    /// The points in `frames`, with the index of the first frame as that of the window.
    ///
    /// # Errors
    /// [`StabilizeError::Store`].
    pub fn part(&self, frames: Range<usize>) -> Result<WindowTracks, StabilizeError> {
        let window = frames.start;
        Ok(WindowTracks { size: (self.width, self.height), window, frames: self.store.window(frames)? })
    }

    /// The tracks of the clip of `motion`, of which those in `parts` are known: [`Self::part`] read back, in order.
    ///
    /// # Errors
    /// [`StabilizeError::Input`] for points of another clip; [`StabilizeError::Store`].
    pub fn of_parts<E: From<StabilizeError>>(
        parts: impl IntoIterator<Item = Result<WindowTracks, E>>,
        motion: &ClipMotion,
    ) -> Result<Self, E> {
        let (width, height) = (motion.width as usize, motion.height as usize);
        let mut store = TrackStore::new().map_err(StabilizeError::from)?;
        let mut push = |tracks: &FrameTracks| store.push(tracks).map_err(StabilizeError::from);
        let unknown = |frame: &FrameMotion| {
            let quality = FrameQuality::default();
            FrameTracks { pts: frame.pts, observations: Vec::new(), quality }
        };
        let mut next = 0;
        for part in parts {
            let part = part?;
            let frames = part.window..part.window.saturating_add(part.frames.len());
            let times = motion.frames.get(frames.clone()).map(|frames| frames.iter().map(|f| f.pts));
            let fits = times.is_some_and(|times| times.eq(part.frames.iter().map(|f| f.pts)));
            if part.size != (width, height) || frames.start < next || !fits {
                let text = "the tracks of a part are not of this clip; plan it again".to_owned();
                return Err(StabilizeError::Input(text).into());
            }
            motion.frames[next..frames.start].iter().try_for_each(|frame| push(&unknown(frame)))?;
            part.frames.iter().try_for_each(&mut push)?;
            next = frames.end;
        }
        motion.frames[next..].iter().try_for_each(|frame| push(&unknown(frame)))?;
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
