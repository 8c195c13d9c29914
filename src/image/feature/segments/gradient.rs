//! Level lines of the blurred, shrunk picture.

use crate::PlaneRef;
use plumbline_num::math::Point2;

/// Size of the grid relative to the picture. At 1 steep edges show their staircase; much below, fine lines merge.
const SCALE: f64 = 0.8;
/// Standard deviation of the blur, px of the shrunk grid: aliasing against blur, as in the paper.
const BLUR: f64 = 0.6;
/// Reach of the blur in standard deviations: beyond it a tap weighs less than a quarter of a percent.
const REACH: f64 = 3.5;
/// Bins of the ordering by strength: within one, gradients count as equal.
const BINS: usize = 1024;

/// The level line at a node of the grid; the norm is zero where there is none.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LevelLine {
    /// Unit vector along the edge, the brighter side on its left on a screen.
    pub(super) along: [f32; 2],
    /// Norm of the gradient, gray levels per px of the grid.
    pub(super) norm: f32,
    /// What the norm exceeds the threshold by: the weight in fits, so that the outermost nodes of an edge, which may just
    /// pass on one side and just fail on the other, do not pull it aside.
    pub(super) weight: f32,
}

/// Level lines on the grid of 2×2 gradients.
#[derive(Debug)]
pub(super) struct LevelLines {
    lines: Vec<LevelLine>,
    width: usize,
    height: usize,
    scale: f64,
}

impl LevelLines {
    /// Level lines of `luma`; gradients of norm up to `threshold` have none.
    pub(super) fn new(luma: PlaneRef<'_, f32>, threshold: f32) -> Self {
        let (w, h) = (shrunk(luma.width()), shrunk(luma.height()));
        if w < 2 || h < 2 {
            return Self { lines: Vec::new(), width: 0, height: 0, scale: SCALE };
        }
        let blurred = shrink(luma, w, h);
        let (width, height) = (w - 1, h - 1);
        let mut lines = Vec::with_capacity(width * height);
        for (upper, lower) in blurred.chunks_exact(w).zip(blurred.chunks_exact(w).skip(1)) {
            for (u, l) in upper.windows(2).zip(lower.windows(2)) {
                let (falling, rising) = (l[1] - u[0], u[1] - l[0]);
                let (gx, gy) = (0.5 * (falling + rising), 0.5 * (falling - rising));
                let norm = (gx * gx + gy * gy).sqrt();
                // Comparing this way leaves out what is not a number.
                let line = if norm > threshold && norm < f32::INFINITY {
                    LevelLine { along: [-gy / norm, gx / norm], norm, weight: norm - threshold }
                } else {
                    LevelLine::default()
                };
                lines.push(line);
            }
        }
        Self { lines, width, height, scale: SCALE }
    }

    /// Nodes along x.
    pub(super) fn width(&self) -> usize {
        self.width
    }

    /// Nodes along y.
    pub(super) fn height(&self) -> usize {
        self.height
    }

    /// Size of the grid relative to the picture.
    pub(super) fn scale(&self) -> f64 {
        self.scale
    }

    /// Number of nodes.
    pub(super) fn len(&self) -> usize {
        self.lines.len()
    }

    /// The level line at node `i`, row by row.
    pub(super) fn at(&self, i: usize) -> &LevelLine {
        &self.lines[i]
    }

    /// Where node `i` lies on the shrunk picture: in the middle of its 2×2 pixels.
    pub(super) fn position(&self, i: usize) -> Point2 {
        Point2::new((i % self.width + 1) as f64, (i / self.width + 1) as f64)
    }

    /// Nodes that have a level line, strongest first, equal ones row by row: a counting sort.
    pub(super) fn by_strength(&self) -> Vec<usize> {
        let strongest = self.lines.iter().fold(0.0_f32, |m, l| m.max(l.norm));
        if !(strongest > 0.0) {
            return Vec::new();
        }
        let bin = |l: &LevelLine| BINS - 1 - (((l.norm / strongest) * BINS as f32) as usize).min(BINS - 1);
        let mut next = [0_usize; BINS + 1];
        for line in self.lines.iter().filter(|l| l.norm > 0.0) {
            next[bin(line) + 1] += 1;
        }
        for b in 0..BINS {
            next[b + 1] += next[b];
        }
        let mut order = vec![0; next[BINS]];
        for (i, line) in self.lines.iter().enumerate().filter(|(_, l)| l.norm > 0.0) {
            let slot = &mut next[bin(line)];
            order[*slot] = i;
            *slot += 1;
        }
        order
    }
}

/// Pixels of the shrunk side: all of them lie on the picture.
fn shrunk(side: usize) -> usize {
    (side as f64 * SCALE) as usize
}

/// Taps of a blur centered between pixels.
struct Taps {
    /// First pixel, already within the side.
    first: usize,
    /// Weights of the pixels from there on, summing to 1; what would lie outside is given to the border pixel.
    weights: Vec<f32>,
}

/// The taps of each shrunk pixel along a side of `n` pixels.
fn taps(n: usize, shrunk: usize) -> Vec<Taps> {
    let sigma = BLUR / SCALE;
    (0..shrunk)
        .map(|i| {
            let center = (i as f64 + 0.5) / SCALE;
            let (from, to) = ((center - REACH * sigma).floor() as i64, (center + REACH * sigma).ceil() as i64);
            let clamp = |j: i64| (j.max(0) as usize).min(n - 1);
            let first = clamp(from);
            let mut weights = vec![0.0_f64; clamp(to - 1) - first + 1];
            for j in from..to {
                let d = (j as f64 + 0.5 - center) / sigma;
                weights[clamp(j) - first] += (-0.5 * d * d).exp();
            }
            let total: f64 = weights.iter().sum();
            Taps { first, weights: weights.into_iter().map(|w| (w / total) as f32).collect() }
        })
        .collect()
}

/// The picture blurred and shrunk to `w×h`, packed.
fn shrink(luma: PlaneRef<'_, f32>, w: usize, h: usize) -> Vec<f32> {
    let (columns, rows) = (taps(luma.width(), w), taps(luma.height(), h));
    let mut row = vec![0.0_f32; luma.width()];
    let mut out = Vec::with_capacity(w * h);
    for t in &rows {
        row.fill(0.0);
        for (k, weight) in t.weights.iter().enumerate() {
            for (sum, sample) in row.iter_mut().zip(luma.row(t.first + k)) {
                *sum += weight * sample;
            }
        }
        out.extend(columns.iter().map(|t| {
            let samples = &row[t.first..t.first + t.weights.len()];
            samples.iter().zip(&t.weights).map(|(s, w)| s * w).sum::<f32>()
        }));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Plane;

    #[test]
    fn the_brighter_side_lies_on_the_left_of_a_level_line() {
        let above = Plane::from_fn(40, 40, |_, y| if y < 20 { 200.0 } else { 50.0 });
        let lines = LevelLines::new(above.as_ref(), 1.0);
        let strongest = lines.at(lines.by_strength()[0]);
        assert!((strongest.along[0] - 1.0).abs() < 1e-6 && strongest.along[1].abs() < 1e-6, "{strongest:?}");
    }

    #[test]
    fn blur_and_shrinking_keep_a_ramp() {
        let ramp = Plane::from_fn(60, 50, |x, y| 2.0 * (x as f32 + 0.5) + 3.0 * (y as f32 + 0.5));
        let (w, h) = (shrunk(60), shrunk(50));
        let out = shrink(ramp.as_ref(), w, h);
        for (x, y) in [(5, 5), (20, 17), (40, 30)] {
            let want = (2.0 * (x as f64 + 0.5) + 3.0 * (y as f64 + 0.5)) / SCALE;
            assert!((f64::from(out[y * w + x]) - want).abs() < 1e-2, "{} {want}", out[y * w + x]);
        }
    }

    #[test]
    fn nodes_come_strongest_first_and_equal_ones_in_order() {
        let steps = Plane::from_fn(60, 10, |x, _| [0.0, 20.0, 120.0][x / 20]);
        let lines = LevelLines::new(steps.as_ref(), 1.0);
        let order = lines.by_strength();
        let strongest = lines.at(order[0]).norm;
        for pair in order.windows(2) {
            let [a, b] = [lines.at(pair[0]).norm, lines.at(pair[1]).norm];
            assert!(a + strongest / BINS as f32 >= b && (a != b || pair[0] < pair[1]), "{a} before {b}");
        }
    }
}
