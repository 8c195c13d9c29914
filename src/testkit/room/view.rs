//! Pictures of the room: rays through a lens against the box.

use rayon::prelude::*;

use super::paint::{Color, light};
use super::panel::Panel;
use super::{HIGH, LOW, Room, Wall};
use plumbline_camera::{CameraPose, Lens, Point3, Vec3};
use plumbline_image::canvas::srgb::srgb_from_linear;
use plumbline_image::canvas::{Canvas, Rgb};
use plumbline_num::math::Point2;

/// A camera in the room.
#[derive(Clone, Debug)]
pub struct RoomView {
    /// Its lens, whose size is the size of the picture.
    pub lens: Lens,
    /// Its pose; the center is inside the room.
    pub pose: CameraPose,
    /// Samples per pixel and axis: the picture is their mean over the pixel's square.
    pub samples: usize,
}

impl RoomView {
    /// The picture; black where the lens sees nothing.
    pub fn render(&self, room: &Room) -> Canvas {
        let (width, height) = (self.lens.size.0 as usize, self.lens.size.1 as usize);
        let mut pixels: Vec<Rgb> = vec![[0; 3]; width * height];
        let walls = by_wall(room);
        pixels.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
            for (x, pixel) in row.iter_mut().enumerate() {
                *pixel = encoded(self.mean(&walls, x, y));
            }
        });
        Canvas::from_pixels(width, height, pixels).expect("one pixel per place")
    }

    /// Mean color of the samples of a pixel.
    fn mean(&self, walls: &[Vec<&Panel>; 6], x: usize, y: usize) -> Color {
        let n = self.samples.max(1);
        let mut sum = [0.0_f32; 3];
        for j in 0..n {
            for i in 0..n {
                let offset = |k: usize| (k as f64 + 0.5) / n as f64;
                let p = Point2::new(x as f64 + offset(i), y as f64 + offset(j));
                let color = self.lens.unproject(p).map_or([0.0; 3], |ray| self.seen(walls, &ray));
                sum = std::array::from_fn(|c| sum[c] + color[c]);
            }
        }
        sum.map(|c| c / (n * n) as f32)
    }

    /// The color in a direction of the camera.
    fn seen(&self, walls: &[Vec<&Panel>; 6], ray: &Vec3) -> Color {
        let direction = self.pose.rotation.inverse() * ray;
        let center = self.pose.center();
        let (wall, place) = hit(&center, &direction);
        let [a, b] = wall.along();
        let (s, t) = (place[a], place[b]);
        // Later panels lie over earlier ones.
        let panel = walls[index(wall)].iter().rev().find(|p| p.holds(s, t));
        let color = panel.map_or([0.0; 3], |p| p.paint.color(s - p.s.0, t - p.t.0, p.t.1 - p.t.0));
        color.map(|c| c * light(wall, s, t))
    }
}

fn index(wall: Wall) -> usize {
    2 * wall.axis + usize::from(wall.high)
}

fn by_wall(room: &Room) -> [Vec<&Panel>; 6] {
    let mut walls: [Vec<&Panel>; 6] = Default::default();
    for panel in &room.panels {
        walls[index(panel.wall)].push(panel);
    }
    walls
}

/// The wall that a ray from inside the room meets, and where.
pub(super) fn hit(center: &Point3, direction: &Vec3) -> (Wall, Point3) {
    let mut nearest = (f64::INFINITY, Wall::FRONT);
    for axis in 0..3 {
        let high = direction[axis] > 0.0;
        let bound = if high { HIGH[axis] } else { LOW[axis] };
        let distance = (bound - center[axis]) / direction[axis];
        // NaN, for a ray along the wall, is not less.
        if distance < nearest.0 {
            nearest = (distance, Wall { axis, high });
        }
    }
    (nearest.1, center + nearest.0 * direction)
}

/// Linear light to sRGB, highlights compressed.
fn encoded(color: Color) -> Rgb {
    color.map(|c| {
        let toned = 1.0 - (-1.35 * c).exp();
        (srgb_from_linear(toned) * 255.0).round().clamp(0.0, 255.0) as u8
    })
}
