//! The result of rectifying and retargeting: a map, its grid, and a report on the marked lines.

use plumbline_image::grid::GridMesh;
use plumbline_image::warp::WarpField;
use plumbline_num::math::{Point2, Rect, Vec2};

/// Largest side of an output, px: the renderer's limit.
pub(crate) const MAX_SIDE: usize = 16_384;
/// Samples along each side of the source that decide how much of it is shown: to about a percent.
const SHOWN_SAMPLES: usize = 96;
/// Deviation from straightness, px, and as a fraction of the length, above both of which a line counts as bent.
const BENT_PX: f64 = 1.0;
const BENT_FRACTION: f64 = 1e-3;

/// Where a point of the source lies in the output; `None` where the warp does not show it.
pub type Forward = dyn Fn(Point2) -> Option<Point2> + Send + Sync;

/// A warp of a picture, ready to be rendered.
pub struct PhotoWarp {
    /// Where each point of the output comes from.
    pub field: WarpField,
    /// Width and height of the output, px.
    pub size: (usize, usize),
    /// The size that the output would have had at the density of the source, where that is many more pixels than the source
    /// has and [`Self::size`] was bounded.
    pub bounded_from: Option<(usize, usize)>,
    /// The grid that was solved, as it lies in the output, px.
    pub mesh: GridMesh,
    /// Where each point of the source lies in the output, also outside its frame.
    pub forward: Box<Forward>,
    /// The marked lines, in their order.
    pub lines: Vec<LineReport>,
    /// Indices of the faces that the crop cuts.
    pub cut_faces: Vec<usize>,
    /// Indices of the faces below which the crop cuts the body, down to three heights of the face, where the source shows it.
    pub cut_below: Vec<usize>,
    /// Solves of the energy; 0 where the map has a closed form.
    pub iterations: usize,
}

impl std::fmt::Debug for PhotoWarp {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { field, size, bounded_from, mesh, lines, cut_faces, cut_below, iterations, forward: _ } = self;
        let mut s = f.debug_struct("PhotoWarp");
        s.field("field", field).field("size", size).field("mesh", mesh).field("lines", lines);
        s.field("bounded_from", bounded_from)
            .field("cut_faces", cut_faces)
            .field("cut_below", cut_below)
            .field("iterations", iterations)
            .finish_non_exhaustive()
    }
}

impl PhotoWarp {
    /// A warp of `size` px that reports nothing: no bound, no lines, no cuts, no solves.
    ///
    /// ```
    /// use plumbline_image::grid::Grid;
    /// use plumbline_image::warp::WarpField;
    /// use plumbline_photo::PhotoWarp;
    ///
    /// let mesh = Grid { cols: 2, rows: 1, width: 20.0, height: 10.0 }.to_mesh();
    /// let same = PhotoWarp::new(WarpField::identity(), (20, 10), mesh, Box::new(Some));
    /// assert!(same.lines.is_empty() && same.source_shown((20.0, 10.0)) == 1.0);
    /// ```
    pub fn new(field: WarpField, size: (usize, usize), mesh: GridMesh, forward: Box<Forward>) -> Self {
        let (lines, cut_faces, cut_below) = (Vec::new(), Vec::new(), Vec::new());
        Self { field, size, bounded_from: None, mesh, forward, lines, cut_faces, cut_below, iterations: 0 }
    }

    /// Part of the area of the source, of so many px, that the output shows, in [0, 1].
    pub fn source_shown(&self, (width, height): (f64, f64)) -> f64 {
        let frame = Rect::of_size(self.size.0 as f64, self.size.1 as f64);
        let source = Rect::of_size(width, height);
        let at = |k: usize| ((k as f64) + 0.5) / SHOWN_SAMPLES as f64;
        let shows = |k: &usize| {
            let p = source.at(at(k % SHOWN_SAMPLES), at(k / SHOWN_SAMPLES));
            (self.forward)(p).is_some_and(|p| frame.contains(p))
        };
        let all = SHOWN_SAMPLES * SHOWN_SAMPLES;
        (0..all).filter(shows).count() as f64 / all as f64
    }
}

/// Report on a marked line in the output.
#[derive(Clone, Debug, PartialEq)]
pub struct LineReport {
    /// The line's name.
    pub name: String,
    /// Largest distance of a marked point from the best straight line, output px.
    pub max_px: f64,
    /// Root mean square of these distances, output px.
    pub rms_px: f64,
    /// Length, output px.
    pub length_px: f64,
    /// Angle from +x towards +y, rad, in (−π/2, π/2].
    pub angle: f64,
    /// Difference to the wanted orientation, rad; `None` for a free line.
    pub angle_error: Option<f64>,
    /// Largest distance of a marked point from the great circle that fits the line best, source px: large where the lens or
    /// the marking is wrong. `None` without a lens, and for lines of two points.
    pub off_lens_px: Option<f64>,
    /// Fraction of the marked points that the output shows.
    pub shown: f64,
    /// What its edge in the result says; `None` where it was not looked for, or none was found.
    pub edge: Option<Straightness>,
}

/// How straight an edge is in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Straightness {
    /// Largest distance from the best straight line, px.
    pub max_px: f64,
    /// Distance of its ends, px.
    pub length_px: f64,
}

impl LineReport {
    /// Largest distance from straight, px: of its edge in the result, or of its points where no edge was found.
    pub fn off_px(&self) -> f64 {
        self.edge.map_or(self.max_px, |edge| edge.max_px)
    }

    /// The line could not be made straight.
    pub fn is_bent(&self) -> bool {
        let length = self.edge.map_or(self.length_px, |edge| edge.length_px);
        self.off_px() > BENT_PX && self.off_px() > BENT_FRACTION * length
    }
}

/// The straight line nearest to points in the sense of total least squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedLine {
    /// A point of it: the points' mean.
    pub center: Vec2,
    /// Its direction, a unit vector from the first point towards the last.
    pub direction: Vec2,
}

impl FittedLine {
    /// The line through `points`, which are two or more and not all the same; `None` otherwise.
    pub fn through(points: &[Point2]) -> Option<Self> {
        let count = points.len() as f64;
        let center = points.iter().fold(Vec2::zeros(), |sum, p| sum + p.coords) / count;
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for p in points {
            let d = p.coords - center;
            xx += d.x * d.x;
            xy += d.x * d.y;
            yy += d.y * d.y;
        }
        let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
        let axis = Vec2::new(angle.cos(), angle.sin());
        let span = points.last()? - points.first()?;
        let direction = if axis.dot(&span) < 0.0 { -axis } else { axis };
        (xx + yy > 0.0 && direction.x.is_finite()).then_some(Self { center, direction })
    }

    /// Its normal: the direction rotated by 90° from +x to +y.
    pub fn normal(&self) -> Vec2 {
        Vec2::new(-self.direction.y, self.direction.x)
    }

    /// Signed distance of a point from the line.
    pub fn off(&self, p: Point2) -> f64 {
        self.normal().dot(&(p.coords - self.center))
    }

    /// Position of a point along the line, from the center.
    pub fn along(&self, p: Point2) -> f64 {
        self.direction.dot(&(p.coords - self.center))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fitted_line_minimizes_the_distances_of_its_points() {
        let points = [(0.0, 0.2), (1.0, 0.9), (2.0, 2.3), (3.0, 2.8)].map(|(x, y)| Point2::new(x, y));
        let line = FittedLine::through(&points).expect("points apart");
        let cost = |angle: f64| {
            let n = Vec2::new(-angle.sin(), angle.cos());
            points.iter().map(|p| n.dot(&(p.coords - line.center)).powi(2)).sum::<f64>()
        };
        let angle = line.direction.y.atan2(line.direction.x);
        assert!(cost(angle) < cost(angle + 1e-3) && cost(angle) < cost(angle - 1e-3));
        assert!(line.direction.x > 0.0, "from the first point towards the last");
        let offs: f64 = points.iter().map(|p| line.off(*p)).sum();
        assert!(offs.abs() < 1e-12);
    }

    #[test]
    fn points_on_one_spot_have_no_line() {
        assert_eq!(FittedLine::through(&[Point2::new(1.0, 2.0); 3]), None);
        assert_eq!(FittedLine::through(&[]), None);
    }
}
