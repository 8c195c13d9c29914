use nalgebra::{Point3, UnitQuaternion, Vector3};

use super::super::Limits;
use super::*;

const LEG: &str = r#"{"format": "plumbline.skeleton", "version": 1, "joints": [
    {"name": "knee", "parent": "hip", "translation": [0, -0.4, 0], "rotation": [2, 0, 0, 0],
     "limits": {"axis": [0, -2, 0], "across": [1, 0, 0], "swing_deg": [140, 5], "twist_deg": [-10, 10]}},
    {"name": "hip", "translation": [0, 0.9, 0], "scale": [2, 2, 2]}],
    "curve": {"nodes": [[0, 1, 0], [1, 2, 3]], "edges": [[0, 1]], "radius": [0.1, 0.2], "node_of_vertex": [1, 1, 0]}}"#;

#[test]
fn joint_frames_are_as_in_the_file_even_if_a_child_comes_first() {
    let file = SkeletonFile::parse(LEG).expect("valid");
    assert_eq!(file.skeleton.find("knee"), Some(0));
    assert_eq!(file.skeleton.joints()[0].parent, Some(1));
    let at = file.skeleton.rest_positions();
    assert!((at[0] - Point3::new(0.0, 0.1, 0.0)).norm() < 1e-15, "{at:?}");
    let limits = file.skeleton.joints()[0].limits.expect("given");
    let expected = Limits { axis: -Vector3::y_axis(), across: Vector3::x_axis(), ..limits };
    assert_eq!(limits, expected);
    assert!(
        (limits.swing[0].to_degrees() - 140.0).abs() < 1e-12 && (limits.twist[0].to_degrees() + 10.0).abs() < 1e-12
    );
    assert_eq!(file.curve.expect("given").node_of_vertex, [1, 1, 0]);
}

#[test]
fn a_round_trip_is_bit_exact() {
    let mut file = SkeletonFile::parse(LEG).expect("valid");
    let mut joints = file.skeleton.joints().to_vec();
    joints[1].rest.rotation = UnitQuaternion::from_euler_angles(0.1, 0.7, -2.0);
    joints[1].limits = None;
    joints[0].limits = None;
    file.skeleton = Skeleton::new(joints).expect("valid");
    assert_eq!(SkeletonFile::parse(&file.to_json()).expect("valid"), file);
}

#[test]
fn errors_name_the_field_and_the_value() {
    let cases = [
        ("\"plumbline.skeleton\"", "\"plumbline.pose\"", "not a file of a skeleton (expected \"plumbline.skeleton\")"),
        ("\"version\": 1", "\"version\": 7", "version 7"),
        ("\"parent\": \"hip\"", "\"parent\": \"hop\"", "there is no joint \"hop\"; did you mean \"hip\"?"),
        ("\"parent\": \"hip\"", "\"parent\": \"knee\"", "cycle: knee → knee"),
        ("\"name\": \"hip\"", "\"name\": \"knee\"", "no joint \"hip\""),
        ("\"rotation\": [2,", "\"rotation\": [0,", "joint \"knee\": rotation is [0.0, 0.0, 0.0, 0.0]"),
        ("[140, 5]", "[200, 5]", "swing"),
        ("[-10, 10]", "[10, -10]", "twist"),
        ("\"across\": [1, 0, 0]", "\"across\": [1, 1, 0]", "across the twist's axis"),
        ("[[0, 1]]", "[[0, 2]]", "an end in edges is 2"),
        ("[1, 1, 0]}", "[1, 5, 0]}", "node_of_vertex is 5"),
        ("[0.1, 0.2]", "[0.1]", "radius is a list of 1"),
        ("\"scale\"", "\"sacle\"", "unknown field `sacle`"),
    ];
    for (from, to, expected) in cases {
        assert!(LEG.contains(from), "{from}");
        let message = SkeletonFile::parse(&LEG.replace(from, to)).expect_err(to).to_string();
        assert!(message.contains(expected), "{to}: {message}");
    }
}

#[cfg(feature = "schema")]
#[test]
fn the_schema_knows_every_key() {
    let schema = serde_json::to_string(&skeleton_file_schema()).expect("JSON");
    for key in
        ["joints", "parent", "translation", "rotation", "scale", "limits", "swing_deg", "curve", "node_of_vertex"]
    {
        assert!(schema.contains(key), "{key}");
    }
}
