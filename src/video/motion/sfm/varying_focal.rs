//! Estimation of a focal length that may change over a shot, from image pairs with parallax.
//!
//! `ln f` is linear between knots at equal distances of time. Image coordinates are relative to the principal point, in any unit,
//! which is also that of `f`. The model of pair `k` is `Fₖ = K₂⁻¹ [tₖ]× Rₖ K₁⁻¹`, `Kᵢ = diag(fᵢ, fᵢ, 1)`, and the estimate is
//!
//! ```text
//! min  Σₖ Σᵢ ρ(rᵢ(Fₖ)²)      over all poses (Rₖ, tₖ) and the knots,
//! ```
//!
//! with `r` the Sampson distance in the image, where the noise does not depend on `f`. The poses are eliminated pair by pair (Schur
//! complement): to the equations for its two focal lengths, and through them for the knots, a pair contributes its information
//! `Hₖ` and its gradient `gₖ`,
//!
//! ```text
//! Hₖ = C − Bᵀ A⁻¹ B,   gₖ = γ − Bᵀ A⁻¹ a,      [A B; Bᵀ C] and (a, γ) its normal equations for (pose, ln f₁, ln f₂).
//! ```
//!
//! A pair whose gradient deviates by more than its noise explains is down-weighted (Cauchy). The covariance is the sum of that from
//! noise alone, `σ² H⁻¹` with `H = Σ Hₖ`, and that from the disagreement of the pairs (sandwich estimator), `H⁻¹ (Σ gₖ gₖᵀ) H⁻¹`.
//!
//! # Reference
//! Hartley, Zisserman, *Multiple View Geometry*, 2nd ed., sections 11.4.3 and A6.3; P. Huber, *Robust statistics*, 1981,
//! section 6.3 (the sandwich estimator).

use nalgebra::{DMatrix, DVector, Dyn, Matrix2, Matrix3, OMatrix, SMatrix, SVector, U2, Vector2};

use super::correspondence::Correspondence;
use super::epipolar::EpipolarFamily;
use super::essential::{ByEssential, EssentialChart};
use super::focal::{FocalOptions, MIN_CORRESPONDENCES, search_settings};
use super::robust_search::robust_search;
use super::sampson::{self, Chart};
use plumbline_camera::Vec3;
use plumbline_num::run::{Run, Stopped};

/// Maximum number of damped Gauss–Newton steps; the refinement ends earlier if no step decreases the energy.
const MAX_STEPS: usize = 30;

/// Maximum change of `ln f` in one step: at a larger change the linearized poses no longer follow.
const MAX_STEP: f64 = 0.15;

/// Normalized gradient of a pair, in standard deviations, at which its Cauchy weight is one half: noise alone
/// exceeds three standard deviations once in 370.
const PAIR_SCALE: f64 = 3.0;

/// Standard deviation of the change of `ln f` from knot to knot: a weak prior that determines knots no pair sees.
const STEP_SIGMA: f64 = 0.5;

/// Changes of `ln f` over the shot from which the refinement starts; the one that explains most is taken. Under a constant focal length
/// a zoom is explained by poses far from the true ones: from 0 alone, a sideways shot that zooms out by a third ends with a standard
/// deviation of .4. ±.3 lies midway between no zoom and one by a factor of two.
const INITIAL_CHANGES: [f64; 3] = [-0.3, 0.0, 0.3];

/// Rounds in which pairs that disagree are down-weighted: their weights settle to a hundredth in ten.
const ROUNDS: usize = 20;

/// A pair of views and their times, as fractions of the shot.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair<'a> {
    pub(super) matches: &'a [Correspondence],
    pub(super) times: [f64; 2],
}

/// A focal length that may change over a shot.
#[derive(Clone, Debug)]
pub(super) struct VaryingFocal {
    /// `ln f` at equal distances from the start of the shot to its end.
    pub(super) ln_focals: DVector<f64>,
    /// Their covariance.
    pub(super) covariance: DMatrix<f64>,
    /// Number of pairs used.
    pub(super) pairs: usize,
    /// What remains: about the number of correspondences that it does not explain.
    pub(super) energy: f64,
}

impl VaryingFocal {
    /// The two knots between which `ln f` changes most, in order of time; the change and its standard deviation.
    pub(super) fn largest_change(&self) -> (f64, f64) {
        let knots = self.ln_focals.len();
        let pairs = (0..knots).flat_map(|j| (0..j).map(move |i| (i, j)));
        let change = |(i, j): (usize, usize)| self.ln_focals[j] - self.ln_focals[i];
        let sigma = |(i, j): (usize, usize)| {
            let c = &self.covariance;
            (c[(i, i)] + c[(j, j)] - 2.0 * c[(i, j)]).max(0.0).sqrt()
        };
        let most = pairs.max_by(|p, q| change(*p).abs().total_cmp(&change(*q).abs()));
        most.map_or((0.0, 0.0), |pair| (change(pair), sigma(pair)))
    }
}

/// The focal length over time at `knots` knots, near `focal`; `None` where the pairs do not determine it.
///
/// # Errors
/// [`Stopped`].
pub(super) fn varying_focal(
    pairs: &[Pair<'_>],
    focal: f64,
    knots: usize,
    options: &FocalOptions,
    run: &Run,
) -> Result<Option<VaryingFocal>, Stopped> {
    let usable: Vec<Pair<'_>> = pairs.iter().filter(|p| p.matches.len() >= MIN_CORRESPONDENCES).copied().collect();
    let course = || {
        let changes: &[f64] = if knots > 1 { &INITIAL_CHANGES } else { &[0.0] };
        let guess = |change: &f64| {
            DVector::from_fn(knots, |k, _| focal.ln() + change * ((k as f64 / (knots - 1).max(1) as f64) - 0.5))
        };
        let joint = Joint::best(&usable, changes.iter().map(guess), options, run)?.refined(options, run);
        let (ln_focals, covariance) = joint.estimate(options)?;
        Some(VaryingFocal { ln_focals, covariance, pairs: joint.pairs.len(), energy: joint.energy })
    };
    run.complete(course())
}

/// The essential matrix of a pair at assumed focal lengths of its views, by robust search.
fn essential(pair: &[Correspondence], focals: [f64; 2], options: &FocalOptions, run: &Run) -> Option<Matrix3<f64>> {
    let [first, second] = focals;
    let ray = |c: &Correspondence| Correspondence::new(c.first.xy() / first, c.second.xy() / second);
    let rays: Vec<Correspondence> = pair.iter().map(ray).collect();
    let settings = search_settings(options.threshold / (first * second).sqrt(), 200);
    Some(robust_search(&ByEssential::of(&rays), &settings, None, 0, run).ok()??.model)
}

/// `K₂⁻¹ [t]× R K₁⁻¹` with coordinates `(ω, a, b, δ ln f₁, δ ln f₂)`.
#[derive(Clone, Copy, Debug)]
struct FocalChart {
    pose: EssentialChart,
    ln_focals: [f64; 2],
}

impl Chart<7> for FocalChart {
    fn matrix(&self) -> Matrix3<f64> {
        let [k1, k2] = self.ln_focals.map(inverse_k);
        k2 * self.pose.matrix() * k1
    }

    fn tangents(&self) -> [Matrix3<f64>; 7] {
        let ([k1, k2], f) = (self.ln_focals.map(inverse_k), self.matrix());
        let flat = Matrix3::from_diagonal(&Vec3::new(1.0, 1.0, 0.0));
        let [a, b, c, d, e] = self.pose.tangents().map(|t| k2 * t * k1);
        [a, b, c, d, e, -f * flat, -flat * f]
    }

    fn moved(&self, step: &SVector<f64, 7>) -> Self {
        let [first, second] = self.ln_focals;
        Self {
            pose: self.pose.moved(&step.fixed_rows::<5>(0).into_owned()),
            ln_focals: [first + step[5], second + step[6]],
        }
    }
}

fn inverse_k(ln_focal: f64) -> Matrix3<f64> {
    let inverse = (-ln_focal).exp();
    Matrix3::from_diagonal(&Vec3::new(inverse, inverse, 1.0))
}

/// Poses of all pairs under one focal length over time.
#[derive(Clone)]
struct Joint<'a> {
    pairs: Vec<Pair<'a>>,
    poses: Vec<EssentialChart>,
    /// `ln f` at the knots.
    ln_focals: DVector<f64>,
    /// Number of correspondences of pairs without a pose: none of them is explained.
    lost: usize,
    energy: f64,
}

/// Contribution of one pair to the equations for the knots, its pose eliminated.
struct Vote {
    inverse: SMatrix<f64, 5, 5>,
    by_pose: SVector<f64, 5>,
    coupling: SMatrix<f64, 5, 2>,
    information: Matrix2<f64>,
    pull: Vector2<f64>,
}

impl<'a> Joint<'a> {
    /// `None` where no pair has a pose.
    fn new(pairs: &[Pair<'a>], ln_focals: DVector<f64>, options: &FocalOptions, run: &Run) -> Option<Self> {
        let mut joint = Self { pairs: Vec::new(), poses: Vec::new(), ln_focals, lost: 0, energy: 0.0 };
        for pair in pairs {
            let focals: Vector2<f64> = joint.shares(pair) * &joint.ln_focals;
            let found = essential(pair.matches, [focals[0].exp(), focals[1].exp()], options, run);
            match found.and_then(|m| EssentialChart::of_matrix(&m)) {
                Some(pose) => {
                    joint.pairs.push(*pair);
                    joint.poses.push(pose);
                }
                None => joint.lost += pair.matches.len(),
            }
        }
        joint.energy = joint.total_energy(options.threshold);
        (!joint.pairs.is_empty()).then_some(joint)
    }

    /// From the one of some initial guesses that explains most.
    fn best(
        pairs: &[Pair<'a>],
        guesses: impl Iterator<Item = DVector<f64>>,
        options: &FocalOptions,
        run: &Run,
    ) -> Option<Self> {
        let joints = guesses.filter_map(|guess| Self::new(pairs, guess, options, run));
        joints.min_by(|a, b| a.energy.total_cmp(&b.energy))
    }

    /// By how much each of the two focal lengths of a pair changes with each knot: hat functions.
    fn shares(&self, pair: &Pair<'_>) -> OMatrix<f64, U2, Dyn> {
        let knots = self.ln_focals.len();
        OMatrix::<f64, U2, Dyn>::from_fn_generic(U2, Dyn(knots), |view, knot| {
            let at = pair.times[view] * (knots - 1) as f64;
            (1.0 - (at - knot as f64).abs()).max(0.0)
        })
    }

    fn chart(&self, k: usize) -> FocalChart {
        let at = self.shares(&self.pairs[k]) * &self.ln_focals;
        FocalChart { pose: self.poses[k], ln_focals: [at[0], at[1]] }
    }

    /// `Σ ρ(r²)` with `ρ′ = (1 − r²/T²)²`, divided by `T²/3`.
    fn total_energy(&self, threshold: f64) -> f64 {
        let of_pair = |k: usize| {
            let m = self.chart(k).matrix();
            self.pairs[k].matches.iter().map(|c| 1.0 - slack(&m, c, threshold).powi(3)).sum::<f64>()
        };
        self.lost as f64 + (0..self.pairs.len()).map(of_pair).sum::<f64>()
    }

    fn vote(&self, k: usize, threshold: f64, damping: f64) -> Option<Vote> {
        let (chart, matches) = (self.chart(k), self.pairs[k].matches);
        let m = chart.matrix();
        let weights: Vec<f64> = matches.iter().map(|c| slack(&m, c, threshold).powi(2)).collect();
        let sum = sampson::normal_equations(&chart, matches, &weights);
        let mut a = sum.normal.fixed_view::<5, 5>(0, 0).into_owned();
        for i in 0..5 {
            a[(i, i)] *= 1.0 + damping;
        }
        let inverse = a.cholesky()?.inverse();
        let coupling = sum.normal.fixed_view::<5, 2>(0, 5).into_owned();
        let by_pose = sum.gradient.fixed_rows::<5>(0).into_owned();
        let reduced = inverse * coupling;
        let information = sum.normal.fixed_view::<2, 2>(5, 5) - coupling.tr_mul(&reduced);
        let pull = sum.gradient.fixed_rows::<2>(5) - reduced.tr_mul(&by_pose);
        Some(Vote { inverse, by_pose, coupling, information, pull })
    }

    /// Variance of one residual, from the correspondences within the threshold.
    fn variance(&self, threshold: f64) -> f64 {
        let (mut count, mut sum) = (0.0, 0.0);
        for (k, pair) in self.pairs.iter().enumerate() {
            let m = self.chart(k).matrix();
            for c in pair.matches {
                let r = sampson::squared_distance(&m, c);
                if r < threshold * threshold {
                    sum += r;
                    count += 1.0;
                }
            }
            count -= 5.0;
        }
        sum / f64::max(count, 1.0)
    }

    /// Robust weight of a pair: lower if its gradient is larger than its noise explains.
    fn voice(pull: &Vector2<f64>, information: &Matrix2<f64>, variance: f64) -> f64 {
        let eigen = information.symmetric_eigen();
        let least = 1e-9 * eigen.eigenvalues.max();
        let squared: f64 = (0..2)
            .filter(|k| eigen.eigenvalues[*k] > least)
            .map(|k| eigen.eigenvectors.column(k).dot(pull).powi(2) / (eigen.eigenvalues[k] * variance))
            .sum();
        1.0 / (1.0 + squared / (PAIR_SCALE * PAIR_SCALE))
    }

    /// At the nearest minimum; anywhere on the way if the run was interrupted.
    fn refined(mut self, options: &FocalOptions, run: &Run) -> Self {
        let mut damping = 1e-4;
        for _ in 0..MAX_STEPS {
            if run.check().is_err() {
                break;
            }
            let Some(next) = self.stepped(options, damping).filter(|next| next.energy < self.energy) else {
                damping *= 10.0;
                if damping > 1e6 {
                    break;
                }
                continue;
            };
            let settled = self.energy - next.energy <= 1e-12 * self.energy;
            (self, damping) = (next, damping * 0.1);
            if settled {
                break;
            }
        }
        self
    }

    /// The equations for the knots: information and pull.
    fn equations<'v>(
        &self,
        votes: impl Iterator<Item = (&'v Pair<'v>, Matrix2<f64>, Vector2<f64>)>,
        options: &FocalOptions,
    ) -> (DMatrix<f64>, DVector<f64>) {
        let knots = self.ln_focals.len();
        let (mut information, mut pull) = (DMatrix::zeros(knots, knots), DVector::zeros(knots));
        for (pair, h, g) in votes {
            let shares = self.shares(pair);
            information += shares.tr_mul(&(h * &shares));
            pull += shares.tr_mul(&g);
        }
        // Neighboring knots differ by `STEP_SIGMA` at a noise of a sixth of the threshold.
        let weight = (options.threshold / 6.0 / STEP_SIGMA).powi(2);
        for k in 1..knots {
            let difference = self.ln_focals[k] - self.ln_focals[k - 1];
            for (i, j, sign) in [(k, k, 1.0), (k - 1, k - 1, 1.0), (k, k - 1, -1.0), (k - 1, k, -1.0)] {
                information[(i, j)] += sign * weight;
            }
            pull[k] += weight * difference;
            pull[k - 1] -= weight * difference;
        }
        (information, pull)
    }

    fn stepped(&self, options: &FocalOptions, damping: f64) -> Option<Self> {
        let votes: Vec<Option<Vote>> =
            (0..self.pairs.len()).map(|k| self.vote(k, options.threshold, damping)).collect();
        let known =
            self.pairs.iter().zip(&votes).filter_map(|(p, v)| Some((p, v.as_ref()?.information, v.as_ref()?.pull)));
        let (mut information, pull) = self.equations(known, options);
        for k in 0..information.nrows() {
            information[(k, k)] *= 1.0 + damping;
        }
        let wanted = -information.cholesky()?.solve(&pull);
        let (low, high) = (options.range.0.ln(), options.range.1.ln());
        let shortened = (MAX_STEP / wanted.amax().max(f64::MIN_POSITIVE)).min(1.0);
        let ln_focals = (&self.ln_focals + wanted * shortened).map(|f| f.clamp(low, high));
        let change = &ln_focals - &self.ln_focals;
        let poses = self.poses.iter().zip(&votes).zip(&self.pairs).map(|((pose, vote), pair)| {
            let own: Vector2<f64> = self.shares(pair) * &change;
            vote.as_ref().map_or(*pose, |v| pose.moved(&-(v.inverse * (v.by_pose + v.coupling * own))))
        });
        let mut next =
            Self { pairs: self.pairs.clone(), poses: poses.collect(), ln_focals, lost: self.lost, energy: 0.0 };
        next.energy = next.total_energy(options.threshold);
        Some(next)
    }

    /// `ln f` at the knots and their covariance; pairs that disagree are down-weighted in a last step.
    fn estimate(&self, options: &FocalOptions) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let variance = self.variance(options.threshold);
        let votes: Vec<(&Pair<'_>, Vote)> = (0..self.pairs.len())
            .filter_map(|k| Some((&self.pairs[k], self.vote(k, options.threshold, 0.0)?)))
            .collect();
        let knots = self.ln_focals.len();
        let mut change = DVector::zeros(knots);
        let mut covariance = DMatrix::zeros(knots, knots);
        for _ in 0..ROUNDS {
            let weighed = votes.iter().map(|(pair, v)| {
                let own: Vector2<f64> = self.shares(pair) * &change;
                let pull = v.pull + v.information * own;
                let w = Self::voice(&pull, &v.information, variance);
                (*pair, v.information * w, pull * w)
            });
            let weighed: Vec<_> = weighed.collect();
            let spread = weighed.iter().fold(DMatrix::zeros(knots, knots), |sum: DMatrix<f64>, (pair, _, g)| {
                let own = self.shares(pair).tr_mul(g);
                sum + &own * own.transpose()
            });
            let mut here = self.clone();
            here.ln_focals += &change;
            let (information, pull) = here.equations(weighed.into_iter(), options);
            let inverse = information.clone().cholesky()?.inverse();
            // From noise alone, and from the disagreement of the pairs.
            covariance = &inverse * (information * variance + spread) * &inverse;
            change = (change - &inverse * pull).map(|c: f64| c.clamp(-MAX_STEP, MAX_STEP));
        }
        Some((&self.ln_focals + change, covariance))
    }
}

/// `1 − r²/T²`, at least 0.
fn slack(m: &Matrix3<f64>, c: &Correspondence, threshold: f64) -> f64 {
    (1.0 - sampson::squared_distance(m, c) / (threshold * threshold)).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::sfm::tests::synthetic_views::{TwoViews, random_pose};

    #[test]
    fn the_tangents_agree_with_central_differences() {
        let mut rng = fastrand::Rng::with_seed(3);
        let pose = EssentialChart::at(&random_pose(&mut rng, 1.0, 1.0));
        sampson::assert_tangents(&FocalChart { pose, ln_focals: [0.3, 0.1] });
    }

    /// Largest change of the focal length over a walk in which it changes by the factor `zoom`, and its standard deviation.
    fn change(zoom: f64, seed: u64) -> (f64, f64) {
        let mut rng = fastrand::Rng::with_seed(seed);
        let pairs: Vec<(Vec<Correspondence>, [f64; 2])> = (0..20)
            .map(|k| {
                let times = [f64::from(k) / 22.0, f64::from(k + 2) / 22.0];
                let [first, second] = times.map(|t| 0.9 * zoom.powf(t));
                let mut pose = random_pose(&mut rng, 0.2, 0.5);
                pose.translation.z -= 0.8;
                let views = TwoViews::general(pose, 150, &mut rng);
                let views = views.with_noise(0.3 / 640.0 / 0.9, &mut rng).with_outliers(0.1, &mut rng);
                let scaled = |c: &Correspondence| Correspondence::new(c.first.xy() * first, c.second.xy() * second);
                (views.correspondences.iter().map(scaled).collect(), times)
            })
            .collect();
        let pairs: Vec<Pair<'_>> = pairs.iter().map(|(matches, times)| Pair { matches, times: *times }).collect();
        let course = varying_focal(&pairs, 1.0, 4, &FocalOptions::for_width(1.0), &Run::default());
        course.expect("a run that never stops").expect("parallax").largest_change()
    }

    #[test]
    fn a_changing_focal_length_is_measured_within_its_uncertainty_and_a_constant_one_is_constant() {
        for (seed, zoom) in [(0, 1.0_f64), (1, 1.4), (2, 0.75), (3, 1.1), (4, 1.0)] {
            let (found, sigma) = change(zoom, seed);
            let wanted = 20.0 / 22.0 * zoom.ln();
            assert!((found - wanted).abs() < 0.03 && sigma < 0.03, "seed {seed}: {found} ± {sigma} for {wanted}");
        }
    }
}
