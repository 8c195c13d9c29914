use nalgebra::{Point3, UnitQuaternion, Vector3};

use super::*;
use crate::character::clip::{Curve, Interpolation, rotations};
use crate::character::humanoid::humanoid;
use crate::character::ik::Frames;
use crate::character::{Extrapolation, Joint, Limits, Pose, Track};
use plumbline_num::math::Trs;

fn person() -> crate::character::Character {
    humanoid(0.15).expect("made")
}

/// The humanoid's skeleton without limits.
fn free() -> Skeleton {
    let limited = person().skeleton;
    let joints = limited.joints().iter().map(|j| Joint { limits: None, ..j.clone() });
    Skeleton::new(joints.collect()).expect("valid")
}

/// A walk forward of two steps a second on feet that do not slide: hips at constant speed, and feet by inverse kinematics on paths
/// that are still while they are down.
fn walk(skeleton: &Skeleton) -> Clip {
    let named = |name: &str| skeleton.named(name).expect("there");
    let rest = skeleton.rest_pose();
    let (at, step) = (skeleton.rest_positions(), 0.6);
    let times: Vec<f64> = (0..=90).map(|k| f64::from(k) / 30.0).collect();
    let mut poses: Vec<Pose> = Vec::new();
    for &t in &times {
        let mut pose = rest.clone();
        let hips = named("hips");
        pose.locals[hips as usize].translation +=
            Vector3::new(0.0, -0.04 + 0.01 * (4.0 * std::f64::consts::PI * t).cos(), step * 2.0 * t / 2.0);
        let mut targets = Vec::new();
        for (foot, phase) in [("foot.L", 0.0), ("foot.R", 0.5)] {
            let foot = named(foot);
            // Of a second, half on the ground and half in the air.
            let cycle = t + phase;
            let (whole, part) = (cycle.floor(), cycle.fract());
            let swing = ((part - 0.5) / 0.5).clamp(0.0, 1.0);
            let eased = swing * swing * (3.0 - 2.0 * swing);
            let forward = step * (whole - phase + eased + 0.25);
            let lift = 0.12 * (std::f64::consts::PI * swing).sin().powi(2);
            let p = at[foot as usize] + Vector3::new(0.0, lift, forward);
            let target = |goal| crate::character::ik::Target { joint: foot, goal, weight: 1.0, chain: Some(2) };
            targets.push(target(crate::character::ik::Goal::Position { point: Point3::origin(), at: p }));
            targets.push(target(crate::character::ik::Goal::Orientation(UnitQuaternion::identity())));
        }
        for (arm, side) in [("arm.L", 1.0), ("arm.R", -1.0)] {
            let turn =
                UnitQuaternion::from_scaled_axis(Vector3::x() * (0.4 * side * (std::f64::consts::TAU * t).sin()));
            pose.locals[named(arm) as usize].rotation =
                turn * UnitQuaternion::from_scaled_axis(Vector3::z() * (-1.2 * side));
        }
        let turn = UnitQuaternion::from_scaled_axis(Vector3::y() * (0.2 * (std::f64::consts::TAU * t).sin()));
        pose.locals[named("chest") as usize].rotation = turn;
        let found = crate::character::ik::solve(
            skeleton,
            &pose,
            &targets,
            &crate::character::ik::IkOptions::default(),
            &Run::default(),
        );
        let found = found.expect("valid");
        assert!(found.residuals.iter().all(|r| *r < 1e-5), "{:?}", found.residuals);
        poses.push(found.pose);
    }
    sampling::clip("walk", skeleton, &times, &poses).expect("valid")
}

/// The rest pose with rotated joints becomes the new rest pose: a T-pose an A-pose.
fn with_rest(skeleton: &Skeleton, rotated: &[(&str, UnitQuaternion<f64>)]) -> Skeleton {
    let mut joints = skeleton.joints().to_vec();
    for (name, by) in rotated {
        joints[skeleton.named(name).expect("there") as usize].rest.rotation *= by;
    }
    Skeleton::new(joints).expect("valid")
}

/// Frames of joints rotated about their origins, positions kept: the convention of another program.
fn with_frames(skeleton: &Skeleton, turn: impl Fn(usize) -> UnitQuaternion<f64>) -> Skeleton {
    let mut joints = skeleton.joints().to_vec();
    for (j, joint) in joints.iter_mut().enumerate() {
        let above = joint.parent.map_or_else(UnitQuaternion::identity, |p| turn(p as usize));
        joint.rest.translation = above.inverse() * joint.rest.translation;
        joint.rest.rotation = above.inverse() * joint.rest.rotation * turn(j);
        joint.limits = None;
    }
    Skeleton::new(joints).expect("valid")
}

/// Lengths scaled by a factor for each joint, then the whole by a map.
fn scaled(skeleton: &Skeleton, factor: impl Fn(&str) -> f64, whole: f64, world: UnitQuaternion<f64>) -> Skeleton {
    let mut joints = skeleton.joints().to_vec();
    for joint in &mut joints {
        joint.rest.translation *= factor(&joint.name) * whole;
        if joint.parent.is_none() {
            joint.rest.translation = world * joint.rest.translation;
            joint.rest.rotation = world * joint.rest.rotation;
        }
    }
    Skeleton::new(joints).expect("valid")
}

fn renamed(skeleton: &Skeleton, name: impl Fn(usize, &str) -> String) -> Skeleton {
    let joints = skeleton.joints().iter().enumerate().map(|(k, j)| Joint { name: name(k, &j.name), ..j.clone() });
    Skeleton::new(joints.collect()).expect("valid")
}

/// With joints in the middle of bones: two more of the spine, and one in each forearm and thigh.
fn with_more_joints(skeleton: &Skeleton) -> Skeleton {
    let mut joints = skeleton.joints().to_vec();
    for name in ["chest", "neck", "forearm.L", "forearm.R", "hand.L", "hand.R", "shin.L", "shin.R"] {
        let k = skeleton.named(name).expect("there") as usize;
        let half = joints[k].rest.translation * 0.5;
        let number = joints.len() as u32;
        let twist = Joint {
            name: format!("extra {name}"),
            parent: joints[k].parent,
            rest: Trs::from_translation(half),
            limits: None,
        };
        joints[k].parent = Some(number);
        joints[k].rest.translation = half;
        joints.push(twist);
    }
    Skeleton::new(joints).expect("valid")
}

fn mixamo(_: usize, name: &str) -> String {
    let (base, side) = match name.split_once('.') {
        Some((base, "L")) => (base, "Left"),
        Some((base, _)) => (base, "Right"),
        None => (name, ""),
    };
    let part = match base {
        "hips" => "Hips",
        "spine" => "Spine",
        "chest" => "Spine1",
        "neck" => "Neck",
        "head" => "Head",
        "head end" => "HeadTop_End",
        "arm" => "Arm",
        "forearm" => "ForeArm",
        "hand" => "Hand",
        "hand end" => "Hand_End",
        "leg" => "UpLeg",
        "shin" => "Leg",
        "foot" => "Foot",
        "toes" => "ToeBase",
        other => other,
    };
    format!("mixamorig:{side}{part}")
}

fn about(axis: Vector3<f64>, angle: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(axis * angle)
}

fn carried(source: &Skeleton, clip: &Clip, target: &Skeleton) -> (Clip, RetargetingReport, Correspondence) {
    let run = Run::default();
    let map = Correspondence::find(source, target, &JointMap::default(), &run).expect("they correspond");
    let (clip, report) = retarget(source, clip, target, &map, &RetargetingOptions::default(), &run).expect("valid");
    (clip, report, map)
}

fn at(skeleton: &Skeleton, clip: &Clip, t: f64) -> Vec<Point3<f64>> {
    Frames::chained(skeleton, &clip.pose(skeleton, t, Extrapolation::Constant).expect("valid")).positions()
}

fn worst(a: &[Point3<f64>], b: &[Point3<f64>]) -> f64 {
    a.iter().zip(b).map(|(p, q)| nalgebra::distance(p, q)).fold(0.0, f64::max)
}

#[test]
fn a_motion_carried_to_its_own_skeleton_is_the_same() {
    let skeleton = free();
    let clips = person().clips;
    for clip in clips.iter().chain([&walk(&skeleton)]) {
        let (same, report, _) = carried(&skeleton, clip, &skeleton);
        assert!((report.scale - 1.0).abs() < 1e-12 && report.left_out.is_empty());
        for t in sampling::times(clip, 30.0).expect("short") {
            let off = worst(&at(&skeleton, &same, t), &at(&skeleton, clip, t));
            assert!(off < 1e-6, "{} at {t}: {off}", clip.name());
        }
    }
}

#[test]
fn names_frames_scale_and_axes_of_another_program_do_not_matter() {
    let skeleton = free();
    let clip = walk(&skeleton);
    let frames = |k: usize| about(Vector3::new(0.3, 1.0, -0.4), k as f64 * 0.7);
    let z_up = about(Vector3::x(), std::f64::consts::FRAC_PI_2);
    let other = with_frames(&renamed(&scaled(&skeleton, |_| 1.0, 100.0, z_up), mixamo), frames);
    let (found, report, map) = carried(&skeleton, &clip, &other);
    assert_eq!((map.by, report.followed), (MatchedBy::Names, 19), "all but the ends");
    for k in 0..=90 {
        let t = f64::from(k) / 30.0;
        let expected: Vec<_> = at(&skeleton, &clip, t).iter().map(|p| z_up * (p * 100.0)).collect();
        let off = worst(&at(&other, &found, t), &expected);
        assert!(off < 1e-4, "{off} of 175 at {t}");
    }
    // And back.
    let (back, ..) = carried(&other, &found, &skeleton);
    let off = worst(&at(&skeleton, &back, 1.3), &at(&skeleton, &clip, 1.3));
    assert!(off < 1e-6, "{off}");
}

#[test]
fn a_t_pose_and_an_a_pose_move_alike() {
    let skeleton = free();
    let clip = walk(&skeleton);
    let rest = [
        ("arm.L", about(Vector3::z(), -0.8)),
        ("arm.R", about(Vector3::z(), 0.8)),
        ("forearm.L", about(Vector3::y(), -0.3)),
    ];
    let other = with_rest(&skeleton, &rest);
    let (found, ..) = carried(&skeleton, &clip, &other);
    for k in 0..=90 {
        let t = f64::from(k) / 30.0;
        let off = worst(&at(&other, &found, t), &at(&skeleton, &clip, t));
        assert!(off < 1e-6, "{off} at {t}");
    }
}

#[test]
fn extra_joints_change_no_position_of_limbs() {
    let skeleton = free();
    let clip = walk(&skeleton);
    let other = with_more_joints(&skeleton);
    let (found, report, _) = carried(&skeleton, &clip, &other);
    assert_eq!(report.followed, skeleton.joint_count());
    for k in 0..=90 {
        let t = f64::from(k) / 30.0;
        let (a, b) = (at(&other, &found, t), at(&skeleton, &clip, t));
        for (joint, (p, q)) in skeleton.joints().iter().zip(a.iter().zip(&b)) {
            // The chest turns half between the joints of the spine.
            let limit = if joint.name.contains("arm") || joint.name.contains("hand") { 0.02 } else { 1e-6 };
            assert!((p - q).norm() < limit, "{} at {t}: {}", joint.name, (p - q).norm());
        }
    }
}

/// The length of a bone by the name of its joint.
type Factor = fn(&str) -> f64;

#[test]
fn feet_do_not_slide_on_other_proportions() {
    let skeleton = free();
    let clip = walk(&skeleton);
    let builds: [(&str, Factor); 4] = [
        (
            "long legs",
            |n| if n.starts_with("leg") || n.starts_with("shin") || n.starts_with("foot") { 1.4 } else { 1.0 },
        ),
        ("short legs", |n| if n.starts_with("shin") || n.starts_with("foot") { 0.6 } else { 1.0 }),
        ("long thighs", |n| {
            if n.starts_with("shin") {
                1.3
            } else if n.starts_with("foot") {
                0.8
            } else {
                1.0
            }
        }),
        ("wide hips and large feet", |n| {
            if n.starts_with("leg") {
                2.0
            } else if n.starts_with("toes") {
                1.8
            } else {
                1.0
            }
        }),
    ];
    for (name, factor) in builds {
        let mut other = scaled(&skeleton, factor, 1.0, UnitQuaternion::identity());
        // It stands on the ground.
        let low = other.rest_positions().iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
        let mut joints = other.joints().to_vec();
        joints[0].rest.translation.y += 0.05 - low;
        other = Skeleton::new(joints).expect("valid");
        let (_, report, _) = carried(&skeleton, &clip, &other);
        assert_eq!(report.feet.len(), 2);
        for foot in &report.feet {
            assert!(foot.contacts >= 3 && foot.slide < 2e-3 + foot.source_slide, "{name}: {foot:?}");
            assert!(foot.height < 0.06, "{name}: {foot:?}");
        }
        assert!(report.missed < 1e-3, "{name}: {}", report.missed);
    }
}

#[test]
fn skeletons_without_a_common_name_are_matched_by_shape() {
    let skeleton = free();
    let clip = walk(&skeleton);
    let other = renamed(
        &scaled(&skeleton, |n| if n.starts_with("arm") { 1.2 } else { 1.0 }, 3.0, UnitQuaternion::identity()),
        |k, _| format!("n{k}"),
    );
    let (found, report, map) = carried(&skeleton, &clip, &other);
    assert!(matches!(map.by, MatchedBy::Shape { .. }), "{:?}", map.by);
    let wrong: Vec<_> = map.source_of.iter().zip(0..).filter(|(i, j)| i.is_some_and(|i| i != *j)).collect();
    assert!(wrong.is_empty() && report.followed >= 18, "{wrong:?} {}", report.followed);
    let foot = skeleton.named("foot.L").expect("there") as usize;
    let off = (at(&other, &found, 1.2)[foot] - at(&skeleton, &clip, 1.2)[foot] * 3.0).norm();
    assert!(off < 0.05, "{off}");
}

#[test]
fn a_map_overrides_names_and_unknown_names_are_refused() {
    let skeleton = free();
    let other = renamed(&skeleton, |k, _| format!("n{k}"));
    let text = |joints: &str| format!(r#"{{"format": "plumbline.joint-map", "version": 1, "joints": {{{joints}}}}}"#);
    let map = JointMap::parse(&text(r#""n0": "hips", "n10": "leg.R", "n11": "shin.R", "n4": null"#), &skeleton, &other)
        .expect("valid");
    let found = Correspondence::find(&skeleton, &other, &map, &Run::default()).expect("three pairs");
    assert_eq!(found.source_of[10], Some(skeleton.named("leg.R").expect("there")));
    assert_eq!(found.source_of[4], None);
    let refused = |joints: &str| JointMap::parse(&text(joints), &skeleton, &other).expect_err("refused").to_string();
    assert_eq!(refused(r#""n99": "hips""#), "the target: there is no joint \"n99\"; did you mean \"n9\"?");
    assert!(
        refused(r#""n1": "hisp""#).starts_with("the source: there is no joint \"hisp\""),
        "{}",
        refused(r#""n1": "hisp""#)
    );
    let chain = |count: u32| {
        let joint =
            |k: u32| Joint { name: format!("q{k}"), parent: k.checked_sub(1), rest: Trs::identity(), limits: None };
        Skeleton::new((0..count).map(joint).collect()).expect("valid")
    };
    let large = Correspondence::find(&skeleton, &chain(2001), &JointMap::default(), &Run::default());
    assert!(large.expect_err("too large").to_string().starts_with("a skeleton of 2001 joints is too large"));
    let refused =
        Correspondence::find(&skeleton, &chain(5), &JointMap::default(), &Run::default()).expect_err("no limbs");
    assert!(refused.to_string().contains("do not correspond"), "{refused}");
}

#[test]
fn the_result_is_in_the_limits_of_the_target() {
    let skeleton = free();
    let clip = walk(&skeleton);
    let mut joints = skeleton.joints().to_vec();
    for name in ["arm.L", "shin.L", "shin.R", "leg.R"] {
        let k = skeleton.named(name).expect("there") as usize;
        joints[k].limits = Some(Limits::cone(Vector3::x_axis(), 0.5, 0.9));
    }
    let limited = Skeleton::new(joints).expect("valid");
    let (found, report, _) = carried(&skeleton, &clip, &limited);
    assert!(report.limited > 0.1);
    for k in 0..=90 {
        let pose = found.pose(&limited, f64::from(k) / 30.0, Extrapolation::Constant).expect("valid");
        for (joint, local) in limited.joints().iter().zip(&pose.locals) {
            let from_rest = joint.rest.rotation.inverse() * local.rotation;
            assert!(joint.limits.is_none_or(|l| l.allows(&from_rest, 1e-6)), "{}", joint.name);
        }
    }
}

#[test]
fn clips_that_are_too_long_are_refused() {
    let skeleton = free();
    let ends = [UnitQuaternion::identity(); 2];
    let keys = rotations(vec![0.0, 1e9], &ends, Interpolation::Linear).expect("valid");
    let clip = Clip::new("long", vec![Track { joint: 0, curve: Curve::Rotation(keys) }], Vec::new()).expect("valid");
    let map = Correspondence::find(&skeleton, &skeleton, &JointMap::default(), &Run::default()).expect("same");
    let refused = retarget(&skeleton, &clip, &skeleton, &map, &RetargetingOptions::default(), &Run::default());
    assert!(refused.expect_err("refused").to_string().contains("is too long"));
    let still = Clip::new("still", Vec::new(), Vec::new()).expect("valid");
    let (clip, _) =
        retarget(&skeleton, &still, &skeleton, &map, &RetargetingOptions::default(), &Run::default()).expect("valid");
    assert!(clip.tracks().is_empty());
}

#[test]
fn a_map_of_other_skeletons_is_refused() {
    let skeleton = humanoid(0.1).expect("valid").skeleton;
    for pair in [(9999, None), (0, Some(9999))] {
        let map = JointMap { pairs: vec![pair] };
        let refused = Correspondence::find(&skeleton, &skeleton, &map, &Run::default()).expect_err("no such joint");
        assert!(refused.to_string().contains("of other skeletons"), "{refused}");
    }
}
