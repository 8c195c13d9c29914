//! Weights of one half carried over to the other.

use std::collections::HashMap;

use nalgebra::{Point3, Unit, Vector3};

use super::super::{CharacterError, Skeleton, SkinWeights};
use crate::mesh::TriMesh;
use plumbline_num::spatial::KdTree;

/// A plane, and which joint is whose image in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Mirroring {
    /// A point of the plane.
    pub point: Point3<f64>,
    /// Its normal: it points to the half that is kept.
    pub normal: Unit<Vector3<f64>>,
    /// The image of each joint; its own for those in the plane.
    pub joints: Vec<u32>,
}

/// What mirroring found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MirrorReport {
    /// Vertices that took the weights of their image.
    pub changed: usize,
    /// Vertices in the plane, whose weights were made even.
    pub evened: usize,
    /// The farthest that any vertex is from the place of its image, units of the model.
    pub farthest: f64,
}

impl SkinWeights {
    /// Vertices behind the plane take the weights of the nearest vertex to their image; those in it, the mean of their own and
    /// their own mirrored.
    ///
    /// # Errors
    /// [`CharacterError::PerVertex`] for another mesh, [`CharacterError::Pose`] where `joints` has another number, and
    /// [`CharacterError::NoSuchJoint`].
    pub fn mirrored(&self, mesh: &TriMesh, mirroring: &Mirroring) -> Result<(Self, MirrorReport), CharacterError> {
        let (given, vertices) = (self.vertex_count(), mesh.vertex_count());
        if given != vertices {
            return Err(CharacterError::PerVertex { what: "rows of weights", given, vertices });
        }
        if mirroring.joints.len() != self.joint_count() {
            return Err(CharacterError::Pose { given: mirroring.joints.len(), joints: self.joint_count() });
        }
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
            report.farthest = report.farthest.max(d2.sqrt());
            self.row(kept[nearest as usize]).iter().map(|i| image((i.joint, i.weight))).collect()
        };
        let rows: Vec<_> = mesh.positions().iter().enumerate().map(row).collect();
        Ok((Self::new(self.joint_count(), rows)?, report))
    }
}

/// The image of each joint by its name: `l_` for `r_`, `Left` for `Right`, `.L` for `.R` and so on; its own where it has no side.
///
/// # Errors
/// [`CharacterError::UnknownJoint`] where a joint has a side and no counterpart.
pub fn mirror_joints_by_name(skeleton: &Skeleton) -> Result<Vec<u32>, CharacterError> {
    let number: HashMap<&str, u32> = skeleton.joints().iter().map(|j| j.name.as_str()).zip(0..).collect();
    let image = |(j, joint): (usize, &super::super::Joint)| match other_side(&joint.name) {
        None => Ok(j as u32),
        Some(name) => match number.get(name.as_str()) {
            Some(&k) => Ok(k),
            None => Err(CharacterError::UnknownJoint { name, nearest: Some(joint.name.clone()) }),
        },
    };
    skeleton.joints().iter().enumerate().map(image).collect()
}

/// Words that name a side, as they stand at the start or the end of a name.
const SIDES: [(&str, &str); 12] = [
    ("left", "right"),
    ("Left", "Right"),
    ("LEFT", "RIGHT"),
    ("l_", "r_"),
    ("L_", "R_"),
    ("l.", "r."),
    ("_l", "_r"),
    ("_L", "_R"),
    (".l", ".r"),
    (".L", ".R"),
    ("-l", "-r"),
    ("-L", "-R"),
];

/// The name of the counterpart; `None` for a name without a side.
fn other_side(name: &str) -> Option<String> {
    let swapped = |a: &str, b: &str| {
        let start = name.strip_prefix(a).filter(|_| !a.starts_with(['_', '.', '-']));
        let end = name.strip_suffix(a).filter(|_| !a.ends_with(['_', '.']));
        start.map(|rest| format!("{b}{rest}")).or_else(|| end.map(|rest| format!("{rest}{b}")))
    };
    SIDES.iter().find_map(|(l, r)| swapped(l, r).or_else(|| swapped(r, l)))
}
