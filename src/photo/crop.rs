//! The largest upright rectangle within what a warp shows.
//!
//! The picture under the warp has a curved border. On a raster of it, a pixel counts as covered where all its corners are;
//! the largest rectangle of covered pixels is found in one pass over the rows, with the heights of covered columns on a
//! stack, or for a given shape by bisection on its size over a table of sums.

use crate::math::{Point2, Rect};

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
        let corner = |i: usize, j: usize| bounds.min + crate::math::Vec2::new(i as f64, j as f64) * pixel;
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

    /// The largest rectangle with this ratio of width to height; of equals the one nearest to the middle.
    pub(super) fn largest_of_shape(&self, aspect: f64) -> Option<Rect> {
        let sums = self.sums();
        let at = |width: f64| self.place(&sums, width, width / aspect);
        let widest = (self.cols as f64).min(self.rows as f64 * aspect);
        if let Some(whole) = at(widest) {
            return Some(whole);
        }
        let (mut low, mut high, mut best) = (0.0, widest, None);
        while high - low > 1e-3 {
            let width = 0.5 * (low + high);
            match at(width) {
                Some(found) => (low, best) = (width, Some(found)),
                None => high = width,
            }
        }
        best
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
    fn place(&self, sums: &[u32], width: f64, height: f64) -> Option<Rect> {
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
        let places = (0..=self.rows - rows).flat_map(|j| (0..=self.cols - cols).map(move |i| (i, j)));
        let (i, j) = places.filter(|&(i, j)| full(i, j)).min_by_key(|&(i, j)| off(i, j))?;
        let slack = crate::math::Vec2::new(cols as f64 - width, rows as f64 - height) * 0.5;
        let min = self.bounds.min + (crate::math::Vec2::new(i as f64, j as f64) + slack) * self.pixel;
        Some(Rect { min, max: min + crate::math::Vec2::new(width, height) * self.pixel })
    }

    fn rect(&self, [x0, y0, x1, y1]: [usize; 4]) -> Rect {
        let at = |x: usize, y: usize| self.bounds.min + crate::math::Vec2::new(x as f64, y as f64) * self.pixel;
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
            let found = disk().largest_of_shape(aspect).expect("covered");
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
        assert_eq!(all.largest_of_shape(1.5), Some(bounds));
        let none = Coverage::new(bounds, 150, |_| false);
        assert_eq!((none.largest(), none.largest_of_shape(1.0), none.bounds()), (None, None, None));
    }

    #[test]
    fn a_hole_is_gone_around() {
        let hole = |p: Point2| !(p.x > 90.0 && p.x < 110.0 && p.y > 20.0 && p.y < 40.0);
        let found = Coverage::new(Rect::of_size(300.0, 200.0), 300, hole).largest().expect("covered");
        let below = Rect { min: Point2::new(0.0, 40.0), max: Point2::new(300.0, 200.0) };
        assert!((found.width() * found.height() - below.width() * below.height()).abs() < 700.0, "{found:?}");
    }
}
