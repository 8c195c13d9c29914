//! Planar motion as a consensus problem: the energy that ranks competing motions of one frame pair.
//!
//! ```text
//! E(M) = Σᵢ ωᵢ min(‖M pᵢ − qᵢ‖²/T², 1) / Σωᵢ  +  λ · min(d(M, M̄)²/(3σ)², 1)
//! ```
//!
//! `ωᵢ` gives every cell of the frame about the same weight, more to tracks of high score and to the border
//! ([`super::background`]). `d` is the root mean square distance, over the frame's corners and center, between the motion `M` and
//! the recent mean motion `M̄` of standard deviation `σ`: a subject's motion that deviates from the camera's recent path is
//! penalized, by up to `λ`.

use plumbline_num::math::{Homography, Point2, Similarity2, Vec2};
use plumbline_num::optim::ransac::Consensus;

use super::planar_fit::{self, FrameScale, Pair};

/// λ: the fraction of the weight by which a competing motion must exceed one that continues the recent path; half of
/// `MIN_SUPPORT`, so that it decides between near ties only.
const CONSISTENCY: f64 = 0.12;

/// Learning rate of the recent path: 0.25 is a memory of about four frames.
const PATH_LEARNING: f64 = 0.25;

/// Displacements of the frame's corners and center under a motion, px, by which two motions are compared.
pub(super) type Displacements = [Vec2; 5];

/// The recent inter-frame motion: mean and variation.
#[derive(Clone, Debug)]
pub(super) struct RecentPath {
    probes: [Point2; 5],
    mean: Option<Displacements>,
    variance: f64,
    floor: f64,
}

impl RecentPath {
    pub(super) fn new(width: u32, height: u32, unit_px: f64) -> Self {
        let (w, h) = (f64::from(width), f64::from(height));
        let probes = [(0.0, 0.0), (w, 0.0), (0.0, h), (w, h), (w / 2.0, h / 2.0)].map(|(x, y)| Point2::new(x, y));
        Self { probes, mean: None, variance: 0.0, floor: unit_px * unit_px }
    }

    pub(super) fn clear(&mut self) {
        self.mean = None;
        self.variance = 0.0;
    }

    /// Displacements under `map`; `None` where a corner has no image.
    fn displacements(&self, map: impl Fn(Point2) -> Option<Point2>) -> Option<Displacements> {
        let mut out = [Vec2::zeros(); 5];
        for (d, p) in out.iter_mut().zip(self.probes) {
            *d = map(p)? - p;
        }
        Some(out)
    }

    /// The second term of the energy.
    fn penalty(&self, map: impl Fn(Point2) -> Option<Point2>) -> f64 {
        let Some(mean) = &self.mean else { return 0.0 };
        let Some(now) = self.displacements(map) else { return CONSISTENCY };
        CONSISTENCY * (squared_distance(&now, mean) / (9.0 * (self.variance + self.floor))).min(1.0)
    }

    /// Updates the mean by the accepted motion.
    pub(super) fn learn(&mut self, motion: &Similarity2) {
        let Some(now) = self.displacements(|p| Some(motion.apply(p))) else { return };
        match &mut self.mean {
            None => self.mean = Some(now),
            Some(mean) => {
                self.variance += PATH_LEARNING * (squared_distance(&now, mean) - self.variance);
                for (m, d) in mean.iter_mut().zip(now) {
                    *m += PATH_LEARNING * (d - *m);
                }
            }
        }
    }
}

fn squared_distance(a: &Displacements, b: &Displacements) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()).sum::<f64>() / 5.0
}

/// Matched points of one frame pair with the recent path.
pub(super) struct PlanarData<'a> {
    pub(super) pairs: &'a [Pair],
    /// Score and cell of each pair: a minimal sample takes one member per cell.
    pub(super) cells: &'a [(f64, usize)],
    pub(super) scale: FrameScale,
    pub(super) path: &'a RecentPath,
}

/// [`PlanarData`] explained by similarities.
pub(super) struct BySimilarity<'a>(pub(super) &'a PlanarData<'a>);

impl Consensus for BySimilarity<'_> {
    type Model = Similarity2;

    fn len(&self) -> usize {
        self.0.pairs.len()
    }

    fn sample_size(&self) -> usize {
        2
    }

    fn fit_minimal(&self, sample: &[usize], models: &mut Vec<Similarity2>) {
        let pairs = [self.0.pairs[sample[0]], self.0.pairs[sample[1]]];
        // No camera zooms by a third between two frames.
        models.extend(planar_fit::similarity(&pairs, &[1.0, 1.0]).filter(|s| (0.75..1.34).contains(&s.scale())));
    }

    fn fit_weighted(&self, weights: &[f64], _initial: &Similarity2) -> Option<Similarity2> {
        planar_fit::similarity(self.0.pairs, weights)
    }

    fn squared_residual(&self, model: &Similarity2, i: usize) -> f64 {
        let pair = &self.0.pairs[i];
        (model.apply(pair.previous) - pair.this).norm_squared()
    }

    fn group(&self, i: usize) -> u32 {
        self.0.cells[i].1 as u32
    }

    fn penalty(&self, model: &Similarity2) -> f64 {
        self.0.path.penalty(|p| Some(model.apply(p)))
    }
}

/// [`PlanarData`] explained by homographies, regularized by `kappa`.
pub(super) struct ByHomography<'a> {
    pub(super) data: &'a PlanarData<'a>,
    pub(super) initial: Homography,
    pub(super) kappa: f64,
}

impl Consensus for ByHomography<'_> {
    type Model = Homography;

    fn len(&self) -> usize {
        self.data.pairs.len()
    }

    fn sample_size(&self) -> usize {
        4
    }

    fn fit_minimal(&self, sample: &[usize], models: &mut Vec<Homography>) {
        let pairs = [0, 1, 2, 3].map(|k| self.data.pairs[sample[k]]);
        models.extend(planar_fit::homography_of_four(pairs, &self.data.scale));
    }

    fn fit_weighted(&self, weights: &[f64], _initial: &Homography) -> Option<Homography> {
        planar_fit::homography(self.data.pairs, weights, &self.initial, self.kappa, &self.data.scale, 2)
    }

    fn squared_residual(&self, model: &Homography, i: usize) -> f64 {
        let pair = &self.data.pairs[i];
        model.apply(pair.previous).map_or(f64::INFINITY, |q| (q - pair.this).norm_squared())
    }

    fn group(&self, i: usize) -> u32 {
        self.data.cells[i].1 as u32
    }

    fn penalty(&self, model: &Homography) -> f64 {
        self.data.path.penalty(|p| model.apply(p))
    }
}
