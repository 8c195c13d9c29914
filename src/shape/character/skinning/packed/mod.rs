//! Single-precision skinning of many vertices: four joints per vertex, 36 bytes each.
//!
//! Positions are stored relative to the center of the model at rest, and results relative to its posed center, so that neither the position
//! of the model nor root motion costs digits. The arithmetic is that of the double-precision methods; the AVX2 kernels differ from the
//! scalar ones by rounding.

/// Calls the AVX2 kernel if the processor supports it, else the scalar one.
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

use super::super::skin::{check_affine, invalid_matrix};
use super::super::{CharacterError, Skin};
use super::dual_quaternion::Motions;
use super::linear_blend::Affine;
use crate::mesh::TriMesh;

/// Influences per vertex.
const INFLUENCES: usize = 4;

/// A vertex: position relative to the center, weights in descending order, joints. Unused weights are 0.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
struct PackedVertex {
    position: [f32; 3],
    weights: [f32; INFLUENCES],
    joints: [u16; INFLUENCES],
}

/// An affine map, column-major; the fourth row is 0 0 0 1.
type Columns = [f32; 16];
/// A dual quaternion: `[x y z w]` of the real, then of the dual part.
type Motion = [f32; 8];

/// A surface bound to joints, packed for speed.
#[derive(Clone, Debug)]
pub struct PackedSkin {
    /// Invariant: every joint index is below the length of `pivots`.
    vertices: Vec<PackedVertex>,
    middle: Point3<f64>,
    pivots: Vec<Point3<f64>>,
    /// Fraction of the total weight of each joint; sums to 1.
    shares: Vec<f64>,
}

impl PackedSkin {
    /// Packs a skin.
    ///
    /// # Errors
    /// [`CharacterError::PerVertex`] for weights of another mesh, [`CharacterError::Input`] if a vertex has more than four influences or a
    /// bind matrix is singular.
    pub fn new(mesh: &TriMesh, skin: &Skin) -> Result<Self, CharacterError> {
        let (weights, vertices) = (skin.weights(), mesh.vertex_count());
        CharacterError::check_per_vertex("rows of weights", weights.vertex_count(), vertices)?;
        if let Some(vertex) = weights.rows().position(|r| r.len() > INFLUENCES) {
            let found = format!("vertex {vertex} has {} influences", weights.row(vertex).len());
            return Err(CharacterError::Input(format!("{found} (at most {INFLUENCES}); limit the weights first")));
        }
        let middle = mesh.bounding_box().map_or(Point3::origin(), |(low, high)| nalgebra::center(&low, &high));
        let pivot = |(joint, b): (usize, &Matrix4<f64>)| {
            let frame = b.try_inverse().ok_or_else(|| invalid_matrix(joint, "flat"))?;
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

    /// Linear blend skinning. Returns the origin of the results.
    ///
    /// # Errors
    /// [`CharacterError::Input`] for a wrong number of joints or an invalid matrix, [`CharacterError::PerVertex`] for a wrong number of
    /// results.
    pub fn linear_blend(&self, matrices: &[Matrix4<f64>], out: &mut [[f32; 3]]) -> Result<Point3<f64>, CharacterError> {
        self.check(matrices, out)?;
        let (middle, moved) = self.recentered(matrices);
        let maps: Vec<Columns> = moved.iter().map(columns).collect();
        match_kernel!(linear_blend(&self.vertices, &maps, out));
        Ok(middle)
    }

    /// Dual quaternion skinning, including scales. Returns the origin of the results.
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
        // A deviation of 1e-7 is below single precision.
        let scales = motions.scales.filter(|scales| scales.iter().any(|s| farthest_from_identity(s) > 1e-7));
        let scales: Option<Vec<Columns>> = scales.map(|scales| scales.iter().map(affine_columns).collect());
        match_kernel!(dual_quaternion(&self.vertices, scales.as_deref(), &rigid, out));
        Ok(middle)
    }

    fn check(&self, matrices: &[Matrix4<f64>], out: &[[f32; 3]]) -> Result<(), CharacterError> {
        CharacterError::check_matrices(self.pivots.len(), matrices.len())?;
        let (given, vertices) = (out.len(), self.vertices.len());
        CharacterError::check_per_vertex("slots for results", given, vertices)?;
        check_affine(matrices)
    }

    /// The posed center of the surface, and the maps between positions relative to the center at rest and to the posed one.
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
