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
//!
//! The course that an edge is followed from may be a few px off, since a detector joins pieces that lie about one line and the lens is
//! not known exactly. Where more than `r` beside it is searched, the offsets of all samples along it are chosen at once, since one by one they
//! would jump to whichever edge is the nearest. With the step `s` at an offset they maximize
//!
//! ```text
//! Σ s/(s + s₀) (1 − o²/2r²) − 2 λ Σ |oₖ₊₁ − oₖ|,
//! ```
//!
//! by dynamic programming (Amini, Weymouth and Jain 1990); each sample is the edge within a px of its offset.

use super::SmoothCurve;
use crate::PlaneRef;
use plumbline_num::math::{Point2, Vec2};

/// Distance of samples along an edge, px: neighboring samples share pixels, more would repeat them.
const STEP: f64 = 2.0;
/// Length of the end of an edge that its continuation is predicted from, px. Shorter ends turn with the noise of a few samples,
/// longer ones lag behind the curvature of a fisheye's border.
const WINDOW: f64 = 60.0;
/// Offsets per px.
const FINE: usize = 2;
/// Maximum number of steps of a profile, which goes one px beyond its reach on both sides.
const MAX_STEPS: usize = 2 * (EdgeTracer::MAX_REACH + 1) * FINE + 1;
/// `s₀`, the step in gray levels at which an edge is half as clear as it can be: twice the least.
const HALF_CLEAR: f64 = 14.0;
/// `λ`, what a path pays for half a px aside, in clear samples. To another edge 4 px away it pays two, and passes eight samples without an edge.
const ASIDE: f64 = 0.25;
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
    /// `r` of a course that is known, px: the prediction over a gap is accurate to about one px, and an edge 4 px aside is another one.
    pub const REACH: usize = 2;
    /// The largest `r`, px.
    pub const MAX_REACH: usize = 4;

    /// On a picture; samples that are not finite belong to no edge.
    pub fn new(luma: PlaneRef<'a, f32>) -> Self {
        Self { luma }
    }

    /// The edge along `course`, px, and beyond its ends as far as it goes; `None` where less than half of the course lies along
    /// an edge. `reach` is how far off the course the edge may be, px, at most
    /// [`Self::MAX_REACH`]: [`Self::REACH`] where the course is measured.
    pub fn trace(&self, course: &[Point2], reach: usize) -> Option<TracedEdge> {
        let mut points = self.along(course, reach)?;
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
    fn along(&self, course: &[Point2], reach: usize) -> Option<Vec<Point2>> {
        let mut profiles = Vec::new();
        // Distance from the next point of the course to the next sample, so that points that lie close count for no more than others.
        let mut ahead = 0.0;
        for pair in course.windows(2) {
            let span = pair[1] - pair[0];
            let Some(tangent) = span.try_normalize(1e-9) else { continue };
            while ahead < span.norm() {
                profiles.push(self.profile(pair[0] + tangent * ahead, tangent, reach));
                ahead += STEP;
            }
            ahead -= span.norm();
        }
        let edge: Vec<Point2> = if reach > Self::REACH {
            let path = clearest_path(&profiles);
            profiles.iter().zip(path).filter_map(|(profile, offset)| profile.as_ref()?.peak_near(offset)).collect()
        } else {
            profiles.iter().flatten().filter_map(Profile::nearest).collect()
        };
        (edge.len() >= MIN_SAMPLES && 2 * edge.len() >= profiles.len()).then_some(edge)
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
        self.profile(p, tangent, Self::REACH)?.nearest()
    }

    /// The steps of gray level across a course at `p`; `None` at the border of the picture.
    fn profile(&self, p: Point2, tangent: Vec2, reach: usize) -> Option<Profile> {
        let reach = reach.min(Self::MAX_REACH);
        let side = (reach + 1) * FINE;
        let normal = Vec2::new(-tangent.y, tangent.x);
        let mut levels = [0.0; MAX_STEPS + 2 * FINE];
        for (k, level) in levels[..=2 * (side + FINE)].iter_mut().enumerate() {
            let at = p + normal * ((k as f64 - (side + FINE) as f64) / FINE as f64);
            *level = (self.gray(at - tangent)? + self.gray(at)? + self.gray(at + tangent)?) / 3.0;
        }
        let mut steps = [0.0; MAX_STEPS];
        for (k, step) in steps[..=2 * side].iter_mut().enumerate() {
            *step = (levels[k + 2 * FINE] - levels[k]).abs();
        }
        Some(Profile { p, normal, reach, steps })
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
            let [a, b] = self.luma.row(j)[i..i + 2] else { return f64::NAN };
            f64::from(a) * (1.0 - s) + f64::from(b) * s
        };
        Some(row(j) * (1.0 - t) + row(j + 1) * t).filter(|v| v.is_finite())
    }
}

/// The steps of gray level across a course, every half px.
#[derive(Debug)]
struct Profile {
    p: Point2,
    normal: Vec2,
    /// px.
    reach: usize,
    /// At offsets from `-reach - 1` to `reach + 1` px, and zeros.
    steps: [f64; MAX_STEPS],
}

impl Profile {
    fn count(&self) -> usize {
        2 * (self.reach + 1) * FINE + 1
    }

    fn offset(&self, k: usize) -> f64 {
        k as f64 / FINE as f64 - (self.reach + 1) as f64
    }

    /// From one on the course to a half at the end of the reach.
    fn nearness(&self, k: usize) -> f64 {
        1.0 - 0.5 * (self.offset(k) / self.reach as f64).powi(2)
    }

    /// From zero to one on the course.
    fn clarity(&self, k: usize) -> f64 {
        let step = self.steps[k];
        if step < MIN_CONTRAST { 0.0 } else { step / (step + HALF_CLEAR) * self.nearness(k) }
    }

    /// The edges within reach.
    fn peaks(&self) -> impl Iterator<Item = usize> {
        let step = |k: usize| self.steps[k];
        (FINE..self.count() - FINE)
            .filter(move |&k| step(k) >= MIN_CONTRAST && step(k) >= step(k - 1) && step(k) >= step(k + 1))
    }

    /// Where the edge at a peak is, to a fraction of a px.
    fn refined(&self, peak: usize) -> Point2 {
        let (before, here, after) = (self.steps[peak - 1], self.steps[peak], self.steps[peak + 1]);
        let bend = before - 2.0 * here + after;
        let shift = if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 };
        self.p + self.normal * (self.offset(peak) + shift / FINE as f64)
    }

    /// The clearest edge, those near the course first.
    fn nearest(&self) -> Option<Point2> {
        let worth = |k: &usize| self.steps[*k] * self.nearness(*k);
        self.peaks().max_by(|i, j| worth(i).total_cmp(&worth(j))).map(|peak| self.refined(peak))
    }

    /// The edge within a px of one of the steps.
    fn peak_near(&self, step: usize) -> Option<Point2> {
        let near = self.peaks().filter(|k| k.abs_diff(step) <= FINE);
        near.max_by(|i, j| self.steps[*i].total_cmp(&self.steps[*j])).map(|peak| self.refined(peak))
    }
}

/// Of each profile the step on the clearest path through them; profiles that the border cuts off are passed.
fn clearest_path(profiles: &[Option<Profile>]) -> Vec<usize> {
    let count = profiles.iter().flatten().map(Profile::count).next().unwrap_or(0);
    let mut sums = [0.0_f64; MAX_STEPS];
    let mut came_from = Vec::with_capacity(profiles.len());
    for profile in profiles {
        let (before, mut from) = (sums, [0; MAX_STEPS]);
        for k in 0..count {
            let over = |j: usize| before[j] - if j == k { 0.0 } else { ASIDE };
            let aside = [k.saturating_sub(1), (k + 1).min(count - 1)];
            from[k] = aside.into_iter().fold(k, |best, j| if over(j) > over(best) { j } else { best });
            sums[k] = over(from[k]) + profile.as_ref().map_or(0.0, |profile| profile.clarity(k));
        }
        came_from.push(from);
    }
    let mut at = (0..count).max_by(|i, j| sums[*i].total_cmp(&sums[*j])).unwrap_or(0);
    let mut path = vec![0; profiles.len()];
    for (step, from) in path.iter_mut().zip(&came_from).rev() {
        *step = at;
        at = from[at];
    }
    path
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

/// The end of an edge as a parabola.
#[derive(Debug)]
struct Course {
    parabola: SmoothCurve<3>,
    /// Position of the last sample, px.
    last: f64,
}

impl Course {
    /// Of the last samples; `None` for too few, or where they bend with less than the radius `least`, px.
    fn of_end(edge: &[Point2], least: f64) -> Option<Self> {
        /// A short end determines no curvature: a weak pull to a straight one, in weights of all samples.
        const PULL: f64 = 0.02;
        let from = edge.len().saturating_sub((WINDOW / STEP) as usize);
        let end = Some(&edge[from..]).filter(|end| end.len() >= MIN_SAMPLES)?;
        let parabola = SmoothCurve::fit(end, [0.0, 0.0, PULL].into())?;
        let last = parabola.position(*end.last()?);
        (parabola.bend(last).abs() * least < 1.0).then_some(Self { parabola, last })
    }

    /// The point so many px beyond the last sample, and the tangent there.
    fn at(&self, beyond: f64) -> (Point2, Vec2) {
        self.parabola.point_and_tangent(self.last + beyond)
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
        let edge =
            EdgeTracer::new(luma.as_ref()).trace(&[on(140.0), on(170.0)], EdgeTracer::REACH).expect("an edge").points;
        assert!(edge[0].x < 8.0 && edge[edge.len() - 1].x > 292.0, "{} to {}", edge[0], edge[edge.len() - 1]);
        let worst = edge.iter().map(|p| ((p - center).norm() - radius).abs()).fold(0.0, f64::max);
        assert!(worst < 0.3, "off by {worst} px");
    }

    #[test]
    fn an_edge_goes_on_where_dark_and_bright_change_sides_and_ends_where_it_ends() {
        let tile = |x: usize, y: usize| if (x / 40 + y / 40).is_multiple_of(2) { 40.0 } else { 200.0 };
        let luma = Plane::from_fn(300, 200, |x, y| if x < 240 { tile(x, y) } else { 120.0_f32 });
        let course = [Point2::new(90.0, 80.0), Point2::new(112.0, 80.0)];
        let edge = EdgeTracer::new(luma.as_ref()).trace(&course, EdgeTracer::REACH).expect("an edge").points;
        assert!(edge[0].x < 8.0, "it begins at {}", edge[0]);
        let end = edge[edge.len() - 1].x;
        assert!((230.0..246.0).contains(&end), "it ends at {end}");
        assert!(edge.iter().all(|p| (p.y - 80.0).abs() < 0.3));
    }

    #[test]
    fn an_edge_is_kept_where_the_course_leads_to_a_fainter_one() {
        // Two edges 4 px apart, and a course from the clear one to the faint one.
        let y = |x: f64| 60.0 + 0.02 * x;
        let luma = Plane::from_fn(300, 120, |x, row| {
            let covered = |y: f64| (row as f64 + 1.0 - y).clamp(0.0, 1.0);
            let y = y(x as f64 + 0.5);
            (40.0 + 120.0 * covered(y) - 20.0 * covered(y - 4.0)) as f32
        });
        let course = [Point2::new(10.0, y(10.0)), Point2::new(290.0, y(290.0) - 4.0)];
        let off = |reach: usize| {
            let edge = EdgeTracer::new(luma.as_ref()).trace(&course, reach).expect("an edge").points;
            edge.iter().map(|p| (p.y - y(p.x)).abs()).fold(0.0, f64::max)
        };
        assert!(off(4) < 0.3, "{}", off(4));
        assert!(off(EdgeTracer::REACH) > 3.0, "out of reach it is not seen");
    }

    #[test]
    fn no_edge_is_followed_where_there_is_none() {
        let luma = Plane::from_fn(100, 100, |x, _| x as f32);
        assert_eq!(
            EdgeTracer::new(luma.as_ref())
                .trace(&[Point2::new(20.0, 50.0), Point2::new(80.0, 50.0)], EdgeTracer::REACH),
            None
        );
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
