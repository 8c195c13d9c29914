//! glTF 2.0, as JSON (`.gltf`) or in one binary file (`.glb`; `.vrm`, a person, is read as one).
//!
//! Read: all triangles, strips and fans of the scene, transformed by their nodes; positions, normals, the first sets of texture
//! coordinates and colors, also quantized, sparse or compressed with meshopt; node names as objects; materials with their textures, samplers and images,
//! passed through unparsed. A skinned mesh is read in its bind pose, as the specification requires. Nodes, skins with up to
//! eight influences per vertex, morph targets and animations are preserved as an
//! [`Articulation`](crate::mesh::model::articulation::Articulation) and written again. Cameras and lights are ignored. Buffers
//! may be in the file, in `data:` URIs or in files of the same folder; nothing outside that folder, and those that the limits
//! allow besides, is opened.
//!
//! # Reference
//! Khronos Group, *glTF 2.0 specification*, ISO/IEC 12113.

mod accessor;
mod articulation;
mod buffers;
mod document;
mod input;
mod meshopt;
mod scene;
mod write;

use std::path::Path;

use super::{MeshFormat, ReadLimits, malformed};
use crate::mesh::{GltfAssets, MeshError, ModelBuilder, Position};
use buffers::Buffers;
use document::Document;
use input::Input;
use plumbline_num::document::JsonCosts;
use plumbline_num::document::gltf::{BINARY_CHUNK, JSON_CHUNK, MAGIC};
use plumbline_num::run::Run;

pub(super) use scene::normal_matrix;
pub(super) use write::{MAX_INFLUENCES, write};

/// Prefixes of required extensions that do not prevent reading the geometry: quantization and meshopt compression are supported,
/// and the others concern textures, materials, lights, and the roles of bones and expressions (VRM) only.
const HARMLESS: [&str; 7] = [
    "KHR_mesh_quantization",
    meshopt::EXTENSION,
    "KHR_texture_",
    "KHR_materials_",
    "EXT_texture_",
    "KHR_lights_",
    "VRM",
];

fn fault(at: impl Into<String>, told: impl Into<String>) -> MeshError {
    malformed(MeshFormat::Gltf, Position::Json(at.into()), told)
}

/// The item of a list that the value at `at` refers to.
fn item<'a, T>(list: &'a [T], index: usize, at: impl Into<String>, what: &str) -> Result<&'a T, MeshError> {
    let missing = || fault(at, format!("there is no {what} {index}; there are {}, numbered from 0", list.len()));
    list.get(index).ok_or_else(missing)
}

/// Reads the file. `folder` contains the files that it references.
pub(super) fn read(
    bytes: &[u8],
    format: MeshFormat,
    folder: Option<&Path>,
    limits: &ReadLimits,
    run: &Run,
) -> Result<ModelBuilder, MeshError> {
    let (json, binary) = if format == MeshFormat::Glb { chunks(bytes)? } else { (bytes, None) };
    let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
    JsonCosts::OF_VALUES.check(json, bytes.len() as u64).map_err(|memory| {
        let told = format!("its values would take {memory} bytes of memory, and the file has {}", bytes.len());
        fault("", format!("{told}: is this the right file?"))
    })?;
    let document: Document = serde_json::from_slice(json)
        .map_err(|e| malformed(format, Position::Line(e.line()), format!("not glTF: {e}")))?;
    let version = &document.asset.version;
    if !version.starts_with("2.") {
        return Err(fault("/asset/version", format!("{version:?}; only glTF 2 is read: convert the file first")));
    }
    if let Some(name) = document.extensions_required.iter().find(|name| !HARMLESS.iter().any(|h| name.starts_with(h))) {
        let told = format!("{name} is not read; write the file again without it (compression, most often)");
        return Err(fault("/extensionsRequired", told));
    }
    let buffers = Buffers::load(&document, binary, folder, limits)?;
    let size = bytes.len() as u64 + buffers.read_bytes();
    let mut builder = scene::read(&Input::new(&document, &buffers, limits, size), run)?;
    builder.assets = assets(&document, &buffers, size)?;
    Ok(builder)
}

/// The JSON chunk and the optional binary chunk of a GLB file. Layout: a 12-byte header (magic, version, length), then chunks
/// of length, type and data; unknown chunks are skipped.
fn chunks(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), MeshError> {
    let fault = |at: usize, told: String| malformed(MeshFormat::Glb, Position::Byte(at), told);
    let word = |at: usize| {
        let raw = bytes
            .get(at..at + 4)
            .ok_or_else(|| fault(at, "the file ends inside its header; it is cut short".to_owned()))?;
        Ok::<_, MeshError>(u32::from_le_bytes(raw.try_into().expect("four bytes")))
    };
    if !bytes.starts_with(MAGIC) || word(4)? != 2 {
        return Err(fault(4, "not version 2 of binary glTF; convert the file first".to_owned()));
    }
    let length = word(8)? as usize;
    if length > bytes.len() {
        return Err(fault(
            8,
            format!("{length} bytes are announced, but the file has {}; it is cut short", bytes.len()),
        ));
    }
    let (mut at, mut json, mut binary) = (12, None, None);
    while at + 8 <= length {
        let (size, kind) = (word(at)? as usize, word(at + 4)?);
        let Some(chunk) = bytes[..length].get(at + 8..(at + 8).saturating_add(size)) else {
            return Err(fault(at, format!("a chunk of {size} bytes is longer than the file; it is cut short")));
        };
        match kind {
            JSON_CHUNK if json.is_none() => json = Some(chunk),
            BINARY_CHUNK if binary.is_none() => binary = Some(chunk),
            _ => {}
        }
        at += 8 + size;
    }
    let json = json.ok_or_else(|| fault(12, "the file has no JSON chunk".to_owned()))?;
    Ok((json, binary))
}

/// Textures, samplers and images of the materials; images in buffer views with their bytes, together no more than the `size` of
/// the files: each has its own copy, and many may name one view.
fn assets(document: &Document, buffers: &Buffers<'_>, size: u64) -> Result<Option<GltfAssets>, MeshError> {
    let (mut images, mut image_bytes, mut copied) = (document.images.clone(), Vec::new(), 0);
    for (k, image) in images.iter_mut().enumerate() {
        let view = image.as_object_mut().and_then(|fields| fields.remove("bufferView"));
        let bytes = match view.and_then(|view| view.as_u64()) {
            Some(view) => {
                let bytes = buffers.view(document, view as usize, &format!("/images/{k}"))?.bytes;
                copied += bytes.len() as u64;
                if copied > size {
                    let told = format!("the images up to this one have {copied} bytes, of files of {size}");
                    return Err(fault(format!("/images/{k}"), told));
                }
                Some(bytes.to_vec())
            }
            None => None,
        };
        image_bytes.push(bytes);
    }
    let concerns =
        |name: &&String| ["KHR_materials_", "KHR_texture_", "EXT_texture_"].iter().any(|p| name.starts_with(p));
    let assets = GltfAssets {
        textures: document.textures.clone(),
        samplers: document.samplers.clone(),
        images,
        image_bytes,
        extensions: document.extensions_used.iter().filter(concerns).cloned().collect(),
    };
    Ok(Some(assets).filter(|assets| *assets != GltfAssets::default()))
}

#[cfg(test)]
mod moving_tests;
#[cfg(test)]
mod tests;
