//! Straight edges of a picture, each with a proof that it is no accident.
//!
//! At every pixel the *level line* runs along the edge: the gradient turned a quarter, so that the brighter side lies on the
//! left on a screen. Pixels that touch and whose level lines agree within `τ` form a region; a region that fills a slim
//! rectangle is a segment if a picture of pure noise would hardly hold one like it: with `n` pixels in the rectangle, `k` of
//! them *aligned* with it within `π p`, and every direction equally likely,
//!
//! ```text
//! NFA = N(W, H) · P(Binomial(n, p) ≥ k),      N = (W H)^{5/2},      accepted where NFA ≤ 10^{−ε},
//! ```
//!
//! `N` being the number of rectangles that could be tried, so that noise yields `10^{−ε}` false segments per picture on
//! average, whatever its size.
//!
//! 1. [`gradient`]: the picture is blurred and shrunk to 4/5, which removes the staircase of steep edges; 2×2 gradients.
//! 2. [`region`]: regions grow from the strongest gradients downwards; those that fill their rectangle too thinly are grown
//!    again with a tighter tolerance, then cut back.
//! 3. [`rectangle`]: the count, the bound and a short search for a better rectangle.
//!
//! Departs from the paper in two places. The tail of the binomial is replaced by its exponential upper bound (Hoeffding),
//!
//! ```text
//! P(Binomial(n, p) ≥ k) ≤ exp(−n KL(k/n ‖ p)),      k ≥ n p,
//! ```
//!
//! which errs on the strict side by about `½ log₁₀ n` and needs no gamma function; and the grid of `p` that is searched
//! does not enter `N`, as it changes the outcome by less than that bound.
//!
//! Everything is deterministic: equal gradients are visited in the order of the rows.
//!
//! # References
//! R. Grompone von Gioi, J. Jakubowicz, J.-M. Morel, G. Randall, *LSD: A Fast Line Segment Detector with a False Detection
//! Control*, PAMI 32(4), 2010, and *LSD: a Line Segment Detector*, IPOL 2, 2012.
//! A. Desolneux, L. Moisan, J.-M. Morel, *Meaningful Alignments*, IJCV 40(1), 2000.
//! W. Hoeffding, *Probability Inequalities for Sums of Bounded Random Variables*, JASA 58, 1963, theorem 1.

mod gradient;
mod rectangle;
mod region;

use crate::PlaneRef;
use plumbline_num::math::{Point2, Vec2};

use gradient::LevelLines;
use region::RegionGrower;

/// `τ`, rad: largest angle between a level line and the region it joins, found in the paper to be best over all kinds of
/// pictures.
const TOLERANCE: f64 = std::f64::consts::PI / 8.0;
/// Error of a gray level by quantization, gray levels (of 255), as in the paper: gradients below `QUANTIZATION / sin τ` have no
/// direction to speak of. Noisy pictures merely lose speed with small values, for noise is not aligned.
const QUANTIZATION: f32 = 2.0;
/// Minimum fraction of a rectangle's pixels that belong to its region, as in the paper.
const DENSITY: f64 = 0.7;
/// `ε`: least `−log₁₀ NFA`. At 0 one segment per picture is an accident.
const MEANINGFULNESS: f64 = 0.0;

/// A straight edge; the brighter side lies on the left on a screen as one walks from start to end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// One end, px, pixel centers at integer + 0.5.
    pub start: Point2,
    /// The other end.
    pub end: Point2,
    /// Width of the edge across, px.
    pub width: f64,
    /// `−log₁₀ NFA` as bounded above: the larger, the less an accident.
    pub score: f64,
}

impl Segment {
    /// Distance between the ends, px.
    pub fn length(&self) -> f64 {
        (self.end - self.start).norm()
    }

    /// Unit vector from start to end; zero for coinciding ends.
    pub fn direction(&self) -> Vec2 {
        (self.end - self.start).try_normalize(0.0).unwrap_or_default()
    }
}

/// Finds the straight edges of a picture of gray levels 0 to 255, the strongest gradients first.
///
/// Edges shorter than `min_length` px are left out. Samples that are not finite belong to no edge. Pictures below 3×3 hold none.
pub fn segments(luma: PlaneRef<'_, f32>, min_length: f64) -> Vec<Segment> {
    let threshold = QUANTIZATION / TOLERANCE.sin() as f32;
    let lines = LevelLines::new(luma, threshold);
    let mut grower = RegionGrower::new(&lines);
    let mut found = Vec::new();
    for seed in lines.by_strength() {
        if let Some(rectangle) = grower.grow(seed) {
            let segment = rectangle.segment(lines.scale());
            if segment.length() >= min_length {
                found.push(segment);
            }
        }
    }
    found
}

#[cfg(test)]
mod tests;
