use super::*;
use crate::mesh::Model;
use crate::mesh::shapes::{icosphere, plane};
use plumbline_num::run::Run;

fn read_back(bytes: &[u8]) -> Result<Model, MeshError> {
    read(bytes, &Run::default()).and_then(ModelBuilder::finish)
}

fn fault_of(bytes: &[u8]) -> String {
    read_back(bytes).map(|_| ()).expect_err("to be refused").to_string()
}

fn written(model: &Model, ascii: bool) -> Vec<u8> {
    let mut bytes = Vec::new();
    write(model, ascii, &mut bytes).expect("valid");
    bytes
}

#[test]
fn what_is_written_reads_back_the_same() {
    let obj = "v 0 0 0 1 0 0.2\nv 1 0 0 0 0 0\nv 1 1 0 0 1 0\nv 0 1 0.1 0 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3 4/1\nf 1/2 3/1 2/1\n";
    let textured =
        super::super::obj::read(obj.as_bytes(), &Run::default()).and_then(ModelBuilder::finish).expect("valid");
    for model in [Model::of_mesh(icosphere(1)), textured] {
        for ascii in [true, false] {
            let again = read_back(&written(&model, ascii)).expect("valid");
            assert_eq!((again.mesh(), again.faces()), (model.mesh(), model.faces()));
            assert_eq!(again.colors(), model.colors());
            let corners = 0..model.faces().corner_count();
            let uv = |m: &Model| corners.clone().map(|c| m.texture().and_then(|t| t.get(c))).collect::<Vec<_>>();
            assert_eq!(uv(&again), uv(&model));
        }
    }
}

#[test]
fn coordinates_that_need_eight_bytes_get_them() {
    let exact = String::from_utf8_lossy(&written(&Model::of_mesh(plane(2)), false)).contains("property float x");
    let far = plane(2).positions().iter().map(|p| p + nalgebra::Vector3::repeat(1e6 + 0.1)).collect();
    let far = Model::of_mesh(plane(2).with_positions(far).expect("valid"));
    assert!(exact && String::from_utf8_lossy(&written(&far, false)).contains("property double x"));
    assert_eq!(read_back(&written(&far, false)).expect("valid").mesh(), far.mesh());
}

/// A triangle with all scalar types, and unknown elements before and after, in either byte order.
fn typed(big: bool) -> Vec<u8> {
    let format = if big { "binary_big_endian" } else { "binary_little_endian" };
    let mut bytes = format!(
        "ply\nformat {format} 1.0\ncomment by hand\nelement camera 1\nproperty list uchar short lens\nproperty double f\n\
         element vertex 3\nproperty short x\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nproperty double y\n\
         property float z\nelement nothing 9000000000\nelement face 1\nproperty uchar flags\nproperty list ushort uint vertex_index\n\
         element edge 1\nproperty int8 a\nend_header\n"
    )
    .into_bytes();
    let mut put = |value: &[u8]| bytes.extend(if big { value.iter().rev().copied().collect() } else { value.to_vec() });
    put(&[2]);
    put(&7_i16.to_le_bytes());
    put(&(-7_i16).to_le_bytes());
    put(&1.5_f64.to_le_bytes());
    for (x, y, z) in [(0_i16, 0.0_f64, 0.5_f32), (-3, 0.25, 0.0), (0, 1e300, 0.0)] {
        put(&x.to_le_bytes());
        for color in [255_u8, 0, 51] {
            put(&[color]);
        }
        put(&y.to_le_bytes());
        put(&z.to_le_bytes());
    }
    put(&[9]);
    put(&3_u16.to_le_bytes());
    for vertex in [2_u32, 1, 0] {
        put(&vertex.to_le_bytes());
    }
    put(&[1]);
    bytes
}

#[test]
fn both_byte_orders_all_types_and_unknown_elements_are_read() {
    for big in [false, true] {
        let model = read_back(&typed(big)).expect("valid");
        assert_eq!(model.mesh().positions()[1], nalgebra::Point3::new(-3.0, 0.25, 0.0));
        assert_eq!(model.mesh().positions()[2].y, 1e300);
        assert_eq!(model.mesh().triangles(), [[2, 1, 0]]);
        assert_eq!(model.colors().expect("valid")[0], [1.0, 0.0, 0.2, 1.0]);
        assert_eq!(model.warnings().len(), 3);
    }
}

#[test]
fn no_prefix_of_a_binary_file_is_read_as_a_whole_one() {
    let bytes = typed(true);
    for length in 0..bytes.len() {
        assert!(read_back(&bytes[..length]).is_err(), "{length} of {} bytes", bytes.len());
    }
}

#[test]
fn strips_are_triangles_of_alternating_order() {
    let text = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n\
                element tristrips 1\nproperty list int int vertex_indices\nend_header\n\
                0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n9 0 1 2 3 -1 2 3 4 -1\n";
    assert_eq!(read_back(text.as_bytes()).expect("valid").mesh().triangles(), [[0, 1, 2], [2, 1, 3], [2, 3, 4]]);
}

#[test]
fn faults_are_told_with_place_value_and_range() {
    let head = |vertices: u64, faces: u64| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n\
             element face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
        )
    };
    for (text, told) in [
        (head(u64::MAX, 0), "PLY, line 10: 18446744073709551615 items of element `vertex` take at least"),
        (
            head(1, 1) + "0 0 nan\n3 0 0 0\n",
            "line 10: vertex 0 (numbered from 0) has a coordinate that is not finite: (0, 0, NaN)",
        ),
        (head(1, 1) + "0 0 0\n3 0 0 7\n", "a face names vertex 7; the file has 1, numbered from 0"),
        (head(1, 1) + "0 0 0\n3 0 -1 0\n", "a face names vertex -1"),
        (
            head(1, 1) + "0 0 0\n3000 0 0 0\n",
            "PLY, line 10: a list `vertex_indices` of 3000 items; the file has room for",
        ),
        (head(1, 1) + "0 0 0\n3 0 0       ", "the file ends where a value should follow"),
        (head(1, 1) + "0 x 0\n3 0 0 0\n", "PLY, line 10: \"x\" is not a number"),
        ("ply\nformat ascii 1.0\nelement vertex 1\n".to_owned(), "the header does not end (`end_header`)"),
        (
            "ply\nformat binary_middle 1.0\nend_header\n".to_owned(),
            "PLY, line 2: format \"binary_middle\" is not known",
        ),
        ("ply\nelement vertex 0\nend_header\n".to_owned(), "the header does not tell the format"),
    ] {
        let fault = fault_of(text.as_bytes());
        assert!(fault.contains(told), "{fault}");
    }
}
