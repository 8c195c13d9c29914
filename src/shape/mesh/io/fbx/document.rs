//! Objects of a file, and the connections between them.

use std::collections::HashMap;

use nalgebra::Matrix4;

use super::binary::{Record, Value};
use super::fault;
use super::reader::Reader;
use crate::mesh::MeshError;

/// Kinds of objects that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Model,
    Mesh,
    Shape,
    /// Geometry that has no polygons.
    OtherGeometry,
    Material,
    Texture,
    Skin,
    Cluster,
    BlendShape,
    BlendShapeChannel,
    AnimationStack,
    AnimationLayer,
    CurveNode,
    Curve,
}

/// An object.
pub(super) struct Object<'a> {
    pub(super) kind: Kind,
    pub(super) record: u32,
    name: &'a [u8],
}

/// A connection, from the object that it leads to.
#[derive(Clone, Copy)]
pub(super) struct Link<'a> {
    /// Index of the connected object.
    pub(super) object: u32,
    /// The property that is connected; empty for the object itself.
    pub(super) property: &'a [u8],
}

/// Objects and connections.
pub(super) struct Document<'r, 'a> {
    pub(super) reader: &'r Reader<'a>,
    pub(super) objects: Vec<Object<'a>>,
    by_id: HashMap<i64, u32>,
    /// Connections by the object that they lead to, in the order of the file: first of each object, then all.
    starts: Vec<u32>,
    links: Vec<Link<'a>>,
}

/// Separates the name of an object from its class.
const CLASS: &[u8] = b"\0\x01";

impl<'r, 'a> Document<'r, 'a> {
    /// The objects and connections of the file.
    pub(super) fn of(reader: &'r Reader<'a>) -> Result<Self, MeshError> {
        let tree = &reader.tree;
        let (mut objects, mut by_id) = (Vec::new(), HashMap::new());
        let all =
            tree.children(None).filter(|&r| tree.record(r).name == b"Objects").flat_map(|r| tree.children(Some(r)));
        for record in all {
            reader.run.check()?;
            let stored = tree.record(record);
            let subtype = stored.value(2).and_then(Value::text).unwrap_or_default();
            let Some(kind) = kind(stored.name, subtype) else { continue };
            let id = stored.value(0).and_then(Value::integer);
            let id = id.ok_or_else(|| fault(stored.at, format!("{} without a number", shown(stored.name))))?;
            if by_id.insert(id, objects.len() as u32).is_some() {
                return Err(fault(stored.at, format!("a second object of number {id}")));
            }
            let name = stored.value(1).and_then(Value::text).unwrap_or_default();
            objects.push(Object { kind, record, name: before_class(name) });
        }
        let mut document = Self { reader, objects, by_id, starts: Vec::new(), links: Vec::new() };
        document.connect()?;
        Ok(document)
    }

    /// Reads the connections, sorted by the object that they lead to.
    fn connect(&mut self) -> Result<(), MeshError> {
        let tree = &self.reader.tree;
        let all = tree.children(None).filter(|&r| tree.record(r).name == b"Connections");
        let mut found: Vec<(u32, Link<'a>)> = Vec::new();
        for record in all.flat_map(|r| tree.children(Some(r))) {
            let mut values = tree.record(record).values();
            let kind = values.next().and_then(Value::text).unwrap_or_default();
            let mut end = || self.by_id.get(&values.next()?.integer()?).copied();
            // Connections of objects that are not read, and those to the root of the scene, name no known object.
            let (from, to) = (end(), end());
            let (Some(object), Some(to)) = (from, to) else { continue };
            let property = match kind {
                b"OO" => b"",
                b"OP" => values.next().and_then(Value::text).unwrap_or_default(),
                _ => continue,
            };
            found.push((to, Link { object, property }));
        }
        self.reader.run.check()?;
        found.sort_by_key(|&(to, _)| to);
        self.starts = Vec::with_capacity(self.objects.len() + 1);
        for object in 0..=self.objects.len() {
            self.starts.push(found.partition_point(|&(to, _)| (to as usize) < object) as u32);
        }
        self.links = found.into_iter().map(|(_, link)| link).collect();
        Ok(())
    }

    /// What is connected to an object.
    pub(super) fn links(&self, object: u32) -> &[Link<'a>] {
        let [start, end] = [0, 1].map(|k| self.starts[object as usize + k] as usize);
        &self.links[start..end]
    }

    /// Objects of a kind that belong to an object.
    pub(super) fn parts(&self, object: u32, kind: Kind) -> impl Iterator<Item = u32> + '_ {
        let of_kind = move |link: &&Link<'a>| link.property.is_empty() && self.object(link.object).kind == kind;
        self.links(object).iter().filter(of_kind).map(|link| link.object)
    }

    /// All objects of a kind.
    pub(super) fn all(&self, kind: Kind) -> impl Iterator<Item = u32> + '_ {
        (0..self.objects.len() as u32).filter(move |&o| self.object(o).kind == kind)
    }

    pub(super) fn object(&self, object: u32) -> &Object<'a> {
        &self.objects[object as usize]
    }

    pub(super) fn record(&self, object: u32) -> &Record<'a> {
        self.reader.tree.record(self.object(object).record)
    }

    /// Counts the search of an object and of what is connected to it.
    pub(super) fn open(&self, object: u32) -> Result<(), MeshError> {
        self.reader.open(self.object(object).record, self.links(object).len())
    }

    /// Position of an object in the file.
    pub(super) fn at(&self, object: u32) -> usize {
        self.record(object).at
    }

    pub(super) fn name(&self, object: u32) -> String {
        String::from_utf8_lossy(self.object(object).name).into_owned()
    }

    /// An error in an object, which it names.
    pub(super) fn fault(&self, object: u32, told: impl std::fmt::Display) -> MeshError {
        let name: String = self.name(object).chars().take(80).collect();
        fault(self.at(object), format!("{} {name:?}: {told}", shown(self.record(object).name)))
    }

    /// Matrices `world_from_node` of models in the bind pose, by object.
    pub(super) fn bind_pose(&self) -> Result<HashMap<u32, Matrix4<f64>>, MeshError> {
        let tree = &self.reader.tree;
        let mut matrices = HashMap::new();
        let objects = tree.children(None).filter(|&r| tree.record(r).name == b"Objects");
        let poses = objects.flat_map(|r| tree.children(Some(r))).filter(|&r| {
            let stored = tree.record(r);
            stored.name == b"Pose" && stored.value(2).and_then(Value::text) == Some(b"BindPose")
        });
        for pose in poses {
            for node in tree.children(Some(pose)).filter(|&r| tree.record(r).name == b"PoseNode") {
                let id = tree.child(Some(node), "Node").and_then(|r| tree.record(r).value(0)?.integer());
                let Some(&object) = id.and_then(|id| self.by_id.get(&id)) else { continue };
                if let Some(matrix) = self.matrix(node, "Matrix")? {
                    matrices.entry(object).or_insert(matrix);
                }
            }
        }
        Ok(matrices)
    }

    /// A matrix of 16 numbers, column by column as it acts on columns; `None` unless it is affine and finite.
    pub(super) fn matrix(&self, record: u32, name: &str) -> Result<Option<Matrix4<f64>>, MeshError> {
        let numbers = self.reader.reals(record, name)?;
        if numbers.len() != 16 || !numbers.iter().all(|x| x.is_finite()) {
            return Ok(None);
        }
        let mut matrix = Matrix4::from_column_slice(&numbers);
        matrix.set_row(3, &nalgebra::RowVector4::new(0.0, 0.0, 0.0, 1.0));
        Ok(Some(matrix))
    }
}

fn kind(name: &[u8], subtype: &[u8]) -> Option<Kind> {
    Some(match (name, subtype) {
        (b"Model", _) => Kind::Model,
        (b"Geometry", b"Mesh") => Kind::Mesh,
        (b"Geometry", b"Shape") => Kind::Shape,
        (b"Geometry", _) => Kind::OtherGeometry,
        (b"Material", _) => Kind::Material,
        (b"Texture", _) => Kind::Texture,
        (b"Deformer", b"Skin") => Kind::Skin,
        (b"Deformer", b"Cluster") => Kind::Cluster,
        (b"Deformer", b"BlendShape") => Kind::BlendShape,
        (b"Deformer", b"BlendShapeChannel") => Kind::BlendShapeChannel,
        (b"AnimationStack", _) => Kind::AnimationStack,
        (b"AnimationLayer", _) => Kind::AnimationLayer,
        (b"AnimationCurveNode", _) => Kind::CurveNode,
        (b"AnimationCurve", _) => Kind::Curve,
        _ => return None,
    })
}

fn before_class(name: &[u8]) -> &[u8] {
    let end = name.windows(CLASS.len()).position(|w| w == CLASS).unwrap_or(name.len());
    &name[..end]
}

fn shown(name: &[u8]) -> String {
    String::from_utf8_lossy(name).chars().take(40).collect()
}
