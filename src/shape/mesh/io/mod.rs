//! Mesh files: OBJ, PLY, OFF, STL, glTF and GLB read and written, Medit `.mesh` and binary FBX read.
//!
//! Readers validate counts, indices and finite positions strictly (unless [`ReadLimits::mend_vertices`]) and report the position
//! of a fault in the file; ignored contents are listed in [`Model::warnings`]. Counts in a header are checked against the file
//! size before allocation. The format is detected by content first, then by the file name extension.

mod detect;
mod fbx;
mod gltf;
mod medit;
mod obj;
mod off;
mod ply;
mod scalar;
mod stl;
mod text;
mod write;

use std::fmt;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use super::{MeshError, Model, ModelBuilder, Position};
use plumbline_num::files::open_regular;
use plumbline_num::run::Run;

pub use detect::detect_format;
pub use write::{WriteOptions, encode_model, losses, write_model, write_model_if, write_model_with};

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
    /// Binary FBX (read only), in meters with y up.
    Fbx,
}

impl MeshFormat {
    /// The format of a file name extension.
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
            "fbx" => Self::Fbx,
            _ => return None,
        })
    }

    /// Whether models can be written in this format.
    ///
    /// # Example
    /// ```
    /// use plumbline_shape::mesh::MeshFormat;
    ///
    /// assert!(MeshFormat::Glb.is_writable() && !MeshFormat::Fbx.is_writable());
    /// ```
    pub fn is_writable(self) -> bool {
        !matches!(self, Self::Medit | Self::Fbx)
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
            Self::Fbx => "FBX",
        })
    }
}

/// Limits of the readers, for hostile files: sizes, which bound memory, the folders of files that are opened, and what is mended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReadLimits {
    /// Maximum total size of the file and the files it references, bytes.
    pub max_bytes: u64,
    /// Maximum number of vertices, and of face corners. Not bounded by the file size: a glTF file may instantiate one mesh many
    /// times.
    pub max_elements: u64,
    /// Folders of files that a mesh file may name, besides its own folder.
    pub allow_paths: Vec<PathBuf>,
    /// Whether vertices with coordinates that are not finite are set to the mean of their neighbors, with a warning of the model; else they are
    /// refused. Morph targets and animations with such values are refused in any case.
    pub mend_vertices: bool,
}

impl Default for ReadLimits {
    /// 4 GiB, 2²⁸ vertices and corners, no further folder, nothing mended.
    fn default() -> Self {
        Self { max_bytes: 4 << 30, max_elements: 1 << 28, allow_paths: Vec::new(), mend_vertices: false }
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
/// [`MeshError::InFile`] with the cause; [`MeshError::Interrupted`].
pub fn read_model(path: &Path, limits: &ReadLimits, run: &Run) -> Result<Model, MeshError> {
    let read = || {
        let bytes = read_file(path, limits.max_bytes)?;
        let format = detect_format(&bytes, path)?;
        decode_model(&bytes, format, path.parent().or(Some(Path::new("."))), limits, run)
    };
    read().map_err(|fault: MeshError| fault.of_file(path))
}

/// Decodes a model. `folder` is the folder of the files that a glTF file may reference, besides those of the limits; `None` allows
/// none.
///
/// # Errors
/// [`MeshError::Malformed`] for bytes that violate the format specification, [`MeshError::TooLarge`] beyond the limits,
/// [`MeshError::Interrupted`].
pub fn decode_model(
    bytes: &[u8],
    format: MeshFormat,
    folder: Option<&Path>,
    limits: &ReadLimits,
    run: &Run,
) -> Result<Model, MeshError> {
    let mut builder = match format {
        MeshFormat::Obj => obj::read(bytes, run)?,
        MeshFormat::Ply => ply::read(bytes, run)?,
        MeshFormat::Off => off::read(bytes, run)?,
        MeshFormat::Stl => stl::read(bytes, run)?,
        MeshFormat::Gltf | MeshFormat::Glb => gltf::read(bytes, format, folder, limits, run)?,
        MeshFormat::Medit => medit::read(bytes, run)?,
        MeshFormat::Fbx => fbx::read(bytes, limits, run)?,
    };
    limits.check("number of vertices", builder.positions.len())?;
    limits.check("number of corners", builder.faces.corner_count())?;
    run.check()?;
    if limits.mend_vertices {
        builder.mend_vertices();
    }
    builder.finish()
}

/// All bytes of a regular file within the size limit.
fn read_file(path: &Path, limit: u64) -> Result<Vec<u8>, MeshError> {
    read_opened(open_regular(path).map_err(|e| unreadable(&e))?, limit)
}

fn unreadable(fault: &std::io::Error) -> MeshError {
    let missing = fault.kind() == std::io::ErrorKind::NotFound;
    MeshError::Unreadable {
        reason: if missing { "no such file; check the name".to_owned() } else { fault.to_string() },
    }
}

/// The rest of a file within the size limit.
fn read_opened(file: std::fs::File, limit: u64) -> Result<Vec<u8>, MeshError> {
    let too_large = |value: u64| MeshError::TooLarge { what: "number of bytes", value, limit };
    let announced = file.metadata().map_err(|e| unreadable(&e))?.len();
    if announced > limit {
        return Err(too_large(announced));
    }
    // Reserved as a whole: a vector that grows by doubling takes twice the memory.
    let mut bytes = Vec::new();
    let reserved = usize::try_from(announced).ok().and_then(|n| bytes.try_reserve_exact(n.saturating_add(1)).ok());
    reserved.ok_or_else(|| MeshError::Unreadable { reason: format!("no memory for its {announced} bytes") })?;
    // The file may grow while it is read: read at most one byte more than the limit.
    file.take(limit.saturating_add(1)).read_to_end(&mut bytes).map_err(|e| unreadable(&e))?;
    if bytes.len() as u64 > limit { Err(too_large(bytes.len() as u64)) } else { Ok(bytes) }
}

/// The error of a malformed file.
fn malformed(format: MeshFormat, at: Position, fault: impl Into<String>) -> MeshError {
    MeshError::Malformed { format, at, fault: fault.into() }
}

/// Adds a vertex that the file has at this position.
fn add_vertex(builder: &mut ModelBuilder, format: MeshFormat, at: impl FnOnce() -> Position, xyz: [f64; 3]) {
    builder.vertex(xyz.into(), |told| malformed(format, at(), told.to_string()));
}

/// The triangles of a strip: every second one has reversed orientation.
fn triangles_of_strip(strip: &[u32]) -> impl Iterator<Item = [u32; 3]> + '_ {
    strip.windows(3).enumerate().map(|(k, t)| if k % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] })
}

/// Replaces non-finite components of normals, texture coordinates and colors by zero: they do not justify rejecting the mesh.
fn or_zero(value: f64) -> f64 {
    if value.is_finite() { value } else { 0.0 }
}

#[cfg(test)]
mod tests;
