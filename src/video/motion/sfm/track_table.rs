//! The tracks of a shot, indexed by frame, by point, and by pairs of frames.

use super::Observation;
use plumbline_num::math::Point2;

/// Minimum number of frames of a track: the observations of a shorter one are used up by the point's own position.
const MIN_FRAMES: usize = 3;

/// The observations of all points of a shot in all frames.
#[derive(Clone, Debug)]
pub struct TrackTable {
    /// Width of the picture, px.
    pub width: u32,
    /// Height of the picture, px.
    pub height: u32,
    /// Sorted by frame, then by point.
    observations: Vec<Observation>,
    /// `observations[frame_starts[f]..frame_starts[f + 1]]` are those of frame `f`.
    frame_starts: Vec<usize>,
    /// Indices of observations, sorted by point, then by frame.
    by_point: Vec<u32>,
    point_starts: Vec<usize>,
    /// The tracker's identifier of each point.
    ids: Vec<u32>,
}

/// A point observed in two frames, px.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    /// Index of the point.
    pub point: u32,
    /// Observed position in the first frame.
    pub first: Point2,
    /// Observed position in the second frame.
    pub second: Point2,
}

/// [`TrackTable::unit_px`] of a picture of this size.
pub(crate) fn unit_px(width: u32, height: u32) -> f64 {
    f64::from(width.max(height)) / 640.0
}

impl TrackTable {
    /// From `(id, pixel)` of every frame in order; ids ascend within a frame. Tracks of fewer than three frames are left out.
    pub fn new<F>(width: u32, height: u32, frames: F) -> Self
    where
        F: IntoIterator,
        F::Item: IntoIterator<Item = (u32, Point2)>,
    {
        let seen: Vec<Vec<(u32, Point2)>> = frames.into_iter().map(|f| f.into_iter().collect()).collect();
        let read = |frame: usize| Ok::<_, std::convert::Infallible>(seen[frame].clone());
        let Ok(table) = Self::read(width, height, seen.len(), read);
        table
    }

    /// [`Self::new`] without the frames in memory: `read` returns those of a frame, and is asked for each of `frames` twice. First
    /// the tracks that are long enough are found, then their observations are stored.
    ///
    /// # Errors
    /// Those of `read`.
    pub fn read<E>(
        width: u32,
        height: u32,
        frames: usize,
        mut read: impl FnMut(usize) -> Result<Vec<(u32, Point2)>, E>,
    ) -> Result<Self, E> {
        let mut ids = Vec::new();
        for frame in 0..frames {
            ids.extend(read(frame)?.into_iter().map(|(id, _)| id));
        }
        ids.sort_unstable();
        let long = || ids.chunk_by(|a, b| a == b).filter(|track| track.len() >= MIN_FRAMES);
        let observations = Vec::with_capacity(long().map(<[u32]>::len).sum());
        let ids = long().map(|track| track[0]).collect();
        let frame_starts = vec![0];
        let mut table =
            Self { width, height, observations, frame_starts, by_point: Vec::new(), point_starts: Vec::new(), ids };
        for frame in 0..frames {
            table.push_frame(frame as u32, &read(frame)?);
        }
        table.index_points();
        Ok(table)
    }

    fn push_frame(&mut self, frame: u32, points: &[(u32, Point2)]) {
        for &(id, pixel) in points {
            if let Ok(point) = self.ids.binary_search(&id) {
                self.observations.push(Observation { frame, point: point as u32, pixel });
            }
        }
        self.frame_starts.push(self.observations.len());
    }

    fn index_points(&mut self) {
        self.point_starts = vec![0; self.ids.len() + 1];
        for o in &self.observations {
            self.point_starts[o.point as usize + 1] += 1;
        }
        for p in 0..self.ids.len() {
            self.point_starts[p + 1] += self.point_starts[p];
        }
        let mut next = self.point_starts.clone();
        self.by_point = vec![0; self.observations.len()];
        for (k, o) in self.observations.iter().enumerate() {
            self.by_point[next[o.point as usize]] = k as u32;
            next[o.point as usize] += 1;
        }
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.frame_starts.len() - 1
    }

    /// Length of a px at 640 px across: the accuracy of tracks is relative to the picture they are tracked in, which
    /// has that size.
    pub fn unit_px(&self) -> f64 {
        unit_px(self.width, self.height)
    }

    /// Cell of a position, row-major, in a grid of `columns` and `rows` over the picture; positions outside count to the
    /// nearest cell.
    pub(super) fn cell(&self, pixel: Point2, (columns, rows): (usize, usize)) -> usize {
        let along = |v: f64, size: u32, n: usize| ((v / f64::from(size) * n as f64).max(0.0) as usize).min(n - 1);
        along(pixel.y, self.height, rows) * columns + along(pixel.x, self.width, columns)
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.ids.len()
    }

    /// The tracker's identifier of a point.
    pub fn id(&self, point: u32) -> u32 {
        self.ids[point as usize]
    }

    /// All observations, by frame, within a frame by point.
    pub fn observations(&self) -> &[Observation] {
        &self.observations
    }

    /// The observations in a frame, by point, ascending.
    pub fn in_frame(&self, frame: usize) -> &[Observation] {
        &self.observations[self.frame_starts[frame]..self.frame_starts[frame + 1]]
    }

    /// The observations of a point, by frame.
    pub fn of_point(&self, point: usize) -> impl DoubleEndedIterator<Item = &Observation> + Clone {
        let range = self.point_starts[point]..self.point_starts[point + 1];
        self.by_point[range].iter().map(|&k| &self.observations[k as usize])
    }

    /// The points observed in both frames, ascending.
    pub fn shared(&self, first: usize, second: usize) -> Vec<Match> {
        let mut others = self.in_frame(second).iter().peekable();
        let mut matches = Vec::new();
        for a in self.in_frame(first) {
            while others.next_if(|b| b.point < a.point).is_some() {}
            if let Some(b) = others.next_if(|b| b.point == a.point) {
                matches.push(Match { point: a.point, first: a.pixel, second: b.pixel });
            }
        }
        matches
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points 10, 20, 30, of which 20 is tracked for two frames only.
    fn table() -> TrackTable {
        let at = |id: u32, frame: usize| (id, Point2::new(f64::from(id), frame as f64));
        let frame = |f: usize| [10, 20, 30].into_iter().filter(move |&id| id != 20 || f < 2).map(move |id| at(id, f));
        TrackTable::new(640, 360, (0..4).map(frame))
    }

    #[test]
    fn tracks_are_found_by_frame_and_by_point_and_short_ones_are_left_out() {
        let t = table();
        assert_eq!((t.frames(), t.points(), t.id(1)), (4, 2, 30));
        assert_eq!(t.in_frame(1).iter().map(|o| t.id(o.point)).collect::<Vec<_>>(), [10, 30]);
        let seen: Vec<(u32, f64)> = t.of_point(1).map(|o| (o.frame, o.pixel.y)).collect();
        assert_eq!(seen, [(0, 0.0), (1, 1.0), (2, 2.0), (3, 3.0)]);
        assert_eq!(t.observations().len(), 8);
    }

    #[test]
    fn shared_points_are_those_that_both_frames_see() {
        let frames = [vec![1, 2, 4], vec![2, 3, 4], vec![1, 2, 3, 4], vec![1, 3]];
        let frames = frames.map(|ids| ids.into_iter().map(|id: u32| (id, Point2::new(f64::from(id), 0.0))));
        let t = TrackTable::new(64, 64, frames);
        let ids = |a: usize, b: usize| t.shared(a, b).iter().map(|m| t.id(m.point)).collect::<Vec<_>>();
        assert_eq!(ids(0, 1), [2, 4]);
        assert_eq!(ids(2, 3), [1, 3]);
        assert_eq!(ids(0, 3), [1]);
    }
}
