//! Zoom detection: whether the focal length changed during a shot.
//!
//! Low residuals do not prove a constant focal length: a map bends its depths and positions until a zoom is walked, to half a pixel.
//! So the focal length over time is estimated apart from any map:
//!
//! - from the pairs with parallax, by their epipolar geometry ([`super::varying_focal`]);
//! - of a rotating camera, from homographies: `H = K₂ R K₁⁻¹` determines `f₂` for an assumed `f₁`, since the first two rows of
//!   `R = K₂⁻¹ H K₁` are as long as the third. The ratios `ln(f₂/f₁)` of all pairs give `ln f` by least squares.
//!
//! It is a zoom if the focal length changes by more than [`MIN_CHANGE`], by more than its uncertainty, and explains clearly more than a
//! constant one. A camera that moves straight towards a plane cannot be distinguished from zoom; in both cases the picture alone says
//! how to move it.
//!
//! # Reference
//! L. de Agapito, E. Hayman, I. Reid, *Self-calibration of rotating and zooming cameras*, IJCV 45(2), 2001 (the homographies of a
//! rotating camera whose focal length varies).

use nalgebra::{DMatrix, DVector, Matrix3};
use rayon::prelude::*;

use super::correspondence::Correspondence;
use super::focal::FocalOptions;
use super::homography_search::ByPlane;
use super::robust_search::robust_search;
use super::rotation_fit::{conjugate_rotation, fit_conjugate_rotation, homography_squared_distance};
use super::two_view::TwoViewVerdict;
use super::varying_focal::{Pair, VaryingFocal, varying_focal};
use super::view_graph::Edge;
use plumbline_camera::{Intrinsics, Vec3};
use plumbline_num::math::median;
use plumbline_num::optim::ransac::MsacOptions;
use plumbline_num::run::{Run, Stopped};

/// Number of knots over a shot: a zoom in, held, and out again has three stretches.
const KNOTS: usize = 4;
/// Maximum number of pairs; a fast pan has thousands. Not fewer: the strongest of groups of five of 238 pairs (a bicycle at 10 frames per
/// second) agreed on a false zoom, and all of them do not.
const MAX_PAIRS: usize = 256;
/// Least change of `ln f` that is a zoom: it moves the border of the picture by 3 % of its width.
const MIN_CHANGE: f64 = 0.06;
/// The same in standard deviations.
const MIN_SIGNIFICANCE: f64 = 5.0;
/// Least fraction of what a constant focal length leaves unexplained that a varying one explains. Uncertainties alone prove no zoom, since
/// pairs that agree may agree in an error, as of a moving object: on eight clips of fixed focal length they gain up to .045
/// (a bicycle at 10 frames per second), rendered zooms of 40 % .09 to .44.
const MIN_GAIN: f64 = 0.07;
/// Maximum ratio of the residual of a rotating, zooming camera to that of a free homography, for a pair that shows no translation.
const MAX_ROTATION_LOSS: f64 = 1.5;
/// Least fraction of the correspondences that it must explain: at less, a few far points decide.
const MIN_EXPLAINED: f64 = 0.7;
/// Least fraction of the pairs that must show none.
const MAJORITY: f64 = 0.6;

/// The factor by which the focal length changes most during a shot, in order of time; `None` if it does not. `rotating` where no
/// camera that moves explains the shot better than one that rotates.
pub(super) fn zoom(edges: &[Edge], guess: &Intrinsics, rotating: bool, run: &Run) -> Result<Option<f64>, Stopped> {
    let seen = Seen::new(edges, guess);
    let mut change = seen.moving(run)?;
    if change.is_none() && rotating {
        change = seen.rotating(run)?;
    }
    Ok(change.map(f64::exp))
}

/// The largest change of `ln f` of a focal length over time, if it is a zoom.
fn significant(focal: &VaryingFocal) -> Option<f64> {
    let (change, sigma) = focal.largest_change();
    (change.abs() > MIN_CHANGE.max(MIN_SIGNIFICANCE * sigma)).then_some(change)
}

/// The pairs of a shot.
struct Seen<'a> {
    edges: &'a [Edge],
    guess: &'a Intrinsics,
    /// First frame, and the number of frames to the last.
    start: usize,
    frames: f64,
}

/// A pair, px from the principal point, and its times as fractions of the shot.
struct SeenPair {
    matches: Vec<Correspondence>,
    times: [f64; 2],
}

impl<'a> Seen<'a> {
    fn new(edges: &'a [Edge], guess: &'a Intrinsics) -> Self {
        let start = edges.iter().map(|e| e.first).min().unwrap_or(0);
        let frames = edges.iter().map(|e| e.second - start).max().unwrap_or(1).max(1) as f64;
        Self { edges, guess, start, frames }
    }

    fn width(&self) -> f64 {
        2.0 * self.guess.center.x.max(self.guess.center.y)
    }

    /// At most [`MAX_PAIRS`] of the edges: of so many groups of successive ones the strongest each.
    fn pairs(&self, used: impl Fn(&Edge) -> bool) -> Vec<SeenPair> {
        let mut edges: Vec<&Edge> = self.edges.iter().filter(|e| used(e)).collect();
        edges.sort_by_key(|e| (e.first, e.second));
        let groups = edges.chunks(edges.len().div_ceil(MAX_PAIRS).max(1));
        let strongest = groups.filter_map(|g| g.iter().max_by(|a, b| a.strength().total_cmp(&b.strength())));
        let center = self.guess.center.coords;
        let at = |frame: usize| (frame - self.start) as f64 / self.frames;
        let pair = |e: &&Edge| SeenPair {
            matches: e
                .matches
                .iter()
                .map(|m| Correspondence::new(m.first.coords - center, m.second.coords - center))
                .collect(),
            times: [at(e.first), at(e.second)],
        };
        strongest.map(pair).collect()
    }

    /// The change that the pairs with parallax determine.
    fn moving(&self, run: &Run) -> Result<Option<f64>, Stopped> {
        let pairs = self.pairs(|e| e.view.verdict == TwoViewVerdict::General);
        let pairs: Vec<Pair<'_>> = pairs.iter().map(|p| Pair { matches: &p.matches, times: p.times }).collect();
        let options = FocalOptions::for_width(self.width());
        let focal = |knots| varying_focal(&pairs, self.guess.focal, knots, &options, run);
        let Some((constant, varying)) = focal(1)?.zip(focal(KNOTS)?) else { return Ok(None) };
        let gains = varying.energy < (1.0 - MIN_GAIN) * constant.energy;
        Ok(significant(&varying).filter(|_| gains))
    }

    /// The change that a camera that only rotates determines; `None` where most pairs show that it moves.
    fn rotating(&self, run: &Run) -> Result<Option<f64>, Stopped> {
        let focal = self.guess.focal;
        let threshold = FocalOptions::for_width(self.width()).threshold / focal;
        let pairs = self.pairs(|_| true);
        let ratios = pairs.par_iter().map(|pair| ratio_of_rotation(&pair.matches, focal, threshold, run));
        let ratios: Vec<Option<f64>> = ratios.collect::<Result<_, _>>()?;
        let known: Vec<(f64, [f64; 2])> =
            ratios.iter().zip(&pairs).filter_map(|(ratio, pair)| Some(((*ratio)?, pair.times))).collect();
        let enough = known.len() > KNOTS && known.len() as f64 >= MAJORITY * ratios.len() as f64;
        let varying = if enough { focal_of_ratios(&known) } else { None };
        Ok(varying.as_ref().and_then(significant))
    }
}

/// `ln(f₂/f₁)` of a pair of a camera that rotates and zooms; `None` where it moves, or too little is seen.
fn ratio_of_rotation(
    matches: &[Correspondence],
    focal: f64,
    threshold: f64,
    run: &Run,
) -> Result<Option<f64>, Stopped> {
    /// Largest factor between `f₁` and the guess.
    const MAX_RATIO: f64 = 2.2;
    /// Steps in which `f₁` and `f₂/f₁` are estimated in turn: each depends on the other by the angle squared.
    const STEPS: usize = 5;
    let rays: Vec<Correspondence> = matches.iter().map(|c| c.scaled(1.0 / focal)).collect();
    let settings = MsacOptions { threshold, min_samples: 40, max_samples: 500, local_steps: 4 };
    let Some(h) = robust_search(&ByPlane(&rays), &settings, None, 0, run)?.map(|s| s.model) else { return Ok(None) };
    // `Σ min(r²/T², 1)`.
    let loss = |h: &Matrix3<f64>| -> f64 {
        rays.iter().map(|c| (homography_squared_distance(h, c) / (threshold * threshold)).min(1.0)).sum()
    };
    let (mut first, mut ratio, mut rotation) = (1.0, 1.0, h);
    for _ in 0..STEPS {
        let [a, b, c] = [0, 1, 2].map(|k| (h * scaling(first)).row(k).norm());
        ratio = (0.5 * (a * a + b * b)).sqrt() / (c * first);
        let flat = scaling(1.0 / ratio) * h;
        let unzoomed: Vec<Correspondence> =
            rays.iter().map(|c| Correspondence::new(c.first.xy(), c.second.xy() / ratio)).collect();
        let Some((initial, _)) = conjugate_rotation(&flat, MAX_RATIO) else { return Ok(None) };
        let fit = fit_conjugate_rotation(initial, &unzoomed, threshold, MAX_RATIO);
        (first, rotation) = (fit.focal_ratio, scaling(ratio) * fit.homography());
    }
    let (free, rotated) = (loss(&h), loss(&rotation));
    let explains = rotated < (1.0 - MIN_EXPLAINED) * rays.len() as f64;
    // With a floor of an eighth of the threshold: under exact data no camera would rotate only.
    let floor = rays.len() as f64 / 64.0;
    Ok((explains && rotated <= MAX_ROTATION_LOSS.powi(2) * (free + floor)).then(|| ratio.ln()))
}

/// `diag(s, s, 1)`.
fn scaling(s: f64) -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vec3::new(s, s, 1.0))
}

/// `ln f` at the knots, the first zero, from differences between two times; the standard deviation from their residuals.
fn focal_of_ratios(ratios: &[(f64, [f64; 2])]) -> Option<VaryingFocal> {
    /// Rounds of reweighting.
    const ROUNDS: usize = 10;
    let share = |time: f64, knot: usize| (1.0 - (time * (KNOTS - 1) as f64 - knot as f64).abs()).max(0.0);
    let rows = DMatrix::from_fn(ratios.len(), KNOTS - 1, |k, knot| {
        let [first, second] = ratios[k].1;
        share(second, knot + 1) - share(first, knot + 1)
    });
    let wanted = DVector::from_iterator(ratios.len(), ratios.iter().map(|r| r.0));
    let mut weights = DVector::from_element(ratios.len(), 1.0);
    let mut found = None;
    for _ in 0..ROUNDS {
        let weighed = DMatrix::from_diagonal(&weights) * &rows;
        let normal = rows.tr_mul(&weighed) + DMatrix::identity(KNOTS - 1, KNOTS - 1) * 1e-6;
        let inverse = normal.cholesky()?.inverse();
        let solution = &inverse * weighed.tr_mul(&wanted);
        let residuals = &rows * &solution - &wanted;
        let mut sizes: Vec<f64> = residuals.iter().map(|r| r.abs()).collect();
        // Huber at 1.5 standard deviations, those from the median of absolute residuals: pairs may be wrong.
        let sigma = (1.4826 * median(&mut sizes)?).max(1e-4);
        weights = residuals.map(|r| (1.5 * sigma / r.abs().max(f64::MIN_POSITIVE)).min(1.0));
        let covariance = (inverse * (sigma * sigma)).insert_row(0, 0.0).insert_column(0, 0.0);
        let energy = residuals.norm_squared();
        found = Some(VaryingFocal { ln_focals: solution.insert_row(0, 0.0), covariance, pairs: ratios.len(), energy });
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::sfm::TrackTable;
    use crate::motion::sfm::keyframes::keyframes;
    use crate::motion::sfm::tests::synthetic::{Course, Shot, ShotOptions};
    use crate::motion::sfm::view_graph::view_graph;
    use plumbline_num::math::Point2;

    /// Result for a synthetic shot whose focal length grows by `per_frame`.
    fn told(course: Course, per_frame: f64) -> Option<f64> {
        let shot = Shot::new(&ShotOptions { seed: 4, frames: 40, course, noise_px: 0.1, ..ShotOptions::default() });
        let mut frames = vec![Vec::new(); 40];
        let center = Point2::new(320.0, 180.0);
        for o in &shot.observations {
            let factor = (per_frame * f64::from(o.frame)).exp();
            frames[o.frame as usize].push((o.point, center + (o.pixel - center) * factor));
        }
        for frame in &mut frames {
            frame.sort_by_key(|p: &(u32, Point2)| p.0);
        }
        let table = TrackTable::new(640, 360, frames);
        let camera = Intrinsics::centered(576.0, 640, 360);
        let edges = view_graph(&table, &keyframes(&table, &camera), &camera, 1.2, &Run::default())
            .expect("a run that never stops");
        zoom(&edges, &camera, true, &Run::default()).expect("a run that never stops")
    }

    #[test]
    fn a_growing_focal_length_is_detected_with_its_direction_and_a_constant_one_is_not() {
        assert!(told(Course::Side, 0.01).is_some_and(|f| f > 1.05), "in: {:?}", told(Course::Side, 0.01));
        assert!(told(Course::Side, -0.01).is_some_and(|f| f < 0.95), "out: {:?}", told(Course::Side, -0.01));
        let turned = told(Course::Rotation, 0.01);
        assert!(turned.is_some_and(|f| f > 1.05), "turning: {turned:?}");
        for course in [Course::Side, Course::Rotation, Course::Walk] {
            assert_eq!(told(course, 0.0), None, "{course:?}");
        }
    }

    #[test]
    fn without_pairs_no_zoom_is_detected() {
        assert_eq!(
            zoom(&[], &Intrinsics::centered(576.0, 640, 360), true, &Run::default()).expect("a run that never stops"),
            None
        );
    }
}
