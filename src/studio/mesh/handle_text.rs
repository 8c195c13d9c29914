//! The file of handles: read into a document, and written from it. What was not edited is written as it was described.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use nalgebra::Point3;
use serde_json::Value;

use super::document::{Handle, MeshDocument, NamedSet, Region};
use super::pipeline_text::PipelineText;
use crate::error::StudioError;
use plumbline_shape::surface::handle_file::HandleFile;

/// Maximum size of a file of handles, bytes: that of the library's reader.
pub const MAX_BYTES: u64 = 1 << 27;

/// The document of a pipeline and the text of its file of handles; `None` where there is no file yet.
///
/// # Errors
/// What is wrong with the file, with its path.
pub fn read(
    pipeline: PipelineText,
    text: Option<&[u8]>,
    path: &Path,
    rest: &[Point3<f64>],
) -> Result<MeshDocument, StudioError> {
    let fail = |why: String| StudioError::Input { path: path.to_owned(), why };
    let mut document = MeshDocument {
        pipeline,
        handles: Vec::new(),
        sets: Arc::default(),
        region: Arc::default(),
        selection: Arc::default(),
        active: None,
    };
    let Some(text) = text else { return Ok(document) };
    let text = std::str::from_utf8(text).map_err(|e| fail(e.to_string()))?;
    let file = HandleFile::parse(text).map_err(|e| fail(e.to_string()))?;
    let found = file.of_mesh_or_draft(rest).map_err(|e| fail(e.to_string()))?;
    let sets = file.sets_of_mesh(rest).map_err(|e| fail(e.to_string()))?;
    let value: Value = serde_json::from_str(text).map_err(|e| fail(e.to_string()))?;
    let described = |k: usize| value["handles"][k].get("vertices").cloned();
    let handles = found.handles.into_iter().enumerate();
    document.handles = handles.map(|(k, mesh)| Arc::new(Handle { mesh, described: described(k) })).collect();
    let set = |(name, vertices): (String, Vec<u32>)| {
        let described = value["sets"].get(&name).cloned();
        (name, Arc::new(NamedSet { vertices, described }))
    };
    document.sets = Arc::new(sets.into_iter().map(set).collect());
    document.region = Arc::new(Region { outside: found.outside, described: value.get("region").cloned() });
    document.active = (!document.handles.is_empty()).then_some(0);
    Ok(document)
}

/// The text of the file of handles.
pub fn write(document: &MeshDocument) -> String {
    let sets: BTreeMap<String, Vec<u32>> =
        document.sets.iter().map(|(name, set)| (name.clone(), set.vertices.clone())).collect();
    let text = document.mesh_handles().to_json_with_sets(&sets);
    let Ok(mut value) = serde_json::from_str::<Value>(&text) else { return text };
    for (k, handle) in document.handles.iter().enumerate() {
        // Positions are in the order of the vertices, which these list.
        let ordered = value["handles"][k].get("positions").is_some();
        if let (Some(described), false) = (&handle.described, ordered) {
            value["handles"][k]["vertices"] = described.clone();
        }
    }
    for (name, set) in document.sets.iter() {
        if let Some(described) = &set.described {
            value["sets"][name] = described.clone();
        }
    }
    if let Some(described) = &document.region.described {
        value["region"] = described.clone();
    }
    format!("{value}\n")
}
