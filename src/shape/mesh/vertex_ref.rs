//! Vertex references in input files: by index or by position.

use nalgebra::Point3;
use serde::Deserialize;

use super::TriMesh;

/// A vertex: its index, from 0 in the order of the file, or the position of the vertex that is meant or nearest to it.
///
/// Written `12`, `[0.1, 2, 0.3]`, `{"vertex": 12}` or `{"position": [0.1, 2, 0.3]}`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(from = "Notation")]
pub enum VertexRef {
    /// The index of a vertex.
    Vertex(u64),
    /// The vertex nearest to a position.
    Nearest([f64; 3]),
}

/// The forms in which a vertex is written.
#[derive(Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(
    untagged,
    expecting = "a vertex: its index, a position [x, y, z], {\"vertex\": index} or {\"position\": [x, y, z]}"
)]
enum Notation {
    /// The index of a vertex, from 0.
    Index(u64),
    /// The vertex nearest to a position.
    Nearest([f64; 3]),
    /// The index with its name.
    Vertex(Vertex),
    /// The position with its name.
    Position(Position),
}

/// An index with its name.
#[derive(Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct Vertex {
    /// The index of a vertex, from 0.
    vertex: u64,
}

/// A position with its name.
#[derive(Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct Position {
    /// The vertex nearest to this position.
    position: [f64; 3],
}

impl From<Notation> for VertexRef {
    fn from(notation: Notation) -> Self {
        match notation {
            Notation::Index(index) | Notation::Vertex(Vertex { vertex: index }) => Self::Vertex(index),
            Notation::Nearest(position) | Notation::Position(Position { position }) => Self::Nearest(position),
        }
    }
}

impl VertexRef {
    /// The referenced vertex of a mesh; `None` if the index is out of range, the mesh has no vertices, or the position is not
    /// finite.
    pub fn find(&self, mesh: &TriMesh) -> Option<u32> {
        self.find_in(mesh.positions())
    }

    /// [`Self::find`] for a list of vertex positions. The nearest vertex is found by linear search.
    pub fn find_in(&self, positions: &[Point3<f64>]) -> Option<u32> {
        match *self {
            Self::Vertex(index) => usize::try_from(index).is_ok_and(|i| i < positions.len()).then_some(index as u32),
            Self::Nearest(position) if position.iter().all(|c| c.is_finite()) => {
                let position = Point3::from(position);
                let distance = |v: &usize| (positions[*v] - position).norm_squared();
                (0..positions.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).map(|v| v as u32)
            }
            Self::Nearest(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_index_and_a_position_are_read_with_and_without_their_names() {
        let read = |text: &str| serde_json::from_str::<VertexRef>(text).expect(text);
        for text in ["12", "{\"vertex\": 12}"] {
            assert_eq!(read(text), VertexRef::Vertex(12));
        }
        for text in ["[0, 1, 2.5]", "{\"position\": [0, 1, 2.5]}"] {
            assert_eq!(read(text), VertexRef::Nearest([0.0, 1.0, 2.5]));
        }
        for text in ["-1", "1.5", "[1, 2]", "{\"vertex\": 1, \"position\": [0, 0, 0]}", "\"12\"", "{}"] {
            let refused = serde_json::from_str::<VertexRef>(text).expect_err(text).to_string();
            assert!(refused.contains("{\"position\": [x, y, z]}"), "{refused}");
        }
    }

    #[test]
    fn a_reference_finds_its_vertex_or_none() {
        let positions = [Point3::new(0.0, 0.0, 0.0), Point3::new(1.0, 0.0, 0.0)];
        let find = |reference: VertexRef| reference.find_in(&positions);
        assert_eq!(find(VertexRef::Vertex(1)), Some(1));
        assert_eq!(find(VertexRef::Vertex(u64::from(u32::MAX) + 2)), None, "no index wraps");
        assert_eq!(find(VertexRef::Nearest([0.9, 0.2, 0.0])), Some(1));
        assert_eq!(find(VertexRef::Nearest([f64::NAN, 0.0, 0.0])), None);
        assert_eq!(VertexRef::Nearest([0.0; 3]).find_in(&[]), None);
    }
}
