//! Inverse depth of a point on the ray of its anchor, from one or more other views.
//!
//! With the ray `m = (x, y, 1)` of the anchor and a view `(R, t)` relative to it, the point is at `Y = R m + w t` up to scale.
//! Each view that observes it at `ŷ` requires `Y_xy − ŷ Y_z = 0`, two equations that are linear in `w`:
//!
//! ```text
//! a + w b = 0,    a = (R m)_xy − ŷ (R m)_z,    b = t_xy − ŷ t_z.
//! ```
//!
//! Divided by the depth factor `Y_z` of the previous iteration they are reprojection errors, so that a few iterations
//! of reweighted least squares converge to the optimal `w` on the fixed ray. Points at infinity (`w = 0`) need no
//! special case; ray and depth are refined together by the bundle adjustment.

use plumbline_camera::{CameraPose, Vec3};
use plumbline_num::math::Vec2;

/// Iterations of reweighting: the depth factors change by a few percent at most, so the second iteration is already
/// accurate.
const ITERATIONS: usize = 4;

/// One further view of a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Pose of the view relative to the anchor's camera.
    pub view_from_anchor: CameraPose,
    /// Observed position, normalized image coordinates.
    pub ray: Vec2,
}

/// A triangulated point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangulated {
    /// `w`: the inverse depth along the anchor's optical axis, in the unit of the poses; negative if the rays diverge
    /// in front of the cameras.
    pub inverse_depth: f64,
    /// Maximum angle between the anchor's ray and another view's, rad.
    pub angle: f64,
    /// Root mean square reprojection error over the other views, normalized image coordinates.
    pub residual: f64,
}

/// The inverse depth on the ray `anchor` (normalized image coordinates) of minimum squared reprojection error.
///
/// `None` if no view has its center off the ray, and if the point would be behind one of the views.
pub fn triangulate(anchor: Vec2, views: &[View]) -> Option<Triangulated> {
    let m = anchor.push(1.0);
    let mut w = 0.0;
    for _ in 0..ITERATIONS {
        let (mut ab, mut bb) = (0.0, 0.0);
        for view in views {
            let (rotated, t) = (view.view_from_anchor.rotation * m, view.view_from_anchor.translation);
            let depth = rotated.z + w * t.z;
            let factor = if depth > 0.0 { 1.0 / (depth * depth) } else { 1.0 };
            let (a, b) = (rotated.xy() - view.ray * rotated.z, t.xy() - view.ray * t.z);
            ab += factor * a.dot(&b);
            bb += factor * b.dot(&b);
        }
        if !(bb > 0.0) {
            return None;
        }
        w = -ab / bb;
    }
    let (mut angle, mut squares) = (0.0_f64, 0.0);
    for view in views {
        let rotated: Vec3 = view.view_from_anchor.rotation * m;
        let seen = rotated + view.view_from_anchor.translation * w;
        if !(seen.z > 0.0) {
            return None;
        }
        squares += (seen.xy() / seen.z - view.ray).norm_squared();
        angle = angle.max(rotated.angle(&view.ray.push(1.0)));
    }
    Some(Triangulated { inverse_depth: w, angle, residual: (squares / views.len() as f64).sqrt() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::sfm::tests::synthetic_views::{TwoViews, normal, random_pose};

    #[test]
    fn exact_rays_meet_at_the_point() {
        for seed in 0..50 {
            let mut rng = fastrand::Rng::with_seed(seed);
            let views = TwoViews::general(random_pose(&mut rng, 0.4, 1.0), 20, &mut rng);
            for (point, pair) in views.points.iter().zip(&views.correspondences) {
                let view = View { view_from_anchor: views.second_from_first, ray: pair.second.xy() };
                let found = triangulate(pair.first.xy(), &[view]).expect("in front");
                assert!((found.inverse_depth * point.z - 1.0).abs() < 1e-9 && found.residual < 1e-12);
                let expected = point.coords.angle(&(point - views.second_from_first.center()));
                assert!((found.angle - expected).abs() < 1e-7);
            }
        }
    }

    #[test]
    fn many_views_average_their_noise_out_and_find_the_least_reprojection_error() {
        let mut rng = fastrand::Rng::with_seed(3);
        let anchor = Vec2::new(0.2, -0.1);
        let point = plumbline_camera::Point3::from(anchor.push(1.0) * 7.0);
        let views: Vec<View> = (0..40)
            .map(|_| {
                let view_from_anchor = random_pose(&mut rng, 0.2, 1.0);
                let seen = view_from_anchor.apply(&point);
                let noise = Vec2::new(normal(&mut rng), normal(&mut rng)) * 5e-4;
                View { view_from_anchor, ray: seen.coords.xy() / seen.z + noise }
            })
            .collect();
        let found = triangulate(anchor, &views).expect("in front");
        // The standard deviation of w is about 5e-4 / √40 per unit of baseline.
        assert!((found.inverse_depth - 1.0 / 7.0).abs() < 4e-4, "{}", found.inverse_depth);
        let energy = |w: f64| {
            let error = |v: &View| {
                let seen = v.view_from_anchor.rotation * anchor.push(1.0) + v.view_from_anchor.translation * w;
                (seen.xy() / seen.z - v.ray).norm_squared()
            };
            views.iter().map(error).sum::<f64>()
        };
        let w = found.inverse_depth;
        assert!(energy(w) <= energy(w + 1e-4) && energy(w) <= energy(w - 1e-4));
    }

    #[test]
    fn infinity_has_inverse_depth_zero_and_a_rotating_camera_determines_no_depth() {
        let mut rng = fastrand::Rng::with_seed(4);
        let pose = random_pose(&mut rng, 0.3, 1.0);
        let anchor = Vec2::new(0.1, 0.2);
        let far = pose.rotation * anchor.push(1.0);
        let view = View { view_from_anchor: pose, ray: far.xy() / far.z };
        assert!(triangulate(anchor, &[view]).expect("in front").inverse_depth.abs() < 1e-14);
        let turning = CameraPose { translation: Vec3::zeros(), ..pose };
        assert!(triangulate(anchor, &[View { view_from_anchor: turning, ..view }]).is_none());
        assert!(triangulate(anchor, &[]).is_none());
    }
}
