//! Reconstruction of a shot of any length in overlapping windows.
//!
//! Each window is solved alone, so that memory contains the observations of one window only, and so that windows can be solved on
//! several machines. The focal length of the first window that shows one is the prior of the others: the *leading* windows of a shot
//! are solved in order until one does, all others in any order. Adjacent windows are aligned by their common cameras and points
//! ([`super::join`]); if the difference would be visible, the shot is split there and the parts keep coordinate systems of their own.
//!
//! Within a window the cameras that do not explain their frame are removed. If a window as a whole has no accepted
//! cameras, the stretches that do are solved alone.

use std::ops::Range;

use super::figures::explained_frames;
use super::join::{fit, is_seamless, joined, overlap};
use super::{Reconstruction, Segment, SfmOptions, SfmVerdict, TrackTable, reconstruct};
use plumbline_num::run::{Run, Stopped};

/// Minimum number of frames with a coordinate system of their own: a shorter stretch ends before its own path has been
/// smoothed.
pub(super) const MIN_WINDOW_FRAMES: usize = 25;
/// Maximum gap without cameras, in frames, between two stretches that are bridged to one.
const BRIDGED: usize = 8;
/// Maximum recursion depth of the splitting of a stretch: no frame is solved more than three times.
const DEPTH: usize = 2;
/// Most leading windows: what no window of the first minute shows is not worth the waiting of all others.
const LEADING: usize = 3;
/// Minimum standard deviation of `ln f` in the prior from a leading window: it moves the border of the picture by 0.6 px at
/// 640 px across, the accuracy of tracks.
const STEADY_FOCAL: f64 = 2e-3;

/// Partition of long shots into windows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Windows {
    /// Maximum length, in frames, of a shot that is solved at once.
    pub longest: usize,
    /// Maximum number of frames of a window of a longer shot.
    pub length: usize,
    /// Number of frames shared by two windows.
    pub overlap: usize,
}

impl Default for Windows {
    /// 30 MB of observations per window, and an overlap of four seconds.
    fn default() -> Self {
        Self { longest: 800, length: 600, overlap: 120 }
    }
}

impl Windows {
    /// The windows of a shot, in order, of lengths as even as possible.
    fn of(&self, frames: Range<usize>) -> Vec<Range<usize>> {
        if frames.len() <= self.longest.max(self.length) {
            return vec![frames];
        }
        let step = self.length.saturating_sub(self.overlap).max(1);
        let count = (frames.len() - self.overlap).div_ceil(step);
        let start = |k: usize| frames.start + k * (frames.len() - self.length) / (count - 1);
        (0..count).map(|k| start(k)..start(k) + self.length).collect()
    }
}

/// Reconstructs a shot; `read` returns the tracks of a range of its frames, the first of them as frame 0.
///
/// The segments cover the shot in order.
///
/// # Errors
/// Those of `read`; [`Stopped`].
pub fn reconstruct_shot<E: From<Stopped>>(
    shot: Range<usize>,
    mut read: impl FnMut(Range<usize>) -> Result<TrackTable, E>,
    options: &SfmOptions,
    windows: &Windows,
    run: &Run,
) -> Result<Vec<Segment>, E> {
    let windows = ShotWindows::new(shot, windows);
    let mut unit_px = 1.0;
    let mut read = |frames: Range<usize>| {
        let table = read(frames)?;
        unit_px = table.unit_px();
        Ok::<_, E>(table)
    };
    let mut found = windows.solve_leading(&mut read, options, run)?;
    let options = ShotWindows::following(options, found.iter().map(Vec::as_slice));
    for window in &windows.ranges()[found.len()..] {
        found.push(ShotWindows::solve(window, &mut read, &options, run)?);
    }
    Ok(ShotWindows::join(found, unit_px))
}

/// The windows of a shot, in order, each solved by a call of its own: [`reconstruct_shot`] in parts.
///
/// ```
/// use plumbline_video::motion::sfm::{ShotWindows, Windows};
///
/// let windows = ShotWindows::new(100..2500, &Windows::default());
/// assert_eq!(windows.ranges().first(), Some(&(100..700)));
/// assert_eq!(windows.ranges().len(), 5);
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ShotWindows {
    ranges: Vec<Range<usize>>,
}

impl ShotWindows {
    /// The windows of the frames `shot`.
    pub fn new(shot: Range<usize>, windows: &Windows) -> Self {
        Self { ranges: windows.of(shot) }
    }

    /// The frames of each window.
    pub fn ranges(&self) -> &[Range<usize>] {
        &self.ranges
    }

    /// The windows that may have to be solved before the others; none where the focal length is known.
    pub fn leading(&self, options: &SfmOptions) -> &[Range<usize>] {
        &self.ranges[..if options.focal.is_some() { 0 } else { LEADING.min(self.ranges.len()) }]
    }

    /// Solves the leading windows, up to the first that shows the focal length. `read` returns the tracks of a range of frames, the
    /// first of them as frame 0. The segments of each window cover it in order.
    ///
    /// # Errors
    /// Those of `read`; [`Stopped`].
    pub fn solve_leading<E: From<Stopped>>(
        &self,
        mut read: impl FnMut(Range<usize>) -> Result<TrackTable, E>,
        options: &SfmOptions,
        run: &Run,
    ) -> Result<Vec<Vec<Segment>>, E> {
        let mut found: Vec<Vec<Segment>> = Vec::new();
        for window in self.leading(options) {
            found.push(solved(window.clone(), &mut read, options, DEPTH, run)?);
            if found.last().is_some_and(|segments| focal_prior(segments).is_some()) {
                break;
            }
        }
        Ok(found)
    }

    /// Solves one of the other windows, with the options that the leading ones give ([`Self::following`]).
    ///
    /// # Errors
    /// Those of `read`; [`Stopped`].
    pub fn solve<E: From<Stopped>>(
        window: &Range<usize>,
        mut read: impl FnMut(Range<usize>) -> Result<TrackTable, E>,
        options: &SfmOptions,
        run: &Run,
    ) -> Result<Vec<Segment>, E> {
        solved(window.clone(), &mut read, options, DEPTH, run)
    }

    /// The options of the windows behind the leading ones, of which these segments are.
    pub fn following<'a>(options: &SfmOptions, leading: impl IntoIterator<Item = &'a [Segment]>) -> SfmOptions {
        SfmOptions { focal: options.focal.or_else(|| leading.into_iter().find_map(focal_prior)), ..*options }
    }

    /// The segments of the shot from those of its windows, in order, in pictures `unit_px` times 640 px across.
    pub fn join(found: impl IntoIterator<Item = Vec<Segment>>, unit_px: f64) -> Vec<Segment> {
        let mut segments: Vec<Segment> = Vec::new();
        for segment in found.into_iter().flatten() {
            push(&mut segments, segment, unit_px);
        }
        segments
    }
}

/// The focal length that the segments of a window show, and the standard deviation of `ln f` in the prior of other windows: three times
/// its own.
fn focal_prior(segments: &[Segment]) -> Option<(f64, f64)> {
    segments.iter().rev().find_map(|segment| {
        let sigma = segment.figures.sigma_ln_focal.filter(|_| segment.verdict == SfmVerdict::ThreeD)?;
        Some((segment.figures.focal, (3.0 * sigma).max(STEADY_FOCAL)))
    })
}

/// Appends a segment, merging it with the last one if they share frames and fit.
fn push(segments: &mut Vec<Segment>, mut next: Segment, unit_px: f64) {
    while let Some(mut last) = segments.pop() {
        if next.frames.end <= last.frames.start {
            // Two windows share these frames, and the first one has split them: they are known.
            segments.push(last);
            return;
        }
        let shared = overlap(&last, &next);
        if shared.is_empty() {
            segments.push(last);
            break;
        }
        if let Some(fit) = fit(&last, &next).filter(|fit| is_seamless(fit, unit_px)) {
            segments.push(joined(&last, &next, &fit));
            return;
        }
        let seam = seam(&last, &next, &shared);
        let (start, end) = (last.frames.start, next.frames.end);
        last.clip(start..seam, MIN_WINDOW_FRAMES);
        next.clip(seam..end, MIN_WINDOW_FRAMES);
        if !last.frames.is_empty() {
            segments.push(last);
            break;
        }
    }
    if !next.frames.is_empty() {
        segments.push(next);
    }
}

/// First frame of the second of two segments: if only one has cameras it keeps all of its frames.
fn seam(last: &Segment, next: &Segment, shared: &Range<usize>) -> usize {
    match (last.verdict.has_cameras(), next.verdict.has_cameras()) {
        (true, false) => shared.end,
        (false, true) => shared.start,
        _ => shared.start.midpoint(shared.end),
    }
}

/// Solves one window; frames that its cameras do not explain, and explained stretches of a failed window, are solved
/// alone.
fn solved<E: From<Stopped>>(
    frames: Range<usize>,
    read: &mut impl FnMut(Range<usize>) -> Result<TrackTable, E>,
    options: &SfmOptions,
    depth: usize,
    run: &Run,
) -> Result<Vec<Segment>, E> {
    let table = read(frames.clone())?;
    let found = reconstruct(&table, options, run)?;
    let explained = explained_frames(&table, &found.scene);
    let mut stretches: Vec<Range<usize>> =
        runs(&explained).into_iter().map(|r| frames.start + r.start..frames.start + r.end).collect();
    let mut whole = None;
    if let Some((first, last)) = stretches.first().zip(stretches.last()).filter(|_| found.verdict.has_cameras()) {
        let known = first.start..last.end;
        let mut segment = Segment::new(frames.clone(), &table, found);
        segment.forget(&explained);
        segment.clip(known.clone(), MIN_WINDOW_FRAMES);
        (whole, stretches) = (Some(segment), vec![known]);
    } else if depth == 0 || stretches.is_empty() || stretches[0] == frames {
        return Ok(vec![without_cameras(frames, found)]);
    }
    drop(table);
    let (mut segments, mut done) = (Vec::new(), frames.start);
    for stretch in stretches {
        segments.extend(rest(done..stretch.start, read, options, depth, run)?);
        done = stretch.end;
        match whole.take() {
            Some(segment) => segments.push(segment),
            None => segments.extend(solved(stretch, read, options, depth - 1, run)?),
        }
    }
    segments.extend(rest(done..frames.end, read, options, depth, run)?);
    Ok(segments)
}

/// Solves the frames without an accepted camera in a window.
fn rest<E: From<Stopped>>(
    frames: Range<usize>,
    read: &mut impl FnMut(Range<usize>) -> Result<TrackTable, E>,
    options: &SfmOptions,
    depth: usize,
    run: &Run,
) -> Result<Vec<Segment>, E> {
    if frames.is_empty() {
        return Ok(Vec::new());
    }
    if frames.len() < MIN_WINDOW_FRAMES || depth == 0 {
        let reason = format!("no camera explains these {} frames", frames.len());
        return Ok(vec![Segment::unknown(frames, SfmVerdict::Failed, reason)]);
    }
    solved(frames, read, options, depth - 1, run)
}

fn without_cameras(frames: Range<usize>, found: Reconstruction) -> Segment {
    let verdict = if found.verdict.has_cameras() { SfmVerdict::Failed } else { found.verdict };
    Segment { figures: found.figures, ..Segment::unknown(frames, verdict, found.reason) }
}

/// Stretches of explained frames of sufficient length, short gaps bridged.
fn runs(explained: &[bool]) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for (frame, _) in explained.iter().enumerate().filter(|(_, e)| **e) {
        match runs.last_mut() {
            Some(run) if frame - run.end <= BRIDGED => run.end = frame + 1,
            _ => runs.push(frame..frame + 1),
        }
    }
    runs.retain(|r| r.len() >= MIN_WINDOW_FRAMES);
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_cover_a_shot_and_share_at_least_what_is_asked() {
        let windows = Windows { longest: 100, length: 60, overlap: 20 };
        for frames in [1, 60, 100, 101, 140, 141, 999] {
            let found = windows.of(7..7 + frames);
            assert_eq!((found[0].start, found[found.len() - 1].end), (7, 7 + frames));
            assert_eq!(found.len() == 1, frames <= 100, "{frames}");
            assert!(found.windows(2).all(|w| w[1].start > w[0].start && w[1].start + 20 <= w[0].end), "{found:?}");
            assert!(found.len() == 1 || found.iter().all(|w| w.len() == 60));
        }
    }

    #[test]
    fn short_gaps_are_bridged_and_short_stretches_left_out() {
        let mut explained = vec![true; 100];
        explained[40..47].fill(false);
        explained[60..80].fill(false);
        assert_eq!((runs(&explained).len(), runs(&explained)[0].clone()), (1, 0..60));
        assert!(runs(&[true; 24]).is_empty());
    }

    fn without(frames: Range<usize>, verdict: SfmVerdict) -> Segment {
        Segment::unknown(frames, verdict, String::new())
    }

    #[test]
    fn a_segment_in_front_of_the_last_one_adds_no_frames() {
        // A clip of ten minutes failed by it: its cameras were for more frames than it had.
        let mut segments = Vec::new();
        for frames in [0..80, 80..100, 60..70, 70..140] {
            push(&mut segments, without(frames, SfmVerdict::Failed), 1.0);
        }
        let frames: Vec<Range<usize>> = segments.iter().map(|s| s.frames.clone()).collect();
        assert_eq!(frames, [0..80, 80..90, 90..140]);
    }

    #[test]
    fn segments_that_share_frames_without_fitting_are_parted_and_none_is_lost() {
        for verdict in [SfmVerdict::Failed, SfmVerdict::Zoom] {
            let mut segments = Vec::new();
            for part in [without(0..60, SfmVerdict::Failed), without(40..100, verdict), without(90..95, verdict)] {
                push(&mut segments, part, 1.0);
            }
            let ends: Vec<Range<usize>> = segments.iter().map(|s| s.frames.clone()).collect();
            assert!(ends[0].start == 0 && ends.windows(2).all(|w| w[0].end == w[1].start), "{ends:?}");
            assert!(segments.iter().all(|s| s.cameras.len() == s.frames.len()));
        }
    }
}
