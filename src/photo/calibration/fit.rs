//! One model fitted to the lines.

use nalgebra::{DMatrix, DVector};

use super::model::{PARAMETERS, Parameters};
use super::{CalibrationOptions, LensModel, MIN_SAMPLES, log_focal};
use crate::great_circle::{Sight, best_circle};
use crate::{Line, PhotoError};
use plumbline_camera::{FieldAxis, FieldOfView, Lens};
use plumbline_num::math::Point2;
use plumbline_num::optim::levenberg_marquardt::{DampedProblem, DampingOptions, minimize};
use plumbline_num::run::Run;

/// Fields of view along the width of the initial guesses, degrees: closer together than the basins of attraction are
/// wide.
const INITIAL_FIELDS_DEG: [f64; 6] = [30.0, 60.0, 90.0, 120.0, 150.0, 185.0];
/// Iterations from each initial guess, and samples per line: enough to rank them. Of eight boards and three fisheyes lenses are the same to three
/// digits with all samples.
const TRIAL_STEPS: usize = 8;
const TRIAL_SAMPLES: usize = 9;
/// Maximum number of iterations of each later fit: a limit for ill-conditioned models, the tolerance usually ends it.
const MAX_STEPS: usize = 40;
/// Iterations of the robust reweighting of lines.
const REWEIGHTINGS: usize = 8;
/// Standard deviation of samples before the first reweighting, px: that of marks by hand.
const INITIAL_NOISE_PX: f64 = 0.5;
/// Scale of the Geman–McClure loss: a line at this multiple of the median rms has a quarter of the weight.
const LOSS_SCALE: f64 = 3.0;
/// A line is an outlier if its rms is this multiple of the median: for lines of 5 samples under normal noise the odds
/// are below 1 in 10⁶.
const OUTLIER_SCALE: f64 = 4.0;
/// Minimum rms of an outlier, as a fraction of the diagonal: half a pixel of a photo of a megapixel, the scatter of
/// marks by hand.
const MIN_OUTLIER_RMS: f64 = 4e-4;
/// Steps of the differences: of `ln f`, of the center (px), of the radial terms; all shift a sample by about
/// the same 10⁻² px in a photo of 1000 px.
const STEPS: [f64; PARAMETERS] = [1e-5, 1e-2, 1e-2, 1e-5, 1e-5];

/// The marked points of lines with three or more.
#[derive(Debug)]
pub(super) struct Samples {
    lines: Vec<Vec<Point2>>,
    size: (f64, f64),
}

impl Samples {
    pub(super) fn new(lines: &[Line], size: (f64, f64)) -> Result<Self, PhotoError> {
        let valid = |s: f64| s > 0.0 && s.is_finite();
        if !(valid(size.0) && valid(size.1)) {
            let (width, height) = size;
            let expected = "expected two finite numbers above 0";
            return Err(PhotoError::Input(format!("picture size {width} × {height} px is invalid ({expected})")));
        }
        for line in lines {
            if !line.points.iter().all(|p| p.x.is_finite() && p.y.is_finite()) {
                let name = &line.name;
                return Err(PhotoError::Input(format!("line {name:?} has a point that is not finite: mark it again")));
            }
        }
        let lines: Vec<_> =
            lines.iter().map(|l| l.points.clone()).filter(|points| points.len() >= MIN_SAMPLES).collect();
        let samples: usize = lines.iter().map(Vec::len).sum();
        // Two samples of each line go into its circle; focal length and center must still be overdetermined.
        let needed = 2 * lines.len().max(2) + 4;
        if lines.len() < 2 || samples < needed {
            return Err(PhotoError::Input(format!(
                "{} lines of three points or more with {samples} points in all do not determine a lens (expected 2 lines and \
                 {needed} points): mark more points along long lines near the picture's edges",
                lines.len()
            )));
        }
        Ok(Self { lines, size })
    }

    /// The same lines with at most so many of their samples, evenly from end to end: the ends are farthest from the center, so that a lens that
    /// sees them as a rule sees all.
    fn thinned(&self, most: usize) -> Self {
        let thin = |points: &Vec<Point2>| {
            let kept = points.len().min(most);
            (0..kept).map(|i| points[i * (points.len() - 1) / (kept - 1)]).collect()
        };
        Self { lines: self.lines.iter().map(thin).collect(), size: self.size }
    }

    /// Number of lines.
    pub(super) fn lines(&self) -> usize {
        self.lines.len()
    }

    /// Distances of all samples from their lines' best circles, px, line by line; `None` where the lens does not see one.
    fn distances(&self, lens: &Lens) -> Option<Vec<Vec<f64>>> {
        let of_line = |points: &Vec<Point2>| {
            let sights: Option<Vec<Sight>> = points.iter().map(|p| Sight::new(lens, *p)).collect();
            let sights = sights?;
            let n = best_circle(&sights)?;
            Some(sights.iter().map(|s| s.distance(&n)).collect())
        };
        self.lines.iter().map(of_line).collect()
    }
}

/// A model fitted to the lines.
#[derive(Debug)]
pub(super) struct Fit {
    model: LensModel,
    size: (f64, f64),
    x: Parameters,
    /// Of the used samples, px.
    noise: f64,
    /// Priors at the solution.
    priors: f64,
    /// Degrees of freedom of the used samples: their number less two per line.
    freedom: usize,
    covariance: DMatrix<f64>,
    used: Vec<bool>,
}

impl Fit {
    /// The fit from the best of all initial guesses; `None` if it does not see all samples, or the run was stopped.
    pub(super) fn new(samples: &Samples, model: LensModel, options: &CalibrationOptions, run: &Run) -> Option<Self> {
        let some = samples.thinned(TRIAL_SAMPLES);
        let mut trial = Problem::new(&some, model, options);
        let mut best: Option<(f64, Parameters)> = None;
        for start in initial_guesses(model, samples.size) {
            trial.x = start;
            if let Some(cost) = trial.run(TRIAL_STEPS, run).filter(|c| best.as_ref().is_none_or(|(least, _)| c < least))
            {
                best = Some((cost, trial.x));
            }
        }
        let mut problem = Problem::new(samples, model, options);
        problem.x = best?.1;
        for _ in 0..REWEIGHTINGS {
            problem.soften(options.mark_sigma)?;
            problem.run(MAX_STEPS, run)?;
        }
        problem.decide(options.mark_sigma)?;
        problem.run(MAX_STEPS, run)?;
        problem.finish(options.mark_sigma)
    }

    pub(super) fn model(&self) -> LensModel {
        self.model
    }

    pub(super) fn lens(&self) -> Lens {
        self.model.lens(&self.x, self.size)
    }

    pub(super) fn noise_px(&self) -> f64 {
        self.noise
    }

    /// Lines that took part.
    pub(super) fn used(&self) -> usize {
        self.used.iter().filter(|u| **u).count()
    }

    /// Standard deviations of `(ln f, c_x, c_y, k…)`.
    pub(super) fn sigma(&self) -> Vec<f64> {
        self.covariance.diagonal().iter().map(|v| v.max(0.0).sqrt()).collect()
    }

    /// Standard deviation of a figure of the lens, by its derivatives; 0 where it has none.
    pub(super) fn spread_of(&self, figure: impl Fn(&Lens) -> Option<f64>) -> f64 {
        let p = self.model.parameters();
        let slope = |j: usize| {
            let at = |step: f64| {
                let mut x = self.x;
                x[j] += step;
                figure(&self.model.lens(&x, self.size))
            };
            Some((at(STEPS[j])? - at(-STEPS[j])?) / (2.0 * STEPS[j]))
        };
        let slopes = DVector::from_iterator(p, (0..p).map(|j| slope(j).unwrap_or(0.0)));
        (slopes.transpose() * &self.covariance * &slopes)[0].max(0.0).sqrt()
    }

    /// Schwarz's criterion; lines that are left out are charged as if they lay at the limit where they are.
    pub(super) fn score(&self, options: &CalibrationOptions) -> f64 {
        let n = self.freedom as f64;
        let sigma = self.noise.max(options.mark_sigma);
        let left_out = self.used.iter().filter(|u| !**u).count() as f64;
        n * (2.0 * sigma.ln())
            + (self.model.parameters() as f64 + OUTLIER_SCALE * OUTLIER_SCALE * left_out) * n.ln()
            + self.priors
    }

    /// Per line: rms and largest distance, px, and whether it took part. Samples that the lens does not see count as far as
    /// the picture is wide.
    pub(super) fn line_fits(&self, samples: &Samples) -> Vec<(f64, f64, bool)> {
        let lens = self.lens();
        let one = |(points, used): (&Vec<Point2>, &bool)| {
            let single = Samples { lines: vec![points.clone()], size: self.size };
            let unseen = vec![vec![self.size.0]];
            let distances = single.distances(&lens).unwrap_or(unseen).remove(0);
            let max = distances.iter().fold(0.0_f64, |m, d| m.max(d.abs()));
            (rms(&distances), max, *used)
        };
        samples.lines.iter().zip(&self.used).map(one).collect()
    }
}

/// Initial guesses of a model.
fn initial_guesses(model: LensModel, size: (f64, f64)) -> impl Iterator<Item = Parameters> {
    INITIAL_FIELDS_DEG.into_iter().map(move |degrees| {
        let fov = FieldOfView::degrees(degrees, FieldAxis::Horizontal);
        let mut x = Parameters::zeros();
        x[0] = log_focal(&model.projection([0.0; 2]), fov, size);
        x
    })
}

fn rms(distances: &[f64]) -> f64 {
    (distances.iter().map(|d| d * d).sum::<f64>() / distances.len().max(1) as f64).sqrt()
}

/// The weighted least-squares problem and its current parameters.
struct Problem<'a> {
    samples: &'a Samples,
    model: LensModel,
    x: Parameters,
    trial: Parameters,
    /// Mean and standard deviation of each parameter a priori; the standard deviation is infinite where there is none.
    prior: [(f64, f64); PARAMETERS],
    weights: Vec<f64>,
    noise: f64,
    h: DMatrix<f64>,
    g: DVector<f64>,
}

impl<'a> Problem<'a> {
    fn new(samples: &'a Samples, model: LensModel, options: &CalibrationOptions) -> Self {
        let (fov, sigma) = options.field_of_view.unwrap_or_else(|| model.usual_field());
        let center = options.center_sigma * samples.size.0.hypot(samples.size.1);
        let mut prior = [(0.0, center); PARAMETERS];
        prior[0] = (log_focal(&model.projection([0.0; 2]), fov, samples.size), sigma);
        for (p, sigma) in prior[3..].iter_mut().zip(model.term_sigma()) {
            *p = (0.0, *sigma);
        }
        let p = model.parameters();
        Self {
            samples,
            model,
            x: Parameters::zeros(),
            trial: Parameters::zeros(),
            prior,
            weights: vec![1.0; samples.lines()],
            noise: INITIAL_NOISE_PX,
            h: DMatrix::zeros(p, p),
            g: DVector::zeros(p),
        }
    }

    /// Residuals at `x`, samples first, priors last; `None` where a sample is not seen.
    fn residuals(&self, x: &Parameters) -> Option<DVector<f64>> {
        let lines = self.samples.distances(&self.model.lens(x, self.samples.size))?;
        let weighted = lines.iter().zip(&self.weights).flat_map(|(distances, w)| {
            let scale = w.sqrt() / self.noise;
            distances.iter().map(move |d| d * scale)
        });
        let mut all: Vec<f64> = weighted.collect();
        all.extend((0..self.model.parameters()).map(|j| (x[j] - self.prior[j].0) / self.prior[j].1));
        all.iter().all(|r| r.is_finite()).then(|| DVector::from_vec(all))
    }

    fn cost(&self, x: &Parameters) -> Option<f64> {
        self.residuals(x).map(|r| 0.5 * r.norm_squared())
    }

    /// Minimizes from the present point; `None` where that point is not seen.
    fn run(&mut self, max_iterations: usize, run: &Run) -> Option<f64> {
        let cost = self.cost(&self.x)?;
        let options = DampingOptions { tolerance: 1e-7, floor: 1e-9, max_iterations, ..DampingOptions::default() };
        Some(minimize(self, cost, &options, run).ok()?.cost)
    }

    /// Rms of each line, and the median over lines, at least the accuracy of marks.
    fn line_rms(&self, least: f64) -> Option<(Vec<f64>, f64)> {
        let distances = self.samples.distances(&self.model.lens(&self.x, self.samples.size))?;
        let each: Vec<f64> = distances.iter().map(|d| rms(d)).collect();
        let mut sorted = each.clone();
        sorted.sort_by(f64::total_cmp);
        // The lower median: of two or four lines the better half sets the scale.
        Some((each, sorted[(sorted.len() - 1) / 2].max(least)))
    }

    /// Updates the weights (Geman–McClure) and the noise.
    fn soften(&mut self, least: f64) -> Option<()> {
        let (each, usual) = self.line_rms(least)?;
        for (w, r) in self.weights.iter_mut().zip(&each) {
            let ratio = r / (LOSS_SCALE * usual);
            *w = (1.0 + ratio * ratio).powi(-2);
        }
        self.noise = usual;
        Some(())
    }

    /// Classifies lines as inliers or outliers.
    fn decide(&mut self, least: f64) -> Option<()> {
        let (each, usual) = self.line_rms(least)?;
        let visible = MIN_OUTLIER_RMS * self.samples.size.0.hypot(self.samples.size.1);
        for (w, r) in self.weights.iter_mut().zip(&each) {
            *w = if *r > (OUTLIER_SCALE * usual).max(visible) { 0.0 } else { 1.0 };
        }
        Some(())
    }

    fn finish(mut self, least: f64) -> Option<Fit> {
        let distances = self.samples.distances(&self.model.lens(&self.x, self.samples.size))?;
        let used: Vec<bool> = self.weights.iter().map(|w| *w > 0.0).collect();
        let kept = || distances.iter().zip(&used).filter(|(_, used)| **used).map(|(d, _)| d);
        let freedom = kept().map(|d| d.len() - 2).sum::<usize>().max(1);
        let squares: f64 = kept().flatten().map(|d| d * d).sum();
        let noise = (squares / freedom as f64).sqrt();
        self.noise = noise.max(least);
        self.linearize();
        let covariance = self.h.clone().try_inverse()?;
        let p = self.model.parameters();
        let priors = (0..p).map(|j| ((self.x[j] - self.prior[j].0) / self.prior[j].1).powi(2)).sum();
        let (model, size, x) = (self.model, self.samples.size, self.x);
        Some(Fit { model, size, x, noise, priors, freedom, covariance, used })
    }
}

impl DampedProblem for Problem<'_> {
    fn linearize(&mut self) {
        let p = self.model.parameters();
        let Some(r) = self.residuals(&self.x) else { return };
        let mut jacobian = DMatrix::zeros(r.len(), p);
        for (j, step) in STEPS.into_iter().enumerate().take(p) {
            let slope = |step: f64| {
                let mut x = self.x;
                x[j] += step;
                Some((self.residuals(&x)? - &r) / step)
            };
            // At the edge of the field one side may see nothing.
            if let Some(slope) = slope(step).or_else(|| slope(-step)) {
                jacobian.set_column(j, &slope);
            }
        }
        self.h = jacobian.tr_mul(&jacobian);
        self.g = jacobian.tr_mul(&r);
    }

    fn propose(&mut self, lambda: f64) -> Option<f64> {
        let damping = DMatrix::from_diagonal(&(lambda * self.h.diagonal()));
        let step = -(&self.h + &damping).cholesky()?.solve(&self.g);
        self.trial = self.x;
        for (t, s) in self.trial.iter_mut().zip(step.iter()) {
            *t += s;
        }
        Some(0.5 * step.dot(&(damping * &step - &self.g)))
    }

    fn trial_cost(&mut self) -> f64 {
        self.cost(&self.trial).unwrap_or(f64::INFINITY)
    }

    fn accept(&mut self) {
        self.x = self.trial;
    }
}
