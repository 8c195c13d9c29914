//! An 8-bit RGB picture with anti-aliased lines, mesh grids and small text.

mod color_map;
pub mod font;
pub mod srgb;

pub use color_map::ColorMap;
pub use font::text_width;
use plumbline_num::math::Point2;

/// Red, green and blue, sRGB.
pub type Rgb = [u8; 3];

/// An 8-bit sRGB picture, rows packed without padding.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Canvas {
    width: usize,
    height: usize,
    pixels: Vec<Rgb>,
}

impl Canvas {
    /// A picture filled with one color.
    pub fn new(width: usize, height: usize, color: Rgb) -> Self {
        Self { width, height, pixels: vec![color; width * height] }
    }

    /// A picture over given pixels, row by row; `None` where their number is not `width·height`.
    pub fn from_pixels(width: usize, height: usize, pixels: Vec<Rgb>) -> Option<Self> {
        (pixels.len() == width * height).then_some(Self { width, height, pixels })
    }

    /// Width, px.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height, px.
    pub fn height(&self) -> usize {
        self.height
    }

    /// All pixels, row by row.
    pub fn pixels(&self) -> &[Rgb] {
        &self.pixels
    }

    /// All samples, row by row, as encoders take them.
    pub fn as_bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.pixels)
    }

    /// Mixes `color` over the pixel at column `x`, row `y` with opacity in [0, 1]; outside, nothing happens.
    pub fn blend(&mut self, x: i64, y: i64, color: Rgb, opacity: f32) {
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else { return };
        if x >= self.width || y >= self.height {
            return;
        }
        let pixel = &mut self.pixels[y * self.width + x];
        for (old, new) in pixel.iter_mut().zip(color) {
            *old = (f32::from(*old) + (f32::from(new) - f32::from(*old)) * opacity.clamp(0.0, 1.0)).round() as u8;
        }
    }

    /// A line of `thickness` px from `a` to `b`, edges softened over a pixel. Not drawn where a coordinate is not finite.
    pub fn line(&mut self, a: Point2, b: Point2, color: Rgb, thickness: f64) {
        let Some((a, b)) = self.clip(a, b, thickness + 1.0) else { return };
        let (d, reach) = (b - a, thickness / 2.0 + 0.5);
        let along = |p: f64, q: f64| ((p.min(q) - reach).floor() as i64, (p.max(q) + reach).ceil() as i64);
        // Only the pixels near the line: along its longer axis, a band around it.
        let steep = d.y.abs() > d.x.abs();
        let (from, to) = if steep { along(a.y, b.y) } else { along(a.x, b.x) };
        let (major, minor, slope) = if steep { (a.y, a.x, d.x / d.y) } else { (a.x, a.y, d.y / d.x) };
        let half_band = reach * 2f64.sqrt();
        for i in from..=to {
            let center = if slope.is_finite() { minor + slope * (i as f64 + 0.5 - major) } else { minor };
            for j in (center - half_band).floor() as i64..=(center + half_band).ceil() as i64 {
                let (x, y) = if steep { (j, i) } else { (i, j) };
                let p = Point2::new(x as f64 + 0.5, y as f64 + 0.5);
                let t = if d.norm_squared() > 0.0 { ((p - a).dot(&d) / d.norm_squared()).clamp(0.0, 1.0) } else { 0.0 };
                let opacity = reach - (p - (a + d * t)).norm();
                self.blend(x, y, color, opacity as f32);
            }
        }
    }

    /// The part of a segment that lies within `margin` px of the picture (Liang–Barsky).
    fn clip(&self, a: Point2, b: Point2, margin: f64) -> Option<(Point2, Point2)> {
        let d = b - a;
        if !(a.coords.norm_squared() + b.coords.norm_squared()).is_finite() {
            return None;
        }
        let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
        for (start, step, end) in [(a.x, d.x, self.width as f64), (a.y, d.y, self.height as f64)] {
            let (low, high) = ((-margin - start) / step, (end + margin - start) / step);
            if step == 0.0 {
                if start < -margin || start > end + margin {
                    return None;
                }
            } else {
                enter = enter.max(low.min(high));
                leave = leave.min(low.max(high));
            }
        }
        (enter <= leave).then(|| (a + d * enter, a + d * leave))
    }

    /// Consecutive points joined by lines.
    pub fn polyline(&mut self, points: &[Point2], color: Rgb, thickness: f64) {
        for pair in points.windows(2) {
            self.line(pair[0], pair[1], color, thickness);
        }
    }

    /// The edges of a grid of `vertices`, row by row, `per_row` ≥ 1 of them in each.
    pub fn grid(&mut self, vertices: &[Point2], per_row: usize, color: Rgb, thickness: f64) {
        for row in vertices.chunks(per_row) {
            self.polyline(row, color, thickness);
        }
        for column in 0..per_row {
            let points: Vec<_> = vertices.iter().skip(column).step_by(per_row).copied().collect();
            self.polyline(&points, color, thickness);
        }
    }

    /// One line of text, capitals in cells of 6×8 pixels times `scale`, the upper left corner at (`x`, `y`).
    #[allow(clippy::cast_possible_wrap)] // positions within a line of text are far below 2^63
    pub fn text(&mut self, x: i64, y: i64, text: &str, color: Rgb, scale: usize) {
        for (i, c) in text.chars().enumerate() {
            for (column, row) in font::dots(c) {
                for dy in 0..scale {
                    for dx in 0..scale {
                        let (column, row) = ((i * 6 + column) * scale + dx, row * scale + dy);
                        self.blend(x + column as i64, y + row as i64, color, 1.0);
                    }
                }
            }
        }
    }

    /// Copies `other` with its upper left corner at (`x`, `y`); what lies outside is cut off.
    pub fn paste(&mut self, x: usize, y: usize, other: &Self) {
        let columns = other.width.min(self.width.saturating_sub(x));
        for row in 0..other.height.min(self.height.saturating_sub(y)) {
            let (to, from) = ((y + row) * self.width + x, row * other.width);
            self.pixels[to..to + columns].copy_from_slice(&other.pixels[from..from + columns]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHITE: Rgb = [255; 3];

    fn ink(canvas: &Canvas) -> f64 {
        canvas.pixels().iter().map(|p| f64::from(p[0]) / 255.0).sum()
    }

    fn drawn(a: (f64, f64), b: (f64, f64), thickness: f64) -> Canvas {
        let mut canvas = Canvas::new(64, 48, [0; 3]);
        canvas.line(Point2::new(a.0, a.1), Point2::new(b.0, b.1), WHITE, thickness);
        canvas
    }

    #[test]
    fn a_line_has_the_area_of_its_length_times_its_thickness() {
        for (a, b) in [((10.0, 20.5), (50.0, 20.5)), ((10.5, 5.0), (10.5, 45.0)), ((8.0, 8.0), (40.0, 40.0))] {
            let length: f64 = f64::hypot(a.0 - b.0, a.1 - b.1);
            let area = ink(&drawn(a, b, 2.0));
            // Round ends add up to the area of a disk; sampling at pixel centers costs a few percent.
            assert!(area > 1.9 * length && area < 2.1 * length + 4.0, "{a:?} to {b:?}: {area} for length {length}");
        }
    }

    #[test]
    fn a_horizontal_line_through_pixel_centers_fills_exactly_its_row() {
        let canvas = drawn((10.0, 20.5), (50.0, 20.5), 1.0);
        let row = |y: usize| canvas.pixels()[y * 64 + 30];
        assert_eq!([row(19), row(20), row(21)], [[0; 3], WHITE, [0; 3]]);
    }

    #[test]
    fn lines_far_outside_cost_nothing_and_are_cut_at_the_edge() {
        assert_eq!(ink(&drawn((-1e12, -5.0), (1e12, -5.0), 1.0)), 0.0);
        assert_eq!(ink(&drawn((f64::NAN, 0.0), (5.0, 5.0), 1.0)), 0.0);
        let through = drawn((-1e9, 20.5), (1e9, 20.5), 1.0);
        assert_eq!(ink(&through), 64.0);
    }

    #[test]
    fn a_grid_draws_every_edge() {
        let at = |i: usize, j: usize| Point2::new(4.5 + 10.0 * i as f64, 4.5 + 10.0 * j as f64);
        let vertices: Vec<_> = (0..3).flat_map(|j| (0..4).map(move |i| at(i, j))).collect();
        let mut canvas = Canvas::new(64, 48, [0; 3]);
        canvas.grid(&vertices, 4, WHITE, 1.0);
        for (x, y) in [(9, 4), (29, 24), (4, 9), (34, 19), (14, 14)] {
            assert_eq!(canvas.pixels()[y * 64 + x], WHITE, "edge through ({x}, {y})");
        }
        assert_eq!(canvas.pixels()[9 * 64 + 9], [0; 3], "inside a cell");
    }

    #[test]
    fn text_and_pastes_are_cut_at_the_edge() {
        let mut canvas = Canvas::new(20, 10, [0; 3]);
        canvas.text(-3, -2, "A1?", WHITE, 2);
        canvas.paste(15, 5, &Canvas::new(10, 10, [9; 3]));
        assert_eq!(canvas.pixels()[9 * 20 + 19], [9; 3]);
    }
}
