//! Common parts of the writers: format selection, atomic files, numbers and names.

use std::fmt;
use std::io;
use std::path::Path;

use super::{MeshFormat, gltf, obj, off, ply, stl};
use crate::mesh::{CornerData, MeshError, Model};
use plumbline_num::files::{IfExists, write_whole};
use plumbline_num::run::Run;

/// Options of the writers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WriteOptions {
    /// Write PLY and STL as text instead of binary.
    pub ascii: bool,
}

/// Writes a model in the format of the file name extension. Atomic: the file is written completely or not at all, in place of
/// one that has the name.
///
/// # Errors
/// [`MeshError::InFile`] around [`MeshError::UnknownFormat`] or [`MeshError::Unwritable`].
pub fn write_model(path: &Path, model: &Model) -> Result<(), MeshError> {
    write_model_with(path, model, &WriteOptions::default(), &Run::default())
}

/// [`write_model`] with options.
///
/// # Errors
/// Those of [`write_model`]; [`MeshError::Interrupted`].
pub fn write_model_with(path: &Path, model: &Model, options: &WriteOptions, run: &Run) -> Result<(), MeshError> {
    write_model_if(path, model, options, IfExists::Replace, run)
}

/// [`write_model_with`], which may be forbidden to replace a file.
///
/// # Errors
/// Those of [`write_model_with`]; [`MeshError::Unwritable`] where the file exists and must stay.
pub fn write_model_if(
    path: &Path,
    model: &Model,
    options: &WriteOptions,
    if_exists: IfExists,
    run: &Run,
) -> Result<(), MeshError> {
    let write = || {
        let unknown = || MeshError::Unwritable {
            reason: "the name's extension is none of .obj, .ply, .off, .stl, .gltf, .glb".to_owned(),
        };
        let format = MeshFormat::of_name(path).filter(|f| f.is_writable()).ok_or_else(unknown)?;
        let bytes = encode_model(model, format, options, run)?;
        write_whole(path, &bytes, if_exists).map_err(|e| MeshError::Unwritable { reason: e.to_string() })
    };
    write().map_err(|fault: MeshError| fault.of_file(path))
}

/// Bytes between two checks for interruption: a millisecond of formatting numbers. A check at each write, of one number or
/// less, costs a tenth of the time to write OBJ.
const CHECK_EVERY: usize = 1 << 16;

/// Output buffer whose writes fail once the run is interrupted.
struct Watched<'a> {
    bytes: Vec<u8>,
    next_check: usize,
    run: &'a Run,
}

impl io::Write for Watched<'_> {
    #[inline]
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.write_all(bytes).map(|()| bytes.len())
    }

    #[inline]
    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.bytes.len() >= self.next_check {
            self.run.check().map_err(io::Error::other)?;
            self.next_check = self.bytes.len() + CHECK_EVERY;
        }
        self.bytes.extend_from_slice(bytes);
        Ok(())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Encodes a model as the bytes of a file.
///
/// # Errors
/// [`MeshError::Unwritable`] for a read-only format, and for coordinates out of the range of the format;
/// [`MeshError::Interrupted`].
pub fn encode_model(
    model: &Model,
    format: MeshFormat,
    options: &WriteOptions,
    run: &Run,
) -> Result<Vec<u8>, MeshError> {
    // Formats with 32-bit coordinates: reject coordinates beyond their range.
    let mut out = Watched { bytes: Vec::new(), next_check: 0, run };
    let beyond = |x: &f64| x.abs() > f64::from(f32::MAX);
    let single = matches!(format, MeshFormat::Gltf | MeshFormat::Glb) || format == MeshFormat::Stl && !options.ascii;
    if single && model.mesh().positions().iter().any(|p| p.coords.iter().any(beyond)) {
        let reason =
            format!("{format} holds coordinates up to {:e}, and the mesh has larger ones; write PLY or OBJ", f32::MAX);
        return Err(MeshError::Unwritable { reason });
    }
    let written = match format {
        MeshFormat::Obj => obj::write(model, &mut out),
        MeshFormat::Ply => ply::write(model, options.ascii, &mut out),
        MeshFormat::Off => off::write(model, &mut out),
        MeshFormat::Stl if options.ascii => stl::write_text(model, &mut out),
        MeshFormat::Stl => stl::write_binary(model, &mut out),
        MeshFormat::Gltf => gltf::write(model, false, &mut out),
        MeshFormat::Glb => gltf::write(model, true, &mut out),
        MeshFormat::Fbx => Err(io::Error::other("FBX files are only read; write glTF")),
        MeshFormat::Medit => Err(io::Error::other("Medit files are only read; write OBJ, PLY, OFF, STL or glTF")),
    };
    run.check()?;
    written.map_err(|e| MeshError::Unwritable { reason: e.to_string() })?;
    Ok(out.bytes)
}

/// Attributes of the model that the format cannot represent, in words; empty if the format is lossless for it.
pub fn losses(model: &Model, format: MeshFormat) -> Vec<&'static str> {
    use MeshFormat as F;
    // Properties of the model that decide which attributes are lost.
    let one_each = model.normals().is_none_or(|n| per_vertex(model, n).is_some());
    let small = model.mesh().positions().iter().all(|p| p.coords.iter().all(|&x| f64::from(x as f32) == x));
    let polygons = model.faces().len() != model.mesh().triangle_count();
    let triangles = matches!(format, F::Stl | F::Gltf | F::Glb);
    let moving = model.articulation();
    let most =
        moving.map_or(0, |a| (0..model.mesh().vertex_count()).map(|v| a.influences.row(v).count()).max().unwrap_or(0));
    [
        (polygons && triangles, "polygons (their triangles are written)"),
        (model.texture().is_some() && matches!(format, F::Off | F::Stl), "texture coordinates"),
        (model.normals().is_some() && matches!(format, F::Off | F::Stl), "normals"),
        (!one_each && format == F::Ply, "normals (a vertex has several)"),
        (model.colors().is_some() && format == F::Stl, "colors"),
        (!model.groups().all.is_empty() && matches!(format, F::Ply | F::Off | F::Stl), "groups"),
        (!model.materials().all.is_empty() && matches!(format, F::Ply | F::Off | F::Stl), "materials"),
        (moving.is_some() && !matches!(format, F::Gltf | F::Glb), "nodes, skins, morph targets and animations"),
        (most > gltf::MAX_INFLUENCES && triangles, "influences beyond eight a vertex"),
        (model.assets().is_some() && !matches!(format, F::Gltf | F::Glb), "materials but for their names, textures"),
        (!small && format == F::Stl, "digits beyond 32-bit coordinates (STL as text keeps them)"),
        (!small && matches!(format, F::Gltf | F::Glb), "digits beyond 32-bit coordinates"),
        (format == F::Stl, "which triangles share vertices (join them with `mesh repair`)"),
    ]
    .into_iter()
    .filter_map(|(lost, what)| lost.then_some(what))
    .collect()
}

/// The attribute per vertex, if the corners of each vertex agree.
pub(super) fn per_vertex<const N: usize>(model: &Model, data: &CornerData<N>) -> Option<Vec<[f64; N]>> {
    data.per_vertex(model.faces().vertices(), model.mesh().vertex_count())
}

/// A number in the fewest digits that round-trip, with an exponent below 10⁻⁵ and from 10¹⁶.
pub(super) struct Number(pub(super) f64);

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let x = self.0;
        if x == 0.0 || (1e-5..1e16).contains(&x.abs()) { write!(f, "{x}") } else { write!(f, "{x:e}") }
    }
}

/// A name on one line, escaped: no line break, no continuation (`\` at the end), no comment (`#` at the start of a word).
pub(super) fn one_line(name: &str) -> String {
    let words: Vec<_> = name
        .split_whitespace()
        .map(|word| word.strip_prefix('#').map_or(word.to_owned(), |w| format!("_{w}")))
        .collect();
    let line = words.join(" ").replace(|c: char| c.is_control(), "_");
    if line.ends_with('\\') { format!("{line}_") } else { line }
}
