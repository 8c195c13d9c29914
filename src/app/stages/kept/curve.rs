//! The curve in the middle of a surface, of which a skeleton is made.

use serde_json::json;

use super::surface::digest_of_mesh;
use super::{Kept, SKELETON, Slot, kept};
use crate::pipeline::RunError;
use crate::stages::context::Context;
use plumbline_shape::character::CurveSkeleton;
use plumbline_shape::character::extraction::{ExtractionOptions, ExtractionReport, Keep, skeleton_of};
use plumbline_shape::character::skeleton_file::SkeletonFile;
use plumbline_shape::mesh::TriMesh;

#[derive(PartialEq)]
struct Extracted(CurveSkeleton, ExtractionReport);

impl Kept for Extracted {
    const FILES: &'static [&'static str] = &["curve.json", "report.json"];

    fn to_files(&self) -> Option<Vec<Vec<u8>>> {
        // The format is that of a skeleton with its curve.
        let skeleton = skeleton_of(&self.0, None).ok()?;
        let file = SkeletonFile { skeleton, curve: Some(self.0.clone()), clips: Vec::new(), proposed_names: None };
        Some(vec![file.to_json().into_bytes(), serde_json::to_vec(&self.1).ok()?])
    }

    fn of_files(files: &[Vec<u8>]) -> Result<Self, String> {
        let text = str::from_utf8(&files[0]).map_err(|e| e.to_string())?;
        let curve = SkeletonFile::parse(text).map_err(|e| e.to_string())?.curve.ok_or("no curve")?;
        Ok(Self(curve, serde_json::from_slice(&files[1]).map_err(|e| e.to_string())?))
    }
}

/// The curve of a surface, computed where it is not kept.
pub(crate) fn curve_of(
    context: &mut Context<'_, '_>,
    mesh: &TriMesh,
    options: &ExtractionOptions,
    compute: impl FnOnce(&mut Context<'_, '_>) -> Result<(CurveSkeleton, ExtractionReport), RunError>,
) -> Result<(CurveSkeleton, ExtractionReport), RunError> {
    let slot = Slot::of(context, context.at, &SKELETON, |_| {
        let keep = match &options.keep {
            Keep::Nothing => json!("nothing"),
            Keep::Extrema => json!("extrema"),
            Keep::Vertices(all) => json!(blake3::hash(format!("{all:?}").as_bytes()).to_hex().as_str()),
        };
        Ok([("mesh", json!(digest_of_mesh(mesh)?)), ("options", json!(options)), ("keep", keep)])
    });
    let vertices = mesh.vertex_count();
    let fits = |found: &Extracted| found.0.node_of_vertex.len() == vertices;
    let found = kept(slot.as_ref(), context, fits, |context| {
        let (curve, report) = compute(context)?;
        Ok(Extracted(curve, report))
    })?;
    Ok((found.0, found.1))
}
