//! Mesh files: OBJ, PLY, OFF, STL, glTF and GLB read and written, Medit `.mesh` read.
//!
//! Readers are strict about what a mesh depends on (counts, indices, finite positions) and say where in the file the fault is;
//! what they leave out they list in [`Model::warnings`]. Counts in a header are held against the size of the file before memory
//! is taken for them. Formats are told by content first, by the name's extension where the content leaves it open.

mod detect;
mod gltf;
mod medit;
mod obj;
mod off;
mod ply;
mod stl;
mod text;
mod write;

use std::fmt;
use std::io::Read as _;
use std::path::Path;

use super::{MeshError, Model, Position};
use plumbline_num::run::Run;

pub use write::{WriteOptions, encode_model, losses, write_model, write_model_with};

/// Formats of mesh files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum MeshFormat {
    /// Wavefront OBJ.
    Obj,
    /// Stanford polygon file.
    Ply,
    /// Object file format of Geomview.
    Off,
    /// Stereolithography.
    Stl,
    /// glTF 2.0 as JSON.
    Gltf,
    /// glTF 2.0 in one binary file.
    Glb,
    /// Medit `.mesh` (read only).
    Medit,
}

impl MeshFormat {
    /// The format of a name's extension.
    pub fn of_name(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        Some(match extension.as_str() {
            "obj" => Self::Obj,
            "ply" => Self::Ply,
            "off" | "coff" | "noff" => Self::Off,
            "stl" => Self::Stl,
            "gltf" => Self::Gltf,
            "glb" => Self::Glb,
            "mesh" => Self::Medit,
            _ => return None,
        })
    }
}

impl fmt::Display for MeshFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Obj => "OBJ",
            Self::Ply => "PLY",
            Self::Off => "OFF",
            Self::Stl => "STL",
            Self::Gltf => "glTF",
            Self::Glb => "GLB",
            Self::Medit => "Medit mesh",
        })
    }
}

/// What a reader may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadLimits {
    /// Largest size of the file and the files it refers to, together, bytes.
    pub max_bytes: u64,
    /// Largest number of vertices, and of face corners. A glTF file may instantiate one mesh many times.
    pub max_elements: u64,
}

impl Default for ReadLimits {
    /// 4 GiB, 2²⁸ vertices and corners.
    fn default() -> Self {
        Self { max_bytes: 4 << 30, max_elements: 1 << 28 }
    }
}

impl ReadLimits {
    fn check(&self, what: &'static str, value: usize) -> Result<(), MeshError> {
        let (value, limit) = (value as u64, self.max_elements);
        if value > limit { Err(MeshError::TooLarge { what, value, limit }) } else { Ok(()) }
    }
}

/// Reads a mesh file.
///
/// # Errors
/// [`MeshError::InFile`] with the fault; [`MeshError::Interrupted`].
pub fn read_model(path: &Path, limits: &ReadLimits, run: &Run) -> Result<Model, MeshError> {
    let read = || {
        let bytes = read_file(path, limits.max_bytes)?;
        let format = detect::format(&bytes, path)?;
        decode_model(&bytes, format, path.parent().or(Some(Path::new("."))), limits, run)
    };
    read().map_err(|fault: MeshError| fault.of_file(path))
}

/// The format of a mesh file's bytes; the name decides where they leave it open.
///
/// # Errors
/// [`MeshError::UnknownFormat`].
pub fn detect_format(bytes: &[u8], name: &Path) -> Result<MeshFormat, MeshError> {
    detect::format(bytes, name)
}

/// The model in these bytes. `folder` is where a glTF file may refer to other files; `None` allows none.
///
/// # Errors
/// [`MeshError::Malformed`] where the bytes are not what the format asks for, [`MeshError::TooLarge`] beyond the limits,
/// [`MeshError::Interrupted`].
pub fn decode_model(
    bytes: &[u8],
    format: MeshFormat,
    folder: Option<&Path>,
    limits: &ReadLimits,
    run: &Run,
) -> Result<Model, MeshError> {
    let builder = match format {
        MeshFormat::Obj => obj::read(bytes, run)?,
        MeshFormat::Ply => ply::read(bytes, run)?,
        MeshFormat::Off => off::read(bytes, run)?,
        MeshFormat::Stl => stl::read(bytes, run)?,
        MeshFormat::Gltf | MeshFormat::Glb => gltf::read(bytes, format, folder, limits, run)?,
        MeshFormat::Medit => medit::read(bytes, run)?,
    };
    limits.check("number of vertices", builder.positions.len())?;
    limits.check("number of corners", builder.faces.corner_count())?;
    run.check()?;
    builder.finish()
}

/// All bytes of a regular file within the size limit.
fn read_file(path: &Path, limit: u64) -> Result<Vec<u8>, MeshError> {
    let fault = |e: std::io::Error| match e.kind() {
        std::io::ErrorKind::NotFound => MeshError::Unreadable { reason: "no such file; check the name".to_owned() },
        _ => MeshError::Unreadable { reason: e.to_string() },
    };
    let about = std::fs::metadata(path).map_err(fault)?;
    if !about.is_file() {
        return Err(MeshError::Unreadable { reason: "not a file; give the path of a mesh file".to_owned() });
    }
    let too_large = |value: u64| MeshError::TooLarge { what: "number of bytes", value, limit };
    if about.len() > limit {
        return Err(too_large(about.len()));
    }
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).map_err(fault)?;
    // The file may grow while it is read.
    file.take(limit.saturating_add(1)).read_to_end(&mut bytes).map_err(fault)?;
    if bytes.len() as u64 > limit { Err(too_large(bytes.len() as u64)) } else { Ok(bytes) }
}

/// A fault of a file.
fn malformed(format: MeshFormat, at: Position, fault: impl Into<String>) -> MeshError {
    MeshError::Malformed { format, at, fault: fault.into() }
}

/// Position of vertex `vertex`, rejected unless finite.
fn finite(
    format: MeshFormat,
    at: impl FnOnce() -> Position,
    vertex: usize,
    xyz: [f64; 3],
) -> Result<nalgebra::Point3<f64>, MeshError> {
    if xyz.iter().all(|c| c.is_finite()) {
        return Ok(xyz.into());
    }
    let [x, y, z] = xyz;
    Err(malformed(format, at(), MeshError::NotFinite { vertex, x, y, z }.to_string()))
}

/// Replaces non-finite normals or texture coordinates: they do not justify rejecting the shape.
fn or_zero(value: f64) -> f64 {
    if value.is_finite() { value } else { 0.0 }
}

#[cfg(test)]
mod tests;
