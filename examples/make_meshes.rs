//! Writes the small meshes of `media/`, those that are made to hurt and a character: `make_meshes [DIR]`.

use std::path::{Path, PathBuf};

use nalgebra::Point3;
use plumbline::num::run::Run;
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
    write("giraffe.ply", animal(&GIRAFFE, 0.048))?;
    write("dog.ply", animal(&DOG, 0.048))?;
    write_model(&folder.join("candy.ply"), &candy()?)?;
    broken(&folder)
}

/// A limb: both ends and the radius at each. Those off the plane z = 0 come twice.
type Limb = ([f64; 3], f64, [f64; 3], f64);

/// About 2.7 units high, y up, facing +x.
const GIRAFFE: [Limb; 9] = [
    ([-0.42, 1.28, 0.0], 0.25, [0.34, 1.42, 0.0], 0.29),
    ([0.42, 1.5, 0.0], 0.2, [0.78, 2.38, 0.0], 0.095),
    ([0.78, 2.42, 0.0], 0.12, [1.1, 2.28, 0.0], 0.07),
    ([-0.62, 1.38, 0.0], 0.055, [-0.78, 0.85, 0.0], 0.05),
    ([0.36, 1.2, 0.15], 0.13, [0.34, 0.62, 0.15], 0.075),
    ([0.34, 0.62, 0.15], 0.075, [0.36, 0.05, 0.15], 0.07),
    ([-0.46, 1.15, 0.14], 0.15, [-0.54, 0.62, 0.15], 0.08),
    ([-0.54, 0.62, 0.15], 0.08, [-0.5, 0.05, 0.15], 0.07),
    ([0.75, 2.47, 0.07], 0.045, [0.68, 2.66, 0.11], 0.045),
];

/// A long dog with the limbs of the giraffe.
const DOG: [Limb; 9] = [
    ([-0.6, 0.58, 0.0], 0.2, [0.45, 0.62, 0.0], 0.23),
    ([0.5, 0.7, 0.0], 0.17, [0.74, 1.0, 0.0], 0.12),
    ([0.76, 1.04, 0.0], 0.15, [1.12, 0.93, 0.0], 0.08),
    ([-0.78, 0.62, 0.0], 0.055, [-1.02, 0.36, 0.0], 0.05),
    ([0.44, 0.5, 0.15], 0.12, [0.44, 0.28, 0.16], 0.08),
    ([0.44, 0.28, 0.16], 0.08, [0.47, 0.05, 0.16], 0.075),
    ([-0.6, 0.48, 0.14], 0.13, [-0.66, 0.28, 0.16], 0.085),
    ([-0.66, 0.28, 0.16], 0.085, [-0.62, 0.05, 0.16], 0.075),
    ([0.73, 1.13, 0.08], 0.055, [0.66, 1.3, 0.13], 0.045),
];

/// The surface around tapered limbs, in cells of the size `cell`.
fn animal(limbs: &[Limb], cell: f64) -> TriMesh {
    let distance = |x: &Point3<f64>, (a, at_a, b, at_b): &Limb| {
        let (a, b) = (Point3::from(*a), Point3::from(*b));
        let (along, from) = (b - a, x - a);
        let t = (from.dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
        (from - along * t).norm() - (at_a + (at_b - at_a) * t)
    };
    // The lesser of two distances, rounded where they are within 0.06 of each other.
    let joined = |a: f64, b: f64| a.min(b) - 0.25 * 0.06 * (((0.06 - (a - b).abs()).max(0.0)) / 0.06).powi(2);
    let inside = |x: &Point3<f64>| {
        let x = Point3::new(x.x, x.y, x.z.abs());
        limbs.iter().map(|limb| distance(&x, limb)).reduce(joined).unwrap_or(1.0)
    };
    shapes::level_set(inside, Point3::new(-1.2, -0.15, -0.45), Point3::new(1.35, 2.9, 0.45), cell)
}

/// A round bar along z with six stripes along it, red and white: it shows a twist.
fn candy() -> Result<Model, Failure> {
    let mut builder = ModelBuilder::default();
    let mesh = shapes::cylinder(48, 60, 0.3, 2.4);
    for p in mesh.positions() {
        let stripe = (p.y.atan2(p.x) / std::f64::consts::TAU * 6.0).rem_euclid(1.0) < 0.5;
        builder.positions.push(*p);
        builder.colors.push(if stripe { [0.85, 0.16, 0.15, 1.0] } else { [0.97, 0.95, 0.92, 1.0] });
    }
    for corners in mesh.triangles() {
        builder.face(corners, NO_VALUE, NO_VALUE);
    }
    Ok(builder.finish()?)
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
        let group = builder.group(group)?;
        builder.face(corners, group, NO_VALUE);
        builder.texture.of_corner.extend([0, 1, 2, 3]);
    }
    Ok(builder.finish()?)
}

/// Files that are to be refused: a coordinate that is not a number, a file that ends early, an address outside its folder.
fn broken(folder: &Path) -> Result<(), Failure> {
    let ball = Model::of_mesh(shapes::icosphere(1));
    let mut nan = encode_model(&ball, MeshFormat::Ply, &WriteOptions::default(), &Run::default())?;
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
