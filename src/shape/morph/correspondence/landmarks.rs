//! Landmarks: corresponding vertices of two meshes.
//!
//! Three formats are read: `plumbline.landmarks`, and two common text formats,
//!
//! ```text
//! { "format": "plumbline.landmarks", "version": 1, "pairs": [[12, 430], [[0.1, 2, 0.3], 77]] }
//! 107⏎ 750, 3386⏎ 524, 3737 …                     .cons: their number, then vertex, vertex
//! markers:⏎  - "750:3386"⏎ …                       .yml: vertex : vertex, after `#` comments
//! ```

use std::collections::BTreeSet;
use std::path::Path;

use serde::Deserialize;

use crate::mesh::TriMesh;
pub use crate::mesh::VertexRef;
use crate::morph::MorphError;
use plumbline_num::document::Kind;

/// 128 MiB: about a million pairs.
const KIND: Kind = Kind { name: "a file of landmarks", format: "plumbline.landmarks", max_bytes: 1 << 27 };

fn malformed(fault: String) -> MorphError {
    MorphError::Malformed { name: KIND.name, fault }
}

/// Pairs of corresponding vertices of two meshes.
#[derive(Clone, Debug, PartialEq)]
pub struct Landmarks(Vec<(VertexRef, VertexRef)>);

/// Pairs of corresponding vertices of two meshes.
#[derive(Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct Document {
    /// Always `plumbline.landmarks`.
    #[expect(dead_code, reason = "checked before the rest is read")]
    format: String,
    /// Always 1.
    #[expect(dead_code, reason = "checked before the rest is read")]
    version: u32,
    /// Vertex of the first mesh, vertex of the second.
    pairs: Vec<(VertexRef, VertexRef)>,
}

/// The JSON schema of files of landmarks.
#[cfg(feature = "schema")]
pub fn landmarks_schema() -> schemars::Schema {
    schemars::schema_for!(Document)
}

impl Landmarks {
    /// Pairs of vertices.
    pub fn of_vertices(pairs: &[(u32, u32)]) -> Self {
        let vertex = |v: u32| VertexRef::Vertex(u64::from(v));
        Self(pairs.iter().map(|&(a, b)| (vertex(a), vertex(b))).collect())
    }

    /// Reads a file in any of the three formats.
    ///
    /// # Errors
    /// [`MorphError::Malformed`], also where the file cannot be read.
    pub fn read(path: &Path) -> Result<Self, MorphError> {
        Self::parse(&KIND.text(path)?)
    }

    /// Parses one of the three formats, detected by its beginning.
    ///
    /// # Errors
    /// [`MorphError::Malformed`].
    pub fn parse(text: &str) -> Result<Self, MorphError> {
        let pairs = if text.trim_start().starts_with('{') {
            KIND.parse::<Document>(text)?.pairs
        } else if text.lines().any(|line| line.trim_end() == "markers:") {
            of_lines(text, "markers:", ':')?
        } else {
            of_counted(text)?
        };
        Ok(Self(pairs))
    }

    /// The pairs as vertices of both meshes.
    ///
    /// # Errors
    /// [`MorphError::NoSuchVertex`], [`MorphError::Value`] for a position that is not finite and for a repeated vertex.
    pub fn vertices(&self, first: &TriMesh, second: &TriMesh) -> Result<Vec<(u32, u32)>, MorphError> {
        let mut seen = [BTreeSet::new(), BTreeSet::new()];
        let mut pairs = Vec::with_capacity(self.0.len());
        for (k, (a, b)) in self.0.iter().enumerate() {
            let context = format!("landmark {k}");
            let pair =
                [(a, first, "first"), (b, second, "second")].map(|(p, mesh, which)| p.vertex(mesh, which, &context));
            let [a, b] = pair;
            let (a, b) = (a?, b?);
            for (seen, (v, which)) in seen.iter_mut().zip([(a, "first"), (b, "second")]) {
                if !seen.insert(v) {
                    return Err(MorphError::Value {
                        what: format!("{context}: the vertex of the {which} mesh"),
                        value: format!("{v}, listed before"),
                        expected: "each vertex once".to_owned(),
                    });
                }
            }
            pairs.push((a, b));
        }
        Ok(pairs)
    }

    /// Number of pairs.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// True without pairs.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl VertexRef {
    /// Resolves the vertex on a mesh.
    ///
    /// # Errors
    /// [`MorphError::NoSuchVertex`], [`MorphError::Value`].
    pub(in crate::morph) fn vertex(
        &self,
        mesh: &TriMesh,
        which: &'static str,
        context: &str,
    ) -> Result<u32, MorphError> {
        let vertices = mesh.vertex_count();
        match *self {
            Self::Vertex(v) if (v as usize) < vertices => Ok(v as u32),
            Self::Vertex(vertex) => {
                Err(MorphError::NoSuchVertex { context: context.to_owned(), which, vertex, vertices })
            }
            Self::Nearest(p) => self.find(mesh).ok_or_else(|| MorphError::Value {
                what: format!("{context}: the position on the {which} mesh"),
                value: format!("{p:?}"),
                expected: "three finite numbers, and a mesh with vertices".to_owned(),
            }),
        }
    }
}

/// The pairs after a line, up to the first other line.
fn of_lines(text: &str, after: &str, between: char) -> Result<Vec<(VertexRef, VertexRef)>, MorphError> {
    let lines = text.lines().enumerate().skip_while(|(_, line)| line.trim_end() != after).skip(1);
    let mut pairs = Vec::new();
    for (number, line) in lines {
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.is_empty() {
            continue;
        }
        let Some(entry) = line.strip_prefix('-') else { break };
        pairs.push(pair(entry.trim().trim_matches(['"', '\'']), between, number)?);
    }
    Ok(pairs)
}

/// The number of pairs in the first line, then the pairs.
fn of_counted(text: &str) -> Result<Vec<(VertexRef, VertexRef)>, MorphError> {
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let first = lines.next().map_or("", |(_, line)| line.trim());
    let count: usize = first.parse().map_err(|_| {
        let shown: String = first.chars().take(30).collect();
        malformed(format!("line 1: {shown:?} (expected JSON, `markers:`, or the number of pairs)"))
    })?;
    let pairs: Vec<_> = lines.map(|(number, line)| pair(line, ',', number)).collect::<Result<_, _>>()?;
    if pairs.len() != count {
        return Err(malformed(format!("line 1 announces {count} pairs, but {} follow", pairs.len())));
    }
    Ok(pairs)
}

fn pair(text: &str, between: char, line: usize) -> Result<(VertexRef, VertexRef), MorphError> {
    let number = |text: &str| text.trim().parse::<u64>().ok().map(VertexRef::Vertex);
    let both = text.split_once(between).and_then(|(a, b)| number(a).zip(number(b)));
    both.ok_or_else(|| {
        let shown: String = text.chars().take(30).collect();
        malformed(format!("line {}: {shown:?} (expected two vertices with `{between}` between)", line + 1))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn three_formats_of_the_same_pairs() {
        let expected = Landmarks::of_vertices(&[(3, 4), (17, 5)]);
        for text in [
            r#"{"format": "plumbline.landmarks", "version": 1, "pairs": [[3, 4], [17, 5]]}"#,
            "2\n3, 4\n17, 5\n",
            "source:\n  poses:\n    - a.obj\nmarkers:\n  - \"3:4\"  # foot\n\n  - \"17:5\"\nother: 3\n",
        ] {
            assert_eq!(Landmarks::parse(text).unwrap(), expected, "{text}");
        }
    }

    #[test]
    fn errors_name_the_line() {
        for (text, part) in [
            ("3\n1, 2\n", "announces 3 pairs, but 1"),
            ("2\n1, 2\n3; 4\n", "line 3"),
            ("hello", "line 1"),
            ("", "line 1"),
            ("markers:\n - \"3-4\"\n", "line 2"),
            (r#"{"format": "plumbline.handles", "version": 1, "pairs": []}"#, "plumbline.landmarks"),
            (r#"{"format": "plumbline.landmarks", "version": 2, "pairs": []}"#, "version 2"),
            (r#"{"format": "plumbline.landmarks", "version": 1, "pairs": [[1]]}"#, "line 1"),
        ] {
            let message = Landmarks::parse(text).unwrap_err().to_string();
            assert!(message.contains(part), "{message}");
        }
        let mesh = shapes::icosphere(0);
        let vertices =
            |pairs: &[(u32, u32)]| Landmarks::of_vertices(pairs).vertices(&mesh, &mesh).unwrap_err().to_string();
        assert!(
            vertices(&[(1, 1), (2, 12)]).contains("landmark 1: the second mesh has no vertex 12 (expected 0 to 11")
        );
        assert!(vertices(&[(1, 1), (1, 2)]).contains("the vertex of the first mesh is 1, listed before"));
        let nowhere = Landmarks(vec![(VertexRef::Nearest([f64::NAN, 0.0, 0.0]), VertexRef::Vertex(0))]);
        assert!(nowhere.vertices(&mesh, &mesh).is_err());
        let p = mesh.positions()[7] * 1.1;
        let near = Landmarks(vec![(VertexRef::Nearest(p.coords.into()), VertexRef::Vertex(0))]);
        assert_eq!(near.vertices(&mesh, &mesh).unwrap(), [(7, 0)]);
    }
}
