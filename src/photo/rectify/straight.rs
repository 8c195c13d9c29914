//! Straight-line terms of the energy: virtual vertices of the marked lines and their residuals.
//!
//! A line is cut into *virtual vertices* `u_k`, points of the grid that move with the corners of their cells: the
//! marked points themselves, and between them points of the great circle through each two, half a cell apart at most.
//! They position on a straight line with normal `N` where, with `s_k` the position of each along it, 0 at the first marked
//! point and 1 at the last,
//!
//! ```text
//! r_k = N·u_k − (1 − s_k) q₀ − s_k q₁ = 0          unknown: q₀, q₁, the offsets of the line's ends
//! ```
//!
//! About a straight configuration this agrees to first order with the distance from the best line, for *every* motion:
//! vertices slide along the line where `N` does not see them, and the line rotates with `q₀` and `q₁`. Each solve is a
//! Gauss–Newton step; three or four suffice. (The paper alternates between fixing `N` and fixing the `s_k`, which
//! converges slowly where lines must rotate.) A given orientation fixes `N`, and `q₀ = q₁`: linear, and exact in one
//! solve.
//!
//! **Beyond the ends** an edge of the scene usually continues, and a bend at the end of the mark would be visible. The
//! line is extended along its great circle at both ends, with a weight that decays by `e` over a fraction of the line's
//! length. Marks that deviate from a great circle indicate an error of lens or marks; they are not extended.
//!
//! **Found lines** of an orientation are straight at whatever angle suits, and enter once more at that angle with the weight
//! [`PREFERENCE`]: nobody asked for it, and a picture that was taken looking up a facade would pay for upright walls with
//! shapes.
//!
//! **Soft lines** that nobody marked enter in the same way at a weight of their own, and the weights of cells do not know them.
//!
//! # Reference
//! Carroll et al. 2009, section 4.2.

use super::SoftLine;
use super::sphere_grid::SphereGrid;
use crate::warp::FittedLine;
use crate::{Line, Orientation};
use plumbline_camera::{Lens, Vec3};
use plumbline_image::grid::{CellPoint, GridMesh};
use plumbline_num::math::{Point2, Rect, Vec2};

/// Maximum distance of virtual vertices, cells: two per cell see the curvature of a bilinear map, more only repeat
/// them.
const SPACING: f64 = 0.5;
/// Fraction of a line's length over which the weight of its extension falls by `e`; the extension then ends after a
/// quarter of the length.
const EXTENSION_DECAY: f64 = 0.018;
/// Weight at which an extension ends: with the default line weight of 10⁴ conformality outweighs it.
const MIN_EXTENSION_WEIGHT: f64 = 1e-6;
/// Factor on the weight of an extension each time it meets a folded cell.
const RELAXATION: f64 = 0.01;
/// Largest deviation of marks from their great circle, as a fraction of their length, for which the line is extended:
/// at 1 % the extrapolated direction is wrong by about half a degree.
const MAX_CIRCLE_DEVIATION: f64 = 0.01;
/// Weight of the angle of a line that was found, relative to its straightness: with the default line weight of 10⁴ six times that of
/// conformality, and above that of a border that yields, so that a picture that is a little slanted becomes level.
const PREFERENCE: f64 = 1e-4;

/// A line on the grid.
#[derive(Clone, Debug)]
pub(super) struct GridLine {
    /// The virtual vertices: those of the marked part in order, then those of its extensions.
    pub(super) vertices: Vec<CellPoint>,
    /// Weight of each, relative to the marked ones'.
    pub(super) weights: Vec<f64>,
    /// Virtual vertices of the marked part.
    marked: usize,
    /// Whose line it is.
    kind: Kind,
    /// The normal where the orientation is given.
    pub(super) normal: Option<Vec2>,
}

/// Whose line it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// Given, marked or found.
    Given,
    /// Found beside given ones.
    Soft,
    /// A side of the picture.
    Side,
}

/// Normal and parametrization of a line on the current mesh.
#[derive(Clone, Debug)]
pub(super) struct LinePosition {
    /// `N`.
    pub(super) normal: Vec2,
    /// `s_k`.
    pub(super) along: Vec<f64>,
}

impl GridLine {
    /// The part of `line` that the grid holds; `None` where that is less than two points.
    pub(super) fn new(line: &Line, lens: &Lens, sphere: &SphereGrid) -> Option<Self> {
        let rays: Vec<Option<Vec3>> = line.points.iter().map(|p| lens.unproject(*p)).collect();
        let vertex = |ray: &Vec3| sphere.locate(sphere.chart.at(ray)?);
        let mut vertices = Vec::new();
        for (k, ray) in rays.iter().enumerate() {
            vertices.extend(ray.as_ref().and_then(vertex));
            if let (Some(from), Some(Some(to))) = (ray, rays.get(k + 1)) {
                vertices.extend(between(from, to, sphere).iter().filter_map(vertex));
            }
        }
        let normal = line.orientation.normal();
        let marked = vertices.len();
        let mut weights = vec![1.0; marked];
        let rays: Vec<Vec3> = rays.into_iter().flatten().collect();
        for (ray, weight) in extensions(&rays, lens, sphere) {
            if let Some(vertex) = vertex(&ray) {
                vertices.push(vertex);
                weights.push(weight);
            }
        }
        (marked >= 2).then_some(Self { vertices, weights, marked, kind: Kind::Given, normal })
    }

    /// The angle at which a line that was found is preferred; `None` for a free one.
    pub(super) fn preferred(line: &Line, lens: &Lens, sphere: &SphereGrid) -> Option<Self> {
        line.orientation.normal()?;
        Some(Self::new(line, lens, sphere)?.weighted(PREFERENCE))
    }

    /// A line that was found beside given ones, at its own weight.
    pub(super) fn soft(found: &SoftLine, lens: &Lens, sphere: &SphereGrid) -> Option<Self> {
        let line = Line { name: String::new(), points: found.points.clone(), orientation: Orientation::Free };
        Some(Self { kind: Kind::Soft, ..Self::new(&line, lens, sphere)?.weighted(found.weight) })
    }

    /// The line at another weight.
    pub(super) fn weighted(self, factor: f64) -> Self {
        Self { weights: self.weights.iter().map(|w| w * factor).collect(), ..self }
    }

    /// The first and the last virtual vertex of the marked part; none of a soft line, at whose ends nobody looks.
    pub(super) fn ends(&self) -> impl Iterator<Item = CellPoint> {
        let ends = [self.vertices[0], self.vertices[self.marked - 1]];
        ends.into_iter().filter(|_| self.kind != Kind::Soft)
    }

    /// A side of the picture, which is no line of the scene.
    pub(super) fn is_side(&self) -> bool {
        self.kind == Kind::Side
    }

    /// Relaxes the extensions where one of them meets these cells, and all of a soft line.
    pub(super) fn relax(&mut self, cells: &[bool]) {
        let first = if self.kind == Kind::Soft { 0 } else { self.marked };
        if self.vertices[first..].iter().any(|p| cells[p.cell]) {
            self.weights[first..].iter_mut().for_each(|w| *w *= RELAXATION);
        }
    }

    /// Multiplies the weight of each virtual vertex by a factor, by its position on the grid's rectangle.
    pub(super) fn weigh(&mut self, sphere: &SphereGrid, factor: impl Fn(Point2) -> f64) {
        self.weights.iter_mut().zip(&self.vertices).for_each(|(w, p)| *w *= factor(sphere.grid.at(*p)));
    }

    /// Unknowns of its own: the offsets of its ends, or one for both.
    pub(super) fn offsets(&self) -> usize {
        if self.normal.is_some() { 1 } else { 2 }
    }

    /// Its normal and parametrization on a mesh; `None` where it has shrunk to a point.
    pub(super) fn position(&self, mesh: &GridMesh) -> Option<LinePosition> {
        if let Some(normal) = self.normal {
            return Some(LinePosition { normal, along: vec![0.0; self.vertices.len()] });
        }
        let at: Vec<Point2> = self.vertices.iter().map(|p| mesh.at(*p)).collect();
        let line = FittedLine::through(&at[..self.marked])?;
        let (first, last) = (line.along(at[0]), line.along(at[self.marked - 1]));
        let along = at.iter().map(|p| (line.along(*p) - first) / (last - first)).collect();
        (last > first).then(|| LinePosition { normal: line.normal(), along })
    }
}

/// The four sides of the picture as lines: top and bottom horizontal, left and right vertical, so that they form a
/// rectangle (the aim of K. He, H. Chang, J. Sun, *Rectangling panoramic images via warping*, SIGGRAPH 2013, section
/// 4). `None` if the lens does not see a part of a side, or the grid does not contain it.
pub(super) fn sides(lens: &Lens, sphere: &SphereGrid) -> Option<Vec<GridLine>> {
    let picture = Rect::of_size(lens.size.0, lens.size.1);
    let steps = 2 * sphere.grid.cols.max(sphere.grid.rows);
    let side = |normal: Vec2, at: &dyn Fn(f64) -> (f64, f64)| {
        let vertex = |k: usize| {
            let (s, t) = at(k as f64 / steps as f64);
            sphere.locate(sphere.chart.at(&lens.unproject(picture.at(s, t))?)?)
        };
        let vertices: Option<Vec<CellPoint>> = (0..=steps).map(vertex).collect();
        let marked = steps + 1;
        Some(GridLine {
            vertices: vertices?,
            weights: vec![1.0; marked],
            marked,
            kind: Kind::Side,
            normal: Some(normal),
        })
    };
    let (level, upright) = (Vec2::new(0.0, 1.0), Vec2::new(1.0, 0.0));
    Some(vec![
        side(level, &|s| (s, 0.0))?,
        side(level, &|s| (s, 1.0))?,
        side(upright, &|t| (0.0, t))?,
        side(upright, &|t| (1.0, t))?,
    ])
}

/// Directions of the great circle between two, so many that neighbors are at most [`SPACING`] cells apart; none of the ends.
fn between(from: &Vec3, to: &Vec3, sphere: &SphereGrid) -> Vec<Vec3> {
    let ends = [from, to].map(|ray| sphere.chart.at(ray));
    let [Some(a), Some(b)] = ends else { return Vec::new() };
    let parts = ((b - a).norm() / (SPACING * sphere.cell())).ceil().clamp(1.0, 1e4) as usize;
    let angle = from.cross(to).norm().atan2(from.dot(to));
    if !(angle > 0.0 && angle < std::f64::consts::PI - 1e-6) {
        return Vec::new();
    }
    let at = |k: usize| {
        let t = k as f64 / parts as f64;
        (from * ((1.0 - t) * angle).sin() + to * (t * angle).sin()) / angle.sin()
    };
    (1..parts).map(at).collect()
}

/// Directions beyond both ends of marked ones, along their great circle, as far as the picture shows it, with their weights.
fn extensions(rays: &[Vec3], lens: &Lens, sphere: &SphereGrid) -> Vec<(Vec3, f64)> {
    let Some((normal, length)) = circle(rays) else { return Vec::new() };
    let picture = Rect::of_size(lens.size.0, lens.size.1);
    let mut beyond = Vec::new();
    for (end, forward) in [(rays[0], -1.0), (rays[rays.len() - 1], 1.0)] {
        let foot = (end - normal * normal.dot(&end)).normalize();
        let ahead = normal.cross(&foot) * forward;
        let step = SPACING * sphere.cell() / stretch(sphere, &foot);
        let mut angle = step;
        while (-angle / (EXTENSION_DECAY * length)).exp() > MIN_EXTENSION_WEIGHT && angle < std::f64::consts::FRAC_PI_2
        {
            let ray = foot * angle.cos() + ahead * angle.sin();
            if !lens.project(&ray).is_some_and(|p| picture.contains(p)) {
                break;
            }
            beyond.push((ray, (-angle / (EXTENSION_DECAY * length)).exp()));
            angle += step;
        }
    }
    beyond
}

/// Unit normal of the great circle through directions, oriented from the first to the last, and their extent, rad;
/// `None` where they do not position on one.
fn circle(rays: &[Vec3]) -> Option<(Vec3, f64)> {
    let (first, last) = (rays.first()?, rays.last()?);
    let length = first.angle(last);
    let chord = first.cross(last).try_normalize(1e-9)?;
    let normal = if rays.len() == 2 {
        chord
    } else {
        let moment = rays.iter().fold(nalgebra::Matrix3::zeros(), |m, r| m + r * r.transpose());
        let eigen = moment.symmetric_eigen();
        let normal: Vec3 = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
        normal * normal.dot(&chord).signum()
    };
    let off = rays.iter().map(|r| normal.dot(r).abs()).fold(0.0, f64::max);
    (off <= MAX_CIRCLE_DEVIATION * length).then_some((normal, length))
}

/// Scale of the chart at a direction: chart length per angle on the sphere.
fn stretch(sphere: &SphereGrid, ray: &Vec3) -> f64 {
    let aside = ray.cross(&Vec3::ith(ray.iamin(), 1.0)).normalize() * 1e-4;
    let ends = [ray + aside, ray - aside].map(|r| sphere.chart.at(&r));
    if let [Some(a), Some(b)] = ends { ((a - b).norm() / 2e-4).max(1e-3) } else { 1.0 }
}
