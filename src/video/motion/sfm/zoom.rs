//! Zoom detection: whether the focal length changed during a shot.
//!
//! A pair of views of focal lengths `f` and `s f` satisfies the constraints of one camera once the second image is
//! scaled by `1/s`. Each pair is therefore evaluated again with its second view divided by factors about 1; its vote
//! is the factor under which the essential matrix, or the rotation, explains it best. Zoom is reported if most pairs
//! vote for a factor other than 1, in one direction, and explain clearly more under it. A camera that moves towards a
//! plane cannot be distinguished from zoom; towards a scene with depth it can.

use rayon::prelude::*;

use super::correspondence::Correspondence;
use super::two_view::{TwoViewOptions, two_view};
use super::view_graph::Edge;
use plumbline_camera::Intrinsics;
use plumbline_num::math::median;
use plumbline_num::run::{Run, Stopped};

/// `ln s` of the scanned factors: a pair spans a second or so, in which zooms by hand or motor make 5 to 50 %.
const LN_FACTORS: [f64; 9] = [-0.34, -0.23, -0.14, -0.06, 0.0, 0.06, 0.14, 0.23, 0.34];
/// Assumed noise, px: a factor between two of the scanned ones leaves a few pixels, and must still be recognized.
const BLUR_PX: f64 = 2.0;
/// Number of pairs that are evaluated: the most distant ones.
const ASKED: usize = 9;
/// Minimum gain of the score, per point, of a vote: noise and a wrong lens give a few hundredths.
const CLEAR_GAIN: f64 = 0.15;
/// Minimum fraction of the pairs that must agree.
const MAJORITY: f64 = 0.6;

/// The median factor of the focal length between distant keyframes, if most pairs vote for a change.
pub(super) fn zoom_between(edges: &[Edge], camera: &Intrinsics, run: &Run) -> Result<Option<f64>, Stopped> {
    let mut asked: Vec<&Edge> = edges.iter().collect();
    asked.sort_by_key(|e| (std::cmp::Reverse(e.second - e.first), e.first));
    asked.truncate(ASKED);
    let mut votes: Vec<f64> = asked.par_iter().map(|edge| vote(edge, camera, run)).collect::<Result<_, _>>()?;
    let count = |sign: f64| votes.iter().filter(|v| sign * **v > 0.0).count() as f64;
    let agreed = MAJORITY * votes.len() as f64;
    if votes.is_empty() || count(1.0).max(count(-1.0)) < agreed {
        return Ok(None);
    }
    Ok(median(&mut votes).map(f64::exp))
}

/// `ln s` of the factor that explains a pair best; 0 if none is clearly better than 1.
fn vote(edge: &Edge, camera: &Intrinsics, run: &Run) -> Result<f64, Stopped> {
    let (threshold, min_noise) = (4.0 * BLUR_PX / camera.focal, BLUR_PX / camera.focal);
    let options =
        TwoViewOptions { threshold, min_noise, max_focal_ratio: 1.0, ..TwoViewOptions::for_focal(camera.focal) };
    let mut scores = LN_FACTORS;
    for (score, ln) in scores.iter_mut().zip(LN_FACTORS) {
        let rays = edge.matches.iter().filter_map(|m| {
            let (a, b) = (camera.undistorted(m.first)?, camera.undistorted(m.second)?);
            Some(Correspondence::new(a, b / ln.exp()))
        });
        let found = two_view(&rays.collect::<Vec<_>>(), &options, run)?.scores;
        *score = found.essential.min(found.rotation);
    }
    let best = (0..scores.len()).fold(LN_FACTORS.len() / 2, |b, k| if scores[k] < scores[b] { k } else { b });
    let gain = scores[LN_FACTORS.len() / 2] - scores[best];
    Ok(if gain > CLEAR_GAIN * edge.matches.len() as f64 { LN_FACTORS[best] } else { 0.0 })
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
        zoom_between(&edges, &camera, &Run::default()).expect("a run that never stops")
    }

    #[test]
    fn a_growing_focal_length_is_detected_with_its_direction_and_a_constant_one_is_not() {
        assert!(told(Course::Side, 0.01).is_some_and(|f| f > 1.05), "in: {:?}", told(Course::Side, 0.01));
        assert!(told(Course::Side, -0.01).is_some_and(|f| f < 0.95), "out: {:?}", told(Course::Side, -0.01));
        for course in [Course::Side, Course::Rotation, Course::Walk] {
            assert_eq!(told(course, 0.0), None, "{course:?}");
        }
    }

    #[test]
    fn without_pairs_no_zoom_is_detected() {
        assert_eq!(
            zoom_between(&[], &Intrinsics::centered(576.0, 640, 360), &Run::default()).expect("a run that never stops"),
            None
        );
    }
}
