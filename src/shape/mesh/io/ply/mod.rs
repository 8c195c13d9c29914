//! PLY, the Stanford polygon file format: as text, or binary in either byte order.
//!
//! Read from element `vertex`: `x y z`, `nx ny nz`, `red green blue alpha` (integers or fractions), `s t` (also `u v`,
//! `texture_u texture_v`); from `face`: the list `vertex_indices` (also `vertex_index`) and `texcoord`, two numbers per corner;
//! `tristrips` as in the files of the Stanford repository. All other elements and properties are skipped, for any type.
//!
//! # Reference
//! G. Turk, *The PLY polygon file format*, 1994.

mod body;
mod header;
mod write;

use super::scalar::Scalar;
use super::{MeshFormat, add_vertex, malformed, or_zero, triangles_of_strip};
use crate::mesh::{MeshError, ModelBuilder, NO_VALUE, Position};
use body::Body;
use header::{Element, Header, Property, Shape};
use plumbline_num::run::Run;

pub(super) use write::write;

/// Reads the file.
pub(super) fn read(bytes: &[u8], run: &Run) -> Result<ModelBuilder, MeshError> {
    let header = Header::read(bytes)?;
    let mut body = Body::after(&header, bytes);
    let mut builder = ModelBuilder::default();
    let vertices = header.elements.iter().find(|e| e.name == "vertex").map_or(0, |e| e.count);
    for element in &header.elements {
        body.holds(element)?;
        match element.name.as_str() {
            "vertex" => read_vertices(&mut body, element, &mut builder, run)?,
            "face" => read_faces(&mut body, element, vertices, &mut builder, run)?,
            "tristrips" => read_strips(&mut body, element, vertices, &mut builder, run)?,
            _ => skip(&mut body, element, &mut builder)?,
        }
    }
    Ok(builder)
}

/// Destination of a vertex property.
#[derive(Clone, Copy)]
enum Slot {
    Position(usize),
    Normal(usize),
    Color(usize, f64),
    Texture(usize),
    None,
}

/// The value of full color intensity.
fn full_intensity(scalar: Scalar) -> f64 {
    match scalar {
        Scalar::I8 => 127.0,
        Scalar::I16 => 32_767.0,
        Scalar::U16 => 65_535.0,
        // Some programs declare bytes as int.
        Scalar::U8 | Scalar::I32 | Scalar::U32 => 255.0,
        Scalar::F32 | Scalar::F64 => 1.0,
    }
}

/// Destination of a property by name; integer colors are scaled to 0 to 1.
fn slot(property: &Property) -> Slot {
    let Shape::One(scalar) = property.shape else { return Slot::None };
    let color = |k| Slot::Color(k, 1.0 / full_intensity(scalar));
    match property.name.as_str() {
        "x" => Slot::Position(0),
        "y" => Slot::Position(1),
        "z" => Slot::Position(2),
        "nx" => Slot::Normal(0),
        "ny" => Slot::Normal(1),
        "nz" => Slot::Normal(2),
        "red" | "r" | "diffuse_red" => color(0),
        "green" | "g" | "diffuse_green" => color(1),
        "blue" | "b" | "diffuse_blue" => color(2),
        "alpha" | "a" => color(3),
        "s" | "u" | "texture_u" => Slot::Texture(0),
        "t" | "v" | "texture_v" => Slot::Texture(1),
        _ => Slot::None,
    }
}

fn read_vertices(
    body: &mut Body<'_>,
    element: &Element,
    builder: &mut ModelBuilder,
    run: &Run,
) -> Result<(), MeshError> {
    // Layout: which properties the element has; an incomplete normal, color or texture coordinate is ignored.
    let slots: Vec<_> = element.properties.iter().map(slot).collect();
    let has = |wanted: fn(&Slot) -> bool| slots.iter().filter(|s| wanted(s)).count();
    if has(|s| matches!(s, Slot::Position(_))) < 3 {
        return Err(body.fault("element `vertex` lacks x, y or z"));
    }
    let normals = has(|s| matches!(s, Slot::Normal(_))) >= 3;
    let colors = has(|s| matches!(s, Slot::Color(..))) >= 3;
    let texture = has(|s| matches!(s, Slot::Texture(_))) >= 2;
    // Values, in the order of the properties. The count was checked against the file size.
    builder.positions.reserve(element.count as usize);
    for _ in 0..element.count {
        run.check()?;
        let at = body.position();
        let (mut xyz, mut normal, mut color, mut uv) = ([0.0; 3], [0.0; 3], [0.0, 0.0, 0.0, 1.0], [0.0; 2]);
        for (slot, property) in slots.iter().zip(&element.properties) {
            let scalar = match property.shape {
                Shape::One(scalar) => scalar,
                Shape::List(..) => {
                    body.values(property, &mut Vec::new())?;
                    continue;
                }
            };
            let value = body.value(scalar)?;
            match *slot {
                Slot::Position(k) => xyz[k] = value,
                Slot::Normal(k) => normal[k] = value,
                Slot::Color(k, scale) => color[k] = (value * scale) as f32,
                Slot::Texture(k) => uv[k] = value,
                Slot::None => {}
            }
        }
        add_vertex(builder, MeshFormat::Ply, || at, xyz);
        if normals {
            builder.normals.values.push(normal.map(or_zero));
        }
        if colors {
            builder.colors.push(color.map(|c| or_zero(f64::from(c)) as f32));
        }
        if texture {
            builder.texture.values.push(uv.map(or_zero));
        }
    }
    Ok(())
}

fn read_faces(
    body: &mut Body<'_>,
    element: &Element,
    vertices: u64,
    builder: &mut ModelBuilder,
    run: &Run,
) -> Result<(), MeshError> {
    let named = |names: &[&str]| {
        let is = |p: &Property| names.contains(&p.name.as_str()) && matches!(p.shape, Shape::List(..));
        element.properties.iter().position(is)
    };
    // Layout: the list of vertex indices, optionally the list of texture coordinates.
    let indices = named(&["vertex_indices", "vertex_index"])
        .ok_or_else(|| body.fault("element `face` has no list `vertex_indices`"))?;
    let texcoord = named(&["texcoord"]);
    // Values, in the order of the properties.
    let (mut corners, mut list, mut small) = (Vec::new(), Vec::new(), 0);
    let per_corner = texcoord.is_some();
    for _ in 0..element.count {
        run.check()?;
        corners.clear();
        let mut uvs = Vec::new();
        for (k, property) in element.properties.iter().enumerate() {
            let at = body.position();
            body.values(property, &mut list)?;
            if k == indices {
                corners.extend(vertex_numbers(&list, vertices, &at)?);
            } else if Some(k) == texcoord {
                uvs.clone_from(&list);
            }
        }
        if corners.len() < 3 {
            small += 1;
            continue;
        }
        add_face(builder, &corners, per_corner.then_some(&uvs));
    }
    if small > 0 {
        builder.warnings.push(format!("faces of fewer than three corners are left out ({small})"));
    }
    Ok(())
}

/// Adds a face; its texture coordinates are per corner if the file has them so, else per vertex.
fn add_face(builder: &mut ModelBuilder, corners: &[u32], uvs: Option<&Vec<f64>>) {
    builder.face(corners, NO_VALUE, NO_VALUE);
    builder.normals.of_corner.extend(corners);
    match uvs {
        None => builder.texture.of_corner.extend(corners),
        Some(uvs) if uvs.len() == 2 * corners.len() => {
            for uv in uvs.chunks_exact(2) {
                builder.texture.of_corner.push(builder.texture.values.len() as u32);
                builder.texture.values.push([or_zero(uv[0]), or_zero(uv[1])]);
            }
        }
        Some(_) => builder.texture.of_corner.extend(corners.iter().map(|_| NO_VALUE)),
    }
}

/// The values as vertex indices; an error at `at` unless all are integers in range.
fn vertex_numbers(values: &[f64], vertices: u64, at: &Position) -> Result<Vec<u32>, MeshError> {
    let number = |&value: &f64| {
        let fits = value >= 0.0 && value < vertices as f64 && value.fract() == 0.0;
        let fault = || format!("a face names vertex {value}; the file has {vertices}, numbered from 0");
        fits.then_some(value as u32).ok_or_else(|| malformed(MeshFormat::Ply, at.clone(), fault()))
    };
    values.iter().map(number).collect()
}

/// Triangle strips, separated by −1.
fn read_strips(
    body: &mut Body<'_>,
    element: &Element,
    vertices: u64,
    builder: &mut ModelBuilder,
    run: &Run,
) -> Result<(), MeshError> {
    let mut list = Vec::new();
    for _ in 0..element.count {
        run.check()?;
        for property in &element.properties {
            body.values(property, &mut list)?;
            if property.name != "vertex_indices" {
                continue;
            }
            for strip in list.split(|&value| value == -1.0) {
                let strip = vertex_numbers(strip, vertices, &body.position())?;
                triangles_of_strip(&strip).for_each(|t| add_face(builder, &t, None));
            }
        }
    }
    Ok(())
}

/// Skips an element, with a warning.
fn skip(body: &mut Body<'_>, element: &Element, builder: &mut ModelBuilder) -> Result<(), MeshError> {
    let mut list = Vec::new();
    // An element without properties has size zero for any count: nothing to skip, and a hostile count costs no time.
    for _ in 0..if element.properties.is_empty() { 0 } else { element.count } {
        for property in &element.properties {
            body.values(property, &mut list)?;
        }
    }
    builder.warnings.push(format!("element `{}` is left out ({})", element.name, element.count));
    Ok(())
}

#[cfg(test)]
mod tests;
