use nalgebra::{Point3, UnitQuaternion, Vector3};

use super::super::clip::rotations;
use super::super::{Curve, Interpolation, Keys, Limits, Track};
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

/// Curves of every property and interpolation, with numbers that have no short decimal.
fn clip(name: &str, interpolation: &Interpolation<4>) -> Clip {
    let turned = |k: u32| UnitQuaternion::from_euler_angles(0.1 * f64::from(k), 0.7 / 3.0, -2.0 * f64::from(k).sqrt());
    let times: Vec<f64> = (0..40).map(|k| f64::from(k) / 24.0).collect();
    let quaternions: Vec<_> = (0..40).map(turned).collect();
    let moved: Vec<[f64; 3]> = quaternions.iter().map(|q| [q.i, q.j / 3.0, -q.k]).collect();
    let curves = [
        Curve::Rotation(rotations(times.clone(), &quaternions, interpolation.clone()).expect("valid")),
        Curve::Translation(Keys::new(times.clone(), moved.clone(), Interpolation::Smooth).expect("valid")),
        Curve::Scale(Keys::new(times, moved, Interpolation::Linear).expect("valid")),
    ];
    let tracks = curves.into_iter().map(|curve| Track { joint: 1, curve }).collect();
    Clip::new(name, tracks, Vec::new()).expect("valid")
}

#[test]
fn clips_keep_their_keys_and_their_interpolation_bit_for_bit() {
    let tangents = vec![[0.1, -0.2, 1.0 / 3.0, 0.4]; 40];
    let cubic = Interpolation::Cubic { arriving: tangents.clone(), leaving: tangents };
    let all = [Interpolation::Step, Interpolation::Linear, Interpolation::Smooth, cubic];
    let clips: Vec<Clip> = all.iter().enumerate().map(|(k, kind)| clip(&format!("clip {k}"), kind)).collect();
    let file = SkeletonFile { clips, ..SkeletonFile::parse(LEG).expect("valid") };
    assert_eq!(SkeletonFile::parse(&file.to_json()).expect("valid"), file);
}

const KICK: &str = r#"{"format": "plumbline.skeleton", "version": 1, "joints": [{"name": "knee"}], "clips": [{"name": "kick",
    "tracks": [{"joint": "knee", "property": "rotation", "interpolation": "smooth", "times": [0, 0.5],
                "values": [[1, 0, 0, 0], [8, 6, 0, 0]]}]}]}"#;

#[test]
fn rotations_of_clips_are_w_x_y_z_of_any_length() {
    let file = SkeletonFile::parse(KICK).expect("valid");
    let pose =
        file.clips[0].pose(&file.skeleton, 0.5, crate::character::Extrapolation::default()).expect("of this skeleton");
    let expected = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 2.0 * 0.6_f64.asin());
    assert!(pose.locals[0].rotation.angle_to(&expected) < 1e-12, "{}", pose.locals[0].rotation);
}

#[test]
fn errors_of_clips_name_the_clip_and_the_joint() {
    let tangents = "\"values\": [[1, 0, 0, 0], [8, 6, 0, 0]], \"arriving\": [[0, 0, 0, 0], [0, 0, 0, 0]]";
    let twice = KICK.replace(
        "}]}]}",
        r#"}, {"joint": "knee", "property": "rotation", "times": [0], "values": [[1, 0, 0, 0]]}]}]}"#,
    );
    let cases = [
        (KICK.replace("\"joint\": \"knee\"", "\"joint\": \"kneel\""), "no joint \"kneel\""),
        (KICK.replace("[0, 0.5]", "[0.5, 0]"), "must be finite and ascend"),
        (KICK.replace("[0, 0.5]", "[]"), "0 key times"),
        (KICK.replace("[0, 0.5]", "[0, 1e999]"), "number out of range"),
        (KICK.replace("[8, 6, 0, 0]", "[0, 0, 0, 0]"), "is no rotation"),
        (KICK.replace("[8, 6, 0, 0]", "[8, 6, 0]"), "clip \"kick\", joint \"knee\": a key of 3 numbers (expected 4)"),
        (KICK.replace("\"rotation\"", "\"spin\""), "unknown variant `spin`"),
        (KICK.replace("\"smooth\"", "\"cubic\""), "2 key times and 0 values"),
        (KICK.replace("\"values\": [[1, 0, 0, 0], [8, 6, 0, 0]]", tangents), "belong to \"cubic\""),
        (twice, "two tracks for the rotation 0"),
    ];
    for (text, expected) in cases {
        let message = SkeletonFile::parse(&text).expect_err(expected).to_string();
        assert!(message.contains(expected), "{expected}: {message}");
    }
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
    let of_joints = ["joints", "parent", "translation", "rotation", "scale", "limits", "swing_deg"];
    for key in of_joints.iter().chain(&["curve", "node_of_vertex", "clips", "tracks", "property", "smooth", "arriving"])
    {
        assert!(schema.contains(key), "{key}");
    }
}
