//! One observation: its residual and its Jacobians.
//!
//! ```text
//! p = m − w t_a,   q = R_aᵀ p,   v = R q,   Y = v + w t          R, t: pose of the observing row
//! r = (project(Y) − observed)/σ,   J_Y = (f/(σ Y_z)) D [1 0 −x; 0 1 −y],   D = ∂(d x, d y)/∂(x, y)
//! dY/dφ = −[v]× (R ← Exp(φ) R),    dY/dt = w I,
//! dY/dω_a = R_ra [p]×,  dY/dt_a = −w R_ra,  dY/dm = R_ra,  dY/dw = t − R_ra t_a,     R_ra = R R_aᵀ
//! ```
//!
//! The pose of a row depends on the poses of its frame and of the neighboring frames ([`super::shutter`]); `J` is the
//! left Jacobian:
//!
//! ```text
//! φ = Exp(θ) ω_i + J(θ) Σ_k c_k (J(l_k)⁻¹ ω_k − J(l_k)⁻ᵀ ω_i)
//! ```

use nalgebra::{Matrix2x3, Matrix3, SMatrix, UnitQuaternion, Vector2};

use super::parameters::{K1, LN_FOCAL, READOUT, Ray, SHARED};
use super::shutter::{NEIGHBORS, Stencil};
use plumbline_camera::rotation::left_jacobian;
use plumbline_camera::{CameraPose, Intrinsics, Vec3};
use plumbline_num::math::{Point2, Vec2};

/// Minimum depth of a point as a fraction of its distance from the camera. At a smaller fraction, more than 84° off
/// the axis, no lens of this model forms an image, and the projection is too steep for linear steps.
const MIN_FRONT: f64 = 0.1;

/// A pose with the quantities that the loops over observations need.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    pub(super) rotation: Matrix3<f64>,
    pub(super) translation: Vec3,
}

/// The camera of one frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Eye<'a> {
    pub(super) lens: &'a Intrinsics,
    pub(super) readout: f64,
    pub(super) view: &'a View,
    /// Row motion; `None` for a global shutter.
    pub(super) stencil: Option<&'a Stencil>,
}

/// A point relative to its anchor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Anchored {
    pub(super) p: Vec3,
    q: Vec3,
    pub(super) w: f64,
}

/// Pose and time of a row.
struct Row {
    view: View,
    weights: [(f64, f64); NEIGHBORS],
    theta: Vec3,
}

/// Jacobian of a residual with respect to one pose: rotation, then translation.
pub(super) type PoseJacobian = SMatrix<f64, 2, 6>;

/// A residual and its Jacobians, all scaled by the root of the robust weight.
#[derive(Clone, Debug)]
pub(super) struct Linearized {
    pub(super) residual: Vector2<f64>,
    /// `J_Y R_ra`: the Jacobian with respect to the ray, and through `p` to the anchor's pose.
    pub(super) ray: Matrix2x3<f64>,
    /// With respect to `(x, y, w)`.
    pub(super) point: Matrix2x3<f64>,
    /// With respect to `ln f`, `k₁`, `ρ_s`.
    pub(super) shared: SMatrix<f64, 2, SHARED>,
    poses: [(usize, PoseJacobian); NEIGHBORS + 1],
    pose_count: usize,
}

impl Linearized {
    pub(super) fn zero() -> Self {
        Self {
            residual: Vector2::zeros(),
            ray: Matrix2x3::zeros(),
            point: Matrix2x3::zeros(),
            shared: SMatrix::zeros(),
            poses: [(0, PoseJacobian::zeros()); NEIGHBORS + 1],
            pose_count: 0,
        }
    }

    /// Frames other than the anchor whose poses the residual depends on, each with its Jacobian; the observing frame
    /// first.
    pub(super) fn poses(&self) -> &[(usize, PoseJacobian)] {
        &self.poses[..self.pose_count]
    }
}

impl View {
    pub(super) fn of(pose: &CameraPose) -> Self {
        Self { rotation: *pose.rotation.to_rotation_matrix().matrix(), translation: pose.translation }
    }
}

impl Anchored {
    /// A point given by its ray and inverse depth in the camera `anchor`.
    pub(super) fn new(ray: &Ray, anchor: &View) -> Self {
        let p = Vec3::new(ray.xy.x, ray.xy.y, 1.0) - ray.w * anchor.translation;
        Self { p, q: anchor.rotation.tr_mul(&p), w: ray.w }
    }
}

impl Eye<'_> {
    /// `(project(Y) − observed)/σ`; `None` if the point is not in front of the camera.
    pub(super) fn residual(&self, point: &Anchored, seen: Point2, sigma: f64) -> Option<Vec2> {
        let row = self.row(seen);
        let y = row.view.rotation * point.q + point.w * row.view.translation;
        let xy = normalized(&y)?;
        Some((self.lens.distorted(xy) - seen) / sigma)
    }

    /// The residual and all its derivatives, times the square root of the robust weight `weight_of(‖r‖²)`; `false` if
    /// the point is not in front of the camera, as in [`Self::residual`]. `frame` is the camera's own.
    pub(super) fn linearize(
        &self,
        (point, anchor): (&Anchored, &View),
        (frame, seen): (usize, Point2),
        sigma: f64,
        weight_of: impl Fn(f64) -> f64,
        out: &mut Linearized,
    ) -> bool {
        let row = self.row(seen);
        let v = row.view.rotation * point.q;
        let y = v + point.w * row.view.translation;
        let Some(xy) = normalized(&y) else { return false };
        let residual = (self.lens.distorted(xy) - seen) / sigma;
        let scale = weight_of(residual.norm_squared()).sqrt();
        out.residual = scale * residual;
        let lens = (scale / (sigma * y.z)) * self.lens.jacobian(xy);
        let j_y = lens * Matrix2x3::new(1.0, 0.0, -xy.x, 0.0, 1.0, -xy.y);
        let rho = xy.norm_squared();
        let reach = (scale / sigma) * self.lens.focal * xy;
        out.shared.set_column(LN_FOCAL, &((1.0 + self.lens.k1 * rho) * reach));
        out.shared.set_column(K1, &(rho * reach));
        out.ray = (j_y * row.view.rotation) * anchor.rotation.transpose();
        let depth = j_y * row.view.translation - out.ray * anchor.translation;
        out.point = Matrix2x3::from_columns(&[out.ray.column(0).into(), out.ray.column(1).into(), depth]);
        self.differentiate_poses(&row, (frame, seen), (&v, point.w), &j_y, out);
        true
    }

    fn differentiate_poses(
        &self,
        row: &Row,
        (frame, seen): (usize, Point2),
        (v, w): (&Vec3, f64),
        j_y: &Matrix2x3<f64>,
        out: &mut Linearized,
    ) {
        let crossed = |k: usize| v.cross(&j_y.row(k).transpose()).transpose();
        let rotation = Matrix2x3::from_rows(&[crossed(0), crossed(1)]);
        out.poses[0] = (frame, stacked(&rotation, &(w * j_y)));
        out.pose_count = 1;
        out.shared.set_column(READOUT, &Vector2::zeros());
        let Some(stencil) = self.stencil else { return };
        let along = rotation * left_jacobian(&row.theta);
        let mut own = rotation * UnitQuaternion::from_scaled_axis(row.theta).to_rotation_matrix().matrix();
        let mut own_weight = 1.0;
        let (mut angular, mut linear) = (Vec3::zeros(), Vec3::zeros());
        for (k, (neighbor, (c, rate))) in stencil.neighbors().iter().zip(row.weights).enumerate() {
            own -= c * along * neighbor.jacobian.transpose();
            own_weight -= c;
            angular += rate * neighbor.rotation;
            linear += rate * neighbor.translation;
            out.poses[k + 1] = (neighbor.frame, stacked(&(c * along * neighbor.jacobian), &(w * c * j_y)));
        }
        out.poses[0] = (frame, stacked(&own, &(w * own_weight * j_y)));
        out.pose_count = 1 + stencil.neighbors().len();
        out.shared.set_column(READOUT, &(self.row_fraction(seen) * (along * angular + w * j_y * linear)));
    }

    /// Vertical position of a row relative to the center of the frame, in frame heights, −½ to ½.
    fn row_fraction(&self, seen: Point2) -> f64 {
        (seen.y - self.lens.center.y) / (2.0 * self.lens.center.y)
    }

    fn row(&self, seen: Point2) -> Row {
        let still = Row { view: *self.view, weights: [(0.0, 0.0); NEIGHBORS], theta: Vec3::zeros() };
        let Some(stencil) = self.stencil else { return still };
        let weights = stencil.weights(self.row_fraction(seen) * self.readout);
        let (mut theta, mut translation) = (Vec3::zeros(), self.view.translation);
        for (neighbor, (c, _)) in stencil.neighbors().iter().zip(weights) {
            theta += c * neighbor.rotation;
            translation += c * neighbor.translation;
        }
        let rotation = UnitQuaternion::from_scaled_axis(theta).to_rotation_matrix();
        Row { view: View { rotation: rotation.matrix() * self.view.rotation, translation }, weights, theta }
    }
}

/// `(Y_x, Y_y)/Y_z`; `None` if `Y` is not in front.
fn normalized(y: &Vec3) -> Option<Vec2> {
    (y.z > MIN_FRONT * y.norm()).then(|| y.xy() / y.z)
}

fn stacked(rotation: &Matrix2x3<f64>, shift: &Matrix2x3<f64>) -> PoseJacobian {
    let mut both = PoseJacobian::zeros();
    both.fixed_columns_mut::<3>(0).copy_from(rotation);
    both.fixed_columns_mut::<3>(3).copy_from(shift);
    both
}

#[cfg(test)]
mod tests {
    use super::super::shutter::neighbors;
    use super::*;
    use plumbline_camera::rotation::skew;

    /// Five cameras in a generic motion, lens and readout, and a point.
    #[derive(Clone)]
    struct Setting {
        poses: Vec<CameraPose>,
        lens: Intrinsics,
        readout: f64,
        ray: Ray,
        anchor: usize,
        rolling: bool,
    }

    const FRAME: usize = 2;
    const SIGMA: f64 = 0.7;

    fn setting(anchor: usize, rolling: bool) -> Setting {
        let pose = |k: usize| {
            let t = k as f64;
            let rotation = Vec3::new(0.1 * t - 0.02 * t * t, -0.06 * t, 0.03 * t * t);
            let shift = Vec3::new(0.2 * t, -0.1 + 0.05 * t * t, 0.3 - 0.1 * t);
            CameraPose { rotation: UnitQuaternion::from_scaled_axis(rotation), translation: shift }
        };
        Setting {
            poses: (0..5).map(pose).collect(),
            lens: Intrinsics { k1: -0.07, ..Intrinsics::centered(500.0, 640, 360) },
            readout: 0.7,
            ray: Ray { xy: Vec2::new(0.21, -0.16), w: 0.35 },
            anchor,
            rolling,
        }
    }

    impl Setting {
        fn with_eye<T>(&self, f: impl Fn(&Eye<'_>, &Anchored, &View) -> T) -> T {
            let view = View::of(&self.poses[FRAME]);
            let around = neighbors(FRAME, |k| k < 5).map(|k| (k, self.poses[k]));
            let stencil = Stencil::of(FRAME, &self.poses[FRAME], around);
            let stencil = self.rolling.then_some(&stencil);
            let anchor = View::of(&self.poses[self.anchor]);
            let eye = Eye { lens: &self.lens, readout: self.readout, view: &view, stencil };
            f(&eye, &Anchored::new(&self.ray, &anchor), &anchor)
        }

        fn residual(&self) -> Vec2 {
            let seen = Point2::new(410.0, 320.0);
            self.with_eye(|eye, point, _| eye.residual(point, seen, SIGMA)).expect("in front")
        }

        fn linearized(&self, weight: f64) -> (Linearized, Anchored) {
            let at = (FRAME, Point2::new(410.0, 320.0));
            self.with_eye(|eye, point, anchor| {
                let mut out = Linearized::zero();
                assert!(eye.linearize((point, anchor), at, SIGMA, |_| weight, &mut out), "in front");
                (out, *point)
            })
        }

        /// Central difference of the residual with respect to a change of the setup.
        fn slope(&self, change: impl Fn(&mut Self, f64)) -> Vec2 {
            let h = 1e-6;
            let at = |step: f64| {
                let mut moved = self.clone();
                change(&mut moved, step);
                moved.residual()
            };
            (at(h) - at(-h)) / (2.0 * h)
        }
    }

    fn settings() -> impl Iterator<Item = Setting> {
        (0..5).flat_map(|anchor| [setting(anchor, true), setting(anchor, false)])
    }

    fn close(found: &Vector2<f64>, slope: &Vec2) -> bool {
        (found - slope).norm() < 1e-6 * (100.0 + slope.norm())
    }

    #[test]
    fn the_jacobians_to_point_lens_and_readout_agree_with_central_differences() {
        for s in settings() {
            let (j, _) = s.linearized(1.0);
            assert!(close(&j.point.column(0).into(), &s.slope(|s, h| s.ray.xy.x += h)));
            assert!(close(&j.point.column(1).into(), &s.slope(|s, h| s.ray.xy.y += h)));
            assert!(close(&j.point.column(2).into(), &s.slope(|s, h| s.ray.w += h)));
            assert!(close(&j.shared.column(LN_FOCAL).into(), &s.slope(|s, h| s.lens.focal *= h.exp())));
            assert!(close(&j.shared.column(K1).into(), &s.slope(|s, h| s.lens.k1 += h)));
            assert!(close(&j.shared.column(READOUT).into(), &s.slope(|s, h| s.readout += h)), "anchor {}", s.anchor);
            assert!((j.residual - s.residual()).norm() < 1e-12);
        }
    }

    #[test]
    fn the_jacobians_to_every_pose_agree_with_central_differences() {
        for s in settings() {
            let (j, point) = s.linearized(1.0);
            let mut of_anchor = SMatrix::<f64, 3, 6>::zeros();
            of_anchor.fixed_columns_mut::<3>(0).copy_from(&skew(&point.p));
            of_anchor.fixed_columns_mut::<3>(3).copy_from(&Matrix3::from_diagonal_element(-point.w));
            for frame in 0..5 {
                let own = j.poses().iter().filter(|(f, _)| *f == frame).map(|(_, j)| *j).sum::<PoseJacobian>();
                let total = own + if frame == s.anchor { j.ray * of_anchor } else { PoseJacobian::zeros() };
                for k in 0..6 {
                    let slope = s.slope(|s, h| {
                        let step = |first: usize| Vec3::from_fn(|i, _| if first + i == k { h } else { 0.0 });
                        s.poses[frame] = s.poses[frame].perturbed(&step(0), &step(3));
                    });
                    let found = total.column(k).into();
                    assert!(close(&found, &slope), "pose {frame}, unknown {k}, anchor {}: {found} {slope}", s.anchor);
                }
            }
        }
    }

    #[test]
    fn a_robust_weight_scales_residual_and_jacobians_by_its_root() {
        let (full, _) = setting(0, true).linearized(1.0);
        let (quarter, _) = setting(0, true).linearized(0.25);
        assert!((quarter.residual - 0.5 * full.residual).norm() < 1e-12);
        assert!((quarter.point - 0.5 * full.point).norm() < 1e-12 * full.point.norm());
        assert!((quarter.shared - 0.5 * full.shared).norm() < 1e-12 * full.shared.norm());
        assert!((quarter.poses()[1].1 - 0.5 * full.poses()[1].1).norm() < 1e-12 * full.poses()[1].1.norm());
    }

    #[test]
    fn points_at_infinity_and_a_little_beyond_are_seen_and_points_behind_are_not() {
        for w in [0.0, -1e-3] {
            let mut s = setting(0, true);
            s.ray.w = w;
            assert!(s.residual().norm().is_finite());
            assert!(s.linearized(1.0).0.point.iter().all(|v| v.is_finite()));
        }
        let mut s = setting(0, false);
        s.ray.w = 30.0;
        s.poses[FRAME].translation.z = -3.0;
        assert!(s.with_eye(|eye, point, _| eye.residual(point, Point2::new(1.0, 1.0), 1.0)).is_none());
    }
}
