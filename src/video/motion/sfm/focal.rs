//! Estimation of one focal length common to many image pairs.
//!
//! The fundamental matrices of the pairs give an initial guess, the focal length for which they are closest to essential
//! ([`super::view_graph_focal()`]); all poses and the focal length are then refined together (`varying_focal.rs`, with one knot).
//!
//! Two further initial guesses were tried, with the lowest energy selecting the result: a sweep of focal lengths over
//! essential matrices, and the median of closed forms. Of 46 clips and synthetic shots they changed four visibly,
//! three for the worse and none for the better: where pairs hardly determine the focal length, the lowest energy is
//! far from the truth (`docs/ABLATIONS.md`).

use nalgebra::Matrix3;

use super::correspondence::Correspondence;
use super::fundamental::ByFundamental;
use super::robust_search::robust_search;
use super::varying_focal::{Pair, varying_focal};
use super::view_graph_focal::view_graph_focal;
use plumbline_camera::Vec3;
use plumbline_num::optim::ransac::MsacOptions;
use plumbline_num::run::{Run, Stopped};

/// Minimum number of correspondences of a pair that is used: nine more than a fundamental matrix has parameters.
pub(super) const MIN_CORRESPONDENCES: usize = 16;

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
    let usable: Vec<Pair<'_>> = found.iter().map(|(matches, _)| Pair { matches, times: [0.0; 2] }).collect();
    let course = varying_focal(&usable, initial, 1, options, run).ok()??;
    let focal = course.ln_focals[0].exp().clamp(options.range.0, options.range.1);
    Some(FocalEstimate { focal, sigma_ln: course.covariance[(0, 0)].sqrt(), pairs: course.pairs })
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

pub(super) fn search_settings(threshold: f64, max_samples: usize) -> MsacOptions {
    MsacOptions { threshold, min_samples: 30, max_samples, local_steps: 4 }
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
