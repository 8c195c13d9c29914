//! Structure-only adjustment: one point at a time, cameras fixed.

use nalgebra::{Cholesky, Matrix3};
use rayon::prelude::*;

use super::cameras::Cameras;
use super::layout::{Layout, TrackObservation};
use super::parameters::{Parameters, Ray, SHARED};
use super::problem::depth_priors;
use super::residual::Linearized;
use super::robust_loss::RobustLoss;
use super::{BundleError, RobustFit};
use crate::motion::sfm::{Observation, Scene};
use plumbline_camera::Vec3;
use plumbline_num::optim::levenberg_marquardt::{DampedProblem, DampingOptions, minimize};
use plumbline_num::run::Run;

/// The optimization of one point.
pub(super) struct PointProblem<'a> {
    pub(super) cameras: &'a Cameras,
    pub(super) anchor: usize,
    pub(super) observations: &'a [TrackObservation],
    pub(super) robust_loss: RobustLoss,
    /// `κ` of [`super`].
    pub(super) beyond: f64,
    present: Ray,
    trial: Ray,
    c: Matrix3<f64>,
    g: Vec3,
    scratch: Linearized,
}

impl<'a> PointProblem<'a> {
    pub(super) fn new(
        cameras: &'a Cameras,
        (anchor, observations): (usize, &'a [TrackObservation]),
        (robust_loss, beyond): (RobustLoss, f64),
        start: Ray,
    ) -> Self {
        let (c, g, scratch) = (Matrix3::zeros(), Vec3::zeros(), Linearized::zero());
        Self { cameras, anchor, observations, robust_loss, beyond, present: start, trial: start, c, g, scratch }
    }

    /// The best point found, and its cost.
    pub(super) fn search(mut self, options: &DampingOptions) -> (Ray, f64) {
        let cost = self.cost(&self.present);
        let report = minimize(&mut self, cost, options, &Run::default()).expect("a run that never stops");
        (self.present, report.cost)
    }

    pub(super) fn cost(&self, ray: &Ray) -> f64 {
        let point = self.cameras.anchored(ray, self.anchor);
        let beyond = 0.5 * (self.beyond * ray.w.min(0.0)).powi(2);
        self.robust_loss.cost_of(self.cameras, &point, self.observations) + beyond
    }
}

impl DampedProblem for PointProblem<'_> {
    fn linearize(&mut self) {
        (self.c, self.g) = (Matrix3::zeros(), Vec3::zeros());
        let point = self.cameras.anchored(&self.present, self.anchor);
        let from = (&point, self.cameras.view(self.anchor));
        for observation in self.observations {
            let weight = |squared| self.robust_loss.loss.weight(squared);
            let (eye, out) = (self.cameras.eye(observation.frame), &mut self.scratch);
            if eye.linearize(from, (observation.frame, observation.pixel), self.robust_loss.sigma, weight, out) {
                self.c += out.point.tr_mul(&out.point);
                self.g += out.point.tr_mul(&out.residual);
            }
        }
        if self.present.w < 0.0 {
            self.c[(2, 2)] += self.beyond * self.beyond;
            self.g.z += self.beyond * self.beyond * self.present.w;
        }
    }

    fn propose(&mut self, lambda: f64) -> Option<f64> {
        // A point observed without any baseline has a depth that is neither observed nor constrained: unit damping
        // keeps it finite.
        let damping = lambda * self.c.diagonal().map(|d| if d > 0.0 { d } else { 1.0 });
        let step = -Cholesky::new(self.c + Matrix3::from_diagonal(&damping))?.solve(&self.g);
        self.trial = self.present.moved(&step);
        Some(0.5 * step.dot(&(damping.component_mul(&step) - self.g)))
    }

    fn trial_cost(&mut self) -> f64 {
        self.cost(&self.trial)
    }

    fn accept(&mut self) {
        self.present = self.trial;
    }
}

/// The problem in which only points are free, its parameters and its cameras.
pub(super) fn fixed_cameras(
    scene: &Scene,
    observations: &[Observation],
) -> Result<(Layout, Parameters, Cameras), BundleError> {
    let frames: Vec<u32> = (0..scene.poses.len() as u32).collect();
    let layout = Layout::new(scene, observations, &frames, [false; SHARED], scene.readout != 0.0)?;
    let parameters = layout.parameters(scene);
    let mut cameras = Cameras::new(&layout, scene.intrinsics.center);
    cameras.set(&parameters, &layout);
    Ok((layout, parameters, cameras))
}

/// Refines every known point observed in at least two known frames, each alone; poses, lens and readout are fixed.
/// Returns the number of points.
///
/// # Errors
/// As [`super::adjust`].
pub fn refine_points(
    scene: &mut Scene,
    observations: &[Observation],
    fit: &RobustFit,
    run: &Run,
) -> Result<usize, BundleError> {
    fit.check()?;
    let (layout, mut parameters, cameras) = fixed_cameras(scene, observations)?;
    let beyond = depth_priors(&layout, &parameters, fit.sigma_px);
    let tracks = layout.tracks.par_iter().zip(&beyond);
    parameters.points.par_iter_mut().zip(tracks).try_for_each(|(ray, (track, &beyond))| {
        run.check()?;
        let observations = &layout.observations[track.observations.clone()];
        for &loss in &fit.losses {
            let robust_loss = RobustLoss { sigma: fit.sigma_px, loss };
            let problem = PointProblem::new(&cameras, (track.anchor, observations), (robust_loss, beyond), *ray);
            *ray = problem.search(&fit.damping_for(observations.len())).0;
        }
        Ok::<(), BundleError>(())
    })?;
    layout.store(&parameters, scene);
    Ok(layout.tracks.len())
}
