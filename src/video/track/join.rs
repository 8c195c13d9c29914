//! Joins the tracks of analysis windows to those of the clip.
//!
//! Every frame is that of the window that owns it. What remains to be decided at a border is which track of the next window is which
//! of the former. Both windows have tracked the warm-up, in the same pictures, each from corners of its own: the same corner of the
//! scene carries a track in both, and a track that has drifted for a while is next to the corner that it began at. With positions
//! `pᵢ(t)` in the former window and `qⱼ(t)` in the next, and `e` the last frame of the warm-up in which track `j` is observed,
//!
//! ```text
//! j continues i   if   |pᵢ(e) − qⱼ(e)| ≤ R    and    |(pᵢ(t) − qⱼ(t)) − (pᵢ(e) − qⱼ(e))| ≤ A   in every frame t that both observe,
//! ```
//!
//! nearest pairs first, each track once: the two are nearer than two corners, and move as one. The joined track
//! keeps the id, and the offset `dᵢ = pᵢ(e) − qⱼ(e)` is added to the positions of the next window: it goes on from where it was, and
//! its motion from frame to frame is the one that the window measured.
//!
//! Tracks of the next window that continue none are new. They begin in the warm-up, whose frames have the points of both windows: any
//! two successive frames share all tracks of one window, so that the motion between them is measured by as many points at a border as
//! elsewhere; the cameras of the warm-up see the points on both sides of it; and what is faded over the life of a track is faded over
//! from one window's tracks to the other's.
//!
//! A frame is blurred relative to the frames around it, across borders; that verdict is made here too, from the sharpness that the
//! tracker measured.
//!
//! Memory: the observations of two warm-ups.

use std::collections::{HashMap, HashSet, VecDeque};

use super::quality::SharpnessMedian;
use super::tracker::SAME_POINT_PX;
use super::{AnalysisWindows, FrameTracks, Observation};

/// R, px of the analysis picture: where the tracker itself takes two tracks for one. Of the tracks of three handheld clips it continues
/// 53 to 59 %; half of it 28 to 45 %, with which a tele shot of little parallax loses its depth when it is cut into windows of a sixth of
/// the length. A larger one would pair neighbors. The price is the offset: where a scene grows by a tenth until the track ends, 4 px
/// move the point by 0.4 px on its surface.
const RADIUS_PX: f32 = SAME_POINT_PX;

/// A, px of the analysis picture: five times the noise of a track; an offset of R changes by as much in a rotation by 7°, more than a
/// hand turns a camera in half a second. Points of different depths under parallax, and on both sides of the edge of a moving object,
/// differ by more.
const AGREEMENT_PX: f32 = 0.5;

/// Tracks of the former window in a cell of side R that are compared: the tracker leaves one, and offsets move few into another's
/// cell. A window file that says that all of its tracks are at one point costs no more than others.
const MAX_PER_CELL: usize = 8;

/// Joins the frames of analysis windows, in bounded memory.
#[derive(Debug)]
pub struct TrackJoiner {
    windows: AnalysisWindows,
    /// Size of a pixel of the analysis picture, px.
    unit_px: f32,
    /// Size of the picture, px.
    size: (f32, f32),
    /// The present window.
    window: usize,
    /// Index of the next frame of the clip.
    next: usize,
    /// The last frames taken, as many as the warm-up has; not returned yet.
    recent: VecDeque<FrameTracks>,
    /// The warm-up of the next window, with the ids of the window.
    warm_up: Vec<FrameTracks>,
    /// Tracks of the clip by those of the present window.
    tracks: HashMap<u32, JoinedTrack>,
    next_id: u32,
    sharpness: SharpnessMedian,
}

/// The track of the clip that a track of a window is part of.
#[derive(Clone, Copy, Debug)]
struct JoinedTrack {
    id: u32,
    /// dᵢ, px.
    offset: [f64; 2],
}

/// A pair of tracks that may be one: in the former window and in the next.
struct Candidate {
    distance: f64,
    former: u32,
    next: u32,
    offset: [f64; 2],
}

/// Errors of [`TrackJoiner::push`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum JoinError {
    /// The caller is at fault: windows are joined in their order, each with its warm-up.
    #[error("a frame of analysis window {found} follows frame {frame} of the clip (expected window {expected})")]
    Order {
        /// Window that owns the next frame.
        expected: usize,
        /// Window of the frame that was pushed.
        found: usize,
        /// Frames joined so far.
        frame: usize,
    },
    /// The input is at fault: the windows are not of one clip.
    #[error("the warm-up of analysis window {window} has other times than the end of window {}; analyze both again", window - 1)]
    OtherClip {
        /// The later window.
        window: usize,
    },
}

impl TrackJoiner {
    /// For a clip of `width×height` px, tracked in windows with analysis pictures of `analysis_width` px.
    pub fn new(windows: AnalysisWindows, (width, height): (usize, usize), analysis_width: usize) -> Self {
        Self {
            windows,
            unit_px: width as f32 / analysis_width.max(1) as f32,
            size: (width as f32, height as f32),
            window: 0,
            next: 0,
            recent: VecDeque::new(),
            warm_up: Vec::new(),
            tracks: HashMap::new(),
            next_id: 0,
            sharpness: SharpnessMedian::default(),
        }
    }

    /// Takes the next frame of a window and returns the frame of the clip that is then complete: the length of a warm-up before it.
    ///
    /// A window's frames come in their order, from its warm-up on. The warm-up may come before, between or behind the last frames of
    /// the former window, and the first frame that the window owns behind all of these; the result is the same.
    ///
    /// # Errors
    /// [`JoinError`]: a frame that does not come next; the joiner is then as it was.
    pub fn push(&mut self, window: usize, tracks: FrameTracks) -> Result<Option<FrameTracks>, JoinError> {
        if window == self.window + 1 && self.warm_up.len() < self.warm_up_of(window) {
            self.warm_up.push(tracks);
            return Ok(None);
        }
        let expected = self.next / self.windows.length();
        if window != expected {
            return Err(JoinError::Order { expected, found: window, frame: self.next });
        }
        if window > self.window {
            self.cross_border(window, &tracks)?;
        }
        Ok(self.take(tracks))
    }

    /// The last frames of the clip.
    pub fn finish(self) -> impl Iterator<Item = FrameTracks> {
        self.recent.into_iter()
    }

    fn warm_up_of(&self, window: usize) -> usize {
        self.windows.owned(window).start - self.windows.read(window).start
    }

    /// Makes `window`, whose first own frame is `first`, the present one.
    fn cross_border(&mut self, window: usize, first: &FrameTracks) -> Result<(), JoinError> {
        let former = self.recent.iter().map(|f| f.pts).skip(self.recent.len().saturating_sub(self.warm_up.len()));
        if !former.eq(self.warm_up.iter().map(|f| f.pts)) {
            return Err(JoinError::OtherClip { window });
        }
        let next = std::mem::take(&mut self.warm_up);
        self.tracks = self.linked(&next);
        self.window = window;
        let new = |o: &&Observation| !self.tracks.contains_key(&o.id);
        let new: Vec<Observation> = first.observations.iter().filter(new).copied().collect();
        // Known by their ids from here on, in ascending order.
        for o in &new {
            self.joined(o);
        }
        let is_new = |o: &&Observation| new.binary_search_by_key(&o.id, |n| n.id).is_ok();
        let mut recent = std::mem::take(&mut self.recent);
        for (frame, begun) in recent.iter_mut().rev().zip(next.iter().rev()) {
            frame.observations.extend(begun.observations.iter().filter(is_new).filter_map(|o| self.joined(o)));
        }
        self.recent = recent;
        Ok(())
    }

    /// The tracks of the warm-up of the next window that continue tracks of the clip.
    fn linked(&self, warm_up: &[FrameTracks]) -> HashMap<u32, JoinedTrack> {
        let mut links = HashMap::new();
        let mut continued = HashSet::new();
        let mut seen = HashSet::new();
        for (former, next) in self.recent.iter().rev().zip(warm_up.iter().rev()) {
            let ending: Vec<Observation> = next.observations.iter().filter(|o| seen.insert(o.id)).copied().collect();
            let mut candidates = self.candidates(former, &ending, warm_up);
            candidates.sort_by(|a, b| {
                a.distance.total_cmp(&b.distance).then(a.former.cmp(&b.former)).then(a.next.cmp(&b.next))
            });
            for Candidate { former, next, offset, .. } in candidates {
                if !links.contains_key(&next) && continued.insert(former) {
                    links.insert(next, JoinedTrack { id: former, offset });
                }
            }
        }
        links
    }

    /// Pairs of a track of `former` and one of `next`, observed in the same frame, that satisfy both conditions of the module.
    fn candidates(&self, former: &FrameTracks, next: &[Observation], warm_up: &[FrameTracks]) -> Vec<Candidate> {
        let radius = RADIUS_PX * self.unit_px;
        let cell = |o: &Observation| ((o.x / radius) as i64, (o.y / radius) as i64);
        let mut cells: HashMap<(i64, i64), Vec<&Observation>> = HashMap::new();
        for p in &former.observations {
            let inside = cells.entry(cell(p)).or_default();
            if inside.len() < MAX_PER_CELL {
                inside.push(p);
            }
        }
        let mut found = Vec::new();
        for q in next {
            let (i, j) = cell(q);
            let around = (i - 1..=i + 1).flat_map(|i| (j - 1..=j + 1).map(move |j| (i, j)));
            for p in around.filter_map(|cell| cells.get(&cell)).flatten() {
                let offset = difference(p, q);
                let distance = offset[0].hypot(offset[1]);
                if distance <= f64::from(radius) && self.agree(p.id, q.id, offset, warm_up) {
                    found.push(Candidate { distance, former: p.id, next: q.id, offset });
                }
            }
        }
        found
    }

    /// Whether the difference of two tracks is `offset` in every frame of the warm-up that both observe.
    fn agree(&self, former: u32, next: u32, offset: [f64; 2], warm_up: &[FrameTracks]) -> bool {
        let limit = f64::from(AGREEMENT_PX * self.unit_px);
        self.recent.iter().rev().zip(warm_up.iter().rev()).all(|(f, n)| {
            let both = position(f, former).zip(position(n, next)).map(|(p, q)| difference(p, q));
            both.is_none_or(|d| (d[0] - offset[0]).hypot(d[1] - offset[1]) <= limit)
        })
    }

    /// Takes a frame of the present window; returns the one that leaves the warm-up.
    fn take(&mut self, mut tracks: FrameTracks) -> Option<FrameTracks> {
        let quality = &mut tracks.quality;
        if !quality.black && !quality.duplicate {
            quality.blurred = self.sharpness.push(quality.sharpness);
        }
        if quality.cut_before {
            self.sharpness.clear();
        }
        tracks.observations = tracks.observations.iter().filter_map(|o| self.joined(o)).collect();
        tracks.observations.sort_unstable_by_key(|o| o.id);
        self.recent.push_back(tracks);
        self.next += 1;
        if self.recent.len() > self.windows.warm_up() { self.recent.pop_front() } else { None }
    }

    /// An observation of the present window as one of the clip; `None` where the offset moves it out of the picture.
    fn joined(&mut self, o: &Observation) -> Option<Observation> {
        let next_id = &mut self.next_id;
        let track = self.tracks.entry(o.id).or_insert_with(|| {
            *next_id += 1;
            JoinedTrack { id: *next_id - 1, offset: [0.0; 2] }
        });
        // In f64 the sum is exact: a position that both windows know is not moved by the least bit.
        let [x, y] = [(o.x, 0), (o.y, 1)].map(|(v, axis)| (f64::from(v) + track.offset[axis]) as f32);
        let inside = (0.0..=self.size.0).contains(&x) && (0.0..=self.size.1).contains(&y);
        inside.then_some(Observation { id: track.id, x, y, ..*o })
    }
}

/// The observation of a track in a frame.
fn position(frame: &FrameTracks, id: u32) -> Option<&Observation> {
    frame.observations.binary_search_by_key(&id, |o| o.id).ok().map(|k| &frame.observations[k])
}

/// `p − q`, px.
fn difference(p: &Observation, q: &Observation) -> [f64; 2] {
    [f64::from(p.x) - f64::from(q.x), f64::from(p.y) - f64::from(q.y)]
}

#[cfg(test)]
mod tests;
