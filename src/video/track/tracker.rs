//! The streaming tracker: takes one picture after another and returns the tracked points of each.
//!
//! Per frame: a small luma picture, its pyramid, the coarse global motion, each point by KLT with forward–backward check, then
//! the checks of a track (inside, not masked, same appearance as in its first frame, not on top of an older one), then new
//! corners where buckets lack points.
//!
//! Frames that cannot be matched are classified by the frames that follow. The last good picture is *kept* with its tracks:
//!
//! - black or flat frames have no features; the tracks continue from the kept picture after them;
//! - a frame where few points survive and the gray levels change begins a new shot (`cut_before`), but if one of the next
//!   [`FLASH_FRAMES`] matches the kept picture instead, it was a flash: the old tracks continue and report how many frames they
//!   skipped (`bridged`), which voids the cut;
//! - a repeated frame has exactly the positions of the one before and does not replace the reference, so that motion too slow
//!   to measure from one frame to the next accumulates.
//!
//! A tracker is started anew for every analysis window (`analysis_window.rs`), so that nothing here remembers the clip.

use plumbline_image::feature::{Corner, CornerDetector, Mask};
use plumbline_image::{Frame, PaddedPlane, Plane, PlaneRef, Pyramid, analysis_luma, analysis_size};
use plumbline_num::time::Timestamp;

use super::appearance::Appearance;
use super::klt::{Match, track};
use super::quality::{PictureStats, repeats};
use super::{FrameQuality, FrameTracks, Observation, coarse};

/// Options of the tracker.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackOptions {
    /// Longest side of the analysis picture, px, 64 and up. Larger is more accurate; the time grows with its square.
    pub analysis_side: usize,
    /// Target number of points, distributed evenly; 16 and up.
    pub points: usize,
}

impl Default for TrackOptions {
    fn default() -> Self {
        Self { analysis_side: 640, points: 1000 }
    }
}

impl TrackOptions {
    /// Size of the analysis picture of a `width×height` frame, px: the size that a [`Mask`] must have.
    pub fn analysis_size(&self, width: usize, height: usize) -> (usize, usize) {
        analysis_size(width, height, self.analysis_side)
    }
}

/// Errors of [`Tracker::new`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TrackError {
    /// The settings are at fault.
    #[error("analysis side {side} px is invalid (expected 64 to 65535)")]
    AnalysisSide {
        /// The setting.
        side: usize,
    },
    /// The settings are at fault.
    #[error("{points} points are invalid (expected 16 to 100000)")]
    Points {
        /// The setting.
        points: usize,
    },
    /// The caller is at fault: the mask is for another picture.
    #[error("the mask is {mask:?} px, the analysis picture {picture:?} px; make it with TrackOptions::analysis_size")]
    MaskSize {
        /// Width and height of the mask, px.
        mask: (usize, usize),
        /// Width and height of the analysis picture, px.
        picture: (usize, usize),
    },
}

/// Levels of the pyramid: the coarsest is 80 px wide at the default size, where a window bridges an eighth of the width.
const LEVELS: usize = 4;

/// Least fraction of the points that must survive; below it the frame does not continue the one before. The fastest pan that
/// the coarse search covers, a quarter of the side, leaves three quarters of them in view; across a cut only chance matches pass.
const MIN_SURVIVAL: f32 = 0.2;

/// Least fraction that must survive from the kept picture for the frames between to count as a flash: twice that of a
/// successive frame, since accepting it voids a cut.
const MIN_RETURN: f32 = 0.4;

/// Least number of points from which these fractions are computed: with fewer, one point is more than an eighth.
const MIN_TRACKS: usize = 8;

/// Longest flash, frames. Longer ones are indistinguishable from cutting away and back, which is two cuts.
pub(super) const FLASH_FRAMES: u32 = 4;

/// Longest black that tracks bridge, frames: beyond, the camera may be anywhere and motion cannot be interpolated.
pub(super) const BLACK_FRAMES: u32 = 10;

/// Frames between appearance checks of a track, staggered by its id: drift accumulates over many frames, so that checking every
/// frame would cost six times as much for little.
const APPEARANCE_EVERY: u32 = 6;

/// Distance below which two tracks follow the same point, px of the analysis picture: half of the least distance of new corners.
pub(super) const SAME_POINT_PX: f32 = 4.0;

/// A point being tracked.
#[derive(Clone, Debug)]
struct Track {
    id: u32,
    /// Position in the reference picture, px of the analysis picture.
    position: [f32; 2],
    /// Frames since the first one.
    age: u32,
    first: Appearance,
}

/// A picture and the points in it.
#[derive(Clone, Debug)]
struct Reference {
    pyramid: Pyramid,
    stats: PictureStats,
    tracks: Vec<Track>,
    /// Frames since.
    age: u32,
}

/// Follows points through an analysis window, or a clip of any length.
#[derive(Debug)]
pub struct Tracker {
    width: usize,
    height: usize,
    options: TrackOptions,
    mask: Option<Mask>,
    detector: CornerDetector,
    /// The last picture with features.
    reference: Option<Reference>,
    /// The reference before a frame that did not continue it.
    kept: Option<Reference>,
    next_id: u32,
    luma: Plane<u8>,
    /// A pyramid whose memory is reused.
    spare: Pyramid,
}

impl Tracker {
    /// A tracker for frames of `width×height` px.
    ///
    /// # Errors
    /// [`TrackError`] where a setting is out of its range or the mask has another size than the analysis picture.
    pub fn new(width: usize, height: usize, options: TrackOptions, mask: Option<Mask>) -> Result<Self, TrackError> {
        if !(64..=65_535).contains(&options.analysis_side) {
            return Err(TrackError::AnalysisSide { side: options.analysis_side });
        }
        if !(16..=100_000).contains(&options.points) {
            return Err(TrackError::Points { points: options.points });
        }
        let picture = options.analysis_size(width, height);
        if let Some(mask) = mask.as_ref().map(Mask::plane).map(|p| (p.width(), p.height())).filter(|m| *m != picture) {
            return Err(TrackError::MaskSize { mask, picture });
        }
        Ok(Self {
            width,
            height,
            options,
            mask,
            detector: CornerDetector::default(),
            reference: None,
            kept: None,
            next_id: 0,
            luma: Plane::new(0, 0),
            spare: Pyramid::new(),
        })
    }

    /// The points of the next frame. A frame of another size than the tracker's, or without memory, counts as black.
    pub fn push(&mut self, frame: &Frame) -> FrameTracks {
        let mut luma = std::mem::replace(&mut self.luma, Plane::new(0, 0));
        let sized = (frame.width, frame.height) == (self.width, self.height);
        let usable = sized && analysis_luma(frame, self.options.analysis_side, &mut luma);
        let tracks = if usable { self.push_luma(luma.as_ref(), frame.pts) } else { self.nothing(frame.pts, 0.0) };
        self.luma = luma;
        tracks
    }

    /// The points of the next frame, given as an analysis picture of [`TrackOptions::analysis_size`].
    pub fn push_luma(&mut self, luma: PlaneRef<'_, u8>, pts: Timestamp) -> FrameTracks {
        let mut pyramid = std::mem::take(&mut self.spare);
        pyramid.rebuild(luma, LEVELS);
        let stats = PictureStats::of(&pyramid);
        if stats.black {
            self.spare = pyramid;
            return self.nothing(pts, stats.sharpness);
        }
        let mut quality = FrameQuality { sharpness: stats.sharpness, ..FrameQuality::default() };
        if let Some(reference) =
            self.reference.as_mut().filter(|r| repeats(&r.pyramid.levels()[0], &pyramid.levels()[0]))
        {
            quality.bridged = std::mem::take(&mut reference.age);
            quality.duplicate = quality.bridged == 0;
            self.spare = pyramid;
            self.age_kept();
            return self.report(pts, quality);
        }
        let now = Reference { pyramid, stats, tracks: Vec::new(), age: 0 };
        self.advance(now, &mut quality);
        self.report(pts, quality)
    }

    /// A frame without features.
    fn nothing(&mut self, pts: Timestamp, sharpness: f32) -> FrameTracks {
        let expired = |r: &mut Reference, limit: u32| {
            r.age += 1;
            r.age > limit
        };
        if self.reference.as_mut().is_some_and(|r| expired(r, BLACK_FRAMES)) {
            self.reference = None;
        }
        if self.kept.as_mut().is_some_and(|r| expired(r, FLASH_FRAMES)) {
            self.kept = None;
        }
        let quality = FrameQuality { sharpness, black: true, ..FrameQuality::default() };
        FrameTracks { pts, observations: Vec::new(), quality }
    }

    /// Makes `now` the reference, with the tracks that reach it and new ones.
    fn advance(&mut self, mut now: Reference, quality: &mut FrameQuality) {
        if let Some(before) = self.reference.take() {
            let followed = self.follow(&before, &now);
            if continues(&before, &followed, MIN_SURVIVAL) {
                quality.bridged = before.age;
                now.tracks = self.thinned(followed, &now.pyramid.levels()[0]);
                self.spare = before.pyramid;
                self.age_kept();
            } else {
                self.interrupted(before, followed, &mut now, quality);
            }
        }
        self.top_up(&mut now);
        self.reference = Some(now);
    }

    /// `now` does not continue `before`: the end of a flash, or the beginning of something else.
    fn interrupted(&mut self, before: Reference, reached: Vec<Track>, now: &mut Reference, quality: &mut FrameQuality) {
        if let Some(kept) = self.kept.take() {
            let followed = self.follow(&kept, now);
            if continues(&kept, &followed, MIN_RETURN) {
                quality.bridged = kept.age + 1;
                now.tracks = self.thinned(followed, &now.pyramid.levels()[0]);
                return;
            }
        }
        quality.cut_before = before.stats.differs(&now.stats);
        if before.tracks.len() >= MIN_TRACKS {
            self.kept = Some(before);
        } else if !quality.cut_before {
            quality.bridged = before.age;
            now.tracks = self.thinned(reached, &now.pyramid.levels()[0]);
        }
    }

    /// Ages the kept picture by a frame that continues its successor; drops it once no flash is that long.
    fn age_kept(&mut self) {
        if self.kept.as_mut().is_some_and(|kept| {
            kept.age += 1;
            kept.age >= FLASH_FRAMES
        }) {
            self.kept = None;
        }
    }

    /// The tracks of `before` that are found in `now`.
    fn follow(&self, before: &Reference, now: &Reference) -> Vec<Track> {
        let points: Vec<[f32; 2]> = before.tracks.iter().map(|t| t.position).collect();
        let shift = coarse::shift(&before.pyramid, &now.pyramid);
        let mut matches = matched(before, now, &points, shift);
        let lost = matches.iter().filter(|m| m.is_none()).count();
        if shift != [0.0; 2] && 2 * lost > points.len() {
            // The coarse motion was that of a moving object: the lost ones are tried again from no motion.
            let again = matched(before, now, &points, [0.0; 2]);
            matches.iter_mut().zip(again).for_each(|(m, again)| *m = m.or(again));
        }
        let pairs = before.tracks.iter().zip(matches);
        pairs.filter_map(|(track, found)| self.continued(track, found?.position, now)).collect()
    }

    /// The track at its new position, unless it left the picture, entered the mask or changed its appearance.
    fn continued(&self, track: &Track, position: [f32; 2], now: &Reference) -> Option<Track> {
        let level = &now.pyramid.levels()[0];
        let (w, h) = (level.width() as f32, level.height() as f32);
        let inside = (0.0..w).contains(&position[0]) && (0.0..h).contains(&position[1]);
        let masked = self.mask.as_ref().is_some_and(|m| m.covers(position[0], position[1]));
        let checked = (track.age + track.id).is_multiple_of(APPEARANCE_EVERY);
        let drifted = || checked && !track.first.agrees(&Appearance::at(level, position));
        (inside && !masked && !drifted()).then(|| Track { position, age: track.age + 1, ..track.clone() })
    }

    /// Drops tracks that ran into an older one, and the youngest of buckets with twice their number of points.
    fn thinned(&self, tracks: Vec<Track>, picture: &PaddedPlane) -> Vec<Track> {
        const CELL: f32 = SAME_POINT_PX;
        let (w, h) = (picture.width(), picture.height());
        let (cols, rows) = CornerDetector::grid(w, h);
        let most = 2 * self.per_bucket(picture);
        let cell_cols = w / CELL as usize + 1;
        let mut cells = vec![false; cell_cols * (h / CELL as usize + 1)];
        let mut buckets = vec![0; cols * rows];
        let keep = |track: &Track| {
            let [x, y] = track.position;
            let cell = &mut cells[(y / CELL) as usize * cell_cols + (x / CELL) as usize];
            let bucket = &mut buckets[(y as usize * rows / h) * cols + x as usize * cols / w];
            let kept = !*cell && *bucket < most;
            *cell = true;
            *bucket += usize::from(kept);
            kept
        };
        let mut tracks = tracks;
        tracks.retain(keep);
        tracks
    }

    /// Target number of points per bucket.
    fn per_bucket(&self, picture: &PaddedPlane) -> usize {
        let (cols, rows) = CornerDetector::grid(picture.width(), picture.height());
        self.options.points.div_ceil(cols * rows).max(1)
    }

    /// New tracks where buckets lack points.
    fn top_up(&mut self, now: &mut Reference) {
        let level = &now.pyramid.levels()[0];
        let per_bucket = self.per_bucket(level);
        let points: Vec<[f32; 2]> = now.tracks.iter().map(|t| t.position).collect();
        let mut found: Vec<Corner> = Vec::new();
        self.detector.top_up(level, &points, per_bucket, self.mask.as_ref(), &mut found);
        for corner in found {
            let (id, position) = (self.next_id, corner.position);
            now.tracks.push(Track { id, position, age: 0, first: Appearance::at(level, position) });
            self.next_id += 1;
        }
    }

    /// The result for a frame whose points are those of the reference.
    fn report(&self, pts: Timestamp, quality: FrameQuality) -> FrameTracks {
        let tracks = self.reference.as_ref().map_or(&[][..], |r| &r.tracks);
        let (w, h) = self.options.analysis_size(self.width, self.height);
        let scale = [self.width as f32 / w as f32, self.height as f32 / h as f32];
        let seen = |t: &Track| Observation {
            id: t.id,
            x: t.position[0] * scale[0],
            y: t.position[1] * scale[1],
            background: true,
        };
        FrameTracks { pts, observations: tracks.iter().map(seen).collect(), quality }
    }
}

/// Where `points` of `before`, moved by `shift`, are found in `now`.
fn matched(before: &Reference, now: &Reference, points: &[[f32; 2]], shift: [f32; 2]) -> Vec<Option<Match>> {
    let guesses: Vec<[f32; 2]> = points.iter().map(|p| [p[0] + shift[0], p[1] + shift[1]]).collect();
    track(&before.pyramid, &now.pyramid, points, &guesses)
}

/// Whether at least the fraction `survival` of `before`'s points was followed; false where there are too few to decide.
fn continues(before: &Reference, followed: &[Track], survival: f32) -> bool {
    before.tracks.len() >= MIN_TRACKS && followed.len() as f32 >= survival * before.tracks.len() as f32
}
