//! The smooth part of an edge that was followed.
//!
//! A lens bends lines smoothly. So an edge is a polynomial over its chord, fitted by least squares, and belongs to one line as far as
//! such a curve through what is known of it predicts what comes next ([`grown`]).

use std::ops::Range;

use nalgebra::{SMatrix, SVector};

use super::TracedEdge;
use plumbline_num::math::{Point2, Vec2};

/// Usual largest distance of an edge's continuation from the cubic through what is known of it, px: twice the scatter of samples, half the
/// least distance between two edges that are distinguished.
pub const MAX_OFF_CUBIC: f64 = 0.7;
/// Rounds in which samples that lie off the smooth part are left out, and how far off they lie: in medians of all distances, and at
/// least, px.
const TRIMMINGS: usize = 3;
const OUTLIER: f64 = 3.0;
const MIN_OUTLIER: f64 = 0.3;

impl TracedEdge {
    /// The smooth part: the course and what continues it as a cubic does, without samples that lie off by more than noise does, as
    /// where a shadow or a hand crosses the edge. Where an edge leaves the cubic through what is known of it by more than `max_off` px, such
    /// as [`MAX_OFF_CUBIC`], another begins.
    #[must_use]
    pub fn smooth(&self, max_off: f64) -> Self {
        let points = &self.points;
        let cubic = |known: Range<usize>| SmoothCurve::<4>::through(&points[known]);
        let off = |cubic: &SmoothCurve<4>, k: usize| Some(cubic.off(points[k]).abs());
        let known = grown(self.course.clone(), points.len(), max_off, cubic, off)
            .map_or_else(|| self.course.clone(), |(known, _)| known);
        let mut own: Vec<bool> = (0..points.len()).map(|k| known.contains(&k)).collect();
        let kept = |own: &[bool]| -> Vec<Point2> {
            points.iter().zip(own).filter(|(_, own)| **own).map(|(p, _)| *p).collect()
        };
        for _ in 0..TRIMMINGS {
            let Some(curve) = SmoothCurve::<6>::through(&kept(&own)) else { break };
            let offs = kept(&own).iter().map(|p| curve.off(*p).abs()).collect();
            let most = (OUTLIER * median(offs).unwrap_or(0.0)).max(MIN_OUTLIER);
            points.iter().zip(&mut own).for_each(|(p, own)| *own &= curve.off(*p).abs() <= most);
        }
        let start = own[..self.course.start].iter().filter(|own| **own).count();
        let along = own[self.course.clone()].iter().filter(|own| **own).count();
        Self { points: kept(&own), course: start..start + along }
    }
}

/// A run of the samples `0..count` of an edge that a model fits, grown outwards from `known` as far as the model of what is known
/// predicts what comes next: where
///
/// ```text
/// median of off(model, k) over the next samples ≤ max_off,
/// ```
///
/// they belong to it and `model` is made again. The median, since single samples may lie off, as at the corners of tiles. Steps are a
/// quarter of what is known, since a model says little about what lies far ahead of its samples, and halved where that much does not
/// fit. `off` is `None` for samples without a distance. Returns the run and its model; `None` where there is no model of `known`.
///
/// # Example
/// ```
/// use plumbline_image::feature::grown;
///
/// // A level, and from the twelfth sample on another.
/// let samples: Vec<f64> = (0..20).map(|k| if k < 12 { 1.0 + 0.1 * f64::from(k % 3) } else { 5.0 }).collect();
/// let mean = |run: std::ops::Range<usize>| Some(samples[run.clone()].iter().sum::<f64>() / run.len() as f64);
/// let off = |mean: &f64, k: usize| Some((samples[k] - mean).abs());
/// let (run, mean) = grown(2..7, samples.len(), 0.5, mean, off).expect("a mean");
/// assert!(run == (0..12) && (mean - 1.1).abs() < 0.01);
/// ```
pub fn grown<M>(
    known: Range<usize>,
    count: usize,
    max_off: f64,
    model: impl Fn(Range<usize>) -> Option<M>,
    off: impl Fn(&M, usize) -> Option<f64>,
) -> Option<(Range<usize>, M)> {
    /// Least number of samples of a step.
    const MIN_STEP: usize = 5;
    let fits = |now: &M, run: Range<usize>| {
        median(run.filter_map(|k| off(now, k)).collect()).is_some_and(|usual| usual <= max_off)
    };
    let (mut known, mut part) = (known, 4);
    let mut now = model(known.clone())?;
    loop {
        let step = known.len().div_ceil(part).max(MIN_STEP);
        let (start, end) = (known.start.saturating_sub(step), (known.end + step).min(count));
        let (before, after) = (fits(&now, start..known.start), fits(&now, known.end..end));
        match (before, after) {
            (false, false) if step == MIN_STEP => return Some((known, now)),
            (false, false) => part *= 2,
            _ => {
                known = if before { start } else { known.start }..if after { end } else { known.end };
                now = model(known.clone())?;
            }
        }
    }
}

/// The median, the larger of two in the middle; `None` of nothing.
fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// The polynomial of `N` coefficients nearest to points, over the chord from the first to the last.
#[derive(Clone, Debug)]
pub struct SmoothCurve<const N: usize> {
    origin: Point2,
    along: Vec2,
    half: f64,
    coefficients: SVector<f64, N>,
}

impl<const N: usize> SmoothCurve<N> {
    /// Of points; `None` for fewer than two apart.
    pub fn through(points: &[Point2]) -> Option<Self> {
        // Few samples leave high powers open: a pull to zero far below the weight of one sample.
        Self::fit(points, SVector::repeat(1e-6))
    }

    /// Of points, each coefficient drawn to zero with `pull` times the weight of all of them.
    pub(super) fn fit(points: &[Point2], pull: SVector<f64, N>) -> Option<Self> {
        let (first, last) = (points.first()?, points.last()?);
        let along = (last - first).try_normalize(1e-9)?;
        let (origin, half) = (nalgebra::center(first, last), 0.5 * (last - first).norm());
        let across = Vec2::new(-along.y, along.x);
        let mut moments = SMatrix::<f64, N, N>::from_diagonal(&(pull * points.len() as f64));
        let mut right = SVector::<f64, N>::zeros();
        for d in points.iter().map(|p| p - origin) {
            let row = Self::powers(along.dot(&d) / half);
            moments += row * row.transpose();
            right += row * across.dot(&d);
        }
        Some(Self { origin, along, half, coefficients: moments.cholesky()?.solve(&right) })
    }

    /// The point at a fraction of the chord, from 0 to 1.
    pub fn at(&self, fraction: f64) -> Point2 {
        self.point_and_tangent((2.0 * fraction - 1.0) * self.half).0
    }

    /// Signed distance of a point from it, across the chord.
    pub fn off(&self, p: Point2) -> f64 {
        let powers = Self::powers(self.position(p) / self.half);
        self.across().dot(&(p - self.origin)) - self.coefficients.dot(&powers)
    }

    /// Position of a point along the chord, px from its middle.
    pub(super) fn position(&self, p: Point2) -> f64 {
        self.along.dot(&(p - self.origin))
    }

    /// The point at a position along the chord, px from its middle, and the unit tangent there.
    pub(super) fn point_and_tangent(&self, position: f64) -> (Point2, Vec2) {
        let t = position / self.half;
        let slope: f64 = (1..N).map(|k| self.coefficients[k] * k as f64 * t.powi(k as i32 - 1)).sum();
        let height = self.coefficients.dot(&Self::powers(t));
        let point = self.origin + self.along * position + self.across() * height;
        (point, (self.along + self.across() * (slope / self.half)).normalize())
    }

    /// Second derivative of the height over the chord there, 1/px: the curvature where the curve is parallel to its chord.
    pub(super) fn bend(&self, position: f64) -> f64 {
        let t = position / self.half;
        let second: f64 = (2..N).map(|k| self.coefficients[k] * (k * (k - 1)) as f64 * t.powi(k as i32 - 2)).sum();
        second / (self.half * self.half)
    }

    fn across(&self) -> Vec2 {
        Vec2::new(-self.along.y, self.along.x)
    }

    fn powers(t: f64) -> SVector<f64, N> {
        SVector::from_fn(|k, _| t.powi(k as i32))
    }
}
