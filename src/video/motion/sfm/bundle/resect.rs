//! Resection: one pose from known points.

use nalgebra::{Cholesky, Matrix6, Vector6};

use super::parameters::Ray;
use super::residual::{Anchored, Eye, Linearized, View};
use super::robust_loss::RobustLoss;
use super::shutter::{Stencil, neighbors};
use super::{BundleError, RobustFit};
use crate::motion::sfm::{Observation, Scene};
use plumbline_camera::{CameraPose, Vec3};
use plumbline_num::math::Point2;
use plumbline_num::optim::levenberg_marquardt::{DampedProblem, minimize};
use plumbline_num::run::Run;

/// Minimum number of points for a pose: three leave up to four solutions.
const MIN_POINTS: usize = 4;

/// A pose found by [`resect`].
#[derive(Clone, Debug, PartialEq)]
pub struct Resection {
    /// The pose, `cam_from_world`.
    pub pose: CameraPose,
    /// Residual length of each observation used, with its index in the input, px; infinite for a point behind the
    /// camera.
    pub residuals_px: Vec<(usize, f64)>,
    /// Whether the last loss was minimized to the tolerance.
    pub converged: bool,
}

/// Optimizes the pose of `frame` from the initial guess `start`, with observations of known points whose anchors are
/// known and are other frames; other observations are ignored. For a rolling shutter the row motion is interpolated
/// from the known poses of the neighboring frames.
///
/// # Errors
/// [`BundleError`]: options out of range, a non-finite initial guess, fewer than four points, an interruption.
pub fn resect(
    scene: &Scene,
    frame: u32,
    start: CameraPose,
    observations: &[Observation],
    fit: &RobustFit,
    run: &Run,
) -> Result<Resection, BundleError> {
    fit.check()?;
    if !start.rotation.coords.iter().chain(start.translation.iter()).all(|v| v.is_finite()) {
        return Err(BundleError::NotFinite { what: format!("initial guess of the pose of frame {frame}") });
    }
    // 1. Observations of known points in this frame.
    let points: Vec<_> =
        observations.iter().enumerate().filter_map(|(i, o)| known_observation(scene, frame, i, o)).collect();
    if points.len() < MIN_POINTS {
        return Err(BundleError::TooFewObservations { found: points.len(), least: MIN_POINTS });
    }
    // 2. Neighboring poses for the row motion; they are fixed, and unused for a global shutter.
    let known = |f: usize| scene.poses.get(f).is_some_and(Option::is_some);
    let around = neighbors(frame as usize, known).filter_map(|n| Some((n, scene.poses[n]?)));
    let mut problem = PoseProblem {
        scene,
        frame: frame as usize,
        around: if scene.readout == 0.0 { Vec::new() } else { around.collect() },
        points,
        robust_loss: RobustLoss { sigma: fit.sigma_px, loss: fit.losses[0] },
        present: start,
        trial: start,
        h: Matrix6::zeros(),
        g: Vector6::zeros(),
        scratch: Linearized::zero(),
    };
    // 3. Minimize each loss from the result of the previous one.
    let damping = fit.damping_for(problem.points.len());
    let mut converged = false;
    for &loss in &fit.losses {
        problem.robust_loss.loss = loss;
        problem.trial = problem.present;
        let cost = problem.trial_cost();
        converged = minimize(&mut problem, cost, &damping, run)?.converged;
    }
    Ok(Resection { pose: problem.present, residuals_px: problem.residuals_px(), converged })
}

/// An observation of a known point.
struct KnownObservation {
    index: usize,
    point: Anchored,
    pixel: Point2,
}

fn known_observation(scene: &Scene, frame: u32, index: usize, seen: &Observation) -> Option<KnownObservation> {
    let point = scene.points.get(seen.point as usize).copied().flatten()?;
    let anchor = scene.poses.get(point.anchor as usize).copied().flatten()?;
    let finite = seen.pixel.x.is_finite() && seen.pixel.y.is_finite();
    (seen.frame == frame && point.anchor != frame && finite).then(|| {
        let point = Anchored::new(&Ray { xy: point.ray, w: point.inverse_depth }, &View::of(&anchor));
        KnownObservation { index, point, pixel: seen.pixel }
    })
}

struct PoseProblem<'a> {
    scene: &'a Scene,
    frame: usize,
    around: Vec<(usize, CameraPose)>,
    points: Vec<KnownObservation>,
    robust_loss: RobustLoss,
    present: CameraPose,
    trial: CameraPose,
    h: Matrix6<f64>,
    g: Vector6<f64>,
    scratch: Linearized,
}

impl PoseProblem<'_> {
    /// The camera at a pose: its view and its row motion.
    fn camera(&self, pose: &CameraPose) -> (View, Option<Stencil>) {
        let around = || Stencil::of(self.frame, pose, self.around.iter().copied());
        (View::of(pose), (!self.around.is_empty()).then(around))
    }

    fn eye<'b>(&'b self, (view, stencil): &'b (View, Option<Stencil>)) -> Eye<'b> {
        Eye { lens: &self.scene.intrinsics, readout: self.scene.readout, view, stencil: stencil.as_ref() }
    }

    fn residuals_px(&self) -> Vec<(usize, f64)> {
        let camera = self.camera(&self.present);
        let eye = self.eye(&camera);
        let length = |s: &KnownObservation| eye.residual(&s.point, s.pixel, 1.0).map_or(f64::INFINITY, |r| r.norm());
        self.points.iter().map(|s| (s.index, length(s))).collect()
    }
}

impl DampedProblem for PoseProblem<'_> {
    fn linearize(&mut self) {
        let camera = self.camera(&self.present);
        let mut scratch = std::mem::replace(&mut self.scratch, Linearized::zero());
        let (mut h, mut g) = (Matrix6::zeros(), Vector6::zeros());
        let eye = self.eye(&camera);
        for observation in &self.points {
            let weight = |squared| self.robust_loss.loss.weight(squared);
            // The derivatives with respect to the point are not used: any view can serve as its anchor.
            let (from, seen) = ((&observation.point, &camera.0), (self.frame, observation.pixel));
            if eye.linearize(from, seen, self.robust_loss.sigma, weight, &mut scratch) {
                let (_, j) = scratch.poses()[0];
                h += j.tr_mul(&j);
                g += j.tr_mul(&scratch.residual);
            }
        }
        (self.h, self.g, self.scratch) = (h, g, scratch);
    }

    fn propose(&mut self, lambda: f64) -> Option<f64> {
        let damping = lambda * self.h.diagonal();
        let step = -Cholesky::new(self.h + Matrix6::from_diagonal(&damping))?.solve(&self.g);
        let (rotation, shift) = (Vec3::new(step[0], step[1], step[2]), Vec3::new(step[3], step[4], step[5]));
        self.trial = self.present.perturbed(&rotation, &shift);
        Some(0.5 * step.dot(&(damping.component_mul(&step) - self.g)))
    }

    fn trial_cost(&mut self) -> f64 {
        let camera = self.camera(&self.trial);
        let eye = self.eye(&camera);
        let squared =
            |s: &KnownObservation| eye.residual(&s.point, s.pixel, self.robust_loss.sigma).map(|r| r.norm_squared());
        self.points.iter().map(|s| self.robust_loss.cost(squared(s))).sum()
    }

    fn accept(&mut self) {
        self.present = self.trial;
    }
}
