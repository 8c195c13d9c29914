//! Trained skin files, little-endian:
//!
//! ```text
//! "plumbline.skin\r\n"  version u32 = 2  form u32: 0 full, 1 reduced
//! vertices u64  triangles u64  fingerprint u64 of the triangles  hold f64
//! joints u64    each: length u32, name in UTF-8, parent u32 (all ones: none)
//! weights       per vertex: count u32, each: joint u32, weight f64
//! full          per triangle: own joint u32, predictor joint u32, [A a; C c] 36 f64 column-major
//! reduced       groups u64  each: own joint u32, predictor joint u32, keys u32 ≤ 8, shapes u32 ≤ 9 keys,
//!                           keys: 36 f64 column-major; predictor: shapes × 9 keys f64 column-major
//!               per triangle: group u32, then E(0) and a map per shape of the group, 9 f32 each column-major
//! ```
//!
//! A model belongs to its rest mesh and skeleton and is rejected with others. Joints are matched by name.

mod bytes;
mod parts;
#[cfg(test)]
mod tests;

use std::path::Path;

use nalgebra::{Matrix4, Point3};

use super::super::{CharacterError, RigFileError, Skeleton, SkinWeights, WeightsFile};
use super::reduced::{Parts, Reduced};
use super::surface_of_gradients::SurfaceOfGradients;
use super::training::Regressor;
use super::{BlendedPositions, RegressionModel};
use crate::mesh::TriMesh;
use bytes::{Reader, Writer, invalid};
use parts::{
    Reducing, read_joints, read_reduced, read_regressors, read_weights, write_reduced, write_regressors, write_weights,
};
use plumbline_num::document::Kind;
use plumbline_num::run::Run;

/// Magic bytes. The line ending detects transfers in text mode.
const MAGIC: &[u8; 16] = b"plumbline.skin\r\n";
/// The supported version.
const VERSION: u32 = 2;
/// Size limit: the full model of seven million triangles.
const KIND: Kind = Kind { name: "a trained skin", format: "plumbline.skin", max_bytes: 1 << 31 };
/// Missing joint index.
const NONE: u32 = u32::MAX;

/// A trained model as stored in a file.
#[derive(Clone, Debug, PartialEq)]
pub struct SkinModel {
    joints: Vec<String>,
    parents: Vec<Option<u32>>,
    vertices: usize,
    triangles: usize,
    fingerprint: u64,
    hold: f64,
    weights: SkinWeights,
    form: Form,
}

#[derive(Clone, Debug, PartialEq)]
enum Form {
    /// One regressor per triangle.
    Full(Vec<Regressor>),
    /// A few shapes per joint.
    Reduced(Reducing),
}

/// A model bound to its mesh and skeleton.
#[derive(Clone, Debug)]
pub struct TrainedSkin {
    /// Index in the skeleton of each joint of the model.
    joints: Vec<u32>,
    model: Bound,
}

#[derive(Clone, Debug)]
enum Bound {
    Full(Box<RegressionModel>),
    Reduced(Box<Reduced>),
}

impl SkinModel {
    /// A full model with its mesh and skeleton, for a file.
    ///
    /// # Errors
    /// [`CharacterError::Input`] for another skeleton, [`CharacterError::PerVertex`] for another mesh.
    pub fn of(mesh: &TriMesh, skeleton: &Skeleton, model: &RegressionModel) -> Result<Self, CharacterError> {
        let form = Form::Full(model.regressors.clone());
        Self::new(mesh, skeleton, &model.blend.weights, model.hold, form)
    }

    /// A reduced model with its mesh and skeleton, for a file.
    ///
    /// # Errors
    /// As [`Self::of`].
    pub fn of_reduced(mesh: &TriMesh, skeleton: &Skeleton, model: &Reduced) -> Result<Self, CharacterError> {
        let parts = &model.parts;
        let form = Form::Reduced((parts.groups.clone(), parts.group_of.clone(), parts.maps.clone()));
        Self::new(mesh, skeleton, &parts.weights, parts.hold, form)
    }

    fn new(
        mesh: &TriMesh,
        skeleton: &Skeleton,
        weights: &SkinWeights,
        hold: f64,
        form: Form,
    ) -> Result<Self, CharacterError> {
        let (joints, vertices) = (skeleton.joint_count(), mesh.vertex_count());
        CharacterError::check_matrices(weights.joint_count(), joints)?;
        CharacterError::check_per_vertex("rows of weights", weights.vertex_count(), vertices)?;
        Ok(Self {
            joints: skeleton.joints().iter().map(|j| j.name.clone()).collect(),
            parents: super::parents_of(skeleton),
            vertices,
            triangles: mesh.triangle_count(),
            fingerprint: fingerprint(mesh),
            hold,
            weights: weights.clone(),
            form,
        })
    }

    /// Whether it is a reduced model.
    pub fn is_reduced(&self) -> bool {
        matches!(self.form, Form::Reduced(_))
    }

    /// Names of the joints.
    pub fn joints(&self) -> &[String] {
        &self.joints
    }

    /// The weights that fit the examples best, by the names of the joints.
    pub fn weights(&self) -> WeightsFile {
        WeightsFile { joints: self.joints.clone(), weights: self.weights.clone() }
    }

    /// Reads a file.
    ///
    /// # Errors
    /// What [`Self::from_bytes`] refuses; [`RigFileError::Document`].
    pub fn read(path: &Path) -> Result<Self, RigFileError> {
        Self::from_bytes(&KIND.bytes(path)?)
    }

    /// Parses the content of a file.
    ///
    /// # Errors
    /// [`RigFileError`]: wrong magic bytes or version, truncated or trailing data, invalid numbers, weights that do not sum to one.
    pub fn from_bytes(content: &[u8]) -> Result<Self, RigFileError> {
        let refused = |fault: String| RigFileError::Content(fault);
        let foreign = || refused("not a trained skin (expected a file that `plumbline skin train` wrote)".to_owned());
        let rest = content.strip_prefix(MAGIC).ok_or_else(foreign)?;
        let mut r = Reader::new(rest);
        let head = &|| "the head".to_owned();
        let version = r.u32(head)?;
        if version != VERSION {
            let expected = format!("(expected {VERSION}): train it again");
            return Err(refused(format!("version {version} of a trained skin is not supported {expected}")));
        }
        let form = r.index(2, &|| "the form".to_owned())?;
        // Least sizes: a vertex has a weight count, a triangle two indices.
        let vertices = r.count(4, &|| "the weights".to_owned())?;
        let triangles = r.count(8, &|| "the triangles".to_owned())?;
        let fingerprint = r.u64(head)?;
        let hold = r.f64(&|| "the hold".to_owned())?;
        if !(hold > 0.0) {
            return Err(invalid("the hold", hold, "above 0"));
        }
        let (joints, parents) = read_joints(&mut r)?;
        let weights = read_weights(&mut r, vertices, joints.len())?;
        let form = if form == 0 {
            Form::Full(read_regressors(&mut r, triangles, joints.len())?)
        } else {
            Form::Reduced(read_reduced(&mut r, triangles, joints.len())?)
        };
        r.end()?;
        Ok(Self { joints, parents, vertices, triangles, fingerprint, hold, weights, form })
    }

    /// The content of a file; [`Self::from_bytes`] restores it bit for bit.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut w = Writer { bytes: MAGIC.to_vec() };
        w.u32(VERSION);
        w.u32(u32::from(self.is_reduced()));
        w.u64(self.vertices as u64);
        w.u64(self.triangles as u64);
        w.u64(self.fingerprint);
        w.f64(self.hold);
        w.u64(self.joints.len() as u64);
        for (name, parent) in self.joints.iter().zip(&self.parents) {
            w.u32(name.len() as u32);
            w.bytes.extend(name.as_bytes());
            w.u32(parent.unwrap_or(NONE));
        }
        write_weights(&mut w, &self.weights);
        match &self.form {
            Form::Full(regressors) => write_regressors(&mut w, regressors),
            Form::Reduced(reducing) => write_reduced(&mut w, reducing),
        }
        w.bytes
    }

    /// Binds the model to a mesh and a skeleton, which may have more joints in another order.
    ///
    /// # Errors
    /// [`RigFileError::Content`] for another mesh than the training mesh or another hierarchy of joints; [`CharacterError::Input`] for a joint
    /// that the skeleton does not have; [`CharacterError::Solve`].
    pub fn bound(&self, mesh: &TriMesh, skeleton: &Skeleton, run: &Run) -> Result<TrainedSkin, RigFileError> {
        let joints = self.check(mesh, skeleton)?;
        let (weights, parents, hold) = (self.weights.clone(), self.parents.clone(), self.hold);
        let model = match &self.form {
            Form::Full(regressors) => Bound::Full(Box::new(RegressionModel {
                regressors: regressors.clone(),
                surface: SurfaceOfGradients::new(mesh, hold, run)?,
                blend: BlendedPositions { rest: mesh.positions().to_vec(), weights },
                parents,
                hold,
            })),
            Form::Reduced(reducing) => {
                let (groups, group_of, maps) = reducing.clone();
                let parts = Parts { groups, group_of, maps, weights, parents, hold };
                Bound::Reduced(Box::new(Reduced::of_parts(mesh, parts, run)?))
            }
        };
        Ok(TrainedSkin { joints, model })
    }

    /// Checks the mesh and the skeleton against those of the training; returns the skeleton indices of the model's joints.
    ///
    /// # Errors
    /// As [`Self::bound`].
    pub fn check(&self, mesh: &TriMesh, skeleton: &Skeleton) -> Result<Vec<u32>, RigFileError> {
        self.check_mesh(mesh)?;
        let joints = self.joints.iter().map(|n| skeleton.named(n)).collect::<Result<Vec<u32>, _>>()?;
        self.check_parents(skeleton, &joints)?;
        Ok(joints)
    }

    fn check_mesh(&self, mesh: &TriMesh) -> Result<(), RigFileError> {
        let (vertices, triangles) = (mesh.vertex_count(), mesh.triangle_count());
        let difference = if (vertices, triangles) != (self.vertices, self.triangles) {
            let model = format!("the model has {} vertices and {} triangles", self.vertices, self.triangles);
            format!("{model}, the mesh has {vertices} and {triangles}")
        } else if fingerprint(mesh) != self.fingerprint {
            "the triangles of the mesh differ from those of the training mesh".to_owned()
        } else {
            return Ok(());
        };
        Err(RigFileError::Content(format!("{difference}; give the rest mesh that the model was trained on")))
    }

    fn check_parents(&self, skeleton: &Skeleton, joints: &[u32]) -> Result<(), RigFileError> {
        let quoted = |name: Option<&str>| name.map_or_else(|| "none".to_owned(), |n| format!("{n:?}"));
        for (j, &number) in joints.iter().enumerate() {
            let expected = self.parents[j].map(|p| self.joints[p as usize].as_str());
            let found = skeleton.joints()[number as usize].parent.map(|p| skeleton.joints()[p as usize].name.as_str());
            if expected != found {
                let (joint, expected, found) = (&self.joints[j], quoted(expected), quoted(found));
                let parents =
                    format!("the parent of joint {joint:?} is {expected} in the model and {found} in the skeleton");
                return Err(RigFileError::Content(format!("{parents}; give the skeleton that it was trained with")));
            }
        }
        Ok(())
    }
}

impl TrainedSkin {
    /// Replaces the rest surface, as morph targets do; the learned rotations and stretches apply to its triangles. A reduced model solves for
    /// all its shapes again.
    ///
    /// # Errors
    /// [`CharacterError::PerVertex`] for another number of vertices.
    pub fn set_rest(&mut self, rest: &[Point3<f64>], run: &Run) -> Result<(), CharacterError> {
        match &mut self.model {
            Bound::Full(model) => model.set_rest(rest),
            Bound::Reduced(model) => model.set_rest(rest, run),
        }
    }

    /// The surface for the skin matrices of a pose of the skeleton.
    ///
    /// # Errors
    /// [`CharacterError::Input`] for fewer matrices than the skeleton has joints or an invalid matrix.
    pub fn positions(&mut self, matrices: &[Matrix4<f64>]) -> Result<Vec<Point3<f64>>, CharacterError> {
        let mine = self.joints.iter().map(|&j| matrices.get(j as usize).copied()).collect::<Option<Vec<_>>>();
        let needed = self.joints.iter().max().map_or(0, |j| *j as usize + 1);
        let mine = mine.ok_or_else(|| CharacterError::wrong_matrices(needed, matrices.len()))?;
        match &mut self.model {
            Bound::Full(model) => model.positions(&mine),
            Bound::Reduced(model) => model.positions(&mine),
        }
    }
}

/// FNV-1a hash of the triangles, 64 bit: detects another mesh by accident, not by intent.
fn fingerprint(mesh: &TriMesh) -> u64 {
    let bytes = mesh.triangles().iter().flatten().flat_map(|v| v.to_le_bytes());
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, b| (hash ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3))
}
