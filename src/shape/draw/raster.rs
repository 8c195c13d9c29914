//! Triangles on the screen: which samples each covers, and at which depth.
//!
//! Corners are snapped to 1/256 of a sample and edges tested in integers, so that a sample on the edge between two triangles
//! belongs to exactly one of them: no cracks, no double hits. Of each row only the samples between the edges are visited: a
//! sliver costs its area and its rows, not its bounding box. `1/z` is affine on the screen: in a run of samples of a row it has its
//! extremes at the ends, and a run whose nearest end is behind what is there is passed over.
//!
//! # Reference
//! N. Greene, M. Kass, G. Miller, *Hierarchical Z-buffer visibility*, SIGGRAPH 1993; here of one level.

#![allow(clippy::cast_possible_wrap)] // sides of pictures are far below 2^63

use nalgebra::Point3;

use super::SurfaceCamera;

/// Snapping steps per sample: positions are exact to less than a gray level of an antialiased edge.
const STEPS: f64 = 256.0;
/// Clamp for corner coordinates, in steps: products of differences stay below 2^63.
const MAX_COORDINATE: f64 = (1_u64 << 29) as f64;
/// Samples of a row whose depths are bounded together: where thousands of triangles cover each other, few runs are looked into.
const RUN: usize = 64;

/// A projected triangle, corners in steps, oriented so that its area is positive.
pub(super) struct Screen {
    x: [i64; 3],
    y: [i64; 3],
    inverse_depth: [f32; 3],
    triangle: u32,
}

/// The rows of one band.
pub(super) struct Target<'a> {
    top: usize,
    columns: usize,
    triangle: &'a mut [u32],
    inverse_depth: &'a mut [f32],
    /// Inverse depths of the layer in front: only farther samples are drawn.
    before: Option<&'a [f32]>,
    /// Of each run of samples a lower bound of what is there.
    floor: Vec<f32>,
    /// Of each run of samples the nearest of the layer in front.
    ceiling: Option<Vec<f32>>,
}

impl<'a> Target<'a> {
    pub(super) fn new(
        top: usize,
        columns: usize,
        triangle: &'a mut [u32],
        inverse_depth: &'a mut [f32],
        before: Option<&'a [f32]>,
    ) -> Self {
        let runs = |row: &'a [f32]| row.chunks(RUN).map(|run| run.iter().copied().fold(0.0, f32::max));
        let ceiling = before.map(|before| before.chunks(columns).flat_map(runs).collect());
        let floor = vec![0.0; triangle.len() / columns * columns.div_ceil(RUN)];
        Self { top, columns, triangle, inverse_depth, before, floor, ceiling }
    }

    /// Draws the columns `left` to `right` of a row, all in one run.
    fn draw(&mut self, row: i64, (left, right): (usize, usize), triangle: u32, plane: &Plane) {
        let line = row as usize - self.top;
        let run = line * self.columns.div_ceil(RUN) + left / RUN;
        let ends = [plane.at(left as i64, row), plane.at(right as i64, row)];
        if ends[0].max(ends[1]) <= self.floor[run] {
            return;
        }
        if self.ceiling.as_ref().is_some_and(|ceiling| ends[0].min(ends[1]) >= ceiling[run]) {
            return;
        }
        let start = line * self.columns;
        for column in left..=right {
            let i = start + column;
            let inverse_depth = plane.at(column as i64, row);
            let open = self.before.is_none_or(|before| inverse_depth < before[i]);
            if open && inverse_depth > self.inverse_depth[i] {
                self.inverse_depth[i] = inverse_depth;
                self.triangle[i] = triangle;
            }
        }
        if right - left + 1 == RUN {
            let drawn = &self.inverse_depth[start + left..=start + right];
            self.floor[run] = drawn.iter().copied().fold(f32::INFINITY, f32::min);
        }
    }
}

impl Screen {
    /// A triangle clipped at the near plane: none, one, or two triangles.
    pub(super) fn of(
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
    pub(super) fn rows(&self) -> (i64, i64) {
        span(self.y)
    }

    pub(super) fn draw(&self, target: &mut Target<'_>) {
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
            let Some((left, right)) = covered(&edges, row, (left, right)) else { continue };
            let (mut left, right) = (left as usize, right as usize);
            while left <= right {
                let end = right.min(left | (RUN - 1));
                target.draw(row, (left, end), self.triangle, &plane);
                left = end + 1;
            }
        }
    }
}

/// First and last column of a row, within a range of columns, that no edge excludes.
fn covered(edges: &[Edge; 3], row: i64, (mut first, mut last): (i64, i64)) -> Option<(i64, i64)> {
    for edge in edges {
        // value + across · column ≥ 0
        let value = edge.at(0, row);
        match edge.across.signum() {
            1 => first = first.max(-value.div_euclid(edge.across)),
            -1 => last = last.min(value.div_euclid(-edge.across)),
            _ if value < 0 => return None,
            _ => {}
        }
    }
    (first <= last).then_some((first, last))
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

#[cfg(test)]
mod tests {
    use super::super::visibility::NO_TRIANGLE;
    use super::*;

    /// Corners in steps: of a size of the picture, beyond it, on centers of samples, nearly on a line.
    fn corners(random: &mut fastrand::Rng) -> [[i64; 2]; 3] {
        let reach = [600, 40 * 256, 1 << 20, 1 << 29][random.usize(0..4)];
        let mut corner = |grid: i64| [(); 2].map(|()| random.i64(-reach / 2..=reach) / grid * grid + grid / 2 % 256);
        let [a, b, c] = [corner(1), corner(128), corner(1)];
        let d = corner(256);
        match random.u8(0..4) {
            0 => [a, b, c],
            1 => [a, b, [a[0] + (b[0] - a[0]) / 3, a[1] + (b[1] - a[1]) / 3 + random.i64(-2..=2)]],
            2 => [d, [d[0], b[1]], [c[0], d[1]]],
            _ => [a, b, [a[0] + random.i64(-300..=300), a[1] + random.i64(-3..=3)]],
        }
    }

    /// What [`Screen::draw`] does, sample by sample of the bounding box.
    fn draw_plainly(screen: &Screen, target: &mut Target<'_>) {
        let edges = [0, 1, 2].map(|k| Edge::new(screen, k));
        let plane = Plane::new(screen);
        for i in 0..target.triangle.len() {
            let (column, row) = ((i % target.columns) as i64, (i / target.columns) as i64);
            let inverse_depth = plane.at(column, row);
            let open = target.before.is_none_or(|before| inverse_depth < before[i]);
            let inside = edges.iter().all(|e| e.at(column, row) >= 0);
            if inside && open && inverse_depth > target.inverse_depth[i] {
                (target.inverse_depth[i], target.triangle[i]) = (inverse_depth, screen.triangle);
            }
        }
    }

    fn screen(random: &mut fastrand::Rng, triangle: u32) -> Option<Screen> {
        let mut corners = corners(random);
        let [a, b, c] = corners;
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if area < 0 {
            corners.swap(1, 2);
        }
        // Now and then of one depth, as others are.
        let flat = random.u8(0..4) == 0;
        let level = f32::from(random.u8(1..9)) / 8.0;
        let inverse_depth = [(); 3].map(|()| if flat { level } else { random.f32() + 0.01 });
        let screen = Screen { x: corners.map(|p| p[0]), y: corners.map(|p| p[1]), inverse_depth, triangle };
        (area != 0).then_some(screen)
    }

    #[test]
    fn every_sample_is_that_of_the_plain_loop_over_the_bounding_box() {
        let mut random = fastrand::Rng::with_seed(5);
        let (columns, rows) = (150, 31);
        let mut seen = std::collections::HashSet::new();
        for round in 0..300 {
            let drawn: Vec<Screen> = (0..80).filter_map(|t| screen(&mut random, t)).collect();
            let mut before: Option<Vec<f32>> = None;
            for layer in 0..3 {
                let [found, expected] =
                    [Screen::draw, |s: &Screen, t: &mut Target<'_>| draw_plainly(s, t)].map(|draw| {
                        let (mut triangle, mut depth) = (vec![NO_TRIANGLE; columns * rows], vec![0.0; columns * rows]);
                        let mut target = Target::new(0, columns, &mut triangle, &mut depth, before.as_deref());
                        for screen in &drawn {
                            draw(screen, &mut target);
                        }
                        (triangle, depth)
                    });
                assert!(found == expected, "round {round}, layer {layer}");
                seen.extend(found.0.iter().map(|t| (round, layer, *t)));
                before = Some(found.1);
            }
        }
        assert!(seen.len() > 5000, "{} triangles are seen", seen.len());
    }
}
