//! The frames held around the one being rendered, within a budget of memory.
//!
//! Half of the budget is for frames that come later: each of them must be kept, for it will be rendered itself. The other
//! half is for earlier ones. Where it does not reach as far back as asked, frames are thinned out: the frame goes whose
//! gap, relative to its distance, is the smallest, so that spacing grows with distance and near frames stay dense.

use std::collections::VecDeque;
use std::sync::Arc;

use super::quarter::Quarter;
use crate::Frame;

/// How many frames to hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FillOptions {
    /// Memory that frames held may take, bytes. At least three frames are held.
    pub memory_bytes: usize,
    /// How far neighbors are looked for, frames before and after.
    pub reach_frames: usize,
}

impl Default for FillOptions {
    /// 256 MB: 74 frames of 1080p in 8 bit. Two seconds at 30 frames/s to either side: shake swings back within one.
    fn default() -> Self {
        Self { memory_bytes: 256 << 20, reach_frames: 60 }
    }
}

/// A frame held.
#[derive(Debug)]
pub(super) struct Held {
    /// Its number.
    pub(super) number: usize,
    pub(super) frame: Arc<Frame>,
    pub(super) quarter: Quarter,
}

/// Frames in order of time.
#[derive(Debug)]
pub(super) struct Window {
    options: FillOptions,
    held: VecDeque<Held>,
    pushed: usize,
    popped: usize,
}

impl Window {
    pub(super) fn new(options: FillOptions) -> Self {
        Self { options, held: VecDeque::new(), pushed: 0, popped: 0 }
    }

    pub(super) fn push(&mut self, frame: Arc<Frame>) {
        self.held.push_back(Held { number: self.pushed, quarter: Quarter::of(&frame), frame });
        self.pushed += 1;
        self.evict();
    }

    /// Number of the frame popped last.
    pub(super) fn now(&self) -> usize {
        self.popped.saturating_sub(1)
    }

    pub(super) fn pop(&mut self, ended: bool) -> Option<(usize, Arc<Frame>)> {
        let next = self.popped;
        if next >= self.pushed || !(ended || self.pushed > next + self.ahead()) {
            return None;
        }
        self.popped += 1;
        self.evict();
        self.held.iter().find(|held| held.number == next).map(|held| (next, Arc::clone(&held.frame)))
    }

    /// Frames held other than `now` that fit, in order of time.
    pub(super) fn neighbors(&self, now: usize, fits: impl Fn(&Frame) -> bool) -> impl Iterator<Item = &Held> {
        let near = move |n: usize| n != now && n.abs_diff(now) <= self.options.reach_frames;
        self.held.iter().filter(move |held| near(held.number) && fits(&held.frame))
    }

    /// Frames that fit into the budget.
    fn capacity(&self) -> usize {
        let bytes = self.held.back().map_or(1, |held| bytes(&held.frame));
        (self.options.memory_bytes / bytes.max(1)).max(3)
    }

    /// Frames held after the one to render next.
    fn ahead(&self) -> usize {
        self.options.reach_frames.min((self.capacity() - 1) / 2)
    }

    /// Lets go of frames out of reach, then of the most crowded ones.
    fn evict(&mut self) {
        let now = self.now();
        while self.held.front().is_some_and(|held| held.number + self.options.reach_frames < now) {
            self.held.pop_front();
        }
        while self.held.len() > self.capacity() {
            let Some(k) = self.most_crowded(now) else { break };
            self.held.remove(k);
        }
    }

    /// The earlier frame whose gap is the smallest relative to its distance from `now`.
    fn most_crowded(&self, now: usize) -> Option<usize> {
        let at = |k: usize| self.held[k].number;
        let earlier = self.held.iter().take_while(|held| held.number < now).count();
        let crowding = |k: usize| {
            let before = if k == 0 { now.saturating_sub(self.options.reach_frames) } else { at(k - 1) };
            (at(k + 1) - before) as f64 / (now - at(k)) as f64
        };
        (0..earlier).min_by(|&a, &b| crowding(a).total_cmp(&crowding(b)))
    }
}

/// Memory of a frame's samples, and of its luma at a quarter of the size.
fn bytes(frame: &Frame) -> usize {
    let samples = |i: usize| {
        let (w, h) = frame.format.plane_size(i, frame.width, frame.height);
        w * h
    };
    (0..frame.format.planes()).map(samples).sum::<usize>() * frame.format.bytes_per_sample() + Quarter::bytes(frame)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Layout, PixelFormat};

    /// Runs `frames` frames of 1024 bytes (32 × 26, and 8 × 6 numbers of 4) through a window; what it held when each was popped.
    fn run(options: FillOptions, frames: usize) -> Vec<(usize, Vec<usize>)> {
        let mut window = Window::new(options);
        let mut seen = Vec::new();
        for n in 0..=frames {
            if n < frames {
                window.push(Arc::new(Frame::new(PixelFormat::opaque(Layout::Gray, 8), 32, 26)));
            }
            while let Some((index, _)) = window.pop(n == frames) {
                seen.push((index, window.held.iter().map(|held| held.number).collect()));
            }
        }
        seen
    }

    #[test]
    fn every_frame_is_popped_once_and_in_order() {
        for (frames, memory_bytes) in [(1, 0), (2, 1 << 20), (50, 8 << 10), (50, 1 << 20)] {
            let seen = run(FillOptions { memory_bytes, reach_frames: 20 }, frames);
            assert!(seen.iter().map(|(n, _)| *n).eq(0..frames), "{frames} frames in {memory_bytes} bytes");
            assert!(seen.iter().all(|(n, held)| held.contains(n)));
        }
    }

    #[test]
    fn memory_stays_within_its_budget() {
        for (_, held) in run(FillOptions { memory_bytes: 12 << 10, reach_frames: 100 }, 300) {
            assert!(held.len() <= 12, "{held:?}");
        }
    }

    #[test]
    fn a_window_that_fits_holds_all_within_reach() {
        let seen = run(FillOptions { memory_bytes: 1 << 20, reach_frames: 9 }, 60);
        assert!(seen[30].1.iter().copied().eq(21..=39 + usize::from(seen[30].1.len() > 19)), "{:?}", seen[30]);
    }

    #[test]
    fn beyond_the_budget_frames_thin_out_with_distance() {
        let (now, held) = run(FillOptions { memory_bytes: 20 << 10, reach_frames: 60 }, 200).swap_remove(150);
        let earlier: Vec<usize> = held.into_iter().filter(|n| *n < now).collect();
        let gaps: Vec<usize> = earlier.windows(2).map(|w| w[1] - w[0]).collect();
        assert!(now - earlier[0] > 25, "reaches far: {earlier:?}");
        assert_eq!(now - earlier[earlier.len() - 1], 1, "near frames stay: {earlier:?}");
        assert!(gaps[0] > 2 * gaps[gaps.len() - 1], "and far ones are sparse: {gaps:?}");
    }
}
