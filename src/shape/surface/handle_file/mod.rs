//! Handle files: which vertices are held or moved, where to, and when.
//!
//! ```json
//! { "format": "plumbline.handles", "version": 1,
//!   "sets": { "foot": {"half_space": {"point": [0, 0.1, 0], "normal": [0, -1, 0]}} },
//!   "handles": [
//!     {"name": "foot", "vertices": "foot"},
//!     {"name": "tip", "vertices": {"sphere": {"center": [0, 1, 0], "radius": 0.2}},
//!      "rigid": {"rotation": {"axis": [0, 0, 1], "angle_deg": 70}, "translation": [0.3, 0, 0]}},
//!     {"name": "thorn", "vertices": {"indices": [17]}, "positions": [[0.1, 0.5, 0.2]], "weight": 10} ],
//!   "region": {"not": "foot"} }
//! ```
//!
//! It is not a pose of a skeleton and not an animation of all vertices: it says what is prescribed, and a deformation method
//! finds the rest. A handle without `rigid` and `positions` is held still. `rigid` turns about `pivot` (the middle of the
//! handle's vertices if left out) and then moves; `positions` has one place per vertex of `indices` or `nearest`, in their
//! order. With `keys` both change over time ([`Track`]). Vertices outside `region` are held still. Numbers of vertices start
//! from 0, in the order of the mesh's file; places are in its units. Unknown keys are refused.

mod document;
mod error;
mod selection;
#[cfg(test)]
mod tests;
mod track;

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Point3;

#[cfg(feature = "schema")]
pub use document::handle_file_schema;
pub use error::HandleFileError;
pub use track::{Interpolation, Track};

use document::Document;
use plumbline_num::document::Kind;
use selection::{Selection, Selector};

/// At most as large as targets of a million vertices with all digits.
const KIND: Kind = Kind { name: "a file of handles", format: "plumbline.handles", max_bytes: 1 << 27 };

/// Handles as they stand in a file, not yet of a mesh.
#[derive(Clone, Debug)]
pub struct HandleFile {
    sets: BTreeMap<String, Selection>,
    handles: Vec<document::HandleEntry>,
    region: Option<Selection>,
}

/// The handles of one mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshHandles {
    /// Each with vertices of its own.
    pub handles: Vec<MeshHandle>,
    /// Vertices outside the region, held still; ascending, none of them in a handle.
    pub outside: Vec<u32>,
}

/// A handle of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshHandle {
    /// What messages call it.
    pub name: String,
    /// Its vertices, ascending.
    pub vertices: Vec<u32>,
    /// `None`: its vertices are where it says, exactly; else how strongly they are drawn there, relative to the mesh's own
    /// stiffness.
    pub weight: Option<f64>,
    /// Where it wants them over time.
    pub track: Track,
}

impl HandleFile {
    /// Reads a file.
    ///
    /// # Errors
    /// [`HandleFileError`]: what [`HandleFile::parse`] refuses, a file that is too large or cannot be read.
    pub fn read(path: &Path) -> Result<Self, HandleFileError> {
        Self::parse(&KIND.text(path)?)
    }

    /// Reads a text.
    ///
    /// # Errors
    /// [`HandleFileError::Document`]; [`HandleFileError::Value`] names the handle and field.
    pub fn parse(text: &str) -> Result<Self, HandleFileError> {
        let document: Document = KIND.parse(text)?;
        if document.handles.is_empty() {
            let expected = "one handle at least".to_owned();
            let place = "the file".to_owned();
            return Err(HandleFileError::Value { place, field: "handles", value: "an empty list".into(), expected });
        }
        let file = Self { sets: document.sets, handles: document.handles, region: document.region };
        for (i, entry) in file.handles.iter().enumerate() {
            entry.check(&file.place(i))?;
        }
        Ok(file)
    }

    /// What messages call a handle.
    fn place(&self, i: usize) -> String {
        match &self.handles[i].name {
            Some(name) => format!("handle {name:?}"),
            None => format!("handle {}", i + 1),
        }
    }

    /// The handles of a mesh with these vertices.
    ///
    /// # Errors
    /// [`HandleFileError`]: vertices that the mesh does not have, unknown or circular sets, handles without vertices, a vertex
    /// in two handles, positions whose number is not that of the vertices.
    pub fn of_mesh(&self, positions: &[Point3<f64>]) -> Result<MeshHandles, HandleFileError> {
        let selector = Selector::new(positions, &self.sets);
        let mut handles = Vec::with_capacity(self.handles.len());
        for (i, entry) in self.handles.iter().enumerate() {
            let place = self.place(i);
            let listed = selector.listed(&entry.vertices, &place)?;
            let mut vertices = listed.clone();
            vertices.sort_unstable();
            vertices.dedup();
            if vertices.is_empty() {
                let (low, high) = selector.extent();
                return Err(HandleFileError::Empty { place, low, high });
            }
            let track = entry.track(&place, &listed, &vertices, positions)?;
            let name = entry.name.clone().unwrap_or_else(|| format!("{}", i + 1));
            handles.push(MeshHandle { name, vertices, weight: entry.weight, track });
        }
        let owner = self.owners(&handles, positions.len())?;
        let outside = match &self.region {
            None => Vec::new(),
            Some(region) => {
                let inside = selector.mask(region, "region")?;
                let free = |v: &usize| !inside[*v] && owner[*v].is_none();
                (0..positions.len()).filter(free).map(|v| v as u32).collect()
            }
        };
        Ok(MeshHandles { handles, outside })
    }

    /// The handle of each vertex.
    fn owners(&self, handles: &[MeshHandle], count: usize) -> Result<Vec<Option<u32>>, HandleFileError> {
        let mut owner: Vec<Option<u32>> = vec![None; count];
        for (i, handle) in handles.iter().enumerate() {
            let taken = |v: &&u32| owner[**v as usize].is_some();
            if let Some(&vertex) = handle.vertices.iter().find(taken) {
                let other = owner[vertex as usize];
                let first = self.place(other.unwrap_or(0) as usize);
                let shared = handle.vertices.iter().filter(|v| owner[**v as usize] == other).count();
                return Err(HandleFileError::Claimed { vertex, first, second: self.place(i), shared });
            }
            for v in &handle.vertices {
                owner[*v as usize] = Some(i as u32);
            }
        }
        Ok(owner)
    }
}

impl MeshHandles {
    /// First and last time of all keys; both 0 where nothing moves.
    pub fn times(&self) -> (f64, f64) {
        let all = || self.handles.iter().filter_map(|h| h.track.times());
        let first = all().map(|t| t.0).fold(f64::INFINITY, f64::min);
        let last = all().map(|t| t.1).fold(f64::NEG_INFINITY, f64::max);
        if first <= last { (first, last) } else { (0.0, 0.0) }
    }

    /// Vertices of handles that move.
    pub fn moving(&self) -> impl Iterator<Item = u32> + '_ {
        self.handles.iter().filter(|h| h.track.times().is_some()).flat_map(|h| h.vertices.iter().copied())
    }
}
