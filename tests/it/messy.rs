//! Files as people have them: five more kinds of mess, made by rule. Repair makes each of them something that deforms, and says
//! what it did; a coordinate that is no number is refused by its vertex.

use nalgebra::{Point3, Vector3};
use plumbline::num::run::Run;
use plumbline::shape::mesh::io::{WriteOptions, decode_model, encode_model};
use plumbline::shape::mesh::{HalfEdges, MeshFormat, Model, ReadLimits, RepairOptions, TriMesh, Weld, repair, shapes};
use plumbline::shape::surface::{
    Convergence, DeformOptions, Deformer, HandlePose, Handles, InitialGuess, Method, Unconstrained,
};

/// Every seventh triangle turned over.
fn flipped() -> TriMesh {
    let ball = shapes::icosphere(3);
    let turned = |(t, &[a, b, c]): (usize, &[u32; 3])| if t % 7 == 3 { [a, c, b] } else { [a, b, c] };
    TriMesh::new(ball.positions().to_vec(), ball.triangles().iter().enumerate().map(turned).collect())
        .expect("corners exist")
}

/// Every fifth triangle cut at a point that lies almost on its first edge.
fn needles() -> TriMesh {
    let ball = shapes::icosphere(3);
    let (mut positions, mut triangles) = (ball.positions().to_vec(), Vec::new());
    for (t, &[a, b, c]) in ball.triangles().iter().enumerate() {
        if t % 5 != 0 {
            triangles.push([a, b, c]);
            continue;
        }
        let [p, q, r] = [a, b, c].map(|v| ball.positions()[v as usize]);
        let near = p + (q - p) * 0.5 + (r - p) * 1e-9;
        let new = positions.len() as u32;
        positions.push(near);
        triangles.extend([[a, b, new], [b, c, new], [c, a, new]]);
    }
    TriMesh::new(positions, triangles).expect("corners exist")
}

/// A ball with dust around it.
fn specks() -> TriMesh {
    let dust = (0..40).map(|k| {
        let k = f64::from(k);
        let at = Vector3::new((k * 1.3).sin(), (k * 2.7).cos(), (k * 0.9).sin()) * 1.5;
        let tiny = shapes::icosphere(0).positions().iter().map(|p| p * 1e-4 + at).collect();
        shapes::icosphere(0).with_positions(tiny).expect("finite")
    });
    shapes::disjoint(&std::iter::once(shapes::icosphere(3)).chain(dust).collect::<Vec<_>>())
}

/// Fifty balls in a row, that touch.
fn fifty() -> TriMesh {
    let ball = |k: i32| {
        let moved = shapes::icosphere(1).positions().iter().map(|p| p * 0.5 + Vector3::x() * f64::from(k)).collect();
        shapes::icosphere(1).with_positions(moved).expect("finite")
    };
    shapes::disjoint(&(0..50).map(ball).collect::<Vec<_>>())
}

/// Holds the lowest tenth of a mesh along x and lifts the highest.
fn bent(mesh: &TriMesh) -> Vec<Point3<f64>> {
    let (low, high) = mesh.bounding_box().expect("vertices");
    let share = |p: &Point3<f64>| (p.x - low.x) / (high.x - low.x);
    let end = |upper: bool| -> Vec<u32> {
        let inside = |p: &Point3<f64>| if upper { share(p) > 0.9 } else { share(p) < 0.1 };
        (0..mesh.vertex_count() as u32).filter(|&v| inside(&mesh.positions()[v as usize])).collect()
    };
    let (held, moved) = (end(false), end(true));
    let handles = Handles::exact(held.iter().chain(&moved).copied()).expect("vertices exist");
    let at = |v: u32| mesh.positions()[v as usize];
    let lift = Vector3::new(0.0, 0.2, 0.1) * (high - low).norm();
    let places: Vec<_> =
        handles.vertices().iter().map(|&v| if moved.contains(&v) { at(v) + lift } else { at(v) }).collect();
    let options = DeformOptions { unconstrained: Unconstrained::Keep, ..DeformOptions::default() };
    let mut deformer = Deformer::new(Method::default(), mesh, &handles, &options, &Run::default())
        .expect("what repair leaves can be deformed");
    let pose = HandlePose::new(places);
    deformer.deform(&pose, InitialGuess::Spread, &Convergence::default(), &Run::default()).expect("it ends").positions
}

#[test]
fn four_kinds_of_defects_are_repaired_reported_and_deformed() {
    let cases = [("flipped", flipped()), ("needles", needles()), ("specks", specks()), ("fifty", fifty())];
    for (name, mesh) in cases {
        for weld in [Weld::Exact, Weld::Within(1e-6)] {
            let repaired = repair(&mesh, &RepairOptions { weld, ..RepairOptions::default() }, &Run::default())
                .expect("a run that never stops");
            HalfEdges::new(&repaired.mesh).unwrap_or_else(|e| panic!("{name}: {e}"));
            let told = format!("{}", repaired.report);
            match name {
                "flipped" => assert!(told.contains("turned"), "{told}"),
                "specks" => assert!(told.contains("41 components"), "{told}"),
                "fifty" => assert!(told.contains("components"), "{told}"),
                _ => {}
            }
            let positions = bent(&repaired.mesh);
            assert_eq!(positions.len(), repaired.mesh.vertex_count());
            assert!(positions.iter().all(|p| p.iter().all(|x| x.is_finite())), "{name}");
        }
    }
}

#[test]
fn a_coordinate_that_is_no_number_in_a_binary_file_is_refused_by_its_vertex() {
    let ball = Model::of_mesh(shapes::icosphere(1));
    let file = encode_model(&ball, MeshFormat::Ply, &WriteOptions::default(), &Run::default()).expect("written");
    let header = file.windows(11).position(|w| w == b"end_header\n").expect("a header") + 11;
    for (vertex, axis, value) in [(0, 0, f64::NAN), (7, 1, f64::INFINITY), (41, 2, f64::NEG_INFINITY)] {
        let mut broken = file.clone();
        let at = header + 8 * (3 * vertex + axis);
        broken[at..at + 8].copy_from_slice(&value.to_le_bytes());
        let refused = decode_model(&broken, MeshFormat::Ply, None, &ReadLimits::default(), &Run::default())
            .expect_err("to be refused");
        let told = refused.to_string();
        assert!(
            told.contains(&format!("vertex {vertex} (numbered from 0) has a coordinate that is not finite")),
            "{told}"
        );
    }
}
