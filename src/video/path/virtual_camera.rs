//! Virtual cameras in space: where the camera would have stood, and looked, had it been held steady.
//!
//! Pose `t` of a run of cameras is smoothed by local linear regression over time, as trajectories of points are
//! ([`super::trajectory`]), in coordinates of its own: centers as they are, rotations by their logarithms,
//!
//! ```text
//! l_k = Log(R_k R_tᵀ),      R̄_t = Exp(l̄(t)) R_t,      c̄_t = c̄(t),      weights e^{−(τ_k − τ_t)²/2σ²}
//! ```
//!
//! so that even motion stays exactly itself, to the ends of the run.
//!
//! # Reference
//! F. Liu, M. Gleicher, H. Jin, A. Agarwala: *Content-preserving warps for 3D video stabilization*, SIGGRAPH 2009, section 4
//! (low-pass filtering of the camera's path).

use std::ops::Range;

use super::local_linear::local_linear_weights;
use plumbline_camera::{CameraPose, Intrinsics, Point3, Vec3};
use plumbline_num::math::{Point2, Similarity2, Vec2};

/// Beyond so many σ the kernel has lost all but a ten-thousandth of its weight.
const REACH: f64 = 4.0;

/// The same for what a viewer sees: beyond 2.5 σ a kernel has lost 96 % of its weight.
const VIEW_REACH: f64 = 2.5;

/// A virtual camera and how its picture is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VirtualCamera {
    /// `cam_from_world`.
    pub pose: CameraPose,
    /// The lens: that of the real camera.
    pub intrinsics: Intrinsics,
    /// `out_from_view`: crop, zoom and what moves the picture inside the source's frame.
    pub correction: Similarity2,
    /// It stands where the real camera stood and only turns: depth plays no part in what it shows.
    pub turns: bool,
}

impl VirtualCamera {
    /// Where the output shows a point of the scene, px; `None` behind the camera.
    pub fn show(&self, place: &Point3) -> Option<Point2> {
        self.intrinsics.project(&self.pose.apply(place)).map(|p| self.correction.apply(p))
    }
}

/// What a viewer would see at a moment if everything moved on evenly: the mean, by local linear regression over time, of what
/// a run of virtual cameras shows.
#[derive(Clone, Debug, PartialEq)]
pub struct SteadyView {
    cameras: Vec<(VirtualCamera, f64)>,
}

impl SteadyView {
    /// The view at frame `t` of `cameras` that are shown at `times_s`, with a kernel of standard deviation `sigma_s` over the
    /// run of known cameras about `t` inside `frames`; `None` without a camera at `t`.
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

    /// Where the viewer sees a point of the scene, px; `None` where a camera has it behind itself.
    pub fn show(&self, place: &Point3) -> Option<Point2> {
        let shown =
            |sum: Vec2, (camera, weight): &(VirtualCamera, f64)| Some(sum + camera.show(place)?.coords * *weight);
        self.cameras.iter().try_fold(Vec2::zeros(), shown).map(Point2::from)
    }
}

/// The smoothed poses of a shot's cameras; `None` where there is no camera. Runs of known cameras are smoothed by themselves.
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
    let (mut turn, mut center) = (Vec3::zeros(), Vec3::zeros());
    for ((pose, _), weight) in near.iter().zip(weights) {
        turn += weight * (pose.rotation * here.rotation.inverse()).scaled_axis();
        center += weight * (pose.center() - here.center());
    }
    let rotation = nalgebra::UnitQuaternion::from_scaled_axis(turn) * here.rotation;
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
    fn even_motion_stays_itself_to_its_ends() {
        let even = |t: f64| {
            let turn = UnitQuaternion::from_scaled_axis(Vec3::new(0.01, 0.02, -0.01) * t);
            Some(CameraPose::looking_from(Point3::new(0.1 * t, 0.02 * t, -0.03 * t), turn))
        };
        let poses: Vec<_> = (0..60).map(|t| even(f64::from(t))).collect();
        for (a, b) in smoothed_poses(&times(60), &poses, 0.3).iter().zip(&poses) {
            assert!(apart(&a.expect("known"), &b.expect("known")) < 1e-12);
        }
    }

    #[test]
    fn shake_is_removed_and_a_gap_parts_two_runs() {
        let mut random = fastrand::Rng::with_seed(2);
        let mut vector = || Vec3::from_fn(|_, _| random.f64() - 0.5);
        let mut pose = || {
            let turn = UnitQuaternion::from_scaled_axis(0.02 * vector());
            CameraPose::looking_from(Point3::from(0.1 * vector()), turn)
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
            turns: false,
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
            turns: false,
        };
        (0..60).map(|t| Some(camera(t))).collect()
    }

    #[test]
    fn a_steady_view_of_even_motion_is_that_motion_to_its_ends() {
        let (cameras, place) = (drifting(|_| 0.0), Point3::new(0.1, 0.0, 1.0));
        for t in 0..60 {
            let view = SteadyView::new(&cameras, &times(60), &(0..60), t, 0.25).expect("a camera");
            let (steady, now) = (view.show(&place).expect("in front"), cameras[t].expect("known").show(&place));
            assert!((steady - now.expect("in front")).norm() < 1e-9, "frame {t}");
        }
    }

    #[test]
    fn a_steady_view_leaves_out_jitter_and_what_lies_beyond_a_gap_or_the_range() {
        let jitter = |t: usize| if t.is_multiple_of(2) { 1.0 } else { -1.0 };
        let (mut cameras, place) = (drifting(jitter), Point3::new(0.1, 0.0, 1.0));
        let show = |cameras: &[Option<VirtualCamera>], range: &std::ops::Range<usize>| {
            let view = SteadyView::new(cameras, &times(60), range, 20, 0.25).expect("a camera");
            view.show(&place).expect("in front").x
        };
        assert!((show(&cameras, &(0..60)) - (320.0 + 50.0 + 40.0)).abs() < 0.01);
        let ended = show(&cameras, &(0..30));
        cameras[30] = None;
        assert!((show(&cameras, &(0..60)) - ended).abs() < 1e-12);
        assert!(SteadyView::new(&cameras, &times(60), &(0..60), 30, 0.25).is_none());
    }
}
