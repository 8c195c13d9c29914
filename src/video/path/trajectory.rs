//! Smoothed feature trajectories: the anchors of the content-preserving warp.
//!
//! The virtual camera `S_t` (`out_from_src`) takes the global shake out of a clip. What is left in the trajectory
//! `s_k(t) = S_t(p_k(t))` of point `k` is the motion that no single homography explains: parallax, rolling shutter,
//! lens distortion. It should be smooth too, so the target of the point is its own local linear regression,
//!
//! ```text
//! q_k(t) = α,   (α, β) = argmin Σ_τ g((τ−t)/σ) ‖s_k(τ) − α − β (τ−t)‖²,   g(u) = e^{−u²/2},  |τ−t| ≤ w,
//! ```
//!
//! which reproduces constant velocity exactly, at the ends of a track too. Tracks begin and end in the middle of a clip: the
//! weight is the product of two linear ramps over the first and last `ramp` seconds, so that no anchor appears suddenly.
//!
//! Streaming: frames are pushed in order and come out `w` later; memory is bounded by the window.
//!
//! # Reference
//! F. Liu, M. Gleicher, H. Jin, A. Agarwala: *Content-preserving warps for 3D video stabilization*, SIGGRAPH 2009,
//! section 4 (fading of constraints); F. Liu et al., *Subspace video stabilization*, TOG 2011 (smoothing trajectories
//! without cameras). Local linear regression: W. S. Cleveland, JASA 1979.

use std::collections::{HashMap, VecDeque};

use super::local_linear::local_linear_weights;
use super::subspace::Subspace;
use plumbline_num::math::{Homography, Point2, Vec2};

/// Options of trajectory smoothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrajectoryOptions {
    /// Standard deviation σ of the regression's kernel, s. Too small keeps the wobble; too large makes points lag behind
    /// real accelerations of the scene, for which the mesh then bends.
    pub sigma_s: f64,
    /// Length of the fade at both ends of a track, s. Too short and the mesh jumps when points come and go, too long
    /// and short tracks never count.
    pub ramp_s: f64,
    /// Also smooth the common subspace of the trajectories.
    pub subspace: bool,
}

impl Default for TrajectoryOptions {
    fn default() -> Self {
        Self { sigma_s: 0.25, ramp_s: 0.5, subspace: false }
    }
}

impl TrajectoryOptions {
    /// Half width `w` of the window, s: beyond 2.5 σ the kernel has lost 96 % of its weight.
    pub(crate) fn half_window_s(&self) -> f64 {
        (2.5 * self.sigma_s).max(self.ramp_s)
    }
}

/// A tracked point in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackedPoint {
    /// Track id.
    pub id: u32,
    /// Measured position, source px.
    pub src: Point2,
    /// Position at the frame's own time, source px: differs from `src` where a rolling shutter captured it earlier or later.
    pub at_frame_time: Point2,
    /// Projection into the virtual camera, output px, where the point's 3D position is known.
    pub in_space: Option<Point2>,
}

/// A point of the source frame and its target in the output frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchor {
    /// Tracked position, source px.
    pub src: Point2,
    /// Smoothed position, output px.
    pub dst: Point2,
    /// Temporal fade in [0, 1], dimensionless.
    pub weight: f64,
    /// Projection into the virtual camera, output px, where the point's 3D position is known.
    pub in_space: Option<Point2>,
    /// Position smoothed in the common subspace of the trajectories (`subspace.rs`), output px, where it was requested and
    /// could be estimated.
    pub in_subspace: Option<Point2>,
}

/// One sample of a track.
#[derive(Clone, Copy, Debug)]
struct Sample {
    time_s: f64,
    src: Point2,
    out: Point2,
    in_space: Option<Point2>,
}

/// Anchors of successive frames, each a window after its frame was pushed.
pub struct TrajectorySmoother {
    options: TrajectoryOptions,
    /// Samples of every track that the window still needs, oldest first. Frames name their points by id, so results do not
    /// depend on the order of this map.
    tracks: HashMap<u32, VecDeque<Sample>>,
    waiting: VecDeque<PendingFrame>,
    /// Times of finished frames that the window still reaches.
    past: VecDeque<f64>,
    ready: VecDeque<Vec<Anchor>>,
    newest_s: f64,
}

struct PendingFrame {
    time_s: f64,
    ids: Vec<u32>,
}

/// Modes of a window, and the times of its frames.
struct Modes {
    times: Vec<f64>,
    subspace: Subspace,
}

impl Modes {
    fn smoothed(&self, samples: &VecDeque<Sample>) -> Option<Point2> {
        let at = |s: &Sample| {
            let frame = self.times.binary_search_by(|t| t.total_cmp(&s.time_s)).ok()?;
            Some((frame, [s.out.x, s.out.y]))
        };
        self.subspace.smoothed(&samples.iter().filter_map(at).collect::<Vec<_>>()).map(Point2::from)
    }
}

impl TrajectorySmoother {
    /// An empty smoother.
    pub fn new(options: TrajectoryOptions) -> Self {
        Self {
            options,
            tracks: HashMap::new(),
            waiting: VecDeque::new(),
            past: VecDeque::new(),
            ready: VecDeque::new(),
            newest_s: f64::NEG_INFINITY,
        }
    }

    /// Adds the next frame: its time, its virtual camera, and its points. Times must not decrease. Points that `out_from_src`
    /// maps beyond its horizon are left out.
    pub fn push(&mut self, time_s: f64, out_from_src: &Homography, points: impl IntoIterator<Item = TrackedPoint>) {
        let mut ids = Vec::new();
        for point in points {
            if let Some(out) = out_from_src.apply(point.at_frame_time) {
                self.tracks.entry(point.id).or_default().push_back(Sample {
                    time_s,
                    src: point.src,
                    out,
                    in_space: point.in_space,
                });
                ids.push(point.id);
            }
        }
        self.waiting.push_back(PendingFrame { time_s, ids });
        self.newest_s = self.newest_s.max(time_s);
        self.settle(self.newest_s - self.options.half_window_s());
    }

    /// Declares that the next frame belongs to another shot: everything pushed so far is settled, tracks end here.
    pub fn cut(&mut self) {
        self.settle(f64::INFINITY);
        self.tracks.clear();
        self.past.clear();
        self.newest_s = f64::NEG_INFINITY;
    }

    /// Anchors of the oldest frame not yet taken, in the order of its points; `None` until its window is complete
    /// (or [`Self::cut`] was called, which also ends the clip).
    pub fn pop(&mut self) -> Option<Vec<Anchor>> {
        self.ready.pop_front()
    }

    /// Finishes the waiting frames that are not younger than `until_s`.
    fn settle(&mut self, until_s: f64) {
        while self.waiting.front().is_some_and(|f| f.time_s <= until_s) {
            let frame = self.waiting.pop_front().expect("the front was just seen");
            let modes = if self.options.subspace { self.modes(&frame) } else { None };
            let anchors = frame.ids.iter().filter_map(|id| self.anchor(*id, frame.time_s, modes.as_ref())).collect();
            self.ready.push_back(anchors);
            self.past.push_back(frame.time_s);
            self.forget(frame.time_s - self.options.half_window_s());
        }
    }

    /// Drops samples that no waiting frame can reach.
    fn forget(&mut self, before_s: f64) {
        while self.past.front().is_some_and(|time| *time < before_s) {
            self.past.pop_front();
        }
        self.tracks.retain(|_, samples| {
            while samples.front().is_some_and(|s| s.time_s < before_s) {
                samples.pop_front();
            }
            !samples.is_empty()
        });
    }

    /// The modes of the trajectories around a frame.
    fn modes(&self, frame: &PendingFrame) -> Option<Modes> {
        let reach = self.options.half_window_s();
        let near = |time: &f64| (time - frame.time_s).abs() <= reach;
        let later = self.waiting.iter().map(|f| f.time_s);
        let times: Vec<f64> = self.past.iter().copied().chain([frame.time_s]).chain(later).filter(near).collect();
        let spanning: Vec<[Vec<f64>; 2]> = (frame.ids.iter())
            .filter_map(|id| {
                let samples = self.tracks.get(id)?;
                let own: Vec<&Sample> = samples.iter().filter(|s| near(&s.time_s)).collect();
                let whole = own.len() == times.len();
                whole.then(|| [own.iter().map(|s| s.out.x).collect(), own.iter().map(|s| s.out.y).collect()])
            })
            .collect();
        let subspace = Subspace::of(&spanning, &self.kernel(&times, frame.time_s))?;
        Some(Modes { times, subspace })
    }

    /// Weights of samples at `times` in the value at `time_s` of the local linear regression through them.
    fn kernel(&self, times: &[f64], time_s: f64) -> Vec<f64> {
        local_linear_weights(&times.iter().map(|t| (t - time_s) / self.options.sigma_s).collect::<Vec<_>>())
    }

    fn anchor(&self, id: u32, time_s: f64, modes: Option<&Modes>) -> Option<Anchor> {
        let samples = self.tracks.get(&id)?;
        let here = samples.iter().find(|s| s.time_s == time_s)?;
        let (first, last) = (samples.front()?.time_s, samples.back()?.time_s);
        let weight = self.fade(time_s - first) * self.fade(last - time_s);
        let (src, in_space) = (here.src, here.in_space);
        let in_subspace = || modes.and_then(|m| m.smoothed(samples));
        let dst = || self.regress(samples, time_s);
        (weight > 0.0).then(|| Anchor { src, dst: dst(), weight, in_space, in_subspace: in_subspace() })
    }

    /// Ramp from 0 at an end of the track to 1, `ramp` seconds inside it.
    fn fade(&self, inside_s: f64) -> f64 {
        (inside_s / self.options.ramp_s).clamp(0.0, 1.0)
    }

    /// Value at `time_s` of the local linear regression through `samples`.
    fn regress(&self, samples: &VecDeque<Sample>, time_s: f64) -> Point2 {
        let (mut s0, mut s1, mut s2) = (0.0, 0.0, 0.0);
        let (mut y0, mut y1) = (Vec2::zeros(), Vec2::zeros());
        for sample in samples {
            let u = (sample.time_s - time_s) / self.options.sigma_s;
            let g = (-0.5 * u * u).exp();
            s0 += g;
            s1 += g * u;
            s2 += g * u * u;
            y0 += g * sample.out.coords;
            y1 += g * u * sample.out.coords;
        }
        let det = s0 * s2 - s1 * s1;
        // Where the weight is not zero at least two samples differ in time; a single one is its own mean.
        let alpha = if det > 1e-12 * s0 * s0 { (s2 * y0 - s1 * y1) / det } else { y0 / s0 };
        Point2::from(alpha)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME_S: f64 = 1.0 / 30.0;

    fn point(id: u32, p: Point2) -> TrackedPoint {
        TrackedPoint { id, src: p, at_frame_time: p, in_space: None }
    }

    /// Pushes `n` frames in which point 7 is at `at(t)` and returns its anchors (`None` where it has none).
    fn follow(n: usize, at: impl Fn(usize) -> Option<Point2>) -> Vec<Option<Anchor>> {
        let mut smoother = TrajectorySmoother::new(TrajectoryOptions::default());
        for t in 0..n {
            smoother.push(t as f64 * FRAME_S, &Homography::identity(), at(t).map(|p| point(7, p)));
        }
        smoother.cut();
        std::iter::from_fn(|| smoother.pop()).map(|a| a.first().copied()).collect()
    }

    #[test]
    fn constant_velocity_is_left_alone_up_to_the_ends() {
        let line = |t: usize| Point2::new(100.0 + 3.0 * t as f64, 50.0 - 1.5 * t as f64);
        let anchors = follow(60, |t| Some(line(t)));
        assert_eq!(anchors.len(), 60);
        for (t, a) in anchors.iter().enumerate().filter_map(|(t, a)| a.map(|a| (t, a))) {
            assert!((a.dst - line(t)).norm() < 1e-9, "frame {t}: {}", a.dst);
            assert_eq!(a.src, line(t));
        }
    }

    #[test]
    fn frame_to_frame_jitter_is_removed() {
        let jitter = |t: usize| if t.is_multiple_of(2) { 1.0 } else { -1.0 };
        let anchors = follow(60, |t| Some(Point2::new(200.0 + jitter(t), 80.0)));
        let middle = &anchors[20..40];
        assert!(middle.iter().all(|a| (a.expect("long track").dst.x - 200.0).abs() < 0.01));
    }

    #[test]
    fn a_track_fades_in_and_out() {
        let anchors = follow(90, |t| (20..70).contains(&t).then(|| Point2::new(1.0, 2.0)));
        let weight = |t: usize| anchors[t].map_or(0.0, |a| a.weight);
        assert_eq!((weight(20), weight(69), weight(10)), (0.0, 0.0, 0.0));
        assert!((weight(45) - 1.0).abs() < 1e-9, "the middle of the track counts fully");
        for t in 20..69 {
            assert!((weight(t + 1) - weight(t)).abs() < 0.08, "no jump at {t}");
        }
    }

    #[test]
    fn frames_come_out_once_and_in_order_however_long_the_clip() {
        let mut smoother = TrajectorySmoother::new(TrajectoryOptions::default());
        let mut out = 0;
        for t in 0..3000_u32 {
            smoother.push(
                f64::from(t) * FRAME_S,
                &Homography::identity(),
                [point(t / 40, Point2::new(f64::from(t), 0.0))],
            );
            while smoother.pop().is_some() {
                out += 1;
            }
            assert!(smoother.tracks.len() < 4 && smoother.waiting.len() < 30, "memory is bounded by the window");
        }
        smoother.cut();
        out += std::iter::from_fn(|| smoother.pop()).count();
        assert_eq!(out, 3000);
    }
}
