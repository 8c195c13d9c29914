//! Laws of handle files.

use nalgebra::{Point3, Vector3};

use super::*;

/// The corners of the unit cube, x fastest.
fn cube() -> Vec<Point3<f64>> {
    (0..8).map(|i| Point3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2 & 1))).collect()
}

fn file(body: &str) -> Result<HandleFile, HandleFileError> {
    HandleFile::parse(&format!("{{\"format\": \"plumbline.handles\", \"version\": 1, {body}}}"))
}

fn handles(body: &str) -> Result<MeshHandles, HandleFileError> {
    file(body)?.of_mesh(&cube())
}

fn vertices(selection: &str) -> Vec<u32> {
    handles(&format!("\"handles\": [{{\"vertices\": {selection}}}]")).expect("a good selection").handles[0]
        .vertices
        .clone()
}

#[test]
fn every_kind_of_selection_finds_its_vertices() {
    let cases: [(&str, &[u32]); 9] = [
        ("{\"indices\": [5, 2, 2]}", &[2, 5]),
        ("{\"range\": [3, 5]}", &[3, 4, 5]),
        ("{\"box\": {\"low\": [0, 0, 0], \"high\": [1, 0.5, 1]}}", &[0, 1, 4, 5]),
        ("{\"sphere\": {\"center\": [0, 0, 0], \"radius\": 1}}", &[0, 1, 2, 4]),
        ("{\"half_space\": {\"point\": [0.5, 0, 0], \"normal\": [2, 0, 0]}}", &[1, 3, 5, 7]),
        ("{\"nearest\": [[2, 2, 2], [-1, 0, 0.1]]}", &[0, 7]),
        ("{\"union\": [{\"indices\": [1]}, {\"range\": [6, 7]}]}", &[1, 6, 7]),
        ("{\"intersection\": [{\"range\": [0, 5]}, {\"range\": [4, 7]}]}", &[4, 5]),
        ("{\"not\": {\"range\": [1, 7]}}", &[0]),
    ];
    for (selection, expected) in cases {
        assert_eq!(vertices(selection), expected, "{selection}");
    }
}

#[test]
fn sets_are_used_by_name_and_vertices_outside_the_region_are_held() {
    let body = "\"sets\": {\"low\": {\"range\": [0, 3]}, \"corner\": {\"intersection\": [\"low\", {\"indices\": [0, 7]}]}}, \
         \"handles\": [{\"name\": \"a\", \"vertices\": \"corner\"}], \"region\": \"low\"";
    let found = handles(body).expect("good");
    assert_eq!((found.handles[0].vertices.as_slice(), found.outside.as_slice()), (&[0][..], &[4, 5, 6, 7][..]));
}

#[test]
fn a_rigid_handle_turns_about_its_middle_and_then_moves() {
    let body = "\"handles\": [{\"vertices\": {\"range\": [0, 3]}, \"rigid\": \
         {\"rotation\": {\"axis\": [0, 0, 3], \"angle_deg\": 90}, \"translation\": [0, 0, 2]}}]";
    let found = handles(body).expect("good");
    let handle = &found.handles[0];
    let at = |time| handle.track.positions(&handle.vertices, &cube(), time);
    assert_eq!(at(0.0), cube()[..4], "rest at 0");
    // About (½, ½, 0): (0, 0) goes to (1, 0).
    assert!((at(1.0)[0] - Point3::new(1.0, 0.0, 2.0)).norm() < 1e-15);
    let half = handle.track.rotation(0.5).expect("rigid");
    assert!((half.scaled_axis() - Vector3::z() * std::f64::consts::FRAC_PI_4).norm() < 1e-15);
    assert_eq!(at(7.0), at(1.0), "the last key holds on");
    assert_eq!(found.times(), (0.0, 1.0));
}

#[test]
fn turns_about_one_axis_go_all_the_way_and_others_the_shortest() {
    let turned = |rotation: &str| {
        let body =
            format!("\"handles\": [{{\"vertices\": {{\"indices\": [0]}}, \"rigid\": {{\"rotation\": {rotation}}}}}]");
        handles(&body).expect("good").handles[0].track.rotation(0.5).expect("rigid").scaled_axis().z.to_degrees()
    };
    assert!((turned("{\"axis\": [0, 0, 1], \"angle_deg\": 300}") - 150.0).abs() < 1e-9);
    // A quaternion of 300° is one of −60°.
    let (sin, cos) = 150_f64.to_radians().sin_cos();
    assert!((turned(&format!("{{\"quaternion\": [{cos}, 0, 0, {sin}]}}")) + 30.0).abs() < 1e-9);
}

#[test]
fn keys_are_met_exactly_and_smooth_motion_rests_at_them() {
    let body = |how: &str| {
        format!(
            "\"handles\": [{{\"vertices\": {{\"indices\": [6]}}, \"rigid\": {{\"interpolation\": \"{how}\", \"keys\": [\
             {{\"time\": 2}}, {{\"time\": 4, \"translation\": [1, 0, 0]}}, {{\"time\": 5, \"translation\": [3, 0, 0]}}]}}}}]"
        )
    };
    let x = |how: &str, time: f64| {
        let handle = handles(&body(how)).expect("good").handles[0].clone();
        handle.track.positions(&handle.vertices, &cube(), time)[0].x
    };
    for how in ["linear", "smooth"] {
        assert_eq!([0.0, 2.0, 4.0, 5.0, 9.0].map(|t| x(how, t)), [0.0, 0.0, 1.0, 3.0, 3.0], "{how}");
        assert_eq!((x(how, 3.0), x(how, 4.5)), (0.5, 2.0), "{how}: halfway");
    }
    let speed = |how: &str, t: f64| (x(how, t + 1e-4) - x(how, t)) / 1e-4;
    assert!(speed("smooth", 4.0) < 1e-2 && (speed("linear", 4.0) - 2.0).abs() < 1e-9);
}

#[test]
fn vertices_are_listed_by_index_and_by_position_as_in_every_other_file() {
    let corner = cube()[2];
    let body = format!(
        "\"handles\": [{{\"vertices\": [5, [{}, {}, {}], {{\"vertex\": 7}}], \"weight\": 3}}]",
        corner.x, corner.y, corner.z
    );
    assert_eq!(handles(&body).expect("good").handles[0].vertices, [2, 5, 7]);
    let refused =
        |vertices: &str| handles(&format!("\"handles\": [{{\"vertices\": {vertices}}}]")).expect_err("refused");
    assert!(refused("[99]").to_string().contains("99"));
    let message = refused("[\"a\"]").to_string();
    assert!(message.contains("a vertex: its index, a position [x, y, z]"), "{message}");
}

#[test]
fn places_go_to_the_vertices_in_the_order_in_which_they_were_named() {
    let body =
        "\"handles\": [{\"vertices\": {\"indices\": [5, 2]}, \"positions\": [[5, 5, 5], [2, 2, 2]], \"weight\": 3}]";
    let found = handles(body).expect("good");
    let handle = &found.handles[0];
    let at = handle.track.positions(&handle.vertices, &cube(), 1.0);
    assert_eq!((handle.vertices.as_slice(), handle.weight), (&[2, 5][..], Some(3.0)));
    assert_eq!(at, [Point3::new(2.0, 2.0, 2.0), Point3::new(5.0, 5.0, 5.0)]);
    assert!(handle.track.rotation(0.5).is_none());
}

#[test]
fn handles_that_were_written_are_read_again() {
    let body = "\"handles\": [{\"name\": \"a \\\"tip\\\"\", \"vertices\": {\"indices\": [1, 3]}, \"weight\": 2.5,
            \"rigid\": {\"pivot\": [0.1, 0, 3], \"interpolation\": \"smooth\", \"keys\": [
                {\"time\": -1, \"translation\": [0.1, 0.2, 0.3]},
                {\"time\": 0.5, \"rotation\": {\"axis\": [1, 2, 3], \"angle_deg\": 500}},
                {\"time\": 2, \"rotation\": {\"quaternion\": [0.5, 0.5, -0.5, 0.5]}}]}},
        {\"vertices\": {\"indices\": [0]}},
        {\"vertices\": {\"indices\": [4, 2]}, \"positions\": [[9, 8, 7], [0.1, 0.3, 0.7]]}],
        \"region\": {\"indices\": [5]}";
    let first = handles(body).expect("valid");
    let again =
        HandleFile::parse(&first.to_json()).and_then(|f| f.of_mesh(&cube())).expect("what was written is valid");
    let rigid = &first.handles[0];
    for time in [-2.0, 0.1, 0.5, 1.0, 1.9, 3.0] {
        let [a, b] = [&first, &again].map(|h| h.handles[0].track.positions(&rigid.vertices, &cube(), time));
        // The angle goes through degrees.
        let apart = a.iter().zip(&b).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        assert!(apart < 1e-14, "{apart:e} at {time}");
    }
    assert_eq!((&first.handles[1..], &first.outside), (&again.handles[1..], &again.outside));
    assert_eq!((&rigid.name, rigid.weight), (&again.handles[0].name, again.handles[0].weight));
}

#[test]
fn named_sets_are_read_and_written_beside_the_handles() {
    let body = "\"sets\": {\"low\": {\"half_space\": {\"point\": [0, 0, 0.5], \"normal\": [0, 0, -1]}}, \"rest\": {\"not\": \"low\"}}, \
                \"handles\": [{\"vertices\": {\"indices\": [0]}}]";
    let sets = file(body).and_then(|f| f.sets_of_mesh(&cube())).expect("valid");
    assert_eq!(sets.keys().map(String::as_str).collect::<Vec<_>>(), ["low", "rest"]);
    assert_eq!(sets["low"].len() + sets["rest"].len(), 8);
    let text = handles(body).expect("valid").to_json_with_sets(&sets);
    let again = HandleFile::parse(&text).expect("what was written is valid");
    assert_eq!(again.sets_of_mesh(&cube()).expect("valid"), sets);
}

#[test]
fn a_file_without_handles_has_its_sets_and_is_refused_as_handles() {
    let draft = file("\"sets\": {\"a\": {\"indices\": [3]}}, \"handles\": []").expect("a file that is being made");
    assert!(draft.is_empty());
    assert_eq!(draft.sets_of_mesh(&cube()).expect("valid")["a"], [3]);
    assert!(draft.of_mesh(&cube()).is_err());
}

#[test]
fn errors_name_the_handle_the_value_and_the_remedy() {
    let one = |handle: &str| format!("\"handles\": [{{\"name\": \"tip\", {handle}}}]");
    let vertex = "\"vertices\": {\"indices\": [1]}";
    let cases = [
        (one("\"vertices\": {\"indices\": [8]}"), "handle \"tip\": the mesh has no vertex 8 (expected 0 to 7"),
        (one("\"vertices\": \"foot\""), "handle \"tip\": there is no set \"foot\" (sets: none)"),
        (
            one("\"vertices\": {\"sphere\": {\"center\": [9, 9, 9], \"radius\": 1}}"),
            "no vertex of the mesh is inside; the mesh extends from (0, 0, 0) to (1, 1, 1)",
        ),
        (one("\"vertices\": {\"sphere\": {\"center\": [9, 9, 9], \"radius\": 0}}"), "radius is 0 (expected above 0)"),
        (
            one("\"vertices\": {\"box\": {\"low\": [0, 1, 0], \"high\": [1, 0, 1]}}"),
            "low is [0.0, 1.0, 0.0] (expected at most high",
        ),
        (one("\"vertices\": {\"half_space\": {\"point\": [0, 0, 0], \"normal\": [0, 0, 0]}}"), "normal is"),
        (one("\"vertices\": {\"range\": [5, 3]}"), "range is [5, 3]"),
        (
            one("\"vertices\": 3"),
            "the name of a set, a list of vertices (indices, or positions [x, y, z]), or one of {\"indices\"",
        ),
        (one("\"vertices\": {\"disk\": 3}"), "unknown variant `disk`, expected one of `indices`, `range`"),
        (one(&format!("{vertex}, \"positions\": 3")), "a list of positions [x, y, z], or {\"keys\""),
        (one(&format!("{vertex}, \"weight\": 0")), "weight is 0 (expected above 0; leave it out"),
        (one(&format!("{vertex}, \"wieght\": 1")), "unknown field `wieght`"),
        (one(&format!("{vertex}, \"rigid\": {{}}")), "rigid is empty (expected rotation, translation or keys)"),
        (one(&format!("{vertex}, \"rigid\": {{\"translation\": [1, 1e999, 0]}}")), "number out of range"),
        (one(&format!("{vertex}, \"rigid\": {{\"rotation\": {{\"axis\": [0, 0, 0], \"angle_deg\": 1}}}}")), "axis is"),
        (
            one(&format!("{vertex}, \"rigid\": {{\"rotation\": {{\"axis\": [0, 0, 1]}}}}")),
            "{\"axis\": [x, y, z], \"angle_deg\": …}",
        ),
        (one(&format!("{vertex}, \"rigid\": {{\"rotation\": {{\"quaternion\": [0, 0, 0, 0]}}}}")), "quaternion is"),
        (one(&format!("{vertex}, \"rigid\": {{\"keys\": []}}")), "keys is an empty list"),
        (
            one(&format!("{vertex}, \"rigid\": {{\"keys\": [{{\"time\": 1}}, {{\"time\": 1}}]}}")),
            "time is 1 after 1 (expected ascending times",
        ),
        (one(&format!("{vertex}, \"positions\": []")), "positions is a list of 0 (expected 1, one per vertex)"),
        (
            one(&format!("{vertex}, \"positions\": [[0, 0, 0]], \"rigid\": {{\"translation\": [1, 0, 0]}}")),
            "positions is given beside rigid",
        ),
        (
            one("\"vertices\": {\"range\": [0, 1]}, \"positions\": [[0, 0, 0], [1, 1, 1]]"),
            "in the order of the positions",
        ),
        (one("\"vertices\": {\"indices\": [1, 1]}, \"positions\": [[0, 0, 0], [1, 1, 1]]"), "no vertex twice"),
        ("\"handles\": []".to_owned(), "handles is an empty list"),
        (
            "\"handles\": [{\"vertices\": {\"range\": [0, 4]}}, {\"vertices\": {\"range\": [3, 7]}}]".to_owned(),
            "vertex 3 is in handle 1 and in handle 2 (2 vertices in total): remove them from one",
        ),
        (
            "\"sets\": {\"a\": {\"not\": \"b\"}, \"b\": {\"not\": \"a\"}}, \"handles\": [{\"vertices\": \"a\"}]"
                .to_owned(),
            "the set \"a\" is defined by itself",
        ),
    ];
    for (body, message) in cases {
        let message_found = handles(&body).expect_err(&body).to_string();
        assert!(message_found.contains(message), "{body}\n{message_found}\n{message}");
    }
    let other = |text: &str| HandleFile::parse(text).expect_err(text).to_string();
    assert!(
        other("{\"format\": \"x\", \"version\": 1}")
            .contains("is not a file of handles (expected \"plumbline.handles\")")
    );
    assert!(other("{\"format\": \"plumbline.handles\", \"version\": 2}").contains("version 2"));
    assert!(other("[1").contains("line 1 column"));
}

#[test]
fn a_nest_of_selections_deeper_than_any_stack_is_refused() {
    let deep = format!("{}{{\"indices\": [0]}}{}", "{\"not\": ".repeat(100_000), "}".repeat(100_000));
    assert!(file(&format!("\"handles\": [{{\"vertices\": {deep}}}]")).is_err());
}

#[cfg(feature = "schema")]
#[test]
fn the_schema_names_every_key() {
    let schema = serde_json::to_string(&handle_file_schema()).expect("JSON");
    for key in
        ["sets", "handles", "region", "half_space", "nearest", "angle_deg", "quaternion", "interpolation", "weight"]
    {
        assert!(schema.contains(&format!("\"{key}\"")), "{key}");
    }
}
