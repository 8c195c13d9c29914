//! Mirrored weights.

use std::collections::HashMap;

use nalgebra::{Point3, Unit, Vector3};

use super::super::edit::other_side;
use super::super::{CharacterError, Skeleton, SkinWeights};
use crate::mesh::TriMesh;
use plumbline_num::spatial::KdTree;

/// A mirror plane and the correspondence of joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Mirroring {
    /// A point on the plane.
    pub point: Point3<f64>,
    /// Its normal, toward the half that is kept.
    pub normal: Unit<Vector3<f64>>,
    /// Mirror image of each joint; joints in the plane are their own image.
    pub joints: Vec<u32>,
}

/// Statistics of mirroring.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MirrorReport {
    /// Vertices that took the weights of their mirror image.
    pub changed: usize,
    /// Vertices in the plane, whose weights were made symmetric.
    pub evened: usize,
    /// Largest distance of a mirrored vertex from the vertex whose weights it took, units of the model.
    pub max_deviation: f64,
}

impl SkinWeights {
    /// Vertices behind the plane take the mirrored weights of the vertex nearest to their image; vertices in the plane take the mean of
    /// their own and their mirrored weights.
    ///
    /// # Errors
    /// [`CharacterError::PerVertex`] for another mesh, [`CharacterError::Input`] if `joints` has the wrong length or names a joint that does
    /// not exist.
    pub fn mirrored(&self, mesh: &TriMesh, mirroring: &Mirroring) -> Result<(Self, MirrorReport), CharacterError> {
        let (given, vertices) = (self.vertex_count(), mesh.vertex_count());
        CharacterError::check_per_vertex("rows of weights", given, vertices)?;
        CharacterError::check_pose(mirroring.joints.len(), self.joint_count())?;
        let in_plane = 1e-6 * mesh.diagonal();
        let height = |p: &Point3<f64>| (p - mirroring.point).dot(&mirroring.normal);
        let kept: Vec<usize> = (0..vertices).filter(|&v| height(&mesh.positions()[v]) >= -in_plane).collect();
        let tree = KdTree::new(&kept.iter().map(|&v| mesh.positions()[v]).collect::<Vec<_>>());
        let mut report = MirrorReport::default();
        let row = |(v, p): (usize, &Point3<f64>)| -> Vec<(u32, f64)> {
            let own = || self.row(v).iter().map(|i| (i.joint, i.weight));
            let image = |i: (u32, f64)| (mirroring.joints[i.0 as usize], i.1);
            let h = height(p);
            if h > in_plane {
                return own().collect();
            }
            if h >= -in_plane {
                report.evened += 1;
                return own().chain(own().map(image)).map(|(j, w)| (j, 0.5 * w)).collect();
            }
            let Some((nearest, d2)) = tree.first_nearest(&(p - mirroring.normal.into_inner() * (2.0 * h))) else {
                return own().collect();
            };
            report.changed += 1;
            report.max_deviation = report.max_deviation.max(d2.sqrt());
            self.row(kept[nearest as usize]).iter().map(|i| image((i.joint, i.weight))).collect()
        };
        let rows: Vec<_> = mesh.positions().iter().enumerate().map(row).collect();
        Ok((Self::new(self.joint_count(), rows)?, report))
    }
}

/// The mirror image of each joint by its name (see [`other_side`]); joints without a side are their own image.
///
/// # Errors
/// [`CharacterError::Input`] if a joint has a side but no counterpart.
pub fn mirror_joints_by_name(skeleton: &Skeleton) -> Result<Vec<u32>, CharacterError> {
    let number: HashMap<&str, u32> = skeleton.joints().iter().map(|j| j.name.as_str()).zip(0..).collect();
    let image = |(j, joint): (usize, &super::super::Joint)| match other_side(&joint.name) {
        None => Ok(j as u32),
        Some(name) => number.get(name.as_str()).copied().ok_or_else(|| {
            CharacterError::Input(format!("there is no joint {name:?}; did you mean {:?}?", joint.name))
        }),
    };
    skeleton.joints().iter().enumerate().map(image).collect()
}
