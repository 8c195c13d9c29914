//! STL, binary and text: a triangle soup without common vertices. [`repair`](crate::mesh::repair) welds them.
//!
//! Binary: an arbitrary header of 80 bytes, the number of triangles (u32), then 50 bytes per triangle: normal, three corners,
//! two unused bytes; little-endian. Text: `solid NAME`, `facet normal …`, `outer loop`, three times `vertex x y z`, `endloop`,
//! `endfacet`, `endsolid`. Each solid is an object. Normals are ignored: the corners determine them.

use std::io::{self, Write};

use nalgebra::Vector3;

use super::text::{Words, shown};
use super::write::{Number, one_line};
use super::{MeshFormat, add_vertex, malformed};
use crate::mesh::{Group, MeshError, Model, ModelBuilder, NO_VALUE, Position, TriMesh};
use plumbline_num::run::Run;

/// Bytes before the first triangle of a binary file: the header of 80 bytes and the triangle count of 4.
const HEADER: usize = 84;
/// Bytes per triangle of a binary file: twelve 32-bit numbers (normal and three corners) and two attribute bytes.
const FACET: usize = 50;

/// Number of triangles in the header of a binary file.
fn announced(bytes: &[u8]) -> Option<u64> {
    let count: [u8; 4] = bytes.get(80..HEADER)?.try_into().ok()?;
    Some(u64::from(u32::from_le_bytes(count)))
}

/// Whether the file size matches the triangle count of a binary header, which is practically impossible for text.
pub(super) fn is_binary(bytes: &[u8]) -> bool {
    announced(bytes).is_some_and(|count| HEADER as u64 + FACET as u64 * count == bytes.len() as u64)
}

/// Reads the file.
pub(super) fn read(bytes: &[u8], run: &Run) -> Result<ModelBuilder, MeshError> {
    let text = bytes.trim_ascii_start().starts_with(b"solid");
    let has_facets = || bytes[..bytes.len().min(1 << 16)].windows(5).any(|w| w == b"facet" || w == b"endso");
    if !is_binary(bytes) && text && has_facets() { read_text(bytes, run) } else { read_binary(bytes, run) }
}

fn read_binary(bytes: &[u8], run: &Run) -> Result<ModelBuilder, MeshError> {
    let fault = |at: usize, told: String| malformed(MeshFormat::Stl, Position::Byte(at), told);
    let Some(count) = announced(bytes) else {
        return Err(fault(bytes.len(), format!("the file ends inside its header of {HEADER} bytes; it is cut short")));
    };
    let room = (bytes.len() - HEADER) / FACET;
    if count > room as u64 {
        return Err(fault(
            80,
            format!("{count} triangles are announced, but the file has room for {room}; it is cut short"),
        ));
    }
    let mut builder = ModelBuilder::default();
    builder.positions.reserve(3 * count as usize);
    for (t, facet) in bytes[HEADER..].chunks_exact(FACET).take(count as usize).enumerate() {
        run.check()?;
        for k in 0..3 {
            let at = 12 + 12 * k;
            let coordinate = |c: usize| {
                let raw = facet[at + 4 * c..at + 4 * c + 4].try_into().expect("four bytes");
                f64::from(f32::from_le_bytes(raw))
            };
            let position = || Position::Byte(HEADER + t * FACET + at);
            let xyz = [coordinate(0), coordinate(1), coordinate(2)];
            add_vertex(&mut builder, MeshFormat::Stl, position, xyz);
        }
        let first = 3 * t as u32;
        builder.face(&[first, first + 1, first + 2], NO_VALUE, NO_VALUE);
    }
    let rest = bytes.len() - HEADER - FACET * count as usize;
    if rest > 0 {
        builder.warnings.push(format!("what follows the last triangle is left out ({rest} bytes)"));
    }
    Ok(builder)
}

fn read_text(bytes: &[u8], run: &Run) -> Result<ModelBuilder, MeshError> {
    let mut words = Words::new(bytes, 0, 1, MeshFormat::Stl, None);
    let mut builder = ModelBuilder::default();
    let mut group = NO_VALUE;
    while let Some(word) = words.next_word() {
        run.check()?;
        match word.to_ascii_lowercase().as_slice() {
            b"solid" => {
                let object = String::from_utf8_lossy(words.rest_of_line()).trim().to_owned();
                group =
                    if object.is_empty() { NO_VALUE } else { builder.group(Group { object, name: String::new() })? };
            }
            b"facet" => facet(&mut words, &mut builder, group)?,
            b"endsolid" => drop(words.rest_of_line()),
            _ => return Err(words.fault(format!("{} where `facet` or `endsolid` should stand", shown(word)))),
        }
    }
    Ok(builder)
}

/// Reads one facet of a text file, after its keyword.
fn facet(words: &mut Words<'_>, builder: &mut ModelBuilder, group: u32) -> Result<(), MeshError> {
    expect(words, "normal")?;
    for _ in 0..3 {
        words.number("a normal")?;
    }
    expect(words, "outer")?;
    expect(words, "loop")?;
    let first = builder.positions.len() as u32;
    for _ in 0..3 {
        expect(words, "vertex")?;
        let mut xyz = [0.0; 3];
        for value in &mut xyz {
            *value = words.number("a coordinate")?;
        }
        add_vertex(builder, MeshFormat::Stl, || words.position(), xyz);
    }
    expect(words, "endloop")?;
    expect(words, "endfacet")?;
    builder.face(&[first, first + 1, first + 2], group, NO_VALUE);
    Ok(())
}

/// Consumes the next word, which must be `keyword` in any letter case.
fn expect(words: &mut Words<'_>, keyword: &str) -> Result<(), MeshError> {
    let word = words.word(keyword)?;
    if word.eq_ignore_ascii_case(keyword.as_bytes()) {
        return Ok(());
    }
    Err(words.fault(format!("{} where `{keyword}` should stand", shown(word))))
}

fn unit_normal(mesh: &TriMesh, t: usize) -> Vector3<f64> {
    mesh.area_normal(t).try_normalize(0.0).unwrap_or_else(Vector3::zeros)
}

/// Writes the triangles in binary, with 32-bit coordinates.
pub(super) fn write_binary(model: &Model, out: &mut impl Write) -> io::Result<()> {
    let mesh = model.mesh();
    let mut header = [b' '; 80];
    header[..13].copy_from_slice(b"plumbline STL");
    out.write_all(&header)?;
    out.write_all(&(mesh.triangle_count() as u32).to_le_bytes())?;
    for t in 0..mesh.triangle_count() {
        let corners = mesh.corners(t);
        for x in unit_normal(mesh, t).iter().chain(corners.iter().flat_map(|p| p.coords.iter())) {
            out.write_all(&(*x as f32).to_le_bytes())?;
        }
        out.write_all(&[0; 2])?;
    }
    Ok(())
}

/// Writes the triangles as text, one solid per object; coordinates round-trip exactly.
pub(super) fn write_text(model: &Model, out: &mut impl Write) -> io::Result<()> {
    let mesh = model.mesh();
    let object = |t: usize| model.groups().get(model.face_of_triangle()[t] as usize).map_or("", |g| &g.object);
    let mut open: Option<&str> = None;
    for t in 0..mesh.triangle_count() {
        let name = object(t);
        if open != Some(name) {
            if let Some(name) = open {
                writeln!(out, "endsolid {}", one_line(name))?;
            }
            writeln!(out, "solid {}", one_line(name))?;
            open = Some(name);
        }
        let n = unit_normal(mesh, t);
        writeln!(out, "facet normal {} {} {}\n  outer loop", n.x as f32, n.y as f32, n.z as f32)?;
        for p in mesh.corners(t) {
            writeln!(out, "    vertex {} {} {}", Number(p.x), Number(p.y), Number(p.z))?;
        }
        writeln!(out, "  endloop\nendfacet")?;
    }
    match open {
        None => writeln!(out, "solid\nendsolid"),
        Some(name) => writeln!(out, "endsolid {}", one_line(name)),
    }
}
