//! Estimation of one focal length common to many image pairs.
//!
//! Image coordinates are relative to the principal point, in any unit, which is also that of `f`. The model of pair
//! `k` is `Fₖ = K⁻¹ [tₖ]× Rₖ K⁻¹`, `K = diag(f, f, 1)`, and the estimate is
//!
//! ```text
//! min  Σₖ Σᵢ ρ(rᵢ(Fₖ)²)      over all poses (Rₖ, tₖ) and one ln f,
//! ```
//!
//! with `r` the Sampson distance in the image, where the noise does not depend on `f`. The poses are eliminated pair
//! by pair (Schur complement): a pair contributes to the equation for `ln f` its information `hₖ` and its gradient
//! `gₖ`,
//!
//! ```text
//! hₖ = c − bᵀ A⁻¹ b,   gₖ = γ − bᵀ A⁻¹ a,      [A b; bᵀ c] and (a, γ) its normal equations for (pose, ln f).
//! ```
//!
//! A pair whose gradient deviates by more than its noise explains is down-weighted (Cauchy). The initial guess is the
//! focal length for which the fundamental matrices are closest to essential ([`super::view_graph_focal()`]).
//!
//! Two further initial guesses were tried, with the lowest energy selecting the result: a sweep of focal lengths over
//! essential matrices, and the median of closed forms. Of 46 clips and synthetic shots they changed four visibly,
//! three for the worse and none for the better: where pairs hardly determine the focal length, the lowest energy is
//! far from the truth (`docs/ABLATIONS.md`).
//!
//! The standard deviation is the larger of that from noise alone, `σ/√Σhₖ`, and that from the disagreement of the
//! pairs (sandwich estimator), `√Σgₖ² / Σhₖ`.
//!
//! # Reference
//! Hartley, Zisserman, *Multiple View Geometry*, 2nd ed., sections 11.4.3 and A6.3; P. Huber, *Robust statistics*, 1981,
//! section 6.3 (the second estimate).

use nalgebra::{Matrix3, SMatrix, SVector};

use super::correspondence::Correspondence;
use super::epipolar::EpipolarFamily;
use super::essential::{ByEssential, EssentialChart};
use super::fundamental::ByFundamental;
use super::robust_search::robust_search;
use super::sampson::{self, Chart};
use super::view_graph_focal::view_graph_focal;
use plumbline_camera::Vec3;
use plumbline_num::optim::ransac::MsacOptions;
use plumbline_num::run::{Run, Stopped};

/// Maximum number of damped Gauss–Newton steps of the joint refinement; it ends earlier if no step decreases the
/// energy.
const MAX_STEPS: usize = 30;

/// Minimum number of correspondences of a pair that is used: nine more than a fundamental matrix has parameters.
const MIN_CORRESPONDENCES: usize = 16;

/// Maximum change of `ln f` in one step: at a larger change the linearized poses no longer follow.
const MAX_STEP: f64 = 0.15;

/// Normalized gradient of a pair, in standard deviations, at which its Cauchy weight is one half: noise alone
/// exceeds three standard deviations once in 370.
const PAIR_SCALE: f64 = 3.0;

/// Settings of [`estimate_focal`], in the unit of the image coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FocalOptions {
    /// Residual at which a correspondence is an outlier, > 0.
    pub threshold: f64,
    /// Minimum and maximum focal length.
    pub range: (f64, f64),
}

impl FocalOptions {
    /// Range 0.4 to 4 widths, from fisheyes to telephoto lenses, and an outlier threshold of two pixels at 640, for a
    /// frame `width` units wide.
    pub fn for_width(width: f64) -> Self {
        Self { threshold: 2.0 / 640.0 * width, range: (0.4 * width, 4.0 * width) }
    }
}

/// A focal length and its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FocalEstimate {
    /// `f`, in the unit of the image coordinates.
    pub focal: f64,
    /// Standard deviation of `ln f`.
    pub sigma_ln: f64,
    /// Number of pairs used.
    pub pairs: usize,
}

/// Estimates the focal length from image pairs with parallax, each a list of correspondences.
///
/// `None` if no pair has enough correspondences or none determines the focal length.
///
/// # Errors
/// [`Stopped`].
pub fn estimate_focal(
    pairs: &[Vec<Correspondence>],
    options: &FocalOptions,
    run: &Run,
) -> Result<Option<FocalEstimate>, Stopped> {
    run.complete(estimated(pairs, options, run))
}

/// The estimate; unspecified if the run was interrupted.
fn estimated(pairs: &[Vec<Correspondence>], options: &FocalOptions, run: &Run) -> Option<FocalEstimate> {
    let usable: Vec<&[Correspondence]> =
        pairs.iter().map(Vec::as_slice).filter(|p| p.len() >= MIN_CORRESPONDENCES).collect();
    let found: Vec<_> = usable.iter().filter_map(|p| Some((*p, fundamental(p, options, run)?))).collect();
    let matrices: Vec<Matrix3<f64>> = found.iter().map(|(_, m)| *m).collect();
    let initial = view_graph_focal(&matrices, options.range)?;
    let usable: Vec<&[Correspondence]> = found.iter().map(|(p, _)| *p).collect();
    Joint::new(&usable, initial, options, run)?.refined(options).estimate(options)
}

/// The fundamental matrix of a pair, by robust search in coordinates scaled to about 1.
fn fundamental(pair: &[Correspondence], options: &FocalOptions, run: &Run) -> Option<Matrix3<f64>> {
    let unit = (options.range.0 * options.range.1).sqrt();
    let scaled: Vec<Correspondence> = pair.iter().map(|c| c.scaled(1.0 / unit)).collect();
    let settings = search_settings(options.threshold / unit, 1000);
    let found = robust_search(&ByFundamental::of(&scaled), &settings, None, 0, run).ok()??;
    let k = Matrix3::from_diagonal(&Vec3::new(1.0 / unit, 1.0 / unit, 1.0));
    Some(k * found.model * k)
}

/// The essential matrix of a pair at an assumed focal length, by robust search.
fn essential(pair: &[Correspondence], focal: f64, options: &FocalOptions, run: &Run) -> Option<Matrix3<f64>> {
    let rays: Vec<Correspondence> = pair.iter().map(|c| c.scaled(1.0 / focal)).collect();
    let settings = search_settings(options.threshold / focal, 200);
    Some(robust_search(&ByEssential::of(&rays), &settings, None, 0, run).ok()??.model)
}

fn search_settings(threshold: f64, max_samples: usize) -> MsacOptions {
    MsacOptions { threshold, min_samples: 30, max_samples, local_steps: 4 }
}

/// `K⁻¹ [t]× R K⁻¹` with coordinates `(ω, a, b, δ ln f)`.
#[derive(Clone, Copy, Debug)]
struct FocalChart {
    pose: EssentialChart,
    ln_focal: f64,
}

impl FocalChart {
    fn inverse_k(&self) -> Matrix3<f64> {
        let inverse = (-self.ln_focal).exp();
        Matrix3::from_diagonal(&Vec3::new(inverse, inverse, 1.0))
    }
}

impl Chart<6> for FocalChart {
    fn matrix(&self) -> Matrix3<f64> {
        self.inverse_k() * self.pose.matrix() * self.inverse_k()
    }

    fn tangents(&self) -> [Matrix3<f64>; 6] {
        let (k, f) = (self.inverse_k(), self.matrix());
        let flat = Matrix3::from_diagonal(&Vec3::new(1.0, 1.0, 0.0));
        let [a, b, c, d, e] = self.pose.tangents().map(|t| k * t * k);
        [a, b, c, d, e, -(flat * f + f * flat)]
    }

    fn moved(&self, step: &SVector<f64, 6>) -> Self {
        Self { pose: self.pose.moved(&step.fixed_rows::<5>(0).into_owned()), ln_focal: self.ln_focal + step[5] }
    }
}

/// Poses of all pairs under one focal length.
struct Joint<'a> {
    pairs: Vec<&'a [Correspondence]>,
    poses: Vec<EssentialChart>,
    ln_focal: f64,
    energy: f64,
}

/// Contribution of one pair to the equation for `ln f`, its pose eliminated.
struct Vote {
    inverse: SMatrix<f64, 5, 5>,
    by_pose: SVector<f64, 5>,
    coupling: SVector<f64, 5>,
    information: f64,
    pull: f64,
}

impl<'a> Joint<'a> {
    fn new(pairs: &[&'a [Correspondence]], focal: f64, options: &FocalOptions, run: &Run) -> Option<Self> {
        let mut joint = Self { pairs: Vec::new(), poses: Vec::new(), ln_focal: focal.ln(), energy: 0.0 };
        for pair in pairs {
            if let Some(pose) = essential(pair, focal, options, run).and_then(|m| EssentialChart::of_matrix(&m)) {
                joint.pairs.push(pair);
                joint.poses.push(pose);
            }
        }
        joint.energy = joint.total_energy(options.threshold);
        (!joint.pairs.is_empty()).then_some(joint)
    }

    fn chart(&self, k: usize) -> FocalChart {
        FocalChart { pose: self.poses[k], ln_focal: self.ln_focal }
    }

    /// `Σ ρ(r²)` with `ρ′ = (1 − r²/T²)²`, divided by `T²/3`.
    fn total_energy(&self, threshold: f64) -> f64 {
        let of_pair = |k: usize| {
            let m = self.chart(k).matrix();
            self.pairs[k].iter().map(|c| 1.0 - slack(&m, c, threshold).powi(3)).sum::<f64>()
        };
        (0..self.pairs.len()).map(of_pair).sum()
    }

    fn vote(&self, k: usize, threshold: f64, damping: f64) -> Option<Vote> {
        let chart = self.chart(k);
        let m = chart.matrix();
        let weights: Vec<f64> = self.pairs[k].iter().map(|c| slack(&m, c, threshold).powi(2)).collect();
        let sum = sampson::normal_equations(&chart, self.pairs[k], &weights);
        let mut a = sum.normal.fixed_view::<5, 5>(0, 0).into_owned();
        for i in 0..5 {
            a[(i, i)] *= 1.0 + damping;
        }
        let inverse = a.cholesky()?.inverse();
        let coupling = sum.normal.fixed_view::<5, 1>(0, 5).into_owned();
        let by_pose = sum.gradient.fixed_rows::<5>(0).into_owned();
        let reduced = inverse * coupling;
        let information = (sum.normal[(5, 5)] - coupling.dot(&reduced)).max(0.0);
        Some(Vote { inverse, by_pose, coupling, information, pull: sum.gradient[5] - by_pose.dot(&reduced) })
    }

    /// Variance of one residual, from the correspondences within the threshold.
    fn variance(&self, threshold: f64) -> f64 {
        let (mut count, mut sum) = (0.0, 0.0);
        for (k, pair) in self.pairs.iter().enumerate() {
            let m = self.chart(k).matrix();
            for c in *pair {
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
    fn voice(vote: &Vote, variance: f64) -> f64 {
        let squared = vote.pull * vote.pull / (vote.information * variance).max(f64::MIN_POSITIVE);
        1.0 / (1.0 + squared / (PAIR_SCALE * PAIR_SCALE))
    }

    fn refined(mut self, options: &FocalOptions) -> Self {
        let mut damping = 1e-4;
        for _ in 0..MAX_STEPS {
            let next = self.stepped(options, damping);
            if next.energy < self.energy {
                let settled = self.energy - next.energy <= 1e-12 * self.energy;
                (self, damping) = (next, damping * 0.1);
                if settled {
                    break;
                }
            } else {
                damping *= 10.0;
                if damping > 1e6 {
                    break;
                }
            }
        }
        self
    }

    fn stepped(&self, options: &FocalOptions, damping: f64) -> Self {
        let votes: Vec<Option<Vote>> =
            (0..self.pairs.len()).map(|k| self.vote(k, options.threshold, damping)).collect();
        let (pull, information) = votes.iter().flatten().fold((0.0, 0.0), |(g, h), v| (g + v.pull, h + v.information));
        let wanted = -pull / (information * (1.0 + damping)).max(f64::MIN_POSITIVE);
        let (low, high) = (options.range.0.ln(), options.range.1.ln());
        let ln_focal = (self.ln_focal + wanted.clamp(-MAX_STEP, MAX_STEP)).clamp(low, high);
        let change = ln_focal - self.ln_focal;
        let poses = self.poses.iter().zip(&votes).map(|(pose, vote)| {
            vote.as_ref().map_or(*pose, |v| pose.moved(&-(v.inverse * (v.by_pose + v.coupling * change))))
        });
        let mut next = Self { pairs: self.pairs.clone(), poses: poses.collect(), ln_focal, energy: 0.0 };
        next.energy = next.total_energy(options.threshold);
        next
    }

    /// The estimate with its standard deviation; pairs that disagree are down-weighted in a last step.
    fn estimate(&self, options: &FocalOptions) -> Option<FocalEstimate> {
        let variance = self.variance(options.threshold);
        let votes: Vec<Vote> = (0..self.pairs.len()).filter_map(|k| self.vote(k, options.threshold, 0.0)).collect();
        let mut change = 0.0;
        let (mut information, mut spread) = (0.0, 0.0);
        for _ in 0..20 {
            (information, spread) = (0.0, 0.0);
            let mut pull = 0.0;
            for v in &votes {
                let here = Vote { pull: v.pull + v.information * change, inverse: v.inverse, ..*v };
                let w = Self::voice(&here, variance);
                information += w * v.information;
                pull += w * here.pull;
                spread += (w * here.pull).powi(2);
            }
            if !(information > 0.0) {
                return None;
            }
            change = (change - pull / information).clamp(-MAX_STEP, MAX_STEP);
        }
        let sigma_ln = (variance / information).sqrt().max(spread.sqrt() / information);
        let focal = (self.ln_focal + change).exp().clamp(options.range.0, options.range.1);
        Some(FocalEstimate { focal, sigma_ln, pairs: self.pairs.len() })
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

    /// Pairs of a camera of focal length `f` widths with noise of 0.3 px at 640 and 10 % outliers.
    fn walk(f: f64, count: usize, seed: u64) -> Vec<Vec<Correspondence>> {
        let mut rng = fastrand::Rng::with_seed(seed);
        let pair = |_| {
            let mut pose = random_pose(&mut rng, 0.2, 0.5);
            pose.translation.z -= 0.8;
            let views = TwoViews::general(pose, 150, &mut rng);
            let views = views.with_noise(0.3 / 640.0 / f, &mut rng).with_outliers(0.1, &mut rng);
            views.correspondences.iter().map(|c| c.scaled(f)).collect()
        };
        (0..count).map(pair).collect()
    }

    #[test]
    fn the_tangents_agree_with_central_differences() {
        let mut rng = fastrand::Rng::with_seed(3);
        let pose = EssentialChart::at(&random_pose(&mut rng, 1.0, 1.0));
        sampson::assert_tangents(&FocalChart { pose, ln_focal: 0.3 });
    }

    #[test]
    fn a_noisy_walk_gives_its_focal_length_within_three_percent_and_within_its_uncertainty() {
        for (seed, f) in [(0, 0.7), (1, 0.9), (2, 0.9), (3, 1.5), (4, 1.1)] {
            let found = estimate_focal(&walk(f, 10, seed), &FocalOptions::for_width(1.0), &Run::default())
                .expect("a run that never stops")
                .expect("parallax");
            let error = (found.focal / f).ln();
            assert!(error.abs() < 0.03, "seed {seed}: {found:?}");
            assert!(error.abs() < 4.0 * found.sigma_ln && found.sigma_ln < 0.03, "seed {seed}: {found:?}");
        }
    }

    #[test]
    fn pairs_of_another_lens_are_outvoted() {
        let mut pairs = walk(0.9, 9, 5);
        pairs.extend(walk(1.6, 2, 6));
        let found = estimate_focal(&pairs, &FocalOptions::for_width(1.0), &Run::default())
            .expect("a run that never stops")
            .expect("parallax");
        assert!((found.focal / 0.9).ln().abs() < 0.05, "{found:?}");
    }

    #[test]
    fn without_correspondences_there_is_no_estimate() {
        assert!(
            estimate_focal(&[], &FocalOptions::for_width(1.0), &Run::default())
                .expect("a run that never stops")
                .is_none()
        );
        assert!(
            estimate_focal(&[Vec::new()], &FocalOptions::for_width(1.0), &Run::default())
                .expect("a run that never stops")
                .is_none()
        );
    }
}
