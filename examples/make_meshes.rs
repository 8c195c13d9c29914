//! Writes the small meshes of `media/`, those that are made to hurt and a character: `make_meshes [DIR]`.

use std::path::{Path, PathBuf};

use plumbline::shape::mesh::io::{WriteOptions, encode_model, write_model};
use plumbline::shape::mesh::{Group, MeshFormat, Model, ModelBuilder, NO_VALUE, TriMesh, shapes};

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "media".to_owned()));
    let write = |name: &str, mesh: TriMesh| write_model(&folder.join(name), &Model::of_mesh(mesh));
    write("mesh-one-triangle.obj", shapes::one_triangle())?;
    write("mesh-moebius.off", shapes::moebius(24, 3))?;
    write("mesh-two-components.ply", shapes::disjoint(&[shapes::icosphere(2), shapes::plane(6)]))?;
    write("mesh-non-manifold-edge.off", shapes::book(3))?;
    write("mesh-hourglass.stl", shapes::hourglass())?;
    write("mesh-bar.ply", shapes::bar([6, 6, 30], [1.0, 1.0, 5.0]))?;
    write("mesh-zero-area.obj", with_zero_area())?;
    write_model(&folder.join("mesh-polygons.obj"), &polygons()?)?;
    let person = plumbline::shape::character::humanoid::humanoid(0.036)?;
    write_model(&folder.join("humanoid.glb"), &person.to_model(None)?)?;
    broken(&folder)
}

/// A square of two halves, and a triangle without area along one side.
fn with_zero_area() -> TriMesh {
    let mut positions = shapes::plane(1).positions().to_vec();
    let mut triangles = shapes::plane(1).triangles().to_vec();
    positions.push(nalgebra::center(&positions[0], &positions[1]));
    triangles.push([0, 4, 1]);
    TriMesh::new(positions, triangles).expect("corners exist")
}

/// A cube of six squares with texture coordinates, a group per pair of opposite sides, and colors.
fn polygons() -> Result<Model, Failure> {
    let mut builder = ModelBuilder::default();
    for k in 0..8_u32 {
        let xyz = [0, 1, 2].map(|axis| f64::from(k >> axis & 1));
        builder.positions.push(xyz.into());
        builder.colors.push([xyz[0] as f32, xyz[1] as f32, xyz[2] as f32, 1.0]);
    }
    builder.texture.values = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let sides = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    for (side, corners) in sides.iter().enumerate() {
        let group = Group { object: "cube".to_owned(), name: ["x", "y", "z"][side / 2].to_owned() };
        let group = builder.group(group);
        builder.face(corners, group, NO_VALUE);
        builder.texture.of_corner.extend([0, 1, 2, 3]);
    }
    Ok(builder.finish()?)
}

/// Files that are to be refused: a coordinate that is not a number, a file that ends early, an address outside its folder.
fn broken(folder: &Path) -> Result<(), Failure> {
    let ball = Model::of_mesh(shapes::icosphere(1));
    let mut nan = encode_model(&ball, MeshFormat::Ply, &WriteOptions::default())?;
    let header = nan.windows(11).position(|w| w == b"end_header\n").expect("a header") + 11;
    std::fs::write(folder.join("mesh-truncated.ply"), &nan[..header + 500])?;
    // The second coordinate of vertex 7, in doubles.
    let at = header + 8 * (3 * 7 + 1);
    nan[at..at + 8].copy_from_slice(&f64::NAN.to_le_bytes());
    std::fs::write(folder.join("mesh-nan.ply"), nan)?;
    let outside = "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":4,\"uri\":\"../outside.bin\"}]}\n";
    std::fs::write(folder.join("mesh-outside.gltf"), outside)?;
    std::fs::write(folder.join("mesh-bad-index.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 -9\n")?;
    Ok(())
}
