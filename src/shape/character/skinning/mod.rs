//! Skinning: deforms the surface by the joints' matrices.
//!
//! | method | `x' =` | preserves |
//! | --- | --- | --- |
//! | [`SkinningMethod::LinearBlend`] | `Σ wⱼ Mⱼ x` | nothing: collapses at twists toward 180° |
//! | [`SkinningMethod::DualQuaternion`] | blended rigid motions, after blended scales | radius under twist; bulges at bends |
//! | [`SkinningMethod::CentersOfRotation`] | blended rotation about a precomputed center | both, mostly |
//! | [`SkinningMethod::TwistSwing`] | mix of the first two | as linear for swings, as dual quaternions for twists |
//!
//! A [`Skinner`] is bound once and then evaluated for the skin matrices of any number of poses ([`super::Skin::joint_matrices`]).
//!
//! Normals are computed from the derivative of the deformation along the surface, including the slopes of the weights:
//!
//! ```text
//! n' ∝ ∂x'/∂s × ∂x'/∂t      s, t tangents at rest
//! ```
//!
//! For one bone this is the inverse transpose of its matrix; for a blend it is the normal of the deformed surface, which blended normals
//! are not.

mod centers_of_rotation;
mod dual_quaternion;
mod linear_blend;
mod packed;
mod rest_surface;
#[cfg(test)]
pub(super) mod tests;
mod twist_swing;

use nalgebra::{Matrix4, Point3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

pub use centers_of_rotation::centers_of_rotation;
pub use packed::PackedSkin;
pub use twist_swing::Twisting;

use super::skin::check_affine;
use super::weights::{WeightOptions, bone_weights};
use super::{CharacterError, Pose, Skeleton, Skin, SkinWeights};
use crate::mesh::TriMesh;
use centers_of_rotation::CentersPose;
use dual_quaternion::DualQuaternionPose;
use linear_blend::LinearPose;
use plumbline_num::run::Run;
use rest_surface::RestSurface;
use twist_swing::TwistSwingPose;

use plumbline_num::math::polar;

/// How the motions of the joints are blended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum SkinningMethod {
    /// Linear blend: fastest, supported everywhere; collapses under twist
    #[serde(rename = "lbs")]
    LinearBlend,
    /// Dual quaternions: keep the radius under twist, bulge at bends
    ///
    /// Rigid motions are blended as dual quaternions, after a linear blend of scale and shear.
    #[default]
    #[serde(rename = "dqs")]
    DualQuaternion,
    /// Optimized centers of rotation: neither; centers are precomputed at binding
    #[serde(rename = "cor")]
    CentersOfRotation,
    /// Dual quaternions for twists, linear blend for swings
    #[serde(rename = "mixed")]
    TwistSwing,
}

/// A surface bound to a skeleton, prepared for one skinning method.
#[derive(Clone, Debug)]
pub struct Skinner {
    rest: RestSurface,
    weights: SkinWeights,
    /// Joint positions in the bind pose.
    pivots: Vec<Point3<f64>>,
    bound: Bound,
}

/// Precomputed data of the method.
#[derive(Clone, Debug)]
enum Bound {
    LinearBlend,
    DualQuaternion,
    CentersOfRotation { centers: Vec<Point3<f64>>, slopes: Vec<[Vector3<f64>; 2]> },
    TwistSwing(Twisting),
}

/// A skinned surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skinned {
    /// Vertex positions.
    pub positions: Vec<Point3<f64>>,
    /// Unit normals.
    pub normals: Vec<Vector3<f64>>,
}

/// A skinning method in one pose. The loops over vertices are here, so that every method gets its own inner loop.
trait PosedMethod {
    /// Posed position of a vertex.
    fn position(&self, vertex: usize) -> Point3<f64>;
    /// Posed position of a vertex and its derivatives along the two tangents at rest.
    fn jet(&self, vertex: usize) -> Jet;

    fn positions_into(&self, vertices: usize, positions: &mut Vec<Point3<f64>>) {
        positions.clear();
        positions.extend((0..vertices).map(|v| self.position(v)));
    }

    fn surface(&self, rest: &RestSurface, vertices: usize) -> Skinned {
        let vertex = |v: usize| {
            let Jet { position, along: [s, t] } = self.jet(v);
            // A surface collapsed to a line has no normal: keep the one at rest.
            (position, s.cross(&t).try_normalize(0.0).unwrap_or_else(|| rest.normal(v)))
        };
        let (positions, normals) = (0..vertices).map(vertex).unzip();
        Skinned { positions, normals }
    }
}

/// A position and its derivative along two tangents.
#[derive(Clone, Copy, Debug)]
struct Jet {
    position: Point3<f64>,
    along: [Vector3<f64>; 2],
}

/// Input of every method: surface, weights and matrices of a pose.
#[derive(Clone, Copy)]
struct Posing<'a> {
    rest: &'a RestSurface,
    weights: &'a SkinWeights,
    pivots: &'a [Point3<f64>],
    matrices: &'a [Matrix4<f64>],
}

/// Skins a mesh in one call: weights by bone heat, bound in the rest pose of the skeleton, posed by dual quaternions. For many poses
/// use a [`Skinner`].
///
/// ```
/// use plumbline_shape::character::{extraction::skeleton, skinning::skin};
/// use plumbline_shape::mesh::shapes;
///
/// let bar = shapes::bar([4, 4, 20], [1.0, 1.0, 8.0]);
/// let skeleton = skeleton(&bar)?;
/// let mut pose = skeleton.rest_pose();
/// let root = skeleton.roots().next().expect("a skeleton has a joint");
/// pose.locals[root as usize].translation.x += 2.0;
/// let posed = skin(&bar, &skeleton, &pose)?;
/// assert!((posed[0].x - bar.positions()[0].x - 2.0).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// As for [`bone_weights`], [`Skinner::new`] and [`Skeleton::globals`].
pub fn skin(mesh: &TriMesh, skeleton: &Skeleton, pose: &Pose) -> Result<Vec<Point3<f64>>, CharacterError> {
    let run = Run::default();
    let (weights, _) = bone_weights(mesh, skeleton, &WeightOptions::default(), &run)?;
    let skin = Skin::bound(weights, skeleton)?;
    let skinner = Skinner::new(mesh, None, skeleton, &skin, SkinningMethod::default(), &run)?;
    skinner.positions(&skin.joint_matrices(&skeleton.globals(pose)?)?)
}

impl Skinner {
    /// Binds a surface. `normals` are per vertex in the bind pose; `None`: area-weighted from the triangles.
    ///
    /// # Errors
    /// [`CharacterError::PerVertex`] for weights or normals of another mesh, [`CharacterError::Input`] for another skeleton or a singular
    /// bind matrix.
    pub fn new(
        mesh: &TriMesh,
        normals: Option<&[Vector3<f64>]>,
        skeleton: &Skeleton,
        skin: &Skin,
        method: SkinningMethod,
        run: &Run,
    ) -> Result<Self, CharacterError> {
        CharacterError::check_matrices(skeleton.joint_count(), skin.inverse_bind().len())?;
        let flat = |j: usize| CharacterError::flat_joint(&skeleton.joints()[j].name);
        let frame = |(j, b): (usize, &Matrix4<f64>)| b.try_inverse().ok_or_else(|| flat(j));
        let frames: Vec<Matrix4<f64>> = skin.inverse_bind().iter().enumerate().map(frame).collect::<Result<_, _>>()?;
        let weights = skin.weights().clone();
        let rest = RestSurface::new(mesh, normals, &weights)?;
        let bound = match method {
            SkinningMethod::LinearBlend => Bound::LinearBlend,
            SkinningMethod::DualQuaternion => Bound::DualQuaternion,
            SkinningMethod::CentersOfRotation => {
                let centers = centers_of_rotation(mesh, &weights, run)?;
                let slopes = rest.slopes_of_points(mesh, &centers, |v| weights.row(v).len() > 1);
                Bound::CentersOfRotation { centers, slopes }
            }
            SkinningMethod::TwistSwing => Bound::TwistSwing(Twisting::new(skeleton, &frames)),
        };
        let pivots = frames.iter().map(|f| Point3::new(f.m14, f.m24, f.m34)).collect();
        Ok(Self { rest, weights, pivots, bound })
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.weights.vertex_count()
    }

    /// Vertex positions for the skin matrices of a pose.
    ///
    /// # Errors
    /// [`CharacterError::Input`] for a wrong number of joints or an invalid matrix.
    pub fn positions(&self, matrices: &[Matrix4<f64>]) -> Result<Vec<Point3<f64>>, CharacterError> {
        let mut positions = Vec::with_capacity(self.vertex_count());
        self.positions_into(matrices, &mut positions)?;
        Ok(positions)
    }

    /// Like [`Self::positions`], reusing a buffer.
    ///
    /// # Errors
    /// As [`Self::positions`].
    pub fn positions_into(
        &self,
        matrices: &[Matrix4<f64>],
        positions: &mut Vec<Point3<f64>>,
    ) -> Result<(), CharacterError> {
        self.posed(matrices)?.positions_into(self.vertex_count(), positions);
        Ok(())
    }

    /// Positions and normals.
    ///
    /// # Errors
    /// As [`Self::positions`].
    pub fn skin(&self, matrices: &[Matrix4<f64>]) -> Result<Skinned, CharacterError> {
        Ok(self.posed(matrices)?.surface(&self.rest, self.vertex_count()))
    }

    fn posed<'a>(&'a self, matrices: &'a [Matrix4<f64>]) -> Result<Box<dyn PosedMethod + 'a>, CharacterError> {
        CharacterError::check_matrices(self.weights.joint_count(), matrices.len())?;
        check_affine(matrices)?;
        let posing = Posing { rest: &self.rest, weights: &self.weights, pivots: &self.pivots, matrices };
        Ok(match &self.bound {
            Bound::LinearBlend => Box::new(LinearPose::new(posing)),
            Bound::DualQuaternion => Box::new(DualQuaternionPose::new(posing)),
            Bound::CentersOfRotation { centers, slopes } => Box::new(CentersPose::new(posing, centers, slopes)),
            Bound::TwistSwing(twisting) => Box::new(TwistSwingPose::new(posing, twisting)),
        })
    }
}

/// Rotations of the joints' maps by polar decomposition.
pub(super) fn joint_rotations(matrices: &[Matrix4<f64>]) -> Vec<UnitQuaternion<f64>> {
    matrices.iter().map(|m| polar(&dual_quaternion::linear(m)).0).collect()
}
