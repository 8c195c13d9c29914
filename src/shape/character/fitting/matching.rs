//! Which end of the curve each end of the template becomes.
//!
//! Ends are taken in the order of what they add; a beam keeps the best partial matchings. The cost of a matching is
//!
//! ```text
//! Var ln (d_C / d_T)  over pairs of matched ends, weighted by d_T
//! + a little of the square of its mean, so that a whole body is not matched with the fingers of a hand
//! + share of the curve's ends that the best proper similarity does not explain
//! + share of the template's length that has no image
//! + a part of the share of the surface that has no limb, by cylinders about the curve
//! ```
//!
//! so that an end may go without one where every place for it is worse than none.

use super::ends::Ends;
use super::graph::Graph;
use super::moments::Moments;
use plumbline_num::run::{Run, Stopped};

/// Image of each end of the template: a number of an end of the curve.
pub(super) type Images = Vec<Option<usize>>;

/// Partial matchings that are kept: all pairs of forty ends where the beam begins, ...
const BEAM_WIDTH: usize = 1600;
/// ... and those that mirrors and swaps of fingers leave alike later on.
const WIDTH: usize = 400;
/// Matchings that are laid out to the last joint.
const LAID_OUT: usize = 48;
/// What the place of ends counts beside lengths: a limb in another pose moves its end, but not the lengths.
pub(super) const PLACE: f64 = 0.5;
/// What the part of the surface without a limb counts. A forearm beside the spike of an elbow, or a snout beside an ear, is most of what
/// tells a limb from what sticks out of it: whatever the length of the template's, that is where the surface is. The ends of five
/// characters are the same from 0.6 to 1.
const SPARE: f64 = 0.8;
/// What the size counts. Lengths are in units of each graph's own: a tail or a missing arm changes that by a tenth or a third, fingers
/// for a body by a factor of ten.
const SIZE: f64 = 0.05;

#[derive(Clone)]
struct Partial {
    images: Images,
    /// Sums of `w`, `w x`, `w x²` over pairs, `x = ln (d_C / d_T)`, `w = d_T`.
    logs: [f64; 3],
    missing: f64,
    /// Share of the surface of the curve about limbs.
    covered: f64,
    moments: Moments,
    cost: f64,
}

/// The best matchings, best first.
pub(super) fn candidates(
    bones: &Graph,
    ours: &Ends,
    branches: &Graph,
    theirs: &Ends,
    run: &Run,
) -> Result<Vec<Images>, Stopped> {
    let none = Partial {
        images: Vec::new(),
        logs: [0.0; 3],
        missing: 0.0,
        covered: 0.0,
        moments: Moments::default(),
        cost: spare(0.0),
    };
    let mut beam = vec![none];
    for (k, reach) in ours.reach.iter().enumerate() {
        let place = bones.points[ours.nodes[k] as usize];
        let mut next = Vec::with_capacity(beam.len() * (theirs.nodes.len() + 1));
        for partial in &beam {
            run.check()?;
            let without = |mut p: Partial| {
                p.images.push(None);
                p.missing += ours.need[k];
                p.cost += p.missing - partial.missing;
                p
            };
            next.push(without(partial.clone()));
            for e in (0..theirs.nodes.len()).filter(|e| !partial.images.contains(&Some(*e))) {
                let Some(logs) = lengths(partial, ours, theirs, k, e) else { continue };
                let mut moments = partial.moments;
                moments.add(*reach, &place, &branches.points[theirs.nodes[e] as usize]);
                let covered = partial.covered + theirs.around[e] * ours.trust[k];
                let cost = spread(&logs) + PLACE * moments.alignment().residual + partial.missing + spare(covered);
                let images = partial.images.iter().copied().chain([Some(e)]).collect();
                next.push(Partial { images, logs, missing: partial.missing, covered, moments, cost });
            }
        }
        next.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        next.truncate(if k < 2 { BEAM_WIDTH } else { WIDTH });
        beam = next;
    }
    Ok(beam.into_iter().map(|p| p.images).filter(|i| i.iter().flatten().count() >= 2).take(LAID_OUT).collect())
}

/// What the part of the curve without a limb costs.
pub(super) fn spare(covered: f64) -> f64 {
    SPARE * (1.0 - covered)
}

/// The sums with the pairs of one more end; `None` where two ends of the curve are in one place.
fn lengths(partial: &Partial, ours: &Ends, theirs: &Ends, k: usize, e: usize) -> Option<[f64; 3]> {
    let mut logs = partial.logs;
    for (i, image) in partial.images.iter().enumerate() {
        let Some(image) = image else { continue };
        let (ours, theirs) = (ours.between(k, i), theirs.between(e, *image));
        let x = (theirs / ours).ln();
        if !x.is_finite() {
            return None;
        }
        logs = [logs[0] + ours, logs[1] + ours * x, logs[2] + ours * x * x];
    }
    Some(logs)
}

fn spread([w, x, xx]: &[f64; 3]) -> f64 {
    if !(*w > 0.0) {
        return 0.0;
    }
    let mean = x / w;
    (xx / w - mean * mean).max(0.0) + SIZE * mean * mean
}
