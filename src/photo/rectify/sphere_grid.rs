//! A grid on the viewing sphere: regular in a conformal chart, over the field of the picture.

use nalgebra::{Matrix2, Matrix3x2};

use super::chart::Chart;
use plumbline_camera::{Lens, Vec3};
use plumbline_image::grid::{CellPoint, Grid};
use plumbline_num::math::{Point2, PointMap, Rect, Vec2};

/// Largest angle from the view's center in a stereographic chart, rad: 110°, where it magnifies threefold.
const MAX_ANGLE: f64 = 1.919_862_177;
/// Largest latitude in a Mercator chart, rad: 75°, where it magnifies fourfold.
const MAX_LATITUDE: f64 = 1.308_996_939;
/// Largest longitude in a Mercator chart, rad: 1° short of the direction behind, where the chart is cut.
const MAX_LONGITUDE: f64 = 3.12;
/// Extension of the grid beyond the picture on each side, as a fraction of its extent: one cell of the default 48, so
/// that the map is defined on both sides of the border.
const EDGE: f64 = 0.02;
/// Samples along each side of the picture at which its field is measured: two per cell of the default grid.
const FIELD_SAMPLES: usize = 97;

/// Angular extent of a view, measured from its center.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// To the left and to the right, rad, in (0, π].
    pub half_width: f64,
    /// Up and down, rad, in (0, π/2).
    pub half_height: f64,
}

/// Chart, grid, and the cells that the picture covers.
#[derive(Clone, Debug)]
pub(super) struct SphereGrid {
    pub(super) chart: Chart,
    /// Position of the grid's first vertex in the chart.
    pub(super) origin: Vec2,
    /// Cells over the rectangle `[0, width] × [0, height]` of chart units from the origin on; cells are square.
    pub(super) grid: Grid,
    /// Cells that the picture covers at least partly.
    pub(super) inside: Vec<bool>,
}

impl SphereGrid {
    /// The grid of `cells` cells along its longer side over the field of `lens`, within `window` where one is given;
    /// `None` where nothing of the picture lies in the view.
    pub(super) fn new(chart: Chart, lens: &Lens, window: Option<Window>, cells: usize) -> Option<Self> {
        let field = shown(&chart, lens, window)?;
        let cell = field.width().max(field.height()) / cells as f64;
        let count = |length: f64| ((length / cell - 1e-9).ceil() as usize).max(1);
        let (cols, rows) = (count(field.width()), count(field.height()));
        let (width, height) = (cols as f64 * cell, rows as f64 * cell);
        let grid = Grid { cols, rows, width, height };
        let origin = field.center().coords - 0.5 * Vec2::new(width, height);
        let mut sphere = Self { chart, origin, grid, inside: Vec::new() };
        sphere.inside = sphere.cells_inside(lens);
        Some(sphere)
    }

    /// The same rectangle with cells of half the side.
    pub(super) fn refined(&self, lens: &Lens) -> Self {
        let grid = Grid { cols: 2 * self.grid.cols, rows: 2 * self.grid.rows, ..self.grid };
        let mut fine = Self { chart: self.chart.clone(), origin: self.origin, grid, inside: Vec::new() };
        fine.inside = fine.cells_inside(lens);
        fine
    }

    /// Position of vertex `i` in the chart.
    pub(super) fn vertex(&self, i: usize) -> Vec2 {
        self.origin + self.grid.vertex(i).coords
    }

    /// The cell of a position in the chart.
    pub(super) fn locate(&self, s: Vec2) -> Option<CellPoint> {
        self.grid.locate(Point2::from(s - self.origin))
    }

    /// Side of a cell, rad at the center of the view.
    pub(super) fn cell(&self) -> f64 {
        self.grid.cell_size().0
    }

    /// The map from the grid's rectangle to the picture.
    pub(super) fn source(&self, lens: &Lens) -> SourceFromRay<impl Fn(Point2) -> Option<Vec3> + Send + Sync + use<>> {
        let (chart, origin) = (self.chart.clone(), self.origin);
        let extent = Rect::of_size(self.grid.width, self.grid.height);
        let ray = move |p: Point2| extent.contains(p).then(|| chart.ray(p.coords + origin)).flatten();
        SourceFromRay { lens: lens.clone(), ray, step: 1e-6 }
    }

    fn cells_inside(&self, lens: &Lens) -> Vec<bool> {
        let picture = Rect::of_size(lens.size.0, lens.size.1);
        let source = self.source(lens);
        let seen = |p: Point2| source.map(p).is_some_and(|p| picture.contains(p));
        let at = |i: usize| seen(self.grid.vertex(i));
        let vertices: Vec<bool> = (0..self.grid.vertex_count()).map(at).collect();
        (0..self.grid.cell_count())
            .map(|cell| {
                let corners = self.grid.corners(cell);
                corners.iter().any(|&i| vertices[i])
                    || seen(nalgebra::center(&self.grid.vertex(corners[0]), &self.grid.vertex(corners[3])))
            })
            .collect()
    }
}

/// The stereographic chart up to [`MAX_ANGLE`], the Mercator chart beyond.
pub(super) fn chart_for(view_from_camera: nalgebra::Rotation3<f64>, window: Option<Window>) -> Chart {
    match window {
        Some(window) if window.half_width.hypot(window.half_height) > MAX_ANGLE => Chart::mercator(view_from_camera),
        _ => Chart::stereographic(view_from_camera),
    }
}

/// Bounds, in the chart, of the directions that the picture shows and the window lets through.
fn shown(chart: &Chart, lens: &Lens, window: Option<Window>) -> Option<Rect> {
    let (w, h) = lens.size;
    let step = |k: usize| k as f64 / (FIELD_SAMPLES - 1) as f64;
    let pixels = (0..FIELD_SAMPLES * FIELD_SAMPLES)
        .map(|k| Point2::new(w * step(k % FIELD_SAMPLES), h * step(k / FIELD_SAMPLES)));
    let places = pixels.filter_map(|p| {
        let ray = chart.view_from_camera() * lens.unproject(p)?;
        reachable(&ray, window).then(|| chart.at_view(&ray)).flatten()
    });
    let bounds = places.fold(None, |bounds: Option<Rect>, s| {
        let p = Point2::from(s);
        Some(bounds.map_or(Rect { min: p, max: p }, |b| Rect { min: b.min.inf(&p), max: b.max.sup(&p) }))
    })?;
    let edge = EDGE * Vec2::new(bounds.width(), bounds.height());
    let grown = Rect { min: bounds.min - edge, max: bounds.max + edge };
    (bounds.width() > 0.0 && bounds.height() > 0.0).then_some(grown)
}

fn reachable(ray_in_view: &Vec3, window: Option<Window>) -> bool {
    let longitude = ray_in_view.x.atan2(ray_in_view.z).abs();
    let latitude = ray_in_view.y.atan2(ray_in_view.x.hypot(ray_in_view.z)).abs();
    match window {
        Some(w) => longitude <= w.half_width.min(MAX_LONGITUDE) && latitude <= w.half_height.min(MAX_LATITUDE),
        None => ray_in_view.x.hypot(ray_in_view.y).atan2(ray_in_view.z) <= MAX_ANGLE,
    }
}

/// From a plane to the picture: the direction of each point, then the lens.
pub(super) struct SourceFromRay<F> {
    pub(super) lens: Lens,
    /// The direction of a point of the plane, in the camera; `None` beyond what is shown.
    pub(super) ray: F,
    /// Step of the central differences, in the unit of the plane.
    pub(super) step: f64,
}

impl<F: Fn(Point2) -> Option<Vec3> + Send + Sync> PointMap for SourceFromRay<F> {
    fn map(&self, p: Point2) -> Option<Point2> {
        self.lens.project(&(self.ray)(p)?)
    }

    fn jacobian(&self, p: Point2) -> Option<Matrix2<f64>> {
        let slope = |d: Vec2| Some(((self.ray)(p + d)? - (self.ray)(p - d)?) / (2.0 * self.step));
        let by_position =
            Matrix3x2::from_columns(&[slope(Vec2::new(self.step, 0.0))?, slope(Vec2::new(0.0, self.step))?]);
        Some(self.lens.project_with_jacobian(&(self.ray)(p)?)?.1 * by_position)
    }
}
