//! Two-view geometry and its classification: general motion, planar scene, pure rotation, or degenerate.
//!
//! Four models are fitted to the pairs, each by robust search: a homography `H`, the homography of a rotating camera
//! `K R K⁻¹` with unknown focal length ([`super::fit_conjugate_rotation`]), an essential matrix `E` at the assumed
//! focal length and a fundamental matrix `F`. The noise `σ` is estimated from the residuals of `F`, the most general
//! model, and [`super::gric`] selects the model:
//!
//! | lowest score | verdict |
//! | --- | --- |
//! | `E` or `F` | [`TwoViewVerdict::General`] |
//! | `H` | [`TwoViewVerdict::Planar`] |
//! | `K R K⁻¹` | [`TwoViewVerdict::RotationOnly`] |
//!
//! An essential matrix fits a rotating camera as well as any other model, with a spurious translation: a low residual
//! does not prove motion. The rotation model with unknown focal length prevents a spurious translation caused by a
//! wrong focal length. As a second test, a minimum fraction of the pairs must have a residual under the rotation
//! larger than their noise explains.

use nalgebra::Matrix3;

use super::correspondence::Correspondence;
use super::essential::{ByEssential, EssentialChart};
use super::essential_pose::{pose_of_essential, ray_angle};
use super::fundamental::ByFundamental;
use super::gric::{ModelSize, gric};
use super::homography_poses::{calibrated_homography, visible_planar_poses};
use super::homography_search::ByPlane;
use super::robust_search::robust_search;
use super::rotation_fit::{ConjugateRotation, conjugate_rotation, fit_conjugate_rotation, homography_squared_distance};
use super::sampson;
use plumbline_camera::{CameraPose, Vec3};
use plumbline_num::math::median;
use plumbline_num::optim::ransac::{Consensus, MsacOptions};
use plumbline_num::run::{Run, Stopped};

/// Steps of the final refinement of the essential matrix.
const FINAL_STEPS: usize = 20;

/// Minimum fraction of the pairs that the selected model must explain: at this fraction 500 samples of five contain one of
/// inliers only with a probability of 70 %, and the search becomes a matter of chance.
const MIN_SUPPORT: f64 = 0.3;

/// Minimum fraction of the pairs whose residual under the rotation exceeds three times the noise, for a translation to
/// be accepted. Noise alone gives 1 in 10 000, and 1 in 300 if it is underestimated by a fifth; a baseline visible in
/// fewer pairs is too short to be of use.
const MIN_PARALLAX_RATIO: f64 = 0.03;

/// Settings of [`two_view`]; lengths in normalized image coordinates (px divided by the assumed focal length).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoViewOptions {
    /// Residual at which a pair is an outlier, > 0.
    pub threshold: f64,
    /// Minimum noise, > 0: with exact data any parallax, however small, would be significant.
    pub min_noise: f64,
    /// Maximum ratio of the true to the assumed focal length or its inverse, ≥ 1, in the rotation model.
    pub max_focal_ratio: f64,
    /// Minimum number of pairs, and of inliers of a model.
    pub min_pairs: usize,
}

impl TwoViewOptions {
    /// Outlier threshold of two pixels and minimum noise of a twentieth of a pixel, at an assumed focal length, px,
    /// that may be wrong by a factor of 1.8.
    pub fn for_focal(focal_px: f64) -> Self {
        Self { threshold: 2.0 / focal_px, min_noise: 0.05 / focal_px, max_focal_ratio: 1.8, min_pairs: 24 }
    }
}

/// Camera motion between two frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TwoViewVerdict {
    /// General motion, and the scene has depth.
    General,
    /// Motion in front of a plane, or of a scene too flat to distinguish.
    Planar,
    /// Pure rotation, or no motion: the pairs show no parallax.
    RotationOnly,
    /// Too few pairs, or no model explains enough of them.
    Degenerate,
}

/// Scores of the models, all under one noise; infinite if a model was not found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoViewScores {
    /// Essential matrix.
    pub essential: f64,
    /// Fundamental matrix.
    pub fundamental: f64,
    /// Homography.
    pub homography: f64,
    /// Rotating camera.
    pub rotation: f64,
}

/// Two-view geometry of a pair.
#[derive(Clone, Debug)]
pub struct TwoView {
    /// Camera motion.
    pub verdict: TwoViewVerdict,
    /// `second_from_first`, best first, with a translation of length 1 (`General`), in units of the plane's distance
    /// (one or two, `Planar`) or zero (`RotationOnly`); empty for `Degenerate`.
    pub poses: Vec<CameraPose>,
    /// By pair: whether the selected model explains it.
    pub inliers: Vec<bool>,
    /// Median angle between the two rays of an inlier under the first pose, rad; 0 without a pose.
    pub median_angle: f64,
    /// Noise per coordinate, normalized image coordinates.
    pub noise: f64,
    /// The best rotation of the camera; `None` if none was found.
    pub rotation: Option<ConjugateRotation>,
    /// Scores of all models.
    pub scores: TwoViewScores,
}

/// Classifies the pairs of two frames, given in image coordinates normalized by an assumed focal length.
///
/// # Errors
/// [`Stopped`].
pub fn two_view(pairs: &[Correspondence], options: &TwoViewOptions, run: &Run) -> Result<TwoView, Stopped> {
    if pairs.len() < options.min_pairs {
        return Ok(TwoView::degenerate(pairs.len()));
    }
    let fits = Fits::new(pairs, options, run)?;
    let noise = fits.noise(pairs, options);
    let scores = fits.scores(pairs, noise);
    let epipolar = scores.essential.min(scores.fundamental);
    let flat = scores.homography.min(scores.rotation);
    let verdict = if !epipolar.min(flat).is_finite() {
        TwoViewVerdict::Degenerate
    } else if epipolar < flat && fits.parallax_ratio(pairs, options, noise) >= MIN_PARALLAX_RATIO {
        TwoViewVerdict::General
    } else if scores.homography < scores.rotation {
        TwoViewVerdict::Planar
    } else {
        TwoViewVerdict::RotationOnly
    };
    Ok(fits.view(verdict, pairs, options, noise, scores))
}

impl TwoView {
    fn degenerate(pairs: usize) -> Self {
        let none = f64::INFINITY;
        Self {
            verdict: TwoViewVerdict::Degenerate,
            poses: Vec::new(),
            inliers: vec![false; pairs],
            median_angle: 0.0,
            noise: 0.0,
            rotation: None,
            scores: TwoViewScores { essential: none, fundamental: none, homography: none, rotation: none },
        }
    }
}

/// The fitted models, each `None` if its search failed.
struct Fits {
    essential: Option<Matrix3<f64>>,
    fundamental: Option<Matrix3<f64>>,
    homography: Option<Matrix3<f64>>,
    /// With the number of its parameters: three at the assumed focal length, four if another focal length is better.
    rotation: Option<(ConjugateRotation, u32)>,
}

impl Fits {
    fn new(pairs: &[Correspondence], options: &TwoViewOptions, run: &Run) -> Result<Self, Stopped> {
        let homography = search(&ByPlane(pairs), options, 500, run)?;
        let rotation = best_rotation(homography.as_ref(), pairs, options);
        Ok(Self {
            essential: search(&ByEssential::of(pairs), options, 500, run)?,
            fundamental: search(&ByFundamental::of(pairs), options, 1000, run)?,
            homography,
            rotation,
        })
    }

    /// Standard deviation per coordinate, from the inliers of the most general model: the median first, then the root
    /// mean square within three times that.
    fn noise(&self, pairs: &[Correspondence], options: &TwoViewOptions) -> f64 {
        let Some(model) = self.fundamental.or(self.essential) else { return options.min_noise };
        let mut squared: Vec<f64> = pairs.iter().map(|p| sampson::squared_distance(&model, p)).collect();
        squared.retain(|r| *r < options.threshold * options.threshold);
        if squared.len() < 8 {
            return options.min_noise;
        }
        squared.sort_by(f64::total_cmp);
        // The median of |r| of a normal variable is 0.6745 standard deviations.
        let rough = squared[squared.len() / 2] / (0.6745 * 0.6745);
        let near = squared.iter().take_while(|r| **r <= 9.0 * rough);
        let (count, sum) = near.fold((0.0, 0.0), |(n, s), r| (n + 1.0, s + r));
        let freedom = f64::max(count - 7.0, 1.0);
        (sum / freedom).sqrt().max(options.min_noise)
    }

    fn scores(&self, pairs: &[Correspondence], noise: f64) -> TwoViewScores {
        let score = |model: Option<Matrix3<f64>>, distance: fn(&Matrix3<f64>, &Correspondence) -> f64, size| {
            model.map_or(f64::INFINITY, |m| gric(pairs.iter().map(|p| distance(&m, p)), noise, size))
        };
        let rotation = self.rotation.map(|(t, _)| t.homography());
        let rotation_size = ModelSize { parameters: self.rotation.map_or(4, |(_, k)| k), ..ModelSize::ROTATION };
        TwoViewScores {
            essential: score(self.essential, sampson::squared_distance, ModelSize::ESSENTIAL),
            fundamental: score(self.fundamental, sampson::squared_distance, ModelSize::FUNDAMENTAL),
            homography: score(self.homography, homography_squared_distance, ModelSize::HOMOGRAPHY),
            rotation: score(rotation, homography_squared_distance, rotation_size),
        }
    }

    /// Fraction of the pairs within the epipolar threshold whose residual under the rotation exceeds three times the
    /// noise.
    fn parallax_ratio(&self, pairs: &[Correspondence], options: &TwoViewOptions, noise: f64) -> f64 {
        let Some(rotation) = self.rotation.map(|(t, _)| t.homography()) else { return 1.0 };
        let limit = options.threshold * options.threshold;
        let explained = |p: &Correspondence| {
            let by = |m: Option<Matrix3<f64>>| m.is_some_and(|m| sampson::squared_distance(&m, p) < limit);
            by(self.essential) || by(self.fundamental)
        };
        let (mut count, mut moved) = (0.0_f64, 0.0);
        for pair in pairs.iter().filter(|p| explained(p)) {
            count += 1.0;
            // r² under a rotation has two degrees of freedom, the noise is that of a single coordinate.
            moved += f64::from(homography_squared_distance(&rotation, pair) > 2.0 * 9.0 * noise * noise);
        }
        moved / count.max(1.0)
    }

    /// Squared residual of a pair under the model of a verdict.
    fn explains(&self, verdict: TwoViewVerdict, scores: &TwoViewScores, pair: &Correspondence) -> f64 {
        let far = f64::INFINITY;
        match verdict {
            TwoViewVerdict::General => {
                let model = if scores.essential <= scores.fundamental { self.essential } else { self.fundamental };
                model.map_or(far, |m| sampson::squared_distance(&m, pair))
            }
            TwoViewVerdict::Planar => self.homography.map_or(far, |h| homography_squared_distance(&h, pair)),
            TwoViewVerdict::RotationOnly => {
                self.rotation.map_or(far, |(t, _)| homography_squared_distance(&t.homography(), pair))
            }
            TwoViewVerdict::Degenerate => far,
        }
    }

    fn view(
        &self,
        verdict: TwoViewVerdict,
        pairs: &[Correspondence],
        options: &TwoViewOptions,
        noise: f64,
        scores: TwoViewScores,
    ) -> TwoView {
        let limit = options.threshold * options.threshold;
        let inliers: Vec<bool> = pairs.iter().map(|p| self.explains(verdict, &scores, p) < limit).collect();
        let count = inliers.iter().filter(|i| **i).count();
        let poses = self.poses(verdict, pairs, &inliers, options);
        if count < options.min_pairs || (count as f64) < MIN_SUPPORT * pairs.len() as f64 || poses.is_empty() {
            return TwoView { noise, scores, ..TwoView::degenerate(pairs.len()) };
        }
        let rotation = self.rotation.map(|(t, _)| t);
        let median_angle = median_angle(&poses[0], pairs, &inliers);
        TwoView { verdict, poses, inliers, median_angle, noise, rotation, scores }
    }

    fn poses(
        &self,
        verdict: TwoViewVerdict,
        pairs: &[Correspondence],
        inliers: &[bool],
        options: &TwoViewOptions,
    ) -> Vec<CameraPose> {
        match verdict {
            TwoViewVerdict::General => {
                self.essential.and_then(|e| moving_pose(&e, pairs, options)).into_iter().collect()
            }
            TwoViewVerdict::Planar => {
                let h = self.homography.and_then(|h| calibrated_homography(&h, pairs, inliers));
                h.map_or_else(Vec::new, |h| {
                    visible_planar_poses(&h, pairs, inliers).into_iter().map(|p| p.pose).collect()
                })
            }
            TwoViewVerdict::RotationOnly => {
                let still =
                    |(t, _): (ConjugateRotation, u32)| CameraPose { rotation: t.rotation, translation: Vec3::zeros() };
                self.rotation.map(still).into_iter().collect()
            }
            TwoViewVerdict::Degenerate => Vec::new(),
        }
    }
}

fn search<P: Consensus>(
    family: &P,
    options: &TwoViewOptions,
    max_samples: usize,
    run: &Run,
) -> Result<Option<P::Model>, Stopped> {
    let settings = MsacOptions { threshold: options.threshold, min_samples: 40, max_samples, local_steps: 4 };
    Ok(robust_search(family, &settings, None, 0, run)?.map(|s| s.model))
}

/// The better of the rotations at the assumed and at a free focal length, selected by GRIC at a noise of half a
/// threshold.
fn best_rotation(
    h: Option<&Matrix3<f64>>,
    pairs: &[Correspondence],
    options: &TwoViewOptions,
) -> Option<(ConjugateRotation, u32)> {
    let fixed_initial = conjugate_rotation(h?, 1.0)?.0;
    let free_initial = conjugate_rotation(h?, options.max_focal_ratio)?.0;
    let free = fit_conjugate_rotation(free_initial, pairs, options.threshold, options.max_focal_ratio);
    let fixed = fit_conjugate_rotation(fixed_initial, pairs, options.threshold, 1.0);
    let score = |rotation: &ConjugateRotation, parameters| {
        let h = rotation.homography();
        let size = ModelSize { parameters, ..ModelSize::ROTATION };
        gric(pairs.iter().map(|p| homography_squared_distance(&h, p)), 0.25 * options.threshold, size)
    };
    Some(if score(&fixed, 3) <= score(&free, 4) { (fixed, 3) } else { (free, 4) })
}

/// The pose of `e` refined on the pairs within the threshold, with smooth weights so that no pair enters abruptly.
fn moving_pose(e: &Matrix3<f64>, pairs: &[Correspondence], options: &TwoViewOptions) -> Option<CameraPose> {
    let limit = options.threshold * options.threshold;
    let slack: Vec<f64> = pairs.iter().map(|p| (1.0 - sampson::squared_distance(e, p) / limit).max(0.0)).collect();
    let weights: Vec<f64> = slack.iter().map(|s| s * s).collect();
    let inliers: Vec<bool> = slack.iter().map(|s| *s > 0.0).collect();
    let (pose, _) = pose_of_essential(e, pairs, &inliers)?;
    Some(sampson::refined(EssentialChart::at(&pose), pairs, &weights, FINAL_STEPS).pose())
}

fn median_angle(pose: &CameraPose, pairs: &[Correspondence], inliers: &[bool]) -> f64 {
    let counted = pairs.iter().zip(inliers).filter(|(_, i)| **i);
    let mut angles: Vec<f64> = counted.map(|(p, _)| ray_angle(pose, p)).collect();
    median(&mut angles).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;
    use crate::motion::sfm::tests::synthetic_views::{
        TwoViews, direction_error, random_pose, random_unit, rotation_error,
    };

    const FOCAL: f64 = 576.0;

    /// Pairs with noise of 0.3 px and 10 % outliers, in coordinates of a focal length assumed `ratio` times too short.
    fn noisy(views: TwoViews, ratio: f64, rng: &mut fastrand::Rng) -> Vec<Correspondence> {
        let views = views.with_noise(0.3 / FOCAL, rng).with_outliers(0.1, rng);
        views.correspondences.iter().map(|c| c.scaled(ratio)).collect()
    }

    #[test]
    fn a_rotating_camera_is_recognized_at_any_assumed_focal_length() {
        for ratio in [0.6, 1.0 / 1.4, 1.0, 1.4, 1.0 / 0.6] {
            for seed in 0..10 {
                let mut rng = fastrand::Rng::with_seed(seed);
                let angle = [0.002, 0.02, 0.1, 0.2, 0.5][seed as usize % 5];
                let rotation = UnitQuaternion::from_scaled_axis(random_unit(&mut rng) * angle);
                let views = TwoViews::general(CameraPose { rotation, translation: Vec3::zeros() }, 250, &mut rng);
                let pairs = noisy(views, ratio, &mut rng);
                let found = two_view(&pairs, &TwoViewOptions::for_focal(FOCAL / ratio), &Run::default())
                    .expect("a run that never stops");
                assert_eq!(found.verdict, TwoViewVerdict::RotationOnly, "{ratio} {seed}: {:?}", found.scores);
                assert_eq!(found.poses[0].translation, Vec3::zeros());
                let error = found.poses[0].rotation.angle_to(&rotation);
                assert!(ratio != 1.0 || error < 0.1_f64.to_radians(), "seed {seed}: {}", error.to_degrees());
            }
        }
    }

    #[test]
    fn a_camera_moving_through_depth_is_general_and_its_pose_is_found() {
        for seed in 0..10 {
            let mut rng = fastrand::Rng::with_seed(seed);
            let pose = random_pose(&mut rng, 0.15, 0.5);
            let pairs = noisy(TwoViews::general(pose, 250, &mut rng), 1.0, &mut rng);
            let found =
                two_view(&pairs, &TwoViewOptions::for_focal(FOCAL), &Run::default()).expect("a run that never stops");
            assert_eq!(found.verdict, TwoViewVerdict::General, "seed {seed}: {:?}", found.scores);
            assert!(rotation_error(&found.poses[0], &pose) < 0.3_f64.to_radians(), "seed {seed}");
            assert!(direction_error(&found.poses[0], &pose) < 4.0_f64.to_radians(), "seed {seed}");
            assert!(found.median_angle > 0.01, "seed {seed}");
            assert!((found.noise * FOCAL - 0.3).abs() < 0.06, "seed {seed}: {}", found.noise * FOCAL);
        }
    }

    #[test]
    fn depth_is_recognized_at_a_wrong_focal_length() {
        for ratio in [0.7, 1.4] {
            let mut rng = fastrand::Rng::with_seed(3);
            let pairs = noisy(TwoViews::general(random_pose(&mut rng, 0.15, 0.7), 250, &mut rng), ratio, &mut rng);
            let found = two_view(&pairs, &TwoViewOptions::for_focal(FOCAL / ratio), &Run::default())
                .expect("a run that never stops");
            assert_eq!(found.verdict, TwoViewVerdict::General, "{ratio}: {:?}", found.scores);
        }
    }

    #[test]
    fn a_plane_is_recognized_and_a_candidate_is_the_pose() {
        for seed in 0..10 {
            let mut rng = fastrand::Rng::with_seed(seed);
            let pose = random_pose(&mut rng, 0.15, 1.0);
            let pairs = noisy(TwoViews::planar(pose, 250, &mut rng), 1.0, &mut rng);
            let found =
                two_view(&pairs, &TwoViewOptions::for_focal(FOCAL), &Run::default()).expect("a run that never stops");
            assert_eq!(found.verdict, TwoViewVerdict::Planar, "seed {seed}: {:?}", found.scores);
            let right = |p: &CameraPose| {
                rotation_error(p, &pose) < 1.0_f64.to_radians() && direction_error(p, &pose) < 8.0_f64.to_radians()
            };
            assert!(found.poses.iter().any(right), "seed {seed}: {:?} for {pose:?}", found.poses);
        }
    }

    #[test]
    fn noise_few_pairs_and_a_still_camera_give_no_translation() {
        let mut rng = fastrand::Rng::with_seed(4);
        let views = TwoViews::general(random_pose(&mut rng, 0.1, 1.0), 100, &mut rng);
        let scattered = views.clone().with_outliers(1.0, &mut rng);
        let options = TwoViewOptions::for_focal(FOCAL);
        assert_eq!(
            two_view(&scattered.correspondences, &options, &Run::default()).expect("a run that never stops").verdict,
            TwoViewVerdict::Degenerate
        );
        assert_eq!(
            two_view(&views.correspondences[..20], &options, &Run::default()).expect("a run that never stops").verdict,
            TwoViewVerdict::Degenerate
        );
        assert_eq!(
            two_view(&[], &options, &Run::default()).expect("a run that never stops").verdict,
            TwoViewVerdict::Degenerate
        );
        let still: Vec<_> = views.correspondences.iter().map(|c| Correspondence { second: c.first, ..*c }).collect();
        let found = two_view(&still, &options, &Run::default()).expect("a run that never stops");
        assert_eq!(found.verdict, TwoViewVerdict::RotationOnly);
        assert!(found.poses[0].rotation.angle() < 1e-6);
    }

    #[test]
    fn the_same_seed_gives_the_same_answer() {
        let mut rng = fastrand::Rng::with_seed(5);
        let pairs = noisy(TwoViews::general(random_pose(&mut rng, 0.15, 0.5), 100, &mut rng), 1.0, &mut rng);
        let run =
            || two_view(&pairs, &TwoViewOptions::for_focal(FOCAL), &Run::default()).expect("a run that never stops");
        assert_eq!(run().poses, run().poses);
    }
}
