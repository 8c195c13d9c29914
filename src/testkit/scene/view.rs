//! Pictures of a scene: a scan-line z-buffer, each row with its own camera, four coverage samples per pixel.
//!
//! Along a row, `1/z` of a plane is linear in x, so that visibility costs one addition and one comparison per sample:
//! with `r = (X, Y, 1)` the ray of a sample, `n` the normal and `k = n·(p₀ − c)` in camera axes, `1/z = (n·r)/k`.

use rayon::prelude::*;

use super::geometry::{LightMap, Polygon};
use super::{Pose, Scene, Vec3, paint};
use plumbline_image::canvas::srgb::Encode;
use plumbline_image::canvas::{Canvas, Rgb};

/// Coverage samples per pixel and axis.
const SAMPLES: usize = 2;
/// Coverage samples per pixel.
const COUNT: usize = SAMPLES * SAMPLES;
/// Near plane, m.
const NEAR_M: f32 = 0.08;
/// Distance at which haze has taken 63 % of a color, m.
const HAZE_M: f32 = 330.0;
const HAZE: [f32; 3] = [0.62, 0.74, 0.92];
/// Identifier of the sky in the coverage buffer.
const SKY: u16 = u16::MAX;

/// A pinhole camera's picture: size and focal length in pixels, the principal point in the middle.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// Width, px.
    pub width: usize,
    /// Height, px.
    pub height: usize,
    /// Focal length, px.
    pub focal_px: f64,
    /// Time between the exposures of the first row and the last, s; 0: all at once.
    pub readout_s: f64,
}

/// A camera in single precision, for the pixel loops of one row.
struct RowCamera {
    rotation: nalgebra::Matrix3<f32>,
    center: Vec3,
}

impl RowCamera {
    fn new(pose: &Pose) -> Self {
        Self { rotation: pose.cam_from_world.matrix().cast(), center: pose.center.cast() }
    }
}

/// A polygon's plane in the axes of a row's camera.
struct Plane {
    normal: Vec3,
    k: f32,
}

impl Plane {
    fn new(polygon: &Polygon, camera: &RowCamera) -> Self {
        let k = polygon.normal.dot(&(polygon.origin - camera.center));
        Self { normal: camera.rotation * polygon.normal, k }
    }
}

impl View {
    /// The picture of `scene` and its moving objects by the camera at `pose_at(time offset in s)`.
    pub fn render(&self, scene: &Scene, movers: &[Polygon], pose_at: impl Fn(f64) -> Pose + Sync) -> Canvas {
        let polygons: Vec<&Polygon> = scene.polygons.iter().chain(movers).collect();
        assert!(polygons.len() < SKY as usize, "{} polygons (allowed: {SKY})", polygons.len());
        let mut pixels: Vec<Rgb> = vec![[0; 3]; self.width * self.height];
        let shadows = feet(movers);
        let encode = Encode::new();
        pixels.par_chunks_mut(self.width).enumerate().for_each(|(y, row)| {
            let offset = ((y as f64 + 0.5) / self.height as f64 - 0.5) * self.readout_s;
            let camera = RowCamera::new(&pose_at(offset));
            let coverage: [Vec<u16>; SAMPLES] = std::array::from_fn(|k| self.visible(&polygons, &camera, y, k));
            let shader = Shader { view: self, scene, polygons: &polygons, camera: &camera, shadows: &shadows };
            for (x, pixel) in row.iter_mut().enumerate() {
                *pixel = encode.apply(shader.pixel(&coverage, x, y));
            }
        });
        Canvas::from_pixels(self.width, self.height, pixels).expect("one pixel per place")
    }

    /// Normalized ray `(X, Y)` of sample `k` of `SAMPLES` across pixel `x` (or row `y`) of a side of `size` px.
    fn ray(&self, position: usize, sample: usize, size: usize) -> f32 {
        let at = position as f64 + (sample as f64 + 0.5) / SAMPLES as f64 - size as f64 / 2.0;
        (at / self.focal_px) as f32
    }

    /// Which polygon each sample of line `k` within row `y` sees.
    fn visible(&self, polygons: &[&Polygon], camera: &RowCamera, y: usize, k: usize) -> Vec<u16> {
        let count = self.width * SAMPLES;
        let (mut nearest, mut seen) = (vec![0.0_f32; count], vec![SKY; count]);
        let ray_y = self.ray(y, k, self.height);
        let (first, step) = (self.ray(0, 0, self.width), 1.0 / (self.focal_px as f32 * SAMPLES as f32));
        let mut corners = Vec::with_capacity(16);
        // Normal of the plane that the row sweeps, in the world: what lies off it needs no closer look.
        let swept = camera.rotation.transpose() * Vec3::new(0.0, 1.0, -ray_y);
        for (id, polygon) in polygons.iter().enumerate() {
            if !polygon.may_cross(camera.center, swept) {
                continue;
            }
            let plane = Plane::new(polygon, camera);
            if plane.k >= 0.0 {
                continue; // seen from behind
            }
            clipped(polygon, camera, &mut corners);
            let Some((left, right)) = span(&corners, ray_y) else { continue };
            let from = ((left - first) / step).ceil().clamp(0.0, count as f32) as usize;
            let to = ((right - first) / step).ceil().clamp(0.0, count as f32) as usize;
            let inverse = |i: usize| {
                let x = first + step * i as f32;
                (plane.normal.x * x + plane.normal.y * ray_y + plane.normal.z) / plane.k
            };
            if from >= to {
                continue;
            }
            let (start, slope) = (inverse(from), plane.normal.x * step / plane.k);
            for (i, (w, s)) in nearest[from..to].iter_mut().zip(&mut seen[from..to]).enumerate() {
                let inverse_z = start + slope * i as f32;
                if inverse_z > *w {
                    (*w, *s) = (inverse_z, id as u16);
                }
            }
        }
        seen
    }
}

/// The vertices of a polygon in a camera's axes, the part in front of the near plane (Sutherland–Hodgman).
fn clipped(polygon: &Polygon, camera: &RowCamera, into: &mut Vec<Vec3>) {
    into.clear();
    let in_camera = |v: &Vec3| camera.rotation * (v - camera.center);
    let Some(last) = polygon.vertices.last() else { return };
    let mut previous = in_camera(last);
    for vertex in &polygon.vertices {
        let current = in_camera(vertex);
        if (previous.z > NEAR_M) != (current.z > NEAR_M) {
            into.push(previous + (current - previous) * ((NEAR_M - previous.z) / (current.z - previous.z)));
        }
        if current.z > NEAR_M {
            into.push(current);
        }
        previous = current;
    }
}

/// Where the row with normalized height `ray_y` enters and leaves a convex polygon in front of the camera, normalized x.
fn span(vertices: &[Vec3], ray_y: f32) -> Option<(f32, f32)> {
    // Height above the row's plane through the camera: its sign tells the side without a division.
    let above = |p: &Vec3| p.y - ray_y * p.z;
    let (mut left, mut right) = (f32::MAX, f32::MIN);
    let mut a = vertices.last()?;
    for b in vertices {
        let (ha, hb) = (above(a), above(b));
        if (ha <= 0.0) != (hb <= 0.0) {
            let p = a + (b - a) * (ha / (ha - hb));
            (left, right) = (left.min(p.x / p.z), right.max(p.x / p.z));
        }
        a = b;
    }
    (left < right).then_some((left, right))
}

/// What a row needs to color its pixels.
struct Shader<'a> {
    view: &'a View,
    scene: &'a Scene,
    polygons: &'a [&'a Polygon],
    camera: &'a RowCamera,
    shadows: &'a [(f32, f32)],
}

impl Shader<'_> {
    /// Mean light of a pixel: each polygon that its samples see is shaded once, at the mean position of those samples.
    fn pixel(&self, coverage: &[Vec<u16>; SAMPLES], x: usize, y: usize) -> Vec3 {
        let sample = |i: usize| {
            let (column, line) = (i % SAMPLES, i / SAMPLES);
            let at = (self.view.ray(x, column, self.view.width), self.view.ray(y, line, self.view.height));
            (coverage[line][x * SAMPLES + column], at)
        };
        let samples: [(u16, (f32, f32)); COUNT] = std::array::from_fn(sample);
        let mut sum = Vec3::zeros();
        for (i, (seen, _)) in samples.iter().enumerate() {
            if samples[..i].iter().any(|(earlier, _)| earlier == seen) {
                continue;
            }
            let (mut n, mut mean) = (0.0, (0.0, 0.0));
            for (_, at) in samples[i..].iter().filter(|(other, _)| other == seen) {
                n += 1.0;
                mean = (mean.0 + at.0, mean.1 + at.1);
            }
            sum += self.shade(*seen, mean.0 / n, mean.1 / n) * n;
        }
        sum / COUNT as f32
    }

    /// Tone-mapped linear color along the ray (X, Y, 1).
    fn shade(&self, seen: u16, ray_x: f32, ray_y: f32) -> Vec3 {
        let ray = Vec3::new(ray_x, ray_y, 1.0);
        if seen == SKY {
            return sky((self.camera.rotation.transpose() * ray).normalize());
        }
        let polygon = self.polygons[seen as usize];
        let plane = Plane::new(polygon, self.camera);
        let denominator = plane.normal.dot(&ray);
        let z = plane.k / denominator;
        // Surface coordinates along each axis, m, and their derivatives by X and Y.
        let offset = self.camera.center - polygon.origin;
        let surface = |axis: &Vec3| {
            let a = self.camera.rotation * axis;
            let slope = |c: usize| z / denominator * (a[c] * denominator - a.dot(&ray) * plane.normal[c]);
            (z * a.dot(&ray) + axis.dot(&offset), slope(0), slope(1))
        };
        let (s, t) = (surface(&polygon.axes[0]), surface(&polygon.axes[1]));
        let pixel = 1.0 / self.view.focal_px as f32;
        let scale = match polygon.material.tile_m {
            Some(tile) => [1.0 / tile; 2],
            None => [1.0 / polygon.size[0], 1.0 / polygon.size[1]],
        };
        let across = [s.1 * pixel * scale[0], t.1 * pixel * scale[1]];
        let along = [s.2 * pixel * scale[0], t.2 * pixel * scale[1]];
        let texture = &self.scene.textures[polygon.material.texture];
        let paint = texture.sample([s.0 * scale[0], t.0 * scale[1]], across, along);
        let light =
            lookup(&polygon.light, s.0 / polygon.size[0], t.0 / polygon.size[1]) * self.contact(polygon, s.0, t.0);
        let color = paint.component_mul(&light).component_mul(&Vec3::from(polygon.material.tint));
        let haze = 1.0 - (-z * ray.norm() / HAZE_M).exp();
        tone(color + (Vec3::from(HAZE) - color) * haze)
    }

    /// Darkening of the ground around the feet of moving objects.
    fn contact(&self, polygon: &Polygon, s: f32, t: f32) -> f32 {
        if self.shadows.is_empty() || polygon.normal.y > -0.9 {
            return 1.0;
        }
        let p = polygon.origin + polygon.axes[0] * s + polygon.axes[1] * t;
        let dark = |(x, z): &(f32, f32)| 1.0 - 0.55 * (-((p.x - x).powi(2) + (p.z - z).powi(2)) / 0.09).exp();
        if p.y < -0.4 { 1.0 } else { self.shadows.iter().map(dark).product() }
    }
}

/// Ground positions of the polygons that come within 15 cm of the ground.
fn feet(movers: &[Polygon]) -> Vec<(f32, f32)> {
    let lowest = |p: &Polygon| p.vertices.iter().max_by(|a, b| a.y.total_cmp(&b.y)).copied();
    let near_ground = movers.iter().filter(|p| p.normal.y > 0.9).filter_map(lowest).filter(|v| v.y > -0.15);
    near_ground.map(|v| (v.x, v.z)).collect()
}

/// Light at (`u`, `v`) in [0, 1] of a light map, bilinear.
fn lookup(map: &LightMap, u: f32, v: f32) -> Vec3 {
    if map.values.len() == 1 {
        return map.values[0];
    }
    let (x, y) = (u.clamp(0.0, 1.0) * (map.cols - 1) as f32, v.clamp(0.0, 1.0) * (map.rows - 1) as f32);
    let (x0, y0) = ((x as usize).min(map.cols - 2), (y as usize).min(map.rows - 2));
    let (fx, fy) = (x - x0 as f32, y - y0 as f32);
    let at = |dx: usize, dy: usize| map.values[(y0 + dy) * map.cols + x0 + dx];
    (at(0, 0) * (1.0 - fx) + at(1, 0) * fx) * (1.0 - fy) + (at(0, 1) * (1.0 - fx) + at(1, 1) * fx) * fy
}

/// A blue sky with fair-weather clouds, for a unit direction.
fn sky(direction: Vec3) -> Vec3 {
    let up = (-direction.y).max(0.0);
    let blue =
        Vec3::new(0.72, 0.82, 0.95) + (Vec3::new(0.16, 0.36, 0.72) - Vec3::new(0.72, 0.82, 0.95)) * up.powf(0.55);
    let flat = 0.7 / (up + 0.25);
    let cloud = paint::fractal(direction.x * flat + 0.3, direction.z * flat, 4, 5, 90);
    let cover = ((cloud - 0.52) * 4.0).clamp(0.0, 0.95) * (up * 5.0).min(1.0);
    blue + (Vec3::new(0.93, 0.92, 0.90) - blue) * cover
}

/// Compresses highlights: nothing clips, shadows stay linear.
fn tone(color: Vec3) -> Vec3 {
    color.map(|v| 1.0 - (-1.05 * v).exp())
}
