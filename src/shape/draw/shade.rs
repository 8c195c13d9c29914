//! Pixel colors: each triangle visible in a pixel is shaded once, at the mean position of its samples.
//!
//! Layers of a translucent surface are composited front to back: with the light `L` and opacity `α` of a layer and the
//! transmittance `T` of the layers before it, a pixel accumulates `T α L` and continues with `T (1 − α)`. The opacity grows at
//! grazing angles, where the path through the surface is longer, as for glass: `α = o + (1 − o)(1 − |n·v|)³`.
//!
//! With the corners `a, b, c` of a triangle in camera coordinates, the intersection of the ray `r = (X, Y, 1)` with its plane has
//! barycentric coordinates proportional to `r·(b×c), r·(c×a), r·(a×b)`: no perspective correction is needed.

use nalgebra::{Point3, Rotation3, Vector3};
use rayon::prelude::*;

use super::corner_normals::corner_normals;
use super::lighting::Lights;
use super::occlusion::Occlusion;
use super::visibility::{NO_TRIANGLE, View, VisibleLayer};
use super::{Paint, Style, Surface, SurfaceCamera, Wireframe};
use plumbline_image::canvas::srgb::{Encode, LINEAR};
use plumbline_image::canvas::{Canvas, Rgb};
use plumbline_num::math::{Point2, Vec2};
use plumbline_num::run::{Run, Stopped};

type Vec3 = Vector3<f32>;

/// Color of missing and NaN entries.
const UNKNOWN: Rgb = [128, 128, 128];
/// Inradius of a triangle, in line widths, from which on its wireframe has full strength: below, lines would cover the surface.
const MIN_LINE_INRADIUS: f64 = 3.0;

/// Maximum number of peeled layers; at an opacity of 0.3 the remaining transmittance is about 1 %.
const MAX_LAYERS: usize = 12;

/// Accumulated light of a pixel, and its transmittance.
#[derive(Clone, Copy)]
struct Gathered {
    light: Vec3,
    transmittance: f32,
}

/// Colors every pixel; returns the picture and the layers that may hide marks.
pub(super) fn shade(
    surface: &Surface<'_>,
    camera: &SurfaceCamera,
    style: &Style,
    view: &View,
    run: &Run,
) -> Result<(Canvas, Occlusion), Stopped> {
    let legible = !matches!(surface.paint, Paint::Plain(_));
    let shader = Shader {
        surface,
        camera,
        view,
        normals: (!style.flat).then(|| corner_normals(surface.mesh, style.crease_deg)),
        camera_from_world: camera.pose.rotation.to_rotation_matrix().cast(),
        lights: Lights::new(legible),
        colors: Colors::new(surface.paint),
        wireframe: style.wireframe,
        back: style.back.map(linear),
        opacity: if style.opacity < 1.0 { style.opacity.max(0.0) as f32 } else { 1.0 },
    };
    run.check()?;
    let (width, height) = camera.size;
    let mut gathered = vec![Gathered { light: Vec3::zeros(), transmittance: 1.0 }; width * height];
    let occlusion = shader.gather(&mut gathered, run)?;
    let encode = Encode::new();
    let mut pixels: Vec<Rgb> = vec![[0; 3]; width * height];
    let rows = pixels.par_chunks_mut(width).zip(gathered.par_chunks(width));
    rows.enumerate().for_each(|(y, (row, gathered))| {
        let behind = background(style, y, height);
        for (pixel, g) in row.iter_mut().zip(gathered) {
            *pixel = encode.apply(g.light + behind * g.transmittance);
        }
    });
    Ok((Canvas::from_pixels(width, height, pixels).expect("one color per pixel"), occlusion))
}

fn background(style: &Style, y: usize, height: usize) -> Vec3 {
    let [above, below] = style.background.map(linear);
    above + (below - above) * ((y as f32 + 0.5) / height as f32)
}

fn linear(color: Rgb) -> Vec3 {
    Vec3::from(color.map(|v| LINEAR[usize::from(v)]))
}

/// Colors of a surface, as linear light.
enum Colors<'a> {
    Listed(Paint<'a>),
    Mapped(Paint<'a>, Vec<Vec3>),
}

impl<'a> Colors<'a> {
    fn new(paint: Paint<'a>) -> Self {
        match &paint {
            Paint::VertexValues(_, scale) | Paint::FaceValues(_, scale) => {
                let table = scale.map.table().map(linear).to_vec();
                Self::Mapped(paint, table)
            }
            _ => Self::Listed(paint),
        }
    }

    fn at(&self, triangle: usize, corners: [u32; 3], weights: [f64; 3]) -> Vec3 {
        let of = |colors: &[Rgb], i: usize| linear(colors.get(i).copied().unwrap_or(UNKNOWN));
        match self {
            Self::Listed(Paint::VertexColors(colors)) => {
                let mixed = corners.iter().zip(weights).map(|(v, w)| of(colors, *v as usize) * w as f32);
                mixed.sum()
            }
            Self::Listed(Paint::FaceColors(colors)) => of(colors, triangle),
            Self::Listed(Paint::Plain(color)) => linear(*color),
            Self::Mapped(Paint::VertexValues(values, scale), table) => {
                let value = |v: u32| values.get(v as usize).copied().unwrap_or(f64::NAN);
                mapped(scale.normalized(corners.iter().zip(weights).map(|(v, w)| value(*v) * w).sum()), table)
            }
            Self::Mapped(Paint::FaceValues(values, scale), table) => {
                mapped(values.get(triangle).and_then(|v| scale.normalized(*v)), table)
            }
            Self::Listed(_) | Self::Mapped(..) => linear(UNKNOWN),
        }
    }
}

fn mapped(position: Option<f64>, table: &[Vec3]) -> Vec3 {
    position.map_or_else(|| linear(UNKNOWN), |t| table[(t * (table.len() - 1) as f64).round() as usize])
}

struct Shader<'a> {
    surface: &'a Surface<'a>,
    camera: &'a SurfaceCamera,
    view: &'a View,
    normals: Option<Vec<[Vec3; 3]>>,
    camera_from_world: Rotation3<f32>,
    lights: Lights,
    colors: Colors<'a>,
    wireframe: Option<Wireframe>,
    back: Option<Vec3>,
    opacity: f32,
}

impl Shader<'_> {
    /// Accumulates the light of the surface, layer by layer where it is translucent.
    fn gather(&self, gathered: &mut [Gathered], run: &Run) -> Result<Occlusion, Stopped> {
        let mut layer = self.view.nearest(run)?;
        if self.opacity >= 1.0 {
            self.add(&layer, gathered, run)?;
            return Ok(Occlusion::Opaque(layer));
        }
        let mut occlusion = Occlusion::Translucent { width: self.camera.size.0, layers: Vec::new() };
        for _ in 0..MAX_LAYERS {
            if layer.is_empty() {
                break;
            }
            occlusion.push(&self.add(&layer, gathered, run)?, &layer);
            layer = self.view.behind(&layer, run)?;
        }
        Ok(occlusion)
    }

    /// Adds the light of a layer; returns its opacity per pixel.
    fn add(&self, layer: &VisibleLayer, gathered: &mut [Gathered], run: &Run) -> Result<Vec<f32>, Stopped> {
        let mut opacity = vec![0.0; gathered.len()];
        let width = self.camera.size.0;
        let rows = gathered.par_chunks_mut(width).zip(opacity.par_chunks_mut(width));
        rows.enumerate().try_for_each(|(y, (row, opacity))| {
            run.check()?;
            for (x, (g, opacity)) in row.iter_mut().zip(opacity).enumerate() {
                if let Some((light, cover)) = self.pixel(layer, x, y) {
                    g.light += light * g.transmittance;
                    g.transmittance *= 1.0 - cover;
                    *opacity = cover;
                }
            }
            Ok(())
        })?;
        Ok(opacity)
    }

    /// Light and opacity of a layer in a pixel; `None` where no sample hits it.
    fn pixel(&self, layer: &VisibleLayer, x: usize, y: usize) -> Option<(Vec3, f32)> {
        let n = layer.samples;
        let sample = |i: usize| layer.triangle(x, y, i % n, i / n);
        let first = sample(0);
        if (1..n * n).all(|i| sample(i) == first) {
            return (first != NO_TRIANGLE).then(|| self.light(first as usize, x as f64 + 0.5, y as f64 + 0.5));
        }
        let (mut light, mut cover) = (Vec3::zeros(), 0.0);
        for i in 0..n * n {
            let triangle = sample(i);
            if triangle == NO_TRIANGLE || (0..i).any(|k| sample(k) == triangle) {
                continue;
            }
            let (mut count, mut sum) = (0.0, Vec2::zeros());
            for k in (i..n * n).filter(|k| sample(*k) == triangle) {
                count += 1.0;
                sum += Vec2::new((k % n) as f64 + 0.5, (k / n) as f64 + 0.5);
            }
            let at = sum / (count * n as f64);
            let (own, opacity) = self.light(triangle as usize, x as f64 + at.x, y as f64 + at.y);
            light += own * count as f32;
            cover += opacity * count as f32;
        }
        let all = (n * n) as f32;
        Some((light / all, cover / all))
    }

    /// Linear light and opacity of a triangle at the pixel position (`x`, `y`).
    fn light(&self, triangle: usize, x: f64, y: f64) -> (Vec3, f32) {
        let corners = self.surface.mesh.triangles()[triangle];
        let [a, b, c] = corners.map(|v| self.view.vertices[v as usize]);
        let (ray_x, ray_y) = self.camera.ray(x, y);
        let ray = Vector3::new(ray_x, ray_y, 1.0);
        let weights = barycentric(&ray, &a, &b, &c);
        let normal = (b - a).cross(&(c - a));
        let from_behind = normal.dot(&ray) > 0.0;
        let view: Vec3 = ray.normalize().cast();
        let mut n: Vec3 = match &self.normals {
            Some(normals) => {
                let mixed: Vec3 = normals[triangle].iter().zip(weights).map(|(n, w)| n * w as f32).sum();
                self.camera_from_world * mixed
            }
            None => normal.try_normalize(0.0).unwrap_or_else(Vector3::zeros).cast(),
        };
        n = n.try_normalize(0.0).unwrap_or(-view);
        if from_behind {
            n = -n;
        }
        let color = match self.back {
            Some(back) if from_behind => back,
            _ => self.colors.at(triangle, corners, weights),
        };
        let lit = self.lights.on(color, &n, &view);
        let grazing = 1.0 - n.dot(&view).abs().min(1.0);
        let opacity = self.opacity + (1.0 - self.opacity) * grazing.powi(3);
        let line = self.wireframe.as_ref().map_or(0.0, |wire| self.line(wire, triangle, [a, b, c], Point2::new(x, y)));
        let ink = self.wireframe.map_or_else(Vec3::zeros, |wire| linear(wire.color));
        let (line, through) = (line as f32, 1.0 - line as f32);
        (ink * line + lit * (opacity * through), line + opacity * through)
    }

    /// Coverage of a point inside a triangle by the wireframe.
    fn line(&self, wire: &Wireframe, triangle: usize, corners: [Point3<f64>; 3], at: Point2) -> f64 {
        let shown = self.surface.edges.map_or(7, |edges| edges.get(triangle).copied().unwrap_or(7));
        if corners.iter().any(|p| p.z <= self.camera.near) || !(wire.width_px > 0.0) {
            return 0.0;
        }
        let projected = corners.map(|p| self.camera.project(&p));
        let sides = [0, 1, 2].map(|k| projected[(k + 1) % 3] - projected[k]);
        let area = sides[0].perp(&sides[1]).abs();
        let radius = area / sides.iter().map(Vec2::norm).sum::<f64>();
        let distance = |k: usize| sides[k].perp(&(at - projected[k])).abs() / sides[k].norm();
        let lines = (0..3).filter(|k| shown >> k & 1 == 1).map(distance);
        let nearest = lines.fold(f64::INFINITY, f64::min);
        let strength = (radius / (MIN_LINE_INRADIUS * wire.width_px)).min(1.0);
        (wire.width_px / 2.0 + 0.5 - nearest).clamp(0.0, 1.0) * strength
    }
}

/// Barycentric coordinates of the intersection of a ray with the plane of a triangle, clamped to be non-negative; their sum is 1.
fn barycentric(ray: &Vector3<f64>, a: &Point3<f64>, b: &Point3<f64>, c: &Point3<f64>) -> [f64; 3] {
    let volume = |p: &Point3<f64>, q: &Point3<f64>| ray.dot(&p.coords.cross(&q.coords));
    let all = [volume(b, c), volume(c, a), volume(a, b)];
    let sign = all.iter().sum::<f64>().signum();
    // Samples may be half a snapping step outside.
    let inside = all.map(|v| (v * sign).max(0.0));
    let sum: f64 = inside.iter().sum();
    if sum > 0.0 && sum.is_finite() { inside.map(|v| v / sum) } else { [1.0 / 3.0; 3] }
}
