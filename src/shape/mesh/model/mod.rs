//! Content of a mesh file: polygons and their attributes.
//!
//! Positions and triangles stand in a [`TriMesh`]; the polygons that the triangles were cut from, texture coordinates and normals
//! per corner, colors per vertex, groups and materials per face stand beside it, so that a deformation of the triangles can be
//! written back as the file it came from. Units and axes are the file's own.

pub mod articulation;
mod builder;
mod corner_data;
mod faces;
mod normals;

use std::sync::Arc;

use nalgebra::Point3;
use serde_json::Value;

use super::{MeshError, Repaired, TriMesh};
use articulation::Articulation;

pub use builder::ModelBuilder;
pub use corner_data::{CornerData, NO_VALUE};
pub use faces::Faces;

/// Content of a mesh file.
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

/// Labels and which of them each face has.
#[derive(Clone, Debug, PartialEq)]
pub struct Labels<T> {
    /// The labels, in the order of the file.
    pub all: Vec<T>,
    /// Label of each face; [`NO_VALUE`] if it has none. Empty if no face has one.
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

/// How a part of the surface looks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Material {
    /// Its name.
    pub name: String,
    /// The whole material of a glTF file, which refers to [`GltfAssets`].
    pub gltf: Option<Value>,
}

/// What the materials of a glTF file refer to, carried along unread.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GltfAssets {
    /// `textures`.
    pub textures: Vec<Value>,
    /// `samplers`.
    pub samplers: Vec<Value>,
    /// `images`, without their buffer views.
    pub images: Vec<Value>,
    /// Bytes of the images that stood in a buffer.
    pub image_bytes: Vec<Option<Vec<u8>>>,
    /// `extensionsUsed` that concern materials and textures.
    pub extensions: Vec<String>,
}

impl Model {
    /// A model of triangles alone.
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

    /// The polygons as they stood in the file.
    pub fn faces(&self) -> &Faces {
        &self.faces
    }

    /// For each triangle the polygon it was cut from.
    pub fn face_of_triangle(&self) -> &[u32] {
        &self.face_of_triangle
    }

    /// For each triangle the corners of [`Self::faces`] it was made of.
    pub fn triangle_corners(&self) -> &[[u32; 3]] {
        &self.triangle_corners
    }

    /// Texture coordinates; v grows upwards, as in OBJ.
    pub fn texture(&self) -> Option<&CornerData<2>> {
        self.texture.as_ref()
    }

    /// Normals.
    pub fn normals(&self) -> Option<&CornerData<3>> {
        self.normals.as_ref()
    }

    /// Colors of the vertices: red, green, blue, opacity, 0 to 1, as they stood in the file.
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

    /// What the materials of a glTF file refer to.
    pub fn assets(&self) -> Option<&GltfAssets> {
        self.assets.as_deref()
    }

    /// Nodes, skins, morph targets and animations, if the file has them.
    pub fn articulation(&self) -> Option<&Articulation> {
        self.articulation.as_deref()
    }

    /// The model with how it moves replaced.
    ///
    /// # Errors
    /// [`MeshError::Articulation`] for an index out of range, or a face in two instances.
    pub fn with_articulation(mut self, articulation: Option<Articulation>) -> Result<Self, MeshError> {
        if let Some(articulation) = &articulation {
            articulation.check(self.mesh.vertex_count(), &self.faces)?;
        }
        self.articulation = articulation.map(Arc::new);
        Ok(self)
    }

    /// What in the file was left out or taken otherwise than it stood.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The same model over other positions, one per vertex: of the bind pose where it is skinned. Normals are made anew; where faces shared one before they do again,
    /// so that hard edges stay hard.
    ///
    /// # Errors
    /// [`MeshError::NotFinite`].
    ///
    /// # Panics
    /// Where the number of positions differs.
    pub fn with_positions(&self, positions: Vec<Point3<f64>>) -> Result<Self, MeshError> {
        let mesh = self.mesh.with_positions(positions)?;
        let normals =
            self.normals.as_ref().map(|old| normals::moved(old, &self.faces, self.mesh.positions(), mesh.positions()));
        Ok(Self { mesh, normals, ..self.clone() })
    }

    /// The model with its colors replaced, one per vertex.
    ///
    /// # Panics
    /// Where the number of colors differs from the number of vertices.
    #[must_use]
    pub fn with_colors(mut self, colors: Vec<[f32; 4]>) -> Self {
        assert_eq!(colors.len(), self.mesh.vertex_count(), "one color per vertex");
        self.colors = Some(colors);
        self
    }

    /// What is left of the model after `repaired` was made of its mesh: triangles, with what lay on their corners.
    #[must_use]
    pub fn repaired(&self, repaired: &Repaired) -> Self {
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
        let base = Self::of_mesh(repaired.mesh.clone());
        let normals = self.normals.as_ref().map(|normals| normals.of(&corners));
        let normals = normals.map(|old| {
            let p = repaired.mesh.positions();
            normals::facing_as_faces(normals::moved(&old, &base.faces, p, p), &base.faces, p)
        });
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
