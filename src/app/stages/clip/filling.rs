//! `border = "fill"`: frames wait until their neighbors are there to fill what the shake pushed out of view.

use std::collections::VecDeque;
use std::sync::Arc;

use super::sampling::Sampled;
use crate::pipeline::run_error::RunError;
use crate::pipeline::summary::FillSummary;
use crate::stages::RenderSettings;
use plumbline_image::Frame;
use plumbline_image::render::{FillOptions, FillReport, Filler, Renderer};
use plumbline_image::warp::{Lattice, Map, WarpField};
use plumbline_media::FramePool;
use plumbline_num::math::Homography;
use plumbline_num::run::Run;
use plumbline_video::motion::ClipMotion;

/// The window of neighbors and the lattices of the frames that wait in it.
pub(crate) struct Filling<'v> {
    filler: Filler,
    waiting: VecDeque<Lattice>,
    motion: &'v ClipMotion,
    frames: usize,
    summary: FillSummary,
}

impl<'v> Filling<'v> {
    /// An empty window; neighbors are found by `motion`.
    pub(crate) fn new(settings: &RenderSettings, motion: &'v ClipMotion) -> Self {
        let options = FillOptions {
            memory_bytes: settings.fill_memory.0.try_into().unwrap_or(usize::MAX),
            reach_frames: RenderSettings::FILL_WINDOW as usize / 2,
        };
        Self {
            filler: Filler::new(options),
            waiting: VecDeque::new(),
            motion,
            frames: 0,
            summary: FillSummary::default(),
        }
    }

    /// Takes the next frame of the source.
    pub(crate) fn push(&mut self, frame: Frame, lattice: Lattice) {
        self.filler.push(Arc::new(frame));
        self.waiting.push_back(lattice);
    }

    /// Renders and fills the next frame whose neighbors are all there; `ended`: none will come any more.
    pub(crate) fn pop(
        &mut self,
        ended: bool,
        renderer: &Renderer,
        pool: &FramePool,
    ) -> Result<Option<Sampled>, RunError> {
        let Some((index, frame)) = self.filler.pop(ended) else { return Ok(None) };
        let lost = || RunError::Internal(format!("frame {index} has no map"));
        let lattice = self.waiting.pop_front().ok_or_else(lost)?;
        let internal = |e: plumbline_image::render::RenderError| RunError::Internal(e.to_string());
        let mut result = pool.get()?;
        renderer.render(&frame, &lattice, &mut result).map_err(internal)?;
        let neighbor = |n| neighbor_from_this(self.motion, index, n);
        let report = self.filler.fill(renderer, &lattice, &mut result, neighbor, &Run::default()).map_err(internal)?;
        self.note(&report);
        Ok(Some(Sampled::new(frame, result)))
    }

    fn note(&mut self, report: &FillReport) {
        let FillReport { uncovered, left, .. } = *report;
        self.frames += 1;
        self.summary.mean += (uncovered - self.summary.mean) / self.frames as f64;
        self.summary.mirrored_mean += (left - self.summary.mirrored_mean) / self.frames as f64;
        self.summary.most = most(self.summary.most, (uncovered, self.frames - 1));
        self.summary.mirrored_most = most(self.summary.mirrored_most, (left, self.frames - 1));
    }

    /// What was filled so far.
    pub(crate) fn summary(&self) -> FillSummary {
        self.summary
    }
}

/// The greater of both, the earlier one where they are equal.
fn most(before: (f64, usize), now: (f64, usize)) -> (f64, usize) {
    if now.0 > before.0 { now } else { before }
}

/// Where the content of frame `this` is in frame `neighbor`: the motions between them, chained; `None` across a cut.
fn neighbor_from_this(motion: &ClipMotion, this: usize, neighbor: usize) -> Option<WarpField> {
    if motion.shot_of(this)? != motion.shot_of(neighbor)? {
        return None;
    }
    let (first, last) = (this.min(neighbor), this.max(neighbor));
    let last_from_first =
        motion.frames.get(first + 1..=last)?.iter().fold(Homography::identity(), |chain, step| step.homography * chain);
    let map = if neighbor < this { last_from_first.inverse()? } else { last_from_first };
    Some(WarpField::identity().then(Map::Homography(map)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_num::math::{Point2, PointMap, Similarity2, Vec2};
    use plumbline_num::time::{Timebase, Timestamp};
    use plumbline_video::motion::{FrameMotion, MotionQuality};

    /// Ten frames that each move by (3, −2); a cut before frame 6.
    fn clip() -> ClipMotion {
        let step = Similarity2 { t: Vec2::new(3.0, -2.0), ..Similarity2::IDENTITY };
        let frame = |k: i64| match k {
            0 | 6 => FrameMotion::still(Timestamp(k), MotionQuality::ShotStart),
            _ => FrameMotion {
                similarity: step,
                homography: step.to_homography(),
                ..FrameMotion::still(Timestamp(k), MotionQuality::Measured)
            },
        };
        ClipMotion::new(640, 360, Timebase { num: 1, den: 30 }, (0..10).map(frame).collect())
    }

    #[test]
    fn a_neighbor_is_found_by_the_motions_between() {
        let at = |this, neighbor| {
            let field = neighbor_from_this(&clip(), this, neighbor)?;
            field.map(Point2::new(100.0, 100.0))
        };
        assert_eq!(at(1, 4), Some(Point2::new(109.0, 94.0)));
        assert_eq!(at(4, 1), Some(Point2::new(91.0, 106.0)));
        assert_eq!(at(3, 3), Some(Point2::new(100.0, 100.0)));
    }

    #[test]
    fn nothing_is_taken_from_another_shot_or_from_beyond_the_clip() {
        assert!(neighbor_from_this(&clip(), 5, 6).is_none());
        assert!(neighbor_from_this(&clip(), 7, 2).is_none());
        assert!(neighbor_from_this(&clip(), 7, 10).is_none());
    }
}
