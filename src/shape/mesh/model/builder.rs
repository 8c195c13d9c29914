//! Builder of a [`Model`]: readers fill in the contents of a file, [`ModelBuilder::finish`] validates and triangulates.

use std::collections::HashMap;
use std::sync::Arc;

use nalgebra::Point3;

use super::articulation::Articulation;
use super::mending::mend;
use super::{CornerData, Faces, GltfAssets, Group, Labels, Material, Model, NO_VALUE};
use crate::mesh::tri_mesh::is_finite;
use crate::mesh::{MeshError, TriMesh};

/// Maximum sum of the lengths of all group names, bytes: a hundred thousand long names.
const MAX_GROUP_BYTES: usize = 32 << 20;

/// Builder of a [`Model`].
#[derive(Clone, Debug, Default)]
pub struct ModelBuilder {
    /// Positions of the vertices.
    pub positions: Vec<Point3<f64>>,
    /// Polygons of at least three corners.
    pub faces: Faces,
    /// Texture coordinates; none if `values` is empty.
    pub texture: CornerData<2>,
    /// Normals; none if `values` is empty.
    pub normals: CornerData<3>,
    /// Vertex colors; none if empty.
    pub colors: Vec<[f32; 4]>,
    /// Named parts.
    pub groups: Labels<Group>,
    /// Materials.
    pub materials: Labels<Material>,
    /// Names of material libraries.
    pub material_files: Vec<String>,
    /// Textures, samplers and images of the materials.
    pub assets: Option<GltfAssets>,
    /// Nodes, skins, morph targets and animations.
    pub articulation: Option<Articulation>,
    /// Contents of the file that are ignored, in words.
    pub warnings: Vec<String>,
    /// Index of each group in `groups`.
    group_numbers: HashMap<Group, u32>,
    /// Bytes of the names of all groups.
    group_bytes: usize,
    /// The fault of the first vertex that is not finite.
    not_finite: Option<MeshError>,
    /// Index of each material name in `materials`.
    material_numbers: HashMap<String, u32>,
}

impl ModelBuilder {
    /// Adds a vertex. One that is not finite is a fault, as the reader tells it, unless it is mended.
    pub(crate) fn vertex(&mut self, position: Point3<f64>, fault: impl FnOnce(MeshError) -> MeshError) {
        if self.not_finite.is_none() && !is_finite(&position) {
            let ([x, y, z], vertex) = (position.coords.into(), self.positions.len());
            self.not_finite = Some(fault(MeshError::NotFinite { vertex, x, y, z }));
        }
        self.positions.push(position);
    }

    /// Mends vertices that are not finite, as far as there is a finite one, and adds a warning.
    pub(crate) fn mend_vertices(&mut self) {
        if self.not_finite.is_none() {
            return;
        }
        let Some((first, count)) = mend(&mut self.positions, &self.faces) else { return };
        self.not_finite = None;
        self.warnings.push(format!(
            "vertices with coordinates that are not finite are set to the mean of their neighbors: {count}, the first of them {first} \
             (numbered from 0)"
        ));
    }

    /// Index of a group, added if it is new.
    ///
    /// # Errors
    /// [`MeshError::TooLarge`] for names that take too much memory: each group has a copy of the name of its object.
    pub fn group(&mut self, group: Group) -> Result<u32, MeshError> {
        if let Some(&known) = self.group_numbers.get(&group) {
            return Ok(known);
        }
        self.group_bytes += group.object.len() + group.name.len();
        if self.group_bytes > MAX_GROUP_BYTES {
            let (what, limit) = ("number of bytes in the names of all groups", MAX_GROUP_BYTES as u64);
            return Err(MeshError::TooLarge { what, value: self.group_bytes as u64, limit });
        }
        let number = self.groups.all.len() as u32;
        self.groups.all.push(group.clone());
        self.group_numbers.insert(group, number);
        Ok(number)
    }

    /// Index of the material with this name, added if it is new.
    pub fn material(&mut self, name: &str) -> u32 {
        let all = &mut self.materials.all;
        *self.material_numbers.entry(name.to_owned()).or_insert_with(|| {
            all.push(Material { name: name.to_owned(), gltf: None });
            all.len() as u32 - 1
        })
    }

    /// Adds a polygon with its group and material labels; [`NO_VALUE`] for none.
    pub fn face(&mut self, vertices: &[u32], group: u32, material: u32) {
        self.faces.push(vertices);
        self.groups.of_face.push(group);
        self.materials.of_face.push(material);
    }

    /// Validates the contents, triangulates the polygons and drops unused labels.
    ///
    /// # Errors
    /// That of a vertex that is not finite, those of [`TriMesh::new`] and of [`Model::with_articulation`], [`MeshError::TooLarge`] for more
    /// corners than a 32-bit index can address.
    pub fn finish(mut self) -> Result<Model, MeshError> {
        if let Some(fault) = self.not_finite {
            return Err(fault);
        }
        // Validation: corner indices below the null index, vertex indices in range.
        let corners = self.faces.corner_count();
        if corners >= NO_VALUE as usize {
            let (value, limit) = (corners as u64, u64::from(NO_VALUE) - 1);
            return Err(MeshError::TooLarge { what: "number of corners", value, limit });
        }
        let vertices = self.positions.len();
        if let Some((triangle, vertex)) = first_beyond(&self.faces, vertices) {
            return Err(MeshError::NoSuchVertex { triangle, vertex, vertices });
        }
        // Triangulation.
        let (triangle_corners, face_of_triangle) = self.faces.triangulate(&self.positions);
        let vertex = |corner: u32| self.faces.vertices()[corner as usize];
        let triangles = triangle_corners.iter().map(|t| t.map(vertex)).collect();
        // One color per vertex: vertices after the last colored one are opaque white.
        self.colors.truncate(vertices);
        if !self.colors.is_empty() {
            self.colors.resize(vertices, [1.0; 4]);
        }
        if let Some(articulation) = &self.articulation {
            articulation.check(vertices, &self.faces)?;
        }
        Ok(Model {
            articulation: self.articulation.map(Arc::new),
            mesh: TriMesh::new(self.positions, triangles)?,
            triangle_corners,
            face_of_triangle,
            texture: filled(self.texture, corners),
            normals: filled(self.normals, corners),
            colors: (!self.colors.is_empty()).then_some(self.colors),
            groups: used(self.groups),
            materials: used(self.materials),
            material_files: self.material_files,
            assets: self.assets.map(Arc::new),
            warnings: self.warnings,
            faces: self.faces,
        })
    }
}

/// The first face with a vertex index out of range, and that index.
fn first_beyond(faces: &Faces, vertices: usize) -> Option<(usize, u32)> {
    let beyond = |face: &[u32]| face.iter().copied().find(|&v| v as usize >= vertices);
    faces.iter().enumerate().find_map(|(face, corners)| Some((face, beyond(corners)?)))
}

/// The attribute padded to `corners` corners, with indices out of range replaced by [`NO_VALUE`]; `None` if no corner has a
/// value.
fn filled<const N: usize>(mut data: CornerData<N>, corners: usize) -> Option<CornerData<N>> {
    let count = data.values.len();
    data.of_corner.resize(corners, NO_VALUE);
    data.of_corner.iter_mut().filter(|value| **value as usize >= count).for_each(|value| *value = NO_VALUE);
    data.of_corner.iter().any(|&value| value != NO_VALUE).then_some(data)
}

/// The labels without unused ones, renumbered in the order of the file.
fn used<T>(labels: Labels<T>) -> Labels<T> {
    let mut number = vec![NO_VALUE; labels.all.len()];
    for &label in labels.of_face.iter().filter(|&&label| label != NO_VALUE) {
        number[label as usize] = 0;
    }
    for (next, number) in (0..).zip(number.iter_mut().filter(|number| **number == 0)) {
        *number = next;
    }
    let mut numbers = number.iter();
    let mut all = labels.all;
    all.retain(|_| numbers.next().is_some_and(|&n| n != NO_VALUE));
    let renumbered = |label: u32| number.get(label as usize).copied().unwrap_or(NO_VALUE);
    let of_face = if all.is_empty() { Vec::new() } else { labels.of_face.into_iter().map(renumbered).collect() };
    Labels { all, of_face }
}
