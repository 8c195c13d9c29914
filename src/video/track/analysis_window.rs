//! Analysis windows: the tracker's state never reaches further back than a fixed number of frames.
//!
//! A clip is partitioned into windows of a fixed length, counted in frames of the clip. Window `k` *owns* the frames
//!
//! ```text
//! [k·L, (k+1)·L)      and its tracker reads      [k·L − V, (k+1)·L),
//! ```
//!
//! from nothing: without a reference picture, without tracks. The `V` frames before its own, the *warm-up*, are owned by the window
//! before. Both have tracked them, which is how the tracks are joined ([`super::TrackJoiner`]).
//!
//! The result of a window depends on the frames that it reads and on nothing else. Windows can be analyzed in any order, at the same
//! time, and in processes that know nothing of each other; the ordinary analysis is the same windows one after the other.
//!
//! **Why the frames of the clip are counted and not those of the shot.** Cuts are found by the tracker. A partition that began anew at
//! each of them would need a pass of its own before the first window could start, and one cut recognized differently would move all
//! windows behind it. With the number of the frame alone, a process knows its window before it has decoded anything. A cut inside a
//! window is handled by its tracker as ever; one in the warm-up or at the first frame after it is seen by both windows and reported by
//! the owner of the frame.
//!
//! **Why the result is that of an undivided tracker.** A frame is classified by the frame itself and a state with a bounded memory: a
//! picture is kept over at most `BLACK_FRAMES` black frames, then as the picture before a flash for at most `FLASH_FRAMES` more. The
//! warm-up is longer than both together, so that at its end every picture that the tracker may still return to is one that the window
//! has seen too, if it exists at all. The running median of the sharpness has a longer memory (a second); it needs no picture, only one
//! number per frame, and is computed at the join. Left to the window are two decisions of degree: which corners it starts from, and
//! at which frame a picture that creeps by less than the noise counts as moved.

use std::ops::{Range, RangeInclusive};

use super::tracker::{BLACK_FRAMES, FLASH_FRAMES};
use plumbline_num::options::OptionError;

/// Frames that a window owns: at 30 frames/s 20 s. The warm-up costs 2.7 % of the tracking; half the length would cost twice that,
/// for twice the joins. Twice the length leaves a clip of ten minutes with too few windows for 16 processes. A sixth of the length
/// does not change the stabilized clip measurably (`docs/ABLATIONS.md`).
const LENGTH: usize = 600;

/// Frames of the warm-up: more than the longest memory of the tracker, a flash directly after the longest bridged black. With less, a
/// window that starts within black would report as new what the window before continues.
const WARM_UP: usize = 16;
const _: () = assert!(WARM_UP as u32 > BLACK_FRAMES + FLASH_FRAMES + 1);

/// Partition of a clip into analysis windows of fixed length, each tracked from nothing.
///
/// # Example
/// ```
/// use plumbline_video::track::AnalysisWindows;
///
/// let windows = AnalysisWindows::new(600, 16)?;
/// assert_eq!((windows.count(1300), windows.owned(1), windows.read(1)), (3, 600..1200, 584..1200));
/// assert_eq!((windows.of(583), windows.of(584)), (0..=0, 0..=1));
/// # Ok::<(), plumbline_num::options::OptionError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AnalysisWindows {
    length: usize,
    warm_up: usize,
}

impl Default for AnalysisWindows {
    fn default() -> Self {
        Self { length: LENGTH, warm_up: WARM_UP }
    }
}

impl AnalysisWindows {
    /// For tests: a few pictures have several borders.
    #[cfg(test)]
    pub(crate) const SHORT: Self = Self { length: 20, warm_up: 16 };

    /// Windows that own `length` frames each, `L`, and are tracked from `warm_up` frames before, `V`.
    ///
    /// # Errors
    /// [`OptionError`]: a length of 0, or a warm-up that is longer than a window.
    pub fn new(length: usize, warm_up: usize) -> Result<Self, OptionError> {
        OptionError::check(length > 0, "length of an analysis window", length as f64, "1 and up")?;
        OptionError::check(warm_up <= length, "warm-up of an analysis window", warm_up as f64, "at most its length")?;
        Ok(Self { length, warm_up })
    }

    /// Frames that a window owns.
    pub fn length(&self) -> usize {
        self.length
    }

    /// Frames before its own from which a window is tracked.
    pub fn warm_up(&self) -> usize {
        self.warm_up
    }

    /// Number of windows of a clip of `frames` frames.
    pub fn count(&self, frames: usize) -> usize {
        frames.div_ceil(self.length)
    }

    /// The frames that a window owns; the last one of a clip owns those that there are.
    pub fn owned(&self, window: usize) -> Range<usize> {
        let start = window.saturating_mul(self.length);
        start..start.saturating_add(self.length)
    }

    /// The frames that a window is tracked through: its own and the warm-up.
    pub fn read(&self, window: usize) -> Range<usize> {
        let owned = self.owned(window);
        owned.start.saturating_sub(self.warm_up)..owned.end
    }

    /// The windows that read a frame, the owner first.
    pub fn of(&self, frame: usize) -> RangeInclusive<usize> {
        frame / self.length..=(frame + self.warm_up) / self.length
    }
}
