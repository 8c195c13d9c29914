//! Cell weights: distortion is visible at line ends, salient regions and faces.
//!
//! ```text
//! w = 1 + 2 w_L + 2 w_S + 4 w_F,    w_L: Gaussians about the ends of lines,  w_S: saliency in [0, 1],  w_F: 1 in a face
//! ```
//!
//! # Reference
//! Carroll et al. 2009, section 4.3.

use super::sphere_grid::SphereGrid;
use super::straight::GridLine;
use plumbline_camera::{Lens, Vec3};
use plumbline_image::Plane;
use plumbline_image::grid::CellPoint;
use plumbline_num::math::{Point2, PointMap, Rect, Vec2};

/// Standard deviation of the Gaussian about the end of a line, as a fraction of the grid's longer side: two cells of
/// the default grid.
const END_SPREAD: f64 = 0.04;
/// Cutoff of that Gaussian, standard deviations: it has fallen to 3e-4.
const END_REACH: f64 = 4.0;
/// Points along each side of a face box: more than one per cell for faces up to an eighth of the picture.
const FACE_POINTS: usize = 7;

/// `w` of each cell.
#[derive(Clone, Debug)]
pub(super) struct CellWeights(pub(super) Vec<f64>);

/// A face box: points of the grid, and their perspective image about the axis through the middle of the box, in units
/// of its distance.
#[derive(Clone, Debug)]
pub(super) struct FaceTarget {
    pub(super) points: Vec<(CellPoint, Vec2)>,
}

impl FaceTarget {
    /// The target of a box, source px; `None` if the view shows less than half of it.
    pub(super) fn new(face: &Rect, lens: &Lens, sphere: &SphereGrid) -> Option<Self> {
        let axis = lens.unproject(face.center())?;
        let right = Vec3::y().cross(&axis).try_normalize(1e-9)?;
        let down = axis.cross(&right);
        let point = |k: usize| {
            let at = |k: usize| k as f64 / (FACE_POINTS - 1) as f64;
            let ray = lens.unproject(face.at(at(k % FACE_POINTS), at(k / FACE_POINTS)))?;
            let depth = ray.dot(&axis);
            let point = sphere.locate(sphere.chart.at(&ray)?)?;
            (depth > 0.0).then(|| (point, Vec2::new(ray.dot(&right), ray.dot(&down)) / depth))
        };
        let points: Vec<_> = (0..FACE_POINTS * FACE_POINTS).filter_map(point).collect();
        (2 * points.len() >= FACE_POINTS * FACE_POINTS).then_some(Self { points })
    }
}

impl CellWeights {
    /// The weights of a view without its lines; `saliency` covers the picture at any resolution, in [0, 1].
    pub(super) fn new(sphere: &SphereGrid, lens: &Lens, faces: &[Rect], saliency: Option<&Plane<f32>>) -> Self {
        let source = sphere.source(lens);
        let weight = |cell: usize| {
            let Some(p) = source.map(middle(sphere, cell)) else { return 1.0 };
            let w_f = f64::from(u8::from(faces.iter().any(|face| face.contains(p))));
            let w_s = saliency.map_or(0.0, |plane| sampled(plane, p, lens.size));
            1.0 + 2.0 * w_s + 4.0 * w_f
        };
        Self((0..sphere.grid.cell_count()).map(weight).collect())
    }

    /// The weights with those of the ends of lines.
    pub(super) fn with_ends(&self, sphere: &SphereGrid, lines: &[GridLine]) -> Self {
        let grid = &sphere.grid;
        let spread = END_SPREAD * grid.width.max(grid.height);
        let (w, h) = grid.cell_size();
        let mut near = vec![0.0_f64; self.0.len()];
        for end in lines.iter().flat_map(GridLine::ends) {
            let at = grid.at(end);
            let range = |v: f64, cell: f64, count: usize| {
                let index = |v: f64| ((v / cell).max(0.0) as usize).min(count);
                index(v - END_REACH * spread)..(index(v + END_REACH * spread) + 1).min(count)
            };
            for row in range(at.y, h, grid.rows) {
                for cell in range(at.x, w, grid.cols).map(|col| row * grid.cols + col) {
                    let squared = (at - middle(sphere, cell)).norm_squared();
                    near[cell] = near[cell].max((-0.5 * squared / (spread * spread)).exp());
                }
            }
        }
        Self(self.0.iter().zip(near).map(|(w, near)| w + 2.0 * near).collect())
    }
}

/// The middle of a cell, on the grid's rectangle.
fn middle(sphere: &SphereGrid, cell: usize) -> Point2 {
    let corners = sphere.grid.corners(cell);
    nalgebra::center(&sphere.grid.vertex(corners[0]), &sphere.grid.vertex(corners[3]))
}

/// The sample of `plane`, laid over a picture of `size`, at the picture's point `p`; 0 outside.
fn sampled(plane: &Plane<f32>, p: Point2, size: (f64, f64)) -> f64 {
    let index = |v: f64, n: usize| (0.0..=1.0).contains(&v).then(|| ((v * n as f64) as usize).min(n - 1));
    match (index(p.x / size.0, plane.width()), index(p.y / size.1, plane.height())) {
        (Some(x), Some(y)) => f64::from(plane.as_ref().row(y)[x]).clamp(0.0, 1.0),
        _ => 0.0,
    }
}
