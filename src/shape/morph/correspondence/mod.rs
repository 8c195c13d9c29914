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
use serde::{Deserialize, Serialize};

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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum CorrespondenceMethod {
    /// Deformed smoothly until it lies there: any mesh, never flawless
    #[default]
    Registration,
    /// Through the sphere: closed meshes without handles, one to one
    Sphere,
    /// Through the disk: meshes with one boundary and without handles, one to one
    Disk,
}

/// Options of [`correspond`]: a method, and the options of each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CorrespondenceOptions {
    /// The method; the options of the others are not used.
    pub method: CorrespondenceMethod,
    /// Options of the registration.
    pub registration: RegistrationOptions,
    /// Options of the map through the sphere.
    pub sphere: SphereOptions,
    /// Options of the map through the disk.
    pub disk: DiskOptions,
}

impl From<CorrespondenceMethod> for CorrespondenceOptions {
    fn from(method: CorrespondenceMethod) -> Self {
        Self { method, ..Self::default() }
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
    options: &CorrespondenceOptions,
    run: &Run,
) -> Result<Correspondence, MorphError> {
    let places = match options.method {
        CorrespondenceMethod::Registration => register(first, second, landmarks, &options.registration, run)?,
        CorrespondenceMethod::Sphere => over_spheres(first, second, landmarks, &options.sphere, run)?,
        CorrespondenceMethod::Disk => over_disks(first, second, landmarks, &options.disk, run)?,
    };
    let positions: Vec<Point3<f64>> = places.iter().map(|p| p.point).collect();
    let laid = first.with_positions(positions)?;
    let quality = measure(first, &laid, second, landmarks, run)?;
    Ok(Correspondence { places, laid, quality })
}
