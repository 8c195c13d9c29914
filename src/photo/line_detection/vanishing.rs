//! Directions of parallel lines.
//!
//! Lines that are parallel in space lie on circles through one direction `v`, their vanishing point: `n·v = 0`. A candidate's
//! support is
//!
//! ```text
//! S(v) = Σᵢ ℓᵢ (1 − (n_i·v / τᵢ)²)₊ ,      τᵢ = τ + pixel/ℓᵢ,
//! ```
//!
//! the sum of the lengths `ℓ` of lines that meet it, each as far as it fits. Candidates are the meetings of every two of the
//! longest lines: all are tried, so nothing is left to chance. The vertical is the best candidate near the picture's own;
//! horizontals are the best ones at right angles to it, found from single lines.

use nalgebra::{Matrix3, SymmetricEigen};

use super::LineGroup;
use super::arc::Arc;
use plumbline_camera::Vec3;

/// Number of longest lines whose pairs are vanishing-point candidates: 4005 pairs.
const MAX_PAIRED: usize = 90;
/// `τ`, sine of the angular tolerance: buildings are square to better than a degree, lenses accurate to about one.
const TOLERANCE: f64 = 0.02;
/// Cosine of the maximum angle between the vertical and the picture's y axis: 40°.
const MIN_UPRIGHT_COSINE: f64 = 0.766;
/// Minimum number of lines of a group: the two that make it a candidate, and as many again that confirm it.
const MIN_LINES: usize = 4;
/// Minimum support of a group, rad of line length: 29 % of the width of a view of 100°.
const MIN_SUPPORT: f64 = 0.5;
/// Maximum number of horizontal groups.
const MAX_HORIZONTALS: usize = 3;
/// Sine of the minimum angle between two groups: 8°.
const MIN_GROUP_SINE: f64 = 0.14;

/// The vertical and horizontal directions of a scene, in the lens's axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Directions {
    pub(super) down: Option<Vec3>,
    pub(super) horizontals: Vec<Vec3>,
}

impl Directions {
    /// The directions of the arcs, which are sorted longest first.
    pub(super) fn find(arcs: &[Arc]) -> Self {
        let Some(down) = vertical(arcs) else { return Self::default() };
        let mut left: Vec<&Arc> = arcs.iter().filter(|a| fit(a, &down) <= 0.0).collect();
        let mut horizontals: Vec<Vec3> = Vec::new();
        while horizontals.len() < MAX_HORIZONTALS {
            let apart = |v: &Vec3| horizontals.iter().all(|h| h.cross(v).norm() > MIN_GROUP_SINE);
            let candidates =
                left.iter().take(MAX_PAIRED).filter_map(|a| a.normal.cross(&down).try_normalize(0.05)).filter(apart);
            let Some(v) = supported(candidates, &left) else { break };
            horizontals.push(v);
            left.retain(|a| fit(a, &v) <= 0.0);
        }
        Self { down: Some(down), horizontals }
    }

    /// The group whose direction a line fits best.
    pub(super) fn group(&self, arc: &Arc) -> LineGroup {
        let horizontals = self.horizontals.iter().enumerate().map(|(i, v)| (LineGroup::Horizontal(i), v));
        let all = self.down.iter().map(|v| (LineGroup::Vertical, v)).chain(horizontals);
        let best = all.map(|(g, v)| (fit(arc, v), g)).filter(|(f, _)| *f > 0.0);
        best.max_by(|a, b| a.0.total_cmp(&b.0)).map_or(LineGroup::Free, |(_, g)| g)
    }
}

/// How well a line runs to `v`: 1 exactly, 0 and below not.
fn fit(arc: &Arc, v: &Vec3) -> f64 {
    let tolerance = TOLERANCE + arc.pixel / arc.half;
    1.0 - (arc.normal.dot(v) / tolerance).powi(2)
}

fn support<'a>(arcs: impl Iterator<Item = &'a Arc>, v: &Vec3) -> f64 {
    arcs.map(|a| a.seen * fit(a, v).max(0.0)).sum()
}

fn vertical(arcs: &[Arc]) -> Option<Vec3> {
    let paired = &arcs[..arcs.len().min(MAX_PAIRED)];
    let upright = |v: &Vec3| v.y.abs() > MIN_UPRIGHT_COSINE;
    let pairs = paired.iter().enumerate().flat_map(|(i, a)| paired[..i].iter().map(move |b| a.normal.cross(&b.normal)));
    let candidates = pairs.filter_map(|v| v.try_normalize(0.01)).filter(upright);
    let all: Vec<&Arc> = arcs.iter().collect();
    supported(candidates, &all).filter(upright).map(|v| v * v.y.signum())
}

/// The candidate of most support, refined; `None` where the best has too little.
fn supported(candidates: impl Iterator<Item = Vec3>, arcs: &[&Arc]) -> Option<Vec3> {
    let mut best: Option<(f64, Vec3)> = None;
    for v in candidates {
        let s = support(arcs.iter().copied(), &v);
        if best.is_none_or(|(most, _)| s > most) {
            best = Some((s, v));
        }
    }
    let (_, v) = best?;
    let v = refined(&v, arcs);
    let meeting = arcs.iter().filter(|a| fit(a, &v) > 0.0).count();
    (meeting >= MIN_LINES && support(arcs.iter().copied(), &v) >= MIN_SUPPORT).then_some(v)
}

/// The direction that the lines which meet `v` meet best.
fn refined(v: &Vec3, arcs: &[&Arc]) -> Vec3 {
    let moment: Matrix3<f64> =
        arcs.iter().map(|a| a.normal * a.normal.transpose() * (a.seen * fit(a, v).max(0.0))).sum();
    if !(moment.trace() > 0.0) {
        return *v;
    }
    let eigen = SymmetricEigen::new(moment / moment.trace());
    let u: Vec3 = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
    // Two lines in one plane with v leave a second direction free: stay where the candidate was.
    if u.dot(v).abs() > 0.99 { u * u.dot(v).signum() } else { *v }
}
