//! Inter-frame motion of the background, frame by frame, in bounded memory.
//!
//! For each pair of frames: weigh the tracks ([`super::background`]), find the similarity of least energy by MSAC
//! ([`super::planar`]), extend it to a homography, refine by iteratively reweighted least squares with the Geman–McClure weight
//! `1/(1+(r/c)²)²`, `c` lowered to the background's own spread, and keep the homography only where the data support it.
//!
//! **Model selection.** With robust squared residuals `ρ = min(r²/σ², 4)` the geometric robust information criterion prefers
//! the family of least
//!
//! ```text
//! GRIC = Σ ρ + λ₁ d n + λ₂ k,     d = 2,  k = 4 or 8,  λ₂ = ln 4n.
//! ```
//!
//! `n` counts occupied cells, not points: the errors of neighbors are correlated. Homographies are further regularized toward
//! similarities by a Gaussian prior on shear, stretch and perspective, which matters only where few points determine them.
//!
//! # Reference
//! Torr, *An assessment of information criteria for motion model selection*, CVPR 1997 (GRIC).

use plumbline_num::math::{Homography, Similarity2, Vec2};
use plumbline_num::optim::ransac::{self, MsacOptions};
use plumbline_num::run::Run;

use super::background::{Background, weighted_median};
use super::frame_motion::{FrameMotion, MotionQuality, PlanarModel};
use super::planar::{ByHomography, BySimilarity, PlanarData, RecentPath};
use super::planar_fit::{self, FrameScale, Pair};
use crate::track::FrameTracks;

/// Frames of this many px across have the thresholds below in px; others in proportion.
const REFERENCE_WIDTH: f64 = 640.0;
/// Least number of pairs for a motion: two determine a similarity, eight check it.
const MIN_PAIRS: usize = 8;
/// Least fraction of the weight that must agree with a motion: below it more than two motions compete, and none can be identified
/// as the camera's.
const MIN_SUPPORT: f64 = 0.25;
/// Lower bound of the spread, px at the reference width: the noise of the tracker under the best conditions.
const MIN_SPREAD: f64 = 0.04;
/// Standard deviation of shear, stretch and perspective between frames, frame units: 0.005 is 2 px in the corners at 640×360, the
/// effect of a fast pan or a rolling shutter.
const PRIOR_DEVIATION: f64 = 0.005;
/// Greatest distance of a corner under the homography from the same under the similarity, fraction of the half diagonal: 16
/// standard deviations of the prior. A larger one is a wrong fit.
const MAX_FROM_SIMILARITY: f64 = 0.08;

/// Score from which a track counts as background: below that of a new track, which is 0.5 without neighbors.
const BACKGROUND_SCORE: f64 = 0.4;

/// Seed of the sampler.
const SEED: u64 = 0x9e37_79b9;
/// Greatest number of minimal samples of MSAC for a similarity; each costs about 0.5 µs per point.
const MAX_SAMPLES: usize = 160;

/// Estimates the motion of the background from frame to frame; see the module.
#[derive(Debug)]
pub struct MotionEstimator {
    scale: FrameScale,
    unit_px: f64,
    world: Background,
    path: RecentPath,
    rng: fastrand::Rng,
    /// Running spreads of the residuals from similarity and homography, px; they set the thresholds of the next frame.
    spreads: (f64, f64),
    started: bool,
    background: Vec<bool>,
    still_pairs: Vec<Pair>,
    matches: Matches,
}

/// The points observed in both frames, in the order of their ids.
#[derive(Debug, Default)]
struct Matches {
    pairs: Vec<Pair>,
    /// Score and cell of each pair.
    members: Vec<(f64, usize)>,
    /// Index into the old tracks.
    tracks: Vec<usize>,
    /// Weights of the background model, and the robust weights, which include the residual.
    prior_weights: Vec<f64>,
    weights: Vec<f64>,
}

/// A measured motion with its spreads.
struct Fit {
    similarity: Similarity2,
    homography: Homography,
    model: PlanarModel,
    spread_px: f64,
    similarity_spread_px: f64,
}

impl MotionEstimator {
    /// An estimator for frames of `width × height` px.
    pub fn new(width: u32, height: u32) -> Self {
        let unit_px = f64::from(width.max(height)).max(1.0) / REFERENCE_WIDTH;
        Self {
            scale: FrameScale::new(width, height),
            unit_px,
            world: Background::new(width, height),
            path: RecentPath::new(width, height, unit_px),
            rng: fastrand::Rng::with_seed(SEED),
            spreads: (unit_px, 0.3 * unit_px),
            started: false,
            background: Vec::new(),
            still_pairs: Vec::new(),
            matches: Matches::default(),
        }
    }

    /// Takes the next frame and returns the motion that leads to it from the previous one.
    pub fn push(&mut self, frame: &FrameTracks) -> FrameMotion {
        if frame.quality.starts_shot() || !self.started {
            self.started = true;
            return self.start_shot(frame);
        }
        self.match_points(frame);
        if frame.quality.duplicate {
            let points = self.matches.pairs.len() as u32;
            self.finish(frame, None);
            return FrameMotion { points, inliers: points, ..FrameMotion::still(frame.pts, MotionQuality::Duplicate) };
        }
        let fit = if frame.quality.black { None } else { self.measure() };
        let motion = self.report(frame, fit.as_ref());
        self.finish(frame, fit.as_ref());
        motion
    }

    /// For each point of the frame last pushed, in its order: whether it belongs to the background.
    pub fn background(&self) -> &[bool] {
        &self.background
    }

    /// The points of the frame last pushed that were also observed in the previous one and moved with the background.
    pub fn background_pairs(&self) -> &[Pair] {
        &self.still_pairs
    }

    fn start_shot(&mut self, frame: &FrameTracks) -> FrameMotion {
        self.world.clear();
        self.path.clear();
        self.matches.clear();
        self.finish(frame, None);
        FrameMotion::still(frame.pts, MotionQuality::ShotStart)
    }

    fn match_points(&mut self, frame: &FrameTracks) {
        let matches = &mut self.matches;
        matches.clear();
        let mut order: Vec<_> = frame.observations.iter().filter(|p| p.x.is_finite() && p.y.is_finite()).collect();
        order.sort_by_key(|p| p.id);
        order.dedup_by_key(|p| p.id);
        let mut fresh = order.into_iter().peekable();
        for (k, track) in self.world.tracks().iter().enumerate() {
            while fresh.next_if(|p| p.id < track.id).is_some() {}
            if let Some(p) = fresh.next_if(|p| p.id == track.id) {
                let this = nalgebra::Point2::new(f64::from(p.x), f64::from(p.y));
                matches.pairs.push(Pair { previous: track.position, this });
                matches.members.push((track.score, self.world.cell(track.position)));
                matches.tracks.push(k);
            }
        }
        Background::weights(&matches.members, &mut matches.prior_weights);
    }

    /// The motion of least energy, refined; `None` where no motion has enough support.
    fn measure(&mut self) -> Option<Fit> {
        if self.matches.pairs.len() < MIN_PAIRS {
            return None;
        }
        let data = PlanarData {
            pairs: &self.matches.pairs,
            cells: &self.matches.members,
            scale: self.scale,
            path: &self.path,
        };
        let unit = self.unit_px;
        let options = |threshold, max_samples| MsacOptions { threshold, min_samples: 24, max_samples, local_steps: 3 };
        let wide = options((4.0 * self.spreads.0).clamp(1.0 * unit, 6.0 * unit), MAX_SAMPLES);
        let coarse = ransac::msac(
            &BySimilarity(&data),
            &self.matches.prior_weights,
            &wide,
            None,
            &mut self.rng,
            &Run::default(),
        )
        .expect("a run that never stops")?;
        let initial = coarse.model.to_homography();
        let narrow = options((5.0 * self.spreads.1).clamp(0.8 * unit, 4.0 * unit), MAX_SAMPLES / 3);
        let family = ByHomography { data: &data, initial, kappa: self.kappa(self.spreads.1) };
        let fine =
            ransac::msac(&family, &self.matches.prior_weights, &narrow, Some(initial), &mut self.rng, &Run::default())
                .expect("a run that never stops")?;
        if !(coarse.support >= MIN_SUPPORT) {
            return None;
        }
        self.refine(fine.model, narrow.threshold)
    }

    /// Weight κ of the prior on a homography's deviation from a similarity, for weights that sum to 1.
    fn kappa(&self, spread_px: f64) -> f64 {
        let deviation = spread_px / self.scale.radius();
        deviation * deviation / (self.matches.occupied_cells().max(1) as f64 * PRIOR_DEVIATION * PRIOR_DEVIATION)
    }

    /// Reweighted least squares with decreasing scale, then model selection.
    fn refine(&mut self, initial: Homography, threshold: f64) -> Option<Fit> {
        let floor = MIN_SPREAD * self.unit_px;
        let mut homography = initial;
        let mut c = threshold;
        for _ in 0..4 {
            let spread = self.matches.reweigh(|p| homography.apply(p), c);
            let kappa = self.kappa(spread.max(floor));
            let (pairs, weights) = (&self.matches.pairs, &self.matches.weights);
            homography = planar_fit::homography(pairs, weights, &homography, kappa, &self.scale, 2)?;
            c = (6.0 * spread).max(3.0 * floor).min(c);
        }
        let spread = self.matches.reweigh(|p| homography.apply(p), c);
        let similarity = planar_fit::similarity(&self.matches.pairs, &self.matches.weights)?;
        self.choose(homography, similarity, spread.max(floor), c)
    }

    /// The homography where the points support it, else the similarity.
    fn choose(&mut self, homography: Homography, similarity: Similarity2, spread: f64, c: f64) -> Option<Fit> {
        let (pairs, weights) = (&self.matches.pairs, &self.matches.weights);
        let distance =
            |k: usize, q: Option<nalgebra::Point2<f64>>| q.map_or(f64::INFINITY, |q| (q - pairs[k].this).norm());
        // The median distance of a two-dimensional Gaussian error of deviation σ is 1.177 σ.
        let sigma = spread / 1.177;
        let (mut gain, mut total, mut similar) = (0.0, 0.0, Vec::with_capacity(pairs.len()));
        for (k, pair) in pairs.iter().enumerate() {
            let by_s = distance(k, Some(similarity.apply(pair.previous)));
            let by_h = distance(k, homography.apply(pair.previous));
            let rho = |r: f64| (r * r / (sigma * sigma)).min(4.0);
            gain += weights[k] * (rho(by_s) - rho(by_h));
            total += weights[k];
            similar.push((by_s, weights[k]));
        }
        let n = self.matches.occupied_cells() as f64;
        let supported = gain / total * n > 4.0 * (4.0 * n).ln() && self.stays_near(&homography, &similarity);
        let similarity_spread_px = weighted_median(&mut similar);
        if supported {
            let model = PlanarModel::Homography;
            return Some(Fit { similarity, homography, model, spread_px: spread, similarity_spread_px });
        }
        self.only_similarity(similarity, c.max(3.0 * similarity_spread_px))
    }

    fn only_similarity(&mut self, initial: Similarity2, c: f64) -> Option<Fit> {
        let mut similarity = initial;
        for _ in 0..3 {
            self.matches.reweigh(|p| Some(similarity.apply(p)), c);
            similarity = planar_fit::similarity(&self.matches.pairs, &self.matches.weights)?;
        }
        let spread = self.matches.reweigh(|p| Some(similarity.apply(p)), c).max(MIN_SPREAD * self.unit_px);
        let model = PlanarModel::Similarity;
        let homography = similarity.to_homography();
        Some(Fit { similarity, homography, model, spread_px: spread, similarity_spread_px: spread })
    }

    /// Whether the homography is near the similarity: a chain of homographies diverges by a single bad one.
    fn stays_near(&self, homography: &Homography, similarity: &Similarity2) -> bool {
        let (h, s) = (self.scale.normalized_map(homography), self.scale.normalized_map(&similarity.to_homography()));
        let corner = |m: &nalgebra::Matrix3<f64>, x: f64, y: f64| {
            let q = m * nalgebra::Vector3::new(x, y, 1.0);
            Vec2::new(q.x / q.z, q.y / q.z)
        };
        let ends = [(-0.8, -0.6), (0.8, -0.6), (-0.8, 0.6), (0.8, 0.6)];
        ends.iter().all(|&(x, y)| (corner(&h, x, y) - corner(&s, x, y)).norm() < MAX_FROM_SIMILARITY)
    }

    fn report(&self, frame: &FrameTracks, fit: Option<&Fit>) -> FrameMotion {
        let points = self.matches.pairs.len() as u32;
        let Some(fit) = fit else {
            return FrameMotion { points, ..FrameMotion::still(frame.pts, MotionQuality::Lost) };
        };
        let limit = self.inlier_limit(fit);
        let mut seen = vec![false; Background::cells()];
        let mut inliers = 0;
        for (k, r) in self.matches.residuals(&fit.homography) {
            if r.norm() < limit && self.matches.members[k].0 >= BACKGROUND_SCORE {
                inliers += 1;
                seen[self.matches.members[k].1] = true;
            }
        }
        FrameMotion {
            pts: frame.pts,
            similarity: fit.similarity,
            homography: fit.homography,
            model: fit.model,
            points,
            inliers,
            coverage: seen.iter().filter(|s| **s).count() as f64 / Background::cells() as f64,
            residual_px: fit.spread_px,
            similarity_residual_px: fit.similarity_spread_px,
            quality: MotionQuality::Measured,
        }
    }

    fn inlier_limit(&self, fit: &Fit) -> f64 {
        (4.0 * fit.spread_px).max(0.5 * self.unit_px)
    }

    /// Updates the running state and marks the background points of this frame.
    fn finish(&mut self, frame: &FrameTracks, fit: Option<&Fit>) {
        let mut residuals = vec![None; self.world.tracks().len()];
        if let Some(fit) = fit {
            for (k, r) in self.matches.residuals(&fit.homography) {
                residuals[self.matches.tracks[k]] = Some(r);
            }
            self.path.learn(&fit.similarity);
            let follow = |old: f64, new: f64| old + 0.2 * (new - old);
            self.spreads.0 = follow(self.spreads.0, fit.similarity_spread_px);
            self.spreads.1 = follow(self.spreads.1, fit.spread_px);
        }
        let spread = fit.map_or(self.spreads.1, |f| f.spread_px);
        let limit = fit.map_or(f64::INFINITY, |f| self.inlier_limit(f));
        let (world, matches) = (&self.world, &self.matches);
        self.still_pairs.clear();
        self.still_pairs.extend(matches.pairs.iter().zip(&matches.tracks).filter_map(|(pair, &k)| {
            let still = world.tracks()[k].score >= BACKGROUND_SCORE && residuals[k]?.norm() < limit;
            still.then_some(*pair)
        }));
        let outlying: Vec<u32> = self
            .world
            .tracks()
            .iter()
            .zip(&residuals)
            .filter(|(_, r)| r.is_some_and(|r| !(r.norm() < limit)))
            .map(|(t, _)| t.id)
            .collect();
        self.world.advance(&frame.observations, &residuals, spread);
        let tracks = self.world.tracks();
        self.background.clear();
        self.background.extend(frame.observations.iter().map(|p| {
            let background =
                tracks.binary_search_by_key(&p.id, |t| t.id).is_ok_and(|k| tracks[k].score >= BACKGROUND_SCORE);
            background && outlying.binary_search(&p.id).is_err()
        }));
    }
}

impl Matches {
    fn clear(&mut self) {
        self.pairs.clear();
        self.members.clear();
        self.tracks.clear();
        self.prior_weights.clear();
        self.weights.clear();
    }

    /// Sets `weights` to the prior weights times the Geman–McClure weight of scale `c` under `map`, normalized to sum 1, and
    /// returns the spread (weighted median distance) under them, px.
    fn reweigh(&mut self, map: impl Fn(nalgebra::Point2<f64>) -> Option<nalgebra::Point2<f64>>, c: f64) -> f64 {
        self.weights.clear();
        let mut distances = Vec::with_capacity(self.pairs.len());
        for (pair, prior) in self.pairs.iter().zip(&self.prior_weights) {
            let r = map(pair.previous).map_or(f64::INFINITY, |q| (q - pair.this).norm());
            let q = (r / c).powi(2);
            let weight = prior / ((1.0 + q) * (1.0 + q));
            self.weights.push(weight);
            distances.push((r, weight));
        }
        let total: f64 = self.weights.iter().sum();
        if total > 0.0 {
            self.weights.iter_mut().for_each(|w| *w /= total);
        }
        weighted_median(&mut distances)
    }

    fn occupied_cells(&self) -> usize {
        let mut seen = vec![false; Background::cells()];
        self.members.iter().for_each(|m| seen[m.1] = true);
        seen.iter().filter(|s| **s).count()
    }

    /// Index of each pair with its residual vector `q − H p`, px; pairs without an image are left out.
    fn residuals<'a>(&'a self, h: &'a Homography) -> impl Iterator<Item = (usize, Vec2)> + 'a {
        let residual = |(k, pair): (usize, &Pair)| Some((k, pair.this - h.apply(pair.previous)?));
        self.pairs.iter().enumerate().filter_map(residual)
    }
}
