//! The optimal path: shake, acceleration and crop balanced in one quadratic program.
//!
//! The unknowns are two virtual cameras, each a pose `B_t = (z_t, d_t)` per frame, linear in the similarity's parameters: the
//! path `P` that is shown, and an ideal path `L` without the constraint of the frame. With the motion seen through a path,
//!
//! ```text
//! r_t(B) = F_t B_{t−1} − B_t,          a_t(B) = r_t(B) − r_{t−1}(B)   (second difference),
//!
//! min  Σ_t 1/E_t · ( |P_t − L_t|² + λ |a_t(L)|² + μ |a_t(P)|² )  −  κ Σ_t Re P.z_t
//! s.t. the four corners of the window P_t inside frame t (and what its neighbors show beside it),   Re P.z_t ≥ min_crop,   |Δ Re P.z_t| ≤ v_t,  the fastest zoom that is not seen.
//! ```
//!
//! `|·|²` is the mean over the frame's area of the squared displacement, so that rotation and zoom count for what they
//! move. The first two terms together are an *infimal convolution*: at frequency ω they cost `λω⁴ / (1 + λω⁴)` of the
//! path's power. That is the power of the shake above the time constant `(4λ)^¼` and no more. A plain penalty on
//! differences, L1 or L2, grows with ω⁴ without bound, so it spends its crop on the rare fast moves (quick pans, running
//! strides) that no window can contain anyway, and follows the frame's edge in between; here a fast move costs its
//! amplitude once, `P` follows it in an S-curve whose curvature `μ` sets, and the crop serves the shake around it.
//! `E_t` is the local strength of the input's shake: crop is weighed against the *fraction* of shake removed, the same for a
//! standing and for a running camera.
//!
//! The input itself (`P = 1`, crop 1) is feasible, hence the optimum is never shakier than the input in these terms.
//!
//! Departure from Grundmann et al.: sums of squares and the second camera in place of L1 norms of three differences (no
//! first differences: a steady pan costs nothing), the window's size as an unknown with a price in place of a fixed crop.

use std::ops::Range;

use super::chain::Chain;
use super::pose::{C64, FrameUnits, Pose, Room};
use plumbline_num::optim::qp::{Affine, QpError, QuadraticProgram};
use plumbline_num::run::Run;

/// Weight of scale and rotation against displacement: the squared radius of gyration of the frame in frame units.
const ROTATION_WEIGHT: f64 = 1.0 / 3.0;

/// Time constant of the acceleration term relative to the smoothness. 0.25 leaves visible jerks; 1 lets the path overshoot into
/// the frame's edge after every fast move. From 0.5 to 0.4 the mean crop of 17 hand-held clips rises from
/// .878 to .894, with .287 and .292 of their shake left.
const ACCELERATION_TIME_RATIO: f64 = 0.4;

/// Price κ of crop against the fraction of shake left. Mean (crop, shake left) over 17 hand-held clips: (.85, .22) at 1, (.88, .25)
/// at 2, (.89, .29) at 3.3, (.91, .35) at 5, (.93, .42) at 8. At 3.3 the last percent of crop removes two and a half of shake.
const CROP_PRICE: f64 = 3.3;

/// Fastest change of the window's width, fraction of the frame's width per second, where nothing else moves: far slower than a
/// manual zoom.
const ZOOM_SPEED: f64 = 0.01;

/// What is added to it for a picture that moves, as a fraction of its speed in half-diagonals per second: beside a movement ten
/// times as fast no zoom is seen either (Weber's law). Without it the clips keep .003 less at .005 more shake; a constant speed of
/// 0.03 gains as much again, and is seen where the camera stands.
const ZOOM_TO_MOTION: f64 = 0.1;

/// Floor of the shake (frame units, RMS; 0.2 px at 1080p): keeps the weights finite on static passages.
const MIN_SHAKE: f64 = 2e-4;

/// Constraint on the size of the window within one program.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Sizing<'a> {
    /// Bounded rate of change: per frame, fraction of the frame's width per second ([`zoom_speeds`]).
    Adaptive(&'a [f64]),
    /// One unknown size.
    Shared,
    /// Given size.
    Pinned(f64),
    /// At least the ideal path's own. A larger one is never better, since it leaves less margin; an equality would leave the
    /// feasible set without an interior, and the solver stalls.
    Followed,
}

/// Data of the program, common to all windows of time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Program<'a> {
    pub(super) chain: &'a Chain,
    pub(super) units: &'a FrameUnits,
    /// What the window must stay in, per frame.
    pub(super) rooms: &'a [Room],
    /// Local strength of the shake per frame, frame units².
    pub(super) strength: &'a [f64],
    /// The ideal path where it is not an unknown.
    pub(super) ideal: Option<&'a [Pose]>,
    /// A smooth path near the ideal one; the unknowns are offsets from it. Relative to the input itself the objective would be
    /// a difference of numbers a thousand times as large, and the solver would stall on rounding.
    pub(super) about: &'a [Pose],
    pub(super) smoothness_s: f64,
    pub(super) min_crop: f64,
    pub(super) sizing: Sizing<'a>,
    /// Size of the rectangle that the frame must cover, relative to the output; below 1 only if the border may show.
    pub(super) window: f64,
}

/// Both cameras over a range of frames.
#[derive(Clone, Debug, Default)]
pub(super) struct Cameras {
    pub(super) path: Vec<Pose>,
    pub(super) ideal: Vec<Pose>,
}

/// A complex affine expression.
#[derive(Clone)]
struct Complex {
    re: Affine,
    im: Affine,
}

impl Complex {
    fn var(index: usize) -> Self {
        Self { re: Affine::var(index), im: Affine::var(index + 1) }
    }

    fn constant(c: C64) -> Self {
        Self { re: Affine::constant(c.re), im: Affine::constant(c.im) }
    }

    fn times(self, c: C64) -> Self {
        let (re, im) = (self.re.clone(), self.im.clone());
        Self { re: c.re * self.re - c.im * self.im, im: c.im * re + c.re * im }
    }

    fn plus(self, o: Self) -> Self {
        Self { re: self.re + o.re, im: self.im + o.im }
    }

    fn minus(self, o: Self) -> Self {
        Self { re: self.re - o.re, im: self.im - o.im }
    }
}

/// A pose as expressions.
#[derive(Clone)]
struct PoseExpr {
    z: Complex,
    d: Complex,
}

impl PoseExpr {
    /// Four unknowns from `index` on: `d`, `z`.
    fn vars(index: usize) -> Self {
        Self { d: Complex::var(index), z: Complex::var(index + 2) }
    }

    fn constant(p: Pose) -> Self {
        Self { z: Complex::constant(p.z), d: Complex::constant(p.d) }
    }

    fn plus(self, o: Pose) -> Self {
        Self { z: self.z.plus(Complex::constant(o.z)), d: self.d.plus(Complex::constant(o.d)) }
    }

    fn minus(self, o: Self) -> Self {
        Self { z: self.z.minus(o.z), d: self.d.minus(o.d) }
    }

    fn scaled(self, s: f64) -> Self {
        let c = C64::new(s, 0.0);
        Self { z: self.z.times(c), d: self.d.times(c) }
    }

    /// `step ∘ self`.
    fn moved_by(self, step: Pose) -> Self {
        Self { z: self.z.times(step.z), d: self.d.times(step.z).plus(Complex::constant(step.d)) }
    }
}

impl Program<'_> {
    /// Solves for `frames` of the shot. The cameras in `head` are those of the range's first frames, already decided.
    pub(super) fn solve(&self, frames: Range<usize>, head: &Cameras, run: &Run) -> Result<Cameras, QpError> {
        let n = frames.len();
        let mut qp = QuadraticProgram::new(n * self.stride());
        let strength = |i: usize| self.strength[frames.start + i].max(MIN_SHAKE * MIN_SHAKE);
        // Weights and price are scaled to about 1, which suits the tolerances of the solver.
        let unit = (0..n).map(strength).sum::<f64>() / n as f64;
        for i in 0..n {
            let weight = unit / strength(i);
            self.add_shake(&mut qp, &frames, i, weight);
            if i >= 2 {
                self.add_acceleration(&mut qp, &frames, i, weight);
            }
            if i >= head.path.len() {
                self.keep_inside(&mut qp, &frames, i);
                self.size_window(&mut qp, &frames, i, unit);
            } else {
                self.fix_head(&mut qp, &frames, i, head);
            }
        }
        let x = qp.solve(run)?;
        let about = &self.about[frames.clone()];
        let pose =
            |k: usize, o: &Pose| Pose { d: o.d + C64::new(x[k], x[k + 1]), z: o.z + C64::new(x[k + 2], x[k + 3]) };
        let path = about.iter().enumerate().map(|(i, o)| pose(i * self.stride(), o)).collect();
        let ideal = match self.ideal {
            Some(given) => given[frames].to_vec(),
            None => about.iter().enumerate().map(|(i, o)| pose(i * self.stride() + 4, o)).collect(),
        };
        Ok(Cameras { path, ideal })
    }

    /// Unknowns per frame.
    fn stride(&self) -> usize {
        if self.ideal.is_some() { 4 } else { 8 }
    }

    fn path(&self, frames: &Range<usize>, i: usize) -> PoseExpr {
        PoseExpr::vars(i * self.stride()).plus(self.about[frames.start + i])
    }

    fn ideal(&self, frames: &Range<usize>, i: usize) -> PoseExpr {
        match self.ideal {
            Some(given) => PoseExpr::constant(given[frames.start + i]),
            None => PoseExpr::vars(i * self.stride() + 4).plus(self.about[frames.start + i]),
        }
    }

    /// Linear crop of the path: its scale along the window's expected direction.
    fn crop(&self, frames: &Range<usize>, i: usize) -> Affine {
        let along = self.ideal.map_or(C64::new(1.0, 0.0), |given| given[frames.start + i].z);
        self.path(frames, i).z.times(along.conj() / along.norm()).re
    }

    /// `|P − L|²`.
    fn add_shake(&self, qp: &mut QuadraticProgram, frames: &Range<usize>, i: usize, weight: f64) {
        add_displacement(qp, weight, self.path(frames, i).minus(self.ideal(frames, i)));
    }

    /// `λ |a(L)|² + μ |a(P)|²`.
    fn add_acceleration(&self, qp: &mut QuadraticProgram, frames: &Range<usize>, i: usize, weight: f64) {
        let t = frames.start + i;
        let velocity = |at: PoseExpr, before: PoseExpr, t: usize| {
            before.moved_by(self.chain.step[t]).minus(at).scaled(self.chain.rate[t])
        };
        let acceleration = |[b2, b1, b0]: [PoseExpr; 3]| velocity(b0, b1.clone(), t).minus(velocity(b1, b2, t - 1));
        // No motion is slower than the shot is long; larger weights would only cost the solver precision.
        let time = self.chain.frames(self.smoothness_s).min(self.chain.len() as f64);
        let mu = weight * (ACCELERATION_TIME_RATIO * time).powi(4) / 4.0;
        add_displacement(qp, mu, acceleration([i - 2, i - 1, i].map(|k| self.path(frames, k))));
        if self.ideal.is_none() {
            let lambda = weight * time.powi(4) / 4.0;
            add_displacement(qp, lambda, acceleration([i - 2, i - 1, i].map(|k| self.ideal(frames, k))));
        }
    }

    /// The window's corners inside the room.
    fn keep_inside(&self, qp: &mut QuadraticProgram, frames: &Range<usize>, i: usize) {
        let Room { least, most } = self.rooms[frames.start + i];
        for q in self.units.corners() {
            let PoseExpr { z, d } = self.path(frames, i);
            let corner = z.times(q * self.window).plus(d);
            for (x, least, most) in [(corner.re, least.re, most.re), (corner.im, least.im, most.im)] {
                qp.require_at_most_zero(x.clone() - Affine::constant(most));
                qp.require_at_most_zero(Affine::constant(least) - x);
            }
        }
    }

    /// Price, bounds and slowness of the window's size.
    fn size_window(&self, qp: &mut QuadraticProgram, frames: &Range<usize>, i: usize, unit: f64) {
        let crop = |k: usize| self.crop(frames, k);
        match (self.sizing, self.ideal) {
            (Sizing::Pinned(size), _) => return qp.require_zero(crop(i) - Affine::constant(size)),
            (Sizing::Followed, Some(given)) => {
                return qp.require_at_most_zero(Affine::constant(given[frames.start + i].z.norm()) - crop(i));
            }
            _ => {}
        }
        qp.add_linear(&(-CROP_PRICE * unit * crop(i)));
        qp.require_at_most_zero(Affine::constant(self.min_crop) - crop(i));
        if i == 0 {
            return;
        }
        let Sizing::Adaptive(speeds) = self.sizing else {
            return qp.require_zero(crop(i) - crop(i - 1));
        };
        let t = frames.start + i;
        let limit = Affine::constant(speeds[t] / (self.chain.fps * self.chain.rate[t]));
        qp.require_at_most_zero(crop(i) - crop(i - 1) - limit.clone());
        qp.require_at_most_zero(crop(i - 1) - crop(i) - limit);
    }

    /// Fixes the frames solved in the previous window of time.
    fn fix_head(&self, qp: &mut QuadraticProgram, frames: &Range<usize>, i: usize, head: &Cameras) {
        let fix = |qp: &mut QuadraticProgram, e: PoseExpr| {
            for x in [e.d.re, e.d.im, e.z.re, e.z.im] {
                qp.require_zero(x);
            }
        };
        fix(qp, self.path(frames, i).minus(PoseExpr::constant(head.path[i])));
        if self.ideal.is_none() {
            fix(qp, self.ideal(frames, i).minus(PoseExpr::constant(head.ideal[i])));
        }
    }
}

/// The fastest zooms that are not seen, for [`Sizing::Adaptive`], where the viewer sees the motion `shown`.
pub(super) fn zoom_speeds(shown: &Chain) -> Vec<f64> {
    // No frame is zoomed by its whole width in a second; a cut that was not recognized moves by any number.
    shown.speed().iter().map(|speed| (ZOOM_SPEED + ZOOM_TO_MOTION * speed).min(1.0)).collect()
}

/// Adds the mean over the frame's area of the squared displacement `e`.
fn add_displacement(qp: &mut QuadraticProgram, weight: f64, e: PoseExpr) {
    qp.add_square(weight, e.d.re);
    qp.add_square(weight, e.d.im);
    qp.add_square(weight * ROTATION_WEIGHT, e.z.re);
    qp.add_square(weight * ROTATION_WEIGHT, e.z.im);
}
