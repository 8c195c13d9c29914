//! Virtual cameras in space: the smoothed poses of the recovered cameras.
//!
//! Pose `t` of a run of cameras is smoothed by local linear regression over time, as point trajectories are
//! ([`super::trajectory`]): centers directly, rotations by their logarithms about `R_t`,
//!
//! ```text
//! l_k = Log(R_k R_tᵀ),      R̄_t = Exp(l̄(t)) R_t,      c̄_t = c̄(t),      weights e^{−(τ_k − τ_t)²/2σ²}
//! ```
//!
//! which reproduces constant velocity exactly, to the ends of the run.
//!
//! # Reference
//! F. Liu, M. Gleicher, H. Jin, A. Agarwala: *Content-preserving warps for 3D video stabilization*, SIGGRAPH 2009, section 4
//! (low-pass filtering of the camera's path).

use std::ops::Range;

use super::local_linear::local_linear_weights;
use plumbline_camera::{CameraPose, Intrinsics, Point3, Vec3};
use plumbline_num::math::{Point2, Similarity2, Vec2};

/// Half width of the kernel for poses, σ: beyond it lies less than a ten-thousandth of the weight.
const REACH: f64 = 4.0;

/// Half width of the kernel for views, σ, as that of point trajectories: beyond 2.5 σ a kernel has lost 96 % of its weight.
const VIEW_REACH: f64 = 2.5;

/// A virtual camera and the placement of its picture in the output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VirtualCamera {
    /// `cam_from_world`.
    pub pose: CameraPose,
    /// Intrinsics of the real camera.
    pub intrinsics: Intrinsics,
    /// `out_from_view`: crop, zoom and the correction that keeps the view inside the source's frame.
    pub correction: Similarity2,
    /// Its center is that of the real camera: its view differs by a rotation only and does not depend on depth.
    pub rotation_only: bool,
}

impl VirtualCamera {
    /// Projects a point of the scene to output px; `None` behind the camera.
    pub fn show(&self, point: &Point3) -> Option<Point2> {
        self.intrinsics.project(&self.pose.apply(point)).map(|p| self.correction.apply(p))
    }
}

/// The local linear regression over time of the projections into a run of virtual cameras: the target of points that belong to
/// the still scene.
#[derive(Clone, Debug, PartialEq)]
pub struct SteadyView {
    cameras: Vec<(VirtualCamera, f64)>,
}

impl SteadyView {
    /// The view at frame `t` of the `cameras` at `times_s`, with a kernel of standard deviation `sigma_s` over the run of known
    /// cameras about `t` inside `frames`; `None` without a camera at `t`.
    pub fn new(
        cameras: &[Option<VirtualCamera>],
        times_s: &[f64],
        frames: &Range<usize>,
        t: usize,
        sigma_s: f64,
    ) -> Option<Self> {
        let near = |k: &usize| (times_s[*k] - times_s[t]).abs() <= VIEW_REACH * sigma_s;
        let known = |k: usize| cameras.get(k).copied().flatten().map(|c| (c, (times_s[k] - times_s[t]) / sigma_s));
        known(t)?;
        let before = (frames.start..t).rev().take_while(near).map_while(known);
        let from_here = (t..frames.end).take_while(near).map_while(known);
        let (cameras, offsets): (Vec<VirtualCamera>, Vec<f64>) = before.chain(from_here).unzip();
        let weights = local_linear_weights(&offsets);
        Some(Self { cameras: cameras.into_iter().zip(weights).collect() })
    }

    /// Projects a point of the scene to output px; `None` where it is behind one of the cameras.
    pub fn show(&self, point: &Point3) -> Option<Point2> {
        let shown =
            |sum: Vec2, (camera, weight): &(VirtualCamera, f64)| Some(sum + camera.show(point)?.coords * *weight);
        self.cameras.iter().try_fold(Vec2::zeros(), shown).map(Point2::from)
    }
}

/// The smoothed poses of a shot's cameras; `None` where there is no camera. Runs of known cameras are smoothed separately.
pub fn smoothed_poses(times_s: &[f64], poses: &[Option<CameraPose>], sigma_s: f64) -> Vec<Option<CameraPose>> {
    let mut smooth = vec![None; poses.len()];
    let mut start = 0;
    while start < poses.len() {
        let run: Vec<CameraPose> = poses[start..].iter().map_while(|p| *p).collect();
        for t in 0..run.len() {
            smooth[start + t] = Some(smoothed(&times_s[start..start + run.len()], &run, t, sigma_s));
        }
        start += run.len().max(1);
    }
    smooth
}

fn smoothed(times_s: &[f64], run: &[CameraPose], t: usize, sigma_s: f64) -> CameraPose {
    let here = run[t];
    let offset = |time: &f64| (time - times_s[t]) / sigma_s;
    let near: Vec<(&CameraPose, f64)> =
        run.iter().zip(times_s.iter().map(offset)).filter(|(_, u)| u.abs() <= REACH).collect();
    let weights = local_linear_weights(&near.iter().map(|(_, u)| *u).collect::<Vec<_>>());
    let (mut rotation_log, mut center) = (Vec3::zeros(), Vec3::zeros());
    for ((pose, _), weight) in near.iter().zip(weights) {
        rotation_log += weight * (pose.rotation * here.rotation.inverse()).scaled_axis();
        center += weight * (pose.center() - here.center());
    }
    let rotation = nalgebra::UnitQuaternion::from_scaled_axis(rotation_log) * here.rotation;
    CameraPose::looking_from(here.center() + center, rotation)
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;

    fn times(n: usize) -> Vec<f64> {
        (0..n).map(|t| t as f64 / 30.0).collect()
    }

    fn apart(a: &CameraPose, b: &CameraPose) -> f64 {
        a.rotation.angle_to(&b.rotation) + (a.center() - b.center()).norm()
    }

    #[test]
    fn constant_velocity_is_reproduced_to_the_ends() {
        let even = |t: f64| {
            let rotation_log = UnitQuaternion::from_scaled_axis(Vec3::new(0.01, 0.02, -0.01) * t);
            Some(CameraPose::looking_from(Point3::new(0.1 * t, 0.02 * t, -0.03 * t), rotation_log))
        };
        let poses: Vec<_> = (0..60).map(|t| even(f64::from(t))).collect();
        for (a, b) in smoothed_poses(&times(60), &poses, 0.3).iter().zip(&poses) {
            assert!(apart(&a.expect("known"), &b.expect("known")) < 1e-12);
        }
    }

    #[test]
    fn shake_is_removed_and_a_gap_divides_two_runs() {
        let mut random = fastrand::Rng::with_seed(2);
        let mut vector = || Vec3::from_fn(|_, _| random.f64() - 0.5);
        let mut pose = || {
            let rotation_log = UnitQuaternion::from_scaled_axis(0.02 * vector());
            CameraPose::looking_from(Point3::from(0.1 * vector()), rotation_log)
        };
        let poses: Vec<_> = (0..80).map(|t| (t != 40).then(&mut pose)).collect();
        let smooth = smoothed_poses(&times(80), &poses, 0.3);
        assert!(smooth[40].is_none());
        let roughness =
            |p: &[Option<CameraPose>]| p.windows(2).filter_map(|w| Some(apart(&w[0]?, &w[1]?))).sum::<f64>();
        assert!(roughness(&smooth) < 0.15 * roughness(&poses));
        let alone = smoothed_poses(&times(40), &poses[..40], 0.3);
        assert!(
            alone.iter().zip(&smooth).all(|(a, b)| a == b),
            "the run before the gap does not know of the one after"
        );
    }

    #[test]
    fn a_point_is_shown_where_the_corrected_picture_has_it() {
        let correction = Similarity2 { a: 1.1, b: 0.0, t: plumbline_num::math::Vec2::new(-32.0, -18.0) };
        let camera = VirtualCamera {
            pose: CameraPose::identity(),
            intrinsics: Intrinsics::centered(500.0, 640, 360),
            correction,
            rotation_only: false,
        };
        let shown = camera.show(&Point3::new(0.4, 0.0, 2.0)).expect("in front");
        assert!((shown - Point2::new(1.1 * 420.0 - 32.0, 1.1 * 180.0 - 18.0)).norm() < 1e-12);
        assert!(camera.show(&Point3::new(0.0, 0.0, -1.0)).is_none());
    }

    /// Cameras that drift evenly to the right, jump by `jump(t)` besides, and see a point at unit depth.
    fn drifting(jump: impl Fn(usize) -> f64) -> Vec<Option<VirtualCamera>> {
        let camera = |t: usize| VirtualCamera {
            pose: CameraPose::identity(),
            intrinsics: Intrinsics::centered(500.0, 640, 360),
            correction: Similarity2 { t: Vec2::new(2.0 * t as f64 + jump(t), 0.0), ..Similarity2::IDENTITY },
            rotation_only: false,
        };
        (0..60).map(|t| Some(camera(t))).collect()
    }

    #[test]
    fn a_steady_view_reproduces_constant_velocity_to_the_ends() {
        let (cameras, point) = (drifting(|_| 0.0), Point3::new(0.1, 0.0, 1.0));
        for t in 0..60 {
            let view = SteadyView::new(&cameras, &times(60), &(0..60), t, 0.25).expect("a camera");
            let (steady, now) = (view.show(&point).expect("in front"), cameras[t].expect("known").show(&point));
            assert!((steady - now.expect("in front")).norm() < 1e-9, "frame {t}");
        }
    }

    #[test]
    fn a_steady_view_leaves_out_jitter_and_cameras_beyond_a_gap_or_the_range() {
        let jitter = |t: usize| if t.is_multiple_of(2) { 1.0 } else { -1.0 };
        let (mut cameras, point) = (drifting(jitter), Point3::new(0.1, 0.0, 1.0));
        let show = |cameras: &[Option<VirtualCamera>], range: &std::ops::Range<usize>| {
            let view = SteadyView::new(cameras, &times(60), range, 20, 0.25).expect("a camera");
            view.show(&point).expect("in front").x
        };
        assert!((show(&cameras, &(0..60)) - (320.0 + 50.0 + 40.0)).abs() < 0.01);
        let ended = show(&cameras, &(0..30));
        cameras[30] = None;
        assert!((show(&cameras, &(0..60)) - ended).abs() < 1e-12);
        assert!(SteadyView::new(&cameras, &times(60), &(0..60), 30, 0.25).is_none());
    }
}
