//! The rectangle that a region fills, and whether it is an accident.

use std::f64::consts::{LN_10, PI};

use super::Segment;
use super::gradient::LevelLines;
use plumbline_num::math::{Point2, Vec2};

/// Halvings of the angular precision that are tried; as in the paper.
const MAX_PRECISION_STEPS: usize = 5;
/// Reductions of the width that are tried; as in the paper.
const MAX_WIDTH_STEPS: usize = 5;
/// Length of such a step, px of the grid.
const STEP: f64 = 0.5;

/// A slim rectangle on the shrunk picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rectangle {
    /// Center of mass of the region's gradients, where extents are measured from.
    pub(super) center: Point2,
    /// Unit vector along the rectangle, as the level lines of its region run.
    pub(super) along: Vec2,
    /// Extent along it: from, to.
    pub(super) length: [f64; 2],
    /// Extent across it, towards `along` turned clockwise: from, to.
    pub(super) across: [f64; 2],
    /// Level lines within `π p` of `along` are aligned.
    pub(super) precision: f64,
    /// `−log₁₀` of the bound on the number of false alarms.
    pub(super) score: f64,
}

impl Rectangle {
    /// Width across, px of the grid; at least 1, for nodes have a size.
    pub(super) fn width(&self) -> f64 {
        (self.across[1] - self.across[0]).max(1.0)
    }

    /// Length along, px of the grid; at least 1.
    pub(super) fn length(&self) -> f64 {
        (self.length[1] - self.length[0]).max(1.0)
    }

    /// The segment through the center, on the picture before it was shrunk by `scale`. The center, which weighs every node
    /// by its gradient, tells where the edge lies far better than the middle of the width, which two nodes decide.
    pub(super) fn segment(&self, scale: f64) -> Segment {
        let end = |t: f64| (self.center + self.along * t) / scale;
        Segment { start: end(self.length[0]), end: end(self.length[1]), width: self.width() / scale, score: self.score }
    }

    /// Nodes inside, and how many of them are aligned.
    pub(super) fn count(&self, lines: &LevelLines) -> (usize, usize) {
        let slack = |extent: [f64; 2]| {
            let widen = 0.5 * (1.0 - (extent[1] - extent[0])).max(0.0);
            [extent[0] - widen, extent[1] + widen]
        };
        let normal = Vec2::new(-self.along.y, self.along.x);
        let slabs = [(self.along, slack(self.length)), (normal, slack(self.across))];
        let reach = |axis: usize| -> f64 {
            let most = |e: [f64; 2]| e[0].abs().max(e[1].abs());
            slabs.iter().map(|(n, e)| n[axis].abs() * most(*e)).sum()
        };
        let cosine = (PI * self.precision).cos() as f32;
        let (ax, ay) = (self.along.x as f32, self.along.y as f32);
        let (mut inside, mut aligned) = (0, 0);
        let first = (self.center.y - reach(1)).ceil().max(1.0) as usize;
        let last = (self.center.y + reach(1)).floor().min(lines.height() as f64);
        for y in first..=(last.max(0.0) as usize) {
            let dy = y as f64 - self.center.y;
            let mut span = [1.0 - self.center.x, lines.width() as f64 - self.center.x];
            for (n, extent) in slabs {
                span = clipped(span, n.x, extent, n.y * dy);
            }
            let (from, to) = ((self.center.x + span[0]).ceil(), (self.center.x + span[1]).floor());
            if !(from <= to) {
                continue;
            }
            let row = (y - 1) * lines.width();
            for x in from as usize..=to as usize {
                let line = lines.at(row + x - 1);
                inside += 1;
                aligned += usize::from(line.norm > 0.0 && line.along[0] * ax + line.along[1] * ay >= cosine);
            }
        }
        (inside, aligned)
    }

    /// The same with its score, on a grid where `tests` rectangles could be tried (their `log₁₀`).
    pub(super) fn scored(mut self, lines: &LevelLines, log_tests: f64) -> Self {
        let (n, k) = self.count(lines);
        self.score = tail_bound(n, k, self.precision) - log_tests;
        self
    }

    /// The best of a few tighter rectangles: finer precision, then sides moved inwards, then finer again.
    pub(super) fn improved(self, lines: &LevelLines, log_tests: f64, enough: f64) -> Self {
        let mut best = self;
        let finer: fn(&mut Self) = |r| r.precision *= 0.5;
        let both: fn(&mut Self) = |r| r.across = [r.across[0] + 0.5 * STEP, r.across[1] - 0.5 * STEP];
        let left: fn(&mut Self) = |r| r.across[0] += STEP;
        let right: fn(&mut Self) = |r| r.across[1] -= STEP;
        let searches = [
            (finer, MAX_PRECISION_STEPS),
            (both, MAX_WIDTH_STEPS),
            (left, MAX_WIDTH_STEPS),
            (right, MAX_WIDTH_STEPS),
            (finer, MAX_PRECISION_STEPS),
        ];
        for (change, times) in searches {
            let mut trial = best;
            for _ in 0..times {
                if best.score > enough {
                    return best;
                }
                change(&mut trial);
                if trial.across[1] - trial.across[0] < STEP {
                    break;
                }
                trial = trial.scored(lines, log_tests);
                if trial.score > best.score {
                    best = trial;
                }
            }
        }
        best
    }
}

/// The part of `span` where `n·x + offset` lies within `extent`; empty as a reversed span.
fn clipped(span: [f64; 2], n: f64, extent: [f64; 2], offset: f64) -> [f64; 2] {
    if n.abs() < 1e-12 {
        let inside = offset >= extent[0] && offset <= extent[1];
        return if inside { span } else { [1.0, 0.0] };
    }
    let (a, b) = ((extent[0] - offset) / n, (extent[1] - offset) / n);
    [span[0].max(a.min(b)), span[1].min(a.max(b))]
}

/// `−log₁₀` of Hoeffding's bound on `P(Binomial(n, p) ≥ k)`; 0 where `k ≤ n p`.
pub(super) fn tail_bound(n: usize, k: usize, p: f64) -> f64 {
    if n == 0 || !(k as f64 > n as f64 * p) {
        return 0.0;
    }
    let (n, q) = (n as f64, k as f64 / n as f64);
    let rest = if q < 1.0 { (1.0 - q) * ((1.0 - q) / (1.0 - p)).ln() } else { 0.0 };
    n * (q * (q / p).ln() + rest) / LN_10
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Plane;

    /// `P(Binomial(n, p) ≥ k)` term by term.
    fn tail(n: usize, k: usize, p: f64) -> f64 {
        let mut term = (1.0 - p).powf(n as f64);
        let mut sum = 0.0;
        for i in 0..=n {
            if i >= k {
                sum += term;
            }
            term *= (n - i) as f64 / (i + 1) as f64 * p / (1.0 - p);
        }
        sum
    }

    #[test]
    fn the_bound_is_never_below_the_binomial_tail_and_close_to_it() {
        for (n, p) in [(10, 0.125), (60, 0.125), (200, 0.0625), (90, 0.25)] {
            for k in 0..=n {
                let exact = -tail(n, k, p).log10();
                let bound = tail_bound(n, k, p);
                assert!(bound <= exact + 1e-9, "n {n} k {k}: {bound} > {exact}");
                assert!(exact - bound < 2.0, "n {n} k {k}: {exact} - {bound}");
            }
        }
    }

    #[test]
    fn all_nodes_of_a_tilted_rectangle_are_counted_once() {
        // Level on the right, where nodes have no level line and count all the same.
        let ramp = Plane::from_fn(80, 60, |x, _| x.min(35) as f32 * 10.0);
        let lines = LevelLines::new(ramp.as_ref(), 1.0);
        for angle in [0.0, 0.3, 1.1, PI / 2.0, 2.5] {
            let along = Vec2::new(f64::cos(angle), f64::sin(angle));
            let (length, across) = ([-13.2, 11.3], [-3.1, 4.2]);
            let rectangle =
                Rectangle { center: Point2::new(30.3, 22.7), along, length, across, precision: 0.125, score: 0.0 };
            let normal = Vec2::new(-along.y, along.x);
            let within = |v: f64, e: [f64; 2]| v >= e[0] && v <= e[1];
            let want = (0..lines.len())
                .filter(|i| {
                    let d = lines.position(*i) - rectangle.center;
                    within(d.dot(&along), length) && within(d.dot(&normal), across)
                })
                .count();
            assert_eq!(rectangle.count(&lines).0, want, "angle {angle}");
        }
    }
}
