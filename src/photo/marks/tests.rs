use super::*;
use crate::{Line, Orientation};
use plumbline_num::math::{Point2, Rect};

const SIZE: (u32, u32) = (400, 300);

fn file(lines: &str) -> String {
    format!(
        r#"{{"format": "plumbline.lines", "version": 1, "source": {{"width": 400, "height": 300}}, "lines": [{lines}]}}"#
    )
}

fn refused(lines: &str) -> String {
    LinesFile::parse(&file(lines), SIZE).expect_err("refused").to_string()
}

#[test]
fn written_files_are_read_back() {
    let line = |name: &str, points: &[[f64; 2]], orientation| Line {
        name: name.into(),
        points: points.iter().map(|[x, y]| Point2::new(*x, *y)).collect(),
        orientation,
    };
    let mut written = LinesFile::new(
        SIZE,
        vec![
            line("door \"A\"", &[[1.5, 2.25], [3.0, 200.125]], Orientation::Vertical),
            line("eaves", &[[0.0, 0.0], [200.0, 10.0], [400.0, 25.5]], Orientation::Horizontal),
            line("ramp", &[[10.0, 10.0], [90.0, 90.0]], Orientation::Angle(30_f64.to_radians())),
            line("pole", &[[300.0, 10.0], [310.0, 290.0]], Orientation::Free),
        ],
    );
    written.lines[1].off = true;
    let text = written.to_json();
    let read = LinesFile::parse(&text, SIZE).expect("our own file");
    assert_eq!(read.in_use().count(), 3);
    assert!((30_f64.to_radians() - angle(&read.lines[2].line)).abs() < 1e-12);
    written.lines[2].line.orientation = read.lines[2].line.orientation;
    assert_eq!(read, written);
    assert_eq!(text.lines().count(), 6, "one line of text each, and the frame around:\n{text}");
    assert!(text.lines().nth(2).expect("the second line").contains(r#""off":true"#), "{text}");
}

fn angle(line: &Line) -> f64 {
    match line.orientation {
        Orientation::Angle(radians) => radians,
        other => panic!("{other:?}"),
    }
}

#[test]
fn centers_at_integers_are_shifted_and_others_refused() {
    let text = file(r#"{"points": [[0, 0], [10, 20]]}"#);
    let first = |text: &str| LinesFile::parse(text, SIZE).expect("a file").lines[0].line.points[0];
    assert_eq!(first(&text), Point2::new(0.0, 0.0));
    let with = |key: &str, center: &str| text.replacen(r#""source""#, &format!(r#""{key}": {center}, "source""#), 1);
    assert_eq!(first(&with("pixel_center", "0")), Point2::new(0.5, 0.5));
    assert_eq!(first(&with("pixel_centre", "0")), Point2::new(0.5, 0.5), "as the key was spelled once");
    assert_eq!(first(&with("pixel_center", "0.5")), Point2::new(0.0, 0.0));
    let error = LinesFile::parse(&with("pixel_center", "1"), SIZE).expect_err("refused").to_string();
    assert_eq!(error, "pixel_center is 1 (expected 0.5 or 0)");
}

#[test]
fn bare_lists_are_read_with_centers_at_integers() {
    let text = r#"[{"id": "row0", "points": [[5, 6], [50, 60.5]], "orientation": "h"},
                   {"id": 7, "points": [[5, 6], [5, 60]], "orientation": 90},
                   {"points": [[9, 9], [99, 9]], "orientation": null},
                   {"id": "slope", "points": [[-0.5, -0.5], [399.5, 299.5]], "orientation": -30}]"#;
    let read = LinesFile::parse(text, SIZE).expect("a list");
    let lines: Vec<_> = read.in_use().map(|l| (l.name.as_str(), l.orientation)).collect();
    assert_eq!(
        lines[..3],
        [("row0", Orientation::Horizontal), ("7", Orientation::Vertical), ("line 3", Orientation::Free)]
    );
    assert!((angle(&read.lines[3].line) - 150_f64.to_radians()).abs() < 1e-12);
    assert_eq!(read.lines[0].line.points[1], Point2::new(50.5, 61.0));
    assert_eq!(read.lines[3].line.points[1], Point2::new(400.0, 300.0), "the picture's corner");
}

#[test]
fn faults_are_named_with_the_line_and_the_key() {
    for (lines, message) in [
        (r#"{"name": "a", "points": [[1, 2]]}"#, "line 1 (\"a\"): points is a list of 1 (expected two or more)"),
        (
            r#"{"points": [[1, 2], [30, 40]]}, {"name": "b", "points": [[1, 2], [401, 5]]}"#,
            "line 2 (\"b\"): points[1] is (401, 5) (expected a point inside the picture of 400×300 px)",
        ),
        (
            r#"{"name": "dot", "points": [[7, 7], [7, 7.5], [7, 7]]}"#,
            "line 1 (\"dot\"): all points lie within a pixel; mark two points that are apart, or remove the line",
        ),
        (
            r#"{"name": "a", "points": [[1, 2], [30, 40]]}, {"name": "a", "points": [[1, 20], [30, 40]]}"#,
            "line 1 (\"a\") and line 2 (\"a\") have the same name: give each its own",
        ),
        (
            r#"{"name": "a", "points": [[1, 2], [30, 40]], "orientation": "h"},
               {"name": "b", "points": [[30.2, 40], [1, 2.2]], "orientation": 20}"#,
            "line 1 (\"a\") and line 2 (\"b\") are the same line and shall be horizontal and at 20°: remove one, or switch it off",
        ),
    ] {
        assert_eq!(refused(lines), message);
    }
    for (lines, part) in [
        (r#"{"points": [[1, 2], [3, 40]], "colour": 3}"#, "unknown field `colour`"),
        (
            r#"{"points": [[1, 2], [3, 40]], "orientation": "diagonal"}"#,
            "invalid value: string \"diagonal\", expected \"free\"",
        ),
        (r#"{"points": [[1, 2], [3, 40]], "orientation": 400}"#, "invalid value: floating point `400.0`"),
        (r#"{"points": [[1, 2], [3, NaN]]}"#, "line 1 column"),
        (r#"{"points": [[1, 2, 3], [3, 4]]}"#, "line 1 column"),
        (r#"{"points": [[1, 1e999], [3, 4]]}"#, "number out of range"),
        (r#"{"name": "a"}"#, "missing field `points`"),
    ] {
        assert!(refused(lines).contains(part), "{}", refused(lines));
    }
}

#[test]
fn files_of_other_kinds_versions_and_pictures_are_refused() {
    let refused = |text: &str| LinesFile::parse(text, SIZE).expect_err("refused").to_string();
    let good = file("");
    assert_eq!(
        refused(&good.replace("\"width\": 400", "\"width\": 800")),
        "the file is for a picture of 800×300 px and this one has 400×300: mark this picture, or scale the file's positions"
    );
    assert_eq!(
        refused(&good.replace("plumbline.lines", "plumbline.motion")),
        "format \"plumbline.motion\" is not a file of marked lines (expected \"plumbline.lines\")"
    );
    assert_eq!(
        refused(&good.replace("\"version\": 1", "\"version\": 2")),
        "version 2 of a file of marked lines is not supported (expected 1)"
    );
    for text in ["", "{", "null", "3", "[[1]]", "{}", &"[".repeat(100_000), "[{\"points\": {}}]"] {
        assert!(refused(text).starts_with("not a file of marked lines: "), "{text:.20}");
    }
    assert!(LinesFile::parse(&good, SIZE).expect("no lines are fine").lines.is_empty());
}

#[test]
fn duplicate_lines_are_dropped_with_a_note_unless_switched_off() {
    let twice = |off: &str| {
        format!(r#"{{"name": "a", "points": [[1, 2], [30, 40]]}}, {{"name": "b", "points": [[30, 40], [1, 2]]{off}}}"#)
    };
    let read = LinesFile::parse(&file(&twice("")), SIZE).expect("a file");
    assert_eq!(read.lines.len(), 1);
    assert_eq!(read.notes, ["line 2 (\"b\") is left out: it is the same as line 1 (\"a\")"]);
    let read = LinesFile::parse(&file(&twice(r#", "off": true, "orientation": "v""#)), SIZE).expect("a file");
    assert_eq!((read.lines.len(), read.in_use().count(), read.notes.len()), (2, 1, 0));
}

#[test]
fn more_than_anyone_marks_is_refused() {
    let many: Vec<_> = (0..10_001).map(|i| format!(r#"{{"name": "{i}", "points": [[1, 2], [30, 40]]}}"#)).collect();
    assert_eq!(refused(&many.join(",")), "10001 lines are too many (at most 10000): is this the right file?");
}

#[test]
fn faces_are_read_and_written() {
    let text = r#"[{"id": 0, "x": 10, "y": 20, "w": 30, "h": 40}, {"id": 1, "x": 380, "y": -5, "w": 30.5, "h": 30}]"#;
    let read = FacesFile::parse(text, SIZE).expect("a list");
    assert_eq!(read.faces[0].rect, Rect { min: Point2::new(10.0, 20.0), max: Point2::new(40.0, 60.0) });
    let mut changed = read.clone();
    changed.faces[0].off = true;
    assert_eq!(FacesFile::parse(&changed.to_json(), SIZE).expect("our own file"), changed);
    assert_eq!((changed.in_use().count(), read.in_use().count()), (1, 2));
}

#[test]
fn faces_without_area_or_outside_are_refused_with_the_key() {
    let refused = |text: &str| FacesFile::parse(text, SIZE).expect_err("refused").to_string();
    assert_eq!(
        refused(r#"[{"id": 3, "x": 1, "y": 1, "w": 0, "h": 4}]"#),
        "face 1 (\"3\"): w is 0 (expected a finite number above 0)"
    );
    assert_eq!(
        refused(r#"[{"x": 399, "y": 1, "w": 10, "h": 4}]"#),
        "face 1 (\"face 1\"): the middle is (404, 3) (expected inside the picture of 400×300 px)"
    );
    assert!(refused(r#"[{"x": 3, "y": 1, "w": 10, "h": 4, "score": 8}]"#).contains("unknown field `score`"));
}

#[cfg(feature = "schema")]
#[test]
fn the_schemas_agree_with_the_parsers() {
    let lines = serde_json::to_value(lines_schema()).expect("a schema");
    assert_eq!(lines["additionalProperties"], false);
    assert_eq!(lines["required"], serde_json::json!(["format", "version", "source", "lines"]));
    assert_eq!(lines["$defs"]["Entry"]["required"], serde_json::json!(["points"]));
    let faces = serde_json::to_value(faces_schema()).expect("a schema");
    assert_eq!(faces["$defs"]["Entry"]["required"], serde_json::json!(["x", "y", "w", "h"]));
}

#[test]
fn damaged_files_are_refused_or_read_and_nothing_else() {
    let good = file(
        r#"{"name": "a", "points": [[1, 2.5], [30, 40]], "orientation": "h", "off": true}, {"points": [[9, 9], [99, 9]]}"#,
    );
    let pieces = ["[", "]", "{", "}", ",", "\"", "-", "1e308", "null", "1", ":", "\u{0}", "é", "NaN", "true"];
    let mut rng = fastrand::Rng::with_seed(9);
    for _ in 0..5000 {
        let mut text: Vec<char> = good.chars().collect();
        for _ in 0..rng.usize(1..4) {
            let at = rng.usize(0..text.len());
            let until = (at + rng.usize(0..6)).min(text.len());
            text.splice(at..until, pieces[rng.usize(0..pieces.len())].chars());
        }
        let text: String = text.into_iter().collect();
        if let Ok(read) = LinesFile::parse(&text, SIZE) {
            let again = LinesFile::parse(&read.to_json(), SIZE).expect("what was read can be written and read");
            assert_eq!(again.lines.len(), read.lines.len());
        }
        let _ = FacesFile::parse(&text, SIZE);
    }
}
