//! Dual quaternion skinning with a separate scale phase.
//!
//! Each joint's map is split by polar decomposition about the joint position `c` in the bind pose,
//!
//! ```text
//! Mⱼ x = Rⱼ (Sⱼ (x − c) + c) + tⱼ        Rⱼ a rotation, Sⱼ symmetric
//!
//! first    y  = Σ wⱼ (Sⱼ (x − cⱼ) + cⱼ)                     scale and shear, blended linearly in rest space
//! then     q̂  = Σ ±wⱼ q̂ⱼ,   x' = q̂ y q̂* / |q̂|²              rigid motions; signs aligned with the largest weight
//! ```
//!
//! Signs are aligned with the strongest joint, not with the running sum, so that the result is independent of the order of the joints.
//! With `q̂ = (a + u) + ε (e + f)`:
//!
//! ```text
//! x' = y + 2 (u × (u × y + a y + f) + a f − e u) / (a² + |u|²)
//! ```
//!
//! The reflection of an orientation-reversing map stays in `S`.
//!
//! # Reference
//! L. Kavan, S. Collins, J. Žára, C. O'Sullivan, *Geometric skinning with approximate dual quaternion blending*, ACM TOG 27
//! (2008), sections 3 and 4. Departure: scales are about the joint instead of the origin, so that results do not depend on the position
//! of the model.

use nalgebra::{Matrix3, Matrix4, Point3, Vector3};

use super::super::Influence;
use super::linear_blend::Affine;
use super::{Jet, PosedMethod, Posing};
use plumbline_num::math::{DualQuaternion, polar};

/// Deviation of a scale from 1 that counts as rounding: a chain of twenty rotations and a matrix, stored in single precision, err by
/// sixteen units in the last place together. Rigid motions from files thus skip the scale phase and stay exactly rigid.
const NO_SCALE: f64 = 2e-6;

/// `[x y z w]` of the real, then of the dual part.
pub(super) type Parts = [f64; 8];

/// Rigid motions of a pose, and the scales if any differs from the identity.
#[derive(Debug)]
pub(super) struct Motions {
    pub(super) rigid: Vec<Parts>,
    pub(super) scales: Option<Vec<Affine>>,
}

impl Motions {
    /// Splits the joints' maps, each about its joint position in the bind pose.
    pub(super) fn new(matrices: &[Matrix4<f64>], pivots: &[Point3<f64>]) -> Self {
        let split: Vec<_> = matrices.iter().zip(pivots).map(|(m, c)| split(m, c)).collect();
        let scaled = split.iter().any(|(_, s)| (s - Matrix3::identity()).amax() > NO_SCALE);
        let about = |((_, s), c): (&(DualQuaternion, Matrix3<f64>), &Point3<f64>)| {
            let mut map = s.to_homogeneous();
            map.fixed_view_mut::<3, 1>(0, 3).copy_from(&(c.coords - s * c.coords));
            Affine::new(&map)
        };
        let scales = scaled.then(|| split.iter().zip(pivots).map(about).collect());
        Self { rigid: split.iter().map(|(q, _)| parts(q)).collect(), scales }
    }
}

impl Motions {
    /// A point after the scale phase.
    #[inline]
    pub(super) fn scaled(&self, row: &[Influence], p: &Point3<f64>) -> Point3<f64> {
        self.scales.as_ref().map_or(*p, |s| Affine::blend(s, row).apply(p))
    }

    /// The same with its derivatives, for the variations `along` of `p` and `slopes` of the weights.
    pub(super) fn scaled_jet(
        &self,
        row: &[Influence],
        slopes: &[[f64; 2]],
        p: &Point3<f64>,
        along: [Vector3<f64>; 2],
    ) -> Jet {
        match &self.scales {
            Some(scales) => Affine::jet(scales, row, slopes, p, along),
            None => Jet { position: *p, along },
        }
    }

    /// Derivative of [`blend`] along tangent `k`.
    pub(super) fn blend_along(&self, row: &[Influence], slopes: &[[f64; 2]], k: usize) -> Parts {
        let pivot = &self.rigid[row[0].joint as usize];
        let mut sum = [0.0; 8];
        for (influence, slope) in row.iter().zip(slopes) {
            let q = &self.rigid[influence.joint as usize];
            let w = slope[k] * sign(pivot, q);
            for (s, c) in sum.iter_mut().zip(q) {
                *s += w * c;
            }
        }
        sum
    }
}

/// Linear part of an affine map.
pub(super) fn linear(m: &Matrix4<f64>) -> Matrix3<f64> {
    m.fixed_view::<3, 3>(0, 0).into_owned()
}

/// Rigid motion, and scale about `c`.
fn split(m: &Matrix4<f64>, c: &Point3<f64>) -> (DualQuaternion, Matrix3<f64>) {
    let (rotation, scale) = polar(&linear(m));
    let translation = m.transform_point(c) - rotation * c;
    (DualQuaternion::from_rigid(&rotation, &translation), scale)
}

fn parts(q: &DualQuaternion) -> Parts {
    let ([x, y, z, w], [i, j, k, l]) = (q.real.coords.into(), q.dual.coords.into());
    [x, y, z, w, i, j, k, l]
}

/// Sign of the contribution of a motion relative to the pivot.
#[inline]
fn sign(pivot: &Parts, q: &Parts) -> f64 {
    let dot = pivot[0] * q[0] + pivot[1] * q[1] + pivot[2] * q[2] + pivot[3] * q[3];
    if dot < 0.0 { -1.0 } else { 1.0 }
}

/// `Σ ±wⱼ q̂ⱼ`; the first (strongest) influence of the row is the pivot.
#[inline]
pub(super) fn blend(rigid: &[Parts], row: &[Influence]) -> Parts {
    let pivot = &rigid[row[0].joint as usize];
    let mut sum = pivot.map(|c| row[0].weight * c);
    for influence in &row[1..] {
        let q = &rigid[influence.joint as usize];
        let w = influence.weight * sign(pivot, q);
        for (s, c) in sum.iter_mut().zip(q) {
            *s += w * c;
        }
    }
    sum
}

/// `q̂ y q̂* / |q̂|²`; `y` itself if the motions cancel.
#[inline]
pub(super) fn moved(q: &Parts, y: &Point3<f64>) -> Point3<f64> {
    let [ux, uy, uz, a, fx, fy, fz, e] = *q;
    let (u, f) = (Vector3::new(ux, uy, uz), Vector3::new(fx, fy, fz));
    let length = u.norm_squared() + a * a;
    let inverse = if length > 0.0 { 2.0 / length } else { 0.0 };
    y + (u.cross(&(u.cross(&y.coords) + a * y.coords + f)) + a * f - e * u) * inverse
}

/// Derivative of [`moved`] for the variations `dq` of `q̂` and `dy` of `y`; `x` is the image of `y`.
pub(super) fn moved_along(
    q: &Parts,
    dq: &Parts,
    y: &Vector3<f64>,
    dy: &Vector3<f64>,
    x: &Vector3<f64>,
) -> Vector3<f64> {
    let vector = |q: &Parts, k: usize| Vector3::new(q[k], q[k + 1], q[k + 2]);
    let (u, a, f, e) = (vector(q, 0), q[3], vector(q, 4), q[7]);
    let (du, da, df, de) = (vector(dq, 0), dq[3], vector(dq, 4), dq[7]);
    let length = u.norm_squared() + a * a;
    if !(length > 0.0) {
        return *dy;
    }
    // x − y = 2 n / length with n = u × s + a f − e u, s = u × y + a y + f.
    let s = u.cross(y) + a * y + f;
    let ds = du.cross(y) + u.cross(dy) + da * y + a * dy + df;
    let dn = du.cross(&s) + u.cross(&ds) + da * f + a * df - de * u - e * du;
    dy + (2.0 * dn - (x - y) * (2.0 * (u.dot(&du) + a * da))) / length
}

/// The method in one pose.
pub(super) struct DualQuaternionPose<'a> {
    posing: Posing<'a>,
    motions: Motions,
}

impl<'a> DualQuaternionPose<'a> {
    pub(super) fn new(posing: Posing<'a>) -> Self {
        Self { posing, motions: Motions::new(posing.matrices, posing.pivots) }
    }
}

impl PosedMethod for DualQuaternionPose<'_> {
    #[inline]
    fn position(&self, vertex: usize) -> Point3<f64> {
        let Posing { rest, weights, .. } = self.posing;
        let (row, p) = (weights.row(vertex), rest.position(vertex));
        moved(&blend(&self.motions.rigid, row), &self.motions.scaled(row, &p))
    }

    fn jet(&self, vertex: usize) -> Jet {
        let Posing { rest, weights, .. } = self.posing;
        let (row, slopes) = (weights.row(vertex), rest.slopes(vertex));
        let scaled = self.motions.scaled_jet(row, slopes, &rest.position(vertex), rest.tangents(vertex));
        let q = blend(&self.motions.rigid, row);
        let position = moved(&q, &scaled.position);
        let along = std::array::from_fn(|k| {
            let dq = self.motions.blend_along(row, slopes, k);
            moved_along(&q, &dq, &scaled.position.coords, &scaled.along[k], &position.coords)
        });
        Jet { position, along }
    }
}
