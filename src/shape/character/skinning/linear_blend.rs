//! Linear blend skinning:
//!
//! ```text
//! x' = Σⱼ wⱼ Mⱼ x
//! ```
//!
//! A convex combination of rotations is not a rotation: midway between two that differ by `θ` about the axis of a limb, the radius
//! shrinks to `|cos(θ/2)|`.
//!
//! # Reference
//! N. Magnenat-Thalmann, R. Laperrière, D. Thalmann, *Joint-dependent local deformations for hand animation and object
//! grasping*, Graphics Interface 1988.

use nalgebra::{Matrix4, Point3, Vector3};

use super::super::Influence;
use super::{Jet, PosedMethod, Posing};

/// The first three rows of an affine matrix, column-major.
#[derive(Clone, Copy, Debug)]
pub(super) struct Affine(pub(super) [f64; 12]);

impl Affine {
    pub(super) const ZERO: Self = Self([0.0; 12]);

    pub(super) fn new(m: &Matrix4<f64>) -> Self {
        Self(std::array::from_fn(|k| m[(k % 3, k / 3)]))
    }

    /// `Σ wⱼ Mⱼ`.
    #[inline]
    pub(super) fn blend(matrices: &[Self], row: &[Influence]) -> Self {
        let mut sum = Self::ZERO;
        for influence in row {
            let m = &matrices[influence.joint as usize].0;
            for (s, m) in sum.0.iter_mut().zip(m) {
                *s += influence.weight * m;
            }
        }
        sum
    }

    #[inline]
    pub(super) fn apply(&self, p: &Point3<f64>) -> Point3<f64> {
        Point3::from(self.apply_linear(&p.coords) + Vector3::new(self.0[9], self.0[10], self.0[11]))
    }

    /// Applies the linear part.
    #[inline]
    pub(super) fn apply_linear(&self, v: &Vector3<f64>) -> Vector3<f64> {
        let a = &self.0;
        Vector3::new(
            a[0] * v.x + a[3] * v.y + a[6] * v.z,
            a[1] * v.x + a[4] * v.y + a[7] * v.z,
            a[2] * v.x + a[5] * v.y + a[8] * v.z,
        )
    }

    /// Position and derivatives under a blend of maps, for the variations `along` of `p` and `slopes` of the weights.
    pub(super) fn jet(
        matrices: &[Self],
        row: &[Influence],
        slopes: &[[f64; 2]],
        p: &Point3<f64>,
        along: [Vector3<f64>; 2],
    ) -> Jet {
        let blend = Self::blend(matrices, row);
        let position = blend.apply(p);
        let mut along = along.map(|t| blend.apply_linear(&t));
        for (influence, slope) in row.iter().zip(slopes) {
            // Relative to the blended position, which keeps digits far from the origin: the slopes sum to zero.
            let there = matrices[influence.joint as usize].apply(p) - position;
            for (a, s) in along.iter_mut().zip(slope) {
                *a += there * *s;
            }
        }
        Jet { position, along }
    }
}

/// The method in one pose.
pub(super) struct LinearPose<'a> {
    posing: Posing<'a>,
    matrices: Vec<Affine>,
}

impl<'a> LinearPose<'a> {
    pub(super) fn new(posing: Posing<'a>) -> Self {
        Self { posing, matrices: posing.matrices.iter().map(Affine::new).collect() }
    }
}

impl PosedMethod for LinearPose<'_> {
    #[inline]
    fn position(&self, vertex: usize) -> Point3<f64> {
        let Posing { rest, weights, .. } = self.posing;
        Affine::blend(&self.matrices, weights.row(vertex)).apply(&rest.position(vertex))
    }

    fn jet(&self, vertex: usize) -> Jet {
        let Posing { rest, weights, .. } = self.posing;
        let (row, slopes) = (weights.row(vertex), rest.slopes(vertex));
        Affine::jet(&self.matrices, row, slopes, &rest.position(vertex), rest.tangents(vertex))
    }
}
