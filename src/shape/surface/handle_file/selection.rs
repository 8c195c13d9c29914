//! Sets of vertices: by number, by place, by name, and made of one another.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};
use serde::Deserialize;

use super::HandleFileError;
use super::document::refused;

/// Vertices: the name of a set, or a description.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(
    untagged,
    expecting = "the name of a set, or one of {\"indices\": …}, {\"range\": …}, {\"box\": …}, {\"sphere\": …}, {\"half_space\": …}, {\"nearest\": …}, {\"union\": …}, {\"intersection\": …}, {\"not\": …}"
)]
pub(super) enum Selection {
    /// The name of a set.
    Named(String),
    /// A description.
    Described(Box<Description>),
}

/// A description of vertices.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Description {
    /// Numbers of vertices, from 0.
    Indices(Vec<u64>),
    /// First and last number.
    Range([u64; 2]),
    /// In a box along the axes, its surface among it.
    Box(Corners),
    /// In a ball, its surface among it.
    Sphere(Ball),
    /// On one side of a plane.
    HalfSpace(HalfSpace),
    /// The vertex that is nearest to each place.
    Nearest(Vec<[f64; 3]>),
    /// In any of these.
    Union(Vec<Selection>),
    /// In all of these.
    Intersection(Vec<Selection>),
    /// Not in this.
    Not(Selection),
}

/// A box along the axes.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct Corners {
    /// Lowest coordinates.
    low: [f64; 3],
    /// Highest coordinates.
    high: [f64; 3],
}

/// A ball.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct Ball {
    /// Its middle.
    center: [f64; 3],
    /// Its radius, above 0.
    radius: f64,
}

/// One side of a plane.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct HalfSpace {
    /// A place on the plane.
    point: [f64; 3],
    /// To which side, across the plane.
    normal: [f64; 3],
}

impl Selection {
    /// Its vertices have an order of the user's.
    pub(super) fn has_order(&self) -> bool {
        match self {
            Self::Named(_) => false,
            Self::Described(d) => matches!(**d, Description::Indices(_) | Description::Nearest(_)),
        }
    }
}

/// Finds the vertices of selections in a mesh.
pub(super) struct Selector<'a> {
    positions: &'a [Point3<f64>],
    sets: &'a BTreeMap<String, Selection>,
}

impl<'a> Selector<'a> {
    pub(super) fn new(positions: &'a [Point3<f64>], sets: &'a BTreeMap<String, Selection>) -> Self {
        Self { positions, sets }
    }

    /// Lowest and highest coordinates of the mesh, for messages.
    pub(super) fn extent(&self) -> (String, String) {
        let first = self.positions.first().copied().unwrap_or_else(Point3::origin);
        let (low, high) = self.positions.iter().fold((first, first), |(low, high), p| (low.inf(p), high.sup(p)));
        // Six digits at most.
        let short = |v: f64| format!("{v:.5e}").parse::<f64>().unwrap_or(v);
        let shown = |p: Point3<f64>| format!("({}, {}, {})", short(p.x), short(p.y), short(p.z));
        (shown(low), shown(high))
    }

    /// The vertices of a selection in the order of the file, where it has one; else ascending.
    pub(super) fn listed(&self, selection: &Selection, place: &str) -> Result<Vec<u32>, HandleFileError> {
        if let Selection::Described(description) = selection {
            match &**description {
                Description::Indices(numbers) => {
                    return numbers.iter().map(|v| self.vertex(*v, place)).collect();
                }
                Description::Nearest(places) => return Ok(places.iter().filter_map(|p| self.nearest(p)).collect()),
                _ => {}
            }
        }
        let mask = self.mask(selection, place)?;
        Ok((0..mask.len()).filter(|v| mask[*v]).map(|v| v as u32).collect())
    }

    /// Which vertices are in a selection.
    pub(super) fn mask(&self, selection: &Selection, place: &str) -> Result<Vec<bool>, HandleFileError> {
        self.inner(selection, place, &mut Vec::new())
    }

    fn inner<'s>(
        &'s self,
        selection: &'s Selection,
        place: &str,
        within: &mut Vec<&'s str>,
    ) -> Result<Vec<bool>, HandleFileError> {
        match selection {
            Selection::Named(name) => self.named(name, place, within),
            Selection::Described(description) => self.described(description, place, within),
        }
    }

    fn named<'s>(
        &'s self,
        name: &'s str,
        place: &str,
        within: &mut Vec<&'s str>,
    ) -> Result<Vec<bool>, HandleFileError> {
        if within.contains(&name) {
            return Err(HandleFileError::Circular { place: place.to_owned(), name: name.to_owned() });
        }
        let Some(set) = self.sets.get(name) else {
            let known: Vec<&str> = self.sets.keys().map(String::as_str).collect();
            let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
            return Err(HandleFileError::NoSuchSet { place: place.to_owned(), name: name.to_owned(), known });
        };
        within.push(name);
        let mask = self.inner(set, place, within);
        within.pop();
        mask
    }

    fn described<'s>(
        &'s self,
        description: &'s Description,
        place: &str,
        within: &mut Vec<&'s str>,
    ) -> Result<Vec<bool>, HandleFileError> {
        let of_all = |inside: &dyn Fn(&Point3<f64>) -> bool| Ok(self.positions.iter().map(inside).collect());
        match description {
            Description::Indices(numbers) => self.those(numbers.iter().map(|v| self.vertex(*v, place))),
            Description::Range([first, last]) => {
                if first > last {
                    return Err(refused(place, "range", format!("[{first}, {last}]"), "[first, last]"));
                }
                let (first, last) = (self.vertex(*first, place)?, self.vertex(*last, place)?);
                self.those((first..=last).map(Ok))
            }
            Description::Box(Corners { low, high }) => {
                if (0..3).any(|k| !(low[k] <= high[k])) {
                    return Err(refused(place, "low", format!("{low:?}"), &format!("at most high, {high:?}")));
                }
                of_all(&|p| (0..3).all(|k| (low[k]..=high[k]).contains(&p[k])))
            }
            Description::Sphere(Ball { center, radius }) => {
                if !(*radius > 0.0) {
                    return Err(refused(place, "radius", radius, "above 0"));
                }
                let center = Point3::from(*center);
                of_all(&|p| nalgebra::distance(p, &center) <= *radius)
            }
            Description::HalfSpace(HalfSpace { point, normal }) => {
                let (point, direction) = (Point3::from(*point), Vector3::from(*normal));
                if direction == Vector3::zeros() {
                    return Err(refused(place, "normal", format!("{normal:?}"), "a direction: not all zeros"));
                }
                of_all(&|p| (p - point).dot(&direction) >= 0.0)
            }
            Description::Nearest(places) => self.those(places.iter().filter_map(|p| self.nearest(p)).map(Ok)),
            Description::Union(parts) => self.joined(parts, place, within, false),
            Description::Intersection(parts) => self.joined(parts, place, within, true),
            Description::Not(part) => Ok(self.inner(part, place, within)?.iter().map(|inside| !inside).collect()),
        }
    }

    fn joined<'s>(
        &'s self,
        parts: &'s [Selection],
        place: &str,
        within: &mut Vec<&'s str>,
        all: bool,
    ) -> Result<Vec<bool>, HandleFileError> {
        let mut joined = vec![all && !parts.is_empty(); self.positions.len()];
        for part in parts {
            for (joined, inside) in joined.iter_mut().zip(self.inner(part, place, within)?) {
                *joined = if all { *joined && inside } else { *joined || inside };
            }
        }
        Ok(joined)
    }

    fn those(
        &self,
        vertices: impl Iterator<Item = Result<u32, HandleFileError>>,
    ) -> Result<Vec<bool>, HandleFileError> {
        let mut mask = vec![false; self.positions.len()];
        for vertex in vertices {
            mask[vertex? as usize] = true;
        }
        Ok(mask)
    }

    fn vertex(&self, vertex: u64, place: &str) -> Result<u32, HandleFileError> {
        let vertices = self.positions.len();
        let missing = || HandleFileError::NoSuchVertex { place: place.to_owned(), vertex, vertices };
        u32::try_from(vertex).ok().filter(|v| (*v as usize) < vertices).ok_or_else(missing)
    }

    /// The nearest vertex; of equally near ones the first. `None` without vertices.
    fn nearest(&self, place: &[f64; 3]) -> Option<u32> {
        let place = Point3::from(*place);
        let distance = |v: &usize| nalgebra::distance_squared(&self.positions[*v], &place);
        (0..self.positions.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).map(|v| v as u32)
    }
}
