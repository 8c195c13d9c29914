use super::*;
use crate::mesh::{Model, Position};
use plumbline_num::run::Run;

fn model(text: &str) -> Model {
    read(text.as_bytes(), &Run::default()).and_then(ModelBuilder::finish).expect("valid")
}

fn fault_of(text: &str) -> String {
    let read = read(text.as_bytes(), &Run::default()).and_then(ModelBuilder::finish);
    read.expect_err("to be refused").to_string()
}

const FULL: &str = "mtllib a.mtl\no box\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0.5 1e-7\nvt 0 0\nvt 1 0.25\nvn 0 0 1\n\
                    g front\nusemtl red paint\nf 1/1/1 2/2/1 3//1 4\ng back\nf -5 -1 2\nf 5 2 1\n";

#[test]
fn what_is_written_reads_back_the_same() {
    let full = model(FULL);
    let mut text = Vec::new();
    write(&full, &mut text).expect("valid");
    assert_eq!(
        read(&text, &Run::default()).and_then(ModelBuilder::finish).expect("valid"),
        full,
        "{}",
        String::from_utf8_lossy(&text)
    );
    assert_eq!(full.faces().get(0), [0, 1, 2, 3]);
    assert_eq!(full.mesh().triangles(), [[0, 1, 2], [0, 2, 3], [0, 4, 1], [4, 1, 0]]);
    assert_eq!(full.face_of_triangle(), [0, 0, 1, 2]);
    assert_eq!(full.materials().get(2).expect("valid").name, "red paint");
    assert_eq!(full.groups().get(1).expect("valid"), &Group { object: "box".into(), name: "back".into() });
    assert_eq!(full.texture().expect("valid").get(1), Some([1.0, 0.25]));
    assert_eq!(
        (full.texture().expect("valid").get(3), full.normals().expect("valid").get(2)),
        (None, Some([0.0, 0.0, 1.0]))
    );
}

#[test]
fn negative_indices_count_back_from_their_line() {
    let early = model("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 5 5 5\nv 6 5 5\nv 5 6 5\nf -3 -2 -1\n");
    assert_eq!(early.mesh().triangles(), [[0, 1, 2], [3, 4, 5]]);
}

#[test]
fn faces_may_come_before_their_vertices_and_lines_may_be_continued() {
    let late = model("f 1 2 \\\n 3\nv 0 0 0 # first\nv 1 0 0\r\nv 0 1 \\\n0");
    assert_eq!(late.mesh().triangles(), [[0, 1, 2]]);
}

#[test]
fn colors_after_positions_are_kept_in_fractions_or_bytes() {
    let fractions = model("v 0 0 0 1 0.5 0\nv 1 0 0 0 0 1 0.5\nv 0 1 0\nf 1 2 3");
    assert_eq!(fractions.colors().expect("valid"), [[1.0, 0.5, 0.0, 1.0], [0.0, 0.0, 1.0, 0.5], [1.0; 4]]);
    let bytes = model("v 0 0 0 255 0 51\nv 1 0 0 0 0 0\nv 0 1 0 0 0 0\nf 1 2 3");
    assert_eq!(bytes.colors().expect("valid")[0], [1.0, 0.0, 0.2, 1.0]);
    let weights = model("v 0 0 0 1.0\nv 1 0 0 1.0\nv 0 1 0 1.0\nf 1 2 3");
    assert_eq!(weights.colors(), None, "a fourth number is a weight");
}

#[test]
fn what_is_left_out_is_told_once_with_its_place() {
    let lines = model("v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2\nl 2 3\nf 1 2\nf 1 2 3\ns off\n");
    let told = ["`f with fewer than three corners` is left out (1 in the file, first in line 6)"];
    assert_eq!(lines.warnings(), [told[0], "`l` is left out (2 in the file, first in line 4)"]);
}

#[test]
fn faults_are_told_with_line_value_and_range() {
    let head = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    for (line, told) in [
        ("f 1 2 9", "OBJ, line 4: a face names vertex 9, but the file has 3"),
        ("f 1 2 0", "OBJ, line 4: vertex 0: numbers start at 1, or at -1 from the end"),
        ("f 1 2 -4", "OBJ, line 4: vertex -4 counts from the end, but only 3 stand before this line"),
        ("f 1/1 2/1 3/1", "OBJ, line 4: a face names texture coordinate 1, but the file has 0"),
        ("f 1 2 99999999999", "OBJ, line 4: a face names vertex 99999999999, more than can be numbered"),
        ("f 1 2 x", "OBJ, line 4: \"x\" is no number of a vertex; corners are written v, v/vt, v//vn or v/vt/vn"),
        ("v 1 2", "OBJ, line 4: a vertex of 2 numbers; x y z are three"),
        ("v 1,5 2 3", "OBJ, line 4: \"1,5\" is not a number"),
        ("v 1 nan 3", "OBJ, line 4: vertex 3 (numbered from 0) has a coordinate that is not finite: (1, NaN, 3)"),
        ("v 1 -1.#IND 3", "OBJ, line 4: vertex 3 (numbered from 0) has a coordinate that is not finite: (1, NaN, 3)"),
    ] {
        assert_eq!(fault_of(&format!("{head}{line}\n")), told);
    }
    assert_eq!(fault_of("hello\nworld\n"), "OBJ, line 3: no vertices (`v x y z`); this may be no OBJ file");
    assert!(matches!(
        read(b"v a", &Run::default()).expect_err("to be refused"),
        MeshError::Malformed { at: Position::Line(1), .. }
    ));
}
