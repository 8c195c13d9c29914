//! Names beside points in space.

#![allow(clippy::cast_possible_wrap)] // sides of pictures are far below 2^63

use nalgebra::Point3;

use super::SurfaceCamera;
use plumbline_image::canvas::{Canvas, Rgb, text_width};

const INK: Rgb = [24, 26, 32];
const HALO: Rgb = [255, 255, 255];
/// Characters of a name that are shown.
const MAX_CHARACTERS: usize = 32;

/// A name beside a point in space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Label<'a> {
    /// The point.
    pub at: Point3<f64>,
    /// The name; no more than 32 characters of it are shown.
    pub text: &'a str,
}

/// A rectangle of pixels: left, top, right, bottom.
type Area = [i64; 4];

/// Which parts of a picture have a name already, in cells of half a line of text.
struct Taken {
    cell: i64,
    columns: i64,
    cells: Vec<bool>,
}

impl Taken {
    fn new((width, height): (i64, i64), cell: i64) -> Self {
        let (columns, rows) = (width / cell + 1, height / cell + 1);
        Self { cell, columns, cells: vec![false; (columns * rows) as usize] }
    }

    /// The cells of an area inside the picture.
    fn under(&self, &[left, top, right, bottom]: &Area) -> impl Iterator<Item = usize> + use<> {
        let (cell, columns) = (self.cell, self.columns);
        let along = move |from: i64, to: i64| from / cell..=(to - 1) / cell;
        along(top, bottom).flat_map(move |row| along(left, right).map(move |column| (row * columns + column) as usize))
    }

    fn is_free(&self, area: &Area) -> bool {
        self.under(area).all(|cell| !self.cells[cell])
    }

    fn take(&mut self, area: &Area) {
        self.under(area).for_each(|cell| self.cells[cell] = true);
    }
}

/// Writes names beside their points, `gap_px` away, in the order given: to the right where there is room, else to the left, above or below.
/// A name that would touch an earlier one or lie outside the picture is left out, as is one of a point behind the camera. Returns how many
/// are written.
///
/// # Example
/// ```
/// use nalgebra::Point3;
/// use plumbline_num::run::Run;
/// use plumbline_shape::draw::{Label, Style, Surface, SurfaceCamera, UpAxis, ViewDirection, draw, draw_labels};
/// use plumbline_shape::mesh::shapes;
///
/// let bar = shapes::bar([1, 1, 2], [1.0, 1.0, 2.0]);
/// let camera = SurfaceCamera::fit(bar.positions(), ViewDirection::default(), UpAxis::default(), (320, 240));
/// let mut picture = draw(&Surface::new(&bar), &camera, &Style::default(), &Run::default())?;
/// let here = Label { at: Point3::origin(), text: "spine" };
/// assert_eq!(draw_labels(&[here, here], 6.0, &camera, &mut picture), 2, "to the right and to the left");
/// # Ok::<(), plumbline_num::run::Stopped>(())
/// ```
pub fn draw_labels(labels: &[Label<'_>], gap_px: f64, camera: &SurfaceCamera, canvas: &mut Canvas) -> usize {
    let (width, height) = (canvas.width() as i64, canvas.height() as i64);
    let scale = (canvas.width().min(canvas.height()) / 400).clamp(1, 4);
    let mut taken = Taken::new((width, height), 4 * scale as i64);
    let mut count = 0;
    for label in labels {
        let text: String = label.text.chars().take(MAX_CHARACTERS).collect();
        let seen = camera.pose.apply(&label.at);
        if !(seen.z > camera.near) || text.is_empty() {
            continue;
        }
        let at = camera.project(&seen);
        if !(at.x >= 0.0 && at.y >= 0.0 && at.x < width as f64 && at.y < height as f64) {
            continue;
        }
        let (x, y, gap) = (at.x as i64, at.y as i64, gap_px.clamp(0.0, 1000.0) as i64);
        let (w, h) = (text_width(&text, scale) as i64, 8 * scale as i64);
        let places = [(x + gap, y - h / 2), (x - gap - w, y - h / 2), (x - w / 2, y - gap - h), (x - w / 2, y + gap)];
        let areas = places.map(|(left, top)| [left, top, left + w, top + h]);
        let fits = |area: &&Area| {
            let inside = area[0] >= 0 && area[1] >= 0 && area[2] <= width && area[3] <= height;
            inside && taken.is_free(area)
        };
        if let Some(area) = areas.iter().find(fits).copied() {
            written(canvas, &area, &text, scale);
            taken.take(&area);
            count += 1;
        }
    }
    count
}

/// Dark on a light rim, to be read on any color.
fn written(canvas: &mut Canvas, area: &Area, text: &str, scale: usize) {
    for (dx, dy) in [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)] {
        canvas.text(area[0] + dx, area[1] + dy, text, HALO, scale);
    }
    canvas.text(area[0], area[1], text, INK, scale);
}

#[cfg(test)]
mod tests {
    use super::super::{UpAxis, ViewDirection};
    use super::*;

    #[test]
    fn names_never_lie_on_one_another_and_those_without_room_are_left_out() {
        let corners = [Point3::new(-1.0, -1.0, 0.0), Point3::new(1.0, 1.0, 0.0)];
        let camera = SurfaceCamera::fit(&corners, ViewDirection::default(), UpAxis::default(), (200, 200));
        let blank = || Canvas::new(200, 200, [128; 3]);
        let here = Label { at: Point3::origin(), text: "joint" };
        let mut canvas = blank();
        assert_eq!(draw_labels(&[here; 9], 8.0, &camera, &mut canvas), 4, "one on each side");
        let inks = canvas.as_bytes().chunks(3).filter(|p| *p == INK).count();
        let mut one = blank();
        draw_labels(&[here], 8.0, &camera, &mut one);
        assert_eq!(inks, 4 * one.as_bytes().chunks(3).filter(|p| *p == INK).count());
        // Behind the camera, outside, nowhere, without a name, and too long for the picture.
        let eye = camera.pose.inverse().apply(&Point3::new(0.0, 0.0, -1.0));
        let far = Point3::new(1e6, 0.0, 0.0);
        let nowhere = Point3::new(f64::NAN, 0.0, 0.0);
        let wide = "a name that is wider than the picture is";
        let unseen = [(eye, "eye"), (far, "far"), (nowhere, "nan"), (Point3::origin(), ""), (Point3::origin(), wide)];
        let unseen = unseen.map(|(at, text)| Label { at, text });
        assert_eq!(draw_labels(&unseen, 5.0, &camera, &mut blank()), 0);
    }
}
