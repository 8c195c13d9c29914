//! Robust consensus: weighted MSAC with local optimization and balanced sampling.
//!
//! Among models `M` of a family, find the one of least energy
//!
//! ```text
//! E(M) = Σᵢ wᵢ min(rᵢ(M)²/T², 1) + penalty(M),      Σᵢ wᵢ = 1,
//! ```
//!
//! by drawing minimal samples, each datum with probability `wᵢ` and no two from one *group*, and by refitting the best
//! model so far to its inliers (LO step). The weights carry what the caller knows beforehand; the groups keep a sample
//! from sitting in one corner. The search stops when a sample free of outliers has been drawn with probability 0.995.
//!
//! # Reference
//! Torr, Zisserman, *MLESAC*, CVIU 2000 (MSAC cost); Chum, Matas, Kittler, *Locally optimized RANSAC*, DAGM 2003.

use crate::run::{Run, Stopped};

/// The largest minimal sample any [`Consensus`] problem may ask for.
pub const MAX_SAMPLE: usize = 8;

/// Probability with which one outlier-free sample must have been seen before the search stops. The number of samples
/// grows with `−ln(1 − p)`: 0.99 saves an eighth of them and fails twice as often, 0.9995 costs 43 % more.
const CONFIDENCE: f64 = 0.995;

/// A family of models and the data they are to explain.
pub trait Consensus {
    /// One hypothesis.
    type Model: Clone;

    /// Number of data.
    fn len(&self) -> usize;

    /// True where there are no data.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of data that determine a model, at most [`MAX_SAMPLE`].
    fn sample_size(&self) -> usize;

    /// Pushes the models through the data of `sample` to `models`, which comes empty; none for a degenerate sample.
    fn fit_minimal(&self, sample: &[usize], models: &mut Vec<Self::Model>);

    /// The model of least squares under `weights` (zero: left out), one entry per datum; `initial` is the model that the
    /// weights were taken from: the initial guess of families that are fitted iteratively.
    fn fit_weighted(&self, weights: &[f64], initial: &Self::Model) -> Option<Self::Model>;

    /// Squared residual of datum `i`, in squared units of [`MsacOptions::threshold`].
    fn squared_residual(&self, model: &Self::Model, i: usize) -> f64;

    /// The group of datum `i`: two data of one group are not drawn into the same sample where that can be avoided.
    fn group(&self, i: usize) -> u32;

    /// Prior energy of a model, dimensionless, ≥ 0, on the scale where all data being outliers costs 1.
    fn penalty(&self, _model: &Self::Model) -> f64 {
        0.0
    }
}

/// Settings of [`msac`].
#[derive(Clone, Copy, Debug)]
pub struct MsacOptions {
    /// Residual at which a datum counts as an outlier, in the unit of the problem, > 0.
    pub threshold: f64,
    /// Minimum number of samples: with fewer a competing motion of equal size is easily missed.
    pub min_samples: usize,
    /// Maximum number of samples.
    pub max_samples: usize,
    /// Refits of each new best model to its inliers.
    pub local_steps: usize,
}

/// The model found by [`msac`].
#[derive(Clone, Debug)]
pub struct Solution<M> {
    /// The model of least energy.
    pub model: M,
    /// Its energy, in [0, 1 + penalty].
    pub energy: f64,
    /// Weight of the data within the threshold, in [0, 1].
    pub support: f64,
}

/// Searches the model of least energy; `initial`, where given, competes with the sampled ones.
///
/// `weights` need not be normalized; negative and non-finite ones count as zero. Returns `None` where fewer data carry
/// weight than a sample needs, or no sample was regular.
///
/// # Errors
/// [`Stopped`].
pub fn msac<P: Consensus>(
    problem: &P,
    weights: &[f64],
    options: &MsacOptions,
    initial: Option<P::Model>,
    rng: &mut fastrand::Rng,
    run: &Run,
) -> Result<Option<Solution<P::Model>>, Stopped> {
    let Some(mut search) = Search::new(problem, weights, options) else { return Ok(None) };
    if let Some(model) = initial {
        search.consider(model);
    }
    let mut needed = options.max_samples;
    let mut drawn = 0;
    let mut sample = [0usize; MAX_SAMPLE];
    let sample = &mut sample[..problem.sample_size().min(MAX_SAMPLE)];
    let mut models = Vec::new();
    // The number of samples needed falls with the support of the best model.
    while drawn < needed.max(options.min_samples).min(options.max_samples) {
        drawn += 1;
        run.check()?;
        if !search.draw(rng, sample) {
            continue;
        }
        models.clear();
        problem.fit_minimal(sample, &mut models);
        for model in models.drain(..) {
            if search.consider(model) {
                needed = search.samples_needed(sample.len());
            }
        }
    }
    Ok(search.best)
}

struct Search<'a, P: Consensus> {
    problem: &'a P,
    options: &'a MsacOptions,
    weights: Vec<f64>,
    cumulative: Vec<f64>,
    refit: Vec<f64>,
    best: Option<Solution<P::Model>>,
}

impl<'a, P: Consensus> Search<'a, P> {
    fn new(problem: &'a P, weights: &[f64], options: &'a MsacOptions) -> Option<Self> {
        let clean = |w: &f64| if w.is_finite() && *w > 0.0 { *w } else { 0.0 };
        let total: f64 = weights.iter().map(clean).sum();
        let carrying = weights.iter().filter(|w| clean(w) > 0.0).count();
        if carrying < problem.sample_size() || !(total > 0.0) || weights.len() != problem.len() {
            return None;
        }
        let weights: Vec<f64> = weights.iter().map(|w| clean(w) / total).collect();
        let mut sum = 0.0;
        let cumulative = weights.iter().map(|w| {
            sum += w;
            sum
        });
        let cumulative = cumulative.collect();
        Some(Self { problem, options, refit: vec![0.0; weights.len()], weights, cumulative, best: None })
    }

    /// Fills `sample` with distinct data of distinct groups; false where the draws keep colliding.
    fn draw(&self, rng: &mut fastrand::Rng, sample: &mut [usize]) -> bool {
        // Draws of one datum: where half of the weight collides, one sample in 2⁸ is given up; the last two may repeat a group.
        const MAX_TRIES: usize = 8;
        for k in 0..sample.len() {
            let mut fresh = None;
            for attempt in 0..MAX_TRIES {
                let i = self.cumulative.partition_point(|c| *c < rng.f64()).min(self.weights.len() - 1);
                let clash =
                    |&j: &usize| j == i || (attempt + 2 < MAX_TRIES && self.problem.group(j) == self.problem.group(i));
                if self.weights[i] > 0.0 && !sample[..k].iter().any(clash) {
                    fresh = Some(i);
                    break;
                }
            }
            let Some(i) = fresh else { return false };
            sample[k] = i;
        }
        true
    }

    /// Keeps `model`, locally optimized, where it beats the best so far.
    fn consider(&mut self, model: P::Model) -> bool {
        let Some(mut solution) = self.score(model) else { return false };
        for _ in 0..self.options.local_steps {
            let Some(refined) = self.refine(&solution.model) else { break };
            let gain = solution.energy - refined.energy;
            if !(gain > 0.0) {
                break;
            }
            solution = refined;
        }
        self.best = Some(solution);
        true
    }

    /// Energy of `model`, given up as soon as it exceeds the best one.
    fn score(&self, model: P::Model) -> Option<Solution<P::Model>> {
        let limit = self.best.as_ref().map_or(f64::INFINITY, |b| b.energy);
        let (mut energy, mut support) = (self.problem.penalty(&model), 0.0);
        let inverse = 1.0 / (self.options.threshold * self.options.threshold);
        for (i, w) in self.weights.iter().enumerate() {
            let cost = self.problem.squared_residual(&model, i) * inverse;
            if cost < 1.0 {
                energy += w * cost;
                support += w;
            } else {
                energy += w;
            }
            if !(energy < limit) {
                return None;
            }
        }
        Some(Solution { model, energy, support })
    }

    /// One LO step: least squares on the inliers of `model`, weighted by `(1 − r²/T²)²` so that none enters abruptly.
    fn refine(&mut self, model: &P::Model) -> Option<Solution<P::Model>> {
        let inverse = 1.0 / (self.options.threshold * self.options.threshold);
        for (i, out) in self.refit.iter_mut().enumerate() {
            let slack = 1.0 - self.problem.squared_residual(model, i) * inverse;
            *out = if slack > 0.0 { self.weights[i] * slack * slack } else { 0.0 };
        }
        let refined = self.problem.fit_weighted(&self.refit, model)?;
        self.score_unbounded(refined)
    }

    fn score_unbounded(&mut self, model: P::Model) -> Option<Solution<P::Model>> {
        let best = self.best.take();
        let solution = self.score(model);
        self.best = best;
        solution
    }

    fn samples_needed(&self, sample_size: usize) -> usize {
        let support = self.best.as_ref().map_or(0.0, |b| b.support);
        let clean = support.powf(sample_size as f64);
        if clean >= CONFIDENCE {
            return 1;
        }
        ((1.0 - CONFIDENCE).ln() / (1.0 - clean).ln()).ceil() as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lines `y = a x + b`.
    struct Line(Vec<(f64, f64)>);

    impl Consensus for Line {
        type Model = (f64, f64);
        fn len(&self) -> usize {
            self.0.len()
        }
        fn sample_size(&self) -> usize {
            2
        }
        fn fit_minimal(&self, s: &[usize], models: &mut Vec<(f64, f64)>) {
            let ((x0, y0), (x1, y1)) = (self.0[s[0]], self.0[s[1]]);
            if x0 != x1 {
                let a = (y1 - y0) / (x1 - x0);
                models.push((a, y0 - a * x0));
            }
        }
        fn fit_weighted(&self, w: &[f64], _start: &(f64, f64)) -> Option<(f64, f64)> {
            let sum = |f: &dyn Fn(f64, f64) -> f64| w.iter().zip(&self.0).map(|(w, (x, y))| w * f(*x, *y)).sum::<f64>();
            let (n, x, y) = (sum(&|_, _| 1.0), sum(&|x, _| x), sum(&|_, y| y));
            let (xx, xy) = (sum(&|x, _| x * x), sum(&|x, y| x * y));
            let d = n * xx - x * x;
            (d > 0.0).then(|| ((n * xy - x * y) / d, (xx * y - x * xy) / d))
        }
        fn squared_residual(&self, &(a, b): &(f64, f64), i: usize) -> f64 {
            let (x, y) = self.0[i];
            (y - a * x - b).powi(2)
        }
        fn group(&self, i: usize) -> u32 {
            i as u32
        }
    }

    const OPTIONS: MsacOptions = MsacOptions { threshold: 0.5, min_samples: 10, max_samples: 400, local_steps: 3 };

    /// 30 points near `y = 2x + 1` and 70 on another line.
    fn two_lines() -> Line {
        let noise = |i: usize| ((i * 37 % 11) as f64 - 5.0) * 0.01;
        let line = |i: usize| {
            let x = i as f64 * 0.1;
            if i < 30 { (x, 2.0 * x + 1.0 + noise(i)) } else { (x, 40.0 - 3.0 * x) }
        };
        Line((0..100).map(line).collect())
    }

    #[test]
    fn the_larger_weight_wins_not_the_larger_number() {
        let data = two_lines();
        let mut weights = vec![1.0; 100];
        let most = msac(&data, &weights, &OPTIONS, None, &mut fastrand::Rng::with_seed(1), &Run::default())
            .expect("a run that never stops")
            .expect("lines exist");
        assert!((most.model.0 + 3.0).abs() < 0.05, "70 of 100 points: {:?}", most.model);
        weights[30..].fill(0.2);
        let trusted = msac(&data, &weights, &OPTIONS, None, &mut fastrand::Rng::with_seed(1), &Run::default())
            .expect("a run that never stops")
            .expect("lines exist");
        assert!((trusted.model.0 - 2.0).abs() < 0.02, "30 trusted points: {:?}", trusted.model);
        assert!((trusted.support - 30.0 / 44.0).abs() < 0.03, "{}", trusted.support);
    }

    #[test]
    fn the_local_step_reaches_least_squares_on_the_inliers() {
        let data = Line(two_lines().0[..30].to_vec());
        let found = msac(&data, &[1.0; 30], &OPTIONS, None, &mut fastrand::Rng::with_seed(3), &Run::default())
            .expect("a run that never stops")
            .expect("a line exists");
        let ideal = data.fit_weighted(&[1.0; 30], &found.model).expect("a line exists");
        assert!((found.model.0 - ideal.0).abs() < 2e-3 && (found.model.1 - ideal.1).abs() < 5e-3, "{:?}", found.model);
    }

    #[test]
    fn the_same_seed_gives_the_same_model() {
        let data = two_lines();
        let run = || {
            msac(&data, &[1.0; 100], &OPTIONS, None, &mut fastrand::Rng::with_seed(7), &Run::default())
                .expect("a run that never stops")
                .expect("found")
                .model
        };
        assert_eq!(run(), run());
    }

    #[test]
    fn too_few_or_worthless_data_give_none() {
        let mut rng = fastrand::Rng::with_seed(1);
        assert!(
            msac(&Line(vec![(0.0, 0.0)]), &[1.0], &OPTIONS, None, &mut rng, &Run::default())
                .expect("a run that never stops")
                .is_none()
        );
        assert!(
            msac(&two_lines(), &[0.0; 100], &OPTIONS, None, &mut rng, &Run::default())
                .expect("a run that never stops")
                .is_none()
        );
        assert!(
            msac(&two_lines(), &[f64::NAN; 100], &OPTIONS, None, &mut rng, &Run::default())
                .expect("a run that never stops")
                .is_none()
        );
        assert!(
            msac(&two_lines(), &[1.0; 99], &OPTIONS, None, &mut rng, &Run::default())
                .expect("a run that never stops")
                .is_none(),
            "one weight per datum"
        );
    }
}
