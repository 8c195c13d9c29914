//! Detection of the file format.

use std::path::Path;

use super::MeshFormat;
use super::text::shown;
use crate::mesh::MeshError;

/// Detects the format of a mesh file by content, or by the name where the content is ambiguous.
///
/// # Errors
/// [`MeshError::UnknownFormat`].
pub fn detect_format(bytes: &[u8], name: &Path) -> Result<MeshFormat, MeshError> {
    let named = MeshFormat::of_name(name);
    if bytes.is_empty() {
        return Err(MeshError::UnknownFormat { seen: "an empty file".to_owned() });
    }
    // The header of binary STL is arbitrary and may begin with "ply" or "solid": the file size identifies the format.
    if named == Some(MeshFormat::Stl) && super::stl::is_binary(bytes) {
        return Ok(MeshFormat::Stl);
    }
    match by_content(bytes).or(named) {
        Some(format) => Ok(format),
        None if super::stl::is_binary(bytes) => Ok(MeshFormat::Stl),
        None => {
            Err(MeshError::UnknownFormat { seen: format!("it begins with {}", shown(&bytes[..bytes.len().min(16)])) })
        }
    }
}

/// The format by its magic number or first keyword, after a byte order mark and white space.
fn by_content(bytes: &[u8]) -> Option<MeshFormat> {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    let begins = |word: &[u8]| text.starts_with(word);
    if bytes.starts_with(b"glTF") {
        Some(MeshFormat::Glb)
    } else if super::fbx::is_fbx(bytes) {
        Some(MeshFormat::Fbx)
    } else if begins(b"ply\n") || begins(b"ply\r") {
        Some(MeshFormat::Ply)
    } else if begins(b"solid") {
        Some(MeshFormat::Stl)
    } else if begins(b"{") {
        Some(MeshFormat::Gltf)
    } else if begins(b"MeshVersionFormatted") {
        Some(MeshFormat::Medit)
    } else {
        super::off::is_keyword(text).then_some(MeshFormat::Off)
    }
}
