//! Polygons and their layers.
//!
//! A polygon is a sequence of vertex indices, of which the last is stored as its bitwise complement. A layer has values by corner, vertex
//! or polygon, or one for all, and may name them by an index.

use nalgebra::{Matrix4, Point3, Vector3};

use super::super::gltf::normal_matrix;
use super::super::or_zero;
use super::document::Document;
use super::reader::Reader;
use crate::mesh::{CornerData, MeshError, ModelBuilder, NO_VALUE};

/// Where a mesh goes, and what its faces are labeled.
pub(super) struct Placement<'a> {
    /// Model from geometry, in the coordinates of the file.
    pub(super) matrix: Matrix4<f64>,
    /// Whether faces are reversed: by the matrix or by the axes of the file, but not by both.
    pub(super) mirrored: bool,
    pub(super) group: u32,
    /// Label of each material of the node.
    pub(super) materials: &'a [u32],
}

/// What is left out of meshes.
#[derive(Clone, Copy, Default)]
pub(super) struct LeftOut {
    /// Polygons of fewer than three corners.
    pub(super) polygons: usize,
    /// Layers by edge, or of another mapping that is not known.
    pub(super) layers: usize,
    /// Vertices with colors that differ from corner to corner, of which the first is read.
    pub(super) colors: usize,
}

/// Adds a mesh to the builder; returns the number of its vertices.
pub(super) fn add(
    document: &Document<'_, '_>,
    geometry: u32,
    placement: &Placement<'_>,
    builder: &mut ModelBuilder,
    left_out: &mut LeftOut,
) -> Result<usize, MeshError> {
    let (reader, record) = (document.reader, document.object(geometry).record);
    document.open(geometry)?;
    let first = builder.positions.len();
    let count = vertices(document, geometry, placement, builder)?;
    // Layers, their values in the space of the model.
    let mut normals: Option<Layer<3>> = Layer::read(reader, record, ["LayerElementNormal", "Normals", "NormalsIndex"])?;
    let texture: Option<Layer<2>> = Layer::read(reader, record, ["LayerElementUV", "UV", "UVIndex"])?;
    let colors: Option<Layer<4>> = Layer::read(reader, record, ["LayerElementColor", "Colors", "ColorIndex"])?;
    let materials: Option<Layer<1>> = Layer::read(reader, record, ["LayerElementMaterial", "Materials", ""])?;
    let of_normals = normal_matrix(&placement.matrix);
    for normal in normals.iter_mut().flat_map(|layer| &mut layer.values) {
        let unit = (of_normals * Vector3::from(*normal)).try_normalize(0.0);
        *normal = unit.filter(|n| n.iter().all(|x| x.is_finite())).unwrap_or_else(Vector3::zeros).into();
    }
    left_out.layers +=
        [unknown(normals.as_ref()), unknown(texture.as_ref()), unknown(colors.as_ref())].iter().sum::<usize>();
    // Polygons.
    let indices = reader.integers(record, "PolygonVertexIndex")?;
    reader.limits.check("number of corners", builder.faces.corner_count() + indices.len())?;
    let [of_normal, of_texture] = [builder.normals.values.len(), builder.texture.values.len()];
    let mut painted = Paint::new(colors.is_some(), count);
    let (mut polygon, mut number): (Vec<Corner>, usize) = (Vec::new(), 0);
    for (corner, &stored) in indices.iter().enumerate() {
        let (last, vertex) = (stored < 0, if stored < 0 { !stored } else { stored } as usize);
        if vertex >= count {
            let told = format!("polygon {number} names vertex {vertex}, but there are {count}, numbered from 0");
            return Err(document.fault(geometry, told));
        }
        polygon.push(Corner { corner, vertex });
        if !last {
            continue;
        }
        if polygon.len() < 3 {
            left_out.polygons += 1;
        } else {
            if placement.mirrored {
                polygon[1..].reverse();
            }
            let material = materials.as_ref().map_or(Some(0), |layer| {
                let value = layer.index(&polygon[0], number).map(|k| layer.values[k][0]);
                value.filter(|&x| x >= 0.0).map(|x| x as usize)
            });
            let material = material.and_then(|k| placement.materials.get(k)).copied().unwrap_or(NO_VALUE);
            let vertices: Vec<u32> = polygon.iter().map(|c| (first + c.vertex) as u32).collect();
            builder.face(&vertices, placement.group, material);
            for corner in &polygon {
                push(&mut builder.normals, normals.as_ref(), of_normal, (corner, number));
                push(&mut builder.texture, texture.as_ref(), of_texture, (corner, number));
                painted.corner(colors.as_ref(), corner, number);
            }
        }
        polygon.clear();
        number += 1;
    }
    if !polygon.is_empty() {
        return Err(document.fault(geometry, "its last polygon has no end: the file is damaged"));
    }
    // Values.
    builder.normals.values.extend(normals.into_iter().flat_map(|layer| layer.values));
    builder.texture.values.extend(texture.into_iter().flat_map(|l| l.values).map(|uv| uv.map(or_zero)));
    if let Some(values) = painted.of_vertex {
        builder.colors.resize(first, [1.0; 4]);
        builder.colors.extend(values);
    }
    left_out.colors += painted.differing;
    Ok(count)
}

/// Adds the positions; returns their number.
fn vertices(
    document: &Document<'_, '_>,
    geometry: u32,
    placement: &Placement<'_>,
    builder: &mut ModelBuilder,
) -> Result<usize, MeshError> {
    let (reader, first) = (document.reader, builder.positions.len());
    let numbers = reader.reals(document.object(geometry).record, "Vertices")?;
    let (points, rest) = numbers.as_chunks::<3>();
    if !rest.is_empty() {
        return Err(document.fault(geometry, format!("{} coordinates of vertices are no triples", numbers.len())));
    }
    reader.limits.check("number of vertices", first + points.len())?;
    for (k, &xyz) in points.iter().enumerate() {
        let p = placement.matrix.transform_point(&Point3::from(xyz));
        let [x, y, z] = xyz;
        builder.vertex(p, |_| document.fault(geometry, MeshError::NotFinite { vertex: k, x, y, z }));
    }
    Ok(points.len())
}

/// A corner of a polygon: its number in the mesh, and its vertex.
struct Corner {
    corner: usize,
    vertex: usize,
}

#[derive(Clone, Copy, PartialEq)]
enum Mapping {
    Corner,
    Vertex,
    Polygon,
    All,
    Unknown,
}

/// Values of a layer.
struct Layer<const N: usize> {
    mapping: Mapping,
    values: Vec<[f64; N]>,
    /// Number of the value of each item; `None` where these are the values in order.
    index: Option<Vec<i32>>,
}

impl<const N: usize> Layer<N> {
    /// The first layer of a kind, by the names of the layer, its values and their index.
    fn read(reader: &Reader<'_>, geometry: u32, [layer, values, index]: [&str; 3]) -> Result<Option<Self>, MeshError> {
        let tree = &reader.tree;
        let Some(layer) = tree.child(Some(geometry), layer) else { return Ok(None) };
        let word = |name: &str| tree.child(Some(layer), name).and_then(|r| tree.record(r).text()).unwrap_or_default();
        let mapping = match word("MappingInformationType") {
            b"ByPolygonVertex" => Mapping::Corner,
            b"ByVertice" | b"ByVertex" | b"ByControlPoint" => Mapping::Vertex,
            b"ByPolygon" => Mapping::Polygon,
            b"AllSame" => Mapping::All,
            _ => Mapping::Unknown,
        };
        let indexed = matches!(word("ReferenceInformationType"), b"IndexToDirect" | b"Index");
        let index = if indexed && !index.is_empty() { Some(reader.integers(layer, index)?) } else { None };
        let numbers = reader.reals(layer, values)?;
        let values = numbers.as_chunks::<N>().0.to_vec();
        // An index that is missing is that of the values in order.
        Ok(Some(Self { mapping, values, index: index.filter(|index| !index.is_empty()) }))
    }

    /// The number of the value at a corner of a polygon.
    fn index(&self, corner: &Corner, polygon: usize) -> Option<usize> {
        let item = match self.mapping {
            Mapping::Corner => corner.corner,
            Mapping::Vertex => corner.vertex,
            Mapping::Polygon => polygon,
            Mapping::All => 0,
            Mapping::Unknown => return None,
        };
        let value = match &self.index {
            None => item,
            Some(index) => usize::try_from(*index.get(item)?).ok()?,
        };
        (value < self.values.len()).then_some(value)
    }
}

/// 1 for a layer of a mapping that is not read.
fn unknown<const N: usize>(layer: Option<&Layer<N>>) -> usize {
    usize::from(layer.is_some_and(|layer| layer.mapping == Mapping::Unknown))
}

/// Adds the value of a corner, where the values of the layer begin at `first` among those of the model.
fn push<const N: usize>(
    data: &mut CornerData<N>,
    layer: Option<&Layer<N>>,
    first: usize,
    (corner, polygon): (&Corner, usize),
) {
    let value = layer.and_then(|layer| layer.index(corner, polygon));
    data.of_corner.push(value.map_or(NO_VALUE, |value| (first + value) as u32));
}

/// Colors of vertices: those of their first corners.
struct Paint {
    of_vertex: Option<Vec<[f32; 4]>>,
    seen: Vec<bool>,
    differing: usize,
}

impl Paint {
    fn new(any: bool, vertices: usize) -> Self {
        let of_vertex = any.then(|| vec![[1.0; 4]; vertices]);
        Self { seen: vec![false; if any { vertices } else { 0 }], of_vertex, differing: 0 }
    }

    fn corner(&mut self, layer: Option<&Layer<4>>, corner: &Corner, polygon: usize) {
        let (Some(of_vertex), Some(layer)) = (&mut self.of_vertex, layer) else { return };
        let Some(value) = layer.index(corner, polygon) else { return };
        let color = layer.values[value].map(|x| or_zero(x) as f32);
        if std::mem::replace(&mut self.seen[corner.vertex], true) {
            self.differing += usize::from(of_vertex[corner.vertex] != color);
        } else {
            of_vertex[corner.vertex] = color;
        }
    }
}
