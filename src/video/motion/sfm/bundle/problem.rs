//! The adjustment as a damped problem: present and trial parameters, priors, cost.

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

/// Search for a point on its own: to its minimum, or else it promises the next joint step a gain that does not come.
const SETTLING: DampingOptions = DampingOptions { lambda: 1e-3, tolerance: 1e-4, floor: 0.0, max_iterations: 30 };

/// `½ ((x − mean)/σ)²`.
#[derive(Clone, Copy, Debug)]
struct Prior {
    mean: f64,
    weight: f64,
}

/// All that an adjustment works on.
pub(super) struct Adjustment<'a> {
    layout: &'a Layout,
    pub(super) robust_loss: RobustLoss,
    priors: [Option<Prior>; SHARED],
    /// `κ` of every track: what inverse depth below zero costs, `½ (κ w)²`.
    beyond: Vec<f64>,
    pub(super) present: Parameters,
    trial: Parameters,
    /// What each track costs at the present point.
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

    /// `E` at the present point under the present loss.
    pub(super) fn cost(&mut self) -> f64 {
        self.trial.copy_from(&self.present);
        self.costs.fill(f64::INFINITY);
        let cost = self.trial_cost();
        self.accept();
        cost
    }

    /// Squared residuals at the point last tried, in units of `σ²`; `None` behind the camera.
    pub(super) fn squares(&self) -> impl Iterator<Item = Option<f64>> {
        self.layout.tracks.iter().zip(&self.trial.points).flat_map(move |(track, ray)| {
            let point = self.cameras.anchored(ray, track.anchor);
            let observations = self.layout.observations[track.observations.clone()].iter();
            observations.map(move |s| self.robust_loss.squared(&self.cameras, &point, s))
        })
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

    /// Where the point of a track is tried, and what it costs there. One that the joint step has made much worse is searched anew on its own, among
    /// the cameras as tried: a linear step carries points near a camera too far, and one such point is not to veto the step. Without
    /// this a rotating camera that is taken for one before a plane has rotations 3.7 degrees off instead of 0.1
    /// (`docs/ABLATIONS.md`).
    fn settled(&self, index: usize, stepped: Ray) -> (Ray, f64) {
        let track = &self.layout.tracks[index];
        let observations = &self.layout.observations[track.observations.clone()];
        let unmoved = self.present.points[index];
        let problem = |start| {
            PointProblem::new(
                &self.cameras,
                (track.anchor, observations),
                (self.robust_loss, self.beyond[index]),
                start,
            )
        };
        let cost = problem(stepped).cost(&stepped);
        if !(cost > 2.0 * self.costs[index] + observations.len() as f64) {
            return (stepped, cost);
        }
        let start = if problem(unmoved).cost(&unmoved) < cost { unmoved } else { stepped };
        problem(start).search(&SETTLING)
    }

    /// Searches anew the points whose observations are met by no means, cameras as they are.
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
            let robust = (self.robust_loss, self.beyond[index]);
            let problem = |start| PointProblem::new(&self.cameras, (track.anchor, observations), robust, start);
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
        self.cameras.place(&self.present, self.layout);
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
        self.cameras.place(&self.trial, self.layout);
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

/// `κ = f B/σ` of every track, `B` its longest baseline from the anchor: a point beyond infinity pays for the parallax it would
/// have against one at infinity as for a residual.
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
