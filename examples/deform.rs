//! Bends a mesh: `cargo run --release --example deform -- IN OUT [DEGREES]`.
//!
//! The lowest tenth of the mesh along its longest side is fixed, the highest tenth is rotated by `DEGREES` (90 by default)
//! about that side; everything between follows as rigidly as possible.

#![allow(clippy::print_stdout, reason = "a program that prints its result")]

use std::env;
use std::error::Error;

use plumbline::prelude::*;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = env::args().skip(1).collect();
    let [input, output, rest @ ..] = args.as_slice() else { return Err("usage: deform IN OUT [DEGREES]".into()) };
    let degrees: f64 = rest.first().map_or(Ok(90.0), |text| text.parse())?;
    let run = Run::default();

    // A model is a mesh with all that its file says of it; colors, materials and texture coordinates are written back.
    let model = read_model(input.as_ref(), &ReadLimits::default(), &run)?;
    let (low, high) = model.mesh().bounding_box().ok_or("the mesh has no vertices")?;
    let axis = (high - low).imax();
    let height = |p: &Point3| (p[axis] - low[axis]) / (high[axis] - low[axis]);

    // The constraints: which vertices, and where they go.
    let rest = model.mesh().positions();
    let at_ends = (0..).zip(rest).filter(|(_, p)| !(0.1..=0.9).contains(&height(p))).map(|(v, _)| v);
    let handles = Handles::exact(at_ends)?;
    let (sin, cos) = degrees.to_radians().sin_cos();
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let target = |vertex: &u32| {
        let (p, middle) = (rest[*vertex as usize], low + 0.5 * (high - low));
        let mut rotated = p;
        if height(&p) > 0.5 {
            let (a, b) = (p[u] - middle[u], p[v] - middle[v]);
            (rotated[u], rotated[v]) = (middle[u] + cos * a - sin * b, middle[v] + sin * a + cos * b);
        }
        rotated
    };
    let targets: Vec<Point3> = handles.vertices().iter().map(target).collect();

    // One call. For a handle that is dragged, a `Deformer` factors once and then takes pose after pose.
    let positions = deform(model.mesh(), &handles, &targets, Method::Arap)?;
    write_model(output.as_ref(), &model.with_positions(positions)?)?;
    println!("{output}: {} vertices, {} of them constrained", rest.len(), handles.len());
    Ok(())
}
