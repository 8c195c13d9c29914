//! Content of a mesh file: polygons and their attributes.
//!
//! A [`TriMesh`] has the positions and the triangles. The [`Model`] adds the polygons that were triangulated, per-corner
//! texture coordinates and normals, per-vertex colors, and per-face groups and materials, so that a deformed mesh can be
//! written with the attributes of the original file. Units and axes are those of the file.

pub mod articulation;
mod builder;
mod coordinates;
mod corner_data;
mod faces;
mod mending;
mod normals;

use std::sync::Arc;

use nalgebra::Point3;
use serde_json::Value;

use super::{MeshError, Repaired, TriMesh};
use articulation::Articulation;

pub use builder::ModelBuilder;
pub use coordinates::{Axis, CoordinateChange, LengthUnit};
pub(in crate::mesh) use coordinates::{all_finite, articulated};
pub use corner_data::{CornerData, NO_VALUE};
pub use faces::Faces;

/// Content of a mesh file: triangle mesh, polygons and attributes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    mesh: TriMesh,
    faces: Faces,
    triangle_corners: Vec<[u32; 3]>,
    face_of_triangle: Vec<u32>,
    texture: Option<CornerData<2>>,
    normals: Option<CornerData<3>>,
    colors: Option<Vec<[f32; 4]>>,
    groups: Labels<Group>,
    materials: Labels<Material>,
    material_files: Vec<String>,
    assets: Option<Arc<GltfAssets>>,
    articulation: Option<Arc<Articulation>>,
    warnings: Vec<String>,
}

/// Per-face labels, indexed.
#[derive(Clone, Debug, PartialEq)]
pub struct Labels<T> {
    /// The labels, in the order of the file.
    pub all: Vec<T>,
    /// Label index of each face; [`NO_VALUE`] for none. Empty if no face has a label.
    pub of_face: Vec<u32>,
}

impl<T> Default for Labels<T> {
    fn default() -> Self {
        Self { all: Vec::new(), of_face: Vec::new() }
    }
}

impl<T> Labels<T> {
    /// The label of a face.
    pub fn get(&self, face: usize) -> Option<&T> {
        self.all.get(*self.of_face.get(face)? as usize)
    }
}

/// A named part of the surface.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Group {
    /// The object of the group (`o` of OBJ, node of glTF, solid of STL); empty without one.
    pub object: String,
    /// The group in it (`g` of OBJ); empty without one.
    pub name: String,
}

/// A surface material.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Material {
    /// Its name.
    pub name: String,
    /// The material object of a glTF file, unparsed; refers to [`GltfAssets`].
    pub gltf: Option<Value>,
}

/// Textures, samplers and images of the materials of a glTF file, passed through unparsed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GltfAssets {
    /// `textures`.
    pub textures: Vec<Value>,
    /// `samplers`.
    pub samplers: Vec<Value>,
    /// `images`, without their buffer views.
    pub images: Vec<Value>,
    /// Bytes of the images stored in a buffer.
    pub image_bytes: Vec<Option<Vec<u8>>>,
    /// `extensionsUsed` that concern materials and textures.
    pub extensions: Vec<String>,
}

impl Model {
    /// A model of a triangle mesh without attributes.
    pub fn of_mesh(mesh: TriMesh) -> Self {
        let mut faces = Faces::default();
        for triangle in mesh.triangles() {
            faces.push(triangle);
        }
        let triangles = mesh.triangle_count() as u32;
        let triangle_corners = (0..triangles).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        Self { mesh, faces, triangle_corners, face_of_triangle: (0..triangles).collect(), ..Self::default() }
    }

    /// Positions and triangles.
    pub fn mesh(&self) -> &TriMesh {
        &self.mesh
    }

    /// The polygons of the file, before triangulation.
    pub fn faces(&self) -> &Faces {
        &self.faces
    }

    /// Whether another model has as many vertices and the same polygons: both are poses of one mesh, although their polygons may be cut
    /// into other triangles.
    pub fn has_faces_of(&self, other: &Self) -> bool {
        self.mesh.vertex_count() == other.mesh.vertex_count() && self.faces == other.faces
    }

    /// Index of the polygon of each triangle.
    pub fn face_of_triangle(&self) -> &[u32] {
        &self.face_of_triangle
    }

    /// The three corners of [`Self::faces`] of each triangle.
    pub fn triangle_corners(&self) -> &[[u32; 3]] {
        &self.triangle_corners
    }

    /// Texture coordinates, with v increasing upwards as in OBJ.
    pub fn texture(&self) -> Option<&CornerData<2>> {
        self.texture.as_ref()
    }

    /// Normals.
    pub fn normals(&self) -> Option<&CornerData<3>> {
        self.normals.as_ref()
    }

    /// Vertex colors: red, green, blue, opacity, 0 to 1, in the color space of the file.
    pub fn colors(&self) -> Option<&[[f32; 4]]> {
        self.colors.as_deref()
    }

    /// Named parts.
    pub fn groups(&self) -> &Labels<Group> {
        &self.groups
    }

    /// Materials.
    pub fn materials(&self) -> &Labels<Material> {
        &self.materials
    }

    /// Names of material libraries (`mtllib`).
    pub fn material_files(&self) -> &[String] {
        &self.material_files
    }

    /// Textures, samplers and images of the materials of a glTF file.
    pub fn assets(&self) -> Option<&GltfAssets> {
        self.assets.as_deref()
    }

    /// Nodes, skins, morph targets and animations, if the file has them.
    pub fn articulation(&self) -> Option<&Articulation> {
        self.articulation.as_deref()
    }

    /// The model with its nodes, skins, morph targets and animations replaced.
    ///
    /// # Errors
    /// [`MeshError::Articulation`] for an index out of range, or a face that joins two instances.
    pub fn with_articulation(mut self, articulation: Option<Articulation>) -> Result<Self, MeshError> {
        if let Some(articulation) = &articulation {
            articulation.check(self.mesh.vertex_count(), &self.faces)?;
        }
        self.articulation = articulation.map(Arc::new);
        Ok(self)
    }

    /// Contents of the file that were ignored or modified on reading, in words.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The model with new vertex positions, those of the bind pose where it is skinned. Normals are recomputed; faces with a
    /// common normal at a vertex keep a common one, so that hard edges stay hard.
    ///
    /// # Errors
    /// [`MeshError::NotFinite`] for a NaN or infinite coordinate.
    ///
    /// # Panics
    /// If the number of positions differs from the number of vertices.
    pub fn with_positions(&self, positions: Vec<Point3<f64>>) -> Result<Self, MeshError> {
        let mesh = self.mesh.with_positions(positions)?;
        let normals =
            self.normals.as_ref().map(|old| normals::moved(old, &self.faces, self.mesh.positions(), mesh.positions()));
        Ok(Self { mesh, normals, ..self.clone() })
    }

    /// The model of a repaired mesh: its triangles with the attributes of their source corners. The polygons are not restored.
    #[must_use]
    pub fn repaired(&self, repaired: &Repaired) -> Self {
        // Source corner and source face of each triangle of the result.
        let corners: Vec<u32> = repaired
            .source_corners
            .iter()
            .flatten()
            .map(|&corner| self.triangle_corners[corner as usize / 3][corner as usize % 3])
            .collect();
        let source_face = |t: &[u32; 3]| self.face_of_triangle[t[0] as usize / 3];
        let faces: Vec<u32> = repaired.source_corners.iter().map(source_face).collect();
        let relabelled = |of_face: &[u32]| {
            // Either every face has a label or none.
            faces.iter().filter_map(|&face| of_face.get(face as usize).copied()).collect()
        };
        let kept = |colors: &Vec<[f32; 4]>| repaired.source_of_vertex.iter().map(|&v| colors[v as usize]).collect();
        // Normals: recomputed, because vertices may be welded or split, and on the side of the repaired orientation.
        let base = Self::of_mesh(repaired.mesh.clone());
        let normals = self.normals.as_ref().map(|normals| normals.of(&corners));
        let normals = normals.map(|old| {
            let p = repaired.mesh.positions();
            normals::facing_as_faces(normals::moved(&old, &base.faces, p, p), &base.faces, p)
        });
        // Articulation: restricted to the remaining vertices; dropped where welding joined parts that move differently.
        let moving = self.articulation().map(|all| all.of(&repaired.source_of_vertex, &base.faces));
        let mut warnings = base.warnings;
        if moving == Some(None) {
            warnings.push(
                "skins, morph targets and animations are left out: repair joined parts that move in different ways \
                 (repair without welding keeps them)"
                    .to_owned(),
            );
        }
        Self {
            articulation: moving.flatten().map(Arc::new),
            warnings,
            texture: self.texture.as_ref().map(|texture| texture.of(&corners)),
            normals,
            colors: self.colors.as_ref().map(kept),
            groups: Labels { all: self.groups.all.clone(), of_face: relabelled(&self.groups.of_face) },
            materials: Labels { all: self.materials.all.clone(), of_face: relabelled(&self.materials.of_face) },
            material_files: self.material_files.clone(),
            assets: self.assets.clone(),
            ..base
        }
    }
}
