//! Medit `.mesh` as text: `Vertices`, `Triangles`, `Quadrilaterals`; tetrahedra, edges and all other entities are ignored.
//!
//! # Reference
//! P. Frey, *Medit: an interactive mesh visualization software*, INRIA technical report 0253, 2001.

use super::text::Words;
use super::text::shown;
use super::{MeshFormat, add_vertex};
use crate::mesh::{MeshError, ModelBuilder, NO_VALUE};
use plumbline_num::run::Run;

/// Ignored keywords with the number of values per item, from the format specification: vertex indices and a reference for
/// elements, one index for lists of entities, components for vectors.
const KEYWORDS: [(&[u8], usize); 13] = [
    (b"Tetrahedra", 5),
    (b"Hexahedra", 9),
    (b"Edges", 3),
    (b"Corners", 1),
    (b"Ridges", 1),
    (b"RequiredVertices", 1),
    (b"RequiredEdges", 1),
    (b"RequiredTriangles", 1),
    (b"Normals", 3),
    (b"NormalAtVertices", 2),
    (b"Tangents", 3),
    (b"TangentAtVertices", 2),
    (b"Prisms", 7),
];

/// Reads the file.
pub(super) fn read(bytes: &[u8], run: &Run) -> Result<ModelBuilder, MeshError> {
    let mut words = Words::new(bytes, 0, 1, MeshFormat::Medit, Some(b'#'));
    let mut builder = ModelBuilder::default();
    while let Some(keyword) = words.next_word() {
        match keyword {
            b"MeshVersionFormatted" => drop(words.whole::<u32>("the version")?),
            b"Dimension" => {
                let dimension: u32 = words.whole("the dimension")?;
                if dimension != 3 {
                    return Err(words.fault(format!("dimension {dimension}; only surfaces in space are read (3)")));
                }
            }
            b"Vertices" => vertices(&mut words, &mut builder, run)?,
            b"Triangles" => faces::<3>(&mut words, &mut builder, run)?,
            b"Quadrilaterals" => faces::<4>(&mut words, &mut builder, run)?,
            b"End" => break,
            _ => {
                let Some((_, values)) = KEYWORDS.iter().find(|(word, _)| *word == keyword) else {
                    return Err(words.fault(format!("{} is no keyword of this format", shown(keyword))));
                };
                let count = count(&mut words, *values)?;
                for _ in 0..count * values {
                    run.check()?;
                    words.number("a value")?;
                }
                if count > 0 {
                    let name = String::from_utf8_lossy(keyword);
                    builder.warnings.push(format!("{name} are left out ({count})"));
                }
            }
        }
    }
    Ok(builder)
}

/// Item count, checked against the remaining file size (at least two bytes per value) before allocation.
fn count(words: &mut Words<'_>, values: usize) -> Result<usize, MeshError> {
    let count: usize = words.whole("the number of items")?;
    let left = words.remaining();
    if count.saturating_mul(2 * values) > left {
        return Err(
            words.fault(format!("{count} items of {values} values are announced, but only {left} bytes follow"))
        );
    }
    Ok(count)
}

fn vertices(words: &mut Words<'_>, builder: &mut ModelBuilder, run: &Run) -> Result<(), MeshError> {
    let count = count(words, 4)?;
    builder.positions.reserve(count);
    for _ in 0..count {
        run.check()?;
        let mut xyz = [0.0; 3];
        for value in &mut xyz {
            *value = words.number("a coordinate")?;
        }
        words.number("a reference")?;
        add_vertex(builder, MeshFormat::Medit, || words.position(), xyz);
    }
    Ok(())
}

fn faces<const N: usize>(words: &mut Words<'_>, builder: &mut ModelBuilder, run: &Run) -> Result<(), MeshError> {
    let vertices = builder.positions.len();
    for _ in 0..count(words, N + 1)? {
        run.check()?;
        let mut corners = [0; N];
        for corner in &mut corners {
            let vertex: usize = words.whole("a vertex")?;
            if vertex == 0 || vertex > vertices {
                return Err(words.fault(format!("a face names vertex {vertex}; there are {vertices}, numbered from 1")));
            }
            *corner = vertex as u32 - 1;
        }
        words.number("a reference")?;
        builder.face(&corners, NO_VALUE, NO_VALUE);
    }
    Ok(())
}
