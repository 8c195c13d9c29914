//! Handle files: constrained vertices and their motions over time.
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
//! The file has the constraints only, neither a skeleton pose nor an animation of all vertices. A handle without `rigid` and
//! `positions` is fixed. `rigid` rotates about `pivot` (default: the centroid of the handle's vertices), then translates;
//! `positions` has one position per vertex of `indices` or `nearest`, in their order. With `keys` both change over time
//! ([`Track`]). Vertices outside `region` are fixed. Vertex indices start at 0, in the order of the mesh file; positions are in
//! its units. Unknown keys are rejected.

mod document;
mod error;
mod selection;
#[cfg(test)]
mod tests;
mod track;
mod write;

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Point3;

#[cfg(feature = "schema")]
pub use document::handle_file_schema;
pub use error::HandleFileError;
pub use track::{Interpolation, KeyRotation, RigidKey, Track};

use document::{Document, rejected};
use plumbline_num::document::Kind;
use selection::{Selection, Selector};

/// 128 MiB: targets of a million vertices with all digits.
const KIND: Kind = Kind { name: "a file of handles", format: "plumbline.handles", max_bytes: 1 << 27 };

/// Maximum number of named sets: far above what a person names, and their masks stay within the memory of the mesh.
const MAX_SETS: usize = 1000;

/// Handles of a file, not yet resolved on a mesh.
#[derive(Clone, Debug)]
pub struct HandleFile {
    sets: BTreeMap<String, Selection>,
    handles: Vec<document::HandleEntry>,
    region: Option<Selection>,
}

/// Handles resolved on a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshHandles {
    /// The handles, with disjoint vertices.
    pub handles: Vec<MeshHandle>,
    /// Fixed vertices outside the region and the handles, ascending.
    pub outside: Vec<u32>,
}

/// A handle of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshHandle {
    /// Name in messages.
    pub name: String,
    /// Its vertices, ascending.
    pub vertices: Vec<u32>,
    /// Weight of soft constraints relative to the stiffness of the mesh; `None` for hard constraints.
    pub weight: Option<f64>,
    /// Targets of the vertices over time.
    pub track: Track,
}

impl HandleFile {
    /// Reads a file.
    ///
    /// # Errors
    /// [`HandleFileError`]: as [`HandleFile::parse`], or a file that is too large or cannot be read.
    pub fn read(path: &Path) -> Result<Self, HandleFileError> {
        Self::parse(&KIND.text(path)?)
    }

    /// Parses the text of a file.
    ///
    /// # Errors
    /// [`HandleFileError::Document`]; [`HandleFileError::Value`] names the handle and field.
    pub fn parse(text: &str) -> Result<Self, HandleFileError> {
        let document: Document = KIND.parse(text)?;
        let sets = document.sets.len();
        if sets > MAX_SETS {
            return Err(rejected("the file", "sets", format!("a table of {sets}"), &format!("at most {MAX_SETS}")));
        }
        let file = Self { sets: document.sets, handles: document.handles, region: document.region };
        for (i, entry) in file.handles.iter().enumerate() {
            entry.check(&file.context(i))?;
        }
        Ok(file)
    }

    /// The handle in messages.
    fn context(&self, i: usize) -> String {
        match &self.handles[i].name {
            Some(name) => format!("handle {name:?}"),
            None => format!("handle {}", i + 1),
        }
    }

    /// Resolves the handles on a mesh with these vertex positions.
    ///
    /// # Errors
    /// [`HandleFileError`]: vertices that do not exist, unknown or circular sets, handles without vertices, a vertex in two handles,
    /// a number of positions other than that of the vertices.
    pub fn of_mesh(&self, positions: &[Point3<f64>]) -> Result<MeshHandles, HandleFileError> {
        if self.handles.is_empty() {
            return Err(rejected("the file", "handles", "an empty list", "at least one handle"));
        }
        self.of_mesh_or_draft(positions)
    }

    /// The same for a file that is being made, which may have no handle yet.
    ///
    /// # Errors
    /// As [`Self::of_mesh`].
    pub fn of_mesh_or_draft(&self, positions: &[Point3<f64>]) -> Result<MeshHandles, HandleFileError> {
        let selector = Selector::new(positions, &self.sets);
        let mut handles = Vec::with_capacity(self.handles.len());
        let mut owner: Vec<Option<u32>> = vec![None; positions.len()];
        for (i, entry) in self.handles.iter().enumerate() {
            let context = self.context(i);
            let listed = selector.listed(&entry.vertices, &context)?;
            let mut vertices = listed.clone();
            vertices.sort_unstable();
            vertices.dedup();
            if vertices.is_empty() {
                let (low, high) = selector.extent();
                return Err(HandleFileError::Empty { context, low, high });
            }
            let track = entry.track(&context, &listed, &vertices, positions)?;
            // Before the next handle is read: handles of all vertices would take the memory of the mesh each.
            self.claim(i, &vertices, &mut owner)?;
            let name = entry.name.clone().unwrap_or_else(|| format!("{}", i + 1));
            handles.push(MeshHandle { name, vertices, weight: entry.weight, track });
        }
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

    /// Whether the file has no handle: one that is being made, with its sets alone.
    pub fn is_empty(&self) -> bool {
        self.handles.is_empty()
    }

    /// The named sets on a mesh with these vertex positions: their vertices, ascending.
    ///
    /// # Errors
    /// [`HandleFileError`]: vertices that do not exist, unknown or circular sets.
    pub fn sets_of_mesh(&self, positions: &[Point3<f64>]) -> Result<BTreeMap<String, Vec<u32>>, HandleFileError> {
        let selector = Selector::new(positions, &self.sets);
        let vertices = |(name, selection): (&String, &Selection)| {
            let mask = selector.mask(selection, &format!("set {name:?}"))?;
            let inside = (0..mask.len()).filter(|v| mask[*v]).map(|v| v as u32).collect();
            Ok((name.clone(), inside))
        };
        self.sets.iter().map(vertices).collect()
    }

    /// Makes handle `i` the owner of its vertices.
    fn claim(&self, i: usize, vertices: &[u32], owner: &mut [Option<u32>]) -> Result<(), HandleFileError> {
        if let Some(&vertex) = vertices.iter().find(|v| owner[**v as usize].is_some()) {
            let other = owner[vertex as usize];
            let first = self.context(other.unwrap_or(0) as usize);
            let count = vertices.iter().filter(|v| owner[**v as usize] == other).count();
            return Err(HandleFileError::Overlap { vertex, first, second: self.context(i), count });
        }
        for v in vertices {
            owner[*v as usize] = Some(i as u32);
        }
        Ok(())
    }
}

impl MeshHandles {
    /// First and last time of all keys; both 0 without motion.
    pub fn times(&self) -> (f64, f64) {
        let all = || self.handles.iter().filter_map(|h| h.track.times());
        let first = all().map(|t| t.0).fold(f64::INFINITY, f64::min);
        let last = all().map(|t| t.1).fold(f64::NEG_INFINITY, f64::max);
        if first <= last { (first, last) } else { (0.0, 0.0) }
    }

    /// Times of so many poses: evenly from the first key to the last; the last alone for one.
    pub fn frame_times(&self, frames: u32) -> impl Iterator<Item = f64> + use<> {
        let (first, last) = self.times();
        let fraction = move |i: u32| if frames <= 1 { 1.0 } else { f64::from(i) / f64::from(frames - 1) };
        (0..frames.max(1)).map(move |i| first * (1.0 - fraction(i)) + last * fraction(i))
    }

    /// Vertices of moving handles.
    pub fn moving(&self) -> impl Iterator<Item = u32> + '_ {
        self.handles.iter().filter(|h| h.track.times().is_some()).flat_map(|h| h.vertices.iter().copied())
    }
}
