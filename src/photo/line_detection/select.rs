//! Selection, names and orientations of the detected lines.

use super::arc::Arc;
use super::vanishing::Directions;
use super::{DetectedLine, Line, LineDetectionOptions, LineGroup, Orientation, PI};
use plumbline_camera::{Lens, Vec3};
use plumbline_num::math::Point2;

/// Distance of points along a line, as a fraction of the photo's diagonal.
const SPACING: f64 = 0.02;
/// Minimum fraction of a line along which an edge is detected.
const MIN_COVERAGE: f64 = 0.6;
/// Cells along a side for the even distribution of lines over the photo.
const CELLS: f64 = 4.0;
/// Sine of the maximum pitch at which verticals are constrained, 20°: in a view up a tower they are meant to converge.
const MAX_PITCH_SINE: f64 = 0.34;
/// Sine of the maximum angle between a horizontal and the image plane, 4°, at which it is constrained: a wall that
/// faces the camera.
const MAX_FACING_SINE: f64 = 0.07;
/// Maximum slope relative to an axis, half a degree, at which a line of a photo without a lens is constrained to that
/// axis.
const MAX_AXIS_SLOPE: f64 = 0.0087;

/// A line before it is named.
struct Course {
    points: Vec<Point2>,
    group: LineGroup,
    length_px: f64,
    coverage: f64,
    clarity: f64,
    orientation: Orientation,
}

/// The best lines, the best first.
pub(super) fn best(
    arcs: &[Arc],
    directions: &Directions,
    lens: &Lens,
    flat: bool,
    options: &LineDetectionOptions,
) -> Vec<DetectedLine> {
    let diagonal = lens.size.0.hypot(lens.size.1);
    let long_enough = |c: &Course| {
        let least = if c.group == LineGroup::Free && !flat { options.min_free_length } else { options.min_length };
        c.length_px * c.clarity >= least * diagonal && c.coverage >= MIN_COVERAGE
    };
    let courses = arcs.iter().filter_map(|a| course(a, directions, lens, flat));
    let chosen = spread(courses.filter(long_enough).collect(), lens.size, options.max_lines);
    let mut counts = [0_usize; 5];
    let named = chosen.into_iter().map(|c| {
        let (word, slot) = match c.group {
            LineGroup::Vertical => ("vertical".to_owned(), 0),
            LineGroup::Horizontal(i) => (format!("horizontal {}", (b'a' + i as u8) as char), 1 + i.min(2)),
            LineGroup::Free => ("free".to_owned(), 4),
        };
        counts[slot] += 1;
        let line = Line { name: format!("{word} {}", counts[slot]), points: c.points, orientation: c.orientation };
        DetectedLine { line, group: c.group, length_px: c.length_px, coverage: c.coverage }
    });
    named.collect()
}

/// The course of an arc over the photo; `None` where less than two points of it are seen.
fn course(arc: &Arc, directions: &Directions, lens: &Lens, flat: bool) -> Option<Course> {
    let points = seen_points(arc, lens)?;
    let length_px = points.windows(2).map(|p| (p[1] - p[0]).norm()).sum();
    let group = directions.group(arc);
    let coverage = (arc.seen / (2.0 * arc.half)).min(1.0);
    let lies = if flat { along_axis(points[0], points[points.len() - 1]) } else { orientation(group, directions) };
    let points = if flat { vec![points[0], points[points.len() - 1]] } else { points };
    Some(Course { points, group, length_px, coverage, clarity: arc.clarity, orientation: lies })
}

/// Points along an arc, evenly spaced in angle, the longest run of them that the photo shows without a jump: a panorama
/// may cut a line in two.
fn seen_points(arc: &Arc, lens: &Lens) -> Option<Vec<Point2>> {
    let diagonal = lens.size.0.hypot(lens.size.1);
    let spacing = (SPACING * diagonal / lens.focal.x.max(lens.focal.y)).min(PI / 60.0);
    let n = (2.0 * arc.half / spacing).ceil().clamp(2.0, 400.0) as usize;
    let mut runs: Vec<Vec<Point2>> = vec![Vec::new()];
    for k in 0..=n {
        let ray: Vec3 = arc.at(arc.half * (2.0 * k as f64 / n as f64 - 1.0));
        let inside = |p: &Point2| p.x >= 0.0 && p.y >= 0.0 && p.x <= lens.size.0 && p.y <= lens.size.1;
        let point = lens.project(&ray).filter(inside);
        let last = runs.last().and_then(|r| r.last());
        let jump = point.zip(last).is_some_and(|(p, q)| (p - q).norm() > 0.25 * diagonal);
        if point.is_none() || jump {
            runs.push(Vec::new());
        }
        runs.last_mut()?.extend(point);
    }
    let longest = runs.into_iter().rev().max_by_key(Vec::len)?;
    (longest.len() >= 2).then_some(longest)
}

/// How a line of a group shall lie.
fn orientation(group: LineGroup, directions: &Directions) -> Orientation {
    let Some(down) = directions.down.filter(|d| d.z.abs() < MAX_PITCH_SINE) else { return Orientation::Free };
    match group {
        LineGroup::Vertical => Orientation::Vertical,
        LineGroup::Horizontal(i) => {
            let across = down.cross(&Vec3::z()).normalize();
            let facing = directions.horizontals[i].cross(&across).norm() < MAX_FACING_SINE;
            if facing { Orientation::Horizontal } else { Orientation::Free }
        }
        LineGroup::Free => Orientation::Free,
    }
}

/// How a line of a photo without a lens lies already.
fn along_axis(a: Point2, b: Point2) -> Orientation {
    let d = (b - a).abs();
    if d.y < MAX_AXIS_SLOPE * d.x {
        Orientation::Horizontal
    } else if d.x < MAX_AXIS_SLOPE * d.y {
        Orientation::Vertical
    } else {
        Orientation::Free
    }
}

/// The longest lines, each counting the less the more lines its part of the photo has already.
fn spread(mut courses: Vec<Course>, size: (f64, f64), most: usize) -> Vec<Course> {
    let cell = |c: &Course| {
        let p = c.points[c.points.len() / 2];
        let index = |v: f64, side: f64| ((v / side * CELLS).clamp(0.0, CELLS - 1.0)) as usize;
        index(p.y, size.1) * CELLS as usize + index(p.x, size.0)
    };
    let mut taken = [0.0_f64; (CELLS * CELLS) as usize];
    let mut chosen = Vec::new();
    while chosen.len() < most && !courses.is_empty() {
        let worth = |c: &Course| c.length_px * c.coverage * c.clarity / (1.0 + 0.5 * taken[cell(c)]);
        let best = (0..courses.len()).rev().max_by(|i, j| worth(&courses[*i]).total_cmp(&worth(&courses[*j])));
        let course = courses.remove(best.expect("courses are left"));
        taken[cell(&course)] += 1.0;
        chosen.push(course);
    }
    chosen
}
