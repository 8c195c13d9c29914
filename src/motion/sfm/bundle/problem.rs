//! The adjustment as a damped problem: present and trial parameters, priors, cost.

use super::layout::{Layout, POSE};
use super::normal::{Judgment, Normal};
use super::options::{BundleOptions, Freedom};
use super::parameters::{Parameters, SHARED};
use super::residual::Cameras;
use super::schur::Reduced;
use crate::camera::Vec3;
use crate::energy::Loss;
use crate::optim::levenberg_marquardt::DampedProblem;

/// `½ ((x − mean)/σ)²`.
#[derive(Clone, Copy, Debug)]
struct Prior {
    mean: f64,
    weight: f64,
}

/// All that an adjustment works on.
pub(super) struct Adjustment<'a> {
    layout: &'a Layout,
    pub(super) judgment: Judgment,
    priors: [Option<Prior>; SHARED],
    /// `κ` of every track: what inverse depth below zero costs, `½ (κ w)²`.
    beyond: Vec<f64>,
    pub(super) present: Parameters,
    trial: Parameters,
    pub(super) cameras: Cameras,
    pub(super) normal: Normal,
    reduced: Reduced,
}

impl<'a> Adjustment<'a> {
    pub(super) fn new(layout: &'a Layout, start: Parameters, cameras: Cameras, options: &BundleOptions) -> Self {
        let normal = Normal::new(layout);
        let judgment = Judgment { sigma: options.sigma_px, loss: Loss::Huber(1.0) };
        let mut problem = Self {
            layout,
            judgment,
            priors: priors(options),
            beyond: Vec::new(),
            trial: start.clone(),
            present: start,
            cameras,
            reduced: Reduced::new(layout, &normal),
            normal,
        };
        problem.beyond = problem.depth_priors();
        problem
    }

    /// `κ = f B/σ`, `B` the longest baseline from the anchor: a point beyond infinity pays for the parallax it would have
    /// against one at infinity as for a residual.
    fn depth_priors(&self) -> Vec<f64> {
        let focal = self.present.shared[0].exp();
        let center = |frame: usize| self.present.poses[frame].center();
        let baseline = |t: &super::layout::Track| {
            let seen = self.layout.sights[t.sights.clone()].iter();
            seen.map(|s| (center(s.frame) - center(t.anchor)).norm()).fold(0.0, f64::max)
        };
        self.layout.tracks.iter().map(|t| focal * baseline(t) / self.judgment.sigma).collect()
    }

    /// `E` at the present point under the present loss.
    pub(super) fn cost(&mut self) -> f64 {
        self.trial.copy_from(&self.present);
        self.trial_cost()
    }

    /// Squared residuals in units of `σ²`; `None` behind the camera.
    pub(super) fn squares(&self) -> impl Iterator<Item = Option<f64>> {
        squares(self.layout, &self.cameras, &self.present, self.judgment.sigma)
    }

    /// Variance of `ln f` if the noise is as stated.
    pub(super) fn variance_of_ln_focal(&mut self) -> Option<f64> {
        self.linearize();
        self.reduced.variance_of_ln_focal(self.layout, &self.normal)
    }

    fn add_priors(&mut self) {
        for (k, prior) in self.priors.iter().enumerate() {
            if let Some(prior) = prior {
                *self.normal.a.corner_mut(k, k) += prior.weight;
                self.normal.b[POSE * self.layout.free + k] += prior.weight * (self.present.shared[k] - prior.mean);
            }
        }
        for ((block, ray), kappa) in self.normal.points.iter_mut().zip(&self.present.points).zip(&self.beyond) {
            if ray.w < 0.0 {
                block.c[(2, 2)] += kappa * kappa;
                block.g.z += kappa * kappa * ray.w;
            }
        }
    }

    fn prior_cost(&self) -> f64 {
        let shared = self.priors.iter().zip(self.trial.shared);
        let shared: f64 = shared.filter_map(|(p, x)| p.map(|p| p.weight * (x - p.mean).powi(2))).sum();
        let beyond = self.trial.points.iter().zip(&self.beyond);
        0.5 * (shared + beyond.map(|(ray, kappa)| (kappa * ray.w.min(0.0)).powi(2)).sum::<f64>())
    }
}

impl DampedProblem for Adjustment<'_> {
    fn linearize(&mut self) {
        self.cameras.place(&self.present, &self.layout.used);
        self.normal.assemble(self.layout, &self.cameras, &self.present, &self.judgment);
        self.add_priors();
    }

    fn propose(&mut self, lambda: f64) -> Option<f64> {
        let gain = self.reduced.solve(self.layout, &self.normal, lambda).ok()?;
        let (poses, shared) = self.reduced.delta.split_at(POSE * self.layout.free);
        for (frame, slot) in self.layout.slot.iter().enumerate() {
            if let Some(slot) = slot {
                let step = &poses[POSE * slot..][..POSE];
                let (turn, shift) = (Vec3::from_row_slice(&step[..3]), Vec3::from_row_slice(&step[3..]));
                self.trial.poses[frame] = self.present.poses[frame].perturbed(&turn, &shift);
            }
        }
        (0..SHARED).for_each(|k| self.trial.shared[k] = self.present.shared[k] + shared[k]);
        for ((trial, ray), step) in self.trial.points.iter_mut().zip(&self.present.points).zip(&self.reduced.points) {
            *trial = ray.moved(step);
        }
        Some(gain)
    }

    fn trial_cost(&mut self) -> f64 {
        self.cameras.place(&self.trial, &self.layout.used);
        let squares = squares(self.layout, &self.cameras, &self.trial, self.judgment.sigma);
        squares.map(|s| self.judgment.cost(s)).sum::<f64>() + self.prior_cost()
    }

    fn accept(&mut self) {
        self.present.copy_from(&self.trial);
    }
}

fn squares(
    layout: &Layout,
    cameras: &Cameras,
    parameters: &Parameters,
    sigma: f64,
) -> impl Iterator<Item = Option<f64>> {
    layout.tracks.iter().zip(&parameters.points).flat_map(move |(track, ray)| {
        let point = cameras.anchored(ray, track.anchor);
        let sights = layout.sights[track.sights.clone()].iter();
        sights.map(move |s| cameras.residual(&point, s.frame, s.pixel, sigma).map(|r| r.norm_squared()))
    })
}

fn priors(options: &BundleOptions) -> [Option<Prior>; SHARED] {
    let prior = |freedom: Freedom, unit: fn(f64) -> f64| match freedom {
        Freedom::Near { value, sigma } => Some(Prior { mean: unit(value), weight: sigma.powi(-2) }),
        Freedom::Fixed | Freedom::Free => None,
    };
    [prior(options.focal, f64::ln), prior(options.k1, |x| x), prior(options.readout, |x| x)]
}
