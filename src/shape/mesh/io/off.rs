//! OFF, the object file format of Geomview, as text: `[ST][C][N]OFF`, the numbers of vertices, faces and edges, then one line
//! per vertex and per face.
//!
//! A vertex is `x y z`, followed by a normal with N, a color with C, texture coordinates with ST. For any keyword, three or
//! four extra numbers of a vertex are its color. The counts may be on the line of the keyword, with or without a space, and the
//! keyword may be missing. Face colors are ignored with a warning.
//!
//! # Reference
//! Geomview manual, *OFF: Object File Format*.

use std::io::{self, Write};

use super::text::{Lines, number, shown, words};
use super::write::Number;
use super::{MeshFormat, add_vertex, malformed, or_zero};
use crate::mesh::{MeshError, Model, ModelBuilder, NO_VALUE, Position};
use plumbline_num::run::Run;

/// Vertex attributes announced by the keyword.
#[derive(Clone, Copy, Debug, Default)]
struct Variant {
    texture: bool,
    normals: bool,
}

/// Whether the text begins with a keyword of this format.
pub(super) fn is_keyword(text: &[u8]) -> bool {
    let word = &text[..text.iter().position(|b| !b.is_ascii_alphanumeric()).unwrap_or(text.len())];
    keyword(word).is_some()
}

/// The prefix of the keyword, and digits directly appended to it.
fn keyword(word: &[u8]) -> Option<(&[u8], &[u8])> {
    let at = word.windows(3).position(|w| w == b"OFF")?;
    let (prefix, rest) = (&word[..at], &word[at + 3..]);
    let known = prefix.iter().all(|b| b"STCN4n".contains(b)) && rest.iter().all(u8::is_ascii_digit);
    known.then_some((prefix, rest))
}

fn fault(line: usize, fault: impl Into<String>) -> MeshError {
    malformed(MeshFormat::Off, Position::Line(line), fault)
}

/// Non-empty lines, without comments.
struct Content<'a>(Lines<'a>);

impl<'a> Content<'a> {
    fn line(&mut self, what: &str) -> Result<(usize, &'a [u8]), MeshError> {
        for (line, text) in self.0.by_ref() {
            let text = text[..text.iter().position(|&b| b == b'#').unwrap_or(text.len())].trim_ascii();
            if !text.is_empty() {
                return Ok((line, text));
            }
        }
        let end = self.0.number();
        Err(fault(end, format!("the file ends where {what} should follow; it may be cut short")))
    }
}

/// Reads the file.
pub(super) fn read(bytes: &[u8], run: &Run) -> Result<ModelBuilder, MeshError> {
    let mut content = Content(Lines::of(bytes));
    // Header.
    let (variant, [vertices, faces]) = header(&mut content)?;
    let (at, left) = (content.0.number(), content.0.remaining());
    // Bound allocation by the file size: each line has at least two bytes; the last may lack its line break.
    if vertices.saturating_add(faces) > left as u64 / 2 + 1 {
        let told = format!("{vertices} vertices and {faces} faces are announced, but only {left} bytes follow");
        return Err(fault(at, told));
    }
    // Vertices, then faces.
    let mut builder = ModelBuilder::default();
    builder.positions.reserve(vertices as usize);
    for _ in 0..vertices {
        run.check()?;
        vertex(&mut content, variant, &mut builder)?;
    }
    let mut left_out = Skipped::default();
    for _ in 0..faces {
        run.check()?;
        face(&mut content, variant, vertices, &mut builder, &mut left_out)?;
    }
    // Colors and warnings.
    scale_colors(&mut builder.colors);
    for (count, what) in [(left_out.colors, "colors of faces"), (left_out.small, "faces of fewer than three corners")] {
        if count > 0 {
            builder.warnings.push(format!("{what} are left out ({count})"));
        }
    }
    if let Ok((line, _)) = content.line("") {
        builder.warnings.push(format!("what follows the last face is left out (from line {line})"));
    }
    Ok(builder)
}

#[derive(Default)]
struct Skipped {
    colors: usize,
    small: usize,
}

/// Reads the keyword and the numbers of vertices and faces.
fn header(content: &mut Content<'_>) -> Result<(Variant, [u64; 2]), MeshError> {
    let (mut line, mut text) = content.line("the keyword OFF")?;
    let first = words(text).next().unwrap_or_default();
    let mut variant = Variant::default();
    if let Some((prefix, glued)) = keyword(first) {
        if prefix.iter().any(|b| b"4n".contains(b)) {
            return Err(fault(
                line,
                format!("{} has no three coordinates per vertex; only surfaces in space are read", shown(first)),
            ));
        }
        let has = |letter: u8| prefix.contains(&letter);
        variant = Variant { texture: has(b'T'), normals: has(b'N') };
        text = text[first.len() - glued.len()..].trim_ascii();
        if text.to_ascii_uppercase().starts_with(b"BINARY") {
            return Err(fault(line, "binary OFF is not read; write it as text, or as PLY"));
        }
        if text.is_empty() {
            (line, text) = content.line("the numbers of vertices and faces")?;
        }
    }
    let mut counts = words(text).map(super::text::whole::<u64>);
    let (Some(Some(vertices)), Some(Some(faces))) = (counts.next(), counts.next()) else {
        return Err(fault(line, format!("{} should be the numbers of vertices, faces and edges", shown(text))));
    };
    Ok((variant, [vertices, faces]))
}

/// Reads one vertex: position, normal, color, texture coordinates, in this order.
fn vertex(content: &mut Content<'_>, variant: Variant, builder: &mut ModelBuilder) -> Result<(), MeshError> {
    let (line, text) = content.line("a vertex")?;
    let (mut values, mut count) = ([0.0; 12], 0);
    for (value, word) in values.iter_mut().zip(words(text)) {
        *value = number(word).ok_or_else(|| fault(line, format!("{} is not a number", shown(word))))?;
        count += 1;
    }
    let least = 3 + 3 * usize::from(variant.normals) + 2 * usize::from(variant.texture);
    if count < least {
        return Err(fault(
            line,
            format!("{} has {count} numbers; a vertex of this file has at least {least}", shown(text)),
        ));
    }
    add_vertex(builder, MeshFormat::Off, || Position::Line(line), [values[0], values[1], values[2]]);
    let mut next = 3;
    if variant.normals {
        builder.normals.values.push([values[3], values[4], values[5]].map(or_zero));
        next = 6;
    }
    let left = count - least;
    if left >= 3 {
        let alpha = if left > 3 { values[next + 3] } else { f64::NAN };
        builder.colors.resize(builder.positions.len() - 1, [1.0; 4]);
        builder.colors.push([values[next], values[next + 1], values[next + 2], alpha].map(|c| c as f32));
        next += left.min(4);
    }
    if variant.texture {
        builder.texture.values.push([values[next], values[next + 1]].map(or_zero));
    }
    Ok(())
}

/// Reads one face: the number of corners, the vertex indices, optionally a color.
fn face(
    content: &mut Content<'_>,
    variant: Variant,
    vertices: u64,
    builder: &mut ModelBuilder,
    left_out: &mut Skipped,
) -> Result<(), MeshError> {
    let (line, text) = content.line("a face")?;
    let mut words = words(text);
    let count: Option<usize> = words.next().and_then(super::text::whole);
    let count = count.ok_or_else(|| fault(line, format!("{} should begin with the number of corners", shown(text))))?;
    let mut corners = Vec::with_capacity(count.min(text.len() / 2));
    for word in words.by_ref().take(count) {
        match super::text::whole::<u32>(word) {
            Some(vertex) if u64::from(vertex) < vertices => corners.push(vertex),
            _ => {
                let told = format!("{} is no vertex; the file has {vertices}, numbered from 0", shown(word));
                return Err(fault(line, told));
            }
        }
    }
    if corners.len() < count {
        return Err(fault(line, format!("a face of {count} corners names only {}", corners.len())));
    }
    left_out.colors += usize::from(words.next().is_some());
    if count < 3 {
        left_out.small += 1;
        return Ok(());
    }
    builder.face(&corners, NO_VALUE, NO_VALUE);
    if variant.normals {
        builder.normals.of_corner.extend(&corners);
    }
    if variant.texture {
        builder.texture.of_corner.extend(&corners);
    }
    Ok(())
}

/// Scales colors to 0 to 1: the file has integers up to 255 or fractions. A missing opacity (NaN) becomes 1.
fn scale_colors(colors: &mut [[f32; 4]]) {
    let whole = colors.iter().flat_map(|c| &c[..3]).any(|&c| c > 1.0);
    for color in colors {
        if whole {
            *color = color.map(|c| c / 255.0);
        }
        if color[3].is_nan() {
            color[3] = 1.0;
        }
        *color = color.map(|c| if c.is_finite() { c } else { 0.0 });
    }
}

/// Writes the model as OFF, or as COFF with colors. Colors are written as fractions: integers up to 255 would be lossy.
pub(super) fn write(model: &Model, out: &mut impl Write) -> io::Result<()> {
    let mesh = model.mesh();
    writeln!(out, "{}", if model.colors().is_some() { "COFF" } else { "OFF" })?;
    writeln!(out, "{} {} 0", mesh.vertex_count(), model.faces().len())?;
    for (vertex, p) in mesh.positions().iter().enumerate() {
        write!(out, "{} {} {}", Number(p.x), Number(p.y), Number(p.z))?;
        if let Some(colors) = model.colors() {
            // With a decimal point, so that no reader takes 1 for 1/255.
            colors[vertex].iter().try_for_each(|c| write!(out, " {c:?}"))?;
        }
        writeln!(out)?;
    }
    for face in model.faces().iter() {
        write!(out, "{}", face.len())?;
        face.iter().try_for_each(|vertex| write!(out, " {vertex}"))?;
        writeln!(out)?;
    }
    Ok(())
}
