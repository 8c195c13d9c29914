//! Skinning of many vertices in single precision: four joints per vertex, 36 bytes each.
//!
//! Places are kept from the middle of the model at rest, and results are from a point that moves with it, so that neither where
//! a model stands nor where it walks costs digits. The arithmetic is that of the exact methods; processors with AVX2 and FMA take
//! kernels of their own, whose results differ from the plain ones by roundings.

/// The wide kernel where the processor has it, else the plain one.
macro_rules! match_kernel {
    ($kernel:ident($($argument:expr),*)) => {{
        #[cfg(target_arch = "x86_64")]
        if avx2::available() {
            avx2::$kernel($($argument),*);
        } else {
            plain::$kernel($($argument),*);
        }
        #[cfg(not(target_arch = "x86_64"))]
        plain::$kernel($($argument),*);
    }};
}

#[cfg(target_arch = "x86_64")]
mod avx2;
mod plain;
#[cfg(test)]
mod tests;

use nalgebra::{Matrix4, Point3, Vector3};

use super::super::skin::check_affine;
use super::super::{CharacterError, Skin};
use super::dual_quaternion::Motions;
use super::linear_blend::Affine;
use crate::mesh::TriMesh;

/// Joints per vertex.
const INFLUENCES: usize = 4;

/// A vertex: where it is from the middle, how much it follows which joints, the strongest first. Unused weights are 0.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
struct PackedVertex {
    position: [f32; 3],
    weights: [f32; INFLUENCES],
    joints: [u16; INFLUENCES],
}

/// An affine map by columns; the fourth row is 0 0 0 1.
type Columns = [f32; 16];
/// `[x y z w]` of the real, then of the dual part of a motion.
type Motion = [f32; 8];

/// A surface bound to joints, for speed.
#[derive(Clone, Debug)]
pub struct PackedSkin {
    /// Every number in `joints` is below the length of `pivots`.
    vertices: Vec<PackedVertex>,
    middle: Point3<f64>,
    pivots: Vec<Point3<f64>>,
    /// How much of the surface follows each joint; sums to 1.
    shares: Vec<f64>,
}

impl PackedSkin {
    /// Packs a skin.
    ///
    /// # Errors
    /// [`CharacterError::TooManyInfluences`] where a vertex follows more than four joints, [`CharacterError::PerVertex`] for
    /// weights of another mesh, [`CharacterError::Matrix`] where a bind matrix has no inverse.
    pub fn new(mesh: &TriMesh, skin: &Skin) -> Result<Self, CharacterError> {
        let (weights, vertices) = (skin.weights(), mesh.vertex_count());
        if weights.vertex_count() != vertices {
            return Err(CharacterError::PerVertex { what: "rows of weights", given: weights.vertex_count(), vertices });
        }
        if let Some(vertex) = weights.rows().position(|r| r.len() > INFLUENCES) {
            let found = weights.row(vertex).len();
            return Err(CharacterError::TooManyInfluences { vertex, found, most: INFLUENCES });
        }
        let middle = mesh.bounding_box().map_or(Point3::origin(), |(low, high)| nalgebra::center(&low, &high));
        let pivot = |(joint, b): (usize, &Matrix4<f64>)| {
            let frame = b.try_inverse().ok_or(CharacterError::Matrix { joint, what: "flat" })?;
            Ok::<_, CharacterError>(Point3::new(frame.m14, frame.m24, frame.m34))
        };
        let pivots: Vec<_> = skin.inverse_bind().iter().enumerate().map(pivot).collect::<Result<_, _>>()?;
        let mut shares = vec![0.0; pivots.len()];
        let mut packed = Vec::with_capacity(vertices);
        for (p, row) in mesh.positions().iter().zip(weights.rows()) {
            let mut vertex =
                PackedVertex { position: (p - middle).map(|c| c as f32).into(), weights: [0.0; 4], joints: [0; 4] };
            for (k, influence) in row.iter().enumerate() {
                vertex.weights[k] = influence.weight as f32;
                vertex.joints[k] = influence.joint as u16;
                shares[influence.joint as usize] += influence.weight / vertices as f64;
            }
            packed.push(vertex);
        }
        Ok(Self { vertices: packed, middle, pivots, shares })
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.vertices.len()
    }

    /// Linear blend skinning. Returns the point that the results are from.
    ///
    /// # Errors
    /// [`CharacterError::Matrices`] for another number of joints, [`CharacterError::Matrix`], [`CharacterError::PerVertex`] for
    /// another number of results.
    pub fn linear_blend(&self, matrices: &[Matrix4<f64>], out: &mut [[f32; 3]]) -> Result<Point3<f64>, CharacterError> {
        self.check(matrices, out)?;
        let (middle, moved) = self.recentered(matrices);
        let maps: Vec<Columns> = moved.iter().map(columns).collect();
        match_kernel!(linear_blend(&self.vertices, &maps, out));
        Ok(middle)
    }

    /// Dual quaternion skinning, scales included. Returns the point that the results are from.
    ///
    /// # Errors
    /// As [`Self::linear_blend`].
    pub fn dual_quaternion(
        &self,
        matrices: &[Matrix4<f64>],
        out: &mut [[f32; 3]],
    ) -> Result<Point3<f64>, CharacterError> {
        self.check(matrices, out)?;
        let (middle, moved) = self.recentered(matrices);
        let pivots: Vec<Point3<f64>> = self.pivots.iter().map(|p| p - self.middle.coords).collect();
        let motions = Motions::new(&moved, &pivots);
        let rigid: Vec<Motion> = motions.rigid.iter().map(|q| q.map(|c| c as f32)).collect();
        match &motions.scales {
            // In single precision a scale of 1 + 1e-7 is none.
            Some(scales) if scales.iter().any(|s| farthest_from_identity(s) > 1e-7) => {
                let scales: Vec<Columns> = scales.iter().map(affine_columns).collect();
                match_kernel!(scaled_dual_quaternion(&self.vertices, &scales, &rigid, out));
            }
            _ => match_kernel!(dual_quaternion(&self.vertices, &rigid, out)),
        }
        Ok(middle)
    }

    fn check(&self, matrices: &[Matrix4<f64>], out: &[[f32; 3]]) -> Result<(), CharacterError> {
        if matrices.len() != self.pivots.len() {
            return Err(CharacterError::Matrices { joints: self.pivots.len(), matrices: matrices.len() });
        }
        if out.len() != self.vertices.len() {
            let (given, vertices) = (out.len(), self.vertices.len());
            return Err(CharacterError::PerVertex { what: "places for results", given, vertices });
        }
        check_affine(matrices)
    }

    /// Where the middle of the surface goes, and the maps between places from the middle at rest and from there.
    fn recentered(&self, matrices: &[Matrix4<f64>]) -> (Point3<f64>, Vec<Matrix4<f64>>) {
        let goes = |m: &Matrix4<f64>| m.transform_point(&self.middle).coords;
        let middle: Vector3<f64> = matrices.iter().zip(&self.shares).map(|(m, s)| goes(m) * *s).sum();
        let recentered = |m: &Matrix4<f64>| {
            let mut moved = *m;
            moved.fixed_view_mut::<3, 1>(0, 3).copy_from(&(goes(m) - middle));
            moved
        };
        (middle.into(), matrices.iter().map(recentered).collect())
    }
}

fn columns(m: &Matrix4<f64>) -> Columns {
    std::array::from_fn(|k| m[(k % 4, k / 4)] as f32)
}

fn affine_columns(a: &Affine) -> Columns {
    std::array::from_fn(|k| match (k % 4, k / 4) {
        (3, 3) => 1.0,
        (3, _) => 0.0,
        (row, column) => a.0[3 * column + row] as f32,
    })
}

fn farthest_from_identity(a: &Affine) -> f64 {
    let identity = |k: usize| f64::from(u8::from(k < 9 && k.is_multiple_of(4)));
    (0..9).map(|k| (a.0[k] - identity(k)).abs()).fold(0.0, f64::max)
}
