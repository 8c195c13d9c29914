//! Conformal charts of the viewing sphere.
//!
//! A chart maps directions to the plane without changing angles, so that *any* map of the picture that is conformal on the
//! sphere is conformal in the chart, where the Cauchy–Riemann equations have constant coefficients:
//!
//! ```text
//! stereographic   s = 2 tan(θ/2) (cos α, sin α)        whole at the view's center, no poles; up to MAX_ANGLE off it
//! Mercator        s = (λ, asinh tan φ)                 for views wider than that; poles stay outside
//! ```
//!
//! R. Carroll et al. (below) write the equations in longitude and latitude, `u_φ = −v_λ/cos φ`, `v_φ = u_λ/cos φ`, and
//! exclude the poles; in the Mercator chart their equations are ours, and the stereographic chart has no poles.
//!
//! # Reference
//! R. Carroll, M. Agrawala, A. Agarwala, *Optimizing content-preserving projections for wide-angle images*, ACM Trans. Graph.
//! (SIGGRAPH) 28 (2009), section 4.

use nalgebra::Rotation3;

use plumbline_camera::{Lens, Projection, Vec3};
use plumbline_num::math::{Point2, Vec2};

/// Directions of camera and view, and the plane in which the energies are written. Unit: radians at the center of the view.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Chart {
    /// The projection at unit focal length about the origin.
    plane: Lens,
    view_from_camera: Rotation3<f64>,
}

impl Chart {
    /// The stereographic chart about the view's axis.
    pub(super) fn stereographic(view_from_camera: Rotation3<f64>) -> Self {
        Self::of(Projection::Stereographic, view_from_camera)
    }

    /// The Mercator chart about the view's vertical axis.
    pub(super) fn mercator(view_from_camera: Rotation3<f64>) -> Self {
        Self::of(Projection::Mercator, view_from_camera)
    }

    fn of(projection: Projection, view_from_camera: Rotation3<f64>) -> Self {
        let plane = Lens { projection, focal: Vec2::new(1.0, 1.0), center: Point2::origin(), size: (1.0, 1.0) };
        Self { plane, view_from_camera }
    }

    /// Rotation from camera to view.
    pub(super) fn view_from_camera(&self) -> &Rotation3<f64> {
        &self.view_from_camera
    }

    /// Position of a direction of the camera.
    pub(super) fn at(&self, ray_in_camera: &Vec3) -> Option<Vec2> {
        self.at_view(&(self.view_from_camera * ray_in_camera))
    }

    /// Position of a direction of the view.
    pub(super) fn at_view(&self, ray_in_view: &Vec3) -> Option<Vec2> {
        self.plane.project(ray_in_view).map(|s| s.coords)
    }

    /// `∇φ` of the scale `e^φ` of the chart, the angle on the sphere per length in the plane.
    pub(super) fn log_scale_gradient(&self, s: Vec2) -> Vec2 {
        match self.plane.projection {
            Projection::Mercator => Vec2::new(0.0, -s.y.tanh()),
            _ => -s / (2.0 + 0.5 * s.norm_squared()),
        }
    }

    /// Unit direction of the camera at a position.
    pub(super) fn ray(&self, s: Vec2) -> Option<Vec3> {
        self.ray_in_view(s).map(|ray| self.view_from_camera.inverse() * ray)
    }

    /// Unit direction of the view at a position.
    pub(super) fn ray_in_view(&self, s: Vec2) -> Option<Vec3> {
        self.plane.unproject(Point2::from(s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ratio of the largest to the smallest stretch of the chart at a direction.
    fn anisotropy(chart: &Chart, s: Vec2) -> f64 {
        let e = 1e-5;
        let at = |d: Vec2| chart.ray(s + d).expect("inside");
        let x = (at(Vec2::new(e, 0.0)) - at(Vec2::new(-e, 0.0))) / (2.0 * e);
        let y = (at(Vec2::new(0.0, e)) - at(Vec2::new(0.0, -e))) / (2.0 * e);
        assert!(x.dot(&y).abs() < 1e-8 * x.norm_squared(), "right angles stay right");
        (x.norm() / y.norm()).max(y.norm() / x.norm())
    }

    #[test]
    fn charts_are_conformal_and_unit_at_their_center() {
        let view = Rotation3::from_euler_angles(0.2, -0.4, 0.1);
        for chart in [Chart::stereographic(view), Chart::mercator(view)] {
            for s in [Vec2::new(0.0, 0.0), Vec2::new(1.1, -0.6), Vec2::new(-0.4, 1.3)] {
                assert!((anisotropy(&chart, s) - 1.0).abs() < 1e-8, "{chart:?} at {s}");
            }
            let axis = view.inverse() * Vec3::z();
            assert!(chart.at(&axis).expect("the center").norm() < 1e-12);
            let beside = view.inverse() * Vec3::new(1e-6, 0.0, 1.0);
            assert!((chart.at(&beside).expect("near it").x - 1e-6).abs() < 1e-15);
        }
    }

    #[test]
    fn the_scale_changes_as_its_gradient_says() {
        for chart in [Chart::stereographic(Rotation3::identity()), Chart::mercator(Rotation3::identity())] {
            let e = 1e-5;
            let at = |s: Vec2| chart.ray(s).expect("inside");
            let log_scale = |s: Vec2| (at(s + Vec2::new(e, 0.0)).angle(&at(s - Vec2::new(e, 0.0))) / (2.0 * e)).ln();
            for s in [Vec2::new(0.0, 0.3), Vec2::new(1.1, -0.6), Vec2::new(-0.4, 1.3)] {
                let step = 1e-3;
                let slope = |d: Vec2| (log_scale(s + d) - log_scale(s - d)) / (2.0 * step);
                let numeric = Vec2::new(slope(Vec2::new(step, 0.0)), slope(Vec2::new(0.0, step)));
                assert!((numeric - chart.log_scale_gradient(s)).norm() < 1e-3, "{chart:?} at {s}: {numeric}");
            }
        }
    }

    #[test]
    fn positions_and_directions_are_inverse_to_each_other() {
        let chart = Chart::stereographic(Rotation3::from_euler_angles(0.3, 0.1, -0.2));
        let ray = Vec3::new(0.5, -0.7, 0.3).normalize();
        assert!((chart.ray(chart.at(&ray).expect("inside")).expect("inside") - ray).norm() < 1e-12);
    }
}
