//! One observation: its residual and what moves it.
//!
//! ```text
//! p = m − w t_a,   q = R_aᵀ p,   v = R q,   Y = v + w t          R, t: pose of the observing row
//! r = (project(Y) − observed)/σ,   J_Y = (f/(σ Y_z)) D [1 0 −x; 0 1 −y],   D = ∂(d x, d y)/∂(x, y)
//! dY/dφ = −[v]× (R ← Exp(φ) R),    dY/dt = w I,
//! dY/dω_a = R_ra [p]×,  dY/dt_a = −w R_ra,  dY/dm = R_ra,  dY/dw = t − R_ra t_a,     R_ra = R R_aᵀ
//! ```
//!
//! Rows of a frame move with it and with its neighbors ([`super::shutter`]), `J` the left Jacobian:
//!
//! ```text
//! φ = Exp(θ) ω_i + J(θ) Σ_k c_k (J(l_k)⁻¹ ω_k − J(l_k)⁻ᵀ ω_i)
//! ```

use nalgebra::{Matrix2x3, Matrix3, SMatrix, UnitQuaternion, Vector2};

use super::parameters::{K1, LN_FOCAL, READOUT, Ray, SHARED};
use super::shutter::{NEIGHBORS, Stencil};
use crate::camera::rotation::left_jacobian;
use crate::camera::{CameraPose, Intrinsics, Vec3};
use crate::math::{Point2, Vec2};

/// Share of its distance that a point must lie in front of the camera's plane. Nearer to the plane than this, 84° off the
/// axis, no lens of this model sees anything, and the projection is too steep to be followed by linear steps.
const LEAST_FRONT: f64 = 0.1;

/// A pose as the loops over observations want it.
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
    /// `None` where all rows are captured at once.
    pub(super) stencil: Option<&'a Stencil>,
}

/// A point seen from its anchor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Anchored {
    pub(super) p: Vec3,
    q: Vec3,
    pub(super) w: f64,
}

/// Where and when a row looks.
struct Row {
    view: View,
    weights: [(f64, f64); NEIGHBORS],
    theta: Vec3,
}

/// Jacobian of a residual to one pose: turn, then shift.
pub(super) type PoseJacobian = SMatrix<f64, 2, 6>;

/// A residual and its Jacobians, all scaled by the root of the robust weight.
#[derive(Clone, Debug)]
pub(super) struct Linearized {
    pub(super) residual: Vector2<f64>,
    /// `J_Y R_ra`: the Jacobian to the ray, and through `p` to the anchor's pose.
    pub(super) ray: Matrix2x3<f64>,
    /// To `(x, y, w)`.
    pub(super) point: Matrix2x3<f64>,
    /// To `ln f`, `k₁`, `ρ_s`.
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

    /// Frames that move the residual other than as anchors, each with its Jacobian; the observing one first.
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
    /// `(project(Y) − observed)/σ`; `None` where the point is not in front of the camera.
    pub(super) fn residual(&self, point: &Anchored, seen: Point2, sigma: f64) -> Option<Vec2> {
        let row = self.row(seen);
        let y = row.view.rotation * point.q + point.w * row.view.translation;
        let xy = normalized(&y)?;
        Some((self.lens.distorted(xy) - seen) / sigma)
    }

    /// The residual and all its derivatives, times the root of the robust weight, which `weight_of` says of a squared
    /// residual; `false` as for [`Self::residual`]. `frame` is the camera's own.
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
        let turn = Matrix2x3::from_rows(&[crossed(0), crossed(1)]);
        out.poses[0] = (frame, stacked(&turn, &(w * j_y)));
        out.pose_count = 1;
        out.shared.set_column(READOUT, &Vector2::zeros());
        let Some(stencil) = self.stencil else { return };
        let along = turn * left_jacobian(&row.theta);
        let mut own = turn * UnitQuaternion::from_scaled_axis(row.theta).to_rotation_matrix().matrix();
        let mut own_weight = 1.0;
        let (mut turning, mut shifting) = (Vec3::zeros(), Vec3::zeros());
        for (k, (neighbor, (c, rate))) in stencil.neighbors().iter().zip(row.weights).enumerate() {
            own -= c * along * neighbor.jacobian.transpose();
            own_weight -= c;
            turning += rate * neighbor.rotation;
            shifting += rate * neighbor.translation;
            out.poses[k + 1] = (neighbor.frame, stacked(&(c * along * neighbor.jacobian), &(w * c * j_y)));
        }
        out.poses[0] = (frame, stacked(&own, &(w * own_weight * j_y)));
        out.pose_count = 1 + stencil.neighbors().len();
        out.shared.set_column(READOUT, &(self.row_fraction(seen) * (along * turning + w * j_y * shifting)));
    }

    /// Height of a row below the middle of the frame, in frame heights, −½ to ½.
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
        let turn = UnitQuaternion::from_scaled_axis(theta).to_rotation_matrix();
        Row { view: View { rotation: turn.matrix() * self.view.rotation, translation }, weights, theta }
    }
}

/// `(Y_x, Y_y)/Y_z`, where `Y` is in front.
fn normalized(y: &Vec3) -> Option<Vec2> {
    (y.z > LEAST_FRONT * y.norm()).then(|| y.xy() / y.z)
}

fn stacked(turn: &Matrix2x3<f64>, shift: &Matrix2x3<f64>) -> PoseJacobian {
    let mut both = PoseJacobian::zeros();
    both.fixed_columns_mut::<3>(0).copy_from(turn);
    both.fixed_columns_mut::<3>(3).copy_from(shift);
    both
}
