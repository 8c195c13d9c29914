//! What a file is, by its first bytes and, for texts, by its name: which workspace opens it.

use std::io::Read as _;
use std::path::{Path, PathBuf};

use crate::error::StudioError;
use plumbline_num::files::open_regular;

/// Maximum size of a pipeline file, bytes.
const MAX_PIPELINE: u64 = 4 << 20;
/// Bytes that are looked at, of binary files: headers of pictures and of meshes.
const HEAD: u64 = 64 << 10;

/// What a file is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Content {
    /// A pipeline file, with the kinds of its stages.
    Pipeline(Vec<String>),
    /// A mesh without a skin.
    Mesh,
    /// A mesh with a skin, or a skeleton.
    Character,
    /// A photo.
    Photo,
    /// For tests.
    #[cfg(any(test, debug_assertions))]
    Fake,
}

impl Content {
    /// A pipeline with a stage whose kind begins with one of these.
    pub fn has_stage(&self, prefixes: &[&str]) -> bool {
        match self {
            Self::Pipeline(stages) => stages.iter().any(|stage| prefixes.iter().any(|p| stage.starts_with(p))),
            _ => false,
        }
    }

    /// What the file is.
    ///
    /// # Errors
    /// A file that cannot be read, or is none of these.
    pub fn of(path: &Path) -> Result<Self, StudioError> {
        let fail = |why: String| StudioError::Input { path: path.to_owned(), why };
        if is_rig(path) && !path.exists() {
            return Ok(Self::Character);
        }
        let extension = extension(path);
        let limit = if extension == "toml" { MAX_PIPELINE + 1 } else { HEAD };
        let mut bytes = Vec::new();
        let file = open_regular(path).map_err(|e| fail(e.to_string()))?;
        file.take(limit).read_to_end(&mut bytes).map_err(|e| fail(e.to_string()))?;
        if extension == "toml" {
            return pipeline(&bytes).map_err(fail);
        }
        of_bytes(&bytes, &extension, path).ok_or_else(|| fail(UNKNOWN.to_owned()))
    }
}

/// Ending of the pipeline files of characters.
pub const RIG: &str = ".character.toml";

/// Whether a path is that of a character's pipeline file.
pub fn is_rig(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().ends_with(RIG))
}

/// The pipeline file of the character that is made of a mesh; another file is its own.
pub fn rig_of(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    match extension(path).as_str() {
        "toml" => path.to_owned(),
        _ => path.with_file_name(format!("{}{RIG}", name.split('.').next().unwrap_or_default())),
    }
}

const UNKNOWN: &str =
    "neither a pipeline file, nor a mesh (OBJ, PLY, OFF, STL, glTF, GLB, FBX), nor a photo (JPEG, PNG, TIFF, WebP)";

/// Extension of a path in lower case; empty where there is none.
pub fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

/// Kinds of the stages of a pipeline file.
fn pipeline(bytes: &[u8]) -> Result<Content, String> {
    if bytes.len() as u64 > MAX_PIPELINE {
        return Err(format!("the file is larger than {MAX_PIPELINE} bytes"));
    }
    let text = std::str::from_utf8(bytes).map_err(|e| e.to_string())?;
    let document: toml_edit::DocumentMut = text.parse().map_err(|e: toml_edit::TomlError| e.to_string())?;
    let stages = document.get("stage").and_then(toml_edit::Item::as_table_like);
    let kinds = stages.into_iter().flat_map(toml_edit::TableLike::iter);
    let kinds = kinds.filter_map(|(_, stage)| Some(stage.as_table_like()?.get("use")?.as_str()?.to_owned()));
    Ok(Content::Pipeline(kinds.collect()))
}

fn of_bytes(bytes: &[u8], extension: &str, path: &Path) -> Option<Content> {
    // By name first: the header of a binary STL is any 80 bytes.
    match extension {
        "glb" | "gltf" => Some(gltf(bytes, path)),
        "fbx" => Some(fbx(path)),
        "ply" | "off" | "obj" | "stl" => Some(Content::Mesh),
        "bvh" => Some(Content::Character),
        #[cfg(any(test, debug_assertions))]
        "fake" => Some(Content::Fake),
        _ if image::guess_format(bytes).is_ok() => Some(Content::Photo),
        _ if bytes.starts_with(b"glTF") => Some(gltf(bytes, path)),
        _ if bytes.starts_with(b"Kaydara FBX Binary") => Some(fbx(path)),
        _ if [b"ply\n".as_slice(), b"ply\r", b"OFF", b"solid "].iter().any(|magic| bytes.starts_with(magic)) => {
            Some(Content::Mesh)
        }
        _ => None,
    }
}

/// A glTF file with a skin is a character. The JSON chunk of a GLB comes first.
fn gltf(head: &[u8], path: &Path) -> Content {
    let has_skin = |json: &[u8]| {
        let value: Option<serde_json::Value> = serde_json::from_slice(json).ok();
        value.is_some_and(|v| v.get("skins").and_then(|s| s.as_array()).is_some_and(|s| !s.is_empty()))
    };
    let json = json_of(head, path).unwrap_or_default();
    if has_skin(&json) { Content::Character } else { Content::Mesh }
}

/// An FBX file with a cluster of weights is a character. Its objects are in any order.
fn fbx(path: &Path) -> Content {
    let mut bytes = Vec::new();
    let read = open_regular(path).and_then(|file| file.take(MAX_FBX).read_to_end(&mut bytes));
    // The kind of an object, as text of seven bytes.
    let is_kind = |window: &[u8]| window == b"S\x07\0\0\0Cluster";
    if read.is_ok() && bytes.windows(12).any(is_kind) { Content::Character } else { Content::Mesh }
}

/// Bytes of an FBX file that are looked into; where the first cluster is behind them the file is taken for a mesh.
const MAX_FBX: u64 = 256 << 20;

/// Maximum size of the JSON of a glTF file that is looked into, bytes; where it is larger the file is taken for a mesh.
const MAX_JSON: u64 = 64 << 20;

fn json_of(head: &[u8], path: &Path) -> Option<Vec<u8>> {
    let mut file = open_regular(path).ok()?;
    let mut length = MAX_JSON;
    if head.starts_with(b"glTF") {
        length = u64::from(u32::from_le_bytes(head.get(12..16)?.try_into().ok()?)).min(MAX_JSON);
        file.read_exact(&mut [0; 20]).ok()?;
    }
    let mut json = Vec::new();
    file.take(length).read_to_end(&mut json).ok()?;
    Some(json)
}

#[cfg(test)]
#[path = "content_tests.rs"]
mod tests;
