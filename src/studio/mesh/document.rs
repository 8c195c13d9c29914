//! The document: pipeline file, handles, named sets, region, selection.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde_json::Value;

use super::pipeline_text::PipelineText;
use crate::error::StudioError;
use plumbline_shape::surface::handle_file::{MeshHandle, MeshHandles};

/// Maximum number of handles: more than a list can show.
pub const MAX_HANDLES: usize = 1000;
/// Maximum number of named sets, as in files of handles.
pub const MAX_SETS: usize = 1000;
/// Maximum length of names, bytes.
pub const MAX_NAME: usize = 200;

/// A handle, and how the file described its vertices.
#[derive(Clone, Debug, PartialEq)]
pub struct Handle {
    /// The handle.
    pub mesh: MeshHandle,
    /// The `vertices` of the file while they are those: a half-space stays one when the file is written again.
    pub described: Option<Value>,
}

/// Vertices under a name.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedSet {
    /// Ascending.
    pub vertices: Vec<u32>,
    /// As the file described them.
    pub described: Option<Value>,
}

/// Vertices that may not move.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Region {
    /// Vertices outside the region and the handles, ascending.
    pub outside: Vec<u32>,
    /// The `region` of the file while it is that.
    pub described: Option<Value>,
}

/// What the files of a deformation say, and the selection.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshDocument {
    /// The pipeline file.
    pub pipeline: PipelineText,
    /// The handles, in the order of the file.
    pub handles: Vec<Arc<Handle>>,
    /// Named sets of vertices.
    pub sets: Arc<BTreeMap<String, Arc<NamedSet>>>,
    /// The region of influence.
    pub region: Arc<Region>,
    /// Selected vertices, ascending. In no file.
    pub selection: Arc<[u32]>,
    /// The handle that is edited. In no file.
    pub active: Option<usize>,
}

impl MeshDocument {
    /// The handles as the library takes them.
    pub fn mesh_handles(&self) -> MeshHandles {
        MeshHandles {
            handles: self.handles.iter().map(|h| h.mesh.clone()).collect(),
            outside: self.outside().collect(),
        }
    }

    /// Vertices that are fixed because they are outside the region; those of handles are not among them.
    pub fn outside(&self) -> impl Iterator<Item = u32> {
        let outside = &self.region.outside;
        let mut free = vec![true; outside.last().map_or(0, |last| *last as usize + 1)];
        for v in self.handles.iter().flat_map(|h| &h.mesh.vertices) {
            free.get_mut(*v as usize).into_iter().for_each(|free| *free = false);
        }
        outside.iter().copied().filter(move |v| free[*v as usize])
    }

    /// A handle.
    ///
    /// # Errors
    /// [`StudioError::Request`] where there is none of that number.
    pub fn handle(&self, index: usize) -> Result<&Arc<Handle>, StudioError> {
        let count = self.handles.len();
        self.handles.get(index).ok_or_else(|| StudioError::request(format!("there is no handle {index} of {count}")))
    }

    /// A handle to be changed: shared ones are copied first.
    ///
    /// # Errors
    /// As [`Self::handle`].
    pub fn handle_mut(&mut self, index: usize) -> Result<&mut Handle, StudioError> {
        self.handle(index)?;
        Ok(Arc::make_mut(&mut self.handles[index]))
    }

    /// First and last time of all keys; both 0 without motion.
    pub fn times(&self) -> (f64, f64) {
        let all = || self.handles.iter().filter_map(|h| h.mesh.track.times());
        let first = all().map(|t| t.0).fold(f64::INFINITY, f64::min);
        let last = all().map(|t| t.1).fold(f64::NEG_INFINITY, f64::max);
        if first <= last { (first, last) } else { (0.0, 0.0) }
    }
}
