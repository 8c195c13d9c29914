//! Correspondence between two meshes: the first is mapped onto the second.
//!
//! [`correspond`] maps every vertex of the first mesh to a point of the second and measures the quality of the map; [`refine`] adds
//! vertices where features of the second would be lost. The first mesh and the result are then two poses of one mesh.

mod disk;
mod landmarks;
mod quality;
mod refinement;
mod registration;
mod relaxation;
mod sphere;
#[cfg(test)]
mod tests;
mod unfolding;
mod walk;

use serde::{Deserialize, Serialize};

pub use disk::{disk_map, over_disks};
#[cfg(feature = "schema")]
pub use landmarks::landmarks_schema;
pub use landmarks::{Landmarks, VertexRef};
pub use quality::{MapQuality, QualityCheck, measure};
pub(in crate::morph) use refinement::divided;
pub use refinement::{Refined, refine};
pub use registration::{RegistrationOptions, register};
pub use sphere::{over_spheres, sphere_map};

use super::MorphError;
use super::bvh::SurfacePoint;
use super::error::check_size;
use crate::mesh::{HalfEdges, RepairOptions, TriMesh, repair};
use plumbline_num::run::Run;
use plumbline_num::spatial::numbered_components;
use relaxation::relax;
use walk::Ground;

/// Correspondence method.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum CorrespondenceMethod {
    /// Registration; where its map fails a check, sphere or disk
    #[default]
    Auto,
    /// Non-rigid registration: any topology; the map may have fold-overs
    Registration,
    /// Over the sphere: closed surfaces of genus 0; few folds
    Sphere,
    /// Over the disk: surfaces of genus 0 with one boundary; bijective
    Disk,
}

/// Options of [`correspond`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CorrespondenceOptions {
    /// The method.
    pub method: CorrespondenceMethod,
    /// Options of the registration.
    pub registration: RegistrationOptions,
}

impl From<CorrespondenceMethod> for CorrespondenceOptions {
    fn from(method: CorrespondenceMethod) -> Self {
        Self { method, ..Self::default() }
    }
}

/// Maximum iterations that move landmarks to their targets on the disk or the sphere; ends when all have arrived.
const MAX_LANDMARK_ITERATIONS: usize = 2000;

/// The half-edges of a connected oriented manifold, and its Euler characteristic; `refused` makes the error of another topology.
fn connected_surface(mesh: &TriMesh, refused: impl Fn(String) -> MorphError) -> Result<(HalfEdges, i64), MorphError> {
    let half_edges = HalfEdges::new(mesh).map_err(|e| refused(format!("is not an oriented manifold: {e}")))?;
    let (_, components) = numbered_components(mesh.vertex_count(), mesh.triangles());
    if components != 1 {
        return Err(refused(format!("has {components} connected components, unreferenced vertices included")));
    }
    let euler = mesh.vertex_count() as i64 - half_edges.edge_count() as i64 + mesh.triangle_count() as i64;
    Ok((half_edges, euler))
}

/// A map of the first mesh onto the second.
#[derive(Clone, Debug)]
pub struct Correspondence {
    /// The method that found it, never [`CorrespondenceMethod::Auto`].
    pub method: CorrespondenceMethod,
    /// The point of every vertex on the second mesh.
    pub points: Vec<SurfacePoint>,
    /// The first mesh's triangles at these points.
    pub mapped: TriMesh,
    /// Quality of the map.
    pub quality: MapQuality,
}

/// Maps the first mesh onto the second with corresponding landmarks, given as vertices of both.
///
/// [`CorrespondenceMethod::Auto`] takes registration, the fastest, unless its map fails a check ([`MapQuality::failed_checks`]); then a
/// map over the sphere or the disk, where the topology of both meshes has one, and of the two the one that exceeds its limits by the
/// smaller factor.
///
/// # Errors
/// [`MorphError::Landmarks`], [`MorphError::Empty`], [`MorphError::Size`], [`MorphError::Topology`], [`MorphError::Numerics`],
/// [`MorphError::Interrupted`].
pub fn correspond(
    first: &TriMesh,
    second: &TriMesh,
    landmarks: &[(u32, u32)],
    options: &CorrespondenceOptions,
    run: &Run,
) -> Result<Correspondence, MorphError> {
    check_size(first, "first")?;
    check_size(second, "second")?;
    let of_points = |method, points: Vec<SurfacePoint>| -> Result<Correspondence, MorphError> {
        let mapped = first.with_positions(points.iter().map(|p| p.point).collect())?;
        let quality = measure(first, &mapped, second, landmarks, run)?;
        Ok(Correspondence { method, points, mapped, quality })
    };
    let by = |method| {
        let points = match method {
            CorrespondenceMethod::Sphere => of_manifold(first, landmarks, run, |m, l| over_spheres(m, second, l, run))?,
            CorrespondenceMethod::Disk => of_manifold(first, landmarks, run, |m, l| over_disks(m, second, l, run))?,
            _ => register(first, second, landmarks, &options.registration, run)?,
        };
        let map = of_points(method, points)?;
        // The sphere method ends so. A map that passes keeps what it made of features; relaxation knows only landmarks.
        if method == CorrespondenceMethod::Sphere || map.excess() <= 1.0 {
            return Ok(map);
        }
        let mut points = map.points.clone();
        relax(first, &Ground::new(second), &mut points, &kept(first, landmarks), run)?;
        let relaxed = of_points(method, points)?;
        Ok(if relaxed.excess() < map.excess() { relaxed } else { map })
    };
    if options.method != CorrespondenceMethod::Auto {
        return by(options.method);
    }
    let mut best = by(CorrespondenceMethod::Registration)?;
    for method in [CorrespondenceMethod::Sphere, CorrespondenceMethod::Disk] {
        if best.excess() <= 1.0 {
            break;
        }
        match by(method) {
            Err(MorphError::Interrupted(stopped)) => return Err(stopped.into()),
            Ok(other) if other.excess() < best.excess() => best = other,
            // Not better, or a method that these surfaces are no input for: the map at hand stays.
            Ok(_) | Err(_) => {}
        }
    }
    Ok(best)
}

/// The vertices that relaxation of a map keeps: landmarks, and those at the border.
fn kept(mesh: &TriMesh, landmarks: &[(u32, u32)]) -> Vec<bool> {
    let mut kept = Ground::new(mesh).border();
    for l in landmarks {
        kept[l.0 as usize] = true;
    }
    kept
}

/// The map of a mesh by a method for manifolds. Sheets that touch in a vertex or an edge are taken apart before and put together after,
/// in one of the two places.
fn of_manifold(
    first: &TriMesh,
    landmarks: &[(u32, u32)],
    run: &Run,
    map: impl Fn(&TriMesh, &[(u32, u32)]) -> Result<Vec<SurfacePoint>, MorphError>,
) -> Result<Vec<SurfacePoint>, MorphError> {
    if HalfEdges::new(first).is_ok() {
        return map(first, landmarks);
    }
    let apart = repair(first, &RepairOptions::default(), run)?;
    let Some(copies) = apart.vertex_of_source.iter().copied().collect::<Option<Vec<u32>>>() else {
        return map(first, landmarks);
    };
    let landmarks: Vec<_> = landmarks.iter().map(|&(v, w)| (copies[v as usize], w)).collect();
    let points = map(&apart.mesh, &landmarks)?;
    Ok(copies.iter().map(|v| points[*v as usize]).collect())
}

impl Correspondence {
    /// The largest of the values that are checked, over its limit.
    fn excess(&self) -> f64 {
        self.quality.checks().iter().map(QualityCheck::excess).fold(0.0, f64::max)
    }
}
