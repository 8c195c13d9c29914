//! Following an edge over its whole visible length.
//!
//! A segment detector cuts an edge where it bends, where a corner touches it, and where its contrast changes sign, as along a row
//! of tiles. Followed from such a piece, the edge is located every [`STEP`] px across its predicted course: with `v(o)` the mean
//! gray level along the course at the offset `o` across it,
//!
//! ```text
//! o* = argmax |v(o + 1) − v(o − 1)| (1 − o²/2r²),      |o| ≤ r,
//! ```
//!
//! refined by a parabola; either sign counts. The course ahead is the parabola `y = a + b t + c t²` that fits the last
//! [`WINDOW`] px, so that an edge that a lens bends is followed too. It ends where no step of [`MIN_CONTRAST`] is found for longer
//! than [`MAX_GAP`], or where it would bend more than any lens bends a line; the last located sample is its end.

use nalgebra::{SMatrix, SVector};

use crate::PlaneRef;
use plumbline_num::math::{Point2, Vec2};

/// Distance of samples along an edge, px: neighboring samples share pixels, more would repeat them.
const STEP: f64 = 2.0;
/// Length of the end of an edge that its continuation is predicted from, px. Shorter ends turn with the noise of a few samples,
/// longer ones lag behind the curvature of a fisheye's border.
const WINDOW: f64 = 60.0;
/// `r`, px: the prediction over a gap is accurate to about one px, and an edge 4 px aside is another one.
const REACH: f64 = 2.0;
/// Least step in gray levels of 255 between two px apart: twice the noise of a photo in the dark.
const MIN_CONTRAST: f64 = 7.0;
/// Longest gap, as a fraction of what is seen of the edge, and its bounds, px: corners of tiles blank an edge for three or four px
/// on either side, and a short piece says little about what lies far ahead.
const MAX_GAP: (f64, f64, f64) = (0.1, 10.0, 24.0);
/// Least radius of curvature, as a fraction of the picture's longer side: a fisheye of 180° over the width bends lines at its border
/// with a radius of a third of it.
const MIN_RADIUS: f64 = 0.25;
/// Least number of samples that a course is predicted from.
const MIN_SAMPLES: usize = 5;

/// Follows edges of a picture of gray levels 0 to 255.
#[derive(Clone, Copy, Debug)]
pub struct EdgeTracer<'a> {
    luma: PlaneRef<'a, f32>,
}

impl<'a> EdgeTracer<'a> {
    /// On a picture; samples that are not finite belong to no edge.
    pub fn new(luma: PlaneRef<'a, f32>) -> Self {
        Self { luma }
    }

    /// The edge along `course`, px, and beyond its ends as far as it goes; `None` where less than half of the course lies along
    /// an edge.
    pub fn trace(&self, course: &[Point2]) -> Option<TracedEdge> {
        let mut points = self.along(course)?;
        let along = points.len();
        self.extend(&mut points);
        let end = points.len();
        points.reverse();
        self.extend(&mut points);
        points.reverse();
        let start = points.len() - end;
        Some(TracedEdge { points, course: start..start + along })
    }

    /// The edge along `course` alone; `None` where less than half of it lies along an edge.
    pub fn along(&self, course: &[Point2]) -> Option<Vec<Point2>> {
        let (mut edge, mut asked) = (Vec::new(), 0_usize);
        for pair in course.windows(2) {
            let span = pair[1] - pair[0];
            let Some(tangent) = span.try_normalize(1e-9) else { continue };
            let count = (span.norm() / STEP).ceil() as usize;
            for k in 0..count {
                asked += 1;
                edge.extend(self.locate(pair[0] + span * (k as f64 / count as f64), tangent));
            }
        }
        (edge.len() >= MIN_SAMPLES && 2 * edge.len() >= asked).then_some(edge)
    }

    /// Appends what follows the end of an edge.
    fn extend(&self, edge: &mut Vec<Point2>) {
        let (fraction, least, most) = MAX_GAP;
        let longest = MIN_RADIUS * self.luma.width().max(self.luma.height()) as f64;
        let seen = edge.len() as f64 * STEP;
        let mut beyond = STEP;
        let mut ahead = Course::of_end(edge, longest);
        while let Some(course) = &ahead {
            let gap = (fraction * (seen + edge.len() as f64 * STEP)).clamp(least, most);
            if beyond > gap {
                return;
            }
            let (p, tangent) = course.at(beyond);
            match self.locate(p, tangent) {
                Some(q) => {
                    edge.push(q);
                    beyond = STEP;
                    ahead = Course::of_end(edge, longest);
                }
                None => beyond += STEP,
            }
        }
    }

    /// The edge nearest to `p` across a course with this tangent.
    fn locate(&self, p: Point2, tangent: Vec2) -> Option<Point2> {
        /// Offsets per px.
        const FINE: usize = 2;
        const SIDE: usize = (REACH as usize + 1) * FINE;
        let normal = Vec2::new(-tangent.y, tangent.x);
        let mut levels = [0.0_f64; 2 * (SIDE + FINE) + 1];
        for (k, level) in levels.iter_mut().enumerate() {
            let at = p + normal * ((k as f64 - (SIDE + FINE) as f64) / FINE as f64);
            let three = [-1.0, 0.0, 1.0].map(|t| self.gray(at + tangent * t));
            *level = (three[0]? + three[1]? + three[2]?) / 3.0;
        }
        let step = |k: usize| (levels[k + 2 * FINE] - levels[k]).abs();
        let offset = |k: usize| (k as f64 - SIDE as f64) / FINE as f64;
        let worth = |k: usize| step(k) * (1.0 - 0.5 * (offset(k) / REACH).powi(2));
        let peaks = (1..2 * SIDE).filter(|&k| {
            offset(k).abs() <= REACH && step(k) >= MIN_CONTRAST && step(k) >= step(k - 1) && step(k) >= step(k + 1)
        });
        let best = peaks.max_by(|i, j| worth(*i).total_cmp(&worth(*j)))?;
        let (before, here, after) = (step(best - 1), step(best), step(best + 1));
        let bend = before - 2.0 * here + after;
        let shift = if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 };
        Some(p + normal * (offset(best) + shift / FINE as f64))
    }

    /// The gray level between the four nearest pixels; `None` outside the picture.
    fn gray(&self, p: Point2) -> Option<f64> {
        let (x, y) = (p.x - 0.5, p.y - 0.5);
        let inside = x >= 0.0 && y >= 0.0 && x < self.luma.width() as f64 - 1.0 && y < self.luma.height() as f64 - 1.0;
        if !inside {
            return None;
        }
        let (i, j) = (x as usize, y as usize);
        let (s, t) = (x - i as f64, y - j as f64);
        let row = |j: usize| {
            let row = self.luma.row(j);
            f64::from(row[i]) * (1.0 - s) + f64::from(row[i + 1]) * s
        };
        Some(row(j) * (1.0 - t) + row(j + 1) * t).filter(|v| v.is_finite())
    }
}

/// An edge that was followed.
#[derive(Clone, Debug, PartialEq)]
pub struct TracedEdge {
    /// Located points in order along it, px, one every 2 px where it is seen.
    pub points: Vec<Point2>,
    /// Those along the course it was followed from; the others lie beyond its ends.
    pub course: std::ops::Range<usize>,
}

impl TracedEdge {
    /// Distance along it from its first point to its last, px.
    pub fn length(&self) -> f64 {
        self.points.windows(2).map(|p| (p[1] - p[0]).norm()).sum()
    }
}

/// Largest distance of an edge's continuation from the cubic through what is known of it, px: twice the scatter of samples, half the
/// least distance between two edges that are distinguished.
const MAX_OFF_CUBIC: f64 = 0.7;
/// Rounds in which samples that lie off the smooth part are left out, and how far off they lie: in medians of all distances, and at
/// least, px.
const TRIMMINGS: usize = 3;
const OUTLIER: f64 = 3.0;
const MIN_OUTLIER: f64 = 0.3;

impl TracedEdge {
    /// The smooth part: the course and what continues it as a cubic does, without samples that lie off by more than noise does, as
    /// where a shadow or a hand crosses the edge. A lens bends lines smoothly; where an edge leaves the cubic through what is known of it,
    /// another begins.
    #[must_use]
    pub fn smooth(&self) -> Self {
        let (points, mut known) = (&self.points, self.course.clone());
        // Outwards by a quarter of what is known at a time, since a cubic says little about what lies far ahead; less where that much does
        // not fit. Single samples may lie off, as at the corners of tiles.
        let mut part = 4;
        while let Some(cubic) = SmoothCurve::<4>::through(&points[known.clone()]) {
            let step = known.len().div_ceil(part).max(MIN_SAMPLES);
            let fits = |run: &[Point2]| {
                let mut offs: Vec<f64> = run.iter().map(|p| cubic.off(*p).abs()).collect();
                offs.sort_by(f64::total_cmp);
                offs.get(offs.len() / 2).is_some_and(|usual| *usual <= MAX_OFF_CUBIC)
            };
            let (start, end) = (known.start.saturating_sub(step), (known.end + step).min(points.len()));
            let (before, after) = (fits(&points[start..known.start]), fits(&points[known.end..end]));
            match (before, after) {
                (false, false) if step == MIN_SAMPLES => break,
                (false, false) => part *= 2,
                _ => known = if before { start } else { known.start }..if after { end } else { known.end },
            }
        }
        let mut own: Vec<bool> = (0..points.len()).map(|k| known.contains(&k)).collect();
        let kept = |own: &[bool]| -> Vec<Point2> {
            points.iter().zip(own).filter(|(_, own)| **own).map(|(p, _)| *p).collect()
        };
        for _ in 0..TRIMMINGS {
            let Some(curve) = SmoothCurve::<6>::through(&kept(&own)) else { break };
            let mut offs: Vec<f64> = kept(&own).iter().map(|p| curve.off(*p).abs()).collect();
            offs.sort_by(f64::total_cmp);
            let most = (OUTLIER * offs[offs.len() / 2]).max(MIN_OUTLIER);
            points.iter().zip(&mut own).for_each(|(p, own)| *own &= curve.off(*p).abs() <= most);
        }
        let start = own[..self.course.start].iter().filter(|own| **own).count();
        let along = own[self.course.clone()].iter().filter(|own| **own).count();
        Self { points: kept(&own), course: start..start + along }
    }
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
        let (first, last) = (points.first()?, points.last()?);
        let along = (last - first).try_normalize(1e-9)?;
        let (origin, half) = (nalgebra::center(first, last), 0.5 * (last - first).norm());
        let across = Vec2::new(-along.y, along.x);
        let (mut moments, mut right) = (SMatrix::<f64, N, N>::zeros(), SVector::<f64, N>::zeros());
        for d in points.iter().map(|p| p - origin) {
            let row = Self::powers(along.dot(&d) / half);
            moments += row * row.transpose();
            right += row * across.dot(&d);
        }
        // Few samples leave high powers open: a pull to zero far below the weight of one sample.
        moments += SMatrix::identity() * (1e-6 * points.len() as f64);
        Some(Self { origin, along, half, coefficients: moments.cholesky()?.solve(&right) })
    }

    /// The point at a fraction of the chord, from 0 to 1.
    pub fn at(&self, fraction: f64) -> Point2 {
        let t = 2.0 * fraction - 1.0;
        let across = Vec2::new(-self.along.y, self.along.x);
        self.origin + self.along * (t * self.half) + across * self.coefficients.dot(&Self::powers(t))
    }

    /// Signed distance of a point from it, across the chord.
    pub fn off(&self, p: Point2) -> f64 {
        let d = p - self.origin;
        let across = Vec2::new(-self.along.y, self.along.x);
        across.dot(&d) - self.coefficients.dot(&Self::powers(self.along.dot(&d) / self.half))
    }

    fn powers(t: f64) -> SVector<f64, N> {
        SVector::from_fn(|k, _| t.powi(k as i32))
    }
}

/// The end of an edge as a parabola in axes along and across it.
#[derive(Debug)]
struct Course {
    origin: Point2,
    along: Vec2,
    /// Position of the last sample.
    last: f64,
    a: f64,
    b: f64,
    c: f64,
}

impl Course {
    /// Of the last samples; `None` for too few, or where they bend with less than the radius `least`, px.
    fn of_end(edge: &[Point2], least: f64) -> Option<Self> {
        let from = edge.len().saturating_sub((WINDOW / STEP) as usize);
        let end = &edge[from..];
        let (first, last) = (end.first()?, end.last()?);
        let along = (last - first).try_normalize(1e-9)?;
        let across = Vec2::new(-along.y, along.x);
        if end.len() < MIN_SAMPLES {
            return None;
        }
        let half = 0.5 * (last - first).norm();
        let origin = nalgebra::center(first, last);
        let mut moments = nalgebra::Matrix3::<f64>::zeros();
        let mut right = nalgebra::Vector3::<f64>::zeros();
        for p in end {
            let d = p - origin;
            let t = along.dot(&d) / half;
            let row = nalgebra::Vector3::new(1.0, t, t * t);
            moments += row * row.transpose();
            right += row * across.dot(&d);
        }
        // A short end determines no curvature: a weak pull to a straight one.
        moments[(2, 2)] += 0.02 * end.len() as f64;
        let fit = moments.cholesky()?.solve(&right);
        let (a, b, c) = (fit[0], fit[1] / half, fit[2] / (half * half));
        (2.0 * c.abs() * least < 1.0).then(|| Self { origin, along, last: along.dot(&(last - origin)), a, b, c })
    }

    /// The point so many px beyond the last sample, and the tangent there.
    fn at(&self, beyond: f64) -> (Point2, Vec2) {
        let across = Vec2::new(-self.along.y, self.along.x);
        let t = self.last + beyond;
        let point = self.origin + self.along * t + across * (self.a + self.b * t + self.c * t * t);
        (point, (self.along + across * (self.b + 2.0 * self.c * t)).normalize())
    }
}

/// An edge by fewer points with less noise: its ends, each the mean of three samples, and between them the means of `parts` runs of
/// samples. An edge of fewer than three samples per part is returned as it is.
pub fn averaged(edge: &[Point2], parts: usize) -> Vec<Point2> {
    if edge.len() < 3 * parts || parts == 0 {
        return edge.to_vec();
    }
    let bound = |k: usize| k * edge.len() / parts;
    let mean = |run: &[Point2]| {
        let sum = run.iter().fold(Vec2::zeros(), |sum, p| sum + p.coords);
        Point2::from(sum / run.len() as f64)
    };
    let between = (0..parts).map(|k| mean(&edge[bound(k)..bound(k + 1)]));
    let (first, last) = (mean(&edge[..3]), mean(&edge[edge.len() - 3..]));
    std::iter::once(first).chain(between).chain(std::iter::once(last)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Plane;

    /// Dark inside a circle, or a board of squares bent by it, with a soft edge.
    fn disk(center: Point2, radius: f64) -> Plane<f32> {
        Plane::from_fn(300, 200, |x, y| {
            let d = (Point2::new(x as f64 + 0.5, y as f64 + 0.5) - center).norm() - radius;
            (128.0 + 90.0 * (d / 1.2).clamp(-1.0, 1.0)) as f32
        })
    }

    #[test]
    fn a_bent_edge_is_followed_over_its_whole_length_from_a_short_piece() {
        let (center, radius) = (Point2::new(150.0, 420.0), 350.0);
        let luma = disk(center, radius);
        let on = |x: f64| Point2::new(x, center.y - (radius * radius - (x - center.x).powi(2)).sqrt());
        let edge = EdgeTracer::new(luma.as_ref()).trace(&[on(140.0), on(170.0)]).expect("an edge").points;
        assert!(edge[0].x < 8.0 && edge[edge.len() - 1].x > 292.0, "{} to {}", edge[0], edge[edge.len() - 1]);
        let worst = edge.iter().map(|p| ((p - center).norm() - radius).abs()).fold(0.0, f64::max);
        assert!(worst < 0.3, "off by {worst} px");
    }

    #[test]
    fn an_edge_goes_on_where_dark_and_bright_change_sides_and_ends_where_it_ends() {
        let tile = |x: usize, y: usize| if (x / 40 + y / 40).is_multiple_of(2) { 40.0 } else { 200.0 };
        let luma = Plane::from_fn(300, 200, |x, y| if x < 240 { tile(x, y) } else { 120.0_f32 });
        let course = [Point2::new(90.0, 80.0), Point2::new(112.0, 80.0)];
        let edge = EdgeTracer::new(luma.as_ref()).trace(&course).expect("an edge").points;
        assert!(edge[0].x < 8.0, "it begins at {}", edge[0]);
        let end = edge[edge.len() - 1].x;
        assert!((230.0..246.0).contains(&end), "it ends at {end}");
        assert!(edge.iter().all(|p| (p.y - 80.0).abs() < 0.3));
    }

    #[test]
    fn no_edge_is_followed_where_there_is_none() {
        let luma = Plane::from_fn(100, 100, |x, _| x as f32);
        assert_eq!(EdgeTracer::new(luma.as_ref()).trace(&[Point2::new(20.0, 50.0), Point2::new(80.0, 50.0)]), None);
    }

    #[test]
    fn averaging_keeps_the_order_and_the_ends_within_a_part() {
        let edge: Vec<Point2> = (0..100).map(|k| Point2::new(f64::from(k), 1.0)).collect();
        let means = averaged(&edge, 10);
        let x: Vec<f64> = means.iter().map(|p| p.x).collect();
        assert_eq!(x, [1.0, 4.5, 14.5, 24.5, 34.5, 44.5, 54.5, 64.5, 74.5, 84.5, 94.5, 98.0]);
        assert_eq!(averaged(&edge[..5], 10), edge[..5]);
    }
}
