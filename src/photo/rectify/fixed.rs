//! Closed-form projections: rectilinear, Panini, cylindrical and others.

use nalgebra::{Matrix2, Matrix2x3, Rotation3};

use super::chart::Chart;
use super::frame::Unframed;
use super::sphere_grid::{SourceFromRay, SphereGrid, Window};
use super::{RectifyOptions, empty_view};
use crate::PhotoError;
use plumbline_camera::{Lens, Projection, Vec3};
use plumbline_image::grid::GridMesh;
use plumbline_image::warp::Map;
use plumbline_num::math::{Point2, Vec2};

/// Largest angle from the center of a rectilinear output, rad: 65°, where it stretches 2.4-fold.
const RECTILINEAR_REACH: f64 = 1.134_464_014;
/// Largest longitude of a Panini output, rad: 80°, where it magnifies 1.7-fold.
const PANINI_REACH: f64 = 1.396_263_402;
/// Largest latitude of a cylindrical output, rad: 70°, where Mercator magnifies 2.9-fold.
const CYLINDER_REACH: f64 = 1.221_730_476;

/// The warp to `projection`, as far as it can show the picture.
pub(super) fn unframed(lens: &Lens, projection: &Projection, options: &RectifyOptions) -> Result<Unframed, PhotoError> {
    let view_from_camera = options.view.view_from_camera();
    let window = within_reach(projection, options.window);
    let chart = Chart::mercator(view_from_camera);
    let sphere = SphereGrid::new(chart, lens, Some(window), options.cells).ok_or_else(empty_view)?;
    let focal = density(lens, &view_from_camera);
    let plane =
        Lens { projection: projection.clone(), focal: Vec2::repeat(focal), center: Point2::origin(), size: (1.0, 1.0) };
    let position = |i: usize| plane.project(&sphere.chart.ray_in_view(sphere.vertex(i))?);
    let vertices: Option<Vec<Point2>> = (0..sphere.grid.vertex_count()).map(position).collect();
    let (cols, rows) = (sphere.grid.cols, sphere.grid.rows);
    let mesh = GridMesh { cols, rows, vertices: vertices.ok_or_else(empty_view)? };
    let (shown_plane, camera_from_view) = (plane.clone(), view_from_camera.inverse());
    let ray = move |p: Point2| {
        let ray = shown_plane.unproject(p)?;
        let longitude = ray.x.atan2(ray.z).abs();
        let latitude = ray.y.atan2(ray.x.hypot(ray.z)).abs();
        let shown = longitude <= window.half_width && latitude <= window.half_height;
        shown.then(|| camera_from_view * ray)
    };
    let map = SourceFromRay { lens: lens.clone(), ray, step: 1e-3 };
    let lens = lens.clone();
    let forward = Box::new(move |p| plane.project(&(view_from_camera * lens.unproject(p)?)));
    Ok(Unframed { maps: vec![Map::Radial(Box::new(map))], mesh, forward })
}

/// Pixels of the source per radian at the view's center, or at the picture's center if the view's center is outside the
/// field: to the right for lenses; for panoramas in the direction in which they resolve least, as they
/// repeat at their poles what they saw once.
pub(super) fn density(lens: &Lens, view_from_camera: &Rotation3<f64>) -> f64 {
    let camera_from_view = view_from_camera.inverse();
    let [axis, right, down] = [Vec3::z(), Vec3::x(), Vec3::y()].map(|v| camera_from_view * v);
    // By the derivative: differences would meet the seam of a panorama.
    let of_slope = |slope: Matrix2x3<f64>| {
        if lens.projection.is_panoramic() {
            Matrix2::from_columns(&[slope * right, slope * down]).singular_values().min()
        } else {
            (slope * right).norm()
        }
    };
    lens.project_with_jacobian(&axis)
        .map(|(_, slope)| of_slope(slope))
        .filter(|d| *d > 0.0 && d.is_finite())
        .unwrap_or(0.5 * (lens.focal.x + lens.focal.y))
}

/// The requested window, clamped to the projection's limits.
fn within_reach(projection: &Projection, window: Option<Window>) -> Window {
    let (half_width, half_height) = match projection {
        Projection::Rectilinear => (RECTILINEAR_REACH, RECTILINEAR_REACH),
        Projection::Equirectangular => (f64::MAX, f64::MAX),
        Projection::Cylindrical | Projection::Mercator => (f64::MAX, CYLINDER_REACH),
        // Panini's, and lenses as projections.
        _ => (PANINI_REACH, CYLINDER_REACH),
    };
    let all = Window { half_width: f64::MAX, half_height: f64::MAX };
    let wanted = window.unwrap_or(all);
    Window { half_width: wanted.half_width.min(half_width), half_height: wanted.half_height.min(half_height) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rectify::{Crop, RectifyInput, View, rectify};
    use crate::warp::PhotoWarp;
    use plumbline_camera::{FieldAxis, FieldOfView};
    use plumbline_num::run::Run;

    /// A view of a panorama of 2000 px around, at a pitch in degrees.
    fn view(from: Projection, height: f64, pitch: f64, crop: Crop) -> PhotoWarp {
        let field = FieldOfView::degrees(360.0, FieldAxis::Horizontal);
        let lens = Lens::from_field_of_view(from, field, (2000.0, height)).expect("a lens");
        let options = RectifyOptions {
            target: crate::rectify::Target::Fixed(Projection::Rectilinear),
            view: View { pitch: pitch.to_radians(), ..View::default() },
            window: Some(Window { half_width: 1.0, half_height: 0.9 }),
            crop,
            ..RectifyOptions::default()
        };
        let input = RectifyInput { lens: &lens, lines: &[], soft_lines: &[], found: false, faces: &[], saliency: None };
        rectify(&input, &options, &Run::default()).expect("a warp")
    }

    #[test]
    fn a_view_near_the_pole_of_a_panorama_has_the_pixels_of_one_at_the_horizon() {
        // Without a crop, which is found on a raster. The density at the center is that of a finite step.
        let level = view(Projection::Equirectangular, 1000.0, 0.0, Crop::None).size;
        for pitch in [-89.0, -70.0, 45.0, 80.0] {
            let near = view(Projection::Equirectangular, 1000.0, pitch, Crop::None);
            let off = |a: usize, b: usize| (a as f64 / b as f64 - 1.0).abs();
            let off = off(near.size.0, level.0).max(off(near.size.1, level.1));
            assert!(off <= 0.005 && near.bounded_from.is_none(), "{pitch}: {:?} for {level:?}", near.size);
        }
    }

    #[test]
    fn a_view_has_not_many_more_pixels_than_its_panorama() {
        let near = view(Projection::Mercator, 2000.0, 75.0, Crop::None);
        let (w, h) = near.size;
        let natural = near.bounded_from.expect("a Mercator map is dense near its poles");
        assert!(((w * h) as f64 / 4e6 - 1.0).abs() < 0.01 && natural.0 * natural.1 > 5_000_000, "{w}×{h}, {natural:?}");
        assert!((w as f64 / h as f64 - natural.0 as f64 / natural.1 as f64).abs() < 0.01, "the shape is kept");
    }
}
