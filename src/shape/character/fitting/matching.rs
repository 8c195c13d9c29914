//! Matching of template leaves to curve leaves by beam search.
//!
//! Template leaves are matched in their order; a beam keeps the best partial matchings. The cost of a matching is
//!
//! ```text
//! Var ln (d_C / d_T)  over pairs of matched leaves, weighted by d_T
//! + a small multiple of the squared mean, so that a whole body is not matched to the fingers of a hand
//! + residual of the best proper similarity, as a fraction of the spread of the curve's leaves
//! + fraction of the template's length without image
//! + a multiple of the fraction of the surface without limb, by cylinders about the curve
//! ```
//!
//! so that a leaf stays unmatched if every candidate costs more.

use super::ends::Ends;
use super::graph::Graph;
use super::moments::Moments;
use plumbline_num::run::{Run, Stopped};

/// Image of each template leaf: index of a curve leaf.
pub(super) type Images = Vec<Option<usize>>;

/// Width of the beam for the first two leaves: all pairs of forty leaves.
const INITIAL_BEAM_WIDTH: usize = 1600;
/// Width of the beam afterwards: enough for the matchings that symmetries and permuted fingers leave with equal costs.
const BEAM_WIDTH: usize = 400;
/// Number of complete matchings that are laid out.
const MAX_LAYOUTS: usize = 48;
/// Weight of leaf positions relative to lengths: a pose moves leaves but keeps lengths.
pub(super) const POSITION_WEIGHT: f64 = 0.5;
/// Weight of the surface without limb. It is the main term that separates a limb from features near it, such as a forearm from a spike at the
/// elbow, or a snout from an ear: the limb is where the surface is, whatever the template's lengths. The result on five characters is
/// constant from 0.6 to 1.
const UNCOVERED_WEIGHT: f64 = 0.8;
/// Weight of the global scale. Lengths are relative to each graph's total: a tail or a missing arm changes that by a tenth or a third, fingers
/// instead of a body by a factor of ten.
const SCALE_WEIGHT: f64 = 0.05;

#[derive(Clone)]
struct Partial {
    images: Images,
    /// Sums of `w`, `w x`, `w x²` over pairs, `x = ln (d_C / d_T)`, `w = d_T`.
    logs: [f64; 3],
    missing: f64,
    /// Fraction of the curve's surface covered by limbs.
    covered: f64,
    moments: Moments,
    cost: f64,
}

/// The best matchings, in ascending order of cost.
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
        let position = bones.points[ours.nodes[k] as usize];
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
                moments.add(*reach, &position, &branches.points[theirs.nodes[e] as usize]);
                let covered = partial.covered + theirs.around[e] * ours.trust[k];
                let cost =
                    spread(&logs) + POSITION_WEIGHT * moments.alignment().residual + partial.missing + spare(covered);
                let images = partial.images.iter().copied().chain([Some(e)]).collect();
                next.push(Partial { images, logs, missing: partial.missing, covered, moments, cost });
            }
        }
        next.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        next.truncate(if k < 2 { INITIAL_BEAM_WIDTH } else { BEAM_WIDTH });
        beam = next;
    }
    Ok(beam.into_iter().map(|p| p.images).filter(|i| i.iter().flatten().count() >= 2).take(MAX_LAYOUTS).collect())
}

/// Cost of the part of the curve without limb.
pub(super) fn spare(covered: f64) -> f64 {
    UNCOVERED_WEIGHT * (1.0 - covered)
}

/// The sums with the pairs of one more leaf; `None` if two curve leaves coincide.
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
    (xx / w - mean * mean).max(0.0) + SCALE_WEIGHT * mean * mean
}
