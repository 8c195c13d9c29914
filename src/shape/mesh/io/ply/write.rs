//! PLY writer.

use std::io::{self, Write};

use super::super::write::{Number, per_vertex};
use crate::mesh::{CornerData, Model};

/// Layout of the vertex and face elements of the file.
#[expect(clippy::struct_excessive_bools, reason = "each is a choice of the file's own")]
struct Layout<'a> {
    model: &'a Model,
    /// Positions need double precision to round-trip.
    double: bool,
    normals: Option<Vec<[f64; 3]>>,
    texture: Option<Vec<[f64; 2]>>,
    corner_texture: Option<&'a CornerData<2>>,
    /// All colors are multiples of 1/255 and are written as bytes.
    bytes: bool,
    alpha: bool,
    /// A polygon has more than 127 corners: its list of texture coordinates, two per corner, would overflow a byte count.
    long: bool,
    ascii: bool,
}

/// Writes the model: positions as float if that is exact, else as double; texture coordinates per vertex if each vertex has
/// only one, else per face corner.
pub(in crate::mesh::io) fn write(model: &Model, ascii: bool, out: &mut impl Write) -> io::Result<()> {
    let layout = Layout::of(model, ascii);
    layout.header(out)?;
    for vertex in 0..model.mesh().vertex_count() {
        layout.vertex(vertex, out)?;
    }
    for face in 0..model.faces().len() {
        layout.face(face, out)?;
    }
    Ok(())
}

impl<'a> Layout<'a> {
    fn of(model: &'a Model, ascii: bool) -> Self {
        let exact = |x: &f64| f64::from(*x as f32).to_bits() == x.to_bits();
        let texture = model.texture().and_then(|t| per_vertex(model, t));
        let whole = |c: &f32| (c * 255.0 - (c * 255.0).round()).abs() < 1e-4 && (0.0..=1.0).contains(c);
        let colors = model.colors().unwrap_or_default();
        Self {
            model,
            double: !model.mesh().positions().iter().all(|p| p.coords.iter().all(exact)),
            normals: model.normals().and_then(|n| per_vertex(model, n)),
            corner_texture: if texture.is_none() { model.texture() } else { None },
            texture,
            bytes: colors.iter().flatten().all(whole),
            alpha: colors.iter().any(|c| c[3] != 1.0),
            long: model.faces().iter().any(|face| face.len() > 127),
            ascii,
        }
    }

    fn header(&self, out: &mut impl Write) -> io::Result<()> {
        let encoding = if self.ascii { "ascii" } else { "binary_little_endian" };
        let position = if self.double { "double" } else { "float" };
        let color = if self.bytes { "uchar" } else { "float" };
        writeln!(out, "ply\nformat {encoding} 1.0\nelement vertex {}", self.model.mesh().vertex_count())?;
        let mut properties =
            |kind: &str, names: &[&str]| names.iter().try_for_each(|n| writeln!(out, "property {kind} {n}"));
        properties(position, &["x", "y", "z"])?;
        if self.normals.is_some() {
            properties("float", &["nx", "ny", "nz"])?;
        }
        if self.model.colors().is_some() {
            properties(color, if self.alpha { &["red", "green", "blue", "alpha"] } else { &["red", "green", "blue"] })?;
        }
        if self.texture.is_some() {
            properties("double", &["s", "t"])?;
        }
        writeln!(
            out,
            "element face {}\nproperty list {} int vertex_indices",
            self.model.faces().len(),
            self.length_type()
        )?;
        if self.corner_texture.is_some() {
            writeln!(out, "property list {} double texcoord", self.length_type())?;
        }
        writeln!(out, "end_header")
    }

    /// Type of list lengths: a byte as in most files, unless a polygon has more than 127 corners with two texture coordinates
    /// each.
    fn length_type(&self) -> &'static str {
        if self.long { "uint" } else { "uchar" }
    }

    fn vertex(&self, vertex: usize, out: &mut impl Write) -> io::Result<()> {
        let mut row = Row { ascii: self.ascii, first: true, out };
        for &x in &self.model.mesh().positions()[vertex].coords {
            row.real(x, self.double)?;
        }
        if let Some(normals) = &self.normals {
            normals[vertex].iter().try_for_each(|&x| row.real(x, false))?;
        }
        if let Some(colors) = self.model.colors() {
            for &c in &colors[vertex][..if self.alpha { 4 } else { 3 }] {
                if self.bytes { row.byte((c * 255.0).round() as u8)? } else { row.real(f64::from(c), false)? }
            }
        }
        if let Some(texture) = &self.texture {
            texture[vertex].iter().try_for_each(|&x| row.real(x, true))?;
        }
        row.end()
    }

    fn face(&self, face: usize, out: &mut impl Write) -> io::Result<()> {
        let mut row = Row { ascii: self.ascii, first: true, out };
        let corners = self.model.faces().corners(face);
        row.length(corners.len(), self.long)?;
        self.model.faces().get(face).iter().try_for_each(|&v| row.int(v.cast_signed()))?;
        if let Some(texture) = self.corner_texture {
            row.length(2 * corners.len(), self.long)?;
            for corner in corners {
                texture.get(corner).unwrap_or_default().iter().try_for_each(|&x| row.real(x, true))?;
            }
        }
        row.end()
    }
}

/// Writer of the values of one item.
struct Row<'a, W> {
    ascii: bool,
    first: bool,
    out: &'a mut W,
}

impl<W: Write> Row<'_, W> {
    fn put(&mut self, bytes: &[u8], text: std::fmt::Arguments<'_>) -> io::Result<()> {
        if !self.ascii {
            return self.out.write_all(bytes);
        }
        let gap = if std::mem::replace(&mut self.first, false) { "" } else { " " };
        write!(self.out, "{gap}{text}")
    }

    fn real(&mut self, x: f64, double: bool) -> io::Result<()> {
        if double {
            self.put(&x.to_le_bytes(), format_args!("{}", Number(x)))
        } else {
            self.put(&(x as f32).to_le_bytes(), format_args!("{}", x as f32))
        }
    }

    fn byte(&mut self, x: u8) -> io::Result<()> {
        self.put(&[x], format_args!("{x}"))
    }

    fn int(&mut self, x: i32) -> io::Result<()> {
        self.put(&x.to_le_bytes(), format_args!("{x}"))
    }

    fn length(&mut self, x: usize, long: bool) -> io::Result<()> {
        if long { self.put(&(x as u32).to_le_bytes(), format_args!("{x}")) } else { self.byte(x as u8) }
    }

    fn end(self) -> io::Result<()> {
        if self.ascii { writeln!(self.out) } else { Ok(()) }
    }
}
