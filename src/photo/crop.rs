//! The largest axis-aligned rectangle that a warp covers, optionally one that contains a given box.
//!
//! The picture under the warp has a curved border. On a raster of it, a pixel counts as covered where all its corners are;
//! the largest rectangle of covered pixels is found in one pass over the rows, with the heights of covered columns on a
//! stack, or for a given shape by bisection on its size over a table of sums. A rectangle that holds a given box grows from
//! it: with `t(i)`, `b(i)` the ends of the covered run of column `i` through the box, all pairs of a left and a right column
//! are tried, whose rows are bounded by the extremes of `t` and `b` on either side of the box.

use plumbline_num::math::{Point2, Rect};

/// Which points of a rectangle are covered, as a raster of square pixels.
pub(super) struct Coverage {
    bounds: Rect,
    cols: usize,
    rows: usize,
    pixel: f64,
    covered: Vec<bool>,
}

impl Coverage {
    /// Asks `covered` at the corners of pixels over `bounds`, `across` along the longer side.
    pub(super) fn new(bounds: Rect, across: usize, covered: impl Fn(Point2) -> bool + Sync) -> Self {
        use rayon::prelude::*;
        let pixel = bounds.width().max(bounds.height()) / across as f64;
        let count = |length: f64| ((length / pixel).round() as usize).max(1);
        let (cols, rows) = (count(bounds.width()), count(bounds.height()));
        let corner = |i: usize, j: usize| bounds.min + plumbline_num::math::Vec2::new(i as f64, j as f64) * pixel;
        let line = |j: usize| (0..=cols).map(|i| covered(corner(i, j))).collect::<Vec<_>>();
        let corners: Vec<Vec<bool>> = (0..=rows).into_par_iter().map(line).collect();
        let whole = |k: usize| {
            let (i, j) = (k % cols, k / cols);
            corners[j][i] && corners[j][i + 1] && corners[j + 1][i] && corners[j + 1][i + 1]
        };
        Self { bounds, cols, rows, pixel, covered: (0..cols * rows).map(whole).collect() }
    }

    /// The bounds of what is covered; `None` where nothing is.
    pub(super) fn bounds(&self) -> Option<Rect> {
        let mut found: Option<[usize; 4]> = None;
        for k in (0..self.covered.len()).filter(|&k| self.covered[k]) {
            let (i, j) = (k % self.cols, k / self.cols);
            found = Some(
                found.map_or([i, j, i + 1, j + 1], |[a, b, c, d]| [a.min(i), b.min(j), c.max(i + 1), d.max(j + 1)]),
            );
        }
        found.map(|bounds| self.rect(bounds))
    }

    /// The rectangle of largest area; `None` where nothing is covered.
    pub(super) fn largest(&self) -> Option<Rect> {
        let mut heights = vec![0_usize; self.cols + 1];
        let (mut best, mut area) = (None, 0);
        for j in 0..self.rows {
            let row = &self.covered[j * self.cols..(j + 1) * self.cols];
            for (height, covered) in heights.iter_mut().zip(row) {
                *height = if *covered { *height + 1 } else { 0 };
            }
            // Columns whose height rises; the one past the last has height 0 and closes them all.
            let mut rising: Vec<(usize, usize)> = Vec::new();
            for (i, &height) in heights.iter().enumerate() {
                let mut start = i;
                while let Some(&(from, tall)) = rising.last().filter(|(_, tall)| *tall >= height) {
                    if tall * (i - from) > area {
                        (best, area) = (Some([from, j + 1 - tall, i, j + 1]), tall * (i - from));
                    }
                    start = from;
                    rising.pop();
                }
                rising.push((start, height));
            }
        }
        best.map(|b| self.rect(b))
    }

    /// The largest rectangle with this ratio of width to height, that holds `kept` where it is given; of equals the one
    /// nearest to the middle.
    pub(super) fn largest_of_shape(&self, aspect: f64, kept: Option<&Rect>) -> Option<Rect> {
        let sums = self.sums();
        let kept = match kept {
            Some(kept) => Some(self.pixels(kept)?),
            None => None,
        };
        let at = |width: f64| self.position(&sums, width, width / aspect, kept);
        let widest = (self.cols as f64).min(self.rows as f64 * aspect);
        if let Some(whole) = at(widest) {
            return Some(whole);
        }
        let least = kept.map_or(0.0, |[x0, y0, x1, y1]| ((x1 - x0) as f64).max((y1 - y0) as f64 * aspect));
        let (mut low, mut high, mut best) = (least, widest, at(least));
        while high - low > 1e-3 {
            let width = 0.5 * (low + high);
            match at(width) {
                Some(found) => (low, best) = (width, Some(found)),
                None => high = width,
            }
        }
        best
    }

    /// The largest rectangle that holds a box; `None` where the box is not covered.
    pub(super) fn largest_around(&self, kept: &Rect) -> Option<Rect> {
        let [x0, y0, x1, y1] = self.pixels(kept)?;
        let run = |i: usize| {
            let covered = |j: &usize| self.covered[j * self.cols + i];
            let through = (y0..y1).all(|j| covered(&j));
            let top = y0 - (0..y0).rev().take_while(covered).count();
            let bottom = y1 + (y1..self.rows).take_while(covered).count();
            through.then_some((top, bottom))
        };
        let narrowed = |(t, b): (usize, usize), (top, bottom): (usize, usize)| (t.max(top), b.min(bottom));
        let within = (x0..x1).map(run).try_fold((0, self.rows), |rows, run| Some(narrowed(rows, run?)))?;
        let outwards = |columns: &mut dyn Iterator<Item = usize>| {
            let mut rows = vec![within];
            for run in columns.map_while(run) {
                rows.push(narrowed(rows[rows.len() - 1], run));
            }
            rows
        };
        let (left, right) = (outwards(&mut (0..x0).rev()), outwards(&mut (x1..self.cols)));
        let pairs =
            left.iter().enumerate().flat_map(|(l, a)| right.iter().enumerate().map(move |(r, b)| (l, *a, r, *b)));
        let grown = pairs.map(|(l, a, r, b)| {
            let (top, bottom) = narrowed(a, b);
            [x0 - l, top, x1 + r, bottom]
        });
        grown.max_by_key(|[x0, y0, x1, y1]| (x1 - x0) * (y1 - y0)).map(|best| self.rect(best))
    }

    /// The pixels that a box touches; `None` where it is not within the bounds.
    fn pixels(&self, kept: &Rect) -> Option<[usize; 4]> {
        let (min, max) = ((kept.min - self.bounds.min) / self.pixel, (kept.max - self.bounds.min) / self.pixel);
        let inside = min.x >= 0.0 && min.y >= 0.0 && max.x <= self.cols as f64 && max.y <= self.rows as f64;
        let [x0, y0] = [min.x, min.y].map(|v| v.floor() as usize);
        let [x1, y1] = [max.x, max.y].map(|v| v.ceil() as usize);
        (inside && x1 > x0 && y1 > y0).then_some([x0, y0, x1, y1])
    }

    /// Covered pixels above and to the left of each corner.
    fn sums(&self) -> Vec<u32> {
        let stride = self.cols + 1;
        let mut sums = vec![0_u32; stride * (self.rows + 1)];
        for j in 0..self.rows {
            let mut row = 0;
            for i in 0..self.cols {
                row += u32::from(self.covered[j * self.cols + i]);
                sums[(j + 1) * stride + i + 1] = sums[j * stride + i + 1] + row;
            }
        }
        sums
    }

    /// Where a rectangle of `width × height` pixels is covered wholly, nearest to the middle. Its corners lie anywhere; the
    /// pixels it touches count.
    fn position(&self, sums: &[u32], width: f64, height: f64, kept: Option<[usize; 4]>) -> Option<Rect> {
        let (cols, rows) = (width.ceil() as usize, height.ceil() as usize);
        if cols == 0 || rows == 0 || cols > self.cols || rows > self.rows {
            return None;
        }
        let stride = self.cols + 1;
        let full = |i: usize, j: usize| {
            let at = |i: usize, j: usize| sums[j * stride + i];
            let count = at(i + cols, j + rows) + at(i, j) - at(i + cols, j) - at(i, j + rows);
            count as usize == cols * rows
        };
        let off = |i: usize, j: usize| {
            let (x, y) = (2 * i + cols, 2 * j + rows);
            x.abs_diff(self.cols).pow(2) + y.abs_diff(self.rows).pow(2)
        };
        let positions = (0..=self.rows - rows).flat_map(|j| (0..=self.cols - cols).map(move |i| (i, j)));
        let holds = |i: usize, j: usize| {
            kept.is_none_or(|[x0, y0, x1, y1]| i <= x0 && j <= y0 && i + cols >= x1 && j + rows >= y1)
        };
        let (i, j) = positions.filter(|&(i, j)| holds(i, j) && full(i, j)).min_by_key(|&(i, j)| off(i, j))?;
        // In the middle of the pixels it touches, or as close to it as the kept box allows.
        let slack = |count: usize, length: f64, at: usize, kept: Option<(usize, usize)>| {
            let middle = 0.5 * (count as f64 - length);
            kept.map_or(middle, |(from, to)| middle.max((to - at) as f64 - length).min((from - at) as f64))
        };
        let x = i as f64 + slack(cols, width, i, kept.map(|[x0, _, x1, _]| (x0, x1)));
        let y = j as f64 + slack(rows, height, j, kept.map(|[_, y0, _, y1]| (y0, y1)));
        let min = self.bounds.min + plumbline_num::math::Vec2::new(x, y) * self.pixel;
        Some(Rect { min, max: min + plumbline_num::math::Vec2::new(width, height) * self.pixel })
    }

    fn rect(&self, [x0, y0, x1, y1]: [usize; 4]) -> Rect {
        let at = |x: usize, y: usize| self.bounds.min + plumbline_num::math::Vec2::new(x as f64, y as f64) * self.pixel;
        Rect { min: at(x0, y0), max: at(x1, y1) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn disk() -> Coverage {
        let bounds = Rect { min: Point2::new(-1.0, -1.0), max: Point2::new(1.0, 1.0) };
        Coverage::new(bounds, 400, |p| p.coords.norm() <= 1.0)
    }

    #[test]
    fn the_largest_rectangle_in_a_disk_is_the_inscribed_square() {
        let found = disk().largest().expect("covered");
        for side in [found.width(), found.height()] {
            assert!((side - 2.0_f64.sqrt()).abs() < 0.02, "{found:?}");
        }
        assert!(found.center().coords.norm() < 0.02);
    }

    #[test]
    fn a_rectangle_of_given_shape_touches_the_disk_with_its_corners() {
        for aspect in [0.5, 1.0, 16.0 / 9.0, 4.0] {
            let found = disk().largest_of_shape(aspect, None).expect("covered");
            assert!((found.width() / found.height() - aspect).abs() < 1e-9);
            let corner = 0.5 * found.width().hypot(found.height());
            assert!(corner <= 1.0 + 1e-9 && corner > 0.98, "aspect {aspect}: corner at {corner}");
        }
    }

    #[test]
    fn a_covered_rectangle_is_found_whole() {
        let bounds = Rect::of_size(300.0, 200.0);
        let all = Coverage::new(bounds, 150, |_| true);
        assert_eq!(all.largest(), Some(bounds));
        assert_eq!(all.largest_of_shape(1.5, None), Some(bounds));
        let none = Coverage::new(bounds, 150, |_| false);
        assert_eq!((none.largest(), none.largest_of_shape(1.0, None), none.bounds()), (None, None, None));
    }

    #[test]
    fn a_hole_is_gone_around() {
        let hole = |p: Point2| !(p.x > 90.0 && p.x < 110.0 && p.y > 20.0 && p.y < 40.0);
        let found = Coverage::new(Rect::of_size(300.0, 200.0), 300, hole).largest().expect("covered");
        let below = Rect { min: Point2::new(0.0, 40.0), max: Point2::new(300.0, 200.0) };
        assert!((found.width() * found.height() - below.width() * below.height()).abs() < 700.0, "{found:?}");
    }

    #[test]
    fn a_rectangle_around_a_box_is_the_largest_that_holds_it() {
        let disk = disk();
        let kept = Rect { min: Point2::new(0.75, -0.2), max: Point2::new(0.9, 0.2) };
        assert!(!holds(&disk.largest().expect("covered"), &kept), "the largest of all cuts it");
        let found = disk.largest_around(&kept).expect("covered");
        assert!(holds(&found, &kept));
        // It reaches to x = 0.9 at least: the best has half height √(1 − 0.9²) and full width.
        let best = 4.0 * 0.9 * (1.0_f64 - 0.81).sqrt();
        assert!((found.width() * found.height() - best).abs() < 0.03, "{found:?}");
        let middle = Rect { min: Point2::new(-0.1, -0.1), max: Point2::new(0.1, 0.1) };
        assert_eq!(disk.largest_around(&middle).map(area), disk.largest().map(area));
        assert_eq!(disk.largest_around(&Rect { min: Point2::new(0.8, 0.5), max: Point2::new(0.95, 0.6) }), None);
    }

    #[test]
    fn a_rectangle_of_given_shape_moves_to_hold_a_box() {
        let disk = disk();
        let kept = Rect { min: Point2::new(0.75, -0.1), max: Point2::new(0.9, 0.1) };
        assert!(!holds(&disk.largest_of_shape(1.0, None).expect("covered"), &kept));
        let found = disk.largest_of_shape(1.0, Some(&kept)).expect("covered");
        assert!(holds(&found, &kept) && (found.width() - found.height()).abs() < 1e-9, "{found:?}");
        // A square with its right side at 0.9 touches the circle at (0.9, ±0.436).
        assert!((found.width() - 0.87).abs() < 0.03, "{found:?}");
        let high = Rect { min: Point2::new(-0.05, -0.9), max: Point2::new(0.05, 0.9) };
        assert_eq!(disk.largest_of_shape(4.0, Some(&high)), None, "no flat rectangle is as high");
    }

    fn holds(outer: &Rect, inner: &Rect) -> bool {
        outer.min.x <= inner.min.x
            && outer.min.y <= inner.min.y
            && outer.max.x >= inner.max.x
            && outer.max.y >= inner.max.y
    }

    fn area(r: Rect) -> i64 {
        (r.width() * r.height() * 1e6).round() as i64
    }
}
