//! OBJ writer.

use std::io::{self, Write};

use super::super::write::{Number, one_line};
use crate::mesh::{Model, NO_VALUE};

/// Writes the model with its original polygons; numbers round-trip exactly.
pub(in crate::mesh::io) fn write(model: &Model, out: &mut impl Write) -> io::Result<()> {
    for name in model.material_files() {
        writeln!(out, "mtllib {}", one_line(name))?;
    }
    let opaque = model.colors().is_none_or(|colors| colors.iter().all(|c| c[3] == 1.0));
    for (vertex, p) in model.mesh().positions().iter().enumerate() {
        write!(out, "v {} {} {}", Number(p.x), Number(p.y), Number(p.z))?;
        if let Some(colors) = model.colors() {
            let [r, g, b, a] = colors[vertex];
            write!(out, " {r} {g} {b}")?;
            if !opaque {
                write!(out, " {a}")?;
            }
        }
        writeln!(out)?;
    }
    for [u, v] in model.texture().iter().flat_map(|texture| &texture.values) {
        writeln!(out, "vt {} {}", Number(*u), Number(*v))?;
    }
    for [x, y, z] in model.normals().iter().flat_map(|normals| &normals.values) {
        writeln!(out, "vn {} {} {}", Number(*x), Number(*y), Number(*z))?;
    }
    faces(model, out)
}

/// Writes the faces, with object, group and material statements where these change.
fn faces(model: &Model, out: &mut impl Write) -> io::Result<()> {
    let (mut object, mut group, mut material) = ("", "", "");
    for face in 0..model.faces().len() {
        let of = model.groups().get(face).map_or(("", ""), |g| (&g.object, &g.name));
        if of.0 != object {
            object = of.0;
            writeln!(out, "o {}", one_line(object))?;
        }
        if of.1 != group {
            group = of.1;
            writeln!(out, "g {}", one_line(group))?;
        }
        let name = model.materials().get(face).map_or("", |m| &m.name);
        if name != material {
            material = name;
            writeln!(out, "usemtl {}", one_line(material))?;
        }
        write!(out, "f")?;
        for corner in model.faces().corners(face) {
            let one_of = |of_corner: Option<&[u32]>| of_corner.map(|all| all[corner]).filter(|&i| i != NO_VALUE);
            let texture = one_of(model.texture().map(|texture| &texture.of_corner[..]));
            let normal = one_of(model.normals().map(|normals| &normals.of_corner[..]));
            write!(out, " {}", u64::from(model.faces().vertices()[corner]) + 1)?;
            match (texture.map(|i| u64::from(i) + 1), normal.map(|i| u64::from(i) + 1)) {
                (None, None) => {}
                (Some(t), None) => write!(out, "/{t}")?,
                (None, Some(n)) => write!(out, "//{n}")?,
                (Some(t), Some(n)) => write!(out, "/{t}/{n}")?,
            }
        }
        writeln!(out)?;
    }
    Ok(())
}
