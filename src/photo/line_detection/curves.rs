//! Edges of a photo as measurements of its lens.
//!
//! Whatever is straight in the world lies on a great circle under the right lens. Without a lens it is not known which edges those
//! are: the longest smooth ones are followed over their whole visible length, and the fit decides which agree.

use plumbline_image::PlaneRef;
use plumbline_image::feature::{EdgeTracer, MAX_OFF_CUBIC, averaged, segments};
use plumbline_num::math::{Point2, Vec2};
use plumbline_num::run::{Run, Stopped};

use super::{Line, Orientation};

/// Points of a followed edge between its ends: enough for the bend of a fisheye, few enough that each is the mean of several
/// samples.
const PARTS: usize = 24;
/// Least length of an edge that is used to find a lens, as a fraction of the diagonal: half as long bends a quarter as much.
const MIN_CURVE: f64 = 0.1;
/// Maximum number of such edges, the longest: the time of the fit grows with it.
const MAX_CURVES: usize = 80;
/// Side of the cells, px, in which an edge occupies the picture, and the part of a segment's course in occupied cells from which on it
/// repeats an edge.
const CELL: f64 = 4.0;
const REPEATED: f64 = 0.5;
/// Least length of a segment that an edge is followed from, px.
const MIN_SEED: f64 = 16.0;

/// The edges of a photo that may be straight in the world, longest first, as measurements of its lens.
///
/// # Errors
/// [`Stopped`].
pub fn curves(luma: PlaneRef<'_, f32>, run: &Run) -> Result<Vec<Line>, Stopped> {
    let (width, height) = (luma.width() as f64, luma.height() as f64);
    let least = MIN_CURVE * width.hypot(height);
    let mut seeds = segments(luma, MIN_SEED);
    run.check()?;
    seeds.sort_by(|a, b| b.length().total_cmp(&a.length()));
    let tracer = EdgeTracer::new(luma);
    let mut occupied = Occupied::new(luma.width(), luma.height());
    let mut found: Vec<(f64, Vec<Point2>)> = Vec::new();
    for seed in &seeds {
        run.check()?;
        let course = [seed.start, seed.end];
        if occupied.holds(course) {
            continue;
        }
        let Some(edge) = tracer.trace(&course, EdgeTracer::REACH) else { continue };
        occupied.add(&edge.points);
        let edge = edge.smooth(MAX_OFF_CUBIC);
        let length = edge.length();
        if length >= least {
            found.push((length, averaged(&edge.points, PARTS)));
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.truncate(MAX_CURVES);
    let line = |(k, (_, points)): (usize, (f64, Vec<Point2>))| Line {
        name: format!("edge {}", k + 1),
        points,
        orientation: Orientation::Free,
    };
    Ok(found.into_iter().enumerate().map(line).collect())
}

/// Cells of a picture that edges run through.
struct Occupied {
    cols: usize,
    cells: Vec<bool>,
}

impl Occupied {
    fn new(width: usize, height: usize) -> Self {
        let count = |side: usize| (side as f64 / CELL).ceil() as usize + 1;
        let (cols, rows) = (count(width), count(height));
        Self { cols, cells: vec![false; cols * rows] }
    }

    fn cell(&self, p: Point2) -> Option<usize> {
        let (i, j) = ((p.x.max(0.0) / CELL) as usize, (p.y.max(0.0) / CELL) as usize);
        (i < self.cols).then_some(j * self.cols + i).filter(|cell| *cell < self.cells.len())
    }

    fn add(&mut self, points: &[Point2]) {
        for p in points {
            // An edge occupies the pixels on both of its sides.
            for aside in [
                Vec2::new(0.0, 0.0),
                Vec2::new(1.5, 0.0),
                Vec2::new(-1.5, 0.0),
                Vec2::new(0.0, 1.5),
                Vec2::new(0.0, -1.5),
            ] {
                if let Some(cell) = self.cell(p + aside) {
                    self.cells[cell] = true;
                }
            }
        }
    }

    fn holds(&self, course: [Point2; 2]) -> bool {
        let count = ((course[1] - course[0]).norm() / CELL).ceil().max(1.0) as usize;
        let at = |k: usize| course[0] + (course[1] - course[0]) * ((k as f64 + 0.5) / count as f64);
        let held = (0..count).filter(|k| self.cell(at(*k)).is_some_and(|cell| self.cells[cell])).count();
        held as f64 > REPEATED * count as f64
    }
}
