//! The tracks of a clip, and the map applied to them before anything else is computed from them.

use crate::track::{FrameTracks, TrackStore};
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
