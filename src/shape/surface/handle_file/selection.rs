//! Vertex selections: by index, by position, by name, and set operations.

use std::cell::{OnceCell, RefCell};
use std::collections::BTreeMap;
use std::fmt;

use nalgebra::Point3;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{self, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};

use super::HandleFileError;
use super::document::rejected;
use crate::mesh::VertexRef;
use crate::mesh::region::{Ball, HalfSpace};
use plumbline_num::spatial::KdTree;

/// Maximum depth of selections within selections, through named sets too: people nest two or three. Bounds the stack.
const MAX_NESTING: usize = 256;

/// Vertices: the name of a set, or a description.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema), schemars(untagged))]
pub(super) enum Selection {
    /// The name of a set.
    Named(String),
    /// Vertices by index or position, in order.
    Listed(Vec<VertexRef>),
    /// A description.
    Described(Box<Description>),
}

/// Told apart by its first character: a derived reader would first store every number in 32 bytes.
impl<'de> Deserialize<'de> for Selection {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = Selection;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(
                    "the name of a set, a list of vertices (indices, or positions [x, y, z]), or one of {\"indices\": …}, \
                     {\"range\": …}, {\"box\": …}, {\"sphere\": …}, {\"half_space\": …}, {\"nearest\": …}, {\"union\": …}, \
                     {\"intersection\": …}, {\"not\": …}",
                )
            }

            fn visit_str<E: de::Error>(self, name: &str) -> Result<Selection, E> {
                Ok(Selection::Named(name.to_owned()))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Selection, A::Error> {
                Deserialize::deserialize(SeqAccessDeserializer::new(seq)).map(Selection::Listed)
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Selection, A::Error> {
                Deserialize::deserialize(MapAccessDeserializer::new(map)).map(Box::new).map(Selection::Described)
            }
        }
        deserializer.deserialize_any(Either)
    }
}

/// A description of vertices.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Description {
    /// Vertex indices, from 0.
    Indices(Vec<u64>),
    /// First and last index.
    Range([u64; 2]),
    /// In an axis-aligned box, boundary included.
    Box(Corners),
    /// In a ball, boundary included.
    Sphere(Ball),
    /// On one side of a plane.
    HalfSpace(HalfSpace),
    /// The vertex nearest to each position.
    Nearest(Vec<[f64; 3]>),
    /// In any of these selections.
    Union(Vec<Selection>),
    /// In all of these selections.
    Intersection(Vec<Selection>),
    /// Not in this selection.
    Not(Selection),
}

/// An axis-aligned box.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct Corners {
    /// Lowest coordinates.
    low: [f64; 3],
    /// Highest coordinates.
    high: [f64; 3],
}

impl Selection {
    /// Whether the file lists its vertices in an order.
    pub(super) fn has_order(&self) -> bool {
        match self {
            Self::Named(_) => false,
            Self::Listed(_) => true,
            Self::Described(d) => matches!(**d, Description::Indices(_) | Description::Nearest(_)),
        }
    }
}

/// A mask, a bit per vertex.
struct Bits(Vec<u64>);

impl Bits {
    fn of(mask: &[bool]) -> Self {
        let word = |bits: &[bool]| bits.iter().enumerate().fold(0, |word, (k, bit)| word | (u64::from(*bit) << k));
        Self(mask.chunks(64).map(word).collect())
    }

    fn mask(&self, vertices: usize) -> Vec<bool> {
        (0..vertices).map(|v| self.0[v / 64] >> (v % 64) & 1 == 1).collect()
    }
}

/// Resolves selections on a mesh.
pub(super) struct Selector<'a> {
    positions: &'a [Point3<f64>],
    sets: &'a BTreeMap<String, Selection>,
    /// Sets resolved so far: of forty sets, each the union of the one before with itself, the last would be resolved 2⁴⁰ times.
    known: RefCell<BTreeMap<&'a str, Bits>>,
    /// Of all positions, made where a nearest vertex is asked for: files may name millions.
    tree: OnceCell<KdTree>,
}

impl<'a> Selector<'a> {
    pub(super) fn new(positions: &'a [Point3<f64>], sets: &'a BTreeMap<String, Selection>) -> Self {
        Self { positions, sets, known: RefCell::default(), tree: OnceCell::new() }
    }

    /// Lowest and highest coordinates of the mesh, for messages.
    pub(super) fn extent(&self) -> (String, String) {
        let first = self.positions.first().copied().unwrap_or_else(Point3::origin);
        let (low, high) = self.positions.iter().fold((first, first), |(low, high), p| (low.inf(p), high.sup(p)));
        // Six significant digits.
        let short = |v: f64| format!("{v:.5e}").parse::<f64>().unwrap_or(v);
        let shown = |p: Point3<f64>| format!("({}, {}, {})", short(p.x), short(p.y), short(p.z));
        (shown(low), shown(high))
    }

    /// The vertices of a selection in the order of the file, where it has one; else ascending.
    pub(super) fn listed(&self, selection: &Selection, context: &str) -> Result<Vec<u32>, HandleFileError> {
        if let Selection::Listed(vertices) = selection {
            return vertices.iter().map(|v| self.referenced(v, context)).collect();
        }
        if let Selection::Described(description) = selection {
            match &**description {
                Description::Indices(numbers) => {
                    return numbers.iter().map(|v| self.vertex(*v, context)).collect();
                }
                Description::Nearest(points) => return Ok(points.iter().filter_map(|p| self.nearest(p)).collect()),
                _ => {}
            }
        }
        let mask = self.mask(selection, context)?;
        Ok((0..mask.len()).filter(|v| mask[*v]).map(|v| v as u32).collect())
    }

    /// Which vertices are in a selection.
    pub(super) fn mask(&self, selection: &Selection, context: &str) -> Result<Vec<bool>, HandleFileError> {
        self.inner(selection, context, &mut Vec::new())
    }

    /// `within` are the selections around this one, with the names of those that are sets.
    fn inner<'s>(
        &'s self,
        selection: &'s Selection,
        context: &str,
        within: &mut Vec<Option<&'s str>>,
    ) -> Result<Vec<bool>, HandleFileError> {
        if within.len() >= MAX_NESTING {
            let found = format!("more than {MAX_NESTING} selections, each in another");
            return Err(rejected(context, "vertices", found, "fewer; list the vertices, or describe them by a shape"));
        }
        let name = if let Selection::Named(name) = selection { Some(name.as_str()) } else { None };
        if name.is_some() && within.contains(&name) {
            let name = name.unwrap_or_default().to_owned();
            return Err(HandleFileError::Circular { context: context.to_owned(), name });
        }
        within.push(name);
        let mask = match selection {
            Selection::Named(name) => self.named(name, context, within),
            Selection::Listed(vertices) => self.mask_of(vertices.iter().map(|v| self.referenced(v, context))),
            Selection::Described(description) => self.described(description, context, within),
        };
        within.pop();
        mask
    }

    fn named<'s>(
        &'s self,
        name: &'s str,
        context: &str,
        within: &mut Vec<Option<&'s str>>,
    ) -> Result<Vec<bool>, HandleFileError> {
        if let Some(bits) = self.known.borrow().get(name) {
            return Ok(bits.mask(self.positions.len()));
        }
        let Some((name, set)) = self.sets.get_key_value(name) else {
            let known: Vec<&str> = self.sets.keys().map(String::as_str).collect();
            let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
            return Err(HandleFileError::NoSuchSet { context: context.to_owned(), name: name.to_owned(), known });
        };
        let mask = self.inner(set, context, within)?;
        self.known.borrow_mut().insert(name, Bits::of(&mask));
        Ok(mask)
    }

    fn described<'s>(
        &'s self,
        description: &'s Description,
        context: &str,
        within: &mut Vec<Option<&'s str>>,
    ) -> Result<Vec<bool>, HandleFileError> {
        let of_all = |inside: &dyn Fn(&Point3<f64>) -> bool| Ok(self.positions.iter().map(inside).collect());
        match description {
            Description::Indices(numbers) => self.mask_of(numbers.iter().map(|v| self.vertex(*v, context))),
            Description::Range([first, last]) => {
                if first > last {
                    return Err(rejected(context, "range", format!("[{first}, {last}]"), "[first, last]"));
                }
                let (first, last) = (self.vertex(*first, context)?, self.vertex(*last, context)?);
                self.mask_of((first..=last).map(Ok))
            }
            Description::Box(Corners { low, high }) => {
                if (0..3).any(|k| !(low[k] <= high[k])) {
                    return Err(rejected(context, "low", format!("{low:?}"), &format!("at most high, {high:?}")));
                }
                of_all(&|p| (0..3).all(|k| (low[k]..=high[k]).contains(&p[k])))
            }
            Description::Sphere(ball) => {
                if !(ball.radius > 0.0) {
                    return Err(rejected(context, "radius", ball.radius, "above 0"));
                }
                of_all(&|p| ball.contains(p))
            }
            Description::HalfSpace(side) => {
                if side.normal == [0.0; 3] {
                    return Err(rejected(
                        context,
                        "normal",
                        format!("{:?}", side.normal),
                        "a direction: not all zeros",
                    ));
                }
                of_all(&|p| side.contains(p))
            }
            Description::Nearest(points) => self.mask_of(points.iter().filter_map(|p| self.nearest(p)).map(Ok)),
            Description::Union(parts) => self.joined(parts, context, within, false),
            Description::Intersection(parts) => self.joined(parts, context, within, true),
            Description::Not(part) => Ok(self.inner(part, context, within)?.iter().map(|inside| !inside).collect()),
        }
    }

    fn joined<'s>(
        &'s self,
        parts: &'s [Selection],
        context: &str,
        within: &mut Vec<Option<&'s str>>,
        all: bool,
    ) -> Result<Vec<bool>, HandleFileError> {
        let mut joined = vec![all && !parts.is_empty(); self.positions.len()];
        for part in parts {
            for (joined, inside) in joined.iter_mut().zip(self.inner(part, context, within)?) {
                *joined = if all { *joined && inside } else { *joined || inside };
            }
        }
        Ok(joined)
    }

    fn mask_of(
        &self,
        vertices: impl Iterator<Item = Result<u32, HandleFileError>>,
    ) -> Result<Vec<bool>, HandleFileError> {
        let mut mask = vec![false; self.positions.len()];
        for vertex in vertices {
            mask[vertex? as usize] = true;
        }
        Ok(mask)
    }

    fn referenced(&self, reference: &VertexRef, context: &str) -> Result<u32, HandleFileError> {
        match reference {
            VertexRef::Vertex(index) => self.vertex(*index, context),
            VertexRef::Nearest(position) => Some(position)
                .filter(|p| p.iter().all(|c| c.is_finite()))
                .and_then(|p| self.nearest(p))
                .ok_or_else(|| rejected(context, "position", format!("{position:?}"), "three finite numbers")),
        }
    }

    fn vertex(&self, vertex: u64, context: &str) -> Result<u32, HandleFileError> {
        let vertices = self.positions.len();
        let missing = || HandleFileError::NoSuchVertex { context: context.to_owned(), vertex, vertices };
        u32::try_from(vertex).ok().filter(|v| (*v as usize) < vertices).ok_or_else(missing)
    }

    /// The nearest vertex, the first of equally near ones; `None` without vertices.
    fn nearest(&self, point: &[f64; 3]) -> Option<u32> {
        let tree = self.tree.get_or_init(|| KdTree::new(self.positions));
        tree.first_nearest(&Point3::from(*point)).map(|(v, _)| v)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn searches_by_tree_find_the_vertices_that_linear_searches_find() {
        let mut random = fastrand::Rng::with_seed(8);
        // On a coarse lattice, so that distances tie.
        let mut lattice = |k: f64| [0; 3].map(|_| f64::from(random.u8(0..8)) / k);
        let positions: Vec<_> = (0..900).map(|_| Point3::from(lattice(1.0))).collect();
        let sets = BTreeMap::new();
        let selector = Selector::new(&positions, &sets);
        for _ in 0..400 {
            let point = lattice(2.0);
            assert_eq!(selector.nearest(&point), VertexRef::Nearest(point).find_in(&positions), "{point:?}");
        }
        // Squares of distances beyond the range of numbers are equal.
        assert_eq!(selector.nearest(&[1e200; 3]), Some(0));
        assert_eq!(Selector::new(&[], &sets).nearest(&[0.0; 3]), None);
    }
}
