//! The adjustment as a damped least-squares problem: current and trial parameters, priors, cost.

use rayon::prelude::*;

use super::cameras::Cameras;
use super::layout::{Layout, POSE, Track};
use super::normal::Normal;
use super::options::{BundleOptions, Freedom};
use super::parameters::{LN_FOCAL, Parameters, Ray, SHARED};
use super::rescue::{self, is_suspicious};
use super::robust_loss::RobustLoss;
use super::schur::Reduced;
use super::structure::PointProblem;
use plumbline_camera::{CameraPose, Vec3};
use plumbline_num::energy::Loss;
use plumbline_num::optim::levenberg_marquardt::{DampedProblem, DampingOptions};
use plumbline_num::run::{Run, Stopped};

/// Options of the search for a single point within a joint step. It runs to the minimum: a point left above it would
/// predict a cost decrease for the next joint step that does not occur.
const SETTLING: DampingOptions = DampingOptions { lambda: 1e-3, tolerance: 1e-4, floor: 0.0, max_iterations: 30 };

/// `½ ((x − mean)/σ)²`.
#[derive(Clone, Copy, Debug)]
struct Prior {
    mean: f64,
    weight: f64,
}

/// State of an adjustment.
pub(super) struct Adjustment<'a> {
    layout: &'a Layout,
    pub(super) robust_loss: RobustLoss,
    priors: [Option<Prior>; SHARED],
    /// `κ` of every track: the penalty of a negative inverse depth is `½ (κ w)²`.
    beyond: Vec<f64>,
    pub(super) present: Parameters,
    trial: Parameters,
    /// Cost of each track at the current parameters.
    costs: Vec<f64>,
    trial_costs: Vec<f64>,
    cameras: Cameras,
    normal: Normal,
    reduced: Reduced,
}

impl<'a> Adjustment<'a> {
    pub(super) fn new(layout: &'a Layout, initial: Parameters, cameras: Cameras, options: &BundleOptions) -> Self {
        let normal = Normal::new(layout);
        let robust_loss = RobustLoss { sigma: options.fit.sigma_px, loss: Loss::Huber(1.0) };
        Self {
            layout,
            robust_loss,
            priors: priors(options),
            beyond: depth_priors(layout, &initial, options.fit.sigma_px),
            costs: vec![0.0; layout.tracks.len()],
            trial_costs: vec![f64::INFINITY; layout.tracks.len()],
            trial: initial.clone(),
            present: initial,
            cameras,
            reduced: Reduced::new(layout, &normal),
            normal,
        }
    }

    /// `E` at the current parameters under the current loss.
    pub(super) fn cost(&mut self) -> f64 {
        self.trial.copy_from(&self.present);
        self.costs.fill(f64::INFINITY);
        let cost = self.trial_cost();
        self.accept();
        cost
    }

    /// Squared residuals at the last trial parameters, in units of `σ²`; `None` behind the camera.
    pub(super) fn squares(&self) -> impl Iterator<Item = Option<f64>> {
        self.layout.tracks.iter().zip(&self.trial.points).flat_map(move |(track, ray)| {
            let point = self.cameras.anchored(ray, track.anchor);
            let observations = self.layout.observations[track.observations.clone()].iter();
            observations.map(move |s| self.robust_loss.squared(&self.cameras, &point, s))
        })
    }

    /// Variance of `ln f` if the noise has the assumed standard deviation.
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

    /// Trial position of the point of a track, and its cost. A point whose cost the joint step has raised strongly is
    /// optimized again on its own, with the trial cameras fixed: a linear step moves points near a camera too far, and
    /// one such point must not reject the step. Without this, a rotating camera that is modeled as one moving before a
    /// plane has rotation errors of 3.7 degrees instead of 0.1 (`docs/ABLATIONS.md`).
    fn settled(&self, index: usize, stepped: Ray) -> (Ray, f64) {
        let unmoved = self.present.points[index];
        let cost = self.of_point(index, stepped).cost(&stepped);
        if !(cost > 2.0 * self.costs[index] + self.layout.tracks[index].observations.len() as f64) {
            return (stepped, cost);
        }
        let start = if self.of_point(index, unmoved).cost(&unmoved) < cost { unmoved } else { stepped };
        self.of_point(index, start).search(&SETTLING)
    }

    /// The optimization of the point of a track alone.
    fn of_point(&self, index: usize, start: Ray) -> PointProblem<'_> {
        let track = &self.layout.tracks[index];
        let observations = &self.layout.observations[track.observations.clone()];
        let robust = (self.robust_loss, self.beyond[index]);
        PointProblem::new(&self.cameras, (track.anchor, observations), robust, start)
    }

    /// Searches again, with the cameras fixed, for the points whose observations have large residuals
    /// ([`super::rescue`]).
    pub(super) fn rescue(&mut self, run: &Run) -> Result<(), Stopped> {
        self.cost();
        let mut depths: Vec<f64> = self.present.points.iter().map(|ray| ray.w).collect();
        depths.sort_by(f64::total_cmp);
        let typical = depths[depths.len() / 2].max(0.0);
        for (index, track) in self.layout.tracks.iter().enumerate() {
            run.check()?;
            let observations = &self.layout.observations[track.observations.clone()];
            if !is_suspicious(self.costs[index], observations.len(), &self.robust_loss) {
                continue;
            }
            let own = observations.iter().find(|s| s.frame == track.anchor);
            let Some(own_ray) = own.and_then(|s| self.cameras.lens().undistorted(s.pixel)) else { continue };
            let problem = |start| self.of_point(index, start);
            if let Some((ray, _)) = rescue::search(problem, own_ray, typical, self.costs[index]) {
                self.present.points[index] = ray;
            }
        }
        Ok(())
    }

    fn prior_cost(&self) -> f64 {
        let shared = self.priors.iter().zip(self.trial.shared);
        0.5 * shared.filter_map(|(p, x)| p.map(|p| p.weight * (x - p.mean).powi(2))).sum::<f64>()
    }
}

impl DampedProblem for Adjustment<'_> {
    fn linearize(&mut self) {
        self.cameras.set(&self.present, self.layout);
        self.normal.assemble(self.layout, &self.cameras, &self.present, &self.robust_loss);
        self.add_priors();
    }

    fn propose(&mut self, lambda: f64) -> Option<f64> {
        let gain = self.reduced.solve(self.layout, &self.normal, lambda).ok()?;
        let (poses, shared) = self.reduced.delta.split_at(POSE * self.layout.free);
        for (frame, slot) in self.layout.slot.iter().enumerate() {
            if let Some(slot) = slot {
                let step = &poses[POSE * slot..][..POSE];
                let (rotation, shift) = (Vec3::from_row_slice(&step[..3]), Vec3::from_row_slice(&step[3..]));
                self.trial.poses[frame] = self.present.poses[frame].perturbed(&rotation, &shift);
            }
        }
        (0..SHARED).for_each(|k| self.trial.shared[k] = self.present.shared[k] + shared[k]);
        for ((trial, ray), step) in self.trial.points.iter_mut().zip(&self.present.points).zip(&self.reduced.points) {
            *trial = ray.moved(step);
        }
        Some(gain)
    }

    fn trial_cost(&mut self) -> f64 {
        self.cameras.set(&self.trial, self.layout);
        let (mut points, mut costs) = (std::mem::take(&mut self.trial.points), std::mem::take(&mut self.trial_costs));
        let each = points.par_iter_mut().zip(&mut costs).enumerate();
        each.with_min_len(64).for_each(|(index, (ray, cost))| (*ray, *cost) = self.settled(index, *ray));
        (self.trial.points, self.trial_costs) = (points, costs);
        self.trial_costs.iter().sum::<f64>() + self.prior_cost()
    }

    fn accept(&mut self) {
        self.present.copy_from(&self.trial);
        self.costs.copy_from_slice(&self.trial_costs);
    }
}

/// `κ = f B/σ` of every track, with `B` its longest baseline from the anchor: the penalty of a point beyond infinity
/// equals that of a residual as large as its parallax against a point at infinity.
pub(super) fn depth_priors(layout: &Layout, at: &Parameters, sigma: f64) -> Vec<f64> {
    let focal = at.shared[LN_FOCAL].exp();
    let centers: Vec<_> = at.poses.iter().map(CameraPose::center).collect();
    let baseline = |t: &Track| {
        let seen = layout.observations[t.observations.clone()].iter();
        seen.map(|s| (centers[s.frame] - centers[t.anchor]).norm()).fold(0.0, f64::max)
    };
    layout.tracks.iter().map(|t| focal * baseline(t) / sigma).collect()
}

fn priors(options: &BundleOptions) -> [Option<Prior>; SHARED] {
    let prior = |freedom: Freedom, unit: fn(f64) -> f64| match freedom {
        Freedom::Near { value, sigma } => Some(Prior { mean: unit(value), weight: sigma.powi(-2) }),
        Freedom::Fixed | Freedom::Free => None,
    };
    [prior(options.focal, f64::ln), prior(options.k1, |x| x), prior(options.readout, |x| x)]
}
