use nalgebra::{Matrix4, UnitQuaternion, Vector3};

use super::*;
use crate::character::clip::{Interpolation, rotations};
use crate::character::{Curve, Extrapolation, Joint, Keys, Track};
use plumbline_num::math::Trs;

/// A body with rotated frames, two legs and a leaf joint.
fn skeleton() -> Skeleton {
    let joint = |name: &str, parent, x: [f64; 3], turn: [f64; 3]| Joint {
        name: name.into(),
        parent,
        rest: Trs::rigid(UnitQuaternion::from_scaled_axis(turn.into()), x.into()),
        limits: None,
    };
    Skeleton::new(vec![
        joint("hip", None, [0.1, 1.0, 0.2], [0.3, 0.1, -0.6]),
        joint("leg.L", Some(0), [0.2, -0.1, 0.0], [0.4, -0.4, 0.2]),
        joint("foot.L", Some(1), [0.0, -0.8, 0.1], [0.0, 0.7, 0.0]),
        joint("leg.R", Some(0), [-0.2, -0.1, 0.0], [0.1, 0.6, -0.7]),
        joint("leg.R end", Some(3), [0.1, -0.6, 0.0], [0.0, 0.0, 0.0]),
    ])
    .expect("valid")
}

fn clip() -> Clip {
    let turn =
        |j: f64, t: f64| UnitQuaternion::from_scaled_axis(Vector3::new(0.5 * j, 0.3, -0.4 * j) * (t * 3.0).sin());
    let times: Vec<f64> = (0..9).map(|k| 0.25 * f64::from(k)).collect();
    let track = |joint: u32| {
        let rest = skeleton().joints()[joint as usize].rest.rotation;
        let turns: Vec<_> = times.iter().map(|&t| rest * turn(f64::from(joint) + 1.0, t)).collect();
        Track { joint, curve: Curve::Rotation(rotations(times.clone(), &turns, Interpolation::Linear).expect("valid")) }
    };
    let place = |t: &f64| [0.1 + t.sin(), 1.0, 0.2 - 0.1 * t];
    let keys = Keys::new(times.clone(), times.iter().map(place).collect(), Interpolation::Linear).expect("valid");
    let moves = Track { joint: 0, curve: Curve::Translation(keys) };
    Clip::new("motion", vec![moves, track(0), track(1), track(2), track(3)], vec![]).expect("valid")
}

/// World positions of joints, by name.
fn places(skeleton: &Skeleton, pose: &crate::character::Pose) -> Vec<(String, Vector3<f64>)> {
    let worlds: Vec<Matrix4<f64>> = skeleton.globals(pose).expect("valid");
    let place = |(j, m): (&Joint, &Matrix4<f64>)| (j.name.clone(), m.fixed_view::<3, 1>(0, 3).into_owned());
    let mut all: Vec<_> = skeleton.joints().iter().zip(&worlds).map(place).collect();
    all.sort_by(|a, b| a.0.cmp(&b.0));
    all
}

fn same_places(a: &[(String, Vector3<f64>)], b: &[(String, Vector3<f64>)]) {
    assert_eq!(a.len(), b.len());
    for ((name, p), (other, q)) in a.iter().zip(b) {
        assert!(name == other && (p - q).norm() < 1e-9, "{name} {p} {other} {q}");
    }
}

#[test]
fn bvh_round_trips_the_skeleton_and_its_clip() {
    let (text, lost) = bvh_text(&skeleton(), Some(&clip())).expect("valid");
    assert!(lost.is_empty() && text.contains("End Site"), "{lost:?}");
    let rig = parse_bvh(&text).expect("own files are read");
    same_places(&places(&rig.skeleton, &rig.skeleton.rest_pose()), &places(&skeleton(), &skeleton().rest_pose()));
    for (k, t) in (0..9_u32).map(|k| (k as usize, 0.25 * f64::from(k))) {
        let [a, b] = [(&rig.skeleton, &rig.clips[0]), (&skeleton(), &clip())]
            .map(|(s, c)| places(s, &c.pose(s, t, Extrapolation::Constant).expect("valid")));
        assert_eq!(rig.clips[0].tracks()[0].curve.times()[k], t);
        same_places(&a, &b);
    }
    let (again, _) = bvh_text(&rig.skeleton, rig.clips.first()).expect("valid");
    assert_eq!(again.lines().count(), text.lines().count());
}

#[test]
fn bvh_round_trips_names_that_end_in_a_brace() {
    for name in ["{", "a {", "a{", "{ {", "} b"] {
        let mut joints = parse_skel("2\n0 0 0 a root\n1 0 0 b a\n").expect("two joints").joints().to_vec();
        name.clone_into(&mut joints[1].name);
        let skeleton = Skeleton::new(joints).expect("two joints");
        let (text, _) = bvh_text(&skeleton, None).expect("one root");
        let read = parse_bvh(&text).unwrap_or_else(|e| panic!("{name}: {e}\n{text}"));
        assert!(read.skeleton.joints().iter().any(|j| j.name == name), "{name}: {text}");
    }
}

#[test]
fn bvh_reads_any_order_of_channels() {
    let text = "HIERARCHY\nROOT a b\n{\n OFFSET 1 2 3\n CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n \
                JOINT c {\n OFFSET 0 1 0\n CHANNELS 3 Yrotation Xrotation Zrotation\n End Site\n {\n OFFSET 0 2 0\n }\n }\n}\n\
                MOTION\nFrames: 2\nFrame Time: 0.5\n0 0 0 0 0 0 0 0 0\n1 1 1 90 0 0 0 90 0\n";
    let rig = parse_bvh(text).expect("valid");
    let names: Vec<&str> = rig.skeleton.joints().iter().map(|j| j.name.as_str()).collect();
    assert_eq!(names, ["a b", "c", "c end"]);
    let pose = rig.clips[0].pose(&rig.skeleton, 0.5, Extrapolation::Constant).expect("valid");
    let there = places(&rig.skeleton, &pose);
    // The root rotates y to −x; c then rotates its own y to z.
    assert!((there[1].1 - Vector3::new(1.0, 3.0, 4.0)).norm() < 1e-12, "{there:?}");
    assert!((there[2].1 - Vector3::new(1.0, 3.0, 6.0)).norm() < 1e-12, "{there:?}");
}

#[test]
fn tgf_and_skel_round_trip_the_joints() {
    let (skeleton, rest) = (skeleton(), skeleton().rest_positions());
    let graph = parse_tgf(&tgf_text(&skeleton)).expect("own files are read").skeleton;
    let list = parse_skel(&skel_text(&skeleton)).expect("own files are read");
    for other in [&graph, &list] {
        for (j, joint) in other.joints().iter().enumerate() {
            assert_eq!(joint.parent, skeleton.joints()[j].parent);
            assert!((other.rest_positions()[j] - rest[j]).norm() < 1e-12);
        }
    }
    assert_eq!(list.joints()[4].name, "leg.R_end");
}

#[test]
fn graphs_may_have_bones_in_either_direction_and_further_sections() {
    let text = "7 0 0 0 9 9\n8 1 0 0\n9 1 1 0\n3 2 0 0\n#\n7 8\n9 8\n8 3\n#\n1 2 3\n";
    let rig = parse_tgf(text).expect("valid");
    let parents: Vec<_> = rig.skeleton.joints().iter().map(|j| j.parent).collect();
    assert_eq!(parents, [None, Some(0), Some(1), Some(1)], "away from the first joint");
    assert_eq!(rig.warnings, ["lines after the bones are left out (1)"]);
}

#[test]
fn anim_clips_rotate_about_their_axes() {
    let skeleton = parse_skel("3\n0 0 0 a root\n1 0 0 b a\n2 0 0 c b\n").expect("valid");
    let text = "2 2\n0\n1 0 0\n1 0 0\n0 0\n1\n0 0 2\n0 0 1\n1.5707963267948966 -1.5707963267948966\n";
    let clip = parse_anim(text, "wave", &skeleton).expect("valid");
    let pose = clip.pose(&skeleton, 1.0, Extrapolation::Constant).expect("valid");
    let there = places(&skeleton, &pose);
    assert!((there[1].1 - Vector3::y()).norm() < 1e-12 && (there[2].1 - Vector3::new(1.0, 1.0, 0.0)).norm() < 1e-12);
    assert_eq!((clip.name(), clip.span()), ("wave", Some((0.0, 1.0))));
}

#[test]
fn the_format_follows_from_the_extension() {
    let folder = tempfile::tempdir().expect("writable");
    for extension in ["json", "bvh", "tgf", "skel"] {
        let path = folder.path().join(format!("a.{extension}"));
        let (text, _) = rig_text(&skeleton(), Some(&clip()), extension).expect("valid");
        std::fs::write(&path, text).expect("writable");
        let rig = read_rig(&path, &ReadLimits::default(), &Run::default()).expect("own files are read");
        let moves = usize::from(["json", "bvh"].contains(&extension));
        assert_eq!((rig.skeleton.joint_count(), rig.clips.len()), (5, moves), "{extension}");
    }
    let told = read_rig(&folder.path().join("a.max"), &ReadLimits::default(), &Run::default())
        .expect_err("to be refused")
        .to_string();
    assert!(
        told.ends_with("a.max: unknown skeleton file extension (expected json, glb, gltf, vrm, fbx, bvh, tgf or skel)")
    );
    assert!(rig_text(&skeleton(), None, "fbx").is_err());
}

/// A motion of one rotation of one digit for each of `joints` joints.
fn digits(joints: usize, frames: usize) -> String {
    let roots = "ROOT a\n{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\n}\n".repeat(joints);
    let numbers = "1 ".repeat(joints * frames);
    format!("HIERARCHY\n{roots}MOTION\nFrames: {frames}\nFrame Time: 0.5\n{numbers}")
}

#[test]
fn curves_of_a_motion_share_their_times() {
    let rig = parse_bvh(&digits(3, 4)).expect("valid");
    let times: Vec<&[f64]> = rig.clips[0].tracks().iter().map(|t| t.curve.times()).collect();
    assert_eq!(times, [[0.0, 0.5, 1.0, 1.5]; 3]);
    assert!(times.iter().all(|t| std::ptr::eq(*t, times[0])));
}

#[test]
fn motions_that_take_far_more_memory_than_their_text_are_refused() {
    // 32 bytes for each of 1.2 · 10⁷ numbers of two bytes.
    let told = parse_bvh(&digits(100, 120_000)).expect_err("to be refused").to_string();
    let expected = "BVH, line 504: 120000 frames of 100 numbers take 384000000 bytes in memory (at most ";
    assert!(told.starts_with(expected) && told.ends_with("or numbers with more digits"), "{told}");
    // A motion that announces more frames than it has is cut short, not too large.
    let cut = digits(100, 10).replace("Frames: 10", "Frames: 4000000");
    let told = parse_bvh(&cut).expect_err("to be refused").to_string();
    assert!(told.ends_with("it is cut short"), "{told}");
}

#[test]
fn errors_name_the_line_and_the_value() {
    let bvh = |text: &str| parse_bvh(text).expect_err("to be refused").to_string();
    assert_eq!(
        bvh("HIERARCHY\nROOT a\n{\n OFFSET 0 x 0\n"),
        "BVH, line 4: \"x\" is no finite number, where the offset is expected"
    );
    assert_eq!(
        bvh("HIERARCHY\nROOT a\n{\n OFFSET 0 0 0\n"),
        "BVH, line 4: the file ends where a part of the joint, or } is expected; it is cut short"
    );
    let head = "HIERARCHY\nROOT a\n{\n OFFSET 0 0 0\n CHANNELS 1 Xrotation\n}\nMOTION\nFrames: 2\nFrame Time: ";
    assert_eq!(bvh(&format!("{head}0\n0\n0\n")), "BVH, line 9: 0 s between frames (expected more than 0)");
    assert!(bvh(&format!("{head}0.1\n0\nNaN\n")).starts_with("BVH, line 11: \"NaN\" is no finite number"));
    assert!(bvh(&format!("{head}0.1\n0\n")).contains("cut short"));
    assert!(bvh(&format!("{head}0.1\n0\n0\n0\n")).contains("after the last of 2 frames"));
    let tgf = |text: &str| parse_tgf(text).expect_err("to be refused").to_string();
    assert_eq!(tgf("1 0 0\n"), "TGF, line 1: joint 1 needs three finite numbers for its place");
    assert_eq!(tgf("1 0 0 0\n#\n1 2\n"), "TGF, line 3: there is no joint 2");
    assert_eq!(tgf("1 0 0 0\n1 0 0 0\n"), "TGF, line 2: a second joint 1");
    assert_eq!(
        tgf("1 0 0 0\n2 0 0 0\n3 0 0 0\n#\n1 2\n2 3\n3 2\n"),
        "TGF, line 7: this bone closes a cycle; a skeleton is a tree"
    );
    assert!(tgf("1 0 0 0\n2 0 0 0\n#\n1 2\n2 1\n").contains("joints form a cycle: 1 → 2 → 1"));
    let skel = |text: &str| parse_skel(text).expect_err("to be refused").to_string();
    assert_eq!(skel("1\n0 0 0 a b\n"), "skel, line 2: there is no joint \"b\"; a joint without a parent has `root`");
    let one = parse_skel("1\n0 0 0 a root\n").expect("valid");
    let anim = |text: &str| parse_anim(text, "x", &one).expect_err("to be refused").to_string();
    assert_eq!(
        anim("1 2\n"),
        "anim, line 1: \"2\", where the number of joints, no more than the skeleton has is expected (0 to 1)"
    );
    let odd = parse_anim("2 1\n1\n1 0 0\n0\n0.5\n1 0 0\n0.1\n", "x", &one).expect("valid");
    assert_eq!(odd.span(), Some((0.0, 1.0)), "times that do not ascend are those of the poses' numbers");
    assert!(anim("1 1\n0\n0 0 0\n0.5\n").contains("about an axis without length"));
}

#[test]
fn a_root_may_be_named_root_in_a_skel_file() {
    let joint = |name: &str, parent: Option<u32>, x: f64| Joint {
        name: name.into(),
        parent,
        rest: Trs::from_translation(Vector3::new(x, 0.5, 0.0)),
        limits: None,
    };
    for several in [false, true] {
        let mut joints = vec![joint("root", None, 1.0), joint("arm", Some(0), 2.0)];
        joints.extend(several.then(|| joint("prop", None, -3.0)));
        let skeleton = Skeleton::new(joints).expect("valid");
        let again = parse_skel(&skel_text(&skeleton)).expect("own files are read");
        assert_eq!(again.rest_positions(), skeleton.rest_positions());
        for (a, b) in again.joints().iter().zip(skeleton.joints()) {
            assert!(a.parent == b.parent && (several || a.name == b.name), "{a:?} {b:?}");
        }
    }
}
