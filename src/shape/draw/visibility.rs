//! A z-buffer with depth peeling: the nearest triangle of each sample.
//!
//! Corners are snapped to 1/256 of a sample and edges tested in integers, so that a sample on the edge between two triangles
//! belongs to exactly one of them: no cracks, no double hits. `1/z` is affine on the screen. The picture is divided into bands
//! of rows, each drawn by one thread in the order of the triangles; of equal depths the first is kept. The layer behind a given
//! one is found by drawing again only what is farther.

#![allow(clippy::cast_possible_wrap)] // sides of pictures are far below 2^63

use nalgebra::Point3;
use rayon::prelude::*;

use super::SurfaceCamera;
use crate::mesh::TriMesh;
use plumbline_num::math::Lists;
use plumbline_num::run::{Run, Stopped};

/// Index of samples without a triangle.
pub(super) const NO_TRIANGLE: u32 = u32::MAX;
/// Snapping steps per sample: positions are exact to less than a gray level of an antialiased edge.
const STEPS: f64 = 256.0;
/// Clamp for corner coordinates, in steps: products of differences stay below 2^63.
const MAX_COORDINATE: f64 = (1_u64 << 29) as f64;
/// Rows of samples in a band: small enough to balance threads, large enough that few triangles are in several bands.
const BAND: usize = 48;

/// All triangles projected to the screen.
pub(super) struct View {
    /// Vertices in camera coordinates.
    pub(super) vertices: Vec<Point3<f64>>,
    screen: Vec<Screen>,
    bands: Lists<u32>,
    samples: usize,
    columns: usize,
    rows: usize,
}

/// The nearest triangle of each sample, perhaps behind another layer.
pub(super) struct VisibleLayer {
    /// Samples per pixel and axis.
    pub(super) samples: usize,
    /// Samples per row.
    columns: usize,
    /// The triangle of each sample, or [`NO_TRIANGLE`].
    triangle: Vec<u32>,
    /// `1/z` of each sample, 0 without a triangle.
    inverse_depth: Vec<f32>,
}

impl View {
    pub(super) fn new(mesh: &TriMesh, camera: &SurfaceCamera, samples: usize) -> Self {
        let vertices: Vec<Point3<f64>> = mesh.positions().par_iter().map(|p| camera.pose.apply(p)).collect();
        let (columns, rows) = (camera.size.0 * samples, camera.size.1 * samples);
        let screen: Vec<Screen> = mesh
            .triangles()
            .par_iter()
            .enumerate()
            .flat_map_iter(|(t, corners)| {
                let corners = corners.map(|v| vertices[v as usize]);
                Screen::of(t as u32, &corners, camera, samples as f64)
            })
            .collect();
        Self { vertices, bands: bands(&screen, rows), screen, samples, columns, rows }
    }

    /// The nearest layer.
    pub(super) fn nearest(&self, run: &Run) -> Result<VisibleLayer, Stopped> {
        self.peeled(None, run)
    }

    /// The nearest layer behind a given one (C. Everitt, *Interactive order-independent transparency*, 2001).
    pub(super) fn behind(&self, layer: &VisibleLayer, run: &Run) -> Result<VisibleLayer, Stopped> {
        self.peeled(Some(layer), run)
    }

    fn peeled(&self, layer: Option<&VisibleLayer>, run: &Run) -> Result<VisibleLayer, Stopped> {
        let mut triangle = vec![NO_TRIANGLE; self.columns * self.rows];
        let mut inverse_depth = vec![0.0_f32; self.columns * self.rows];
        let size = self.columns * BAND;
        let targets = triangle.par_chunks_mut(size).zip(inverse_depth.par_chunks_mut(size));
        targets.enumerate().try_for_each(|(band, (triangle, inverse_depth))| {
            run.check()?;
            let before = layer.map(|l| &l.inverse_depth[band * size..][..inverse_depth.len()]);
            let mut target = Target { top: band * BAND, columns: self.columns, triangle, inverse_depth, before };
            self.bands.of(band).iter().try_for_each(|i| {
                run.check()?;
                self.screen[*i as usize].draw(&mut target);
                Ok(())
            })
        })?;
        Ok(VisibleLayer { samples: self.samples, columns: self.columns, triangle, inverse_depth })
    }
}

impl VisibleLayer {
    /// True where no sample has a triangle.
    pub(super) fn is_empty(&self) -> bool {
        self.triangle.iter().all(|t| *t == NO_TRIANGLE)
    }

    /// The triangle of sample (`column`, `line`) of pixel (`x`, `y`).
    #[inline]
    pub(super) fn triangle(&self, x: usize, y: usize, column: usize, line: usize) -> u32 {
        self.triangle[self.index(x, y, column, line)]
    }

    /// `1/z` of that sample.
    #[inline]
    pub(super) fn inverse_depth(&self, x: usize, y: usize, column: usize, line: usize) -> f32 {
        self.inverse_depth[self.index(x, y, column, line)]
    }

    /// Mean `1/z` of the samples of a pixel with a triangle; 0 without any.
    pub(super) fn mean_inverse_depth(&self, x: usize, y: usize) -> f32 {
        let n = self.samples;
        let hits = (0..n * n).map(|i| self.inverse_depth(x, y, i % n, i / n)).filter(|near| *near > 0.0);
        let (sum, count) = hits.fold((0.0, 0.0), |(sum, count), near| (sum + near, count + 1.0));
        if count > 0.0 { sum / count } else { 0.0 }
    }

    #[inline]
    fn index(&self, x: usize, y: usize, column: usize, line: usize) -> usize {
        (y * self.samples + line) * self.columns + x * self.samples + column
    }
}

/// A projected triangle, corners in steps, oriented so that its area is positive.
struct Screen {
    x: [i64; 3],
    y: [i64; 3],
    inverse_depth: [f32; 3],
    triangle: u32,
}

/// The rows of one band.
struct Target<'a> {
    top: usize,
    columns: usize,
    triangle: &'a mut [u32],
    inverse_depth: &'a mut [f32],
    /// Inverse depths of the layer in front: only farther samples are drawn.
    before: Option<&'a [f32]>,
}

impl Screen {
    /// A triangle clipped at the near plane: none, one, or two triangles.
    fn of(
        triangle: u32,
        corners: &[Point3<f64>; 3],
        camera: &SurfaceCamera,
        samples: f64,
    ) -> impl Iterator<Item = Self> + use<> {
        let mut polygon = [Point3::origin(); 4];
        let count = clipped(corners, camera.near, &mut polygon);
        let fan = (2..count).map(move |k| [polygon[0], polygon[k - 1], polygon[k]]);
        let camera = *camera;
        fan.filter_map(move |corners| Self::projected(triangle, &corners, &camera, samples))
    }

    fn projected(triangle: u32, corners: &[Point3<f64>; 3], camera: &SurfaceCamera, samples: f64) -> Option<Self> {
        let projected = corners.map(|p| camera.project(&p) * (samples * STEPS));
        if !projected.iter().all(|p| p.x.is_finite() && p.y.is_finite()) {
            return None;
        }
        let snap = |v: f64| v.round().clamp(-MAX_COORDINATE, MAX_COORDINATE) as i64;
        let (mut x, mut y) = (projected.map(|p| snap(p.x)), projected.map(|p| snap(p.y)));
        let mut inverse_depth = corners.map(|p| (1.0 / p.z) as f32);
        let area = (x[1] - x[0]) * (y[2] - y[0]) - (y[1] - y[0]) * (x[2] - x[0]);
        let step = STEPS as i64;
        let (right, bottom) = (camera.size.0 as i64, camera.size.1 as i64);
        let (right, bottom) = (right * samples as i64 * step, bottom * samples as i64 * step);
        let outside = x.iter().all(|x| *x < 0) || x.iter().all(|x| *x > right);
        if area == 0 || outside || y.iter().all(|y| *y < 0) || y.iter().all(|y| *y > bottom) {
            return None;
        }
        if area < 0 {
            x.swap(1, 2);
            y.swap(1, 2);
            inverse_depth.swap(1, 2);
        }
        Some(Self { x, y, inverse_depth, triangle })
    }

    /// Rows of samples whose centers the triangle may cover.
    fn rows(&self) -> (i64, i64) {
        span(self.y)
    }

    fn draw(&self, target: &mut Target<'_>) {
        let height = target.triangle.len() / target.columns;
        let (top, bottom) = self.rows();
        let (first, last) = (top.max(target.top as i64), bottom.min((target.top + height) as i64 - 1));
        let (left, right) = span(self.x);
        let (left, right) = (left.max(0), right.min(target.columns as i64 - 1));
        if left > right {
            return;
        }
        let edges = [0, 1, 2].map(|k| Edge::new(self, k));
        let plane = Plane::new(self);
        for row in first..=last {
            let mut inside = edges.map(|e| e.at(left, row));
            let start = (row as usize - target.top) * target.columns;
            for column in left..=right {
                if inside[0] | inside[1] | inside[2] >= 0 {
                    let i = start + column as usize;
                    let inverse_depth = plane.at(column, row);
                    let open = target.before.is_none_or(|before| inverse_depth < before[i]);
                    if open && inverse_depth > target.inverse_depth[i] {
                        target.inverse_depth[i] = inverse_depth;
                        target.triangle[i] = self.triangle;
                    }
                }
                for (value, edge) in inside.iter_mut().zip(&edges) {
                    *value += edge.across;
                }
            }
        }
    }
}

/// First and last sample whose centers are between the minimum and the maximum of three coordinates.
fn span(x: [i64; 3]) -> (i64, i64) {
    let step = STEPS as i64;
    let (low, high) = (x[0].min(x[1]).min(x[2]), x[0].max(x[1]).max(x[2]));
    ((low - step / 2 + step - 1).div_euclid(step), (high - step / 2).div_euclid(step))
}

/// The edge function: twice the area between an edge and a point, in steps²; non-negative inside. Points on edges that are
/// neither left nor top are outside (top-left rule).
#[derive(Clone, Copy)]
struct Edge {
    value: i64,
    across: i64,
    down: i64,
}

impl Edge {
    fn new(screen: &Screen, k: usize) -> Self {
        let (a, b) = (k, (k + 1) % 3);
        let (dx, dy) = (screen.x[b] - screen.x[a], screen.y[b] - screen.y[a]);
        let (step, half) = (STEPS as i64, STEPS as i64 / 2);
        let top_left = dy < 0 || (dy == 0 && dx > 0);
        let value = dx * (half - screen.y[a]) - dy * (half - screen.x[a]) - i64::from(!top_left);
        Self { value, across: -dy * step, down: dx * step }
    }

    fn at(&self, column: i64, row: i64) -> i64 {
        self.value + self.across * column + self.down * row
    }
}

/// `1/z` over the screen.
struct Plane {
    origin: f64,
    across: f64,
    down: f64,
    range: [f32; 2],
}

impl Plane {
    fn new(screen: &Screen) -> Self {
        let at = |k: usize| [screen.x[k] as f64 / STEPS - 0.5, screen.y[k] as f64 / STEPS - 0.5];
        let (a, b, c) = (at(0), at(1), at(2));
        let [na, nb, nc] = screen.inverse_depth.map(f64::from);
        let (bx, by, cx, cy) = (b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]);
        let area = bx * cy - by * cx;
        let across = ((nb - na) * cy - (nc - na) * by) / area;
        let down = ((nc - na) * bx - (nb - na) * cx) / area;
        let [n0, n1, n2] = screen.inverse_depth;
        // Slivers extrapolate badly: clamp to the depths of the corners.
        let range = [n0.min(n1).min(n2), n0.max(n1).max(n2)];
        Self { origin: na - across * a[0] - down * a[1], across, down, range }
    }

    #[inline]
    fn at(&self, column: i64, row: i64) -> f32 {
        let inverse_depth = (self.origin + self.across * column as f64 + self.down * row as f64) as f32;
        inverse_depth.max(self.range[0]).min(self.range[1])
    }
}

/// The part of a triangle beyond the near plane (Sutherland–Hodgman); returns the number of its corners.
fn clipped(corners: &[Point3<f64>; 3], near: f64, into: &mut [Point3<f64>; 4]) -> usize {
    let mut count = 0;
    let mut keep = |p: Point3<f64>| {
        into[count] = p;
        count += 1;
    };
    let mut previous = corners[2];
    for current in corners {
        if (previous.z > near) != (current.z > near) {
            keep(previous + (current - previous) * ((near - previous.z) / (current.z - previous.z)));
        }
        if current.z > near {
            keep(*current);
        }
        previous = *current;
    }
    count
}

/// Indices of the triangles that overlap each band.
fn bands(screen: &[Screen], rows: usize) -> Lists<u32> {
    let touched = |s: &Screen| {
        let (top, bottom) = s.rows();
        let (top, bottom) = (top.max(0), bottom.min(rows as i64 - 1));
        if top > bottom { 0..0 } else { (top as usize / BAND) as u32..(bottom as usize / BAND + 1) as u32 }
    };
    let pairs = (0..).zip(screen).flat_map(|(i, s)| touched(s).map(move |band| (band, i)));
    Lists::new(rows.div_ceil(BAND), pairs)
}
