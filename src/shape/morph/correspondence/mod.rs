//! Meshes that are not poses of one: the first mesh's triangles laid over the second.
//!
//! [`correspond`] gives every vertex of the first a place on the second, and says how good that is; with [`refine`] the first gains
//! vertices where features of the second would be lost. The result and the first are then two poses of one mesh.

mod disk;
mod landmarks;
mod quality;
mod refinement;
mod registration;
mod sphere;
#[cfg(test)]
mod tests;
mod unfolding;

use nalgebra::Point3;

pub use disk::{DiskOptions, disk_map, over_disks};
#[cfg(feature = "schema")]
#[cfg(feature = "schema")]
pub use landmarks::landmarks_schema;
pub use landmarks::{Landmarks, Place};
pub use quality::{MapQuality, measure};
pub(in crate::morph) use refinement::divided;
pub use refinement::{Refined, refine};
pub use registration::{RegistrationOptions, register};
pub use sphere::{SphereOptions, over_spheres, sphere_map};

use super::MorphError;
use super::bvh::Nearest;
use crate::mesh::TriMesh;
use plumbline_num::run::Run;

/// How one mesh is laid over another.
#[derive(Clone, Debug, PartialEq)]
pub enum CorrespondenceMethod {
    /// Deformed smoothly until it lies there: any topology, never flawless.
    Registration(RegistrationOptions),
    /// Over the sphere: closed surfaces without handles; one to one.
    Sphere(SphereOptions),
    /// Over the disk: surfaces with one boundary, without handles; one to one.
    Disk(DiskOptions),
}

impl Default for CorrespondenceMethod {
    fn default() -> Self {
        Self::Registration(RegistrationOptions::default())
    }
}

/// The first mesh laid over the second.
#[derive(Clone, Debug)]
pub struct Correspondence {
    /// The place of every vertex on the second mesh.
    pub places: Vec<Nearest>,
    /// The first mesh's triangles at these places.
    pub laid: TriMesh,
    /// How well.
    pub quality: MapQuality,
}

/// Lays the first mesh over the second so that landmarks, given as vertices of both, meet.
///
/// # Errors
/// [`MorphError::Landmarks`], [`MorphError::Empty`], [`MorphError::Topology`], [`MorphError::Numerics`],
/// [`MorphError::Interrupted`].
pub fn correspond(
    first: &TriMesh,
    second: &TriMesh,
    landmarks: &[(u32, u32)],
    method: &CorrespondenceMethod,
    run: &Run,
) -> Result<Correspondence, MorphError> {
    let places = match method {
        CorrespondenceMethod::Registration(options) => register(first, second, landmarks, options, run)?,
        CorrespondenceMethod::Sphere(options) => over_spheres(first, second, landmarks, options, run)?,
        CorrespondenceMethod::Disk(options) => over_disks(first, second, landmarks, options, run)?,
    };
    let positions: Vec<Point3<f64>> = places.iter().map(|p| p.point).collect();
    let laid = first.with_positions(positions)?;
    let quality = measure(first, &laid, second, landmarks, run)?;
    Ok(Correspondence { places, laid, quality })
}
