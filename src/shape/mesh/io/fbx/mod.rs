//! FBX in its binary form, versions 7.0 to 7.7 (read only).
//!
//! A file is a tree of records ([`binary`]), among them objects and the connections between them ([`document`]):
//!
//! ```text
//! Geometry → Model                     polygons at a node of the hierarchy
//! Model → Model                        a child and its parent
//! Model → Cluster → Skin → Geometry    a joint, its weights, and the mesh that it deforms
//! Shape → BlendShapeChannel → BlendShape → Geometry
//! AnimationCurve → AnimationCurveNode → property of a Model or a BlendShapeChannel
//! ```
//!
//! Read: polygons with normals, the first sets of texture coordinates and colors, names of materials; the transforms of nodes with
//! pivots, pre- and post-rotations, rotation orders and inheritance of scale; skins in their bind pose, blend shapes, animations of the
//! first layer. They become a model with an [`Articulation`](crate::mesh::model::articulation::Articulation), as those of glTF, in its
//! units and axes: meters, y up, the front toward +z. Materials beyond their names, textures, cameras, lights and constraints are left
//! out. Animation curves are sampled: at their keys, and between them to the tolerances of [`sampling`].
//!
//! Memory is bounded: a file may decompress to [`PER_COMPRESSED_BYTE`] times its compressed bytes, and arrays that several objects
//! refer to are counted each time.
//!
//! # Reference
//! A. Gessler, C. Barton, *FBX binary file format specification*, Blender Foundation, 2013 (records and arrays). Autodesk, *FBX SDK
//! Developer Guide*, "Computing transformation matrices" (pivots), "Node transformation inheritance", "Cluster" (bind matrices).

mod animation;
mod binary;
mod curve;
mod document;
mod geometry;
mod properties;
mod reader;
mod sampling;
mod scene;
mod shapes;
mod skin;
mod transform;

use super::{MeshFormat, ReadLimits, malformed};
use crate::mesh::{MeshError, ModelBuilder, Position};
use plumbline_num::run::Run;

/// First bytes of a binary file.
pub(super) const MAGIC: &[u8] = b"Kaydara FBX Binary  \0";

/// First bytes of a file in text form.
const TEXT: &[u8] = b"; FBX";

/// Whether the bytes are those of an FBX file, binary or text.
pub(super) fn is_fbx(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC) || bytes.starts_with(TEXT)
}

fn fault(at: usize, told: impl Into<String>) -> MeshError {
    malformed(MeshFormat::Fbx, Position::Byte(at), told)
}

/// Reads the file.
pub(super) fn read(bytes: &[u8], limits: &ReadLimits, run: &Run) -> Result<ModelBuilder, MeshError> {
    if !bytes.starts_with(MAGIC) {
        let told = if bytes.starts_with(TEXT) || bytes.iter().take(256).all(|b| b.is_ascii() && *b != 0) {
            "FBX as text (ASCII); only binary FBX is read: export the model as binary FBX or as glTF (Blender, \
             `assimp export IN.fbx OUT.glb`)"
        } else {
            "not FBX: it does not begin with \"Kaydara FBX Binary\""
        };
        return Err(fault(0, told));
    }
    let tree = binary::Tree::parse(bytes, run)?;
    let reader = reader::Reader::new(tree, limits, run);
    let document = document::Document::of(&reader)?;
    scene::read(&document)
}

#[cfg(test)]
mod tests;
