//! Wavefront OBJ.
//!
//! Read: `v` (with vertex colors after the position), `vt`, `vn`, `f` with any number of corners, indices from 1 or negative
//! (relative to the end), `o`, `g`, `usemtl`, `mtllib`, line continuation by `\`. Smoothing groups are ignored: the normals
//! have the same information. Curves, surfaces, lines and points are ignored with a warning.
//!
//! # Reference
//! Wavefront Technologies, *Advanced Visualizer manual*, appendix B1.

mod write;

use std::collections::BTreeMap;

use super::text::{Lines, number, shown, words};
use super::{MeshFormat, add_vertex, malformed, or_zero};
use crate::mesh::{Group, MeshError, ModelBuilder, NO_VALUE, Position};
use plumbline_num::run::Run;

pub(super) use write::write;

/// Statements ignored without a warning: smoothing groups, level of detail, shadow and ray-tracing objects and merging groups
/// (appendix B1) do not affect the polygons.
const SILENT: [&[u8]; 5] = [b"s", b"lod", b"shadow_obj", b"trace_obj", b"mg"];

struct Reader {
    builder: ModelBuilder,
    group: Group,
    group_number: u32,
    material: u32,
    /// Line number of each face, for errors about indices out of range, which are known only at the end of the file.
    lines: Vec<usize>,
    /// Whether a vertex so far has a color.
    colored: bool,
    /// Ignored statements by keyword: first line and count.
    skipped: BTreeMap<Vec<u8>, (usize, usize)>,
    corners: [Vec<u32>; 3],
}

/// Reads the file.
pub(super) fn read(bytes: &[u8], run: &Run) -> Result<ModelBuilder, MeshError> {
    let mut reader = Reader {
        builder: ModelBuilder::default(),
        group: Group::default(),
        group_number: NO_VALUE,
        material: NO_VALUE,
        lines: Vec::new(),
        colored: false,
        skipped: BTreeMap::new(),
        corners: Default::default(),
    };
    let mut lines = Lines::of(bytes);
    let mut joined = Vec::new();
    // Join continued lines into logical lines; `joined` has the text before the current line.
    while let Some((line, text)) = lines.next() {
        run.check()?;
        let text = text.trim_ascii_end();
        if let Some(begun) = text.strip_suffix(b"\\") {
            joined.extend_from_slice(begun);
            joined.push(b' ');
            if lines.remaining() > 0 {
                continue;
            }
        }
        if joined.is_empty() {
            reader.statement(line, text)?;
        } else {
            if !text.ends_with(b"\\") {
                joined.extend_from_slice(text);
            }
            reader.statement(line, &std::mem::take(&mut joined))?;
        }
    }
    reader.finish(lines.number())
}

fn fault(line: usize, fault: impl Into<String>) -> MeshError {
    malformed(MeshFormat::Obj, Position::Line(line), fault)
}

impl Reader {
    /// Reads one logical line.
    fn statement(&mut self, line: usize, text: &[u8]) -> Result<(), MeshError> {
        // A comment starts at the beginning of a line or after white space: some programs write `1.#IND` for NaN.
        let begins = |k: &usize| text[*k] == b'#' && (*k == 0 || text[k - 1].is_ascii_whitespace());
        let text = &text[..(0..text.len()).find(begins).unwrap_or(text.len())];
        let mut words = words(text);
        let Some(keyword) = words.next() else { return Ok(()) };
        match keyword {
            b"v" => self.vertex(line, words),
            b"vt" => {
                let [u, v] = numbers::<2>(line, "vt", words, 1)?;
                self.builder.texture.values.push([u, v]);
                Ok(())
            }
            b"vn" => {
                let normal = numbers::<3>(line, "vn", words, 3)?;
                self.builder.normals.values.push(normal);
                Ok(())
            }
            b"f" | b"fo" => self.face(line, words),
            b"o" | b"g" => {
                let name = joined(words);
                *(if keyword == b"o" { &mut self.group.object } else { &mut self.group.name }) = name;
                let none = self.group == Group::default();
                self.group_number = if none { NO_VALUE } else { self.builder.group(self.group.clone())? };
                Ok(())
            }
            b"usemtl" => {
                let name = joined(words);
                self.material = if name.is_empty() { NO_VALUE } else { self.builder.material(&name) };
                Ok(())
            }
            b"mtllib" => {
                self.builder.material_files.push(joined(words));
                Ok(())
            }
            _ if SILENT.contains(&keyword) => Ok(()),
            _ => {
                self.skipped.entry(keyword[..keyword.len().min(40)].to_vec()).or_insert((line, 0)).1 += 1;
                Ok(())
            }
        }
    }

    /// `x y z`, `x y z w`, `x y z r g b` or `x y z r g b a`.
    fn vertex<'a>(&mut self, line: usize, words: impl Iterator<Item = &'a [u8]>) -> Result<(), MeshError> {
        let mut values = [0.0; 7];
        let mut count = 0;
        for word in words.take(7) {
            values[count] = number(word).ok_or_else(|| fault(line, format!("{} is not a number", shown(word))))?;
            count += 1;
        }
        if count < 3 {
            return Err(fault(line, format!("a vertex of {count} numbers; x y z are three")));
        }
        let [x, y, z, r, g, b, a] = values;
        let builder = &mut self.builder;
        add_vertex(builder, MeshFormat::Obj, || Position::Line(line), [x, y, z]);
        self.colored |= count >= 6;
        let color = if count >= 6 { [r, g, b, if count == 7 { a } else { 1.0 }] } else { [1.0; 4] };
        // Colors are rare: store none until the first one.
        if self.colored {
            builder.colors.resize(builder.positions.len() - 1, [1.0; 4]);
            builder.colors.push(color.map(|c| c as f32));
        }
        Ok(())
    }

    fn face<'a>(&mut self, line: usize, words: impl Iterator<Item = &'a [u8]>) -> Result<(), MeshError> {
        let builder = &mut self.builder;
        let counts = [builder.positions.len(), builder.texture.values.len(), builder.normals.values.len()];
        self.corners.iter_mut().for_each(Vec::clear);
        for word in words {
            let mut parts = word.splitn(3, |&b| b == b'/');
            for (part, (&count, corners)) in counts.iter().zip(&mut self.corners).enumerate() {
                let text = parts.next().unwrap_or_default();
                corners.push(if text.is_empty() && part > 0 { NO_VALUE } else { index(line, text, count, part)? });
            }
        }
        let [vertices, texture, normals] = &self.corners;
        if vertices.len() < 3 {
            self.skipped.entry(b"f with fewer than three corners".to_vec()).or_insert((line, 0)).1 += 1;
            return Ok(());
        }
        builder.face(vertices, self.group_number, self.material);
        builder.texture.of_corner.extend(texture);
        builder.normals.of_corner.extend(normals);
        self.lines.push(line);
        Ok(())
    }

    /// Checks the indices, normalizes the colors and lists ignored statements.
    fn finish(mut self, last: usize) -> Result<ModelBuilder, MeshError> {
        let builder = &mut self.builder;
        // Indices may refer to elements after the face, so they are checked last.
        if builder.positions.is_empty() {
            return Err(fault(last, "no vertices (`v x y z`); this may be no OBJ file"));
        }
        for (face, &line) in self.lines.iter().enumerate() {
            let corners = builder.faces.corners(face);
            for (what, all, count) in [
                ("vertex", builder.faces.vertices(), builder.positions.len()),
                ("texture coordinate", &builder.texture.of_corner, builder.texture.values.len()),
                ("normal", &builder.normals.of_corner, builder.normals.values.len()),
            ] {
                let beyond = all[corners.clone()].iter().find(|&&i| i != NO_VALUE && i as usize >= count);
                if let Some(&index) = beyond {
                    let told = format!("a face names {what} {}, but the file has {count}", u64::from(index) + 1);
                    return Err(fault(line, told));
                }
            }
        }
        // Some programs write colors as 0 to 255 instead of 0 to 1.
        if builder.colors.iter().flatten().any(|&c| c > 1.0) {
            builder.colors.iter_mut().for_each(|color| color[..3].iter_mut().for_each(|c| *c /= 255.0));
        }
        for (keyword, (line, count)) in self.skipped {
            let keyword = String::from_utf8_lossy(&keyword).into_owned();
            builder.warnings.push(format!("`{keyword}` is left out ({count} in the file, first in line {line})"));
        }
        Ok(self.builder)
    }
}

/// Zero-based index of a corner. `part` is 0 for the vertex, 1 for the texture coordinate, 2 for the normal.
fn index(line: usize, text: &[u8], count: usize, part: usize) -> Result<u32, MeshError> {
    let what = ["vertex", "texture coordinate", "normal"][part];
    let given: i64 = super::text::whole(text).ok_or_else(|| {
        fault(line, format!("{} is no number of a {what}; corners are written v, v/vt, v//vn or v/vt/vn", shown(text)))
    })?;
    let from_zero = match given {
        0 => return Err(fault(line, format!("{what} 0: numbers start at 1, or at -1 from the end"))),
        1.. => given - 1,
        _ => given.saturating_add(i64::try_from(count).unwrap_or(i64::MAX)),
    };
    if from_zero < 0 {
        return Err(fault(
            line,
            format!("{what} {given} counts from the end, but only {count} stand before this line"),
        ));
    }
    match u32::try_from(from_zero) {
        Ok(index) if index != NO_VALUE => Ok(index),
        _ => Err(fault(line, format!("a face names {what} {given}, more than can be numbered"))),
    }
}

/// The first `N` numbers, at least `least` of them; missing and non-finite ones are zero.
fn numbers<'a, const N: usize>(
    line: usize,
    keyword: &str,
    words: impl Iterator<Item = &'a [u8]>,
    least: usize,
) -> Result<[f64; N], MeshError> {
    let (mut values, mut count) = ([0.0; N], 0);
    for (value, word) in values.iter_mut().zip(words) {
        let given = number(word).ok_or_else(|| fault(line, format!("{} is not a number", shown(word))))?;
        *value = or_zero(given);
        count += 1;
    }
    if count < least {
        return Err(fault(line, format!("`{keyword}` with {count} numbers; it has at least {least}")));
    }
    Ok(values)
}

/// Words joined by single spaces; names may contain spaces.
fn joined<'a>(words: impl Iterator<Item = &'a [u8]>) -> String {
    words.map(String::from_utf8_lossy).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests;
