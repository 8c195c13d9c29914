use std::fmt::Write as _;
use std::path::Path;

use super::*;
use crate::mesh::shapes::{bar, icosphere, soup};
use crate::mesh::{ModelBuilder, TriMesh};
use plumbline_num::run::Run;

fn decode(bytes: &[u8], format: MeshFormat) -> Result<Model, MeshError> {
    decode_model(bytes, format, None, &ReadLimits::default(), &Run::default())
}

fn off(text: &str) -> Result<Model, MeshError> {
    decode(text.as_bytes(), MeshFormat::Off)
}

#[test]
fn every_format_gives_back_the_triangles_it_was_given() {
    let mesh = bar([3, 2, 5], [0.1, 0.7, 1.0 / 3.0]);
    let model = Model::of_mesh(mesh.clone());
    let formats =
        [MeshFormat::Obj, MeshFormat::Ply, MeshFormat::Off, MeshFormat::Stl, MeshFormat::Gltf, MeshFormat::Glb];
    for (format, ascii) in formats.into_iter().flat_map(|f| [(f, false), (f, true)]) {
        let bytes = encode_model(&model, format, &WriteOptions { ascii }, &Run::default()).expect("valid");
        assert_eq!(detect_format(&bytes, Path::new("x")).unwrap_or(MeshFormat::Obj), format, "told by content");
        let again = decode(&bytes, format).expect("valid");
        let joined = format == MeshFormat::Stl;
        let expected = if joined { soup(&mesh) } else { mesh.clone() };
        assert_eq!(again.mesh().triangles(), expected.triangles(), "{format}");
        let single = matches!(format, MeshFormat::Stl | MeshFormat::Gltf | MeshFormat::Glb);
        for (p, q) in again.mesh().positions().iter().zip(expected.positions()) {
            assert!((p - q).norm() <= if single { 1e-7 } else { 0.0 }, "{format}: {p} {q}");
        }
    }
}

#[test]
fn variants_of_off_are_read() {
    let body = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    for head in
        ["OFF\n3 1 0\n", "OFF 3 1 0\n", "OFF3 1 0\n", "3 1 0\n", "# a\n OFF # b\n\n3 1\n", "\u{feff}OFF\r\n3 1 0\r\n"]
    {
        let text =
            if head.contains('\r') { format!("{head}{}", body.replace('\n', "\r\n")) } else { format!("{head}{body}") };
        assert_eq!(off(&text).expect("valid").mesh().triangles(), [[0, 1, 2]], "{head:?}");
    }
    let full = "STCNOFF\n3 1 0\n0 0 0  0 0 1  1 0 0 0.5  0.1 0.2\n1 0 0  0 0 1  0 1 0 1  0.3 0.4\n0 1 0  0 0 1  0 0 1 1  0.5 0.6\n3 0 1 2 255 0 0\n";
    let full = off(full).expect("valid");
    assert_eq!(full.colors().expect("valid")[0], [1.0, 0.0, 0.0, 0.5]);
    assert_eq!(
        (full.normals().expect("valid").get(1), full.texture().expect("valid").get(2)),
        (Some([0.0, 0.0, 1.0]), Some([0.5, 0.6]))
    );
    assert_eq!(full.warnings(), ["colors of faces are left out (1)"]);
    let bytes = off("COFF\n3 1 0\n0 0 0 255 0 51\n1 0 0 0 0 0\n0 1 0 0 0 0\n3 0 1 2\n").expect("valid");
    assert_eq!(bytes.colors().expect("valid")[0], [1.0, 0.0, 0.2, 1.0]);
}

/// A mesh as OFF; `broken` vertices have no numbers.
fn off_of(mesh: &TriMesh, broken: &[usize]) -> String {
    let mut text = format!("OFF\n{} {} 0\n", mesh.vertex_count(), mesh.triangle_count());
    for (v, p) in mesh.positions().iter().enumerate() {
        let _ =
            if broken.contains(&v) { writeln!(text, "0 nan inf") } else { writeln!(text, "{} {} {}", p.x, p.y, p.z) };
    }
    for [a, b, c] in mesh.triangles() {
        let _ = writeln!(text, "3 {a} {b} {c}");
    }
    text
}

#[test]
fn vertices_that_are_not_finite_are_mended_on_request() {
    let limits = ReadLimits { mend_vertices: true, ..ReadLimits::default() };
    let mended = |text: &str| decode_model(text.as_bytes(), MeshFormat::Off, None, &limits, &Run::default());
    let ball = icosphere(3);
    let [a, b, c] = ball.triangles()[100].map(|v| v as usize);
    let broken = [a, b, c, 7];
    let model = mended(&off_of(&ball, &broken)).expect("mended");
    assert_eq!(model.mesh().triangles(), ball.triangles());
    let edge = nalgebra::distance(&ball.positions()[a], &ball.positions()[b]);
    for (v, (p, q)) in model.mesh().positions().iter().zip(ball.positions()).enumerate() {
        let reach = if broken.contains(&v) { 0.5 * edge } else { 0.0 };
        assert!(nalgebra::distance(p, q) <= reach, "vertex {v}: {p} for {q}");
    }
    let first = broken.iter().min().expect("four");
    let told = format!("are set to the mean of their neighbors: 4, the first of them {first} (numbered from 0)");
    assert!(model.warnings().iter().any(|w| w.ends_with(&told)), "{:?}", model.warnings());
    assert_eq!(mended(&off_of(&ball, &[])).expect("whole").mesh(), &ball);
    // Of no face, or with no whole vertex around.
    let apart = mended("OFF\n4 1 0\n0 0 0\n3 0 0\n0 3 0\nnan 0 0\n3 0 1 2\n").expect("mended");
    assert_eq!(apart.mesh().positions()[3].coords.as_slice(), [1.0, 1.0, 0.0]);
    let lost = mended("OFF\n3 1 0\nnan 0 0\n3 0 inf\n0 nan 0\n3 0 1 2\n").expect_err("nothing to go by");
    assert!(lost.to_string().contains("vertex 0 (numbered from 0) has a coordinate that is not finite"), "{lost}");
}

#[test]
fn faults_of_off_and_stl_are_told_with_place_value_and_range() {
    for (text, told) in [
        (
            "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n",
            "OFF, line 6: \"3\" is no vertex; the file has 3, numbered from 0",
        ),
        (
            "OFF\n3 1 0\n0 0 0\n1 0 0\n0 nan 0\n3 0 1 2\n",
            "line 5: vertex 2 (numbered from 0) has a coordinate that is not finite",
        ),
        (
            "OFF\n3 1 0\n0 0 0\n1 0\n0 1 0\n3 0 1 2\n",
            "OFF, line 4: \"1 0\" has 2 numbers; a vertex of this file has at least 3",
        ),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n", "the file ends where a face should follow"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n4 0 1 2\n", "a face of 4 corners names only 3"),
        (
            "OFF\n18446744073709551615 1 0\n0 0 0\n",
            "18446744073709551615 vertices and 1 faces are announced, but only 6 bytes follow",
        ),
        ("4OFF\n1 0 0\n0 0 0 1\n", "only surfaces in space are read"),
        ("OFF BINARY\n", "binary OFF is not read"),
        ("OFF\nmany\n", "\"many\" should be the numbers of vertices, faces and edges"),
    ] {
        let fault = off(text).expect_err("to be refused").to_string();
        assert!(fault.contains(told), "{fault}");
    }
    let whole = encode_model(&Model::of_mesh(icosphere(0)), MeshFormat::Stl, &WriteOptions::default(), &Run::default())
        .expect("valid");
    let cut = decode(&whole[..whole.len() - 1], MeshFormat::Stl).expect_err("to be refused").to_string();
    assert_eq!(cut, "STL, byte 80: 20 triangles are announced, but the file has room for 19; it is cut short");
    let mut nan = whole.clone();
    nan[84 + 50 + 12..84 + 50 + 16].copy_from_slice(&f32::NAN.to_le_bytes());
    assert!(
        decode(&nan, MeshFormat::Stl)
            .expect_err("to be refused")
            .to_string()
            .contains("byte 146: vertex 3 (numbered from 0)")
    );
    let text = decode(b"solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nendloop\n", MeshFormat::Stl);
    assert_eq!(text.expect_err("to be refused").to_string(), "STL, line 6: \"endloop\" where `vertex` should stand");
}

#[test]
fn binary_stl_may_begin_with_any_word() {
    let mut bytes =
        encode_model(&Model::of_mesh(icosphere(0)), MeshFormat::Stl, &WriteOptions::default(), &Run::default())
            .expect("valid");
    for word in ["solid facet", "ply\n       ", "OFF        "] {
        bytes[..11].copy_from_slice(word.as_bytes());
        assert_eq!(detect_format(&bytes, Path::new("a.stl")), Ok(MeshFormat::Stl));
        assert_eq!(decode(&bytes, MeshFormat::Stl).expect("valid").mesh().triangle_count(), 20);
    }
}

#[test]
fn medit_surfaces_are_read_and_the_rest_is_left_out() {
    let text = "MeshVersionFormatted 1\nDimension 3\nVertices\n4\n0 0 0 1\n1 0 0 1\n0 1 0 1\n0 0 1 1\nTriangles\n1\n1 2 3 0\n\
                Quadrilaterals 1 1 2 3 4 0\nTetrahedra\n1\n1 2 3 4 7\nEnd\n";
    let model = decode(text.as_bytes(), MeshFormat::Medit).expect("valid");
    assert_eq!((model.faces().len(), model.warnings()), (2, &["Tetrahedra are left out (1)".to_owned()][..]));
    let beyond = decode(text.replace("1 2 3 0", "1 2 9 0").as_bytes(), MeshFormat::Medit);
    assert!(
        beyond
            .expect_err("to be refused")
            .to_string()
            .contains("line 11: a face names vertex 9; there are 4, numbered from 1")
    );
}

#[test]
fn a_deformation_keeps_polygons_seams_and_hard_edges() {
    let cube = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
                vn 0 0 -1\nvn 0 0 1\nvn 1 0 0\nf 1/1/1 4/2/1 3/3/1 2/4/1\nf 5/1/2 6/2/2 7/3/2 8/4/2\nf 2/1/3 3/2/3 7/3/3 6/4/3\n";
    let model = decode(cube.as_bytes(), MeshFormat::Obj).expect("valid");
    let rotation = nalgebra::Rotation3::from_euler_angles(0.3, -0.8, 1.9);
    let moved = model.mesh().positions().iter().map(|p| rotation * p * 3.0).collect();
    let moved = model.with_positions(moved).expect("valid");
    assert_eq!((moved.faces(), moved.texture()), (model.faces(), model.texture()));
    for corner in 0..12 {
        let expected = rotation * nalgebra::Vector3::from(model.normals().expect("valid").get(corner).expect("valid"));
        let normal = nalgebra::Vector3::from(moved.normals().expect("valid").get(corner).expect("valid"));
        assert!((normal - expected).norm() < 1e-12, "corner {corner}: {normal} {expected}");
    }
}

#[test]
fn files_appear_whole_and_name_themselves_in_faults() {
    let folder = tempfile::tempdir().expect("valid");
    let path = folder.path().join("a.ply");
    let model = Model::of_mesh(icosphere(1));
    write_model(&path, &model).expect("valid");
    assert_eq!(read_model(&path, &ReadLimits::default(), &Run::default()).expect("valid"), model);
    assert_eq!(std::fs::read_dir(folder.path()).expect("valid").count(), 1, "nothing else is left");
    let refused = |path: &Path, limits: &ReadLimits| {
        read_model(path, limits, &Run::default()).expect_err("to be refused").to_string()
    };
    let small = refused(&path, &ReadLimits { max_bytes: 100, ..ReadLimits::default() });
    assert!(
        small.starts_with(&path.display().to_string()) && small.contains("is more than the limit of 100"),
        "{small}"
    );
    let missing = refused(&folder.path().join("b.ply"), &ReadLimits::default());
    assert!(missing.ends_with("b.ply: cannot be read: no such file; check the name"), "{missing}");
    assert!(refused(folder.path(), &ReadLimits::default()).contains("not a regular file"));
    let into_nothing = write_model(&folder.path().join("none/a.ply"), &model).expect_err("to be refused");
    assert!(into_nothing.is_output(), "{into_nothing}");
    assert!(
        write_model(&folder.path().join("a.xyz"), &model)
            .expect_err("to be refused")
            .to_string()
            .contains("none of .obj")
    );
    std::fs::write(folder.path().join("c.bin"), "\u{1}\u{2}\u{3}").expect("valid");
    assert!(refused(&folder.path().join("c.bin"), &ReadLimits::default()).contains("not a mesh that is read here"));
}

#[test]
fn losses_are_told_before_they_surprise() {
    let mut builder = ModelBuilder::default();
    builder.positions = vec![nalgebra::Point3::origin(); 4];
    builder.colors = vec![[0.5; 4]; 4];
    let group = builder.group(crate::mesh::Group { object: "a".into(), name: String::new() }).expect("a short name");
    builder.face(&[0, 1, 2, 3], group, crate::mesh::NO_VALUE);
    let model = builder.finish().expect("valid");
    assert!(losses(&model, MeshFormat::Obj).is_empty());
    assert_eq!(losses(&model, MeshFormat::Ply), ["groups"]);
    assert_eq!(losses(&model, MeshFormat::Stl).len(), 4);
    assert!(losses(&Model::of_mesh(TriMesh::default()), MeshFormat::Glb).is_empty());
}

#[test]
fn poses_of_polygons_have_the_same_faces_however_they_are_cut_into_triangles() {
    let quad = |second: &str| off(&format!("OFF\n4 1 0\n0 0 0\n{second}\n1 1 0\n0 1 0\n4 0 1 2 3\n")).expect("valid");
    let (convex, concave) = (quad("1 0 0"), quad("0.2 0.6 0"));
    assert_ne!(convex.mesh().triangles(), concave.mesh().triangles(), "the diagonal depends on the pose");
    assert!(convex.has_faces_of(&concave));
    let other = off("OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 1 2 3 0\n").expect("valid");
    assert!(!convex.has_faces_of(&other), "corners in another order are other faces");
}
