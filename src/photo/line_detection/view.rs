//! Perspective views of a photo.

use std::f64::consts::{FRAC_PI_2, PI};

use rayon::prelude::*;

use plumbline_camera::{Lens, Projection, Vec3};
use plumbline_image::{Plane, PlaneRef};
use plumbline_num::math::{Point2, Vec2};

/// Half the field of a cube view: 45° is a face of a cube, 5° overlap, so that no line is cut at a seam.
const HALF_FIELD: f64 = 50.0 * PI / 180.0;
/// Corner angle up to which a photo is processed in one view; beyond, its corners are too stretched.
const MAX_SINGLE_VIEW: f64 = 55.0 * PI / 180.0;
/// Maximum focal length of a cube view, px: bounds the work on panoramas.
const MAX_FOCAL: f64 = 500.0;
/// Minimum fraction of probed points of a view that the photo covers; other views are skipped.
const MIN_VISIBLE: f64 = 0.02;

/// A perspective view.
#[derive(Debug)]
pub(super) struct View {
    luma: Plane<f32>,
    rays: ViewRays,
}

/// Viewing rays of a view's pixels.
#[derive(Debug)]
enum ViewRays {
    /// The photo itself, shrunk by a whole factor.
    Photo { lens: Lens, shrunk: f64 },
    /// A pinhole camera rotated relative to the lens.
    Turned { lens_from_view: nalgebra::Rotation3<f64>, focal: f64, middle: Vec2 },
}

impl View {
    /// Views that together cover the field of `lens` on a photo.
    pub(super) fn all(luma: PlaneRef<'_, f32>, lens: &Lens, max_side: usize) -> Vec<Self> {
        let factor = luma.width().max(luma.height()).div_ceil(max_side.max(1));
        let shrunk = shrink(luma, factor);
        let scale = factor as f64;
        let corner = lens.corner_angle();
        if lens.projection == Projection::Rectilinear && corner < MAX_SINGLE_VIEW {
            return vec![Self { luma: shrunk, rays: ViewRays::Photo { lens: lens.clone(), shrunk: scale } }];
        }
        let focal = (lens.focal.x.max(lens.focal.y) / scale).min(MAX_FOCAL);
        let (half, turns) = if corner < MAX_SINGLE_VIEW {
            (corner, vec![nalgebra::Rotation3::identity()])
        } else {
            (HALF_FIELD, cube())
        };
        let side = (2.0 * focal * half.tan()).ceil().max(8.0) as usize;
        let middle = Vec2::repeat(0.5 * side as f64);
        let all_rays = turns.into_iter().map(|lens_from_view| ViewRays::Turned { lens_from_view, focal, middle });
        let worth = all_rays.filter(|rays| seen(rays, lens, side) >= MIN_VISIBLE);
        worth.map(|rays| Self { luma: sampled(&shrunk, scale, lens, &rays, side), rays }).collect()
    }

    /// Gray levels; no numbers where the photo does not reach.
    pub(super) fn luma(&self) -> PlaneRef<'_, f32> {
        self.luma.as_ref()
    }

    /// The fraction of a sharp edge's step in gray between its nearest pixels: less where the photo is stretched.
    pub(super) fn sharpness(&self) -> f64 {
        match self.rays {
            ViewRays::Photo { .. } => 1.0,
            ViewRays::Turned { .. } => 0.8,
        }
    }

    /// The gray level of the pixel around `p`; `None` outside and where the photo does not reach.
    pub(super) fn gray(&self, p: Point2) -> Option<f32> {
        let inside = p.x >= 0.0 && p.y >= 0.0 && p.x < self.luma.width() as f64 && p.y < self.luma.height() as f64;
        let sample = inside.then(|| self.luma.as_ref().row(p.y as usize)[p.x as usize]);
        sample.filter(|s| s.is_finite())
    }

    /// The unit direction in the lens's axes in which a point of the view looks.
    pub(super) fn ray(&self, p: Point2) -> Option<Vec3> {
        self.rays.ray(p)
    }

    /// Angle that a pixel of the view spans in the middle, rad.
    pub(super) fn pixel_angle(&self) -> f64 {
        match &self.rays {
            ViewRays::Photo { lens, shrunk } => shrunk / lens.focal.x,
            ViewRays::Turned { focal, .. } => 1.0 / focal,
        }
    }
}

impl ViewRays {
    fn ray(&self, p: Point2) -> Option<Vec3> {
        match self {
            Self::Photo { lens, shrunk } => lens.unproject(p * *shrunk),
            Self::Turned { lens_from_view, focal, middle } => {
                let m = (p.coords - middle) / *focal;
                Some(lens_from_view * Vec3::new(m.x, m.y, 1.0).normalize())
            }
        }
    }
}

/// Ahead, right, left, up, down and behind.
fn cube() -> Vec<nalgebra::Rotation3<f64>> {
    let about = |axis: Vec3, angle: f64| nalgebra::Rotation3::new(axis * angle);
    let around = [0.0, FRAC_PI_2, -FRAC_PI_2, PI].map(|angle| about(Vec3::y(), angle));
    let above = [FRAC_PI_2, -FRAC_PI_2].map(|angle| about(Vec3::x(), angle));
    around.into_iter().chain(above).collect()
}

/// Share of a coarse grid of a view's points that the photo shows.
fn seen(rays: &ViewRays, lens: &Lens, side: usize) -> f64 {
    const PROBES: usize = 24;
    let step = side as f64 / PROBES as f64;
    let at = |k: usize| Point2::new(((k % PROBES) as f64 + 0.5) * step, ((k / PROBES) as f64 + 0.5) * step);
    let shown = |k: &usize| on_photo(lens, rays.ray(at(*k))).is_some();
    (0..PROBES * PROBES).filter(shown).count() as f64 / (PROBES * PROBES) as f64
}

/// Where a direction lies on the photo.
fn on_photo(lens: &Lens, ray: Option<Vec3>) -> Option<Point2> {
    let p = lens.project(&ray?)?;
    let inside = p.x >= 0.0 && p.y >= 0.0 && p.x <= lens.size.0 && p.y <= lens.size.1;
    inside.then_some(p)
}

/// The view of a photo that was shrunk by `scale`.
fn sampled(photo: &Plane<f32>, scale: f64, lens: &Lens, rays: &ViewRays, side: usize) -> Plane<f32> {
    let mut out = Plane::new(side, side);
    let (data, stride) = out.as_mut().into_data();
    data.par_chunks_mut(stride).enumerate().for_each(|(y, row)| {
        for (x, sample) in row[..side].iter_mut().enumerate() {
            let ray = rays.ray(Point2::new(x as f64 + 0.5, y as f64 + 0.5));
            *sample = on_photo(lens, ray).map_or(f32::NAN, |p| bilinear(photo.as_ref(), p / scale));
        }
    });
    out
}

/// The gray level between the four nearest pixels, borders continued.
fn bilinear(photo: PlaneRef<'_, f32>, p: Point2) -> f32 {
    let split = |v: f64, n: usize| {
        let v = (v - 0.5).clamp(0.0, (n - 1) as f64);
        let i = (v as usize).min(n.saturating_sub(2));
        (i, (i + 1).min(n - 1), (v - i as f64) as f32)
    };
    let ((x0, x1, s), (y0, y1, t)) = (split(p.x, photo.width()), split(p.y, photo.height()));
    let mix = |row: &[f32]| row[x0] + s * (row[x1] - row[x0]);
    let (upper, lower) = (mix(photo.row(y0)), mix(photo.row(y1)));
    upper + t * (lower - upper)
}

/// The means of blocks of `factor × factor` pixels; incomplete blocks at the right and lower side are dropped.
fn shrink(luma: PlaneRef<'_, f32>, factor: usize) -> Plane<f32> {
    let (w, h) = (luma.width() / factor, luma.height() / factor);
    let mut out = Plane::new(w, h);
    let (data, stride) = out.as_mut().into_data();
    let weight = 1.0 / (factor * factor) as f32;
    data.par_chunks_mut(stride).take(h).enumerate().for_each(|(y, row)| {
        for k in 0..factor {
            let blocks = luma.row(y * factor + k).chunks_exact(factor);
            for (sum, block) in row.iter_mut().zip(blocks) {
                *sum += weight * block.iter().sum::<f32>();
            }
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_camera::{FieldAxis, FieldOfView};

    #[test]
    fn the_views_of_a_fisheye_show_every_direction_that_the_photo_shows() {
        let fov = FieldOfView::degrees(170.0, FieldAxis::Horizontal);
        let lens = Lens::from_field_of_view(Projection::Equidistant, fov, (400.0, 300.0)).expect("a lens");
        let views = View::all(Plane::from_fn(400, 300, |_, _| 7.0_f32).as_ref(), &lens, 1000);
        for (x, y) in [(200.0, 150.0), (5.0, 150.0), (395.0, 295.0), (200.0, 3.0), (30.0, 280.0)] {
            let ray = lens.unproject(Point2::new(x, y)).expect("inside the field");
            let shows = |v: &View| {
                let ViewRays::Turned { lens_from_view, focal, middle } = &v.rays else { panic!("one view of many") };
                let d = lens_from_view.inverse() * ray;
                let p = *focal * Vec2::new(d.x, d.y) / d.z + *middle;
                let n = v.luma.width() as f64;
                let inside = d.z > 0.0 && p.x > 0.0 && p.y > 0.0 && p.x < n && p.y < n;
                inside && v.luma.as_ref().row(p.y as usize)[p.x as usize] == 7.0
            };
            assert!(views.iter().any(shows), "({x}, {y})");
        }
        assert!(views.len() < 6, "nothing is seen behind");
    }

    #[test]
    fn a_view_is_sampled_where_its_rays_meet_the_photo() {
        let fov = FieldOfView::degrees(120.0, FieldAxis::Horizontal);
        let lens = Lens::from_field_of_view(Projection::Stereographic, fov, (300.0, 300.0)).expect("a lens");
        let photo = Plane::from_fn(300, 300, |x, y| x as f32 + 0.5 + 1000.0 * (y as f32 + 0.5));
        for view in View::all(photo.as_ref(), &lens, 1000) {
            let n = view.luma.width();
            for (x, y) in [(n / 2, n / 2), (n / 3, n / 2), (n / 2, 3 * n / 4)] {
                let sample = view.luma().row(y)[x];
                let p = lens.project(&view.ray(Point2::new(x as f64 + 0.5, y as f64 + 0.5)).expect("a ray"));
                let Some(p) = p.filter(|p| (1.0..299.0).contains(&p.x) && (1.0..299.0).contains(&p.y)) else {
                    continue;
                };
                assert!((f64::from(sample) - (p.x + 1000.0 * p.y)).abs() < 0.1, "{sample} at {p}");
            }
        }
    }
}
